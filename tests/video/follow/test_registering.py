"""Places in a flight by registration, for balls of which the wall hides a side."""

from dataclasses import replace

import numpy as np
import pytest

from tests.video.scenes import matte
from virtual_lab.units import Array
from virtual_lab.video.find.blobs import blobs
from virtual_lab.video.find.still import still_of
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.registering import register
from virtual_lab.video.follow.scene import FlightScene
from virtual_lab.video.follow.searching import FlightsFound

TIMES = np.arange(14.0)


def flight(radius: float) -> tuple[Watched, FlightsFound, Array]:
    """Return a ball that flies before a wall as bright as one of its sides, and its true places."""
    size = 13 * radius
    row, column = np.mgrid[: round(size), : round(3 * size)]
    wall = 100 + 70 * column / column.max()
    places = radius * np.stack([2.5 + 2.613 * TIMES, 3.0 + 0.031 * TIMES**2], axis=1)
    still = still_of([wall.round().astype(np.uint8)] * 8, 8, tripod=True)
    rows, views = [], {}
    for k, (x, y) in enumerate(places):
        share = matte(wall.shape, x, y, radius)
        shade = 190 + 30 / radius * ((column - x) + (row - y))
        picture = (share * shade + (1 - share) * wall).round().astype(np.uint8)
        found, around = blobs(k, picture, still.shrunk(picture), np.zeros(4), still)
        largest = int(found["radius"].argmax())
        rows.append(found[largest : largest + 1])
        views[k] = around[largest]
    moving = np.concatenate(rows)
    watched = Watched(still=still, blobs=moving, change=np.zeros(len(TIMES)), views=views)
    scene = FlightScene(blobs=moving, time=TIMES, stamped=TIMES, size=still.size, exposure=None)
    way = Piece.of(moving, np.arange(len(TIMES)), TIMES)
    return watched, FlightsFound(scene=scene, ways=[way]), places


def scatter(places: Array, true: Array) -> float:
    """Return the rms deviation of places from the true ones, without their mean [pixels]."""
    off = places - true
    return float(np.sqrt(np.mean((off - off.mean(axis=0)) ** 2)))


@pytest.mark.parametrize("radius", [12.0, 72.0])
def test_a_side_that_the_wall_hides_moves_no_place(radius: float) -> None:
    """The pictures of the large ball are shrunk before they are matched."""
    watched, result, true = flight(radius)
    after, refined = register(watched, result)
    (way,) = refined.ways
    assert scatter(result.ways[0].xy, true) > 0.05 * radius
    assert scatter(way.xy, true) < 0.025 * radius
    for axis, name in enumerate("xy"):
        assert (after.blobs[name] == way.xy[:, axis]).all()
        assert (refined.scene.blobs[f"picture_{name}"] == way.xy[:, axis]).all()  # no drift


def test_a_bright_spot_beside_the_ball_moves_no_place() -> None:
    """A spot of 5 x 5 pixels in one picture counts by its difference, not by the square of it."""
    watched, result, true = flight(12.0)
    plain = register(watched, result)[1].ways[0].xy
    view = watched.views[6]
    picture = view.picture.copy()
    x, y = (true[6] - view.corner).round().astype(int)
    picture[y - 2 : y + 3, x + 10 : x + 15] = 255
    spotted = replace(watched, views=watched.views | {6: view._replace(picture=picture)})
    places = register(spotted, result)[1].ways[0].xy
    assert np.abs(places[6] - plain[6]).max() < 0.1
    assert np.abs(places - plain).max() < 0.3


def test_a_ball_that_is_hardly_brighter_than_noise_is_followed() -> None:
    """The ball is 2 pixels beside its blob, left and right in turn; 20 DN, and noise of 12 DN."""
    watched, result, blobs_at = flight(12.0)
    side = np.where(np.arange(len(TIMES)) % 2, 2.0, -2.0)
    true, rng = blobs_at + np.stack([side, 0 * side], axis=1), np.random.default_rng(1)
    views = {}
    for k, view in watched.views.items():
        shape = view.picture.shape[:2]
        share = matte(shape, *(true[k] - view.corner), 12.0)
        picture = 120 + 20 * share + 12 * rng.standard_normal(shape)
        behind = np.full(shape, 120, np.uint8)
        views[k] = view._replace(picture=picture.round().astype(np.uint8), behind=behind)
    moving = watched.blobs.copy()
    moving["x"], moving["y"] = blobs_at.T
    start = replace(result, ways=[replace(result.ways[0], xy=blobs_at)])
    way = register(replace(watched, blobs=moving, views=views), start)[1].ways[0]
    assert scatter(way.xy, true) < 0.5


def test_places_without_a_view_stay() -> None:
    watched, result, _ = flight(12.0)
    views = {k: view for k, view in watched.views.items() if k != 5}
    after, refined = register(replace(watched, views=views), result)
    assert (after.blobs["x"] == watched.blobs["x"]).all()
    assert (refined.ways[0].xy == result.ways[0].xy).all()
