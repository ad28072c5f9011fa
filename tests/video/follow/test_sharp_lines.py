"""Straight flights through noisy positions: right within their stated uncertainties."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.find.blobs import BLOB
from virtual_lab.video.follow.joint import Fit, estimate_of, fit_flights
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene

Array = NDArray[np.float64]
NOISE = 0.003  # noise of positions [pixels]
CLIPS = 150


def fit(
    places: Array, u: float, pattern_u: float = 0.0, pull: tuple[float, float] = (0, 0), drag=0.0
) -> Fit:
    """Fit a flight through one position per frame [pixels] with known u, gravity and drag."""
    count = len(places)
    t = np.arange(float(count))
    scene = FlightScene(
        blobs=np.zeros(count, BLOB),
        time=t,
        stamped=t,
        size=(1280, 800),
        exposure=0.0,
        pull=np.array(pull, float),
        drag=(drag, 0.0),
        in_radii=False,
    )
    numbers = np.arange(count)
    flight = Piece(
        blobs=numbers,
        frames=numbers,
        t=t,
        xy=places,
        radius=15.0,
        sharp=True,
        u=np.full(count, u),
        pattern_u=pattern_u,
    )
    return fit_flights(scene, [flight])


def speed(places: Array, u: float, pattern_u: float = 0.0) -> Estimate:
    """Return the speed at the last position [pixels/frame]."""
    last = len(places) - 1
    return estimate_of(
        lambda some: np.linalg.norm(some.at(0, last)[..., 0, 2:], axis=-1),
        fit(places, u, pattern_u),
    )


def turning(rng: np.random.Generator, angle: Array, rms: float) -> Array:
    """Return the apparent shift of a turning ball, (frame, 2): harmonics of its angle."""
    order = np.arange(1, 7)
    weights = rng.standard_normal((2, 2, order.size)) / np.sqrt(order)
    weights *= rms / np.sqrt((weights**2).sum(axis=(1, 2), keepdims=True) / 2)
    waves = np.stack([np.cos(np.outer(order, angle)), np.sin(np.outer(order, angle))])
    return np.einsum("akn,knt->ta", weights, waves)


@pytest.mark.parametrize("frames", [8, 24])
@pytest.mark.parametrize(
    ("pattern", "spin_rpm"),
    [(0.0, 0), *((pattern, spin) for pattern in (0.01, 0.08) for spin in (0, 300, 1500))],
)
def test_the_u_covers_a_turning_pattern(frames: int, spin_rpm: float, pattern: float) -> None:
    """The 95 % interval covers at least 95 % of the clips, by a binomial bound of 1e-4."""
    rng = np.random.default_rng([frames, int(spin_rpm), int(1000 * pattern)])
    t = np.arange(frames)
    inside = 0
    for _ in range(CLIPS):
        angle = spin_rpm / 60 * 2 * np.pi * t / 5000 + rng.uniform(0, 2 * np.pi)
        places = np.outer(t, (10.0, 1.0)) + NOISE * rng.standard_normal((frames, 2))
        places += turning(rng, angle, pattern) if pattern else 0.0
        result = speed(places, NOISE, 1.1 * pattern)
        inside += abs(result.value - np.hypot(10, 1)) < 1.96 * result.u
    assert inside >= binom.ppf(1e-4, CLIPS, 0.95)


def test_noise_alone_has_the_textbooks_uncertainty() -> None:
    """A straight line has σ_v = σ √(12 / (N (N² - 1))) / dt."""
    frames = 20
    t = np.arange(frames)
    rng = np.random.default_rng(4)
    places = np.outer(t, (10.0, 1.0)) + NOISE * rng.standard_normal((frames, 2))
    textbook = 1.2 * NOISE * np.sqrt(12 / (frames * (frames**2 - 1)))
    assert speed(places, 1.2 * NOISE).u == pytest.approx(textbook, rel=1e-4)


def test_gravity_and_drag_are_corrected() -> None:
    """The oracle is an integration in small steps with the same small gravity and drag."""
    gravity, drag = np.array([0.0, 0.02]), 1e-4  # gravity and drag in pixels and frames
    steps, count = 1000, 40
    place, velocity, path = np.array([100.0, 300.0]), np.array([20.0, -1.0]), []
    for k in range(steps * (count - 1) + 1):
        if k % steps == 0:
            path.append(place.copy())
            last = velocity.copy()
        middle = velocity + 0.5 / steps * (gravity - drag * np.hypot(*velocity) * velocity)
        place = place + middle / steps
        velocity = velocity + (gravity - drag * np.hypot(*middle) * middle) / steps
    result = fit(np.array(path), 1e-4, pull=(0.0, 0.02), drag=drag).at(0, count - 1)[0]
    np.testing.assert_allclose(result, [*path[-1], *last], atol=2e-5)


def test_unstated_scatter_widens_the_interval() -> None:
    t = np.arange(30)
    rng = np.random.default_rng(8)
    places = np.outer(t, (10.0, 0.0)) + 0.1 * rng.standard_normal((30, 2))
    white = 0.1 * np.sqrt(12 / (30 * (30**2 - 1)))
    assert white < speed(places, NOISE).u < 4 * white


def test_the_interval_of_three_frames_allows_for_their_few_dof() -> None:
    """Positions scatter 30 times more than claimed: t with two dof has 4.3, not 1.96.

    For 600 clips, the 95 % interval passes a binomial bound of 1e-4; u by
    the root of t covers 89 %.
    """
    t, rng, clips = np.arange(3), np.random.default_rng(1), 600
    inside = 0
    for _ in range(clips):
        places = np.outer(t, (10.0, 0.0)) + 0.1 * rng.standard_normal((3, 2))
        result = speed(places, NOISE)
        inside += abs(result.value - 10) < 1.96 * result.u
    assert inside >= binom.ppf(1e-4, clips, 0.95)
