"""The ruler of a phone's clip: gravity or the ball's size, each checked by the other.

36 scenes at full size: python -m tests.video.follow.light_study.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.video.follow.light_study import clip_of, knowledge_of, speeds_of
from tests.video.follow.lit_ball import LIGHTS, Filmed, Throw, film
from virtual_lab.errors import InputError
from virtual_lab.video.follow.following import FollowedClip, follow, follow_blobs
from virtual_lab.video.show.track_text import track_document, track_text

SMALL = {"rows": 240, "columns": 320, "count": 58, "fps": 60.0, "radius": 8.0}
SEED = 5  # seed by which the camera is tilted by about 4 degrees in two of three lights
WITHOUT_PICTURES = {"thumbs": {}, "drifts": np.array([])}  # positions are not registered again

Followed = Callable[[str], tuple[Filmed, FollowedClip]]


@pytest.fixture(scope="module")
def followed() -> Followed:
    """Return a function that films and follows a ball in a light, once."""

    @cache
    def get(light: str) -> tuple[Filmed, FollowedClip]:
        throw = Throw(light=light, seed=SEED, **SMALL)
        made = film(throw)
        return made, follow(clip_of(throw, made), knowledge_of(throw))

    return get


def again(result: FollowedClip, **changed: object) -> FollowedClip:
    """Return the clip followed again with other knowledge."""
    watched = replace(result.watched, **WITHOUT_PICTURES)
    return follow_blobs(result.clip, watched, replace(result.knowledge, **changed))


@pytest.mark.parametrize("light", LIGHTS)
def test_speeds_are_right_in_any_light(light: str, followed: Followed) -> None:
    """By the ball's size, the speeds in side light would be 25 % too high."""
    made, result = followed(light)
    assert result.scale is not None
    assert result.scale.source == "gravity"
    for said, true in zip(speeds_of(result), made.speeds, strict=True):
        assert abs(said.value - true) < min(2 * said.u, 0.015 * true)
        assert said.u < 0.03 * true
    restitution = result.contacts[0].restitution
    assert restitution is not None
    assert abs(restitution.value - made.restitution) < 2.5 * restitution.u


@pytest.mark.parametrize("light", LIGHTS)
def test_the_u_of_the_ball_s_size_covers_its_shade(light: str, followed: Followed) -> None:
    made, result = followed(light)
    by_ball = again(result, ruler="ball")
    assert by_ball.scale is not None
    off = by_ball.scale.metres_per_pixel / made.metres_per_pixel - 1
    assert abs(off) < 3 * by_ball.scale.relative_u or "GRAVITY" in by_ball.flags
    assert (abs(off) > 0.2) == (light == "side")
    assert (by_ball.scale.relative_u < 0.04) == (light == "flat")
    assert by_ball.gravity is not None
    if light != "side":
        assert abs(by_ball.gravity.value - made.gravity) < 3 * by_ball.gravity.u


def test_each_ruler_checks_the_other(followed: Followed) -> None:
    """The text names the ruler, its u, and the deviation of the other ruler in combined u."""
    _, result = followed("flat")
    (check,) = result.checks
    assert result.scale is not None
    ratio = np.log(check.metres_per_pixel / result.scale.metres_per_pixel)
    apart = ratio / np.hypot(check.relative_u, result.scale.relative_u)
    document = track_document(result)["scale"]
    assert document["from"] == "gravity"
    assert document["checks"][0]["from"] == "ball"
    assert document["checks"][0]["off_u"] == pytest.approx(apart)
    said = f"from gravity ({100 * result.scale.relative_u:.2g} %); the scale from the "
    assert f"{said}ball's size differs by " in track_text(result)
    assert f"a difference of {abs(apart):.1f} u)" in track_text(result)
    assert [each.source for each in again(result, ruler="ball").checks] == ["gravity"]


