"""From readings to results: a numerically integrated pendulum and a collision by hand."""

from math import isclose, pi, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from virtual_lab.measurement.reduction.gates import GateReadings, Passages
from virtual_lab.measurement.reduction.observations import (
    ImpactReadings,
    across_constant,
    bench_constants,
)
from virtual_lab.measurement.reduction.rate import RateFit
from virtual_lab.measurement.reduction.shot_algebra import (
    BatProperties,
    MeasuredBalls,
    ReductionSettings,
    ShotResults,
    bat_properties,
    shot_results,
)
from virtual_lab.records import AimMarks, LengthReadings, MassReadings, PendulumRecord, ShotLog
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.origin import Supplied
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.estimate import Estimate

# Bat and stand of round numbers
MASS, LENGTH, Z_CM, INERTIA_CM = 0.88, 0.86, 0.29, 0.0465
PIVOT_FROM_KNOB, CLAMP_INERTIA, CLAMP_MOMENT, GRAVITY = 0.15, 2e-4, 1e-3, 9.81
LEVER = LENGTH - PIVOT_FROM_KNOB - Z_CM
ZERO, SPAN, RULE, STAND, CLOCK, AMPLITUDE = 3e-4, 1.0004, 2e-4, -3e-4, 1.0001, 2e-3
SWINGS, RELEASES = 10, 3


def swing(release: float, damping: float) -> tuple[np.ndarray, float, float]:
    """Integrate I θ'' = -moment g sin θ - damping; return one-way passages and amplitudes."""
    inertia = INERTIA_CM + MASS * LEVER**2 + CLAMP_INERTIA
    square = (MASS * LEVER + CLAMP_MOMENT) * GRAVITY / inertia

    def passes(_: float, state: np.ndarray) -> float:
        return float(state[0])

    passes.direction = 1.0
    solution = solve_ivp(
        lambda _, s: [s[1], -square * sin(s[0]) - damping * s[1]],
        (0, 25),
        [-release, 0.0],
        events=passes,
        rtol=1e-11,
        atol=1e-13,
    )
    times, speeds = solution.t_events[0][: SWINGS + 1], solution.y_events[0][: SWINGS + 1, 1]
    # amplitudes from the energy at the passage: ω² = 4 Ω² sin²(θ/2)
    first, last = 2 * np.arcsin(speeds[[0, -1]] / 2 / square**0.5)
    return times, float(first), float(last)


@pytest.fixture(scope="module")
def bench() -> Session:
    """Return a session whose bench measured that bat by instruments with known errors."""
    runs = [swing(0.2 + 0.01 * i, 2e-3) for i in range(RELEASES)]
    exact = {"scale.zero": ZERO, "scale.span": SPAN, "rule.offset": RULE, "stand.offset": STAND}
    exact |= {"scale.resolution": 0.0, "rule.resolution": 0.0, "stand.resolution": 0.0}
    exact |= {"pendulum.clock": CLOCK, "pendulum.amplitude_offset": AMPLITUDE}
    exact |= {"pendulum.pivot_from_knob": PIVOT_FROM_KNOB}
    exact |= {"pendulum.clamp_inertia": CLAMP_INERTIA, "pendulum.clamp_moment": CLAMP_MOMENT}
    return Session(
        bat="",
        ball="",
        rigs={},
        procedure_text="",
        calibration={f"bench.{key}": Estimate(value=value) for key, value in exact.items()}
        | {"hall.gravity": Estimate(value=GRAVITY)},
        records={
            "bench": {
                "bat-mass": MassReadings(readings=np.full((1, 2), SPAN * MASS + ZERO)),
                "length": LengthReadings(readings=np.full((1, 2), LENGTH + RULE)),
                "barrel-radius": LengthReadings(readings=np.full((1, 2), 0.031 + RULE)),
                "balance": LengthReadings(readings=np.full((1, 2), Z_CM + STAND)),
                "pendulum": PendulumRecord(
                    times=CLOCK * np.array([times for times, _, _ in runs]) + 4.5,
                    first_amplitude=np.array([first for _, first, _ in runs]) + AMPLITUDE,
                    last_amplitude=np.array([last for _, _, last in runs]) + AMPLITUDE,
                ),
            }
        },
        origin=Supplied(laboratory="worked by hand"),
    )


def _best(session: Session) -> dict[str, np.ndarray]:
    block = SessionBlock.of(session)
    constants = dict(block.calibration) | bench_constants(block)
    return {key: np.array(each.row(0).value) for key, each in constants.items()}


def test_the_inertia_of_an_integrated_pendulum_is_recovered(bench: Session) -> None:
    """The oracle is solve_ivp of the full equation at 0.2 rad.

    The reduction uses the amplitude at the middle of each swing, an error of second order in the
    decay. The inertia about the center of mass magnifies it 9 times, to 1e-6.
    """
    bat = bat_properties(_best(bench))
    assert isclose(bat.mass, MASS, rel_tol=1e-12)
    assert isclose(bat.length, LENGTH, rel_tol=1e-12)
    assert isclose(bat.z_cm, Z_CM, rel_tol=1e-12)
    assert isclose(bat.barrel_radius, 0.031, rel_tol=1e-12)
    assert isclose(bat.inertia_cm, INERTIA_CM, rel_tol=1e-6)


