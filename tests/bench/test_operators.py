"""Operators and the debrief: who does what, what is found, what is scored, what cost most."""

import json
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner
from scipy import stats

import virtual_lab as vl
from tests.bench.days import (
    PLACE_MM,
    PLAIN,
    SALT,
    SEED,
    after_plain,
    apparatus,
    asked,
    day_of,
    debrief_of,
    experts,
    play_actions,
    scenario,
)
from virtual_lab import catalog
from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.day import Day, ready_steps
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.doubts import fault_titles
from virtual_lab.bench.day.operators import Look, Operator, _confidence, by_script, operator_of
from virtual_lab.bench.day.readings import suspected_faults
from virtual_lab.bench.day.scenario import Scenario, load_scenario
from virtual_lab.bench.day.table import PREPARING, detectable, preparation
from virtual_lab.bench.entrance import operated_day
from virtual_lab.bench.entrance.operated_day import RehearsedDay
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.stored_day import StoredDay, laboratory_of, run_operator
from virtual_lab.bench.scoring.costs import _cost, actions_to_replay
from virtual_lab.bench.scoring.debrief import Debrief, TimeLine, debrief
from virtual_lab.bench.scoring.debrief_page import debrief_page
from virtual_lab.cli import cli
from virtual_lab.errors import InputError
from virtual_lab.records.origin import DAY_FILES

END = (("reduce", {}), ("give-verdict", {"verdict": "PASS"}), ("hand-in", {}))


@cache
def day_by(name: str, *faults: str) -> Day:
    if name == "expert":
        return experts(*faults)
    return run_operator(apparatus(*faults), operator_of(name, 4))


@cache
def debrief_by(name: str, *faults: str) -> Debrief:
    return debrief_of(day_by(name, *faults), *faults)


def scores(found: Debrief) -> dict[str, float]:
    return {score.name: score.value for score in found.scores}


def test_the_operator_book_scores_full_marks() -> None:
    found = debrief_by("book")
    assert found.verdict == found.right_verdict == "PASS"
    assert found.costly == ()
    assert scores(found) == pytest.approx(dict.fromkeys(scores(found), 1.0), abs=1e-6)
    assert found.nothing_wrong
    assert found.faults == found.false_alarms == ()


def test_an_expert_adds_checks_and_changes_no_result() -> None:
    done = {event.action for event in day_by("expert").events}
    assert {"tap-bat", "weigh-check-mass", "fire-check-cylinder", "gauge-gates"} <= done
    assert debrief_by("expert").value == debrief_by("book").value
    assert debrief_by("expert").false_alarms == ()
    assert debrief_by("expert").minutes > debrief_by("book").minutes


@pytest.mark.parametrize("fault", ["scale-not-tared", "encoder-half-counts"])
def test_an_expert_finds_what_the_book_does_not(fault: str) -> None:
    assert debrief_by("expert", fault).found == (fault,)
    assert fault not in {doubt.fault for doubt in suspected_faults(Desk(day_by("book")))}


def test_only_a_remedied_fault_leaves_a_verdict() -> None:
    """A gate gauged and reduced with, a dish taken off the scale: as on a sound day.

    A cracked bat has no remedy. Balls of another lot than those at the wall leave no trace, and
    the book does not look.
    """
    gauged, weighed = debrief_by("expert", "gate-moved"), debrief_by("expert", "scale-not-tared")
    cracked = debrief_by("expert", "bat-cracked")
    assert gauged.verdict == gauged.right_verdict == "PASS"
    assert weighed.verdict == weighed.right_verdict == "PASS"
    assert cracked.verdict == cracked.right_verdict == "INVALID"
    assert [scores(each)["result"] for each in (gauged, weighed, cracked)] == [1.0, 1.0, 1.0]
    missed = debrief_by("book", "wrong-lot")
    assert (missed.verdict, missed.right_verdict) == ("PASS", "INVALID")
    assert scores(missed)["result"] < 0.5
    assert scores(missed)["detection"] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("name", catalog.names("bench/scenarios"))
