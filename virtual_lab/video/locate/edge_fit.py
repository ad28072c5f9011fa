"""A ball's place from its outline alone, to the limit of its own pattern: the edge fit.

The ball's brightness may go up and down along the rim and inward from it: smooth shading, as of
light from a side, and a pattern such as a seam, of unknown strength in each sector of the rim. What
the pattern may shift the place by is distinguished from noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import exp, pi, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.video.locate import rim_profiles as at
from virtual_lab.video.locate.located import Located, PlaceFlag
from virtual_lab.video.locate.noise import Noise
from virtual_lab.video.locate.rim_profiles import LIKE, blurred_profiles

if TYPE_CHECKING:
    from virtual_lab.video.locate.edge_kernel import Rim, View

__all__ = ["covered", "fit_edge", "solve_ring"]

Array = NDArray[np.float64]
Places = NDArray[np.int_]

PIXEL = 1 / 12  # variance of a square pixel along any direction
INSIDE = 3.0  # pixels of the ball that are looked at, blur apart
ARC = 3.0  # pixels along the rim that one sector has
SECTORS = (24, 96)
MISFIT = 3.0  # chi^2 on the outline, of a pattern finer than a sector too
SHARE = 0.02  # of the outline: more than this makes a flag
SPARE = 0.12  # of the outline: a fit on less has lost the ball
STRAY = 0.02  # share of pixels that fit nothing
OVAL = 0.003  # of an outline, as far as nobody knows: a camera that looks at the ball squarely
FAINT = 100.0  # standard uncertainties in the radius: with fewer there is no outline
GENEROUS = 1.5  # seams are no random field: what hides at the rim shifts more than one would
HIDDEN = 0.3  # of what a pattern at the rim would shift the place by, were it the outline
COVERED = 0.27  # of the rim; the side that no light reaches may be as dark as what is behind
RISE = 1e3  # DN over a region: a background's slope is less
FAINTEST, STRONGEST = 0.004, 0.5  # of the ball's brightness, a pattern's standard deviation
NOISY = 0.6  # of a pixel's noise: a fainter pattern would not be seen
# of the ball's brightness, a pattern until the outline stands still, and when it first does: with
# more, at first, it would explain an outline in a wrong place
STIFF, ROUGH = 0.01, 0.06
STILL, SETTLING = 0.2, 7  # pixels; repetitions at most
ROUNDS, CLOSE = 4, 1.0  # repetitions after that at most; a step of so much of u ends them
TURNS, SMALL = 12, 0.1  # solutions of each for the pattern's strength; likewise
SHADE = 2.0  # of the ball's brightness: what shading may be
HELD = 1e12
# how much of the rim is hidden: where the picture shows the background in its place
RING = 1.5, 4.5  # pixels inside the outline that are looked at, wherever the ball is
ALIKE = 3.0  # standard deviations of noise: the background and nothing else
CLEAR = 12.0  # of them that ball and background are apart: with less they are alike


def fit_edge(
    regions: NDArray[np.generic],
    corners: Array,
    start: Located,
    *,
    noise: Noise,
    lens: float = 0.7,
    background: Array | None = None,
    oval: ArrayLike = 0.0,
    oval_u: float = OVAL,
) -> Located:
    """Return the balls of a batch of regions by their outlines.

    `x_u` and `y_u` are noise alone; `pattern_u` is what the pattern may shift x or y by.

    Parameters
    ----------
    regions
        Grey values, (region, row, col) [DN]: the ball, its blur and some pixels around.
    corners
        Place of each region's first pixel in the frame, (region, 2): x, y.
    start
        Where the ball is to a pixel or so, how large, and how blurred it is: the blur is held.
    noise
        The camera's noise; its black shows how bright the ball is.
    lens
        Standard deviation of the lens's blur [pixel].
    background
        The scene without the ball, (region, row, col) or (1, row, col); its level is fitted,
        with a slope. Without it, the background is a level and a slope.
    oval
        What is known of outlines that are no circles, r = R (1 + c cos 2a + s sin 2a): c and s,
        (region, 2) or less. A sphere off a camera's axis by the angle b has an outline that is
        longer by 1 / cos b along the way from the axis.
    oval_u
        Standard uncertainty of c and s; 0 only where they are known to 0.0005: what is left of
        an ellipse would be taken for a pattern, and the place with it.
    """
    from virtual_lab.video.locate.edge_kernel import Rim, View

    pixels = np.ascontiguousarray(regions, float)
    behind = np.ones((1, *pixels.shape[1:]))
    if background is not None:
        behind = np.ascontiguousarray(background, float)
    count = len(pixels)
    ways = np.stack([start.blur_x, start.blur_y], axis=1)
    p = np.zeros((count, at.COUNT))
    p[:, at.X], p[:, at.Y] = (np.stack([start.x, start.y], axis=1) - corners).T
    p[:, at.RADIUS] = start.radius
    p[:, [at.OVAL_C, at.OVAL_S]] = oval
    found: list[Outline | None] = [None] * count
    usable = np.isfinite(p).all(axis=1) & np.isfinite(ways).all(axis=1)
    if usable.any():
        width = sqrt(lens**2 + PIXEL)
        radius = float(np.median(p[usable, at.RADIUS]))
        known = blurred_profiles(radius, width, INSIDE, float(np.hypot(*ways[usable].T).max()))
        sectors = int(np.clip(round(2 * pi * radius / ARC), *SECTORS))
        prior = _prior(oval_u)
        for k in np.flatnonzero(usable):
            rim = Rim(known.table, known.stiffness, known.hides, width, INSIDE, ways[k])
            view = View(pixels[k], behind[k % len(behind)])
            found[k] = _outline(view, rim, noise, prior, sectors, p[k])
    return _judged(found, start, corners, pixels.shape[1:])


def _prior(oval_u: float) -> Array:
    """Return the weights of what was known before."""
    prior = np.zeros(at.COUNT)
    prior[[at.OVAL_C, at.OVAL_S]] = 1 / oval_u**2 if oval_u else HELD
    prior[[at.LEVEL, at.SLOPE_X, at.SLOPE_Y]] = 1e-12, 1 / RISE**2, 1 / RISE**2
    return prior


@dataclass(frozen=True, slots=True)
class Outline:
    """What fits one region."""

    p: Array  # the kernel's shared parameters
    covariance: Array  # (3, 3) of x, y and radius
    shifts: Array  # (3,) variances that the pattern gives them
    tally: Array  # the kernel's
    sway: float  # how far the place would be off, were the pattern the outline [pixel]
    covered: float  # share of the rim that is as bright as what is behind


def _outline(
    view: View, rim: Rim, noise: Noise, prior: Array, sectors: int, start: Array
) -> Outline | None:
    """Fit one region by Gauss and Newton; None: nothing fits."""
    from virtual_lab.video.locate.edge_kernel import sector_sums

    p, knots = start.copy(), len(rim.stiffness)
    bright = _brightness(view.pixels, p, noise)
    faintest = NOISY * sqrt(float(noise.variance(noise.black + bright))) / bright
    pattern, amplitude = np.zeros((sectors, knots)), np.full(sectors, STIFF)
    sums = np.empty((sectors + 1, *[at.COUNT + 2 * knots + 1] * 2))
    change, settling, rounds = pattern, True, 0
    for turn in range(SETTLING + ROUNDS):
        tally = sector_sums(view, rim, noise.figures, p, pattern, settling, sums)
        if tally[at.PIXELS] < 4 * at.COUNT:
            return None
        weight = prior.copy()
        weight[: at.LEVEL] = prior[: at.LEVEL] if turn else HELD
        weight[at.PLAIN :] = 1.0 / (SHADE * bright) ** 2
        equations = _equations(sums, knots)
        equations.shared[:, :-1] += np.diag(weight)
        equations.shared[:, -1] += weight * (start - p)
        last = np.full(2, np.inf)
        for again in range(1 if settling else TURNS):
            if again:
                power = np.mean(((pattern + change) / bright) ** 2, axis=1)
                power = np.maximum(power, np.maximum(_before(power), _next(power)))
                amplitude = np.sqrt(max(FAINTEST, faintest) ** 2 + power).clip(max=STRONGEST)
            solved = _solved(equations, pattern, amplitude * bright, rim.stiffness)
            if solved is None:
                return None
            step, change, covariance, by_pattern = solved
            u = sqrt(covariance[0, 0])
            if np.abs(step[:2] - last).max() < SMALL * u:
                break
            last = step[:2]
        far = float(np.abs(step[:3]).max())
        if not far < 0.5 * start[at.RADIUS]:
            return None
        p[: at.LEVEL] += min(1.0, 1.0 / max(far, 1e-9)) * step[: at.LEVEL]
        p[at.LEVEL :] += step[at.LEVEL :]
        pattern += change
        rounds += not settling
        if rounds == ROUNDS or (rounds > 1 and far < CLOSE * u):
            break
        if settling and ((far <= STILL and turn) or turn + 1 == SETTLING):
            settling, amplitude = False, np.full(sectors, ROUGH)
    return Outline(
        p=p,
        covariance=covariance,
        shifts=_shifts(by_pattern / (amplitude * bright)[:, None, None], rim.stiffness),
        tally=tally,
        sway=_sway(pattern, rim.hides, view, p, noise.black + bright),
        covered=covered(view, p, rim.way, noise),
    )


class Equations(NamedTuple):
    """Normal equations: a ring of blocks, one where a sector begins, and what all share."""

    blocks: Array  # (sector, knot, knot)
    links: Array  # (sector, knot, knot) of each with the next
    border: Array  # (sector, knot, shared + 1) of each with the shared, and its right side
    shared: Array  # (shared, shared + 1)


def _equations(sums: Array, knots: int) -> Equations:
    """Return the equations of the kernel's sums."""
    count = sums.shape[1] - 2 * knots - 1
    begin, end = np.s_[count : count + knots], np.s_[count + knots : -1]
    rest = np.r_[:count, -1]
    ring = sums[:-1]
    return Equations(
        ring[:, begin, begin] + _before(ring[:, end, end]),
        ring[:, begin, end],
        ring[:, begin][..., rest] + _before(ring[:, end][..., rest]),
        sums.sum(axis=0)[:count][:, rest],
    )


