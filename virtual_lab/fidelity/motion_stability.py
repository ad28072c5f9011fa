"""Where pymunk holds, left to itself and as the motion's dear rung: maps of the step.

A cell is a handful of shots whose contacts fall evenly into a step, on a rigid bat of one radius,
at rest and struck 6 in from its tip; of the slop it is swung and the ball aslant, of iterations it
is struck 20 in from the tip. Errors are in the ball's velocity after the contact, over the speed
of approach, against the closed form. What the rung refuses is carried out all the same, to see
whether it is right to.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.fidelity.motion_chart import STARTS, SWUNG, chart_scene, rod
from virtual_lab.fidelity.naive_pymunk import hit_of, off_round_end, round_hit
from virtual_lab.fidelity.results import StabilityMap
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.tables import table_text
from virtual_lab.simulation.motion import play
from virtual_lab.simulation.motion.played import BAT
from virtual_lab.simulation.motion.pymunk_scene import PymunkSettings, carry
from virtual_lab.simulation.motion.scene import ShotScene
from virtual_lab.units import INCH, MPH

__all__ = ["motion_stability"]

Array = NDArray[np.float64]
Row = dict[str, Any]
ALONE, RUNG = "pymunk alone", "pymunk rung"
STEPS = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
SHOTS = {ALONE: 8, RUNG: 3}
SPEED_MPH, AHEAD, AFTER = 60.0, 0.12, 5e-3  # mph, m, s
GOOD, INACCURATE, UNSTABLE = "good", "inaccurate", "unstable"
MARKS = {GOOD: ".", INACCURATE: "o", UNSTABLE: "X"}
COLOURS = {GOOD: "#6baed6", INACCURATE: "#f16913", UNSTABLE: "#800026"}
HATCH = "//"
TOLERANCE = 1e-4  # of a good cell, as of e_A
RUNAWAY = 0.5  # error of a ball that jumped the bat, or flew off with more than it brought

SPEED, PLACE, ACROSS = "speed [mph]", "z [in]", "off the axis [mm]"
SLOP, ITERATIONS = "slop [m]", "iterations"
AXES: dict[str, tuple[float, ...]] = {
    SPEED: (10, 20, 40, 60, 90, 120, 160, 200),
    PLACE: (0.2, 0.5, 0.8, 1.1, 2, 6, 12, 20),
    ACROSS: (0, 0.1, 1, 3, 10, 20, 40, 60),
    SLOP: (0, 1e-7, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1),
    ITERATIONS: (1, 2, 3, 5, 8, 10, 20, 50),
}


def motion_stability(progress: Progress = quiet) -> StabilityMap:
    """Return the maps; their rows are those of `motion_cells`."""
    return _maps(motion_cells(progress))


def _maps(rows: list[dict[str, Any]]) -> StabilityMap:
    return StabilityMap(
        title="stability of the motion", text=_maps_text(rows), rows=rows, picture=_draw
    )


def motion_cells(progress: Progress = quiet) -> list[dict[str, Any]]:
    """Return a row a cell: its place, its state, its worst error, and whether it is refused.

    Of a refused one state and error are what it would have come to.
    """
    rows = []
    for axis, values in AXES.items():
        progress(axis)
        for method in (ALONE, RUNG):
            cells = ((step, value) for step in STEPS for value in values)
            rows += [_cell(axis, method, step, value) for step, value in cells]
    return rows


def _maps_text(rows: list[Row]) -> str:
    """Return a table a map for a terminal, the states by their marks."""
    key = ", ".join(f"{mark} {state}" for state, mark in MARKS.items())
    parts = [f"down, steps [s]; {key}; in brackets refused, and what it would be"]
    for axis in AXES:
        for method in (ALONE, RUNG):
            own = [row for row in rows if (row["map"], row["method"]) == (axis, method)]
            table = []
            for step in dict.fromkeys(row["step"] for row in own):
                marks = [(row["value"], _mark(row)) for row in own if row["step"] == step]
                table.append({"step": step} | {f"{value:g}": mark for value, mark in marks})
            parts.append(f"{method}: {axis}\n{table_text(table)}")
    return "\n\n".join(parts)


def _mark(row: Row) -> str:
    mark = MARKS[row["state"]]
    return f"({mark})" if row["refused"] else mark


def _cell(axis: str, method: str, step: float, value: float) -> Row:
    """Return what the shots of a cell come to."""
    speed = (value if axis == SPEED else SPEED_MPH) * MPH
    # iterations show where the joint works hard: by the grip
    place = 20 * INCH if axis == ITERATIONS else 6 * INCH
    start = dict(STARTS[SWUNG]) if axis == SLOP else {"z": place}
    start |= {PLACE: {"z": value * INCH}, ACROSS: {"y": value * 1e-3}}.get(axis, {})
    count = SHOTS[method]
    ahead = AHEAD + speed * step * (np.arange(count) + 0.5) / count
    scene = chart_scene(start, speed, ahead, float(ahead.max()) / speed + AFTER)
    settings = PymunkSettings(
        step=step,
        slop=value if axis == SLOP else 1e-5,
        iterations=int(value) if axis == ITERATIONS else 10,
    )
    refused = False
    if method == RUNG:
        refused, error = _by_rung(scene, settings)
    else:
        error = _alone(axis, scene, settings)
    worst = float(np.max(error)) if np.isfinite(error).all() else None
    if worst is None or worst > RUNAWAY:
        state = UNSTABLE
    else:
        state = GOOD if worst <= TOLERANCE else INACCURATE
    row = {"map": axis, "method": method, "value": value, "step": step, "refused": refused}
    return row | {"state": state, "shots": count, "worst_error": worst}


def _by_rung(scene: ShotScene, settings: PymunkSettings) -> tuple[bool, Array]:
    refused = False
    try:
        settings.check(scene)
    except InputError:
        refused = True
    found, true = (each.first(BAT) for each in (carry(scene, settings), play(scene, "closed-form")))
    gap = np.array(found.state[3:6]) - np.array(true.state[3:6])
    return refused, np.linalg.norm(gap, axis=0) / true.speed


def _alone(axis: str, scene: ShotScene, settings: PymunkSettings) -> Array:
    """Return the errors of pymunk that does the collision too."""
    bat, start, true = rod(), scene.start, play(scene, "closed-form").first(BAT)
    thrown = np.array(true.state[3:6]).T
    velocity = thrown[:, [0, 2]]
    found = np.empty_like(velocity)
    for shot in range(scene.shots):
        at, speed = float(start.x[shot]), float(start.vx[shot])
        if axis == ACROSS:  # in the section of the barrel: x and y
            across = at, float(start.y[shot])
            hit = round_hit(bat, across, speed, step=settings.step)
            velocity[shot] = thrown[shot, :2]
        else:
            hit = hit_of(
                bat,
                (at, float(start.z[shot])),
                (speed, float(start.vz[shot])),
                step=settings.step,
                iterations=settings.iterations,
                slop=settings.slop,
                angle=float(start.angle[shot]),
                rate=float(start.rate[shot]),
                round_end=axis == PLACE,
            )
        if axis == PLACE:
            velocity[shot] = off_round_end(bat, float(start.z[shot]), speed)
        found[shot] = hit.velocity
    return np.asarray(np.linalg.norm(found - velocity, axis=1) / true.speed)


def _draw(rows: list[Row], path: Path) -> None:
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(14, 5.8), dpi=130, layout="constrained")
    panels = figure.subplots(2, len(AXES), squeeze=False)
    for line, method in zip(panels, (ALONE, RUNG), strict=True):
        for axis, axes in zip(AXES, line, strict=True):
            own = [row for row in rows if (row["map"], row["method"]) == (axis, method)]
            _draw_map(axes, own)
            axes.set_xlabel(axis, fontsize=9)
        line[0].set_ylabel(f"{method}: step [s]", fontsize=9)
    keys = [Patch(color=colour, label=state) for state, colour in COLOURS.items()]
    keys.append(Patch(fill=False, hatch=HATCH, edgecolor="0.5", label="refused by the rung"))
    figure.legend(handles=keys, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    title = (
        "Ball off a bat by pymunk alone and by the motion's pymunk rung; good: the ball's velocity "
        f"to {TOLERANCE:.0e} of the speed of approach, unstable: not to {RUNAWAY:g}"
    )
    figure.suptitle(title, fontsize=11)
    figure.savefig(path)


def _draw_map(axes: Any, rows: list[Row]) -> None:
    from matplotlib.patches import Rectangle

    values = list(dict.fromkeys(row["value"] for row in rows))
    steps = list(dict.fromkeys(row["step"] for row in rows))
    for row in rows:
        corner = values.index(row["value"]) - 0.5, steps.index(row["step"]) - 0.5
        look: dict[str, Any] = {"edgecolor": "white", "linewidth": 1.0}
        if row["refused"]:
            look = {"hatch": HATCH, "edgecolor": "0.6", "linewidth": 0.0}
        axes.add_patch(Rectangle(corner, 1, 1, facecolor=COLOURS[row["state"]], **look))
    axes.set_xlim(-0.5, len(values) - 0.5)
    axes.set_ylim(len(steps) - 0.5, -0.5)
    axes.set_xticks(range(len(values)), [_short(value) for value in values])
    axes.set_yticks(range(len(steps)), [_short(step) for step in steps])
    axes.tick_params(length=0, labelsize=7.5)
    axes.spines[:].set_visible(False)


def _short(value: float) -> str:
    return f"{value:.0e}".replace("e-0", "e-") if 0 < value < 0.05 else f"{value:g}"