@pytest.mark.parametrize(
    "constant", ["pendulum.clock", "pendulum.amplitude_offset", "pendulum.pivot_from_knob"]
)
def test_every_correction_is_made(bench: Session, constant: str) -> None:
    """Omitting a correction shifts the inertia by more than the tolerance above."""
    best = _best(bench)
    neutral = {"clock": 1.0, "amplitude_offset": 0.0, "pivot_from_knob": 0.1501}
    wrong = best | {f"bench.{constant}": np.array(neutral[constant.split(".")[1]])}
    assert abs(bat_properties(wrong).inertia_cm / INERTIA_CM - 1) > 1e-4


def test_the_u_of_a_mean_square_follows_chi_square() -> None:
    """The mean square of 3 and 4 mm is 12.5 mm², and its u is √(2/n) of it (chi-square)."""
    log = ShotLog(ball=np.zeros(1), nominal_speed=np.ones(1), place=np.ones(1))
    marks = AimMarks(along=np.zeros(2), across=np.array([3e-3, -4e-3]))
    block = SessionBlock(
        procedure_text="",
        calibration={},
        records={"impact": {"aim": marks, "log": log}},
        owner=np.zeros(1, dtype=np.intp),
        laboratories=1,
    )
    square = across_constant(block).row(0)
    assert square.value == pytest.approx(12.5e-6, rel=1e-12)
    assert square.u == pytest.approx(12.5e-6, rel=1e-12)
    assert square.dof == 2


M, I_P, B, V, OMEGA, E0, R_BARREL, R_BALL = 0.145, 0.20, 0.55, 27.0, 14.0, 0.54, 0.033, 0.037


def constants(**changes: float) -> dict[str, np.ndarray]:
    constants = {
        "hall.air.density": 0.0,
        "hall.air.drag_coefficient": 0.0,
        "impact.gates.distance_0": 0.55,
        "impact.gates.distance_1": 0.25,
        "impact.gates.clock": 1.0,
        "impact.pivot.from_knob": 0.15,
        "impact.cannon.along": 0.0,
        "impact.encoder.scale": 1.0,
        "impact.encoder.counts_per_turn": 10_000.0,
        "impact.aim.across_square": 0.0,
        "ball.radius": R_BALL,
        "ball.restitution_slope": 0.0,
    }
    return {key: np.array(value) for key, value in (constants | changes).items()}


def worked(x: dict[str, np.ndarray]):
    d = LENGTH - 0.15 - Z_CM
    bat = BatProperties(
        mass=np.array(MASS),
        length=np.array(LENGTH),
        z_cm=np.array(Z_CM),
        inertia_cm=np.array(I_P - MASS * d**2),
        barrel_radius=np.array(R_BARREL),
    )
    balls = MeasuredBalls(
        mass=np.array([M]),
        restitution=np.array([E0]),
        speed=26.8224,
        slope=x["ball.restitution_slope"],
    )
    counts = np.array([OMEGA / (2 * pi) * 10_000])
    recoil = RateFit(
        rate=counts,
        rate_u=np.zeros(1),
        before=np.zeros(1),
        angle=np.zeros(1),
        ring_frequency=np.zeros(0),
        ring_decay=np.zeros(0),
        rest=np.zeros(1),
        residual=np.zeros(1),
        by_half=counts,
        by_half_u=np.zeros(1),
        span=np.ones(1),
        counting=0.3,
    )
    readings = ImpactReadings(
        ball=np.zeros(1, dtype=int),
        position=np.array([LENGTH - 0.15 - B]),
        flights=GateReadings(
            stage="impact",
            passages=Passages(
                times=np.array([[[0.0, 0.3 / V], [0.2 + 0.3 / 6.0, 0.2]]]),
                heights=np.full((1, 2, 2), np.nan),
                heights_u=np.zeros((1, 2, 2)),
                misfit=np.full((1, 2), np.nan),
            ),
            distances=np.array([0.5, 0.2]),
            shows_height=False,
        ),
        recoil=recoil,
        swing=None,
    )
    settings = ReductionSettings(
        reads="recoil",
        recoil="pivoted",
        pivot_from_knob=0.15,
        ball_speed=26.8224,
        turn_rate=np.zeros_like,
        window_speed=26.8224,
    )
    return shot_results(ShotResults, x, bat, balls, readings, settings)


