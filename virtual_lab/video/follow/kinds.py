"""What kind of motion a clip shows: flights, free fall, a pendulum, rolling, carried, none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.follow.flights import SAG, SIZE, FlightScene, joint_fit
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.said import Said

__all__ = ["MotionKind", "motion_of"]

Array = NDArray[np.float64]

STRAIGHT = 0.15  # radii, rms off a straight line
LEVEL = 1.1  # radians that a rolling ball's way may be off the picture's rows
LEAST = 8  # places that a ball rolls through
MOSTLY = 0.5  # of a ball's places that are those of rolling
ROLLED = 3.0  # radii it then goes at least
SWUNG = 0.6  # of a period that must be seen
ARC = 0.02  # of its swing, that a pendulum may be off its arc
HARMONIC = 0.03  # of the variance that a pendulum's harmonic may leave
LET_GO = 0.15  # of its last speed: what a falling ball may have had upward
DOWN = 0.15  # radians that free fall may be off g


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionKind:
    """A kind, and what goes with it."""

    kind: str  # flights | free-fall | pendulum | rolling | carried | none
    period: Said | None = None  # of a pendulum [s]


def motion_of(
    scene: FlightScene, pieces: Sequence[Piece], flights: Sequence[Piece], step: float
) -> MotionKind:
    """Return the kind of motion; `step`: seconds of a step of time."""
    if flights:
        return MotionKind(kind="free-fall" if _only_falls(scene, flights) else "flights")
    if not pieces:
        return MotionKind(kind="none")
    ball = _largest_group(pieces)
    if swing := _pendulum(ball, step):
        return swing
    rolled = sum(len(each.t) for each in ball if _rolls(scene, each))
    if rolled > MOSTLY * sum(len(each.t) for each in ball):
        return MotionKind(kind="rolling")
    return MotionKind(kind="carried")


def _only_falls(scene: FlightScene, flights: Sequence[Piece]) -> bool:
    """Return whether one flight goes along g from its start to its end."""
    if len(flights) != 1:
        return False
    way = flights[0]
    fit = joint_fit(scene, flights)
    pull = fit.pull[0]
    size = float(np.hypot(*pull))
    if size * np.ptp(way.t) ** 2 / 8 < SAG * way.radius:
        return False
    down = pull / size
    velocity = fit.at(0, way.t)[:, 2:]
    along = velocity @ down
    aside = np.abs(velocity @ np.array([-down[1], down[0]]))
    return bool(
        along[0] > -max(2 * size, LET_GO * along[-1]) and aside.max() < np.tan(DOWN) * along[-1]
    )


def _largest_group(pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces of about one size with the most places."""
    groups = [
        [each for each in pieces if 1 / SIZE < each.radius / one.radius < SIZE] for one in pieces
    ]
    return max(groups, key=lambda group: sum(len(each.t) for each in group))


def _pendulum(ball: Sequence[Piece], step: float) -> MotionKind | None:
    """Return a pendulum's period where one harmonic explains the way, with another at twice it."""
    t = np.concatenate([each.t for each in ball])
    xy = np.concatenate([each.xy for each in ball])
    _, once = np.unique(t, return_index=True)
    t, xy = t[once], xy[once]
    if len(t) < 3 * LEAST:
        return None
    centred = xy - xy.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    along, aside = centred @ axis, centred @ np.array([-axis[1], axis[0]])
    arc = np.vander(along / max(np.ptp(along), 1.0), 3)
    beside = aside - arc @ np.linalg.lstsq(arc, aside, rcond=None)[0]
    if float(np.sqrt((beside**2).mean())) > ARC * float(np.ptp(along)):
        return None
    span = float(np.ptp(t))
    total = float(along @ along)
    best: tuple[float, float, Array] | None = None
    for turns in np.arange(SWUNG, len(t) / 4, 0.02):
        omega = 2 * np.pi * turns / span
        left, solved = _harmonic(t, along, omega)
        if best is None or left < best[0]:
            best = (left, omega, solved)
    assert best is not None
    left, omega, solved = best
    for width in (0.01, 0.002, 0.0004):
        for each in np.linspace(omega * (1 - width), omega * (1 + width), 11):
            now, again = _harmonic(t, along, float(each))
            if now < left:
                left, omega, solved = now, float(each), again
    swing = float(np.hypot(*solved[1:3]))
    # a part of a slow harmonic may be any bend: it must be seen to turn
    turns = span * omega / (2 * np.pi)
    if left > HARMONIC * total or turns < SWUNG or swing > 0.8 * np.ptp(along) or swing < 1.0:
        return None
    rms = np.sqrt(left / len(t))
    period_u = float(np.sqrt(6) * rms / (np.pi * swing * np.sqrt(len(t)) * turns))
    period = step * 2 * np.pi / omega
    return MotionKind(kind="pendulum", period=Said(value=period, u=period * period_u))


def _harmonic(t: Array, along: Array, omega: float) -> tuple[float, Array]:
    design = np.stack([np.ones_like(t), np.cos(omega * t), np.sin(omega * t)], axis=1)
    solved, *_ = np.linalg.lstsq(design, along, rcond=None)
    left = along - design @ solved
    return float(left @ left), solved


def _rolls(scene: FlightScene, piece: Piece) -> bool:
    """Return whether a piece goes straight along while gravity would bend a flight."""
    if len(piece.t) < LEAST:
        return False
    expected = scene.expected(piece.radius)
    span = float(np.ptp(piece.t))
    if expected is not None and expected * span**2 / 8 < SAG * piece.radius:
        return False
    centred = piece.xy - piece.xy.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    off = centred @ np.array([-axis[1], axis[0]])
    along = centred @ axis
    straight = float(np.sqrt((off**2).mean())) < STRAIGHT * piece.radius
    onward = abs(float(np.sign(np.diff(along)).mean())) > 0.9
    level = abs(float(np.arctan2(axis[1], axis[0])))
    level = min(level, np.pi - level)
    return bool(straight and onward and level < LEVEL and np.ptp(along) > ROLLED * piece.radius)
