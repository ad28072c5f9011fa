"""The noise of a camera, found from frames of a still scene."""

import numpy as np
import pytest

from virtual_lab.errors import InputError
from virtual_lab.video.locate.noise import Noise


def frames(gain: float, read: float, seed: int = 1, count: int = 6) -> np.ndarray:
    """Return 12-bit frames of a ramp with Poisson noise, as whole gray values."""
    random = np.random.default_rng(seed)
    electrons = np.broadcast_to(np.linspace(40, 900, 200) / gain, (count, 120, 200))
    grey = gain * random.poisson(electrons) + read**0.5 * random.standard_normal(electrons.shape)
    return np.clip(np.rint(grey), 0, 4095).astype(np.uint16)


@pytest.mark.parametrize(("gain", "read"), [(0.5, 4.0), (0.05, 1.0), (2.0, 30.0)])
def test_photon_transfer_gives_the_noise(gain: float, read: float) -> None:
    """The variance is right within 5 % from dark to bright pixels, rounding included."""
    noise = Noise.from_frames(frames(gain, read), 4095.0)
    mean = np.array([50.0, 290.0, 840.0])
    assert noise.variance(mean) == pytest.approx(gain * mean + read + 1 / 12, rel=0.05)


def test_flicker_and_a_passing_ball_are_left_out() -> None:
    """A frame that is brighter by 20, and a bright patch in another, do not count as noise."""
    taken = frames(0.5, 4.0).astype(float)
    taken[1] += 20
    taken[2, :20, :20] += 200
    noise = Noise.from_frames(taken, 4095.0)
    assert noise.variance(290.0) == pytest.approx(0.5 * 290 + 4, rel=0.06)


def test_bad_noise_is_refused() -> None:
    """The error message states the allowed values."""
    for figures in ({"gain": -1.0}, {"read": 0.0}, {"black": 300.0, "full_scale": 255.0}):
        with pytest.raises(InputError, match="allowed"):
            Noise(**({"gain": 1.0, "read": 1.0} | figures))
