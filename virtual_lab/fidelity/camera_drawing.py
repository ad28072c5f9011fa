"""The picture of the ways of locating a ball: error over time a frame, the limit drawn in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["CAMERA_TITLE", "CAMERA_WORDS", "draw_camera"]

CAMERA_TITLE = "Locating the ball: error over time a frame"
CAMERA_WORDS = (
    "Root mean square errors along an axis over places spread evenly within a pixel; radius 30 px, "
    "shift during the exposure 2 px, contrast 96 times a pixel's noise. The limit is Cramér and "
    "Rao's bound of a plain ball: nothing unbiased does better. A marker with a "
    "ring is of an estimator that flags these pictures as not to be trusted; one that lost more "
    "than half of them is not drawn."
)
PEERS = ("#7f7f7f", "#009e73", "#8c564b", "#bcbd22", "#e69f00", "#17becf", "#cc79a7", "#d55e00")
LINES = ("#aec7e8", "#0072b2", "#000000")
MARKERS = "osDX"
FLAGGED = 0.5  # share of pictures
TICKS = (0.2, 0.5, 1, 2, 5, 10)  # ms
ROOM = 150.0  # px: above the worst error there is room for the key


def draw_camera(rows: list[dict[str, Any]]) -> Figure:
    """Return the figure of rows as `camera_chart.measure` gives them."""
    from matplotlib.figure import Figure

    from virtual_lab.fidelity.camera_estimators import CV2, OURS

    names = list(dict.fromkeys(row["estimator"] for row in rows))
    colours = dict(zip([*CV2, *OURS], PEERS + LINES, strict=True))
    colours = {name: colours[name] for name in names}
    balls = list(dict.fromkeys(row["ball"] for row in rows))
    figure = Figure(figsize=(11.5, 5.4), dpi=150, layout="constrained")
    panels = figure.subplots(1, len(balls), sharex=True, sharey=True, squeeze=False)[0]
    for ball, axes in zip(balls, panels, strict=True):
        _panel(axes, [row for row in rows if row["ball"] == ball], colours)
        axes.set_title(ball, fontsize=10)
    panels[0].set_ylabel("error along an axis [px]")
    for name, colour in colours.items():
        panels[0].plot([], [], color=colour, linewidth=4, label=name)
    handles, labels = panels[0].get_legend_handles_labels()
    some = [(h, n) for h, n in zip(handles, labels, strict=True) if n in colours]
    figure.legend(
        [h for h, _ in some],
        [n for _, n in some],
        loc="outside right center",
        fontsize=8,
        frameon=False,
    )
    figure.suptitle(CAMERA_TITLE, fontsize=11)
    return figure


def _panel(axes: Any, rows: list[dict[str, Any]], colours: dict[str, str]) -> None:
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    drawn = [row for row in rows if row["rms_px"] is not None and row["lost"] <= FLAGGED]
    for name, colour in colours.items():
        own = [row for row in drawn if row["estimator"] == name]
        times, errors = ([row[key] for row in own] for key in ("ms_a_frame", "rms_px"))
        axes.loglog(times, errors, color=colour, linewidth=0.8, alpha=0.6)
        for row in own:
            place = row["ms_a_frame"], row["rms_px"]
            marker = MARKERS[scenes.index(row["scene"])]
            axes.plot(*place, marker=marker, color=colour, markersize=6)
            if row["flagged"] > FLAGGED:
                axes.plot(
                    *place, marker="o", color="#c00000", markersize=11, markerfacecolor="none"
                )
    limit = max(row["limit_px"] for row in rows)
    axes.axhline(limit, color="black", linestyle="--", linewidth=1)
    axes.annotate(
        f"Cramér–Rao limit, {limit:.4f} px",
        (0.98, limit),
        xycoords=("axes fraction", "data"),
        xytext=(0, -10),
        textcoords="offset points",
        ha="right",
        fontsize=8,
    )
    keys = [
        axes.plot([], [], color="0.4", marker=marker, linewidth=0, label=scene)[0]
        for scene, marker in zip(scenes, MARKERS, strict=False)
    ]
    if any(row["flagged"] > FLAGGED for row in drawn):
        keys += axes.plot(
            [], [], "o", color="#c00000", markersize=9, markerfacecolor="none", label="flagged"
        )
    axes.legend(handles=keys, fontsize=8, frameon=False, loc="upper left", ncols=2)
    axes.set_ylim(limit / 2, ROOM)
    axes.set_xticks(TICKS, [f"{tick:g}" for tick in TICKS])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("time a frame, one core [ms]")
    axes.grid(True, which="major", linewidth=0.3)
