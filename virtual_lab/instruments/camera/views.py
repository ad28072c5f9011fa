"""Views of a chessboard through the true lens: what a laboratory calibrates its camera with.

A chessboard is the product of two square waves, each blurred across its own edges in closed form:
lens and pixel as one Gaussian. At a crossing both stay odd, so no corner moves. The first view
lies in the plane that the calibration takes for the ball's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.instruments.camera.camera import Camera
from virtual_lab.instruments.camera.lens import TrueLens
from virtual_lab.relations.pinhole import distorted, rotation
from virtual_lab.streams import Draws

__all__ = ["Board", "board_views"]

Array = NDArray[np.float64]
ROUNDS = 12  # of undoing a distortion, each some ten times closer
LIT = 0.6  # of the full well, on white
PAPER, INK, BEYOND = 0.9, 0.06, 0.02  # albedos; the last of what is behind the board
LEAN, NEAR, ASIDE = 0.6, 0.35, 0.25  # spread of the poses: rad, m toward the camera, m


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A chessboard by its inner corners, with a white border of one square."""

    columns: int = 13
    rows: int = 8
    square: float = 0.04  # [m]

    def corners(self) -> Array:
        """Return the inner corners about the board's middle, row by row, (corner, 3) [m]."""
        x, y = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        flat = np.stack([x - (self.columns - 1) / 2, y - (self.rows - 1) / 2], axis=-1)
        return np.pad(self.square * flat.reshape(-1, 2), ((0, 0), (0, 1)))


def board_views(
    camera: Camera, board: Board, views: int, draws: Draws, name: str
) -> Iterator[tuple[NDArray[Any], Array]]:
    """Yield grey pictures (row, column) of a board, and where its corners truly are.

    The corners are (corner, 3) in the axes that are calibrated [m]. The first view is flat at
    Z = 0, its rows along X; in the others it is held nearer, askew and aside.
    """
    spec = camera.spec
    rays = _rays(camera.lens, (spec.sensor.rows, spec.sensor.columns))
    blur = np.sqrt(spec.blur**2 + 1 / 12)
    lean, off = draws.uniform(f"{name}.lean", (views, 3)), draws.uniform(f"{name}.off", (views, 3))
    middle = np.array([camera.lens.place[0], camera.lens.place[1], 0.0])
    for view in range(views):
        held = view > 0
        turned = rotation(held * LEAN * 2 * lean[view])
        up = np.array([ASIDE, ASIDE, NEAR]) * (off[view] + [0.0, 0.0, 0.5])
        place = middle + held * up
        albedo = _drawn(camera.lens, board, turned, place, rays, float(blur))
        electrons = LIT * spec.sensor.full_well / PAPER * albedo
        grey = camera.sensor.expose(
            electrons[None], [[0, 0]], draws, f"{name}.{view}", 0, spec.clock.exposure
        )
        yield grey[0], board.corners() @ turned.T + place


def _drawn(
    lens: TrueLens, board: Board, turned: Array, place: Array, rays: Array, blur: float
) -> Array:
    """Return the albedo that each pixel sees on average, (row, column)."""
    axes = lens.rotation @ turned  # the board's, in columns, in axes of the camera
    origin = lens.seen(place)
    reach = (axes[:, 2] @ origin) / (rays @ axes[:, 2])
    on_board = (reach[..., None] * rays - origin) @ axes / board.square
    u = on_board[..., 0] + (board.columns - 1) / 2
    v = on_board[..., 1] + (board.rows - 1) / 2
    waves, squares, paper = np.ones((3, *rays.shape[:2]))
    for way, number in ((u, board.columns), (v, board.rows)):
        down, right = np.gradient(way)
        width = blur * np.hypot(down, right)
        waves = waves * _wave(way, width, number)
        squares = squares * _share(way + 1, width) * _share(number - way, width)
        paper = paper * _share(way + 2, width) * _share(number + 1 - way, width)
    dark = squares * (1 - waves) / 2
    return np.asarray(BEYOND + (PAPER + (INK - PAPER) * dark - BEYOND) * paper)


def _wave(place: Array, width: Array, number: int) -> Array:
    """Return a wave of ±1 that changes its sign at 0, 1 … number - 1, blurred by `width`."""
    nearest = np.clip(np.rint(place), 0, number - 1)
    sign = np.where(nearest % 2 == 0, 1.0, -1.0)
    return np.asarray(sign * (2 * _share(place - nearest, width) - 1))


def _share(ahead: Array, width: Array) -> Array:
    """Return how much of a blurred step there is `ahead` of it."""
    from scipy.special import ndtr

    return np.asarray(ndtr(ahead / width))


def _rays(lens: TrueLens, shape: tuple[int, int]) -> Array:
    """Return the way each pixel looks, (row, column, 3) with z = 1, axes of the camera."""
    y, x = np.indices(shape, dtype=np.float64)
    bent = (np.stack([x, y], axis=-1) - lens.centre) / lens.focal
    straight = bent.copy()
    for _ in range(ROUNDS):
        straight += bent - distorted(straight, lens.distortion)
    return np.concatenate([straight, np.ones((*shape, 1))], axis=-1)
