"""The angle encoder on the pivot: whole counts at the ticks of the recorder.

It turns with the section of the bat at the pivot, so it shows the rigid turn and the bending
ring alike, and its mounting makes it show a little more or less than the true angle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, sqrt, tau
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension, YesNo
from virtual_lab.records import EncoderRecord, RateRecord
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    Freedom,
    TrueConstant,
)
from virtual_lab.streams import Draws, Slots
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderSpec(CalibratedSpec):
    """Data sheet of the encoder and its recorder."""

    other_errors: ClassVar[tuple[str, ...]] = ("whole_counts", "sees_ring")

    kind: str
    title: str
    counts_per_turn: Annotated[int, Gt(0), Dimension("number")]
    sample_rate: Annotated[float, Gt(0), Dimension("frequency")]
    duration: Annotated[float, Gt(0), Dimension("time")]
    scale_u: Annotated[float, Ge(0), Dimension("number")]
    scale: Annotated[float, Gt(0), Dimension("number")] = 1.0
    scale_dof: Freedom = inf
    whole_counts: YesNo = True
    sees_ring: YesNo = True

    def sample_times(self) -> Array:
        """Return the recorder's ticks from the trigger on [s], shape (sample,)."""
        return np.arange(round(self.duration * self.sample_rate)) / self.sample_rate


@dataclass(frozen=True, slots=True)
class Encoder(CalibratedInstrument[EncoderSpec]):
    """The encoder of one laboratory."""

    def exact(self) -> dict[str, Estimate]:
        return {"counts_per_turn": Estimate(value=float(self.spec.counts_per_turn))}

    @property
    def scale(self) -> TrueConstant:
        """Angle shown over true angle."""
        return self.true["scale"]

    def sum_up(
        self,
        rate: Array,
        draws: Draws,
        name: str,
        slots: Slots,
        *,
        span: Array,
        gap: float,
        angle: Array | None = None,
    ) -> RateRecord:
        """Record rates [rad a shown second] at contact, (shot,), as a recorder that fits would.

        It fits a cubic to the counts of a `span` (shot,) that ends, or begins, a `gap` from
        contact [s]. The noise is that of the cubic's slope there, of n counts each rounded:
        with Legendre's polynomials σ √(Σ (2k + 1) P_k'² / n) 2/span, at 1 + 2 gap/span.
        """
        spec, per_angle = self.spec, self.scale * self.spec.counts_per_turn / tau
        count = sqrt(1 / 12) if spec.whole_counts else 0.0
        at = 1 + 2 * gap / span
        slopes = 3 + 5 * (3 * at) ** 2 + 7 * (7.5 * at**2 - 1.5) ** 2
        u = count * np.sqrt(slopes / (span * spec.sample_rate)) * 2 / span
        noise = u * draws.normal(f"{name}.sums", slots=slots)
        swung = angle is not None
        return RateRecord(
            rate=per_angle * rate + noise,
            rate_u=u,
            before=np.full(rate.shape, np.nan if swung else 0.0),
            angle=np.full(rate.shape, np.nan) if angle is None else per_angle * angle,
        )

    def read(
        self, turn: Callable[[slice], Array], draws: Draws, name: str, slots: Slots
    ) -> EncoderRecord:
        """Count a turn from a rest angle of any phase.

        `turn` gives the true angles [rad] of some of the shots, (shot, sample), which are then
        overwritten: a few shots at a time stay in the cache.
        """
        spec, per_angle = self.spec, self.scale * self.spec.counts_per_turn / tau
        times = spec.sample_times()
        shots = slots.size
        rest = draws.uniform(f"{name}.rest", 1, slots)
        counts = np.empty((shots, times.size))
        for first in range(0, shots, 32):
            part = slice(first, first + 32)
            angle = turn(part)
            angle *= per_angle
            np.add(angle, rest[part] + 0.5 if spec.whole_counts else rest[part], out=counts[part])
            if spec.whole_counts:
                np.floor(counts[part], out=counts[part])
        counts.setflags(write=False)
        return EncoderRecord(counts=counts, times=times)
