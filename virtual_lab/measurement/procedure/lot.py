"""Admissible balls of a lot; the others are set aside before the first hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.reduction.shot_algebra import MeasuredBalls
from virtual_lab.output.rounding import beyond
from virtual_lab.units import MPH, OUNCE, Array, Mask


@dataclass(frozen=True, slots=True)
class SetAside:
    """A ball that is not used, and why."""

    ball: int
    reason: str


@dataclass(frozen=True, slots=True)
class Lot:
    """The balls as measured against the rules.

    If none is admissible, all are `used`, and every shot is then rejected.
    """

    used: Mask  # (ball,)
    set_aside: tuple[SetAside, ...]


def admitted(procedure: Procedure, balls: MeasuredBalls) -> Mask:
    """Return a mask of the balls that define the lot, (..., ball): all where none is admissible."""
    light, e0 = _misfits(procedure, balls)
    fit = ~(light | e0)
    return np.asarray(fit | ~fit.any(axis=-1, keepdims=True))


def lot_of(procedure: Procedure, balls: MeasuredBalls) -> Lot:
    """Return the lot, judged by the windows of mass and e0, at the procedure's speed for e0."""
    windows = procedure.windows
    of_mass, of_e0 = _misfits(procedure, balls)
    e0 = _restitution(procedure, balls)
    set_aside = []
    for ball in np.flatnonzero(of_mass | of_e0):
        if of_mass[ball]:
            low, high = windows.ball_mass_low / OUNCE, windows.ball_mass_high / OUNCE
            text = "{0:.{d}f} oz, allowed {1:.{d}f} to {2:.{d}f} oz"
            reason = beyond(text, balls.mass[ball] / OUNCE, low, high, 3)
        else:
            low, high = windows.ball_restitution_low, windows.ball_restitution_high
            at = f"at {windows.ball_restitution_speed / MPH:.4g} mph"
            text = f"e0 {{0:.{{d}}f}} {at}, allowed {{1:.3f}} to {{2:.3f}}"
            reason = beyond(text, e0[ball], low, high, 4)
        set_aside.append(SetAside(int(ball), reason))
    return Lot(admitted(procedure, balls), tuple(set_aside))


def _restitution(procedure: Procedure, balls: MeasuredBalls) -> Array:
    speed = procedure.windows.ball_restitution_speed
    return np.asarray(balls.restitution + balls.slope * (speed - balls.speed))


def _misfits(procedure: Procedure, balls: MeasuredBalls) -> tuple[Mask, Mask]:
    """Return masks of the balls outside the window of the mass, and that of e0, (..., ball)."""
    windows, e0 = procedure.windows, _restitution(procedure, balls)
    of_mass = (windows.ball_mass_low <= balls.mass) & (balls.mass <= windows.ball_mass_high)
    of_e0 = (windows.ball_restitution_low <= e0) & (e0 <= windows.ball_restitution_high)
    return ~of_mass, ~of_e0
