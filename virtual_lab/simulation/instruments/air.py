"""Air and gravity of the hall: density of the air, drag coefficient of a ball, gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension
from virtual_lab.relations.flight import drag_rate
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    TrueConstant,
)
from virtual_lab.units import Array

Number = Annotated[float, Ge(0), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class HallAirSpec(CalibratedSpec):
    """Data sheet of the air of the hall, as measured on the day."""

    other_errors: ClassVar[tuple[str, ...]] = ("density",)

    kind: str
    title: str
    density: Annotated[float, Ge(0), Dimension("density")]
    density_u: Annotated[float, Ge(0), Dimension("density")]
    drag_coefficient: Number
    drag_coefficient_u: Number


@dataclass(frozen=True, slots=True)
class HallAir(CalibratedInstrument[HallAirSpec]):
    """The air of one laboratory."""

    def drag(self, radius: TrueConstant, mass: Array) -> Array:
        """Return the drag rate κ of balls of `radius` [m] and `mass` [kg], (shot,) [1/m]."""
        return drag_rate(self.true["density"], self.true["drag_coefficient"], radius, mass)


@dataclass(frozen=True, slots=True, kw_only=True)
class GravitySpec(CalibratedSpec):
    """Data sheet of the gravity at the laboratory, from a survey."""

    kind: str
    title: str
    gravity: Annotated[float, Gt(0), Dimension("acceleration")]
    gravity_u: Annotated[float, Ge(0), Dimension("acceleration")]


@dataclass(frozen=True, slots=True)
class Gravity(CalibratedInstrument[GravitySpec]):
    """Gravity of one laboratory."""

    @property
    def acceleration(self) -> TrueConstant:
        """True acceleration [m/s²]."""
        return self.true["gravity"]
