"""Flights from blobs of known motion: a toss, low hops, a two-colored ball, repeats."""

import numpy as np
import pytest
from numpy.typing import NDArray

from virtual_lab.video.clips.timing import is_uneven, usual_step
from virtual_lab.video.find.blobs import BLOB, Blobs
from virtual_lab.video.follow.flights import explained_share, falls_freely, flights_of
from virtual_lab.video.follow.joint import fit_flights
from virtual_lab.video.follow.pieces import Piece, pieces
from virtual_lab.video.follow.scene import FlightScene

Array = NDArray[np.float64]
RADIUS = 15.0  # radius of the ball [px]
PULL = 0.285  # gravity [px/frame²]


def blobs_of(xy: Array, colour: Array | float = 100.0, noise: float = 0.2) -> Blobs:
    """Return one clean blob per frame at these positions, (frame, 2) [px]."""
    blobs = np.zeros(len(xy), BLOB)
    blobs["frame"] = np.arange(len(xy))
    blobs["x"], blobs["y"] = (xy + np.random.default_rng(5).normal(0, noise, xy.shape)).T
    blobs["picture_x"], blobs["picture_y"] = blobs["x"], blobs["y"]
    blobs["radius"] = blobs["length"] = RADIUS
    blobs["contrast"] = 80.0
    blobs["colour"] = np.broadcast_to(np.reshape(colour, (-1, 1)), (len(xy), 3))
    return blobs


def flights_in(blobs: Blobs, fall: float = PULL / RADIUS) -> list[Piece]:
    """Return the flights for a global shutter; the first round gives g to the second."""
    time = np.arange(blobs["frame"].max() + 1.0)
    scene = FlightScene(
        blobs=blobs,
        time=time,
        stamped=time,
        size=(960, 540),
        exposure=0.5,
        fall=fall,
    )
    flights, fit = flights_of(scene, pieces(blobs, time))
    if fit is not None:
        flights, _ = flights_of(scene, pieces(blobs, time, fit.pull[0]))
    return flights


def hops(speeds: list[float]) -> tuple[Array, list[NDArray[np.intp]]]:
    """Return a ball's path with these speeds off the floor [px/frame], and each hop's frames."""
    ends = np.cumsum([0.4, *(2 * each / PULL for each in speeds)])
    t = np.arange(int(ends[-1]))
    y = np.full(len(t), 400.0)
    whole = []
    for start, end, speed in zip(ends[:-1], ends[1:], speeds, strict=True):
        inside = (t >= start) & (t < end)
        late = t[inside] - start
        y[inside] -= speed * late - PULL * late**2 / 2
        whole.append(np.flatnonzero(inside & (t > start + 0.5) & (t < end - 0.5)))
    return np.stack([100 + 2.0 * t, y], axis=1), whole


def test_a_toss_is_separated_from_the_hand() -> None:
    """The velocity hardly changes at release, so that a single cut leaves no parabola."""
    rise = np.cumsum(np.linspace(0, 9.5, 26))  # hand, up to 9.5 px/frame
    late = np.arange(1, 67)
    flown = rise[-1] + 9.5 * late - PULL * late**2 / 2
    caught = flown[-1] - 6.0 * np.arange(1, 15)
    y = 500 - np.concatenate([rise, flown, caught])
    (flight,) = flights_in(blobs_of(np.stack([np.full(len(y), 400.0), y], axis=1)))
    assert abs(flight.frames[0] - len(rise)) <= 3
    assert abs(flight.frames[-1] - (len(rise) + len(flown))) <= 3


def test_a_shadow_that_a_low_sun_moves_across_the_ground_is_no_ball() -> None:
    """The shadow moves on a parabola; its last piece is too short to show the direction of bend."""
    way, (_, _, last) = hops([9.0, 8.0, 7.0])
    way = way[: last[9]]
    ball = blobs_of(way, noise=0.3)[12:]  # blobs after the ball leaves the hand
    shadow = blobs_of(np.stack([700 - 0.6 * (400 - way[:, 1]), np.full(len(way), 420.0)], axis=1))
    shadow["radius"] = shadow["length"] = 6.0
    shadow["colour"] = 60.0
    both = np.concatenate([ball, shadow])
    flights = flights_in(both[np.argsort(both["frame"], kind="stable")])
    assert len(flights) >= 2
    assert all((each.xy[:, 0] < 500).all() for each in flights)


@pytest.mark.parametrize("lost", [1, 5])
def test_frames_lost_during_a_flight_are_counted(lost: int) -> None:
    late = np.delete(np.arange(80.0), np.s_[20 : 20 + lost])
    y = 420 - 10 * late + PULL * late**2 / 2
    (flight,) = flights_in(blobs_of(np.stack([100 + 4 * late, y], axis=1)))
    np.testing.assert_array_equal(flight.t, late)


