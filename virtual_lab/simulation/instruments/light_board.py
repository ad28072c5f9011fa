"""Light boards: rows of beams at different heights that time the two edges of a ball.

A ball breaks about ten beams of a board, each along a different chord, so a board measures the time
and the height of the passage of its center. Each beam has a fixed threshold that makes it trip
early or late. Occasionally a fragment of the sabot crosses the first board just ahead of the ball.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np
from annotated_types import Ge, Gt, Lt, MinLen

from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import BoardRecord, PassageRecord, Record
from virtual_lab.simulation.instruments.calibrated import Freedom, draw_constants, stated_constant
from virtual_lab.simulation.instruments.indicator import quantise
from virtual_lab.simulation.instruments.light_gate import (
    BallGates,
    GateSheet,
    LengthsU,
    WatchedBatch,
    per_shot,
)
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.streams import Draws, Slots
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

if TYPE_CHECKING:
    from virtual_lab.simulation.instruments.board_kernel import Boards

Length = Annotated[float, Ge(0), Dimension("length")]


@dataclass(frozen=True, slots=True, kw_only=True)
class LightBoardSpec(GateSheet):
    """Data sheet of light boards and their beams."""

    other_errors: ClassVar[tuple[str, ...]] = ("trip_spread", "tick", "sabot_rate")

    distances: Annotated[tuple[float, ...], MinLen(3), Dimension("length")]
    beams: Annotated[int, Gt(3), Dimension("number")]
    pitch: Annotated[float, Gt(0), Dimension("length")]
    lowest: Annotated[float, Dimension("length")]  # height of the lowest beam above line of fire
    height_u: LengthsU  # standard uncertainty of the height of each board
    trip_spread: Length  # standard deviation of the depth at which a beam trips, between beams
    sabot_rate: Annotated[float, Ge(0), Lt(1), Dimension("number")]  # share of shots with fragments
    # heights of the boards' zeros; if empty, all are on the line of fire
    heights: Annotated[tuple[float, ...], Dimension("length")] = ()
    height_dof: Freedom = inf

    def __post_init__(self) -> None:
        GateSheet.__post_init__(self)  # a class with slots has no `super` of its own
        if self.heights and len(self.heights) != len(self.distances):
            raise ValueError(f"{len(self.heights)} heights of {len(self.distances)} boards")
        self.of_each_gate(self.height_u)
        if not self.lowest < 0 < self.highest:
            raise ValueError(
                f"beams from {self.lowest:g} to {self.highest:g} m: none at the line of fire"
            )

    def numbers_in(
        self, records: Sequence[Record], constants: Mapping[str, float]
    ) -> Mapping[str, object]:
        """Return the calibrated distances and heights of the boards, and their number of beams."""
        numbers = dict(GateSheet.numbers_in(self, records, constants))
        count = sum(key.startswith("height_") for key in constants)
        numbers["heights"] = tuple(constants[f"height_{at}"] for at in range(count))
        beams = [each.times.shape[3] for each in records if isinstance(each, BoardRecord)]
        return numbers | {"beams": beams[0]} if beams else numbers

    @property
    def highest(self) -> float:
        """Height of the top beam [m]."""
        return self.lowest + (self.beams - 1) * self.pitch

    @property
    def detected_depth(self) -> float:
        """Depth below the line of fire at which a ball's upper half still breaks beams [m]."""
        return -self.lowest

    def view(self, radius: float) -> tuple[float, float]:
        """Return the lowest and the highest position of a ball's center that is detected [m]."""
        return self.lowest - radius, self.highest + radius

    def certificate(self) -> dict[str, Estimate]:
        """Return distance and height of each board, and clock: recorded = clock x true time."""
        distances = GateSheet.certificate(self)
        stated = {"clock": distances["clock"]}  # random numbers are drawn in this order
        heights = self.heights or (0.0,) * len(self.distances)
        each = zip(heights, self.of_each_gate(self.height_u), strict=True)
        for index, (height, u) in enumerate(each):
            stated[f"distance_{index}"] = distances[f"distance_{index}"]
            stated[f"height_{index}"] = stated_constant(height, u, self.height_dof)
        return stated


