"""Sharp places of one ball in a clip: its outline fitted, region by region.

Noise and lens are learnt from some of the regions, where the camera is not known.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.locate.edge_fit import RIM_FIT, fit_edge
from virtual_lab.video.locate.located import Located, Regions, part_of
from virtual_lab.video.locate.noise import Noise


@dataclass(frozen=True, slots=True, kw_only=True)
class Learning:
    """How a clip shows its camera, and how often a ball is fitted."""

    noise_sample_px: float = 5e5  # of the frames sampled: enough for their noise
    regions: int = 16  # in which it is looked for what all share
    core_share: float = 0.6  # of the radius: well inside the ball
    lens_regions: int = 6  # in which the lens is found
    round_u: float = 1e-3  # of an outline near the middle: its oval
    # pixels, from which to start: a wrong one may be the best about it
    lenses_px: tuple[float, ...] = (0.45, 0.6, 0.8, 1.1, 1.5, 2.2, 3.2)
    lens_log_step: float = 0.3  # relative, from one to the next
    lens_log_tolerance: float = 0.06  # relative, to which one is found
    worst_score: float = 50.0  # of a lens by which a ball is lost
    lit_share: float = 0.93  # of the ball's radius: less of it is light, the rest in the dark
    light_edge: float = 0.5  # of the light's contrast: its outline
    # from start to end: more, and the fit may have taken outline for pattern
    refit_shift_px: float = 0.3
    rounds: int = 4


LEARN = Learning()


def noise_of_clip(clip: Clip) -> Noise:
    """Return the noise in time of a clip's pixels, from the frames sampled for its background."""
    if len(clip.samples) < 2:
        return Noise(gain=0.0, read=1.0, full_scale=clip.full_scale)
    every = max(1, int(np.sqrt(clip.samples.size / LEARN.noise_sample_px)))
    return Noise.measured(clip.grey_samples(every), clip.full_scale)


def noise_of_ball(noise: Noise, seen: Regions, start: Located) -> Noise:
    """Return a noise that explains the evenest parts of balls too.

    A ball that is lighter than its background shows how unlike the pixels are; a darker one, the
    noise in the dark, of which a bright background shows nothing.
    """
    count, rows, columns = seen.pixels.shape
    x, y = start.x - seen.corners[:, 0], start.y - seen.corners[:, 1]
    row, column = np.mgrid[:rows, :columns]
    found = []
    for k in range(count):
        image = seen.pixels[k].astype(float)
        inside = np.hypot(column - x[k], row - y[k]) < LEARN.core_share * start.radius[k]
        # across two pixels and back: neither shading nor a slope counts
        bent = (image[:, 2:] - 2 * image[:, 1:-1] + image[:, :-2])[inside[:, 1:-1]]
        mean = float(np.median(image[inside])) - noise.black if inside.any() else 0.0
        if bent.size < 50 or not 0 < mean < 0.9 * noise.full_scale:
            continue
        spread = float(np.median(np.abs(bent)) / 0.6745) ** 2 / 6
        rest = max(spread - float(noise.variance(mean + noise.black)), 0.0)
        found.append((rest, mean, float(np.median(seen.background[k])) - noise.black))
    if not found:
        return noise
    rest, mean, behind = np.median(found, axis=0)
    if mean < behind:
        return replace(noise, read=noise.read + rest)
    return replace(noise, prnu=float(np.sqrt(rest)) / mean)


def lens_of(seen: Regions, start: Located, noise: Noise, middle: tuple[float, float]) -> float:
    """Return the standard deviation of the lens's blur [pixel], as the ball's outline shows it.

    Balls near the frame's `middle` show it: there outlines are circles.
    """
    from scipy.optimize import minimize_scalar

    order = np.argsort(np.hypot(start.x - middle[0], start.y - middle[1]), kind="stable")

    def misfit(log: float, tried: NDArray[np.int_]) -> float:
        # a wrong one misfits, or is mended by much of a pattern
        some, begin, lens = part_of(seen, tried), part_of(start, tried), float(np.exp(log))
        found = fit_edge(some, begin, noise=noise, lens=lens, oval_u=LEARN.round_u)
        assert found.pattern_u is not None
        u = found.x_u**2 + found.y_u**2 + 2 * found.pattern_u**2
        each = np.log(found.chi_square * u)
        return float(np.median(np.where(np.isfinite(each), each, LEARN.worst_score)))

    tried = np.sort(order[: LEARN.lens_regions])
    about = min(np.log(LEARN.lenses_px).tolist(), key=lambda log: misfit(log, tried[::3]))
    near = about - LEARN.lens_log_step, about + LEARN.lens_log_step
    best = minimize_scalar(
        misfit, bounds=near, args=(tried,), options={"xatol": LEARN.lens_log_tolerance}
    )
    return float(np.exp(best.x))


