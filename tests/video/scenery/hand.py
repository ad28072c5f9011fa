"""A hand with its arm, made of capsules: some behind the ball, some around its front."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.video.scenery.motion import Pair, Path

__all__ = ["SKIN", "hand_shares"]

Image = NDArray[np.float32]
Capsule = tuple[NDArray[np.float64], NDArray[np.float64], float]  # two end points and width [m]

SKIN = (0.19, 0.27, 0.47)  # blue, green and red as shares of the light


def hand_shares(
    path: Path,
    times: NDArray[np.float64],
    ball_radius: float,
    to_pixels: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]],
    pixels_per_metre: float,
    shape: tuple[int, int],
) -> tuple[Image, Image, tuple[slice, slice]] | None:
    """Return the hand's share of pixels behind and before the ball, and the slices of those pixels.

    Shares are means over `times`. `to_pixels` converts positions [m] by time, at those times. The
    result is None if the hand is not in the picture.
    """
    sets = [_capsules(*path.hand_at(float(t)), path.arm_from, ball_radius) for t in times]
    count = len(sets[0][0])  # number of capsules behind the ball
    widths = [width for _, _, width in sets[0][0] + sets[0][1]]
    metres = np.array([[(a, b) for a, b, _ in behind + before] for behind, before in sets])
    ends = to_pixels(metres, times)
    reach = 0.06 * pixels_per_metre + 4
    low = np.floor(ends.min(axis=(0, 1, 2)) - reach).astype(int)
    high = np.ceil(ends.max(axis=(0, 1, 2)) + reach).astype(int)
    left, top = np.maximum(low, 0)
    right, bottom = np.minimum(high, [shape[1], shape[0]])
    if right - left < 2 or bottom - top < 2:
        return None
    shares = [np.zeros((bottom - top, right - left), np.float32) for _ in range(2)]
    fixed = np.round((ends - [left, top]) * 16).astype(int)
    thick = [max(1, round(width * pixels_per_metre)) for width in widths]
    for at_once in fixed:
        for share, which in zip(shares, (slice(count), slice(count, None)), strict=True):
            mask = np.zeros(share.shape, np.uint8)
            for (one, two), width in zip(at_once[which], thick[which], strict=True):
                cv2.line(
                    mask, tuple(map(int, one)), tuple(map(int, two)), 255, width, cv2.LINE_AA, 4
                )
            share[:] += mask / np.float32(255 * len(fixed))
    behind, before = (cv2.GaussianBlur(share, (0, 0), 0.8) for share in shares)
    return behind, before, (slice(top, bottom), slice(left, right))


def _capsules(
    hold: Pair, closed: float, arm_from: Pair, radius: float
) -> tuple[list[Capsule], list[Capsule]]:
    at = np.array(hold)
    toward = np.array(arm_from) - at
    toward = toward / np.linalg.norm(toward)
    side = np.array([-toward[1], toward[0]])

    def point(along: float, across: float) -> NDArray[np.float64]:
        return at + along * toward + across * side

    def between(open_: NDArray[np.float64], shut: NDArray[np.float64]) -> NDArray[np.float64]:
        return closed * shut + (1 - closed) * open_

    wrist = point(radius + 0.10, 0)
    behind: list[Capsule] = [
        (wrist, np.array(arm_from), 0.065),
        (point(radius + 0.02, 0.012), wrist, 0.06),
        (point(radius + 0.02, -0.012), wrist, 0.06),
    ]
    for k in (-1.0, 0.0, 1.0):
        base = point(radius + 0.02, 0.025 * k)
        tip = between(point(radius - 0.055, 0.042 * k), point(-0.5 * radius, 1.1 * radius * k))
        behind.append((base, tip, 0.017))
    before: list[Capsule] = []
    for k in (-1.0, 1.0):
        base = point(radius + 0.05, 0.035 * k)
        tip = between(point(radius - 0.01, 0.075 * k), point(0.7 * radius, 0.7 * radius * k))
        before.append((base, tip, 0.018))
    return behind, before
