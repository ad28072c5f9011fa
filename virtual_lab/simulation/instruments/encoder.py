"""The angle encoder on the pivot: integer counts at the sampling times of the recorder.

It rotates with the section of the bat at the pivot, so it records both the rigid rotation and the
bending vibration. Because of its mounting, the recorded angle differs from the true angle by a
factor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt, tau
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension, YesNo
from virtual_lab.records import EncoderRecord, RateRecord, Record
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

    def numbers_in(
        self, records: Sequence[Record], constants: Mapping[str, float]
    ) -> Mapping[str, object]:
        """Return rate and duration of the sampling."""
        numbers: dict[str, object] = {}
        for record in records:
            if isinstance(record, EncoderRecord):
                tick = float(record.times[1] - record.times[0])
                numbers = {"sample_rate": 1 / tick, "duration": record.times.size * tick}
        return numbers

    def sample_times(self) -> Array:
        """Return the sampling times after the trigger [s], shape (sample,)."""
        return np.arange(round(self.duration * self.sample_rate)) / self.sample_rate


@dataclass(frozen=True, slots=True)
class Encoder(CalibratedInstrument[EncoderSpec]):
    """The encoder of one laboratory."""

    def exact(self) -> dict[str, Estimate]:
        return {"counts_per_turn": Estimate(value=float(self.spec.counts_per_turn))}

    @property
    def scale(self) -> TrueConstant:
        """Ratio of recorded to true angle."""
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
        """Return the record of a recorder that fits the angular rate at contact, (shot,).

        `rate` is the true rate [rad per recorded second]. The recorder fits a cubic to the counts
        of a `span` (shot,) that ends, or begins, at a time `gap` from contact [s]. The noise is the
        noise of the slope of this cubic at contact, for n rounded counts. With Legendre polynomials
        it is σ √(Σ (2k + 1) P_k'² / n) 2/span, at 1 + 2 gap/span. For a swung bat `angle` is its
        angle at contact, and the recorded rate before contact is NaN. Otherwise the recorded angle
        is NaN, and the rate before contact is 0.
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
        """Return the counts of a rotation that starts at a random phase of the encoder.

        The function `turn` returns the true angles of a slice of the shots, (shot, sample) [rad];
        these arrays are overwritten. A few shots are processed at a time, so that they fit in the
        cache.
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
