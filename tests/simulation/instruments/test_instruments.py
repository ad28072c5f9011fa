"""Instruments against their data sheets: readings, scatter, rounding and the ideal case.

All statistics have fixed seeds; bounds are four standard errors unless stated otherwise.
"""

from dataclasses import replace
from math import inf, isclose, log, pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats
from scipy.special import ellipk

from tests.catalog.test_reading import INSTRUMENTS
from virtual_lab import catalog
from virtual_lab.catalog.reading import DATA
from virtual_lab.simulation.instruments import calibration_of, true_constants_of
from virtual_lab.simulation.instruments.air import Gravity, GravitySpec, HallAir, HallAirSpec
from virtual_lab.simulation.instruments.calibrated import draw_constants
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.spec import CameraSpec
from virtual_lab.simulation.instruments.cannon import Cannon, CannonSpec
from virtual_lab.simulation.instruments.certificate_kernel import pieces_of, stated_shares
from virtual_lab.simulation.instruments.climate import SHOWN, ClimateLogger, ClimateLoggerSpec
from virtual_lab.simulation.instruments.encoder import Encoder, EncoderSpec
from virtual_lab.simulation.instruments.indicator import (
    Rule,
    RuleSpec,
    Scale,
    ScaleSpec,
    quantise,
)
from virtual_lab.simulation.instruments.light_board import LightBoards, LightBoardSpec
from virtual_lab.simulation.instruments.light_gate import LightGates, LightGateSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.instruments.pendulum import Pendulum, PendulumSpec
from virtual_lab.streams import Quiet, Streams
from virtual_lab.uncertainty.estimate import Estimate

MAKERS = {
    "air": HallAir,
    "camera": Camera,
    "cannon": Cannon,
    "climate-logger": ClimateLogger,
    "encoder": Encoder,
    "gravity": Gravity,
    "light-board": LightBoards,
    "light-gate": LightGates,
    "pendulum": Pendulum,
    "rule": Rule,
    "scale": Scale,
}
KIND = {
    name: next(kind for kind in INSTRUMENTS if f'kind = "{kind}"' in text)
    for name in catalog.names("instruments")
    for text in [(DATA / "instruments" / f"{name}.toml").read_text("utf-8")]
}
# Constants in a calibration without a true value: a resolution is no error, the number of lines
# of an encoder is exact, a standard deviation is no error. Nobody knows the lateral aim of a
# cannon, so no calibration states it.
OF_A_CAMERA = {"exposure", "jitter", "blur", "read_noise", "photo_response", "dark_signal"}
OF_A_CAMERA |= {"black_level", "full_scale"}
NEVER_WRONG = {
    "resolution",
    *(f"{name}_resolution" for name in SHOWN),
    "counts_per_turn",
    "lowest",
    "pitch",
} | OF_A_CAMERA
NEVER_KNOWN = {"across"}


def spec_of(name: str):
    return catalog.load("instruments", name, INSTRUMENTS[KIND[name]]).spec


def small(spec):
    """Return a camera sheet with few pixels; the maps of a million pixels have no constant."""
    if not isinstance(spec, CameraSpec):
        return spec
    return replace(spec, window=8, sensor=replace(spec.sensor, columns=8, rows=8))


@pytest.mark.parametrize("name", KIND)
def test_calibration_and_errors_name_the_same_constants(name: str) -> None:
    """Every uncertain constant has a true value, and every true value has an uncertainty."""
    instrument = MAKERS[KIND[name]].commission(spec_of(name), Streams(1), name)
    assert instrument.calibration().keys() - NEVER_WRONG == instrument.errors().keys() - NEVER_KNOWN
    assert calibration_of({"x": instrument}).keys() == {
        f"x.{key}" for key in instrument.calibration()
    }
    assert true_constants_of({"x": instrument}).keys() == {
        f"x.{key}" for key in instrument.errors()
    }


@pytest.mark.parametrize("name", KIND)
def test_an_ideal_instrument_has_no_uncertainty_and_no_error(name: str) -> None:
    """The certificate has no uncertainty, and its constants are the true ones, for any seed."""
    instrument = MAKERS[KIND[name]].commission(spec_of(name).ideal(), Streams(1), name)
    calibration = instrument.calibration()
    assert all(estimate.u == 0 for estimate in calibration.values())
    stated = calibration | dict(instrument.stated)
    assert all(value == stated[key].value for key, value in instrument.errors().items())


