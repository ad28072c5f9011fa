"""trackpy on the same pictures: as in its guide, without characterization, and from a start."""

from __future__ import annotations

import numpy as np

from virtual_lab.fidelity.camera_estimators import Estimator, Picture, Place, by_picture

__all__ = ["TRACKPY"]

PAD = 20  # empty margin [pixels], because trackpy finds no ball near an edge
BEYOND = 11  # width of its window beyond the ball's diameter [pixels]
WHITE = 200.0  # gray value of the ball
SMOOTHED = 1 / 3  # smoothing in radii; with less, a plateau has no peak


def _located(picture: Picture, *, characterize: bool) -> Place | None:
    import trackpy

    diameter = 2 * round(picture.radius) + BEYOND
    grey = np.pad(np.round(np.clip(picture.matte, 0, 1) * WHITE).astype(np.uint8), PAD)
    table = trackpy.locate(
        grey,
        diameter,
        topn=1,
        noise_size=round(SMOOTHED * picture.radius),
        characterize=characterize,
    )
    if not len(table):
        return None
    return float(table["x"].iloc[0]) - PAD, float(table["y"].iloc[0]) - PAD


def _refined(picture: Picture) -> Place | None:
    from trackpy.refine import refine_com

    grey = np.pad(np.clip(picture.matte, 0, 1) * WHITE, PAD).astype(np.float32)
    start = np.array([[picture.y + PAD, picture.x + PAD]])
    reach = round(picture.radius) + BEYOND // 2
    table = refine_com(grey, grey, reach, start, engine="numba", characterize=False)
    return float(table["x"].iloc[0]) - PAD, float(table["y"].iloc[0]) - PAD


TRACKPY: dict[str, Estimator] = {
    "trackpy locate": by_picture(lambda picture: _located(picture, characterize=True)),
    "trackpy locate, places alone": by_picture(
        lambda picture: _located(picture, characterize=False)
    ),
    "trackpy refine_com": by_picture(_refined),
}
