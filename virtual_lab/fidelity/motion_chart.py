"""Speed against accuracy of the motion rungs, beside pymunk left to itself.

Errors are root mean squares over shots whose starts are spread evenly over one step, against
scipy's integration of the same equations. The bat is rigid, of one radius, in no air and on no
friction, so that pymunk itself could be right. What planning expected stands beside what
is measured; it was measured on pymunk alone, and is why ball and bat never collide there.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, Profile
from virtual_lab.errors import InputError
from virtual_lab.fidelity.motion_reference import reference
from virtual_lab.fidelity.naive_pymunk import (
    Hit,
    Rod,
    energy_lost,
    hit_of,
    missed,
    off_round_end,
    round_hit,
)
from virtual_lab.fidelity.results import SpeedChart
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.simulation.motion import play
from virtual_lab.simulation.motion.played import BAT as STRUCK
from virtual_lab.simulation.motion.played import PlayedShots
from virtual_lab.simulation.motion.pymunk_scene import PymunkSettings
from virtual_lab.simulation.motion.scene import PivotedBat, ShotScene, ShotState
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.units import INCH

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["motion_chart", "rod"]

Array = NDArray[np.float64]
Row = dict[str, Any]
BAT, BALL = "r161", "baseball-2003"
NAIVE = "pymunk alone"
OURS = "pymunk rung"
CLOSED = "closed form"
SCIPY = "solve_ivp"
TITLE = "Motion: the rungs beside pymunk left to itself"
WORDS = (
    "Root mean square errors over starts spread evenly over a step, against scipy's integration "
    "of the same equations: e_A, the ball's velocity (off a round barrel and alone, its upward "
    "part), the bat's rate. Shares are of shots missed or of energy lost. Planned is what was "
    "expected before, of pymunk alone. No error at all is drawn at 1e-16."
)
COLOURS = {NAIVE: "#d55e00", OURS: "#0072b2", CLOSED: "#009e73"}
MARKERS = "osd^"
FLOOR = 1e-16  # m/s: drawn for no error at all
RADIUS = 0.0318  # m, of the straight bat; with the ball's the reach of planning's figures
SPEED, AHEAD, AFTER = 26.8, 0.12, 5e-3  # m/s, m, s
SQUARE, SWUNG, ROUND, TIP = "at rest, square", "swung and aslant", "10 mm off the axis", "tip"
STARTS: dict[str, dict[str, float]] = {
    SQUARE: {"z": 6 * INCH},
    SWUNG: {"z": 6 * INCH, "vz": 1.0, "rate": -30.0, "angle": 0.12},
    ROUND: {"z": 6 * INCH, "y": 0.010},
    TIP: {"z": 0.010},
}
STEPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
SHOTS, FEW_SHOTS, BATCH = 20, 4, 20_000
TRIES, LONG = 5, 0.5  # s
ITERATIONS = (1, 2, 5, 10, 20)
BARREL, GRIP = "2 to 10 in, worst", "20 in"
PLACES_IN = {BARREL: (2, 4, 6, 8, 10), GRIP: (20,)}
MISSES = ((26.8, 1e-2, 0.74), (62.6, 2e-3, 0.45), (62.6, 1e-3, 0.0))  # m/s, s, planned share
LOSSES = ((1e-2, 0.41), (1e-3, 0.07), (1e-4, 0.0075), (1e-5, 0.00075))  # s, planned share
SPIN = 11.5  # rad/s, at which planning's losses come out
PLANNED_ROUND = {1e-3: 1.4, 1e-4: 0.11, 1e-5: 0.008}  # m/s, upward
PLANNED_ITERATIONS = {(GRIP, 1): 0.24, (BARREL, 10): 1e-16}


def motion_chart(progress: Progress = quiet) -> SpeedChart:
    """Return the chart; its rows are those of `motion_rows`."""
    return _chart(motion_rows(progress))


def _chart(rows: list[dict[str, Any]]) -> SpeedChart:
    return SpeedChart(name="motion", title=TITLE, words=WORDS, rows=rows, figure=draw_motion)


def motion_rows(progress: Progress = quiet) -> list[Row]:
    """Return a row a model, scene and setting: errors, shares, planned figure, time a shot [µs].

    Errors are in e_A, in the ball's velocity [m/s] and in the bat's rate [rad/s]; shares, of
    shots missed or of energy lost. What does not apply is None.
    """
    rows: list[Row] = []
    play(_scene(SQUARE, 1e-3, 1), "pymunk")  # what is loaded at first use is nobody's time
    for name in STARTS:
        progress(name)
        rows += _accuracy(name)
    progress("iterations")
    rows += [_iterations(count, scene) for scene in PLACES_IN for count in ITERATIONS]
    progress("missed contacts and lost energy")
    rows += [row for speed, step, planned in MISSES for row in _misses(speed, step, planned)]
    rows += [row for step, planned in LOSSES for row in _losses(step, planned)]
    return rows


def rod() -> Rod:
    """Return a bat of one radius with the mass and the inertia of a real one."""
    beam = beam_of(catalog.load_bat(BAT).spec.body)
    ball = catalog.load("balls", BALL, BallSpec).spec
    axis = beam.length - 6 * INCH
    return Rod(
        length=beam.length,
        radius=RADIUS,
        axis=axis,
        mass=beam.mass,
        z_cm=beam.z_cm,
        inertia=beam.inertia(axis),
        ball_mass=ball.mass,
        ball_radius=ball.radius,
        restitution=0.5,
    )


def chart_scene(start: dict[str, float], speed: float, ahead: Array, duration: float) -> ShotScene:
    """Return shots at the bat of `rod`, their balls `ahead` [m] of its axis, (n,)."""
    bat, many = rod(), np.ones(len(ahead))
    return ShotScene(
        start=ShotState.of(**({"vx": speed} | start | {"x": -ahead})),
        ball_mass=bat.ball_mass * many,
        ball_drag=0 * many,
        ball_radius=bat.ball_radius,
        bat=PivotedBat(
            Profile(z=(0.0, bat.length), outer_diameter=(2 * bat.radius, 2 * bat.radius)),
            bat.axis,
            bat.inertia,
        ),
        efficiency=bat.efficiency,
        duration=duration,
    )


def _row(series: str, scene: str, setting: str, **own: float | None) -> Row:
    names = ("e_A", "ball_m_s", "bat_rad_s", "share", "planned", "us_a_shot")
    return {"series": series, "scene": scene, "setting": setting} | {
        name: own.get(name) for name in names
    }


def _accuracy(name: str) -> Iterator[Row]:
    scene = _scene(name, 1e-3, SHOTS)
    closed = play(scene, "closed-form")
    true, spent = _timed(partial(_truth, scene))
    yield _row(SCIPY, name, "1e-13", us_a_shot=spent / SHOTS * 1e6)
    _, spent = _timed(partial(play, _scene(name, 1e-3, BATCH), "closed-form"))
    yield _errors(scene, closed, true, _row(CLOSED, name, "exact", us_a_shot=spent / BATCH * 1e6))
    for step in STEPS:
        scene = _scene(name, step, FEW_SHOTS)
        try:
            carried, spent = _timed(
                partial(play, scene, "pymunk", settings=PymunkSettings(step=step))
            )
        except InputError:
            yield _row(OURS, name, f"{step:.0e} s: refused")
            continue
        row = _row(OURS, name, f"{step:.0e} s", us_a_shot=spent / FEW_SHOTS * 1e6)
        yield _errors(scene, carried, _truth(scene), row)
    for step in STEPS:
        yield _naive(name, step)


def _scene(name: str, step: float, shots: int) -> ShotScene:
    """Return shots whose contacts fall evenly into a step."""
    spread = SPEED * step * (np.arange(shots) + 0.5) / shots
    ahead = AHEAD + spread
    return chart_scene(STARTS[name], SPEED, ahead, float(ahead.max()) / SPEED + AFTER)


def _truth(scene: ShotScene) -> list[Any]:
    return [reference(scene, shot) for shot in range(scene.shots)]


def _errors(scene: ShotScene, found: PlayedShots, true: list[Any], row: Row) -> Row:
    hit = found.first(STRUCK)
    e_A = scene.efficiency(hit.place, hit.speed, hit.shot)
    ball = np.array(hit.state[3:6]).T - [t.ball_velocity for t in true]
    return row | {
        "e_A": _rms(e_A - [t.efficiency for t in true]),
        "ball_m_s": _rms(np.linalg.norm(ball, axis=1)),
        "bat_rad_s": _rms(hit.state.rate - [t.bat_rate for t in true]),
    }


def _naive(name: str, step: float) -> Row:
    """Return the errors of pymunk alone; of a round barrel the upward one, as was planned."""
    bat, scene = rod(), _scene(name, step, SHOTS)
    hits, spent = _timed(lambda: [_naive_hit(name, bat, scene, i, step) for i in range(SHOTS)])
    row = _row(NAIVE, name, f"{step:.0e} s", us_a_shot=spent / SHOTS * 1e6)
    balls = np.array([hit.velocity for hit in hits])
    if name == ROUND:
        angle = np.arcsin(STARTS[ROUND]["y"] / (bat.radius + bat.ball_radius))
        e_A = bat.efficiency(np.array(6 * INCH))
        up = (1 + e_A) * SPEED * np.cos(angle) * np.sin(angle)
        planned = PLANNED_ROUND.get(step)
        return row | {"ball_m_s": _rms(balls[:, 1] - up), "planned": planned}
    if name == TIP:
        true_tip = off_round_end(bat, STARTS[TIP]["z"], SPEED)
        return row | {"ball_m_s": _rms(np.linalg.norm(balls - true_tip, axis=1))}
    true = _truth(scene)
    velocity = np.array([t.ball_velocity[[0, 2]] for t in true])
    came = np.array([SPEED, STARTS[name].get("vz", 0.0)])
    normal = (velocity - came) / np.linalg.norm(velocity - came, axis=1)[:, None]
    approach = np.array([t.contacts[0][3] for t in true])
    return row | {
        "e_A": _rms(((balls - velocity) * normal).sum(axis=1) / approach),
        "ball_m_s": _rms(np.linalg.norm(balls - velocity, axis=1)),
        "bat_rad_s": _rms(np.array([h.rate - t.bat_rate for h, t in zip(hits, true, strict=True)])),
    }


def _naive_hit(name: str, bat: Rod, scene: ShotScene, shot: int, step: float) -> Hit:
    one = scene.start.part(shot)
    if name == ROUND:
        return round_hit(bat, (float(one.x), float(one.y)), SPEED, step=step)
    return hit_of(
        bat,
        (float(one.x), float(one.z)),
        (float(one.vx), float(one.vz)),
        step=step,
        angle=float(one.angle),
        rate=float(one.rate),
        round_end=name == TIP,
    )


def _iterations(count: int, scene: str) -> Row:
    """Return the worst error in e_A over the places, flat hits in steps of 1e-4 s."""
    bat, errors = rod(), []
    for place in np.array(PLACES_IN[scene]) * INCH:
        hit = hit_of(bat, (-AHEAD, place), (SPEED, 0.0), step=1e-4, iterations=count)
        true = bat.efficiency(np.asarray(place))
        errors.append(-hit.velocity[0] / SPEED - float(true))
    planned = PLANNED_ITERATIONS.get((scene, count))
    words = f"{count} iterations" if count > 1 else "1 iteration"
    return _row(NAIVE, scene, words, e_A=float(np.abs(errors).max()), planned=planned)


def _misses(speed: float, step: float, planned: float) -> Iterator[Row]:
    setting = f"{step:.0e} s"
    scene = f"missed at {speed:g} m/s"
    share = missed(rod(), speed, step, 100)
    yield _row(NAIVE, scene, setting, share=share, planned=planned)
    spread = speed * step * (np.arange(SHOTS) + 0.5) / SHOTS
    shots = chart_scene(STARTS[SQUARE], speed, 0.2 + spread, duration=0.03)
    try:
        found = play(shots, "pymunk", settings=PymunkSettings(step=step))
    except InputError:
        yield _row(OURS, scene, f"{setting}: refused")
    else:
        yield _row(OURS, scene, setting, share=1 - len(found.first(STRUCK).shot) / SHOTS)


def _losses(step: float, planned: float) -> Iterator[Row]:
    scene, setting = f"energy lost a second at {SPIN:g} rad/s", f"{step:.0e} s"
    yield _row(NAIVE, scene, setting, share=energy_lost(rod(), SPIN, step), planned=planned)
    # a ball that rests far away limits no step
    alone = chart_scene({"rate": SPIN, "vx": 0.0}, 0.0, np.array([9.0]), duration=1.0)
    try:
        end = play(alone, "pymunk", settings=PymunkSettings(step=step)).at(alone, alone.duration)
    except InputError:
        yield _row(OURS, scene, f"{setting}: refused")
    else:
        yield _row(OURS, scene, setting, share=abs(float(1 - (end.rate[0, 0] / SPIN) ** 2)))


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return what work gives and the least time it took [s], tried again while it is short."""
    times: list[float] = []
    while not times or (len(times) < TRIES and sum(times) < LONG):
        start = time.perf_counter()
        done = work()
        times.append(time.perf_counter() - start)
    return done, min(times)