@pytest.mark.parametrize("name", KIND)
def test_true_constants_scatter_as_the_calibration_says(name: str) -> None:
    """(true - stated)/u is Student's t of ν over 400 laboratories (KS test, p > 1e-4).

    The mean of u² is σ², to 4.5 standard errors √(2/400ν).
    """
    scores: dict[str, list[float]] = {}
    squares: dict[str, list[float]] = {}
    spec = small(spec_of(name))
    sheet = MAKERS[KIND[name]].commission(spec, Quiet(), name).calibration()
    for seed in range(400):
        instrument = MAKERS[KIND[name]].commission(spec, Streams(seed), name)
        true = instrument.errors()
        for key, estimate in instrument.calibration().items():
            assert (estimate.value, estimate.dof) == (sheet[key].value, sheet[key].dof)
            if estimate.u > 0:
                scores.setdefault(key, []).append((true[key] - estimate.value) / estimate.u)
                squares.setdefault(key, []).append((estimate.u / sheet[key].u) ** 2)
    assert scores
    for key, values in scores.items():
        dof = sheet[key].dof
        law = stats.norm if dof == inf else stats.t(dof)
        assert stats.kstest(values, law.cdf).pvalue > 1e-4, key
        assert abs(np.mean(squares[key]) - 1) <= 4.5 * sqrt(2 / (400 * dof)), key
    if len(scores) > 1:
        correlation = np.corrcoef(list(scores.values()))
        np.fill_diagonal(correlation, 0.0)
        assert np.abs(correlation).max() < 4.5 / sqrt(400)


@given(
    value=st.floats(-1e6, 1e6),
    step=st.sampled_from([1e-6, 1e-4, 0.5e-3, 0.1, 1.0, 3.0]),
)
def test_quantising_rounds_to_the_nearest_step(value: float, step: float) -> None:
    """The result is a whole number of steps, within half a step; a step of 0 changes nothing."""
    quantised = float(quantise(value, step))
    assert abs(quantised - value) <= step / 2 * (1 + 1e-9) + 1e-9 * abs(value)
    assert isclose(quantised / step, round(quantised / step), rel_tol=1e-12, abs_tol=1e-12)
    assert quantise(value, 0.0) == value


def test_quantising_noise_is_uniform() -> None:
    """Sheppard: the rounding error of a wide distribution has the variance step²/12."""
    n = 50_000
    fine = Streams(3).normal("x", n)
    error = quantise(fine, 0.1) - fine
    assert abs(error.mean()) < 4 * 0.1 / sqrt(12 * n)
    # variance of the square of a uniform error: step⁴/180
    assert abs(error.var() - 0.01 / 12) < 4 * sqrt(1e-4 / 180 / n)


def test_indicator_adds_offset_and_scatter() -> None:
    """The mean is true + offset, the standard deviation the repeatability; n = 40 000."""
    n, scatter = 40_000, 0.03
    spec = RuleSpec(
        kind="", title="", resolution=0.0, repeatability=scatter, offset_u=0.0, offset=0.2
    )
    rule = Rule.commission(spec, Quiet(), "r")
    readings = rule.measure([5.0, 7.0], n, Streams(8), "r").readings
    assert readings.shape == (2, n)
    for row, true in zip(readings, (5.0, 7.0), strict=True):
        assert abs(row.mean() - true - 0.2) < 4 * scatter / sqrt(n)
        assert abs(row.std() - scatter) < 4 * scatter / sqrt(2 * n)
    assert abs(np.corrcoef(readings)[0, 1]) < 4 / sqrt(n)


SCALE = ScaleSpec(
    kind="scale",
    title="",
    resolution=1e-4,
    repeatability=2e-4,
    zero_u=5e-4,
    span_u=1e-3,
)


def test_scale_reads_span_times_mass_plus_zero() -> None:
    """A least-squares line through 20 000 readings gives the true constants of the scale."""
    scale = Scale.commission(SCALE, Streams(4), "s")
    mass = np.linspace(0.1, 2.0, 200)
    readings = scale.weigh(mass, 100, Streams(5), "w").readings
    zero, span = np.polynomial.polynomial.polyfit(mass, readings.mean(axis=1), 1)
    u = sqrt((2e-4) ** 2 + 1e-8 / 12) / sqrt(readings.size)
    spread = mass.std()
    assert abs(span - scale.errors()["span"]) < 4 * u / spread
    assert abs(zero - scale.errors()["zero"]) < 4 * u * sqrt(1 + (mass.mean() / spread) ** 2)
    steps = readings / 1e-4
    assert np.abs(steps - np.rint(steps)).max() < 1e-6


