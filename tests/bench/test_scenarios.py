"""What a scenario chooses: limit, feedback, checklists, exam, another laboratory's records."""

import html
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tests.bench.days import PLAIN, apparatus, asked
from virtual_lab import catalog
from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.day import Day, ready_steps
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.doubts import fault_sheets
from virtual_lab.bench.day.operators import operator_of
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.day.table import preparation
from virtual_lab.bench.entrance.review import replay
from virtual_lab.bench.entrance.served_day import ServedDay
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.stored_day import (
    LOG,
    SECRET,
    StoredDay,
    do_action,
    laboratory_of,
    run_operator,
)
from virtual_lab.bench.pages.page import day_page, wall_page
from virtual_lab.bench.scoring.debrief import debrief_of
from virtual_lab.cli import cli
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Procedure


def begun(folder: Path, name: str) -> StoredDay:
    return StoredDay.begin(folder / name, load_scenario(name), 3)


def on_the_page(folder: Path, name: str) -> ServedDay:
    day = ServedDay(folder / name, load_scenario(name), None)
    day.open()
    return day


def shown(day: StoredDay, name: str, **given: object) -> dict[str, object]:
    return {what: value for what, value, _ in day.do(action_of(name, given)).shown}


def test_eight_scenarios_ship_and_are_documented() -> None:
    names = catalog.names("bench/scenarios")
    assert len(names) >= 8
    page = (Path(__file__).parents[2] / "virtual_lab/docs/scenarios.md").read_text("utf-8")
    assert [name for name in names if f"`{name}`" not in page] == []


def test_no_scenario_tests_a_bat_that_its_rules_exempt() -> None:
    """The BBCOR rules exempt one-piece wood bats, so no verdict on one can be right."""
    exempt = 0
    for name in catalog.names("bench/scenarios"):
        told = load_scenario(name).spec
        rules = catalog.load("procedures", told.procedure, Procedure).spec
        if rules.eligibility is not None and rules.eligibility.exempt:
            assert rules.eligibility.exempt == "one-piece wood bats"
            assert "wood" not in catalog.load_bat(told.bat).spec.title
            exempt += 1
    assert exempt >= 3


def to_two_undecided_hits(look: Callable[[], Desk]) -> Iterator[Action]:
    """Fire where the rules ask for it until two hits are within the windows; decide none."""
    yield from map(action_of, preparation())
    while len(look().undecided_hits) < 2:
        if look().needs_position:
            yield action_of("set-place", {"place": round((look().next_position or 0.0) * 1e3, 3)})
        yield action_of("load-ball", {"ball": look().next_ball + 1})
        yield from map(action_of, (*ready_steps(look().day), "fire"))


def test_a_college_day_shows_its_rules_and_the_hits_that_hold_the_scan() -> None:
    """Two undecided hits hold the scan; accepted, they send it on by its first step, 1 in."""
    told = load_scenario("college-day").spec
    machines = Apparatus(laboratory_of(told, 3, b""))
    held = Desk(run_operator(machines, to_two_undecided_hits))
    assert len(held.undecided_hits) == 2
    assert all(not held.reasons[shot] for shot in held.undecided_hits)
    page = day_page(held, told.briefing())
    place = re.search(r"still requires hits at ([\d.]+) mm", page)
    following = re.search(r"the next impact position is ([\d.]+) mm", page)
    assert place
    assert following
    assert float(following[1]) - float(place[1]) == pytest.approx(25.4, abs=0.6)
    assert page.count('value="accept-within"') == 2  # beside the sentence and in the part of hits
    accepted = held
    for shot in held.undecided_hits:
        action = action_of("accept", {"shot": shot + 1})
        accepted = accepted.after(do_action(machines, accepted.day, action))
    assert accepted.next_position == held.with_undecided_accepted.next_position
    assert "Undecided hits do not count" not in day_page(accepted, told.briefing())

    reduced = accepted.after(do_action(machines, accepted.day, action_of("reduce")))
    rules = [str(value) for what, value, _ in reduced.day.events[-1].shown if "rule" in what]
    less = re.match(r"length in inches minus weight in ounces ([\d.]+), allowed up to 3", rules[0])
    length, mass = (
        np.mean([float(value) for _, value, _ in event.shown])
        for name in ("measure-length", "weigh-bat")
        if (event := reduced.last(name))
    )
    assert less
    assert float(less[1]) == pytest.approx(length / 25.4 - mass / 28.349523, abs=0.03)
    assert "allowed up to 2.625 in (ring gauge)" in rules[2]
    assert "moment of inertia" in rules[3]
    assert all(html.escape(rule) in day_page(reduced, told.briefing()) for rule in rules)


