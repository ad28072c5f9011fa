"""A scene that no solver can follow raises an error that names it, and never returns a number."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from tests.benchmarks.scenes import struck
from tests.simulation.collision.scenes import scattered, usual
from virtual_lab.catalog import load_bat
from virtual_lab.errors import InputError
from virtual_lab.simulation.collision import stepping
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.collision.stepping import STEPPER, WINDOW, Stepper
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned, Support
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.units import INCH

WOOD, ALUMINIUM = load_bat("r161").spec.body, load_bat("ea70").spec.body
CLAMPED = Clamped(31 * INCH)


@lru_cache
def wood(support: Support = Free()) -> ModalModel:  # noqa: B008 frozen
    return ModalModel.of(WOOD, support)


HELD = {"free": Free(), "pinned at 0.7112 m": Pinned(28 * INCH), "clamped at 0.7874 m": CLAMPED}


@pytest.mark.parametrize("held", HELD)
def test_a_scene_without_end_is_an_error(held: str) -> None:
    odd = usual([6.0, 6.0], relative_speed=50.0, stiffness=np.array([3.5e6, 1e18]))
    with pytest.raises(InputError) as refused:
        wood(HELD[held]).collide(odd)
    text = str(refused.value)
    assert text.startswith("collision: no end is found")
    assert "\n" not in text
    assert "k 1e+18 N/m^1" in text
    assert "struck 0.1524 m from its tip at 50 m/s by a ball of 0.145291 kg" in text
    assert f"no result for a bat {held}, " in text


def test_the_reference_refuses_a_scene_it_cannot_follow() -> None:
    model = ReferenceModel.of(WOOD, Free(), 4)
    assert model.collide(usual([6.0])).contacts[0] == 1
    with pytest.raises(InputError, match=r"collision: no end is found; .* e0 0\.004,"):
        model.collide(usual([6.0], ball_restitution=0.004))
    loose = replace(model, tolerance=1e-9, method="RK45", longest_step=1e4)
    with pytest.raises(InputError, match=r"collision: .*; no result for a bat free, struck 0\.5"):
        loose.collide(usual([20.0], ball_restitution=0.02, stiffness=1e9))


def test_disagreement_of_finer_steps_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check applies to doubtful scenes, and to no others."""
    hard = usual([1.0], stiffness=3.5e8, ball_restitution=0.45)
    assert wood().collide(hard).redone[0] > 0
    one_pass = Stepper.one_pass

    def trembling(self: Stepper, *arguments: object) -> object:
        result, doubtful = one_pass(self, *arguments)  # type: ignore[arg-type]
        result.states[:, -1] *= 1 + 1e-3 * self.mode_step
        return result, doubtful

    monkeypatch.setattr(Stepper, "one_pass", trembling)
    with pytest.raises(
        InputError, match="collision: finer steps disagree; no result for a bat free"
    ):
        wood().collide(hard)
    assert wood().collide(usual([6.0])).redone[0] == 0


def test_the_energy_balance_is_checked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hard = usual([1.0], stiffness=3.5e8, ball_restitution=0.45)
    monkeypatch.setattr(stepping, "STAYS", 1e-17)
    with pytest.raises(InputError, match="collision: energy does not close; no result"):
        wood().collide(hard)


@pytest.mark.parametrize("speed", [1e-3, 1e-9])
def test_slow_balls_are_right_or_refused(speed: float) -> None:
    """The e_A of a linear ball is independent of speed; a stiffening ball at 1 nm/s is refused."""
    model, places = wood(), [1.0, 6.0, 16.0]
    fast = model.collide(usual(places, relative_speed=50.0)).collision_efficiency
    slow = model.collide(usual(places, relative_speed=speed)).collision_efficiency
    assert slow == pytest.approx(fast, abs=1e-6)
    creeping = usual([6.0], relative_speed=speed, exponent=3.0, stiffness=2.4e10)
    if speed > 1e-6:
        assert model.collide(creeping).energy.total == pytest.approx(np.ones(1), abs=1e-6)
    else:
        with pytest.raises(InputError, match=rf"collision: no end is found; .* at {speed:g} m/s"):
            model.collide(creeping)


def followed(model: ModalModel, scenes: Scenes, window: float) -> np.ndarray:
    """Return the remaining speed of the ball, as a share of the approach speed, per scene."""
    return STEPPER.follow(struck(model, scenes), window).states[:, -1] / scenes.relative_speed


@pytest.mark.parametrize("body", [WOOD, ALUMINIUM])
@pytest.mark.parametrize("support", [Free(), Pinned(28 * INCH), Pinned(28 * INCH, 1e6)])
def test_no_contact_begins_after_the_contact_window(body: object, support: Support) -> None:
    model = ModalModel.of(body, support)  # type: ignore[arg-type]
    scenes = scattered(300, 0.3, 24, seed=21)
    speeds = followed(model, scenes, WINDOW)
    for window in (0.006, 0.04):
        assert np.array_equal(followed(model, scenes, window), speeds)


def test_a_late_contact_of_a_clamped_bat_does_not_count() -> None:
    model, scenes = wood(CLAMPED), scattered(300, 0.5, 24, seed=22)
    speeds = followed(model, scenes, WINDOW)
    assert np.abs(followed(model, scenes, 0.006) - speeds).max() < 1e-6
    late = np.abs(followed(model, scenes, 0.04) - speeds)
    assert (late > 1e-6).sum() > 5
    assert late.max() > 0.3


def test_the_contact_window_agrees_with_the_reference() -> None:
    modes = modes_of(WOOD, CLAMPED, 6)
    scenes = scattered(12, 0.5, 12, seed=23)
    collisions = ModalModel(modes=modes, stiff=modes.above(6)).collide(scenes)
    true = ReferenceModel(modes=modes, tolerance=1e-9, longest_step=1.0).collide(scenes)
    assert np.array_equal(collisions.contacts, true.contacts)
    assert np.abs(collisions.collision_efficiency - true.collision_efficiency).max() < 1e-5
