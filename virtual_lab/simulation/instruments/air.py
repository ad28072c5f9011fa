"""The air of the hall: its density and a ball's drag coefficient, known within limits."""

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
    """What was measured on the day."""

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
        """Return κ of balls of `radius` [m] and `mass` [kg], shape (shot,) [1/m]."""
        return drag_rate(self.true["density"], self.true["drag_coefficient"], radius, mass)


@dataclass(frozen=True, slots=True, kw_only=True)
class GravitySpec(CalibratedSpec):
    """What a survey says of the place."""

    kind: str
    title: str
    gravity: Annotated[float, Gt(0), Dimension("acceleration")]
    gravity_u: Annotated[float, Ge(0), Dimension("acceleration")]


@dataclass(frozen=True, slots=True)
class Gravity(CalibratedInstrument[GravitySpec]):
    """Gravity of one laboratory."""

    @property
    def acceleration(self) -> TrueConstant:
        """What it truly is [m/s²]."""
        return self.true["gravity"]
