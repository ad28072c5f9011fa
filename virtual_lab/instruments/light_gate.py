"""Light gates: curtains of beams that a passing ball breaks and clears, both edges timed.

A curtain stands at a true place a little off the surveyed one; the recorder's clock runs a
little fast or slow, adds jitter to each edge and counts whole ticks. The mean of a gate's two
edges is the passage of the ball's centre, whatever part of the beam trips it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np
from annotated_types import Ge, Gt, MinLen
from numpy.typing import ArrayLike, NDArray

from virtual_lab.estimate import Estimate
from virtual_lab.instruments.indicator import quantise
from virtual_lab.records import GateRecord
from virtual_lab.relations.flight import time_after, time_before
from virtual_lab.specs import Dimension, Spec
from virtual_lab.streams import Draws

__all__ = ["LightGateSpec", "LightGates", "Passage"]

Array = NDArray[np.float64]
Time = Annotated[float, Ge(0), Dimension("time")]
Number = Annotated[float, Ge(0), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class LightGateSpec(Spec):
    """A row of curtains along the flight, their places counted from the ball's at contact."""

    kind: str
    title: str
    distances: Annotated[tuple[float, ...], MinLen(2), Dimension("length")]  # far one first
    distance_u: Annotated[float, Ge(0), Dimension("length")]
    half_height: Annotated[
        float, Gt(0), Dimension("length")
    ]  # of the curtain, about the line of fire
    tick: Time
    edge_jitter: Time
    clock_u: Number

    def __post_init__(self) -> None:
        if (
            list(self.distances) != sorted(set(self.distances), reverse=True)
            or self.distances[-1] <= 0
        ):
            raise ValueError(
                "distances must fall from the cannon's gate to the target's, all above 0"
            )

    def ideal(self) -> Self:
        """Return gates that stand where surveyed, with a perfect clock."""
        return replace(self, distance_u=0.0, tick=0.0, edge_jitter=0.0, clock_u=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """True flights of a batch: speeds at the target [m/s], drag [1/m], radius [m], shape (shot,).

    `rise_per_metre` is the slope of the rebound out of the horizontal; `gravity` bends it down.
    """

    speed_in: Array
    speed_out: Array
    drag: Array
    radius: float
    rise_per_metre: Array
    gravity: float


@dataclass(frozen=True, slots=True)
class LightGates:
    """The curtains of one laboratory, true places and clock drawn once."""

    spec: LightGateSpec
    distances: Array
    clock: float

    @classmethod
    def commission(cls, spec: LightGateSpec, draws: Draws, name: str) -> Self:
        survey = draws.normal(f"{name}.distances", (len(spec.distances),))
        clock = float(draws.normal(f"{name}.clock"))
        return cls(
            spec,
            np.asarray(spec.distances) + spec.distance_u * survey,
            1 + spec.clock_u * clock,
        )

    def calibration(self) -> dict[str, Estimate]:
        """Return what the laboratory knows: a distance for each gate, shown time = clock x time."""
        known = {
            f"distance_{index}": Estimate(value=distance, u=self.spec.distance_u)
            for index, distance in enumerate(self.spec.distances)
        }
        return known | {"clock": Estimate(value=1.0, u=self.spec.clock_u)}

    def errors(self) -> dict[str, float]:
        """Return the true constants, to be sealed."""
        true = {f"distance_{index}": float(d) for index, d in enumerate(self.distances)}
        return true | {"clock": self.clock}

    def arrival(self, passage: Passage) -> Array:
        """Return the true time from the trigger to contact [s], shape (shot,).

        The trigger is the first edge of the far gate.
        """
        return time_before(self.distances[0] + passage.radius, passage.speed_in, passage.drag)

    def watch(
        self,
        passage: Passage,
        contact: ArrayLike,
        leaving: ArrayLike,
        draws: Draws,
        name: str,
        block: int,
    ) -> GateRecord:
        """Record balls that reach the target at `contact` and leave it at `leaving` [s]."""
        edge = passage.radius * np.array([1.0, -1.0])
        shots = (slice(None), None, None)
        ahead = self.distances[:, None] + edge
        inbound = np.asarray(contact)[shots] - time_before(
            ahead, passage.speed_in[shots], passage.drag[shots]
        )
        back = self.distances[:, None] - edge
        speed_out = np.where(passage.speed_out > 0, passage.speed_out, np.nan)
        flight = time_after(back, speed_out[shots], passage.drag[shots])
        height = passage.rise_per_metre[shots] * back - passage.gravity / 2 * flight**2
        seen = np.abs(height) < self.spec.half_height
        outbound = np.where(seen, np.asarray(leaving)[shots] + flight, np.nan)
        times = np.stack([inbound, outbound], axis=1)
        return GateRecord(times=self._time(times, draws, name, block))

    def _time(self, times: Array, draws: Draws, name: str, block: int) -> Array:
        start = self.spec.tick * draws.uniform(f"{name}.start", (len(times), 1, 1, 1), block)
        jitter = self.spec.edge_jitter * draws.normal(f"{name}.jitter", times.shape, block)
        return quantise(self.clock * times + start + jitter, self.spec.tick)
