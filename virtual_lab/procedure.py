"""A test procedure: what to ask of a rig, which hits count, metric, limit and verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Lt
from numpy.typing import NDArray

from virtual_lab.reduction.measurement import ShotResults
from virtual_lab.reduction.observations import ImpactReadings
from virtual_lab.relations.kinematics import centre_of_percussion
from virtual_lab.specs import Dimension, Spec
from virtual_lab.units import INCH, MPH, OUNCE

__all__ = ["Judgement", "Procedure", "Verdict", "Windows", "aimed_place", "judge", "verdict"]

Array = NDArray[np.float64]
FASTEST = 100.0  # m/s, beyond any ball cannon and any bat
MOST_ATTEMPTS = 1000  # a slip of the pen, not a test, beyond
SETTING_STEP = 0.5e-3  # m, the operator sets a place to half a millimetre

Mass = Annotated[float, Gt(0), Dimension("mass")]
Number = Annotated[float, Gt(0), Dimension("number")]
Count = Annotated[int, Gt(1), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows(Spec):
    """What a hit must meet to count."""

    speed_tolerance: Annotated[float, Gt(0), Dimension("speed")]
    place_tolerance: Annotated[float, Gt(0), Dimension("length")]
    rate_before: Annotated[float, Gt(0), Dimension("angular speed")]
    recoil_u: Number  # of one recoil fit, relative
    ball_mass_low: Mass
    ball_mass_high: Mass
    ball_restitution_low: Number
    ball_restitution_high: Number

    def __post_init__(self) -> None:
        for name in ("ball_mass", "ball_restitution"):
            low, high = getattr(self, f"{name}_low"), getattr(self, f"{name}_high")
            if low > high:
                raise ValueError(f"{name}_low {low:g} is above {name}_high {high:g}: no ball fits")


@dataclass(frozen=True, slots=True, kw_only=True)
class Procedure(Spec):
    """A rule book, as far as a rig and a reduction need it."""

    name: str
    title: str
    edition: str
    rig: str
    ball: str
    metric: Literal["bat_performance_factor"]
    place: Literal["centre-of-percussion"]
    recoil: Literal["pivoted"]
    pivot_from_knob: Annotated[float, Gt(0), Dimension("length")]
    speed: Annotated[float, Gt(0), Lt(FASTEST), Dimension("speed")]
    limit: Number
    valid_hits: Count
    attempts: Count
    wall_hits: Count  # of each ball
    windows: Windows

    def __post_init__(self) -> None:
        if self.attempts < self.valid_hits:
            raise ValueError(f"{self.attempts} attempts cannot give {self.valid_hits} valid hits")
        if self.attempts > MOST_ATTEMPTS:
            raise ValueError(f"{self.attempts} attempts; allowed: up to {MOST_ATTEMPTS}")


class Verdict(Enum):
    """The outcome of a test by the procedure's own rule."""

    PASS = "PASS"
    FAIL = "FAIL"
    INVALID = "INVALID"


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """Why each shot counts or not: an empty reason is a valid hit."""

    reasons: tuple[str, ...]

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Which shots count, (shot,)."""
        return np.array([not reason for reason in self.reasons], dtype=bool)


def aimed_place(bat: Mapping[str, float], pivot_from_knob: float, *, exact: bool) -> float:
    """Return the place to set [m]: the centre of percussion (Eq. 11) of the bat as measured.

    `bat` holds the measured mass, length, z_cm and inertia_cm [SI]; `exact` leaves out the
    operator's half-millimetre steps.
    """
    axis = bat["length"] - pivot_from_knob
    place = float(centre_of_percussion(bat["z_cm"], bat["inertia_cm"], bat["mass"], axis))
    return place if exact else round(place / SETTING_STEP) * SETTING_STEP


def judge(
    procedure: Procedure, results: ShotResults, readings: ImpactReadings, aimed: float
) -> Judgement:
    """Accept or reject each shot by the windows; the first one missed is named.

    `aimed` is the place [m] that the bat as measured asks for.
    """
    windows, recoil = procedure.windows, readings.recoil
    with np.errstate(divide="ignore", invalid="ignore"):  # a bat that was not hit does not turn
        per_count = results.recoil_rate / recoil.rate
        before = np.abs(recoil.rate_before * per_count)
        unclear = recoil.rate_u / np.abs(recoil.rate)
    mass, e0 = results.ball_mass, results.nominal_ball_restitution
    low, high = windows.ball_mass_low, windows.ball_mass_high
    dead, lively = windows.ball_restitution_low, windows.ball_restitution_high
    nearby = windows.place_tolerance
    around = f"{procedure.speed / MPH:.4g} ± {windows.speed_tolerance / MPH:.3g}"
    criteria: tuple[tuple[NDArray[np.bool_], str, Array], ...] = (
        (np.isfinite(results.speed), "the gates did not see the ball come in", results.speed),
        (
            np.abs(results.speed - procedure.speed) <= windows.speed_tolerance,
            f"ball at {{:.2f}} mph, allowed {around} mph",
            results.speed / MPH,
        ),
        (
            np.abs(readings.place - aimed) <= nearby,
            f"set at {{:.3f}} in, allowed {aimed / INCH:.3f} ± {nearby / INCH:.3f} in",
            readings.place / INCH,
        ),
        (
            (low <= mass) & (mass <= high),
            f"ball of {{:.3f}} oz, allowed {low / OUNCE:.3f} to {high / OUNCE:.3f} oz",
            mass / OUNCE,
        ),
        (
            (dead <= e0) & (e0 <= lively),
            f"ball of e0 {{:.4f}}, allowed {dead:.3f} to {lively:.3f}",
            e0,
        ),
        (
            ~(before > windows.rate_before),
            f"bat turned at {{:.3f}} rad/s before the hit, allowed {windows.rate_before:.3f}",
            before,
        ),
        (
            unclear <= windows.recoil_u,
            f"recoil known to {{:.2%}}, allowed {windows.recoil_u:.2%}",
            unclear,
        ),
        (
            (results.restitution > 0) & (results.restitution <= 1),
            "restitution of {:.3f}, which no collision has (signs, units or calibration?)",
            results.restitution,
        ),
    )
    missed = np.array([~met for met, _, _ in criteria])
    reasons = np.full(len(results.speed), "", dtype=object)
    for shot in np.flatnonzero(missed.any(axis=0)):
        _, sentence, value = criteria[int(missed[:, shot].argmax())]
        reasons[shot] = sentence.format(value[shot])
    return Judgement(reasons=tuple(reasons))


def verdict(procedure: Procedure, value: float, valid_hits: int) -> Verdict:
    """Return PASS up to and including the limit, FAIL beyond, INVALID with too few hits."""
    if valid_hits < procedure.valid_hits:
        return Verdict.INVALID
    return Verdict.PASS if value <= procedure.limit else Verdict.FAIL
