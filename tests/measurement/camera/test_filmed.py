"""Flights from positions and windows of a camera, against the true flights."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tests.simulation.instruments.camera.scenes import SHOTS, bat_of, camera_of, course_of, spec_of
from virtual_lab.errors import InputError
from virtual_lab.measurement.camera.filmed import CameraResults, Sightings, frames_u, reduce_film
from virtual_lab.measurement.camera.windows import _noise, sight
from virtual_lab.measurement.reduction.flights import Flights
from virtual_lab.records import ClipRecord
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.camera.shots import Course
from virtual_lab.streams import Quiet, Streams

STAGE = "impact"
OVER = 0.15  # distance of the camera's Y = 0 from the tip [m]


def constants(camera) -> dict[str, np.ndarray]:
    """Return the camera's constants under the names of the reduction."""
    constants = {f"{STAGE}.camera.{key}": each.value for key, each in camera.calibration().items()}
    constants |= {f"{STAGE}.camera.over": OVER, "ball.radius": 0.0365, "hall.gravity": 9.80665}
    return {name: np.array(value) for name, value in constants.items()}


def timed(course: Course) -> Flights:
    """Return the flights that ideal gates would measure of a course."""
    passage = course.passage
    return Flights(
        speed_in=passage.speed_in,
        speed_out=passage.speed_out,
        offset=np.asarray(passage.height),
        slope_in=np.asarray(passage.slope_in),
        slope_out=np.asarray(passage.slope_out),
    )


def seen_by(camera, course: Course, detail: RecordDetail, draws=None, bat=None) -> Sightings:
    record, _ = camera.watch(course, draws or Quiet(), "clip", np.arange(3), detail, bat)
    return sight(record, constants(camera))


def measured(camera, course: Course, sightings: Sightings, **changed: np.ndarray) -> CameraResults:
    x = constants(camera) | {f"{STAGE}.camera.{name}": value for name, value in changed.items()}
    return reduce_film(x, sightings, course.passage.drag, timed(course))


@pytest.mark.parametrize("name", ["camera-overhead", "camera-backlit"])
def test_a_camera_without_errors_measures_the_true_flights(name: str) -> None:
    """Drag, gravity, slopes, tilted and distorted lens: speeds to 1e-5, positions to 2 µm.

    The remaining error is the first-order treatment of the lens that deforms a sphere's outline,
    about 1e-3 px, and for a sloped rebound 0.011 of its slope squared (1e-4 at 0.1).
    """
    spec = spec_of(name, frames_in=40, frames_out=40).ideal()
    camera, course = camera_of(spec, Quiet()), course_of()
    got = measured(camera, course, seen_by(camera, course, RecordDetail.SUMMED))
    assert got.flights.speed_in == pytest.approx(course.passage.speed_in, rel=1e-5)
    off = got.flights.speed_out / course.passage.speed_out - 1
    assert np.all(np.abs(off) < 1e-5 + 0.012 * np.square(course.passage.slope_out))
    assert got.place == pytest.approx(OVER - course.along, abs=2e-6)
    assert got.angle_in == pytest.approx(np.zeros(SHOTS), abs=1e-5)


def test_windows_of_a_plain_ball_give_the_true_flights() -> None:
    """Noiseless pixels with the bat in view: speeds to 1e-4 from twelve frames and more.

    An error of 0.01 px over twelve frames at 13 m/s would be 1e-3.
    """
    spec = spec_of("camera-overhead", frames_in=20, frames_out=40).ideal()
    spec = replace(spec, ball=replace(spec.ball, seam_contrast=0.0))
    spec = replace(spec, light=replace(spec.light, ambient=1.0))
    camera, course = camera_of(spec, Quiet()), course_of()
    sightings = seen_by(camera, course, RecordDetail.FULL, bat=bat_of(course))
    got = measured(camera, course, sightings)
    assert got.flights.speed_in == pytest.approx(course.passage.speed_in, rel=1e-4)
    assert got.flights.speed_out == pytest.approx(course.passage.speed_out, rel=1e-4)
    assert got.place == pytest.approx(OVER - course.along, abs=2e-5)


