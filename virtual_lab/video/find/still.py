"""The still frame: what stands behind all that moves, and how far each picture drifts from it.

A phone held by hand shifts its picture by up to a pixel a frame: the samples are laid upon each
other before their median is taken, and each picture is shifted back before it is compared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from virtual_lab.units import Array
from virtual_lab.video.clips.reading import grey_of
from virtual_lab.video.clips.source import Frame
from virtual_lab.video.find.drift import (
    FAR_OFF,
    Edges,
    at_rim,
    edges_of,
    matrix_of,
    onward,
    upon,
    upper_median,
)

Image = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class _StillSettings:
    """How the still frame is found."""

    searched: float = 4e5  # pixels of the picture that is searched: larger ones are made smaller
    no_drift: float = 0.15  # pixels over a clip: a camera on a stand
    hand_drift: float = 0.02  # of the longer side a second, each way: 0.005 to 0.03 in real clips
    swung: float = 0.025  # of the picture's longer side a frame: a camera turned after the ball
    coded_still: float = 6.0  # DN/px: H.264 keeps flatter edges in place while the camera drifts
    shown_parts: int = 4  # of 144, that have edges but for one thing's, to show a drift
    held: float = 3.0  # pixels a frame: what fewer show moves faster than a hand with a camera
    # of what edges lie off in the median part of the picture, that a drift leaves at most: cameras
    # in hands show .02 to .84, on a stand .96 at least; and that a turn leaves beside a shift:
    # turning ones .2 to .82, others .81 at least
    better: float = 0.85
    fewest: int = 8  # samples that show which side of the background a ball is on
    # quantile, or its complement, at which the background of a slow ball lies: at the median balls
    # lit from the side before a camera in grey lose flights in 3 clips of 8
    side: float = 0.25
    touched: float = 8.0  # noises that a pixel's brightness varies by if the ball was there
    restless: float = 0.75  # quantile of the samples' differences: what a pixel does without a ball
    most_restless: int = 16  # DN: more may be a ball that stays
    rows: int = 64  # at a time: a sorted stack of whole pictures would need the memory of them all
    grid: int = 8  # every eighth pixel shows how bright the light is
    lit: int = 16  # DN of a background that shows it


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
    # how far it may drift each way unseen [pixels a frame], None: edges too few show that
    stands_to: float | None = 0.0

    @property
    def drifts(self) -> bool:
        """Whether the camera does."""
        return bool(self.sampled.any())

    def unseen_drift(self, step: float) -> float:
        """Drift, each way, that the picture does not show [px/frame]; `step`: seconds a frame."""
        hand = _STILL.hand_drift * max(self.size) * step
        return hand if self.stands_to is None else self.stands_to

    @property
    def turns(self) -> bool:
        """Whether it turns, too, or what it sees grows."""
        return bool(self.sampled[:, 2:].any())

    @property
    def fastest(self) -> float:
        """Largest drift along each axis that is looked for [pixels a frame]."""
        return _STILL.swung * max(self.size)

    def drift(self, small: Image, guess: Array, before: Array) -> Array:
        """Drift of a small picture from the still frame, (4,) as in `find.drift` [full px].

        `before`: how the picture before does, or the samples about it do.
        """
        if not self.drifts:
            return np.zeros(4)
        grey, full = grey_of(small), self._full
        found = self.edges.shift(grey, guess / full, before / full)
        return full * (self.edges.turn(grey, found) if self.turns else found)

    @property
    def _full(self) -> Array:
        return np.array([self.shrink, self.shrink, 1, 1])

    def shrunk(self, picture: Image) -> Image:
        """Picture in the size that is searched."""
        return _shrunk(picture, self.shrink)

    def light(self, small: Image, drift: Array) -> Array:
        """Brightness of a small picture over the background's, (channel,).

        1.0 within half a percent, and where no pixel is bright enough to measure it.
        """
        grid = self.small[:: _STILL.grid, :: _STILL.grid]
        here = self.here(small, drift, grid, _STILL.grid)
        here, behind = (np.atleast_3d(each).T for each in (here, grid))
        gains = np.ones(len(behind))
        for k, (one, lit) in enumerate(zip(here, behind.astype(np.float32), strict=True)):
            shown = lit > _STILL.lit
            if shown.any():
                gain = float(np.median(one[shown] / lit[shown]))
                if abs(gain - 1) > 0.005:
                    gains[k] = gain
        return gains

    def difference(self, small: Image, drift: Array, light: Array) -> Image:
        """Difference of a small picture from the background, (row, column) [DN].

        The channel that differs most counts, less what the pixel does without a ball.
        """
        behind = _as_bright(self.small, light)
        apart = _strongest(cv2.absdiff(self.here(small, drift, behind), behind))
        return np.asarray(cv2.subtract(apart, self.restless), np.uint8)

    def here(self, small: Image, drift: Array, behind: Image, every: int = 1) -> Image:
        """Small picture in the still frame, what it does not show as it is behind.

        `every`: pixels from one to the next that is asked for, each way.
        """
        corner = (self.origin[0] // self.shrink, self.origin[1] // self.shrink)
        return moved_back(small, drift / self._full, corner, behind, every)

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
        return moved_back(picture, drift, (x + self.origin[0], y + self.origin[1]), behind), behind


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
    greys = [grey_of(each) for each in small]
    drifts = np.zeros((len(greys), 4))
    if not stands:
        limits = np.array([_STILL.swung * max(rows, columns), _STILL.held]) * apart / shrink
        drifts = _lay(greys, *limits.tolist())
    size = greys[0].shape[::-1]
    if np.ptp(drifts * at_rim(size) * shrink, axis=0).max() <= _STILL.no_drift:
        drifts[:] = 0
    matrices = [matrix_of(each, size) for each in drifts]
    corners = np.array([[x, y] for x in (0, columns) for y in (0, rows)], float) / shrink
    seen = np.concatenate([(corners - m[:, 2]) @ np.linalg.inv(m[:, :2]).T for m in matrices])
    first = np.minimum(0, np.floor(seen.min(axis=0))).astype(int)
    end = np.maximum(corners[-1], seen.max(axis=0))
    origin = shrink * first
    drifts[:, :2] *= shrink
    wide, high = np.ceil(shrink * end).astype(int) - origin
    background = _background_of(pictures, drifts, origin, (high, wide), share_of(pictures))
    behind = _shrunk(background, shrink)
    edges = edges_of(grey_of(behind), first, size)
    full = [shrink, shrink, 1, 1]
    off = [
        _strongest(cv2.absdiff(moved_back(each, drift / full, first, behind), behind))
        for each, drift in zip(small, drifts, strict=True)
    ]
    stands_to = _stands_to(edges, behind.shape, [] if drifts.any() else greys)
    return Still(
        background=background,
        origin=(int(origin[0]), int(origin[1])),
        size=(columns, rows),
        small=behind,
        restless=np.minimum(_quantile(off, _STILL.restless), _STILL.most_restless).astype(np.uint8),
        shrink=shrink,
        edges=edges,
        sampled=_usual(drifts),
        stands_to=None if stands_to is None else stands_to * shrink / apart,
    )


def _lay(greys: Sequence[Image], most: float, held: float) -> Array:
    """Drifts that lay pictures upon the first, (picture, 4) [pixels].

    From one to the next at most `most`, or `held` where few edges show that. Each is laid upon the
    one before, and then upon the median of all: shifted alone, and turned, too, if edges then lie
    clearly better in most of the picture, from one to the next or in all of them together. In the
    end each is looked for where those about it lie.
    """
    if len(greys) == 1:
        return np.zeros((1, 4))
    edges = [edges_of(each) for each in greys]
    shifted, turned, step = [np.zeros(4)], [np.zeros(4)], np.zeros(4)
    for one, grey in zip(edges[:-1], greys[1:], strict=True):
        step = one.shift(grey, step)
        shifted.append(onward(shifted[-1], step))
        turned.append(onward(turned[-1], one.turn(grey, step)))
    best = np.zeros((len(greys), 4))
    middles = edges_of(_median(greys, best))
    costs = _costs(edges, middles, greys, best)
    for chain, lay in ((shifted, Edges.shift), (turned, Edges.turn)):
        whole = edges_of(_median(greys, np.array(chain)))
        laid = _lay_again(whole, greys, np.array(chain), lay)
        middle = _median(greys, laid)
        whole = edges_of(middle)
        own = _costs(edges, whole, greys, laid)
        parts = whole.parts(middle.shape, _STILL.coded_still)
        few = parts.sum() < _STILL.shown_parts
        pairs = zip(own[:, parts | few], costs[:, parts | few], strict=True)
        ratio = min(_ratio(some, others) for some, others in pairs)
        fast = np.abs(np.diff(laid[:, :2], axis=0)).max(initial=0.0)
        if ratio < _STILL.better and fast < (held if few else most):
            best, middles, costs = laid, whole, own
    if best.any():
        best = _lay_again(middles, greys, _usual(best), Edges.shift)
        if best[:, 2:].any():
            best = _lay_again(middles, greys, best, Edges.turn)
    return np.array([upon(each, best[0]) for each in best])


def _lay_again(
    edges: Edges,
    greys: Sequence[Image],
    drifts: Array,
    lay: Callable[[Edges, Image, Array], Array],
) -> Array:
    """Drifts of pictures that show enough of some edges, looked for again near where they are."""
    return np.array(
        [
            lay(edges, grey, near) if edges.lie_in(grey, near) else near
            for grey, near in zip(greys, drifts, strict=True)
        ]
    )


def _costs(edges: Sequence[Edges], whole: Edges, greys: Sequence[Image], drifts: Array) -> Array:
    """Distance that edges lie off in each part of most pictures [pixels], inf: none, (2, part).

    Those of each picture in the next one, and of all together in each.
    """
    steps = [upon(after, before) for before, after in pairwise(drifts)]
    one_by_one = zip(edges[:-1], greys[1:], steps, strict=True)
    together = zip([whole] * len(greys), greys, drifts, strict=True)
    each = [
        np.array([e.costs(g, d, _STILL.coded_still) for e, g, d in some])
        for some in (one_by_one, together)
    ]
    return np.stack([upper_median(np.nan_to_num(some.T, nan=np.inf)) for some in each])


def _ratio(some: Array, others: Array) -> float:
    """Median ratio of what edges lie off in parts where either has some."""
    shown = np.isfinite(np.minimum(some, others))
    some, others = (np.minimum(each[shown], FAR_OFF) + 1e-3 for each in (some, others))
    return float(np.median(some / others)) if shown.any() else 1.0


def _usual(drifts: Array) -> Array:
    """Drifts of pictures by those about them: one or two in a row may be laid wrong."""
    return np.asarray(ndimage.median_filter(drifts, (5, 1), mode="nearest"))


def _stands_to(edges: Edges, shape: tuple[int, ...], greys: Sequence[Image]) -> float | None:
    """Drift from one picture to the next that edges too few to follow leave open [pixels].

    Twice the slope of their shifts, or twice its standard uncertainty. None: nearly all are of one
    thing, which may move on its own.
    """
    if edges.parts(shape, _STILL.coded_still).sum() < _STILL.shown_parts:
        return None
    if len(greys) < 3:
        return 0.0
    steep, none = edges.steeper(_STILL.coded_still), np.zeros(4)
    shifts = np.array([steep.shift(each, none, none)[:2] for each in greys])
    t = np.arange(len(greys)) - (len(greys) - 1) / 2
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


def moved_back(
    picture: Image, drift: Array, corner: tuple[int, int], behind: Image, every: int = 1
) -> Image:
    """Drifted picture where it lies before a background, elsewhere the background.

    The corner (x, y) is that of the background in the still frame, which has `every` pixel of it.
    """
    x, y = corner
    rows, columns = behind.shape[:2]
    right, below = x + every * (columns - 1) + 1, y + every * (rows - 1) + 1
    inside = x >= 0 and y >= 0 and right <= picture.shape[1] and below <= picture.shape[0]
    if inside and not np.any(drift):
        return picture[y:below:every, x:right:every]
    back = matrix_of(drift, picture.shape[1::-1])
    back[:, 2] += back[:, :2] @ [x, y]
    back[:, :2] *= every
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    here = behind.copy()
    mode = cv2.BORDER_TRANSPARENT
    cv2.warpAffine(picture, back, (columns, rows), dst=here, flags=flags, borderMode=mode)
    return here


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
    pictures: Sequence[Image], drifts: Array, origin: Array, shape: tuple[int, int], share: float
) -> Image:
    """Quantile of drifted pictures where they reach; black where none does."""
    whole = np.zeros((*shape, *pictures[0].shape[2:]), np.uint8)
    size = pictures[0].shape[1::-1]
    for top in range(0, shape[0], _STILL.rows):
        block = whole[top : top + _STILL.rows]
        corner = (int(origin[0]), int(origin[1]) + top)
        stack = np.stack(
            [moved_back(p, d, corner, block) for p, d in zip(pictures, drifts, strict=True)]
        )
        if not drifts.any():
            whole[top : top + _STILL.rows] = of_rank(stack, round(share * (len(stack) - 1)))
            continue
        y, x = np.ogrid[: len(block), : shape[1]]
        x, y = x + corner[0], y + corner[1]
        count = np.zeros(block.shape[:2], np.uint8)
        for each, drift in zip(stack, drifts, strict=True):
            inside = np.ones_like(count, bool)
            for (by_x, by_y, by), side in zip(matrix_of(drift, size), size, strict=True):
                at = by_x * x + (by_y * y + by)
                inside &= (at >= 0) & (at <= side - 1)
            each[~inside] = 255  # beyond the others in rank
            count += inside
        if block.ndim == 3:
            count = count[..., None]
        rank = np.rint(share * (np.maximum(count, 1) - 1.0)).astype(np.uint8)
        whole[top : top + _STILL.rows] = np.where(count > 0, of_rank(stack, rank), 0)
    return whole


def of_rank(stack: NDArray[np.uint8], rank: int | NDArray[np.uint8]) -> Image:
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


def _median(pictures: Sequence[Image], drifts: Array) -> Image:
    """Median of pictures, each moved back by its drift."""
    pairs = zip(pictures, drifts, strict=True)
    return _quantile([moved_back(p, each, (0, 0), p) for p, each in pairs], 0.5)


def _quantile(pictures: Sequence[Image], share: float) -> Image:
    return of_rank(np.stack(pictures), round(share * (len(pictures) - 1)))
