"""Rms error of e_A a shot by kind of light, for any way of placing the ball.

`python -m tests.video.scenery.shot_study [CLIPS]` prints it for OpenCV's convex hull.
"""

import sys
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.video.scenery.shots import KINDS, Kind, Shot, efficiency, make_shot

__all__ = ["hull_places", "rms_error"]

Array = NDArray[np.float64]
OPEN = 5  # px, of the opening that takes noise off


def rms_error(kind: Kind, clips: int, places: Callable[[Shot], Array]) -> float:
    """Return the rms relative error of e_A a shot; `places` gives x of each frame, or NaN."""
    errors = []
    for seed in range(clips):
        shot = make_shot(kind, seed)
        errors.append(efficiency(shot, places(shot)) / shot.efficiency - 1)
    return float(np.sqrt(np.mean(np.square(errors))))


def hull_places(shot: Shot) -> Array:
    """Return x of the convex hull of what differs from the background by a quarter of the ball."""
    kernel = np.ones((OPEN, OPEN), np.uint8)
    places = np.full(len(shot.times), np.nan)
    for k, (column, row) in enumerate(shot.corners):
        region = shot.regions[k].astype(np.float32)
        high, wide = region.shape
        apart = np.abs(region - shot.background[row : row + high, column : column + wide])
        apart[:, max(0, int(shot.bat[0] - column)) :] = 0  # the bat leaves its place
        level = np.percentile(apart, 75) / 4  # seams stay above it
        mask = cv2.morphologyEx((apart > level).astype(np.uint8), cv2.MORPH_OPEN, kernel)
        points = cv2.findNonZero(mask)
        if points is not None:
            moments = cv2.moments(cv2.convexHull(points))
            places[k] = column + moments["m10"] / moments["m00"]
    return places


def main(clips: int) -> None:
    """Print a line a kind."""
    for name, kind in KINDS.items():
        print(f"{name:6s} {100 * rms_error(kind, clips, hull_places):.4f} %", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
