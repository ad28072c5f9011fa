"""Validity of hits: every shot is compared with the windows, and the first violation is named."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import inf
from typing import Protocol

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure.rules import SETTING_STEP, Procedure
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.rate import MOST_MISFIT, RateFit
from virtual_lab.measurement.reduction.shot_algebra import ShotResults
from virtual_lab.output.rounding import limit_message
from virtual_lab.records.session import HitDecision
from virtual_lab.units import DEGREE, INCH, MPH, OUNCE, Array, Mask

UNDECIDED = "undecided"  # reason of a hit about which a person has not decided
# whether the criterion is met, function that writes the reason for a value, and the values;
# arrays (..., shot)
Criterion = tuple[Mask, Callable[[float], str], Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """Reason for rejection of each shot, empty for a valid hit."""

    reasons: tuple[str, ...]

    @property
    def valid(self) -> Mask:
        """Mask of the valid shots, (shot,)."""
        return np.array([not reason for reason in self.reasons], dtype=bool)


class Acceptance(Protocol):
    """Function that decides which hits are valid: the procedure (`judge`), or a person."""

    def __call__(
        self,
        procedure: Procedure,
        results: ShotResults,
        readings: ImpactReadings,
        percussion: float,
        turn_rate: float,
        /,
    ) -> Judgement: ...


def judge_by(decisions: Iterable[HitDecision]) -> Acceptance:
    """Return the function by which a person's decisions count instead of the rules.

    A hit without a decision is not valid, nor an accepted hit without a measured e_A. The function
    raises `InputError` for a decision on a shot that was not fired.
    """

    def judge_shots(_: Procedure, results: ShotResults, *_others: object) -> Judgement:
        reasons = [UNDECIDED] * len(results.speed)
        for each in decisions:
            if each.shot >= len(reasons):
                allowed = f"allowed: 0 to {len(reasons) - 1}"
                raise InputError("session.json", "decisions.shot", each.shot, allowed)
            reasons[each.shot] = "" if each.accepted else each.because or "rejected"
            if each.accepted and not np.isfinite(results.collision_efficiency[each.shot]):
                reasons[each.shot] = "accepted, but its records give no e_A"
        return Judgement(reasons=tuple(reasons))

    return judge_shots


def judge(
    procedure: Procedure,
    results: ShotResults,
    readings: ImpactReadings,
    percussion: float,
    turn_rate: float,
) -> Judgement:
    """Return the reason for rejection of each shot, (shot,). It is empty for a valid hit.

    A reason names only the first violated window. `percussion` is the distance of the center of
    percussion from the barrel tip [m]. `turn_rate` is the angular speed [rad/s] that the procedure
    requires for the measured bat. A missed ball is rejected, because its speed is NaN. A ball with
    an unknown mass or e0 (NaN) is rejected too. NaN does not violate the windows for edge misfit,
    rebound angle, rate before contact, agreement of e_A, and encoder misfit.
    """
    criteria = _criteria(procedure, results, readings, percussion, turn_rate)
    violations = np.array([~met for met, _, _ in criteria])
    reasons = np.full(len(results.speed), "", dtype=object)
    for shot in np.flatnonzero(violations.any(axis=0)):
        _, sentence, value = criteria[int(violations[:, shot].argmax())]
        reasons[shot] = sentence(float(value[shot]))
    return Judgement(reasons=tuple(reasons))


def accept_hits(
    procedure: Procedure,
    results: ShotResults,
    readings: ImpactReadings,
    percussion: Array,
    turn_rate: Array,
) -> Mask:
    """Return a mask of the shots that meet all windows of the procedure, (..., shot).

    `percussion` is the distance of the center of percussion from the barrel tip [m]. `turn_rate` is
    the angular speed [rad/s] that the procedure requires for the measured bat. Both broadcast over
    the shots. A missed ball is rejected, because its speed is NaN. A ball with an unknown mass or
    e0 (NaN) is rejected too. NaN does not violate the windows for edge misfit, rebound angle, rate
    before contact, agreement of e_A, and encoder misfit.
    """
    valid = np.ones(np.shape(results.speed), dtype=bool)
    for met, _, _ in _criteria(procedure, results, readings, percussion, turn_rate):
        valid &= met
    return valid


def _criteria(
    procedure: Procedure,
    results: ShotResults,
    readings: ImpactReadings,
    percussion: Array | float,
    turn_rate: Array | float,
) -> list[Criterion]:
    return [
        *_ball(procedure, results),
        *_place(procedure, readings, percussion),
        *_flight(procedure, results, readings),
        *_recoil(procedure, results, readings),
        *_swing(procedure, results, readings, turn_rate),
        *_sense(procedure, results),
    ]


def _within(text: str, low: float, high: float, places: int) -> Callable[[float], str]:
    """Return a function that writes the sentence on a value outside its limits."""
    return lambda value: limit_message(text, value, low, high, places)


def _up_to(text: str, high: float, places: int) -> Callable[[float], str]:
    return _within(text, -inf, high, places)


def _near_speed(name: str, middle: float, tolerance: float) -> Callable[[float], str]:
    """Return a function that writes the sentence on a speed [mph] too far from `middle` [m/s]."""
    mph, most = middle / MPH, tolerance / MPH
    allowed = f"{mph:.4g} ± {most:.3g} mph ({middle:.4g} ± {tolerance:.2g} m/s)"
    text = f"{name} {{0:.{{d}}f}} mph ({{3:.{{d}}f}} m/s), allowed {allowed}"
    return _within(text, mph - most, mph + most, 2)


def _ball(procedure: Procedure, results: ShotResults) -> Iterator[Criterion]:
    windows = procedure.windows
    speed, mass, e0 = results.speed, results.ball_mass, results.window_ball_restitution
    yield np.isfinite(speed), lambda _: "the gates missed the incoming ball", speed
    yield (
        np.abs(speed - procedure.ball_speed) <= windows.speed_tolerance,
        _near_speed("ball speed", procedure.ball_speed, windows.speed_tolerance),
        speed / MPH,
    )
    low, high = windows.ball_mass_low, windows.ball_mass_high
    yield (
        (low <= mass) & (mass <= high),
        _within(
            "ball mass {0:.{d}f} oz, allowed {1:.{d}f} to {2:.{d}f} oz",
            low / OUNCE,
            high / OUNCE,
            3,
        ),
        mass / OUNCE,
    )
    dead, lively = windows.ball_restitution_low, windows.ball_restitution_high
    yield (
        (dead <= e0) & (e0 <= lively),
        _within("e0 of the ball {0:.{d}f}, allowed {1:.3f} to {2:.3f}", dead, lively, 4),
        e0,
    )


def _place(
    procedure: Procedure, readings: ImpactReadings, percussion: Array | float
) -> Iterator[Criterion]:
    position, nearby = readings.position, procedure.windows.place_tolerance
    if procedure.scan is not None:
        low, high = procedure.scan.low, procedure.scan.high
        yield (
            (position >= low - SETTING_STEP) & (position <= high + SETTING_STEP),
            _within(
                "impact position set to {0:.{d}f} in, allowed {1:.{d}f} to {2:.{d}f} in (range of "
                "the scan)",
                low / INCH,
                high / INCH,
                3,
            ),
            position / INCH,
        )
    elif nearby is not None:

        def describe(value: float) -> str:
            middle, most = float(percussion) / INCH, nearby / INCH
            text = f"impact position set to {{0:.{{d}}f}} in, allowed {middle:.3f} ± {most:.3f} in"
            return limit_message(text, value, middle - most, middle + most, 3)

        yield np.abs(position - percussion) <= nearby, describe, position / INCH


def worst_misfit(results: ShotResults, readings: ImpactReadings) -> Array:
    """Return the rms deviation of the beam edges from a straight flight [m], (..., shot).

    A beam edge is the time at which the ball breaks or clears a beam of a light board. Its
    deviation is converted to a distance by the speed of the ball. The incoming and the rebounding
    flight have separate deviations, and the larger one is returned. An unknown deviation (NaN)
    counts as 0.
    """
    speeds = np.stack([results.speed, np.abs(results.rebound_speed)], axis=-1)
    misfit = readings.flights.raw.misfit * speeds
    return np.asarray(np.where(np.isfinite(misfit), misfit, 0.0).max(axis=-1))


def _flight(
    procedure: Procedure, results: ShotResults, readings: ImpactReadings
) -> Iterator[Criterion]:
    windows = procedure.windows
    misfit, angle_most = windows.edge_misfit, windows.rebound_angle
    if misfit is not None:
        worst = worst_misfit(results, readings)
        yield (
            worst <= misfit,
            _up_to(
                "beam edges {0:.{d}f} mm rms from a single flight, allowed {2:.{d}f} mm",
                misfit * 1e3,
                2,
            ),
            worst * 1e3,
        )
    if angle_most is not None:
        angle = np.abs(np.arctan(results.rebound_slope))
        yield (
            ~(angle > angle_most),
            _up_to("rebound angle {0:.{d}f} deg, allowed {2:.{d}f} deg", angle_most / DEGREE, 1),
            angle / DEGREE,
        )


def _recoil(
    procedure: Procedure, results: ShotResults, readings: ImpactReadings
) -> Iterator[Criterion]:
    windows, recoil = procedure.windows, readings.recoil
    if recoil is None:
        return
    with np.errstate(divide="ignore", invalid="ignore"):  # a bat that was not hit does not turn
        per_count = results.recoil_rate / recoil.rate
        before = np.abs(recoil.before * per_count)
        unclear = recoil.rate_u / np.abs(recoil.rate)
    if windows.rate_before is not None:
        yield (
            ~(before > windows.rate_before),
            _up_to(
                "bat turning at {0:.{d}f} rad/s before contact, allowed {2:.{d}f} rad/s",
                windows.rate_before,
                3,
            ),
            before,
        )
    yield _fit_criterion(recoil)
    if windows.recoil_u is not None:
        yield (
            unclear <= windows.recoil_u,
            _up_to(
                "relative u of the recoil rate {0:.{d}f}%, allowed {2:.{d}f}%",
                100 * windows.recoil_u,
                2,
            ),
            100 * unclear,
        )
    if windows.agreement is not None:
        difference = np.abs(results.recoil_efficiency - results.rebound_efficiency)
        yield (
            ~(difference > windows.agreement),
            _up_to(
                "e_A from recoil and from rebound differ by {0:.{d}f}, allowed {2:.{d}f}",
                windows.agreement,
                4,
            ),
            difference,
        )


def _fit_criterion(turn: RateFit) -> Criterion:
    """Return the criterion that the fitted rotation agrees with the encoder's record."""
    return (
        ~(turn.misfit > MOST_MISFIT),
        _up_to(
            "no smooth rotation fits the encoder record: the rms misfit is {0:.{d}f} times that of "
            "resolution and noise at rest, allowed {2:g}",
            MOST_MISFIT,
            1,
        ),
        turn.misfit,
    )


