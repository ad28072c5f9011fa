"""The maps of the collision's steps: their states and files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from virtual_lab.fidelity import collision_stability as maps
from virtual_lab.fidelity.collision_stability import ColumnOutcome, _cell
from virtual_lab.fidelity.drawing import State
from virtual_lab.fidelity.results import StabilityMap
from virtual_lab.simulation.collision.stepping import STAYS, STEPPER


@pytest.fixture(scope="module")
def found() -> StabilityMap:
    ends = {axis: (values[0], values[-1]) for axis, values in maps.AXES.items()}
    ends[maps.CollisionAxis.CONTACTS] = (1, 3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maps, "AXES", ends)
        patch.setattr(maps, "FACTORS", (0.5, 1.0, 1.3, 1.5, 4.0))
        patch.setattr(maps, "PLACES_IN", (1.0, 6.5, 16.0))
        patch.setattr(maps, "POOLED_SCENES", 600)
        return maps.collision_stability()


@pytest.fixture(scope="module")
def rows(found: StabilityMap) -> list[dict[str, Any]]:
    return found.rows


def at(rows: list[dict[str, Any]], *steps: str) -> list[dict[str, Any]]:
    return [row for row in rows if row["step"] in steps]


def test_the_shipped_steps_are_good(rows: list[dict[str, Any]]) -> None:
    for row in at(rows, maps.SHIPPED):
        assert row["state"] == State.GOOD, row
        assert row["scenes"] > 0


def test_the_default_notices_its_errors(rows: list[dict[str, Any]]) -> None:
    default = at(rows, "0.5", "1")
    assert {row["state"] for row in default} == {State.GOOD, State.NOTICED}
    assert max(row["worst_unnoticed_error"] for row in default) < STAYS


def test_scenes_have_the_contacts_of_their_column() -> None:
    for contacts in (1, 3):
        for model, scenes in maps._column(maps.CollisionAxis.CONTACTS, contacts):
            exact = replace(model, stepper=STEPPER.refine(8.0)).collide(scenes)
            assert len(scenes) > 0
            assert (exact.contacts == contacts).all()


def test_the_energy_balance_refuses_every_unstable_result(rows: list[dict[str, Any]]) -> None:
    """Far above the limit of stability, at 9 rad per step, results are wrong and are noticed."""
    assert not any(row["refused"] for row in at(rows, "0.5", "1", maps.SHIPPED))
    assert {True} == {row["refused"] for row in rows if row["state"] == State.UNSTABLE}
    assert State.UNSTABLE in {row["state"] for row in at(rows, "4")}


def test_each_outcome_has_its_state() -> None:
    def state(error: float, leak: float, doubted: bool) -> str:
        def outcome(efficiency: float) -> maps.ColumnOutcome:
            return maps.ColumnOutcome(
                efficiency=np.array([0.1, efficiency]),
                leak=np.array([0.0, leak]),
                doubted=np.array([False, doubted]),
                failed=np.array([False, False]),
            )

        return str(maps._cell(outcome(0.1 + error), outcome(0.1), False)["state"])

    assert state(1e-7, 0.0, False) == State.GOOD
    assert state(1e-3, 0.0, True) == State.NOTICED
    assert state(1e-3, 0.0, False) == State.INACCURATE
    assert state(1e-7, 0.2, True) == State.UNSTABLE
    assert state(-5.0, 0.0, True) == State.UNSTABLE
    assert state(np.nan, np.nan, True) == State.UNSTABLE


def test_the_text_and_the_files_have_every_row(found: StabilityMap, tmp_path: Path) -> None:
    text, rows = found.text, found.rows
    assert text.count(maps.SHIPPED) == len(maps.AXES)
    assert "(X)" in text
    found.save(tmp_path / "maps")
    assert (tmp_path / "maps" / "stability.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "maps" / "stability.csv").read_text().splitlines()) == len(rows) + 1
    json.dumps(rows, allow_nan=False)


@pytest.mark.parametrize(("share", "state"), [(0.99, "good"), (1.01, "inaccurate")])
def test_a_state_is_good_within_the_tolerance_of_the_default(share: float, state: str) -> None:
    """One of two scenes has an unnoticed error just below or just above the tolerance."""

    def outcome(efficiency: float) -> ColumnOutcome:
        return ColumnOutcome(
            efficiency=np.array([0.25, efficiency]),
            leak=np.zeros(2),
            doubted=np.zeros(2, dtype=bool),
            failed=np.zeros(2, dtype=bool),
        )

    cell = _cell(outcome(0.25 + share * STAYS), outcome(0.25), shipped=True)
    assert cell["state"] == state
    assert cell["off"] == (share > 1)
