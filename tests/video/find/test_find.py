"""The still frame, its drift, and blobs in pictures of known content."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.video.scenery.ball import sphere
from tests.video.scenery.filming import moved, pictures
from tests.video.scenery.motion import Ball
from tests.video.scenery.scenes import SCENES, UNSEEN
from tests.video.scenes import Film, matte
from virtual_lab.video.find.blobs import BLOB, blobs
from virtual_lab.video.find.drift import edges_of, leap_of, matrix_of
from virtual_lab.video.find.still import still_of
from virtual_lab.video.find.watching import Watched, in_region, lulls, repeats

NONE = np.zeros(4)


def test_a_shift_is_found_to_a_hundredth_of_a_pixel_whatever_moves_before() -> None:
    """Two pictures are cut out of a larger scene with a known shift; a square covers a part."""
    rng = np.random.default_rng(3)
    coarse = rng.uniform(60, 200, (9, 12))
    row, column = np.mgrid[:120, :160] / 16.0

    def scene(x: float, y: float, light: float = 1.0) -> NDArray[np.uint8]:
        from scipy.ndimage import map_coordinates

        picture = map_coordinates(coarse, [row + y / 16, column + x / 16], order=3, mode="mirror")
        return np.clip(light * picture, 0, 255).astype(np.uint8)

    edges = edges_of(scene(0.0, 0.0))
    for way in ((0.0, 0.0), (1.37, -0.62), (-5.2, 4.9)):
        other = scene(*way, light=1.05)
        other[40:75, 60:100] = 250
        drift = edges.drift(other, NONE)
        assert drift == pytest.approx((-way[0], -way[1], 0, 0), abs=0.03)


def test_a_turn_is_found_to_a_hundredth_of_a_pixel_at_the_rim() -> None:
    """A scene is seen again by a camera that turned and came nearer."""
    from scipy.ndimage import map_coordinates

    coarse = np.random.default_rng(3).uniform(60, 200, (14, 17))
    row, column = np.mgrid[:120, :160].astype(float)

    def scene(right: float, down: float, growth: float, turn: float) -> NDArray[np.uint8]:
        """Return a picture that shows x at c + (1 + growth) R(turn) (x - c) + shift; c: middle."""
        off = (column - 79.5 - right) + 1j * (row - 59.5 - down)
        still = off * np.exp(-1j * np.arctan2(turn, 1 + growth)) / np.hypot(1 + growth, turn)
        at = [(still.imag + 59.5) / 16 + 3, (still.real + 79.5) / 16 + 3]
        picture = map_coordinates(coarse, at, order=3, mode="mirror")
        return np.clip(np.rint(picture), 0, 255).astype(np.uint8)

    edges = edges_of(scene(0, 0, 0, 0))
    for drift in ((0.8, -0.4, 0.006, 0.012), (-0.3, 0.5, -0.004, -0.02)):
        other = scene(*drift)
        other[40:75, 60:100] = 250
        fit = NONE
        for _ in range(3):  # iterations, because a fit stays near its start
            fit = edges.drift(other, fit)
        assert fit * [1, 1, 80, 80] == pytest.approx(np.array(drift) * [1, 1, 80, 80], abs=0.03)


def test_edges_lie_where_the_still_frame_has_them() -> None:
    """A picture cut out of a larger one is aligned with it; a matrix is computed by hand."""
    noise = np.random.default_rng(3).integers(60, 200, (160, 200)).astype(np.uint8)
    larger = cv2.GaussianBlur(noise, (0, 0), 2.0)
    edges = edges_of(larger, (160, 120), (-13, -18))
    drift = edges.drift(larger[17:137, 15:175], NONE)
    np.testing.assert_allclose(drift * [1, 1, 80, 80], [-2, 1, 0, 0], atol=0.03)
    corner = matrix_of(np.array([0, 0, 0, 0.01]), (320, 240)) @ [319, 119.5, 1]
    np.testing.assert_allclose(corner, [319, 119.5 + 1.595])  # rotation from x to y


def test_a_step_of_many_pixels_is_found_to_a_few() -> None:
    scene = cv2.GaussianBlur(
        np.random.default_rng(3).integers(0, 255, (300, 400)).astype(np.uint8), (0, 0), 4.0
    )
    step = leap_of(scene[50:250, 50:350], scene[30:230, 90:390])
    np.testing.assert_allclose(step, [-40, 20, 0, 0], atol=3)


@pytest.mark.parametrize("covered", ["plain", "another"])
def test_a_shift_stays_where_nothing_shows_it(covered: str) -> None:
    """With a coat before the lens, the drift neither continues nor returns to zero."""
    scene, coat = (np.random.default_rng(k).integers(60, 200, (120, 160)) for k in (3, 4))
    edges = edges_of(cv2.GaussianBlur(scene.astype(np.uint8), (0, 0), 2.0))
    picture = cv2.GaussianBlur(coat.astype(np.uint8), (0, 0), 2.0)
    picture = picture if covered == "another" else np.full_like(picture, 90)
    guess = np.array([6.0, -3.0, 0.0, 0.0])
    starts = (guess, np.array([7.5, -2.5, 0.0, 0.0]), NONE)
    np.testing.assert_allclose(edges.drift(picture, *starts), guess, atol=1.5)


def test_drift_and_background_of_a_hand_held_phone_are_found() -> None:
    """The still frame is the first one: shifts agree with the truth, and the wall is in place."""
    scene = replace(SCENES["glossy-floor"], count=40, mirror=0.0)
    frames = list(pictures(scene))
    still = still_of(frames[::2], 8, 2)
    assert still.drifts
    empty = next(pictures(replace(scene, actors=())))
    x, y = (-each for each in still.origin)
    inner = still.background[y : y + 240, x : x + 320].astype(int)
    assert np.percentile(np.abs(inner - empty), 95) < 8
    drift, last = NONE, still.shrunk(frames[0])
    drifts = []
    for frame in frames:
        small = still.shrunk(frame)
        drift, last = still.drift(small, drift, (last, drift)), small
        drifts.append(drift)
    assert np.ptp(drifts, axis=0).max() > 2
    assert np.ptp(still.sampled[:, 2:] * 160, axis=0).max() < 0.15  # rim [px]


def test_a_drift_is_found_if_most_pictures_are_far_from_the_first() -> None:
    """Most pictures show a plain wall at the edges of the first picture."""
    wall = np.full((290, 460), 150.0)
    for column, row in ((60, 30), (330, 40), (70, 170), (340, 180), (200, 110)):
        wall[row : row + 16, column : column + 16] = 90.0
    noise, late = np.random.default_rng(5), np.arange(24)
    shifts = np.rint(np.where(late < 4, 8 * late, 32 + 4 * np.sin(late))).astype(int)
    frames = [
        cv2.GaussianBlur(wall[k : k + 240, k : k + 360], (0, 0), 1.0)
        + noise.normal(0, 1.0, (240, 360))
        for k in shifts
    ]
    still = still_of([each.round().astype(np.uint8) for each in frames], 8, 6)
    np.testing.assert_allclose(still.sampled[:, :2], -np.stack([shifts, shifts], 1), atol=0.2)


def test_the_turn_of_a_phone_in_the_hand_is_found() -> None:
    """Positions at the rim are right to 0.5 px; by a shift alone they are wrong by nearly 4 px."""
    scene = replace(UNSEEN["rolled"], count=60)
    frames = list(pictures(scene))
    still = still_of(frames[::3], 8, 3)
    assert still.sampled[:, 2:].any()
    rim = np.array([[20.0, 20], [300, 20], [20, 220], [300, 220]])
    true = moved(scene, rim, np.arange(scene.count))
    off = []
    for k, (frame, places) in enumerate(zip(frames, true - true[0] + rim, strict=True)):
        between = np.array([np.interp(k, np.arange(0, 60, 3), each) for each in still.sampled.T])
        drift = still.drift(small := still.shrunk(frame), between, (small, between))
        matrix = matrix_of(drift, still.size)
        off.append(rim @ matrix[:, :2].T + matrix[:, 2] - places)
    assert np.abs(off).max() < 0.5


def test_a_camera_on_a_stand_does_not_drift() -> None:
    for name in ("thrown-up", "light-ball"):
        scene = replace(SCENES[name], count=30)
        assert not still_of(list(pictures(scene)), 8).drifts


def test_an_arm_before_a_plain_wall_is_no_camera_that_turns() -> None:
    """The foot of the wall is in place, though it hardly shows a motion along itself."""
    import cv2

    noise = np.random.default_rng(7)
    swing = np.concatenate([np.zeros(4), np.linspace(0, 1, 6), np.ones(10)])
    frames = []
    for part in swing:
        picture = np.full((270, 480), 190, np.uint8)
        cv2.fillPoly(picture, [np.array([[0, 214], [480, 222], [480, 270], [0, 270]])], 120)
        ends = np.array([[20, 75], [180, 30]]) - np.rint(part * np.array([58, 10])).astype(int)
        cv2.line(picture, ends[0].tolist(), ends[1].tolist(), 60, 14)
        shaded = cv2.GaussianBlur(picture, (0, 0), 1.0) + noise.normal(0, 1.0, picture.shape)
        frames.append(np.clip(shaded, 0, 255).astype(np.uint8))
    assert not still_of(frames, 8, 6).drifts


def test_a_ball_alone_before_a_plain_wall_is_no_camera_that_turns() -> None:
    """The ball has all the edges in the picture."""
    part = np.concatenate([np.zeros(4), np.arange(1, 13) / 12, np.ones(6)])
    noise = np.random.default_rng(7)
    row, column = np.mgrid[:270, :480]
    frames = []
    for x, y in zip(60 + 245 * part, 150 - 92 * part, strict=True):
        inside = np.clip(45 - np.hypot(column - x, row - y), 0, 1)
        picture = 190 - 110 * inside + noise.normal(0, 1.0, inside.shape)
        frames.append(np.clip(picture, 0, 255).astype(np.uint8))
    assert not still_of(frames, 8, 4).drifts


@pytest.mark.parametrize("blur", [(0.0, 0.0), (12.0, 5.0)])
def test_a_blob_is_where_and_as_large_as_the_ball(blur: tuple[float, float]) -> None:
    behind = np.full((200, 320), 60, np.uint8)
    share = matte(behind.shape, 150.3, 90.8, 14.0, blur)
    frame = np.round(behind * (1 - share) + 200 * share).astype(np.uint8)
    still = still_of([behind], 8, tripod=True)
    (blob,) = blobs(0, frame, frame, NONE, still)
    assert (blob["x"], blob["y"]) == pytest.approx((150.3, 90.8), abs=0.1)
    assert blob["radius"] == pytest.approx(14.0, abs=0.2 + np.hypot(*blur) ** 2 / 600)
    assert blob["dirty"] < 0.05
    assert not blob["cut"]


def test_a_ball_lit_from_the_side_keeps_its_place_before_a_lighter_wall() -> None:
    """An outline at half its contrast would move by three pixels on its dark side."""

    def place(wall: int) -> float:
        y, x = np.mgrid[:480, :640] / 4.0
        fine = np.where(np.hypot(x - 80, y - 60) < 12, 180 + 4 * (x - 80), wall)
        small = cv2.resize(fine.astype(np.float32), (160, 120), interpolation=cv2.INTER_AREA)
        picture = cv2.GaussianBlur(small, (0, 0), 0.8).round().astype(np.uint8)
        still = still_of([np.full(picture.shape, wall, np.uint8)] * 8, 8, tripod=True)
        (ball,) = blobs(0, picture, still.shrunk(picture), np.zeros(4), still)
        return float(ball["x"])

    assert place(70) == pytest.approx(79.6, abs=0.7)
    assert abs(place(110) - place(70)) < 0.7


def test_a_ball_lit_from_above_keeps_its_size_as_the_wall_changes() -> None:
    """The wall is about as bright as the lower half of the ball; the size must not jump."""
    ball = Ball(diameter=0.08, mass=1.0, colour=(0.7, 0.7, 0.7), texture=0.0)
    row, column = np.mgrid[-50:50, -60:60] / 450.0
    rays = np.stack([column, row, np.ones_like(row)], axis=-1)
    at = np.broadcast_to([0.0, 0.0, 2.0], (1, 100, 3))
    light, share = sphere(rays, at, 450.0, ball, 0.0, (0.2, -1.0, -0.3), 0.3)
    noise, sizes = np.random.default_rng(1), []
    for wall in range(100, 140, 5):
        linear = (wall / 255) ** 2.2 * (1 - share) + light[..., 0]
        grey = cv2.GaussianBlur(255 * linear ** (1 / 2.2), (0, 0), 0.8)
        picture = np.rint(grey + noise.normal(0, 1.5, grey.shape)).clip(0, 255).astype(np.uint8)
        still = still_of([np.full(picture.shape, wall, np.uint8)] * 8, 8, tripod=True)
        (blob,) = blobs(0, picture, picture, NONE, still)
        sizes.append(float(blob["radius"]))
    assert np.abs(np.diff(np.log(sizes))).max() < 0.15


def test_the_lit_side_of_a_ball_is_followed_though_its_dark_side_is_larger() -> None:
    """Before a wall of medium brightness the blob must not change from one side to the other."""
    row, column = np.mgrid[:100, :120]
    ball, places = np.hypot(column - 60, row - 50) < 12, []
    for border in (48, 50, 52):  # row in which the ball is as bright as the wall
        light = np.where(ball, 130 - 4.0 * (row - border), 130)
        picture = np.rint(cv2.GaussianBlur(light, (0, 0), 0.8)).astype(np.uint8)
        still = still_of([np.full(picture.shape, 130, np.uint8)] * 8, 8, tripod=True)
        candidates = blobs(0, picture, picture, NONE, still)
        lit, dark = candidates[~candidates["shaded"]], candidates[candidates["shaded"]]
        assert lit["lit"].all()
        assert not dark["lit"].any()
        places.append(float(lit["y"].item()))
    assert np.diff(places) == pytest.approx(1.0, abs=0.5)


def test_a_ball_that_is_held_or_cut_is_marked() -> None:
    behind = np.full((120, 160), 60, np.uint8)
    still = still_of([behind], 8, tripod=True)

    def balls_near(x: float, *, held: bool = False) -> list[np.void]:
        share = matte(behind.shape, x, 60.0, 12.0)
        frame = np.round(behind * (1 - share) + 220 * share).astype(np.uint8)
        if held:
            frame[54:66, int(x) + 12 :] = 190
        candidates = blobs(0, frame, frame, NONE, still)
        return [each for each in candidates if abs(each["x"] - x) < 6]

    assert not any(each["dirty"] < 0.05 for each in balls_near(80.0, held=True))
    assert [each["dirty"] for each in balls_near(80.0)] == [0]
    assert all(each["cut"] for each in balls_near(8.0))
    assert not any(each["cut"] for each in balls_near(80.0))


def test_a_changing_light_is_no_blob() -> None:
    frames = np.stack(list(Film(contact=(900.0, 900.0), count=8).frames())).astype(np.uint8)
    still = still_of(list(frames), 8, tripod=True)
    for gain in (0.85, 1.0, 1.15):
        lit = np.clip(frames[3] * gain, 0, 255).astype(np.uint8)
        assert len(blobs(0, lit, lit, NONE, still)) == 0


def test_a_light_of_another_color_is_no_blob_and_hides_no_ball() -> None:
    """A new white balance changes each channel by its own factor."""
    rng = np.random.default_rng(2)
    wall = np.repeat(np.repeat(rng.uniform(60, 170, (8, 10, 3)), 25, axis=0), 32, axis=1)
    covered = matte((200, 320), 150.0, 90.0, 14.0)[..., None]
    ball = covered * np.array([40.0, 60.0, 235.0]) + (1 - covered) * wall
    still = still_of([wall.astype(np.uint8)] * 4, 8, tripod=True)
    for gains in ((1.0, 1.0, 1.0), (0.88, 1.0, 1.12), (0.75, 0.78, 0.8)):
        lit = np.clip(wall * gains, 0, 255).astype(np.uint8)
        assert len(blobs(0, lit, lit, NONE, still)) == 0
        lit = np.clip(ball * gains, 0, 255).astype(np.uint8)
        (blob,) = blobs(0, lit, lit, NONE, still)
        assert (blob["x"], blob["y"]) == pytest.approx((150.0, 90.0), abs=0.4)
        assert blob["radius"] == pytest.approx(14.0, rel=0.05)
        assert blob["dirty"] < 0.05


def test_a_ball_before_a_pattern_is_found() -> None:
    """The contrast with mortar is four times that with bricks."""
    row, column = np.mgrid[:200, :320]
    wall = np.where((row % 24 < 3) | ((column + row // 24 % 2 * 20) % 40 < 3), 190.0, 100.0)
    covered = matte((200, 320), 150.0, 92.0, 20.0)
    ball = covered * 70.0 + (1 - covered) * wall
    still = still_of([wall.astype(np.uint8)] * 4, 8, tripod=True)
    picture = np.clip(ball, 0, 255).astype(np.uint8)
    candidates = blobs(0, picture, picture, NONE, still)
    best = candidates[np.argmin(np.hypot(candidates["x"] - 150, candidates["y"] - 92))]
    assert (best["x"], best["y"]) == pytest.approx((150.0, 92.0), abs=2.5)
    assert best["radius"] == pytest.approx(20.0, rel=0.1)


def test_a_ball_with_dark_patches_before_a_light_wall_is_one() -> None:
    """The patches of a football differ from the wall eight times as much as the rest."""
    behind = np.full((200, 320), 200.0)
    covered = matte(behind.shape, 150.3, 90.8, 20.0)
    ball = covered * 225.0 + (1 - covered) * behind
    for turn in np.arange(5) * 2 * np.pi / 5:
        x, y = 150.3 + 11 * np.cos(turn), 90.8 + 11 * np.sin(turn)
        patch = matte(behind.shape, x, y, 4.5)
        ball = patch * 30.0 + (1 - patch) * ball
    still = still_of([behind.astype(np.uint8)] * 4, 8, tripod=True)
    picture = np.round(ball).astype(np.uint8)
    candidates = blobs(0, picture, picture, NONE, still)
    (best,) = candidates[candidates["radius"] > 8]
    assert (best["x"], best["y"]) == pytest.approx((150.3, 90.8), abs=1.0)
    assert best["radius"] == pytest.approx(20.0, rel=0.05)


def test_a_ball_at_the_top_of_a_low_hop_is_no_repeat() -> None:
    """The picture hardly changes, but the ball moves by a pixel or two."""
    change = np.array([np.nan, 40, 38, 9, 36, 40, 3, 41.0])
    candidates = np.zeros(8, BLOB)
    candidates["frame"], candidates["radius"], candidates["x"] = np.arange(8), 15.0, 100.0
    candidates["y"] = [90, 84, 80, 78.5, 80, 84, 84, 90]
    still = still_of([np.zeros((40, 40), np.uint8)] * 3, 8, tripod=True)
    watched = Watched(still=still, blobs=candidates, change=change)
    assert np.flatnonzero(lulls(change)).tolist() == [3, 6]
    assert np.flatnonzero(repeats(watched)).tolist() == [6]


def test_one_blob_of_noise_is_no_motion_in_a_repeat() -> None:
    """In a repeated frame most blobs stay in place; one of the codec's noise may move."""
    change = np.array([np.nan, 40, 38, 3, 36, 40.0])
    candidates = np.zeros((6, 3), BLOB)  # blobs of each frame: ball, shadow, noise
    candidates["frame"], candidates["radius"] = np.arange(6)[:, None], [15.0, 11.0, 4.0]
    candidates["x"][:, :2] = np.array([100, 110, 120, 120, 130, 140.0])[:, None]
    candidates["y"] = np.array([[90, 300, y] for y in (60, 64, 60, 61.5, 60, 64)])
    candidates = candidates.ravel()
    still = still_of([np.zeros((40, 40), np.uint8)] * 3, 8, tripod=True)
    watched = Watched(still=still, blobs=candidates, change=change)
    assert np.flatnonzero(repeats(watched)).tolist() == [3]