def test_an_expert_has_a_check_for_every_fault_of_a_scenario(name: str) -> None:
    """Its checks found each of these on 100 days of 100; names give nothing away."""
    found = load_scenario(name).spec
    assert {*found.may_go_wrong, *(found.faults or ())} <= set(detectable())
    told = {key: value for key, value in found.briefing().items() if key != "may_go_wrong"}
    told_of = " ".join(map(str, told.values()))
    assert not any(fault in told_of + name for fault in fault_titles())


def test_an_expert_uses_the_gauge_after_a_gate_was_moved() -> None:
    used = [event for event in day_by("expert", "gate-moved").events if event.constants]
    assert [event.action for event in used] == ["gauge-gates"]


def test_the_careless_operator_skips_steps_and_accepts_hits() -> None:
    found, day = debrief_by("careless"), day_by("careless")
    assert scores(found)["protocol"] < 0.9
    assert scores(found)["record"] < 1
    (left,) = (each.because for each in found.scores if each.name == "protocol")
    assert "skipped: clear away the sabot scrap" in left  # as on its button
    page = debrief_page(found)
    assert " m/s, allowed " in page  # in the scenario's units alone
    assert " mph" not in page
    waved = [e for e in day.events if e.arguments.get("because") == "near enough"]
    assert waved
    assert found.costly


def test_the_cheating_operator_rejects_high_hits() -> None:
    """Every reason given against the windows is on a hit above the middle of those before."""
    day = day_by("cheating")
    made_up = [e.arguments["shot"] for e in day.events if "sound right" in str(e.arguments)]
    assert made_up
    assert scores(debrief_by("cheating"))["record"] < 0.9
    assert scores(debrief_by("cheating"))["protocol"] == 1.0


def test_the_cost_of_a_decision_equals_the_gain_of_a_day_without_it() -> None:
    """Against a day that was really taken otherwise: the balance entered in inches."""
    wrong = [
        (name, given | {"end": "knob"} if name == "measure-balance" else given)
        for name, given in PLAIN
    ]
    day, sound = day_of([*wrong, *END]), after_plain(*END)
    found = debrief_of(day)
    entry = next(e.number for e in day.events if e.action == "measure-balance")
    costs = {each.entry: each for each in found.costly}
    other = Desk(sound).certification.metric
    assert other is not None
    if found.value is None:
        assert costs[entry].word == "this decision prevents a result"
    else:
        cost = abs(found.value - found.truth) - abs(other.value - found.truth)
        assert costs[entry].cost == pytest.approx(cost, rel=1e-9)


def to_seven_shots(end: str, decide: str = "") -> Operator:
    """Return who fires seven balls where the bench asks for them, with three steps left out.

    The hits stay undecided, or are decided by the windows or all rejected.
    """

    def played(look: Look) -> Iterator[Action]:
        for name in preparation():
            if name not in PREPARING:
                yield action_of(name, {"end": end} if name == "measure-balance" else {})
        place = look().next_position
        assert place is not None
        yield action_of("set-place", {"place": 1e3 * place})
        for shot in range(1, 8):
            yield action_of("load-ball", {"ball": look().next_ball + 1})
            yield from map(action_of, (*ready_steps(look().day), "fire"))
            why = look().reasons[-1] if decide == "windows" else decide
            if why:
                yield action_of("reject", {"shot": shot, "because": why})
            elif decide:
                yield action_of("accept", {"shot": shot})

    return played


def refused(end: str, decide: str = "") -> Debrief:
    """Return the debrief of the seven shots, refused as INVALID without a reduction.

    In this laboratory a balance point from the knob moves the shots by more than the windows allow.
    """
    there = Apparatus(laboratory_of(scenario(), 5, SALT))
    last = asked([("give-verdict", {"verdict": "INVALID", "confidence": 90}), ("hand-in", {})])

    def played(look: Look) -> Iterator[Action]:
        yield from to_seven_shots(end, decide)(look)
        yield from last

    return debrief(there, run_operator(there, played), scenario())


