"""The modal model: conservation laws, symmetry and independence of the support."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson

from tests.simulation.collision.scenes import scattered, usual
from virtual_lab.catalog import load_bat
from virtual_lab.catalog.specs import BatBody, Lump
from virtual_lab.measurement.reduction import kinematics
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.patch import patch_shape
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned, Support, beam_of
from virtual_lab.units import INCH

WOOD, ALUMINIUM = load_bat("r161").spec.body, load_bat("ea70").spec.body
PIVOT = 28 * INCH
BARREL = np.linspace(3, 8, 11)


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
@pytest.mark.parametrize("support", [Free(), Pinned(PIVOT), Pinned(PIVOT, 1e6), Clamped(31 * INCH)])
def test_the_shares_of_energy_add_up_to_one(body: BatBody, support: Support) -> None:
    # hysteresis: computed from the area of the force law, not as the remainder
    result = ModalModel.of(body, support).collide(scattered(60, 0.5, 24, seed=1))
    e = result.energy
    assert np.abs(e.ball + e.rigid + e.bending + e.hoop + e.hysteresis - 1).max() < 1e-6
    assert e.hoop.max() > 1e-4 if body.hoop else not e.hoop.any()


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
def test_a_free_bat_takes_the_momentum_of_the_ball(body: BatBody) -> None:
    model, beam = ModalModel.of(body, Free()), beam_of(body)
    scenes = scattered(60, 0.5, 30, seed=2)
    result = model.collide(scenes)
    # momentum of all nodes, with bending, against the change of the ball's momentum
    count = model.modes.deflections.shape[1]
    field = (
        result.modal_velocities[:, :count]
        @ np.concatenate((model.modes.deflections, model.modes.rotations)).T
    )
    impulse = scenes.ball_mass * scenes.relative_speed * (1 + result.collision_efficiency)
    assert field @ beam.mass_matrix @ beam.heave() == pytest.approx(impulse, rel=1e-9)
    lever = beam.z_cm - scenes.impact_position
    turning = field @ beam.mass_matrix @ beam.turn(beam.z_cm)
    assert turning == pytest.approx(impulse * lever, rel=1e-9, abs=1e-10)


def test_a_pinned_bat_takes_the_angular_momentum_about_the_pin() -> None:
    model, I_p = ModalModel.of(WOOD, Pinned(PIVOT)), beam_of(WOOD, Pinned(PIVOT)).inertia(PIVOT)
    scenes = scattered(60, 0.0, 24, seed=3)  # scenes at the tip, where the patch is shorter
    result = model.collide(scenes)
    omega = result.modal_velocities[:, 0] * model.modes.rotation(PIVOT)[0]
    lever = PIVOT - scenes.impact_position
    v_f = kinematics.rebound_speed_from_recoil(
        I_p, omega, scenes.ball_mass, lever, scenes.relative_speed
    )
    assert v_f / scenes.relative_speed == pytest.approx(result.collision_efficiency, abs=1e-12)


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
def test_efficiency_does_not_depend_on_the_support_at_the_knob(body: BatBody) -> None:
    free, pinned, clamped = (
        ModalModel.of(body, support, 40).collide(usual(BARREL)).collision_efficiency
        for support in (Free(), Pinned(28 * INCH), Clamped(33 * INCH))
    )
    assert np.abs(pinned - free).max() < 3e-4
    assert np.abs(clamped - free).max() < 3e-4


def test_rigid_and_vibrational_energy_sum_to_the_same_whatever_the_support() -> None:
    sums, rigid = [], []
    for support in (Free(), Pinned(28 * INCH), Clamped(33 * INCH)):
        e = ModalModel.of(WOOD, support, 40).collide(usual(BARREL)).energy
        sums.append(e.rigid + e.bending)
        rigid.append(e.rigid)
    assert np.abs(np.array(sums[1:]) - sums[0]).max() < 3e-4
    assert np.abs(rigid[1] - rigid[0]).max() > 0.02


def test_a_turned_bat_is_the_same_bat() -> None:
    profile = WOOD.profile
    turned = replace(
        WOOD,
        profile=replace(
            profile,
            z=tuple(WOOD.length - z for z in reversed(profile.z)),
            outer_diameter=tuple(reversed(profile.outer_diameter)),
        ),
    )
    scenes = usual([1.0, 5.0, 12.0, 20.0])
    mirrored = replace(scenes, impact_position=WOOD.length - scenes.impact_position)
    one = ModalModel.of(WOOD, Free()).collide(scenes)
    two = ModalModel.of(turned, Free()).collide(mirrored)
    assert one.collision_efficiency == pytest.approx(two.collision_efficiency, abs=1e-7)


def test_with_a_linear_ball_nothing_depends_on_the_speed() -> None:
    slow, fast = (
        ModalModel.of(ALUMINIUM, Free()).collide(usual(BARREL, relative_speed=v)) for v in (20, 80)
    )
    assert slow.collision_efficiency == pytest.approx(fast.collision_efficiency, abs=1e-10)
    assert 4 * slow.modal_velocities == pytest.approx(fast.modal_velocities, rel=1e-6, abs=1e-7)
    harder = usual(BARREL, relative_speed=80, exponent=1.5, stiffness=3e7)
    softer = replace(harder, relative_speed=harder.relative_speed / 4)
    gap = np.subtract(
        *(
            ModalModel.of(ALUMINIUM, Free()).collide(s).collision_efficiency
            for s in (harder, softer)
        )
    )
    assert np.abs(gap).max() > 1e-3


def test_an_added_weight_far_from_the_impact_has_no_effect() -> None:
    loaded = replace(WOOD, lumps=(Lump(name="weight", z=33 * INCH, mass=0.1),))
    plain, heavy = (
        ModalModel.of(body, Free()).collide(usual([4.0])).collision_efficiency
        for body in (WOOD, loaded)
    )
    assert plain == pytest.approx(heavy, abs=1e-3)


def test_a_batch_is_its_scenes_one_by_one() -> None:
    model, scenes = ModalModel.of(ALUMINIUM, Pinned(PIVOT)), usual(BARREL)
    together = model.collide(scenes)
    for i in (0, 7):
        alone = model.collide(usual([BARREL[i]]))
        assert alone.collision_efficiency[0] == together.collision_efficiency[i]
        assert np.array_equal(alone.modal_velocities[0], together.modal_velocities[i])


def test_the_ball_that_carries_on_has_a_negative_efficiency() -> None:
    result = ModalModel.of(WOOD, Free()).collide(usual([0.3]))
    assert result.collision_efficiency[0] < -0.1


def test_a_yielding_pivot_lies_between_a_free_bat_and_a_rigid_pin() -> None:
    """The gap of e_A to the free bat is proportional to k, that to the pinned bat to 1/k."""
    scenes = usual([5.0, 12.0, 20.0, 24.0])

    def efficiency(support: Support) -> np.ndarray:
        return ModalModel.of(WOOD, support, 30).collide(scenes).collision_efficiency

    free, rigid = efficiency(Free()), efficiency(Pinned(PIVOT))
    assert np.abs(free - rigid).max() > 0.1
    gaps = [np.abs(efficiency(Pinned(PIVOT, k)) - rigid).max() for k in (1e9, 1e10, 1e11)]
    assert gaps[1] == pytest.approx(gaps[0] / 10, rel=0.2)
    assert gaps[2] < 2e-5
    soft = [np.abs(efficiency(Pinned(PIVOT, k)) - free).max() for k in (1e1, 1e2, 1e3)]
    assert soft[2] == pytest.approx(10 * soft[1], rel=0.2)
    assert soft[0] < 2e-5


@pytest.mark.parametrize("place", [0.16, 0.01])
def test_the_patch_pressure_is_half_a_cosine(place: float) -> None:
    """Mean deflection of each mode under cos(πx/2h); h = 15 mm, or the 10 mm to the tip.

    The oracle is Simpson's rule with 2001 points; a uniform pressure would differ by 1e-3.
    """
    modes = ModalModel.of(WOOD, Free(), 6).modes
    x = np.linspace(-1.0, 1.0, 2001)
    pressure = np.cos(np.pi / 2 * x)
    half = min(0.015, place)
    deflections = modes.shape(np.maximum(place + half * x, 0.0))
    expected = simpson(pressure[:, None] * deflections, x=x, axis=0) / simpson(pressure, x=x)
    shape = patch_shape(modes, np.array([place]), 0.03)[0]
    assert shape == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
def test_at_release_the_ball_touches_the_bat_surface(body: BatBody) -> None:
    """The path of the ball, v t - ∫∫F/m, equals the deflection of all modes under the patch.

    ∫∫F follows from the rigid rotation about the pin. The tolerance is 1e-4 of a compression.
    """
    model, scenes = ModalModel.of(body, Pinned(PIVOT)), scattered(60, 2.0, 24, seed=5)
    collisions = model.collide(scenes)
    shapes = patch_shape(model.modes, scenes.impact_position, model.patch)
    pushed = collisions.modal_displacements[:, 0] / shapes[:, 0]
    path = scenes.relative_speed * collisions.contact_time - pushed / scenes.ball_mass
    assert path == pytest.approx((shapes * collisions.modal_displacements).sum(axis=1), abs=1e-6)