def test_speeds_of_a_stitched_ball_at_1500_rpm_are_right_to_1e_4() -> None:
    """62.6 m/s at 5 kHz, full noise, known scale, depth and drag: both speeds to 1e-4.

    No error exceeds 4 u.
    """
    spec = spec_of("camera-overhead", frames_in=60, frames_out=60, empty_frames=32)
    exact_spec = replace(
        spec.ideal(), sensor=spec.sensor, light=spec.light, clock=replace(spec.clock, clock_u=0.0)
    )
    camera, course = camera_of(exact_spec, Streams(11)), course_of()
    spin = np.full((SHOTS, 3), 157.0 / np.sqrt(3))
    course = replace(course, spin_in=spin, spin_out=spin)
    sightings = seen_by(camera, course, RecordDetail.FULL, Streams(12), bat_of(course))
    got = measured(camera, course, sightings)
    u = frames_u(constants(camera), sightings, got)
    for result, true, sure in (
        (got.flights.speed_in, course.passage.speed_in, u["speed_in"]),
        (got.flights.speed_out, course.passage.speed_out, u["speed_out"]),
    ):
        assert result == pytest.approx(true, rel=1e-4)
        assert np.abs((result - true) / sure).max() < 4


def test_speeds_scatter_by_their_stated_uncertainty() -> None:
    """χ² of (measured - true)/u of speeds, position and angle, over 150 batches of three; p > 1e-3.

    Rebounds are level, because the error due to a slope (test above) is no scatter of the frames.
    """
    spec = spec_of("camera-overhead", frames_in=30, frames_out=30)
    spec = replace(spec, clock=replace(spec.clock, jitter=0.0))
    camera, course = camera_of(spec, Quiet()), course_of()
    course = replace(course, passage=replace(course.passage, slope_out=np.zeros(SHOTS)))
    scores = []
    for seed in range(150):
        sightings = seen_by(camera, course, RecordDetail.SUMMED, Streams(seed))
        got = measured(camera, course, sightings)
        u = frames_u(constants(camera), sightings, got)
        scores.append(
            [
                (got.flights.speed_in - course.passage.speed_in) / u["speed_in"],
                (got.flights.speed_out - course.passage.speed_out) / u["speed_out"],
                (got.place - OVER + course.along) / u["place"],
                got.angle_in / u["angle"],
            ]
        )
    for way in np.moveaxis(np.array(scores), 1, 0):
        two_sided = stats.chi2.cdf(float(np.sum(way**2)), way.size)
        assert 5e-4 < two_sided < 1 - 5e-4


def test_the_uncertainty_of_a_line_is_the_closed_form() -> None:
    """The oracle is σ_v = σ √(12/(N (N² - 1)))/dt for N equidistant frames of equal σ."""
    frames, dt, sigma = 24, 2e-4, 0.02
    spec = spec_of("camera-overhead").ideal()
    camera = camera_of(spec, Quiet())
    times = np.arange(2 * frames)[None] * dt
    sightings = Sightings(
        times=times,
        x=np.zeros_like(times),
        y=np.zeros_like(times),
        u=np.full_like(times, sigma),
        pattern_u=np.zeros_like(times),
        out=times > times[0, frames - 1] + dt / 2,
    )
    x = constants(camera)
    height = x["impact.camera.place_z"] - x["impact.camera.plane"]
    scale = float(height / x["impact.camera.focal"])
    true_dt = dt / float(x["impact.camera.clock"])
    by_hand = scale * sigma * np.sqrt(12 / (frames * (frames**2 - 1))) / true_dt
    one = np.ones(1)
    result = CameraResults(
        flights=Flights(speed_in=one, speed_out=one, offset=one, slope_in=one, slope_out=one),
        place=one,
        angle_in=one,
        met=np.array([(frames - 1) / 2 * dt]),
    )
    u = frames_u(x, sightings, result)
    # tolerance: the camera is tilted by a few milliradians
    assert u["speed_in"][0] == pytest.approx(by_hand, rel=2e-5)
    assert u["speed_out"][0] == pytest.approx(by_hand, rel=2e-5)
    assert u["place"][0] == pytest.approx(scale * sigma / np.sqrt(frames), rel=2e-5)
    # errors that drift from frame to frame: they change the slope, constant ones do not
    slow = frames_u(x, replace(sightings, pattern_u=np.full_like(times, sigma)), result)
    assert slow["speed_in"][0] > 2 * by_hand


