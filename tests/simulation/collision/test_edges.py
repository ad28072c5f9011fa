"""Extreme scenes: tip, center of mass, soft and stiff balls, slow and grazing hits."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from tests.simulation.collision.scenes import scattered, usual
from tests.simulation.physics.bodies import rod
from virtual_lab.catalog import load_bat
from virtual_lab.catalog.specs import BatBody, HoopMode
from virtual_lab.errors import InputError
from virtual_lab.measurement.reduction.kinematics import energy_fractions
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.collision.scene import Collisions, Scenes
from virtual_lab.simulation.collision.stepping import OneByOne
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned, Support, beam_of
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.units import INCH

WOOD, ALUMINIUM = load_bat("r161").spec.body, load_bat("ea70").spec.body
FREE = Free()
BODIES = pytest.mark.parametrize("body", [WOOD, ALUMINIUM], ids=["wood", "aluminium"])
FEW_MODES = 8  # number of modes where the reference is compared, which is slow
QUICK = {"tolerance": 1e-10, "longest_step": 1.0}  # settings of the reference, as in test_reference


@lru_cache
def model_of(body: BatBody, support: Support = FREE) -> ModalModel:
    return ModalModel.of(body, support)


def one_by_one(model: ModalModel, scenes: Scenes) -> Collisions:
    return replace(model, stepper=OneByOne()).collide(scenes)


def holds(body: BatBody, scenes: Scenes, support: Support = FREE) -> Collisions:
    """Assert agreement with one-by-one stepping and closure of energy; return the collisions."""
    model = model_of(body, support)
    collisions, slow = model.collide(scenes), one_by_one(model, scenes)
    gap = collisions.collision_efficiency - slow.collision_efficiency
    assert np.abs(gap).max() < 1e-6
    assert np.abs(total(collisions) - 1).max() < 1e-6
    assert np.array_equal(collisions.contacts, slow.contacts)
    return collisions


def holds_to_the_reference(body: BatBody, scenes: Scenes, support: Support = FREE) -> None:
    modes = modes_of(body, support, FEW_MODES)
    collisions = ModalModel(modes=modes, stiff=modes.above(FEW_MODES)).collide(scenes)
    truth = ReferenceModel(modes=modes, **QUICK).collide(scenes)
    assert collisions.collision_efficiency == pytest.approx(truth.collision_efficiency, abs=1e-6)
    assert np.array_equal(collisions.contacts, truth.contacts)


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
    holds_to_the_reference(body, scenes.part(slice(5)))


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


def test_a_clamped_bat_agrees_with_the_reference() -> None:
    holds_to_the_reference(WOOD, scattered(5, 2, 20, seed=4), Clamped(31 * INCH))


@BODIES
def test_a_bat_lighter_than_the_ball_is_swept_along(body: BatBody) -> None:
    scenes = scattered(150, 0.5, 30, seed=4)
    collisions = holds(light(body), scenes)
    assert collisions.collision_efficiency.max() < 0
    holds_to_the_reference(light(body), scenes.part(slice(5)))


@BODIES
def test_a_ball_ten_times_stiffer_agrees_with_the_slow_steps(body: BatBody) -> None:
    scenes = scattered(150, 0.5, 30, seed=5)
    scenes = replace(scenes, stiffness=10 * scenes.stiffness)
    collisions = holds(body, scenes)
    assert (collisions.contacts > 2).any() or (collisions.reloads > 2).any()
    holds_to_the_reference(body, scenes.part(slice(4)))


@BODIES
def test_a_ball_a_hundred_times_stiffer_with_four_contacts_agrees_with_the_slow_steps(
    body: BatBody,
) -> None:
    """Each contact enlarges the error of the last, so two finer tries may agree and be wrong."""
    scenes = usual([1.0, 4.0, 6.5], stiffness=3.5e8, ball_restitution=0.45)
    contacts = holds(body, scenes).contacts
    assert contacts.max() > (3 if body is WOOD else 1)


@pytest.mark.parametrize("turns", [0.5, 0.8, 1.0, 1.25, 2.0])
def test_a_hoop_mode_with_a_period_near_the_contact_time_agrees_with_the_slow_steps(
    turns: float,
) -> None:
    ball = usual(6.0)
    time = wall_contact(
        ball.ball_mass, ball.relative_speed, ball.stiffness, ball.exponent, ball.ball_restitution
    ).time[0]
    hoop = HoopMode(frequency=turns / float(time), modal_mass=0.1)
    body = replace(ALUMINIUM, hoop=hoop)
    collisions = holds(body, scattered(100, 0.5, 30, seed=8))
    assert collisions.energy.hoop.max() > 0.05
    holds_to_the_reference(body, usual([6.0, 20.0]))


def test_a_grazing_second_contact_agrees_with_the_slow_steps() -> None:
    """The scenes have two contacts, and the first try was in doubt."""
    model = model_of(WOOD)
    many = scattered(1500, 13, 17, seed=11)
    collisions = model.collide(many)
    grazing = np.flatnonzero((collisions.redone >= 1) & (collisions.contacts == 2))
    assert len(grazing) > 20
    assert {1, 3} <= set(collisions.redone[grazing])
    holds(WOOD, many.part(grazing))
    # scenes in which finer steps did not agree, so they were followed one by one
    hard = grazing[collisions.redone[grazing] == 3][:3]
    bare = replace(model, stiff=model.stiff.above(model.stiff.count))
    reference = ReferenceModel(modes=model.modes, **QUICK)
    truth = reference.collide(many.part(hard))
    assert bare.collide(many.part(hard)).collision_efficiency == pytest.approx(
        truth.collision_efficiency, abs=1e-6
    )


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
    for collisions in (model.collide(scenes), one_by_one(model, scenes)):
        wall = rigid.collide(scenes)
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
@pytest.mark.parametrize("e0", [0.2, 0.999, 1.0])
def test_very_low_and_very_high_e0_agree_with_the_slow_steps(body: BatBody, e0: float) -> None:
    scenes = with_all(scattered(150, 0.5, 30, seed=7), ball_restitution=e0)
    collisions = holds(body, scenes)
    if e0 == 1:
        assert not collisions.energy.hysteresis.any()
    elif e0 > 0.9:
        assert 0 < collisions.energy.hysteresis.min() <= collisions.energy.hysteresis.max() < 2.1e-3
    holds_to_the_reference(body, scenes.part(slice(3)))


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
