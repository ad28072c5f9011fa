"""Indicating instruments: offset, repeatability, and a scale of finite steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, prod
from typing import Annotated, TypeVar

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import ArrayLike

from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import LengthReadings, MassReadings, Record
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    Freedom,
    StandardDeviation,
)
from virtual_lab.streams import Draws, Slots, owners_and_slots
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array


def quantise(values: ArrayLike, step: float) -> Array:
    """Return `values` rounded to whole multiples of `step`, in their shape and unit.

    A value midway between two multiples is rounded to the even multiple. With a step of 0 the
    values are returned unrounded. NaN remains NaN.
    """
    exact = np.asarray(values, dtype=float)
    return np.rint(exact / step) * step if step else exact


class IndicatorSpec(CalibratedSpec):
    """A data sheet that states step and scatter, in the unit of the readings."""

    __slots__ = ()
    resolution: float
    repeatability: float

    def numbers_in(
        self, records: Sequence[Record], constants: Mapping[str, float]
    ) -> Mapping[str, object]:
        """Return the repeatability, the scatter of the readings without rounding."""
        items = [
            item
            for each in records
            if isinstance(each, MassReadings | LengthReadings)
            for item in each.readings
        ]
        shown = StandardDeviation.of_groups(items, known=constants["resolution"] ** 2 / 12)
        return {"repeatability": shown} if shown.value else {}


S = TypeVar("S", bound=IndicatorSpec)


@dataclass(frozen=True, slots=True)
class Indicator(CalibratedInstrument[S]):
    """An instrument that displays a value to be read."""

    def exact(self) -> dict[str, Estimate]:
        return {"resolution": Estimate(value=self.spec.resolution)}

    def read(
        self, values: ArrayLike, repeats: int, draws: Draws, name: str, items: Slots | None = None
    ) -> Array:
        """Return readings of several items with scatter, (item, repeat).

        `values`, (item,), is the display of each item without scatter.

        The noise of a reading depends on the number of its item in `items`, (item,), and on the
        repeat. Without `items` the items are counted from 0 in each laboratory of a block.
        """
        displayed = np.atleast_1d(np.asarray(values, dtype=float))
        if items is None:
            owner, items = owners_and_slots(
                self.laboratories, displayed.size // prod(self.laboratories)
            )
            draws = draws.at(owner)
        noise = self.spec.repeatability * draws.normal(name, repeats, items)
        return quantise(displayed[:, None] + noise, self.spec.resolution)


Distance = Annotated[float, Ge(0), Dimension("length")]


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleSpec(IndicatorSpec):
    """Data sheet and calibration of a rule or a balance stand."""

    kind: str
    title: str
    resolution: Distance
    repeatability: Distance
    offset_u: Distance
    offset: Annotated[float, Dimension("length")] = 0.0
    offset_dof: Freedom = inf


@dataclass(frozen=True, slots=True)
class Rule(Indicator[RuleSpec]):
    """One rule or stand."""

    def measure(self, length: ArrayLike, repeats: int, draws: Draws, name: str) -> LengthReadings:
        """Read true lengths [m], shape (item,), `repeats` times each."""
        displayed = np.asarray(length) + self.true["offset"]
        return LengthReadings(readings=self.read(displayed, repeats, draws, name))


Mass = Annotated[float, Ge(0), Dimension("mass")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleSpec(IndicatorSpec):
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
class Scale(Indicator[ScaleSpec]):
    """One scale."""

    def weigh(
        self, mass: ArrayLike, repeats: int, draws: Draws, name: str, items: Slots | None = None
    ) -> MassReadings:
        """Weigh `items` of true `mass` [kg], shape (item,), `repeats` times each."""
        displayed = self.true["span"] * np.asarray(mass) + self.true["zero"]
        return MassReadings(readings=self.read(displayed, repeats, draws, name, items))
