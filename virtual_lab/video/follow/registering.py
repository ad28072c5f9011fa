"""Positions of the ball in a flight, by registration of its pictures.

A wall as bright as one side of a ball hides that part of the outline, so that the hull moves by
pixels as the ball passes lighter and darker parts of the wall. Here each picture is modeled as the
background, hidden by a disk, plus the light of the ball, which is the same in all pictures of a
flight and moves with the ball. A hidden side then has no weight. Light and positions are computed
alternately. The light is the mean of the pictures without their backgrounds, and each position
follows from the light by least squares (Gauss-Newton). All positions of a flight may have the same
error, which changes no speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from virtual_lab.units import Array
from virtual_lab.video.find.blobs import COARSE, Blobs, BlobView
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.pieces import FAR_U, Piece, polynomial
from virtual_lab.video.follow.searching import FlightsFound

Picture = NDArray[np.float32]  # (row, column, channel) [DN]


def register(watched: Watched, result: FlightsFound) -> tuple[Watched, FlightsFound]:
    """Return the blobs and the flights with more accurate positions, by image registration.

    The images of the ball in a flight are shifted until they match each other. The positions of a
    flight stay unchanged if an image of one of its blobs is missing in `watched.views`.
    """
    blobs = watched.blobs.copy()
    for way in result.ways:
        views = [watched.views[k] for k in way.blobs.tolist() if k in watched.views]
        if len(views) == len(way.blobs):
            moves = _places(way, watched.blobs[way.blobs], views) - way.xy
            for axis, move in zip("xy", moves.T, strict=True):
                for name in (axis, f"picture_{axis}"):
                    blobs[name][way.blobs] += move
    places = np.stack([blobs["x"], blobs["y"]], axis=1)
    ways = [replace(way, xy=places[way.blobs]) for way in result.ways]
    scene = replace(result.scene, blobs=blobs)
    return replace(watched, blobs=blobs), replace(result, scene=scene, ways=ways)


def _places(way: Piece, blobs: Blobs, views: Sequence[BlobView]) -> Array:
    """Return the positions of a flight from the views of its blobs, (position, 2) [pixels]."""
    short, long = (float(np.median(blobs[name])) for name in ("radius", "length"))
    shrink = 1 + 2 * int(short / COARSE)  # odd, so that middles stay middles
    radius = (short + long) / 2 / shrink
    reach = int(np.ceil(long / shrink + 2 * FAR_U))
    middles = np.rint(way.xy).astype(int)
    pairs = [
        (_cut(view.picture, at, reach, shrink), _cut(view.behind, at, reach, shrink))
        for view, at in zip(views, middles - [each.corner for each in views], strict=True)
    ]
    curve = np.vander(way.t, 3, increasing=True) @ polynomial(way.t, way.xy, 2)[0]
    off = (curve - middles) / shrink
    for _ in range(3):  # two more rounds change no result by more than its scatter
        balls = [
            _moved(picture - behind * _outside(behind, at, radius), -at)
            for (picture, behind), at in zip(pairs, off, strict=True)
        ]
        light = np.mean(balls, axis=0)
        steps = [_step(*pair, light, at, radius) for pair, at in zip(pairs, off, strict=True)]
        off = off + np.array(steps)
    return np.asarray(middles + shrink * off)


def _cut(picture: NDArray[np.uint8], at: Array, reach: int, shrink: int) -> Picture:
    """Return the square around a pixel `at`, (2,), reduced to `reach` pixels on each side."""
    half = shrink * reach + shrink // 2
    x, y = map(int, at)
    padded = cv2.copyMakeBorder(picture, half, half, half, half, cv2.BORDER_REPLICATE)
    square = padded[y : y + 2 * half + 1, x : x + 2 * half + 1]
    side = 2 * reach + 1
    small = cv2.resize(square, (side, side), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32).reshape(side, side, -1)


def _distance(picture: Picture, at: Array) -> Picture:
    """Return the distance of each pixel from a position `at`, (2,), relative to the middle."""
    reach = len(picture) // 2
    y, x = np.ogrid[-reach : reach + 1, -reach : reach + 1]
    return np.asarray(np.hypot(x - at[0], y - at[1]), np.float32)[..., None]


def _outside(picture: Picture, at: Array, radius: float) -> Picture:
    """Return the share of each pixel that is outside the disk of a ball, blurred by a pixel."""
    return np.asarray(ndtr(_distance(picture, at) - radius))


def _moved(picture: Picture, by: Array) -> Picture:
    """Return a picture moved by (2,) pixels."""
    shift, size = np.column_stack([np.eye(2), by]), picture.shape[1::-1]
    moved = cv2.warpAffine(
        picture, shift, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(moved, np.float32).reshape(picture.shape)


def _step(picture: Picture, behind: Picture, light: Picture, at: Array, radius: float) -> Array:
    """Return the step, (2,), toward the position at which the model fits the picture best."""
    shown, own = _outside(behind, at, radius), _moved(light, at)
    away = _distance(picture, at)[..., 0] - radius
    near = (away < FAR_U) & (away > -radius / 2)  # farther inside a pattern turns with the ball
    rises = (np.gradient(each, axis=(1, 0)) for each in (shown, own))
    slopes = [(-behind * edge - rise)[near].ravel() for edge, rise in zip(*rises, strict=True)]
    design, left = np.stack(slopes, axis=1), (picture - behind * shown - own)[near].ravel()
    spread = max(1.0, 1.4826 * float(np.median(np.abs(left))))
    weight = 1 / np.maximum(1.0, np.abs(left) / (FAR_U * spread))
    normal = (design * weight[:, None]).T @ design
    # a ball that nowhere differs from its background stays where it is
    normal += np.eye(2) * (spread / radius) ** 2
    step = np.linalg.solve(normal, (design * weight[:, None]).T @ left)
    return np.asarray(step / max(1.0, 4 * float(np.hypot(*step)) / radius))