def _solved(
    equations: Equations, pattern: Array, spread: Array, stiffness: Array
) -> tuple[Array, Array, Array, Array] | None:
    """Return steps of shared parameters and pattern, with what they are known to.

    The pattern is believed to be alike over LIKE along the rim, of a standard deviation `spread`
    (sector,). Then come the covariance of x, y and radius, and theirs with the pattern,
    (sector, knot, 3).
    """
    blocks, links, border, shared = equations
    like = _like(len(pattern))
    here, after = 1 / spread, 1 / _next(spread)
    own, next_to = (1 + like**2) / (1 - like**2) * here**2, -like / (1 - like**2) * here * after
    pull = next_to[:, None] * _next(pattern)
    pull += _before(next_to[:, None] * pattern) + own[:, None] * pattern
    right = border.copy()
    right[..., -1] -= pull @ stiffness
    blocks = blocks + own[:, None, None] * stiffness
    links = links + next_to[:, None, None] * stiffness
    try:
        ring = solve_ring(blocks, links, right)
        left = shared - np.tensordot(border[..., :-1], ring, ((0, 1), (0, 1)))
        covariance = np.linalg.inv(left[:, :-1])
    except np.linalg.LinAlgError:
        return None
    step = covariance @ left[:, -1]
    change = ring[..., -1] - ring[..., :-1] @ step
    by_pattern = -ring[..., :-1] @ covariance[:, :3]
    return step, change, np.asarray(covariance[:3, :3]), np.asarray(by_pattern)


