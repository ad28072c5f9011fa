"""Positions of the ball in the picture of a camera that does not turn.

A camera that follows the ball turns about its lens, which moves objects at the rim farther than
those in the middle, unlike a shift. Each picture is therefore aligned with an earlier one by a
rotation. The focal length is a parameter of the fit of the flights: the usual one of a phone with a
u of 20 %. Scenes filmed with 0.75 to 0.95 longer sides are fitted to their values within this u.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.find.drift import edges_of
from virtual_lab.video.find.still import soft
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FOCAL, FlightScene

FOCAL_U = 0.2  # relative u of the focal length
TURNS = 0.01  # smallest drift of a camera that turns [longer sides of the picture]
FAR = 0.1  # largest shift between two pictures that are aligned [focal lengths]


def turn_back(
    scene: FlightScene, flights: Sequence[Piece], watched: Watched
) -> tuple[FlightScene, list[Piece]]:
    """Return scene and flights with the positions in a camera that does not turn.

    They are unchanged if the picture drifts by less than `TURNS`, if positions are sharp, or if no
    pictures were kept.
    """
    size, frames = np.array(scene.size), scene.blobs["frame"]
    used = np.concatenate([frames[:0], *(flight.frames for flight in flights)])
    if not (used.size and watched.thumbs) or flights[0].sharp:
        return scene, list(flights)
    moved = np.ptp(watched.drifts[used, :2], axis=0)
    if moved.max() < TURNS * size.max():
        return scene, list(flights)
    middle, focal = (size - 1) / 2, FOCAL * float(size.max())
    offsets = np.stack([scene.blobs[f"picture_{axis}"] for axis in "xy"], axis=1) - middle

    def positions(focal: float) -> Array:
        rays = np.column_stack([offsets, np.full(len(offsets), focal)])[..., None]
        back = np.linalg.solve(_turns(watched, used, focal)[frames], rays)[..., 0]
        return np.asarray(middle + focal * back[:, :2] / back[:, 2:])

    xy = positions(focal)
    lens = positions((1 + FOCAL_U) * focal) - xy
    # any direction of the camera may be the one that is square to the flight
    level_u = np.hypot(scene.level_u, moved / focal / np.sqrt(3))
    turned = replace(scene, lens=lens, level_u=level_u)
    return turned, [replace(each, xy=xy[each.blobs]) for each in flights]


def _turns(watched: Watched, used: NDArray[np.intp], focal: float) -> Array:
    """Return the matrix that maps rays of the first picture to those of each, (frame, 3, 3).

    It is a rotation times a growth of the picture. Each of the `used` pictures is aligned with an
    earlier one that shows nearly the same part of the scene.
    """
    shrink, drifts = watched.still.shrink, watched.drifts
    key = last = min(watched.thumbs)
    focal, edges = focal / shrink, None
    turns = np.tile(np.eye(3), (len(drifts), 1, 1))
    for k, thumb in watched.thumbs.items():
        far = np.abs(drifts[k] - drifts[key])[:2].max() > FAR * shrink * focal
        if not (far or k in used or edges is None):
            turns[k] = turns[k - 1]
            continue
        grey = soft(np.asarray(cv2.imdecode(thumb, cv2.IMREAD_GRAYSCALE), np.uint8))
        size = grey.shape[1::-1]
        across, down = (np.array(size) - 1) / 2
        lens = np.array([[focal, 0, across], [0, focal, down], [0, 0, 1]])
        if edges is not None:
            step = (drifts[k] - drifts[last]) / [shrink, shrink, 1, 1]
            turns[k] = _turn(step, focal) @ turns[last]
            for _ in range(3):  # a drift is a rotation only if it is small
                between = turns[k] @ np.linalg.inv(turns[key])
                warp, flags = lens @ between @ np.linalg.inv(lens), cv2.WARP_INVERSE_MAP
                view = cv2.warpPerspective(grey, warp, size, flags=flags | cv2.INTER_LINEAR)
                drift = edges.drift(np.asarray(view, np.uint8), np.zeros(4))
                if not drift.any():  # a further alignment would find the same
                    break
                turns[k] = between @ _turn(drift, focal) @ turns[key]
        if edges is None or far:
            key, edges = k, edges_of(grey)
        last = k
    return turns


def _turn(drift: Array, focal: float) -> Array:
    """Return the matrix (3, 3) of a small rotation and growth, from the drift that it causes."""
    across, down, growth, turn = drift
    rotation = cv2.Rodrigues(np.array([-down / focal, across / focal, turn]))[0]
    return np.asarray(np.diag([1 + growth, 1 + growth, 1.0]) @ rotation)
