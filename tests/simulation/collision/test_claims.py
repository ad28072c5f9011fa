"""The claims of Secs. III and IV of the paper about its bats, in its standard game."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pytest

from tests.simulation.collision.scenes import usual
from virtual_lab.catalog import load, load_bat
from virtual_lab.catalog.specs import BallSpec, BatBody, HoopMode
from virtual_lab.measurement.reduction import kinematics
from virtual_lab.relations.peaks import peak
from virtual_lab.relations.swing import KNOB_OFFSET, PowerLawSwing, bat_speed
from virtual_lab.simulation.collision.modal import BENDING_MODES, ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned, beam_of
from virtual_lab.units import INCH, MPH, OUNCE, OZ_IN2

Z = np.arange(2.5, 9.01, 0.1)
BALL, MASS = 90 * MPH, 5.125 * OUNCE
STIFFNESS = 3.23e6  # stiffness of the paper's ball [N/m]


@dataclass(frozen=True)
class Peaks:
    """Peak values and their positions [in]."""

    e: float
    e_at: float
    efficiency: float
    efficiency_at: float
    v_f: float  # [mph]
    v_f_at: float


@lru_cache
def peaks(name: str, exponent: float = 0.0, inertia_0: float = 1.7e4 * OZ_IN2) -> Peaks:
    body = load_bat(name).spec.body
    beam = beam_of(body)
    swing = PowerLawSwing(angular_speed_0=45, inertia_0=inertia_0, exponent=exponent)
    omega = swing.angular_speed(beam.inertia(beam.length - KNOB_OFFSET))
    v_bat = bat_speed(omega, beam.length, Z * INCH)
    e_A = (
        ModalModel.of(body, Free())
        .collide(usual(Z, relative_speed=BALL + v_bat, ball_mass=MASS, stiffness=STIFFNESS))
        .collision_efficiency
    )
    r = kinematics.recoil_factor_free(MASS, beam.mass, beam.inertia_cm, Z * INCH - beam.z_cm)
    curves = (
        kinematics.restitution_from_efficiency(e_A, r),
        e_A,
        np.asarray(kinematics.batted_speed(e_A, BALL, v_bat)) / MPH,
    )
    tops = [(float(np.max(y)), float(Z[np.argmax(y)])) for y in curves]
    return Peaks(*(value for top in tops for value in top))


def test_wood_peaks_in_the_order_of_the_paper() -> None:
    wood = peaks("r161")
    assert 5.1 < wood.e_at < 6.9  # interval between the first two nodes
    assert wood.e == pytest.approx(0.5, abs=0.01)
    assert wood.efficiency_at > wood.e_at + 0.4
    assert wood.v_f_at < wood.efficiency_at - 0.4


def test_restitution_falls_on_both_sides_of_its_peak() -> None:
    body = load_bat("r161").spec.body
    beam, z = beam_of(body), np.array([2.5, 5.25, 8.5])
    e_A = ModalModel.of(body, Free()).collide(usual(z)).collision_efficiency
    r = kinematics.recoil_factor_free(MASS, beam.mass, beam.inertia_cm, z * INCH - beam.z_cm)
    e = np.asarray(kinematics.restitution_from_efficiency(e_A, r))
    assert e[1] - e[0] > 0.1
    assert e[1] - e[2] > 0.1


def test_aluminium_beats_wood_in_the_laboratory_but_not_at_equal_swing() -> None:
    wood, aluminium = peaks("r161"), peaks("ea70")
    assert aluminium.e / wood.e - 1 == pytest.approx(0.085, abs=0.003)
    # the paper has 12 %, a claim that is lost
    assert aluminium.efficiency / wood.efficiency - 1 == pytest.approx(0.098, abs=0.005)
    assert aluminium.v_f == pytest.approx(wood.v_f, abs=0.5)


@pytest.mark.parametrize(("exponent", "lead"), [(0.25, 3.0), (0.5, 6.0)])
def test_a_lighter_swing_gives_aluminium_its_lead(exponent: float, lead: float) -> None:
    gap = peaks("ea70", exponent).v_f - peaks("r161", exponent).v_f
    assert gap == pytest.approx(lead, abs=0.4)


def test_loading_the_barrel_wins_for_any_swing_short_of_equal_energy() -> None:
    body = load_bat("barrel-loaded").spec.body
    inertia_0 = beam_of(body).inertia(body.length - KNOB_OFFSET)
    barrel = peaks("barrel-loaded", 0.0, inertia_0)
    assert barrel.e == pytest.approx(peaks("knob-loaded", 0.0, inertia_0).e, rel=0.02)
    leads = [
        peaks("barrel-loaded", n, inertia_0).v_f - peaks("knob-loaded", n, inertia_0).v_f
        for n in (0.0, 0.25, 0.45)
    ]
    assert leads[0] > leads[1] > leads[2] > 0
    assert leads[0] > 5


def test_one_laboratory_number_ranks_bats_the_wrong_way_round() -> None:
    """The knob-loaded bat has a higher e than wood, but a lower v_f at equal swing speed.

    At n = 0.5 its v_f is higher. The paper has it lower by more than 1 mph: a claim that is lost.
    """
    wood, loaded = peaks("r161"), peaks("knob-loaded")
    assert loaded.e > 1.05 * wood.e
    assert loaded.v_f < wood.v_f
    assert peaks("knob-loaded", 0.5).v_f > peaks("r161", 0.5).v_f + 2


@pytest.mark.parametrize("name", ["r161", "ea70"])
def test_the_support_changes_restitution_but_not_efficiency(name: str) -> None:
    """Free, pinned at 28 in and clamped at 33 in; the gap falls with the number of modes."""
    body, z, pin = load_bat(name).spec.body, np.linspace(3, 8, 21), 28 * INCH

    def efficiency(modes: int, support: Free | Pinned | Clamped) -> np.ndarray:
        return ModalModel.of(body, support, modes).collide(usual(z)).collision_efficiency

    gaps = {}
    for modes in (6, 8, 10, 14, BENDING_MODES, 30):
        free = efficiency(modes, Free())
        held = (efficiency(modes, Pinned(pin)), efficiency(modes, Clamped(33 * INCH)))
        gaps[modes] = [float(np.abs(one - free).max()) for one in held]
        print(f"{name}, {modes} modes: e_A pinned and clamped less free, worst", gaps[modes])
    assert max(gaps[BENDING_MODES]) < 3e-4
    assert max(gaps[6]) > max(gaps[BENDING_MODES])
    beam, free = beam_of(body), efficiency(BENDING_MODES, Free())
    r = kinematics.recoil_factor_free(MASS, beam.mass, beam.inertia_cm, z * INCH - beam.z_cm)
    e = np.asarray(kinematics.restitution_from_efficiency(free, r))
    assert np.all(e - free > 0.1)  # clamped bat: r = 0, so e = e_A


@pytest.mark.parametrize("modes", [BENDING_MODES, 30])
def test_a_soft_softball_bat_feels_its_pivot(modes: int) -> None:
    """An independent solver gave e_A = .0954 pinned and .0961 free at 6.5 in, for the hoop below.

    The number of modes does not matter. The contact lasts 1.05 ms instead of 0.6 to 0.8 ms, so the
    reaction of the handle returns before it ends. A wooden bat shows no difference.
    """
    ball = load("balls", "softball-slowpitch", BallSpec).spec
    scene = Scenes.with_ball(ball, impact_position=np.array([6.5 * INCH]), relative_speed=60 * MPH)
    gaps = {}
    for name in ("softball-34", "softball-wood-34"):
        body = load_bat(name).spec.body
        if body.hoop:
            body = replace(body, hoop=HoopMode(frequency=1800, modal_mass=0.2))
        free, held = (
            ModalModel.of(body, support, modes).collide(scene)
            for support in (Free(), Pinned(28 * INCH))
        )
        gaps[name] = float(held.collision_efficiency[0] - free.collision_efficiency[0])
        if name == "softball-34":
            assert free.contact_time[0] == pytest.approx(1.05e-3, abs=0.02e-3)
    assert gaps["softball-34"] == pytest.approx(-7e-4, abs=0.6e-4)
    assert abs(gaps["softball-wood-34"]) < 2e-5


def test_a_stiff_dull_ball_touches_twice_from_13_inches() -> None:
    """F = 1e9 u², e0 = .4, 32 mph on a free R161, against Verlet steps of .5 us over 60 modes.

    The oracle gave e_A = -.05211 in one contact at 13.2 in and -.05560 in two contacts at 13.5 in.
    """
    scenes = Scenes.of(
        impact_position=np.array([13.2, 13.5]) * INCH,
        relative_speed=np.full(2, 32 * MPH),
        ball_mass=np.full(2, MASS),
        ball_restitution=np.full(2, 0.4),
        stiffness=1e9,
        exponent=2.0,
    )
    collisions = ModalModel.of(load_bat("r161").spec.body, Free()).collide(scenes)
    assert collisions.contacts.tolist() == [1, 2]
    assert collisions.collision_efficiency == pytest.approx([-0.05211, -0.05560], abs=1e-4)


def shell_peak(body: BatBody) -> float:
    """Return the peak e of a bat at 136 mph, with a ball of e0 .5."""
    z = np.arange(2.5, 9.01, 0.5)
    beam = beam_of(body)
    scenes = usual(z, relative_speed=136 * MPH, stiffness=STIFFNESS)
    e_A = ModalModel.of(body, Free()).collide(scenes).collision_efficiency
    r = MASS * (1 / beam.mass + (z * INCH - beam.z_cm) ** 2 / beam.inertia_cm)
    return peak(z, e_A * (1 + r) + r).value


def test_a_softer_shell_makes_a_livelier_bat() -> None:
    """With the modal mass of EA70's shell, e falls with the frequency, and rises as the wall thins.

    The modal mass is that at 6 in from the tip.
    Measured hollow bats do so, too (Nathan et al., Sports Eng. 13 (2011) 153; Russell 2017).
    """
    body = load_bat("ea70").spec.body
    of_frequency = [
        shell_peak(replace(body, hoop=HoopMode(frequency=frequency, modal_mass=0.165)))
        for frequency in range(1000, 3001, 200)
    ]
    assert np.all(np.diff(of_frequency) < 0)
    of_wall = [shell_peak(body.with_wall(factor)) for factor in (1.0, 0.9, 0.8, 0.7, 0.6)]
    assert np.all(np.diff(of_wall) > 0)
    wood = shell_peak(load_bat("r161").spec.body)
    assert of_wall[0] / wood - 1 == pytest.approx(0.085, abs=0.003)
