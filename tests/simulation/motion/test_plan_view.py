"""What is seen of a shot from above, against free flight by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulation.motion.scenes import AXIS, INERTIA, MASS, RADIUS, rigid, scene, stop
from virtual_lab.simulation.motion import play
from virtual_lab.simulation.motion.played import plan_view
from virtual_lab.units import INCH


@pytest.mark.parametrize("rung", ["closed-form", "pymunk"])
def test_before_and_after_the_blow_it_is_free_flight(rung: str) -> None:
    """By hand, without air: the ball comes and goes at even speeds, the bat turns at one rate."""
    place = 5 * INCH
    played = scene(z=[place, 8 * INCH], drag=0.0, gravity=0.0, duration=0.1)
    seen = plan_view(played, play(played, rung), 0, moments=50)
    touch = -RADIUS - float(played.bat.radius(np.array(place)))
    blow, e_A = (0.9 + touch) / 26.8, float(rigid(np.array(place)))
    (contact,) = seen.contacts
    assert contact.struck == "bat"
    assert contact[1:] == pytest.approx((blow, touch, place), abs=1e-12)
    late = np.maximum(seen.time - blow, 0.0)
    way = np.where(late > 0, touch - e_A * 26.8 * late, -0.9 + 26.8 * seen.time)
    assert seen.ball_x == pytest.approx(way, abs=1e-11)
    assert seen.ball_z == pytest.approx(np.full(len(way), place), abs=1e-12)
    rate = MASS * (AXIS - place) * (1 + e_A) * 26.8 / INERTIA
    assert seen.angle == pytest.approx(rate * late, abs=1e-11)
    assert contact.time in seen.time
    assert seen.axis == AXIS


def test_all_that_is_struck_is_named_in_turn() -> None:
    played = scene(z=3 * INCH, stop=stop(0.02, 1.0), duration=0.1, vx=10.0, gravity=0.0)
    seen = plan_view(played, play(played), 0)
    assert [contact.struck for contact in seen.contacts][:3] == ["bat", "stop", "bat again"]
    assert seen.angle.max() == pytest.approx(0.02)
    assert np.isin([contact.time for contact in seen.contacts], seen.time).all()


def test_a_refused_shot_is_not_shown() -> None:
    played = scene(z=-0.02)
    with pytest.raises(ValueError, match="edge of the bat's end"):
        plan_view(played, play(played), 0)
