"""The edge fit: position of a ball from its outline, as accurate as its pattern allows.

The brightness of the ball may vary along the rim and inward from it. The causes are smooth shading
(light from the side) and a pattern such as a seam. The strength of the pattern is unknown in each
sector of the rim. The pattern may shift the position; the u of this shift is estimated separately
from noise.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from math import exp, pi, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.units import Array
from virtual_lab.video.locate.located import Located, PlaceFlag, Regions
from virtual_lab.video.locate.noise import Noise
from virtual_lab.video.locate.rim_profiles import AT, TABLE, TALLY, Profiles, blurred_profiles

if TYPE_CHECKING:
    from virtual_lab.video.locate.edge_kernel import View

Places = NDArray[np.int_]
Equations = tuple[Array, Array, Array, Array]  # see `_equations`


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeFit:
    """Settings of the fit, and limits of a good fit. Shares refer to the outline."""

    cell_px: float = 3.0  # depth of the rim without blur, and length of a sector
    # u of the oval of the outline if it is not known, for a camera that points at the ball
    oval_u: float = 0.003
    held_weight: float = 1e12  # weight of a fixed parameter

    # standard deviations of a pattern, as shares of the ball's brightness unless stated otherwise:
    strongest_pattern: float = 0.5
    # faintest pattern, which is hardly visible [share of a pixel's noise]
    unseen_pattern: float = 0.6
    # values until the outline has converged (with less, a rim that is half in the dark would not
    # fit), and when it first has converged (more would explain an outline in a wrong position)
    settling_pattern: float = 0.01
    first_pattern: float = 0.06

    settling_step_px: float = 0.2  # largest step of an outline that has converged
    # largest number of rounds until the outline has converged, then until a step is less than its
    # u, and within one solution
    rounds: int = 7
    # smallest step for which the strength of the pattern is estimated again
    strength_step_over_u: float = 0.1

    # factor on the shift by a pattern, because seams are not a random field, and seams hidden at
    # the rim shift more
    pattern_factor: float = 1.5
    sway_share: float = 0.3  # share of the shift if the pattern were mistaken for the outline
    least_radius_over_u: float = 100.0  # smallest ratio of the radius to the u of the fit
    # largest reduced chi^2 on the outline, where a pattern may be finer than a sector
    greatest_misfit: float = 3.0
    # largest share of the outline that is at full scale or outside the picture, and largest share
    # of outlying pixels
    flagged_share: float = 0.02

    # limits for a hidden rim, where the picture shows the background instead of the ball:
    # largest difference of a pixel that shows only the background [standard deviations of noise]
    alike_sigmas: float = 3.0
    # largest hidden share of the rim, because an unlit side may be as dark as the background
    covered_share: float = 0.27


RIM_FIT = EdgeFit()
# fields of `Located` that are fitted
FITTED = ("x", "y", "radius", "x_u", "y_u", "chi_square", "pattern_u")


def fit_edge(
    regions: Regions,
    start: Located,
    *,
    noise: Noise,
    lens: float,
    oval: ArrayLike = 0.0,
    oval_u: float = RIM_FIT.oval_u,
) -> Located:
    """Return position and radius of the ball in each region, from a fit of its outline.

    Positions are in pixels of the full frame. The radius is in pixels. `x_u` and `y_u` only include
    noise. `pattern_u` is the standard uncertainty caused by the pattern of the ball, the same in x
    and in y. A ball that cannot be fitted has the flag `NOT_FOUND`. All its values except the blur
    are then NaN.

    Parameters
    ----------
    regions
        Regions that contain the blurred ball and some pixels around it. The level of the background
        is fitted.
    start
        Position of the ball to about a pixel, its radius, and its motion blur. The blur is not
        fitted.
    noise, lens
        Noise of the camera, and standard deviation of the blur of its lens [pixels].
    oval
        Expected deviation of the outlines from circles: the numbers c and s, in a shape that
        broadcasts to (region, 2). The outline is an ellipse. Its radius in the direction a is r = R
        (1 + c cos 2a + s sin 2a), where R is the mean radius.

        A ball beside the camera's axis has such an outline. The outline is longer in the direction
        away from the axis, by the factor 1 / cos b. b is the angle between the ball and the axis.
    oval_u
        Standard uncertainty of c and s. If it is above 0, c and s are fitted together with the
        position and the radius. If it is 0, c and s keep the values of `oval`. State 0 only if the
        errors of c and s are below 0.0005. Larger errors would be taken for a pattern of the ball.
    """
    from virtual_lab.video.locate.edge_kernel import View

    ways, count = np.stack([start.blur_x, start.blur_y], axis=1), len(start.x)
    p = np.zeros((count, len(AT)))
    p[:, [AT.x, AT.y]] = start.places - regions.corners
    p[:, AT.radius] = start.radius
    p[:, [AT.oval_c, AT.oval_s]] = oval
    prior = np.zeros(len(AT))
    prior[[AT.oval_c, AT.oval_s]] = 1 / oval_u**2 if oval_u else RIM_FIT.held_weight
    # Level and slopes of the background are free.
    prior[[AT.level, AT.slope_x, AT.slope_y]] = 1 / RIM_FIT.held_weight
    table = np.full((count, len(FITTED)), np.nan)
    flags = np.full(count, PlaceFlag.NOT_FOUND, np.uint16)
    usable = np.isfinite(p).all(axis=1) & np.isfinite(ways).all(axis=1)
    if usable.any():
        width = sqrt(lens**2 + 1 / 12)  # the variance of a square pixel is 1/12 in any direction
        radius = float(np.median(p[usable, AT.radius]))
        blur = float(np.hypot(*ways[usable].T).max())
        rim = blurred_profiles(radius, width, RIM_FIT.cell_px, blur)
        sectors = max(3, round(2 * pi * radius / RIM_FIT.cell_px))
        for k in np.flatnonzero(usable):
            here, behind = regions.pixels[k], regions.background[k]
            view = View(here.astype(float, "C"), behind.astype(float, "C"), ways[k])
            with suppress(np.linalg.LinAlgError):
                table[k], flags[k] = _outline(view, rim, noise, prior, sectors, p[k])
    table[:, :2] += regions.corners
    return replace(start, flags=flags, **dict(zip(FITTED, table.T, strict=True)))


def _outline(
    view: View, rim: Profiles, noise: Noise, prior: Array, sectors: int, start: Array
) -> tuple[list[float], int]:
    """Fit one region by Gauss-Newton. Return the values of `FITTED`, and flags.

    Raises `LinAlgError` if the equations have no solution.
    """
    from virtual_lab.video.locate.edge_kernel import sector_sums

    p, knots = start.copy(), len(rim.stiffness)
    bright = _brightness(view.pixels, p, noise)
    faintest = RIM_FIT.unseen_pattern * sqrt(float(noise.variance(noise.black + bright))) / bright
    pattern, amplitude = np.zeros((sectors, knots)), np.full(sectors, RIM_FIT.settling_pattern)
    sums = np.empty((sectors + 1, *[len(AT) + 2 * knots + 1] * 2))
    change, settling, rounds = pattern, True, 0
    for turn in range(2 * RIM_FIT.rounds):
        tally = sector_sums(view, rim, noise.figures, p, pattern, settling, sums)
        if tally[TALLY.pixels] < 4 * len(AT):
            raise np.linalg.LinAlgError("too few pixels")
        weight = prior.copy()
        if not turn:
            weight[: AT.level] = RIM_FIT.held_weight
        weight[AT.plain :] = 1.0 / bright**2  # prior: shading is about as strong as the brightness
        equations = _equations(sums, knots)
        shared = equations[-1]
        shared[:, :-1] += np.diag(weight)
        shared[:, -1] += weight * (start - p)
        last = np.full(2, np.inf)
        for again in range(1 if settling else RIM_FIT.rounds):
            if again:
                power = np.mean(((pattern + change) / bright) ** 2, axis=1)
                power = np.maximum(power, np.maximum(_before(power), _next(power)))
                amplitude = np.sqrt(faintest**2 + power).clip(max=RIM_FIT.strongest_pattern)
            spread = amplitude * bright
            step, change, covariance, by_pattern = _solve(equations, pattern, spread, rim.stiffness)
            u = sqrt(covariance[0, 0])
            if np.abs(step[:2] - last).max() < RIM_FIT.strength_step_over_u * u:
                break
            last = step[:2]
        far = float(np.abs(step[:3]).max())
        if not far < 0.5 * start[AT.radius]:
            raise np.linalg.LinAlgError("the fit runs away")
        p[: AT.level] += min(1.0, 1.0 / max(far, 1e-9)) * step[: AT.level]
        p[AT.level :] += step[AT.level :]
        pattern += change
        rounds += not settling
        if rounds == RIM_FIT.rounds or (rounds > 1 and far < u):
            break
        if settling and ((far <= RIM_FIT.settling_step_px and turn) or turn + 1 == RIM_FIT.rounds):
            settling, amplitude = False, np.full(sectors, RIM_FIT.first_pattern)
    shifts = _shifts(by_pattern / (amplitude * bright)[:, None, None], rim.stiffness)
    sway = _sway(pattern, rim.hides, view, p, noise.black + bright)
    hidden = hidden_share(view, p, noise)
    return _assess(p, np.diagonal(covariance), shifts, tally, sway, hidden)


def _equations(sums: Array, knots: int) -> Equations:
    """Return the normal equations from the kernel's sums.

    They have a ring of blocks, one per sector boundary, and shared parameters. The result is:

    * blocks, (sector, knot, knot)
    * links, the coupling of each sector with the next, (sector, knot, knot)
    * border, the coupling with the shared parameters, and the right side, (sector, knot, shared +
      1)
    * equations of the shared parameters, and their right side, (shared, shared + 1)
    """
    count = len(AT)
    begin, end = np.s_[count : count + knots], np.s_[count + knots : -1]
    rest = np.r_[:count, -1]
    ring = sums[:-1]
    blocks = ring[:, begin, begin] + _before(ring[:, end, end])
    border = ring[:, begin][..., rest] + _before(ring[:, end][..., rest])
    return blocks, ring[:, begin, end], border, sums.sum(axis=0)[:count][:, rest]


def _solve(
    equations: Equations, pattern: Array, spread: Array, stiffness: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the steps of shared parameters and pattern, with their covariances.

    The pattern is assumed to be correlated along the rim, with the standard deviation `spread`,
    (sector,). The third result is the covariance of x, y and radius, (3, 3), and the fourth is
    their covariance with the pattern, (sector, knot, 3). Raises `LinAlgError` if there is no
    solution.
    """
    blocks, links, border, shared = equations
    like = _like(len(pattern))
    here, after = 1 / spread, 1 / _next(spread)
    diagonal, beside = (1 + like**2) / (1 - like**2) * here**2, -like / (1 - like**2) * here * after
    pull = beside[:, None] * _next(pattern)
    pull += _before(beside[:, None] * pattern) + diagonal[:, None] * pattern
    right = border.copy()
    right[..., -1] -= pull @ stiffness
    blocks = blocks + diagonal[:, None, None] * stiffness
    links = links + beside[:, None, None] * stiffness
    ring, solved = solve_ring(blocks, links, right, shared)
    return solved[:, 0], ring[..., 0], solved[:3, 1:], ring[..., 1:]


