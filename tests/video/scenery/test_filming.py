"""Pictures agree with the truth, and stored frames agree with the filmed ones."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.video.scenery.ball import sphere
from tests.video.scenery.filming import film, moved, pictures
from tests.video.scenery.motion import Ball, Rolling, Thrown
from tests.video.scenery.scene import Actor, Frames, Made, Phone, Scene
from tests.video.scenery.scenes import SCENES

PURE = Ball(diameter=0.08, mass=1.0, colour=(0.8, 0.8, 0.8), texture=0.0, gloss=0.0)
FALLING = Actor(ball=PURE, motion=Thrown(place=(-0.22, -0.12), velocity=(1.5, -0.6)))
QUIET = Scene(
    name="quiet",
    size=(160, 120),
    fps=60,
    count=16,
    exposure=1 / 150,
    actors=(FALLING,),
    phone=Phone(distance=1.0, focal=225, noise=0.0, gamma=1.0),
    wall_shadow=0.0,
    codec="FFV1",
    jpeg=100,
)
DRIFTING = replace(QUIET, phone=replace(QUIET.phone, drift=9.0), seed=3)
TURNING = replace(
    QUIET, phone=replace(QUIET.phone, drift=9.0, pan=150.0, turn=4.0, turns=True), seed=5
)
ROLLING_SHUTTER = replace(QUIET, phone=replace(QUIET.phone, readout=0.015), seed=4)


def small(scene: Scene, **changes: Any) -> Scene:
    """Return a scene with half as many pixels in each direction."""
    phone = replace(scene.phone, focal=scene.phone.focal / 2, drift=scene.phone.drift / 2)
    size = (scene.size[0] // 2, scene.size[1] // 2)
    return replace(scene, phone=phone, size=size, **changes)


@cache
def read(path: Path) -> np.ndarray:
    clip, frames = cv2.VideoCapture(str(path)), []
    while (got := clip.read())[0]:
        frames.append(got[1])
    return np.array(frames)


def balls_seen(scene: Scene) -> np.ndarray:
    """Return centroids of the differences that the ball makes to the pictures, (exposure, 2)."""
    empty = pictures(replace(scene, actors=()))
    places = []
    for one, other in zip(pictures(scene), empty, strict=True):
        apart = (one.astype(float) - other).sum(axis=2)
        row, column = np.indices(apart.shape)
        weight = np.abs(apart)
        places.append([(weight * p).sum() / weight.sum() for p in (column, row)])
    return np.array(places)


def black(ball: Ball = PURE) -> Ball:
    """Return a ball without light, of which the pictures show only the share."""
    return replace(ball, colour=(0.0, 0.0, 0.0))


def without_light(scene: Scene) -> Scene:
    flat = replace(scene.backdrop, wall=(200, 200, 200), slope=(0, 0, 0), grain=0, plates=0)
    return replace(scene, actors=(replace(FALLING, ball=black()),), backdrop=flat)


def truth(scene: Scene, folder: Path) -> Frames:
    return film(scene, folder).truth.frames


def test_a_drawn_ball_has_the_right_position_and_size() -> None:
    focal, distance = 450.0, 2.0
    at = np.array([[[3.3 / focal * distance, -2.6 / focal * distance, distance]]])
    row, column = np.mgrid[-30:31, -30:31].astype(float)
    rays = np.stack([column / focal, row / focal, np.ones_like(row)], axis=-1)
    _, share = sphere(rays, np.broadcast_to(at, (1, 61, 3)), focal, PURE, 0.0)
    radius = focal * PURE.radius / np.sqrt(distance**2 - PURE.radius**2)
    assert share.sum() == pytest.approx(np.pi * radius**2, rel=3e-3)
    assert (share * column).sum() / share.sum() == pytest.approx(3.3, abs=5e-3)
    assert (share * row).sum() / share.sum() == pytest.approx(-2.6, abs=5e-3)


def test_off_the_axis_a_ball_is_an_oval_toward_the_middle() -> None:
    focal, distance, aside = 100.0, 1.0, 1.0  # position 45 degrees off the axis
    at = np.array([[[aside, 0.0, distance]]])
    row, column = np.mgrid[-40:41, 60:141].astype(float)
    rays = np.stack([column / focal, row / focal, np.ones_like(row)], axis=-1)
    ball = replace(PURE, diameter=0.2)
    _, share = sphere(rays, np.broadcast_to(at, (1, 81, 3)), focal, ball, 0.0)
    size = share.sum()
    x = (share * column).sum() / size
    spread_x = (share * (column - x) ** 2).sum() / size
    spread_y = (share * row**2).sum() / size
    assert spread_x / spread_y == pytest.approx(2.0, rel=0.02)  # elongation 1 / cos^2


def test_blur_is_as_long_as_the_motion_during_the_exposure() -> None:
    parts, length = 30, 12.0
    late = length * ((np.arange(parts) + 0.5) / parts - 0.5)
    at = np.zeros((parts, 61, 3))
    at[..., 0], at[..., 2] = late[:, None] / 450 * 2, 2.0
    row, column = np.mgrid[-30:31, -30:31].astype(float)
    rays = np.stack([column / 450, row / 450, np.ones_like(row)], axis=-1)
    _, share = sphere(rays, at, 450.0, PURE, 0.0)
    across, along = ((share * p**2).sum() / share.sum() for p in (row, column))
    assert along - across == pytest.approx(length**2 / 12, rel=0.01)


@pytest.mark.parametrize(
    "scene", [QUIET, DRIFTING, TURNING, ROLLING_SHUTTER], ids=lambda s: str(s.seed)
)
def test_balls_are_at_their_true_positions(scene: Scene, tmp_path: Path) -> None:
    scene = without_light(scene)
    frames = truth(scene, tmp_path)
    centroids = balls_seen(scene)[frames.whole]
    assert frames.whole.sum() >= 10
    true = np.stack([frames.picture_x, frames.picture_y], axis=1)[frames.whole]
    still = np.stack([frames.x, frames.y], axis=1)[frames.whole]
    at = true if scene.phone.turns else still  # the oval points away from the lens's axis
    outward = (at - [79.5, 59.5]) * PURE.radius**2 / (1 - PURE.radius**2)  # offset of the oval
    assert np.abs(centroids - true - outward).max() < 0.02


def test_positions_in_the_still_frame_are_free_of_drift(tmp_path: Path) -> None:
    still, drifting = truth(QUIET, tmp_path / "a"), truth(DRIFTING, tmp_path / "b")
    assert drifting.x == pytest.approx(still.x)
    assert drifting.y == pytest.approx(still.y)
    moved = drifting.picture_x - drifting.x, drifting.picture_y - drifting.y
    assert max(np.ptp(each) for each in moved) > 2


def test_a_camera_that_turns_sees_what_a_rotated_pinhole_sees() -> None:
    """The reference is OpenCV's projection of points far away, turned by Euler angles."""
    phone, middle = TURNING.phone, np.array([79.5, 59.5])
    places = np.array([middle, [10.0, 20], [150, 100]])
    seen = moved(replace(TURNING, phone=replace(phone, turn=0.0)), places, np.array([0, 15]))[1]
    right, below = (seen[0] - middle) / phone.focal
    down = np.arctan(below)
    turn = Rotation.from_euler("yx", [np.arctan(right * np.cos(down)), -down]).as_rotvec()
    far = np.column_stack([(places - middle) / phone.focal, np.ones(3)])
    matrix = np.array([[phone.focal, 0, 79.5], [0, phone.focal, 59.5], [0, 0, 1.0]])
    expected = cv2.projectPoints(far, turn, np.zeros(3), matrix, None)[0][:, 0]
    assert np.abs(seen[0] - middle).max() > 20
    np.testing.assert_allclose(seen, expected, atol=1e-6)


