"""Encoder records of a swung bat: rate and angle at contact, from the rotation just before it.

Ripple and droop of the drive are slow compared with the record, so a polynomial of low order in
time fits the angle up to contact; each shot is fitted about its time of contact. A bat that is not
square to the ball at the nominal time meets the ball a little before or after the time from the
gates.
"""

from __future__ import annotations

import numpy as np

from virtual_lab.measurement.reduction.rate import RateFit, counting_noise
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
    fitted = np.full((7, contact.size), np.nan)  # the names below
    # shots of as many samples before contact share the matrix of their fit
    for number in np.unique(samples[enough]):
        shots = enough & (samples == number)
        before = record.counts[shots, :number]
        fitted[:, shots] = _fit(record.times[:number], before, contact[shots], reach[shots])
    rate, rate_u, angle, residual, by_half, by_half_u, span = fitted
    return RateFit(
        rate=rate,
        rate_u=rate_u,
        by_half=by_half,
        by_half_u=by_half_u,
        span=span,
        before=np.full(contact.shape, np.nan),
        angle=angle,
        ring_frequency=np.zeros(0),
        ring_decay=np.zeros(0),
        rest=np.full(contact.shape, np.nan),
        residual=residual,
        counting=counting_noise(record.counts),
    )


def _fit(times: Array, counts: Array, contact: Array, reach: Array) -> tuple[Array, ...]:
    """Return what is known at contact, for records of equal times, (shot,) each.

    Rate, its u, angle, residual, rate by the later half of the record, u of its difference from
    that by the whole, and the time fitted.
    """
    origin, span = times[-1], times[-1] - times[0]
    clock = (times - origin) / span
    powers = np.arange(DEGREE + 1)[:, None]
    coefficients, triangle, square = _cubic(clock, counts)

    def at(time: Array) -> tuple[Array, Array, Array]:
        """Return angle, rate and the rate's row of the fit at a time."""
        beyond = (time - origin) / span
        row = powers * beyond ** np.maximum(powers - 1, 0) / span
        return (beyond**powers * coefficients).sum(axis=0), (row * coefficients).sum(axis=0), row

    angle, rate, _ = at(contact)
    sooner = reach * angle / (1 + rate * reach)  # ball and bat, each at its speed
    angle, rate, row = at(contact - sooner)
    leverage = (np.linalg.solve(triangle.T, row) ** 2).sum(axis=0)
    variance = square / (times.size - DEGREE - 1)
    later = slice(times.size // 2, None)
    by_half, triangle, _ = _cubic(clock[later], counts[:, later])
    more = (np.linalg.solve(triangle.T, row) ** 2).sum(axis=0) - leverage
    return (
        rate,
        np.sqrt(variance * leverage),
        angle,
        np.sqrt(square / times.size),
        (row * by_half).sum(axis=0),
        # of a part against a least-squares fit of the whole: u² = u_part² - u_whole²
        np.sqrt(variance * np.maximum(more, 0.0)),
        np.full(rate.shape, span),
    )


def _cubic(clock: Array, counts: Array) -> tuple[Array, Array, Array]:
    """Return coefficients (power, shot), the triangle of the fit and the squares left (shot,)."""
    orthogonal, triangle = np.linalg.qr(np.vander(clock, DEGREE + 1, increasing=True))
    seen = counts @ orthogonal
    left = counts - seen @ orthogonal.T
    return np.linalg.solve(triangle, seen.T), triangle, (left**2).sum(axis=1)