def _swing(
    procedure: Procedure, results: ShotResults, readings: ImpactReadings, turn_rate: Array | float
) -> Iterator[Criterion]:
    windows, swing = procedure.windows, readings.swing
    if swing is None:
        return
    rate = results.swing_rate
    yield np.isfinite(rate), lambda _: "the encoder shows no rotation before contact", rate
    yield _fit_criterion(swing)
    if windows.bat_speed_tolerance is not None:
        # The procedure states the bat speed 6 in from the tip, so the window applies there.
        lever = (procedure.bat_speed or 0.0) / turn_rate
        tolerance = windows.bat_speed_tolerance
        yield (
            np.abs(rate - turn_rate) * lever <= tolerance,
            _near_speed("bat speed", procedure.bat_speed or 0.0, tolerance),
            rate * lever / MPH,
        )
    most = windows.contact_angle
    if most is not None:
        angle = np.abs(swing.angle * rate / swing.rate)
        yield (
            angle <= most,
            _up_to(
                "angle of the bat at contact {0:.{d}f} deg from square, allowed {2:.{d}f} deg",
                most / DEGREE,
                1,
            ),
            angle / DEGREE,
        )


def _sense(procedure: Procedure, results: ShotResults) -> Iterator[Criterion]:
    e = results.restitution
    if procedure.reads == "rebound":
        yield np.isfinite(e), lambda _: "the gates missed the returning ball", e
    yield (
        (e > 0) & (e <= 1),
        _within(
            "restitution {0:.{d}f}, which is impossible; check signs, units and calibration",
            0.0,
            1.0,
            3,
        ),
        e,
    )
