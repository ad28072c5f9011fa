"""The still frame: the scene behind all moving objects, and the drift of each picture from it.

The picture of a hand-held phone shifts by up to a pixel per frame. The samples are therefore
aligned with each other before their median is computed, and each picture is shifted back before it
is compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, repeat

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from virtual_lab.units import Array
from virtual_lab.video.clips.reading import grey_of
from virtual_lab.video.clips.source import Frame
from virtual_lab.video.find.drift import (
    BLACK,
    Edges,
    Image,
    edges_of,
    leap_of,
    matrix_of,
    upper_median,
)


@dataclass(frozen=True, kw_only=True)
class _StillSettings:
    """Settings of the search for the still frame."""

    # largest number of pixels of the searched picture; larger pictures are shrunk
    searched: float = 4e5
    # drift of a hand-held camera along each axis [longer sides of the picture per second]; 0.005 to
    # 0.03 in real clips
    hand_drift: float = 0.02
    # fastest drift, of a camera that is turned with the ball [longer sides of the picture per
    # frame]
    swung: float = 0.025
    # smallest number of parts of the picture with edges that can show a drift, without those of one
    # moving object
    shown_parts: int = 4
    # fastest drift that few edges may show [longer sides of the picture per frame], because they
    # may all belong to one object that moves faster than a hand-held camera
    held: float = 0.006
    # largest ratio of the deviation at edges with a drift to that without it; 0.1 to 0.35 for
    # hand-held cameras, at least 1 on a stand
    better: float = 0.75
    # smallest number of samples that show whether a ball is lighter or darker than the background
    fewest: int = 8
    # quantile, or its complement, for the background of a slow ball. With the median, flights of
    # balls lit from the side were lost in 3 of 8 clips of a gray camera.
    side: float = 0.25
    # smallest range of brightness of a pixel that the ball touched [standard deviations of noise]
    touched: float = 8.0
    # quantile of the samples' differences that is used as a pixel's variation without a ball
    restless: float = 0.75
    # largest variation of a pixel without a ball [DN]; more may be a ball that stays
    most_restless: int = 16
    # number of rows processed at a time, because a stack of whole pictures would need too much
    # memory
    rows: int = 64
    # spacing of the pixels from which the brightness of the light is measured [pixels]
    grid: int = 16


_STILL = _StillSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Still:
    """The scene without moving objects, as gray (row, column) or color (…, 3) pictures of 8 bits.

    If the camera drifts, it is larger than a picture, because it contains everything that any
    sample shows.
    """

    background: Image  # background in full size
    origin: tuple[int, int]  # x, y of the background's first pixel, in pixels of the first picture
    size: tuple[int, int]  # columns and rows of a picture
    small: Image  # background in the size of the searched picture
    restless: Image  # (row, column) differences in `small` that occur without a ball [DN]
    shrink: int  # number of full-size pixels per pixel of `small`, along each axis
    edges: Edges  # edges of `small`
    # drift of the camera at the samples, (sample, 4) as in `find.drift` [full pixels]
    sampled: Array
    # largest undetected drift along each axis [pixels per frame]; inf: unknown, with too few edges
    hidden_drift: float

    @property
    def drifts(self) -> bool:
        """Whether the camera drifts."""
        return bool(self.sampled.any())

    def unseen_drift(self, step: float) -> float:
        """Return the largest undetected drift per axis [px/frame]; `step` is the frame time [s].

        It is at most the drift of a hand-held camera, and equal to it if there are too few edges.
        """
        return min(_STILL.hand_drift * max(self.size) * step, self.hidden_drift)

    @property
    def fastest(self) -> float:
        """Largest drift along each axis that is searched [pixels per frame]."""
        return _STILL.swung * max(self.size)

    def drift(self, small: Image, guess: Array, before: tuple[Image, Array]) -> Array:
        """Return the drift (4,) of a small picture, as in `find.drift` [pixels in full size].

        `before` is another small picture and its drift. The result is 0 if the camera does not
        drift.
        """
        if not self.drifts:
            return np.zeros(4)
        grey, last = soft(small), before[1] / self._full
        leapt = last + leap_of(soft(before[0]), grey)
        return self._full * self.edges.drift(grey, guess / self._full, leapt)

    @property
    def _full(self) -> Array:
        return np.array([self.shrink, self.shrink, 1, 1])

    def shrunk(self, picture: Image) -> Image:
        """Return a picture in the size of the searched picture."""
        return _shrunk(picture, self.shrink)

    def difference(self, small: Image, drift: Array) -> tuple[Image, Array]:
        """Return the difference of a small picture from the background, and their brightness ratio.

        The difference, (row, column) [DN], is that of the channel that differs most, minus the
        pixel's variation without a ball. The ratio, (channel,), is set to 1.0 if it is within half
        a percent of 1, or if no pixel is bright enough to measure it.
        """
        corner = (self.origin[0] // self.shrink, self.origin[1] // self.shrink)
        drift, every = drift / self._full, _STILL.grid
        grid = self.small[::every, ::every]
        here = warp_back(small, drift, corner, grid, every)
        visible = np.atleast_3d(grid).min(axis=2) > BLACK
        light = np.ones(np.atleast_3d(grid).shape[2])
        if visible.any():
            ratio = np.atleast_2d((here[visible] / grid[visible]).T)
            light = upper_median(ratio)
            light[np.abs(light - 1) < 0.005] = 1.0
        behind = _as_bright(self.small, light)
        apart = difference_of(warp_back(small, drift, corner, behind), behind)
        return np.asarray(cv2.subtract(apart, self.restless), np.uint8), light

    def cut(
        self,
        picture: Image,
        drift: Array,
        light: Array,
        corner: tuple[int, int],
        size: tuple[int, int],
    ) -> tuple[Image, Image]:
        """Return a region of a full picture in the still frame, and the background behind it.

        `corner` (x, y) and `size` (columns, rows) refer to the background.
        """
        x, y = corner
        behind = _as_bright(self.background[y : y + size[1], x : x + size[0]], light)
        return warp_back(picture, drift, (x + self.origin[0], y + self.origin[1]), behind), behind


def difference_of(part: Image, behind: Image) -> Image:
    """Return the absolute difference of a picture from its background, (row, column) [DN].

    For color pictures it is the largest difference of the three channels.
    """
    apart = cv2.absdiff(part, behind)
    if apart.ndim == 3:
        one, two, three = cv2.split(apart)
        apart = cv2.max(cv2.max(one, two), three)
    return np.asarray(apart, np.uint8)


def still_of(
    samples: Sequence[Frame], depth: int, apart: float = 1.0, *, tripod: bool = False
) -> Still:
    """Return the still frame of a clip: its background, and the drift of each sampled picture.

    Drifts are relative to the first picture. They are 0 for a single picture, and for a camera on a
    tripod.

    Parameters
    ----------
    samples
        Pictures sampled from the clip, gray or in color; at least one.
    depth
        Number of bits of their values.
    apart
        Number of frames from one sample to the next.
    tripod
        Whether the camera is known not to move.
    """
    pictures = [eight_bits(each, depth) for each in samples]
    rows, columns = pictures[0].shape[:2]
    halvings = max(0, int(np.ceil(np.log2(rows * columns / _STILL.searched) / 2)))
    shrink = 2**halvings
    small = [_shrunk(each, shrink) for each in pictures]
    greys, size = [soft(each) for each in small], small[0].shape[1::-1]
    drifts: Array = np.zeros((len(small), 4))
    hidden_drift = 0.0
    if not tripod and len(greys) > 1:
        drifts, hidden_drift = _drifts_of(greys, _STILL.held * max(size) * apart)
    full = np.array([shrink, shrink, 1, 1])
    background, origin = _panorama(pictures, full * drifts, share_of(pictures), shrink)
    behind = _shrunk(background, shrink)
    corner = (origin[0] // shrink, origin[1] // shrink)
    views = map(warp_back, small, drifts, repeat(corner), repeat(behind))
    off = [difference_of(each, behind) for each in views]
    restless = of_rank(np.stack(off), round(_STILL.restless * (len(off) - 1)))
    return Still(
        background=background,
        origin=origin,
        size=(columns, rows),
        small=behind,
        restless=np.minimum(restless, _STILL.most_restless).astype(np.uint8),
        shrink=shrink,
        edges=edges_of(soft(behind), size, corner),
        sampled=full * drifts,
        hidden_drift=hidden_drift * shrink / apart,
    )


def _drifts_of(greys: Sequence[Image], most: float) -> tuple[Array, float]:
    """Return the drift of each picture from the first, (picture, 4), and the hidden drift [pixels].

    Each picture is aligned with the previous one, and then with the median of all. The drifts are
    accepted if they clearly reduce the change of the edges. With few edges the hidden drift is
    inf, no turn is determined, and the drift between successive pictures is limited to `most`.
    """
    none = np.zeros((len(greys), 4))
    size = greys[0].shape[1::-1]
    steps = [none[0]]
    for before, grey in pairwise(greys):
        edges = edges_of(before, turns=False)
        steps.append(edges.drift(grey, steps[-1], none[0], leap_of(before, grey)))
    laid, few = np.cumsum(steps, axis=0), True
    for turns in (False, True, True, True):
        behind, corner = _panorama(greys, laid)
        few = edges_of(behind, size, corner).count_parts(size) < _STILL.shown_parts
        edges = edges_of(behind, size, corner, turns=turns and not few)
        # One or two successive pictures may be aligned wrongly.
        usual = ndimage.median_filter(laid, (5, 1), mode="nearest")
        laid = np.array([edges.drift(*each) for each in zip(greys, usual, laid, strict=True)])
        laid = laid - laid[0]
    stands = edges_of(_panorama(greys, none)[0])
    # The median is used, because hands and balls change fewer than half of the edges.
    off = [list(map(each.deviation, greys, by)) for each, by in ((edges, laid), (stands, none))]
    moved, stood = (np.nanmedian(np.append(0.0, np.abs(each))) for each in off)
    fast = np.abs(np.diff(laid[:, :2], axis=0)).max()
    drifts = moved < _STILL.better * stood and not (few and fast > most)
    hidden = 0.0 if drifts else _slope(laid[:, :2])
    return laid if drifts else none, np.inf if few else hidden


def _slope(shifts: Array) -> float:
    """Return the hidden drift along an axis from shifts, (picture, 2), per picture [pixels].

    It is twice the slope of the shifts or twice its standard uncertainty, whichever is larger.
    """
    if len(shifts) < 3:
        return 0.0
    (slope, _), spread = np.polyfit(np.arange(len(shifts)), shifts, 1, cov=True)
    return float(2 * np.maximum(np.abs(slope), np.sqrt(spread[0, 0])).max())


def eight_bits(frame: Frame, depth: int) -> Image:
    """Return a picture converted from `depth` bits to 8 bits.

    A gray picture stays gray, and a picture with three color channels keeps them. A fourth channel
    is dropped. A picture stored in 8 bits keeps its values.
    """
    if frame.ndim == 3 and frame.shape[2] != 3:
        frame = frame[..., :3] if frame.shape[2] == 4 else frame[..., 0]
    if frame.dtype == np.uint8:
        return frame
    return np.asarray(frame >> max(0, depth - 8), np.uint8)


def warp_back(
    picture: Image, drift: Array, corner: Sequence[int], behind: Image, every: int = 1
) -> Image:
    """Return a picture without its drift, in the shape of `behind`.

    The picture is shifted, scaled and turned. Each pixel then shows the same point of the scene as
    in `behind`. Pixels that the picture does not show are copied from `behind`.

    Parameters
    ----------
    picture
        The picture with its drift.
    drift
        Drift of the picture from the first picture of the clip, (4,): shift to the right and down
        [pixels], growth, and turn [rad].
    corner
        Position of the first pixel of `behind` in the first picture, x and y [pixels].
    behind
        The background: the clip without moving objects, aligned with the first picture.
    every
        Spacing of the rows and columns of `behind` in the first picture [pixels].
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
    flags, mode = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_TRANSPARENT
    size, here = (columns, rows), behind.copy()
    cv2.warpAffine(picture, back, size, dst=here, flags=flags, borderMode=mode)
    return here


