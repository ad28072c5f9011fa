"""A ball that something known hides in part: located anew by what is seen of it.

What stands before the ball is known only once the ball was followed, for the ball hides it, too.
So the ball is followed first, and a second time in those frames that its cover comes near. Whether
the ball is before the cover or behind it does not matter: a rim that is not used costs less than
one that is taken for another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.background import ENOUGH, Image
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.locate.located import Flag, Located, part_of, put
from virtual_lab.video.locate.regions import Cover, Locator
from virtual_lab.video.track.tracking import (
    AT_ONCE,
    Spotted,
    Tracked,
    followed,
    locate_in,
)

__all__ = ["track_covered"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NEAR = 12.0  # pixels about the ball in which a fit looks at what is behind it
NEIGHBOURS = 6  # frames that tell where a hidden ball is to begin with
ABOUT = 8.0  # pixels about the ball that tell nothing of what is behind it
SPOILT = Flag.NOT_FOUND | Flag.POOR_FIT


def track_covered(
    tracked: Tracked,
    calibration: ClipCalibration,
    locator: Locator,
    cover: Cover,
    *,
    progress: Callable[[str], None] = lambda _: None,
) -> Tracked:
    """Return the way of a ball of which a part is hidden in some frames.

    A frame in which it is counts all the same: its place rests on the rim that is seen, its
    uncertainty knows how little that is, and OVERLAP is raised where more than 2 % is hidden.

    Parameters
    ----------
    tracked
        The ball followed as if nothing hid it.
    calibration, locator
        As they were for that; the locator heeds the regions' mask.
    cover
        What hides it.
    progress
        Told what is under way.

    Raises
    ------
    InputError
        Too few frames locate the ball.
    """
    whole, located, unseen = _every(tracked)
    good = located.flags == 0
    first = _flown(tracked, whole, located, good, ~good)
    bare, stood, unknown = _uncovered(whole, located, good, unseen, cover)
    near = _near(whole, first, _And(cover, stood))
    if not near.any():
        return tracked
    progress(f"locating what is seen of the ball in {int(near.sum())} frames")
    whole, clip, left = replace(whole, background=bare), whole.clip, near
    known = _And(cover, unknown)
    # it flies on as before; or it is being struck, and is where it was spotted
    for start in (_flown(tracked, whole, located, good & ~near, near), whole.start):
        for some in _rounds(left, ~near & ~unseen):
            begin = part_of(start, some)
            again = locate_in(clip, whole.frames[some], whole.background, begin, locator, known)
            wanted = np.flatnonzero(left[some])
            located = put(part_of(again, wanted), some[wanted], located)
        left = near & _spoilt(located) & ~unseen
    judged = np.uint16(Flag.JUMP | Flag.CONTACT)
    located = replace(located, flags=located.flags & ~judged)
    kept = np.flatnonzero(~unseen | (near & ~_spoilt(located)))
    spotted = replace(whole, frames=whole.frames[kept], start=part_of(first, kept))
    return followed(spotted, part_of(located, kept), calibration, covered=near[kept])


def _every(tracked: Tracked) -> tuple[Spotted, Located, Mask]:
    """Return the ball in every frame between its first and last, and where it was not seen."""
    first, last = int(tracked.frames[0]), int(tracked.frames[-1])
    numbers = np.arange(first, last + 1)
    known = tracked.frames - first
    unseen = np.ones(len(numbers), bool)
    unseen[known] = False
    like = np.zeros(len(numbers), np.intp)  # the nearest frame of the same flight that shows it
    inward, seen_inward = (
        _inward(tracked, tracked.clip.times[each]) for each in (numbers, tracked.frames)
    )
    for side in (True, False):
        own, seen = inward == side, np.flatnonzero(seen_inward == side)
        if seen.size:
            place = np.interp(numbers[own], tracked.frames[seen], np.arange(seen.size))
            like[own] = seen[np.rint(place).astype(int)]
    located = part_of(tracked.located, like)
    located = replace(
        located,
        x=np.where(unseen, np.nan, located.x),
        y=np.where(unseen, np.nan, located.y),
        flags=np.where(unseen, np.uint16(Flag.NOT_FOUND), located.flags),
    )
    whole = Spotted(
        clip=tracked.clip,
        frames=numbers,
        start=part_of(tracked.start, like),
        exposure=tracked.exposure,
        background=tracked.background,
    )
    return whole, located, unseen


@dataclass(frozen=True, slots=True)
class _And:
    """A cover, and pixels that no frame may use."""

    cover: Cover
    always: Mask

    def hidden(self, frame: int) -> Mask:
        return self.cover.hidden(frame) | self.always


def _uncovered(
    whole: Spotted, located: Located, good: Mask, unseen: Mask, cover: Cover
) -> tuple[Image, Mask, Mask]:
    """Return the background without a cover, where that stood, and what of it was never bare.

    Where a cover moved the background was a mean of both; and a ball not found beside it left its
    picture there. A frame that should show the ball, and does not well, tells nothing.
    """
    clip, place = whole.clip, {int(number): k for k, number in enumerate(whole.frames)}
    rows, columns = np.ogrid[: clip.shape[0], : clip.shape[1]]
    total, count = np.zeros(clip.shape), np.zeros(clip.shape, np.intp)
    stood = np.zeros(clip.shape, bool)
    for number, sample in zip(clip.sampled.tolist(), clip.grey_samples(), strict=True):
        hidden = cover.hidden(number)
        stood |= hidden
        free = ~hidden
        k = place.get(number)
        if k is not None:
            if unseen[k] or not good[k]:
                continue
            reach = located.radius[k] + np.hypot(located.blur_x[k], located.blur_y[k]) / 2 + ABOUT
            free &= np.hypot(columns - located.x[k], rows - located.y[k]) > reach
        total += np.where(free, sample, 0)
        count += free
    enough = count >= ENOUGH
    bare = np.where(enough, total / np.maximum(count, 1), whole.background)
    return bare.astype(np.float32), stood, stood & ~enough


def _inward(tracked: Tracked, t: Array) -> Mask:
    """Return which times are before the contact."""
    legs = tracked.legs
    return t < legs.flight_in.time if legs.flight_out else np.ones(len(t), bool)


def _near(whole: Spotted, start: Located, cover: Cover) -> Mask:
    """Return the frames in which something is hidden of what a fit looks at, (frame,)."""
    reach = start.radius + np.hypot(start.blur_x, start.blur_y) / 2 + NEAR
    near = []
    for number, x, y, far in zip(whole.frames, start.x, start.y, reach, strict=True):
        top, left = max(0, int(y - far)), max(0, int(x - far))
        hidden = cover.hidden(int(number))[top : int(y + far) + 2, left : int(x + far) + 2]
        row, column = np.nonzero(hidden)
        near.append(bool((np.hypot(column + left - x, row + top - y) < far).any()))
    return np.array(near)


def _flown(tracked: Tracked, whole: Spotted, located: Located, told: Mask, wanted: Mask) -> Located:
    """Return starts, those wanted on the line through the nearest frames that tell of a flight."""
    start, t = whole.start, whole.times
    x, y = start.x.copy(), start.y.copy()
    inward = _inward(tracked, t)
    for side in (True, False):
        flight = inward == side
        others = np.flatnonzero(flight & told)
        if len(others) < 2:
            continue
        for k in np.flatnonzero(flight & wanted):
            some = others[np.argsort(np.abs(t[others] - t[k]), kind="stable")[:NEIGHBOURS]]
            for there, places in ((x, located.x), (y, located.y)):
                there[k] = np.polynomial.Polynomial.fit(t[some] - t[k], places[some], 1)(0.0)
    return replace(start, x=x, y=y)


def _rounds(hidden: Mask, whole: Mask) -> Iterator[NDArray[np.intp]]:
    """Yield frames to locate together: hidden ones, and as many others as tell the ball's size."""
    wanted, others = np.flatnonzero(hidden), np.flatnonzero(whole)
    for first in range(0, len(wanted), AT_ONCE // 2):
        some = wanted[first : first + AT_ONCE // 2]
        closest = np.argsort(np.abs(others - some.mean()), kind="stable")[: AT_ONCE - len(some)]
        yield np.sort(np.concatenate([some, others[closest]]))


def _spoilt(located: Located) -> Mask:
    return (located.flags & np.uint16(SPOILT)) > 0
