"""The ball cannon: a ball of 60 to 160 mph, a bat at rest on its pivot, boards of light beams.

Nothing watches the bat: e_A is the ball's own speed back over its speed in, from all the edges
of three boards, which also show how high above the bat's axis each ball struck. The pivot only
holds the bat: e_A does not know it is there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from virtual_lab import catalog
from virtual_lab.records import AimMarks, BoardRecord, Record, ShotLog
from virtual_lab.simulation.cannon_station import RestingBatSpec, RestingBatStation, fitted
from virtual_lab.simulation.instruments import InstrumentFactory
from virtual_lab.simulation.instruments.holder import Holder, HolderSpec
from virtual_lab.simulation.instruments.light_board import LightBoards, LightBoardSpec
from virtual_lab.simulation.rig import MotionRung, Stage
from virtual_lab.streams import Draws


@dataclass(frozen=True, slots=True, kw_only=True)
class BallCannonSpec(RestingBatSpec):
    """Which instruments make up the rig, what holds the bat and what stands around it."""

    holder: HolderSpec


class BallCannon:
    """The rig."""

    name = "ball-cannon"
    stage = Stage.IMPACT
    blocks = True
    motions = frozenset(MotionRung)
    channels: Mapping[str, type[Record]] = {"log": ShotLog, "gates": BoardRecord, "aim": AimMarks}

    def commission(self, draws: Draws, *, ideal: bool = False) -> BallCannonStation:
        spec = catalog.load("rigs", self.name, BallCannonSpec).spec
        return BallCannonStation(**parts(spec, InstrumentFactory(draws=draws, ideal=ideal)))


@dataclass(frozen=True, slots=True, kw_only=True)
class BallCannonStation(RestingBatStation):
    """The rig in one laboratory."""

    name = "ball-cannon"


def parts(spec: BallCannonSpec, factory: InstrumentFactory) -> dict[str, Any]:
    """Return what a ball cannon is made of, by the fields of its station."""
    holder = factory.as_asked(spec.holder)
    return {
        "holder": Holder.commission(holder, factory.draws, "ball-cannon.holder"),
        "frame": spec.frame,
        "stop": spec.stop,
    } | fitted(spec, factory, "ball-cannon", LightBoards, LightBoardSpec)


RIG = BallCannon()
