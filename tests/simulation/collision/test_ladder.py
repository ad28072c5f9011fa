from pathlib import Path

import numpy as np
import pytest

from tests.simulation.collision.scenes import usual
from virtual_lab.catalog import load_bat
from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.ladder import (
    MODAL_ERROR,
    RUNGS,
    Ladder,
    choose,
    choose_efficiency,
)
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.physics.supports import Free

WOOD = load_bat("r161").spec.body
PROBE = usual([4.0, 6.0, 8.0])


@pytest.mark.parametrize("rung", RUNGS)
def test_a_rung_asked_for_is_given(rung: str) -> None:
    choice = choose(WOOD, Free(), PROBE, rung=rung)
    assert choice.model.rung == rung
    assert choice.reason.startswith(f"{rung} was asked for")


def test_modal_is_the_default() -> None:
    assert choose(WOOD, Free(), PROBE).model.rung == "modal"


@pytest.mark.parametrize(("u", "rung"), [(10.0, "rigid"), (0.005, "modal"), (1e-5, "reference")])
def test_the_cheapest_good_enough_is_taken(u: float, rung: str) -> None:
    choice = choose(WOOD, Free(), PROBE, standard_uncertainty=u)
    assert choice.model.rung == rung
    assert choice.error <= 0.1 * u
    assert choice.reason.count(".") >= 1


def test_the_error_of_the_rigid_rung_is_measured() -> None:
    sweet = choose(WOOD, Free(), usual([5.5]), rung="rigid").error
    tip = choose(WOOD, Free(), usual([2.0]), rung="rigid").error
    assert MODAL_ERROR < sweet < 0.03 < tip


def test_unknown_rungs_and_useless_uncertainties_are_refused() -> None:
    with pytest.raises(InputError, match="rigid, modal, reference"):
        choose(WOOD, Free(), PROBE, rung="best")
    with pytest.raises(InputError, match="standard_uncertainty"):
        choose(WOOD, Free(), PROBE, standard_uncertainty=float("nan"))


@pytest.mark.parametrize(
    ("places", "u", "rung"),
    [
        (np.linspace(3, 9, 6000), 0.005, "surrogate"),
        (np.linspace(3, 9, 60), 0.005, "modal"),  # too few to build for
        (np.linspace(3, 24, 6000), 0.005, "modal"),  # some re-load
        (np.linspace(3, 9, 6000), 10.0, "rigid"),
        (np.linspace(3, 9, 60), 1e-5, "reference"),
    ],
)
def test_efficiency_alone_may_come_from_a_surrogate(
    places: np.ndarray, u: float, rung: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VIRTUAL_LAB_CACHE", str(tmp_path))
    scenes = usual(places)
    choice = choose_efficiency(WOOD, Free(), scenes, standard_uncertainty=u)
    assert choice.rung == rung
    assert choice.error <= 0.1 * u
    if rung in ("surrogate", "modal"):
        modal = ModalModel.of(WOOD, Free()).collide(scenes).collision_efficiency
        assert np.abs(choice.efficiency(scenes) - modal).max() < 0.1 * MODAL_ERROR
    assert ("no surrogate" in choice.reason) == (len(places) > 60 and rung == "modal")


def test_a_ladder_keeps_its_surrogate_for_scenes_like_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Built once with room; built anew for scenes beyond; few scenes go to the modal rung."""
    monkeypatch.setenv("VIRTUAL_LAB_CACHE", str(tmp_path))
    ladder = Ladder(probe=PROBE, standard_uncertainty=0.005)
    first, near, beyond = (
        usual(np.linspace(*ends, 6000)) for ends in ((4, 8), (3.5, 8.5), (3, 11))
    )
    modal = ModalModel.of(WOOD, Free())
    for scenes, boxes in ((first, 1), (near, 1), (beyond, 2)):
        found = ladder.efficiency(WOOD, Free(), scenes)
        some = slice(None, None, 200)
        exact = modal.collide(scenes.part(some)).collision_efficiency
        assert np.abs(found[some] - exact).max() < 0.1 * MODAL_ERROR
        assert len(list(tmp_path.rglob("*.npz"))) == boxes
    few = usual(np.linspace(4, 8, 60))
    assert np.array_equal(
        ladder.efficiency(WOOD, Free(), few), modal.collide(few).collision_efficiency
    )


def test_a_rung_asked_for_is_no_surrogate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIRTUAL_LAB_CACHE", str(tmp_path))
    ladder = Ladder(probe=PROBE, standard_uncertainty=0.005, rung="rigid")
    ladder.efficiency(WOOD, Free(), usual(np.linspace(4, 8, 6000)))
    assert not list(tmp_path.rglob("*"))
    assert ladder.report()["rung"] == "rigid"
