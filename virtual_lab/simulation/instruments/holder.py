"""The holder of a bat on a machine: position of its pivot, and height of the bat."""

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
    """A pivot as installed and surveyed. The cannon is aligned with the bat, at height 0."""

    nominal_from_knob: Annotated[float, Gt(0), Dimension("length")]  # nominal position of the pivot
    from_knob: Annotated[float, Gt(0), Dimension("length")]
    from_knob_u: Annotated[float, Ge(0), Dimension("length")]
    from_knob_dof: Freedom = inf


@dataclass(frozen=True, slots=True, kw_only=True)
class HolderSpec(AxisSpec):
    """A pivot that also holds the bat above or below the line of fire."""

    height: Annotated[float, Dimension("length")]  # height of the bat above the line of fire
    height_u: Annotated[float, Ge(0), Dimension("length")]
    height_dof: Freedom = inf


S = TypeVar("S", bound=AxisSpec)


@dataclass(frozen=True, slots=True)
class Holder(CalibratedInstrument[S]):
    """The holder of one laboratory."""

    @property
    def from_knob(self) -> TrueConstant:
        """True distance of the pivot from the knob [m]."""
        return self.true["from_knob"]

    @property
    def height(self) -> TrueConstant:
        """True height of the bat above the line of fire [m]."""
        return self.true.get("height", 0.0)
