"""Gravity in the hall: one constant for whatever falls or swings there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, Sheet

__all__ = ["Gravity", "GravitySpec"]


@dataclass(frozen=True, slots=True, kw_only=True)
class GravitySpec(Sheet):
    """What a survey says of the place."""

    kind: str
    title: str
    gravity: Annotated[float, Gt(0), Dimension("acceleration")]
    gravity_u: Annotated[float, Ge(0), Dimension("acceleration")]


@dataclass(frozen=True, slots=True)
class Gravity(CalibratedInstrument[GravitySpec]):
    """Gravity of one laboratory."""

    @property
    def acceleration(self) -> float:
        """What it truly is [m/s²]."""
        return self.true["gravity"]
