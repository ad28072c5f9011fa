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
    # shots of as many samples before contact share the matrix of their fit
    samples = np.searchsorted(record.times, contact - MARGIN)
    if samples.min() < 5 * (DEGREE + 1):
        raise ValueError("the encoder record holds too little before contact")
    fitted = np.empty((4, contact.size))  # rate, its u, angle, residual
    for number in np.unique(samples):
        shots = samples == number
        fitted[:, shots] = _fit(
            record.times[:number], record.counts[shots, :number], contact[shots]
        )
    rate, rate_u, angle, residual = fitted
    return RateFit(
        rate=rate,
        rate_u=rate_u,
        before=np.full(contact.shape, np.nan),
        angle=angle,
        ring_frequency=np.zeros(0),
        ring_decay=np.zeros(0),
        residual=residual,
    )


def _fit(times: Array, counts: Array, contact: Array) -> tuple[Array, Array, Array, Array]:
    """Return rate, its u, angle and residual at contact of shots with the same samples, (shot,)."""
    span = times[-1] - times[0]
    orthogonal, triangle = np.linalg.qr(
        np.vander((times - times[-1]) / span, DEGREE + 1, increasing=True)
    )
    seen = counts @ orthogonal
    coefficients = np.linalg.solve(triangle, seen.T)
    left = counts - seen @ orthogonal.T
    square = (left**2).sum(axis=1)
    beyond = (contact - times[-1]) / span
    powers = np.arange(DEGREE + 1)[:, None]
    at = beyond**powers
    slope = powers * beyond ** np.maximum(powers - 1, 0) / span
    leverage = (np.linalg.solve(triangle.T, slope) ** 2).sum(axis=0)
    variance = square / (times.size - DEGREE - 1)
    return (
        (slope * coefficients).sum(axis=0),
        np.sqrt(variance * leverage),
        (at * coefficients).sum(axis=0),
        np.sqrt(square / times.size),
    )
