"""The picture of the motion rungs: error over time a shot, missed shots, energy lost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["CLOSED", "NAIVE", "OURS", "SCIPY", "TITLE", "WORDS", "draw"]

NAIVE = "pymunk alone"
OURS = "pymunk rung"
CLOSED = "closed form"
SCIPY = "solve_ivp"
TITLE = "Motion: the rungs beside pymunk left to itself"
WORDS = (
    "Root mean square errors over starts spread evenly over a step, against scipy's integration "
    "of the same equations: e_A, the ball's velocity (off a round barrel and alone, its upward "
    "part), the bat's rate. Shares are of shots missed or of energy lost. Planned is what was "
    "reckoned with before, of pymunk alone. No error at all is drawn at 1e-16."
)
COLOURS = {NAIVE: "#d55e00", OURS: "#0072b2", CLOSED: "#009e73"}
MARKERS = "osd^"
FLOOR = 1e-16  # m/s: drawn for no error at all


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Return the figure of rows as `motion_chart.measure` gives them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 4.6), dpi=150, layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=(2.0, 1.0, 1.0))
    _errors(left, rows)
    _misses(middle, rows)
    _losses(right, rows)
    figure.suptitle(TITLE, fontsize=11)
    return figure


def _errors(axes: Any, rows: list[dict[str, Any]]) -> None:
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


def _misses(axes: Any, rows: list[dict[str, Any]]) -> None:
    from virtual_lab.fidelity.motion_chart import rod

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


def _losses(axes: Any, rows: list[dict[str, Any]]) -> None:
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
