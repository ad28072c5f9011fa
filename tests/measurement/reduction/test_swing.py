"""Rates and angles of a swung bat, against rotations in closed form."""

from math import pi, tau

import numpy as np
import pytest

from virtual_lab.measurement.reduction.swing import fit_swing
from virtual_lab.records import EncoderRecord

COUNTS = 10_000 / tau  # counts per radian
TIMES = np.arange(800) / 20e3
EVEN, CONTACT = 41.0, 0.0298  # rate [rad/s], contact [s]


def turn(
    *,
    contact: float = CONTACT,
    angle: float = 0.0,
    ripple: float = 0.0,
    frequency: float = 12.0,
    droop: float = 0.0,
    phase: float = 0.0,
) -> tuple[np.ndarray, float]:
    """Return angles (sample,) [rad] that stop at contact, and the rate there [rad/s].

    ω(t) = ω0 (1 + droop t + ripple cos(2π f t + phase)), integrated by hand from contact.
    """
    since, turned = np.minimum(TIMES - contact, 0.0), tau * frequency
    wave = (np.sin(turned * since + phase) - np.sin(phase)) / turned
    path = angle + EVEN * (since + droop * since**2 / 2 + ripple * wave)
    return path, EVEN * (1 + ripple * np.cos(phase))


def fitted(angles: np.ndarray, contact: np.ndarray, reach: float = 0.0, *, whole: bool = False):
    counts = COUNTS * np.atleast_2d(angles)
    record = EncoderRecord(counts=np.rint(counts) if whole else counts, times=TIMES)
    return fit_swing(record, contact, np.full(contact.shape, reach))


def test_an_even_rotation_is_exact() -> None:
    """Exact for any time of contact, and for a parabolic angle."""
    for contact, droop in ((0.0298, 0.0), (0.0212, -0.2), (0.035, 5.0)):
        angles, rate = turn(contact=contact, angle=0.011, droop=droop)
        fit = fitted(angles, np.array([contact]))
        assert fit.rate / COUNTS == pytest.approx(rate, rel=1e-10)
        assert fit.angle / COUNTS == pytest.approx(0.011, abs=1e-10)
        assert fit.residual[0] < 1e-9


@pytest.mark.parametrize("phase", np.arange(8) * pi / 4)
def test_ripple_leaves_a_bias_below_its_fourth_derivative(phase: float) -> None:
    """A cubic angle misses at most (2πf T)³/4! of the ripple in the rate (Taylor).

    The shipped drive has 0.1 % at 12 Hz over 30 ms, so 4.7e-4 of the rate at any phase. At half the
    frequency it is an eighth of that.
    """
    for frequency in (12.0, 6.0):
        angles, rate = turn(ripple=1e-3, frequency=frequency, droop=-0.2, phase=phase)
        fit = fitted(angles, np.array([CONTACT]))
        bound = 1e-3 * (tau * frequency * CONTACT) ** 3 / 24
        assert abs(fit.rate[0] / COUNTS / rate - 1) < bound
        assert bound < 5e-4


def test_the_bias_of_the_ripple_is_above_a_tenth_of_its_bound() -> None:
    """Without this lower bound, the upper bound above would be no test."""
    biases = []
    for phase in np.arange(8) * pi / 4:
        angles, rate = turn(ripple=1e-3, phase=phase)
        biases.append(abs(fitted(angles, np.array([CONTACT])).rate[0] / COUNTS / rate - 1))
    assert max(biases) > 1e-3 * (tau * 12 * CONTACT) ** 3 / 24 / 10


@pytest.mark.parametrize("angle", [-0.05, -0.02, 0.0, 0.01, 0.05])
def test_rate_and_angle_of_an_oblique_bat_are_fitted_at_the_true_contact(angle: float) -> None:
    """The ball meets the bat at lever θ before its nominal position, and so much earlier.

    Gates give the time at the nominal position; at that time the bat has already stopped.
    """
    speed, lever = 31.3, 0.56
    angles, rate = turn(contact=CONTACT - lever * angle / speed, angle=angle, droop=-0.2)
    fit = fitted(angles, np.array([CONTACT]), lever / speed / COUNTS)
    assert fit.angle / COUNTS == pytest.approx(angle, abs=2e-6)
    assert fit.rate / COUNTS == pytest.approx(rate, rel=1e-6)


