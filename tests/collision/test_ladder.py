import pytest

from tests.collision.scenes import usual
from virtual_lab.catalog import load_bat
from virtual_lab.collision.ladder import MODAL_ERROR, RUNGS, choose
from virtual_lab.errors import InputError
from virtual_lab.physics.supports import Free

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
