"""The still frame: the scene behind all moving things, and the drift of each picture from it.

A phone held by hand shifts its picture by up to a pixel per frame. So the samples are aligned with
each other before their median is taken, and each picture is shifted back before it is compared.
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

    # largest number of pixels of the picture that is searched: larger pictures are shrunk
    searched: float = 4e5
    no_drift: float = 0.15  # largest drift over a clip of a camera on a stand [pixels]
    # drift of a hand-held camera along each axis [longer sides of the picture per second]: 0.005 to
    # 0.03 in real clips
    hand_drift: float = 0.02
    # fastest drift, of a camera turned after the ball [longer sides of the picture per frame]
    swung: float = 0.025
    # smallest steepness of an edge that shows a drift [DN/px]: H.264 keeps flatter edges in place
    # while the camera drifts
    coded_still: float = 6.0
    # smallest number of the 144 parts that must have edges to show a drift, those of one moving
    # thing left out
    shown_parts: int = 4
    # smallest share of a sample's edges that lie in another sample aligned with it
    overlap: float = 0.6
    # largest drift that few edges may show [share of the fastest one]: they may all belong to one
    # thing, which moves faster than a camera in a hand
    held: float = 0.25
    # largest ratio of the cost with a drift to that without, in the median part of the picture, and
    # likewise of the cost with a turn to that with a shift alone. Measured for drifts: .03 to .78
    # in hands, at least .85 on a stand; for turns: .2 to .61 of turning cameras, at least .84 of
    # others
    better: float = 0.8
    # smallest number of samples that show whether a ball is lighter or darker than the background
    fewest: int = 8
    # quantile, or its complement, at which the background of a slow ball is found. With the median,
    # balls lit from the side lost flights in 3 of 8 clips of a grey camera
    side: float = 0.25
    # smallest range of brightness of a pixel that the ball touched [standard deviations of noise]
    touched: float = 8.0
    # quantile of the samples' differences that is taken as a pixel's variation without a ball
    restless: float = 0.75
    # largest variation of a pixel without a ball [DN]: more may be a ball that stays
    most_restless: int = 16
    # number of rows at a time: a stack of whole pictures would need the memory of them all
    rows: int = 64
    # spacing of the pixels from which the brightness of the light is measured [pixels]
    grid: int = 16


_STILL = _StillSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Still:
    """The scene without what moves; pictures are grey (row, column) or colour (…, 3), 8 bits.

    Where the camera drifts it is larger than a picture: it holds what any sample shows.
    """

    background: Image  # background in full size
    origin: tuple[int, int]  # x, y of its first pixel in the first picture's pixels
    size: tuple[int, int]  # columns and rows of a picture
    small: Image  # background in the size that is searched
    restless: Image  # (row, column) differences in `small` that occur without a ball [DN]
    shrink: int  # number of full-size pixels per pixel of `small`, along each axis
    edges: Edges  # edges of `small`
    # drift of the camera at the samples, (sample, 4) as in `find.drift` [full pixels]
    sampled: Array
    usual: float  # usual cost of the samples at their drifts [pixels of `small`]
    # largest drift along each axis that the picture may hide [pixels per frame]; None: too few
    # edges to tell
    stands_to: float | None

    @property
    def drifts(self) -> bool:
        """Whether the camera drifts."""
        return bool(self.sampled.any())

    def unseen_drift(self, step: float) -> float:
        """Drift along each axis that the picture may hide [px/frame]; `step`: frame time [s]."""
        hand = _STILL.hand_drift * max(self.size) * step
        return hand if self.stands_to is None else min(hand, self.stands_to)

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
        """Difference of a small picture from the background, and ratio of their brightness.

        The difference, (row, column) [DN], is that of the channel that differs most, minus the
        pixel's variation without a ball. The ratio, (channel,), is 1.0 if it is within half a
        percent of that, or if no pixel is bright enough to measure it.
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
        """Region of a full picture in the still frame, and the background behind it.

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
        Number of bits of their values.
    apart
        Number of frames from one sample to the next.
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
        # with few edges a leap does not show
        usual=np.inf if stands_to is None else cost,
        stands_to=None if stands_to is None else stands_to * shrink / apart,
    )


def _lay(greys: Sequence[Image], most: float) -> tuple[Array, float | None]:
    """Drifts that align pictures with the first, (picture, 4), and largest hidden drift [pixels].

    From one picture to the next the drift is at most `most`, and less if few edges show it. Each
    picture is aligned with an earlier one, and then with the median of all. The drifts are accepted
    if the edges then fit clearly better, in most of the picture, than without them. The hidden
    drift is None if there are too few edges to tell.
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
        # few edges can show only a slow drift and no turn, because nearly all may belong to one
        # thing
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
    """Median cost of each part over pictures [pixels], (part,); inf: no edges in any picture."""
    each = np.sort(list(map(edges.costs, greys, drifts, repeat(_STILL.coded_still))), axis=0)
    seen = np.isfinite(each).sum(axis=0)
    return np.asarray(np.take_along_axis(each, seen[None] // 2, axis=0)[0])


def _ratio(some: Array, others: Array) -> float:
    """Median ratio of the costs `some` to `others`, over the parts where either is finite."""
    shown = np.isfinite(np.minimum(some, others))
    some, others = (np.minimum(each[shown], FAR_OFF) + 1e-3 for each in (some, others))
    return float(np.median(some / others)) if shown.any() else 1.0


def _usual(drifts: Array) -> Array:
    """Median of drifts over five pictures: one or two in a row may be aligned wrongly."""
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

    `corner` (x, y) is the corner of the background in the still frame. The background holds every
    `every`-th pixel of the still frame along each axis.
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
    # OpenCV takes half as long for four channels as for three, except for a small part of a picture
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

    It is the median, except for a grey camera, as used in laboratories: there a slow ball may cover
    a pixel for most of the time. It covers most of the pixels that it touches for less than half of
    the time. This shows whether the ball is lighter than the background, which is then found on the
    other side of the median.
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
    """Quantile of drifted pictures, over `size` columns and rows that begin at `origin`.

    A pixel that a picture does not show is taken from the picture before it. It is black if no
    picture shows it.
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
    """Smoothed grey picture for the alignment: noise and a codec's blocks have steep edges."""
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
