"""The ball cannon: speed of the ball and its impact position on the bat, with their scatter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension
from virtual_lab.errors import InputError
from virtual_lab.records import AimMarks, Record
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    Freedom,
    StandardDeviation,
)
from virtual_lab.simulation.instruments.indicator import quantise
from virtual_lab.streams import Draws, Slots, owners_and_slots
from virtual_lab.units import MPH, Array

Distance = Annotated[float, Ge(0), Dimension("length")]


@dataclass(frozen=True, slots=True, kw_only=True)
class CannonSpec(CalibratedSpec):
    """Data sheet of a cannon: scatter of speed and aim, and uncertainty of its alignment."""

    kind: str
    title: str
    fastest: Annotated[float, Gt(0), Dimension("speed")]
    speed_scatter: Annotated[float, Ge(0), Dimension("speed")]
    along_scatter: Distance
    across_scatter: Distance
    slope_scatter: Annotated[float, Ge(0), Dimension("angle")]
    along_u: Distance
    across_u: Distance
    marks: Annotated[int, Gt(1), Dimension("number")]
    mark_resolution: Distance
    along: Annotated[float, Dimension("length")] = 0.0  # mean impact position minus set position
    along_dof: Freedom = inf
    across: Annotated[float, Dimension("length")] = 0.0  # mean height above the line of fire

    def numbers_in(
        self, records: Sequence[Record], constants: Mapping[str, float]
    ) -> Mapping[str, object]:
        """Return number and scatter of the marks.

        Their mean height is left out: the mean aim of one day is not that of every day.
        """
        numbers: dict[str, object] = {}
        for marks in records:
            if isinstance(marks, AimMarks) and marks.along.size > 1:
                numbers = {
                    "marks": marks.along.size,
                    "mark_resolution": 0.0,
                    "along_scatter": StandardDeviation.of(marks.along),
                    "across_scatter": StandardDeviation.of(marks.across),
                }
        return numbers


@dataclass(frozen=True, slots=True)
class Launch:
    """True speed at the target [m/s] and offsets from the aim [m], arrays (shot,)."""

    speed: Array
    along: Array
    across: Array
    slope: Array  # height lost per meter of the incoming flight


@dataclass(frozen=True, slots=True)
class Cannon(CalibratedInstrument[CannonSpec]):
    """A cannon as aligned for the test of a laboratory."""

    unknown: ClassVar[frozenset[str]] = frozenset({"across"})

    def fire(self, speed: Array, draws: Draws, name: str, slots: Slots) -> Launch:
        """Return the true launches of the shots `slots`, (shot,).

        `speed` is the nominal speed at the target [m/s], (shot,). Raises `InputError` if the cannon
        is not that fast.
        """
        if np.any(speed > self.spec.fastest):
            fastest, most = (
                f"{each / MPH:.4g} mph ({each:.4g} m/s)"
                for each in (float(np.max(speed)), self.spec.fastest)
            )
            allowed = f"{self.spec.title} fires up to {most}"
            raise InputError("procedure.toml", "ball_speed", fastest, allowed)
        scatter = draws.normal(name, 4, slots).T
        return Launch(
            speed=speed + self.spec.speed_scatter * scatter[0],
            along=self.true["along"] + self.spec.along_scatter * scatter[1],
            across=self.true["across"] + self.spec.across_scatter * scatter[2],
            slope=self.spec.slope_scatter * scatter[3],
        )

    def mark(self, draws: Draws, name: str) -> AimMarks:
        """Return the marks on an aim paper of test shots before the test, read with a rule.

        In a block the marks are in the order of the laboratories.
        """
        owner, marks = owners_and_slots(self.laboratories, self.spec.marks)
        launch = self.at(owner).fire(np.full(marks.size, np.nan), draws.at(owner), name, marks)
        return AimMarks(
            along=quantise(launch.along, self.spec.mark_resolution),
            across=quantise(launch.across, self.spec.mark_resolution),
        )