def test_rule_reads_length_plus_offset() -> None:
    """The mean of 20 000 readings of a length between two marks is length + offset."""
    spec = RuleSpec(kind="rule", title="", resolution=1e-3, repeatability=2e-3, offset_u=1e-3)
    rule = Rule.commission(spec, Streams(4), "r")
    readings = rule.measure(0.86361, 20_000, Streams(5), "m").readings
    assert readings.shape == (1, 20_000)
    u = sqrt(4e-6 + 1e-6 / 12) / sqrt(20_000)
    assert abs(readings.mean() - 0.86361 - rule.errors()["offset"]) < 4 * u


@pytest.mark.parametrize("maker", [Scale, Rule])
def test_ideal_indicators_read_the_truth_by_their_certificate(maker) -> None:
    """The reading is span x mass + zero, or length + offset, and nothing else."""
    name = {"Scale": "lab-scale", "Rule": "steel-rule"}[maker.__name__]
    ideal = maker.commission(spec_of(name).ideal(), Streams(1), "i")
    true = np.array([0.1452941176, 0.8788])
    act = ideal.weigh if maker is Scale else ideal.measure
    expected = true * 1.00015 + 0.1e-3 if maker is Scale else true + 0.5e-3
    readings = act(true, 3, Streams(2), "x").readings
    assert readings == pytest.approx(np.stack([expected] * 3, axis=1), rel=1e-15)


def test_cannon_scatters_as_its_sheet_says() -> None:
    """Mean and standard deviation of speed and of both offsets, over 50 000 shots."""
    spec, n = spec_of("ball-cannon"), 50_000
    cannon = Cannon.commission(spec, Streams(6), "c")
    launch = cannon.fire(np.full(n, 26.8224), Streams(7), "f", np.arange(n))
    for values, centre, scatter in (
        (launch.speed, 26.8224, 0.4 * 0.44704),
        (launch.along, cannon.true["along"], 1.5e-3),
        (launch.across, cannon.true["across"], 1.5e-3),
    ):
        assert abs(values.mean() - centre) < 4 * scatter / sqrt(n)
        assert abs(values.std() - scatter) < 4 * scatter / sqrt(2 * n)
    assert abs(np.corrcoef([launch.speed, launch.along, launch.across])[0, 1]) < 4 / sqrt(n)


def test_cannon_marks_tell_its_aim() -> None:
    """The mean of 4000 marks is within four standard errors of the aim; steps are 0.5 mm."""
    spec = replace(spec_of("ball-cannon"), marks=4000)
    cannon = Cannon.commission(spec, Streams(6), "c")
    marks = cannon.mark(Streams(7), "m")
    u = sqrt(2.25e-6 + 0.25e-6 / 12) / sqrt(4000)
    assert abs(marks.along.mean() - cannon.true["along"]) < 4 * u
    assert abs(marks.across.mean() - cannon.true["across"]) < 4 * u
    steps = np.concatenate([marks.along, marks.across]) / 0.5e-3
    assert np.abs(steps - np.rint(steps)).max() < 1e-9


def test_the_drag_rate_agrees_with_a_hand_calculation() -> None:
    """κ = ρ C_d π R²/(2 m): 1.2 x 0.4 x π x 0.0366² / (2 x 0.145) = 6.9655e-3 per meter."""
    spec = HallAirSpec(
        kind="air",
        title="",
        density=1.2,
        density_u=0.0,
        drag_coefficient=0.4,
        drag_coefficient_u=0.0,
    )
    air = HallAir.commission(spec, Quiet(), "a")
    by_hand = 1.2 * 0.4 * pi * 0.0366**2 / 0.29
    assert air.drag(0.0366, np.array([0.145]))[0] == pytest.approx(by_hand, rel=1e-14)
    assert by_hand == pytest.approx(6.9655e-3, rel=1e-4)
    still = HallAir.commission(spec.ideal(), Streams(1), "a")
    assert still.drag(0.0366, np.array([0.145]))[0] == 0


