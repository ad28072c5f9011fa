"""The ball's edge on rays from its centre, and the circle through it.

On each ray the edge is a blurred step between the background known there and the brightness found
just inside, so that shading along the rim costs little; the rays' offsets are those of a shifted
circle. What is left of them in the next harmonics, which no shift makes, tells what the ball's own
pattern (seams, dirt) may do to the shift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

__all__ = ["EDGE_WIDTHS", "Circle", "View", "fit_circle"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

EDGE_WIDTHS = (0.76, 1.0, 1.4, 2.0, 2.8, 4.0)  # of lens and pixel, tried on a clip [pixels]
REACH = 3.5  # widths from the edge that a ray covers
INSIDE = 2.0  # pixels of the ball a ray covers beyond that
STEP = 0.7  # pixels along a ray
TURNS = 4  # repetitions of the fit
HARMONICS = (2, 3)  # of the rays' offsets: neither shift nor size
FAINT = 0.15  # of the median contrast: a ray with less shows no edge
INTERPOLATED = 1.3  # noise of neighbouring rays is shared: their u is this much larger
FAR = 0.1  # of the radius: a ray this far off the circle shows another edge
CHI_MEDIAN = 0.455  # of χ² with one degree of freedom


@dataclass(frozen=True, slots=True)
class View:
    """A region as rays see it; pixels count from its own first."""

    image: Image
    behind: Image  # the background, as bright as in this frame
    noise: float  # standard deviation of a pixel [DN]
    blur: tuple[float, float]  # the ball's shift during the exposure


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle fitted to a ball's edge."""

    x: float
    y: float
    radius: float
    u: float  # of x and y, from the pixels' noise
    pattern: float  # variance of x and y the ball's pattern makes likely
    chi_square: float  # of the rays' offsets
    misfit: float  # of the steps along the rays, in noise variances
    off: float  # median distance of a ray's edge from the circle [pixels]
    cut: float  # share of rays that leave the region
    stray: float  # share of the others that show an edge far off
    dark: float  # share of the others that show none
    contrast: float  # of the ball to what is behind it [DN]


def fit_circle(
    view: View, x: float, y: float, radius: float, width: float, turns: int = TURNS
) -> Circle | None:
    """Return the circle whose edge fits, starting near it; None where there is no edge."""
    import cv2

    if not (np.isfinite([x, y, radius]).all() and radius > 2):
        return None
    rows, columns = view.image.shape
    rays = _Rays.about(radius, view.blur, width)
    cos, sin = rays.cos, rays.sin
    for _ in range(turns):
        reach = radius + rays.places
        to_x = (x + reach * cos[:, None]).astype(np.float32)
        to_y = (y + reach * sin[:, None]).astype(np.float32)
        seen = cv2.remap(view.image, to_x, to_y, cv2.INTER_LINEAR)
        back = cv2.remap(view.behind, to_x, to_y, cv2.INTER_LINEAR)
        inside = ((to_x > 0) & (to_x < columns - 1) & (to_y > 0) & (to_y < rows - 1)).all(axis=1)
        rest = seen - back * (1 - rays.share)
        light, moved = np.einsum("kij,knj,kn->ik", rays.inverse, rays.design, rest)
        contrast = light - (back * rays.slope).sum(axis=1) / rays.slope.sum(axis=1)
        usual = float(np.median(np.abs(contrast[inside]))) if inside.any() else 0.0
        good = inside & (np.abs(contrast) > max(FAINT * usual, view.noise))
        if good.mean() < 0.25:
            return None
        contrast = np.where(good, contrast, 1.0)
        offset = np.clip(moved / contrast, -rays.high, rays.high)
        u = view.noise * np.sqrt(rays.inverse[:, 1, 1]) / np.abs(contrast)
        weight = np.where(good, 1 / u, 0.0)
        shift, left, trust = _circle(cos, sin, offset, weight)
        x, y, radius = x + shift[0], y + shift[1], radius + shift[2]
        if not (0 <= x < columns and 0 <= y < rows and 2 < radius < max(rows, columns)):
            return None
    design = np.stack([cos, sin, np.ones_like(cos)], axis=1) * weight[:, None]
    own = INTERPOLATED**2 * np.diagonal(np.linalg.inv(design.T @ design))[:2].mean()
    power = _harmonics(np.where(good, left * np.sqrt(trust), 0.0)) / good.mean()
    strange = rest - light[:, None] * rays.share - moved[:, None] * rays.slope
    far = np.abs(left[good]) > max(1.0, FAR * radius)
    return Circle(
        x=float(x),
        y=float(y),
        radius=float(radius),
        u=float(np.sqrt(own)),
        pattern=float(power - own),
        chi_square=float(np.median((left * weight)[good] ** 2) / CHI_MEDIAN),
        misfit=float(np.median(np.mean(strange[good] ** 2, axis=1)) / view.noise**2),
        off=float(np.median(np.abs(left[good]))),
        cut=float(1 - inside.mean()),
        stray=float(far.mean()),
        dark=float(1 - good.sum() / inside.sum()),
        contrast=usual,
    )


