"""Straight flights through places whose errors are drawn: right, and as uncertain as they say."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.track.legs import fit_flight

Array = NDArray[np.float64]
RATE = 5000.0
NOISE = 0.003  # pixels
CLIPS = 150


def turning(rng: np.random.Generator, angle: Array, rms: float) -> Array:
    """Return the apparent shift of a turning ball: some harmonics of its angle, (frame, 2)."""
    order = np.arange(1, 7)
    weights = rng.standard_normal((2, 2, order.size)) / np.sqrt(order)
    weights *= rms / np.sqrt((weights**2).sum(axis=(1, 2), keepdims=True) / 2)
    waves = np.stack([np.cos(np.outer(order, angle)), np.sin(np.outer(order, angle))])
    return np.einsum("akn,knt->ta", weights, waves)


@pytest.mark.parametrize("frames", [8, 24])
@pytest.mark.parametrize("spin_rpm", [0, 300, 1500])
@pytest.mark.parametrize("pattern", [0.0, 0.01, 0.08])
def test_a_turning_pattern_is_covered(frames: int, spin_rpm: float, pattern: float) -> None:
    """The 95 % interval holds at least 95 % of clips, by a binomial bound of 1e-4."""
    rng = np.random.default_rng([frames, int(spin_rpm), int(1000 * pattern)])
    t = np.arange(frames) / RATE
    inside = 0
    for _ in range(CLIPS):
        angle = spin_rpm / 60 * 2 * np.pi * t + rng.uniform(0, 2 * np.pi)
        places = np.outer(t, (50_000.0, 5_000.0)) + NOISE * rng.standard_normal((frames, 2))
        places += turning(rng, angle, pattern) if pattern else 0.0
        found = fit_flight(
            t, places, np.full(frames, NOISE), 1.1 * pattern, ClipCalibration(), t[-1]
        )
        inside += abs(found.speed - np.hypot(50_000, 5_000)) < 1.96 * found.speed_u
    assert inside >= binom.ppf(1e-4, CLIPS, 0.95)


def test_noise_alone_has_the_textbooks_uncertainty() -> None:
    """σ_v = σ √(12 / (N (N² - 1))) / dt of a straight line."""
    frames = 20
    t = np.arange(frames) / RATE
    rng = np.random.default_rng(4)
    places = np.outer(t, (50_000.0, 5_000.0)) + NOISE * rng.standard_normal((frames, 2))
    found = fit_flight(t, places, np.full(frames, 1.2 * NOISE), 0.0, ClipCalibration(), t[-1])
    textbook = 1.2 * NOISE * np.sqrt(12 / (frames * (frames**2 - 1))) * RATE
    assert found.speed_u == pytest.approx(textbook, rel=1e-9)


def test_gravity_and_drag_are_taken_out() -> None:
    """Against an integration in small steps, gravity and drag together as small as they are."""
    gravity, drag, speed = np.array([0.0, 9.81]), 0.007, 60.0
    step, t_end = 1e-6, 4e-3
    place, velocity = np.zeros(2), np.array([speed, -3.0])
    told = []
    for k in range(round(t_end / step)):
        if k % 200 == 0:
            told.append(place.copy())
        middle = velocity + step / 2 * (gravity - drag * np.hypot(*velocity) * velocity)
        place = place + step * middle
        velocity = velocity + step * (gravity - drag * np.hypot(*middle) * middle)
    t = np.arange(len(told)) * 200 * step
    air = ClipCalibration(drag_per_m=drag, drag_per_m_u=0.001, gravity_mps2=(0.0, 9.81))
    u = np.full(len(t), 1e-6)
    found = fit_flight(t, np.array(told), u, 0.0, air, t_end)
    np.testing.assert_allclose(found.velocity, velocity, rtol=2e-6, atol=2e-4)
    np.testing.assert_allclose(found.place, place, atol=2e-7)
    mean_way = speed * (t_end - t.mean())
    assert found.drag_u == pytest.approx(0.001 * mean_way, rel=0.01)


def test_scatter_that_nobody_claimed_widens_the_interval() -> None:
    t = np.arange(30) / RATE
    rng = np.random.default_rng(8)
    places = np.outer(t, (50_000.0, 0.0)) + 0.1 * rng.standard_normal((30, 2))
    found = fit_flight(t, places, np.full(30, NOISE), 0.0, ClipCalibration(), t[-1])
    white = 0.1 * np.sqrt(12 / (30 * (30**2 - 1))) * RATE
    assert white < found.speed_u < 4 * white


def test_three_frames_know_their_own_scatter_badly() -> None:
    """Places that scatter 30 times as claimed: two degrees of freedom, of a t of 4.3, not 1.96.

    1 000 clips: the 95 % interval holds by a binomial bound of 1e-4; u by the root of t holds 89 %.
    """
    t, rng, clips = np.arange(3) / RATE, np.random.default_rng(1), 1000
    inside = 0
    for _ in range(clips):
        places = np.outer(t, (50_000.0, 0.0)) + 0.1 * rng.standard_normal((3, 2))
        found = fit_flight(t, places, np.full(3, NOISE), 0.0, ClipCalibration(), t[-1])
        inside += abs(found.speed - 50_000) < 1.96 * found.speed_u
    assert inside >= binom.ppf(1e-4, clips, 0.95)


def test_places_by_chance_on_a_line_are_no_better_known() -> None:
    """A quick fit of residuals 0 has the textbook's u all the same, of 4 u a scatter four times."""
    frames = 20
    t = np.arange(frames) / RATE
    exact = np.outer(t, (50_000.0, 5_000.0))
    textbook = NOISE * np.sqrt(12 / (frames * (frames**2 - 1))) * RATE
    given = np.full(frames, NOISE), 0.0, ClipCalibration(), t[-1]
    assert fit_flight(t, exact, *given, rough=True).speed_u == pytest.approx(textbook, rel=1e-9)
    zigzag = exact + 4 * NOISE * (-1.0) ** np.arange(frames)[:, None]
    found = fit_flight(t, zigzag, *given, rough=True).speed_u
    assert found == pytest.approx(4 * textbook * np.sqrt(frames / (frames - 2)), rel=0.01)