@pytest.mark.parametrize(
    ("name", "step", "effect"),
    [
        ("clock", 1.001, 1e-3),  # fast clock: counts more seconds
        ("focal", None, -1e-3),  # longer lens: less distance per pixel
        ("place_z", None, 1e-3),  # higher camera: more distance per pixel
    ],
)
def test_a_wrong_constant_changes_both_speeds_alike(
    name: str, step: float | None, effect: float
) -> None:
    """An error of 0.1 % in a constant changes both speeds by 0.1 %, and e_A not at all."""
    spec = spec_of("camera-overhead", frames_in=30, frames_out=30).ideal()
    camera, course = camera_of(spec, Quiet()), course_of()
    sightings = seen_by(camera, course, RecordDetail.SUMMED)
    value = step or float(constants(camera)[f"{STAGE}.camera.{name}"]) * 1.001
    sound = measured(camera, course, sightings).flights
    # columns of constants, as in a budget
    column = np.array([[float(constants(camera)[f"{STAGE}.camera.{name}"])], [value]])
    both = measured(camera, course, sightings, **{name: column}).flights
    assert both.speed_in.shape == (2, SHOTS)
    assert both.speed_in[0] == pytest.approx(sound.speed_in, rel=1e-12)
    wrong = both.speed_in[1] / sound.speed_in - 1
    assert wrong == pytest.approx(np.full(SHOTS, effect), abs=2e-5)
    ratio = both.speed_out[1] / both.speed_in[1]
    assert ratio == pytest.approx(sound.speed_out / sound.speed_in, rel=4e-5)


def test_a_rebound_that_the_gates_missed_has_no_speed() -> None:
    """Without its height the distance of the ball is unknown: NaN; the speed in is unaffected."""
    spec = spec_of("camera-overhead").ideal()
    camera, course = camera_of(spec, Quiet()), course_of()
    sightings = seen_by(camera, course, RecordDetail.SUMMED)
    gates = replace(timed(course), slope_out=np.array([np.nan, 0.0, 0.0]))
    got = reduce_film(constants(camera), sightings, course.passage.drag, gates)
    assert np.isnan(got.flights.speed_out).tolist() == [True, False, False]
    assert np.isfinite(got.flights.speed_in).all()


def test_bad_windows_are_named() -> None:
    """Missing pixels, a missing background and windows outside the frame are errors."""
    camera, course = camera_of(spec_of("camera-overhead"), Quiet()), course_of()
    record, _ = camera.watch(course, Quiet(), "clip", np.arange(3))
    assert isinstance(record, ClipRecord)
    x = constants(camera)
    with pytest.raises(InputError, match="pixels"):
        sight(replace(record, pixels=None), x)
    with pytest.raises(InputError, match="background"):
        sight(replace(record, background=None), x)
    with pytest.raises(InputError, match="left_px"):
        sight(replace(record, left=record.left + 4000), x)


def test_the_noise_of_a_dark_pixel_is_that_of_readout_pattern_and_rounding() -> None:
    """(3² + 4²) electrons² at 2 DN per electron, and 1/12 DN² of a rounded number."""
    names = ("gain", "read_noise", "dark_signal", "black_level", "photo_response", "full_scale")
    noise = _noise(dict(zip(names, (2.0, 3.0, 4.0, 64.0, 0.01, 4095.0), strict=True)))
    assert noise.read == pytest.approx(100 + 1 / 12)
