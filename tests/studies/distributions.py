"""JCGM 101 and first order in the same tests: intervals that hold the true value.

    python -m tests.studies.distributions tests TESTS ENDS.CSV [PROCEDURE …]
    python -m tests.studies.distributions table ENDS.CSV OUT.CSV

20 000 draws per test by numpy of the whole measurement model: constants and scatter of the hits,
normal or t, and the interval of equal tails. The first command adds the ends of the intervals of
each test to a file and continues at its end, the procedures in turn; the second counts them.
Fractions have Clopper-Pearson intervals. The bat is r161, or softball-34 for `asa`.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from virtual_lab.lab import RoundRobin
from virtual_lab.measurement.alternatives.refined import low_dof_source, model_of

DRAWS, SEED = 20_000, 1
SHARE = 20  # tests per procedure before the next procedure
PROCEDURES = ("astm-f1881", "asa", "bbcor", "proposed", "ncaa-besr", "ncaa-modified")
ENDS = ("true", "first_low", "first_high", "draws_low", "draws_high")


def intervals(rules: RoundRobin, first: int, tests: int) -> list[list[float]]:
    """Return number, true value and both intervals of each test with a result."""
    rows = []
    for block in rules.blocks(tests, SEED, first):
        for at in np.flatnonzero(block.certified.sound).tolist():
            rng = np.random.default_rng([SEED, first + at])
            linear = block.certified.results["metric"].row(at)
            true = block.measurands["metric"][at]
            row = [first + at, true, *linear.interval_95]
            if low_dof_source(linear):  # smallest degrees of freedom for draws, as on a certificate
                rows.append([*row, *linear.interval_95])
                continue
            own = block.of(at).certification
            reduced = block.certified.reduced.row(at)
            model, inputs = model_of(reduced, own.readings, own.hit_weights, linear)
            drawn = {}
            for name, each in inputs.items():
                finite = np.isfinite(each.dof)
                error = rng.standard_t(each.dof, DRAWS) if finite else rng.standard_normal(DRAWS)
                drawn[name] = each.value + each.u * error
            ends = np.quantile(model(**drawn), [0.025, 0.975])
            rows.append([*row, *ends.tolist()])
    return rows


def run(tests: int, path: Path, procedures: tuple[str, ...]) -> None:
    done = dict.fromkeys(procedures, 0)
    if path.exists():
        for row in read(path):
            done[row["procedure"]] = int(row["number"]) + 1
    bats = {"asa": "softball-34"}
    rules = {name: RoundRobin.of(bats.get(name, "r161"), name) for name in procedures}
    with path.open("a", encoding="utf-8", newline="") as file:
        out = csv.writer(file)
        if not file.tell():
            out.writerow(["procedure", "number", *ENDS])
        for first in range(0, tests, SHARE):
            for name in procedures:
                if first >= done[name]:
                    out.writerows([name, *row] for row in intervals(rules[name], first, SHARE))
                    file.flush()


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


def table(ends: Path, path: Path) -> None:
    every = read(ends)
    with path.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file)
        ways = [f"{way}_{what}" for way in ("first", "draws") for what in ("held", "low", "high")]
        out.writerow(
            ["procedure", "tests", *ways, "only_first", "only_draws", "not_drawn", "length_ratio"]
        )
        for procedure in dict.fromkeys(row["procedure"] for row in every):
            own = [row for row in every if row["procedure"] == procedure]
            numbers = [[float(row[key]) for key in ENDS] for row in own]
            out.writerow([procedure, len(own), *counted(numbers)])


def counted(rows: list[list[float]]) -> list[Any]:
    true, *ends = np.array(rows).T
    row: list[Any] = []
    held = [(low <= true) & (true <= high) for low, high in (ends[:2], ends[2:])]
    for each in held:
        band = binomtest(int(each.sum()), true.size).proportion_ci(0.95, method="exact")
        row += [f"{x:.4f}" for x in (each.mean(), band.low, band.high)]
    first, draws = held
    ratio = float(np.median((ends[3] - ends[2]) / (ends[1] - ends[0])))
    apart = [int(mask.sum()) for mask in (first & ~draws, draws & ~first, ends[0] == ends[2])]
    return [*row, *apart, f"{ratio:.4f}"]


if __name__ == "__main__":
    if sys.argv[1] == "tests":
        run(int(sys.argv[2]), Path(sys.argv[3]), tuple(sys.argv[4:]) or PROCEDURES)
    else:
        table(Path(sys.argv[2]), Path(sys.argv[3]))
