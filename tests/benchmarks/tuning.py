"""Effects of the constants of the default stepper: ``python -m tests.benchmarks.tuning``.

Each constant is varied on random scenes of two bats, and compared with steps twelve times shorter.
The table has the largest error of e_A, the share of repeated scenes and the steps per pass; it is
that of `virtual_lab/simulation/collision/README.md`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tests.benchmarks.scenes import WIDE, default_model, struck
from virtual_lab.simulation.collision.stepping import (
    STEPPER,
    CollisionBatch,
    FinalStates,
    Stepper,
)

SCENES, SEED = 6000, 11
VALUES = {
    "mode_step": (1.6, 2.0, 2.8, 3.1),
    "ball_step": (0.2, 0.3, 0.7, 1.0),
    "flight_step": (0.2, 0.4, 0.9, 1.5),
    "rough": (0.0, 1.5, 3.0, 5.0),
}
Batch = tuple[CollisionBatch, FinalStates]


def main() -> None:
    """Print one line per value."""
    batches = list(_batches())
    print(f"{'':22s}{'largest':>12s}{'again':>8s}{'steps':>7s}")
    _print("as it is", STEPPER, batches)
    for name, values in VALUES.items():
        for value in values:
            _print(f"{name} {value:g}", replace(STEPPER, **{name: value}), batches)


def _batches() -> Iterator[Batch]:
    for bat in ("r161", "ea70"):
        batch = struck(default_model(bat), WIDE.draw(SCENES, SEED))
        yield batch, STEPPER.refine(12.0).follow(batch)


def _print(name: str, stepper: Stepper, batches: list[Batch]) -> None:
    worst, again, steps = 0.0, [], []
    for batch, exact in batches:
        gap = np.abs(batch.efficiency_gap(stepper.follow(batch), exact))
        worst = max(worst, float(gap[exact.failure == 0].max()))
        once, doubted = stepper.one_pass(batch)
        again.append(doubted.mean())
        steps.append(once.steps.mean())
    print(f"{name:22s}{worst:12.1e}{np.mean(again):8.1%}{np.mean(steps):7.1f}", flush=True)


if __name__ == "__main__":
    main()
