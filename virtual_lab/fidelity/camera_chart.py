"""Speed against accuracy of every way of locating a ball: OpenCV's estimators beside ours.

All see the same pictures: a ball of 30 pixels' radius that moves 2 in an exposure, at every place
within a pixel, its contrast 96 times a pixel's noise. Errors are root mean squares along an axis;
times are the processor's, on one core.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from virtual_lab.fidelity.camera_drawing import draw_camera
from virtual_lab.fidelity.camera_errors import score_places, seconds_a_picture
from virtual_lab.fidelity.camera_estimators import ESTIMATORS, Estimator
from virtual_lab.fidelity.camera_pictures import pictures
from virtual_lab.fidelity.camera_scenes import Case
from virtual_lab.fidelity.results import SpeedChart
from virtual_lab.output.progress import Progress, quiet

__all__ = ["camera_chart"]

Row = dict[str, Any]
SCENES: dict[tuple[str, str], Case] = {
    ("plain ball", "flat background"): Case(),
    ("plain ball", "sloping background"): Case(slope=0.5),
    ("stitched ball", "back light"): Case(stitched=True, light="back"),
    ("stitched ball", "soft light"): Case(stitched=True, light="soft"),
    ("stitched ball", "hard side light"): Case(stitched=True, light="hard side"),
}


def camera_chart(progress: Progress = quiet) -> SpeedChart:
    """Return the chart; its rows are those of `camera_rows`."""
    return _chart(camera_rows(progress))


def _chart(rows: list[dict[str, Any]]) -> SpeedChart:
    return SpeedChart(
        name="camera",
        title="Locating the ball: error over time a frame",
        words="Root mean square errors along an axis over places spread evenly within a pixel; "
        "radius 30 px, shift during the exposure 2 px, contrast 96 times a pixel's noise. The "
        "limit is Cramér and Rao's bound of a plain ball: nothing unbiased does better. A marker "
        "with a ring is of an estimator that flags these pictures as not to be trusted; one that "
        "lost more than half of them is not drawn.",
        rows=rows,
        figure=draw_camera,
    )


def camera_rows(
    progress: Progress = quiet,
    scenes: Mapping[tuple[str, str], Case] = SCENES,
    estimators: Mapping[str, Estimator] = ESTIMATORS,
) -> list[Row]:
    """Return a row a scene and estimator: error and limit [px], bias over it, time a frame [ms].

    Bias is that of the worst phase of a pixel, without noise; of a stitched ball, whose pattern is
    another in each picture, there is none. Shares are of pictures: lost without a place, flagged,
    and off by more than five of their own standard uncertainties without a flag. What does not
    apply is None.
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
    return rows


def _scene(ball: str, scene: str, case: Case, estimators: Mapping[str, Estimator]) -> list[Row]:
    rows = []
    batch = pictures(case)
    still = pictures(replace(case, quiet=True, phases=4 * case.phases, repeats=1))
    for name, estimator in estimators.items():
        spent = seconds_a_picture(estimator, batch.given, rounds=2)
        found = score_places(batch, estimator(batch.given))
        bias = score_places(still, estimator(still.given)).bias if not case.stitched else np.inf
        rows.append(
            {
                "ball": ball,
                "scene": scene,
                "estimator": name,
                "rms_px": found.rms if np.isfinite(found.rms) else None,
                "limit_px": batch.limit,
                "bias_over_limit": bias if np.isfinite(bias) else None,
                "ms_a_frame": spent * 1e3,
                "lost": found.lost,
                "flagged": found.flagged,
                "wrong_unsaid": found.unsaid,
            }
        )
    return rows
