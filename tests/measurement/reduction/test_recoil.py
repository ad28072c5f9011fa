"""The recoil fit of synthetic encoder records: rotation, its deceleration, three rings, counts.

The records use no code of the rigs. The bearing slows the bat by dω/dt = -λω - qω², so the angle is
ln(1 + q ω0 (1 - e^(-λt)) / λ) / q. Rings begin at the end of contact with random amplitudes, phases
and decays. The encoder gives the floor of real counts at a random rest phase.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import tau

import numpy as np
import pytest

from virtual_lab.measurement.reduction.rate import RateFit, unwrap
from virtual_lab.measurement.reduction.recoil import RECOIL, fit_recoil
from virtual_lab.records import EncoderRecord

RECORDS, SHOTS = 150, 6
COUNTS = 10_000  # counts per turn


@dataclass(frozen=True)
class Made:
    """A record and its true values."""

    record: EncoderRecord
    contact: np.ndarray
    rate: np.ndarray  # rate at the end of contact [counts/s]
    frequencies: tuple[float, ...]


def make(seed: int, *, counts: int = COUNTS, whole: bool = True, rings: int = 3) -> Made:
    """Make the record of one session from a seed."""
    rng = np.random.default_rng([20030601, seed])
    time = np.arange(1500) / 1e4
    contact = 0.022 + rng.uniform(-2e-4, 2e-4, SHOTS)
    rate = rng.uniform(15, 25, SHOTS)[:, None]
    viscous, air = rng.uniform(0.05, 0.3), rng.uniform(1e-3, 0.02)
    since = np.maximum(time - (contact + RECOIL.contact_duration)[:, None], 0)
    angle = np.log1p(air * rate * -np.expm1(-viscous * since) / viscous) / air
    frequencies = (rng.uniform(140, 180), rng.uniform(480, 620), rng.uniform(1000, 1300))[:rings]
    for frequency in frequencies:
        turn = tau * frequency
        # amplitude such that the rate of the ring is of the order of the bat's, as at a real pivot
        swing = rng.uniform(0.5, 1.5, (SHOTS, 1)) * rng.uniform(0.3, 1.0) * rate / turn
        decay = rng.uniform(0.002, 0.006) * turn
        angle = angle + swing * np.exp(-decay * since) * np.sin(turn * since)
    real_counts = counts / tau * angle + rng.uniform(0, 1, (SHOTS, 1))
    return Made(
        record=EncoderRecord(counts=np.floor(real_counts) if whole else real_counts, times=time),
        contact=contact,
        rate=counts / tau * rate[:, 0],
        frequencies=frequencies,
    )


@lru_cache(maxsize=1)
def fitted() -> list[tuple[Made, RateFit]]:
    """Return records of fixed seeds and their fits."""
    made = [make(seed) for seed in range(RECORDS)]
    return [(one, fit_recoil(one.record, one.contact)) for one in made]


def test_bias_is_below_the_stated_uncertainty() -> None:
    """In at least 95 % of 150 records, the mean error over the shots is below their mean u."""
    below = [abs(np.mean(fit.rate - one.rate)) < np.mean(fit.rate_u) for one, fit in fitted()]
    assert np.mean(below) >= 0.95


def test_stated_uncertainty_is_the_scatter() -> None:
    """900 shots: z has standard deviation 1 (to 20 %), and at least 90 % are within 2.

    Its mean is 0, but for the error of the cubic deceleration, 1e-5 of the rate or 0.1 u.
    """
    z = np.concatenate([(fit.rate - one.rate) / fit.rate_u for one, fit in fitted()])
    assert abs(z.mean()) < 0.2
    assert 0.8 < z.std() < 1.2
    assert np.mean(np.abs(z) < 2) > 0.9
    assert np.abs(z).max() < 6


def test_rates_are_recovered() -> None:
    """All 900 rates are within 0.1 % (one count in 150 ms at 20 rad/s is 0.02 %)."""
    for one, fit in fitted():
        assert fit.rate == pytest.approx(one.rate, rel=1e-3)


def test_rings_are_found() -> None:
    """In at least 95 % of the records all three rings are within 2 Hz, the lowest within 0.5 Hz."""
    right = []
    for one, fit in fitted():
        frequencies = np.sort(fit.ring_frequency)
        right.append(
            len(frequencies) == 3
            and bool(np.all(np.abs(frequencies - one.frequencies) < [0.5, 2.0, 2.0]))
        )
    assert np.mean(right) >= 0.95


def test_the_residual_is_the_noise_of_counting() -> None:
    """The floor of a real number has a uniform error: rms 1/√12 = 0.289 counts, here to 15 %."""
    residual = np.concatenate([fit.residual for _, fit in fitted()])
    assert residual.mean() == pytest.approx(12**-0.5, rel=0.15)


def test_the_rate_before_contact_is_measured() -> None:
    """Constant counts have a rate of 0; a rotation is seen with the resolution of 18 ms."""
    one = make(1)
    assert fit_recoil(one.record, one.contact).before == pytest.approx(0, abs=1e-9)
    drift = 500 * one.record.times  # drift of 500 counts/s [counts]
    turning = EncoderRecord(counts=one.record.counts + np.floor(drift), times=one.record.times)
    before = fit_recoil(turning, one.contact).before
    assert before == pytest.approx(500, abs=20)


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("period", [2**10, 2**12, 2**16, 2**32, COUNTS])
def test_a_counter_overflow_is_unwrapped(period: int, signed: bool) -> None:
    """By definition the range of such a counter begins at 0, or half of it is below 0."""
    one = make(3)
    counts = one.record.counts
    top = period // 2 if signed else period
    counter = (counts + top - counts.max(axis=1).min() // 2 + top - period) % period + top - period
    assert counter.min() >= top - period
    assert counter.max() < top
    record = EncoderRecord(counts=counter, times=one.record.times)
    assert np.ptp(np.diff(counter)) > period - 100
    unwound = unwrap(record, COUNTS, one.contact)
    assert np.array_equal(np.diff(unwound.counts), np.diff(counts))
    at = np.searchsorted(one.record.times, one.contact)
    assert np.abs(unwound.counts[np.arange(SHOTS), at]).max() <= period / 2


def test_a_jump_that_is_no_overflow_is_kept() -> None:
    """The jump is 300 counts, more than half of the 9-bit range that holds all counts."""
    one = make(3, counts=300)
    jumped = one.record.counts + 300.0 * (one.record.times > 0.07)
    assert 300 < np.ptp(jumped) < 512
    record = EncoderRecord(counts=jumped, times=one.record.times)
    for unchanged in (one.record, record):
        assert unwrap(unchanged, 300, one.contact) is unchanged


def test_a_record_without_rings_is_fitted() -> None:
    """A stiff bat does not ring: no ring is found, and the rate is right."""
    one = make(2, rings=0)
    fit = fit_recoil(one.record, one.contact)
    assert len(fit.ring_frequency) == 0
    assert fit.rate == pytest.approx(one.rate, rel=1e-3)


@pytest.mark.parametrize("counts", [2_000, 40_000, 1_000_000])
def test_coarse_and_fine_encoders_give_the_rate(counts: int) -> None:
    """With very fine counts only the error of the cubic remains, about 1e-5."""
    for seed in range(20):
        one = make(seed, counts=counts)
        fit = fit_recoil(one.record, one.contact)
        assert fit.rate == pytest.approx(one.rate, rel=max(1e-4, 3 / counts))


def test_real_valued_counts_are_fitted() -> None:
    """An encoder without steps resolves the ring; the rate is within 1e-4."""
    for seed in range(40):
        one = make(seed, whole=False)
        fit = fit_recoil(one.record, one.contact)
        assert fit.rate == pytest.approx(one.rate, rel=1e-4)


def test_a_shot_without_a_contact_time_has_no_rate() -> None:
    """The rate of the shot is unknown; the other shots are unaffected."""
    one = make(3)
    contact = one.contact.copy()
    contact[2] = np.nan
    fit = fit_recoil(one.record, contact)
    assert np.isnan(fit.rate[2])
    others = np.arange(SHOTS) != 2
    assert fit.rate[others] == pytest.approx(one.rate[others], rel=1e-3)


def test_a_record_that_ends_too_soon_is_refused() -> None:
    """The fit raises the documented `ValueError`."""
    one = make(4)
    short = EncoderRecord(counts=one.record.counts[:, :300], times=one.record.times[:300])
    with pytest.raises(ValueError, match="too soon"):
        fit_recoil(short, one.contact)


def test_a_bat_without_ring_shows_none() -> None:
    """Whole counts of an even rotation have lines at the count rate, which are no rings."""
    for seed in range(20):
        one = make(seed, rings=0)
        fit = fit_recoil(one.record, one.contact)
        assert fit.ring_frequency.size == 0
        assert fit.rate == pytest.approx(one.rate, rel=1e-3)


def stopped(one: Made, at: float) -> EncoderRecord:
    """Return the record of a bat that meets its stop at an angle [counts] and returns slower."""
    turned = one.record.counts - one.record.counts[:, :1]
    beyond = np.maximum(turned - at, 0)
    return EncoderRecord(counts=one.record.counts - np.round(1.3 * beyond), times=one.record.times)


def farthest(one: Made) -> np.ndarray:
    """Return the angle of each bat at the end of the record, (shot,) [counts]."""
    return np.asarray(one.record.counts[:, -1] - one.record.counts[:, 0])


@pytest.mark.parametrize("part", [0.6, 0.8, 0.97])
def test_a_bat_that_meets_its_stop_is_fitted_until_then(part: float) -> None:
    """The stop is at a share of the fastest bat's angle; the others reach it later.

    The time until then is that share of the record after contact (22 ms), less 3 ms of settling.
    The deceleration makes it longer by less than 6 %.
    """
    for seed in range(5):
        one = make(seed)
        fit = fit_recoil(stopped(one, part * farthest(one).max()), one.contact)
        assert np.all(fit.span == fit.span[0])
        assert part - 0.06 < (fit.span[0] + 3e-3) / 0.128 < part + 0.06
        assert np.all(np.abs(fit.rate - one.rate) < 6 * fit.rate_u)
        assert fit.rate == pytest.approx(one.rate, rel=1e-3)
        assert fit.misfit.max() < 1.5


def test_the_whole_tail_is_fitted_where_no_bat_turns_back() -> None:
    """1500 ticks of 0.1 ms, contact before 22.2 ms, 3 ms of settling; a ring may hide the end."""
    spans = np.array([fit.span[0] for _, fit in fitted()])
    assert spans.max() < 0.125
    assert spans.min() > 0.1245


def test_one_odd_shot_does_not_shorten_the_others() -> None:
    """A bat that was missed, one that jumps back to its start, and one that counts down."""
    one = make(5)
    whole = fit_recoil(one.record, one.contact)
    counts = one.record.counts.copy()
    counts[1] = counts[1, 0]
    counts[2, 500:] = counts[2, 0]
    counts[3] = 2 * counts[3, 0] - counts[3]
    fit = fit_recoil(EncoderRecord(counts=counts, times=one.record.times), one.contact)
    assert fit.span[0] == pytest.approx(whole.span[0], abs=7e-3)
    sound = [0, 4, 5]
    assert fit.rate[sound] == pytest.approx(one.rate[sound], rel=1e-3)
    assert fit.rate[3] == pytest.approx(-one.rate[3], rel=1e-3)
    assert fit.misfit[2] > 1.5


def test_a_stop_right_after_contact_leaves_no_valid_fit() -> None:
    """The time before the stop is too short, and the whole record has a large misfit."""
    one = make(6)
    fit = fit_recoil(stopped(one, 0.2 * farthest(one).min()), one.contact)
    assert fit.misfit.min() > 1.5


def test_counts_in_steps_of_four_are_no_misfit() -> None:
    """A recorder that stores every fourth count has a counting residual of 4/√12."""
    for seed in range(10):
        one = make(seed)
        coarse = EncoderRecord(counts=4 * np.floor(one.record.counts / 4), times=one.record.times)
        fit = fit_recoil(coarse, one.contact)
        assert fit.counting == pytest.approx(4 / 12**0.5)
        assert fit.misfit.max() < 1.2


def test_half_a_record_agrees_with_the_whole() -> None:
    """900 shots: the difference over its u scatters by 1 (to 20 %), at least 90 % within 2.

    By Gauss and Markov a least-squares fit of the whole is uncorrelated with its difference from
    any other unbiased fit, so u² = u_half² - u_whole².
    """
    z = np.concatenate([(fit.by_half - fit.rate) / fit.by_half_u for _, fit in fitted()])
    assert abs(z.mean()) < 0.2
    assert 0.8 < z.std() < 1.2
    assert np.mean(np.abs(z) < 2) > 0.9


def test_u_of_half_minus_whole_is_the_root_of_the_difference_of_variances() -> None:
    """Without rings, from the normal equations of a cubic: u² = u_half² - u_whole², over σ²."""
    one = make(2, rings=0)
    fit = fit_recoil(one.record, one.contact)
    assert len(fit.ring_frequency) == 0
    time = one.record.times[-(round(fit.span[0] * 1e4) + 1) :]
    since = time - one.contact[0] - RECOIL.contact_duration

    def leverage(since: np.ndarray) -> float:
        powers = np.vander(since / 0.1, 4, increasing=True)
        return float(np.linalg.inv(powers.T @ powers)[1, 1])

    more = leverage(since[: len(since) // 2]) / leverage(since) - 1
    assert (fit.by_half_u[0] / fit.rate_u[0]) ** 2 == pytest.approx(more, rel=1e-6)


def test_a_slow_slip_shows_in_the_halves() -> None:
    """Twenty counts lost over 50 ms late in a shot change the whole fit, but not the first half."""
    one = make(7)
    lost = 20 * np.clip((one.record.times - 0.09) / 0.05, 0, 1) * (np.arange(SHOTS) == 2)[:, None]
    slipped = EncoderRecord(counts=np.floor(one.record.counts - lost), times=one.record.times)
    fit = fit_recoil(slipped, one.contact)
    apart = np.abs(fit.by_half - fit.rate) / fit.by_half_u
    assert apart[2] > 5
    assert np.delete(apart, 2).max() < 5
