"""Encoder records of a swung bat: rate and angle at contact, from the rotation just before it.

Ripple and droop of the drive are slow compared with the record, so the angle up to contact is
fitted by a polynomial of low order in time, about the time of contact of each shot. A bat that is
not square to the ball at the time from the gates meets the ball a little earlier or later.
"""

from __future__ import annotations

import numpy as np

from virtual_lab.measurement.reduction.rate import RateFit, counting_noise
from virtual_lab.records import EncoderRecord
from virtual_lab.units import Array

DEGREE = 3


def fit_swing(record: EncoderRecord, contact: Array, delay: Array) -> RateFit:
    """Return rate [counts/s] and angle [counts] of a swung bat at contact in each shot, (shot,).

    The results of a shot are NaN if the gates did not detect the ball, or if the ball came too
    early for a fit.

    Parameters
    ----------
    record
        Counts (shot, sample) at times that all shots share. The count is 0 where the bat is square
        to the ball.
    contact
        Time of contact with a bat that is square to the ball, shape (shot,) [s]. It is computed
        from the gate times, without calibration corrections.
    delay
        Distance that the bat moves during one encoder count at the impact position, divided by the
        speed of the ball, shape (shot,) [s].

    Raises
    ------
    ValueError
        The gates detected no ball, or the record before contact is too short for a fit in all
        shots.
    """
    if not np.isfinite(contact).any():
        raise ValueError("the gates saw no incoming ball")
    # A bat three degrees out of phase meets the ball at most 1 ms earlier.
    samples = np.searchsorted(record.times, contact - 1e-3)
    enough = np.isfinite(contact) & (samples >= 5 * (DEGREE + 1))
    if not enough.any():
        raise ValueError("the encoder record is too short before contact")
    fitted = np.full((7, contact.size), np.nan)  # rows in the order of the names below
    # Shots with the same number of samples before contact share the matrix of the fit.
    for number in np.unique(samples[enough]):
        shots = enough & (samples == number)
        before = record.counts[shots, :number]
        fitted[:, shots] = _fit(record.times[:number], before, contact[shots], delay[shots])
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


def _fit(times: Array, counts: Array, contact: Array, delay: Array) -> tuple[Array, ...]:
    """Return the results at contact for records with common times, each (shot,).

    The results are rate, u of the rate, angle, residual, rate from the later half of the record, u
    of the difference between the rates of half and whole, and fitted duration.
    """
    origin, span = times[-1], times[-1] - times[0]
    clock = (times - origin) / span
    powers = np.arange(DEGREE + 1)[:, None]
    coefficients, triangle, square = _cubic(clock, counts)

    def at(time: Array) -> tuple[Array, Array, Array]:
        """Return angle, rate, and the row of the fit for the rate at a time."""
        beyond = (time - origin) / span
        row = powers * beyond ** np.maximum(powers - 1, 0) / span
        return (beyond**powers * coefficients).sum(axis=0), (row * coefficients).sum(axis=0), row

    angle, rate, _ = at(contact)
    sooner = delay * angle / (1 + rate * delay)  # because ball and bat approach each other
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
        # difference between the fits of a part and of the whole: u² = u_part² - u_whole²
        np.sqrt(variance * np.maximum(more, 0.0)),
        np.full(rate.shape, span),
    )


def _cubic(clock: Array, counts: Array) -> tuple[Array, Array, Array]:
    """Return coefficients (power, shot), triangle of the fit, and squared residuals (shot,)."""
    orthogonal, triangle = np.linalg.qr(np.vander(clock, DEGREE + 1, increasing=True))
    projection = counts @ orthogonal
    residual = counts - projection @ orthogonal.T
    return np.linalg.solve(triangle, projection.T), triangle, (residual**2).sum(axis=1)
