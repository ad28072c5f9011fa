"""The ball's place with OpenCV alone: its edge on rays, and as a whole where it has no pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.locate.located import Flag, Located
from virtual_lab.video.locate.rays import EDGE_WIDTHS, Circle, Image, View, fit_circle
from virtual_lab.video.locate.regions import Regions

__all__ = ["quick"]

Array = NDArray[np.float64]

TRIED = 5  # regions on which the width of the edge is found
PLAIN = 0.03  # of the contrast: a ball whose brightness scatters less has no pattern
GENEROUS = 1.2  # a shift's own harmonic is a little stronger than the next ones
LEAST_NOISE = 12**-0.5  # DN, of whole grey values
FLICKER = 1.4  # the most that the light is believed to change from frame to frame
OFF = 0.03  # of the radius: rays farther off than this show no round edge
LEVER = 10.0  # u of one ray over that of the circle, about
DARK = 0.6  # share of rays that show no edge: too little of the rim is lit
STRAY = 0.15  # share of rays that show another edge: something touches the ball
CUT = 0.02  # share of rays beyond the frame
FULL = 0.02  # share of the ball's pixels at full scale


def quick(clip: Clip, seen: Regions, start: Located) -> Located:
    """Return the ball's places by OpenCV's means alone; a `Locator`.

    A ball without pattern is aligned as a whole, by maximum correlation of its matte with one
    rendered anew (ECC); any other by its edge on rays.
    """
    count = len(seen.pixels)
    x, y = start.x - seen.corners[:, 0], start.y - seen.corners[:, 1]
    views = [
        _view(seen, k, x[k], y[k], start.radius[k], (start.blur_x[k], start.blur_y[k]))
        for k in range(count)
    ]
    width = _edge_width(views, x, y, start.radius)
    found = np.full((count, 6), np.nan)
    flags = np.zeros(count, np.uint16)
    for k, view in enumerate(views):
        circle = fit_circle(view, x[k], y[k], start.radius[k], width)
        if circle is None:
            flags[k] = Flag.NOT_FOUND
            continue
        flags[k] = _flags(circle, view, clip.full_scale)
        place = _aligned(view, circle, width) if not flags[k] else None
        row = place or (circle.x, circle.y, circle.radius, circle.u, circle.pattern)
        found[k] = (*row, circle.chi_square)
    return Located(
        x=found[:, 0] + seen.corners[:, 0],
        y=found[:, 1] + seen.corners[:, 1],
        radius=found[:, 2],
        x_u=found[:, 3],
        y_u=found[:, 3],
        blur_x=start.blur_x,
        blur_y=start.blur_y,
        chi_square=found[:, 5],
        flags=flags,
        pattern_u=_shared(found[:, 4], flags),
    )


def _view(
    seen: Regions, k: int, x: float, y: float, radius: float, blur: tuple[float, float]
) -> View:
    """Return a region with its background made as bright as in its frame, and its noise."""
    image = seen.pixels[k].astype(np.float32)
    behind = seen.background[k]
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    outside = np.hypot(columns - x, rows - y) > radius + np.hypot(*blur) / 2 + 5
    noise = LEAST_NOISE
    if outside.sum() > 30:
        bright = float(np.median(image[outside])) / max(float(np.median(behind[outside])), 1.0)
        if 1 / FLICKER < bright < FLICKER:
            behind = behind * np.float32(bright)
        off = float(np.median(np.abs(image[outside] - behind[outside])))
        noise = max(1.4826 * off, LEAST_NOISE)
    return View(image, behind, noise, blur)


def _edge_width(views: list[View], x: Array, y: Array, radius: Array) -> float:
    """Return the width of the edge that fits some of the regions best [pixels]."""
    tried = np.unique(np.linspace(0, len(views) - 1, min(len(views), TRIED)).astype(int))

    def misfit(width: float) -> float:
        circles = [fit_circle(views[k], x[k], y[k], radius[k], width, turns=2) for k in tried]
        return float(np.median([each.misfit if each else np.inf for each in circles]))

    return min(EDGE_WIDTHS, key=misfit)


def _flags(circle: Circle, view: View, full_scale: float) -> int:
    rows, columns = np.mgrid[: view.image.shape[0], : view.image.shape[1]]
    ball = view.image[np.hypot(columns - circle.x, rows - circle.y) < circle.radius + 1]
    tests = {
        Flag.SATURATED: float(np.mean(ball >= full_scale)) > FULL,
        Flag.CLIPPED: circle.cut > CUT,
        Flag.OVERLAP: circle.stray > STRAY,
        Flag.POOR_FIT: circle.off > max(OFF * circle.radius, 3 * circle.u * LEVER)
        or circle.dark > DARK,
    }
    return int(sum(flag for flag, raised in tests.items() if raised))


def _aligned(
    view: View, circle: Circle, width: float
) -> tuple[float, float, float, float, float] | None:
    """Return place, radius, u and pattern of a plain ball aligned as a whole; None: it is none."""
    import cv2

    rows, columns = np.mgrid[: view.image.shape[0], : view.image.shape[1]]
    long = float(np.hypot(*view.blur))
    away = np.hypot(columns - circle.x, rows - circle.y)
    core = view.image[away < circle.radius - 3 * width - long / 2]
    if core.size < 20:
        return None
    light = float(np.median(core))
    scatter = 1.4826 * float(np.median(np.abs(core - light)))
    shading = float(core.max() - core.min())
    if max(scatter, shading / 6) > max(3 * view.noise, PLAIN * circle.contrast):
        return None
    step = light - view.behind
    if np.abs(step).min() < circle.contrast / 3:
        return None
    share = ((view.image - view.behind) / step).astype(np.float32)
    model = _matte(share.shape, circle, view.blur, width)
    near = (away < circle.radius + long / 2 + 4 * width + 2).astype(np.uint8) * 255
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-6)
    moved = np.eye(2, 3, dtype=np.float32)
    try:
        _, moved = cv2.findTransformECC(  # type: ignore[assignment]
            model, share, moved, cv2.MOTION_TRANSLATION, stop, near, 1
        )
    except cv2.error:
        return None
    x, y = circle.x + float(moved[0, 2]), circle.y + float(moved[1, 2])
    if np.hypot(x - circle.x, y - circle.y) > 0.5 + 5 * circle.u:
        return None
    radius = float(np.sqrt(share[near > 0].sum() / np.pi))
    slopes = np.gradient(model.astype(float))
    noise = np.hypot(view.noise, scatter) / np.sqrt(2) / float(np.median(np.abs(step)))
    u = noise / np.sqrt(min(float((slope**2).sum()) for slope in slopes))
    return x, y, radius, u, circle.pattern


def _matte(
    shape: tuple[int, int], circle: Circle, blur: tuple[float, float], width: float
) -> Image:
    """Return each pixel's share of the ball."""
    long = float(np.hypot(*blur))
    nodes, weights = np.polynomial.legendre.leggauss(int(np.ceil(0.9 * long / width)) + 4)
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    share = np.zeros(shape)
    for node, weight in zip(nodes / 2, weights / 2, strict=True):
        x, y = circle.x + node * blur[0], circle.y + node * blur[1]
        inside = circle.radius - np.hypot(columns - x, rows - y)
        share += weight * ndtr(inside / width - width / (2 * circle.radius))
    return share.astype(np.float32)


def _shared(pattern: Array, flags: NDArray[np.uint16]) -> Array:
    """Return one standard uncertainty for all: few harmonics say little of one frame."""
    good = np.isfinite(pattern) & (flags == 0)
    power = float(np.mean(pattern[good])) if good.any() else np.nan
    return np.where(np.isfinite(pattern), GENEROUS * np.sqrt(max(power, 0.0)), np.nan)
