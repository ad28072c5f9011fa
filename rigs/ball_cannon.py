"""The ball cannon: a ball of 60 to 160 mph, a bat at rest on its pivot, and light boards.

No instrument observes the bat. e_A is the rebound speed of the ball over its incoming speed. Both
are computed from all edges of three light boards, which also measure the height of each ball above
the bat's axis. The pivot holds the bat and has no effect on e_A.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from virtual_lab import catalog
from virtual_lab.records import AimMarks, BoardRecord, Record, ShotLog
from virtual_lab.simulation.instruments import InstrumentFactory
from virtual_lab.simulation.instruments.holder import Holder, HolderSpec
from virtual_lab.simulation.instruments.light_board import LightBoards, LightBoardSpec
from virtual_lab.simulation.stations.cannon_station import (
    RestingBatSpec,
    RestingBatStation,
    commission,
)
from virtual_lab.simulation.stations.rig import MotionModel, Stage
from virtual_lab.streams import Draws


@dataclass(frozen=True, slots=True, kw_only=True)
class BallCannonSpec(RestingBatSpec):
    """Data sheet of the rig: instruments, pivot, and objects around the bat."""

    holder: HolderSpec


class BallCannon:
    """The ball-cannon rig."""

    name = "ball-cannon"
    stage = Stage.IMPACT
    blocks = True
    motions = frozenset(MotionModel)
    channels: Mapping[str, type[Record]] = {"log": ShotLog, "gates": BoardRecord, "aim": AimMarks}

    def commission(self, draws: Draws, *, ideal: bool = False) -> BallCannonStation:
        spec = catalog.load("rigs", self.name, BallCannonSpec).spec
        return BallCannonStation(**parts(spec, InstrumentFactory(draws=draws, ideal=ideal)))


@dataclass(frozen=True, slots=True, kw_only=True)
class BallCannonStation(RestingBatStation):
    """The ball-cannon rig in one laboratory, or in a block of them."""

    name = "ball-cannon"


def parts(spec: BallCannonSpec, factory: InstrumentFactory) -> dict[str, Any]:
    """Return the parts of a ball cannon, keyed by the field names of `BallCannonStation`.

    The errors of the instruments are random, or zero if the laboratory is ideal. The frame around
    each gate, and the stop that ends the recoil of the bat, are taken from the data sheet. The key
    ``ideal`` is True if the laboratory is ideal. Raises `InputError` for an unknown or invalid data
    sheet.
    """
    holder = factory.adapt(spec.holder)
    return {
        "holder": Holder.commission(holder, factory.draws, "ball-cannon.holder"),
        "frame": spec.frame,
        "stop": spec.stop,
    } | commission(spec, factory, "ball-cannon", LightBoards, LightBoardSpec)


RIG = BallCannon()
