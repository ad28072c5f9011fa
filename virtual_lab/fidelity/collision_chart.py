"""Speed against accuracy of the collision rungs: error in e_A over time a shot.

Errors are the worst over scenes along the barrel and over speeds. What approximates the bat
(rigid, so many modes, so fine a mesh) is held against the reference, all the modes of the beam
under its own integrator; what approximates the solution (stepping, the methods of scipy, a
surrogate) against the same modes solved far more finely. Times are medians of repeated batches.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, BatBody
from virtual_lab.fidelity.chart_files import chart_text, save_chart
from virtual_lab.fidelity.collision_drawing import (
    ELEMENTS,
    MODES,
    RIGID,
    SCIPY,
    STEPS,
    SURROGATE,
    TITLE,
    WORDS,
    draw,
)
from virtual_lab.simulation.collision.modal import BENDING_MODES, STIFF_MODES, ModalModel
from virtual_lab.simulation.collision.reference import Method, ReferenceModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.collision.scene import CollisionModel, Scenes
from virtual_lab.simulation.collision.stepping import COARSE, FINE, OneByOne, Stepper
from virtual_lab.simulation.collision.surrogate import Box, Surrogate
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.simulation.physics.supports import Free
from virtual_lab.units import INCH, MPH

__all__ = ["measure", "save", "text"]

Array = NDArray[np.float64]
Efficiency = Callable[[Scenes], Array]
BAT, BALL = "r161", "baseball-2003"
MODE_COUNTS = (4, 6, 8, 10, 14, 20, 30)
DEGREES = (4, 5)  # of the elements' polynomials, where the default is 8
STEPPERS: dict[str, Stepper] = {
    "coarse": COARSE,
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
PLACES_IN = (2.0, 3.5, 5.0, 6.5, 8.0, 10.0, 12.0)
SPEEDS_MPH = (60.0, 110.0, 160.0)
BATCH, REPEATS = 20_000, 7
TOLERANCES = (1e-4, 1e-5, 1e-6)


def measure(say: Callable[[str], None] = lambda _: None) -> list[dict[str, Any]]:
    """Return a row a model: rung, setting, worst and rms error in e_A, time a shot [µs]."""
    body = catalog.load_bat(BAT).spec.body
    scenes = _scenes(np.array(PLACES_IN) * INCH, np.array(SPEEDS_MPH) * MPH)
    batch = _scenes(np.linspace(2, 12, BATCH // 4) * INCH, np.linspace(60, 160, 4) * MPH)
    say("reference: every mode, tight tolerance")
    true = ReferenceModel.of(body, Free()).collide(scenes).collision_efficiency
    default, bare = ModalModel.of(body, Free()), _bare(body)
    solved = {
        SCIPY: _of(replace(bare, stepper=EXACT))(scenes),
        STEPS: _of(replace(default, stepper=EXACT))(scenes),
    }
    solved[SURROGATE] = solved[STEPS]
    rows = []
    for series, setting, efficiency in _models(body):
        say(f"{series}: {setting}")
        error = efficiency(scenes) - solved.get(series, true)
        timed = scenes if series == SCIPY else batch
        rows.append(
            {
                "series": series,
                "setting": setting,
                "worst_error": float(np.abs(error).max()),
                "rms_error": float(np.sqrt((error**2).mean())),
                "us_a_shot": _median_time(efficiency, timed) / len(timed) * 1e6,
            }
        )
    return rows


def save(rows: list[dict[str, Any]], folder: Path) -> None:
    """Write the rows as CSV, PNG and an HTML page into a new folder."""
    save_chart("collision", rows, folder, title=TITLE, words=WORDS, figure=draw(rows))


def text(rows: list[dict[str, Any]]) -> str:
    """Return the rows as a table."""
    return chart_text(rows)


def _models(body: BatBody) -> Iterator[tuple[str, str, Efficiency]]:
    default = ModalModel.of(body, Free())
    yield RIGID, "closed form", _of(RigidModel.of(body, Free()))
    for tolerance in TOLERANCES:
        surrogate = Surrogate.build(default, _box(), tolerance=tolerance)
        yield SURROGATE, f"{surrogate.coefficients.size} nodes", surrogate.efficiency
    for count in MODE_COUNTS:
        yield MODES, f"{count} modes", _of(ModalModel.of(body, Free(), count))
    for degree in DEGREES:
        modes = modes_of(body, Free(), BENDING_MODES + STIFF_MODES, order=degree)
        meshed = ModalModel(modes=modes.first(BENDING_MODES), stiff=modes.above(BENDING_MODES))
        yield ELEMENTS, f"degree {degree}", _of(meshed)
    for setting, stepper in STEPPERS.items():
        yield STEPS, setting, _of(replace(default, stepper=stepper))
    for method, tolerance in METHODS:
        solver = ReferenceModel(
            modes=default.modes, tolerance=tolerance, method=method, longest_step=10.0
        )
        yield SCIPY, f"{method} {tolerance:.0e}", _of(solver)


def _bare(body: BatBody) -> ModalModel:
    """Return the default modes without residual flexibility: what the methods of scipy solve."""
    model = ModalModel.of(body, Free())
    return replace(model, stiff=model.stiff.above(model.stiff.count))


def _of(model: CollisionModel) -> Efficiency:
    return lambda scenes: model.collide(scenes).collision_efficiency


@cache
def _ball() -> BallSpec:
    return catalog.load("balls", BALL, BallSpec).spec


def _box() -> Box:
    """Return a box about all scenes of this chart."""
    ball = _ball()
    return Box(
        impact_position=(1.5 * INCH, 12.5 * INCH),
        relative_speed=(55 * MPH, 170 * MPH),
        ball_restitution=(0.43, 0.57),
        ball_mass=(0.98 * ball.mass, 1.02 * ball.mass),
        stiffness=ball.stiffness,
        exponent=ball.exponent,
    )


def _scenes(places: Array, speeds: Array) -> Scenes:
    place, speed = (grid.ravel() for grid in np.meshgrid(places, speeds))
    return Scenes.with_ball(_ball(), impact_position=place, relative_speed=speed)


def _median_time(efficiency: Efficiency, batch: Scenes) -> float:
    efficiency(batch)
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        efficiency(batch)
        times.append(time.perf_counter() - start)
    return float(np.median(times))
