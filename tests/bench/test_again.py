"""The debrief: shift of the result by each fault, its time line, a day taken again."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.bench.days import PLAIN, apparatus, asked, day_of, debrief_of, play_actions
from tests.bench.test_web import Browser
from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.operators import operator_of
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.entrance.review import summary
from virtual_lab.bench.entrance.served_day import ServedDay
from virtual_lab.bench.machines.stored_day import StoredDay
from virtual_lab.bench.scoring.debrief import debrief
from virtual_lab.bench.scoring.debrief_page import debrief_page
from virtual_lab.errors import InputError

END = (("reduce", {}), ("give-verdict", {"verdict": "PASS"}), ("hand-in", {}))
LOOKED = (*PLAIN[:11], ("gauge-gates", {}), ("tap-bat", {}), *PLAIN[11:])


def test_the_effect_of_a_fault_equals_the_difference_from_a_day_without_it() -> None:
    """Against the same actions really taken in a sound laboratory."""
    closing = debrief_of(day_of([*PLAIN, *END], "gate-moved"), "gate-moved")
    with_it, without = (Desk(day_of(PLAIN, *faults)).result for faults in (("gate-moved",), ()))
    assert with_it
    assert without
    (review,) = closing.fault_reviews
    assert review.moved == pytest.approx(with_it[0] - without[0], rel=1e-9)
    assert abs(review.moved) > 1e-3
    page = debrief_page(closing)
    assert f"{review.moved:+.4f}" in page
    assert f"{review.moved / with_it[1]:+.1f} u" in page


def test_a_time_line_has_minutes_and_shots() -> None:
    """Gauged as entry 12; named nine entries and a shot later, put right by the gauge."""
    noted = ("note-doubt", {"doubt": "gate-moved", "confidence": 90})
    days = [*LOOKED[:20], noted, ("gauge-gates", {"use": "gauge"}), *LOOKED[20:], *END]
    day = day_of(days, "gate-moved")
    closing = debrief_of(day, "gate-moved")
    (review,) = closing.fault_reviews
    seen, named, acted = review.yours.seen, review.yours.named, review.yours.acted
    assert seen
    assert named
    assert acted
    assert (seen.entry, seen.shots) == (12, 0)
    assert seen.minute == pytest.approx(sum(event.seconds for event in day.events[:12]) / 60)
    assert (named.entry, named.shots, acted.entry) == (21, 1, 22)
    assert review.expert.seen
    assert "1 shots later" in review.yours.delay
    page = debrief_page(closing, linked=True)
    assert '<a href="/replay?entry=12">entry 12</a>' in page
    assert "/replay" not in debrief_page(closing)


@pytest.fixture(scope="module")
def handed_in(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("days") / "Ada" / "1"
    folder.parent.mkdir()
    kept = StoredDay.begin(folder, load_scenario("tuesday"), 3)
    for action in asked([*PLAIN, *END]):
        kept.do(action)
    return folder


def test_a_branch_repeats_the_draws_of_its_day_and_counts_as_practice(
    handed_in: Path, tmp_path: Path
) -> None:
    source = StoredDay(handed_in)
    again = StoredDay.branch(handed_in, 15, tmp_path / "again")
    assert (again.day.practice, len(again.day.events)) == (15, 15)
    for event in source.day.events[15:]:
        assert again.do(Action(name=event.action, arguments=event.arguments)) == event
    assert debrief(again.apparatus, again.day, again.scenario).practice == 15


@pytest.mark.parametrize("entry", [-1, 1000])
def test_a_branch_from_a_missing_entry_is_refused(
    entry: int, handed_in: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=r"entry = .*allowed: 0 to"):
        StoredDay.branch(handed_in, entry, tmp_path / "again")
    assert not (tmp_path / "again").exists()


def test_an_unfinished_day_cannot_be_branched(tmp_path: Path) -> None:
    StoredDay.begin(tmp_path / "day", load_scenario("tuesday"), 3).do(action_of("tare"))
    with pytest.raises(InputError, match="has not been handed in"):
        StoredDay.branch(tmp_path / "day", 1, tmp_path / "again")


def test_the_table_of_a_class_leaves_practice_out(handed_in: Path, tmp_path: Path) -> None:
    shutil.copytree(handed_in, tmp_path / "Ada" / "1")
    StoredDay.branch(handed_in, 15, tmp_path / "Ada" / "2").run_operator(operator_of("book"))
    assert [row.trainee for row in summary(tmp_path).rows] == ["Ada/1"]


def test_the_page_leads_from_the_debrief_to_the_entry_and_to_practice(handed_in: Path) -> None:
    room = ServedDay(handed_in, load_scenario("tuesday"), None)
    room.open()
    browser = Browser(room)
    browser.open()
    assert "Practice from this entry" in browser.ask("/replay?entry=5").text
    assert browser.ask("/branch", {"entry": "999"}).status == 422
    assert browser.ask("/branch", {"entry": "5"}).status == 303
    assert "Practice</strong>: repeats an earlier day from entry 5" in browser.ask("/").text
    assert browser.ask("/branch", {"entry": "2"}).status == 422  # it is not handed in


def test_a_result_entered_after_the_certificate_is_refused() -> None:
    given = [*PLAIN, *END[:2], ("enter-result", {"BPF": 0.95})]
    with pytest.raises(InputError, match="has been reduced"):
        play_actions(apparatus(), asked(given))