def draw_motion(rows: list[Row]) -> Figure:
    """Return the figure of rows as `motion_chart` gives them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 4.6), dpi=150, layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=(2.0, 1.0, 1.0))
    _draw_errors(left, rows)
    _draw_misses(middle, rows)
    _draw_losses(right, rows)
    figure.suptitle(TITLE, fontsize=11)
    return figure


def _draw_errors(axes: Any, rows: list[Row]) -> None:
    timed = [row for row in rows if row["us_a_shot"] and row["ball_m_s"] is not None]
    scenes = list(dict.fromkeys(row["scene"] for row in timed))
    for scene, marker in zip(scenes, MARKERS, strict=False):
        for series, colour in COLOURS.items():
            own = [row for row in timed if (row["series"], row["scene"]) == (series, scene)]
            times = [row["us_a_shot"] for row in own]
            errors = [max(row["ball_m_s"], FLOOR) for row in own]
            axes.loglog(times, errors, marker=marker, color=colour, linewidth=1, markersize=5)
            if scene == scenes[-1]:
                for row, time, error in zip(own, times, errors, strict=True):
                    axes.annotate(
                        row["setting"].replace("e-0", "e-"),
                        (time, error),
                        xytext=(4, 5),
                        textcoords="offset points",
                        fontsize=7,
                        rotation=25,
                        color=colour,
                    )
    for series, colour in COLOURS.items():
        axes.plot([], [], color=colour, linewidth=3, label=series)
    for scene, marker in zip(scenes, MARKERS, strict=False):
        axes.plot([], [], color="0.4", marker=marker, linewidth=0, label=scene)
    axes.set_xlabel("time a shot, one core [µs]")
    axes.set_ylabel("error of the ball's velocity [m/s]")
    axes.grid(True, which="major", linewidth=0.3)
    low, high = axes.get_xlim()
    axes.set_xlim(low, 3 * high)
    axes.legend(fontsize=7.5, frameon=False, loc="center right")


def _draw_misses(axes: Any, rows: list[Row]) -> None:
    bat = rod()
    reach = bat.radius + bat.ball_radius
    way = np.linspace(1e-3, 0.3, 300)
    axes.plot(way, np.maximum(0.0, 1 - reach / way), color="0.5", label="1 − (R + r) / (v dt)")
    for row in rows:
        if row["scene"].startswith("missed") and row["share"] is not None:
            speed, step = float(row["scene"].split()[2]), float(row["setting"].split()[0])
            marker = "o" if row["series"] == NAIVE else "x"
            axes.plot(speed * step, row["share"], marker, color=COLOURS[row["series"]])
    axes.axvspan(reach, way[-1], color=COLOURS[OURS], alpha=0.12, linewidth=0)
    axes.annotate("refused by the rung", (0.185, 0.04), ha="center", fontsize=7.5, color="#0072b2")
    axes.set_xlabel("v dt [m]")
    axes.set_ylabel("share of shots that jump the bat")
    axes.legend(fontsize=7.5, frameon=False, loc="upper left")


def _draw_losses(axes: Any, rows: list[Row]) -> None:
    lost = [row for row in rows if row["scene"].startswith("energy") and row["share"] is not None]
    for series in (NAIVE, OURS):
        own = [row for row in lost if row["series"] == series]
        steps = [float(row["setting"].split()[0]) for row in own]
        shares = [max(row["share"], FLOOR) for row in own]
        axes.loglog(steps, shares, marker="o", color=COLOURS[series], linewidth=1, label=series)
    axes.set_xlabel("step [s]")
    axes.set_ylabel("energy a turning bat loses in a second")
    axes.grid(True, which="major", linewidth=0.3)
    axes.legend(fontsize=7.5, frameon=False, loc="center right")
