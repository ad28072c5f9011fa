"""A scale: zero and span as its certificate states them, steps and repeatability a reading."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import ArrayLike

from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import MassReadings
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, Freedom, Sheet
from virtual_lab.simulation.instruments.indicator import indicate
from virtual_lab.streams import Draws, Slots
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["Scale", "ScaleSpec"]

Mass = Annotated[float, Ge(0), Dimension("mass")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleSpec(Sheet):
    """Data sheet and calibration of a scale."""

    kind: str
    title: str
    resolution: Mass
    repeatability: Mass
    zero_u: Mass
    span_u: Annotated[float, Ge(0), Dimension("number")]
    zero: Annotated[float, Dimension("mass")] = 0.0
    zero_dof: Freedom = inf
    span: Annotated[float, Gt(0), Dimension("number")] = 1.0
    span_dof: Freedom = inf


@dataclass(frozen=True, slots=True)
class Scale(CalibratedInstrument[ScaleSpec]):
    """One scale."""

    def exact(self) -> dict[str, Estimate]:
        return {"resolution": Estimate(value=self.spec.resolution)}

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
                self.true["span"] * np.atleast_1d(np.asarray(mass, dtype=float)),
                offset=self.true["zero"],
                repeatability=self.spec.repeatability,
                resolution=self.spec.resolution,
                repeats=repeats,
                draws=draws,
                name=name,
                items=items,
            )
        )
