"""The sensor against the equations of EMVA 1288 and the Poisson distribution."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from virtual_lab.simulation.instruments.camera.sensor import Sensor
from virtual_lab.simulation.instruments.camera.spec import SensorSpec
from virtual_lab.streams import Quiet, Streams

SPEC = SensorSpec(
    columns=320,
    rows=200,
    pixel=28e-6,
    quantum_efficiency=0.5,
    full_well=25_000.0,
    gain=0.15,
    gain_u=0.01,
    read_noise=15.0,
    dark_current=1000.0,
    photo_response=0.005,
    dark_signal=3.0,
    black_level=64.0,
    bits=12,
)


@pytest.mark.parametrize("level", [8.0, 24.0, 26.0, 400.0, 9000.0])
def test_mean_and_variance_follow_emva_1288(level: float) -> None:
    """Variance K² (σ_d² + μ) + 1/12 and mean K μ + black level, over 60 frames."""
    sensor = Sensor.commission(SPEC, Streams(4), "s")
    light = np.full((60, 40, 50), level, np.float32)
    corners = np.tile([[30, 20]], (60, 1))
    grey = sensor.expose(light, corners, Streams(5), "frames", exposure=1e-3).astype(float)
    mean = level + 1.0
    variance = grey.var(axis=0, ddof=1).mean()
    expected = sensor.gain**2 * (15.0**2 + mean) + 1 / 12
    assert variance == pytest.approx(expected, rel=4 * np.sqrt(2 / (59 * 2000)))
    maps = sensor.response[20:60, 30:80] * level + 1.0 + sensor.offset[20:60, 30:80]
    wanted = sensor.gain * maps.mean() + 64
    assert grey.mean() == pytest.approx(wanted, abs=4 * np.sqrt(expected / grey.size))


def test_counts_of_dim_pixels_are_poisson() -> None:
    """Without read noise, the gray values of dim pixels are Poisson counts times the gain."""
    spec = SPEC.ideal()
    counting = Sensor.commission(spec, Quiet(), "s")
    for level in (0.5, 6.0, 20.0):
        light = np.full((1, 200, 320), level, np.float32)
        grey = counting.expose(light, [[0, 0]], Streams(6), f"level {level}")
        counts = np.rint((grey - 64) / spec.gain)
        assert np.allclose(counts * spec.gain + 64, grey, atol=1e-3)
        edges = np.arange(stats.poisson.ppf(1e-4, level), stats.poisson.ppf(1 - 1e-4, level))
        observed = [np.sum(counts <= edges[0]), *(np.sum(counts == n) for n in edges[1:])]
        share = np.diff(stats.poisson.cdf(edges, level), prepend=0)
        observed.append(counts.size - sum(observed))
        wanted = np.append(share, 1 - share.sum()) * counts.size
        assert stats.chisquare(observed, wanted).pvalue > 1e-3


def test_saturation_is_full_scale() -> None:
    """A saturated pixel shows the smaller of full well and full scale, and never wraps."""
    sensor = Sensor.commission(SPEC, Quiet(), "s")
    light = np.full((1, 4, 4), 1e6, np.float32)
    assert np.all(sensor.expose(light, [[0, 0]], Streams(1), "x") == round(0.15 * 25_000 + 64))
    eight = Sensor.commission(replace(SPEC, bits=8), Quiet(), "s")
    grey = eight.expose(light, [[0, 0]], Streams(1), "x")
    assert grey.dtype == np.uint8
    assert np.all(grey == 255)


def test_quiet_draws_give_the_expected_value() -> None:
    """Dim or bright pixels show the expected value, to half a gray value."""
    sensor = Sensor.commission(SPEC, Quiet(), "s")
    light = np.linspace(0, 60, 50, dtype=np.float32).reshape(1, 5, 10)
    grey = sensor.expose(light, [[0, 0]], Quiet(), "x")
    assert np.abs(grey - (0.15 * light + 64)).max() <= 0.5 + 1e-4


def test_a_drawn_mean_is_distributed_as_the_mean_of_frames() -> None:
    """The mean of 32 frames and a mean drawn at once have the same mean and scatter.

    Each pixel has its own mean, by its maps. Bounds are four standard errors of 4000 pixels.
    """
    small = replace(SPEC, columns=80, rows=50)
    sensor = Sensor.commission(small, Streams(4), "s")
    light = np.full((50, 80), 3000.0, np.float32)
    corners = np.zeros((32, 2), int)
    frames = sensor.expose(np.tile(light, (32, 1, 1)), corners, Streams(5), "f", exposure=1e-3)
    one, other = frames.mean(axis=0), sensor.mean_of(light, 32, Streams(6), "m", exposure=1e-3)
    sigma = np.sqrt((sensor.gain**2 * (3001.0 + 15.0**2) + 1 / 12) / 32)
    assert abs(float((one - other).mean())) < 4 * sigma * np.sqrt(2 / 4000)
    assert float((one - other).std()) == pytest.approx(sigma * np.sqrt(2), rel=4 / np.sqrt(8000))


def test_a_pixel_keeps_its_own_faults() -> None:
    """The maps belong to the sensor: two regions show the same pattern on the same pixels."""
    sensor = Sensor.commission(SPEC, Streams(4), "s")
    light = np.full((1, 20, 20), 10_000, np.float32)
    one = sensor.expose(light, [[100, 50]], Quiet(), "x").astype(float)
    other = sensor.expose(light, [[110, 55]], Quiet(), "x").astype(float)
    assert np.array_equal(one[0, 5:, 10:], other[0, :-5, :-10])
    assert one.std() == pytest.approx(0.15 * 10_000 * 0.005, rel=0.2)


def test_read_noise_is_in_the_mean_of_dark_frames() -> None:
    """Four frames of 25 e: s = gain √((25 + 15²)/4), a hundred times the rounding.

    With 16 000 pixels, s is known to 4/√32 000.
    """
    spec = replace(SPEC, columns=160, rows=100, photo_response=0.0, dark_signal=0.0)
    sensor = Sensor.commission(spec, Streams(4), "s")
    grey = sensor.mean_of(np.full((100, 160), 25.0, np.float32), 4, Streams(7), "m")
    wanted = np.sqrt((sensor.gain**2 * 250.0 + 1 / 12) / 4)
    assert float(grey.std()) == pytest.approx(wanted, rel=4 / np.sqrt(32_000))