@pytest.mark.parametrize("decide", ["", "windows"])
def test_a_debrief_without_a_result_names_the_entry_that_prevented_it(decide: str) -> None:
    """The bench then asks for shots elsewhere, so the corrected day must fire elsewhere too.

    Three steps were left out as well; each of these alone prevents nothing.
    """
    found = refused("knob", decide)
    assert [each.what for each in found.costly] == [
        "find the balance point: knob instead of from the tip"
    ]
    assert found.costly[0].word == "this decision prevents a result"
    assert (found.verdict, found.right_verdict) == ("INVALID", "INVALID")
    assert found.right_because == "the day has no result"
    assert found.brier == pytest.approx(0.01)
    (result,) = (each for each in found.scores if each.name == "result")
    assert (result.value, result.because) == (0.0, "no result, although the bat could be judged")
    assert found.change.startswith("result: ")  # economy is 0 because the result is
    differ = "The correct verdicts differ: INVALID for your day, which has no result; PASS for the"
    assert found.expert.apart.startswith(differ)


@pytest.mark.parametrize(("place", "replayed"), [(PLACE_MM, {}), (120.0, {"place": 120.0})])
def test_only_a_required_impact_position_follows_the_readings_of_a_replay(
    place: float, replayed: dict[str, float]
) -> None:
    before = PLAIN[: len(preparation())]
    set_place = ("set-place", {"place": place})
    assert actions_to_replay(day_of([*before, set_place]))[-1].arguments == replayed
    first, *_ = actions_to_replay(day_of([set_place, *before]))
    assert first.arguments == {"place": place}  # nothing was required yet


@pytest.mark.parametrize(("decide", "hits"), [("", 7), ("a feeling", 3)])
def test_a_debrief_names_hits_whose_decisions_prevent_a_result(decide: str, hits: int) -> None:
    """No single hit would be enough. Four balls hit a frame: their rejection is justified."""
    found = refused("tip", decide)
    (costly,) = found.costly
    assert costly.what == f"{hits} hits undecided, or decided against the windows"
    assert costly.word == "this decision prevents a result"


def test_a_single_undecided_hit_is_a_decision_with_a_cost() -> None:
    """Against the day with this hit accepted."""
    accepted = Desk(after_plain()).result
    found = debrief_of(day_of([*PLAIN[:-1], *END]))
    assert accepted
    assert found.value is not None
    assert found.truth is not None
    (costly,) = found.costly
    assert (costly.entry, costly.what) == (0, "hit 7 undecided (it is within all windows)")
    cost = abs(found.value - found.truth) - abs(accepted[0] - found.truth)
    assert costly.cost == pytest.approx(cost, rel=1e-9)


@pytest.mark.parametrize(
    ("decide", "message"),
    [
        ("", "undecided: 1, 2, 3, 4, 5, 6, 7$"),
        ("windows", "fire again, or give the verdict INVALID"),
    ],
)
def test_a_reduction_without_a_result_is_refused_and_leaves_the_day_open(
    decide: str, message: str, tmp_path: Path
) -> None:
    day = StoredDay.begin(tmp_path / "day", load_scenario("short-day"), SEED)
    day.run_operator(to_seven_shots("knob", decide))
    entries = len(day.log.events())
    with pytest.raises(InputError, match=f"fewer than two hits were valid.*{message}"):
        day.do(action_of("reduce"))
    assert len(day.log.events()) == entries
    day.do(action_of("measure-balance"))
    for shot in range(1, 8):
        day.do(action_of("accept", {"shot": shot, "because": "the balance point was wrong"}))
    day.do(action_of("reduce"))
    assert day.day.reduced


