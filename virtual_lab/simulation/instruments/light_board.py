"""Light boards: rows of beams one above the other, both edges of every beam timed.

A ball breaks some ten beams of a board, each along its own chord, so a board shows when the
centre passed and how high. A beam trips a little early or late for good, by its own threshold;
now and then a scrap of the sabot crosses the first board just ahead of the ball.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
from annotated_types import Ge, Gt, Lt, MinLen

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.errors import InputError
from virtual_lab.records import BoardRecord, PassageRecord
from virtual_lab.simulation.arrays import Array
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.board_sums import gain_table
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    Freedom,
    certified,
    drawn,
)
from virtual_lab.simulation.instruments.indicator import quantise
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.streams import Draws, Slots
from virtual_lab.uncertainty.estimate import Estimate

if TYPE_CHECKING:
    from virtual_lab.simulation.instruments.board_kernel import Boards

__all__ = ["LightBoardSpec", "LightBoards"]

Time = Annotated[float, Ge(0), Dimension("time")]
Length = Annotated[float, Ge(0), Dimension("length")]
Number = Annotated[float, Ge(0), Dimension("number")]
SCRAP_AHEAD = 0.03  # m, a scrap of the sabot flies this far ahead of the ball's front


@dataclass(frozen=True, slots=True, kw_only=True)
class LightBoardSpec(Spec):
    """Boards along the flight, their places counted from the ball's at contact, far one first."""

    kind: str
    title: str
    distances: Annotated[tuple[float, ...], MinLen(3), Dimension("length")]
    distance_u: Length
    beams: Annotated[int, Gt(3), Dimension("number")]
    pitch: Annotated[float, Gt(0), Dimension("length")]
    lowest: Annotated[float, Dimension("length")]  # beam, above the line of fire
    height_u: Length  # of each board
    trip_spread: Length  # beam to beam, of how far into the beam the ball trips it
    tick: Time
    edge_jitter: Time
    clock_u: Number
    sabot_rate: Annotated[float, Ge(0), Lt(1), Dimension("number")]  # share of the shots
    distance_dof: Freedom = inf
    heights: Annotated[tuple[float, ...], Dimension("length")] = ()  # zeros; none: all at the line
    height_dof: Freedom = inf
    clock_fast: Annotated[float, Gt(-1), Dimension("number")] = 0.0  # shown over true time, less 1

    def __post_init__(self) -> None:
        if (
            list(self.distances) != sorted(set(self.distances), reverse=True)
            or self.distances[-1] <= 0
        ):
            raise ValueError(
                "distances must fall from the cannon's board to the target's, all above 0"
            )
        if self.heights and len(self.heights) != len(self.distances):
            raise ValueError(f"{len(self.heights)} heights of {len(self.distances)} boards")
        if not self.lowest < 0 < self.highest:
            raise ValueError(
                f"beams from {self.lowest:g} to {self.highest:g} m: none at the line of fire"
            )

    @property
    def highest(self) -> float:
        """Height of the top beam [m]."""
        return self.lowest + (self.beams - 1) * self.pitch

    @property
    def room(self) -> float:
        """How far below the line of fire a ball's centre is seen for sure [m]: its upper half."""
        return -self.lowest

    def view(self, radius: float) -> tuple[float, float]:
        """Return between which heights the centre of a ball is ever seen [m]."""
        return self.lowest - radius, self.highest + radius

    def ideal(self) -> Self:
        """Return boards that stand where surveyed, with alike beams and a perfect clock."""
        return replace(
            self,
            distance_u=0.0,
            height_u=0.0,
            trip_spread=0.0,
            tick=0.0,
            edge_jitter=0.0,
            clock_u=0.0,
            sabot_rate=0.0,
        )

    def certificate(self) -> dict[str, Estimate]:
        """Return places and heights of the boards, and the clock: shown time = clock x time."""
        stated = {"clock": certified(1 + self.clock_fast, self.clock_u)}
        heights = self.heights or (0.0,) * len(self.distances)
        for index, (distance, height) in enumerate(zip(self.distances, heights, strict=True)):
            stated[f"distance_{index}"] = certified(distance, self.distance_u, self.distance_dof)
            stated[f"height_{index}"] = certified(height, self.height_u, self.height_dof)
        return stated


