"""Speeds of flights from blobs of known motion: the u covers their errors."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.video.follow.test_pieces import RADIUS, blobs_of, hops
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.find.blobs import Blobs
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.following import FollowedClip, _let_go, follow_blobs
from virtual_lab.video.follow.joint import estimate_of, fit_flights
from virtual_lab.video.follow.knowledge import ClipKnowledge
from virtual_lab.video.follow.models import FittedFlights
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene

RATE = 240.0
BALL = 0.073  # diameter [m]


def followed(blobs: Blobs, readout: float | None = 0.0) -> FollowedClip:
    """Return flights and contacts of blobs, as from a camera on a stand."""
    count = int(blobs["frame"].max()) + 1
    clip = SimpleNamespace(
        count=count,
        times=np.arange(count) / RATE,
        shape=(540, 960),
        warnings=(),
        source=SimpleNamespace(path="clip"),
    )
    watched = Watched(
        still=cast("Any", SimpleNamespace(drifts=False, hidden_drift=0.0)),
        blobs=blobs,
        change=np.full(count, np.nan),
    )
    knowledge = ClipKnowledge(
        rate=RATE, ball=BALL, ball_u=1e-4, tripod=True, readout=readout, ruler="ball"
    )
    return follow_blobs(cast("Clip", clip), watched, knowledge)


@pytest.mark.parametrize("noise", [0.3, 0.5])
@pytest.mark.parametrize("before", [0, 5, 11, 15])
def test_the_u_of_speed_covers_a_roll_over_a_table_s_edge(before: int, noise: float) -> None:
    """Positions before the edge bend the path too little to be rejected; u covers their effect."""
    late = np.arange(-before, 86.0)
    fallen = np.where(late > 0, 0.07 * late**2 / 2, 0.0)
    blobs = blobs_of(np.stack([200 + 0.85 * late, 100 + fallen], axis=1), noise=noise)
    (flight,) = followed(blobs).flights
    true = 0.85 * RATE * BALL / (2 * RADIUS)
    assert abs(flight.speed_in.value - true) < 3 * flight.speed_in.u
    if not before:
        assert flight.speed_in.u < 0.08 * true


@pytest.mark.parametrize("before", [0, 3, 5, 8])
def test_the_u_of_speed_covers_rest_before_release(before: int) -> None:
    """In slow motion, rest before release lies on the path within an outline's error."""
    late = np.arange(-before, 140.0)
    fallen = np.where(late > 0, 0.04 * late**2 / 2, 0.0)
    blobs = blobs_of(np.stack([200 + 0 * late, 60 + fallen], axis=1), noise=0.02)
    (flight,) = followed(blobs).flights
    true = 0.04 * max(0, flight.first_frame - before) * RATE * BALL / (2 * RADIUS)
    assert abs(flight.speed_in.value - true) < 3 * flight.speed_in.u


@pytest.mark.parametrize("readout", [0.0, 0.5, 1.0])
def test_the_u_of_gravity_covers_an_unknown_readout(readout: float) -> None:
    """Rows read later show a falling ball later, which increases its apparent acceleration."""
    frames = np.arange(80.0)
    late, y = frames, np.zeros(80)
    for _ in range(20):
        y = 60 + 0.075 * late**2 / 2
        late = frames + readout * y / 540
    blobs = blobs_of(np.stack([200 + 0 * y, y], axis=1), noise=0.1)
    measured = followed(blobs, readout=None).gravity
    assert measured is not None
    true = 0.075 * RATE**2 * BALL / (2 * RADIUS)
    assert abs(measured.value - true) < 2.5 * measured.u


