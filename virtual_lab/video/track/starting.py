"""From what was found roughly to where a locator starts: places, size, blur, exposure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.background import Image
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.reading import Frame
from virtual_lab.video.locate.located import Located
from virtual_lab.video.track.legs import Places, split
from virtual_lab.video.track.lines import Air

__all__ = ["starts"]

Array = NDArray[np.float64]

TRIED = 8  # frames from which an exposure is read
FAINT = 0.1  # of the ball's brightness: less is noise
ROUGH = 0.5  # pixels, standard uncertainty of a spot's place


def starts(
    clip: Clip, background: Image, found: NDArray[np.void], exposure: float | None
) -> tuple[Located, float]:
    """Return where to start in each frame, and the exposure [s], read off the blur if unknown.

    Parameters
    ----------
    found
        The ball's blob in each frame that shows it, an array of `find.blobs.BLOB`.
    """
    frames = found["frame"].astype(np.intp)
    t = clip.times[frames]
    places = np.stack([found["picture_x"], found["picture_y"]], axis=1)
    whole = found[~found["cut"]] if not found["cut"].all() else found
    rough = Places(
        t=t, places=places, u=np.full(len(t), ROUGH), pattern_u=0.0, exposure=exposure or 0.0
    )
    legs = split(rough, Air(), stamped=False)
    velocity = np.tile(legs.flight_in.velocity, (len(t), 1))
    if legs.flight_out:
        velocity[t > legs.flight_out.time] = legs.flight_out.velocity
    unknown, zero = np.full(len(t), np.nan), np.zeros(len(t))
    start = Located(
        x=places[:, 0],
        y=places[:, 1],
        radius=np.full(len(t), float(np.median(whole["radius"]))),
        x_u=unknown,
        y_u=unknown,
        blur_x=zero,
        blur_y=zero,
        chi_square=unknown,
        flags=np.zeros(len(t), np.uint16),
    )
    if exposure is None:
        exposure = _exposure(clip, background, start, frames, velocity)
    return replace(
        start, blur_x=velocity[:, 0] * exposure, blur_y=velocity[:, 1] * exposure
    ), exposure


def _exposure(
    clip: Clip, background: Image, start: Located, frames: NDArray[np.intp], velocity: Array
) -> float:
    """Return the exposure that makes the ball as long as it is [s], a frame's at most.

    The matte of a blurred disc has L²/12 more variance along the blur L than across it.
    """
    speed = np.hypot(*velocity.T)
    rows, columns = background.shape
    reach = 1.6 * start.radius + 4
    inside = (start.x > reach) & (start.x < columns - reach)
    inside &= (start.y > reach) & (start.y < rows - reach)
    fast = np.flatnonzero(inside & (speed > 0.5 * speed.max()))
    if not fast.size:
        return 0.0
    tried = fast[np.unique(np.linspace(0, fast.size - 1, min(fast.size, TRIED)).astype(int))]
    squares = []
    for k, (_, frame) in zip(tried, clip.chosen(frames[tried]), strict=True):
        squares.append(12 * _longer(frame, background, start, int(k), velocity[k] / speed[k]))
    squared = float(np.median(squares)) / float(np.mean(speed[tried] ** 2))
    step = float(np.median(np.diff(clip.times)))
    return min(float(np.sqrt(max(squared, 0.0))), step)


def _longer(frame: Frame, background: Image, start: Located, k: int, along: Array) -> float:
    """Return the variance of a ball's matte along a direction, less that across it [pixels²]."""
    x, y, radius = float(start.x[k]), float(start.y[k]), float(start.radius[k])
    reach = 1.6 * radius + 4
    place = np.s_[int(y - reach) : int(y + reach) + 1, int(x - reach) : int(x + reach) + 1]
    rows, columns = np.mgrid[place]
    away = np.hypot(columns - x, rows - y)
    off = frame[place] - background[place]
    light = float(np.median(off[away < 0.5 * radius]))
    share = np.clip(np.where(away < reach, off / light, 0.0), 0.0, 1.0) if light else off * 0.0
    share[share < FAINT] = 0.0
    total = max(float(share.sum()), 1.0)
    mean_x, mean_y = (share * columns).sum() / total, (share * rows).sum() / total
    u = (columns - mean_x) * along[0] + (rows - mean_y) * along[1]
    w = (rows - mean_y) * along[0] - (columns - mean_x) * along[1]
    return float((share * (u**2 - w**2)).sum() / total)
