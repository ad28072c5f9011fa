"""The true outcome of an impact, against the equations of the paper written out here."""

from dataclasses import replace

import numpy as np
import pytest

from tests.rigs.conformance import _Modal
from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.physics.beam import Pinned, beam_of
from virtual_lab.simulation.physics.truth import TrueOutcome, draw_balls, make_bat
from virtual_lab.simulation.stations.impact import (
    rebound_velocity,
    true_outcome,
    wall_restitution,
)
from virtual_lab.simulation.stations.rig import ShotPlan, Specimen
from virtual_lab.streams import Quiet

INCH = 0.0254
PLACES = np.array([0.2, 1.0, 4.0, 6.0, 8.0, 12.0, 18.0]) * INCH
FROM_KNOB = 6 * INCH


def specimen_of(bat: str) -> Specimen:
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    return Specimen(
        bat=make_bat(catalog.load_bat(bat).spec, Quiet()),
        balls=draw_balls(ball, 3, Quiet()),
        collision=_Modal(),
    )


def truth_of(specimen: Specimen) -> TrueOutcome:
    first = np.zeros(PLACES.size, dtype=int)
    speed = np.full(PLACES.size, 40.0)
    plan = ShotPlan(slot=np.arange(PLACES.size), ball=first, speed=speed, place=PLACES)
    support = Pinned(specimen.bat.body.length - FROM_KNOB)
    return true_outcome(plan, specimen, support, FROM_KNOB)


@pytest.mark.parametrize("bat", ["r161", "ea70", "barrel-loaded", "knob-loaded"])
def test_the_rigid_modes_give_equations_6_8_and_9(bat: str) -> None:
    """R by (8) and (9) from the beam's mass and inertia, e by (6); both from one impulse."""
    specimen = specimen_of(bat)
    true, beam = truth_of(specimen), beam_of(specimen.bat.body)
    m, M, I = specimen.balls.spec.mass, beam.mass, beam.inertia_cm  # noqa: E741
    axis = beam.length - FROM_KNOB
    free = m * (1 / M + (PLACES - beam.z_cm) ** 2 / I)
    pivoted = m * (PLACES - axis) ** 2 / (I + M * (beam.z_cm - axis) ** 2)
    assert true.free.recoil_factor == pytest.approx(free, rel=1e-12)
    assert true.pivoted.recoil_factor == pytest.approx(pivoted, rel=1e-12)
    for r, rigid in ((free, true.free), (pivoted, true.pivoted)):
        by_equation_6 = true.collision_efficiency * (1 + r) + r
        assert rigid.restitution == pytest.approx(by_equation_6, rel=1e-12)


def test_a_hoop_mode_does_not_recoil() -> None:
    """A ringing shell takes speed from the ball, but its motion is no recoil of the bat."""
    specimen = specimen_of("ea70")
    bare = replace(specimen.bat, bodies=(replace(specimen.bat.body, hoop=None),))
    with_shell, without = truth_of(specimen), truth_of(replace(specimen, bat=bare))
    assert with_shell.free.recoil_factor == pytest.approx(without.free.recoil_factor, rel=1e-12)
    assert np.abs(with_shell.collision_efficiency - without.collision_efficiency).max() > 0.01


@pytest.mark.parametrize(("exponent", "stiffness"), [(1.0, 3.5e6), (1.5, 1e8), (2.0, 1e9)])
def test_a_ball_followed_off_a_wall_has_its_restitution(exponent: float, stiffness: float) -> None:
    scenes = Scenes.of(
        impact_position=0.15,
        relative_speed=[20.0, 40.0, 60.0, 60.0],
        ball_mass=0.145,
        ball_restitution=[0.3, 0.5, 0.55, 0.99],
        stiffness=stiffness,
        exponent=exponent,
    )
    assert wall_restitution(scenes) == pytest.approx(scenes.ball_restitution, rel=1e-13)


def test_the_work_of_a_wall_contact_is_the_kinetic_energy() -> None:
    """The work up to the peak, k u²/2, equals m v²/2."""
    contact = wall_contact(*(np.array(x) for x in (0.145, 50.0, 3.5e6, 1.0, 0.5)))
    work = 3.5e6 * contact.compression**2 / 2
    assert work == pytest.approx(0.145 * 50.0**2 / 2, rel=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 0.05, 0.4])
def test_a_tilted_hit_keeps_the_speed_along_the_surface(tilt: float) -> None:
    """In the bat's frame e_A applies to the normal speed; the tangential speed is unchanged."""
    efficiency, speed = np.array([0.2, -0.1]), 40.0
    back, slope = rebound_velocity(efficiency, np.array(tilt), np.array(speed), 3.0)
    normal = np.array([-np.cos(tilt), np.sin(tilt)])  # bat to ball; ball along +x
    surface = np.array([np.sin(tilt), np.cos(tilt)])
    for e, x, rise in zip(efficiency, back, slope, strict=True):
        velocity = e * speed * np.cos(tilt) * normal + speed * np.sin(tilt) * surface
        assert -velocity[0] + 3.0 == pytest.approx(x, rel=1e-12)
        assert velocity[1] / x == pytest.approx(rise, rel=1e-12)


@pytest.mark.parametrize(("sd", "loss"), [(0.03, 0.0003), (0.05, 0.0009), (0.10, 0.0037)])
def test_scatter_across_the_axis_lowers_bpf_as_computed_by_hand(sd: float, loss: float) -> None:
    """Mean over a normal scatter [in] by Gauss-Hermite quadrature; radii 1.45 in and 1.25 in."""
    x, weight = np.polynomial.hermite_e.hermegauss(20)
    tilt = np.arcsin(sd * x / (1.45 + 1.25))
    back, _ = rebound_velocity(np.full(20, 0.2), tilt, np.ones(20), 0.0)
    lost = 0.2 - float(weight @ back / weight.sum())
    bpf = lost * (1 + 0.22) / 0.5  # change of BPF by Eqs. (5) and (6), with r = 0.22 and e0 = 0.5
    assert bpf == pytest.approx(loss, rel=0.15, abs=7e-5)
