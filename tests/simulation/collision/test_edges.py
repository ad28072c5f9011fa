"""Extreme scenes: tip, center of mass, soft and stiff balls, slow and grazing hits."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from tests.simulation.collision.scenes import scattered, usual
from tests.simulation.physics.bodies import rod
from tests.studies.paper.equations import energy_fractions
from virtual_lab.catalog import load_bat
from virtual_lab.catalog.specs import BatBody
from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.collision.scene import Collisions, Scenes
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned, Support, beam_of
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.units import INCH

WOOD, ALUMINIUM = load_bat("r161").spec.body, load_bat("ea70").spec.body
FREE = Free()
BODIES = pytest.mark.parametrize("body", [WOOD, ALUMINIUM], ids=["wood", "aluminium"])


@lru_cache
def model_of(body: BatBody, support: Support = FREE) -> ModalModel:
    return ModalModel.of(body, support)


def holds(body: BatBody, scenes: Scenes, support: Support = FREE) -> Collisions:
    """Assert that the energy closes, and return the collisions."""
    collisions = model_of(body, support).collide(scenes)
    assert np.abs(total(collisions) - 1).max() < 1e-6
    return collisions


def total(collisions: Collisions) -> np.ndarray:
    return np.asarray(collisions.energy.total)


def with_all(scenes: Scenes, **changes: float) -> Scenes:
    """Return the scenes with the given values in every scene."""
    return replace(scenes, **{name: np.full(len(scenes), value) for name, value in changes.items()})


def light(body: BatBody, share: float = 1 / 20) -> BatBody:
    return replace(body, material=replace(body.material, density=share * body.material.density))


@BODIES
def test_at_the_tip_the_ball_carries_on(body: BatBody) -> None:
    scenes = scattered(200, 0.0, 0.6, seed=1)
    collisions = holds(body, scenes)
    assert collisions.collision_efficiency.max() < 0
    assert (collisions.contacts > 1).any()
    assert holds(body, usual([0.0])).collision_efficiency[0] < -0.19


@BODIES
def test_at_the_centre_of_mass_a_free_bat_does_not_turn(body: BatBody) -> None:
    beam = beam_of(body)
    scenes = with_all(scattered(100, 1, 2, seed=2), impact_position=beam.z_cm)
    collisions, model = holds(body, scenes), model_of(body)
    spin = collisions.modal_velocities[:, :2] @ model.modes.rotation(beam.z_cm)[:2]
    heave = collisions.impulse / beam.mass
    assert np.abs(spin * beam.length / heave).max() < 1e-9
    assert collisions.energy.rigid == pytest.approx(
        heave**2 * beam.mass / (scenes.ball_mass * scenes.relative_speed**2), rel=1e-9
    )


@BODIES
@pytest.mark.parametrize("z", [20.0, 33.0])
def test_a_clamped_bat_takes_no_rigid_energy(body: BatBody, z: float) -> None:
    """A clamped bat does not recoil (r = 0); only bending and the hoop mode lower e_A."""
    collisions = holds(body, scattered(150, 0.5, z - 1, seed=3), Clamped(z * INCH))
    assert not collisions.energy.rigid.any()
    close = usual(z - 0.3, ball_restitution=0.5)
    near_wall = holds(body, close, Clamped(z * INCH)).collision_efficiency[0]
    assert near_wall == pytest.approx(0.5, abs=0.1)


@BODIES
def test_a_bat_lighter_than_the_ball_is_swept_along(body: BatBody) -> None:
    scenes = scattered(150, 0.5, 30, seed=4)
    collisions = holds(light(body), scenes)
    assert collisions.collision_efficiency.max() < 0


@BODIES
def test_the_e_a_of_a_linear_ball_does_not_depend_on_speed(body: BatBody) -> None:
    scenes = with_all(scattered(100, 0.5, 30, seed=6), exponent=1.0, stiffness=3.5e6)
    fast = holds(body, scenes).collision_efficiency
    for speed in (1e-6, 1e-9):
        slow = holds(body, with_all(scenes, relative_speed=speed))
        assert slow.collision_efficiency == pytest.approx(fast, abs=1e-6)


@BODIES
def test_a_slow_hard_ball_finds_a_bat_rigid(body: BatBody) -> None:
    """At 1 µm/s the contact lasts over 50 ms; e_A and energy are those of a rigid bat."""
    scenes = usual([5.0, 15.0], relative_speed=1e-6, exponent=2.0, stiffness=3e8)
    model, rigid = model_of(body), RigidModel.of(body, Free())
    collisions, wall = model.collide(scenes), rigid.collide(scenes)
    assert collisions.contact_time.min() > 0.05
    assert collisions.contact_time == pytest.approx(wall.contact_time, rel=1e-2)
    assert collisions.collision_efficiency == pytest.approx(wall.collision_efficiency, abs=1e-3)
    assert collisions.energy.hysteresis == pytest.approx(wall.energy.hysteresis, abs=1e-3)
    assert collisions.energy.bending.max() < 1e-4
    assert np.abs(total(collisions) - 1).max() < 1e-6


def test_a_ball_at_rest_is_refused() -> None:
    for speed in (0.0, -0.0, -1.0):
        with pytest.raises(InputError, match=r"scenes: relative_speed = .*; allowed: 1e-09 to"):
            usual([5.0], relative_speed=speed)


@BODIES
@pytest.mark.parametrize("e0", [0.999, 1.0])
def test_a_ball_of_high_e0_loses_little_energy(body: BatBody, e0: float) -> None:
    scenes = with_all(scattered(150, 0.5, 30, seed=7), ball_restitution=e0)
    collisions = holds(body, scenes)
    if e0 == 1:
        assert not collisions.energy.hysteresis.any()
    else:
        assert 0 < collisions.energy.hysteresis.min() <= collisions.energy.hysteresis.max() < 2.1e-3


@pytest.mark.parametrize("support", [Free(), Pinned(0.8)])
@pytest.mark.parametrize("e0", [0.2, 0.5, 0.999, 1.0])
def test_the_shares_of_a_stiff_bat_are_those_of_the_paper(support: Support, e0: float) -> None:
    """The shares of energy of a bat that does not bend are those of Eqs. (10)."""
    body = rod((0.04, 0.04), density=800.0, youngs_modulus=1e17, shear_modulus=4e16)
    scenes = usual([2.0, 6.0, 15.0], exponent=1.5, stiffness=3e7, ball_restitution=e0)
    modes = modes_of(body, support, 0)
    r = scenes.ball_mass * np.sum(modes.shape(scenes.impact_position) ** 2, axis=1)
    fractions = energy_fractions(np.full(3, e0), r)
    energy = ModalModel.of(body, support, 4).collide(scenes).energy
    assert energy.ball == pytest.approx(fractions.ball, abs=1e-4)
    assert energy.rigid == pytest.approx(fractions.bat, abs=1e-4)
    # energy of bending and hysteresis together
    rest = energy.hysteresis + energy.bending
    assert rest == pytest.approx(fractions.dissipated, abs=1e-4)
