"""What kind of motion a clip shows: flights, free fall, a pendulum, rolling, carried, none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array
from virtual_lab.video.follow.flights import FLIGHTS
from virtual_lab.video.follow.joint import fit_flights
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSettings:
    """How the kinds of motion differ."""

    straight: float = 0.15  # radii, rms off a straight line, of a ball that rolls
    level: float = 1.1  # radians that a rolling ball's way may be off the picture's rows
    rolling_places: int = 8
    rolling_travel: float = 3.0  # radii
    rolling_share: float = 0.5  # of a ball's places
    pendulum_places: int = 24
    flown_share: float = 0.5  # of its places: fewer that bend as gravity lets them are no flights
    turns: float = 0.6  # of a period that must be seen: less may be a part of any bend
    off_arc: float = 0.02  # of its swing, that a pendulum may be off its arc
    harmonic: float = 0.03  # of the variance that a pendulum's harmonic may leave
    rise: float = 0.15  # of its last speed: what a falling ball may have had upward
    off_down: float = 0.15  # radians that free fall may be off g


MOTION = MotionSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionKind:
    """A kind, and what goes with it."""

    kind: str  # flights | free-fall | pendulum | rolling | carried | none
    period: Estimate | None = None  # of a pendulum [s]


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
    rolls = rolled > MOTION.rolling_share * sum(len(each.t) for each in ball)
    return MotionKind(kind="rolling" if rolls else "carried")


def swings(pieces: Sequence[Piece], flights: Sequence[Piece]) -> bool:
    """Return whether what was taken for flights are a few places of a pendulum."""
    if not flights:
        return False
    ball = _largest_group(pieces)
    flown, whole = (sum(len(each.t) for each in some) for some in (flights, ball))
    return flown < MOTION.flown_share * whole and _pendulum(ball, 1.0) is not None


def _only_falls(scene: FlightScene, flights: Sequence[Piece]) -> bool:
    """Return whether one flight goes along g from its start to its end."""
    if len(flights) != 1:
        return False
    way, fit = flights[0], fit_flights(scene, flights)
    pull = fit.pull[0]
    size = float(np.hypot(*pull))
    if size * np.ptp(way.t) ** 2 / 8 < FLIGHTS.sag * way.radius:
        return False
    velocity = fit.at(0, way.t)[:, 2:]
    along, aside = velocity @ pull / size, np.abs(velocity @ [-pull[1], pull[0]]) / size
    rise = max(2 * size, MOTION.rise * along[-1])
    return bool(along[0] > -rise and aside.max() < np.tan(MOTION.off_down) * along[-1])


def _largest_group(pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces of about one size with the most places."""
    ratio = FLIGHTS.size_ratio
    groups = [
        [each for each in pieces if 1 / ratio < each.radius / one.radius < ratio] for one in pieces
    ]
    return max(groups, key=lambda group: sum(len(each.t) for each in group))


def _pendulum(ball: Sequence[Piece], step: float) -> MotionKind | None:
    """Return a pendulum's period where one harmonic explains the way, with another at twice it."""
    t, once = np.unique(np.concatenate([each.t for each in ball]), return_index=True)
    if len(t) < MOTION.pendulum_places:
        return None
    along, aside, _ = _along_and_aside(np.concatenate([each.xy for each in ball])[once])
    width = float(np.ptp(along))
    arc = np.vander(along / max(width, 1.0), 3)
    beside = aside - arc @ np.linalg.lstsq(arc, aside, rcond=None)[0]
    if float(np.sqrt((beside**2).mean())) > MOTION.off_arc * width:
        return None
    span = float(np.ptp(t))
    tried = 2 * np.pi / span * np.arange(MOTION.turns, len(t) / 4, 0.02)
    left, omega, swing = min(_harmonic(t, along, each) for each in tried)
    for part in (0.01, 0.002, 0.0004):
        tried = omega * np.linspace(1 - part, 1 + part, 11)
        left, omega, swing = min(_harmonic(t, along, each) for each in [omega, *tried])
    turns = span * omega / (2 * np.pi)
    if left > MOTION.harmonic * float(along @ along) or turns < MOTION.turns:
        return None
    if not 1.0 <= swing <= 0.8 * width:
        return None
    period = step * 2 * np.pi / omega
    relative_u = float(np.sqrt(6 * left) / (np.pi * swing * len(t) * turns))
    return MotionKind(kind="pendulum", period=Estimate(value=period, u=period * relative_u))


def _harmonic(t: Array, along: Array, omega: float) -> tuple[float, float, float]:
    """Return the squares that a harmonic leaves, its angular frequency and its amplitude."""
    design = np.stack([np.ones_like(t), np.cos(omega * t), np.sin(omega * t)], axis=1)
    solved, *_ = np.linalg.lstsq(design, along, rcond=None)
    left = along - design @ solved
    return float(left @ left), float(omega), float(np.hypot(*solved[1:]))


def _along_and_aside(xy: Array) -> tuple[Array, Array, Array]:
    """Return places along their main axis and across it, from their mean, and the axis."""
    centred = xy - xy.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    return centred @ axis, centred @ np.array([-axis[1], axis[0]]), axis


def _rolls(scene: FlightScene, piece: Piece) -> bool:
    """Return whether a piece goes straight along while gravity would bend a flight."""
    if len(piece.t) < MOTION.rolling_places:
        return False
    expected = scene.expected(piece.radius)
    if expected and expected * np.ptp(piece.t) ** 2 / 8 < FLIGHTS.sag * piece.radius:
        return False
    along, aside, axis = _along_and_aside(piece.xy)
    straight = np.sqrt((aside**2).mean()) < MOTION.straight * piece.radius
    onward = abs(np.sign(np.diff(along)).mean()) > 0.9
    level = np.arctan2(abs(axis[1]), abs(axis[0])) < MOTION.level
    far = np.ptp(along) > MOTION.rolling_travel * piece.radius
    return bool(straight and onward and level and far)