def _like(sectors: int) -> float:
    """Return the correlation of a pattern from one sector to the next."""
    return exp(-2 * pi / sectors / LIKE)


def solve_ring(blocks: Array, links: Array, right: Array) -> Array:
    """Return the solution of a ring of blocks of which only neighbours meet, as `right`.

    `blocks` (block, n, n) are on the diagonal, `links` from each to the next, the last's to the
    first; `right` (block, n, m). Folded, 0, last, 1, …, neighbours are two places apart: a band.
    Raises `LinAlgError` where it is not positive definite.
    """
    from scipy.linalg.lapack import dpbsv

    count, n = blocks.shape[:2]
    first, on, beside = _folded(count, n)
    band = np.zeros((3 * n, count * n), order="F")
    band[on] = blocks
    band[beside] = links
    folded = np.empty((count * n, right.shape[2]), order="F")
    folded[first] = right
    _, solved, failed = dpbsv(band, folded, lower=1, overwrite_ab=1, overwrite_b=1)
    if failed:
        raise np.linalg.LinAlgError("a ring of sectors that is not positive definite")
    return np.asarray(solved[first])


@lru_cache
def _folded(count: int, n: int) -> tuple[Places, tuple[Places, Places], tuple[Places, Places]]:
    """Return the rows of each block of a folded ring; where in the band blocks and links stand."""
    step = np.minimum(2 * np.arange(count), 2 * count - 1 - 2 * np.arange(count))
    first = step[:, None] * n + np.arange(n)
    places = []
    for column in (first, _next(first)):
        one, other = np.broadcast_arrays(first[:, :, None], column[:, None])
        places.append((np.abs(one - other), np.minimum(one, other)))
    return first, places[0], places[1]