def test_a_rolled_camera_is_stated_and_changes_no_speed(followed: Followed) -> None:
    """All positions are turned by 8 degrees about the middle; gravity's direction is fitted."""
    _, result = followed("flat")
    turn, rows, columns = np.radians(8), *result.clip.shape
    blobs, straight = result.watched.blobs.copy(), track_document(result)["scale"]["roll_deg"]
    for x, y in (("x", "y"), ("picture_x", "picture_y")):
        right, down = blobs[x] - columns / 2, blobs[y] - rows / 2
        blobs[x] = columns / 2 + np.cos(turn) * right + np.sin(turn) * down
        blobs[y] = rows / 2 - np.sin(turn) * right + np.cos(turn) * down
    turned = replace(result.watched, blobs=blobs, **WITHOUT_PICTURES)
    rolled = follow_blobs(result.clip, turned, result.knowledge)
    assert rolled.scale is not None
    assert rolled.scale.source == "gravity"
    for one, other in zip(speeds_of(rolled), speeds_of(result), strict=True):
        assert one.value == pytest.approx(other.value, rel=2e-3)
    roll = track_document(rolled)["scale"]["roll_deg"]
    assert roll - straight == pytest.approx(8, abs=0.1)
    assert f"points {roll:.0f} deg to the right of the picture's vertical" in track_text(rolled)


def test_a_wrong_diameter_is_flagged_and_changes_no_speed(followed: Followed) -> None:
    _, result = followed("flat")
    wrong = again(result, ball=1.25 * 0.073)
    assert "GRAVITY" in wrong.flags
    cures = r"slow motion\?\); fps=5\d\S* or ball='([\d.]+)mm' would fit"
    (diameter,) = re.findall(cures, " ".join(wrong.warnings))
    assert float(diameter) == pytest.approx(73, rel=0.04)  # in this light u of the size is 4 %
    for one, other in zip(speeds_of(wrong), speeds_of(result), strict=True):
        assert one.value == pytest.approx(other.value, rel=2e-3)
    assert wrong.gravity is not None
    assert wrong.gravity.value == pytest.approx(1.25 * result.gravity.value, rel=5e-3)


@pytest.mark.parametrize("factor", [0.72, 0.85, 1.2, 1.4])
def test_gravity_is_flagged_by_the_stated_difference(factor: float, followed: Followed) -> None:
    """Two scales contradict each other beyond 3 u of their difference; it includes the u of g."""
    _, result = followed("flat")
    other = again(result, ball=factor * 0.073, gravity_u=0.6)
    off = track_document(other)["scale"]["checks"][0]["off_u"]
    assert ("GRAVITY" in other.flags) == (abs(off) > 3) == (abs(np.log(factor)) > 0.3)
    headline = track_text(other).partition("\n")[0]
    assert headline.endswith("; doubtful: see GRAVITY") == ("GRAVITY" in other.flags)


def test_g_is_not_measured_by_itself(followed: Followed) -> None:
    _, result = followed("flat")
    alone = again(result, ball=None, ruler="gravity")
    assert alone.gravity is None
    assert [each.acceleration for each in alone.flights] == [None] * len(alone.flights)
    document = track_document(alone)
    assert document["gravity_mps2"] is None
    assert document["scale"]["checks"] == []
    assert "m/s²" not in track_text(alone)
    for one, other in zip(speeds_of(alone), speeds_of(result), strict=True):
        assert one.value == pytest.approx(other.value, rel=2e-3)
    # speeds are proportional to g: they have all of its u, and none of the ball's
    moon = again(result, ball=None, ruler="gravity", gravity=1.62, gravity_u=0.0)
    for one, other in zip(speeds_of(moon), speeds_of(alone), strict=True):
        assert one.value == pytest.approx(other.value * 1.62 / result.knowledge.gravity, rel=1e-6)


