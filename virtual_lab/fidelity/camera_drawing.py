"""The picture of the ways of locating a ball: error over time a frame, the limit drawn in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_camera"]


def draw_camera(rows: list[dict[str, Any]], title: str) -> Figure:
    """Return the figure of rows as `camera_chart` gives them."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from virtual_lab.fidelity.camera_estimators import ESTIMATORS

    wheel = (
        "#7f7f7f #009e73 #8c564b #bcbd22 #e69f00 #17becf #cc79a7 #d55e00 #aec7e8 #0072b2 #000000"
    )
    named = dict(zip(ESTIMATORS, wheel.split(), strict=True))
    colours = {name: named[name] for name in dict.fromkeys(row["estimator"] for row in rows)}
    balls = list(dict.fromkeys(row["ball"] for row in rows))
    figure = Figure(figsize=(11.5, 5.4), dpi=150, layout="constrained")
    panels = figure.subplots(1, len(balls), sharex=True, sharey=True, squeeze=False)[0]
    for ball, axes in zip(balls, panels, strict=True):
        _panel(axes, [row for row in rows if row["ball"] == ball], colours)
        axes.set_title(ball, fontsize=10)
    panels[0].set_ylabel("error along an axis [px]")
    keys = [Line2D([], [], color=own, linewidth=4, label=name) for name, own in colours.items()]
    figure.legend(handles=keys, loc="outside right center", fontsize=8, frameon=False)
    figure.suptitle(title, fontsize=11)
    return figure


def _panel(axes: Any, rows: list[dict[str, Any]], colours: dict[str, str]) -> None:
    scenes = dict.fromkeys(row["scene"] for row in rows)
    markers = dict(zip(scenes, "osDX", strict=False))
    drawn = [row for row in rows if row["rms_px"] is not None and row["lost"] <= 0.5]
    for name, colour in colours.items():
        own = [row for row in drawn if row["estimator"] == name]
        times, errors = ([row[key] for row in own] for key in ("ms_a_frame", "rms_px"))
        axes.loglog(times, errors, color=colour, linewidth=0.8, alpha=0.6)
        for row in own:
            place = row["ms_a_frame"], row["rms_px"]
            axes.plot(*place, marker=markers[row["scene"]], color=colour, markersize=6)
            if row["flagged"] > 0.5:
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
        for scene, marker in markers.items()
    ]
    if any(row["flagged"] > 0.5 for row in drawn):
        keys += axes.plot(
            [], [], "o", color="#c00000", markersize=9, markerfacecolor="none", label="flagged"
        )
    axes.legend(handles=keys, fontsize=8, frameon=False, loc="upper left", ncols=2)
    axes.set_ylim(limit / 2, 150.0)  # above the worst error there is room for the key
    ticks = (0.2, 0.5, 1, 2, 5, 10)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("time a frame, one core [ms]")
    axes.grid(True, which="major", linewidth=0.3)
