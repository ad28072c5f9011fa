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

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from virtual_lab.units import Array
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.source import Frame
from virtual_lab.video.find.blobs import COARSE
from virtual_lab.video.find.drift import Image
from virtual_lab.video.find.still import Still, eight_bits
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.pieces import FAR_U, Piece, polynomial
from virtual_lab.video.follow.searching import FlightsFound

Picture = NDArray[np.float32]  # (row, column, channel) [DN]
# u of the registered positions [share of their rms distance from the hulls' positions, without
# their mean], found with 18 clips of cameras with a known scale and g, and confirmed with 12 more
MOVED_U = 0.6


def register(clip: Clip, watched: Watched, result: FlightsFound) -> tuple[Watched, FlightsFound]:
    """Return the blobs and the flights with more accurate positions, by image registration.

    The images of the ball in a flight are read again and shifted until they match each other. The
    positions stay unchanged if `watched` was not made from pictures.
    """
    if not watched.drifts.size or not result.ways:
        return watched, result
    blobs, ways = watched.blobs.copy(), []
    share = 0.0 if result.scene.pull is None else MOVED_U  # a fitted g has a larger u of its own
    pictures = clip.numbered_frames(np.concatenate([way.frames for way in result.ways]))
    for way in result.ways:
        xy = _places(way, watched, clip, islice(pictures, len(way.t)))
        for axis, move in zip("xy", (xy - way.xy).T, strict=True):
            for name in (axis, f"picture_{axis}"):
                blobs[name][way.blobs] += move
        u = np.hypot(way.pattern_u, share * (xy - way.xy).std(axis=0).max())
        ways.append(replace(way, xy=xy, pattern_u=float(u)))
    scene = replace(result.scene, blobs=blobs)
    return replace(watched, blobs=blobs), replace(result, scene=scene, ways=ways)


def _places(
    way: Piece, watched: Watched, clip: Clip, pictures: Iterator[tuple[int, Frame]]
) -> Array:
    """Return the positions of a flight from its `pictures`, (position, 2) [pixels]."""
    blobs, depth = watched.blobs[way.blobs], int(clip.full_scale).bit_length()
    short, long = (float(np.median(blobs[name])) for name in ("radius", "length"))
    shrink = 1 + 2 * int(short / COARSE)  # odd, so that middles stay middles
    radius = (short + long) / 2 / shrink
    reach = int(np.ceil(long / shrink + 2 * FAR_U))
    middles = np.rint(way.xy).astype(int)
    pairs = [
        _squares(watched.still, eight_bits(frame, depth), watched.drifts[number], at, reach, shrink)
        for (number, frame), at in zip(pictures, middles, strict=True)
    ]
    curve = np.vander(way.t, 3, increasing=True) @ polynomial(way.t, way.xy, 2)[0]
    off = (curve - middles) / shrink
    for _ in range(3):  # two more rounds change no result by more than its scatter
        balls = [
            _translate(picture - behind * _outside(behind, at, radius), -at)
            for (picture, behind), at in zip(pairs, off, strict=True)
        ]
        light = np.mean(balls, axis=0)
        steps = [_step(*pair, light, at, radius) for pair, at in zip(pairs, off, strict=True)]
        off = off + np.array(steps)
    return np.asarray(middles + shrink * off)


def _squares(
    still: Still, picture: Image, drift: Array, at: NDArray[np.intp], reach: int, shrink: int
) -> tuple[Picture, Picture]:
    """Return the squares around a pixel `at`, (2,), of a picture and of the background behind it.

    They are in the still frame, and reduced to `reach` pixels on each side of the middle.
    """
    light = still.difference(still.shrunk(picture), drift)[1]
    first = at - still.origin - shrink * reach - shrink // 2
    last, side = first + shrink * (2 * reach + 1), 2 * reach + 1
    here = np.clip([first, last], 0, still.background.shape[1::-1])
    (x, y), size = here[0].tolist(), (here[1] - here[0]).tolist()
    (left, top), (right, below) = np.abs(here - [first, last]).tolist()
    squares = []
    for each in still.cut(picture, drift, light, (x, y), (size[0], size[1])):
        whole = cv2.copyMakeBorder(each, top, below, left, right, cv2.BORDER_REPLICATE)
        small = cv2.resize(whole, (side, side), interpolation=cv2.INTER_AREA)
        squares.append(np.asarray(small, np.float32).reshape(side, side, -1))
    return squares[0], squares[1]


def _distance(picture: Picture, at: Array) -> Picture:
    """Return the distance of each pixel from a position `at`, (2,), relative to the middle."""
    reach = len(picture) // 2
    y, x = np.ogrid[-reach : reach + 1, -reach : reach + 1]
    return np.asarray(np.hypot(x - at[0], y - at[1]), np.float32)[..., None]


def _outside(picture: Picture, at: Array, radius: float) -> Picture:
    """Return the share of each pixel that is outside the disk of a ball, blurred by a pixel."""
    return np.asarray(ndtr(_distance(picture, at) - radius))


def _translate(picture: Picture, by: Array) -> Picture:
    """Return a picture moved by (2,) pixels."""
    shift, size = np.column_stack([np.eye(2), by]), picture.shape[1::-1]
    moved = cv2.warpAffine(picture, shift, size, None, cv2.INTER_CUBIC, cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.float32).reshape(picture.shape)


def _step(picture: Picture, behind: Picture, light: Picture, at: Array, radius: float) -> Array:
    """Return the step, (2,), toward the position at which the model fits the picture best."""
    shown, own = _outside(behind, at, radius), _translate(light, at)
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
