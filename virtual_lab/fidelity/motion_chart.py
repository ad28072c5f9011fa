"""Chart of accuracy against run time of the models of the motion, and of plain pymunk.

Errors are rms errors over shots that start at times spread evenly over one step. The reference is
an independent calculation with vectors. The bat is rigid with one radius, and there is no air and
no friction, so that plain pymunk could be exact.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from virtual_lab.errors import InputError
from virtual_lab.fidelity.drawing import error_axes
from virtual_lab.fidelity.naive_pymunk import (
    Shape,
    energy_loss_share,
    missed_share,
    naive_errors,
    rod,
    rod_scene,
)
from virtual_lab.fidelity.results import SpeedChart, least_time
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.motion.closed_form import play_closed_form
from virtual_lab.simulation.motion.played import PlayedShots, Target
from virtual_lab.simulation.motion.pymunk_scene import PymunkSettings, play_pymunk
from virtual_lab.simulation.motion.scene import ShotScene
from virtual_lab.units import INCH, Array

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

Row = dict[str, Any]


class Carrier(StrEnum):
    """Model of the motion."""

    ALONE = "plain pymunk"
    OURS = "our pymunk model"
    CLOSED = "closed form"


class Start(StrEnum):
    """Approach of the ball to the bat."""

    SQUARE = "at rest, square"
    SWUNG = "swung and aslant"
    ROUND = "10 mm off the axis"
    TIP = "tip"


COLOURS = {Carrier.ALONE: "#d55e00", Carrier.OURS: "#0072b2", Carrier.CLOSED: "#009e73"}
STARTS: dict[Start, dict[str, float]] = {
    Start.SQUARE: {"z": 6 * INCH},
    Start.SWUNG: {"z": 6 * INCH, "vz": 1.0, "rate": -30.0, "angle": 0.12},
    Start.ROUND: {"z": 6 * INCH, "y": 0.010},
    Start.TIP: {"z": 0.010},
}


class PartingState(NamedTuple):
    """State of ball and bat after the contact."""

    efficiency: float
    velocity: Array  # velocity of the ball, (3,) [m/s]
    rate: float  # angular rate of the bat [rad/s]


def motion_chart(
    progress: Progress = quiet,
    steps: Sequence[float] = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6),
    losses: Sequence[float] = (1e-2, 1e-3, 1e-4, 1e-5),
    batch: int = 20_000,
) -> SpeedChart:
    """Return a chart of error and run time of the models that move ball and bat.

    There is one row per model, scene and setting. A row states:

    * rms errors of the collision efficiency e_A, of the ball's velocity [m/s] and of the bat's
      angular rate [rad/s];
    * the share of missed contacts or of lost energy, 0 to 1;
    * the run time per shot [µs].

    Values that do not apply are None.

    Parameters
    ----------
    progress
        Function that is called with a message that names the current task.
    steps
        Time steps [s] of the simulated hits.
    losses
        Time steps [s] of the simulations that measure the energy loss. In these simulations the bat
        rotates and is not hit.
    batch
        Number of shots with which the run time of the closed form is measured.
    """
    rows: list[Row] = []
    play_pymunk(_scene(Start.SQUARE, 1e-3, 1))  # loads modules before the timing
    for name in STARTS:
        progress(name)
        rows += _accuracy(name, steps, batch)
    progress("missed contacts and lost energy")
    for speed, step in ((26.8, 1e-2), (62.6, 2e-3), (62.6, 1e-3)):  # m/s, s
        rows += _misses(speed, step)
    rows += [row for step in losses for row in _losses(step)]
    return SpeedChart(
        name="motion",
        title="Models of the motion compared with plain pymunk",
        words="Rms errors over starts spread evenly over a step: of e_A, of the velocity of the "
        "ball, and of the angular rate of the bat. Shares of missed shots or of lost energy. "
        "Errors below 1e-16 are drawn at 1e-16.",
        rows=rows,
        figure=draw_motion,
    )


def _row(series: str, scene: str, setting: str, **values: float | None) -> Row:
    names = ("e_A", "ball_m_s", "bat_rad_s", "share", "us_a_shot")
    return {"series": str(series), "scene": str(scene), "setting": setting} | {
        name: values.get(name) for name in names
    }


def _scene(name: Start, step: float, shots: int) -> ShotScene:
    return rod_scene(STARTS[name], 26.8, step, shots)


def _accuracy(name: Start, steps: Sequence[float], batch: int) -> Iterator[Row]:
    scene = _scene(name, 1e-3, 20)
    _, spent = least_time(partial(play_closed_form, _scene(name, 1e-3, batch)))
    exact = _errors(scene, play_closed_form(scene))
    yield _row(Carrier.CLOSED, name, "exact", us_a_shot=spent / batch * 1e6, **exact)
    for step in steps:
        yield _of_rung(name, step, partial(_time_model, _scene(name, step, 4), step))
    for step in steps:
        scene = _scene(name, step, 20)
        shapes: dict[str, Shape] = {Start.ROUND: "section", Start.TIP: "round tip"}
        alone = partial(naive_errors, scene, step, shape=shapes.get(name, "side"))
        errors, spent = least_time(alone)
        us = spent / scene.shots * 1e6
        yield _row(Carrier.ALONE, name, f"{step:.0e} s", us_a_shot=us, ball_m_s=_rms(errors))


def _of_rung(scene: str, step: float, work: Callable[[], Mapping[str, float]]) -> Row:
    """Return the row of the pymunk model with a step: the results of `work`, or a rejection."""
    setting = f"{step:.0e} s"
    try:
        return _row(Carrier.OURS, scene, setting, **work())
    except InputError:
        return _row(Carrier.OURS, scene, f"{setting}: refused")


def _time_model(scene: ShotScene, step: float) -> dict[str, float]:
    carried, spent = least_time(partial(play_pymunk, scene, PymunkSettings(step=step)))
    return _errors(scene, carried) | {"us_a_shot": spent / scene.shots * 1e6}


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


def _misses(speed: float, step: float) -> Iterator[Row]:
    scene = f"missed at {speed:g} m/s"
    share = missed_share(rod(), speed, step, 100)
    yield _row(Carrier.ALONE, scene, f"{step:.0e} s", share=share)
    shots = rod_scene(STARTS[Start.SQUARE], speed, step, 20, ahead=0.2, duration=0.03)

    def of_rung() -> dict[str, float]:
        played = play_pymunk(shots, PymunkSettings(step=step))
        return {"share": 1 - len(played.first(Target.BAT).shot) / shots.shots}

    yield _of_rung(scene, step, of_rung)


def _losses(step: float) -> Iterator[Row]:
    spin = 11.5  # rad/s
    scene = f"energy lost per second at {spin:g} rad/s"
    yield _row(Carrier.ALONE, scene, f"{step:.0e} s", share=energy_loss_share(rod(), spin, step))
    # a ball at rest far away, which does not limit the step
    alone = rod_scene({"rate": spin, "vx": 0.0}, 0.0, step, 1, ahead=9.0, duration=1.0)

    def of_rung() -> dict[str, float]:
        end = play_pymunk(alone, PymunkSettings(step=step)).at(alone, alone.duration)
        return {"share": abs(float(1 - (end.rate[0, 0] / spin) ** 2))}

    yield _of_rung(scene, step, of_rung)


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def draw_motion(rows: list[Row], title: str) -> PageFigure:
    """Return a figure of the rows of `motion_chart`, with three panels.

    The first panel shows the error of the ball's velocity [m/s] against the time per shot [µs]. The
    second shows the share of missed contacts against the distance that the ball travels in one time
    step [m]. The third shows the share of lost energy against the time step [s].
    """
    from virtual_lab.output.page_figure import PageFigure

    figure = PageFigure(figsize=(11.5, 4.6), dpi=150, layout="constrained")
    errors, misses, losses = figure.subplots(1, 3, width_ratios=(2.0, 1.0, 1.0))
    _draw_errors(errors, [row for row in rows if row["us_a_shot"]])
    _draw_misses(misses, [row for row in rows if row["scene"].startswith("missed")])
    _draw_losses(losses, [row for row in rows if row["scene"].startswith("energy")])
    figure.suptitle(title, fontsize=11)
    return figure


def _draw_errors(axes: Any, rows: list[Row]) -> None:
    markers = dict(zip(STARTS, "osd^", strict=True))
    for series, colour in COLOURS.items():
        axes.plot([], [], color=colour, linewidth=3, label=series)
        for scene, marker in markers.items():
            scene_rows = [row for row in rows if (row["series"], row["scene"]) == (series, scene)]
            times = [row["us_a_shot"] for row in scene_rows]
            places = [max(row["ball_m_s"], 1e-16) for row in scene_rows]
            axes.plot(times, places, marker=marker, color=colour, linewidth=1, markersize=5)
            for row, *place in zip(scene_rows, times, places, strict=True):
                if scene == Start.TIP:
                    words = row["setting"].replace("e-0", "e-")
                    axes.annotate(words, place, fontsize=7, rotation=25, color=colour)
    for scene, marker in markers.items():
        axes.plot([], [], color="0.4", marker=marker, linewidth=0, label=scene)
    error_axes(axes, "error of the velocity of the ball [m/s]")
    low, high = axes.get_xlim()
    axes.set_xlim(low, 3 * high)
    axes.legend(fontsize=7.5, frameon=False, loc="center right")


def _draw_misses(axes: Any, rows: list[Row]) -> None:
    contact_distance = rod().contact_distance
    steps_m = np.linspace(1e-3, 0.3, 300)
    axes.plot(
        steps_m,
        np.maximum(0.0, 1 - contact_distance / steps_m),
        color="0.5",
        label="1 − (R + r) / (v dt)",
    )
    for row in rows:
        if row["share"] is not None:
            speed, step = float(row["scene"].split()[2]), float(row["setting"].split()[0])
            marker = "o" if row["series"] == Carrier.ALONE else "x"
            axes.plot(speed * step, row["share"], marker, color=COLOURS[row["series"]])
    axes.axvspan(
        contact_distance, steps_m[-1], color=COLOURS[Carrier.OURS], alpha=0.12, linewidth=0
    )
    axes.annotate("refused by the model", (0.185, 0.04), ha="center", fontsize=7.5, color="#0072b2")
    axes.set_xlabel("v dt [m]")
    axes.set_ylabel("share of shots that pass through the bat")
    axes.legend(fontsize=7.5, frameon=False, loc="upper left")


def _draw_losses(axes: Any, rows: list[Row]) -> None:
    for series in (Carrier.ALONE, Carrier.OURS):
        series_rows = [row for row in rows if row["series"] == series and row["share"] is not None]
        steps = [float(row["setting"].split()[0]) for row in series_rows]
        shares = [max(row["share"], 1e-16) for row in series_rows]
        axes.plot(steps, shares, marker="o", color=COLOURS[series], linewidth=1, label=series)
    error_axes(axes, "share of energy lost in one second by a rotating bat")
    axes.set_xlabel("step [s]")
    axes.legend(fontsize=7.5, frameon=False, loc="center right")
