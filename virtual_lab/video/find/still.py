"""The still frame: what stands behind all that moves, and how far each picture drifts from it.

A phone held by hand shifts its picture by up to a pixel a frame: the samples are laid upon each
other before their median is taken, and each picture is shifted back before it is compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from virtual_lab.units import Array, Mask
from virtual_lab.video.clips.reading import Frame, grey_of
from virtual_lab.video.find.drift import Edges, at_rim, edges_of, matrix_of, onward, upon

Image = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class _StillSettings:
    """How the still frame is found."""

    searched: float = 4e5  # pixels of the picture that is searched: larger ones are made smaller
    no_drift: float = 0.15  # pixels over a clip: a camera on a stand
    hand_drift: float = 0.02  # of the longer side a second, each way: 0.005 to 0.03 in real clips
    held: float = 3.0  # pixels a frame of a camera held in a hand
    swung: float = 0.025  # of the picture's longer side a frame: a camera turned after the ball
    coded_still: float = 6.0  # DN/px: H.264 keeps flatter edges in place while the camera drifts
    # of a side, that edges reach over to show a drift, and such as are steep that way to show a
    # turn: a ball's alone do not, nor those of a man who walks past
    span: tuple[float, float] = (0.5, 0.25)
    turn_parts: int = 4  # of 144, that have edges but for one thing's, to show a turn
    turned: float = 0.8  # of the misfit of shifted pictures: no less shows a turn
    fewest: int = 8  # samples that show which side of the background a ball is on
    # quantile, or its complement, at which the background of a slow ball lies: at the median balls
    # lit from the side before a camera in grey lose flights in 3 clips of 8
    side: float = 0.25
    touched: float = 8.0  # noises that a pixel's brightness varies by if the ball was there
    # of the misfits without: cameras on a stand show 0.91 at least, and 0.61 times that of all; of
    # others, turning ones show 0.74 at most, those held by hand 0.53 so multiplied
    turns: float = 0.8
    drifts: float = 0.6
    sharper: tuple[float, float] = (1.3, 0.02)  # factor and pixels that a part's edges lie less off
    # of 144: if so many more are sharper unmoved, the camera stands; if no more are sharper turned
    # than shifted, it does not turn
    parts_apart: int = 3
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
    shows_drift: bool  # edges that no codec keeps in place reach over the picture
    shows_turn: Mask  # which ways, x and y, those do that are steep that way
    # how far it may drift each way by the few edges there are [pixels a frame], None: there are
    # none, or enough
    stands_to: float | None = None

    @property
    def drifts(self) -> bool:
        """Whether the camera does."""
        return bool(self.sampled.any())

    def unseen_drift(self, step: float) -> float:
        """Drift, each way, that the picture does not show [px/frame]; `step`: seconds a frame."""
        if self.stands_to is not None:
            return self.stands_to
        return 0.0 if self.shows_drift else _STILL.hand_drift * max(self.size) * step

    @property
    def turns(self) -> bool:
        """Whether it turns, too, or what it sees grows."""
        return bool(self.sampled[:, 2:].any())

    @property
    def fastest(self) -> Array:
        """How far it may drift each way, (2,) [pixels a frame]."""
        return np.where(self.shows_turn, _STILL.swung * max(self.size), _STILL.held)

    def drift(self, small: Image, guess: Array, before: Array) -> Array:
        """Drift of a small picture from the still frame, (4,) as in `find.drift` [full px].

        `before`: how the picture before does, or the samples about it do.
        """
        if not self.drifts:
            return np.zeros(4)
        grey, full = grey_of(small), self._full
        found = self.edges.shifted(grey, guess / full, before / full)
        return full * (self.edges.turned(grey, found) if self.turns else found)

    @property
    def _full(self) -> Array:
        return np.array([self.shrink, self.shrink, 1, 1])

    def shrunk(self, picture: Image) -> Image:
        """Return a picture in the size that is searched."""
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
        behind = _lit(self.small, light)
        apart = _strongest(cv2.absdiff(self.here(small, drift, behind), behind))
        return np.asarray(cv2.subtract(apart, self.restless), np.uint8)

    def here(self, small: Image, drift: Array, behind: Image, every: int = 1) -> Image:
        """Return a small picture in the still frame, what it does not show as it is behind.

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
        """Return a region of a full picture in the still frame, and what is behind it.

        Corner (x, y) and size (columns, rows) are of the background.
        """
        x, y = corner
        behind = _lit(self.background[y : y + size[1], x : x + size[0]], light)
        return moved_back(picture, drift, (x + self.origin[0], y + self.origin[1]), behind), behind


def difference_of(part: Image, behind: Image) -> NDArray[np.float32]:
    """Difference of two pictures in the channel that differs most, (row, column) [DN]."""
    return _strongest(cv2.absdiff(part, behind)).astype(np.float32)


