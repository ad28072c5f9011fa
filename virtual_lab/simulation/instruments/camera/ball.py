"""Images of stitched balls that fly and spin: the exact expectation, before any noise.

An opaque ball hides what is behind it, so a region is mu = b (1 - cover) + radiance, with the
share `cover` of each pixel's light that the ball keeps off, and the light it sends instead.
Both are the sphere's disc, summed over nodes of a quadrature that is as dense as the blur
demands: the lens's blur (a Gaussian), the pixel's square and the motion are all exact. The
sphere is shaded as if seen along parallel rays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import ceil, log, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.relations.pinhole import rotation
from virtual_lab.simulation.instruments.camera.spec import BallLook
from virtual_lab.units import Array

Pixels = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """How densely a ball is summed."""

    spacing: float = 1.1  # of the nodes, in standard deviations of the blur
    detail: float = 30.0  # nodes a radius that seams need, however small the ball
    step: float = 1.12  # from one set of nodes to the next finer one
    turn: float = 0.5  # pixels the surface may turn in one step of the exposure
    least_blur: float = 0.5  # pixels
    most_blur: float = 3.0
    most_spread: float = 0.49  # pixels: what fits the eight grid points a node is spread over


SAMPLING = Sampling()


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """Light on the ball: a share from everywhere, the rest from one side.

    `toward` points from the ball to the lamp, in axes of the camera: (0, 0, -1) is light from
    the camera. `softness` 0 is a lamp far away, 1 one as large as half the sky.
    """

    ambient: float = 1.0
    toward: tuple[float, float, float] = (0.0, 0.0, -1.0)
    softness: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderedBalls:
    """Balls as their light reaches the pixels, each (region, row, column)."""

    cover: Pixels  # share of the background's light that a ball keeps off
    radiance: Pixels  # of the ball; a white surface that squarely faces the lamp has 1

    def over(self, background: ArrayLike, white: ArrayLike) -> Pixels:
        """Return the photoelectrons of each pixel.

        `background` is what they had without a ball, (region, row, column) or less [e], `white`
        what a white surface would give, () or (region,) [e].
        """
        hidden = np.asarray(background, np.float32) * (1 - self.cover)
        return hidden + np.asarray(white, np.float32).reshape(-1, 1, 1) * self.radiance


def render_balls(
    path: ArrayLike,
    radius: ArrayLike,
    corners: ArrayLike,
    shape: tuple[int, int],
    *,
    sigma: float,
    look: BallLook,
    light: Light | None = None,
    orientation: ArrayLike | None = None,
    turn: ArrayLike | None = None,
    times: ArrayLike | None = None,
    warp: ArrayLike | None = None,
    view: ArrayLike | None = None,
) -> RenderedBalls:
    """Return the balls of many regions of one shape.

    Parameters
    ----------
    path
        Centres of the ball in the frame, (region, point, 2) [px]: one point (at rest), two (from
        the start of the exposure to its end), or more, a straight leg between each and the next.
    radius
        () or (region,) [px].
    corners
        Each region's first pixel (x, y) in the frame, (region, 2), whole numbers.
    shape
        Rows and columns of every region.
    sigma
        Standard deviation of the lens's blur, 0.5 to 3 [px].
    orientation
        The ball's axes in its rows, in axes of the camera, at mid-exposure, (region, 3, 3) or less.
    turn
        Rotation vector of the ball over the exposure, (region, 3) or (3,) [rad].
    times
        When the ball is at each point, from 0 to 1, (region, point); evenly where None.
    warp
        Outlines that are no circles: coefficients of x, y, x², xy and y² that carry the unit
        disc into pixels about the centre, (region, 2, 5), in place of `radius`.
    view
        Rotation of the direction to the camera, (0, 0, -1), to what it really is, (region, 3, 3).

    Raises
    ------
    ValueError
        Where `sigma` is out of range.
    """
    from virtual_lab.simulation.instruments.camera.ball_kernel import (
        LANES,
        KernelLook,
        ShownBall,
        render,
    )

    if not SAMPLING.least_blur <= sigma <= SAMPLING.most_blur:
        raise ValueError(
            f"blur from {SAMPLING.least_blur} to {SAMPLING.most_blur} px, not {sigma:g}"
        )
    corner = np.asarray(corners, dtype=np.float64)
    regions = len(corner)
    course = np.asarray(path, dtype=np.float64) - corner[:, None]
    if course.shape[1] == 1:
        course = np.repeat(course, 2, axis=1)
    points = course.shape[1]
    when = np.broadcast_to(np.linspace(0, 1, points) if times is None else times, (regions, points))
    size = np.broadcast_to(np.asarray(radius, dtype=np.float64), regions)
    outline = _circles(size) if warp is None else np.asarray(warp, dtype=np.float64)
    axes = np.broadcast_to(np.eye(3) if orientation is None else orientation, (regions, 3, 3))
    turns = np.broadcast_to(np.zeros(3) if turn is None else turn, (regions, 3))
    lamp = light or Light()
    toward = np.broadcast_to(lamp.toward, (regions, 3))
    if view is not None:
        # shading and seams are those of the side that the camera sees
        seen = np.asarray(view, dtype=np.float64)
        turns, toward = (np.einsum("rji,rj->ri", seen, vector) for vector in (turns, toward))
        axes = axes @ seen
    shades = np.column_stack([toward, np.full((regions, 2), [lamp.ambient, lamp.softness])])
    neck = look.neck**2 / sqrt(1 - look.neck**2)
    features = np.array([look.albedo, look.seam_contrast, look.seam_width, neck])
    surface = np.linalg.norm(turns, axis=1) * size * (look.seam_contrast > 0)
    spans = np.maximum(np.ceil(surface / SAMPLING.turn), 1).astype(np.int64)
    out = np.zeros((regions, 2, *shape), np.float32)
    spread = min(sigma / sqrt(2), SAMPLING.most_spread)
    fine = max(
        float(size.max()) / (SAMPLING.spacing * sigma),
        SAMPLING.detail if look.seam_contrast else 1.0,
    )
    warp, path, times, body, turned, lit = (
        np.require(part, np.float64, ["C", "W"])  # one type: the kernel is compiled once
        for part in (outline, course, when, axes, turns, shades)
    )
    render(
        ShownBall(warp, path, times, body, turned, lit, spans),
        KernelLook(
            nodes=_nodes(ceil(log(fine) / log(SAMPLING.step))),
            surface=features,
            table=_table(spread),
            blur=sqrt(sigma**2 - spread**2),
            gauss=_gauss(float(np.linalg.norm(np.diff(course, axis=1), axis=2).max()), sigma),
            size=4 * (ceil(float(np.abs(outline).sum(axis=2).max())) + LANES // 4),
        ),
        out,
    )
    return RenderedBalls(cover=out[:, 0], radiance=out[:, 1])


def axes_of(turn: ArrayLike) -> Array:
    """Return a ball's axes, (…, 3, 3), after rotation vectors (…, 3) [rad] from the camera's."""
    return np.swapaxes(rotation(turn), -1, -2)


def _circles(radius: Array) -> Array:
    outline = np.zeros((radius.size, 2, 5))
    outline[:, 0, 0] = outline[:, 1, 1] = radius
    return outline


@cache
def _gauss_of(number: int) -> Array:
    points, weights = np.polynomial.legendre.leggauss(number)
    return np.stack([(points + 1) / 2, weights / 2])


def _gauss(blur: float, sigma: float) -> Array:
    """Return nodes and weights of Gauss and Legendre from 0 to 1, enough for a blur [px]."""
    return _gauss_of(ceil(1.2 * blur / sqrt(sigma**2 + 1 / 12)) + 6)


@cache
def _table(sigma: float) -> Pixels:
    """Return a Gaussian of `sigma` [px] at eight points half a pixel apart, flat (phase, point).

    The node lies a phase beyond the fourth point; the last phase only ends the one before.
    """
    from virtual_lab.simulation.instruments.camera.ball_kernel import LANES, NODE_PHASES

    phase = np.arange(NODE_PHASES + 2)[:, None] / NODE_PHASES
    steps = (np.arange(LANES) - LANES // 2 + 1 - phase) / (2 * sigma)
    values = np.exp(-(steps**2) / 2)
    whole: Pixels = (values / values.sum(axis=1, keepdims=True)).astype(np.float32)
    return whole.ravel()


@cache
def _nodes(level: int) -> Array:
    """Return nodes on the unit disc: x, y, the sphere's height there, and their area, (node, 4).

    Rings by Gauss and Legendre in the radius squared, points evenly spaced along each; none is
    further from the next than 1 / SAMPLING.step^level.
    """
    fine = SAMPLING.step**level
    rings = ceil(np.pi / 2 * fine) + 3
    points, weights = np.polynomial.legendre.leggauss(rings)
    squares = (points + 1) / 2
    parts = []
    for ring, (square, weight) in enumerate(zip(squares, weights, strict=True)):
        radius = sqrt(square)
        number = max(ceil(2 * np.pi * radius * fine), 8)
        angle = 2 * np.pi * (np.arange(number) + 0.5 * (ring % 2)) / number
        height = np.full(number, sqrt(1 - square))
        area = np.full(number, weight * np.pi / 2 / number)
        parts.append(np.stack([radius * np.cos(angle), radius * np.sin(angle), height, area], 1))
    nodes = np.concatenate(parts)
    nodes.setflags(write=False)
    return nodes
