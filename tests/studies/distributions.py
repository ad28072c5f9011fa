"""JCGM 101 beside the first order in the same tests: which intervals hold the true value.

    python -m tests.studies.distributions TESTS OUT.CSV [PROCEDURE …]

20 000 draws a test by numpy, of its whole measurement model: constants and the scatter of its hits,
normal or t, and the interval of equal tails. Intervals of Clopper and Pearson. Of r161; softball-34
for `asa`.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from virtual_lab.lab import RoundRobin
from virtual_lab.measurement.refined import model_of

DRAWS, SEED = 20_000, 1
PROCEDURES = ("astm-f1881", "asa", "bbcor", "proposed", "ncaa-besr", "ncaa-modified")


def intervals(procedure: str, tests: int) -> np.ndarray:
    """Return true value and both intervals of each test with a result, (test, 5)."""
    bat = "softball-34" if procedure == "asa" else "r161"
    rng, rows = np.random.default_rng(SEED), []
    for block in RoundRobin.of(bat, procedure).blocks(tests, SEED):
        for number in np.flatnonzero(block.certified.some & ~block.certified.invalid):
            linear = block.certified.results["metric"].of(int(number))
            model, inputs = model_of(
                block.reduced.of(int(number), block.readings),
                linear,
                float(block.certified.variances["metric"].dof[number]),
            )
            drawn = {}
            for name, each in inputs.items():
                finite = np.isfinite(each.dof)
                error = rng.standard_t(each.dof, DRAWS) if finite else rng.standard_normal(DRAWS)
                drawn[name] = each.value + each.u * error
            ends = np.quantile(model(**drawn), [0.025, 0.975])
            rows.append([block.measurands["metric"][number], *linear.interval_95, *ends])
    return np.array(rows)


def main(tests: str, path: str, *procedures: str) -> None:
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file)
        ways = [f"{way}_{what}" for way in ("first", "draws") for what in ("held", "low", "high")]
        out.writerow(["procedure", "tests", *ways, "only_first", "only_draws", "length_ratio"])
        for procedure in procedures or PROCEDURES:
            true, *ends = intervals(procedure, int(tests)).T
            row: list[str] = []
            held = [(low <= true) & (true <= high) for low, high in (ends[:2], ends[2:])]
            for each in held:
                band = binomtest(int(each.sum()), true.size).proportion_ci(0.95, method="exact")
                row += [f"{x:.4f}" for x in (each.mean(), band.low, band.high)]
            first, draws = held
            ratio = float(np.median((ends[3] - ends[2]) / (ends[1] - ends[0])))
            apart = [int((first & ~draws).sum()), int((draws & ~first).sum())]
            out.writerow([procedure, true.size, *row, *apart, f"{ratio:.4f}"])
            file.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
