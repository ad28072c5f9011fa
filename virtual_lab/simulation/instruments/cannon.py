"""The ball cannon: a speed asked for, a speed given, and where on the bat the ball lands."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension
from virtual_lab.errors import InputError
from virtual_lab.records import AimMarks
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    Freedom,
)
from virtual_lab.simulation.instruments.indicator import quantise
from virtual_lab.streams import Draws, Slots, in_turn
from virtual_lab.units import MPH, Array

Distance = Annotated[float, Ge(0), Dimension("length")]


@dataclass(frozen=True, slots=True, kw_only=True)
class CannonSpec(CalibratedSpec):
    """Scatter of speed and aim, and how well the aim was lined up."""

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
    along: Annotated[float, Dimension("length")] = 0.0  # where balls strike less where they are set
    along_dof: Freedom = inf
    across: Annotated[float, Dimension("length")] = 0.0  # how far above the line of fire


@dataclass(frozen=True, slots=True)
class Launch:
    """True speed at the target [m/s] and offsets from the aim [m], shape (shot,)."""

    speed: Array
    along: Array
    across: Array
    slope: Array  # height lost a metre as the ball comes


@dataclass(frozen=True, slots=True)
class Cannon(CalibratedInstrument[CannonSpec]):
    """One cannon as lined up for a laboratory's test."""

    unknown: ClassVar[frozenset[str]] = frozenset({"across"})

    def fire(self, speed: Array, draws: Draws, name: str, slots: Slots) -> Launch:
        """Fire shots, `slots` by number, asked to reach the target at `speed` [m/s], (shot,).

        Raises `InputError` where the cannon is not that strong.
        """
        if np.any(speed > self.spec.fastest):
            asked, most = float(np.max(speed)) / MPH, self.spec.fastest / MPH
            allowed = f"{self.spec.title} fires up to {most:.4g} mph"
            raise InputError("procedure.toml", "ball_speed", f"{asked:.4g} mph", allowed)
        scatter = draws.normal(name, 4, slots).T
        return Launch(
            speed=speed + self.spec.speed_scatter * scatter[0],
            along=self.true["along"] + self.spec.along_scatter * scatter[1],
            across=self.true["across"] + self.spec.across_scatter * scatter[2],
            slope=self.spec.slope_scatter * scatter[3],
        )

    def mark(self, draws: Draws, name: str) -> AimMarks:
        """Fire at an aim paper before the test and read the marks with a rule.

        Those of a block are marks of one laboratory after another.
        """
        owner, marks = in_turn(self.laboratories, self.spec.marks)
        launch = self.at(owner).fire(np.full(marks.size, np.nan), draws.at(owner), name, marks)
        return AimMarks(
            along=quantise(launch.along, self.spec.mark_resolution),
            across=quantise(launch.across, self.spec.mark_resolution),
        )
