"""Rotation of the bat at contact, from encoder counts or from the recorder's sums."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import sqrt
from typing import Any

import numpy as np

from virtual_lab.measurement.reduction.flights import Shots, some_of
from virtual_lab.records import EncoderRecord, RateRecord
from virtual_lab.units import Array

WIDTHS = range(8, 33)  # of a counter that starts again [bit]
MOST_MISFIT = 1.5  # of a fit that holds, over what counting and noise at rest leave


@dataclass(frozen=True, slots=True, kw_only=True)
class RateFit:
    """Encoder results of a batch of shots, in counts and uncorrected seconds."""

    rate: Array  # at contact: its end for a struck bat, its beginning for a swung one, (shot,)
    rate_u: Array  # its standard uncertainty from the fit, (shot,)
    by_half: Array  # rate by the half of the record nearest contact, NaN: not recorded, (shot,)
    by_half_u: Array  # standard uncertainty of its difference from `rate`, (shot,)
    span: Array  # of the record that was fitted, NaN: not recorded, (shot,) [s]
    before: Array  # rate before contact, of a bat that should be at rest, (shot,)
    angle: Array  # at contact, of a bat that is swung, from square to the ball, (shot,) [counts]
    ring_frequency: Array  # (ring,) [Hz]
    ring_decay: Array  # (ring,) [1/s]
    rest: Array  # rms noise at rest, before contact, NaN: it was not recorded, (shot,) [counts]
    residual: Array  # rms, NaN: not recorded, (shot,) [counts]
    counting: float  # rms error of whole counts [counts]

    def part(self, chosen: Shots) -> RateFit:
        """Return some of the shots, see `some_of`."""
        shared = ("ring_frequency", "ring_decay", "counting")
        own: dict[str, Any] = {
            each.name: some_of(getattr(self, each.name), chosen)
            for each in fields(self)
            if each.name not in shared
        }
        return replace(self, **own)

    @property
    def misfit(self) -> Array:
        """Residual over what counting and noise at rest leave, NaN: not recorded, (shot,)."""
        return np.asarray(self.residual / self.noise)

    @property
    def noise(self) -> Array:
        """Rms that counting and noise at rest leave, (shot,) [counts]."""
        return np.hypot(self.counting, np.nan_to_num(self.rest))


def unwrapped(record: EncoderRecord, counts_per_turn: float, contact: Array) -> EncoderRecord:
    """Return the record of a counter that never starts again.

    A counter of n bits, with or without a sign, and one that counts a turn start again at the other
    end of their range. Such a step is larger than half the range, which the counts fill. The
    counts at `contact`, (shot,) [s], are left within half the range of 0.
    """
    counts = record.counts
    steps = np.diff(counts)
    size, extent = np.abs(steps), np.ptp(counts)
    for period in sorted({counts_per_turn, *(2.0**bits for bits in WIDTHS)}):
        again = size > period / 2
        if extent < period and again.any():
            usual = size[~again].max(initial=1.0)
            if (np.abs(size[again] - period) > 2 * usual).any():
                continue  # a fault, which the fit shows
            counts = counts.copy()
            counts[:, 1:] -= period * np.cumsum(np.sign(steps) * again, axis=1)
            at = np.searchsorted(record.times, contact).clip(max=record.times.size - 1)
            ends = counts[np.arange(len(counts)), at]
            return replace(record, counts=counts - period * np.rint(ends / period)[:, None])
    return record


def counting_noise(counts: Array) -> float:
    """Return the rms error of an encoder's counts, which may go in steps of several [counts]."""
    steps = np.diff(counts)
    if not np.array_equal(steps, np.rint(steps)):
        return 1 / sqrt(12)
    return max(int(np.gcd.reduce(steps.astype(np.int64), axis=None)), 1) / sqrt(12)


def unseen(shots: int) -> RateFit:
    """Return empty rates, for shots without a known contact."""
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


def summed_up(record: RateRecord) -> RateFit:
    """Return the rates computed by the encoder's recorder, which does not say how it fitted."""
    return replace(
        unseen(len(record.rate)),
        rate=record.rate,
        rate_u=record.rate_u,
        before=record.before,
        angle=record.angle,
    )