@pytest.mark.parametrize("along", [2.0, -2.0])
def test_a_ball_that_also_turns_back_along_the_floor_has_no_restitution(along: float) -> None:
    """A wall and a floor between two pictures have no common normal: there is no restitution."""
    late = np.arange(-50, 50) + 0.5
    x = np.where(late < 0, 3.0, along) * late
    y = np.where(late < 0, 8.0, -6.0) * late + 0.07 * late**2 / 2
    result = followed(blobs_of(np.stack([300 + x, 400 + y], axis=1)))
    (contact,) = result.contacts
    assert contact.kind == "floor"
    assert (contact.restitution is None) == (along < 0)
    assert ("CONTACT_UNCLEAR" in result.flags) == (along < 0)


def test_a_flight_with_more_scatter_has_a_larger_u() -> None:
    way, wholes = hops([6.0, 5.5, 3.0])
    time = np.arange(len(way), dtype=float)
    off = []
    for seed in range(40):
        blobs = blobs_of(way, noise=0.2)
        stray = wholes[2]
        noise = np.random.default_rng(seed).normal(0, 2.0, (2, len(stray)))
        blobs["x"][stray], blobs["y"][stray] = (way[stray].T + noise).tolist()
        scene = FlightScene(
            blobs=blobs, time=time, stamped=time, size=(960, 540), exposure=0.5, fall=None
        )
        flights = [Piece.of(blobs, whole, time[whole]) for whole in wholes]
        fit = fit_flights(scene, flights)
        along = estimate_of(lambda some: some.states[..., 2, 2], fit)
        off.append((along.value - 2.0) / along.u)
    assert 0.2 < np.std(off) < 1.5


def test_the_u_of_speed_covers_places_that_shift_slowly() -> None:
    """No residual shows a shift that grows from one end of a flight to the other."""
    time = np.arange(40.0)
    blobs = blobs_of(np.stack([100 + 6 * time, 100 + 0.07 * time**2 / 2], axis=1), noise=0.1)
    blobs["x"] += 0.25 * time / time[-1]
    blobs["edge"] = 2.0
    scene = FlightScene(
        blobs=blobs,
        time=time,
        stamped=time,
        size=(960, 540),
        exposure=0.5,
        pull=np.array([0, 0.07]),
        drag=(1e-7, 1e-8),
        in_radii=False,
        level_u=1e-3,
    )
    model = FittedFlights.of(scene, [Piece.of(blobs, np.arange(40), time)])
    speed = estimate_of(lambda fit: fit.states[..., 0, 2], model.fit, model.rest)
    assert abs(speed.value - 6) < 2 * speed.u < 0.02


def test_a_ball_that_moves_most_of_the_time_without_flying_is_flagged() -> None:
    """The ball rolls for 100 frames, or for 8, before it falls off a table."""
    for before, flagged in ((100, True), (8, False)):
        late = np.arange(-before, 86.0)
        fallen = np.where(late > 0, 0.07 * late**2 / 2, 0.0)
        blobs = blobs_of(np.stack([200 + 1.9 * late, 100 + fallen], axis=1), noise=0.2)
        clip = followed(blobs)
        (flight,) = clip.flights
        assert ("UNEXPLAINED" in clip.flags) == flagged
        share = (flight.last_frame - flight.first_frame + 1) / len(late)
        assert f"flights explain {100 * share:.0f} %" in " ".join(clip.warnings)


@pytest.mark.parametrize(
    ("down", "u"), [(1.3, 0.1), (1.2, np.hypot(0.1, 2 * np.hypot(3, 1.2) - 6))]
)
def test_a_ball_that_has_just_been_let_go_may_have_no_fall_yet(down: float, u: float) -> None:
    """Gravity is 0.25 px/frame², and the first position 0.5 px off: a fall of two frames, each way.

    A ball that falls faster than 0.25 (1 + 4) px/frame was let go before. The speed of the slower
    one is between that of the fit and that along the horizontal.
    """
    speed = Estimate(value=2 * float(np.hypot(3, down)), u=0.1)  # at 2 m/s per px/frame
    found = _let_go(speed, 2.0, 0.5, np.array([3.0, down]), np.array([0.0, 0.25]))
    assert found.value == speed.value
    assert found.u == pytest.approx(u)
