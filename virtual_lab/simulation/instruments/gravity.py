"""Gravity in the hall: one constant for whatever falls or swings there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Self

from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, certified
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["Gravity", "GravitySpec"]


@dataclass(frozen=True, slots=True, kw_only=True)
class GravitySpec(Spec):
    """What a survey says of the place."""

    kind: str
    title: str
    gravity: Annotated[float, Gt(0), Dimension("acceleration")]
    gravity_u: Annotated[float, Ge(0), Dimension("acceleration")]

    def ideal(self) -> Self:
        """Return the place whose gravity is known exactly."""
        return replace(self, gravity_u=0.0)

    def certificate(self) -> dict[str, Estimate]:
        """Return the acceleration."""
        return {"gravity": certified(self.gravity, self.gravity_u)}


@dataclass(frozen=True, slots=True)
class Gravity(CalibratedInstrument[GravitySpec]):
    """Gravity of one laboratory."""

    @property
    def acceleration(self) -> float:
        """What it truly is [m/s²]."""
        return self.true["gravity"]
