"""Chart of accuracy against run time of the models of the motion.

Errors are rms errors over shots that start at times spread evenly over one step. The reference is
an independent calculation with vectors. The bat is rigid with one radius, and there is no air and
no friction, so that plain pymunk could be exact.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, Profile
from virtual_lab.errors import InputError
from virtual_lab.fidelity.drawing import error_axes
from virtual_lab.fidelity.results import SpeedChart, least_time
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.motion.closed_form import play_closed_form
from virtual_lab.simulation.motion.played import PlayedShots, Target
from virtual_lab.simulation.motion.pymunk_scene import PymunkSettings, play_pymunk
from virtual_lab.simulation.motion.scene import PivotedBat, ShotScene, ShotState
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.units import INCH, Array

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

Row = dict[str, Any]


class Carrier(StrEnum):
    """Model of the motion."""

    PYMUNK = "pymunk"
    CLOSED = "closed form"


class Start(StrEnum):
    """Approach of the ball to the bat."""

    SQUARE = "at rest, square"
    SWUNG = "swung and aslant"
    ROUND = "10 mm off the axis"
    TIP = "tip"


COLOURS = {Carrier.PYMUNK: "#0072b2", Carrier.CLOSED: "#009e73"}
STARTS: dict[Start, dict[str, float]] = {
    Start.SQUARE: {"z": 6 * INCH},
    Start.SWUNG: {"z": 6 * INCH, "vz": 1.0, "rate": -30.0, "angle": 0.12},
    Start.ROUND: {"z": 6 * INCH, "y": 0.010},
    Start.TIP: {"z": 0.010},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Rod:
    """A rigid bat of one radius on a pivot, and a ball, in SI units."""

    length: float
    radius: float
    axis: float  # distance of the pivot from the tip
    inertia: float  # moment of inertia about the pivot
    ball_mass: float
    ball_radius: float
    restitution: float

    @property
    def contact_distance(self) -> float:
        """Distance between the center of the ball and the axis of the bat at contact [m]."""
        return self.radius + self.ball_radius

    def efficiency(self, place: Array, *_: Any) -> Array:
        """Return e_A for e = e0 at `place` [m from the tip]; `ShotScene` passes more arguments."""
        r = self.ball_mass * (self.axis - place) ** 2 / self.inertia
        return np.asarray((self.restitution - r) / (1 + r))


@cache
def rod() -> Rod:
    """Return a bat of constant radius with the mass and inertia of R161, and a ball, in SI units.

    The ball is baseball-2003 with an e0 of 0.5. The pivot is 6 in from the knob.
    """
    beam = beam_of(catalog.load_bat("r161").spec.body)
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    axis = beam.length - 6 * INCH
    return Rod(
        length=beam.length,
        radius=0.0318,
        axis=axis,
        inertia=beam.inertia(axis),
        ball_mass=ball.mass,
        ball_radius=ball.radius,
        restitution=0.5,
    )


class PartingState(NamedTuple):
    """State of ball and bat after the contact."""

    efficiency: float
    velocity: Array  # velocity of the ball, (3,) [m/s]
    rate: float  # angular rate of the bat [rad/s]


def motion_chart(
    progress: Progress = quiet,
    steps: Sequence[float] = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6),
    batch: int = 20_000,
) -> SpeedChart:
    """Return a chart of error and run time of the models that move ball and bat.

    There is one row per model, scene and setting. A row states the rms errors of the collision
    efficiency e_A, of the ball's velocity [m/s] and of the bat's angular rate [rad/s], and the run
    time per shot [µs]. The values are None for a setting that the model refuses.

    Parameters
    ----------
    progress
        Function that is called with a message that names the current task.
    steps
        Time steps of pymunk [s].
    batch
        Number of shots with which the run time of the closed form is measured.
    """
    rows: list[Row] = []
    play_pymunk(_scene(Start.SQUARE, 1e-3, 1))  # loads modules before the timing
    for name in STARTS:
        progress(name)
        rows += _accuracy(name, steps, batch)
    return SpeedChart(
        name="motion",
        title="Models of the motion",
        rows=rows,
        figure=draw_motion,
    )


def _row(series: str, scene: str, setting: str, **values: float | None) -> Row:
    names = ("e_A", "ball_m_s", "bat_rad_s", "us_a_shot")
    return {"series": str(series), "scene": str(scene), "setting": setting} | {
        name: values.get(name) for name in names
    }


def _scene(name: Start, step: float, shots: int) -> ShotScene:
    """Return shots at the bat of `rod`. Their contact times are spread evenly over one time step.

    The ball comes from 0.12 m in front of the axis of the bat, with 60 mph (26.8 m/s). All shots
    end 5 ms after the last ball would reach the axis.
    """
    bat, many, speed = rod(), np.ones(shots), 26.8
    distance = 0.12 + speed * step * (np.arange(shots) + 0.5) / shots
    return ShotScene(
        start=ShotState.of(**({"vx": speed} | STARTS[name] | {"x": -distance})),
        ball_mass=bat.ball_mass * many,
        ball_drag=0 * many,
        ball_radius=bat.ball_radius,
        bat=PivotedBat(
            Profile(z=(0.0, bat.length), outer_diameter=(2 * bat.radius, 2 * bat.radius)),
            bat.axis,
            bat.inertia,
        ),
        efficiency=bat.efficiency,
        duration=float(distance.max()) / speed + 5e-3,
    )


def _accuracy(name: Start, steps: Sequence[float], batch: int) -> Iterator[Row]:
    scene = _scene(name, 1e-3, 20)
    _, spent = least_time(partial(play_closed_form, _scene(name, 1e-3, batch)))
    exact = _errors(scene, play_closed_form(scene))
    yield _row(Carrier.CLOSED, name, "exact", us_a_shot=spent / batch * 1e6, **exact)
    for step in steps:
        yield _pymunk_row(name, step)


def _pymunk_row(name: Start, step: float) -> Row:
    """Return the row of the pymunk model with a step, which it may refuse."""
    scene, setting = _scene(name, step, 4), f"{step:.0e} s"
    try:
        played, spent = least_time(partial(play_pymunk, scene, PymunkSettings(step=step)))
    except InputError:
        return _row(Carrier.PYMUNK, name, f"{setting}: refused")
    errors = _errors(scene, played)
    return _row(Carrier.PYMUNK, name, setting, us_a_shot=spent / scene.shots * 1e6, **errors)


def _errors(scene: ShotScene, played: PlayedShots) -> dict[str, float]:
    hit = played.first(Target.BAT)
    true = [separate_by_hand(scene, shot) for shot in range(scene.shots)]
    e_A = scene.efficiency(hit.place, hit.speed, hit.shot)
    ball = np.array(hit.state[3:6]).T - [each.velocity for each in true]
    return {
        "e_A": _rms(e_A - [each.efficiency for each in true]),
        "ball_m_s": _rms(np.linalg.norm(ball, axis=1)),
        "bat_rad_s": _rms(hit.state.rate - [each.rate for each in true]),
    }


def separate_by_hand(scene: ShotScene, shot: int) -> PartingState:
    """Return the exact state of ball and bat after contact in one shot, without air drag.

    The state is e_A, the velocity of the ball, (3,) [m/s], and the angular rate of the bat [rad/s].
    It is computed by vector algebra. `shot` is the index of the shot in the scene, from 0. Raises
    `ValueError` if the ball does not reach the bat.
    """
    bat, start = rod(), scene.start.part(shot)
    velocity, turning = np.array(start[3:6]), np.array([0.0, -float(start.rate), 0.0])

    def separation(time: float) -> tuple[Array, Array]:
        """Return the vectors from the bat's axis to the ball, and from the pivot to its foot."""
        angle = start.angle + start.rate * time
        along = np.array([np.sin(angle), 0.0, -np.cos(angle)])
        arm = np.array(start[:3]) + velocity * time - [0.0, 0.0, bat.axis]
        foot = (arm @ along) * along
        return arm - foot, foot

    behind = float(-start.x / start.vx)  # time at which the ball reaches the bat at rest
    time = brentq(
        lambda t: np.linalg.norm(separation(t)[0]) - bat.contact_distance, 0, behind, xtol=1e-16
    )
    offset, foot = separation(time)
    normal, place = offset / np.linalg.norm(offset), bat.axis - np.linalg.norm(foot)
    speed = float((np.cross(turning, foot) - velocity) @ normal)
    efficiency = float(bat.efficiency(np.asarray(place)))
    impulse = bat.ball_mass * speed * (1 + efficiency) * normal
    return PartingState(
        efficiency,
        velocity + impulse / bat.ball_mass,
        float(start.rate - np.cross(foot, -impulse)[1] / bat.inertia),
    )


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def draw_motion(rows: list[Row], title: str) -> PageFigure:
    """Return a figure of the error of the ball's velocity [m/s] against the time per shot [µs]."""
    from virtual_lab.output.page_figure import PageFigure

    figure = PageFigure(figsize=(6.9, 4.6), dpi=150, layout="constrained")
    axes, rows = figure.add_subplot(), [row for row in rows if row["us_a_shot"]]
    markers = dict(zip(STARTS, "osd^", strict=True))
    for series, colour in COLOURS.items():
        axes.plot([], [], color=colour, linewidth=3, label=series)
        for scene, marker in markers.items():
            scene_rows = [row for row in rows if (row["series"], row["scene"]) == (series, scene)]
            times = [row["us_a_shot"] for row in scene_rows]
            places = [max(row["ball_m_s"], 1e-16) for row in scene_rows]
            axes.plot(times, places, marker=marker, color=colour, linewidth=1, markersize=5)
            for row, time, place in zip(scene_rows, times, places, strict=True):
                if scene == Start.TIP:
                    words = row["setting"].replace("e-0", "e-")
                    axes.annotate(words, (time, place), fontsize=7, rotation=25, color=colour)
    for scene, marker in markers.items():
        axes.plot([], [], color="0.4", marker=marker, linewidth=0, label=scene)
    error_axes(axes, "error of the velocity of the ball [m/s]")
    low, high = axes.get_xlim()
    axes.set_xlim(low, 3 * high)
    axes.legend(fontsize=7.5, frameon=False, loc="center right")
    figure.suptitle(title, fontsize=11)
    return figure
