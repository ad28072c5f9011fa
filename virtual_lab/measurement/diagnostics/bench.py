"""Checks of the bench and of the lot of balls."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, pi, sqrt
from typing import Any

import numpy as np

from virtual_lab.catalog.specs import CHECK_STANDARD
from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Discrepancy, Flag, pair
from virtual_lab.measurement.procedure import lot_of
from virtual_lab.measurement.reduction.observations import restitution_names
from virtual_lab.uncertainty.budget import type_a

DECAY_U = 0.4  # relative, of the loss of amplitude: two readings a few of their steps apart


def sports(seen: Evidence) -> Iterator[Flag]:
    """Compare the sports of bat, balls and procedure, as far as known."""
    session = seen.session
    known = {
        "the bat": session.bat_sport,
        "the ball": session.ball_sport,
        "the procedure": seen.procedure.sport,
    }
    found = {what: sport for what, sport in known.items() if sport and sport != CHECK_STANDARD}
    if len(set(found.values())) > 1:
        said = ", ".join(f"{what} is of {sport}" for what, sport in found.items())
        yield Flag(name="sports", sentence=f"{said}: the result holds for no game")


def check_standard(seen: Evidence) -> Iterator[Flag]:
    """Flag a check standard: its result describes the laboratory, not a bat."""
    if seen.session.bat_sport == CHECK_STANDARD:
        sentence = f"{seen.session.bat} is a check standard and no bat: the verdict holds for none"
        yield Flag(name="check-standard", sentence=sentence)


def bat_shape(seen: Evidence) -> Iterator[Flag]:
    """Compare density, balance, mass and radius of gyration with limits valid for any bat."""
    bat = seen.bat
    length, mass = float(bat.length), float(bat.mass)
    light, heavy = 100.0, 12000.0  # kg/m³, solid balsa and solid lead
    density = mass / (pi * float(bat.barrel_radius) ** 2 * length)
    if not light <= density <= heavy:
        yield Flag(
            name="bat-shape",
            sentence=f"mass over length and barrel is {density:.3g} kg/m³, "
            f"possible {light:g} to {heavy:g}",
            invalidates=True,
        )
    square = float(bat.inertia_cm) / mass / length**2
    # of any bat, a child's too, and of the plain steel cylinder of a morning's check
    for words, value, (low, high), unit in (
        ("balance point", float(bat.z_cm) / length, (0.25, 0.55), " of the length from the tip"),
        ("radius of gyration", sqrt(max(square, 0.0)), (0.20, 0.36), " of the length"),
        ("mass", mass, (0.4, 20.0), " kg"),
    ):
        if not low <= value <= high:
            yield Flag(
                name="bat-shape",
                sentence=f"{words} {value:.3g}{unit}, allowed {low:g} to {high:g}",
            )


def pendulum_swing(seen: Evidence) -> Iterator[Discrepancy]:
    """Compare the change of the pendulum period with the amplitudes that were read."""
    record: Any = seen.session.records["bench"]["pendulum"]
    found = swing_slowing(record)
    if found is None:
        return
    slowing, scatter, dof = found
    # the period is that of small swings times 1 + θ²/16, and θ² would be so many times as large
    square = float((record.first_amplitude * record.last_amplitude).mean())
    period = seen.sensitivities.get("bat.period", inf) * float(seen.best["bat.period"])
    yield pair(
        "pendulum-swing",
        f"periods shorten {slowing:.1f} times as much as the amplitudes read allow, in "
        f"{len(record.times)} releases of bench/pendulum",
        slowing - 1,
        [type_a("scatter", 0.0, scatter, dof=dof)],
        least=DECAY_U,
        moves=abs(period) * square / 16,
    )


def swing_slowing(record: Any) -> tuple[float, float, int] | None:
    """Return the change of the period over that from the amplitudes read, its u and dof.

    The period grows with the square of the amplitude, so it shortens as the swing decays; the
    amount of this change shows the real amplitude. None for a swing that is too short, or did
    not decay.
    """
    releases, passages = record.times.shape
    swings = passages - 1
    if swings < 4:
        return None
    first, last = record.first_amplitude.mean(), record.last_amplitude.mean()
    middle = first * (last / first) ** ((np.arange(swings) + 0.5) / swings)
    longer = np.concatenate([[0.0], np.cumsum(middle**2 / 16)])
    basis = np.stack([np.ones(passages), np.arange(passages), longer], axis=1)
    orthogonal, triangle = np.linalg.qr(basis)
    fitted = record.times @ orthogonal
    rest = record.times - fitted @ orthogonal.T
    dof = releases * (passages - 3)
    spread = sqrt(float((rest**2).sum()) / dof)
    if abs(triangle[2, 2]) < 1e-9:  # rad²
        return None
    _, period, slowing = np.linalg.solve(triangle, fitted.mean(axis=0))
    u = spread / sqrt(releases) / abs(triangle[2, 2]) / float(period)
    return float(slowing / period), u, dof


def lot_rules(seen: Evidence) -> Iterator[Flag]:
    """Flag balls far outside the windows, and inadmissible balls that were fired."""
    windows, balls = seen.procedure.windows, seen.measured_balls
    at = balls.restitution + balls.slope * (windows.ball_restitution_speed - balls.speed)
    low, high = windows.ball_restitution_low, windows.ball_restitution_high
    for each in lot_of(seen.procedure, balls).set_aside:
        if each.ball in seen.readings.ball:
            sentence = f"ball {each.ball}, which the rules do not admit, was fired: {each.reason}"
        elif not low - 5e-3 <= at[each.ball] <= high + 5e-3:  # no sound lot scatters as much
            sentence = f"ball {each.ball} of the lot has {each.reason}: worn, or of another kind"
        else:
            continue
        yield Flag(name="lot-rules", sentence=sentence)


def wall_drift(seen: Evidence) -> Iterator[Discrepancy]:
    """Look for a trend of e0 over the order in which the balls were measured."""
    e0 = seen.measured_balls.restitution
    hits = np.bincount(seen.balls.ball, minlength=e0.size)
    order = np.bincount(seen.balls.ball, np.arange(seen.balls.ball.size), e0.size) / hits
    if e0.size < 4:
        return
    along, length = order - order.mean(), float(np.ptp(order))
    slope = float(along @ e0 / (along @ along))
    rest = e0 - e0.mean() - slope * along
    dof = e0.size - 2
    change, scatter = slope * length, sqrt(rest @ rest / dof / (along @ along)) * length
    # as the trend goes on or began there, the mean is off by half the change
    known = seen.sensitivities
    shared = sum(known.get(name, 0.0) for name in restitution_names(e0.size))
    yield pair(
        "wall-drift",
        f"e0 at the wall changed by {change:+.4f} from first ball to last of {e0.size} "
        "(balls/gates)",
        change,
        [type_a("scatter", 0.0, scatter, dof=dof)],
        least=1e-5,
        moves=abs(shared) / 2 if known else inf,
    )
