"""The truth of motions obeys the closed forms of flight, bounce and pendulum."""

import numpy as np
import pytest
from scipy.special import ellipk

from tests.video.scenery.motion import (
    GRAVITY,
    STEP,
    Ball,
    Carried,
    Motion,
    Path,
    Rolling,
    Surface,
    Swinging,
    Thrown,
)
from tests.video.scenery.scenes import SCENES

LIGHT = Ball(diameter=0.040, mass=0.0027)
FLOOR = Surface(at=1.0, restitution=(0.8, 0.7), keeps=0.9)


def thrown(velocity: tuple[float, float] = (0.5, 0.0), ball: Ball = LIGHT) -> Path:
    return Thrown(place=(0.0, 0.0), velocity=velocity, surfaces=(FLOOR,)).path(ball, 1.2)


def velocity_beside(path: Path, time: float, side: int) -> np.ndarray:
    """Return the velocity at a time from three positions on one side of it."""
    apart = 2e-3 * side
    x, y = path.at(time + apart * np.arange(3))
    return np.array([-3 * p[0] + 4 * p[1] - p[2] for p in (x, y)]) / (2 * apart)


def test_fall_with_drag_follows_closed_form() -> None:
    path = Thrown(place=(0.0, 0.0)).path(LIGHT, 1.5)
    terminal = np.sqrt(GRAVITY / LIGHT.drag_per_metre)
    fallen = terminal**2 / GRAVITY * np.log(np.cosh(GRAVITY * path.t / terminal))
    assert path.y == pytest.approx(fallen, abs=1e-8)
    assert fallen[-1] < 0.8 * GRAVITY * 1.5**2 / 2  # sizeable drag


def test_a_table_tennis_ball_has_its_known_drag() -> None:
    assert LIGHT.drag_per_metre == pytest.approx(0.1257, abs=1e-4)


def test_acceleration_is_gravity_less_drag() -> None:
    path = thrown((3.0, -2.0))
    inside = (path.t > 0.05) & (path.t < path.contacts[0].time - 0.05)
    apart = 50  # number of nodes
    t, places = path.t[inside][::apart], np.stack([path.x, path.y])[:, inside][:, ::apart]
    step = apart * STEP
    velocity = (places[:, 2:] - places[:, :-2]) / (2 * step)
    acceleration = (places[:, 2:] - 2 * places[:, 1:-1] + places[:, :-2]) / step**2
    drag = LIGHT.drag_per_metre * np.hypot(*velocity) * velocity
    assert acceleration == pytest.approx(np.array([[0], [GRAVITY]]) - drag, abs=0.01)
    assert t.size > 10


def test_contacts_have_the_stated_restitution() -> None:
    path = thrown()
    for contact, restitution in zip(path.contacts, (0.8, 0.7), strict=False):
        before, after = (velocity_beside(path, contact.time, side) for side in (-1, 1))
        assert -after[1] / before[1] == pytest.approx(restitution, rel=1e-4)
        assert after[0] / before[0] == pytest.approx(0.9, rel=1e-4)
        assert contact.velocity_in == pytest.approx(before, rel=1e-4)
        assert contact.velocity_out == pytest.approx(after, rel=1e-4)
        assert path.at(np.array(contact.time))[1] == pytest.approx(1.0 - LIGHT.radius, abs=1e-9)
    assert len(path.contacts) >= 2
    assert path.y.max() <= 1.0 - LIGHT.radius + 1e-9


def test_ball_that_no_longer_bounces_rolls() -> None:
    path = Thrown(place=(0, 0.8), velocity=(0.4, 0), surfaces=(FLOOR,)).path(LIGHT, 4.0)
    assert [name for _, name in path.phases][-1] == "rolling"
    assert path.y[-1] == pytest.approx(1.0 - LIGHT.radius, abs=1e-9)


def test_a_wall_reverses_the_normal_speed() -> None:
    wall = Surface(kind="right", at=0.5, restitution=(0.6,), keeps=1.0)
    path = Thrown(place=(0, 0), velocity=(3.0, -1.0), surfaces=(wall,)).path(Ball(), 0.5)
    (contact,) = path.contacts
    assert contact.kind == "wall"
    assert path.x.max() == pytest.approx(0.5 - Ball().radius, abs=1e-9)
    assert contact.velocity_out[0] == pytest.approx(-0.6 * contact.velocity_in[0])
    assert contact.velocity_out[1] == pytest.approx(contact.velocity_in[1])


def test_hand_and_ball_part_at_release_with_no_jump() -> None:
    held = Thrown(place=(0, 0), velocity=(2.0, -3.0), released=0.4, arm_from=(-1, 1))
    path = held.path(Ball(), 0.8)
    assert velocity_beside(path, 0.4, -1) == pytest.approx([2.0, -3.0], abs=0.01)
    assert velocity_beside(path, 0.4, 1) == pytest.approx([2.0, -3.0], abs=0.01)
    before = path.t < 0.4
    assert path.hand[before] == pytest.approx(np.stack([path.x, path.y], axis=1)[before])
    (x, y), closed = path.hand_at(0.55)
    assert closed == 0
    assert np.hypot(x - np.interp(0.55, path.t, path.x), y - np.interp(0.55, path.t, path.y)) > 0.1
    assert np.abs(np.diff(path.x)).max() < 1.1 * 2.0 * STEP  # motion without jumps


def test_caught_ball_stays_in_the_hand() -> None:
    scene = SCENES["thrown-up"]
    path = scene.actors[0].motion.path(scene.actors[0].ball, 2.0)
    assert [name for _, name in path.phases] == ["hand", "flight", "hand"]
    assert len(path.flights) == 1
    assert not path.contacts
    assert np.abs(np.diff(path.x)).max() < 4 * STEP
    assert np.abs(np.diff(path.hand, axis=0)).max() < 5 * STEP


def test_pendulum_has_the_period_of_its_amplitude() -> None:
    swing = Swinging(pivot=(0, 0), length=0.9, amplitude=0.6, damping=0.0)
    path = swing.path(Ball(), 6.0)
    rising = np.flatnonzero((path.x[:-1] < 0) & (path.x[1:] >= 0))
    period = 4 * np.sqrt(0.9 / GRAVITY) * ellipk(np.sin(0.3) ** 2)
    assert np.diff(path.t[rising]) == pytest.approx(period, abs=2 * STEP)
    assert np.hypot(path.x, path.y) == pytest.approx(0.9, abs=1e-9)


@pytest.mark.parametrize(
    ("motion", "phase"),
    [(Carried(), "hand"), (Rolling(place=(0, 0)), "rolling"), (Swinging(pivot=(0, 0)), "pendulum")],
)
def test_a_ball_that_never_flies_has_no_flight(motion: Motion, phase: str) -> None:
    path = motion.path(Ball(), 3.0)
    assert path.phases == ((0.0, phase),)
    assert not path.flights
    assert not path.contacts
    assert path.t[-1] >= 3.0
