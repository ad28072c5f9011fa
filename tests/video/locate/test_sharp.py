"""Edge fits in a clip of a stitched ball that spins, and in regions under hard and back light."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.simulation.instruments.camera.scenes import camera_of, course_of, spec_of
from tests.video.follow.test_sharp_clips import hit
from tests.video.stitched import LENS, scene
from virtual_lab.simulation.instruments.camera.film import whole_frames
from virtual_lab.streams import Streams
from virtual_lab.video.clips.calibration_file import CameraModel, ClipCalibration
from virtual_lab.video.locate.located import Regions
from virtual_lab.video.locate.sharp import on_the_limb, place

ROUND = 0.0, 2e-4  # eccentricity of the outlines of balls squarely before a camera, and its u


def test_a_stitched_ball_that_spins_is_tracked(tmp_path: Path) -> None:
    """At 1500 rpm, off the axis of a true lens, speeds are right within 3 u plus 1e-4."""
    spec = spec_of("camera-overhead", frames_in=18, frames_out=60)
    spec = replace(
        spec,
        lens=spec.lens.ideal(),
        pose=spec.pose.ideal(),
        clock=spec.clock.ideal(),
        sensor=replace(spec.sensor, rows=200),
    )
    draws, level = Streams(3), np.zeros(3)
    camera, course = camera_of(spec, draws), course_of()
    spin = draws.normal("spins", (2, 3, 3))
    spin *= 157 / np.linalg.norm(spin, axis=-1, keepdims=True)
    flight = replace(course.passage, gravity=0.0, height=level, slope_in=level, slope_out=level)
    course = replace(
        course, passage=flight, leaving=course.contact, spin_in=spin[0], spin_out=spin[1]
    )
    stamps, frames = zip(*whole_frames(camera, course, draws, "film", np.arange(3)), strict=True)
    np.save(tmp_path / "clip.npy", np.stack(frames))
    (tmp_path / "stamps.csv").write_text("\n".join(map(repr, stamps)))
    lens = camera.lens
    x, y = map(float, lens.centre)
    calibration = ClipCalibration(
        camera=CameraModel(
            image_size=(spec.sensor.columns, spec.sensor.rows),
            matrix=((lens.focal, 0.0, x), (0.0, lens.focal, y), (0.0, 0.0, 1.0)),
            distortion=tuple(lens.distortion.tolist()),
            rotation=tuple(cv2.Rodrigues(lens.rotation)[0].ravel().tolist()),
            translation_m=tuple((-lens.rotation @ lens.place).tolist()),
        ),
        ball_diameter_m=0.073,
        exposure_s=spec.clock.exposure,
        lens_blur_px=spec.blur,
        timestamps=str(tmp_path / "stamps.csv"),
        drag_per_m=0.0069,
    )
    rendered = camera.frames(course, draws, "film", np.arange(3), whole=True)
    true = rendered.outlines.middle[rendered.shot == 0]
    tracked, said = hit(tmp_path / "clip.npy", calibration)
    flying = np.isin(tracked.frames, np.concatenate([way.frames for way in said.clip.ways]))
    located = tracked.located
    off = np.stack([located.x, located.y], axis=1) - true[tracked.frames]
    assert float(np.sqrt(np.mean(off[flying] ** 2))) < 0.03
    assert said.speed_out is not None
    into, out = float(np.ravel(flight.speed_in)[0]), float(np.ravel(flight.speed_out)[0])
    for speed, exact, way in ((said.speed_in, into, 0), (said.speed_out, out, 1)):
        assert abs(speed.value - exact) < 3 * speed.u + 1e-4 * exact  # scale of the plane
        frames = np.isin(tracked.frames, said.clip.ways[way].frames)
        middle = true[tracked.frames[frames]].mean(axis=0)
        ray = lens.rotation.T @ [*(middle - lens.centre) / lens.focal, 1.0]
        tilted = np.tan(np.radians(0.5)) * abs(ray[0] / ray[2])  # tilt of a flight by half a degree
        # the growth of the ball's picture shows the slope, so that u need not cover such a tilt
        assert 0 < speed.u / exact < np.hypot(tilted, 6e-4)


def seen_of(regions: np.ndarray, behind: float) -> Regions:
    return Regions(
        pixels=regions,
        background=np.full((len(regions), *regions.shape[1:]), behind, np.float32),
        corners=np.zeros((len(regions), 2)),
    )


def test_a_ball_with_half_its_rim_dark_is_located() -> None:
    """Under a hard lamp from the side, errors are no larger than their stated u."""
    sample = scene("side", count=40)
    middle = (sample.regions.shape[2] / 2, sample.regions.shape[1] / 2)
    fit = place(
        seen_of(sample.regions, 15.0),
        sample.start(),
        noise=sample.noise,
        lens=LENS,
        middle=middle,
        oval=ROUND,
    )
    assert not fit.flags.any()
    for off, u in ((fit.x - sample.x, fit.x_u), (fit.y - sample.y, fit.y_u)):
        assert np.sqrt(np.mean(off**2)) < 0.07
        assert np.sqrt(np.mean((off / np.hypot(u, fit.pattern_u)) ** 2)) < 1.3


@pytest.mark.long
def test_the_u_allows_for_seams_at_the_rim() -> None:
    """A seam along the rim looks like the outline; fewer than 1 in 150 errors exceed 5 u.

    A flight leaves such a position out, because it is far from the fitted line.
    """
    off, pulls = [], []
    for seed in (12, 13, 14, 18):
        sample = scene("soft", 2, seed=seed)
        middle = (sample.regions.shape[2] / 2, sample.regions.shape[1] / 2)
        fit = place(
            seen_of(sample.regions, 40.0),
            sample.start(),
            noise=sample.noise,
            lens=LENS,
            middle=middle,
            oval=ROUND,
        )
        off.append(np.stack([fit.x - sample.x, fit.y - sample.y]))
        pulls.append(off[-1] / np.hypot(np.stack([fit.x_u, fit.y_u]), fit.pattern_u))
    assert np.sqrt(np.mean(np.square(off))) < 0.012
    assert (np.abs(pulls) > 5).mean() < 1 / 150


def test_a_poor_start_gives_no_poorer_position() -> None:
    """A start wrong by 2 pixels and by 5 % in radius is fitted again from the first result."""
    sample = scene("soft", count=20)
    middle = (sample.regions.shape[2] / 2, sample.regions.shape[1] / 2)
    start = sample.start(off=2.0)
    start.radius[:] *= 1.05
    fit = place(
        seen_of(sample.regions, 40.0),
        start,
        noise=sample.noise,
        lens=LENS,
        middle=middle,
        oval=ROUND,
    )
    assert not fit.flags.any()
    assert np.sqrt(np.mean((fit.x - sample.x) ** 2)) < 0.02
    assert np.sqrt(np.mean((fit.y - sample.y) ** 2)) < 0.02


def test_a_start_may_share_its_arrays() -> None:
    """Unknown values of a start share one array of NaN, which the fit does not change."""
    sample = scene("back", count=3)
    nothing = np.full(3, np.nan)
    bare = replace(sample.start(), x_u=nothing, y_u=nothing, chi_square=nothing)
    options = {"noise": sample.noise, "lens": LENS, "middle": (0.0, 0.0)}
    fits = [
        place(seen_of(sample.regions, 155.0), each, **options) for each in (sample.start(), bare)
    ]
    for name in ("x", "x_u", "y_u", "chi_square", "pattern_u"):
        np.testing.assert_array_equal(*(getattr(each, name) for each in fits))
    assert np.isnan(nothing).all()


def test_a_shadow_needs_no_pattern() -> None:
    sample = scene("back", count=20)
    fit = place(
        seen_of(sample.regions, 155.0), sample.start(), noise=sample.noise, lens=LENS, middle=(0, 0)
    )
    assert fit.pattern_u.max() < 0.002
    assert np.sqrt(np.mean((fit.x - sample.x) ** 2)) < 0.005


def test_a_ball_lit_from_the_side_is_found_by_its_limb() -> None:
    """A start 8 pixels off, in the middle of the light, gives each position within 2 pixels."""
    sample = scene("side", count=20)
    start = sample.start()
    light = replace(start, y=start.y - 8.0, radius=np.full(20, sample.radius))
    fit = on_the_limb(seen_of(sample.regions, 15.0), light)
    assert np.hypot(fit.x - sample.x, fit.y - sample.y).max() < 2
