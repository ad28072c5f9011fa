"""Images of stitched balls in flight and spin: the exact expected values before noise.

An opaque ball hides the background, so the image of a region is mu = b (1 - cover) + radiance.
`cover` is the share of a pixel's background light that the ball blocks, and `radiance` is the light
of the ball itself. Both are integrals over the disk of the sphere, computed by a quadrature. Its
density depends on the blur. The effects of the lens blur (a Gaussian), the square pixel and the
motion are exact. The shading assumes parallel rays.
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
    """Density of the quadrature over a ball."""

    spacing: float = 1.1  # distance of the nodes [standard deviations of the blur]
    detail: float = 30.0  # smallest number of nodes per radius for a ball with seams
    step: float = 1.12  # ratio of density from one set of nodes to the next
    turn: float = 0.5  # largest motion of the surface by spin per step of the exposure [px]
    least_blur: float = 0.5  # [px]
    most_blur: float = 3.0
    most_spread: float = 0.49  # widest Gaussian that fits the eight grid points of a node [px]


SAMPLING = Sampling()


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """Light on the ball: the share `ambient` comes from all directions, the rest from one lamp.

    `toward` points from the ball to the lamp in axes of the camera; (0, 0, -1) is light from the
    camera. `softness` is 0 for a distant lamp and 1 for one as large as half the sky.
    """

    ambient: float = 1.0
    toward: tuple[float, float, float] = (0.0, 0.0, -1.0)
    softness: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderedBalls:
    """Images of balls, each (region, row, column)."""

    cover: Pixels  # share of the background light that the ball blocks
    radiance: Pixels  # light of the ball, 1 for a white surface that faces the lamp

    def over(self, background: ArrayLike, white: ArrayLike) -> Pixels:
        """Return the photoelectrons of each pixel.

        `background` is the number of electrons without a ball, broadcast to (region, row, column)
        [e]. `white` is the number for a white surface that faces the lamp, () or (region,) [e].
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
    """Return images of the ball in many regions of a frame, before noise.

    The result has two images, (region, row, column). The image `cover` is the share of the
    background light that the ball blocks, 0 to 1. The image `radiance` is the light that the ball
    reflects, 1 for a white surface that faces the lamp.

    Parameters
    ----------
    path
        Centers of the ball in the frame, (region, point, 2) [px]: one point for a ball at rest, two
        from the start to the end of the exposure, or more for a path of straight segments.
    radius
        Radius of the ball, () or (region,) [px].
    corners
        First pixel (x, y) of each region in the frame, (region, 2), whole numbers.
    shape
        Rows and columns of each region.
    sigma
        Standard deviation of the blur of the lens, 0.5 to 3 [px].
    look
        Albedo of the ball, and contrast and shape of its seam.
    light
        Light on the ball; ambient light by default.
    orientation
        Axes of the ball in the middle of the exposure, one per row, in the axes of the camera,
        (region, 3, 3) or (3, 3). By default they are the axes of the camera.
    turn
        Rotation vector of the ball over the exposure, (region, 3) or (3,) [rad]. By default the
        ball does not spin.
    times
        Time of each point of the path, increasing from 0 to 1, (region, point). By default the
        steps are equal.
    warp
        Coefficients of x, y, x², xy and y² that map the unit disk to pixels about the center,
        (region, 2, 5), for outlines that are not circles. `radius` then only sets the density of
        sampling.
    view
        Rotation matrices, (region, 3, 3), for a ball off the optical axis. A matrix turns the
        vector (0, 0, -1) into the direction from the ball to the camera. By default the ball is on
        the optical axis.

    Raises
    ------
    ValueError
        `sigma` is out of range.
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
        # rotation that shows shading and seams of the side that faces the camera
        rotation = np.asarray(view, dtype=np.float64)
        turns, toward = (np.einsum("rji,rj->ri", rotation, vector) for vector in (turns, toward))
        axes = axes @ rotation
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
    # arrays of one type, so that the kernel is compiled only once
    warp, path, times, body, turned, lit = (
        np.require(part, np.float64, ["C", "W"])
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
    """Return the directions of the three axes of each rotated ball, (…, axis of the ball, 3).

    The last index of the result counts the components of a unit vector along the axes of the
    camera. A ball has the rotation vector `turn`, (…, 3) [rad]. Its axes agree with the axes of the
    camera if `turn` is 0.
    """
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
    """Return Gauss-Legendre nodes and weights from 0 to 1 for a motion blur [px], (2, node)."""
    return _gauss_of(ceil(1.2 * blur / sqrt(sigma**2 + 1 / 12)) + 6)


@cache
def _table(sigma: float) -> Pixels:
    """Return a Gaussian of `sigma` [px] at eight half-pixel steps, flat (phase, point).

    The node is a fraction of a step (its phase) beyond the fourth point.
    """
    from virtual_lab.simulation.instruments.camera.ball_kernel import LANES, NODE_PHASES

    phase = np.arange(NODE_PHASES + 2)[:, None] / NODE_PHASES
    steps = (np.arange(LANES) - LANES // 2 + 1 - phase) / (2 * sigma)
    values = np.exp(-(steps**2) / 2)
    table: Pixels = (values / values.sum(axis=1, keepdims=True)).astype(np.float32)
    return table.ravel()


@cache
def _nodes(level: int) -> Array:
    """Return nodes on the unit disk, (node, 4): x, y, height of the sphere, and area.

    The rings are Gauss-Legendre points in the squared radius, with equal spacing along each ring.
    Neighboring nodes are at most 1 / SAMPLING.step^level apart.
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