def test_an_operator_without_a_result_does_not_reduce(tmp_path: Path) -> None:
    text = load_scenario("plain-day").text.replace(
        'procedure = "astm-f1881"', 'procedure = "astm-f1881"\nfaults = ["balance-from-knob"]'
    )
    entry = catalog.read(text, "test", Scenario)
    day = StoredDay.begin(tmp_path / "day", entry, SEED).run_operator(operator_of("book"))
    assert (day.reduced, day.verdict, day.handed_in) == (False, "INVALID", True)


def test_the_best_scores_are_all_named() -> None:
    assert debrief_by("book").keep == ("result, detection, protocol, record, economy: 1.00 each")
    assert debrief_by("careless").keep.startswith("detection: ")


def test_a_cost_needs_two_results_and_the_truth() -> None:
    def words(*values: float | None, truth: float | None) -> list[str]:
        return [each.word for each in _cost(1, "x", *values, truth, 0.0)]

    assert words(2.0, 1.0, truth=None) == []
    assert words(2.0, 1.0, truth=1.0) == ["cost"]
    assert words(None, 1.0, truth=None) == ["this decision prevents a result"]
    assert words(1.0, None, truth=1.0) == ["there is no result without this decision"]
    assert words(None, None, truth=None) == []


def test_a_checklist_hides_neither_costs_nor_effects_of_faults() -> None:
    fault = "gate-moved"
    plain = day_by("careless", fault)
    actions = [Action(name=event.action, arguments=event.arguments) for event in plain.events]
    listed = run_operator(
        apparatus(fault),
        lambda _: iter([action_of("start-checklist"), *actions]),
        replace(plain.until(0), checklists=True),
    )
    found, expected = debrief_of(listed, fault), debrief_by("careless", fault)
    assert [(each.what, each.cost) for each in found.costly] == [
        (each.what, each.cost) for each in expected.costly
    ]
    assert found.costly
    (moved,), (expected_moved,) = (
        [each.moved for each in debriefed.fault_reviews] for debriefed in (found, expected)
    )
    assert moved == expected_moved is not None


def test_a_lucky_mistake_is_called_luck() -> None:
    """Hits thrown out one at a time: some must bring the mean nearer to the truth."""
    words = set()
    for shot in (1, 3, 4, 5, 6, 7):
        day = after_plain(("reject", {"shot": shot, "because": "a feeling"}), *END)
        each = debrief_of(day).costly[0]
        assert (each.cost < 0) == each.word.startswith("luck")
        words.add(each.word.split(":")[0])
        if len(words) == 2:
            break
    assert words == {"cost", "luck"}


def test_a_justified_deviation_is_not_marked_down() -> None:
    days = [each for each in PLAIN if each[0] != "level-stand"]
    note = ("note-deviation", {"step": "level-stand", "because": "the stand levels itself"})
    bare, excused = (
        scores(debrief_of(day_of(each), scores_only=True))["protocol"]
        for each in ([*days, *END], [note, *days, *END])
    )
    assert bare < excused == 1.0


def test_a_confident_false_alarm_costs_more() -> None:
    """By Brier: a false alarm of 30 % costs less than one of 90 %."""

    def score(confidence: float) -> float:
        doubt = ("note-doubt", {"doubt": "gate-moved", "confidence": confidence})
        day = after_plain(doubt, *END)
        return scores(debrief_of(day, scores_only=True))["detection"]

    assert score(30) == pytest.approx(1 - 0.09)
    assert score(90) == pytest.approx(1 - 0.81)


def test_a_wrong_verdict_scores_nothing() -> None:
    day = replace(after_plain(*END), verdict="FAIL")
    assert scores(debrief_of(day, scores_only=True))["result"] == 0


