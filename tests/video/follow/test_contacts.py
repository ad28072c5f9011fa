"""Contributions to the u and time of a contact, for a bounce with exactly known speeds."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.video.follow.test_pieces import RADIUS, blobs_of
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.follow.contacts import Contact, contacts_of
from virtual_lab.video.follow.doubts import of_drag, of_positions
from virtual_lab.video.follow.flights import flights_of, meetings
from virtual_lab.video.follow.joint import fit_flights
from virtual_lab.video.follow.knowledge import ClipKnowledge
from virtual_lab.video.follow.models import FittedFlights
from virtual_lab.video.follow.pieces import Piece, pieces
from virtual_lab.video.follow.ruler import Ruler
from virtual_lab.video.follow.scene import FlightScene

PULL = 0.2  # gravity [px/frame²]
SIZE = (2400, 700)
MET = 40.3  # time of the contact [frames]
FLOOR = 600.0  # height of the floor [px]
SCALE = PixelScale(metres_per_pixel=1e-3, relative_u=0.0, source="given")


def bounce(across: float, readout: float = 0.0) -> FittedFlights:
    """Return a bounce with restitution 0.7; each frame shows the ball when its row is read."""
    frames = np.arange(95.0)
    late = np.zeros(95)
    for _ in range(20):  # iterations: the row depends on the position, the position on the row
        t = frames + readout * late - MET
        y = FLOOR + np.where(t < 0, 9.0, -6.3) * t + PULL * t**2 / 2
        late = np.clip(y / (SIZE[1] - 1), 0, 1)
    blobs = blobs_of(np.stack([100 + across * (t + MET), y], axis=1), noise=0.02)
    scene = FlightScene(
        blobs=blobs,
        time=frames,
        stamped=frames,
        size=SIZE,
        exposure=0.2,
        readout=readout,
        fall=PULL / RADIUS,
    )
    ways, _ = flights_of(scene, pieces(blobs, frames))
    assert len(ways) == 2
    return FittedFlights.of(scene, ways)


def contact(model: FittedFlights) -> Contact:
    (result,), _ = contacts_of(model, 1.0, Ruler.of(SCALE, ClipKnowledge(rate=1.0)), None)
    return result


def test_a_contact_may_be_hidden_for_a_part_of_long_flights() -> None:
    """At a floor a shadow hides the ball for ten frames; between short flights it is a catch."""
    model = bounce(5.0)
    for most, found in ((99, 1), (21, 0)):
        away = [np.abs(way.t - 41) for way in model.ways]
        parts = [(each > 5) & (each < most) for each in away]
        ways = [way.part(part) for way, part in zip(model.ways, parts, strict=True)]
        assert len(meetings(ways, model.fit)) == found
        ruler = Ruler.of(SCALE, ClipKnowledge(rate=1.0))
        notes = contacts_of(replace(model, ways=ways), 1.0, ruler, None)[1]
        assert ("CONTACT_OUTSIDE" in dict(notes)) == (not found)


def test_time_and_frame_of_a_contact_are_corrected_for_the_readout() -> None:
    """The row of the floor is read 0.86 of a frame after the first one."""
    model = bounce(5.0, readout=1.0)
    # read 0.44 frames before the contact, and 0.56 after it
    assert [model.ways[0].frames[-1], model.ways[1].frames[0]] == [39, 40]
    result = contact(model)
    read_at = MET - FLOOR / (SIZE[1] - 1)
    assert result.frame == pytest.approx(read_at, abs=0.05)
    assert result.time.value == pytest.approx(read_at, abs=0.05)


def test_the_u_of_a_contact_s_time_includes_alternative_fits() -> None:
    model = bounce(5.0)
    vector = model.fit.vector.copy()
    vector[-3] += 3.0  # second flight 3 px lower: contact 0.2 frames later
    late = 3.0 / (9.0 + 6.3)
    beside = replace(model, rest=[*model.rest, model.fit.with_vector(vector)])
    apart = contact(beside).time.u ** 2 - contact(model).time.u ** 2
    assert np.sqrt(apart) == pytest.approx(late, rel=0.1)


@pytest.mark.parametrize(
    ("flight", "part", "off", "flagged"),
    [
        (0, slice(-3, None), 1.5, True),
        (1, slice(3), 1.5, True),
        (1, slice(20, 24), 1.5, True),
        (0, slice(7, 8), 2.5, True),
        (0, slice(7, 8), 1.5, False),
        (0, slice(7, 9), 1.5, False),
    ],
)
def test_three_positions_or_one_twice_as_far_off_the_flight_are_flagged(
    flight: int, part: slice, off: float, flagged: bool
) -> None:
    """The limit is 0.07 radii, 1.05 px."""
    model = bounce(5.0)
    residuals = [each.copy() for each in model.fit.residuals]
    residuals[flight][part] = [0.0, off]
    notes = of_positions(replace(model, fit=replace(model.fit, residuals=residuals)))
    assert [flag for flag, _ in notes] == ["POSITIONS_OFF"] * flagged
    frames = ", ".join(map(str, model.ways[flight].frames[part]))
    for _, words in notes:
        assert re.search(rf" frames? {frames} (is|are up to) {off} pixels", words)


def test_the_u_of_a_restitution_includes_a_fit_without_the_positions_that_are_off() -> None:
    model = bounce(5.0)
    one, other = model.ways
    xy = one.xy.copy()
    xy[-3:] -= [0, 4]
    off = FittedFlights.of(model.scene, [replace(one, xy=xy), other])
    without = FittedFlights.of(model.scene, [one.part(slice(-3)), other])
    wide, narrow, true = (contact(m).restitution for m in (off, replace(off, rest=[]), without))
    added = np.sqrt(wide.u**2 - narrow.u**2)
    assert added == pytest.approx(abs(true.value - narrow.value), rel=1e-3)


def test_a_stated_drag_that_the_flights_contradict_is_flagged() -> None:
    model = bounce(5.0)
    fitted = model.fit.drag * model.ways[0].radius
    for ratio, flags in ((100.0, ["DRAG"]), (1.0, [])):
        drag = ratio * fitted
        stated = replace(model, scene=replace(model.scene, drag=(drag, drag / 5)))
        assert [flag for flag, _ in of_drag(stated)] == flags
    assert of_drag(model) == []


def test_a_tilted_floor_adds_to_the_u_of_an_oblique_bounce() -> None:
    """A floor turned by 0.2 degrees converts tan(0.2 deg) of the tangential speed."""
    result = contact(bounce(20.0))
    assert result.restitution is not None
    least = np.radians(0.2) * (20.0 + 0.7 * 20.0) / 9.0
    assert least < result.restitution.u < 2 * least


def test_correlated_residuals_increase_the_u_of_a_speed() -> None:
    """Autoregressive errors of 0.6 have a variance larger by (1 + .6)/(1 - .6) = 4.

    A position that is far off does not hide it.
    """
    draw = np.random.default_rng(7)
    noise = np.zeros((2, 800))
    for k in range(1, 800):
        noise[:, k] = 0.6 * noise[:, k - 1] + 0.8 * draw.normal(0, 0.5, 2)
    t = np.arange(800.0)
    places = np.stack([3.0 * t, 0.001 * t**2], axis=1)
    speeds_u = []
    far = noise + 50.0 * (t == 400)
    for errors in (draw.normal(0, 0.5, (2, 800)), noise, far):
        blobs = blobs_of(places + errors.T, noise=0.0)
        scene = FlightScene(
            blobs=blobs,
            time=t,
            stamped=t,
            size=SIZE,
            exposure=0.2,
            drag=(0.0, 0.0),
            level_u=0.0,
        )
        fit = fit_flights(scene, [Piece.of(blobs, np.arange(800), t)])
        speeds_u.append(float(np.sqrt(fit.covariance[-2, -2])))
    assert speeds_u[1] / speeds_u[0] == pytest.approx(2.0, rel=0.15)
    assert speeds_u[2] / speeds_u[1] == pytest.approx(1.0, abs=0.02)
