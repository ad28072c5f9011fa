"""Admissible balls of a lot; the others are set aside before the first hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.reduction.shot_algebra import MeasuredBalls
from virtual_lab.output.rounding import limit_message, with_unit
from virtual_lab.units import MPH, OUNCE, Array, Mask


@dataclass(frozen=True, slots=True)
class SetAside:
    """A ball outside the windows of mass and e0: its number from 0, and the reason."""

    ball: int
    reason: str


def admit_balls(procedure: Procedure, balls: MeasuredBalls) -> Mask:
    """Return a mask of the balls that define the mean of the lot, (..., ball).

    These are the balls with mass and e0 within the windows of the procedure. NaN is outside a
    window. If no ball of a lot is within the windows, the mask is True for all its balls, because
    the mean must exist. All shots with these balls are rejected later.
    """
    light, e0 = _misfits(procedure, balls)
    fit = ~(light | e0)
    return np.asarray(fit | ~fit.any(axis=-1, keepdims=True))


def has_too_few(procedure: Procedure, balls: MeasuredBalls) -> Mask:
    """Return whether too few balls of each lot are within the windows, (...).

    Too few are none, or a share of the balls below `least_admitted` of the procedure.
    """
    light, e0 = _misfits(procedure, balls)
    admitted = (~(light | e0)).mean(axis=-1)
    return np.asarray((admitted < procedure.least_admitted - 1e-9) | (admitted == 0))


def set_aside(procedure: Procedure, balls: MeasuredBalls) -> tuple[SetAside, ...]:
    """Return the balls of one lot with a mass or e0 outside the window, each with the reason.

    A window is the range that the procedure allows. `balls` has arrays (ball,). The window of e0
    (ball-wall restitution) applies at a speed that the procedure states. e0 is therefore computed
    for this speed. If both mass and e0 are outside, the reason is the mass. The tuple is empty if
    all balls are within the windows.
    """
    windows = procedure.windows
    of_mass, of_e0 = _misfits(procedure, balls)
    e0 = _restitution(procedure, balls)
    excluded = []
    for ball in np.flatnonzero(of_mass | of_e0):
        if of_mass[ball]:
            low, high = windows.ball_mass_low / OUNCE, windows.ball_mass_high / OUNCE
            text = "mass {0:.{d}f} oz, allowed {1:.{d}f} to {2:.{d}f} oz"
            reason = limit_message(text, balls.mass[ball] / OUNCE, low, high, 3)
        else:
            low, high = windows.ball_restitution_low, windows.ball_restitution_high
            at = with_unit(windows.ball_restitution_speed / MPH, "mph", ".4g")
            text = f"e0 {{0:.{{d}}f}} at {at}, allowed {{1:.3f}} to {{2:.3f}}"
            reason = limit_message(text, e0[ball], low, high, 4)
        excluded.append(SetAside(int(ball), reason))
    return tuple(excluded)


def _restitution(procedure: Procedure, balls: MeasuredBalls) -> Array:
    speed = procedure.windows.ball_restitution_speed
    return np.asarray(balls.restitution + balls.slope * (speed - balls.speed))


def _misfits(procedure: Procedure, balls: MeasuredBalls) -> tuple[Mask, Mask]:
    """Return two masks, (..., ball): balls with a wrong mass, and balls with a wrong e0."""
    windows, e0 = procedure.windows, _restitution(procedure, balls)
    of_mass = (windows.ball_mass_low <= balls.mass) & (balls.mass <= windows.ball_mass_high)
    of_e0 = (windows.ball_restitution_low <= e0) & (e0 <= windows.ball_restitution_high)
    return ~of_mass, ~of_e0