def test_a_fail_is_explained_in_the_debrief_and_the_bench_gives_no_verdict() -> None:
    """A limit of .9 for a bat of .947, by the truth; the verdict is the trainee's before that."""
    strict = scenario(limit=0.9)
    there = Apparatus(laboratory_of(strict, SEED, SALT))
    end = (("reduce", {}), ("give-verdict", {"verdict": "FAIL"}), ("hand-in", {}))
    day = play_actions(there, asked([*PLAIN, *end]))
    (reduced,) = (event for event in day.events if event.action == "reduce")
    found = debrief(there, day, strict)
    words = {what: str(value) for what, value, _ in reduced.shown}
    value, u = (float(words[what]) for what in ("Bat performance factor", "standard uncertainty"))
    low, high = (float(end) for end in words["95 % interval"].split(" to "))
    assert words.pop("limit") == "0.900"
    assert (low + high) / 2 == pytest.approx(value, abs=1e-4)
    assert 1.9 * u < (high - low) / 2 < 2.8 * u
    assert not any(each in " ".join(words.values()) for each in ("PASS", "FAIL", "above"))
    assert found.right_verdict == "FAIL"
    assert found.right_because == f"BPF {found.truth:.4f} is above the limit 0.900"
    assert found.right_because in debrief_page(found)
    assert debrief_by("book").right_because == ""


def test_the_debrief_is_closed_until_the_day_ends() -> None:
    with pytest.raises(InputError, match="handed in"):
        debrief_of(after_plain())


def test_what_is_typed_is_escaped() -> None:
    note = ("note-deviation", {"because": "<script>alert(1)</script>"})
    day = after_plain(note, *END)
    page = debrief_page(debrief_of(day))
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_a_script_is_played_line_by_line_and_a_wrong_line_is_named(tmp_path: Path) -> None:
    actions = [{"do": name, **given} for name, given in (*PLAIN, *END)]
    path = tmp_path / "day.json"
    path.write_text(json.dumps({"actions": actions}), "utf-8")
    found = vl.rehearse(script=path, seed=3)
    assert found.debrief.value == debrief_by("book").value
    with pytest.raises(InputError, match=r"day.json: actions\[1\]; .*allowed"):
        by_script({"actions": [{"do": "sing"}]}, "day.json")
    with pytest.raises(InputError, match=r"actions\[2\]"):
        by_script({"actions": [{"do": "tare"}, "tare"]}, "day.json")
    for last, said in (("fire", "fire: ball; is missing"), ("tare", "not been handed in")):
        path.write_text(json.dumps({"actions": [{"do": "tare"}, {"do": last}]}), "utf-8")
        number = 2 if last == "fire" else 3
        with pytest.raises(InputError, match=rf"day.json: actions\[{number}\]; .*{said}"):
            vl.rehearse(script=path, seed=3)


def test_the_command_writes_a_day_and_its_debrief(tmp_path: Path) -> None:
    out = tmp_path / "day"
    given = ["rehearse", "--operator", "book", "--seed", "3", "--out", str(out), "--json"]
    done = CliRunner().invoke(cli, given, catch_exceptions=False)
    document = json.loads(done.stdout)
    assert document["value"] == debrief_by("book").value
    of_result = {"certificate.json", "certificate.html", "records", "settings.toml", "truth"}
    of_result |= {"readings.csv", "datapackage.json", "ro-crate-metadata.json", "SHA256SUMS"}
    assert {path.name for path in out.iterdir()} == of_result | set(DAY_FILES)
    settings = (out / "settings.toml").read_text()
    assert settings.startswith("# virtual-lab rehearse --config settings.toml\n")
    assert tomllib.loads(settings) == {"operator": "book"}
    again = vl.reduce(out / "records")
    assert again.document["metric"]["value"] == pytest.approx(document["value"], rel=1e-9)
    assert json.loads((out / "debrief.json").read_text("utf-8"))["verdict"] == "PASS"
    repeated = json.loads(json.dumps(vl.rehearse(script=out / "actions.json", seed=3).document))
    assert repeated == {key: document[key] for key in repeated} | {"seal": repeated["seal"]}


def test_a_script_that_stops_early_says_how_to_end(tmp_path: Path) -> None:
    path = tmp_path / "short.json"
    path.write_text('{"actions": [{"do": "tare"}]}', "utf-8")
    with pytest.raises(InputError, match=r"short.json: actions\[2\]; .*hand-in"):
        vl.rehearse(script=path, seed=3)