def test_a_lamp_from_above_lights_the_upper_half() -> None:
    at, row = np.array([[[0.0, 0.0, 2.0]]]), np.mgrid[-30:31, -30:31][0] / 450.0
    rays = np.stack([row.T, row, np.ones_like(row)], axis=-1)
    centres = np.broadcast_to(at, (1, 61, 3))
    light, share = sphere(rays, centres, 450.0, PURE, 0.0, (0.0, -1.0, 0.0), 0.25)
    below, above = light[33:36, 30, 0], light[25:28, 30, 0]
    assert below == pytest.approx(0.8 * 0.25 * share[33:36, 30], rel=1e-3)  # ambient light alone
    assert (above > 1.5 * below[::-1]).all()


def test_background_moves_with_the_drift(tmp_path: Path) -> None:
    scene = replace(SCENES["thrown-on-wall"], actors=(), count=24)
    made = film(scene, tmp_path)
    grey = [each.mean(axis=2) for each in pictures(scene)]
    window = cv2.createHanningWindow(scene.size, cv2.CV_64F)
    for k in (8, 16, 23):
        (x, y), _ = cv2.phaseCorrelate(grey[0], grey[k], window)
        assert (x, y) == pytest.approx(tuple(made.drift[k] - made.drift[0]), abs=0.3)
    assert np.abs(np.diff(made.drift, axis=0)).max() < 1.0
    assert np.abs(made.drift[-1]).max() > 2