FIRST = np.zeros(1, dtype=int)  # index of the first shot
GATES = LightGateSpec(
    kind="light-gate",
    title="",
    distances=(0.6, 0.4, 0.2),
    distance_u=1e-4,
    half_height=0.05,
    tick=1e-6,
    edge_jitter=2e-6,
    clock_u=1e-4,
)


def passage(n: int = 1, **changes) -> Passage:
    values = {
        "speed_in": np.full(n, 30.0),
        "speed_out": np.full(n, 6.0),
        "drag": np.zeros(n),
        "radius": 0.0366,
        "gravity": 0.0,
    }
    return Passage(**(values | changes))


def test_ideal_gates_without_air_record_distance_over_speed() -> None:
    """Time is distance over speed; the front breaks the beam, the rear clears it, both ways."""
    gates = LightGates.commission(GATES.ideal(), Streams(1), "g")
    record = gates.watch(passage(), np.array([0.1]), np.array([0.101]), Streams(2), "g", FIRST)
    radius = 0.0366
    for gate, distance in enumerate((0.6, 0.4, 0.2)):
        into = [0.1 - (distance + radius) / 30, 0.1 - (distance - radius) / 30]
        back = [0.101 + (distance - radius) / 6, 0.101 + (distance + radius) / 6]
        assert record.times[0, 0, gate] == pytest.approx(into, rel=1e-14)
        assert record.times[0, 1, gate] == pytest.approx(back, rel=1e-14)
    assert gates.arrival(passage())[0] == pytest.approx((0.6 + radius) / 30, rel=1e-14)


def test_gates_with_air_record_the_time_in_closed_form() -> None:
    """dv/dx = -κ v gives v = v0 e^(-κx), so the ball takes (e^(κx) - 1)/(κ v0) back to 0.4 m."""
    gates = LightGates.commission(GATES.ideal(), Quiet(), "g")
    drag = np.array([0.02])
    record = gates.watch(passage(drag=drag), np.array([0.1]), np.array([0.1]), Quiet(), "g", FIRST)
    x = 0.4 - 0.0366
    assert record.times[0, 1, 1, 0] - 0.1 == pytest.approx(
        (np.exp(0.02 * x) - 1) / (0.02 * 6), rel=1e-12
    )
    # flight in, faster farther out: v(x) = v e^(κx) at x ahead, t = (1 - e^(-κx))/κv
    x = 0.4 + 0.0366
    assert 0.1 - record.times[0, 0, 1, 0] == pytest.approx(
        (1 - np.exp(-0.02 * x)) / (0.02 * 30), rel=1e-12
    )


def test_gates_show_jitter_clock_and_ticks() -> None:
    """The mean is clock x time, and the scatter that of jitter and rounding; 20 000 shots."""
    n = 20_000
    gates = LightGates.commission(GATES, Streams(9), "g")
    contact = np.full(n, 0.1)
    record = gates.watch(passage(n), contact, contact, Streams(10), "g", np.arange(n))
    steps = record.times / 1e-6
    assert np.abs(steps - np.rint(steps)).max() < 1e-4
    # scatter between two edges with a common phase: two jitters and two roundings
    width = record.times[:, 0, 0, 1] - record.times[:, 0, 0, 0]
    scatter = sqrt(2 * 4e-12 + 2e-12 / 12)
    assert abs(width.mean() - gates.clock * 2 * 0.0366 / 30) < 4 * scatter / sqrt(n)
    assert abs(width.std() - scatter) < 4 * scatter / sqrt(2 * n)
    between = record.times[:, 0, 2].mean(axis=1) - record.times[:, 0, 0].mean(axis=1)
    true = (gates.distances[0] - gates.distances[2]) / 30
    assert abs(between.mean() - gates.clock * true) < 4 * scatter / sqrt(n)
    assert gates.clock != 1
    assert gates.distances[0] != 0.6


def test_a_clock_with_a_random_phase_has_no_mean_error() -> None:
    """Without jitter, whole ticks with a uniform phase have the mean of the true time.

    The mean of each edge of 4000 shots lies within 5 tick/√(4 n). With a fixed phase, each edge
    would be off by its own fraction of a tick.
    """
    n, tick = 4000, 1e-6
    sheet = spec_of("pivot-gates")
    spec = replace(sheet, edge_jitter=0.0, distance_u=0.0, clock_u=0.0, clock_fast=0.0, tick=tick)
    gates = LightGates.commission(spec, Streams(3), "g")
    flown = passage(n, speed_in=np.full(n, 29.7131))  # speed at which no edge is near a whole tick
    contact = gates.arrival(flown)
    record = gates.watch(flown, contact, contact, Streams(4), "g", np.arange(n))
    edges = np.array(spec.distances)[:, None] + flown.radius * np.array([1.0, -1.0])
    true = contact[0] - edges / flown.speed_in[0]
    late = record.times[:, 0].mean(axis=0) - true
    assert np.abs(late).max() < 5 * tick / np.sqrt(4 * n)


