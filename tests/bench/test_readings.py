"""Each fault is found by the checks its sheet names, and what finds it stands in the study."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.bench.days import apparatus, day_of, detector, play_actions
from virtual_lab import catalog
from virtual_lab.bench.day.actions import action_of
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.doubts import fault_sheets
from virtual_lab.bench.day.readings import CLOCK, suspected_faults
from virtual_lab.bench.day.table import action_table, detectable
from virtual_lab.bench.machines.checks import _chart_rows
from virtual_lab.bench.machines.stored_day import run_operator
from virtual_lab.errors import InputError

STUDY = Path(__file__).with_name("study-2026-11-22.txt")
ROW = re.compile(r"^  ([\w-]+) +(\d+)$", re.MULTILINE)


@pytest.mark.parametrize("fault", detectable())
def test_a_fault_is_found_by_its_checks_and_no_other_is_named(fault: str) -> None:
    day = run_operator(apparatus(fault), detector(fault))
    assert {doubt.fault for doubt in suspected_faults(Desk(day))} == {fault}


SOUND_TOO = ("encoder-slip", "bat-cracked", "bearing-friction", "pendulum-wide", "pivot-off")


@pytest.mark.parametrize("fault", [*SOUND_TOO, "clamp-forgotten", "gate-clock", "wrong-lot"])
def test_a_check_suspects_no_fault_on_a_day_without_a_fault(fault: str) -> None:
    assert list(suspected_faults(Desk(run_operator(apparatus(), detector(fault))))) == []


@pytest.mark.parametrize("name", ["reweigh-balls", "recheck-balls"])
def test_a_repeated_reading_needs_the_first(name: str) -> None:
    with pytest.raises(InputError, match="comes first"):
        play_actions(apparatus(), [action_of(name)])


def test_a_pendulum_released_too_far_shows_at_every_angle() -> None:
    for amplitude in (2, 4, 20, 45):
        days = [("fit-clamp", {}), ("swing", {"amplitude": amplitude})]
        named = [
            {doubt.fault for doubt in suspected_faults(Desk(day_of(days, *faults)))}
            for faults in ((), ("pendulum-wide",))
        ]
        assert named == [set(), {"pendulum-wide"}]


def test_every_check_of_a_fault_is_an_action_at_the_bench() -> None:
    for sheet in fault_sheets().values():
        if sheet.found_by:
            assert set(sheet.found_by.actions) <= action_table().actions.keys()
            assert set(sheet.found_by.unless) <= set(catalog.names("faults")) - {sheet.name}


def test_detectable_faults_are_those_found_on_99_of_100_days() -> None:
    """`python -m tests.bench.study detection --days 100`, kept with its date."""
    found = {name: int(days) for name, days in ROW.findall(STUDY.read_text("utf-8"))}
    assert found.keys() == set(detectable())
    assert min(found.values()) >= 99


def test_a_clock_that_runs_fast_is_shown_fast() -> None:
    """By the fault's 100 ppm more than on the mornings before, to the 2 ppm of a comparison."""
    day = run_operator(apparatus("gate-clock"), detector("gate-clock"))
    event = Desk(day).last("compare-clock")
    assert event is not None
    shown = {what: value for what, value, _ in event.shown}
    off = shown[f"{CLOCK}, today"] - shown[f"{CLOCK}, chart"]
    assert off == pytest.approx(100, abs=10)


def test_a_chart_shows_mean_and_scatter_of_its_mornings() -> None:
    """1, 2, 3: mean 2, s = 1 of a sample."""
    shown = _chart_rows("ratio", 2.5, np.array([1.0, 2.0, 3.0]), 3, "ppm")
    assert [value for _, value, _ in shown] == [2.5, 2.0, 1.0]