def test_rules_have_the_units_of_the_rule_book_and_si() -> None:
    """136 mph is 136 x .44704 m/s, 2.625 in x 25.4 mm, 9530 oz in^2 x .0283495 x .0254^2 kg m^2."""
    told = load_scenario("college-day").spec
    text = catalog.load("procedures", "bbcor", Procedure).text
    session = replace(apparatus().laboratory.session, procedure_text=text)
    page = wall_page(Desk(Day(morning=session, balls=12)), told.briefing(), "rules")
    for words in (
        "136 mph (60.8 m/s)",
        "2.625 in (66.67 mm)",
        "12 deg",
        "0.3 mm",
        "5.25 oz (148.8 g)",
    ):
        assert f">{words}<" in page
    assert "6805, 7630, 8538, 9530 oz in² (0.1245, 0.1396, 0.1562, 0.1743 kg m²)" in page


def test_a_fault_that_no_check_finds_is_in_no_scenario(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    text = load_scenario("plain-day").text
    path.write_text(
        text.replace("procedure =", 'faults = ["records-swapped"]\nprocedure ='), "utf-8"
    )
    with pytest.raises(InputError, match=r"no check at the bench finds records-swapped"):
        load_scenario(str(path))


def test_faults_befall_days_at_the_rates_of_the_scenario(tmp_path: Path) -> None:
    """Of 4 000 days each fault befalls 10 %, within 4 standard errors; the page lists them all."""
    told = load_scenario("tuesday").spec
    drawn = [told.draw_faults(seed).faults or () for seed in range(4000)]
    for fault, rate in told.may_go_wrong.items():
        share = sum(fault in faults for faults in drawn) / len(drawn)
        assert abs(share - rate) < 4 * (rate * (1 - rate) / len(drawn)) ** 0.5
    seed = next(seed for seed, faults in enumerate(drawn) if faults)
    day = StoredDay.begin(tmp_path / "day", load_scenario("tuesday"), seed)
    assert day.scenario.faults == StoredDay(tmp_path / "day").scenario.faults == drawn[seed]
    listed = wall_page(day.desk, day.log.morning["briefing"], "rules")
    assert all(fault_sheets()[fault].title in listed for fault in told.may_go_wrong)
    assert told.laboratory
    assert all(how in listed for how in told.laboratory.values())


def test_a_scenario_replaces_the_limit_of_its_procedure(tmp_path: Path) -> None:
    day = begun(tmp_path, "at-the-limit")
    assert day.desk.rules.spec.metric_limit == 0.955
    for action in asked([*PLAIN, ("reduce", {})]):
        day.do(action)
    assert day.desk.certification.marginal
    with pytest.raises(InputError, match="your verdict precedes the program's"):
        on_the_page(tmp_path, "at-the-limit").certificate()
    day.do(action_of("give-verdict", {"verdict": "PASS"}))
    assert "0.955" in on_the_page(tmp_path, "at-the-limit").certificate()


def test_feedback_during_the_day_names_omitted_steps(tmp_path: Path) -> None:
    first, plain = (begun(tmp_path, name) for name in ("first-day", "plain-day"))
    assert "skipped: tare the scale" in shown(first, "weigh-bat")
    assert not any("skipped" in what for what in shown(plain, "weigh-bat"))
    assert not any("skipped" in what for what in shown(first, "measure-length"))


def test_a_checklist_marks_the_steps_done(tmp_path: Path) -> None:
    day = begun(tmp_path, "first-day")
    day.do(action_of("tare"))
    listed = shown(day, "start-checklist")
    assert listed["Tare the scale"] == "done"
    assert listed["Tap the bat"] == "not done"
    day.do(action_of("weigh-bat"))
    assert shown(day, "end-checklist")["Every hit accepted or rejected"] == "done"
    with pytest.raises(InputError, match="has no checklists"):
        begun(tmp_path, "plain-day").do(action_of("start-checklist"))


def test_an_exam_tells_nothing_before_the_trainer_opens_it(tmp_path: Path) -> None:
    day = begun(tmp_path, "exam-day")
    assert shown(day, "enter-result", e_A="0,25") == {"e_A": 0.25}
    day.run_operator(operator_of("book"))
    with pytest.raises(InputError, match="trainer"):
        on_the_page(tmp_path, "exam-day").debrief()
    assert on_the_page(tmp_path, "exam-day").motion(1) is None
    assert not (tmp_path / "exam-day" / "debrief.json").exists()
    assert debrief_of(day).missed == day.scenario.faults


def test_records_of_another_laboratory_are_judged_with_its_machines_far(tmp_path: Path) -> None:
    day = begun(tmp_path, "records")  # whose draw of this seed is a gate that triggers twice
    assert day.scenario.faults == ("gate-doubles",)
    assert day.day.supplied_events == len(day.day.events) > 20
    assert len(day.day.fired) >= 6
    for name in ("tare", "fire", "tap-bat", "gauge-gates"):
        with pytest.raises(InputError, match="came from another laboratory"):
            day.do(action_of(name))
    again = StoredDay(tmp_path / "records")
    assert again.day == day.day
    day.run_operator(operator_of("expert"))
    told = debrief_of(day)
    assert told.found == ("gate-doubles",)
    assert {score.name: score.value for score in told.scores}["record"] == 1
    assert any(step.done != "done" and step.excuse for step in told.steps)
    line = told.fault_reviews[0].yours
    assert line.seen.entry <= day.day.supplied_events < line.named.entry


def test_the_page_shows_the_digest_of_the_sealed_file(tmp_path: Path) -> None:
    day = begun(tmp_path, "plain-day")
    shown_first = on_the_page(tmp_path, "plain-day").briefing["commitment"]
    assert day.seal.startswith("intact")
    assert str(shown_first) in day.seal


def test_a_day_can_begin_again_after_a_crash_at_its_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sealed file is on disk, the log is not yet."""
    folder, scenario = tmp_path / "day", load_scenario("plain-day")
    with monkeypatch.context() as broken:
        broken.setattr("virtual_lab.bench.machines.stored_day.DayLog.create", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            StoredDay.begin(folder, scenario, 3)
    day = StoredDay.begin(folder, scenario, 3)
    assert {path.name for path in folder.iterdir()} == {LOG, SECRET}
    assert day.seal.startswith("intact")


def test_commands_list_a_class_replay_a_day_and_try_a_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(*words: str) -> object:
        do_action = CliRunner().invoke(cli, ["rehearse", *words, "--json"], catch_exceptions=False)
        return json.loads(do_action.stdout)

    monkeypatch.setattr("virtual_lab.bench.entrance.review.TRIED", (1,))
    begun(tmp_path, "plain-day").do(action_of("tare"))
    (tmp_path / "class").mkdir()
    exam = begun(tmp_path / "class", "exam-day")
    exam.run_operator(operator_of("book"))
    (tmp_path / "class" / "exam-day").rename(tmp_path / "=cmd")
    rows = {row["trainee"]: row for row in run("summary", str(tmp_path))}
    assert rows.keys() == {"'=cmd", "plain-day"}
    assert rows["plain-day"]["verdict"] == "not handed in"
    assert rows["'=cmd"]["brier"] < 0.02
    assert (tmp_path / "=cmd" / "debrief.html").exists()

    entries = run("--replay", str(tmp_path / "=cmd" / LOG))
    assert [row["action"] for row in entries][:2] == ["Tare the scale", "Weigh the bat"]
    assert {row["same"] for row in entries} == {True}
    text = replay(tmp_path / "=cmd").text
    assert max(map(len, text.splitlines())) <= 100
    words = " ".join(text.split())
    for row in entries:
        assert all(row[key] in words for key in ("action", "entered", "shown"))
    with pytest.raises(InputError, match="not handed in"):
        run("--replay", str(tmp_path / "plain-day"))
    for other in ("copy.sqlite", "nowhere"):  # never the day that lies beside it
        with pytest.raises(InputError, match=r"allowed: an existing day\.sqlite, or its folder"):
            run("--replay", str(tmp_path / "=cmd" / other))

    tried = run("check", "short-day")
    assert {row["operator"] for row in tried} == {"book", "expert"}
    with pytest.raises(InputError, match="no folder in it"):
        run("summary", str(tmp_path / "no"))