@dataclass(slots=True)
class Sharp:
    """The ball's places in regions of one clip, of which the first show noise and lens."""

    ball_radius: float | None = None  # [pixel], where the clip's scale is known
    known: dict[str, Any] = field(default_factory=dict)

    def __call__(self, clip: Clip, seen: Regions, start: Located) -> Located:
        """Return the ball's places in the full frame."""
        if self.ball_radius and float(np.median(start.radius)) < LEARN.lit_share * self.ball_radius:
            whole = np.full(len(start.x), self.ball_radius)
            start = on_the_limb(seen, replace(start, radius=whole))
        middle = ((clip.shape[1] - 1) / 2, (clip.shape[0] - 1) / 2)
        if not self.known:
            last = len(start.x) - 1
            tried = np.unique(np.linspace(0, last, min(last + 1, LEARN.regions)).astype(int))
            first, begin = part_of(seen, tried), part_of(start, tried)
            noise = noise_of_ball(noise_of_clip(clip), first, begin)
            self.known = {"noise": noise, "lens": lens_of(first, begin, noise, middle)}
        return place(seen, start, middle=middle, **self.known)


def place(
    seen: Regions,
    start: Located,
    *,
    noise: Noise,
    lens: float,
    middle: tuple[float, float],
    oval: tuple[float, float] = (0.0, RIM_FIT.oval_u),
) -> Located:
    """Return the ball's places in the full frame; `start` knows them to a pixel or so.

    `lens` is the standard deviation of its blur [pixel], `middle` the pixel that the camera's axis
    meets. `oval` is k, a sphere at d from the middle having the outline
    r = R (1 + k d² cos 2(a - a_d)) [1/px²], and the standard uncertainty of what is beside the 1.
    """
    off = _stretched(_places(start), np.array(middle))
    k, oval_u = oval
    left = np.arange(len(off))
    found = part_of(replace(start, pattern_u=np.full(len(off), np.nan)), left)  # a copy
    for _ in range(LEARN.rounds):
        some, begin = part_of(seen, left), part_of(found, left)
        fitted = fit_edge(some, begin, noise=noise, lens=lens, oval=k * off[left], oval_u=oval_u)
        for each in fields(Located):
            getattr(found, each.name)[left] = getattr(fitted, each.name)
        moved = np.hypot(*(_places(fitted) - _places(begin)).T)
        left = left[np.fmax(moved, np.abs(fitted.radius - begin.radius)) > LEARN.refit_shift_px]
        if not left.size:
            break
    return found


def _stretched(places: Array, middle: Array) -> Array:
    """Return d² (cos 2a, sin 2a) of places (region, 2) at d off the axis, in the direction a."""
    x, y = np.where(np.isfinite(places), places - middle, 0.0).T
    return np.stack([x**2 - y**2, 2 * x * y], axis=1)


def _places(found: Located) -> Array:
    return np.stack([found.x, found.y], axis=1)


def on_the_limb(seen: Regions, start: Located) -> Located:
    """Return places from the lit limb, to a pixel or two; those of the start where there is none.

    A lamp from the side lights a part of a ball alone: limb on one side of the light, on the other
    the line between light and shade. Of all circles of the ball's size, that on which most of the
    light's outline lies is the ball's: one that moves little in an exposure, against its radius,
    which the start knows to 3 %.
    """
    import cv2

    x, y = start.x.copy(), start.y.copy()
    for k, (left, top) in enumerate(seen.corners):
        off = np.abs(seen.pixels[k].astype(np.float32) - seen.background[k])
        smooth = cv2.GaussianBlur(off, (0, 0), 1.0)
        bright = (smooth > LEARN.light_edge * np.percentile(smooth, 90)).astype(np.uint8)
        contours, _ = cv2.findContours(bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        largest = max(contours, key=cv2.contourArea, default=None)
        if largest is None or len(largest) < start.radius[k]:
            continue
        outline = np.zeros(off.shape, np.float32)
        cv2.polylines(outline, [cv2.convexHull(largest)], True, 1.0)
        radius = round(float(start.radius[k]))
        ring = np.zeros([2 * radius + 3] * 2, np.float32)
        cv2.circle(ring, (radius + 1, radius + 1), radius, 1.0)
        votes = cv2.filter2D(outline, -1, ring, borderType=cv2.BORDER_CONSTANT)
        column, row = cv2.minMaxLoc(cv2.GaussianBlur(votes, (0, 0), 1.0))[3]
        x[k], y[k] = left + column, top + row
    return replace(start, x=x, y=y)
