"""Restitutions with a fitted tilt of the camera."""

from typing import Any

import numpy as np
import pytest

from tests.video.follow.test_contacts import SCALE
from tests.video.follow.test_pieces import RADIUS, blobs_of
from virtual_lab.video.follow.contacts import contacts_of
from virtual_lab.video.follow.flights import flights_of
from virtual_lab.video.follow.joint import Fit
from virtual_lab.video.follow.knowledge import ClipKnowledge
from virtual_lab.video.follow.models import FittedFlights
from virtual_lab.video.follow.pieces import pieces
from virtual_lab.video.follow.ruler import Ruler
from virtual_lab.video.follow.scene import FlightScene

PULL = 0.2  # gravity [px/frame²]
SIZE = (960, 540)


def hop(yaw: float, seed: int) -> FittedFlights:
    """Return fits of a bounce of 0.7 with 0.3 px noise, seen by a camera turned by `yaw`."""
    t = np.arange(-40.0, 55.0)
    place = np.stack([5.0 * t, np.where(t < 0, 9.0, -6.3) * t + PULL * t**2 / 2], axis=1)
    off = place + np.array([0.0, 150.0])  # from the middle; the floor is low
    off /= 1 + off[:, :1] * np.tan(yaw) / (0.8 * SIZE[0])
    blobs = blobs_of(off + (np.array(SIZE) - 1) / 2, noise=0.0)
    noise = np.random.default_rng(seed).normal(0, 0.3, (2, len(t)))
    blobs["x"], blobs["y"] = blobs["x"] + noise[0], blobs["y"] + noise[1]
    arrays: dict[str, Any] = {"blobs": blobs, "time": t - t[0], "stamped": t - t[0]}
    scene = FlightScene(**arrays, size=SIZE, exposure=0.5, fall=PULL / RADIUS, drag=(0.0, 0.0))
    ways, fit = flights_of(scene, pieces(blobs, t - t[0]))
    assert fit is not None
    assert len(ways) == 2
    return FittedFlights.of(scene, ways)


def hops(yaw: float, noise: float = 0.0, seed: int = 0) -> FittedFlights:
    """Return fits of two bounces of 0.7 with `noise` [px], seen by a camera turned by `yaw`.

    A codec bends each flight to the side by 0.8 px, as a tilted picture would.
    """
    t, next_bounce = np.arange(-40.0, 120.0), 63.0
    later = t - next_bounce
    y = np.where(t < 0, 9.0, -6.3) * t + PULL * t**2 / 2
    y = np.where(later < 0, y, -4.41 * later + PULL * later**2 / 2)
    off = np.stack([4.0 * t - 160.0, y + 150.0], axis=1)  # from the middle
    off /= 1 + off[:, :1] * np.tan(yaw) / (0.8 * SIZE[0])
    off += np.random.default_rng(seed).normal(0, noise, off.shape)
    blobs = blobs_of(off + (np.array(SIZE) - 1) / 2, noise=0.0)
    late = np.select([t < 0, later < 0], [t / 40, t / next_bounce], later / 57) % 1
    blobs["x"] += 0.8 * np.sin(np.pi * late)
    arrays: dict[str, Any] = {"blobs": blobs, "time": t - t[0], "stamped": t - t[0]}
    scene = FlightScene(**arrays, size=SIZE, exposure=0.5, fall=PULL / RADIUS)
    ways, fit = flights_of(scene, pieces(blobs, t - t[0]))
    assert fit is not None
    assert len(ways) == 3
    return FittedFlights.of(scene, ways)


def ratio(fit: Fit) -> float:
    before, after = (fit.at(k, 40.0)[0, 2:] for k in (0, 1))
    return float(-(after @ fit.pull[0]) / (before @ fit.pull[0]))


def test_the_u_of_a_restitution_covers_a_fitted_tilt() -> None:
    """Yaws of -4, 0 and 4 degrees are draws from its u of 2.5 degrees, as their rms is 1.3 u."""
    ruler, z = Ruler.of(SCALE, ClipKnowledge(rate=1.0)), []
    for seed in range(12):
        model = hop(np.radians(4.0 * (seed % 3 - 1)), seed)
        (contact,), _ = contacts_of(model, 1.0, ruler, None)
        assert contact.restitution is not None
        assert contact.restitution.u < 0.02
        z.append((contact.restitution.value - 0.7) / contact.restitution.u)
    assert 0.4 < np.sqrt(np.mean(np.square(z))) < 1.4


@pytest.mark.parametrize("yaw", [-4.0, 0.0, 4.0])
def test_two_contacts_show_the_floor_so_that_bent_flights_give_the_restitution(yaw: float) -> None:
    model = hops(np.radians(yaw))
    assert [k for k, _ in model.fit.floor] == [0, 1]
    assert abs(ratio(model.fit) - 0.7) > 0.007
    before, after = (complex(*model.fit.at(k, 40.0)[0, 2:]) for k in (0, 1))
    down = model.fit.down
    assert -(after / down).real / (before / down).real == pytest.approx(0.7, abs=0.004)


def test_the_floor_is_level_to_a_fifth_of_a_degree() -> None:
    """Positions with errors of 0.75 px alone would give its slope to g within half a degree."""
    slopes = []
    for seed in range(4):
        fit = hops(0.0, noise=0.75, seed=seed).fit
        pull = complex(*fit.pull[0])
        slopes.append((pull / fit.down).imag / abs(pull))
    assert np.sqrt(np.mean(np.square(slopes))) < 0.0045
