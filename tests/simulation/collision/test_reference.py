"""Stepping and truncation of the modal model against an independent solution."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.simulation.collision.scenes import scattered, usual
from tests.simulation.physics.bodies import rigid_rod
from virtual_lab.catalog import load_bat
from virtual_lab.catalog.specs import BatBody
from virtual_lab.measurement.reduction.kinematics import efficiency_from_restitution
from virtual_lab.simulation.collision import reference
from virtual_lab.simulation.collision.ladder import choose
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.scene import Collisions
from virtual_lab.simulation.collision.stepping import STEPPER
from virtual_lab.simulation.physics.ball import (
    Branch,
    HuntCrossley,
    LawOfBall,
    PowerLaw,
    wall_contact,
)
from virtual_lab.simulation.physics.beam import Free, Pinned, Support
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.units import INCH

WOOD, ALUMINIUM = load_bat("r161").spec.body, load_bat("ea70").spec.body
MODES = 16
# settings of the reference; e_A agrees with the default (1e-12, 0.2 rad of the highest mode) to
# 6e-10, with second contacts to 4e-9, in a fifth of the time
QUICK: dict[str, Any] = {"tolerance": 1e-10, "longest_step": 1.0}

# number of scenes, lowest and highest position [in], seed; each scene alone shows a force that is
# wrong by 1e-6
Drawn = tuple[int, float, float, int]


@cache
def both(body: BatBody, support: Support) -> tuple[ModalModel, ReferenceModel]:
    """Return the modal and reference models with the same modes, without residual flexibility."""
    modes = modes_of(body, support, MODES)
    reference = ReferenceModel(modes=modes, **QUICK)
    return ModalModel(modes=modes, stiff=modes.above(MODES)), reference


@cache
def solved(body: BatBody, support: Support, drawn: Drawn) -> Collisions:
    """Return the solution of the reference."""
    return both(body, support)[1].collide(scattered(*drawn))


def agree(body: BatBody, support: Support, drawn: Drawn, tolerance: float) -> np.ndarray:
    scenes, reference = scattered(*drawn), solved(body, support, drawn)
    collisions = both(body, support)[0].collide(scenes)
    gap = collisions.collision_efficiency - reference.collision_efficiency
    assert np.abs(gap).max() < tolerance
    assert np.array_equal(collisions.contacts, reference.contacts)
    assert np.array_equal(collisions.reloads, reference.reloads)
    assert collisions.contact_time == pytest.approx(reference.contact_time, rel=1e3 * tolerance)
    scale = scenes.relative_speed[:, None]
    velocities = (collisions.modal_velocities - reference.modal_velocities) / scale
    assert np.abs(velocities).max() < 100 * tolerance
    return collisions.contacts + collisions.reloads


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
@pytest.mark.parametrize("support", [Free(), Pinned(28 * INCH), Pinned(28 * INCH, 1e6)])
def test_barrel_hits_agree_with_the_reference(body: BatBody, support: Support) -> None:
    agree(body, support, (10, 1, 11, 4), 1e-8)


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
def test_reloading_and_second_contacts_agree_with_the_reference(body: BatBody) -> None:
    events = agree(body, Free(), (16, 18, 24, 5), 1e-7)
    assert (events > 1).sum() > 5


def test_tip_hits_that_meet_twice_agree_with_the_reference() -> None:
    events = agree(WOOD, Free(), (20, 0.0, 0.3, 6), 1e-7)
    assert (events > 1).sum() > 2


@pytest.mark.parametrize("exponent", [1.0, 1.4])
def test_steps_converge_at_order_six(exponent: float) -> None:
    modal, _ = both(WOOD, Free())
    scenes = usual(np.linspace(3, 8, 6), exponent=exponent)
    exact = replace(modal, stepper=STEPPER.refine(12.0)).collide(scenes).collision_efficiency
    errors = [
        np.abs(
            replace(modal, stepper=STEPPER.refine(n)).collide(scenes).collision_efficiency - exact
        ).max()
        for n in (1.0, 1.5)
    ]
    order = np.log(errors[0] / errors[1]) / np.log(1.5)
    print(f"exponent {exponent}: errors {errors}, observed order {order:.2f}")
    assert order > 5


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
def test_the_omitted_modes_cause_no_more_than_the_stated_error(body: BatBody) -> None:
    scenes = usual([1.5, 4.0, 6.0, 9.0, 10.5])
    reference = replace(ReferenceModel.of(body, Free()), **QUICK)
    gap = (
        ModalModel.of(body, Free()).collide(scenes).collision_efficiency
        - reference.collide(scenes).collision_efficiency
    )
    assert 1e-8 < np.abs(gap).max() < choose(body, Free(), scenes).error


def test_residual_flexibility_reduces_the_error_ten_times() -> None:
    scenes = usual([4.0, 6.0, 8.0])
    truth = ModalModel.of(WOOD, Free(), 80).collide(scenes).collision_efficiency
    model = ModalModel.of(WOOD, Free(), 20)
    bare = replace(model, stiff=model.stiff.above(model.stiff.count))
    errors = [np.abs(m.collide(scenes).collision_efficiency - truth).max() for m in (model, bare)]
    assert 10 * errors[0] < errors[1]


@pytest.mark.parametrize("law", [PowerLaw.of, HuntCrossley.of])
@pytest.mark.parametrize(("exponent", "e0"), [(1.0, 0.5), (1.5, 0.45), (2.0, 0.9)])
def test_the_restitution_on_a_wall_is_e0(law: LawOfBall, exponent: float, e0: float) -> None:
    """A rod of 200 000 t against the closed form (power law) or quadrature (Hunt and Crossley)."""
    k = 3.5e6 * 0.012 ** (1 - exponent)
    scenes = usual([20.0], exponent=exponent, stiffness=k, ball_restitution=e0)
    result = ReferenceModel.of(rigid_rod(), Free(), 0, law).collide(scenes)
    mass, speed = float(scenes.ball_mass[0]), float(scenes.relative_speed[0])
    made = law(stiffness=k, exponent=exponent, restitution=e0, speed=speed)
    if isinstance(made, HuntCrossley):
        wall = made.wall_contact(mass, speed)
    else:
        wall = wall_contact(*(np.array(x) for x in (mass, speed, k, exponent, e0)))
    assert result.collision_efficiency[0] == pytest.approx(e0, rel=1e-8)
    assert result.contact_time[0] == pytest.approx(wall.time, rel=1e-8)
    assert result.energy.hysteresis[0] == pytest.approx(1 - e0**2, rel=1e-8)


@pytest.mark.parametrize("law", [PowerLaw.of, HuntCrossley.of])
def test_the_restitution_of_a_recoiling_rigid_bat_is_e0(law: LawOfBall) -> None:
    """Without bending modes e = e0 for any reduced mass; e_A follows by Eq. (6)."""
    modes = modes_of(WOOD, Free(), 0)
    scenes = usual([3.0, 6.0, 20.0])
    r = scenes.ball_mass * np.sum(modes.shape(scenes.impact_position) ** 2, axis=1)
    efficiency = (
        ReferenceModel(modes=modes, patch=0.0, law=law).collide(scenes).collision_efficiency
    )
    assert efficiency == pytest.approx(efficiency_from_restitution(0.5, r), abs=1e-9)


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
@pytest.mark.parametrize("law", [PowerLaw.of, HuntCrossley.of])
def test_every_law_accounts_for_its_energy(body: BatBody, law: LawOfBall) -> None:
    model = replace(both(body, Free())[1], law=law)
    e = model.collide(scattered(8, 0.5, 24, seed=8)).energy
    whole = e.ball + e.rigid + e.bending + e.hoop + e.hysteresis
    assert whole == pytest.approx(np.ones(8), abs=1e-9)
    assert e.hysteresis.min() > 0


@pytest.mark.parametrize("damping", [1e2, 1e3, 1e4])
def test_a_dashpot_at_the_pivot_has_no_effect(
    damping: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A weak or strong dashpot changes e_A less than the omitted modes do, so no model has one."""
    model = ReferenceModel.of(WOOD, Pinned(28 * INCH, 1e6), 20)
    model = replace(model, **QUICK, leak=np.inf)  # energy in no share: that of the dashpot
    at_pivot, undamped = model.modes.shape(28 * INCH), reference._Scene.derivative
    scenes = usual([5.0, 8.0, 12.0])
    free = model.collide(scenes).collision_efficiency

    def damped(self: reference._Scene, y: np.ndarray, branch: Branch) -> np.ndarray:
        rates, count = undamped(self, y, branch), len(self.shape)
        rates[count + 1 : -2] -= at_pivot * damping * (at_pivot @ y[count + 1 : -2])
        return rates

    monkeypatch.setattr(reference._Scene, "derivative", damped)
    change = np.abs(model.collide(scenes).collision_efficiency - free)
    assert 0 < change[:2].max() < 1.2e-5
    assert change[2] < 8e-5
