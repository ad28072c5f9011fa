"""Nominal quantities from data sheets, drawings and rule books, as frozen SI floats.

Axes and signs of the whole project: ``z`` is the distance along the bat from the barrel tip (0) to
the knob (the length). Speeds are positive in their usual directions: ball toward the bat, bat
toward the ball, batted ball away from the bat. A field annotated with a `Dimension` has the form
``{ value, unit, source, verified }`` in its file and is an SI float here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, cast

import numpy as np
from annotated_types import Ge, Gt, Le, Len, Lt
from numpy.typing import ArrayLike, NDArray

from virtual_lab.errors import nearest
from virtual_lab.units import DIMENSIONS, from_si, to_si

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

QUANTITY_KEYS = ("value", "unit", "source", "verified", "note")
JOINERS = str.maketrans("", "", "\u200c\u200d")  # characters that shape their neighbors
LARGEST = 1e18  # largest value of any quantity [SI], so that products stay finite


class ReadEntry(ABC):
    """Annotation of a field whose file entry is converted or checked by `read`."""

    __slots__ = ()

    @abstractmethod
    def read(self, raw: object) -> object:
        """Return the value of the entry. Raises `ValueError` if the entry is not allowed."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        from pydantic_core import core_schema

        return core_schema.no_info_before_validator_function(self.read, handler(source))


@dataclass(frozen=True, slots=True)
class Dimension(ReadEntry):
    """Annotation of a field whose file entry is a quantity of this dimension, converted to SI.

    A value that is not between `low` and `high` is rejected, because usually its unit is wrong.
    """

    name: str
    low: float = -LARGEST
    high: float = LARGEST

    def read(self, raw: object) -> object:
        """Return the SI value of an entry of a file, or the tuple of its SI values.

        Raises `ValueError` for a wrong form, an unknown unit, and a value outside the range.
        """
        if not isinstance(raw, Mapping):
            raise ValueError("expected a table { value, unit, source, verified }")
        if unknown := sorted(set(raw) - set(QUANTITY_KEYS)):
            hint = nearest(unknown[0], QUANTITY_KEYS)
            raise ValueError(
                f"unknown key {unknown[0]!r}, {hint}allowed: {', '.join(QUANTITY_KEYS)}"
            )
        for key in ("value", "unit", "source", "verified"):
            if key not in raw:
                raise ValueError(f"lacks {key!r} (value, unit, source and verified are required)")
        units = DIMENSIONS[self.name]
        unit = raw["unit"]
        if not isinstance(unit, str) or unit not in units:
            hint = nearest(unit, units)
            raise ValueError(
                f"unit {unit!r} is not a unit of {self.name}, {hint}allowed: {', '.join(units)}"
            )
        if not isinstance(raw["verified"], bool):
            raise ValueError("verified must be true or false")
        if not (isinstance(raw["source"], str) and raw["source"]):
            raise ValueError("source must name the origin of the number")
        value = raw["value"]
        if isinstance(value, list):
            return tuple(self._number(item, unit) for item in value)
        return self._number(value, unit)

    def _number(self, value: object, unit: str) -> float:
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not abs(value) < 1e300  # an integer in TOML can exceed every float
        ):
            quotes = ", without quotes" if isinstance(value, str) else ""
            raise ValueError(f"value must be a finite number{quotes}")
        number = to_si(float(value), unit, self.name)
        if self.low <= number <= self.high:
            return number
        low, high = (from_si(end, unit, self.name) for end in (self.low, self.high))
        meant = [
            repr(other)
            for other in DIMENSIONS[self.name]
            if other not in ("um", "ppm")
            and self.low <= to_si(float(value), other, self.name) <= self.high
        ]
        hint = f" (is the unit {' or '.join(meant)}?)" if meant else ""
        allowed = f"{low:g} to {high:g} {unit}".removesuffix(" 1")
        raise ValueError(f"{value:g} is outside the range {allowed}{hint}")


