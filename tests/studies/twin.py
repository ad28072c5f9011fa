"""Laboratories beside their twins: readings pointed at, and u over the errors of the days.

    python -m tests.studies.twin sound PROCEDURE LABORATORIES OUT.CSV
    python -m tests.studies.twin faulty PROCEDURE LABORATORIES OUT.CSV
    python -m tests.studies.twin known PROCEDURE LABORATORIES
    python -m tests.studies.twin table ONE.CSV … OUT.CSV

One row per laboratory: tail probability of each reading, number of full days, the readings unlike
their twins, and the stated u of the metric over the standard deviation of 1 000 summed days. In the
laboratories of `faulty` each fault of the catalog that the rigs can have takes its turn, in the
smallest of the sizes `SIZES` with which it moves the metric by at least 3 u against the same day
without it; faults that never do so have no row. The bat is an individual r161, or softball-34 for
asa. A study that was cut goes on behind the rows that its file has. The twin sees records only.
`known` prints the standard deviation on days of twins, over that of errors of 4 000 laboratories.
`table` joins the files, and prints the tables of the page.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

import virtual_lab as vl
from tests.laboratories import certify, setup_of
from virtual_lab.errors import InputError
from virtual_lab.lab import certify_bat
from virtual_lab.measurement.certification import Certification
from virtual_lab.simulation.faults import CATALOGUE, FaultSet, faults_at
from virtual_lab.simulation.faults.size import resize
from virtual_lab.studies.twin.days import TwinDays
from virtual_lab.studies.twin.quantities import compare_quantities
from virtual_lab.studies.twin.readings import TWIN_READINGS, differing_readings
from virtual_lab.studies.twin.statement import Statement

SEED = 8_200_000
SIZES = (0.5, 1.0, 2.0, 4.0, 8.0)  # sizes of a fault [its size in the catalog]
MOVED = 3.0  # smallest shift of the metric by a fault [u]
DAYS = 250  # largest number of full days
FIELDS = (
    *("procedure", "laboratory", "fault", "size", "shift", "verdict"),
    *("ratio", "days", *TWIN_READINGS, "unlike"),
)


def join(*paths: Path) -> None:
    *parts, out = paths
    rows = [row for part in parts for row in csv.DictReader(part.open())]
    with out.open("w", newline="") as file:
        table = csv.DictWriter(file, FIELDS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    print("\n".join(lines_of(rows)))


def lines_of(rows: list[dict[str, str]]) -> list[str]:
    """Return the lines of the page: sound laboratories by procedure, faulty ones by fault."""
    lines, refused = [], [row["unlike"].startswith("refused") for row in rows]
    unlike = [bool(row["unlike"]) and not each for row, each in zip(rows, refused, strict=True)]
    for procedure in dict.fromkeys(row["procedure"] for row in rows):
        own = [
            at for at, row in enumerate(rows) if (row["procedure"], row["fault"]) == (procedure, "")
        ]
        played = [rows[at] for at in own if not refused[at]]
        ratio, days = (np.array([float(row[key]) for row in played]) for key in ("ratio", "days"))
        tails = np.array([float(row[key]) for row in played for key in TWIN_READINGS if row[key]])
        cells = (
            f"`{procedure}`",
            len(own),
            f"{np.median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f})",
            f"{np.median(days):.0f} ({days.max():.0f})",
            len(tails),
            np.sum(tails <= 0.05),
            np.sum(tails <= 0.1),
            sum(unlike[at] for at in own),
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    for fault in sorted({row["fault"] for row in rows} - {""}):
        own = [at for at, row in enumerate(rows) if row["fault"] == fault]
        sizes = sorted({float(rows[at]["size"]) for at in own})
        cells = (
            fault,
            len(own),
            f"{sizes[0]:g}" if len(sizes) == 1 else f"{sizes[0]:g} to {sizes[-1]:g}",
            sum(rows[at]["verdict"].startswith("INVALID") for at in own),
            sum(unlike[at] for at in own),
            sum(refused[at] for at in own),
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return lines


def main(kind: str, procedure: str, laboratories: int, out: Path) -> None:
    done = list(csv.DictReader(out.open())) if out.exists() else []
    bat = "softball-34" if procedure == "asa" else "r161"
    with out.open("a", newline="") as file:
        table = csv.DictWriter(file, FIELDS, lineterminator="\n")
        if not done:
            table.writeheader()
        tests = sound(bat, procedure, laboratories, len(done))
        if kind == "faulty":
            tests = faulty(bat, procedure, laboratories, done)
        for about, certification in tests:
            about |= {"procedure": procedure}
            table.writerow(about | beside_its_twin(certification, about["laboratory"]))
            file.flush()


def sound(
    bat: str, procedure: str, laboratories: int, first: int
) -> Iterator[tuple[dict[str, Any], Certification]]:
    """Yield sound laboratories with their columns."""
    for number in range(first, laboratories):
        tested = certify(bat, procedure=procedure, seed=SEED, number=number)
        yield {"laboratory": number}, tested.certification


def faulty(
    bat: str, procedure: str, laboratories: int, done: list[dict[str, str]]
) -> Iterator[tuple[dict[str, Any], Certification]]:
    """Yield laboratories with a fault that moves their metric far enough, with their columns."""
    setup = setup_of(bat, procedure=procedure, seed=SEED)
    names = faults_at(setup.rig)
    last = int(done[-1]["laboratory"]) if done else -1
    found = len(done)
    for number, name in enumerate(cycle(names)):
        if found == laboratories or number > 20 * laboratories:
            return
        if number <= last:
            continue
        about = {"procedure": procedure, "seed": SEED, "number": number}
        plain = certify(bat, **about).certification.metric
        for size in SIZES:
            faults = FaultSet(faults=(resize(CATALOGUE[name], size),))
            try:
                tested = certify_bat(replace(setup_of(bat, **about), faults=faults)).certification
            except InputError:  # records that the reduction refuses
                continue
            if plain is None or tested.metric is None:
                continue
            shift = (tested.metric.value - plain.value) / plain.u
            if abs(shift) >= MOVED:
                found += 1
                columns = {"fault": name, "size": size, "shift": f"{shift:+.1f}"}
                yield columns | {"laboratory": number}, tested
                break


def known(procedure: str, laboratories: int) -> float:
    """Return the standard deviation of the metric on days of twins, divided by the known one.

    The first is the rms over the twins of laboratories with the sheets of the catalog, the second
    that of the errors of 4 000 such laboratories.
    """
    study = vl.coverage("r161", procedure=procedure, summed=True, laboratories=4000, seed=SEED)
    metric = study.table.iloc[0]
    variances = []
    for _, certification in sound("r161", procedure, laboratories, 0):
        playing = TwinDays.fit(Statement.of(certification), SEED)
        (row, *_), _ = compare_quantities(certification, playing, 1000)
        variances.append(row.error_sd**2)
    return float(np.sqrt(np.mean(variances) / (metric.rms_error**2 - metric.bias**2)))


def beside_its_twin(certification: Certification, seed: int) -> dict[str, Any]:
    """Return the columns of a laboratory that compare it with its twin."""
    shown = f"{certification.verdict.value}{' and flags' if certification.flags else ''}"
    try:
        playing = TwinDays.fit(Statement.of(certification), seed)
        (metric, *_), _ = compare_quantities(certification, playing, 1000)
        with np.errstate(all="ignore"):
            rows, days = differing_readings(certification, playing, DAYS)
    except InputError as refusal:
        return {"verdict": shown, "unlike": f"refused: {refusal}"}
    tails = {row.reading: f"{row.tail_probability:.4f}" for row in rows}
    unlike = "; ".join(row.reading for row in rows if row.finding)
    return {
        "verdict": shown,
        "ratio": f"{metric.u_ratio:.3f}",
        "days": days,
        "unlike": unlike,
    } | tails


if __name__ == "__main__":
    if sys.argv[1] == "table":
        join(*map(Path, sys.argv[2:]))
    elif sys.argv[1] == "known":
        print(known(sys.argv[2], int(sys.argv[3])))
    else:
        main(sys.argv[1], sys.argv[2], int(sys.argv[3]), Path(sys.argv[4]))
