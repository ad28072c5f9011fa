"""Which balls of a lot are admissible; the others are set aside before the first hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure.rules import Procedure
from virtual_lab.measurement.reduction.shot_algebra import MeasuredBalls
from virtual_lab.units import MPH, OUNCE


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

    used: NDArray[np.bool_]  # (ball,)
    set_aside: tuple[SetAside, ...]


def lot_of(procedure: Procedure, balls: MeasuredBalls) -> Lot:
    """Return the lot, judged by the windows of mass and e0, at the procedure's speed for e0."""
    windows = procedure.windows
    restitution = balls.restitution + balls.slope * (windows.ball_restitution_speed - balls.speed)
    set_aside = []
    for ball, (mass, e0) in enumerate(zip(balls.mass, restitution, strict=True)):
        if not windows.ball_mass_low <= mass <= windows.ball_mass_high:
            low, high = windows.ball_mass_low / OUNCE, windows.ball_mass_high / OUNCE
            reason = f"{mass / OUNCE:.3f} oz, allowed {low:.3f} to {high:.3f} oz"
            set_aside.append(SetAside(ball, reason))
        elif not windows.ball_restitution_low <= e0 <= windows.ball_restitution_high:
            low, high = windows.ball_restitution_low, windows.ball_restitution_high
            at = f"at {windows.ball_restitution_speed / MPH:.4g} mph"
            reason = f"e0 {e0:.4f} {at}, allowed {low:.3f} to {high:.3f}"
            set_aside.append(SetAside(ball, reason))
    used = np.ones(len(restitution), dtype=bool)
    used[[each.ball for each in set_aside]] = False
    return Lot(used if used.any() else ~used, tuple(set_aside))
