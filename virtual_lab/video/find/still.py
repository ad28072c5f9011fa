"""The still frame: what stands behind all that moves, and how far each picture drifts from it.

A phone held by hand shifts its picture by up to a pixel a frame: the samples are laid upon each
other before their median is taken, and each picture is shifted back before it is compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, repeat
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from virtual_lab.units import Array
from virtual_lab.video.clips.reading import grey_of
from virtual_lab.video.clips.source import Frame
from virtual_lab.video.find.drift import (
    BLACK,
    FAR_OFF,
    Edges,
    at_rim,
    edges_of,
    leap_of,
    matrix_of,
    upper_median,
)

Image = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class _StillSettings:
    """Settings of the search for the still frame."""

    searched: float = 4e5  # pixels of the picture that is searched: larger ones are made smaller
    no_drift: float = 0.15  # pixels over a clip: a camera on a stand
    hand_drift: float = 0.02  # of the longer side a second, each way: 0.005 to 0.03 in real clips
    swung: float = 0.025  # of the picture's longer side a frame: a camera turned after the ball
    coded_still: float = 6.0  # DN/px: H.264 keeps flatter edges in place while the camera drifts
    shown_parts: int = 4  # of 144, that have edges but for one thing's, to show a drift
    overlap: float = 0.6  # of a sample's edges, that lie in those laid upon them
    held: float = 0.25  # of that: what few edges show moves faster than a hand with a camera
    # of what edges lie off in the median part of the picture, that a drift leaves at most: cameras
    # in hands show .03 to .78, on a stand .85 at least; and that a turn leaves beside a shift:
    # turning ones .2 to .61, others .84 at least
    better: float = 0.8
    fewest: int = 8  # samples that show which side of the background a ball is on
    # quantile, or its complement, at which the background of a slow ball lies: at the median balls
    # lit from the side before a camera in grey lose flights in 3 clips of 8
    side: float = 0.25
    touched: float = 8.0  # noises that a pixel's brightness varies by if the ball was there
    restless: float = 0.75  # quantile of the samples' differences: what a pixel does without a ball
    most_restless: int = 16  # DN: more may be a ball that stays
    rows: int = 64  # at a time: a sorted stack of whole pictures would need the memory of them all
    grid: int = 16  # every so manieth pixel shows how bright the light is


_STILL = _StillSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Still:
    """The scene without what moves; pictures are grey (row, column) or colour (…, 3), 8 bits.

    Where the camera drifts it is larger than a picture: it holds what any sample shows.
    """

    background: Image  # full size
    origin: tuple[int, int]  # x, y of its first pixel in the first picture's pixels
    size: tuple[int, int]  # columns and rows of a picture
    small: Image  # as it is searched
    restless: Image  # (row, column) of that: differences that are no ball's
    shrink: int  # pixels of the full size a pixel of the small one, each way
    edges: Edges  # of `small`
    # how the camera drifts at the samples, (sample, 4) as in `find.drift` [full pixels]
    sampled: Array
    usual: float  # pixels of `small`, that its edges lie off in the samples
    # how far it may drift each way unseen [pixels a frame], None: edges too few show that
    stands_to: float | None

    @property
    def drifts(self) -> bool:
        """Whether the camera does."""
        return bool(self.sampled.any())

    def unseen_drift(self, step: float) -> float:
        """Drift, each way, that the picture does not show [px/frame]; `step`: seconds a frame."""
        hand = _STILL.hand_drift * max(self.size) * step
        return hand if self.stands_to is None else self.stands_to

    @property
    def fastest(self) -> float:
        """Largest drift along each axis that is looked for [pixels a frame]."""
        return _STILL.swung * max(self.size)

    def drift(self, small: Image, guess: Array, before: tuple[Image, Array]) -> Array:
        """Drift of a small picture from the still frame, (4,) as in `find.drift` [full px].

        `before`: another small picture and its drift.
        """
        if not self.drifts:
            return np.zeros(4)
        guess = guess / self._full

        def starts() -> Iterator[Array]:
            yield guess
            yield before[1] / self._full + leap_of(_soft(before[0]), grey)

        grey = _soft(small)
        return self._full * self.edges.drift(grey, starts(), self.usual)

    @property
    def _full(self) -> Array:
        return np.array([self.shrink, self.shrink, 1, 1])

    def shrunk(self, picture: Image) -> Image:
        """Picture in the size that is searched."""
        return _shrunk(picture, self.shrink)

    def difference(self, small: Image, drift: Array) -> tuple[Image, Array]:
        """Difference of a small picture from the background, and its brightness over that.

        (row, column) [DN], in the channel that differs most, less what the pixel does without a
        ball; and (channel,), 1.0 within half a percent and where no pixel is bright enough to
        measure it.
        """
        corner = (self.origin[0] // self.shrink, self.origin[1] // self.shrink)
        drift, every = drift / self._full, _STILL.grid
        grid = self.small[::every, ::every]
        here = warp_back(small, drift, corner, grid, every)
        shown = np.atleast_3d(grid).min(axis=2) > BLACK
        light = np.ones(np.atleast_3d(grid).shape[2])
        if shown.any():
            ratio = np.atleast_2d((here[shown] / grid[shown]).T)
            light = upper_median(ratio)
            light[np.abs(light - 1) < 0.005] = 1.0
        behind = _as_bright(self.small, light)
        apart = _strongest(cv2.absdiff(warp_back(small, drift, corner, behind), behind))
        return np.asarray(cv2.subtract(apart, self.restless), np.uint8), light

    def cut(
        self,
        picture: Image,
        drift: Array,
        light: Array,
        corner: tuple[int, int],
        size: tuple[int, int],
    ) -> tuple[Image, Image]:
        """Region of a full picture in the still frame, and what is behind it.

        Corner (x, y) and size (columns, rows) are of the background.
        """
        x, y = corner
        behind = _as_bright(self.background[y : y + size[1], x : x + size[0]], light)
        return warp_back(picture, drift, (x + self.origin[0], y + self.origin[1]), behind), behind


def difference_of(part: Image, behind: Image) -> NDArray[np.float32]:
    """Difference of two pictures in the channel that differs most, (row, column) [DN]."""
    return _strongest(cv2.absdiff(part, behind)).astype(np.float32)


def still_of(
    samples: Sequence[Frame], depth: int, apart: float = 1.0, *, stands: bool = False
) -> Still:
    """Still frame of some pictures of a clip, the first of which does not drift.

    Parameters
    ----------
    samples
        The pictures, grey or in colour.
    depth
        Bits that their values take.
    apart
        Frames from one to the next.
    stands
        Whether the camera is known to stand still.
    """
    pictures = [eight_bits(each, depth) for each in samples]
    rows, columns = pictures[0].shape[:2]
    halvings = max(0, int(np.ceil(np.log2(rows * columns / _STILL.searched) / 2)))
    shrink = 2**halvings
    small = [_shrunk(each, shrink) for each in pictures]
    greys, size = [_soft(each) for each in small], small[0].shape[1::-1]
    drifts: Array = np.zeros((len(small), 4))
    stands_to: float | None = 0.0
    if not stands:
        drifts, stands_to = _lay(greys, _STILL.swung * max(rows, columns) * apart / shrink)
    if np.ptp(drifts * at_rim(size) * shrink, axis=0).max() <= _STILL.no_drift:
        drifts[:] = 0
    corners = np.array([[x, y] for x in (0, columns) for y in (0, rows)], float) / shrink
    back = [cv2.invertAffineTransform(matrix_of(each, size)) for each in drifts]
    seen = np.concatenate([corners @ each[:, :2].T + each[:, 2] for each in back])
    first = np.minimum(0, np.floor(seen.min(axis=0))).astype(int)
    end = np.ceil(shrink * np.maximum(corners[-1], seen.max(axis=0))).astype(int)
    full = np.array([shrink, shrink, 1, 1])
    origin, share = shrink * first, share_of(pictures)
    background = _background_of(pictures, full * drifts, origin, end - origin, share)
    behind = _shrunk(background, shrink)
    off = [
        _strongest(cv2.absdiff(warp_back(each, drift, tuple(first), behind), behind))
        for each, drift in zip(small, drifts, strict=True)
    ]
    restless = of_rank(np.stack(off), round(_STILL.restless * (len(off) - 1)))
    edges = edges_of(_soft(behind), None, tuple(first), size, turns=bool(drifts[:, 2:].any()))
    cost = float(np.median(list(map(edges.cost, greys, drifts))))
    return Still(
        background=background,
        origin=(int(origin[0]), int(origin[1])),
        size=(columns, rows),
        small=behind,
        restless=np.minimum(restless, _STILL.most_restless).astype(np.uint8),
        shrink=shrink,
        edges=edges,
        sampled=_usual(full * drifts),
        # few edges show no leap
        usual=np.inf if stands_to is None else cost,
        stands_to=None if stands_to is None else stands_to * shrink / apart,
    )


def _lay(greys: Sequence[Image], most: float) -> tuple[Array, float | None]:
    """Drifts that lay pictures upon the first, (picture, 4), and drift that none may show [pixels].

    From one to the next at most `most`, and less where few edges show it. Each is laid upon an
    earlier one, and then upon the median of all; they drift if edges then lie clearly better in
    most of the picture than where they do not.
    """
    best = np.zeros((len(greys), 4))
    others, unseen = _costs(_edges(greys, best, turns=False), greys, best), None
    for turns in (False, True):
        drifts, edges, step = [best[0]], edges_of(greys[0], turns=turns), best[0]
        for before, grey in pairwise(greys):
            last = drifts[-1]
            if edges.share_in(grey, last) < _STILL.overlap:
                edges = edges_of(before, last, turns=turns)
            drifts.append(edges.drift(grey, (last, last + step, last + leap_of(before, grey))))
            step = drifts[-1] - last
        laid = np.array(drifts)
        for _ in range(2):
            edges = _edges(greys, laid, turns=turns)
            starts = np.stack([laid, _usual(laid)], axis=1)
            laid = np.array(list(map(edges.drift, greys, starts)))
        costs, parts = _costs(edges, greys, laid), edges.parts(_STILL.coded_still)
        few = parts.sum() < _STILL.shown_parts
        fast = np.abs(np.diff(laid[:, :2], axis=0)).max(initial=0.0)
        better = _ratio(costs[parts | few], others[parts | few]) < _STILL.better
        # few edges show a slow drift alone, and no turn: nearly all may be of one thing
        if better and fast < (_STILL.held * most * (not turns) if few else most):
            best, others, unseen = laid, costs, None if few else 0.0
        elif not turns:
            unseen = None if few else _slope(laid[:, :2])
    return best - best[0], unseen


def _edges(greys: Sequence[Image], drifts: Array, *, turns: bool) -> Edges:
    """Edges of the median of pictures, each moved back by its drift."""
    size = np.array(greys[0].shape[1::-1])
    return edges_of(_background_of(greys, drifts, np.zeros(2, int), size, 0.5), turns=turns)


def _costs(edges: Edges, greys: Sequence[Image], drifts: Array) -> Array:
    """Median distance that edges lie off in each part [pixels], inf: in no picture any, (part,)."""
    each = np.sort(list(map(edges.costs, greys, drifts, repeat(_STILL.coded_still))), axis=0)
    seen = np.isfinite(each).sum(axis=0)
    return np.asarray(np.take_along_axis(each, seen[None] // 2, axis=0)[0])


def _ratio(some: Array, others: Array) -> float:
    """Median ratio of what edges lie off in parts where either has some."""
    shown = np.isfinite(np.minimum(some, others))
    some, others = (np.minimum(each[shown], FAR_OFF) + 1e-3 for each in (some, others))
    return float(np.median(some / others)) if shown.any() else 1.0


def _usual(drifts: Array) -> Array:
    """Drifts of pictures by those about them: one or two in a row may be laid wrong."""
    return np.asarray(ndimage.median_filter(drifts, (5, 1), mode="nearest"))


def _slope(shifts: Array) -> float:
    """Twice the slope of shifts (picture, 2), or twice its standard uncertainty [pixels]."""
    if len(shifts) < 3:
        return 0.0
    t = np.arange(len(shifts)) - (len(shifts) - 1) / 2
    slope = t @ shifts / (t @ t)
    rest = shifts - shifts.mean(axis=0) - t[:, None] * slope
    u = np.sqrt((rest**2).sum(axis=0) / (len(t) - 2) / (t @ t))
    return float(2 * np.maximum(np.abs(slope), u).max())


def eight_bits(frame: Frame, depth: int) -> Image:
    """Picture cut to 8 bits, of three channels or one."""
    if frame.ndim == 3 and frame.shape[2] != 3:
        frame = frame[..., :3] if frame.shape[2] == 4 else frame[..., 0]
    if frame.dtype == np.uint8:
        return frame
    return np.asarray(frame >> max(0, depth - 8), np.uint8)


def warp_back(
    picture: Image, drift: Array, corner: Sequence[int], behind: Image, every: int = 1
) -> Image:
    """Drifted picture where it lies before a background, elsewhere the background.

    The corner (x, y) is that of the background in the still frame, which has `every` pixel of it.
    """
    x, y = map(int, corner)
    rows, columns = behind.shape[:2]
    right, below = x + every * (columns - 1) + 1, y + every * (rows - 1) + 1
    inside = x >= 0 and y >= 0 and right <= picture.shape[1] and below <= picture.shape[0]
    if inside and not np.any(drift):
        return picture[y:below:every, x:right:every]
    back = matrix_of(drift, picture.shape[1::-1])
    back[:, 2] += back[:, :2] @ [x, y]
    back[:, :2] *= every
    # four channels take half as long as three, but for a small part of a picture
    wider = picture.ndim == 3 and 2 * behind.size > picture.size
    there, here = (
        np.asarray(cv2.cvtColor(each, cv2.COLOR_BGR2BGRA), np.uint8) if wider else each
        for each in (picture, behind)
    )
    here = here if wider else here.copy()
    flags, mode = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_TRANSPARENT
    cv2.warpAffine(there, back, (columns, rows), dst=here, flags=flags, borderMode=mode)
    return np.asarray(cv2.cvtColor(here, cv2.COLOR_BGRA2BGR) if wider else here, np.uint8)


def share_of(pictures: Sequence[Image]) -> float:
    """Quantile at which the background is found.

    The median; but before a camera in grey, a laboratory's, a slow ball may cover a pixel for most
    of the time. Of most pixels that it touches it covers the lesser part: that shows whether it is
    lighter than what is behind it, and the background lies on the other side.
    """
    if pictures[0].ndim == 3 or len(pictures) < _STILL.fewest:
        return 0.5
    stack = np.stack([each[::2, ::2] for each in pictures])
    low, high = (each.astype(int) for each in (stack.min(axis=0), stack.max(axis=0)))
    reach = high - low
    touched = reach > _STILL.touched * max(float(np.median(reach)) / 4, 1.0)
    middle = of_rank(stack, len(stack) // 2).astype(int)
    return _STILL.side if (low + high - 2 * middle)[touched].sum() >= 0 else 1 - _STILL.side


def _background_of(
    pictures: Sequence[Image], drifts: Array, origin: Array, size: Array, share: float
) -> Image:
    """Quantile of drifted pictures, of columns and rows that begin at an origin.

    What a picture does not show is as the one before it has it; black where none does.
    """
    columns, rows = map(int, size)
    whole = np.zeros((rows, columns, *pictures[0].shape[2:]), np.uint8)
    pairs = list(zip(pictures, drifts, strict=True))
    for top in range(0, rows, _STILL.rows):
        here, corner = whole[top : top + _STILL.rows], (origin[0], origin[1] + top)
        stack = []
        for picture, drift in (*reversed(pairs), *pairs) if drifts.any() else pairs:
            here = warp_back(picture, drift, corner, here)
            stack.append(here)
        ranked = np.stack(stack[-len(pairs) :])
        whole[top : top + _STILL.rows] = of_rank(ranked, round(share * (len(pairs) - 1)))
    return whole


def of_rank(stack: NDArray[np.uint8], rank: int) -> Image:
    """Value of a rank among pictures, by bisection: much quicker than sorting."""
    found = np.zeros(stack.shape[1:], np.uint8)
    for bit in (128, 64, 32, 16, 8, 4, 2, 1):
        below = (stack < found + np.uint8(bit)).sum(axis=0, dtype=np.uint8)
        found += np.uint8(bit) * (below <= rank)  # much quicker than `where`
    return found


def _shrunk(picture: Image, shrink: int) -> Image:
    """Picture halved some times over: much quicker than at once."""
    while shrink > 1:
        rows, columns = (2 * (side // 2) for side in picture.shape[:2])
        size = (columns // 2, rows // 2)
        halved = cv2.resize(picture[:rows, :columns], size, interpolation=cv2.INTER_AREA)
        picture, shrink = np.asarray(halved, np.uint8), shrink // 2
    return picture


def _soft(picture: Image) -> Image:
    """Grey of a picture, as its edges are laid: noise and a codec's blocks have steeper ones."""
    return np.asarray(cv2.GaussianBlur(grey_of(picture), (5, 5), 1.0), np.uint8)


def _strongest(apart: NDArray[Any]) -> NDArray[Any]:
    if apart.ndim == 2:
        return apart
    one, two, three = cv2.split(apart)
    return cv2.max(cv2.max(one, two), three)


def _as_bright(behind: Image, light: Array) -> Image:
    """Background as bright as a picture is, channel by channel."""
    if (light == 1.0).all():
        return behind
    values = np.clip(np.rint(np.arange(256)[:, None] * light), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(behind, values.reshape(1, 256, -1)), np.uint8).reshape(behind.shape)