def _next(values: NDArray[Any]) -> NDArray[Any]:
    """Return what each sector's next one has."""
    return np.concatenate((values[1:], values[:1]))


def _before(values: NDArray[Any]) -> NDArray[Any]:
    """Return what the sector before each has."""
    return np.concatenate((values[-1:], values[:-1]))


def _shifts(by_pattern: Array, stiffness: Array) -> Array:
    """Return the variance a pattern gives x, y and radius, from their rows of the inverse."""
    like = _like(len(by_pattern))
    along = (1 + like**2) * by_pattern - 2 * like * _next(by_pattern)
    return np.asarray(np.einsum("ska,kl,sla->a", by_pattern, stiffness, along) / (1 - like**2))


def _brightness(region: Array, p: Array, noise: Noise) -> float:
    """Return the root mean square of the ball's grey values over the black."""
    row, col = np.ogrid[: region.shape[0], : region.shape[1]]
    ball = np.hypot(row - p[at.Y], col - p[at.X]) < 0.9 * p[at.RADIUS]
    return max(1.0, sqrt(float(np.mean((region[ball] - noise.black) ** 2)))) if ball.any() else 1.0


def _sway(pattern: Array, hides: Array, view: View, p: Array, light: float) -> float:
    """Return how far the place would be off were the pattern taken for the outline [pixel]."""
    contrast = max(abs(light - p[at.LEVEL] * view.background.mean()), 1.0)
    turn = np.exp(2j * pi * np.arange(len(pattern)) / len(pattern))
    return float(2.0 * abs(turn @ (pattern @ hides)) / (len(pattern) * contrast))