def test_a_collision_gives_the_results_by_hand() -> None:
    """Angular momentum: I ω = m b (v + v_f); r = m b²/I; e = e_A (1 + r) + r; BPF = e/e0."""
    rebound = I_P * OMEGA / (M * B) - V
    e_A, r = rebound / V, M * B**2 / I_P
    got = worked(constants())
    assert got.speed[0] == pytest.approx(V, rel=1e-12)
    assert got.recoil_rate[0] == pytest.approx(OMEGA, rel=1e-12)
    assert got.recoil_factor[0] == pytest.approx(r, rel=1e-12)
    assert got.collision_efficiency[0] == pytest.approx(e_A, rel=1e-11)
    assert got.restitution[0] == pytest.approx(e_A * (1 + r) + r, rel=1e-11)
    assert got.bat_performance_factor[0] == pytest.approx((e_A * (1 + r) + r) / E0, rel=1e-11)
    assert got.rebound_efficiency[0] == pytest.approx(6.0 / V, rel=1e-12)
    # restitution as the ratio of relative speeds, by its definition
    assert got.restitution[0] == pytest.approx((rebound + B * OMEGA) / V, rel=1e-11)


def test_an_offset_across_the_bat_is_corrected() -> None:
    """The head-on e satisfies e cos² - sin² = measured e_A, with θ = asin(y/R)."""
    y = 5e-3
    sine2 = (y / (R_BARREL + R_BALL)) ** 2
    oblique = (I_P * OMEGA / (M * B) - V) / V
    got = worked(constants(**{"impact.aim.across_square": y**2}))
    e_A = got.collision_efficiency[0]
    assert e_A * (1 - sine2) - sine2 == pytest.approx(oblique, rel=1e-11)


def test_e_a_is_corrected_to_the_aimed_position() -> None:
    """The hit is 2 mm off, with its own lever, and e_A has a slope of 0.5 per meter: 0.001 less."""
    along = {"impact.cannon.along": 2e-3}
    beside = worked(constants(**along))
    got = worked(constants(**along, **{"procedure.place_slope": 0.5}))
    lever = B - 2e-3
    struck = I_P * OMEGA / (M * lever) / V - 1
    assert beside.collision_efficiency[0] == pytest.approx(struck, rel=1e-11)
    assert got.collision_efficiency[0] == pytest.approx(struck - 1e-3, rel=1e-11)
    assert beside.position[0] - got.position[0] == pytest.approx(2e-3, rel=1e-9)
    error = worked(constants(**{"procedure.place_slope_error": 3e-4}))
    straight = worked(constants())
    assert straight.collision_efficiency[0] - error.collision_efficiency[0] == pytest.approx(3e-4)
    # e_A for the check against the rebound: that of the struck position
    assert got.recoil_efficiency[0] == beside.recoil_efficiency[0]


def test_e_belongs_to_the_struck_position_and_the_printed_r_to_the_aimed_one() -> None:
    """Eq. (6) and r = m b²/I with b 2 mm shorter at the struck position; e_A is unchanged."""
    got, recoil = worked(constants(**{"impact.cannon.along": 2e-3})), M * (B - 2e-3) ** 2 / I_P
    e_A = got.collision_efficiency[0]
    assert got.recoil_factor[0] == pytest.approx(recoil, rel=1e-11)
    assert got.restitution[0] == pytest.approx(e_A * (1 + recoil) + recoil, rel=1e-11)
    assert got.aimed_recoil_factor[0] == pytest.approx(M * B**2 / I_P, rel=1e-11)
    e = got.lot_restitution[0]
    lot_e_A = (e - got.lot_recoil_factor[0]) / (1 + got.lot_recoil_factor[0])
    assert got.lot_collision_efficiency[0] == pytest.approx(lot_e_A, rel=1e-11)


def test_a_fast_clock_cancels_only_in_ratios() -> None:
    """A clock 1 % fast shows longer times: v and ω are 1 % higher than shown; e_A is unchanged."""
    plain, fast = worked(constants()), worked(constants(**{"impact.gates.clock": 1.01}))
    assert fast.speed[0] == pytest.approx(1.01 * V, rel=1e-12)
    assert fast.recoil_rate[0] == pytest.approx(1.01 * OMEGA, rel=1e-12)
    assert fast.collision_efficiency[0] == pytest.approx(plain.collision_efficiency[0], rel=1e-10)


def test_e0_is_corrected_to_the_speed_of_the_shot() -> None:
    """As e0 falls by 0.001 per mph, at v it is E0 - slope (26.8224 - v)."""
    slope = -0.001 / 0.44704
    got = worked(constants(**{"ball.restitution_slope": slope}))
    assert got.ball_restitution[0] == pytest.approx(E0 + slope * (V - 26.8224), rel=1e-12)
    assert got.window_ball_restitution[0] == E0
    assert got.lot_restitution[0] / E0 == pytest.approx(got.bat_performance_factor[0])


def test_columns_of_constants_are_rows_of_results() -> None:
    """Constants (k, 1) give results (k, n); each row is the result of its own constants alone."""
    x = constants()
    columns = {key: np.full((3, 1), value) for key, value in x.items()}
    columns["impact.encoder.scale"] = np.array([[1.0], [1.001], [0.999]])
    together = worked(columns)
    for row, scale in enumerate((1.0, 1.001, 0.999)):
        alone = worked(x | {"impact.encoder.scale": np.array(scale)})
        assert together.restitution[row] == pytest.approx(alone.restitution, rel=1e-14)
