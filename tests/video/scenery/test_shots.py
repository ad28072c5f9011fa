"""Shots rendered for the tests obey closed forms of disks, blur, seams, noise and flight."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.video.scenery.shot_study import hull_places, rms_error, sharp_places
from tests.video.scenery.shots import DRAG, KINDS, Kind, Shot, drawn, efficiency, make_shot, strip

SHAPE = (112, 112)
STILL = np.zeros(2)


def few(kind: str, frames: int = 4) -> Kind:
    """Return a kind of shot with at most `frames` frames before and after the contact."""
    return replace(KINDS[kind], most_in=frames, most_out=frames)


def moments(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the centroid and the variances, each for x and y."""
    row, column = np.indices(share.shape)
    centre = np.array([(share * p).sum() for p in (column, row)]) / share.sum()
    spread = [(share * (p - c) ** 2).sum() for p, c in zip((column, row), centre, strict=True)]
    return centre, np.array(spread) / share.sum()


@pytest.mark.parametrize("place", [(55.5, 55.5), (56.13, 54.77), (55.86, 55.31)])
def test_a_disc_has_the_right_position_and_area(place: tuple[float, float]) -> None:
    kind = KINDS["plain"]
    _, share = drawn(kind, SHAPE, np.array(place), STILL, np.eye(3))
    centre, spread = moments(share.astype(float))
    assert centre == pytest.approx(place, abs=0.003)
    assert share.sum() == pytest.approx(np.pi * kind.radius**2, rel=1e-3)
    # variances of the disk, the lens and the pixel
    assert spread == pytest.approx(kind.radius**2 / 4 + kind.blur**2 + 1 / 12, rel=1e-3)


def test_blur_is_as_long_as_the_motion() -> None:
    kind, way = KINDS["back"], np.array([6.0, -2.0])
    (_, still), (_, moved) = (
        drawn(kind, SHAPE, np.array([55.3, 55.6]), each, np.eye(3)) for each in (STILL, way)
    )
    centre, spread = moments(moved.astype(float))
    assert centre == pytest.approx([55.3, 55.6], abs=0.003)
    assert spread - moments(still.astype(float))[1] == pytest.approx(way**2 / 12, rel=0.03)


def test_a_silhouette_is_evenly_dark() -> None:
    light, share = drawn(KINDS["back"], SHAPE, np.array([55.5, 55.5]), STILL, np.eye(3))
    assert np.abs(light - 0.85 * 360 * share).max() < 0.01


def test_hard_light_comes_from_its_lamp() -> None:
    bare = replace(KINDS["hard"], seams=0.0)
    light, _ = drawn(bare, SHAPE, np.array([55.5, 55.5]), STILL, np.eye(3))
    row, column = np.unravel_index(light.argmax(), SHAPE)
    lamp = np.array(bare.lamp) / np.linalg.norm(bare.lamp)
    assert (column, row) == pytest.approx(tuple(55.5 + bare.radius * lamp[:2]), abs=2)
    assert light.max() == pytest.approx(0.85 * 8400, rel=0.01)


def test_seams_turn_with_the_ball_and_cover_the_right_area() -> None:
    kind = replace(KINDS["soft"], ambient=0.999999)
    place, covered = np.array([55.5, 55.5]), []
    facing = cv2.Rodrigues(np.array([0.4, 1.1, -0.3]))[0]
    light, _ = drawn(kind, SHAPE, place, STILL, facing)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turned, _ = drawn(kind, SHAPE, place, STILL, facing @ quarter)
    assert np.abs(turned - np.rot90(light)).max() < 0.01 * light.max()
    assert np.abs(turned - light).max() > 0.3 * light.max()
    for axis in np.eye(3):
        for sign in (-1, 1):
            first = np.roll(np.eye(3), int(np.argmax(axis)), axis=0) * sign
            first[0] *= np.linalg.det(first)
            light, share = drawn(kind, SHAPE, place, STILL, first)
            row, column = np.indices(SHAPE)
            depth = np.sqrt(np.maximum(1 - ((row - 55.5) ** 2 + (column - 55.5) ** 2) / 37**2, 0))
            inside = depth > 0.3
            dark = 1 - light[inside] / (0.85 * kind.white * share[inside])
            covered.append((dark / depth[inside]).sum() / (1 / depth[inside]).sum() / kind.seams)
    # seam of length 11.6 radii and width 0.14 radii, on a surface of 4 pi
    assert np.mean(covered) == pytest.approx(11.6 * 0.14 / (4 * np.pi), rel=0.25)