def test_a_length_in_the_picture_replaces_both_rulers(followed: Followed) -> None:
    made, result = followed("flat")
    unit = made.metres_per_pixel
    by_length = again(result, metres_per_pixel=unit, metres_per_pixel_u=0.002 * unit)
    assert by_length.scale is not None
    assert (by_length.scale.source, by_length.scale.metres_per_pixel) == ("given", unit)
    assert {each.source for each in by_length.checks} == {"gravity", "ball"}
    assert set(by_length.flags) <= {"TILTED"}
    assert by_length.gravity is not None
    assert abs(by_length.gravity.value - made.gravity) < 3 * by_length.gravity.u < 0.4
    wrong = again(result, metres_per_pixel=unit, metres_per_pixel_u=0.002 * unit, ball=0.09)
    assert set(wrong.flags) - {"TILTED"} == {"BALL_SIZE"}
    assert track_text(wrong).partition("\n")[0].endswith("; doubtful: see BALL_SIZE")


def test_a_rate_that_makes_g_absurd_is_refused_with_the_one_that_fits(followed: Followed) -> None:
    """A rate ten times too high gives a hundred times g: 981 m/s²."""
    _, result = followed("flat")
    right = r"fps=(59|60|61)\b.* or ball='0\.\d+mm' would give 9\.81"
    with pytest.raises(InputError, match=rf"ball would fall at 9\d\d.*{right}"):
        again(result, rate=600.0)
    slow = again(result, rate=7.5)
    assert "GRAVITY" in slow.flags
    assert "fps=6" in " ".join(slow.warnings) or "fps=59" in " ".join(slow.warnings)


@pytest.mark.parametrize("rate", [6.0, 600.0])
def test_a_rate_that_makes_the_ball_absurd_is_refused(followed: Followed, rate: float) -> None:
    """Gravity is the only ruler, and the diameter is proportional to 1 / rate²."""
    _, result = followed("flat")
    assert result.knowledge.ball
    diameter, size = 1e3 * result.knowledge.ball * (60 / rate) ** 2, r"a diameter of ([\d.]+) mm"
    with pytest.raises(InputError, match=size) as refused:
        again(result, ball=None, ruler="gravity", rate=rate)
    stated = float(re.search(size, str(refused.value))[1])
    assert stated == pytest.approx(diameter, rel=0.1, abs=0.5)


@pytest.mark.parametrize(("rate", "doubtful"), [(60.0, False), (30.0, True), (120.0, True)])
def test_a_rate_that_makes_the_ball_no_ball_of_a_sport_is_flagged(
    rate: float, doubtful: bool, followed: Followed
) -> None:
    """Without a stated size, the ball of 73 mm has 292 or 18 mm, and speeds are wrong."""
    _, result = followed("flat")
    wrong = again(result, ball=None, ruler="gravity", rate=rate)
    words = " ".join(wrong.warnings)
    diameter = float(re.search(r"by gravity the ball has a diameter of (\d+) mm", words)[1])
    assert diameter == pytest.approx(73 * (60 / rate) ** 2, rel=0.06)
    assert ("BALL_SIZE" in wrong.flags) == doubtful
    headline = track_text(wrong).partition("\n")[0]
    assert headline.endswith("; doubtful: see BALL_SIZE") == doubtful
    cures = re.findall(r"fps=(\d+) gives (\d+) mm\. If the size is right, state ball", words)
    assert [int(fps) for fps, _ in cures] == [60] * doubtful
    assert [int(size) for _, size in cures] == [pytest.approx(73, rel=0.06)] * doubtful
    stated = again(result, ball=1e-3 * diameter, ruler="gravity", rate=rate)
    assert "BALL_SIZE" not in stated.flags  # the user has confirmed the size