def test_frames_lost_at_a_contact_are_counted() -> None:
    """Five frames are lost while the ball bounces, so that no flight shows the gap itself."""
    way, (_, second, _) = hops([11.0, 10.0, 9.0])
    kept = np.delete(np.arange(len(way)), np.s_[second[0] - 3 : second[0] + 2])
    flights = flights_in(blobs_of(way[kept], noise=0.05))
    assert len(flights) == 3
    for each in flights:
        np.testing.assert_array_equal(each.t, kept[each.frames])


def test_the_share_of_explained_frames_counts_every_frame_of_a_flight() -> None:
    """The ball moves in 50 frames, of which a flight spans 24."""
    late = np.arange(50.0)
    blobs = blobs_of(np.stack([100 + 4 * late, np.full(50, 300.0)], axis=1))
    scene = FlightScene(blobs=blobs, time=late, stamped=late, size=(960, 540), exposure=0.5)
    flight = Piece.of(blobs, np.arange(10, 34), late[10:34])
    assert explained_share(scene, [flight]) == 24 / 50


def test_leaves_that_sail_down_slowly_are_not_the_falling_ball() -> None:
    """The leaves are more and move alike; over so many frames, gravity would show."""
    late = np.arange(16.0)
    ball = blobs_of(np.stack([300 + 8 * late, 100 + PULL * late**2], axis=1))
    leaves = [
        blobs_of(np.stack([x + 6 * late, y + 5 * late + 0.02 * late**2], axis=1))
        for x, y in ((40.0, 60.0), (60.0, 300.0), (500.0, 40.0))
    ]
    leaves.append(leaves[0][:7].copy())  # leaf that is too short to show that it does not fall
    for k, leaf in enumerate(leaves):
        leaf["frame"] += 18 * k
        leaf["radius"] = leaf["length"] = 12.0
    both = np.concatenate([ball, *leaves])
    (flight,) = flights_in(both[np.argsort(both["frame"], kind="stable")], fall=2 * PULL / RADIUS)
    assert len(flight.t) == 16
    assert np.allclose(flight.xy[:, 0], 300 + 8 * late, atol=1.0)


def test_another_ball_does_not_continue_the_flights_of_the_first() -> None:
    """Another ball has other color and size; a two-colored ball that turns keeps its size."""
    way, whole = hops([9.0, 8.0, 7.0, 6.0])
    blobs = blobs_of(way)
    late = blobs["frame"] >= whole[2][0]
    blobs["colour"][late] = 200.0
    assert len(flights_in(blobs)) == 4
    blobs["radius"][late] = blobs["length"][late] = RADIUS / 1.5
    flights = flights_in(blobs)
    assert len(flights) == 2
    assert max(each.frames[-1] for each in flights) < whole[2][0]


@pytest.mark.parametrize("drawn", [0.0, 3.0])
@pytest.mark.parametrize("across", [1.0, 0.1])
def test_hops_lower_than_the_ball_are_flights(across: float, drawn: float) -> None:
    """The struck surface displaces the last blob before it by `drawn` pixels."""
    way, whole = hops([6.0, 4.2, 2.9, 2.1])
    way[:, 0] *= across
    way[[each[-1] for each in whole], 1] -= drawn
    flights = flights_in(blobs_of(way))
    assert len(flights) == len(whole)
    for flight, inside in zip(flights, whole, strict=True):
        assert np.isin(inside, flight.frames).mean() >= 0.8


def test_dark_patches_of_a_ball_do_not_replace_it() -> None:
    """Three patches with equal motion count as one; the ball's own flights have more positions."""
    way, (one, two, three) = hops([3.0, 2.9, 2.8])
    ball, patches = blobs_of(way), []
    for k, off in enumerate(((-5.0, 0.0), (4.0, -5.0), (4.0, 6.0))):
        patch = blobs_of(way + off, noise=0.1 + 0.01 * k)[three]
        patch["radius"] = patch["length"] = 4.0
        patches.append(patch)
    both = np.concatenate([ball[one], ball[two], *patches])
    flights = flights_in(both[np.argsort(both["frame"], kind="stable")])
    assert [each.radius for each in flights] == [RADIUS, RADIUS]


def test_a_turning_ball_in_two_colors_is_one_ball() -> None:
    way, whole = hops([6.0, 5.0, 4.0])
    colour = np.full(len(way), 60.0)
    colour[whole[1][0] :] = 140.0
    colour[whole[2][0] :] = 215.0
    assert len(flights_in(blobs_of(way, colour))) == 3