def is_line(text: str, most: int) -> bool:
    """Return whether a string is one printable line of at most `most` characters.

    An empty string is such a line. The joiners U+200C and U+200D, needed in Persian, in Indian
    scripts and in emoji, are allowed and count as characters.
    """
    return len(text) <= most and text.translate(JOINERS).isprintable()


@dataclass(frozen=True, slots=True)
class Words(ReadEntry):
    """Annotation of a field whose file entry is one printable line."""

    most: int

    def read(self, raw: object) -> object:
        """Return the file entry. Raises `ValueError` if it is not one printable line."""
        if isinstance(raw, str) and not is_line(raw, self.most):
            raise ValueError(f"must be one line of up to {self.most} printable characters")
        return raw


@dataclass(frozen=True, slots=True)
class Exact:
    """Annotation of a field whose file entry has exactly its type, such as `true` instead of 1."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return cast("CoreSchema", {**handler(source), "strict": True})


class Spec:
    """Base of every nominal dataclass. Unknown keys in its file are errors."""

    __slots__ = ()
    __pydantic_config__ = {"extra": "forbid", "allow_inf_nan": False}  # noqa: RUF012 pydantic's own form


Name = Annotated[str, Words(100)]
Title = Annotated[str, Words(200)]
Real = Annotated[float, Exact()]
Whole = Annotated[int, Exact()]
YesNo = Annotated[bool, Exact()]
SHORTEST, LONGEST = 0.2, 1.5  # limits of the length of a bat [m]
PositiveLength = Annotated[float, Gt(0), Dimension("length")]
Sport = Literal["baseball", "softball"]  # sport of a bat, ball or procedure
CHECK_STANDARD: Final = "check standard"
BatSport = Literal["baseball", "softball", "check standard"]  # a check standard is not a bat
# rules exempt bats by these words
Construction = Literal["one-piece wood", "composite wood", "aluminum", "composite"]
PositiveNumber = Annotated[float, Gt(0), Dimension("number")]
NonNegative = Annotated[float, Ge(0), Dimension("number")]
# relative standard deviation; even five of them below the mean, a value is still positive
Spread = Annotated[float, Dimension("number", 0, 0.2)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile(Spec):
    """Profile of a bat: z, outer diameter and wall thickness [m] at stations; no wall if solid."""

    z: Annotated[tuple[float, ...], Len(2, 100), Dimension("length", 0, LONGEST)]
    outer_diameter: Annotated[tuple[float, ...], Dimension("length", 1e-3, 0.2)]
    wall: Annotated[tuple[float, ...] | None, Dimension("length", 2e-4, 0.1)] = None

    def __post_init__(self) -> None:
        if self.z[0] != 0:
            raise ValueError(f"z must start at 0, the barrel tip, not at {self.z[0]:g} m")
        if self.z[-1] < SHORTEST:
            raise ValueError(
                f"z ends at {self.z[-1]:g} m, and no bat is shorter than {SHORTEST:g} m (is the "
                "unit right?)"
            )
        for left, right in zip(self.z, self.z[1:], strict=False):
            if right <= left:
                raise ValueError(
                    f"z must increase from station to station: {right:g} m follows {left:g} m"
                )
        for name in ("outer_diameter", "wall"):
            values = getattr(self, name)
            if values is None:
                continue
            if len(values) != len(self.z):
                raise ValueError(f"{name} has {len(values)} stations, but z has {len(self.z)}")
        if self.wall is not None:
            for diameter, wall in zip(self.outer_diameter, self.wall, strict=True):
                if 2 * wall > diameter:
                    raise ValueError(
                        f"wall of {wall:g} m does not fit in a diameter of {diameter:g} m"
                    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Material(Spec):
    """Material of the whole bat. The shear coefficient is 0.9 for a solid bat, 0.5 for a tube.

    With `density_tilt` t the density varies linearly along the bat, from (1 + t) times the mean at
    the tip to (1 - t) times the mean at the knob. The tilt of a drawing is 0, that of an individual
    bat is not.
    """

    density: Annotated[float, Dimension("density", 100, 3e4)]
    youngs_modulus: Annotated[float, Dimension("modulus", 1e8, 1e13)]
    shear_modulus: Annotated[float, Dimension("modulus", 1e7, 1e13)]
    shear_coefficient: Annotated[float, Gt(0), Le(1), Dimension("number")]
    density_tilt: Annotated[float, Gt(-1), Lt(1), Dimension("number")] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Lump(Spec):
    """A knob, end cap or added weight: mass [kg] and rotary inertia [kg m^2] at z [m]."""

    name: Name
    z: Annotated[float, Dimension("length", 0, LONGEST)]
    mass: Annotated[float, Gt(0), Dimension("mass", 0, 5)]
    inertia: Annotated[float, Dimension("inertia", 0, 1)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HoopMode(Spec):
    """The hoop mode (n = 2 shell mode) of a hollow barrel, the vibration of its cross section.

    Its modal coordinate has no net momentum.
    """

    frequency: Annotated[float, Dimension("frequency", 10, 1e5)]
    modal_mass: Annotated[float, Dimension("mass", 1e-4, 5)]


@dataclass(frozen=True, slots=True, kw_only=True)
class BatBody(Spec):
    """Geometry and material of a bat, from which the physical model is built."""

    profile: Profile
    material: Material
    damping_ratio: Annotated[float, Dimension("number", 0, 0.2)]
    lumps: tuple[Lump, ...] = ()
    hoop: HoopMode | None = None

    def __post_init__(self) -> None:
        for lump in self.lumps:
            if lump.z > self.length:
                raise ValueError(
                    f"lump {lump.name!r} at {lump.z:g} m lies beyond the knob at {self.length:g} m"
                )

    @property
    def length(self) -> float:
        """Length of the bat [m]."""
        return self.profile.z[-1]

    def with_wall(self, factor: float) -> BatBody:
        """Return the bat with all walls multiplied by `factor`. A solid bat is returned unchanged.

        The hoop mode changes with the wall thickness t as for a thin ring that bends without
        stretching (Hoppe 1871; Rayleigh, The Theory of Sound, § 233): f = 6/√5 √(E/12ρ) t / 2πR².
        Frequency and modal mass are therefore proportional to t, and the stiffness to t³. The mean
        radius R is treated as constant, which causes an error of 1 % of f if t changes by a tenth.
        The share of the stiffness that comes from stretching at the ends of the barrel is also
        treated as constant.
        """
        if self.profile.wall is None:
            return self
        wall = tuple(factor * thickness for thickness in self.profile.wall)
        hoop = self.hoop and replace(
            self.hoop,
            frequency=factor * self.hoop.frequency,
            modal_mass=factor * self.hoop.modal_mass,
        )
        return replace(self, profile=replace(self.profile, wall=wall), hoop=hoop)


@dataclass(frozen=True, slots=True, kw_only=True)
class BatSpread(Spec):
    """Variation of individual bats about the drawing, as relative standard deviations."""

    density: Spread
    youngs_modulus: Spread
    density_tilt: Spread  # tilt of the density between tip and knob


NO_SPREAD = BatSpread(density=0.0, youngs_modulus=0.0, density_tilt=0.0)  # spread of one specimen


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedBat(Spec):
    """Published properties of the bat, for comparison with those computed from the body."""

    length: PositiveLength
    mass: Annotated[float, Gt(0), Dimension("mass")]
    z_cm: Annotated[float | None, Gt(0), Dimension("length")] = None
    inertia_cm: Annotated[float | None, Gt(0), Dimension("inertia")] = None
    # moment of inertia about the point 1 in from the knob
    inertia_knob: Annotated[float | None, Gt(0), Dimension("inertia")] = None
    # moment of inertia about the axis 6 in from the knob
    inertia_pivot: Annotated[float | None, Gt(0), Dimension("inertia")] = None
    bending_frequencies: Annotated[tuple[float, ...], Dimension("frequency")] = ()
    barrel_nodes: Annotated[tuple[float, ...], Dimension("length")] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class BatSpec(Spec):
    """A nominal bat."""

    name: Name
    title: Title
    body: BatBody
    spread: BatSpread
    sport: BatSport | None = None  # None: not known
    construction: Construction | None = None  # None: not known
    published: PublishedBat | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RestitutionLine(Spec):
    """Ball-wall restitution e0(v) = value + slope (v - speed), never below `floor`."""

    speed: Annotated[float, Gt(0), Dimension("speed")]
    value: Annotated[float, Dimension("number", 0.05, 1)]
    slope: Annotated[float, Le(0), Dimension("slope of speed")]
    floor: Annotated[float, Dimension("number", 0.05, 1)]
    # standard deviations between lots, which the wall test measures
    value_u: Annotated[float, Ge(0), Le(0.1), Dimension("number")] = 0.0
    slope_u: Annotated[float, Ge(0), Dimension("slope of speed")] = 0.0

    def at(self, speed: ArrayLike) -> NDArray[np.float64]:
        """Return e0 of the nominal ball at `speed` [m/s], in the shape of `speed`."""
        return np.maximum(self.value + self.slope * (np.asarray(speed) - self.speed), self.floor)


@dataclass(frozen=True, slots=True, kw_only=True)
class BallSpread(Spec):
    """Standard deviations between the balls of a lot, and between the hits of one ball."""

    mass: Annotated[float, Dimension("mass", 0, 0.02)]
    restitution: Spread
    hit_restitution: Spread  # between hits at the wall, and at the bat unless the next is stated
    bat_hit_restitution: Spread | None = None  # between hits at the bat


@dataclass(frozen=True, slots=True, kw_only=True)
class BallAgeing(Spec):
    """Aging of a ball: a hit at v reduces e0 by loss (v / speed)²; part of this loss recovers."""

    speed: Annotated[float, Gt(0), Dimension("speed")]
    loss: Annotated[float, Ge(0), Lt(1), Dimension("number")]
    recovering: Annotated[float, Ge(0), Le(1), Dimension("number")]  # share that recovers at rest
    recovery_time: Annotated[float, Gt(0), Dimension("time")]  # time constant of the recovery


@dataclass(frozen=True, slots=True, kw_only=True)
class BallHumidity(Spec):
    """Effect of the humidity in which balls are kept on their e0.

    At the relative humidity `standard`, e0 has the value of the sheet. `slope` is the change of e0
    from 0 to 100 % relative humidity, divided by the e0 of the sheet.
    """

    standard: Annotated[float, Ge(0), Le(1), Dimension("number")]
    slope: Annotated[float, Ge(-1), Le(1), Dimension("number")]

    def factor(self, humidity: ArrayLike) -> NDArray[np.float64]:
        """Return e0 at a relative humidity, from 0 to 1, divided by e0 at `standard`."""
        return 1 + self.slope * (np.asarray(humidity) - self.standard)


@dataclass(frozen=True, slots=True, kw_only=True)
class BallSpec(Spec):
    """A nominal ball. The force of loading is F = stiffness u^exponent."""

    name: Name
    title: Title
    mass: Annotated[float, Dimension("mass", 0.01, 1)]
    radius: Annotated[float, Dimension("length", 5e-3, 0.2)]
    stiffness: Annotated[float, Dimension("stiffness", 1)]
    exponent: Annotated[float, Dimension("number", 1, 5)]
    restitution: RestitutionLine
    spread: BallSpread
    # standard deviations between lots: of the radius, and of the stiffness, relative to its mean
    radius_u: Annotated[float, Ge(0), Dimension("length")] = 0.0
    stiffness_spread: Spread = 0.0
    sport: Sport | None = None  # None: not known
    ageing: BallAgeing | None = None
    humidity: BallHumidity | None = None  # None: e0 does not depend on humidity

    def __post_init__(self) -> None:
        force = np.ravel(self.stiffness * 0.01**self.exponent)  # one value, or one per lot
        if (wrong := force[(force < 100) | (force > 1e7)]).size:
            raise ValueError(
                f"the force of a ball compressed by 1 cm is {wrong[0]:g} N; allowed: 100 to 1e7 N"
            )
