"""Encoder records: rate of recoil at contact, from a joint fit of rotation and vibration.

The encoder measures the rigid rotation, slowed by bearing and air, plus the bending vibration
(ring). At the pivot, the angular rate of the vibration is as large as that of the rotation. All
shots of a batch are at one bat, so they share frequencies and decays of the vibration. Rotation,
slowing, phases and amplitudes differ between shots and enter linearly. The shared parameters are
fitted by variable projection (Golub & Pereyra 1973, Jacobian of Kaufman 1975). If the end of a
record does not fit, the bat has hit its stop. The fit of all shots then ends at the first time at
which a bat reaches its largest angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np

from virtual_lab.measurement.reduction.rate import RateFit, counting_noise
from virtual_lab.records import EncoderRecord
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True)
class RecoilFit:
    """Settings of the fit of rotation and vibration."""

    polynomial_order: int = 3  # order of the rotation: rate and two terms of its slowing
    most_rings: int = 6
    slowest_ring: float = 60.0  # lowest frequency of a bat; a slipping coupling is slower [Hz]
    settling_time: float = 3e-3  # time after contact at which the forced motion is over [s]
    # duration of contact [s]; the rotation is extrapolated to its end. Data of balls are
    # 0.6 to 1.0 ms, about 0.7 ms at 60 mph. Friction reduces the rate by 1e-4 per millisecond.
    contact_duration: float = 0.7e-3
    first_decay: float = 5.0  # start value of the decay [1/s]
    greatest_decay: float = 300.0  # largest decay [1/s]
    peak_over_median: float = 20.0  # smallest peak of a vibration in the periodogram [median]
    most_steps: int = 10
    shots_searched: int = 48  # number of shots from which the frequencies are determined
    odd: float = 2.0  # residual beyond which a shot is not used for frequencies [median]
    turned: float = 3.0  # misfit at the end of a record that shows a bat at its stop (noise: 1.7)
    shots_together: int = 32  # number of shots whose residuals fit in the cache
    converged_step: float = 1e-5  # step at which the fit has converged [1/record length]
    residual: float = 1e-3  # rms residual without vibration for fractional counts [counts]
    residual_of_counts: float = 1.02 / sqrt(12)  # the same for integer counts, with a margin


RECOIL = RecoilFit()


def fit_recoil(record: EncoderRecord, contact: Array) -> RateFit:
    """Return the recoil rates of one bat in all shots, by a joint fit of rotation and vibration.

    Parameters
    ----------
    record
        Counts (shot, sample) at times that all shots share.
    contact
        Time of contact, shape (shot,) [s], computed from the gates. It refers to the clock of the
        encoder. It is NaN if the gates did not detect the ball.

    Returns
    -------
    RateFit
        Rates at the end of contact, (shot,) [counts/s]. The calibration of the encoder's clock is
        not yet applied. A shot without a contact has NaN.

    Raises
    ------
    ValueError
        The record ends too soon after the last contact for a fit. Or no shot has a contact.
    """
    contacts = contact[np.isfinite(contact)]
    after = record.times > (contacts.max() if contacts.size else np.inf) + RECOIL.settling_time
    fewest = 20 * (RECOIL.polynomial_order + 1 + 2 * RECOIL.most_rings)
    if after.sum() < fewest:
        raise ValueError("the encoder record ends too soon after contact")
    first = int(after.argmax())
    until = _samples_before_stop(record.counts[:, first:])
    whole, beyond = _fit(record, contact, slice(first, None), until)
    if (beyond > RECOIL.turned).any() and until >= fewest:
        return _fit(record, contact, slice(first, first + until), until)[0]
    return whole


def _fit(record: EncoderRecord, contact: Array, tail: slice, until: int) -> tuple[RateFit, Array]:
    """Return the fit of a part of the record, and its misfit from sample `until` on, (shot,)."""
    times, counts = record.times[tail], record.counts[:, tail]
    origin, span = times[0], times[-1] - times[0]
    clock = (times - origin) / span
    # All shots have the same vibrations, so some shots of a large batch give the frequencies.
    is_whole = bool(np.array_equal(counts[:1], np.rint(counts[:1])))
    no_ring = RECOIL.residual_of_counts if is_whole else RECOIL.residual
    searched = counts[: RECOIL.shots_searched].T
    rings, basis = _find_rings(clock, searched, span, no_ring)
    rms = np.sqrt((project(basis, searched)[1] ** 2).mean(axis=0))
    odd = rms > RECOIL.odd * np.median(rms)  # a jump in one shot is not a vibration
    if odd.any():
        rings, basis = _find_rings(clock, searched[:, ~odd], span, no_ring)
    row = np.zeros((contact.size, basis.shape[1]))
    release = (contact + RECOIL.contact_duration - origin) / span
    for power in range(1, RECOIL.polynomial_order + 1):
        row[:, power] = power * release ** (power - 1) / span
    rate, leverage, square, tail_square = _rates(basis, counts, row, until)
    half = len(times) // 2
    by_half, half_leverage, _, _ = _rates(basis[:half], counts[:, :half], row, half)
    variance = square / (len(times) - basis.shape[1] - len(rings))
    before, rest = _fit_at_rest(record, contact)
    fit = RateFit(
        rate=rate,
        rate_u=np.sqrt(variance * leverage),
        by_half=by_half,
        # difference between the fits of a part and of the whole: u² = u_part² - u_whole²
        by_half_u=np.sqrt(variance * np.maximum(half_leverage - leverage, 0.0)),
        span=np.where(np.isfinite(contact), span, np.nan),
        counting=counting_noise(record.counts),
        before=before,
        angle=np.full(contact.shape, np.nan),
        ring_frequency=rings[:, 0] / span,
        ring_decay=rings[:, 1] / span,
        rest=rest,
        residual=np.sqrt(square / len(times)),
    )
    return fit, np.sqrt(tail_square / max(len(times) - until, 1)) / fit.noise


def _samples_before_stop(counts: Array) -> int:
    """Return the number of samples before the first bat rebounds from its stop.

    A shot that reaches its largest count in less than half of the usual time (a bat that was not
    hit, or an encoder that jumps) is ignored here; its residual reveals it.
    """
    farthest = np.abs(counts - counts[:, :1]).argmax(axis=1)
    usual = farthest[farthest > np.median(farthest) / 2]
    return int(usual.min()) + 1 if usual.size else counts.shape[1]


def _rates(
    basis: Array, counts: Array, row: Array, until: int
) -> tuple[Array, Array, Array, Array]:
    """Return rates, their variances per squared count of noise, and sums of squared residuals.

    The four results are (shot,). The third is the sum over all samples. The fourth is the sum over
    the samples from `until` to the end.
    """
    orthogonal, triangle = np.linalg.qr(basis)
    weight = np.linalg.solve(triangle.T, row.T)
    rate, square, tail_square = np.empty((3, len(counts)))
    for first in range(0, len(counts), RECOIL.shots_together):
        part = slice(first, first + RECOIL.shots_together)
        projection = counts[part] @ orthogonal
        residual = counts[part] - projection @ orthogonal.T
        rate[part] = np.einsum("ps,sp->s", weight[:, part], projection)
        square[part] = np.einsum("st,st->s", residual, residual)
        tail_square[part] = np.einsum("st,st->s", residual[:, until:], residual[:, until:])
    return rate, (weight**2).sum(axis=0), square, tail_square


def _find_rings(clock: Array, counts: Array, span: float, no_ring: float) -> tuple[Array, Array]:
    """Return the vibrations of the shots, and the basis of the fit.

    The rounding to whole counts also causes spectral lines. They are ignored if the rms of the
    residual is at most `no_ring` [counts].
    """
    return _search_rings(clock.tobytes(), np.asarray(counts.T, float).tobytes(), span, no_ring)


@lru_cache(maxsize=32)  # a bench day is reduced after each entry, often with the same hits
def _search_rings(
    clock_bytes: bytes, counts_bytes: bytes, span: float, no_ring: float
) -> tuple[Array, Array]:
    """Return the result of `_find_rings`. Vibrations are added while the residual contains one."""
    clock = np.frombuffer(clock_bytes)
    counts = np.frombuffer(counts_bytes).reshape(-1, clock.size).T
    rings = np.empty((0, 2))  # frequency and decay in units of 1/span
    slowest = max(RECOIL.polynomial_order, RECOIL.slowest_ring * span)
    basis = turn_and_rings(clock, rings)
    while len(rings) < RECOIL.most_rings:
        _, residual = project(basis, counts)
        small = np.sqrt((residual**2).mean()) < no_ring
        peak = None if small else _strongest_line(clock, residual, slowest)
        if peak is None:
            break
        try:
            more = _refine(
                clock, counts, np.vstack([rings, [peak, RECOIL.first_decay * span]]), span
            )
        except np.linalg.LinAlgError:
            break  # the new vibration coincides with an existing one
        wider = turn_and_rings(clock, more)
        if np.linalg.matrix_rank(wider) < wider.shape[1]:
            break
        rings, basis = more, wider
    return rings, basis


def _strongest_line(clock: Array, residual: Array, slowest: float) -> float | None:
    """Return the frequency of the strongest line of the residual, None if there is no clear one."""
    n = len(clock)
    spectrum = np.fft.rfft(np.hanning(n)[:, None] * residual, 4 * n, axis=0)
    power = (np.abs(spectrum) ** 2).sum(axis=1)
    frequency = np.fft.rfftfreq(4 * n, clock[1] - clock[0])
    power[frequency < slowest] = 0.0
    best = int(power.argmax())
    return (
        float(frequency[best]) if power[best] > RECOIL.peak_over_median * np.median(power) else None
    )


def _refine(clock: Array, counts: Array, rings: Array, span: float) -> Array:
    """Return the vibrations with the smallest residual, by Gauss-Newton from a close start."""
    fastest_decay = RECOIL.greatest_decay * span
    for _ in range(RECOIL.most_steps):
        basis = turn_and_rings(clock, rings)
        orthogonal, triangle = np.linalg.qr(basis)
        projection = orthogonal.T @ counts
        coefficients, residual = (
            np.linalg.solve(triangle, projection),
            counts - orthogonal @ projection,
        )
        moves = clock[:, None] * basis[:, RECOIL.polynomial_order + 1 :]
        moves -= orthogonal @ (orthogonal.T @ moves)
        shares = _shares(coefficients[RECOIL.polynomial_order + 1 :])
        # normal equations for changes that are sums of products of moves and shares
        flat, between = shares.reshape(len(shares), -1), moves.T @ moves
        matrix = flat @ np.einsum("mn,pns->pms", between, shares).reshape(flat.shape).T
        step = np.linalg.lstsq(matrix, flat @ (moves.T @ residual).ravel(), rcond=None)[0]
        step = np.clip(step.reshape(-1, 2), [-0.5, -20.0], [0.5, 20.0])
        rings = np.clip(rings + step, [RECOIL.slowest_ring * span, 0.0], [np.inf, fastest_decay])
        if np.abs(step).max() < RECOIL.converged_step:
            break
    return rings


def _shares(coefficients: Array) -> Array:
    """Return the factor of each move in the derivative by each parameter, (parameter, move, shot).

    The parameters are frequencies and decays. A move is a column of a vibration multiplied by the
    time. `coefficients` are the coefficients of the columns, (move, shot).
    """
    moves, shots = coefficients.shape
    shares = np.zeros((moves // 2, 2, moves // 2, 2, shots))
    ring = np.arange(moves // 2)
    a, b = coefficients[::2], coefficients[1::2]
    shares[ring, 0, ring] = 2 * np.pi * np.stack([b, -a], axis=1)
    shares[ring, 1, ring] = -np.stack([a, b], axis=1)
    return shares.reshape(moves, moves, shots)


def turn_and_rings(clock: Array, rings: Array) -> Array:
    """Return the basis functions of the fit at each time, (sample, column).

    The first columns are the powers of time from 0 to `RECOIL.polynomial_order`. They are followed
    by two columns per vibration, a decaying cosine and a decaying sine. `clock` is the time,
    (sample,). `rings` holds the frequency and the decay of each vibration, (ring, 2). The unit of
    time is the length of the record.
    """
    columns = [clock**power for power in range(RECOIL.polynomial_order + 1)]
    for frequency, decay in rings:
        envelope = np.exp(-decay * clock)
        phase = 2 * np.pi * frequency * clock
        columns += [envelope * np.cos(phase), envelope * np.sin(phase)]
    return np.stack(columns, axis=1)


def project(basis: Array, data: Array) -> tuple[Array, Array]:
    """Return the coefficients, (column, shot), and the residuals, (sample, shot), of a linear fit.

    The fit minimizes the squared residuals of `data`, (sample, shot). `basis`, (sample, column),
    must have independent columns.
    """
    orthogonal, triangle = np.linalg.qr(basis)
    projection = orthogonal.T @ data
    return np.linalg.solve(triangle, projection), data - orthogonal @ projection


def _fit_at_rest(record: EncoderRecord, contact: Array) -> tuple[Array, Array]:
    """Return the rate before contact, from a straight line, and the noise, each (shot,).

    The rate of a bat at rest is 0. Both are NaN if the record is too short.
    """
    before = record.times < np.nanmin(contact) - RECOIL.settling_time / 3
    if before.sum() < 3:
        nothing = np.full(contact.shape, np.nan)
        return nothing, nothing
    since = record.times[before] - record.times[before].mean()
    counts = record.counts[:, before]
    rate = counts @ (since / np.sum(since**2))
    residual = counts - counts.mean(axis=1, keepdims=True) - rate[:, None] * since
    return np.asarray(rate), np.asarray(np.sqrt((residual**2).mean(axis=1)))
