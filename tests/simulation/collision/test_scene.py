"""Invalid scenes are refused before any computation."""

import numpy as np
import pytest

from tests.simulation.collision.scenes import usual
from tests.simulation.physics.bodies import rod
from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.collision.scene import CollisionModel
from virtual_lab.simulation.physics.beam import Free, Pinned


def test_numbers_and_arrays_broadcast_to_one_axis() -> None:
    scenes = usual([5.0, 6.0, 7.0])
    assert len(scenes) == 3
    assert scenes.ball_mass.shape == (3,)
    assert len(usual(5.0)) == 1


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("impact_position", -0.001),
        ("impact_position", float("nan")),
        ("relative_speed", 0.0),
        ("relative_speed", float("inf")),
        ("ball_mass", -0.1),
        ("ball_restitution", 0.0),
        ("ball_restitution", 1.001),
        ("stiffness", -1.0),
        ("exponent", 0.99),
        ("exponent", [1.0, float("nan")]),
    ],
)
def test_numbers_out_of_range_are_refused_by_name(key: str, value: object) -> None:
    with pytest.raises(InputError, match="allowed") as caught:
        usual([5.0, 6.0], **{key: value})
    assert caught.value.key == key


@pytest.mark.parametrize("z", [[], [[5.0], [6.0]]])
def test_empty_and_two_dimensional_batches_are_refused(z: list[object]) -> None:
    with pytest.raises(InputError, match="shapes"):
        usual(z)  # type: ignore[arg-type]


def test_shapes_that_do_not_match_are_refused() -> None:
    with pytest.raises(InputError, match="shapes"):
        usual([5.0, 6.0], stiffness=np.ones(3))


@pytest.mark.parametrize("model", [RigidModel, ModalModel, ReferenceModel])
def test_positions_off_the_bat_are_refused(model: type[RigidModel]) -> None:
    bat: CollisionModel = model.of(rod(), Free())
    with pytest.raises(InputError, match="impact_position = 1"):
        bat.collide(usual(5.0, impact_position=[0.1, 1.0001]))


@pytest.mark.parametrize("model", [RigidModel, ModalModel, ReferenceModel])
def test_supports_off_the_bat_are_refused(model: type[RigidModel]) -> None:
    with pytest.raises(InputError, match="pinned bat"):
        model.of(rod(), Pinned(1.2))