@dataclass(frozen=True, slots=True)
class _Rays:
    """What of the rays does not change as the circle settles; (ray, place along it)."""

    cos: Array
    sin: Array
    places: Array  # from the circle, outward [pixels]
    high: Array  # (ray,) the farthest
    share: Array  # of the ball
    slope: Array
    design: Array
    inverse: Array

    @classmethod
    def about(cls, radius: float, blur: tuple[float, float], width: float) -> _Rays:
        count = int(np.clip(2 * np.pi * radius, 48, 256))
        angle = np.arange(count) * 2 * np.pi / count
        cos, sin = np.cos(angle), np.sin(angle)
        along = np.abs(cos * blur[0] + sin * blur[1]) / 2  # half the way on the ray
        # what moves across the ray takes the edge inward, as the circle curves
        across = cos * blur[1] - sin * blur[0]
        bulge = across**2 / (24 * radius) + width**2 / (2 * radius)
        low, high = -(REACH * width + along + INSIDE), REACH * width + along
        steps = int(np.ceil((high - low).max() / STEP))
        places = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, steps)
        share, slope = _edge(-places - bulge[:, None], along, width)
        design = np.stack([share, slope], axis=-1)
        normal = np.einsum("kni,knj->kij", design, design) + 1e-6 * np.eye(2)
        return cls(cos, sin, places, high, share, slope, design, np.linalg.inv(normal))


def _edge(inside: Array, along: Array, width: float) -> tuple[Array, Array]:
    """Return a blurred edge's share of the ball and its slope, at pixels inside the edge."""
    half = np.maximum(along, 0.05)[:, None]
    ahead, behind = (inside + half) / width, (inside - half) / width
    share = width * (_ramp(ahead) - _ramp(behind)) / (2 * half)
    return share, (ndtr(ahead) - ndtr(behind)) / (2 * half)


def _ramp(z: Array) -> Array:
    """Return the integral of the normal distribution up to z."""
    return np.asarray(z * ndtr(z) + np.exp(-z * z / 2) / np.sqrt(2 * np.pi))


def _circle(cos: Array, sin: Array, offset: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Return a circle's shift and growth, what they leave, and each ray's trust (Huber's)."""
    design = np.stack([cos, sin, np.ones_like(cos)], axis=1)
    trust = np.ones_like(weight)
    for _ in range(6):
        scale = weight * np.sqrt(trust)
        weighted = design * scale[:, None]
        solved = np.linalg.solve(weighted.T @ weighted, weighted.T @ (offset * scale))
        left = offset - design @ solved
        size = np.abs(left * weight)
        spread = 1.4826 * float(np.median(size[weight > 0])) + 1e-9
        trust = 1 / np.maximum(1.0, size / (2 * spread))
    return np.asarray(solved), left, np.asarray(trust)


def _harmonics(left: Array) -> float:
    """Return the variance a shift would have, were its harmonic as strong as the next ones."""
    waves = np.fft.rfft(left)[list(HARMONICS)] * 2 / len(left)
    return float(np.mean(np.abs(waves) ** 2) / 2)
