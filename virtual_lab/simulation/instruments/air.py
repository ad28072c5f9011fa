"""The air of the hall: its density and a ball's drag coefficient, known within limits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Self

from annotated_types import Ge

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.relations.flight import Array, drag_rate
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["Air", "AirSpec"]

Number = Annotated[float, Ge(0), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class AirSpec(Spec):
    """What the laboratory reckons with."""

    kind: str
    title: str
    density: Annotated[float, Ge(0), Dimension("density")]
    density_u: Annotated[float, Ge(0), Dimension("density")]
    drag_coefficient: Number
    drag_coefficient_u: Number

    def ideal(self) -> Self:
        """Return no air at all."""
        return replace(self, density=0.0, density_u=0.0, drag_coefficient_u=0.0)


@dataclass(frozen=True, slots=True)
class Air:
    """The air of one laboratory, drawn once."""

    spec: AirSpec
    density: float
    drag_coefficient: float

    @classmethod
    def commission(cls, spec: AirSpec, draws: Draws, name: str) -> Self:
        density, coefficient = draws.normal(f"{name}.errors", (2,))
        return cls(
            spec,
            spec.density + spec.density_u * float(density),
            spec.drag_coefficient + spec.drag_coefficient_u * float(coefficient),
        )

    def calibration(self) -> dict[str, Estimate]:
        """Return what the laboratory reckons with."""
        spec = self.spec
        return {
            "density": Estimate(value=spec.density, u=spec.density_u),
            "drag_coefficient": Estimate(value=spec.drag_coefficient, u=spec.drag_coefficient_u),
        }

    def errors(self) -> dict[str, float]:
        """Return the true constants, to be sealed."""
        return {"density": self.density, "drag_coefficient": self.drag_coefficient}

    def drag(self, radius: float, mass: Array) -> Array:
        """Return κ of balls of `radius` [m] and `mass` [kg], shape (shot,) [1/m]."""
        return drag_rate(self.density, self.drag_coefficient, radius, mass)
