"""Chart of error against run time of methods to locate a ball, from OpenCV and this package.

All methods use the same pictures: a ball with a radius of 30 pixels that moves 2 pixels during the
exposure, at positions spread over one pixel, with a contrast of 96 times the noise of a pixel.
Errors are rms errors along an axis. Times are processor times on one core.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.fidelity.camera_errors import score_positions, seconds_per_picture
from virtual_lab.fidelity.camera_estimators import ESTIMATORS, Estimator
from virtual_lab.fidelity.camera_pictures import pictures
from virtual_lab.fidelity.camera_scenes import Case
from virtual_lab.fidelity.results import SpeedChart
from virtual_lab.output.progress import Progress, quiet

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

Row = dict[str, Any]
SCENES: dict[tuple[str, str], Case] = {
    ("plain ball", "flat background"): Case(),
    ("plain ball", "sloping background"): Case(slope=0.5),
    ("stitched ball", "back light"): Case(stitched=True, light="back"),
    ("stitched ball", "soft light"): Case(stitched=True, light="soft"),
    ("stitched ball", "hard side light"): Case(stitched=True, light="hard side"),
}


def camera_chart(
    progress: Progress = quiet,
    scenes: Mapping[tuple[str, str], Case] = SCENES,
    estimators: Mapping[str, Estimator] = ESTIMATORS,
) -> SpeedChart:
    """Return the chart of all methods to locate a ball, one row per scene and method.

    A row has these values:

    * ``rms_px``: rms error along an axis [px].
    * ``limit_px``: smallest possible u of the position of a plain ball along an axis [px].
    * ``bias_over_limit``: largest absolute error along an axis in pictures without noise, over all
      positions of the ball within a pixel, divided by the limit.
    * ``ms_a_frame``: processor time per frame [ms].
    * ``lost``: share of pictures without a position, 0 to 1.
    * ``flagged``: share of pictures with a position and a flag, 0 to 1.
    * ``wrong_unsaid``: share of pictures with an error above 5 u but without a flag, 0 to 1.

    Error and bias are None if no ball was located. The bias is also None for a stitched ball,
    because its pattern differs in each picture.
    """
    import cv2

    rows: list[Row] = []
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        for (ball, scene), case in scenes.items():
            progress(f"{ball}, {scene}")
            rows += _scene(ball, scene, case, estimators)
    finally:
        cv2.setNumThreads(threads)
    return SpeedChart(
        name="camera",
        title="Locating the ball: error against time per frame",
        rows=rows,
        figure=draw_camera,
    )


def _scene(ball: str, scene: str, case: Case, estimators: Mapping[str, Estimator]) -> list[Row]:
    rows = []
    batch = pictures(case)
    still = pictures(replace(case, quiet=True, phases=4 * case.phases, repeats=1))
    for name, estimator in estimators.items():
        spent = seconds_per_picture(estimator, batch.inputs, rounds=2)
        score = score_positions(batch, estimator(batch.inputs))
        bias = score_positions(still, estimator(still.inputs)).bias if not case.stitched else np.inf
        rows.append(
            {
                "ball": ball,
                "scene": scene,
                "estimator": name,
                "rms_px": score.rms if np.isfinite(score.rms) else None,
                "limit_px": batch.limit,
                "bias_over_limit": bias if np.isfinite(bias) else None,
                "ms_a_frame": spent * 1e3,
                "lost": score.lost,
                "flagged": score.flagged,
                "wrong_unsaid": score.unsaid,
            }
        )
    return rows


def draw_camera(rows: list[Row], title: str) -> PageFigure:
    """Return a figure of the rms position error [px] over computing time [ms], one panel per ball.

    `rows` are the rows of `camera_chart`. Each method that locates the ball has its own color. The
    error is along one axis of the picture, and the time is per frame. A method that finds the ball
    in less than half of the pictures is not drawn.
    """
    from matplotlib.lines import Line2D

    from virtual_lab.output.page_figure import PageFigure

    wheel = (
        "#7f7f7f #009e73 #8c564b #bcbd22 #e69f00 #17becf #cc79a7 #d55e00 #aec7e8 #0072b2 #000000"
    )
    colour_of = dict(zip(ESTIMATORS, cycle(wheel.split()), strict=False))
    colours = {name: colour_of[name] for name in dict.fromkeys(row["estimator"] for row in rows)}
    balls = list(dict.fromkeys(row["ball"] for row in rows))
    figure = PageFigure(figsize=(11.5, 5.4), dpi=150, layout="constrained")
    panels = figure.subplots(1, len(balls), sharex=True, sharey=True, squeeze=False)[0]
    for ball, axes in zip(balls, panels, strict=True):
        _panel(axes, [row for row in rows if row["ball"] == ball], colours)
        axes.set_title(ball, fontsize=10)
    panels[0].set_ylabel("error along an axis [px]")
    keys = [
        Line2D([], [], color=colour, linewidth=4, label=name) for name, colour in colours.items()
    ]
    figure.legend(handles=keys, loc="outside right center", fontsize=8, frameon=False)
    figure.suptitle(title, fontsize=11)
    return figure


def _panel(axes: Any, rows: list[Row], colours: dict[str, str]) -> None:
    scenes = dict.fromkeys(row["scene"] for row in rows)
    markers = dict(zip(scenes, "osDX", strict=False))
    points = [row for row in rows if row["rms_px"] is not None and row["lost"] <= 0.5]
    for name, colour in colours.items():
        estimator_rows = [row for row in points if row["estimator"] == name]
        times, errors = ([row[key] for row in estimator_rows] for key in ("ms_a_frame", "rms_px"))
        axes.loglog(times, errors, color=colour, linewidth=0.8, alpha=0.6)
        for row in estimator_rows:
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
    if any(row["flagged"] > 0.5 for row in points):
        keys += axes.plot(
            [], [], "o", color="#c00000", markersize=9, markerfacecolor="none", label="flagged"
        )
    axes.legend(handles=keys, fontsize=8, frameon=False, loc="upper left", ncols=2)
    axes.set_ylim(limit / 2, 150.0)  # leaves room for the legend above the largest error
    ticks = (0.2, 0.5, 1, 2, 5, 10)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("time per frame, one core [ms]")
    axes.grid(True, which="major", linewidth=0.3)
