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
from virtual_lab.simulation.collision.surrogate import Box
from virtual_lab.simulation.physics.supports import Free

WOOD = load_bat("r161").spec.body
PROBE = usual([4.0, 6.0, 8.0])
BOX = Box.about(PROBE)


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
    ("farthest", "u", "rung"),
    [
        (9, 0.005, "surrogate"),
        (24, 0.005, "modal"),  # some re-load
        (9, 10.0, "rigid"),
        (9, 1e-5, "reference"),
    ],
)
def test_efficiency_alone_may_come_from_a_surrogate(
    farthest: float, u: float, rung: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VIRTUAL_LAB_CACHE", str(tmp_path))
    scenes = usual(np.linspace(3, farthest, 500))
    choice = choose_efficiency(WOOD, Free(), PROBE, Box.about(scenes), standard_uncertainty=u)
    assert choice.rung == rung
    assert choice.error <= 0.1 * u
    if rung in ("surrogate", "modal"):
        modal = ModalModel.of(WOOD, Free()).collide(scenes).collision_efficiency
        assert np.abs(choice.efficiency(scenes) - modal).max() < 0.1 * MODAL_ERROR
    assert ("no surrogate" in choice.reason) == (rung == "modal")


def test_a_scene_outside_the_box_goes_to_the_modal_rung_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every scene's e_A, bit for bit, is that of its rung asked for it alone, in any order."""
    monkeypatch.setenv("VIRTUAL_LAB_CACHE", str(tmp_path))
    modal, scenes = ModalModel.of(WOOD, Free()), usual(np.linspace(3, 9, 601))
    box = Box.about(usual([4.0, 8.0]))
    ladder = Ladder(probe=PROBE, standard_uncertainty=0.005, box=box)
    found = ladder.efficiency(WOOD, Free(), scenes)
    exact = modal.collide(scenes).collision_efficiency
    inside = box.inside(scenes)
    assert inside.sum() == 401
    assert np.array_equal(found[~inside], exact[~inside])
    assert (found[inside] != exact[inside]).mean() > 0.9
    assert np.abs(found - exact).max() < 0.1 * MODAL_ERROR
    again = Ladder(probe=PROBE, standard_uncertainty=0.005, box=box)
    for some in (np.arange(600, -1, -1), np.array([3]), np.array([300]), np.arange(90, 110)):
        assert np.array_equal(again.efficiency(WOOD, Free(), scenes.part(some)), found[some])
    assert len(list(tmp_path.rglob("*.npz"))) == 1


def test_without_a_box_there_is_no_surrogate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many scenes come at once: what a scene gives depends on no other."""
    monkeypatch.setenv("VIRTUAL_LAB_CACHE", str(tmp_path))
    scenes = usual(np.linspace(4, 8, 6000))
    found = Ladder(probe=PROBE, standard_uncertainty=0.005).efficiency(WOOD, Free(), scenes)
    modal = ModalModel.of(WOOD, Free()).collide(scenes).collision_efficiency
    assert np.array_equal(found, modal)
    assert not list(tmp_path.rglob("*"))


def test_a_rung_asked_for_is_no_surrogate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIRTUAL_LAB_CACHE", str(tmp_path))
    ladder = Ladder(probe=PROBE, standard_uncertainty=0.005, rung="rigid", box=BOX)
    ladder.efficiency(WOOD, Free(), usual(np.linspace(4, 8, 60)))
    assert not list(tmp_path.rglob("*"))
    assert ladder.report()["rung"] == "rigid"