@pytest.mark.parametrize(
    ("changes", "seen"),
    [
        ({}, True),
        ({"speed_out": np.array([0.0])}, False),
        ({"speed_out": np.array([-1.0])}, False),
        ({"slope_out": np.array([0.2])}, False),  # height of 0.13 m at the far gate
        ({"slope_out": np.array([0.05])}, True),
        # fall g t²/2 of 49 mm in 0.1 s; at 6 m/s the far gate is 0.106 s away
        ({"gravity": 9.80665}, False),
        ({"gravity": 9.80665, "speed_out": np.array([6.6])}, True),
    ],
)
def test_the_curtains_see_rebounds_within_their_height(changes: dict, seen: bool) -> None:
    """Heights by hand against a half height of 50 mm; the flight in is always seen."""
    gates = LightGates.commission(GATES.ideal(), Quiet(), "g")
    record = gates.watch(passage(**changes), np.array([0.1]), np.array([0.1]), Quiet(), "g", FIRST)
    assert np.isfinite(record.times[0, 0]).all()
    assert np.isfinite(record.times[0, 1, 0]).all() == seen


ENCODER = EncoderSpec(
    kind="encoder",
    title="",
    counts_per_turn=4000,
    sample_rate=1000.0,
    duration=0.5,
    scale_u=1e-3,
)


def test_the_encoder_shows_the_angle_within_one_count() -> None:
    """An angle of 1 rad gives scale x 4000/2π counts, to less than one count at any rest phase."""
    encoder = Encoder.commission(ENCODER, Streams(11), "e")
    angle = np.linspace(0, 1, 500)[None, :].repeat(200, axis=0)
    record = encoder.read(lambda part: angle[part].copy(), Streams(12), "e", np.arange(len(angle)))
    assert record.times.tolist() == (np.arange(500) / 1000).tolist()
    assert np.array_equal(record.counts, np.rint(record.counts))
    exact = encoder.scale * 4000 / (2 * pi) * angle
    deviation = record.counts - exact
    assert np.abs(deviation).max() < 1
    # triangular distribution of rest phase plus rounding, both uniform of one count: 2/12
    assert abs(deviation[:, 1:].var() - 1 / 6) < 0.02
    assert abs(encoder.scale - 1) < 5e-3
    assert encoder.scale != 1


def test_ideal_encoder_shows_the_angle() -> None:
    """Counts are real numbers and the scale is 1."""
    encoder = Encoder.commission(ENCODER.ideal(), Streams(11), "e")
    angle = np.linspace(0, 1, 500)[None, :]
    counts = encoder.read(
        lambda part: angle[part].copy(), Quiet(), "e", np.arange(len(angle))
    ).counts
    assert counts == pytest.approx(4000 / (2 * pi) * angle, rel=1e-14)
    assert not encoder.spec.sees_ring
    assert not encoder.spec.whole_counts


STAND = spec_of("pendulum")


def test_pendulum_period_is_the_elliptic_integral() -> None:
    """T = 4 √(I/gMd) K(sin²(θ/2)) of an exact pendulum, in the middle of every swing."""
    stand = replace(STAND.ideal(), swings=8, amplitude_decay=0.01)
    inertia, moment = 0.25, 0.40
    record = Pendulum.commission(stand, Quiet(), "p").swing(
        inertia=inertia, moment=moment, gravity=9.79, releases=2, draws=Quiet(), name="p"
    )
    both, arm = inertia + stand.clamp_inertia, moment + stand.clamp_moment
    amplitude = stand.release_amplitude * 0.99 ** np.arange(9)
    middle = np.sqrt(amplitude[:8] * amplitude[1:])
    periods = 4 * np.sqrt(both / (9.79 * arm)) * ellipk(np.sin(middle / 2) ** 2)
    displayed = amplitude + stand.amplitude_offset
    assert np.diff(record.times[0]) == pytest.approx((1 + stand.timer_fast) * periods, rel=1e-8)
    assert record.first_amplitude[0] == pytest.approx(displayed[0], rel=1e-12)
    assert record.last_amplitude[0] == pytest.approx(displayed[8], rel=1e-12)