def _like(sectors: int) -> float:
    """Return the correlation of a pattern from one sector to the next."""
    return exp(-2 * pi / sectors / TABLE.alike)


def solve_ring(blocks: Array, links: Array, border: Array, corner: Array) -> tuple[Array, Array]:
    """Return the solution of symmetric equations of a ring of blocks and of shared parameters.

    The first result is the part of the ring, (block, n, 4), and the second one that of the shared
    parameters, (m, 4). The last three columns are the first three columns of the inverse matrix
    that belong to shared parameters. Raises `LinAlgError` if the matrix is not positive definite.

    Parameters
    ----------
    blocks
        Blocks on the diagonal of the matrix, (block, n, n). Each has n rows and n columns. There
        are at least three.
    links
        Blocks beside the diagonal, (block, n, n). ``links[k]`` is in the rows of block k and the
        columns of block k + 1. The last link is in the rows of the last block and the columns of
        the first block. The other half of the symmetric matrix has the transposed links.
    border
        Columns of the shared parameters and right side, in the rows of the ring, (block, n, m + 1).
    corner
        Columns of the shared parameters and right side, in their own rows, (m, m + 1).
    """
    from scipy.linalg.lapack import dpbtrf, dtbtrs

    count, n = blocks.shape[:2]
    first, on, beside = _fold(count, n)
    band = np.zeros((3 * n, count * n), order="F")
    band[on], band[beside] = blocks, links
    folded = np.empty((count * n, border.shape[2]), order="F")
    folded[first] = border
    factor, fault = dpbtrf(band, lower=1, overwrite_ab=1)
    if fault:
        raise np.linalg.LinAlgError("the ring is not positive definite")
    half = dtbtrs(factor, folded, uplo="L", overwrite_b=1)[0]
    left = corner - half[:, :-1].T @ half
    inverse = np.linalg.inv(left[:, :-1])
    solved = np.column_stack([inverse @ left[:, -1], inverse[:, :3]])
    rest = -half[:, :-1] @ solved
    rest[:, 0] += half[:, -1]
    return dtbtrs(factor, rest, uplo="L", trans="T")[0][first], solved


