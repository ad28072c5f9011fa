"""What holds a bat on a machine: where its axis is, and how high the bat lies in it."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Annotated, TypeVar

from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    Freedom,
    TrueConstant,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisSpec(CalibratedSpec):
    """An axis as it was set up and surveyed, on a bat that the cannon is lined up on."""

    nominal_from_knob: Annotated[float, Gt(0), Dimension("length")]  # where the axis should be
    from_knob: Annotated[float, Gt(0), Dimension("length")]
    from_knob_u: Annotated[float, Ge(0), Dimension("length")]
    from_knob_dof: Freedom = inf


@dataclass(frozen=True, slots=True, kw_only=True)
class HolderSpec(AxisSpec):
    """And a bat that lies higher or lower than the cannon fires."""

    height: Annotated[float, Dimension("length")]  # of the bat above the line of fire
    height_u: Annotated[float, Ge(0), Dimension("length")]
    height_dof: Freedom = inf


S = TypeVar("S", bound=AxisSpec)


@dataclass(frozen=True, slots=True)
class Holder(CalibratedInstrument[S]):
    """The holder of one laboratory."""

    @property
    def from_knob(self) -> TrueConstant:
        """The true distance of the axis from the knob [m]."""
        return self.true["from_knob"]

    @property
    def height(self) -> TrueConstant:
        """The true height of the bat above the line of fire [m]."""
        return self.true.get("height", 0.0)
