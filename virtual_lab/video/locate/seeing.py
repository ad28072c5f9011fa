"""What a clip tells of its own camera: the noise of its pixels, and how sharp its lens draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.reading import grey_of
from virtual_lab.video.locate.edge_fit import EdgeFit, fit_edge
from virtual_lab.video.locate.located import Located, part_of
from virtual_lab.video.locate.noise import Noise
from virtual_lab.video.locate.regions import Regions

__all__ = ["lens_of", "noise_of_ball", "noise_of_clip"]

Array = NDArray[np.float64]

PIXELS = 5e5  # of the frames sampled: enough for their noise
CORE = 0.6  # of the radius: well inside the ball
ROUND = 1e-3  # of an outline near the middle: its oval
TRIED = 8  # regions on which the lens is found
LENSES = (0.45, 0.6, 0.8, 1.1, 1.5, 2.2, 3.2)  # pixels
CLOSE = (0.84, 0.92, 1.0, 1.08, 1.16)  # times the best of them, then
WORST = 50.0  # of a score


def noise_of_clip(clip: Clip) -> Noise:
    """Return the noise in time of a clip's pixels, from the frames sampled for its background."""
    samples = clip.samples
    every = max(1, int(np.sqrt(samples.size / PIXELS)))
    samples = samples[:, ::every, ::every]
    if len(samples) < 2:
        return Noise(gain=0.0, read=1.0, full_scale=clip.full_scale)
    grey = np.stack([grey_of(each, str(clip.source.path)) for each in samples])
    return Noise.measured(grey, full_scale=clip.full_scale)


def noise_of_ball(noise: Noise, seen: Regions, start: Located) -> Noise:
    """Return a noise that explains the evenest parts of balls too.

    A ball that is lighter than its background shows how unlike the pixels are; a darker one, the
    noise in the dark, of which a bright background tells nothing.
    """
    count, rows, columns = seen.pixels.shape
    x, y = start.x - seen.corners[:, 0], start.y - seen.corners[:, 1]
    row, column = np.mgrid[:rows, :columns]
    found = []
    for k in range(count):
        image = seen.pixels[k].astype(float)
        inside = np.hypot(column - x[k], row - y[k]) < CORE * start.radius[k]
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

    Balls near the frame's `middle` tell it: there outlines are circles.
    """
    near = np.argsort(np.hypot(start.x - middle[0], start.y - middle[1]), kind="stable")
    tried = np.sort(near[:TRIED])
    some = part_of(start, tried)
    pixels, corners, behind = seen.pixels[tried], seen.corners[tried], seen.background[tried]

    def least(lenses: Array) -> float:
        found = [
            fit_edge(
                pixels,
                corners,
                some,
                noise=noise,
                lens=lens,
                background=behind.astype(float),
                oval_u=ROUND,
            )
            for lens in lenses.tolist()
        ]
        return _least(np.log(lenses), np.array([_score(each) for each in found]))

    return least(least(np.array(LENSES)) * np.array(CLOSE))


def _score(found: EdgeFit) -> float:
    """Return how badly a lens does: a wrong one misfits, or is mended by much of a pattern."""
    located = found.located
    u = located.x_u**2 + located.y_u**2 + found.x_pattern_u**2 + found.y_pattern_u**2
    each = np.log(located.chi_square * u)
    return float(np.median(np.where(np.isfinite(each), each, WORST)))


def _least(logs: Array, scores: Array) -> float:
    """Return the lens of the least score, between those tried."""
    best = int(np.clip(np.argmin(scores), 1, len(logs) - 2))
    a, b, _ = np.polyfit(logs[best - 1 : best + 2] - logs[best], scores[best - 1 : best + 2], 2)
    off = -b / (2 * a) if a > 0 else 0.0
    low, high = logs[best - 1] - logs[best], logs[best + 1] - logs[best]
    return float(np.exp(logs[best] + np.clip(off, low, high)))
