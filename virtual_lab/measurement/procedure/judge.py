"""Which hits count: every shot is compared with the windows; the first violation is named."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from virtual_lab.measurement.procedure.rules import SETTING_STEP, Procedure
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.rate import MOST_MISFIT, RateFit
from virtual_lab.measurement.reduction.shot_algebra import ShotResults
from virtual_lab.units import DEGREE, INCH, MPH, OUNCE, Array, Mask

# met, what says why it is not, and the value to put in; arrays (..., shot)
Criterion = tuple[Mask, Callable[[], str], Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """Reason of rejection of each shot; an empty reason is a valid hit."""

    reasons: tuple[str, ...]

    @property
    def valid(self) -> Mask:
        """Which shots count, (shot,)."""
        return np.array([not reason for reason in self.reasons], dtype=bool)


class Acceptance(Protocol):
    """Decides which hits count: the procedure (`judge`), or a person who may overrule it."""

    def __call__(
        self,
        procedure: Procedure,
        results: ShotResults,
        readings: ImpactReadings,
        percussion: float,
        turn_rate: float,
        /,
    ) -> Judgement: ...


def judge(
    procedure: Procedure,
    results: ShotResults,
    readings: ImpactReadings,
    percussion: float,
    turn_rate: float,
) -> Judgement:
    """Accept or reject each shot by the windows.

    `percussion` is the place [m] and `turn_rate` the angular speed [rad/s] that the procedure
    requires for the measured bat.
    """
    criteria = _criteria(procedure, results, readings, percussion, turn_rate)
    missed = np.array([~met for met, _, _ in criteria])
    reasons = np.full(len(results.speed), "", dtype=object)
    for shot in np.flatnonzero(missed.any(axis=0)):
        _, sentence, value = criteria[int(missed[:, shot].argmax())]
        reasons[shot] = sentence().format(value[shot])
    return Judgement(reasons=tuple(reasons))


def accepted(
    procedure: Procedure,
    results: ShotResults,
    readings: ImpactReadings,
    percussion: Array,
    turn_rate: Array,
) -> Mask:
    """Return which shots meet all the windows, of any shape; the last two broadcast to it."""
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


def _ball(procedure: Procedure, results: ShotResults) -> Iterator[Criterion]:
    windows = procedure.windows
    speed, mass, e0 = results.speed, results.ball_mass, results.window_ball_restitution
    yield np.isfinite(speed), lambda: "the gates did not see the ball come in", speed
    around = f"{procedure.ball_speed / MPH:.4g} ± {windows.speed_tolerance / MPH:.3g}"
    yield (
        np.abs(speed - procedure.ball_speed) <= windows.speed_tolerance,
        lambda: f"ball at {{:.2f}} mph, allowed {around} mph",
        speed / MPH,
    )
    low, high = windows.ball_mass_low, windows.ball_mass_high
    yield (
        (low <= mass) & (mass <= high),
        lambda: f"ball of {{:.3f}} oz, allowed {low / OUNCE:.3f} to {high / OUNCE:.3f} oz",
        mass / OUNCE,
    )
    dead, lively = windows.ball_restitution_low, windows.ball_restitution_high
    yield (
        (dead <= e0) & (e0 <= lively),
        lambda: f"ball of e0 {{:.4f}}, allowed {dead:.3f} to {lively:.3f}",
        e0,
    )


def _place(
    procedure: Procedure, readings: ImpactReadings, percussion: Array | float
) -> Iterator[Criterion]:
    place, nearby = readings.place, procedure.windows.place_tolerance
    if procedure.scan is not None:
        low, high = procedure.scan.low, procedure.scan.high
        yield (
            (place >= low - SETTING_STEP) & (place <= high + SETTING_STEP),
            lambda: (
                f"set at {{:.3f}} in, the scan is from {low / INCH:.3f} to {high / INCH:.3f} in"
            ),
            place / INCH,
        )
    elif nearby is not None:
        yield (
            np.abs(place - percussion) <= nearby,
            lambda: f"set at {{:.3f}} in, allowed {percussion / INCH:.3f} ± {nearby / INCH:.3f} in",
            place / INCH,
        )


def worst_misfit(results: ShotResults, readings: ImpactReadings) -> Array:
    """Return how far the edges of a shot are off one flight, in or back, (..., shot) [m]."""
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
            lambda: f"edges {{:.2f}} mm off one flight, allowed {misfit * 1e3:.2f} mm",
            worst * 1e3,
        )
    if angle_most is not None:
        angle = np.abs(np.arctan(results.rebound_slope))
        yield (
            ~(angle > angle_most),
            lambda: f"ball came back at {{:.1f}} deg, allowed {angle_most / DEGREE:.1f} deg",
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
            lambda: (
                f"bat turned at {{:.3f}} rad/s before the hit, allowed {windows.rate_before:.3f}"
            ),
            before,
        )
    yield _fitted(recoil)
    if windows.recoil_u is not None:
        yield (
            unclear <= windows.recoil_u,
            lambda: f"recoil known to {{:.2%}}, allowed {windows.recoil_u:.2%}",
            unclear,
        )
    if windows.agreement is not None:
        apart = np.abs(results.recoil_efficiency - results.rebound_efficiency)
        yield (
            ~(apart > windows.agreement),
            lambda: f"e_A by recoil and by rebound {{:.4f}} apart, allowed {windows.agreement:.4f}",
            apart,
        )


def _fitted(turn: RateFit) -> Criterion:
    """Ask that the model of the turn holds over the record it was fitted to."""
    return (
        ~(turn.misfit > MOST_MISFIT),
        lambda: (
            "no smooth turn fits the encoder: {:.1f} times the rms that counting and noise at "
            f"rest leave, allowed {MOST_MISFIT:g}"
        ),
        turn.misfit,
    )


def _swing(
    procedure: Procedure, results: ShotResults, readings: ImpactReadings, turn_rate: Array | float
) -> Iterator[Criterion]:
    windows, swing = procedure.windows, readings.swing
    if swing is None:
        return
    turned = results.swing_rate
    yield np.isfinite(turned), lambda: "the encoder shows no turn up to contact", turned
    yield _fitted(swing)
    if windows.bat_speed_tolerance is not None:
        # the bat's speed is named 6 in from the tip, so the window is taken there
        lever = (procedure.bat_speed or 0.0) / turn_rate
        tolerance = windows.bat_speed_tolerance

        def asked() -> str:
            window = f"{turn_rate * lever / MPH:.4g} ± {tolerance / MPH:.3g}"
            return f"bat at {{:.2f}} mph, allowed {window} mph"

        yield (
            np.abs(turned - turn_rate) * lever <= tolerance,
            asked,
            turned * lever / MPH,
        )
    most = windows.contact_angle
    if most is not None:
        angle = np.abs(swing.angle * turned / swing.rate)
        yield (
            angle <= most,
            lambda: f"bat {{:.1f}} deg from square at contact, allowed {most / DEGREE:.1f} deg",
            angle / DEGREE,
        )


def _sense(procedure: Procedure, results: ShotResults) -> Iterator[Criterion]:
    e = results.restitution
    if procedure.reads == "rebound":
        yield np.isfinite(e), lambda: "the gates did not see the ball come back", e
    yield (
        (e > 0) & (e <= 1),
        lambda: "restitution of {:.3f}, which no collision has (signs, units or calibration?)",
        e,
    )
