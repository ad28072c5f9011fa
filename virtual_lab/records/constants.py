"""The calibration constants: description, printed unit and plausible range."""

from __future__ import annotations

import re
from typing import NamedTuple

from virtual_lab.errors import InputError
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DIMENSIONS

GREATEST = 1e18  # largest value of any constant [SI], so that products stay finite

PER_SI = {  # printed unit: number of them in one SI unit
    "": 1.0,
    "g": 1e3,
    "g m": 1e3,
    "g m²": 1e3,
    "kg/m³": 1.0,
    "K": 1.0,
    "Pa": 1.0,
    "mm": 1e3,
    "mm²": 1e6,
    "mm/s²": 1e3,
    "mrad": 1e3,
    "ms": 1e3,
    "ppm": 1e6,
    "px": 1.0,
    "s/m": 1.0,
}


class Constant(NamedTuple):
    """Description, unit and plausible range of a constant."""

    dimension: str
    meaning: str  # meaning of the value, printed in the form for another laboratory
    words: str  # name of the constant in a budget
    printed: str  # unit in a budget, a key of PER_SI
    low: float = 0.0  # limits of a plausible value [SI]; u is at most the width of this range
    high: float = GREATEST


CONSTANTS = {  # key: "instrument.constant"
    "scale.zero": Constant("mass", "reading of the empty scale", "scale, zero", "g", -1, 1),
    "scale.span": Constant(
        "number", "reading minus zero, divided by the true mass", "scale, span", "ppm", 0.5, 2
    ),
    "scale.resolution": Constant("mass", "smallest step of the scale", "scale, smallest step", "g"),
    "rule.offset": Constant("length", "reading minus true length", "rule, offset", "mm", -1, 1),
    "rule.resolution": Constant("length", "smallest step of the rule", "rule, smallest step", "mm"),
    "stand.offset": Constant(
        "length", "reading minus true balance point", "balance stand, offset", "mm", -1, 1
    ),
    "stand.resolution": Constant(
        "length", "smallest step of the balance stand", "balance stand, smallest step", "mm"
    ),
    "pendulum.clock": Constant(
        "number", "recorded time divided by true time", "pendulum, clock rate", "ppm", 0.5, 2
    ),
    "pendulum.amplitude_offset": Constant(
        "angle", "reading minus true amplitude", "pendulum, amplitude reading", "mrad", -1, 1
    ),
    "pendulum.pivot_from_knob": Constant(
        "length",
        "distance from the end of the knob to the axis of the pendulum",
        "pendulum, axis to knob",
        "mm",
        -1,
        2,
    ),
    "pendulum.clamp_inertia": Constant(
        "inertia",
        "moment of inertia of the clamp alone about the axis of the pendulum",
        "pendulum, inertia of the clamp",
        "g m²",
        0,
        10,
    ),
    "pendulum.clamp_moment": Constant(
        "moment",
        "mass of the clamp times the distance of its center of mass below the axis",
        "pendulum, balance of the clamp",
        "g m",
        -10,
        10,
    ),
    "climate.temperature": Constant(
        "temperature difference", "reading minus true temperature", "thermometer", "K", -20, 20
    ),
    "climate.temperature_resolution": Constant(
        "temperature difference",
        "smallest step of the thermometer",
        "thermometer, smallest step",
        "K",
        0,
        20,
    ),
    "climate.humidity": Constant(
        "number", "reading minus true relative humidity", "hygrometer", "", -0.5, 0.5
    ),
    "climate.humidity_resolution": Constant(
        "number", "smallest step of the hygrometer", "hygrometer, smallest step", "", 0, 0.5
    ),
    "climate.pressure": Constant(
        "pressure", "reading minus true pressure", "barometer", "Pa", -1e4, 1e4
    ),
    "climate.pressure_resolution": Constant(
        "pressure", "smallest step of the barometer", "barometer, smallest step", "Pa", 0, 1e4
    ),
    "gates.distance": Constant(
        "length",
        "distance of the gate from the ball's center at contact; gate 0 is the farthest",
        "light gates, distance of gate {number}",
        "mm",
        0,
        100,
    ),
    "gates.height": Constant(
        "length",
        "height of the gate above the line of fire minus its nominal height",
        "light gates, height of gate {number}",
        "mm",
        -10,
        10,
    ),
    "gates.lowest": Constant(
        "length",
        "height of the lowest beam above the line of fire",
        "light boards, lowest beam",
        "mm",
        -10,
        10,
    ),
    "gates.pitch": Constant(
        "length",
        "distance between neighboring beams",
        "light boards, pitch of the beams",
        "mm",
        0.0001,
        1,
    ),
    "gates.thickness": Constant(
        "length",
        "thickness of a beam along the flight",
        "light gates, thickness of a beam",
        "mm",
        0,
        0.1,
    ),
    "gates.clock": Constant(
        "number", "recorded time divided by true time", "light gates, clock rate", "ppm", 0.5, 2
    ),
    "hall.gravity": Constant(
        "acceleration", "gravity in the hall", "Hall: gravity", "mm/s²", 9, 11
    ),
    "air.density": Constant(
        "density", "density of the air in the hall", "air density", "kg/m³", 0, 10
    ),
    "air.drag_coefficient": Constant(
        "number", "drag coefficient of the ball", "drag coefficient of the ball", "", 0, 5
    ),
    "pivot.from_knob": Constant(
        "length",
        "distance from the end of the knob to the axis of the bat's rotation",
        "pivot to knob",
        "mm",
        -1,
        2,
    ),
    "pivot.height": Constant(
        "length",
        "height of the bat's axis above the line of fire",
        "bat above the line of fire",
        "mm",
        -10,
        10,
    ),
    "cannon.along": Constant(
        "length",
        "mean impact position minus the set impact position",
        "cannon, aim along the bat",
        "mm",
        -1,
        1,
    ),
    "encoder.scale": Constant(
        "number", "recorded angle divided by true angle", "encoder, scale", "ppm", 0.5, 2
    ),
    "encoder.counts_per_turn": Constant(
        "number", "counts per turn of the encoder", "encoder, counts per turn", "", 1, 1e9
    ),
    "swing.scale": Constant(
        "number", "recorded angle divided by true angle", "swing encoder, scale", "ppm", 0.5, 2
    ),
    "swing.counts_per_turn": Constant(
        "number", "counts per turn of the encoder", "swing encoder, counts per turn", "", 1, 1e9
    ),
    "control.restitution_ratio": Constant(
        "number",
        "e of the control bat with this lot divided by its reference value",
        "Control bat with this lot of balls",
        "",
        0.1,
        10,
    ),
    "ball.radius": Constant("length", "radius of the ball", "Ball radius", "mm", 0.005, 0.2),
    "ball.restitution_slope": Constant(
        "slope of speed",
        "slope of the ball's e0 against its speed",
        "Decrease of ball restitution with speed",
        "s/m",
        -1,
        1,
    ),
}