def test_rolling_shutter_reads_lower_rows_later(tmp_path: Path) -> None:
    frames = truth(ROLLING_SHUTTER, tmp_path)
    start = (np.arange(16) + 0.5) / 60
    row = np.clip(frames.picture_y, 0, 119)
    assert frames.time - start == pytest.approx(0.015 * row / 119, abs=1e-6)
    x, y = ROLLING_SHUTTER.actors[0].motion.path(PURE, 1.0).at(frames.time)
    assert frames.x == pytest.approx(79.5 + 225 * x)
    assert frames.y == pytest.approx(59.5 + 225 * y)


def test_gravity_and_scale_are_those_of_the_plane(tmp_path: Path) -> None:
    ball_truth = film(QUIET, tmp_path).truth
    assert ball_truth.metres_per_pixel == pytest.approx(1 / 225)
    assert ball_truth.gravity_px == pytest.approx((0, 9.81 * 225), abs=1e-6)
    frames = ball_truth.frames
    fall = np.diff(frames.y, 2) * 60**2
    assert fall == pytest.approx(9.81 * 225, rel=0.01)  # tolerance for drag


def test_a_tilted_camera_changes_the_fall_over_the_picture(tmp_path: Path) -> None:
    frames = truth(small(SCENES["tilted"], count=26), tmp_path)
    fall = np.diff(frames.y[:25], 2)
    assert fall.max() / fall.min() > 1.1
    assert np.ptp(frames.radius) > 0.03 * frames.radius.mean()


def test_noise_and_flicker_have_their_size(tmp_path: Path) -> None:
    scene = replace(SCENES["empty"], count=2, phone=Phone(noise=2.0))
    one, other = (each.astype(float) for each in pictures(scene))
    assert (one - other).std() == pytest.approx(2 * np.sqrt(2), rel=0.1)
    shaky = replace(scene, count=20, size=(64, 48), phone=Phone(noise=0.5, flicker=0.1))
    assert np.ptp([each.mean() for each in pictures(shaky)]) > 3


def test_frames_with_a_hand_on_the_ball_are_marked(tmp_path: Path) -> None:
    scene = small(SCENES["thrown-up"], fps=20, count=30)
    scene = replace(scene, phone=replace(scene.phone, noise=0.0))
    frames = truth(scene, tmp_path)
    actor = scene.actors[0]
    free = replace(actor, motion=replace(actor.motion, arm_from=None))
    without = pictures(replace(scene, actors=(free,)))
    for k, (one, other) in enumerate(zip(pictures(scene), without, strict=True)):
        row, column = np.ogrid[: scene.size[1], : scene.size[0]]
        away = np.hypot(column - frames.picture_x[k], row - frames.picture_y[k])
        apart = np.abs(one.astype(int) - other).max(axis=2)
        on, near = (apart[away < frames.radius[k] + d].max(initial=0) for d in (1, 4))
        if frames.whole[k] and frames.phase[k] == "hand":
            assert frames.touched[k]
            assert on > 30
        elif frames.whole[k]:
            assert near > 5 if frames.touched[k] else on < 12
    assert 8 < frames.readable.sum() < 15


