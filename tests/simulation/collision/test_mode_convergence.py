"""The number of bending modes of the default model, and the gain by each of its remedies."""

from __future__ import annotations

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.simulation.collision.modal import BENDING_MODES, ModalModel
from virtual_lab.simulation.collision.patch import PATCH
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.units import INCH, MPH

# bats with the shape of another one: Russell's bats come from two templates
TWINS = {f"russell-{number}" for number in (1, 2, 4, 5, 6)}
BATS = [name for name in catalog.names("bats") if name not in TWINS]


@pytest.mark.parametrize("bat", BATS)
def test_the_default_is_converged(bat: str) -> None:
    """Oracle: 120 modes with the same contact, along the barrel at 60 and 160 mph."""
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    place, speed = np.meshgrid(np.linspace(1, 12, 23) * INCH, np.array([60.0, 160.0]) * MPH)
    scenes = Scenes.with_ball(ball, impact_position=place.ravel(), relative_speed=speed.ravel())
    every = modes_of(catalog.load_bat(bat).spec.body, Free())

    def efficiency(count: int, patch: float, *, residual: bool = True) -> np.ndarray:
        stiff = every.above(count if residual else every.count)
        model = ModalModel(modes=every.first(count), stiff=stiff, patch=patch)
        return model.collide(scenes).collision_efficiency

    true = {patch: efficiency(120, patch) for patch in (PATCH, 0.0)}

    def error(count: int, patch: float = PATCH, *, residual: bool = True) -> float:
        return float(np.abs(efficiency(count, patch, residual=residual) - true[patch]).max())

    default = error(BENDING_MODES)
    print(f"{bat}: {default:.1e} against 120 modes")
    assert 0 < default < 3e-4
    assert error(8) > 4 * default
    assert error(BENDING_MODES, residual=False) > 10 * default
    assert error(30, 0.0, residual=False) > error(30, residual=False)
