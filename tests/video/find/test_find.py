"""The still frame, its drift, and blobs in pictures of known content."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.video.scenery.filming import pictures
from tests.video.scenery.scenes import SCENES
from tests.video.scenes import Film, matte
from virtual_lab.video.find.blobs import blobs
from virtual_lab.video.find.drift import edges_of
from virtual_lab.video.find.still import still_of
from virtual_lab.video.find.watching import repeats
from virtual_lab.video.track.tracking import middle_of, uncovered_mean

NONE = np.zeros(2)


def test_a_shift_is_found_to_a_hundredth_of_a_pixel_whatever_moves_before() -> None:
    """Two pictures of one scene cut out of a larger one a known way apart; a square covers some."""
    rng = np.random.default_rng(3)
    coarse = rng.uniform(60, 200, (9, 12))
    row, column = np.mgrid[:120, :160] / 16.0

    def scene(x: float, y: float, light: float = 1.0) -> NDArray[np.uint8]:
        from scipy.ndimage import map_coordinates

        seen = map_coordinates(coarse, [row + y / 16, column + x / 16], order=3, mode="mirror")
        return np.clip(light * seen, 0, 255).astype(np.uint8)

    edges = edges_of(scene(0.0, 0.0))
    for way in ((0.0, 0.0), (1.37, -0.62), (-5.2, 4.9)):
        other = scene(*way, light=1.05)
        other[40:75, 60:100] = 250
        found = edges.shift(other, NONE)
        assert found == pytest.approx((-way[0], -way[1]), abs=0.03)


def test_drift_and_background_of_a_hand_held_phone() -> None:
    """The still frame is the first: shifts are those of the truth, the wall is where it was."""
    scene = replace(SCENES["glossy-floor"], count=40, mirror=0.0)
    frames = list(pictures(scene))
    still = still_of(frames[::2], 8, 2)
    assert still.drifts
    empty = next(pictures(replace(scene, actors=())))
    x, y = (-each for each in still.origin)
    inner = still.background[y : y + 240, x : x + 320].astype(int)
    assert np.percentile(np.abs(inner - empty), 95) < 8
    shift = NONE
    found = []
    for frame in frames:
        shift = still.shift(still.shrunk(frame), shift)
        found.append(shift)
    assert np.ptp(found, axis=0).max() > 2


def test_a_camera_on_a_stand_does_not_drift() -> None:
    for name in ("thrown-up", "light-ball"):
        scene = replace(SCENES[name], count=30)
        assert not still_of(list(pictures(scene)), 8).drifts


@pytest.mark.parametrize("blur", [(0.0, 0.0), (12.0, 5.0)])
def test_a_blob_is_where_and_as_large_as_the_ball(blur: tuple[float, float]) -> None:
    behind = np.full((200, 320), 60, np.uint8)
    share = matte(behind.shape, 150.3, 90.8, 14.0, blur)
    frame = np.round(behind * (1 - share) + 200 * share).astype(np.uint8)
    still = still_of([behind], 8, stands=True)
    (blob,) = blobs(0, frame, frame, NONE, still)
    assert (blob["x"], blob["y"]) == pytest.approx((150.3, 90.8), abs=0.1)
    assert blob["radius"] == pytest.approx(14.0, abs=0.2 + np.hypot(*blur) ** 2 / 600)
    assert blob["dirty"] < 0.05
    assert not blob["cut"]


def test_a_ball_that_is_held_or_cut_is_said_to_be() -> None:
    behind = np.full((120, 160), 60, np.uint8)
    still = still_of([behind], 8, stands=True)

    def seen(x: float, *, held: bool = False) -> list[np.void]:
        share = matte(behind.shape, x, 60.0, 12.0)
        frame = np.round(behind * (1 - share) + 220 * share).astype(np.uint8)
        if held:
            frame[54:66, int(x) + 12 :] = 190
        found = blobs(0, frame, frame, NONE, still)
        return [each for each in found if abs(each["x"] - x) < 6]

    assert not any(each["dirty"] < 0.05 for each in seen(80.0, held=True))
    assert [each["dirty"] for each in seen(80.0)] == [0]
    assert all(each["cut"] for each in seen(8.0))
    assert not any(each["cut"] for each in seen(80.0))


def test_a_changing_light_is_no_blob() -> None:
    frames = np.stack(list(Film(contact=(900.0, 900.0), count=8).frames())).astype(np.uint8)
    still = still_of(list(frames), 8, stands=True)
    for gain in (0.85, 1.0, 1.15):
        lit = np.clip(frames[3] * gain, 0, 255).astype(np.uint8)
        assert len(blobs(0, lit, lit, NONE, still)) == 0


def test_frames_stored_twice_change_less_than_those_beside() -> None:
    moving = np.array([np.nan, 40, 2, 42, 3, 39, 2, 41, 38, 40, 3, 44, 40.0])
    assert np.flatnonzero(repeats(moving)).tolist() == [2, 4, 6, 10]
    slowing = np.array([np.nan, 40, 30, 20, 12, 7, 12, 20, 30, 40.0])
    assert not repeats(slowing).any()
    key_frames = np.array([np.nan, 2, 2, 2, 30, 2, 2, 2, 2, 30, 2, 2.0])
    assert not repeats(key_frames).any()


@pytest.mark.parametrize("light", [True, False])
def test_what_is_behind_a_slow_ball(light: bool) -> None:
    """A ball covers a pixel in many frames; the mean of those that do not is the background."""
    ball, dark = (180.0, 40.0) if light else (20.0, 120.0)
    scene = Film(light=ball, dark=dark, velocity_out=(-2.0, 0.3))
    samples = np.stack(list(scene.frames())).astype(np.uint8)[::2]
    behind = dark + 30 * np.linspace(0, 1, 320)
    still = still_of(list(samples), 8, stands=True)
    assert np.percentile(np.abs(still.background - behind), 99) < 6
    x, y = scene.places()
    covered = [[(a, b, scene.radius + 4)] for a, b in zip(x[::2], y[::2], strict=True)]
    bare = uncovered_mean(samples, middle_of(samples), covered)
    far = np.hypot(*(np.mgrid[:200, :320] - np.array([[[100]], [[230]]]))) > 30
    assert np.abs(bare - behind)[far].max() < 6 * scene.noise / np.sqrt(3)
