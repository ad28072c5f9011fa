"""Rms error of e_A per shot, by kind of light, for any method of locating the ball.

`python -m tests.video.scenery.shot_study [CLIPS]` prints it for OpenCV's convex hull and the edge
fit.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.video.scenery.shots import KINDS, Kind, Shot, efficiency, empties, make_shot
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.source import Source
from virtual_lab.video.locate import sharp
from virtual_lab.video.locate.located import Located, Regions

__all__ = ["hull_places", "rms_error", "sharp_places"]

Array = NDArray[np.float64]
Places = tuple[Array, Array]  # x of each frame [px], NaN if there is none, and its u
OPEN = 5  # size of the opening that removes noise [px]
EMPTY = 12  # number of frames without the ball, from which the edge fit estimates the noise


def rms_error(kind: Kind, clips: int, places: Callable[[Shot], Places]) -> float:
    """Return the rms relative error of e_A per shot."""
    errors = []
    for seed in range(clips):
        shot = make_shot(kind, seed)
        errors.append(efficiency(shot, *places(shot)) / shot.efficiency - 1)
    return float(np.sqrt(np.mean(np.square(errors))))


def hull_places(shot: Shot) -> Places:
    """Return x of the convex hull of pixels that differ clearly from the background, u = 1."""
    x = _hulls(shot)[:, 0]
    return x, np.ones_like(x)


def sharp_places(shot: Shot) -> Places:
    """Return x and its u by the edge fit, started from the hulls."""
    hulls = _hulls(shot)
    high, wide = shot.regions.shape[1:]
    behind = [shot.background[r : r + high, c : c + wide] for c, r in shot.corners]
    regions = Regions(
        pixels=shot.regions,
        background=np.stack(behind).astype(np.float32),
        corners=shot.corners.astype(float),
    )
    blurs = np.zeros((len(hulls), 2))
    for side in (shot.times < 0, shot.times > 0):
        usable = side & np.isfinite(hulls).all(axis=1)
        blurs[side] = np.polyfit(shot.times[usable], hulls[usable, :2], 1)[0] * shot.kind.exposure
    start = Located.start(hulls[:, :2], float(np.nanmedian(hulls[:, 2])), blurs)
    samples = empties(shot.kind, EMPTY)
    clip = Clip(
        source=Source(path=Path("made"), declared=0, read=lambda *_: iter(())),
        times=shot.times,
        shape=(800, 1280),
        full_scale=2.0 ** (8 * samples.itemsize) - 1,
        samples=samples,
        sampled=np.arange(EMPTY),
        warnings=(),
    )
    located = sharp.sharp_places(
        clip, regions, start, lens=shot.kind.blur, ball_radius=shot.kind.radius
    )
    return np.where(located.flags == 0, located.x, np.nan), np.hypot(located.x_u, located.pattern_u)


def _hulls(shot: Shot) -> Array:
    """Return middle and radius of the ball's convex hull in each frame, (frame, 3) [px]."""
    kernel = np.ones((OPEN, OPEN), np.uint8)
    places = np.full((len(shot.times), 3), np.nan)
    for k, (column, row) in enumerate(shot.corners):
        region = shot.regions[k].astype(np.float32)
        high, wide = region.shape
        apart = np.abs(region - shot.background[row : row + high, column : column + wide])
        apart[:, max(0, int(shot.bat[0] - column)) :] = 0  # bat, which leaves its position
        level = np.percentile(apart, 75) / 4  # threshold that seams exceed
        mask = cv2.morphologyEx((apart > level).astype(np.uint8), cv2.MORPH_OPEN, kernel)
        points = cv2.findNonZero(mask)
        if points is not None:
            moments = cv2.moments(cv2.convexHull(points))
            area = moments["m00"]
            x, y = column + moments["m10"] / area, row + moments["m01"] / area
            places[k] = x, y, np.sqrt(area / np.pi)
    return places


def main(clips: int) -> None:
    """Print one line per kind of light and method."""
    for name, kind in KINDS.items():
        for places in (hull_places, sharp_places):
            error = 100 * rms_error(kind, clips, places)
            print(f"{name:6s} {places.__name__:12s} {error:.4f} %", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
