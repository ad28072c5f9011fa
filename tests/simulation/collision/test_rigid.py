"""The rigid model against closed forms, and as the limit of the modal model."""

import numpy as np
import pytest

from tests.simulation.collision.scenes import usual
from tests.simulation.physics.bodies import rigid_rod, rod
from virtual_lab.catalog.specs import BatBody, HoopMode
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned

# rod light enough to recoil and too stiff to bend: bending above 100 kHz
STIFF = rod((0.04, 0.04), density=800.0, youngs_modulus=1e17, shear_modulus=4e16)


def mass_of(body: BatBody) -> float:
    return body.material.density * np.pi / 4 * body.profile.outer_diameter[0] ** 2


def test_struck_at_its_centre_a_free_rod_gives_the_textbook_answer() -> None:
    r = 0.145 / mass_of(rod())
    result = RigidModel.of(rod(), Free()).collide(usual(5.0, impact_position=0.5, ball_mass=0.145))
    assert result.collision_efficiency == pytest.approx((0.5 - r) / (1 + r), rel=1e-10)
    assert result.modal_velocities[0, 0] ** 2 / 2 == pytest.approx(
        result.impulse[0] ** 2 / (2 * mass_of(rod())), rel=1e-10
    )


def test_clamped_bat_is_a_wall() -> None:
    result = RigidModel.of(rod(), Clamped(1.0)).collide(usual([3.0, 20.0]))
    assert result.collision_efficiency == pytest.approx([0.5, 0.5])
    assert result.modal_velocities.shape == (2, 0)


@pytest.mark.parametrize("support", [Free(), Pinned(0.8)])
def test_the_modal_model_tends_to_the_rigid_one_as_the_bat_stiffens(support: Free | Pinned) -> None:
    scenes = usual([2.0, 6.0, 15.0], exponent=1.5, stiffness=3e7, ball_restitution=[0.4, 0.5, 1])
    rigid = RigidModel.of(STIFF, support).collide(scenes)
    modal = ModalModel.of(STIFF, support, 4).collide(scenes)
    assert modal.collision_efficiency == pytest.approx(rigid.collision_efficiency, abs=1e-4)
    assert modal.contact_time == pytest.approx(rigid.contact_time, rel=1e-3)
    assert modal.energy.hysteresis == pytest.approx(rigid.energy.hysteresis, abs=1e-4)
    assert modal.energy.rigid == pytest.approx(rigid.energy.rigid, abs=1e-4)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("e0", [0.3, 0.5, 1.0])
def test_on_a_wall_the_ball_keeps_its_own_restitution_and_time(e0: float, exponent: float) -> None:
    scenes = usual(12.0, ball_restitution=e0, exponent=exponent)
    wall = wall_contact(
        scenes.ball_mass, scenes.relative_speed, scenes.stiffness, scenes.exponent, np.array(e0)
    )
    result = ModalModel.of(rigid_rod(), Free()).collide(scenes)
    assert result.collision_efficiency == pytest.approx(e0, abs=1e-7)
    assert result.contact_time == pytest.approx(wall.time, rel=1e-6)
    assert (result.contacts[0], result.reloads[0]) == (1, 0)


def test_a_stiff_shell_on_a_wall_stores_energy_the_ball_would_lose() -> None:
    """e² tends to (e0² R + 1) / (R + 1), R = k_shell / k_ball, as the hoop frequency rises.

    Below about 16 kHz the gap varies with the phase of the shell. Above, the shell rings less and
    less, and the gap falls with the square of the frequency.
    """
    e0, ratio, k = 0.5, 5.0, 3.5e6
    quasi_static = np.sqrt((e0**2 * ratio + 1) / (ratio + 1))
    frequencies, gaps = (3.2e4, 6.4e4, 12.8e4), []
    for frequency in frequencies:
        mass = ratio * k / (2 * np.pi * frequency) ** 2
        body = rigid_rod(HoopMode(frequency=frequency, modal_mass=mass))
        e = ModalModel.of(body, Free(), 4).collide(usual(12.0)).collision_efficiency[0]
        gaps.append(abs(e - quasi_static))
    orders = np.diff(np.log(gaps)) / np.diff(np.log(frequencies))
    assert gaps[-1] < 2e-4
    assert orders == pytest.approx([-2, -2], abs=0.3)


def test_shares_of_energy_add_to_one() -> None:
    e = RigidModel.of(rod(), Pinned(0.8)).collide(usual([1.0, 8.0])).energy
    assert e.ball + e.rigid + e.bending + e.hoop + e.hysteresis == pytest.approx([1, 1])
