"""Splines of the mode shapes along the bat, in tiles that are computed on demand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from virtual_lab.catalog import load_bat
from virtual_lab.simulation.collision.modal import BENDING_MODES, ModalModel
from virtual_lab.simulation.collision.patch import TILE, PatchTable
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of

LENGTH, WIDTH = 0.85, 0.03


def waves(z: np.ndarray) -> np.ndarray:
    """Return two functions of z; the slope of one jumps where the patch begins to shrink."""
    return np.stack([np.sin(40 * z), np.abs(z - WIDTH / 2)], axis=1)


def test_tiles_join_to_one_spline_of_the_whole_bat() -> None:
    """The oracle is one spline through all knots between the ends of the patch, to 1e-14."""
    table = PatchTable(waves, LENGTH, WIDTH)
    low, high = WIDTH / 2, LENGTH - WIDTH / 2
    knots = np.linspace(low, high, round((high - low) / 2e-4))
    z = np.random.default_rng(3).uniform(low, high, 4000)
    at_seams = knots[TILE::TILE]
    for places in (z, at_seams, np.array([low, high])):
        np.testing.assert_allclose(table(places), CubicSpline(knots, waves(knots))(places), 1e-14)


def test_a_value_does_not_depend_on_the_other_positions() -> None:
    """The bits of a value are the same alone and beside others, so no shot depends on another."""
    z = np.linspace(0, LENGTH, 301)
    alone = np.concatenate([PatchTable(waves, LENGTH, WIDTH)(z[i : i + 1]) for i in range(z.size)])
    np.testing.assert_array_equal(PatchTable(waves, LENGTH, WIDTH)(z), alone)


def test_a_few_positions_compute_only_a_part_of_the_bat() -> None:
    sizes: list[int] = []

    def counted(z: np.ndarray) -> np.ndarray:
        sizes.append(z.size)
        return waves(z)

    table = PatchTable(counted, LENGTH, WIDTH)
    table(np.array([0.15, 0.151]))
    table(np.array([0.152]))
    assert len(sizes) == 1
    assert sizes[0] < 0.1 * LENGTH / 2e-4


@pytest.mark.parametrize("end", [0.0, WIDTH / 2, LENGTH - WIDTH / 2, LENGTH])
def test_the_ends_of_bat_and_patch_are_valid_positions(end: float) -> None:
    read = PatchTable(waves, LENGTH, WIDTH)
    assert read(np.array([end])) == pytest.approx(waves(np.array([end])), abs=1e-9)
    assert read(np.zeros(0)).shape[0] == 0


@pytest.mark.parametrize("bat", ["r161", "ea70"])
def test_the_compliance_does_not_depend_on_the_elements(bat: str) -> None:
    """Compliance of all stiff modes along the barrel; the oracle is a mesh twice as fine.

    A rule of Gauss over the whole patch gives up to 12 in 1000 more where elements meet.
    """
    body, z = load_bat(bat).spec.body, np.linspace(0.03, 0.3, 136)
    coarse, fine = (
        ModalModel.within(modes_of(body, Free(), element_size=size), BENDING_MODES)
        for size in (0.05, 0.02)
    )
    assert coarse.table.values(z)[:, -1] == pytest.approx(fine.table.values(z)[:, -1], rel=3e-3)