@lru_cache
def _fold(count: int, n: int) -> tuple[Places, tuple[Places, Places], tuple[Places, Places]]:
    """Return the rows of each block of a folded ring, and their positions in the band."""
    step = np.minimum(2 * np.arange(count), 2 * count - 1 - 2 * np.arange(count))
    first = step[:, None] * n + np.arange(n)
    places = []
    for column in (first, _next(first)):
        one, other = np.broadcast_arrays(first[:, :, None], column[:, None])
        places.append((np.abs(one - other), np.minimum(one, other)))
    return first, places[0], places[1]


def _next(values: NDArray[Any]) -> NDArray[Any]:
    """Return the values of the next sector."""
    return np.concatenate((values[1:], values[:1]))


def _before(values: NDArray[Any]) -> NDArray[Any]:
    """Return the values of the previous sector."""
    return np.concatenate((values[-1:], values[:-1]))


def _shifts(by_pattern: Array, stiffness: Array) -> Array:
    """Return the variances of x, y and radius from a pattern, using their rows of the inverse."""
    like = _like(len(by_pattern))
    along = (1 + like**2) * by_pattern - 2 * like * _next(by_pattern)
    return np.asarray(np.einsum("ska,kl,sla->a", by_pattern, stiffness, along) / (1 - like**2))


