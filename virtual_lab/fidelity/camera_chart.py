"""Speed against accuracy of every way of locating a ball: OpenCV's estimators beside ours.

All see the same pictures: a ball of 30 pixels' radius that moves 2 in an exposure, at every place
within a pixel, its contrast 96 times a pixel's noise. Errors are root mean squares along an axis;
times are the processor's, on one core.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from virtual_lab.fidelity.camera_drawing import CAMERA_TITLE, CAMERA_WORDS, draw_camera
from virtual_lab.fidelity.camera_errors import score_places, seconds_a_picture
from virtual_lab.fidelity.camera_estimators import ESTIMATORS
from virtual_lab.fidelity.camera_pictures import pictures
from virtual_lab.fidelity.camera_scenes import BACK, HARD, SOFT, Case
from virtual_lab.fidelity.results import SpeedChart
from virtual_lab.output.progress import Progress, quiet

__all__ = ["camera_chart"]

Row = dict[str, Any]
PHASES, REPEATS = 8, 25
PLAIN, STITCHED = "plain ball", "stitched ball"
SCENES: dict[tuple[str, str], Case] = {
    (PLAIN, "flat background"): Case(),
    (PLAIN, "sloping background"): Case(slope=0.5),
    (STITCHED, "back light"): Case(stitched=True, light=BACK),
    (STITCHED, "soft light"): Case(stitched=True, light=SOFT),
    (STITCHED, "hard side light"): Case(stitched=True, light=HARD),
}


def camera_chart(progress: Progress = quiet) -> SpeedChart:
    """Return the chart; its rows are those of `camera_rows`."""
    return _chart(camera_rows(progress))


def _chart(rows: list[dict[str, Any]]) -> SpeedChart:
    return SpeedChart(
        name="camera", title=CAMERA_TITLE, words=CAMERA_WORDS, rows=rows, figure=draw_camera
    )


def camera_rows(progress: Progress = quiet) -> list[Row]:
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
        for (ball, scene), case in SCENES.items():
            progress(f"{ball}, {scene}")
            rows += _scene(ball, scene, replace(case, phases=PHASES, repeats=REPEATS))
    finally:
        cv2.setNumThreads(threads)
    return rows


def _scene(ball: str, scene: str, case: Case) -> list[Row]:
    rows = []
    batch = pictures(case)
    still = pictures(replace(case, quiet=True, phases=4 * PHASES, repeats=1))
    for name, estimator in ESTIMATORS.items():
        spent = seconds_a_picture(estimator, batch.given, rounds=2)
        found = score_places(batch, estimator(batch.given))
        bias = score_places(still, estimator(still.given)).bias if ball == PLAIN else np.inf
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
