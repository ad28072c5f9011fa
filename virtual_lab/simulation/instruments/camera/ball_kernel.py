"""Compiled rendering of a shaded sphere: its light is spread over a grid, then summed into pixels.

The image of a node of the disk is a Gaussian. Part of its variance is applied when the nodes are
spread over a grid of half pixels. The rest, with the square pixel and the motion, is applied when
the grid points are summed into pixels.
"""

from __future__ import annotations

from math import ceil, cos, erf, floor, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import config, njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from virtual_lab.units import INNER, Array

Pixels = NDArray[np.float32]
FAST: dict[str, Any] = {"fastmath": True, "error_model": "numpy"}
NODE_PHASES = 256  # number of tabulated positions of a node between two grid points
REACH = 4.2  # half width of the blur [standard deviations]


class Seam(NamedTuple):
    """Shape of a seam, with lengths relative to its half width."""

    groove: float = 0.3
    row: float = 0.45  # half width of a row of stitches
    away: float = 0.55  # distance of a row from the groove
    slant: float = 4.0
    stitches: float = 54.0  # number of pairs of stitches in half a turn of the seam
    evening: float = 1.1  # factor that spaces the stitches evenly


SEAM = Seam()


class KernelLook(NamedTuple):
    """Properties common to all balls of a batch."""

    nodes: Array  # (node, 4): x, y, z on the unit sphere, share of the disk
    surface: Array  # (4,): albedo; contrast, width and neck of the seam
    table: Pixels  # flat: Gaussian at eight grid points for each phase of a node
    blur: float  # blur of the lens that `table` does not include [px]
    gauss: Array  # (2, point): nodes and weights along a segment of the path
    size: int  # number of columns of the grid


class ShownBall(NamedTuple):
    """Properties of one ball. The arrays of a batch have a leading axis of regions."""

    warp: Array  # (2, 5), map from the unit disk to the picture [px]
    path: Array  # (point, 2), from the first pixel of the region [px]
    times: Array  # (point,), from 0 to 1
    body: Array  # (3, 3), axes of the ball as rows
    turn: Array  # (3,), rotation vector over the exposure [rad]
    light: Array  # (5,): direction to the lamp, ambient, softness
    spans: NDArray[np.int64]  # number of steps in which a spinning ball is rendered


@njit(**INNER, **FAST)
def _bump(u: float) -> float:
    return float((1 - u * u) ** 2) if abs(u) < 1 else 0.0


@njit(**FAST)
def _albedo(x: float, y: float, z: float, look: Array) -> float:
    """Return the albedo at a unit vector (x, y, z) in axes of the ball.

    The seam is the curve x^2 - y^2 + neck z = 0. The distance to it [radii] is computed to first
    order.
    """
    white, contrast, width, neck = look[0], look[1], look[2], look[3]
    square = x * x - y * y
    f = square + neck * z
    along = 2 * square + neck * z
    slope = 4 * (x * x + y * y) + neck * neck - along * along
    if f * f >= width * width * slope:
        return float(white)
    far = abs(f) / sqrt(slope) / width
    dark = 0.8 * _bump(far / SEAM.groove)
    thread = _bump((far - SEAM.away) / SEAM.row)
    if thread > 0:
        turn = SEAM.stitches * np.arctan2(SEAM.evening * z, 2 * x * y) + SEAM.slant * far
        dark += thread * (0.6 + 0.4 * cos(turn))
    return float(white * (1 - contrast * dark))


