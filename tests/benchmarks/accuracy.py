"""Largest errors of e_A on many scenes along the whole bat, against scipy's DOP853."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tests.benchmarks.rows import Row
from tests.benchmarks.scenes import BATS, WIDE, default_model, eight_modes, struck
from tests.simulation.collision.oracle import solve

__all__ = ["accuracy"]

PART = "accuracy: 4 bats, z 0.5-30 in, 20-180 mph, e0 0.3-0.8, exponent 1-2, against DOP853 1e-12"
SCENES, GOAL = 3000, 1e-7
MODELS = {"8 modes": eight_modes, "20 + residual": default_model}


def accuracy(scenes: int = SCENES, seed: int = 1) -> Iterator[Row]:
    """Yield the largest errors of e_A, the closure of energy, and the share of repeated scenes."""
    for label, model_of in MODELS.items():
        by_bat: dict[str, float] = {}
        errors, leaks, redone, counts = [], [], [], 0
        for number, bat in enumerate(BATS):
            model = model_of(bat)
            drawn = WIDE.draw(scenes // len(BATS), seed * len(BATS) + number)
            ours, true = model.collide(drawn), solve(struck(model, drawn))
            error = np.abs(ours.collision_efficiency - [one.efficiency for one in true])
            counts += int(np.sum(ours.contacts != [one.contacts for one in true]))
            by_bat[bat] = float(error.max())
            errors.append(error)
            leaks.append(np.abs(ours.energy.total - 1))
            redone.append(ours.redone)
        yield from _rows(label, by_bat, *map(np.concatenate, (errors, leaks, redone)), counts)


def _rows(
    what: str,
    by_bat: dict[str, float],
    errors: np.ndarray,
    leaks: np.ndarray,
    redone: np.ndarray,
    counts: int,
) -> Iterator[Row]:
    note = ", ".join(f"{bat} {error:.1e}" for bat, error in by_bat.items())
    largest = f"{what}: largest of {len(errors)}"
    yield Row(part=PART, what=largest, value=float(errors.max()), at_most=GOAL, note=note)
    value = float(np.quantile(errors, 0.999))
    yield Row(part=PART, what=f"{what}: 99.9 % below", value=value)
    yield Row(part=PART, what=f"{what}: scenes with another number of contacts", value=counts)
    yield Row(part=PART, what=f"{what}: energy that does not close", value=float(leaks.max()))
    shares = [f"{share:.2%}" for share in np.bincount(redone) / len(redone)]
    note = f"by number of repetitions: {', '.join(shares)}"
    value = 100 * float(np.mean(redone > 0))
    yield Row(part=PART, what=f"{what}: repeated", value=value, unit="%", note=note)
