"""Views of a calibration board through the true lens.

A chessboard is the product of two square waves. Each is blurred across its edges in closed form,
with lens and pixel as one Gaussian. Both remain odd functions about a corner, so the corners do not
move. Markers are blurred in the same way, cell by cell. In the first view the board is in the plane
that the calibration uses for the ball.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.board import Board
from virtual_lab.relations.pinhole import DOWN, rotation, undistort
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.lens import TrueLens
from virtual_lab.streams import Draws
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardLook:
    """Light, albedos and poses of a board."""

    lit: float = 0.6  # exposure of white paper [share of the full well]
    paper: float = 0.9  # albedo of the paper
    ink: float = 0.06
    beyond: float = 0.02  # albedo behind the board
    lean: float = 0.6  # spread of the angles of the poses [rad]
    nearer: float = 0.35  # spread of the distance toward the camera [m]
    aside: float = 0.25  # spread of the lateral position [m]


LOOK = BoardLook()


def board_views(
    camera: Camera, board: Board, views: int, draws: Draws, name: str
) -> Iterator[tuple[NDArray[Any], Array]]:
    """Yield `views` pairs: a gray picture (row, column), and the true positions of the corners.

    The positions are the corners of the squares of the board, (corner, 3), in the calibrated axes
    [m]. In the first view the board is flat at Z = 0, with its rows along X. In the other views it
    is closer to the camera, tilted and off-center. `name` selects the random numbers.
    """
    spec = camera.spec
    rays = _rays(camera.lens, (spec.sensor.rows, spec.sensor.columns))
    blur = np.sqrt(spec.blur**2 + 1 / 12)
    lean, shift = (
        draws.uniform(f"{name}.lean", (views, 3)),
        draws.uniform(f"{name}.off", (views, 3)),
    )
    middle = np.array([camera.lens.place[0], camera.lens.place[1], 0.0])
    for view in range(views):
        is_tilted = view > 0
        orientation = rotation(is_tilted * LOOK.lean * 2 * lean[view]) @ DOWN
        up = np.array([LOOK.aside, LOOK.aside, LOOK.nearer]) * (shift[view] + [0.0, 0.0, 0.5])
        place = middle + is_tilted * up
        albedo = _albedo(camera.lens, board, orientation, place, rays, float(blur))
        electrons = LOOK.lit * spec.sensor.full_well / LOOK.paper * albedo
        grey = camera.sensor.expose(
            electrons[None], [[0, 0]], draws, f"{name}.view", np.array([view]), spec.clock.exposure
        )
        yield grey[0], board.corners() @ orientation.T + place


def _albedo(
    lens: TrueLens, board: Board, orientation: Array, place: Array, rays: Array, blur: float
) -> Array:
    """Return the mean albedo in each pixel, (row, column)."""
    axes = lens.rotation @ orientation  # axes of the board as columns, in axes of the camera
    origin = lens.to_camera(place)
    distance = (axes[:, 2] @ origin) / (rays @ axes[:, 2])
    on_board = (distance[..., None] * rays - origin) @ axes / board.square
    u = on_board[..., 0] + board.columns / 2  # from the outer corner of the first square [squares]
    v = on_board[..., 1] + board.rows / 2
    wide, high = (blur * np.hypot(*np.gradient(coordinate)) for coordinate in (u, v))
    waves = _wave(u, wide, board.columns) * _wave(v, high, board.rows)
    dark = _inside(u, wide, board.columns, 0) * _inside(v, high, board.rows, 0) * (1 + waves) / 2
    paper = _inside(u, wide, board.columns, 1) * _inside(v, high, board.rows, 1)
    if board.marker:
        dark = dark + _markers(board, u, v, wide, high)
    return np.asarray(
        LOOK.beyond + (LOOK.paper + (LOOK.ink - LOOK.paper) * dark - LOOK.beyond) * paper
    )


def _markers(board: Board, u: Array, v: Array, wide: Array, high: Array) -> Array:
    """Return the share of each pixel that is ink of the markers, at positions u, v [squares]."""
    ids = board.marker_at()
    column = np.clip(np.floor(u).astype(int), 0, board.columns - 1)
    row = np.clip(np.floor(v).astype(int), 0, board.rows - 1)
    inks = _inks(board.dictionary, int(ids.max()) + 1)
    cells = inks.shape[1] - 4  # the border of paper is two cells wide on each side
    size = board.marker / board.square / cells
    across, down = ((place - 0.5) / size + cells / 2 for place in (u - column, v - row))
    first, second = _shares(across, wide / size, cells), _shares(down, high / size, cells)
    ink = np.zeros_like(u)
    marker = ids[row, column]
    for i, share_down in second:
        for j, share_across in first:
            ink += share_down * share_across * inks[marker, i, j]
    return np.where(marker < 0, 0.0, ink)


def _shares(place: Array, width: Array, cells: int) -> list[tuple[NDArray[np.intp], Array]]:
    """Return the three cells nearest to each pixel in a row, and the pixel's share in each."""
    nearest = np.clip(np.floor(place), -1, cells)
    before = 1 - _share(place - nearest, width)
    after = _share(place - nearest - 1, width)
    middle = nearest.astype(np.intp) + 2
    return [(middle - 1, before), (middle, 1 - before - after), (middle + 1, after)]


def _inks(dictionary: str, count: int) -> Array:
    """Return the cells with ink of the first `count` markers, with border, (marker, cell, cell)."""
    from cv2 import aruco

    words = aruco.getPredefinedDictionary(getattr(aruco, f"DICT_{dictionary}"))
    cells = words.markerSize + 2
    markers = [aruco.generateImageMarker(words, marker, cells) < 128 for marker in range(count)]
    return np.pad(np.array(markers, dtype=np.float64), ((0, 0), (2, 2), (2, 2)))


def _wave(place: Array, width: Array, number: int) -> Array:
    """Return a square wave of ±1 with sign changes at 1, 2, …, number - 1, blurred by `width`."""
    nearest = np.clip(np.rint(place), 1, number - 1)
    sign = np.where(nearest % 2 == 0, 1.0, -1.0)
    return np.asarray(sign * (2 * _share(place - nearest, width) - 1))


def _inside(place: Array, width: Array, number: int, border: int) -> Array:
    """Return the share of each pixel between -border and number + border, blurred by `width`."""
    return _share(place + border, width) * _share(number + border - place, width)


def _share(ahead: Array, width: Array) -> Array:
    """Return a step blurred by `width`, at a distance `ahead` of it."""
    from scipy.special import ndtr

    return np.asarray(ndtr(ahead / width))


def _rays(lens: TrueLens, shape: tuple[int, int]) -> Array:
    """Return the direction of each pixel in axes of the camera, (row, column, 3) with z = 1."""
    y, x = np.indices(shape, dtype=np.float64)
    bent = (np.stack([x, y], axis=-1) - lens.centre) / lens.focal
    return np.concatenate([undistort(bent, lens.distortion), np.ones((*shape, 1))], axis=-1)
