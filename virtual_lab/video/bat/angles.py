"""A bat's angle frame by frame, from the pictures across its edges, and how fast it recoils.

Across each point of its outline a frame shows what the picture at rest shows there, shifted by as
much as the edge has moved, and brighter or darker as lamps flicker. The shifts are those of a bat
that turned; their scatter about it shows how surely. A bat that bends rings on besides, and the
line through the angles passes it by only as far as the ring averages out.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array
from virtual_lab.video.bat.outline import BatEdges, values_at


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnFit:
    """Settings of the fit of a frame's turn, and what a frame must show."""

    rounds: int = 6
    last_step_px: float = 0.002  # a smaller step of the farthest point ends them
    farthest_caught_px: float = 4.0  # an edge that moved farther is none
    least_share_caught: float = 0.5  # of the points a frame shows, at least
    least_points: int = 12
    ball_margin_px: float = 4.0  # kept between the ball and an edge's pixels
    wild_sigmas: float = 4.0  # robust standard deviations of the shifts
    least_frames: int = 3  # of a recoil


FIT = TurnFit()


@dataclass(frozen=True, slots=True, kw_only=True)
class BatAngles:
    """How far a bat has turned since it was at rest, (frame,); NaN where it is not seen."""

    times: Array  # [s]
    angle: Array  # from X toward Y [rad]
    u: Array  # of a frame's own noise; the outline's, about half of it, is common to all
    points: NDArray[np.intp]  # of its outline that a frame shows


@dataclass(frozen=True, slots=True, kw_only=True)
class Recoil:
    """A bat that rests until it is struck and then turns at a constant rate."""

    rate: Estimate  # [rad/s]
    contact: Estimate  # when the turn began [s]
    chi_square: float  # a degree of freedom
    frames: int  # after contact


def bat_angles(
    frames: Iterable[tuple[float, NDArray[Any]]],
    edges: BatEdges,
    balls: Array,
    *,
    pivoted: bool = False,
) -> BatAngles:
    """Return a bat's angle in each frame: time [s] and grey values (row, column), read once.

    `balls` (frame, 3) hide the bat: x, y and radius [pixels], half the blur in it; NaN: nothing.
    A `pivoted` bat turns about the axis's pivot, as exactly as that is known: a pivot one per cent
    nearer makes angles one per cent larger. Another may move across, too, and its edges must be
    long in the picture.
    """
    found: list[tuple[float, float, float, int]] = []
    last: tuple[float, Array] | None = None
    rate = np.zeros(2)
    for number, (time, grey) in enumerate(frames):
        start = last[1] + rate * (time - last[0]) if last else np.zeros(2)
        pose, u, points = _pose(grey, edges, balls[number], start, pivoted)
        found.append((time, float(pose[0]), u, points))
        if points:
            if last and time > last[0]:
                rate = (pose - last[1]) / (time - last[0])
            last = (time, pose)
    times, angle, u_angle, seen = np.array(found, dtype=np.float64).T
    return BatAngles(times=times, angle=angle, u=u_angle, points=seen.astype(np.intp))


