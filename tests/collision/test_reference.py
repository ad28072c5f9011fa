"""The modal rung's stepping and truncation against an independent solution."""

from dataclasses import replace

import numpy as np
import pytest

from tests.collision.scenes import scattered, usual
from virtual_lab.catalog import load_bat
from virtual_lab.collision.ladder import MODAL_ERROR
from virtual_lab.collision.modal import ModalModel
from virtual_lab.collision.reference import ReferenceModel
from virtual_lab.collision.scene import Scenes
from virtual_lab.physics.modes import modes_of
from virtual_lab.physics.supports import Free, Pinned, Support
from virtual_lab.specs import BatBody
from virtual_lab.units import INCH

WOOD, ALUMINIUM = load_bat("r161").spec.body, load_bat("ea70").spec.body
MODES = 16


def both(body: BatBody, support: Support) -> tuple[ModalModel, ReferenceModel]:
    """Return the two rungs over the very same modes, without residual flexibility."""
    modes = modes_of(body, support, MODES)
    return ModalModel(modes=modes, stiff=modes.above(MODES)), ReferenceModel(modes=modes)


def agree(body: BatBody, support: Support, scenes: Scenes, tolerance: float) -> np.ndarray:
    modal, reference = (model.collide(scenes) for model in both(body, support))
    gap = modal.collision_efficiency - reference.collision_efficiency
    assert np.abs(gap).max() < tolerance
    assert np.array_equal(modal.contacts, reference.contacts)
    assert np.array_equal(modal.reloads, reference.reloads)
    assert modal.contact_time == pytest.approx(reference.contact_time, rel=1e-6)
    scale = scenes.relative_speed[:, None]
    assert np.abs((modal.modal_velocities - reference.modal_velocities) / scale).max() < 1e-6
    return modal.contacts + modal.reloads


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
@pytest.mark.parametrize("support", [Free(), Pinned(28 * INCH)])
def test_barrel_hits_agree_with_the_reference(body: BatBody, support: Support) -> None:
    agree(body, support, scattered(25, 1, 12, seed=4), 1e-8)


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
def test_reloading_and_second_contacts_agree_with_the_reference(body: BatBody) -> None:
    events = agree(body, Free(), scattered(30, 18, 24, seed=5), 1e-7)
    assert (events > 1).sum() > 10


def test_tip_hits_that_meet_twice_agree_with_the_reference() -> None:
    events = agree(ALUMINIUM, Free(), scattered(10, 0.2, 1.0, seed=6), 1e-8)
    assert (events > 1).sum() > 2


@pytest.mark.parametrize("exponent", [1.0, 1.4])
def test_steps_converge_at_order_six(exponent: float) -> None:
    modal, _ = both(WOOD, Free())
    scenes = usual(np.linspace(3, 8, 6), exponent=exponent)
    exact = replace(modal, refinement=4.0).collide(scenes).collision_efficiency
    errors = [
        np.abs(replace(modal, refinement=n).collide(scenes).collision_efficiency - exact).max()
        for n in (0.4, 0.8)
    ]
    order = np.log2(errors[0] / errors[1])
    print(f"exponent {exponent}: errors {errors}, observed order {order:.2f}")
    assert order > 5


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
def test_the_modes_left_out_cost_no_more_than_stated(body: BatBody) -> None:
    scenes = usual([1.5, 4.0, 6.0, 9.0, 10.5])
    gap = (
        ModalModel.of(body, Free()).collide(scenes).collision_efficiency
        - ReferenceModel.of(body, Free()).collide(scenes).collision_efficiency
    )
    assert 1e-8 < np.abs(gap).max() < MODAL_ERROR


def test_residual_flexibility_is_worth_ten_times() -> None:
    scenes = usual([4.0, 6.0, 8.0])
    truth = ModalModel.of(WOOD, Free(), 80).collide(scenes).collision_efficiency
    model = ModalModel.of(WOOD, Free(), 20)
    bare = replace(model, stiff=model.stiff.above(model.stiff.count))
    errors = [np.abs(m.collide(scenes).collision_efficiency - truth).max() for m in (model, bare)]
    assert 10 * errors[0] < errors[1]
