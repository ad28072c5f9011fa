"""Instruments that read a length: the rule, and the balance stand with its knife edge."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Self

from annotated_types import Ge
from numpy.typing import ArrayLike

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.records import LengthReadings
from virtual_lab.simulation.instruments.indicator import indicate
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["Rule", "RuleSpec"]

Distance = Annotated[float, Ge(0), Dimension("length")]


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleSpec(Spec):
    """Data sheet and calibration of a rule or a balance stand."""

    kind: str
    title: str
    resolution: Distance
    repeatability: Distance
    offset_u: Distance

    def ideal(self) -> Self:
        """Return the rule that shows the length."""
        return replace(self, resolution=0.0, repeatability=0.0, offset_u=0.0)


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule or stand with the offset its calibration left, drawn once a laboratory."""

    spec: RuleSpec
    offset: float

    @classmethod
    def commission(cls, spec: RuleSpec, draws: Draws, name: str) -> Self:
        return cls(spec, spec.offset_u * float(draws.normal(f"{name}.errors")))

    def calibration(self) -> dict[str, Estimate]:
        """Return what the laboratory knows: reading = length + offset."""
        return {
            "offset": Estimate(value=0.0, u=self.spec.offset_u),
            "resolution": Estimate(value=self.spec.resolution),
        }

    def errors(self) -> dict[str, float]:
        """Return the true constants, to be sealed."""
        return {"offset": self.offset}

    def measure(self, length: ArrayLike, repeats: int, draws: Draws, name: str) -> LengthReadings:
        """Read true lengths [m], shape (item,), `repeats` times each."""
        return LengthReadings(
            readings=indicate(
                length,
                offset=self.offset,
                repeatability=self.spec.repeatability,
                resolution=self.spec.resolution,
                repeats=repeats,
                draws=draws,
                name=name,
            )
        )
