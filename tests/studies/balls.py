"""Mean error of e0 and BPF in units of u, in all laboratories and where most balls are set aside.

    python -m tests.studies.balls LABORATORIES SEED OUT.CSV [PROCEDURE ...]

The bat is r161, or softball-34 for `asa`; instruments record only summary values. The seeds 6701
and 6702 were named before the first run. The quarter has the most balls set aside. The rows `mean
of all balls` have no estimator and no selection of balls: the mean measured e0 of the whole lot
minus its mean true e0. They show how far an error that all balls share is above zero where many
balls are set aside, because it helps to set them aside.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from math import sqrt
from pathlib import Path

import numpy as np

from virtual_lab import catalog
from virtual_lab.lab import BlockTest, RoundRobin
from virtual_lab.units import Array

WHOLE_LOT = "mean of all balls"
QUANTITIES = ("ball_restitution", "bat_performance_factor")


def errors(block: BlockTest) -> dict[str, Array]:
    """Return errors in units of u, and the number of balls set aside, of the sound tests."""
    certified = block.certified
    preparation, results = certified.reduced.preparation, certified.results
    columns = {
        name: (results[name].value - block.measurands[name])
        / np.where(certified.sound, results[name].u, np.nan)
        for name in QUANTITIES
    }
    balls, lot = block.laboratory.specimen.balls, preparation.lot
    line, speed = balls.spec.restitution, lot.speed[:, 0, 0]
    true = balls.restitution.mean(axis=1) + line.slope * (speed - line.speed)
    sound, u = certified.sound, results["ball_restitution"].u
    columns[WHOLE_LOT] = (lot.restitution[:, 0].mean(axis=1) - true) / np.where(sound, u, np.nan)
    columns["set aside"] = (~preparation.used[:, 0]).sum(axis=1)
    return {name: values[sound] for name, values in columns.items()}


def rows(procedure: str, laboratories: int, seed: int) -> Iterator[dict[str, object]]:
    bat = "softball-34" if procedure == "asa" else "r161"
    parts = [*RoundRobin.of(bat, procedure).each_block(errors, laboratories, seed)]
    columns = {name: np.concatenate([each[name] for each in parts]) for name in parts[0]}
    aside = columns.pop("set aside")
    quarter = np.argsort(-aside, kind="stable")[: aside.size // 4]
    for name, z in columns.items():
        yield {
            **{"procedure": procedure, "seed": seed, "quantity": name, "laboratories": z.size},
            **{"mean_z": z.mean(), "mean_z_se": z.std() / sqrt(z.size), "sd_z": z.std()},
            **{"quarter_set_aside": aside[quarter].mean(), "quarter_z": z[quarter].mean()},
            "quarter_z_se": z[quarter].std() / sqrt(quarter.size),
        }


def main(laboratories: str, seed: str, path: str, *procedures: str) -> None:
    table = [
        row
        for procedure in procedures or catalog.names("procedures")
        for row in rows(procedure, int(laboratories), int(seed))
    ]
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, table[0])
        writer.writeheader()
        for row in table:
            writer.writerow({k: f"{v:.4f}" if isinstance(v, float) else v for k, v in row.items()})


if __name__ == "__main__":
    main(*sys.argv[1:])
