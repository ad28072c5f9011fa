"""Encoder records of a swung bat: rate and angle at contact, from the turn just before it.

The drive ripples and droops slowly against the record, so a low polynomial in time follows the
angle up to contact; each shot is fitted about its own time of contact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records import EncoderRecord
from virtual_lab.reduction.rate import RateFit

__all__ = ["fit_swing"]

Array = NDArray[np.float64]
DEGREE = 3
MARGIN = 2e-4  # s, the gates' time of contact is surely better than this


def fit_swing(record: EncoderRecord, contact: Array) -> RateFit:
    """Fit a batch of shots.

    Parameters
    ----------
    record
        Counts (shot, sample) at common times; 0 where the bat stands square to the ball.
    contact
        Shown time of contact, shape (shot,) [s], from the gates.

    Raises
    ------
    ValueError
        The record holds too little before contact to fit anything.
    """
    seen = contact[np.isfinite(contact)]
    if not seen.size:
        raise ValueError("the gates saw no ball come in")
    contact = np.where(np.isfinite(contact), contact, np.median(seen))
    before = record.times[None] < contact[:, None] - MARGIN
    samples = before.sum(axis=1)
    if samples.min() < 5 * (DEGREE + 1):
        raise ValueError("the encoder record holds too little before contact")
    span = contact - record.times[0]
    clock = np.where(before, (record.times[None] - contact[:, None]) / span[:, None], 0.0)
    basis = np.stack([np.where(before, clock**power, 0.0) for power in range(DEGREE + 1)], axis=1)
    normal = basis @ basis.transpose(0, 2, 1)
    inverse = np.linalg.inv(normal)
    counts = np.where(before, record.counts, 0.0)
    coefficients = (inverse @ (basis @ counts[..., None]))[..., 0]
    fitted = (coefficients[:, None] @ basis)[:, 0]
    square = np.where(before, (counts - fitted) ** 2, 0.0).sum(axis=1)
    variance = square / (samples - DEGREE - 1)
    return RateFit(
        rate=coefficients[:, 1] / span,
        rate_u=np.sqrt(variance * inverse[:, 1, 1]) / span,
        before=np.full(contact.shape, np.nan),
        angle=coefficients[:, 0],
        ring_frequency=np.zeros(0),
        ring_decay=np.zeros(0),
        residual=np.sqrt(square / samples),
    )