def test_gravity_that_no_flight_shows_is_no_ruler(followed: Followed) -> None:
    _, result = followed("flat")
    few = result.watched.blobs["frame"] < result.contacts[0].frame
    few &= result.watched.blobs["frame"] > result.contacts[0].frame - 5
    short = replace(result.watched, blobs=result.watched.blobs[few], **WITHOUT_PICTURES)
    with pytest.raises(
        InputError, match=r"no flight measures.* and fps= if the clip is in slow motion"
    ):
        follow_blobs(result.clip, short, replace(result.knowledge, ruler="gravity"))


def test_the_u_of_gravity_includes_its_unobservable_parts(followed: Followed) -> None:
    """It includes g from 9.78 to 9.83 over the Earth, a tilt of 2.5 degrees, and buoyancy.

    For a ball of diameter d with drag k v², k d = 3/4 C_d ρ/ρ_b.
    """
    _, result = followed("flat")
    assert result.scale is not None
    assert result.fit is not None
    density = result.fit.drag * 2 * SMALL["radius"] / (0.75 * 0.45)  # air over ball
    parts = [0.025 / 9.81 / 3**0.5, 1 / np.cos(np.radians(2.5)) - 1, 1.5 * density / 3**0.5]
    least = float(np.linalg.norm(parts))
    assert result.scale.rest_u == pytest.approx(least, rel=0.012)
    assert least < result.scale.relative_u < 3 * least
    for said in speeds_of(result):
        assert said.u > 0.97 * least * said.value
    there = again(result, gravity_u=0.0)
    assert there.scale is not None
    apart = result.scale.relative_u**2 - there.scale.relative_u**2
    assert apart == pytest.approx(parts[0] ** 2, rel=0.02)


def test_the_ruler_with_the_smaller_u_is_used(followed: Followed) -> None:
    _, result = followed("flat")
    for gravity_u, used in ((0.01, "gravity"), (1.0, "ball")):
        by = again(result, gravity_u=gravity_u)
        assert by.scale is not None
        assert by.scale.source == used
        assert by.scale.relative_u < by.checks[0].relative_u


def test_gravity_stays_the_ruler_after_lost_frames_are_corrected(followed: Followed) -> None:
    """The motion gives the number of lost frames, without doubt left by the fit."""
    made, result = followed("flat")
    assert result.scale is not None
    assert result.scale.source == "gravity"
    throw = Throw(light="flat", seed=SEED, **SMALL)
    thinner = replace(made, frames=np.delete(made.frames, [8, 9], axis=0))
    lost = follow(clip_of(throw, thinner), knowledge_of(throw))
    assert "LOST_FRAMES" in lost.flags
    assert lost.scale is not None
    assert lost.scale.source == "gravity"
    for said, true in zip(speeds_of(lost), made.speeds, strict=True):
        assert abs(said.value - true) < min(2 * said.u, 0.015 * true)


def test_an_unknown_rate_is_fitted_by_gravity(followed: Followed) -> None:
    """A file plays 60 frames per second at 15; the ball's size and gravity give the rate."""
    made, result = followed("flat")
    words = "the frame rate is the file's own, 15 per second"  # as of a file
    result = replace(result, clip=replace(result.clip, warnings=(words,)))
    slow = again(result, rate=15.0, rate_of="file")
    assert "RATE_FITTED" in slow.flags
    assert words not in slow.warnings
    said = track_document(slow)["frames_per_second"]
    assert said["from"] == "gravity"
    assert abs(said["value"] - 60.0) < 2 * said["u"] < 4.0
    for speed, true in zip(speeds_of(slow), made.speeds, strict=True):
        assert abs(speed.value - true) < 2 * speed.u < 0.1 * true
    assert slow.checks == ()  # checks without gravity, which gave the rate
    right = again(result, rate_of="file")
    assert right.knowledge.rate == 60.0
    assert right.scale == result.scale
    assert words in right.warnings