def test_a_pendulum_record_has_the_scatter_and_steps_of_its_sheet() -> None:
    """Jitter of 50 µs and steps of 10 µs at each passage; amplitudes in steps of 0.1°."""
    pendulum = Pendulum.commission(STAND, Streams(3), "p")
    record = pendulum.swing(
        inertia=0.25, moment=0.4, gravity=9.8, releases=4000, draws=Streams(4), name="p"
    )
    steps = record.times / 10e-6
    assert np.abs(steps - np.rint(steps)).max() < 1e-4
    total = record.times[:, -1] - record.times[:, 0]
    scatter = sqrt(2 * (50e-6) ** 2 + 2 * (10e-6) ** 2 / 12)
    assert abs(total.std() - scatter) < 4 * scatter / sqrt(2 * 4000)
    amplitude_steps = np.degrees(record.first_amplitude) / 0.1
    assert np.abs(amplitude_steps - np.rint(amplitude_steps)).max() < 1e-9


def test_pendulum_decay_is_as_the_sheet_says() -> None:
    """A decay of 0.5 % per swing over ten swings: ln(first/last) = -10 ln 0.995."""
    stand = replace(STAND.ideal(), amplitude_offset=0.0)
    record = Pendulum.commission(stand, Quiet(), "p").swing(
        inertia=0.25, moment=0.4, gravity=9.8, releases=1, draws=Quiet(), name="p"
    )
    ratio = float(record.first_amplitude[0] / record.last_amplitude[0])
    assert log(ratio) == pytest.approx(-10 * log(0.995), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "act"),
    [
        ("ball-cannon", lambda c, d: c.fire(np.full(5, 26.0), d, "n", np.arange(5)).speed),
        (
            "pivot-gates",
            lambda g, d: (
                g.watch(passage(5), np.full(5, 0.1), np.full(5, 0.1), d, "n", np.arange(5)).times
            ),
        ),
        ("lab-scale", lambda s, d: s.weigh(0.9, 5, d, "n").readings),
        ("steel-rule", lambda r, d: r.measure(0.9, 5, d, "n").readings),
        (
            "pendulum",
            lambda p, d: (
                p.swing(inertia=0.2, moment=0.4, gravity=9.8, releases=5, draws=d, name="n").times
            ),
        ),
    ],
)
def test_noise_comes_from_the_draws_alone(name: str, act) -> None:
    """The same draws give the same bits, other draws others, and quiet draws no scatter."""
    instrument = MAKERS[KIND[name]].commission(spec_of(name), Quiet(), name)
    assert act(instrument, Streams(1)).tobytes() == act(instrument, Streams(1)).tobytes()
    assert act(instrument, Streams(1)).tobytes() != act(instrument, Streams(2)).tobytes()
    rows = act(instrument, Quiet())
    rows = rows.reshape(5, -1) if rows.shape[0] == 5 else rows.T
    assert np.array_equal(rows, np.broadcast_to(rows[:1], rows.shape))


def test_specs_are_those_of_the_catalog() -> None:
    """The tests make every kind of instrument in the catalog, and no other."""
    assert set(KIND.values()) == set(MAKERS) == set(INSTRUMENTS)
    assert {type(spec_of(name)) for name in KIND} <= {
        HallAirSpec,
        CameraSpec,
        CannonSpec,
        ClimateLoggerSpec,
        EncoderSpec,
        GravitySpec,
        LightBoardSpec,
        LightGateSpec,
        PendulumSpec,
        RuleSpec,
        ScaleSpec,
    }


@pytest.mark.parametrize("name", KIND)
def test_an_instrument_of_a_block_is_that_of_the_laboratory_alone(name: str) -> None:
    """True constants and certificate have the same bits in a block and alone."""
    make, spec, numbers = (
        MAKERS[KIND[name]].commission,
        small(spec_of(name)),
        np.array([7, 0, 7, 3]),
    )
    block = make(spec, Streams(2, (), numbers), name)
    for at, number in enumerate(numbers):
        alone = make(spec, Streams(2, (), int(number)), name)
        assert {key: one.row(at) for key, one in block.calibration().items()} == alone.calibration()
        assert {key: one[at] for key, one in block.errors().items()} == alone.errors()
    gathered = block.at(np.array([3, 1])).true
    assert all(np.array_equal(one, block.true[key][[3, 1]]) for key, one in gathered.items())


