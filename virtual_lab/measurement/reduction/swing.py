"""Encoder records of a swung bat: rate and angle at contact, from the rotation just before it.

Ripple and droop of the drive are slow compared with the record, so a polynomial of low order in
time fits the angle up to contact; each shot is fitted about its time of contact. A bat that is not
square to the ball at the nominal time meets the ball a little before or after the time from the
gates.
"""

from __future__ import annotations

import numpy as np

from virtual_lab.measurement.reduction.rate import RateFit
from virtual_lab.records import EncoderRecord
from virtual_lab.units import Array

DEGREE = 3


def fit_swing(record: EncoderRecord, contact: Array, reach: Array) -> RateFit:
    """Fit a batch of shots.

    Parameters
    ----------
    record
        Counts (shot, sample) at common times; 0 where the bat stands square to the ball.
    contact
        Uncorrected time at which the ball reaches the plane of a square bat, from the gates,
        shape (shot,) [s].
    reach
        The ball's time over the motion of the struck point for one encoder count, shape (shot,)
        [s].

    A shot that the gates did not see, or saw too early for a fit, has a rate of NaN.

    Raises
    ------
    ValueError
        The record holds too little before any contact to fit anything.
    """
    if not np.isfinite(contact).any():
        raise ValueError("the gates saw no ball come in")
    # a bat three degrees out of step meets the ball no sooner than 1 ms before
    samples = np.searchsorted(record.times, contact - 1e-3)
    enough = np.isfinite(contact) & (samples >= 5 * (DEGREE + 1))
    if not enough.any():
        raise ValueError("the encoder record holds too little before contact")
    fitted = np.full((4, contact.size), np.nan)  # rate, its u, angle, residual
    # shots of as many samples before contact share the matrix of their fit
    for number in np.unique(samples[enough]):
        shots = enough & (samples == number)
        before = record.counts[shots, :number]
        fitted[:, shots] = _fit(record.times[:number], before, contact[shots], reach[shots])
    rate, rate_u, angle, residual = fitted
    return RateFit(
        rate=rate,
        rate_u=rate_u,
        before=np.full(contact.shape, np.nan),
        angle=angle,
        ring_frequency=np.zeros(0),
        ring_decay=np.zeros(0),
        rest=np.full(contact.shape, np.nan),
        residual=residual,
    )


def _fit(
    times: Array, counts: Array, contact: Array, reach: Array
) -> tuple[Array, Array, Array, Array]:
    """Return rate, its u, angle and residual at contact, for records of equal times, (shot,)."""
    span = times[-1] - times[0]
    orthogonal, triangle = np.linalg.qr(
        np.vander((times - times[-1]) / span, DEGREE + 1, increasing=True)
    )
    seen = counts @ orthogonal
    coefficients = np.linalg.solve(triangle, seen.T)
    left = counts - seen @ orthogonal.T
    square = (left**2).sum(axis=1)
    powers = np.arange(DEGREE + 1)[:, None]

    def at(time: Array) -> tuple[Array, Array, Array]:
        """Return angle, rate and the rate's row of the fit at a time."""
        beyond = (time - times[-1]) / span
        row = powers * beyond ** np.maximum(powers - 1, 0) / span
        return (beyond**powers * coefficients).sum(axis=0), (row * coefficients).sum(axis=0), row

    angle, rate, _ = at(contact)
    sooner = reach * angle / (1 + rate * reach)  # ball and bat, each at its speed
    angle, rate, row = at(contact - sooner)
    leverage = (np.linalg.solve(triangle.T, row) ** 2).sum(axis=0)
    variance = square / (times.size - DEGREE - 1)
    return rate, np.sqrt(variance * leverage), angle, np.sqrt(square / times.size)