def constant_of(key: str) -> Constant | None:
    """Return the description of a calibration constant, or None if it is unknown.

    `key` has the form ``stage.instrument.constant``. The stage is not checked. A number at the end,
    as in ``distance_0`` and ``distance_1``, is ignored, because it only distinguishes constants of
    one kind.
    """
    return CONSTANTS.get(re.sub(r"_\d+$", "", ".".join(key.split(".")[-2:])))


def require_plausible(key: str, constant: Estimate, where: str) -> None:
    """Raise `InputError` if a constant is outside its plausible range, or if its u is too large.

    u must not be larger than the width of the range. An uncertainty budget shifts the constant by
    u, and a larger u would shift it far outside the range. The model is meaningless there. A
    constant of an unknown kind may have any value between -1e18 and 1e18.

    `key` is the name of the constant. `where` is the name of the file, for the message.
    """
    of = constant_of(key)
    low, high = (of.low, of.high) if of else (-GREATEST, GREATEST)
    for name, value, least, most in (
        ("value", constant.value, low, high),
        ("u", constant.u, 0.0, high - low),
    ):
        if not least <= value <= most:
            unit = next(iter(DIMENSIONS[of.dimension])) if of else ""
            allowed = f"allowed: {least:g} to {most:g} {unit}".removesuffix(" 1").strip()
            raise InputError(where, f"calibration.{key}.{name}", f"{value:.12g}", allowed)