def _brightness(region: Array, p: Array, noise: Noise) -> float:
    """Return the root mean square of the ball's gray values above the black level."""
    row, col = np.ogrid[: region.shape[0], : region.shape[1]]
    ball = np.hypot(row - p[AT.y], col - p[AT.x]) < 0.9 * p[AT.radius]
    return max(1.0, sqrt(float(np.mean((region[ball] - noise.black) ** 2)))) if ball.any() else 1.0


def _sway(pattern: Array, hides: Array, view: View, p: Array, light: float) -> float:
    """Return the shift of the position [pixels] if the pattern were mistaken for the outline."""
    contrast = max(abs(light - p[AT.level] * view.background.mean()), 1.0)
    turn = np.exp(2j * pi * np.arange(len(pattern)) / len(pattern))
    return float(2.0 * abs(turn @ (pattern @ hides)) / (len(pattern) * contrast))


def hidden_share(view: View, p: Array, noise: Noise) -> float:
    """Return the share of the pixels along the ball's rim that show only the background, 0 to 1.

    An object that covers part of the ball, such as a bat or a cable, belongs to the background
    because it was in the picture before the ball. The share is 0 if the ball looks like its
    background, or if no pixel of the rim is in the picture. `p` are the fitted parameters of the
    outline, in the order of `AT`.
    """
    row, col = np.ogrid[: view.pixels.shape[0], : view.pixels.shape[1]]
    u, v = col - p[AT.x], row - p[AT.y]
    ends = [np.hypot(u + side * view.way[0], v + side * view.way[1]) for side in (-0.5, 0.5)]
    # a ring one cell deep that is half a cell inside the outline during the whole exposure
    rim = np.abs(p[AT.radius] - np.maximum(*ends) - RIM_FIT.cell_px) < RIM_FIT.cell_px / 2
    expected = p[AT.level] * view.background[rim]
    sigmas = (view.pixels[rim] - expected) / np.sqrt(noise.variance(expected))
    # There are no pixels, or ball and background look alike.
    if not sigmas.size or abs(sigmas.mean()) < 4 * RIM_FIT.alike_sigmas:
        return 0.0
    return float((np.abs(sigmas) < RIM_FIT.alike_sigmas).mean())


def _assess(
    p: Array, variances: Array, shifts: Array, tally: Array, sway: float, hidden: float
) -> tuple[list[float], int]:
    """Return the values of `FITTED`, and flags for values that are not reliable.

    Parameters
    ----------
    p, tally
        Parameters of the fit, and sums of the kernel.
    variances, shifts
        Variances of x, y and radius, and the parts of them that the pattern causes, (3,).
    sway
        Shift of the position if the pattern were mistaken for the outline [pixel].
    hidden
        Share of the rim that is as bright as the background.
    """
    radius, (pixels, near, around, visible, full, stray) = p[AT.radius], tally
    misfit = near / max(around - len(AT), 1.0)
    grown = max(misfit, 1.0)  # a misfit is treated as noise
    sigma = np.sqrt(np.maximum(variances - shifts, 0.0) * grown)
    pattern = RIM_FIT.pattern_factor * np.sqrt(np.maximum(shifts, 0.0) * grown)
    if not np.hypot(sigma, pattern).max() * RIM_FIT.least_radius_over_u < radius:
        raise np.linalg.LinAlgError("no outline")
    visible, full = visible / (2 * pi * radius), full / (2 * pi * radius)
    poor = misfit > RIM_FIT.greatest_misfit or stray > RIM_FIT.flagged_share * pixels
    tests = {
        PlaceFlag.SATURATED: full > RIM_FIT.flagged_share,
        PlaceFlag.CLIPPED: 1 - visible > RIM_FIT.flagged_share,
        PlaceFlag.OVERLAP: hidden > RIM_FIT.covered_share,
        PlaceFlag.POOR_FIT: poor,
    }
    swayed = np.hypot(pattern[:2], RIM_FIT.sway_share * sway)
    located = [p[AT.x], p[AT.y], radius, sigma[0], sigma[1], misfit, np.hypot(*swayed) / sqrt(2)]
    return located, sum(flag for flag, raised in tests.items() if raised)