@njit(**INNER, **FAST)
def _spread(warp: Array, body: Array, light: Array, look: KernelLook, grid: Pixels) -> None:
    """Fill `grid` with rows of the disk and rows of its radiance, in alternation."""
    nodes, surface, table, size = look.nodes, look.surface, look.table, look.size
    for k in range(grid.size):
        grid[k] = 0
    across, down = np.empty(LANES, np.float32), np.empty(LANES, np.float32)
    middle = size // 2 - LANES // 2 + 1
    plain = surface[1] == 0
    ambient, soft = light[3], light[4]
    for n in range(len(nodes)):
        x, y, z, share = nodes[n, 0], nodes[n, 1], nodes[n, 2], nodes[n, 3]
        px = warp[0, 0] * x + warp[0, 1] * y + warp[0, 2] * x * x + warp[0, 3] * x * y
        px += warp[0, 4] * y * y
        py = warp[1, 0] * x + warp[1, 1] * y + warp[1, 2] * x * x + warp[1, 3] * x * y
        py += warp[1, 4] * y * y
        area = (warp[0, 0] + 2 * warp[0, 2] * x + warp[0, 3] * y) * (
            warp[1, 1] + warp[1, 3] * x + 2 * warp[1, 4] * y
        )
        area -= (warp[0, 1] + warp[0, 3] * x + 2 * warp[0, 4] * y) * (
            warp[1, 0] + 2 * warp[1, 2] * x + warp[1, 3] * y
        )
        facing = light[0] * x + light[1] * y - light[2] * z
        shine = ambient + (1 - ambient) * max(facing + soft, 0.0) / (1 + soft)
        if plain:
            shine *= surface[0]
        else:
            shine *= _albedo(
                body[0, 0] * x + body[0, 1] * y - body[0, 2] * z,
                body[1, 0] * x + body[1, 1] * y - body[1, 2] * z,
                body[2, 0] * x + body[2, 1] * y - body[2, 2] * z,
                surface,
            )
        px, py = 2 * px + middle, 2 * py + middle
        column, row = int(px), int(py)
        _phase(px - column, table, across)
        _phase(py - row, table, down)
        weight = np.float32(4 * abs(area) * share)  # one pixel has four grid cells
        bright = np.float32(shine)
        at = 2 * row * size + column
        for k in range(LANES):
            part = weight * down[k]
            add_row(grid, at, across, 0, part)
            add_row(grid, at + size, across, 0, part * bright)
            at += 2 * size


@njit(**INNER, **FAST)
def _phase(part: float, table: Pixels, out: Pixels) -> None:
    """Set `out` to the Gaussian of a node at a fraction `part` of the grid spacing."""
    entry = NODE_PHASES * part
    number = int(entry)
    rest = np.float32(entry - number)
    for k in range(LANES):
        out[k] = 0
    add_row(out, 0, table, LANES * number, np.float32(1) - rest)
    add_row(out, 0, table, LANES * (number + 1), rest)


@njit(**INNER, **FAST)
def _weights(
    path: Array,
    times: Array,
    start: float,
    end: float,
    look: KernelLook,
    first: NDArray[np.int64],
    out: Array,
) -> None:
    """Fill `out` with the weights of square pixel, remaining blur and motion from start to end.

    Element (k, l) is the weight of a grid point for a pixel at a distance (first + (k, l)) / 2.
    """
    gauss, s = look.gauss, look.blur
    for k in range(len(out)):
        for j in range(out.shape[1]):
            out[k, j] = 0
    half_width = 0.5 + REACH * s
    steps = ceil(4 * half_width) + 1
    hx, hy = np.empty(steps), np.empty(steps)
    step = 0.5 / (s * sqrt(2.0))
    for leg in range(len(times) - 1):
        low, high = max(start, times[leg]), min(end, times[leg + 1])
        if high <= low:
            continue
        for g in range(gauss.shape[1]):
            t = (low + (high - low) * gauss[0, g] - times[leg]) / (times[leg + 1] - times[leg])
            weight = (high - low) * gauss[1, g] / 16
            x = 2 * (path[leg, 0] + t * (path[leg + 1, 0] - path[leg, 0])) - first[0]
            y = 2 * (path[leg, 1] + t * (path[leg + 1, 1] - path[leg, 1])) - first[1]
            column, row = ceil(x - 2 * half_width), ceil(y - 2 * half_width)
            for k in range(steps):
                hx[k] = erf((column + k - x + 1) * step) - erf((column + k - x - 1) * step)
                hy[k] = erf((row + k - y + 1) * step) - erf((row + k - y - 1) * step)
            for k in range(steps):
                for j in range(steps):
                    out[row + k, column + j] += weight * hy[k] * hx[j]


@njit(**INNER, **FAST)
def _gather(
    grid: Pixels, planes: Pixels, weights: Array, first: NDArray[np.int64], out: Pixels
) -> None:
    """Add the weighted grid points to the pixels `out` (channel, row, column).

    `planes` (row, channel, parity, column) separates even and odd columns of the grid, so that the
    points of neighboring pixels are adjacent in memory.
    """
    size, _, _, columns = planes.shape
    for row in range(size):
        for channel in range(2):
            at = (2 * row + channel) * size
            for column in range(columns):
                planes[row, channel, 0, column] = grid[at + 2 * column]
                planes[row, channel, 1, column] = grid[at + 2 * column + 1]
    for i in range(out.shape[1]):
        for ky in range(len(weights)):
            row = 2 * i + size // 2 - ky - first[1]
            if row < 0 or row >= size:
                continue
            for kx in range(weights.shape[1]):
                weight = np.float32(weights[ky, kx])
                if weight < 1e-7:
                    continue
                shift = size // 2 - kx - first[0]
                parity = shift & 1
                shift = (shift - parity) // 2
                low, high = max(0, -shift), min(out.shape[2], columns - shift)
                if high <= low:
                    continue
                for channel in range(2):
                    line = out[channel, i, low:high]
                    source = planes[row, channel, parity, low + shift : high + shift]
                    for j in range(high - low):
                        line[j] += weight * source[j]