def test_rest_before_a_fall_is_no_part_of_the_flight() -> None:
    late = np.maximum(np.arange(60) - 25.0, 0)
    way = np.stack([np.full(60, 300.0), 100 + PULL * late**2 / 2], axis=1)
    (flight,) = flights_in(blobs_of(way))
    assert 22 <= flight.frames[0] <= 29


@pytest.mark.parametrize("after", [1 / 30, 1 / 24])
def test_a_phone_may_film_on_at_a_lower_rate(after: float) -> None:
    """Phones change from 30 to 24 frames per second in the dark; time stamps show it."""
    rounded = np.random.default_rng(1).uniform(-4e-4, 4e-4, 80)
    times = np.cumsum([*np.full(30, 1 / 30), *np.full(50, after)]) + rounded
    assert is_uneven(times) == (after != 1 / 30)
    assert usual_step(times) == pytest.approx(after, rel=0.02)


def test_a_hand_that_goes_with_the_ball_does_not_begin_a_flight() -> None:
    """The hand is on the ball's path, but its blob is longer than the ball and its blur."""
    t = np.arange(30.0)
    blobs = blobs_of(np.stack([300 + 4 * t, 400 - 6 * t + PULL * t**2 / 2], axis=1))
    blobs["length"][:3] *= 1.9
    (flight,) = flights_in(blobs)
    assert flight.frames[0] == 3
    assert flight.frames[-1] == 29


@pytest.mark.parametrize("angle", [0.6, 0.8, 1.0, 1.2])
def test_a_pendulum_that_starts_slowly_is_no_flight(angle: float) -> None:
    """Each quarter of its swing is nearly a parabola, but the acceleration points to the side."""
    length, pull = 300.0, 1.1  # length [px], gravity [px/frame²]
    turns, rate = [angle], 0.0
    for _ in range(79):  # small steps of the equation of motion
        for _ in range(100):
            rate -= pull / length * np.sin(turns[-1]) / 100
            turns[-1] += rate / 100
        turns.append(turns[-1])
    turn = np.array(turns)
    blobs = blobs_of(np.stack([480 + length * np.sin(turn), 80 + length * np.cos(turn)], axis=1))
    assert pieces(blobs, np.arange(80.0))
    assert flights_in(blobs, 0.0) == []


@pytest.mark.parametrize(
    ("pull", "count", "noise", "falls"),
    [
        (PULL, 20, 0.1, True),
        (PULL / 10, 20, 0.1, False),
        (PULL / 10, 80, 0.1, True),
        (PULL / 10, 80, 1.0, False),
        (PULL, 20, 4.0, False),
        (0, 5, 0.0, False),
    ],
)
def test_a_path_that_does_not_show_a_fall_is_no_flight(
    pull: float, count: int, noise: float, falls: bool
) -> None:
    """A held ball bends its path too little, scatters, or moves by less than two radii.

    In slow motion a path bends as little, but is a parabola.
    """
    late = np.arange(float(count))
    blobs = blobs_of(np.stack([100 + 4 * late, 100 + pull * late**2 / 2], axis=1), noise=noise)
    scene = FlightScene(
        blobs=blobs,
        time=late,
        stamped=late,
        size=(960, 540),
        exposure=0.5,
        fall=PULL / RADIUS,
    )
    flights = [Piece.of(blobs, np.arange(count), late)]
    assert falls_freely(scene, flights, fit_flights(scene, flights)) == falls


@pytest.mark.parametrize("fall", [None, 5 * PULL / RADIUS])
@pytest.mark.parametrize(("count", "falls"), [(24, True), (50, False)])
def test_a_ball_that_moves_on_beyond_its_path_must_fall(
    count: int, falls: bool, fall: float | None
) -> None:
    """Parts of a hand's path are lines or parabolas by chance; a ball in flight would fly on.

    With an expected fall, the path bends by more than a radius, as with a wrong frame rate.
    """
    late = np.arange(float(count))
    turned = np.maximum(late - 23, 0) / 8
    right, down = 4 * np.minimum(late, 23) + 32 * np.sin(turned), 32 - 32 * np.cos(turned)
    down += (PULL / 2 if fall else 0.0) * np.minimum(late, 23) ** 2
    blobs = blobs_of(100 + np.stack([right, down], axis=1))
    scene = FlightScene(
        blobs=blobs, time=late, stamped=late, size=(960, 540), exposure=0.5, fall=fall
    )
    flights = [Piece.of(blobs, np.arange(24), late[:24])]
    assert falls_freely(scene, flights, fit_flights(scene, flights)) == falls
