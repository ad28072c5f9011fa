"""Rotation of the bat at contact, from encoder counts or from the recorder's summary values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import ClassVar

import numpy as np

from virtual_lab.aligned import AlignedArrays
from virtual_lab.records import EncoderRecord, RateRecord
from virtual_lab.units import Array

WIDTHS = range(8, 33)  # widths of counters that can overflow [bit]
MOST_MISFIT = 1.5  # largest misfit of a good fit [rms of counting and noise at rest]


@dataclass(frozen=True, slots=True, kw_only=True)
class RateFit(AlignedArrays):
    """Encoder results of a batch of shots, in counts and uncorrected seconds."""

    # rate at the end of contact of a struck bat, at the beginning for a swung one, (shot,)
    rate: Array
    rate_u: Array  # standard uncertainty of `rate` from the fit, (shot,)
    by_half: Array  # rate from the half of the record nearest contact, NaN: not recorded, (shot,)
    by_half_u: Array  # standard uncertainty of `by_half` minus `rate`, (shot,)
    span: Array  # duration of the fitted record, NaN: not recorded, (shot,) [s]
    before: Array  # rate before contact of a bat that should be at rest, (shot,)
    angle: Array  # angle of a swung bat at contact, from square to the ball, (shot,) [counts]
    ring_frequency: Array  # (ring,) [Hz]
    ring_decay: Array  # (ring,) [1/s]
    rest: Array  # rms noise at rest before contact, NaN: not recorded, (shot,) [counts]
    residual: Array  # rms residual of the fit, NaN: not recorded, (shot,) [counts]
    counting: float  # rms error of whole counts [counts]

    aligned: ClassVar = (
        *("rate", "rate_u", "by_half", "by_half_u", "span", "before", "angle"),
        *("rest", "residual"),
    )

    @property
    def misfit(self) -> Array:
        """Residual divided by the noise of counting and at rest, (shot,). NaN: not recorded."""
        return np.asarray(self.residual / self.noise)

    @property
    def noise(self) -> Array:
        """Rms noise of counting and at rest together, (shot,) [counts]."""
        return np.hypot(self.counting, np.nan_to_num(self.rest))


def unwrap(record: EncoderRecord, counts_per_turn: float, contact: Array) -> EncoderRecord:
    """Return an encoder record without the overflows of its counter.

    A counter has a range. At the end of the range, the counter continues at the other end. The
    possible ranges are:

    * one turn, `counts_per_turn`
    * 2^n counts for a counter of n bits, where n is 8 to 32

    The smallest possible range that agrees with the record is used. A step of more than half the
    range is an overflow. After all overflows are removed, the counts of each shot are shifted by
    whole ranges. The count at the time `contact`, (shot,) [s], is then within half a range of 0. A
    record without overflows is returned unchanged.
    """
    counts = record.counts
    steps = np.diff(counts)
    size, extent = np.abs(steps), np.ptp(counts)
    for period in sorted({counts_per_turn, *(2.0**bits for bits in WIDTHS)}):
        again = size > period / 2
        if extent < period and again.any():
            usual = size[~again].max(initial=1.0)
            if (np.abs(size[again] - period) > 2 * usual).any():
                continue  # a fault, which increases the misfit of the fit
            counts = counts.copy()
            counts[:, 1:] -= period * np.cumsum(np.sign(steps) * again, axis=1)
            at = np.searchsorted(record.times, contact).clip(max=record.times.size - 1)
            ends = counts[np.arange(len(counts)), at]
            return replace(record, counts=counts - period * np.rint(ends / period)[:, None])
    return record


def counting_noise(counts: Array) -> float:
    """Return the rms error caused by the resolution of an encoder's counts [counts].

    It is s/√12, where s is the resolution. s is the greatest common divisor of all changes of the
    count, at least 1. If a change is not a whole number, s is 1.
    """
    steps = np.diff(counts)
    if not np.array_equal(steps, np.rint(steps)):
        return 1 / sqrt(12)
    return max(int(np.gcd.reduce(steps.astype(np.int64), axis=None)), 1) / sqrt(12)


def empty_rates(shots: int) -> RateFit:
    """Return empty encoder results, for shots in which the time of the contact is unknown.

    `shots` is the number of shots. Each field is an array of NaN, (shot,), with three exceptions.
    The fields `ring_frequency` and `ring_decay` are empty arrays (0,). The field `counting`, the
    standard uncertainty by rounding to whole counts, is 1/√12 counts.
    """
    none, empty = np.full(shots, np.nan), np.zeros(0)
    return RateFit(
        rate=none,
        rate_u=none,
        by_half=none,
        by_half_u=none,
        span=none,
        before=none,
        angle=none,
        ring_frequency=empty,
        ring_decay=empty,
        rest=none,
        residual=none,
        counting=1 / sqrt(12),
    )


def rates_from_summary(record: RateRecord) -> RateFit:
    """Return the encoder results that the encoder's own recorder computed, arrays (shot,).

    `rate`, `rate_u` and `before` [counts/s] and `angle` [counts] are copied from the record. The
    recorder stores no other results. The other fields (shot,) are therefore NaN, and the vibration
    frequencies and decays are empty arrays (0,). The field `counting`, the standard uncertainty by
    rounding to whole counts, is 1/√12 counts.
    """
    return replace(
        empty_rates(len(record.rate)),
        rate=record.rate,
        rate_u=record.rate_u,
        before=record.before,
        angle=record.angle,
    )