def covered(view: View, p: Array, way: Array, noise: Noise) -> float:
    """Return the share of the rim's pixels that are as bright as their background, alone.

    What stands before the ball stood there before it came: a bat, a cable, the sabot's catcher.
    """
    row, col = np.ogrid[: view.pixels.shape[0], : view.pixels.shape[1]]
    u, v = col - p[at.X], row - p[at.Y]
    ends = [np.hypot(u + side * way[0], v + side * way[1]) for side in (-0.5, 0.5)]
    far = np.maximum(*ends)
    rim = (far > p[at.RADIUS] - RING[1]) & (far < p[at.RADIUS] - RING[0])
    if not rim.any():
        return 0.0
    seen, expected = view.pixels[rim], p[at.LEVEL] * view.background[rim]
    if (seen - expected).mean() ** 2 < CLEAR**2 * noise.variance(expected.mean()):
        return 0.0
    return float(((seen - expected) ** 2 < ALIKE**2 * noise.variance(expected)).mean())


def _judged(
    outlines: list[Outline | None], start: Located, corners: Array, shape: tuple[int, ...]
) -> Located:
    """Return what was found, with what is to be said against it."""
    lost_p, lost_tally = np.full(at.COUNT, np.nan), np.full(at.TALLY, np.nan)
    none = Outline(lost_p, np.full((3, 3), np.nan), np.full(3, np.nan), lost_tally, 0.0, 0.0)
    found = [each or none for each in outlines]
    p, covariance, shifts, tally = (
        np.array([getattr(each, name) for each in found])
        for name in ("p", "covariance", "shifts", "tally")
    )
    sway, hidden = np.array([(each.sway, each.covered) for each in found]).reshape(-1, 2).T
    misfit = tally[:, at.NEAR] / np.maximum(tally[:, at.AROUND] - at.COUNT, 1.0)
    grown = np.maximum(misfit, 1.0)[:, None]  # misfit counts as noise
    total = np.diagonal(covariance, axis1=1, axis2=2)
    own = np.sqrt(np.maximum(total - shifts, 0.0) * grown)
    pattern = GENEROUS * np.sqrt(np.maximum(shifts, 0.0) * grown)
    whole = np.hypot(own, pattern)
    pattern[:, :2] = np.hypot(pattern[:, :2], HIDDEN * sway[:, None])
    around = 2 * pi * p[:, at.RADIUS]
    seen, full = tally[:, at.SEEN] / around, tally[:, at.FULL] / around
    stray = tally[:, at.STRAY] / np.maximum(tally[:, at.PIXELS], 1.0)
    with np.errstate(invalid="ignore"):
        lost = ~np.isfinite(np.column_stack([p, whole])).all(axis=1)
        lost |= seen < SPARE
        lost |= whole.max(axis=1) * FAINT > p[:, at.RADIUS]
        for place, side in ((at.X, shape[1]), (at.Y, shape[0])):
            reach = 0.5 * p[:, at.RADIUS]
            lost |= (p[:, place] < -reach) | (p[:, place] > side - 1 + reach)
        tests = {
            PlaceFlag.SATURATED: full > SHARE,
            PlaceFlag.CLIPPED: 1 - seen > SHARE,
            PlaceFlag.OVERLAP: hidden > COVERED,
            PlaceFlag.POOR_FIT: (misfit > MISFIT) | (stray > STRAY),
        }
    flags = np.zeros(len(p), np.uint16)
    for flag, raised in tests.items():
        flags[raised] |= np.uint16(flag)
    flags[lost] = PlaceFlag.NOT_FOUND
    p[lost], own[lost], pattern[lost] = np.nan, np.nan, np.nan
    return Located(
        x=p[:, at.X] + corners[:, 0],
        y=p[:, at.Y] + corners[:, 1],
        radius=p[:, at.RADIUS],
        x_u=own[:, 0],
        y_u=own[:, 1],
        blur_x=start.blur_x,
        blur_y=start.blur_y,
        chi_square=np.where(lost, np.nan, misfit),
        flags=flags,
        pattern_u=np.hypot(pattern[:, 0], pattern[:, 1]) / sqrt(2),
    )
