"""No scene depends on its neighbors in a batch; splines of the mode shapes are accurate."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import lru_cache

import numpy as np
import pytest

from tests.benchmarks.scenes import WIDE
from virtual_lab.catalog import load_bat
from virtual_lab.simulation.collision.modal import ModalModel, collide_bats
from virtual_lab.simulation.collision.patch import patch_shape
from virtual_lab.simulation.collision.scene import Collisions
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned
from virtual_lab.units import INCH

TABLE_ERROR, MOSTLY = 5e-7, 2e-8  # errors of e_A due to the splines: largest, and 95 % quantile


def total(collisions: Collisions) -> np.ndarray:
    return np.sum(
        [getattr(collisions.energy, one.name) for one in fields(collisions.energy)], axis=0
    )


def columns(collisions: Collisions) -> dict[str, np.ndarray]:
    arrays = {one.name: getattr(collisions, one.name) for one in fields(collisions)[1:-1]}
    return arrays | {
        one.name: getattr(collisions.energy, one.name) for one in fields(collisions.energy)
    }


@lru_cache
def bats() -> list[ModalModel]:
    supports = (Free(), Free(), Pinned(28 * INCH), Clamped(31 * INCH))
    names = ("r161", "ea70", "barrel-loaded", "knob-loaded")
    return [
        ModalModel.of(load_bat(name).spec.body, support)
        for name, support in zip(names, supports, strict=True)
    ]


def test_a_scene_does_not_depend_on_its_batch() -> None:
    """The results are the same bits in any order and beside any neighbors."""
    model, scenes = bats()[1], WIDE.draw(500, 30)
    whole, order = columns(model.collide(scenes)), np.random.default_rng(31).permutation(500)
    shuffled = columns(model.collide(scenes.part(order)))
    halves = [columns(model.collide(scenes.part(part))) for part in np.split(order, [77])]
    for name, values in whole.items():
        assert np.array_equal(values[order], shuffled[name]), name
        assert np.array_equal(shuffled[name], np.concatenate([h[name] for h in halves])), name
    assert set(whole["redone"]) == {0, 1}


def test_a_bat_in_a_batch_gives_the_same_bits_as_alone() -> None:
    """Bats with other supports, with or without a hoop mode, give the same bits as alone."""
    batch = [(model, WIDE.draw(400, 40 + i)) for i, model in enumerate(bats())]
    for (model, scenes), together in zip(batch, collide_bats(batch), strict=True):
        alone = columns(model.collide(scenes))
        assert set(alone["redone"]) == {0, 1}
        for name, values in columns(together).items():
            assert np.array_equal(values, alone[name]), name


def test_a_bat_of_few_modes_is_unchanged_beside_one_of_many() -> None:
    """The number of modes of one bat does not change the bits of another."""
    few = ModalModel.of(load_bat("r161").spec.body, Free(), 7)
    bare = replace(few, stiff=few.stiff.above(few.stiff.count))  # no residual flexibility
    many = ModalModel.of(load_bat("ea70").spec.body, Free(), 40)
    batch = [(model, WIDE.draw(200, 50 + i)) for i, model in enumerate([many, few, bare])]
    for (model, scenes), together in zip(batch, collide_bats(batch), strict=True):
        alone = columns(model.collide(scenes))
        for name, values in columns(together).items():
            assert np.array_equal(values, alone[name]), name


@pytest.mark.parametrize("which", range(4))
def test_splines_of_the_mode_shapes_change_e_a_only_within_the_stated_error(which: int) -> None:
    """The oracle has exact mode shapes; in all other tests, the oracle has the same splines."""
    model, scenes = bats()[which], WIDE.draw(300, 60 + which)

    def shapes(z: np.ndarray) -> np.ndarray:
        stiff = patch_shape(model.stiff, z, model.patch) / model.stiff.angular_frequencies
        return np.column_stack((patch_shape(model.modes, z, model.patch), np.sum(stiff**2, axis=1)))

    exact = replace(model)
    vars(exact)["table"] = shapes
    gap = exact.collide(scenes).collision_efficiency - model.collide(scenes).collision_efficiency
    error = np.abs(gap)
    print(f"worst {error.max():.1e}, of 95 in 100 {np.quantile(error, 0.95):.1e}")
    assert 0 < error.max() < TABLE_ERROR
    assert np.quantile(error, 0.95) < MOSTLY
