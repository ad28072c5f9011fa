"""The test for a bias that pixels make: what was put in is found, and where none was, none."""

import numpy as np
import pytest
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.track.phase import phase_bias

Array = NDArray[np.float64]
COUNT, SPEED = 400, 0.3117  # frames, pixels a frame


def drift(bias: float, noise: float, seed: int = 1, speed: float = SPEED) -> tuple[Array, Array]:
    """Return places that roll through the picture, slowing down, and lean by the phase."""
    t = np.arange(float(COUNT))
    true = 100.3 + speed * t - 1e-5 * t**2
    lean = bias * np.sin(2 * np.pi * true + 0.7)
    return true + lean + noise * np.random.default_rng(seed).standard_normal(COUNT), t


def test_a_bias_is_found_with_its_uncertainty() -> None:
    """In 40 clips, amplitude and u against what was put in."""
    pulls = []
    for seed in range(40):
        found = phase_bias(*drift(0.02, 0.02, seed))
        assert found.seen
        assert found.scatter == pytest.approx(0.02, rel=0.15)
        assert found.bias_u == pytest.approx(0.02 * np.sqrt(4 / COUNT), rel=0.4)
        pulls.append((found.bias - 0.02) / found.bias_u)
    assert np.std(pulls) < 1.4
    assert abs(np.mean(pulls)) < 1.0  # the worst of all phases is a little more than the wave


def test_no_bias_no_alarm() -> None:
    """One in a thousand is allowed: none in a hundred, or one."""
    alarms = sum(phase_bias(*drift(0.0, 0.02, seed)).seen for seed in range(100))
    assert alarms <= 1


def test_the_table_shows_the_wave() -> None:
    found = phase_bias(*drift(0.05, 0.001))
    expected = 0.05 * np.sin(2 * np.pi * found.phases + 0.7) * np.sinc(1 / 8)
    assert found.means == pytest.approx(expected, abs=0.004)
    assert found.counts.sum() == COUNT
    assert found.counts.min() > 20


def test_frames_without_the_ball_are_left_out() -> None:
    places, times = drift(0.02, 0.002)
    places[::3] = np.nan
    found = phase_bias(places, times)
    assert found.frames == COUNT - 134
    assert found.bias == pytest.approx(0.02, abs=0.001)


@pytest.mark.parametrize("speed", [0.0, 0.5, 1.0])
def test_phases_that_do_not_tell(speed: float) -> None:
    t = np.arange(float(COUNT))
    noise = 0.001 * np.random.default_rng(1).standard_normal(COUNT)
    with pytest.raises(InputError, match="fraction of a pixel"):
        phase_bias(100.3 + speed * t + noise, t)


def test_too_few_frames() -> None:
    with pytest.raises(InputError, match="frames"):
        phase_bias(np.arange(20.0), np.arange(20.0))