def still_of(
    samples: Sequence[Frame], depth: int, apart: float = 1.0, *, stands: bool = False
) -> Still:
    """Return the still frame of some pictures of a clip, the first of which does not drift.

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
        drifts = _laid(greys, *limits.tolist())
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
    background = _covered(pictures, drifts, origin, (high, wide), share_of(pictures))
    behind = _shrunk(background, shrink)
    edges = edges_of(grey_of(behind), first, size)
    full = [shrink, shrink, 1, 1]
    off = [
        _strongest(cv2.absdiff(moved_back(each, drift / full, first, behind), behind))
        for each, drift in zip(small, drifts, strict=True)
    ]
    shows_drift = bool(_shown(edges, behind, own=False).any())
    stands_to = None
    if not (shows_drift or drifts.any() or len(greys) < 3):
        stands_to = _stands_to(edges, behind.shape, greys)
    return Still(
        background=background,
        origin=(int(origin[0]), int(origin[1])),
        size=(columns, rows),
        small=behind,
        restless=np.minimum(_quantile(off, _STILL.restless), _STILL.most_restless).astype(np.uint8),
        shrink=shrink,
        edges=edges,
        sampled=_usual(drifts),
        shows_drift=shows_drift,
        stands_to=None if stands_to is None else stands_to * shrink / apart,
        shows_turn=_shown(edges, behind, own=True),
    )


def _laid(greys: Sequence[Image], most: float, held: float) -> Array:
    """Return the drifts that lay pictures upon the first, (picture, 4) [pixels].

    From one to the next at most `most`, where edges show that, else `held`: what moves faster is no
    hand that holds a camera. Each is laid upon the one before, and then upon the median of all:
    shifted alone, and then turned, too, if that lays them clearly better; in the end each is looked
    for where those about it lie.
    """
    edges = [edges_of(each) for each in greys]
    shifted, turned, step = [np.zeros(4)], [np.zeros(4)], np.zeros(4)
    for one, grey in zip(edges[:-1], greys[1:], strict=True):
        step = one.shifted(grey, step)
        shifted.append(onward(shifted[-1], step))
        turned.append(onward(turned[-1], one.turned(grey, step)))
    best, least = np.zeros((len(greys), 4)), 1.0
    middles = edges_of(_median(greys))
    stands = _misfits(edges, middles, greys, best)
    ways = (
        (shifted, Edges.shifted, -_STILL.parts_apart),
        (turned, Edges.turned, _STILL.parts_apart),
    )
    for chain, lay, parts in ways:
        laid, before = np.array(chain), (middles, best)
        for _ in range(2):  # a third time lays none nearer
            if np.abs(laid * at_rim(greys[0].shape[::-1])).max() < _STILL.no_drift:
                break
            middle = _median(greys, laid)
            whole = edges_of(middle)
            steps = np.abs(np.diff(laid[:, :2], axis=0)).max(axis=0, initial=0.0)
            one_by_one, together = _misfits(edges, whole, greys, laid) / stands
            limit = np.where(_shown(whole, middle, own=True), most, min(most, held))
            # the median of pictures that hardly overlap shows nothing
            misfit = one_by_one * min(1.0, together)
            moves = one_by_one < _STILL.turns or misfit < _STILL.drifts
            if (
                moves
                and misfit < least
                and (steps <= limit).all()
                and _sharper(greys, before, (whole, laid)) > parts
            ):
                best, least, middles = laid, misfit, whole
            laid = np.array([lay(whole, g, near) for g, near in zip(greys, laid, strict=True)])
        least *= _STILL.turned
    if best.any():
        about = _usual(best)
        found = [middles.shifted(g, near, near) for g, near in zip(greys, about, strict=True)]
        if best[:, 2:].any():
            found = [middles.turned(g, near) for g, near in zip(greys, found, strict=True)]
        shown = [middles.lie_in(g, near) for g, near in zip(greys, about, strict=True)]
        best = np.where(np.array(shown)[:, None], found, best)
    return np.array([upon(each, best[0]) for each in best])


def _usual(drifts: Array) -> Array:
    """Return the drifts of pictures by those about them: one or two in a row may be laid wrong."""
    return np.asarray(ndimage.median_filter(drifts, (5, 1), mode="nearest"))


def _sharper(greys: Sequence[Image], one: tuple[Edges, Array], other: tuple[Edges, Array]) -> int:
    """Return in how many more parts the edges lie sharper by the other drifts than by the one.

    An arm that swings before a plain wall is no camera that turns: the wall's foot stays.
    """
    costs = []
    for edges, drifts in (one, other):
        each = [edges.costs(g, d, _STILL.coded_still) for g, d in zip(greys, drifts, strict=True)]
        costs.append(np.mean(each, axis=0))
    factor, offset = _STILL.sharper
    less, more = (np.sum(factor * a + offset < b) for a, b in (costs, costs[::-1]))
    return int(more - less)


def _shown(edges: Edges, grey: Image, *, own: bool) -> Mask:
    """Whether edges that no codec keeps in place span enough of a picture, by axis, (2,)."""
    shown = edges.spans(grey.shape, _STILL.coded_still, own=own) >= _STILL.span[own]
    return shown & (not own or edges.parts(grey.shape, _STILL.coded_still) >= _STILL.turn_parts)


def _stands_to(edges: Edges, shape: tuple[int, ...], greys: Sequence[Image]) -> float | None:
    """Drift from one picture to the next that edges too few to follow leave open [pixels].

    Twice the slope of their shifts, or twice its standard uncertainty. None: nearly all are of one
    thing, which may move on its own.
    """
    if edges.parts(shape, _STILL.coded_still) < _STILL.turn_parts:
        return None
    steep, none = edges.steeper(_STILL.coded_still), np.zeros(4)
    shifts = np.array([steep.shifted(each, none, none)[:2] for each in greys])
    t = np.arange(len(greys)) - (len(greys) - 1) / 2
    slope = t @ shifts / (t @ t)
    rest = shifts - shifts.mean(axis=0) - t[:, None] * slope
    u = np.sqrt((rest**2).sum(axis=0) / (len(t) - 2) / (t @ t))
    return float(2 * np.maximum(np.abs(slope), u).max())


def _misfits(edges: Sequence[Edges], whole: Edges, greys: Sequence[Image], drifts: Array) -> Array:
    """Mean shift of edges [pixels], (2,): of each picture in the next one, of all in each.

    A turning camera shows in the former alone, one that drifts before a plain wall in the latter.
    """
    steps = [upon(after, before) for before, after in pairwise(drifts)]
    pairs = zip(edges[:-1], greys[1:], steps, strict=True)
    one_by_one = [one.cost(grey, step) for one, grey, step in pairs]
    together = [whole.cost(grey, drift) for grey, drift in zip(greys, drifts, strict=True)]
    return np.array([np.mean(one_by_one or 0.0), np.mean(together)])


def eight_bits(frame: Frame, depth: int) -> Image:
    """Return a picture cut to 8 bits, of three channels or one."""
    if frame.ndim == 3 and frame.shape[2] != 3:
        frame = frame[..., :3] if frame.shape[2] == 4 else frame[..., 0]
    if frame.dtype == np.uint8:
        return frame
    return np.asarray(frame >> max(0, depth - 8), np.uint8)


def moved_back(
    picture: Image, drift: Array, corner: tuple[int, int], behind: Image, every: int = 1
) -> Image:
    """Return a drifted picture where it lies before a background, elsewhere the background.

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
    """Return the quantile at which the background is found.

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
    middle = ranked(stack, len(stack) // 2).astype(int)
    return _STILL.side if (low + high - 2 * middle)[touched].sum() >= 0 else 1 - _STILL.side


def _covered(
    pictures: Sequence[Image], drifts: Array, origin: Array, shape: tuple[int, int], share: float
) -> Image:
    """Return a quantile of drifted pictures where they reach; black where none does."""
    whole = np.zeros((*shape, *pictures[0].shape[2:]), np.uint8)
    size = pictures[0].shape[1::-1]
    for top in range(0, shape[0], _STILL.rows):
        block = whole[top : top + _STILL.rows]
        corner = (int(origin[0]), int(origin[1]) + top)
        stack = np.stack(
            [moved_back(p, d, corner, block) for p, d in zip(pictures, drifts, strict=True)]
        )
        if not drifts.any():
            whole[top : top + _STILL.rows] = ranked(stack, round(share * (len(stack) - 1)))
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
        whole[top : top + _STILL.rows] = np.where(count > 0, ranked(stack, rank), 0)
    return whole


def ranked(stack: NDArray[np.uint8], rank: int | NDArray[np.uint8]) -> Image:
    """Return the value of a rank among pictures, by bisection: much quicker than sorting."""
    found = np.zeros(stack.shape[1:], np.uint8)
    for bit in (128, 64, 32, 16, 8, 4, 2, 1):
        below = (stack < found + np.uint8(bit)).sum(axis=0, dtype=np.uint8)
        found += np.uint8(bit) * (below <= rank)  # much quicker than `where`
    return found


def _shrunk(picture: Image, shrink: int) -> Image:
    """Return a picture halved some times over: much quicker than at once."""
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


def _lit(behind: Image, light: Array) -> Image:
    """Return a background as bright as a picture is, channel by channel."""
    if (light == 1.0).all():
        return behind
    values = np.clip(np.rint(np.arange(256)[:, None] * light), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(behind, values.reshape(1, 256, -1)), np.uint8).reshape(behind.shape)


def _median(pictures: Sequence[Image], shifts: Array | None = None) -> Image:
    """Return the median of pictures, each moved by its shift [pixels]."""
    if shifts is not None:
        pictures = [moved_back(p, s, (0, 0), p) for p, s in zip(pictures, shifts, strict=True)]
    return _quantile(pictures, 0.5)


def _quantile(pictures: Sequence[Image], share: float) -> Image:
    return ranked(np.stack(pictures), round(share * (len(pictures) - 1)))