@njit(**INNER, **FAST)
def _rotate(turn: Array, share: float, body: Array, out: Array) -> None:
    """Set `out` to `body` (axes of the ball as rows), rotated by a share of a rotation vector."""
    angle = share * sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    a = share * (sin(angle) / angle if angle != 0 else 1.0)
    b = share * share * ((1 - cos(angle)) / (angle * angle) if angle != 0 else 0.5)
    for k in range(3):
        along = turn[0] * body[k, 0] + turn[1] * body[k, 1] + turn[2] * body[k, 2]
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            cross = turn[j] * body[k, m] - turn[m] * body[k, j]
            out[k, i] = cos(angle) * body[k, i] + a * cross + b * along * turn[i]


@njit(**FAST, cache=True)
def render(balls: ShownBall, look: KernelLook, out: Pixels) -> None:
    """Render the ball in each region, and add it to the values of `out`.

    `out` has the shape (region, channel, row, column). Channel 0 is the share of the background
    that the ball hides. Channel 1 is the light of the ball, 1 for a white surface that faces the
    lamp.
    """
    size = look.size
    grid = np.empty(2 * size * size, np.float32)
    planes = np.empty((size, 2, 2, size // 2), np.float32)
    half_width = 0.5 + REACH * look.blur
    orientation = np.empty((3, 3))
    first, last = np.empty(2, np.int64), np.empty(2, np.int64)
    for r in range(len(balls.warp)):
        path, spans = balls.path[r], balls.spans[r]
        for axis in range(2):
            low = high = path[0, axis]
            for point in range(1, len(path)):
                low, high = min(low, path[point, axis]), max(high, path[point, axis])
            first[axis] = floor(2 * (low - half_width)) - 1
            last[axis] = ceil(2 * (high + half_width)) + 3
        weights = np.empty((last[1] - first[1], last[0] - first[0]))
        for span in range(spans):
            start, end = span / spans, (span + 1) / spans
            _rotate(balls.turn[r], (start + end) / 2 - 0.5, balls.body[r], orientation)
            _spread(balls.warp[r], orientation, balls.light[r], look, grid)
            _weights(path, balls.times[r], start, end, look, first, weights)
            _gather(grid, planes, weights, first, out[r])


LANES = 8


def _add_row(context: Any, target: Any, at: Any, source: Any, start: Any, weight: Any) -> Any:
    """Add ``weight * source[start : start + 8]`` to ``target[at : at + 8]``, float32, unchecked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = ir.VectorType(ir.FloatType(), LANES)
        index = ir.IntType(32)

        def pointer(array: int, offset: int) -> Any:
            kind = signature.args[array]
            data = context.make_array(kind)(context, builder, arguments[array]).data
            return builder.bitcast(builder.gep(data, [arguments[offset]]), vector.as_pointer())

        to, of = pointer(0, 1), pointer(2, 3)
        blank = ir.Constant(vector, ir.Undefined)
        one = builder.insert_element(blank, arguments[4], ir.Constant(index, 0))
        mask = ir.Constant(ir.VectorType(index, LANES), [0] * LANES)
        every = builder.shuffle_vector(one, blank, mask)
        product = builder.fmul(every, builder.load(of, align=4), flags=("contract",))
        total = builder.fadd(builder.load(to, align=4), product, flags=("contract",))
        builder.store(total, to, align=4)
        return context.get_dummy_value()

    line = types.Array(types.float32, 1, "C")
    return types.void(line, types.intp, line, types.intp, types.float32), generate


def _add_row_plainly(target: Any, at: int, source: Any, start: int, weight: Any) -> None:
    target[at : at + LANES] += weight * source[start : start + LANES]


compiles = not config.DISABLE_JIT  # type: ignore[attr-defined]
add_row: Any = intrinsic(_add_row) if compiles else _add_row_plainly