@dataclass(frozen=True, slots=True)
class LightBoards(CalibratedInstrument[LightBoardSpec]):
    """The boards of one laboratory; the thresholds of their beams stand on no certificate."""

    trips: Array  # what each beam adds to the ball's radius, (board, beam) [m]

    @classmethod
    def commission(cls, spec: LightBoardSpec, draws: Draws, name: str) -> Self:
        trips = draws.normal(f"{name}.trips", (len(spec.distances), spec.beams))
        return cls(spec, *drawn(spec.certificate(), draws, name), spec.trip_spread * trips)

    def exact(self) -> dict[str, Estimate]:
        spec = self.spec
        return {"lowest": Estimate(value=spec.lowest), "pitch": Estimate(value=spec.pitch)}

    @property
    def distances(self) -> Array:
        """Their true places, (board,) [m]."""
        return np.array([self.true[f"distance_{at}"] for at in range(len(self.spec.distances))])

    @property
    def heights(self) -> Array:
        """True heights of the boards' zeros above the line of fire, (board,) [m]."""
        return np.array([self.true[f"height_{at}"] for at in range(len(self.spec.distances))])

    @property
    def clock(self) -> float:
        """Seconds shown a true second."""
        return self.true["clock"]

    def arrival(self, passage: Passage) -> Array:
        """Return the true time from the trigger to contact [s], shape (shot,).

        The trigger is the ball's front at the far board.
        """
        return passage.inbound(self.distances[None, 0] + passage.radius)[0]

    def watch(
        self,
        passage: Passage,
        contact: Array,
        leaving: Array,
        draws: Draws,
        name: str,
        slots: Slots,
        rung: RecordDetail = RecordDetail.FULL,
    ) -> BoardRecord | PassageRecord:
        """Record balls that reach the target at `contact` and leave it at `leaving` [s]."""
        if slots.shape != contact.shape:
            raise InputError("", "slots", slots.shape, f"allowed: one a shot, {contact.shape}")
        record = self._edges if rung is RecordDetail.FULL else self._sums
        written = record(passage, contact, leaving, draws, name, slots)
        return passage.seen(written, self.distances)

    def _edges(
        self,
        passage: Passage,
        contact: Array,
        leaving: Array,
        draws: Draws,
        name: str,
        slots: Slots,
    ) -> BoardRecord:
        from virtual_lab.simulation.instruments.board_kernel import write_edges

        spec, ways = self.spec, (0, 1)
        shape = (len(ways), len(self.distances), spec.beams, 2)
        records = spec.edge_jitter * draws.normal(f"{name}.jitter", shape, slots)
        records += spec.tick * draws.uniform(f"{name}.start", (1, 1, 1, 1), slots)
        scraps, late = self._scraps(passage, contact, draws, name, slots)
        scrapped = quantise(records[scraps] + self.clock * late, spec.tick)
        by_way = records.reshape(*records.shape[:3], -1)
        for way, start in zip(ways, (contact, leaving), strict=True):
            flown = passage.way(out=bool(way))
            reach = passage.radius + self.trips
            write_edges(by_way[:, way], flown, start, bool(way), self._boards(passage), reach)
        records[scraps] = scrapped
        records.setflags(write=False)
        return BoardRecord(times=records)

    def _sums(
        self,
        passage: Passage,
        contact: Array,
        leaving: Array,
        draws: Draws,
        name: str,
        slots: Slots,
    ) -> PassageRecord:
        """Sum each board up: time and height of the ball's centre.

        Their noise is that of the sums over the beams that a ball breaks where it passes. A
        ball that rises or falls passes its own height sooner or later: the height's error is
        in the time too.
        """
        from virtual_lab.simulation.instruments.board_kernel import sum_up

        spec = self.spec
        edge = sqrt(spec.edge_jitter**2 + spec.tick**2 / 12)
        gains = gain_table(passage.radius / spec.pitch)
        gains = gains * np.array([[edge], [edge], [spec.trip_spread]])
        # way by way, whole shots side by side; what starts as noise ends as records
        noise = draws.normal(f"{name}.sums", (2, 2, len(self.distances)), slots)
        records = np.ascontiguousarray(np.moveaxis(noise, 0, -1))
        for start, way, out in zip((contact, leaving), records, (False, True), strict=True):
            sum_up(way, passage.way(out=out), start, out, self._boards(passage), gains)
        records.setflags(write=False)
        times, heights = records.transpose(1, 3, 0, 2)
        return PassageRecord(times=times, heights=heights)

    def _boards(self, passage: Passage) -> Boards:
        from virtual_lab.simulation.instruments.board_kernel import Boards

        spec = self.spec
        return Boards(
            distances=self.distances,
            heights=self.heights,
            clock=self.clock,
            tick=spec.tick,
            lowest=spec.lowest,
            pitch=spec.pitch,
            beams=spec.beams,
            radius=passage.radius,
            gravity=passage.gravity,
        )

    def _scraps(
        self, passage: Passage, contact: Array, draws: Draws, name: str, slots: Slots
    ) -> tuple[tuple[Any, ...], Array]:
        """Return which edges a scrap of the sabot makes, ahead of the ball, and when [s].

        It breaks some beams of the first board.
        """
        spec = self.spec
        share = draws.uniform(f"{name}.sabot", 2, slots).T + 0.5
        tripped = np.flatnonzero(share[0] < spec.sabot_rate)
        ahead = self.distances[None, 0] + passage.radius + SCRAP_AHEAD
        early = (contact - passage.inbound(ahead)[0])[tripped]
        middle = (spec.beams - 1) * share[1, tripped, None]
        struck, beams = np.nonzero(np.abs(np.arange(spec.beams) - middle) < 2)
        return (tripped[struck], 0, 0, beams, 0), early[struck]