@dataclass(frozen=True, slots=True)
class LightBoards(BallGates[LightBoardSpec]):
    """The light boards of a laboratory. The thresholds of their beams are on no certificate."""

    # threshold of each beam, added to the radius, ([laboratory,] board, beam) [m]
    trip_depths: Array

    @classmethod
    def commission(cls, spec: LightBoardSpec, draws: Draws, name: str) -> Self:
        trip_depths = draws.normal(f"{name}.trips", (len(spec.distances), spec.beams))
        return cls(
            spec, *draw_constants(spec.certificate(), draws, name), spec.trip_spread * trip_depths
        )

    def exact(self) -> dict[str, Estimate]:
        spec = self.spec
        return {"lowest": Estimate(value=spec.lowest), "pitch": Estimate(value=spec.pitch)}

    @property
    def heights(self) -> Array:
        """True heights of the boards' zeros above the line of fire [m], shape of `distances`."""
        return self.of_gates("height")

    def edges(self, batch: WatchedBatch) -> BoardRecord:
        passage, contact, leaving, draws, name, slots = batch
        from virtual_lab.simulation.instruments.board_kernel import write_edges

        spec, directions = self.spec, (0, 1)
        shape = (len(directions), len(spec.distances), spec.beams, 2)
        records = spec.edge_jitter * draws.normal(f"{name}.jitter", shape, slots)
        records += spec.tick * draws.uniform(f"{name}.start", (1, 1, 1, 1), slots)
        scraps, delay = self._scraps(passage, contact, draws, name, slots)
        scrapped = quantise(records[scraps] + self.clock * delay, spec.tick)
        edges = records.reshape(*records.shape[:3], -1)
        for direction, start in zip(directions, (contact, leaving), strict=True):
            out = bool(direction)
            trip_distance = passage.radius + self.trip_depths
            flights = passage.trajectory_rows(out=out)
            write_edges(edges, flights, start, out, self._boards(passage), trip_distance)
        records[scraps] = scrapped
        records.setflags(write=False)
        return BoardRecord(times=records)

    def sums(self, batch: WatchedBatch) -> PassageRecord:
        """Return the time and the height of the ball's center at each board.

        The noise is the noise of a fit to the beams that the ball breaks. For a ball that rises or
        falls, an error of the height also causes an error of the time.
        """
        passage, contact, leaving, draws, name, slots = batch
        from virtual_lab.simulation.instruments.board_kernel import sum_up

        spec = self.spec
        edge = sqrt(spec.edge_jitter**2 + spec.tick**2 / 12)
        boards = self._boards(passage)
        # The order is (direction, quantity, board, shot). The records overwrite the noise.
        noise = draws.normal(f"{name}.sums", (2, 2, len(spec.distances)), slots)
        records = np.ascontiguousarray(np.moveaxis(noise, 0, -1))
        for start, rows, out in zip((contact, leaving), records, (False, True), strict=True):
            sum_up(
                rows, passage.trajectory_rows(out=out), start, out, boards, edge, spec.trip_spread
            )
        records.setflags(write=False)
        times, heights = records.transpose(1, 3, 0, 2)
        return PassageRecord(times=times, heights=heights)

    def _boards(self, passage: Passage) -> Boards:
        from virtual_lab.simulation.instruments.board_kernel import Boards

        spec, shots = self.spec, passage.speed_in.size
        return Boards(
            distances=self.rows("distance", shots),
            heights=self.rows("height", shots),
            clock=per_shot(self.clock, shots),
            gravity=per_shot(passage.gravity, shots),
            radius=per_shot(passage.radius / spec.pitch, shots),
            tick=spec.tick,
            lowest=spec.lowest,
            pitch=spec.pitch,
            beams=spec.beams,
        )

    def _scraps(
        self, passage: Passage, contact: Array, draws: Draws, name: str, slots: Slots
    ) -> tuple[tuple[Any, ...], Array]:
        """Return the indices of the edges made by fragments of the sabot, and their times [s].

        A fragment breaks a few beams of the first board ahead of the ball.
        """
        spec = self.spec
        share = draws.uniform(f"{name}.sabot", 2, slots).T + 0.5
        tripped = np.flatnonzero(share[0] < spec.sabot_rate)
        ahead = self.distances[None, 0] + passage.radius + 0.03  # [m] ahead of the ball's front
        early = (contact - passage.inbound(ahead)[0])[tripped]
        middle = (spec.beams - 1) * share[1, tripped, None]
        struck, beams = np.nonzero(np.abs(np.arange(spec.beams) - middle) < 2)
        return (tripped[struck], 0, 0, beams, 0), early[struck]
