"""Planned beside simulated u of 20 plans that are drawn at random from all candidates.

``python -m tests.studies.plan OUT.CSV [TESTS]`` writes one row per plan, with 5 000 tests each by
default. It takes some minutes of processor time.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from virtual_lab.lab.setup import TestSetup
from virtual_lab.output.metrics import METRICS
from virtual_lab.studies.plan.laboratory import PlannedLaboratory, better_instruments

CASES = (
    ("astm-f1881", "r161"),
    ("astm-f1881", "ea70"),
    ("bbcor", "r161"),
    ("bbcor", "ea70"),
    ("asa", "softball-34"),
    ("asa", "softball-wood-34"),
    ("ncaa-besr", "r161"),
    ("ncaa-besr", "ea70"),
    ("ncaa-modified", "ea70"),
    ("proposed", "r161"),
)
PLANS = 2  # plans per case
SEED = 11


def rows_of(
    procedure: str, bat: str, tests: int, rng: np.random.Generator
) -> list[dict[str, object]]:
    """Return planned and simulated u of plans of one bat by one procedure."""
    rigs = TestSetup.of(bat, procedure=procedure).rigs.values()
    laboratory = PlannedLaboratory.of(bat, procedure, better_instruments(rigs), SEED, 1)
    grid = laboratory.forecast.present.grid
    u = laboratory.predict_u(grid)
    size = METRICS[laboratory.forecast.rules.metric].unit_si
    rows: list[dict[str, object]] = []
    for at in rng.permutation(np.argwhere(np.isfinite(u)))[:PLANS]:
        counts = grid.at(tuple(at[1:].tolist()))
        exchanged = laboratory.exchange_names(int(at[0]))
        sample = laboratory.simulate(exchanged, counts, tests)
        value, error = sample.median_u
        planned = float(u[tuple(at)])
        rows.append(
            {
                "procedure": procedure,
                "bat": bat,
                "exchanged": ", ".join(exchanged) or "none",
                **dict(
                    zip(("hits", "final_hits", "balls", "wall_hits"), counts.values, strict=True)
                ),
                "planned_u": f"{planned / size:.6g}",
                "simulated_u": f"{value / size:.6g}",
                "simulated_u_se": f"{error / size:.2g}",
                "ratio": f"{value / planned:.4f}",
                "tests": tests,
                "invalid": int(sample.invalid.sum()),
                "shots_planned": f"{float(laboratory.forecast.shots(counts)):.1f}",
                "shots": f"{sample.shots.mean():.1f}",
            }
        )
    return rows


def main(path: Path, tests: int = 5000) -> None:
    """Write the table of all cases into a new file."""
    rng, rows = np.random.default_rng(SEED), list[dict[str, object]]()
    for procedure, bat in CASES:
        rows += rows_of(procedure, bat, tests, rng)
        print(*rows[-PLANS:], sep="\n", flush=True)
    pd.DataFrame(rows).to_csv(path, index=False, lineterminator="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
