"""Spots in full frames, and the one way through them that is a ball's."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from virtual_lab.video.track.finding import Spot, finder
from virtual_lab.video.track.linking import ball_track

from tests.video.scenes import Film, matte
from virtual_lab.errors import InputError
from virtual_lab.video.clips.background import (
    first_background,
    light_ball,
    uncovered_mean,
)

FULL = 255.0


def frames_of(film: Film) -> NDArray[np.uint8]:
    return np.stack(list(film.frames())).astype(np.uint8)


@pytest.mark.parametrize("light", [True, False])
def test_which_is_lighter_and_what_is_behind(light: bool) -> None:
    """A slow ball covers a pixel in most frames; what is behind it is found all the same."""
    ball, dark = (180.0, 40.0) if light else (20.0, 120.0)
    film = Film(light=ball, dark=dark, velocity_out=(-2.0, 0.3))
    samples = frames_of(film)[::2]
    assert light_ball(samples) is light
    first = first_background(samples, light=light)
    behind = dark + 30 * np.linspace(0, 1, 320)
    assert np.abs(first - behind).mean() < 1.0
    x, y = film.places()
    covered = [[(a, b, film.radius + 4)] for a, b in zip(x[::2], y[::2], strict=True)]
    bare = uncovered_mean(samples, first, covered)
    far = np.hypot(*(np.mgrid[:200, :320] - np.array([[[100]], [[230]]]))) > 30
    assert np.abs(bare - behind)[far].max() < 6 * film.noise / np.sqrt(3)


@pytest.mark.parametrize("blur", [(0.0, 0.0), (12.0, 5.0)])
@pytest.mark.parametrize("halvings", [0, 2])
def test_a_spot_is_where_and_as_large_as_the_ball(blur: tuple[float, float], halvings: int) -> None:
    scene = np.full((200, 320), 60.0)
    share = matte(scene.shape, 150.3, 90.8, 14.0, blur)
    frame = np.round(scene * (1 - share) + 200 * share).astype(np.uint8)
    seeker = finder(scene.astype(np.float32), scene.astype(np.uint8)[None], FULL, halvings)
    (spot,) = seeker.spots(frame)
    scale = 2**halvings
    assert np.hypot(spot.x - 150.3, spot.y - 90.8) < 0.2 * scale
    assert spot.radius == pytest.approx(14.0, abs=0.5 * scale)
    assert spot.round
    assert not spot.cut
    assert spot.contrast > 100


def test_flicker_is_no_spot() -> None:
    samples = frames_of(Film(contact=(900.0, 900.0), count=8))
    background = samples.mean(axis=0).astype(np.float32)
    seeker = finder(background, samples, FULL)
    for gain in (0.85, 1.0, 1.15):
        assert seeker.spots(np.clip(samples[3] * gain, 0, 255).astype(np.uint8)) == []


def spot(x: float, y: float, radius: float = 10.0, **other: object) -> Spot:
    whole = Spot(
        x=x, y=y, radius=radius, blur_x=0.0, blur_y=0.0, contrast=80.0, round=True, cut=False
    )
    return replace(whole, **other)  # type: ignore[arg-type]


def test_the_way_of_a_ball_through_noise_and_a_gap() -> None:
    """Lost behind the bat for three frames; dust and a square thing move about as well."""
    rng = np.random.default_rng(6)
    frames: list[list[Spot]] = []
    for k in range(30):
        seen = [spot(*rng.uniform(0, 300, 2), radius=4.0)]
        seen.append(spot(50.0, 3.0 * k, radius=11.0, round=False))
        if not 14 <= k < 17:
            x = 20 + 12 * k if k < 16 else 200 - 6 * (k - 16)
            seen.insert(0, spot(x, 150.0 + rng.normal()))
        frames.append(seen)
    found = ball_track(frames, "clip")
    assert set(found) == set(range(30)) - {14, 15, 16}
    assert all(each.radius == 10.0 for each in found.values())


def test_a_known_size_tells_which_is_the_ball() -> None:
    frames = [[spot(12.0 * k, 50.0), spot(300 - 8.0 * k, 150.0, radius=20.0)] for k in range(20)]
    assert next(iter(ball_track(frames, "clip", 10.0).values())).radius == 10.0
    assert next(iter(ball_track(frames, "clip", 20.0).values())).radius == 20.0
    with pytest.raises(InputError, match="not found"):
        ball_track(frames, "clip", 40.0)


def test_a_bat_that_is_seen_whole_is_no_ball() -> None:
    """A bar is as full as its moments say, but longer than any blur of it at its speed."""
    frames = [[spot(100 + 4.0 * k, 80.0, radius=13.0, blur_y=140.0)] for k in range(20)]
    with pytest.raises(InputError, match="not found"):
        ball_track(frames, "clip")


def test_dark_and_light_are_two_things() -> None:
    frames = [[spot(12.0 * k, 50.0, contrast=80.0 if k % 2 else -80.0)] for k in range(6)]
    with pytest.raises(InputError, match="not found"):
        ball_track(frames, "clip")


def test_the_searched_picture_is_no_bit_stretched() -> None:
    """Sizes that are no multiples of four: a place is where it was."""
    scene = np.full((203, 323), 60, np.uint8)
    frame = scene.copy()
    cv2.rectangle(frame, (280, 170), (299, 189), 200, -1)  # its middle is 289.5, 179.5
    (seen,) = finder(scene.astype(np.float32), scene[None], FULL, 2).spots(frame)
    assert (seen.x, seen.y) == pytest.approx((289.5, 179.5), abs=0.6)
