"""Largest errors of e_A on very many scenes, including second contacts and grazing releases."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.rows import Row
from tests.benchmarks.scenes import BATS, WIDE, default_model, eight_modes
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.collision.stepping import FINE, OneByOne

__all__ = ["accuracy"]

Floats = NDArray[np.float64]
PART = "accuracy: 4 bats, z 0.5-30 in, 20-180 mph, e0 0.3-0.8, exponent 1-2, against one by one"
SCENES, CHECKED = 120_000, 10
MODELS = {"8 modes": eight_modes, "20 + residual": default_model}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """Errors of one bat and model."""

    errors: Floats
    closure: Floats
    redone: NDArray[np.int64]


def accuracy(scenes: int = SCENES, seed: int = 1) -> Iterator[Row]:
    """Yield the largest errors of e_A, the closure of energy, and the shares of repeated scenes."""
    yield from _one_by_one(seed)
    for label, of in MODELS.items():
        results = [
            _compare(of(bat), WIDE.draw(scenes // len(BATS), seed * len(BATS) + number))
            for number, bat in enumerate(BATS)
        ]
        yield from _rows(f"FINE, {label}", results)


def _one_by_one(seed: int) -> Iterator[Row]:
    """Yield the differences of the exact steps from the reference and from finer steps."""
    gaps: dict[str, list[float]] = {"the reference": [], "itself, four times finer": []}
    for number, bat in enumerate(BATS):
        model, scenes = eight_modes(bat), WIDE.draw(CHECKED, 1000 + seed * len(BATS) + number)
        ours = replace(model, stepper=OneByOne()).collide(scenes)
        others = (
            ReferenceModel(modes=model.modes),
            replace(model, stepper=OneByOne(refinement=4)),
        )
        for differences, other in zip(gaps.values(), others, strict=True):
            gap = ours.collision_efficiency - other.collide(scenes).collision_efficiency
            differences.append(float(np.abs(gap).max()))
    for against, differences in gaps.items():
        what, note = f"one by one against {against}", f"{CHECKED * len(BATS)} scenes, 8 modes"
        yield Row(part=PART, what=what, value=max(differences), note=note)


def _compare(model: ModalModel, scenes: Scenes) -> _Found:
    exact = replace(model, stepper=OneByOne()).collide(scenes).collision_efficiency
    ours = model.collide(scenes)
    return _Found(
        errors=np.abs(ours.collision_efficiency - exact),
        closure=np.abs(ours.energy.total - 1),
        redone=ours.redone,
    )


def _rows(what: str, results: list[_Found]) -> Iterator[Row]:
    errors = np.concatenate([run.errors for run in results])
    redone = np.bincount(np.concatenate([run.redone for run in results]), minlength=4) / len(errors)
    by_bat = ", ".join(
        f"{bat} {run.errors.max():.1e}" for bat, run in zip(BATS, results, strict=True)
    )
    aim = FINE.tolerance
    yield Row(
        part=PART,
        what=f"{what}: largest of {len(errors)}",
        value=float(errors.max()),
        at_most=aim,
        note=by_bat,
    )
    value = float(np.quantile(errors, 0.999))
    above = f"{np.count_nonzero(errors > aim)} above {aim:g}"
    yield Row(part=PART, what=f"{what}: 99.9 % below", value=value, note=above)
    closure = max(float(run.closure.max()) for run in results)
    yield Row(part=PART, what=f"{what}: energy that does not close", value=closure)
    finer, finest, single = redone[1:]
    yield Row(
        part=PART,
        what=f"{what}: first try did",
        value=float(redone[0] * 100),
        unit="%",
        note=f"second {finer:.3%}, third {finest:.3%}, one by one {single:.3%}",
    )
