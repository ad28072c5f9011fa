"""Speed against accuracy of the collision rungs: error in e_A over time a shot.

Two questions, a reference to each. What a rung errs by in all, that is by leaving modes out, by
meshing, by interpolating and by stepping, is held against 120 modes stepped one by one. What a
method of solving errs by is held against the same modes it was given, stepped one by one four
times finer. Errors are the worst of scenes drawn over the barrel, times medians of repeated
batches. Where a method fails is looked for all along the bat, from its tip to its knob.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, BatBody
from virtual_lab.errors import InputError
from virtual_lab.fidelity.collision_drawing import (
    COLLISION_TITLE,
    COLLISION_WORDS,
    ELEMENTS,
    IN_ALL,
    MODES,
    REFERENCE,
    RIGID,
    SCIPY,
    SOLVING,
    STEPS,
    SURROGATE,
    draw_collision,
)
from virtual_lab.fidelity.results import SpeedChart
from virtual_lab.lab.laboratory import EFFICIENCY_U
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.collision.modal import BENDING_MODES, STIFF_MODES, ModalModel
from virtual_lab.simulation.collision.reference import Method, ReferenceModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.collision.scene import CollisionModel, Scenes
from virtual_lab.simulation.collision.stepping import FINE, OneByOne, Stepper
from virtual_lab.simulation.collision.surrogate import Box, Surrogate
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.simulation.physics.supports import Free
from virtual_lab.streams import Streams
from virtual_lab.units import INCH, MPH

__all__ = ["collision_chart"]

Array = NDArray[np.float64]
Efficiency = Callable[[Scenes], Array]
BAT, BALL = "r161", "baseball-2003"
CONVERGED = 120
MODE_COUNTS = (4, 6, 8, 10, 14, 20, 30, 40)
DEGREES = (4, 5)  # of the elements' polynomials, where the default is 8
STEPPERS: dict[str, Stepper] = {
    "fine": FINE,
    "fine, steps / 2": FINE.finer(2.0),
    "one by one": OneByOne(),
}
EXACT = OneByOne(refinement=4.0)
METHODS: tuple[tuple[Method, float], ...] = (
    ("RK45", 1e-4),
    ("RK45", 1e-6),
    ("DOP853", 1e-4),
    ("DOP853", 1e-7),
    ("LSODA", 1e-6),
    ("Radau", 1e-4),
)
TOLERANCES = (1e-3, 1e-4, 1e-5)  # of surrogates
PLACES_IN, SPEEDS_MPH = (2.0, 12.0), (60.0, 160.0)  # between which scenes are drawn
WHOLE_IN = (0.3, 33.0)  # all along the bat
SEED = 1
SCENES, FEW, FEWEST = 400, 40, 6  # for ours, for methods of milliseconds, for the reference
BATCH, REPEATS = 8192, 5


@dataclass(frozen=True, kw_only=True)
class Point:
    """What is charted: a way to e_A, what it is held against, and on how many scenes."""

    panel: str
    series: str
    setting: str
    efficiency: Efficiency
    exact: Callable[[tuple[float, float], int], Array]  # of `_scenes`
    scenes: int = SCENES


def collision_chart(progress: Progress = quiet) -> SpeedChart:
    """Return the chart; its rows are those of `collision_rows`."""
    return _chart(collision_rows(progress))


def _chart(rows: list[dict[str, Any]]) -> SpeedChart:
    return SpeedChart(
        name="collision",
        title=COLLISION_TITLE,
        words=COLLISION_WORDS,
        rows=rows,
        figure=draw_collision,
    )


def collision_rows(progress: Progress = quiet) -> list[dict[str, Any]]:
    """Return a row a model.

    Of the scenes about the barrel: worst and rms error in e_A, time a shot [µs]. Of as many all
    along the bat: the share off by more than the u of a certificate, and the share refused.
    """
    rows = []
    for point in _points(catalog.load_bat(BAT).spec.body):
        progress(f"{point.series}: {point.setting}")
        barrel, whole = (_scenes(ends, point.scenes) for ends in (PLACES_IN, WHOLE_IN))
        error = np.abs(point.efficiency(barrel) - point.exact(PLACES_IN, point.scenes))
        found = _answers(point.efficiency, whole)
        off = np.abs(found - point.exact(WHOLE_IN, point.scenes)) > EFFICIENCY_U  # not of a nan
        quick = point.scenes == SCENES
        timed, repeats = (_scenes(PLACES_IN, BATCH), REPEATS) if quick else (barrel, 1)
        rows.append(
            {
                "held_against": point.panel,
                "series": point.series,
                "setting": point.setting,
                "scenes": point.scenes,
                "worst_error": float(error.max()),
                "rms_error": float(np.sqrt((error**2).mean())),
                "us_a_shot": _median_time(point.efficiency, timed, repeats) / len(timed) * 1e6,
                "off_along_the_bat": float(off.mean()),
                "refused_along_the_bat": float(np.isnan(found).mean()),
            }
        )
    return rows


def _points(body: BatBody) -> Iterator[Point]:
    converged = replace(ModalModel.of(body, Free(), CONVERGED), stepper=OneByOne())
    exact = _kept(_of(converged))
    for series, setting, efficiency in _rungs(body):
        scenes = FEWEST if series == REFERENCE else SCENES
        yield Point(
            panel=IN_ALL,
            series=series,
            setting=setting,
            efficiency=efficiency,
            exact=exact,
            scenes=scenes,
        )
    bare = _bare(body)
    exact = _kept(_of(replace(bare, stepper=EXACT)))
    for series, setting, model, scenes in _solvers(bare):
        yield Point(
            panel=SOLVING,
            series=series,
            setting=setting,
            efficiency=_of(model),
            exact=exact,
            scenes=scenes,
        )


def _solvers(bare: ModalModel) -> Iterator[tuple[str, str, CollisionModel, int]]:
    for setting, stepper in STEPPERS.items():
        yield STEPS, setting, replace(bare, stepper=stepper), SCENES
    for method, tolerance in METHODS:
        solver = ReferenceModel(
            modes=bare.modes, tolerance=tolerance, method=method, longest_step=10.0
        )
        yield SCIPY, f"{method} {tolerance:.0e}", solver, FEW


def _rungs(body: BatBody) -> Iterator[tuple[str, str, Efficiency]]:
    default = ModalModel.of(body, Free())
    yield RIGID, "closed form", _of(RigidModel.of(body, Free()))
    for tolerance in TOLERANCES:
        surrogate = Surrogate.build(default, _box(), tolerance=tolerance)
        yield SURROGATE, f"{surrogate.coefficients.size} nodes", surrogate.efficiency
    for count in MODE_COUNTS:
        yield MODES, f"{count} modes", _of(ModalModel.of(body, Free(), count))
    for degree in DEGREES:
        modes = modes_of(body, Free(), BENDING_MODES + STIFF_MODES, order=degree)
        yield ELEMENTS, f"degree {degree}", _of(ModalModel.within(modes, BENDING_MODES))
    yield REFERENCE, "DOP853 1e-12", _of(ReferenceModel.of(body, Free()))


def _bare(body: BatBody) -> ModalModel:
    """Return the default modes without residual flexibility: what the methods of scipy solve."""
    model = ModalModel.of(body, Free())
    return replace(model, stiff=model.stiff.above(model.stiff.count))


def _of(model: CollisionModel) -> Efficiency:
    return lambda scenes: model.collide(scenes).collision_efficiency


def _kept(efficiency: Efficiency) -> Callable[[tuple[float, float], int], Array]:
    """Return what finds e_A of scenes between two places once."""
    return cache(lambda ends_in, count: efficiency(_scenes(ends_in, count)))


def _answers(efficiency: Efficiency, scenes: Scenes) -> Array:
    """Return e_A of each scene, nan where it is refused."""
    found = np.full(len(scenes), np.nan)
    for i in range(len(scenes)):
        try:
            found[i] = efficiency(scenes.part(slice(i, i + 1)))[0]
        except InputError:
            continue
    return found


@cache
def _ball() -> BallSpec:
    return catalog.load("balls", BALL, BallSpec).spec


def _box() -> Box:
    """Return a box about the scenes of this chart over the barrel."""
    ball = _ball()
    return Box(
        impact_position=(1.5 * INCH, 12.5 * INCH),
        relative_speed=(55 * MPH, 170 * MPH),
        ball_restitution=(0.43, 0.57),
        ball_mass=(0.98 * ball.mass, 1.02 * ball.mass),
        stiffness=ball.stiffness,
        exponent=ball.exponent,
    )


@cache
def _scenes(ends_in: tuple[float, float], count: int) -> Scenes:
    """Return scenes drawn evenly between two places, and over the speeds."""
    draws = Streams(SEED)
    return Scenes.with_ball(
        _ball(),
        impact_position=_between(ends_in, draws.uniform("place", count)) * INCH,
        relative_speed=_between(SPEEDS_MPH, draws.uniform("speed", count)) * MPH,
    )


def _between(ends: tuple[float, float], draws: Array) -> Array:
    return np.asarray(ends[0] + (ends[1] - ends[0]) * (0.5 + draws))


def _median_time(efficiency: Efficiency, batch: Scenes, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.process_time()
        efficiency(batch)
        times.append(time.process_time() - start)
    return float(np.median(times))
