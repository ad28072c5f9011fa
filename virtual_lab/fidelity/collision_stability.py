"""Maps of the conditions under which the integration of the modal model is accurate.

A cell consists of a few collisions with a wooden and a hollow bat, integrated in a single pass
without repeats. The reference of e_A has the same modes and is integrated with finer steps. The
step is stated as a factor on the default steps of modes and ball. One more line of each map shows
the default integration, which repeats doubtful collisions. A column without a reference result
stays empty.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache, partial
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.fidelity.collision_chart import usual_ball
from virtual_lab.fidelity.drawing import State, draw_maps, maps_text
from virtual_lab.fidelity.results import StabilityMap
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.collision.modal import BENDING_MODES, ModalModel, collide_bats
from virtual_lab.simulation.collision.scene import Collisions, Failure, Scenes
from virtual_lab.simulation.collision.stepping import (
    STAYS,
    STEPPER,
    WINDOW,
    CollisionBatch,
    FinalStates,
    Stepper,
)
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned, Support
from virtual_lab.streams import Streams
from virtual_lab.units import INCH, MPH, Array, Mask

Column = list[tuple[ModalModel, Scenes]]  # input of `collide_bats`
FACTORS = (0.25, 0.5, 0.7, 0.85, 1.0, 1.15, 1.3, 1.5, 2.0, 3.0, 3.5, 4.0)
SHIPPED = "as shipped"  # name of the line of the default, instead of a factor
PLACES_IN, SPEEDS_MPH = (1.0, 4.0, 6.5, 10.0, 16.0, 24.0), (60.0, 160.0)
SUPPORTS: dict[str, Support] = {
    "free": Free(),
    "pinned 28 in": Pinned(28 * INCH),
    "spring of 1e6 N/m at 28 in": Pinned(28 * INCH, 1e6),
    "clamped 33 in": Clamped(33 * INCH),
    "clamped 25 in": Clamped(25 * INCH),
}
POOLED_SCENES = 3000  # number of scenes from which those with several contacts are selected


class CollisionAxis(StrEnum):
    """Quantity that varies across a map."""

    MODES = "bending modes"
    PLACE = "impact position from the tip [in]"
    SPEED = "relative speed [mph]"
    STIFFNESS = "stiffness of the ball / usual stiffness"
    EXPONENT = "exponent of the ball's force law"
    RESTITUTION = "e0 of the ball"
    MASS = "mass of the ball / usual mass"
    SUPPORT = "support of the bat"
    CONTACTS = "number of contacts"


AXES: dict[CollisionAxis, tuple[Any, ...]] = {
    CollisionAxis.MODES: (4, 6, 8, 10, 14, 20, 26, 32, 40),
    CollisionAxis.PLACE: (0.5, 1, 2, 3, 4.5, 6, 8, 11, 15, 20, 25, 30),
    CollisionAxis.SPEED: (0.1, 0.3, 1, 3, 10, 30, 60, 90, 120, 160, 200),
    CollisionAxis.STIFFNESS: (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100),
    CollisionAxis.EXPONENT: (1, 1.1, 1.25, 1.5, 1.75, 2, 2.5, 3),
    CollisionAxis.RESTITUTION: (0.005, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1),
    CollisionAxis.MASS: (0.01, 0.1, 0.3, 0.6, 1, 2, 5, 10, 30, 100),
    CollisionAxis.SUPPORT: tuple(SUPPORTS),
    CollisionAxis.CONTACTS: (1, 2, 3, 4, 5, 6),
}


class OnePass(Stepper):
    """A stepper that makes only the first pass and accepts every result."""

    def follow(self, struck: CollisionBatch, window: float = WINDOW) -> FinalStates:
        """Return the states after one pass; `redone` is 1 for a doubtful, 2 for a failed scene."""
        final, doubtful = self.one_pass(struck, window)
        failed = final.failure != Failure.SOUND
        redone = doubtful.astype(np.int64) + failed
        return replace(final, redone=redone, failure=np.zeros_like(redone))


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnOutcome:
    """Results of all scenes of a column, arrays of shape (scene,)."""

    efficiency: Array
    leak: Array  # error of the energy balance [share of the energy]
    doubted: Mask  # scenes that the default would repeat
    failed: Mask  # scenes without an energy balance, or in which a contact did not end

    @classmethod
    def of(cls, parts: list[Collisions]) -> ColumnOutcome:
        def whole(part: Any) -> Any:
            return np.concatenate([part(each) for each in parts])

        return cls(
            efficiency=whole(lambda each: each.collision_efficiency),
            leak=whole(lambda each: np.abs(each.energy.total - 1)),
            doubted=whole(lambda each: each.redone > 0),
            failed=whole(lambda each: each.redone > 1),
        )


def collision_stability(progress: Progress = quiet) -> StabilityMap:
    """Return maps of the accuracy of the modal model, one row per cell of a map.

    One axis of a map is a quantity of `CollisionAxis`, such as the relative speed. The other axis
    is the time step divided by the default step. A cell summarizes a few collisions. A row states:

    * the two coordinates of its cell;
    * the state of the cell, a value of `State`, such as ``good`` or ``unstable``;
    * the largest errors of e_A and of the energy balance (relative to the energy), None if an error
      is not finite or the cell has no result;
    * the number of collisions, the number with a large error of e_A (``off``), and the number that
      the default integration would repeat (``doubted``);
    * whether at least one collision has no energy balance or no end (``refused``).
    """
    rows = []
    for axis, values in AXES.items():
        progress(axis)
        columns = [_column(axis, value) for value in values]
        exact = [_exact(column) for column in columns]
        for step, stepper in _steppers():
            for value, column, true in zip(values, columns, exact, strict=True):
                outcome = _outcome(column, stepper) if true else None
                row = {"map": axis.value, "value": value, "step": step}
                rows.append(row | _cell(outcome, true, step == SHIPPED))
    down = "step / default step"
    title = (
        "Integration of the modal model: up to 24 scenes per cell in one pass, and as shipped; "
        f"good: error of e_A at most {STAYS:.0e}; numbers: scenes with a larger error"
    )
    return StabilityMap(
        title="stability of the collision",
        text=f"rows: {down}; {maps_text(rows, State, ('step',))}",
        rows=rows,
        picture=partial(draw_maps, title=title, states=State, down=down, framed="1"),
    )


def _steppers() -> Iterator[tuple[str, Stepper]]:
    """Yield the name of each stepper, and the stepper."""
    for factor in FACTORS:
        yield f"{factor:g}", OnePass().refine(1 / factor)
    yield SHIPPED, STEPPER


def _column(axis: CollisionAxis, value: Any) -> Column:
    """Return the bats and scenes of one column, in which one quantity has the given value."""
    if axis is CollisionAxis.CONTACTS:
        return _meeting(int(value))
    ball = usual_ball()
    several = axis in (CollisionAxis.PLACE, CollisionAxis.SPEED)
    exponents = (value,) if axis is CollisionAxis.EXPONENT else (1.0, 1.5) if several else (1.0,)
    many = (20.0, 45.0, 70.0, 95.0, 120.0, 160.0)
    speeds = (
        (value,)
        if axis is CollisionAxis.SPEED
        else many
        if axis is CollisionAxis.PLACE
        else SPEEDS_MPH
    )
    places = (value,) if axis is CollisionAxis.PLACE else PLACES_IN
    grid = np.meshgrid(np.array(places) * INCH, np.array(speeds) * MPH, exponents)
    place, speed, exponent = (each.ravel() for each in grid)
    scenes = Scenes.with_ball(ball, impact_position=place, relative_speed=speed)
    # every exponent gives the same force at a compression of 12 mm
    stiffness = ball.stiffness * 0.012 ** (ball.exponent - exponent)
    scenes = replace(scenes, exponent=exponent, stiffness=stiffness)
    if axis is CollisionAxis.STIFFNESS:
        scenes = replace(scenes, stiffness=value * stiffness)
    if axis is CollisionAxis.MASS:
        scenes = replace(scenes, ball_mass=value * scenes.ball_mass)
    if axis is CollisionAxis.RESTITUTION:
        scenes = replace(scenes, ball_restitution=np.full(len(scenes), value))
    count = int(value) if axis is CollisionAxis.MODES else BENDING_MODES
    support = value if axis is CollisionAxis.SUPPORT else "free"
    return [(_model(bat, support, count), scenes) for bat in ("r161", "ea70")]


def _meeting(contacts: int) -> Column:
    """Return the column of scenes in which ball and bat have this number of contacts."""
    column = []
    for bat in ("r161", "ea70"):
        pool, met = _pool(bat)
        selected = np.flatnonzero(met == contacts)[: len(PLACES_IN) * len(SPEEDS_MPH)]
        column.append((_model(bat, "free", BENDING_MODES), pool.part(selected)))
    return column


@cache
def _pool(bat: str) -> tuple[Scenes, NDArray[np.int64]]:
    """Return scenes along a whole bat with stiff balls, and the number of contacts of each scene.

    The balls are up to 100 times as stiff as usual, so that some scenes have several contacts.
    """
    ball = usual_ball()
    draws, (slow, fast) = Streams(5), SPEEDS_MPH
    names = ("z", "speed", "harder")
    place, speed, harder = (draws.uniform(name, POOLED_SCENES) + 0.5 for name in names)
    usual = Scenes.with_ball(
        ball,
        impact_position=(0.3 + 29.7 * place) * INCH,
        relative_speed=(slow + (fast - slow) * speed) * MPH,
    )
    pool = replace(usual, stiffness=usual.stiffness * 100.0**harder)
    return pool, _model(bat, "free", BENDING_MODES).collide(pool).contacts


@cache
def _model(bat: str, support: str, count: int) -> ModalModel:
    return ModalModel.of(catalog.load_bat(bat).spec.body, SUPPORTS[support], count)


def _exact(column: Column) -> ColumnOutcome | None:
    """Return the reference results of a column; None if the model rejects it."""
    try:
        return _outcome(column, STEPPER.refine(4.0))
    except InputError:
        return None


def _outcome(column: Column, stepper: Stepper) -> ColumnOutcome:
    (first, scenes), *further = column
    with np.errstate(all="ignore"):  # diverging scenes overflow
        return ColumnOutcome.of(collide_bats([(replace(first, stepper=stepper), scenes), *further]))


def _cell(
    outcome: ColumnOutcome | None, true: ColumnOutcome | None, shipped: bool
) -> dict[str, Any]:
    """Return the state of a cell, its largest errors, and its numbers of scenes."""
    if outcome is None or true is None:
        counts = dict.fromkeys(("scenes", "off", "doubted"), 0)
        worst = dict.fromkeys(("worst_error", "worst_unnoticed_error", "worst_leak"))
        return {"state": State.NO_RESULT.value, "refused": True} | counts | worst
    error = np.abs(outcome.efficiency - true.efficiency)
    # Larger values of e_A or of the leak are a sign of instability; comparisons are False for NaN.
    stable = (np.abs(outcome.efficiency) <= 2.0) & (outcome.leak <= 0.1)
    good = error <= STAYS
    unnoticed = ~good if shipped else ~good & ~outcome.doubted
    state = State.GOOD if good.all() else State.INACCURATE if unnoticed.any() else State.NOTICED
    return {
        "state": (state if stable.all() else State.UNSTABLE).value,
        "refused": bool((outcome.failed & (not shipped)).any()),
        "scenes": len(error),
        "off": int((~good).sum()),
        "doubted": int(outcome.doubted.sum()),
        "worst_error": _worst(error),
        "worst_unnoticed_error": _worst(error[~outcome.doubted | shipped]),
        "worst_leak": _worst(outcome.leak),
    }


def _worst(values: Array) -> float | None:
    """Return the largest value; None if a value is not finite, which JSON cannot store."""
    worst = float(values.max(initial=0.0))
    return worst if isfinite(worst) else None