def test_whole_counts_scatter_by_the_stated_uncertainty() -> None:
    """The u of 300 rates is that of 1/√12 counts through Legendre polynomials.

    It is √(Σ (2k + 1) P_k'(x)² / n) 2/T at x = 1 + 2 ms/T, and the rates scatter by it.
    """
    n = 300
    rates = np.linspace(36, 50, n)
    angles = rates[:, None] * np.minimum(TIMES - CONTACT, 0.0) + np.linspace(0, 7, n)[:, None]
    fit = fitted(angles, np.full(n, CONTACT), whole=True)
    span = CONTACT - 1e-3
    x = 1 + 2e-3 / span
    slope = np.sqrt((3 + 5 * (3 * x) ** 2 + 7 * (7.5 * x**2 - 1.5) ** 2) / (span * 20e3)) * 2 / span
    said = np.sqrt(1 / 12) * slope
    assert np.median(fit.rate_u) == pytest.approx(said, rel=0.03)
    deviation = fit.rate - rates * COUNTS
    # tolerance of 25 %: rounding is no white noise at one rate, only over many rates
    assert np.sqrt((deviation**2).mean()) == pytest.approx(said, rel=0.25)


def test_a_ball_that_was_not_seen_has_no_rate() -> None:
    """The same is true of a contact before the first samples; other shots are as if alone."""
    angles, rate = turn(angle=0.01)
    fit = fitted(np.stack([angles] * 4), np.array([CONTACT, np.nan, 5e-4, CONTACT]))
    assert np.isnan(fit.rate[1:3]).all()
    assert np.isnan(fit.angle[1:3]).all()
    assert fit.rate[[0, 3]] / COUNTS == pytest.approx(rate, rel=1e-10)


@pytest.mark.parametrize(
    ("contact", "said"), [(np.nan, "saw no incoming ball"), (1e-3, "too short before contact")]
)
def test_a_record_with_nothing_to_fit_is_refused(contact: float, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        fitted(turn()[0], np.array([contact]))


def test_u_of_half_minus_whole_is_that_of_the_difference_of_their_weights() -> None:
    """A record with a single count gives the weight of that sample in both rates."""
    before = int(np.searchsorted(TIMES, CONTACT - 1e-3))
    record = EncoderRecord(counts=np.eye(TIMES.size)[:before], times=TIMES)
    fit = fit_swing(record, np.full(before, CONTACT), np.zeros(before))
    whole, half = np.linalg.norm(fit.rate), np.linalg.norm(fit.by_half - fit.rate)
    assert fit.by_half_u / fit.rate_u == pytest.approx(np.full(before, half / whole), rel=1e-6)


def test_u_of_a_swing_and_of_its_halves_is_their_scatter() -> None:
    """4000 shots with white noise: z of both has variance 1, within four times √(2/4000).

    With a divisor of n instead of n - 4 for a cubic, the variance of z would be larger by 4/600. So
    rms² n / (n - 4) times the leverage is compared with u² directly.
    """
    rng = np.random.default_rng(20261125)
    angles, rate = turn()
    shots, samples = 4000, int(np.searchsorted(TIMES, CONTACT - 1e-3))
    record = EncoderRecord(
        counts=COUNTS * angles + rng.normal(size=(shots, TIMES.size)), times=TIMES
    )
    fit = fit_swing(record, np.full(shots, CONTACT), np.zeros(shots))
    for z in (
        (fit.rate - COUNTS * rate) / fit.rate_u,
        (fit.by_half - fit.rate) / fit.by_half_u,
    ):
        assert np.mean(z**2) == pytest.approx(1, abs=4 * (2 / shots) ** 0.5)
    clock = (TIMES[:samples] - CONTACT) / CONTACT
    powers = np.vander(clock, 4, increasing=True)
    leverage = np.linalg.inv(powers.T @ powers)[1, 1] / CONTACT**2
    variance = fit.residual**2 * samples / (samples - 4)
    assert fit.rate_u == pytest.approx(np.sqrt(variance * leverage), rel=1e-4)
    assert fit.span == pytest.approx((samples - 1) / 20e3)


def test_a_jump_of_the_counts_shows_in_the_misfit() -> None:
    """20 counts gained at once raise the residual far above 1/√12."""
    angles, _ = turn()
    jumped = angles + 20 / COUNTS * (TIMES > CONTACT / 2)
    contact = np.array([CONTACT])
    assert fitted(angles, contact, whole=True).misfit[0] < 1.2
    assert fitted(jumped, contact, whole=True).misfit[0] > 5
