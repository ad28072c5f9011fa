"""The surrogate: its error at new points, its refusals, and its box."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from virtual_lab.catalog import load_bat
from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.collision.surrogate import Box, Surrogate
from virtual_lab.simulation.collision.surrogate_kernel import evaluate_surrogate
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.units import INCH, MPH

BODY = load_bat("ea70").spec.body
BOX = Box(
    impact_position=(3 * INCH, 9 * INCH),
    relative_speed=(50 * MPH, 170 * MPH),
    ball_restitution=(0.40, 0.60),
    ball_mass=(0.1417, 0.1488),
    stiffness=3.5e6,
    exponent=1.0,
)
TOLERANCE = 1e-5


@pytest.fixture(scope="module")
def model() -> ModalModel:
    return ModalModel.of(BODY, Free())


@pytest.fixture(scope="module")
def surrogate(model: ModalModel) -> Surrogate:
    return Surrogate.build(model, BOX, tolerance=TOLERANCE)


def test_the_error_at_new_points_is_below_the_tolerance(
    surrogate: Surrogate, model: ModalModel
) -> None:
    """Neither the fit nor its check used these 600 points; a third of them are corners."""
    unit = np.random.default_rng(77).uniform(-1, 1, (4, 600))
    unit[:, :200] = np.sign(unit[:, :200])
    scenes = BOX.scenes(unit)
    error = surrogate.efficiency(scenes) - model.collide(scenes).collision_efficiency
    assert surrogate.error <= TOLERANCE
    assert np.abs(error).max() <= 2 * TOLERANCE
    assert np.abs(error).max() > surrogate.error / 100  # proof that it is no copy


@pytest.mark.parametrize("shape", [(3, 2, 4, 1), (1, 1, 1, 1), (16, 5, 5, 3)])
def test_the_kernel_agrees_with_numpys_chebyshev_series(shape: tuple[int, ...]) -> None:
    """The oracle is numpy.polynomial, at more points than a block, with block edges."""
    rng = np.random.default_rng(5)
    coefficients = rng.normal(size=shape)
    unit = rng.uniform(-1, 1, (4, 700))
    expected = []
    for x, y, z, w in unit.T:
        value = coefficients
        for at in (x, y, z, w):
            value = np.polynomial.chebyshev.chebval(at, value)
        expected.append(value)
    assert evaluate_surrogate(coefficients, unit) == pytest.approx(np.array(expected), abs=1e-12)
    alone = np.concatenate(
        [evaluate_surrogate(coefficients, unit[:, i : i + 1].copy()) for i in range(9)]
    )
    assert evaluate_surrogate(coefficients, unit)[:9] == pytest.approx(alone, abs=1e-14)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"impact_position": 2.9 * INCH}, "impact_position"),
        ({"relative_speed": 171 * MPH}, "relative_speed"),
        ({"ball_restitution": 0.61}, "ball_restitution"),
        ({"ball_mass": 0.15}, "ball_mass"),
        ({"stiffness": 3.6e6}, "stiffness"),
        ({"exponent": 1.5}, "exponent"),
    ],
)
def test_the_surrogate_refuses_scenes_outside_its_box(
    change: dict[str, float], key: str, surrogate: Surrogate
) -> None:
    inside = {
        "impact_position": 6 * INCH,
        "relative_speed": 100 * MPH,
        "ball_restitution": 0.5,
        "ball_mass": 0.145,
        "stiffness": 3.5e6,
        "exponent": 1.0,
    }
    assert surrogate.efficiency(Scenes.of(**inside)).shape == (1,)
    with pytest.raises(InputError, match=key):
        surrogate.efficiency(Scenes.of(**(inside | change)))


def test_no_surrogate_is_built_where_scenes_reload() -> None:
    """A free wooden bat reloads beyond 14 in."""
    wood = ModalModel.of(load_bat("r161").spec.body, Free())
    box = replace(BOX, impact_position=(14 * INCH, 28 * INCH))
    with pytest.raises(InputError, match="re-load"):
        Surrogate.build(wood, box, tolerance=TOLERANCE)


def test_an_unreachable_tolerance_is_an_error(model: ModalModel) -> None:
    with pytest.raises(InputError, match="tolerance"):
        Surrogate.build(model, BOX, tolerance=1e-12)


def test_a_box_with_reversed_ends_is_refused() -> None:
    with pytest.raises(InputError, match="relative_speed"):
        replace(BOX, relative_speed=(80.0, 20.0))


def test_a_box_includes_its_ends() -> None:
    """The ends of each axis lie in the box; points beyond either end do not."""
    for axis in ("impact_position", "relative_speed", "ball_restitution", "ball_mass"):
        low, high = getattr(BOX, axis)
        unit = np.zeros((4, 4))
        scenes = replace(
            BOX.scenes(unit), **{axis: np.array([low * 0.999, low, high, high * 1.001])}
        )
        assert BOX.inside(scenes).tolist() == [False, True, True, False]
