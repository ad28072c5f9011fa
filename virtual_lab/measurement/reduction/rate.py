"""Rotation of the bat at contact, from encoder counts or from the recorder's sums."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_lab.records import RateRecord
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class RateFit:
    """Encoder results of a batch of shots, in counts and uncorrected seconds."""

    rate: Array  # at contact: its end for a struck bat, its beginning for a swung one, (shot,)
    rate_u: Array  # its standard uncertainty from the fit, (shot,)
    before: Array  # rate before contact, of a bat that should be at rest, (shot,)
    angle: Array  # at contact, of a bat that is swung, from square to the ball, (shot,) [counts]
    ring_frequency: Array  # (ring,) [Hz]
    ring_decay: Array  # (ring,) [1/s]
    rest: Array  # rms noise at rest, before contact, NaN: it was not recorded, (shot,) [counts]
    residual: Array  # rms, (shot,) [counts]


def unseen(shots: int) -> RateFit:
    """Return empty rates, for shots without a known contact."""
    none = np.full(shots, np.nan)
    empty = np.zeros(0)
    return RateFit(
        rate=none,
        rate_u=none,
        before=none,
        angle=none,
        ring_frequency=empty,
        ring_decay=empty,
        rest=none,
        residual=none,
    )


def summed_up(record: RateRecord) -> RateFit:
    """Return the rates computed by the encoder's recorder."""
    return RateFit(
        rate=record.rate,
        rate_u=record.rate_u,
        before=record.before,
        angle=record.angle,
        ring_frequency=np.zeros(0),
        ring_decay=np.zeros(0),
        rest=np.full(record.rate.shape, np.nan),
        residual=np.full(record.rate.shape, np.nan),
    )
