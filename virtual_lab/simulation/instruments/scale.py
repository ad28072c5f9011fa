"""A scale: zero and span errors from its calibration, steps and repeatability a reading."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np
from annotated_types import Ge
from numpy.typing import ArrayLike

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.records import MassReadings
from virtual_lab.simulation.instruments.indicator import indicate
from virtual_lab.streams import Draws, Slots
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["Scale", "ScaleSpec"]

Mass = Annotated[float, Ge(0), Dimension("mass")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleSpec(Spec):
    """Data sheet and calibration of a scale."""

    kind: str
    title: str
    resolution: Mass
    repeatability: Mass
    zero_u: Mass
    span_u: Annotated[float, Ge(0), Dimension("number")]

    def ideal(self) -> Self:
        """Return the scale that shows the mass."""
        return replace(self, resolution=0.0, repeatability=0.0, zero_u=0.0, span_u=0.0)


@dataclass(frozen=True, slots=True)
class Scale:
    """One scale with the errors its calibration left, drawn once a laboratory."""

    spec: ScaleSpec
    zero: float
    span: float

    @classmethod
    def commission(cls, spec: ScaleSpec, draws: Draws, name: str) -> Self:
        zero, span = draws.normal(f"{name}.errors", (2,))
        return cls(spec, spec.zero_u * float(zero), 1 + spec.span_u * float(span))

    def calibration(self) -> dict[str, Estimate]:
        """Return what the laboratory knows: reading = span x mass + zero."""
        return {
            "zero": Estimate(value=0.0, u=self.spec.zero_u),
            "span": Estimate(value=1.0, u=self.spec.span_u),
            "resolution": Estimate(value=self.spec.resolution),
        }

    def errors(self) -> dict[str, float]:
        """Return the true constants, to be sealed."""
        return {"zero": self.zero, "span": self.span}

    def weigh(
        self,
        mass: ArrayLike,
        repeats: int,
        draws: Draws,
        name: str,
        items: Slots | None = None,
    ) -> MassReadings:
        """Weigh `items` of true `mass` [kg], shape (item,), `repeats` times each."""
        return MassReadings(
            readings=indicate(
                self.span * np.atleast_1d(np.asarray(mass, dtype=float)),
                offset=self.zero,
                repeatability=self.spec.repeatability,
                resolution=self.spec.resolution,
                repeats=repeats,
                draws=draws,
                name=name,
                items=items,
            )
        )
