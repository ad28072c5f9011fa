"""Instruments that read a length: the rule, and the balance stand with its knife edge."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Annotated

from annotated_types import Ge
from numpy.typing import ArrayLike

from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import LengthReadings
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, Freedom, Sheet
from virtual_lab.simulation.instruments.indicator import indicate
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["Rule", "RuleSpec"]

Distance = Annotated[float, Ge(0), Dimension("length")]


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleSpec(Sheet):
    """Data sheet and calibration of a rule or a balance stand."""

    kind: str
    title: str
    resolution: Distance
    repeatability: Distance
    offset_u: Distance
    offset: Annotated[float, Dimension("length")] = 0.0
    offset_dof: Freedom = inf


@dataclass(frozen=True, slots=True)
class Rule(CalibratedInstrument[RuleSpec]):
    """One rule or stand."""

    def exact(self) -> dict[str, Estimate]:
        return {"resolution": Estimate(value=self.spec.resolution)}

    def measure(self, length: ArrayLike, repeats: int, draws: Draws, name: str) -> LengthReadings:
        """Read true lengths [m], shape (item,), `repeats` times each."""
        return LengthReadings(
            readings=indicate(
                length,
                offset=self.true["offset"],
                repeatability=self.spec.repeatability,
                resolution=self.spec.resolution,
                repeats=repeats,
                draws=draws,
                name=name,
            )
        )
