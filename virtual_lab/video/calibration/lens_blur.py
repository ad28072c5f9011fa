"""Blur of a lens [pixel], measured at the edges of a calibration board between its corners."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import ndtr

from virtual_lab.relations.board import Board
from virtual_lab.units import Array
from virtual_lab.video.calibration.board_finding import BoardView


def lens_blur_of(picture: NDArray[Any], view: BoardView, board: Board) -> float:
    """Return the standard deviation of a lens's blur in a picture of a board, 0.1 to 10 pixels.

    The brightness across an edge of a square is modeled by a normal distribution function. The
    variance of this function is the variance of the lens's blur plus the variance of a pixel, 1/12.
    Only the middle half of each edge is used. The fit has one width for all edges, and a dark and a
    bright level for each edge. On a board with markers, the model also includes the marker next to
    the edge.
    """
    edge, off, value, paper = _beside_edges(picture, view, board)
    count = np.maximum(np.bincount(edge), 1)

    def subtract_mean(values: Array) -> Array:
        return np.asarray(values - (np.bincount(edge, values) / count)[edge])

    value = subtract_mean(value)
    # Distance from the edge, positive toward the paper.
    bright = np.sign(np.bincount(edge, off * value))[edge] * off

    def misfit(width: float) -> float:
        share = subtract_mean(ndtr(bright / width) - ndtr((bright - paper) / width))
        slope = np.bincount(edge, share * value) / np.maximum(np.bincount(edge, share**2), 1e-12)
        return float(np.sum((value - slope[edge] * share) ** 2))

    width = minimize_scalar(misfit, bounds=(0.3, 10.0), method="bounded").x
    return float(np.sqrt(max(width**2 - 1 / 12, 0.01)))


def _beside_edges(
    picture: NDArray[Any], view: BoardView, board: Board
) -> tuple[NDArray[np.intp], Array, Array, float]:
    """Return edge number, distance and gray value of pixels near edges, and width of the paper."""
    places = np.full((*board.shape[::-1], 2), np.nan)
    places.reshape(-1, 2)[view.ids] = view.places
    rows, columns = (places[:, :-1], places[:, 1:]), (places[:-1], places[1:])
    ends = [np.vstack([e.reshape(-1, 2) for e in pair]) for pair in zip(rows, columns, strict=True)]
    start, end = (each[np.isfinite(ends[0] + ends[1]).all(axis=1)] for each in ends)
    way, length = end - start, np.hypot(*(end - start).T)
    side = float(np.median(length))
    paper = side * (1 - board.marker / board.square) / 2 if board.marker else np.inf
    reach = min(0.75 * paper, 0.4 * side)
    half = int(length.max() / 4 + reach) + 1
    around = np.mgrid[-half : half + 1, -half : half + 1].reshape(2, 1, -1)
    pixels = np.round((start + end).T[::-1] / 2)[..., None] + around  # row, column
    down, right = pixels - (start + end).T[::-1, :, None] / 2
    along, across = (way / length[:, None]).T[..., None]
    off = along * down - across * right
    near = (np.abs(off) < reach) & (np.abs(along * right + across * down) < length[:, None] / 4)
    size = np.reshape(picture.shape, (2, 1, 1))
    near &= ((pixels >= 0) & (pixels < size)).all(axis=0)
    row, column = pixels[:, near].astype(np.intp)
    return np.nonzero(near)[0], off[near], picture[row, column].astype(float), paper