def test_photon_noise_has_its_variance() -> None:
    kind = few("plain", 16)
    shot = make_shot(kind, 5)
    corner = shot.regions[:, 4:12, 4:12].astype(float)  # corner with background only
    behind = shot.background[396:404, 400:408].mean() - kind.black
    wanted = kind.gain * behind + (kind.gain * kind.read) ** 2 + 1 / 12
    flat = corner - corner.mean(axis=(1, 2), keepdims=True)
    assert flat.var() * 64 / 63 == pytest.approx(wanted, rel=0.12)
    assert corner.mean() == pytest.approx(behind + kind.black, rel=0.08)  # slope and flicker


@pytest.mark.parametrize("kind", ["plain", "hard"])
def test_positions_follow_drag_and_contact(kind: str) -> None:
    shot = make_shot(few(kind, 8), 7)
    scale = shot.kind.scale
    assert efficiency(shot, shot.x, np.ones_like(shot.x)) == pytest.approx(
        shot.efficiency, rel=1e-6
    )
    assert 26.8 <= np.hypot(*shot.velocity_in) <= 60
    into = shot.times < 0
    for side, velocity in ((into, shot.velocity_in), (~into, shot.velocity_out)):
        t, x = shot.times[side], (shot.x[side] - shot.contact[0]) / scale
        speed = np.hypot(*velocity)
        drag = DRAG * speed * t  # loss of speed by drag, to first order
        assert x == pytest.approx(
            velocity[0] * t * (1 - drag / 2), abs=2 * np.abs(x * drag**2).max()
        )
        assert (shot.y[side] - shot.contact[1]) / scale == pytest.approx(
            x * velocity[1] / velocity[0], abs=1e-9
        )
    assert (np.abs(shot.times) > shot.kind.exposure).all()


def test_regions_lie_in_the_strip() -> None:
    shot = make_shot(few("plain"), 3)
    for k, frame in enumerate(strip(shot, 320, 160)):
        column, row = shot.corners[k]
        assert frame.shape == (160, 1280)
        high, wide = shot.regions[k].shape
        part = frame[row - 320 : row - 320 + high, column : column + wide]
        assert np.array_equal(part, shot.regions[k])
        bat = frame[:, int(shot.bat[k]) + 5 : int(shot.bat[k]) + 60].mean()
        assert bat > 1.5 * frame[:, 1100:].mean()


def test_an_independent_estimator_finds_e_a() -> None:
    assert rms_error(few("plain", 10), 2, hull_places) < 0.01
    assert rms_error(few("back", 10), 2, lambda shot: (shot.x, np.ones_like(shot.x))) < 1e-5


def test_the_same_seed_gives_the_same_shot() -> None:
    one, other, third = (make_shot(few("soft", 2), seed) for seed in (1, 1, 2))
    assert np.array_equal(one.regions, other.regions)
    assert one.efficiency != third.efficiency


def test_frames_without_a_position_do_not_count() -> None:
    shot: Shot = make_shot(few("back", 8), 2)
    x = shot.x.copy()
    x[3] = np.nan
    assert efficiency(shot, x, np.ones_like(x)) == pytest.approx(shot.efficiency, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "most"), [("plain", 1e-4), pytest.param("soft", 1.7e-3, marks=pytest.mark.long)]
)
def test_the_edge_fit_is_much_sharper_than_a_hull(name: str, most: float) -> None:
    """Two clips each; `python -m tests.benchmarks.locating` uses 40 clips of four kinds."""
    assert rms_error(few(name, 10), 2, sharp_places) < most