def test_the_floor_shows_shadow_and_mirror_image() -> None:
    resting = Actor(ball=SCENES["glossy-floor"].actors[0].ball, motion=Rolling(place=(0, 0.1)))
    scene = replace(QUIET, count=1, floor=0.14, actors=(resting,))
    empty = next(pictures(replace(scene, actors=()))).astype(int)
    x, foot = 82, round(59.5 + 225 * 0.14)
    dark = next(pictures(scene)).astype(int) - empty
    assert dark[foot + 1, x - 2 : x + 3].max() < -10
    shiny = next(pictures(replace(scene, mirror=0.4, floor_shadow=0.0))).astype(int) - empty
    below = shiny[foot + 3 : foot + 12, x].mean(axis=0)
    assert below[2] < below[1] - 10  # loss of red: the mirrored green ball hides the floor


@pytest.mark.parametrize(
    ("stored", "count"), [("doubled", 24), ("thinned", 10), ("repeated", 16), ("lost", 11)]
)
def test_stored_frames_are_the_stated_exposures(stored: str, count: int, tmp_path: Path) -> None:
    scene = replace(QUIET, count=12, stored=stored, seed=2)
    made, exposed = film(scene, tmp_path), list(pictures(scene))
    frames = read(made.path)
    assert len(frames) == len(made.exposures)
    assert len(frames) == count
    for frame, exposure in zip(frames, made.exposures, strict=True):
        assert np.array_equal(frame, exposed[exposure])
    repeats = np.flatnonzero(made.truth.frames.repeat)
    assert np.array_equal(frames[repeats], frames[repeats - 1])
    assert made.times == pytest.approx((made.exposures + 0.5) / scene.fps)


def test_contact_frames_count_in_stored_frames(tmp_path: Path) -> None:
    scene = small(SCENES["glossy-floor"], count=34, mirror=0.0)
    once = film(scene, tmp_path / "a").truth
    twice = film(replace(scene, stored="doubled"), tmp_path / "b").truth
    assert once.contacts[0].frame == pytest.approx(once.contacts[0].time * 60 - 0.5)
    assert twice.contacts[0].frame == pytest.approx(2 * once.contacts[0].frame)
    assert [flight.places for flight in twice.flights] == [f.places for f in once.flights]
    flight, contact = once.flights[0], once.contacts[0]
    assert flight.last_frame < contact.frame < once.flights[1].first_frame
    assert once.flights[1].first_frame - flight.last_frame <= 2


def test_rotated_files_are_turned_back_by_a_player(tmp_path: Path) -> None:
    for degrees in (90, 180, 270):
        scene = replace(QUIET, name=str(degrees), count=2, rotation=degrees, codec="mp4v")
        frame = read(film(scene, tmp_path).path)[0].astype(float)
        filmed = next(pictures(scene)).astype(float)
        assert frame.shape == filmed.shape
        assert np.abs(frame - filmed).mean() < 4
        assert np.abs(frame[::-1, ::-1] - filmed).mean() > 5


def test_a_lower_jpeg_quality_gives_a_smaller_file(tmp_path: Path) -> None:
    scene = replace(QUIET, count=2, codec="MJPG", phone=Phone(noise=3))
    made: dict[int, Made] = {q: film(replace(scene, jpeg=q), tmp_path / str(q)) for q in (20, 95)}
    assert made[20].path.stat().st_size < 0.6 * made[95].path.stat().st_size


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_is_stored_completely(name: str, tmp_path: Path) -> None:
    scene = replace(SCENES[name], count=3)
    made = film(scene, tmp_path)
    if scene.codec == "PNG":
        frames = [cv2.imread(str(each)) for each in sorted(made.path.iterdir())]
    else:
        frames = read(made.path)
    assert len(frames) == len(made.exposures)
    assert frames[0].shape == (scene.size[1], scene.size[0], 3)


def test_the_same_seed_gives_the_same_clip(tmp_path: Path) -> None:
    scene = replace(SCENES["glossy-floor"], count=5)
    one, other = (film(scene, tmp_path / each).path.read_bytes() for each in "ab")
    assert one == other
    assert film(replace(scene, seed=99), tmp_path / "c").path.read_bytes() != one
