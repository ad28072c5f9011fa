"""What holds a bat on a machine: where its axis is, and how high the bat lies in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Annotated, Self

from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, Freedom, certified
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["Holder", "HolderSpec"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HolderSpec(Spec):
    """As it was set up and surveyed."""

    nominal_from_knob: Annotated[float, Gt(0), Dimension("length")]  # where the axis should be
    from_knob: Annotated[float, Gt(0), Dimension("length")]
    from_knob_u: Annotated[float, Ge(0), Dimension("length")]
    from_knob_dof: Freedom = inf
    height: Annotated[float, Dimension("length")]  # of the bat above the line of fire
    height_u: Annotated[float, Ge(0), Dimension("length")]
    height_dof: Freedom = inf

    def ideal(self) -> Self:
        """Return the holder that holds the bat exactly where it was surveyed."""
        return replace(self, from_knob_u=0.0, height_u=0.0)

    def certificate(self) -> dict[str, Estimate]:
        """Return what was surveyed: the axis from the knob, the bat above the line of fire."""
        return {
            "from_knob": certified(self.from_knob, self.from_knob_u, self.from_knob_dof),
            "height": certified(self.height, self.height_u, self.height_dof),
        }


@dataclass(frozen=True, slots=True)
class Holder(CalibratedInstrument[HolderSpec]):
    """The holder of one laboratory."""

    @property
    def from_knob(self) -> float:
        """The true distance of the axis from the knob [m]."""
        return self.true["from_knob"]

    @property
    def height(self) -> float:
        """The true height of the bat above the line of fire [m]."""
        return self.true["height"]
