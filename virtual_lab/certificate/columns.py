"""The columns of the table of shots, which has one row per shot.

``readings.csv``, the certificate's document, its page and PDF, and the dictionary of a result
folder read the columns from here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from virtual_lab.files.column_units import unit_of
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.reduction.gates import INBOUND, OUTBOUND, GateReadings
from virtual_lab.output.metrics import METRICS
from virtual_lab.units import name_with_unit

Getter = Callable[[Certification], Any]


class InPrint(NamedTuple):
    """A column on the page: heading, unit and decimals."""

    words: str
    unit: str = ""
    places: int = 4
    symbol: str = ""  # symbol before the words; "metric": the symbol of the procedure's metric
    # text for a missing value; None: a column without values is left out
    otherwise: str | None = None


class ShotColumn(NamedTuple):
    """A column. Its name ends in its unit; ``{}`` stands for the metric with its SI unit."""

    name: str
    meaning: str
    si: Getter  # function for the values in SI, (shot,); None if the rig lacks the instrument
    row: str = ""  # field of the certificate's `ShotRow`; "": only in the table
    printed: InPrint | None = None

    def values(self, certification: Certification) -> Any:
        """Return the values in the unit of the name, (shot,), or None."""
        values, size = self.si(certification), unit_of(self.name).si
        return values if values is None or size == 1 else values / size


def _shots(name: str) -> Getter:
    return lambda certification: getattr(certification.shots, name)


def _reading(which: str, name: str) -> Getter:
    return lambda certification: getattr(getattr(certification.readings, which), name, None)


def _by_encoder(which: str, name: str) -> Getter:
    """Return a function that returns the values `name`, or None if no encoder measured them."""
    return lambda c: None if getattr(c.readings, which) is None else getattr(c.shots, name)


def _gate_time(direction: int, first: int, last: int) -> Getter:
    def read_time(certification: Certification) -> Any:
        flights = certification.readings.flights
        if not isinstance(flights, GateReadings):
            return None
        times = flights.passages.times[:, direction]
        return times[:, last] - times[:, first]

    return read_time


def _speed_u(name: str) -> Getter:
    def read_u(certification: Certification) -> Any:
        u = getattr(certification.readings.flights.raw_u, name)
        return u if np.isfinite(u).any() else None

    return read_u


def _video(of: Callable[[Any], Any]) -> Getter:
    return lambda certification: (
        None if certification.camera is None else np.asarray(of(certification.camera))
    )


def _video_u(name: str) -> Getter:
    return _video(lambda camera: camera.u[name])


_C = ShotColumn
SHOTS = (
    _C("shot", "number of the shot", lambda c: np.arange(len(c.shots.speed)), "shot"),
    _C("ball", "number of the ball", lambda c: c.readings.ball, "ball"),
    _C("ball_mass_oz", "mass of the ball", _shots("ball_mass")),
    _C(
        "impact_position_in",
        "impact position set with the rule, from the barrel tip",
        lambda c: c.readings.position,
        "impact_position_in",
        InPrint("Position", "in", 2),
    ),
    _C(
        "gate_time_in_us",
        "time from the first to the last gate, inbound",
        _gate_time(INBOUND, 0, -1),
    ),
    _C(
        "gate_time_out_us",
        "time from the last to the first gate, on the way back",
        _gate_time(OUTBOUND, -1, 0),
    ),
    _C(
        "speed_mph",
        "speed of the ball at the bat, before contact",
        _shots("speed"),
        "speed_mph",
        InPrint("Speed", "mph", 2, otherwise="not measured"),
    ),
    _C("rebound_speed_mph", "speed of the ball at the bat, after contact", _shots("rebound_speed")),
    _C(
        "speed_u_mph",
        "standard uncertainty of the speed from the scatter of the readings alone",
        _speed_u("speed_in"),
    ),
    _C(
        "rebound_speed_u_mph",
        "standard uncertainty of the rebound speed from the scatter of the readings alone",
        _speed_u("speed_out"),
    ),
    _C(
        "encoder_counts_per_s",
        "recoil rate of the bat from the encoder",
        _reading("recoil", "rate"),
    ),
    _C(
        "encoder_u_counts_per_s",
        "standard uncertainty of the recoil rate by the fit",
        _reading("recoil", "rate_u"),
    ),
    _C(
        "encoder_residual_counts",
        "rms deviation of the encoder record from its fit",
        _reading("recoil", "residual"),
    ),
    _C(
        "swing_counts_per_s",
        "swing rate of the bat from the swing encoder",
        _reading("swing", "rate"),
    ),
    _C(
        "swing_u_counts_per_s",
        "standard uncertainty of the swing rate by the fit",
        _reading("swing", "rate_u"),
    ),
    _C(
        "swing_residual_counts",
        "rms deviation of the swing record from its fit",
        _reading("swing", "residual"),
    ),
    _C(
        "recoil_rad_per_s",
        "recoil rate of the bat about its pivot at the end of contact",
        _by_encoder("recoil", "recoil_rate"),
        "recoil_rad_per_s",
        InPrint("Recoil", "rad/s", 3),
    ),
    _C(
        "bat_speed_mph",
        "speed of the bat at the impact position",
        _by_encoder("swing", "bat_speed"),
        "bat_speed_mph",
        InPrint("Bat", "mph", 2),
    ),
    _C(
        "video_speed_mph",
        "speed of the ball before contact from video",
        _video(lambda c: c.filmed.flights.speed_in),
    ),
    _C("video_speed_u_mph", "standard uncertainty of this speed", _video_u("speed_in")),
    _C(
        "video_rebound_speed_mph",
        "speed of the ball after contact from video",
        _video(lambda c: c.filmed.flights.speed_out),
    ),
    _C("video_rebound_speed_u_mph", "standard uncertainty of this speed", _video_u("speed_out")),
    _C("video_impact_position_in", "impact position from video", _video(lambda c: c.filmed.place)),
    _C("video_impact_position_u_in", "standard uncertainty of this position", _video_u("place")),
    _C(
        "video_angle_deg",
        "angle of the ball's approach from video",
        _video(lambda c: c.filmed.angle_in),
    ),
    _C("video_angle_u_deg", "standard uncertainty of this angle", _video_u("angle")),
    _C(
        "video_collision_efficiency",
        "collision efficiency e_A from video",
        _video(lambda c: c.shots.rebound_efficiency),
    ),
    _C("video_collision_efficiency_u", "standard uncertainty of this e_A", _video_u("efficiency")),
    _C(
        "collision_efficiency",
        "collision efficiency e_A from the instrument that the procedure names",
        _shots("collision_efficiency"),
    ),
    _C(
        "recoil_efficiency",
        "collision efficiency e_A from the recoil of the bat",
        _by_encoder("recoil", "recoil_efficiency"),
        "recoil_efficiency",
        InPrint("by recoil", symbol="e_A"),
    ),
    _C(
        "rebound_efficiency",
        "collision efficiency e_A from the rebound of the ball",
        _shots("rebound_efficiency"),
        "rebound_efficiency",
        InPrint("by rebound", symbol="e_A", otherwise="not measured"),
    ),
    _C(
        "recoil_factor",
        "recoil factor r of the support that the procedure names",
        _shots("recoil_factor"),
    ),
    _C("restitution", "coefficient of restitution e of ball and bat", _shots("restitution")),
    _C(
        "ball_restitution",
        "coefficient of restitution e0 of the lot against a wall at this speed",
        _shots("ball_restitution"),
    ),
    _C("bat_performance_factor", "bat performance factor e / e0", _shots("bat_performance_factor")),
    _C(
        "metric_{}",
        "metric of the hit [SI]",
        lambda c: c.shot_metric,
        "value",
        InPrint("", symbol="metric", otherwise="–"),
    ),
    _C("weight", "weight of the hit in the result", lambda c: c.hit_weights.weights),
    _C("used", "whether the hit counts in the result", lambda c: c.hit_weights.used, "used"),
    _C("valid", "whether the hit is valid", lambda c: c.judgement.valid),
    _C(
        "reason",
        "reason why the hit is not valid; empty: the hit is valid",
        lambda c: list(c.judgement.reasons),
        "reason",
    ),
)


def shot_columns(metric: str) -> dict[str, ShotColumn]:
    """Return all columns that ``readings.csv`` can have, keyed by name, in the order of the file.

    `metric` is the name of the procedure's metric, which is part of some column names. Raises
    `KeyError` for an unknown metric.
    """
    metric_name = name_with_unit(metric, METRICS[metric].si_unit)
    return {each.name.format(metric_name): each for each in SHOTS}