def share_of(pictures: Sequence[Image]) -> float:
    """Return the level of the quantile that gives the background of the pictures, 0 to 1.

    The background of a pixel is a quantile of the pixel's gray values in all pictures. The level is
    0.5, the median, for color pictures and for fewer than eight pictures. In gray pictures from a
    laboratory, a slow ball may cover a pixel most of the time. With eight or more gray pictures,
    the level is therefore below 0.5 if the ball is lighter than the background, and above 0.5 if
    the ball is darker.
    """
    if pictures[0].ndim == 3 or len(pictures) < _STILL.fewest:
        return 0.5
    stack = np.stack([each[::2, ::2] for each in pictures])
    low, high = (each.astype(int) for each in (stack.min(axis=0), stack.max(axis=0)))
    reach = high - low
    touched = reach > _STILL.touched * max(float(np.median(reach)) / 4, 1.0)
    middle = of_rank(stack, len(stack) // 2).astype(int)
    return _STILL.side if (low + high - 2 * middle)[touched].sum() >= 0 else 1 - _STILL.side


def _panorama(
    pictures: Sequence[Image], drifts: Array, share: float = 0.5, grid: int = 1
) -> tuple[Image, tuple[int, int]]:
    """Return a quantile of drifted pictures over all that they show, and x, y of its first pixel.

    x and y are multiples of `grid`. A pixel that a picture does not show is copied from the
    previous picture. It is black if no picture shows it.
    """
    size = pictures[0].shape[1::-1]
    corners = np.array([[x, y] for x in (0, size[0]) for y in (0, size[1])], float)
    back = [cv2.invertAffineTransform(matrix_of(each, size)) for each in drifts]
    outline = np.concatenate([corners, *(corners @ each[:, :2].T + each[:, 2] for each in back)])
    left, top = grid * np.floor(outline.min(axis=0) / grid).astype(int)
    right, below = grid * np.ceil(outline.max(axis=0) / grid).astype(int)
    whole = np.zeros((below - top, right - left, *pictures[0].shape[2:]), np.uint8)
    pairs = list(zip(pictures, drifts, strict=True))
    for row in range(0, len(whole), _STILL.rows):
        here, stack = whole[row : row + _STILL.rows], []
        for picture, drift in (*reversed(pairs), *pairs) if drifts.any() else pairs:
            here = warp_back(picture, drift, (left, top + row), here)
            stack.append(here)
        ranked = np.stack(stack[-len(pairs) :])
        whole[row : row + _STILL.rows] = of_rank(ranked, round(share * (len(pairs) - 1)))
    return whole, (int(left), int(top))


def of_rank(stack: NDArray[np.uint8], rank: int) -> Image:
    """Return, for each pixel, the gray value with the rank `rank` among several pictures.

    `stack` has up to 255 pictures along its first axis; the result has the shape of one picture.
    Rank 0 is the darkest value.
    """
    result = np.zeros(stack.shape[1:], np.uint8)
    for bit in (128, 64, 32, 16, 8, 4, 2, 1):
        below = (stack < result + np.uint8(bit)).sum(axis=0, dtype=np.uint8)
        result += np.uint8(bit) * (below <= rank)  # much faster than `where`
    return result


def _shrunk(picture: Image, shrink: int) -> Image:
    """Return a picture reduced by repeated halving, which is much faster than one reduction."""
    while shrink > 1:
        rows, columns = (2 * (side // 2) for side in picture.shape[:2])
        size = (columns // 2, rows // 2)
        picture, shrink = area_mean(picture[:rows, :columns], size), shrink // 2
    return picture


def area_mean(picture: Image, size: tuple[int, int]) -> Image:
    """Return a picture reduced to a size, (columns, rows), by the means of areas."""
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def soft(picture: Image) -> Image:
    """Return a smoothed gray picture, because noise and the blocks of a codec have steep edges."""
    return np.asarray(cv2.GaussianBlur(grey_of(picture), (5, 5), 1.0), np.uint8)


def _as_bright(behind: Image, light: Array) -> Image:
    """Return the background scaled to the brightness of a picture, per channel."""
    same = (light == 1.0).all()  # if so, no copy is made
    return behind if same else np.asarray(cv2.multiply(behind, light), np.uint8)