@pytest.mark.parametrize("name", KIND)
def test_a_quiet_block_states_the_sheet(name: str) -> None:
    """The stated u is σ of the sheet, even if ν is finite; a σ of 0 stays 0."""
    spec = small(spec_of(name))
    block = MAKERS[KIND[name]].commission(spec, Quiet(np.arange(3)), name).calibration()
    alone = MAKERS[KIND[name]].commission(spec, Quiet(), name).calibration()
    assert {key: one.row(2) for key, one in block.items()} == alone
    assert all(one.value.shape == one.u.shape == one.dof.shape == (3,) for one in block.values())


@pytest.mark.parametrize("dof", [1.0, 2.0, 3.0, 9.0, 19.0, 1000.0])
def test_the_stated_u_follows_a_chi_square_law(dof: float) -> None:
    """The oracle is scipy's quantile from the nearer tail, at 4000 normal numbers and up to ±7."""
    chance = np.concatenate([np.random.default_rng(1).normal(size=4000), [-7.0, -5.0, 5.0, 7.0]])
    shares = np.empty(chance.size)
    stated_shares(chance, pieces_of(dof), shares)
    law = stats.chi2(dof)
    square = np.where(chance < 0, law.ppf(stats.norm.cdf(chance)), law.isf(stats.norm.sf(chance)))
    usual = np.abs(chance) < 6
    error = np.abs(shares / np.sqrt(square / dof) - 1)
    assert error[usual].max() < 1e-13
    assert error.max() < 2e-11


def test_the_degrees_of_freedom_of_u_do_not_change_the_instrument() -> None:
    """ν belongs to the certificate: with the same draws, only u depends on it."""
    sheets = ({"x": Estimate(value=2.0, u=0.1, dof=dof)} for dof in (3.0, inf))
    (few, true_of_few), (many, true) = (draw_constants(sheet, Streams(5), "n") for sheet in sheets)
    assert true_of_few == true != {"x": 2.0}
    assert few["x"].u != many["x"].u == 0.1


def test_a_board_sees_from_its_lowest_beam_to_its_highest() -> None:
    """21 beams 5 mm apart from -50 to 50 mm see a ball of radius 36 mm up to 86 mm."""
    spec = replace(spec_of("light-boards"), beams=21, pitch=5e-3, lowest=-0.05)
    assert spec.highest == pytest.approx(0.05, abs=1e-12)
    assert spec.view(0.036) == pytest.approx((-0.086, 0.086), abs=1e-12)


def test_scrap_of_the_sabot_trips_some_beams_of_the_first_board_before_the_ball() -> None:
    """The scrap is 30 mm ahead of the ball: at least half a millisecond early at 60 m/s."""
    spec = replace(spec_of("light-boards").ideal(), sabot_rate=0.5)
    clean, scrapped = (
        _edges_of(replace(spec, sabot_rate=rate), speed=60.0, shots=40) for rate in (0.0, 0.5)
    )
    early = clean - scrapped
    is_early = np.abs(early) > 1e-9
    assert not is_early[:, 1].any()  # direction: back
    assert not is_early[:, 0, 1:].any()  # other boards
    assert not is_early[..., 1].any()  # edges at which the ball clears a beam
    assert 10 <= is_early.any(axis=(1, 2, 3, 4)).sum() <= 30
    assert early[is_early].min() >= 0.03 / 60.0 - 1e-9
    assert set(is_early[:, 0, 0, :, 0].sum(axis=1)) <= {0, 1, 2, 3, 4}


def _edges_of(spec: LightBoardSpec, *, speed: float, shots: int) -> NDArray[np.float64]:
    boards = LightBoards.commission(spec, Quiet(), "b")
    passage = Passage(
        speed_in=np.full(shots, speed),
        speed_out=np.full(shots, 20.0),
        drag=np.zeros(shots),
        radius=0.0366,
        gravity=0.0,
    )
    contact = boards.arrival(passage)
    record = boards.watch(passage, contact, contact, Streams(3), "b", np.arange(shots))
    return np.nan_to_num(record.times)