def test_stated_times_are_converted_to_frames_by_a_fitted_rate(followed: Followed) -> None:
    """A file plays 60 frames per second at 15. A readout of 10 ms is 0.6 frames, not 0.15."""
    _, result = followed("flat")
    times = {"readout": 0.010, "readout_u": 0.001, "exposure": 0.005}
    slow = again(result, rate=15.0, rate_of="file", **times)
    assert "RATE_FITTED" in slow.flags
    scene = slow.scene
    assert [scene.readout, scene.readout_u, scene.exposure] == pytest.approx(
        [0.6, 0.06, 0.3], rel=0.05
    )
    # The film has a global shutter. The warning states the same time as the user.
    assert "would fit better than 10 ms" in " ".join(again(slow, readout_u=0.0).warnings)


def test_a_levelled_camera_and_a_known_drag_leave_gravity_a_smaller_u(followed: Followed) -> None:
    """Two u of level are 1 degree instead of 5; buoyancy is 0.25 % for 730 kg/m³ in 1.2 kg/m³."""
    _, result = followed("flat")
    density = 1.2 / 730.0
    slowing = 0.75 * 0.45 * density / 0.073  # drag constant of a sphere [1/m]
    levelled = again(result, level_u=np.radians(0.5), drag=(slowing, 0.0), gravity_u=0.0)
    assert levelled.scale is not None
    # tolerance of the ball's size in the picture, which is known to a few percent
    least = np.hypot(1 / np.cos(np.radians(0.5)) - 1, 1.5 * density / 3**0.5)
    assert levelled.scale.rest_u == pytest.approx(least, rel=0.05)
    tilted = again(result, level_u=np.radians(5), drag=(slowing, 0.0), gravity_u=0.0)
    assert tilted.scale.rest_u == pytest.approx(
        np.hypot(1 / np.cos(np.radians(5)) - 1, 1.5 * density / 3**0.5), rel=0.05
    )
    assert tilted.scale.relative_u > levelled.scale.relative_u
    assert levelled.drag_per_m is not None
    assert levelled.drag_per_m.value == pytest.approx(slowing, rel=0.05)
    text = track_text(levelled)
    assert f"the air takes {100 * levelled.drag_per_m.value:.4f} (u 0." in text
    mass = float(text.partition("as of a ball of ")[2].split()[0])  # g
    assert mass == pytest.approx(730e3 * np.pi / 6 * 0.073**3, rel=0.1)
    stated = float(text.partition(" (stated: ")[2].split()[0])  # g
    assert stated == pytest.approx(730e3 * np.pi / 6 * 0.073**3, rel=4e-3)


def test_the_text_compares_the_mass_from_the_flights_with_the_stated_one(
    followed: Followed,
) -> None:
    """The fit combines both, but the difference is that of a fit without the stated drag."""
    _, result = followed("flat")
    free = again(result).drag_per_m
    assert free is not None
    u = 2.5 * free.u
    stated = free.value + 2 * u
    tested = again(result, drag=(stated, u))
    assert "DRAG" not in tested.flags
    mass = 1e3 * 1.2 * 0.45 * np.pi * 0.0365**2 / 2 / stated
    before, _, after = track_text(tested).partition(f" g (stated: {mass:.3g} g, a difference of ")
    assert before
    assert float(after.split()[0]) == pytest.approx(2 * u / np.hypot(u, free.u), abs=0.1)


def test_the_u_of_the_diameter_is_added_to_the_u_of_the_scale(followed: Followed) -> None:
    """For 73 mm ± 7 mm, the u of the diameter is added in squares."""
    _, result = followed("flat")
    sharp, unsure = (again(result, ruler="ball", ball_u=u) for u in (0.0, 0.007))
    added = np.sqrt(unsure.scale.relative_u**2 - sharp.scale.relative_u**2)
    assert added == pytest.approx(0.007 / 0.073, rel=1e-6)
    added = np.sqrt(unsure.drag_per_m.u**2 - sharp.drag_per_m.u**2)
    assert added == pytest.approx(unsure.drag_per_m.value * 0.007 / 0.073, rel=1e-3)