def test_the_text_names_each_fault_and_only_written_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The book does not look for a moved gate. Without --out no file is written or named."""
    found = debrief_by("book", "gate-moved")
    (review,) = found.fault_reviews
    assert review.moved is not None
    files = {"day.sqlite": b"", "sealed.json": b""}
    day = RehearsedDay(debrief=found, files=files, desk=Desk(day_by("book", "gate-moved")))
    monkeypatch.setattr(operated_day, "rehearse", lambda *_, **__: day)
    given, out = ["rehearse", "--operator", "book"], tmp_path / "day"
    printed = CliRunner().invoke(cli, given, catch_exceptions=False).stdout
    title = fault_titles()["gate-moved"]
    assert f"  fault, not named: {title}; effect on the result: {review.moved:+.4f}\n" in printed
    assert "day.sqlite" not in printed
    printed = CliRunner().invoke(cli, [*given, "--out", str(out)], catch_exceptions=False).stdout
    assert printed.endswith(f"{out / 'debrief.html'}\n")


def test_an_operator_sees_no_truth() -> None:
    """Two laboratories whose records agree so far get the same actions, whatever is sealed."""
    one = Apparatus(laboratory_of(scenario(), 3, SALT))
    cracked = apparatus("bat-cracked")
    before = [
        [action.name for _, action in zip(range(14), seen, strict=False)]
        for seen in (_first_actions(one), _first_actions(cracked))
    ]
    assert before[0] == before[1]


def _first_actions(machines: Apparatus):
    taken_day = run_operator(machines, _until_fire)
    return iter(asked([(e.action, dict(e.arguments)) for e in taken_day.events]))


def _until_fire(look):
    for action in operator_of("expert")(look):
        if action.name == "fire":
            return
        yield action


def test_the_debrief_compares_the_trainee_with_an_expert_on_the_same_day() -> None:
    """The same bat, balls and draws: hits of the same ball at the same place are the same hit."""
    longer = debrief_by("careless")
    assert len(longer.hits) == longer.shots > longer.expert.shots
    found = debrief_by("book", "gate-moved")
    assert found.expert.doubts == ("gate-moved",)
    assert "Measure the distances of the gates" in found.expert.checks
    same = [(mine, theirs) for mine, theirs in debrief_by("book").hits]
    assert all(mine == theirs for mine, theirs in same)
    review = found.fault_reviews[0]
    assert review.yours == TimeLine(seen=None, named=None, acted=None)
    assert review.checks == ("Measure the distances of the gates",)
    assert "You did not name it." in debrief_page(found)
    assert found.change.startswith(("protocol", "detection", "record", "result"))


@pytest.mark.parametrize(
    ("name", "faults", "limit", "said"),
    [
        (
            "book",
            ("gate-moved",),
            None,
            "INVALID for your day, whose result is wrong by more than U; PASS for the expert, who "
            "repaired the fault (m",
        ),
        ("book", ("ball-worn-out",), None, ""),
        ("book", (), 0.955, "Here the expert is wrong by chance"),
        ("book", ("bat-cracked",), None, ""),
        ("expert", ("gate-moved",), None, ""),
    ],
)
def test_the_debrief_explains_an_expert_whose_verdict_is_wrong(
    name: str, faults: tuple[str, ...], limit: float | None, said: str
) -> None:
    if limit is None:
        found = debrief_by(name, *faults)
    else:
        given = scenario(faults, limit=limit)
        machines = Apparatus(laboratory_of(given, 3, SALT))
        found = debrief(machines, run_operator(machines, operator_of(name, 4)), given)
    assert (found.expert.verdict == found.right_verdict) == (not said)
    assert said in found.expert.apart
    assert bool(said) == bool(found.expert.apart)
    assert found.expert.apart in debrief_page(found).replace("&#39;", "'")


def test_only_a_debrief_without_faults_and_mistakes_says_nothing_went_wrong() -> None:
    assert "Nothing went wrong" in debrief_page(debrief_by("book"))
    assert "Nothing went wrong" not in debrief_page(debrief_by("careless"))
    assert "Nothing went wrong" not in debrief_page(debrief_by("expert", "gate-moved"))


def test_the_debrief_lists_where_a_fault_showed_and_where_it_was_named() -> None:
    found = debrief_by("expert", "bat-cracked")
    events = {event.number: event for event in day_by("expert", "bat-cracked").events}
    (review,) = found.fault_reviews
    seen, named = review.yours.seen.entry, review.yours.named.entry
    assert events[seen].action == "tap-bat"
    assert events[named].arguments["doubt"] == "bat-cracked"
    assert seen < named


def test_the_confidence_in_the_verdict_is_scored_by_brier() -> None:
    for verdict, confidence, brier in (("PASS", 80, 0.04), ("FAIL", 80, 0.64), ("FAIL", 0, 0)):
        given = ("give-verdict", {"verdict": verdict, "confidence": confidence})
        day = after_plain(("reduce", {}), given, ("hand-in", {}))
        assert debrief_of(day, scores_only=True).brier == pytest.approx(brier)


def test_the_confidence_of_an_operator_is_the_probability_of_conformity() -> None:
    """A result one u above the limit: 84 %; without a limit 90 %."""
    met = SimpleNamespace(findings=[SimpleNamespace(met=True)])
    for limit, expected in ((0.5, stats.norm.cdf(1)), (None, 0.9)):
        rules = SimpleNamespace(spec=SimpleNamespace(metric_limit=limit))
        desk = SimpleNamespace(result=(0.51, 0.01), rules=rules, certification=met)
        assert _confidence(desk) == pytest.approx(expected)


def test_results_entered_by_hand_are_checked_and_decide_the_verdict() -> None:
    """Those of the software to four digits agree; one with a slip of a digit costs its error."""
    sound = Desk(after_plain()).certification.quantities
    names = {"r": "recoil_factor", "e_A": "collision_efficiency", "e": "restitution"}
    right = {name: round(sound[key].value, 4) for name, key in names.items()}
    value = sound["recoil_factor"].value
    assert sound["restitution"].value == pytest.approx(
        sound["collision_efficiency"].value * (1 + value) + value, rel=1e-3
    )
    bpf = debrief_by("book").value
    assert bpf is not None

    def taken_with(**entered: float) -> tuple[Day, Debrief]:
        day = after_plain(("enter-result", entered), END[1], END[2])
        return day, debrief_of(day)

    day, agreed = taken_with(**right, BPF=round(bpf, 4))
    said = {what: value for event in day.events[-3:] for what, value, _ in event.shown}
    assert [said[f"{name}, compared with the records"] for name in right] == ["agrees"] * 3
    assert scores(agreed)["record"] == 1
    assert agreed.value == round(bpf, 4)
    _, slipped = taken_with(BPF=round(bpf, 4) + 0.1)
    assert scores(slipped)["record"] == pytest.approx(7 / 8)
    assert slipped.costly[0].what == "entered BPF"
    assert slipped.truth is not None
    expected = abs(round(bpf, 4) + 0.1 - slipped.truth) - abs(bpf - slipped.truth)
    assert slipped.costly[0].cost == pytest.approx(expected, rel=1e-9)


def test_a_disputed_score_shows_the_note_of_the_trainee() -> None:
    note = ("dispute-score", {"score": "economy", "note": "the wall rig was =taken="})
    with pytest.raises(InputError, match="has not been handed in"):
        play_actions(apparatus(), asked([*PLAIN, note]))
    found = debrief_of(after_plain(*END, note))
    assert found.disputes == (("economy", "the wall rig was =taken="),)
    assert "Disputed: the wall rig was =taken=" in debrief_page(found)
    assert scores(found) == scores(debrief_by("book"))
