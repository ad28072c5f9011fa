"""The integrator against stored results of scipy's DOP853, from usual scenes to the edges."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.scenes import struck
from tests.simulation.collision.groups import GROUPS, references
from tests.simulation.collision.oracle import solve


@pytest.mark.parametrize("name", GROUPS)
def test_e_a_agrees_with_the_reference(name: str) -> None:
    model, scenes = GROUPS[name]()
    collisions, stored = model.collide(scenes), references(name)
    errors = np.abs(collisions.collision_efficiency - [one.efficiency for one in stored])
    print(f"{name}: largest error {errors.max():.1e}, repetitions {collisions.redone.max()}")
    assert errors.max() < 1e-7
    assert np.abs(collisions.energy.total - 1).max() < 1e-6
    assert collisions.contacts.tolist() == [one.contacts for one in stored]
    reloads = collisions.reloads - [one.reloads for one in stored]
    assert (reloads == 0).mean() > 0.9  # a tiny reload may lie within one step


def test_the_groups_have_every_kind_of_scene() -> None:
    stored = [one for name in GROUPS for one in references(name)]
    assert len(stored) > 300
    assert max(one.contacts for one in stored) > 3
    assert max(one.reloads for one in stored) > 9


@pytest.mark.parametrize("name", ["r161 spring", "hidden peak, clamped bat"])
def test_the_stored_results_are_those_of_the_oracle(name: str) -> None:
    for result, stored in zip(solve(struck(*GROUPS[name]())), references(name), strict=True):
        assert result.efficiency == pytest.approx(stored.efficiency, abs=1e-9)
        assert result.contacts == stored.contacts