def test_frames_stored_twice_change_less_than_those_beside() -> None:
    moving = np.array([np.nan, 40, 2, 42, 3, 39, 2, 41, 38, 40, 3, 44, 40.0])
    assert np.flatnonzero(lulls(moving)).tolist() == [2, 4, 6, 10]
    slowing = np.array([np.nan, 40, 30, 20, 12, 7, 12, 20, 30, 40.0])
    assert not lulls(slowing).any()
    trimmed = np.array([np.nan, 3, 42, 2, 39, 2, 41.0])  # the clip begins while the ball moves
    assert np.flatnonzero(lulls(trimmed)).tolist() == [1, 3, 5]
    key_frames = np.array([np.nan, 2, 2, 2, 30, 2, 2, 2, 2, 30, 2, 2.0])
    assert not lulls(key_frames).any()


@pytest.mark.parametrize("light", [True, False])
def test_the_background_behind_a_slow_ball_is_found(light: bool) -> None:
    """A ball covers a pixel in many frames; the mean of the others is the background."""
    ball, dark = (180.0, 40.0) if light else (20.0, 120.0)
    scene = Film(light=ball, dark=dark, velocity_out=(-2.0, 0.3))
    samples = np.stack(scene.frames()).astype(np.uint8)[::2]
    behind = dark + 30 * np.linspace(0, 1, 320)
    still = still_of(list(samples), 8, tripod=True)
    assert np.percentile(np.abs(still.background - behind), 99) < 6


def test_a_picture_hides_no_more_than_the_drift_of_a_hand() -> None:
    """A hand moves by 0.02 of the longer side per second, whatever a failed alignment shows."""
    still = still_of(list(Film().frames())[:9], 8, 1.0)
    drifts = [replace(still, hidden_drift=each).unseen_drift(1 / 40) for each in (8.0, 0.01)]
    assert drifts == pytest.approx([0.02 * 320 / 40, 0.01])


def test_a_region_selects_the_blobs_between_its_four_edges() -> None:
    """From the corner (1, 2) it is 3 wide and 4 high; one blob is inside, one beyond each edge."""
    moving = np.zeros(5, BLOB)
    moving["x"], moving["y"] = [2, 0, 5, 2, 2], [3, 3, 3, 1, 7]
    assert in_region(moving, (1, 2, 3, 4)).tolist() == [True, False, False, False, False]
    assert in_region(moving, None).all()
