"""Places in a flight by registration, for balls of which the wall hides a side."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.video.scenes import matte
from virtual_lab.units import Array
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.find.blobs import blobs
from virtual_lab.video.find.still import still_of
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.registering import register
from virtual_lab.video.follow.scene import FlightScene
from virtual_lab.video.follow.searching import FlightsFound

TIMES = np.arange(14.0)
Pictures = list[NDArray[np.uint8]]


def register_in(
    pictures: Pictures, watched: Watched, result: FlightsFound
) -> tuple[Watched, FlightsFound]:
    """Register the flight of a clip with these pictures."""
    clip = SimpleNamespace(
        full_scale=255, numbered_frames=lambda wanted: ((k, pictures[k]) for k in wanted)
    )
    return register(cast("Clip", clip), watched, result)


def flight(radius: float) -> tuple[Pictures, Watched, FlightsFound, Array]:
    """Return a ball that flies before a wall as bright as one of its sides, and its true places."""
    size = 13 * radius
    row, column = np.mgrid[: round(size), : round(3 * size)]
    wall = 100 + 70 * column / column.max()
    places = radius * np.stack([2.5 + 2.613 * TIMES, 3.0 + 0.031 * TIMES**2], axis=1)
    still = still_of([wall.round().astype(np.uint8)] * 8, 8, tripod=True)
    rows, pictures = [], []
    for k, (x, y) in enumerate(places):
        share = matte(wall.shape, x, y, radius)
        shade = 190 + 30 / radius * ((column - x) + (row - y))
        picture = (share * shade + (1 - share) * wall).round().astype(np.uint8)
        found = blobs(k, picture, still.shrunk(picture), np.zeros(4), still)
        largest = int(found["radius"].argmax())
        rows.append(found[largest : largest + 1])
        pictures.append(picture)
    moving, none = np.concatenate(rows), np.zeros((len(TIMES), 4))
    watched = Watched(still=still, blobs=moving, change=none[:, 0], drifts=none)
    scene = FlightScene(blobs=moving, time=TIMES, stamped=TIMES, size=still.size, exposure=None)
    way = Piece.of(moving, np.arange(len(TIMES)), TIMES)
    return pictures, watched, FlightsFound(scene=scene, ways=[way]), places


def scatter(places: Array, true: Array) -> float:
    """Return the rms deviation of places from the true ones, without their mean [pixels]."""
    off = places - true
    return float(np.sqrt(np.mean((off - off.mean(axis=0)) ** 2)))


@pytest.mark.parametrize("radius", [12.0, 72.0])
def test_a_side_that_the_wall_hides_moves_no_place(radius: float) -> None:
    """The pictures of the large ball are shrunk before they are matched."""
    pictures, watched, result, true = flight(radius)
    after, refined = register_in(pictures, watched, result)
    (way,) = refined.ways
    assert scatter(result.ways[0].xy, true) > 0.05 * radius
    assert scatter(way.xy, true) < 0.025 * radius
    for axis, name in enumerate("xy"):
        assert (after.blobs[name] == way.xy[:, axis]).all()
        assert (refined.scene.blobs[f"picture_{name}"] == way.xy[:, axis]).all()  # no drift


def test_registered_places_have_a_u_of_their_own_if_g_is_stated() -> None:
    """A larger u would reduce the weight of a flight from which g is fitted."""
    pictures, watched, result, true = flight(12.0)
    fitted = register_in(pictures, watched, result)[1].ways[0]
    assert fitted.pattern_u == result.ways[0].pattern_u
    scene = replace(result.scene, pull=np.array([0.0, 0.1]))
    stated = register_in(pictures, watched, replace(result, scene=scene))[1].ways[0]
    assert stated.pattern_u > 2 * scatter(stated.xy, true)
    assert stated.pattern_u < scatter(result.ways[0].xy, true)


def test_a_bright_spot_beside_the_ball_moves_no_place() -> None:
    """A spot of 5 x 5 pixels in one picture counts by its difference, not by the square of it."""
    pictures, watched, result, true = flight(12.0)
    plain = register_in(pictures, watched, result)[1].ways[0].xy
    x, y = true[6].round().astype(int)
    pictures[6][y - 2 : y + 3, x + 10 : x + 15] = 255
    places = register_in(pictures, watched, result)[1].ways[0].xy
    assert np.abs(places[6] - plain[6]).max() < 0.1
    assert np.abs(places - plain).max() < 0.3


def test_a_ball_that_is_hardly_brighter_than_noise_is_followed() -> None:
    """The ball is 2 pixels beside its blob, left and right in turn; 20 DN, and noise of 12 DN."""
    pictures, watched, result, blobs_at = flight(12.0)
    side = np.where(np.arange(len(TIMES)) % 2, 2.0, -2.0)
    true, rng = blobs_at + np.stack([side, 0 * side], axis=1), np.random.default_rng(1)
    shape = pictures[0].shape
    still = still_of([np.full(shape, 120, np.uint8)] * 8, 8, tripod=True)
    noisy = [
        120 + 20 * matte(shape, *place, 12.0) + 12 * rng.standard_normal(shape) for place in true
    ]
    moving = watched.blobs.copy()
    moving["x"], moving["y"] = blobs_at.T
    start = replace(result, ways=[replace(result.ways[0], xy=blobs_at)])
    pictures = [each.round().astype(np.uint8) for each in noisy]
    way = register_in(pictures, replace(watched, still=still, blobs=moving), start)[1].ways[0]
    assert scatter(way.xy, true) < 0.5


def test_places_of_a_written_track_stay() -> None:
    pictures, watched, result, _ = flight(12.0)
    written = replace(watched, drifts=np.array([]))
    after, refined = register_in(pictures, written, result)
    assert (after.blobs["x"] == watched.blobs["x"]).all()
    assert (refined.ways[0].xy == result.ways[0].xy).all()


def test_places_refer_to_the_first_picture_of_a_camera_that_drifts() -> None:
    """The last seven pictures are shifted by 5 and 3 pixels; blobs are in the still frame."""
    pictures, watched, result, _ = flight(12.0)
    plain = register_in(pictures, watched, result)[1].ways[0].xy
    drifts = np.zeros((len(TIMES), 4))
    drifts[7:, :2] = 5, 3
    moved = [
        picture if k < 7 else np.roll(picture, (3, 5), (0, 1)) for k, picture in enumerate(pictures)
    ]
    places = register_in(moved, replace(watched, drifts=drifts), result)[1].ways[0].xy
    assert np.abs(places - plain).max() < 0.05