def _pose(
    grey: NDArray[Any], edges: BatEdges, ball: Array, start: Array, pivoted: bool
) -> tuple[Array, float, int]:
    """Return a frame's angle and shift, the angle's u, and how many points show them."""
    lost = (np.full(2, np.nan), np.nan, 0)
    pose, size = start.copy(), np.array([grey.shape[1], grey.shape[0]])
    # how far an edge moves to the left by angle, by shift, and where the bat seems wider, as a
    # brighter one does [pixels]
    moves = np.stack([-edges.along, np.ones_like(edges.along)], axis=1) / edges.pixel
    moves = np.column_stack([moves[:, : 2 - pivoted], edges.side])
    for _ in range(FIT.rounds):
        across = edges.pixels(*pose)
        ends = across[:, [0, -1]]
        used = np.asarray(((ends > 1) & (ends < size - 2)).all(axis=(1, 2)))
        if np.isfinite(ball).all():
            away = np.hypot(*np.moveaxis(across - ball[:2], -1, 0)).min(axis=1)
            used &= away > ball[2] + FIT.ball_margin_px
        if used.sum() < FIT.least_points:
            return lost
        shift, weight = edges.shifts(values_at(grey, across[used]), used)
        both = min((edges.side[used] == sign).sum() for sign in (1, -1)) >= FIT.least_points
        good = (weight > 0) & (np.abs(shift) < FIT.farthest_caught_px)
        if good.sum() < max(FIT.least_points, FIT.least_share_caught * used.sum()):
            return lost
        design = moves[used] if both else moves[used, :-1]
        step, variance, good = _solve(design, shift, weight, good)
        step = step[: 2 - pivoted]
        pose[: len(step)] += step
        if np.abs(moves[used, : len(step)] @ step).max() < FIT.last_step_px:
            return pose, float(np.sqrt(variance)), int(good.sum())
    return lost


def _solve(
    design: Array, shift: Array, weight: Array, good: NDArray[np.bool_]
) -> tuple[Array, float, NDArray[np.bool_]]:
    """Return weighted least squares, the first number's variance, and the points kept."""
    for _ in range(3):
        root = np.sqrt(weight[good])
        whole = design[good] * root[:, None]
        inverse = np.linalg.inv(whole.T @ whole)
        solved = inverse @ (whole.T @ (shift[good] * root))
        rest = (shift - design @ solved) * np.sqrt(weight)
        usual = 1.4826 * float(np.median(np.abs(rest[good])))
        kept = good & (np.abs(rest) <= FIT.wild_sigmas * usual)
        if kept.sum() < FIT.least_points or np.array_equal(kept, good):
            break
        good = kept
    variance = float((rest[good] ** 2).sum()) / (int(good.sum()) - design.shape[1])
    return np.asarray(solved, np.float64), variance * float(inverse[0, 0]), good


def recoil_of(found: BatAngles, contact: float, lasts: float = 0.0) -> Recoil:
    """Return how fast a bat turns after contact: at rest until it, at a constant rate from it on.

    `contact` is when the turn begins, about [s]: the line after it decides; frames within `lasts`
    [s] of it belong to neither side. Raises `InputError` where fewer than three frames show the
    bat after contact, or none before.
    """
    since = found.times - contact
    seen = np.isfinite(found.angle) & (np.abs(since) > lasts)
    after, before = seen & (since > 0), seen & (since < 0)
    for name, some, least in (("after", after, FIT.least_frames), ("before", before, 1)):
        if some.sum() < least:
            allowed = f"at least {least} must show the bat"
            raise InputError("", f"frames {name} contact", int(some.sum()), allowed)
    t, angle, u = since[seen], found.angle[seen], found.u[seen]
    late = after[seen]
    # rest, rate, and rate times how late the turn began
    design = np.stack([np.ones_like(t), np.where(late, t, 0.0), np.where(late, -1.0, 0.0)], axis=1)
    whole, right = design / u[:, None], angle / u
    covariance = np.linalg.inv(whole.T @ whole)
    solved = covariance @ (whole.T @ right)
    chi = float(((right - whole @ solved) ** 2).sum()) / (len(right) - 3)
    covariance = covariance * max(chi, 1.0)
    _, rate, late_by = map(float, solved)
    slope = np.array([-late_by / rate**2, 1 / rate])
    late_u = float(np.sqrt(slope @ covariance[1:, 1:] @ slope))
    return Recoil(
        rate=Estimate(value=rate, u=float(np.sqrt(covariance[1, 1])), evaluation="A"),
        contact=Estimate(value=float(contact) + late_by / rate, u=late_u, evaluation="A"),
        chi_square=chi,
        frames=int(late.sum()),
    )
