"""The air of the hall: its density and a ball's drag coefficient, known within limits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Self

from annotated_types import Ge

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.relations.flight import Array, drag_rate
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, certified
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["HallAir", "HallAirSpec"]

Number = Annotated[float, Ge(0), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class HallAirSpec(Spec):
    """What was measured on the day."""

    kind: str
    title: str
    density: Annotated[float, Ge(0), Dimension("density")]
    density_u: Annotated[float, Ge(0), Dimension("density")]
    drag_coefficient: Number
    drag_coefficient_u: Number

    def ideal(self) -> Self:
        """Return no air at all."""
        return replace(self, density=0.0, density_u=0.0, drag_coefficient_u=0.0)

    def certificate(self) -> dict[str, Estimate]:
        """Return the constants of a ball's drag."""
        return {
            "density": certified(self.density, self.density_u),
            "drag_coefficient": certified(self.drag_coefficient, self.drag_coefficient_u),
        }


@dataclass(frozen=True, slots=True)
class HallAir(CalibratedInstrument[HallAirSpec]):
    """The air of one laboratory."""

    def drag(self, radius: float, mass: Array) -> Array:
        """Return κ of balls of `radius` [m] and `mass` [kg], shape (shot,) [1/m]."""
        return drag_rate(self.true["density"], self.true["drag_coefficient"], radius, mass)
