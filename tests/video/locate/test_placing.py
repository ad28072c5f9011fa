"""Plain and stitched balls of several flights together, their scales a step apart."""

from dataclasses import fields, replace

import numpy as np
import pytest

from tests.video.plain import located
from tests.video.stitched import LENS, scene
from virtual_lab.video.locate.located import Located, part_of
from virtual_lab.video.locate.one_radius import with_one_radius
from virtual_lab.video.locate.place import MODEL, place
from virtual_lab.video.locate.plain_ball.refining import Optics
from virtual_lab.video.locate.regions import Regions
from virtual_lab.video.locate.stitched_ball.edge import Edged, fit_edge

SCENES = {
    "plain": scene("back", count=10, seed=1),
    "stitched": scene("soft", count=24, seed=2),
    "few": scene("soft", count=4, seed=3),
    "larger": scene("soft", count=24, radius=30.4, seed=4),
}
FLIGHT = np.repeat([5, 2, 9, 3], [len(each.x) for each in SCENES.values()])
ROUND = (0.0, 1e-3)
NOISE = SCENES["plain"].noise


def seen_of(names: list[str]) -> tuple[Regions, Located]:
    """Return regions of some scenes and starts in them, off by half a pixel."""
    scenes = [SCENES[name] for name in names]
    regions = np.concatenate([each.regions for each in scenes])
    starts = [each.start() for each in scenes]
    start = located(
        np.concatenate([each.x for each in starts]),
        np.concatenate([each.y for each in starts]),
        30.1,
        scenes[0].blur,
    )
    seen = Regions(
        pixels=regions,
        background=np.concatenate(
            [
                np.full(SCENES[name].regions.shape, 155.0 if name == "plain" else 40.0, np.float32)
                for name in names
            ]
        ),
        corners=np.zeros((len(regions), 2)),
    )
    return seen, start


def placed(names: list[str], flight: np.ndarray | None = None) -> Located:
    seen, start = seen_of(names)
    side = seen.pixels.shape[1] / 2
    return place(
        seen,
        start,
        noise=NOISE,
        optics=Optics(lens=LENS),
        middle=(side, side),
        flight=flight,
        oval=ROUND,
    )


@pytest.fixture(scope="module")
def together() -> Located:
    return placed(list(SCENES), FLIGHT)


def test_each_flight_is_plain_or_not_by_itself(together: Located) -> None:
    """A plain ball among stitched ones: its occlusion fit, and what the model leaves open."""
    pattern_u = together.pattern_u
    assert pattern_u is not None
    assert (pattern_u[FLIGHT == 5] == MODEL).all()
    assert (pattern_u[FLIGHT != 5] != MODEL).all()


def test_flights_know_nothing_of_one_another() -> None:
    """What a radius in common makes of places: the same, each flight alone; of few, nothing."""
    names = ["stitched", "few", "larger"]
    seen, start = seen_of(names)
    flight, oval = np.repeat([2, 9, 3], [24, 4, 24]), np.linspace(0, 0.01, 52)
    order = np.random.default_rng(1).permutation(52)

    def edged(which: np.ndarray) -> Edged:
        return fit_edge(
            seen.pixels[which],
            seen.corners[which],
            part_of(start, which),
            noise=NOISE,
            lens=LENS,
            background=seen.background[which].astype(float),
            oval_u=1e-3,
        )

    whole = edged(order)
    together = with_one_radius(whole, oval[order], flight[order])
    for number in (2, 9, 3):
        mine = np.flatnonzero(flight[order] == number)
        own = Edged(
            located=part_of(whole.located, mine),
            **{
                each.name: getattr(whole, each.name)[mine]
                for each in fields(Edged)
                if each.name != "located"
            },
        )
        alone = with_one_radius(own, oval[order][mine], np.zeros(len(mine), int))
        kept = own.located if number == 9 else alone
        for field in ("x", "y", "radius", "x_u", "y_u", "pattern_u"):
            found = getattr(together, field)[mine]
            assert found == pytest.approx(getattr(kept, field), rel=1e-9)


def test_flights_at_two_scales_have_two_radii(together: Located) -> None:
    """Balls of 30.0 and 30.4 px, each told to 0.02 px; taken for one, places are poorer."""
    truth = {2: SCENES["stitched"], 3: SCENES["larger"]}
    for number, true in truth.items():
        assert np.abs(together.radius[number == FLIGHT] - true.radius).max() < 0.02
    names = ["stitched", "larger"]
    mixed = placed(names)
    off, wrong = [], []
    for number, true in truth.items():
        mine = number == FLIGHT
        off += [together.x[mine] - true.x, together.y[mine] - true.y]
    for true, part in zip(truth.values(), (slice(24), slice(24, 48)), strict=True):
        wrong += [mixed.x[part] - true.x, mixed.y[part] - true.y]
    assert np.sqrt(np.mean(np.square(off))) < 0.015
    assert np.sqrt(np.mean(np.square(off))) < np.sqrt(np.mean(np.square(wrong)))


def test_a_start_that_is_lost_loses_no_other() -> None:
    """NaN where the ball was not found; flights of it go on."""
    seen, start = seen_of(["stitched"])
    start = replace(start, x=np.where(np.arange(24) == 3, np.nan, start.x))
    found = place(
        seen, start, noise=NOISE, optics=Optics(lens=LENS), middle=(44.0, 44.0), oval=ROUND
    )
    assert np.isnan(found.x[3])
    rest = np.arange(24) != 3
    assert np.abs(found.x - SCENES["stitched"].x)[rest].max() < 0.1
