"""Metrics by hand: one curve evaluated by every metric, correction and swing law."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.measurement.procedure import Curve, Procedure, metric_of
from virtual_lab.measurement.procedure.metric import field_speeds
from virtual_lab.measurement.procedure.rules import BallCorrection
from virtual_lab.measurement.reduction.kinematics import restitution_of_standard_ball
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.relations.peaks import peak

INCH, MPH, OUNCE = 0.0254, 0.44704, 0.028349523125
OZ_IN2 = OUNCE * INCH**2
F1881, ASA, BESR, MODIFIED, BBCOR, PROPOSED = (
    catalog.load("procedures", name, Procedure).spec
    for name in ("astm-f1881", "asa", "ncaa-besr", "ncaa-modified", "bbcor", "proposed")
)
# R161 of the paper: 34 in, 31 oz, balance point 11.3 in from the tip, 2539 oz in² about it
BAT = BatProperties(
    mass=np.array(31 * OUNCE),
    length=np.array(34 * INCH),
    z_cm=np.array(11.3 * INCH),
    inertia_cm=np.array(2539 * OZ_IN2),
    barrel_radius=np.array(np.nan),
)


def curve(e_A: float, r: float, e0: float, place: float = 6 * INCH) -> Curve:
    """Return a curve with one position, its e by Eq. (6) written out."""
    numbers = [place, e_A, r, e_A * (1 + r) + r, e0]
    return Curve(**dict(zip(Curve.__dataclass_fields__, map(np.atleast_1d, numbers), strict=True)))


def of(procedure: Procedure, at: Curve, **options) -> float:
    return float(metric_of(procedure, **options)(at, BAT)[0])


def test_each_metric_of_one_collision_is_that_by_hand() -> None:
    """e_A 0.2 and r 0.25: e = 0.2 x 1.25 + 0.25 = 0.5, BPF = 0.5/0.5 = 1, BESR = 0.7."""
    at = curve(0.2, 0.25, 0.5)
    assert of(BBCOR, at) == pytest.approx(0.5, rel=1e-14)
    assert of(F1881, at) == pytest.approx(1.0, rel=1e-14)
    assert of(BESR, at) == pytest.approx(0.7, rel=1e-14)
    # Eq. (3) with the speeds of the test: 0.2 x 70 + 1.2 x 66 mph, 6 in from the tip
    assert of(MODIFIED, at) / MPH == pytest.approx(14 + 79.2, rel=1e-12)


def test_the_ncaa_limit_is_97_miles_an_hour() -> None:
    """70 and 66 mph with e_A 0.228: BESR 0.728; 0.228 x 136 + 66 = 97.008 mph."""
    at = curve(0.228, 0.22, 0.5)
    assert of(BESR, at) == pytest.approx(0.728, rel=1e-12)
    assert of(MODIFIED, at) / MPH == pytest.approx(97.008, rel=1e-12)
    # BESR from that speed: (v_f + (v_p - v_b)/2)/(v_p + v_b)
    back = (97 + (70 - 66) / 2) / 136
    assert back == pytest.approx(0.728, abs=5e-4)


def test_the_bat_speed_is_proportional_to_the_distance_from_the_axis() -> None:
    """The axis is 6 in from the knob of a 34 in bat, so the speed is 66 mph x (28 - z)/22."""
    for z in (3, 6, 9):
        pitch, swing = field_speeds(BESR, np.array([z * INCH]), BAT)
        assert pitch / MPH == pytest.approx(70, rel=1e-12)
        assert swing[0] / MPH == pytest.approx(66 * (28 - z) / 22, rel=1e-12)


def test_the_standard_game_conditions_are_those_by_hand() -> None:
    """A bat of the reference inertia turns at 45 rad/s, which is 69.03 mph 27 in from the axis."""
    game = PROPOSED.game
    assert game is not None
    about = 2539 + 31 * (33 - 11.3) ** 2  # inertia by hand [oz in²]
    changed_game = replace(game, reference_inertia=about * OZ_IN2)
    pitch, swing = field_speeds(replace(PROPOSED, game=changed_game), np.array([6 * INCH]), BAT)
    assert pitch / MPH == pytest.approx(90, rel=1e-12)
    assert swing[0] / MPH == pytest.approx(69.03, abs=0.01)
    _, scaled = field_speeds(PROPOSED, np.array([6 * INCH]), BAT)
    assert scaled[0] / swing[0] == pytest.approx((17_000 / about) ** 0.3, rel=1e-12)


def test_a_softball_swing_speed_falls_with_the_fourth_root_of_the_mass() -> None:
    """60 mph at any position with 30 oz, (30/31)^¼ of it with 31 oz; the pitch is 10 mph."""
    for z in (4 * INCH, 8 * INCH):
        pitch, swing = field_speeds(ASA, np.array([z]), BAT)
        assert pitch / MPH == pytest.approx(10, rel=1e-12)
        assert swing[0] / MPH == pytest.approx(60 * (30 / 31) ** 0.25, rel=1e-12)
    at = curve(0.1, 0.3, 0.45)
    by_hand = 0.1 * 10 + 1.1 * 60 * (30 / 31) ** 0.25
    assert of(ASA, at) / MPH == pytest.approx(by_hand, rel=1e-12)


def corrected(method: str, e: float, e0: float, *, standard: float = 0.5, **options) -> float:
    """Return e corrected to the standard ball; r does not matter."""
    rules = replace(BBCOR, correction=BallCorrection(method=method, standard=standard))
    return of(rules, curve((e - 0.25) / 1.25, 0.25, e0), **options)


def test_corrections_for_a_ball_with_low_e0_agree_with_hand_calculations() -> None:
    """For e 0.50 and e0 0.49: +0.0102 by the ratio, +0.0097 by the stiffness of the shell."""
    assert corrected("none", 0.5, 0.49) == pytest.approx(0.5, rel=1e-12)
    assert corrected("ratio", 0.5, 0.49) - 0.5 == pytest.approx(0.5 / 49, rel=1e-12)
    assert corrected("ratio", 0.5, 0.49) - 0.5 == pytest.approx(0.0102, abs=5e-5)
    stiffer = (1 - 0.25) / (0.25 - 0.49**2)
    sprung = sqrt((0.25 * stiffer + 1) / (stiffer + 1))
    assert corrected("trampoline", 0.5, 0.49) == pytest.approx(sprung, rel=1e-12)
    assert sprung - 0.5 == pytest.approx(0.0097, abs=5e-5)
    assert corrected("control-bat", 0.5, 0.49, control_ratio=np.array(0.98)) == pytest.approx(
        0.5 / 0.98
    )


@pytest.mark.parametrize(
    ("e0", "bpf"), [(0.45, 1.222), (0.50, 1.173), (0.525, 1.153), (0.55, 1.135)]
)
def test_the_trampoline_correction_is_exact_for_a_shell_seven_times_stiffer(
    e0: float, bpf: float
) -> None:
    """e² = (7 e0² + 1)/8: BPF of four balls, and e of each ball computed from each other ball."""
    e = sqrt((7 * e0**2 + 1) / 8)
    assert e / e0 == pytest.approx(bpf, abs=6e-4)
    for other in (0.45, 0.50, 0.525, 0.55):
        expected = sqrt((7 * other**2 + 1) / 8)
        assert restitution_of_standard_ball(e, e0, other) == pytest.approx(expected, rel=1e-12)


def test_for_a_rigid_shell_both_corrections_agree() -> None:
    """A rigid shell has e = e0 less its bending loss, so the trampoline correction is the ratio."""
    assert restitution_of_standard_ball(0.45, 0.50, 0.48) == pytest.approx(0.45 * 0.96, rel=1e-12)
    both = restitution_of_standard_ball(np.array([0.499999, 0.500001]), 0.5, 0.48)
    assert both == pytest.approx(0.48, abs=5e-6)  # continuity of the two formulas


def test_the_peak_of_a_sine_is_inside_and_of_a_line_at_its_end() -> None:
    """A sine's maximum lies between two points, with an error of h⁴; a line's is at its end."""
    places = np.linspace(0.08, 0.22, 41)
    wave = np.sin((places - 0.0713) * 20)
    top = 0.0713 + np.pi / 40
    h = (places[1] - places[0]) * 20
    top_of_wave = peak(places, wave)
    assert top_of_wave.value == pytest.approx(1, abs=h**4)
    assert top_of_wave.place == pytest.approx(top, abs=h**3 / 20)
    assert peak(places, -places) == pytest.approx((-0.08, 0.08))
    assert peak(places, places) == pytest.approx((0.22, 0.22))
