"""The scores of days worked out on paper: what the rules of the debrief make of ten players."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import sqrt
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.bench.days import Asked, asked, scenario
from virtual_lab import catalog
from virtual_lab.bench.day.day import Day, DayEvent, replay_events
from virtual_lab.bench.day.desk import EnteredResult
from virtual_lab.bench.scoring import costs
from virtual_lab.bench.scoring import debrief as debriefing
from virtual_lab.bench.scoring.debrief import DayScore, Debrief, _advice, debrief
from virtual_lab.bench.scoring.deviations import DENIED, JUSTIFIED, OPEN, Deviation
from virtual_lab.bench.scoring.scores import detection_score, right_verdict
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Procedure

TRUTH, LIMIT, U = 0.95, 1.0, 0.01  # of the metric; U = 2 u = .02
MINUTES, SHOTS = 100.0, 2  # that an expert takes
ATTEMPTS = 12
ACTION = 5.0  # minutes of each action of these days
SHOT: tuple[Asked, ...] = (
    *((name, {}) for name in ("zero-encoder", "clear-scrap", "wait-pressure", "wait-rest")),
    ("load-ball", {"ball": 1}),
    ("fire", {}),
)
BENCH: tuple[Asked, ...] = tuple(
    (name, {})
    for name in ("tare", "weigh-bat", "level-stand", "measure-balance", "fit-clamp", "swing")
)
BOOK = (*BENCH, *SHOT, ("accept", {"shot": 1}), *SHOT, ("accept", {"shot": 2}))
DUE = 3 + 4 + 5  # steps: of the bench, of the first shot (there is no scrap yet), of the second


def doubt(name: str, confidence: float) -> Asked:
    return "note-doubt", {"doubt": name, "confidence": confidence}


def verdict(word: str, confidence: float, worst: str = "none") -> tuple[Asked, Asked]:
    given = {"verdict": word, "confidence": confidence, "doubt": worst}
    return ("give-verdict", given), ("hand-in", {})


@dataclass
class HandDesk:
    """A desk with results given by hand, in place of the one that the debrief opens."""

    day: Day
    result: tuple[float, float] | None = (TRUTH, U)
    reasons: tuple[str, ...] = ("", "")
    entered: tuple[EnteredResult, ...] = ()
    reduction_error: str = ""
    reasons_to_refuse: tuple[str, ...] = ()
    hits: tuple[Any, ...] = ()
    rules: Any = field(
        default_factory=lambda: SimpleNamespace(
            spec=SimpleNamespace(
                metric="bat_performance_factor",
                metric_limit=LIMIT,
                attempts=ATTEMPTS,
                eligibility=None,
            )
        )
    )
    preparation: Any = field(default_factory=lambda: SimpleNamespace(bat=None))
    session: Any = field(default_factory=lambda: SimpleNamespace(bat_construction=""))

    def last(self, action: str) -> DayEvent | None:
        found = [event for event in self.day.events if event.action == action]
        return found[-1] if found else None

    def entered_results(self, _: Mapping[str, object]) -> tuple[EnteredResult, ...]:
        return self.entered


@pytest.fixture
def debrief_of(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the debrief of a day's actions, its records given by hand and its truth `TRUTH`."""
    sealed, seen = SimpleNamespace(measurand={"metric": TRUTH}), dict[str, int]()
    machines: Any = SimpleNamespace(finish=lambda _: SimpleNamespace(sealed=sealed))
    for name, instead in {
        "run_operator": lambda *_: SimpleNamespace(seconds=60 * MINUTES, fired=((0, 0.0),) * SHOTS),
        "_expert_review": lambda *_, **__: None,
        "costly_decisions": lambda *_: (),
        "_fault_reviews": lambda *_: (),
        "_visible_faults": lambda _: seen,
        "run_chart": lambda *_: "",
    }.items():
        monkeypatch.setattr(debriefing, name, instead)

    def run(
        actions: Iterable[Asked],
        *,
        faults: tuple[str, ...] = (),
        departed: tuple[Deviation, ...] = (),
        visible: tuple[str, ...] = (),
        rates: Mapping[str, float] = MappingProxyType({}),
        **records: Any,
    ) -> Debrief:
        events = (
            DayEvent(number=at, action=each.name, arguments=each.arguments, seconds=60 * ACTION)
            for at, each in enumerate(asked(actions), 1)
        )
        untouched: Any = SimpleNamespace(calibration={})
        seen.clear()
        seen.update(dict.fromkeys(visible, 1))
        day = replay_events(Day(morning=untouched, balls=6), events)
        monkeypatch.setattr(debriefing, "Desk", lambda own: HandDesk(own or day, **records))
        monkeypatch.setattr(debriefing, "deviations", lambda _: iter(departed))
        return debrief(machines, day, scenario(faults, may_go_wrong=dict(rates)))

    return run


def scores(found: Debrief) -> dict[str, float]:
    return {score.name: score.value for score in found.scores}


def test_a_sure_day_by_the_book_scores_full_marks(debrief_of: Any) -> None:
    """.05 U off, PASS at 90 %, nothing listed. 22 actions of 5 min: 100/110; 2 shots of 2."""
    found = debrief_of([*BOOK, *verdict("PASS", 90)], result=(TRUTH + 0.05 * 2 * U, U))
    assert scores(found) == pytest.approx(
        {
            "result": 1,
            "detection": 1,
            "protocol": 1,
            "record": 1,
            "economy": 100 / (5 * (len(BOOK) + 2)),
        }
    )
    assert (found.right_verdict, found.brier) == ("PASS", pytest.approx(0.01))


@pytest.mark.parametrize(("off", "score"), [(0.99, 1.0), (1.01, 1 / 1.01), (1.5, 2 / 3), (-2, 0.5)])
def test_an_error_beyond_its_uncertainty_lowers_the_result_score(
    off: float, score: float, debrief_of: Any
) -> None:
    """Within U all of it, beyond it U over what it is off; the verdict is right all the same."""
    found = debrief_of([*BOOK, *verdict("PASS", 60)], result=(TRUTH + off * 2 * U, U))
    assert scores(found)["result"] == pytest.approx(score)
    assert found.brier == pytest.approx(0.4**2)
    assert scores(found)["economy"] == pytest.approx(score * MINUTES / (5 * (len(BOOK) + 2)))


def test_a_wrong_verdict_scores_no_result_and_no_economy(debrief_of: Any) -> None:
    """However near the number: nothing, and none of the time it took."""
    found = debrief_of([*BOOK, *verdict("FAIL", 90)])
    assert scores(found)["result"] == scores(found)["economy"] == 0
    assert found.brier == pytest.approx(0.81)


def test_an_entered_result_is_scored_instead_of_the_reduced_one(debrief_of: Any) -> None:
    """Entered .98, 1.5 U off, where the records give .95: 2/3. One of two own results agrees.

    The record: two hits of two as the windows have it and one of two own results: 3/4.
    """
    own = (
        EnteredResult(name="BPF", entered=0.98, reduced=TRUTH, u=U),
        EnteredResult(name="e_A", entered=0.25, reduced=0.2501, u=0.001),
    )
    enter = ("enter-result", {"BPF": 0.98, "e_A": 0.25})
    found = debrief_of([*BOOK, enter, *verdict("PASS", 90)], entered=own)
    assert found.value == 0.98
    assert scores(found)["result"] == pytest.approx(2 / 3)
    assert scores(found)["record"] == pytest.approx(3 / 4)


def test_refusing_a_sound_day_scores_no_result(debrief_of: Any) -> None:
    """Named at 30 % without a record that bears it out: nothing. A false alarm: .09."""
    found = debrief_of([*BOOK, doubt("gate-moved", 30), *verdict("INVALID", 50)])
    assert scores(found)["result"] == scores(found)["economy"] == 0
    assert scores(found)["detection"] == pytest.approx(1 - 0.09)
    assert (found.right_verdict, found.false_alarms) == ("PASS", ("gate-moved",))


@pytest.mark.parametrize(
    ("shown", "worth"),
    [
        ({"visible": ("bat-cracked",), "faults": ("bat-cracked",)}, 1.0),
        ({"reasons_to_refuse": ("flag scatter",)}, 1.0),  # in the expert's records too
        ({"visible": ("gate-moved",)}, 0.2),  # the expert has no reason on this sound day
    ],
)
def test_a_refusal_is_right_if_the_records_show_a_reason(
    shown: dict[str, Any], worth: float, debrief_of: Any
) -> None:
    """Whether or not the trainee named it; little remains if only his own test is the reason."""
    found = debrief_of([*BOOK, *verdict("INVALID", 80)], **shown)
    assert scores(found)["result"] == worth
    assert found.brier == pytest.approx(0.04)


def test_a_verdict_without_a_measurement_scores_nothing(debrief_of: Any) -> None:
    """INVALID and hand in, nothing measured, on a day with a fault."""
    found = debrief_of(
        [*verdict("INVALID", 100)],
        faults=("gate-moved",),
        rates={"gate-moved": 0.1, "wrong-lot": 0.1},
        result=None,
        reasons=(),
    )
    assert scores(found) == pytest.approx(
        {"result": 0, "detection": 1 - 0.81 - 0.01, "protocol": 0, "record": 0, "economy": 0}
    )


@pytest.mark.parametrize(("off", "right"), [(0.99, "PASS"), (1.01, "INVALID")])
@pytest.mark.parametrize(("fault", "worth"), [("gate-moved", 0.6), ("bat-cracked", 1.0)])
def test_refusing_a_day_counts_less_if_its_fault_had_a_remedy(
    off: float, right: str, fault: str, worth: float, debrief_of: Any
) -> None:
    """A moved gate could have been gauged and reduced with; a cracked bat has no remedy."""
    found = debrief_of(
        [*BOOK, doubt(fault, 80), *verdict("INVALID", 90)],
        faults=(fault,),
        visible=(fault,),
        result=(TRUTH + off * 2 * U, U),
    )
    assert found.right_verdict == right
    assert found.brier == pytest.approx(0.01)  # right to refuse, 90 % sure of it
    assert scores(found)["result"] == worth
    assert scores(found)["detection"] == pytest.approx(1 - 0.04)
    assert found.found == (fault,)


def test_after_a_repair_the_truth_decides_the_verdict(debrief_of: Any) -> None:
    """After the repair the truth alone decides: beyond U by chance, the verdict is right."""
    repaired = [*BOOK, doubt("encoder-slip", 90), ("tighten-coupling", {}), *verdict("PASS", 90)]
    found = debrief_of(repaired, faults=("encoder-slip",), visible=("encoder-slip",))
    assert (found.right_verdict, scores(found)["result"]) == ("PASS", 1.0)


def test_a_missed_fault_costs_its_share_of_detection(debrief_of: Any) -> None:
    """2 U off: .2. Of three at 10 % one named at 100 %, one missed, .9², the third .1²."""
    faults = ("gate-moved", "scale-not-tared")
    found = debrief_of(
        [*BOOK, doubt("gate-moved", 100), *verdict("PASS", 70)],
        faults=faults,
        rates=dict.fromkeys((*faults, "wrong-lot"), 0.1),
        result=(TRUTH + 4 * U, U),
    )
    assert scores(found)["result"] == pytest.approx(0.2)
    assert scores(found)["detection"] == pytest.approx(1 - 0.81 - 0.01)
    assert (found.found, found.missed) == (("gate-moved",), ("scale-not-tared",))


@pytest.mark.parametrize(
    ("confidence", "squares"), [(0, 1 + 2 * 0), (1, 0.99**2 + 2 * 0.01**2), (50, 3 * 0.25)]
)
def test_naming_every_fault_scores_by_the_confidence(
    confidence: float, squares: float, debrief_of: Any
) -> None:
    """Of three listed at 10 % one is there; at 0 and 1 % none is found, at 50 % two are alarms."""
    listed = ("gate-moved", "scale-not-tared", "wrong-lot")
    found = debrief_of(
        [*BOOK, *(doubt(name, confidence) for name in listed), *verdict("PASS", 90)],
        faults=("gate-moved",),
        rates=dict.fromkeys(listed, 0.1),
    )
    assert scores(found)["detection"] == pytest.approx(max(0.0, 1 - squares))
    above = confidence > 10
    assert (found.found, len(found.false_alarms)) == (listed[:above], 2 * above)


def test_named_faults_and_false_alarms_are_counted() -> None:
    """Two of three faults are named; of two others, one has a probability below its rate."""
    faults = ("gate-moved", "scale-not-tared", "wrong-ball")
    named = {"gate-moved": 0.9, "scale-not-tared": 0.9, "wrong-lot": 0.5, "wall-drift": 0.05}
    _, words = detection_score(named, faults, dict.fromkeys(named, 0.1))
    assert words.startswith("2 of 3 faults named, 1 false alarm; ")


def test_a_doubt_struck_out_does_not_count(debrief_of: Any) -> None:
    """The fault is missed: 1. A note at 60 % counts: .16."""
    noted = doubt("gate-moved", 90)
    strike = ("strike-out", {"entry": len(BOOK) + 1, "because": "it was the wind"})
    spoilt = {"faults": ("gate-moved",), "result": (TRUTH + 4 * U, U)}
    found = debrief_of([*BOOK, noted, strike, *verdict("PASS", 100)], **spoilt)
    assert (found.found, found.missed) == ((), ("gate-moved",))
    assert scores(found)["detection"] == pytest.approx(0.0)
    again = debrief_of(
        [*BOOK, noted, strike, doubt("gate-moved", 60), *verdict("PASS", 0)], **spoilt
    )
    assert scores(again)["detection"] == pytest.approx(1 - 0.16)


def test_a_doubt_named_only_with_the_verdict_counts_50_percent(debrief_of: Any) -> None:
    """As sure as not, 50 %: .25; noted before, what was noted counts. By its title as well."""
    spoilt = {"faults": ("gate-moved",), "result": (TRUTH + 4 * U, U)}
    worst = verdict("INVALID", 100, "a gate moved after its survey")
    found = debrief_of([*BOOK, *worst], **spoilt)
    assert scores(found)["detection"] == pytest.approx(1 - 0.25)
    found = debrief_of([*BOOK, doubt("gate-moved", 90), *worst], **spoilt)
    assert scores(found)["detection"] == pytest.approx(1 - 0.01)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("a gate moved after the survey", "did you mean .*A gate moved after its survey"),
        ("the wind", "other:"),
    ],
)
def test_an_unknown_doubt_is_refused_with_a_suggestion(words: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        asked([doubt(words, 50)])
    assert asked([doubt("other: the wind", 50)])[0].arguments["doubt"] == "other: the wind"


def departure(entry: int, judged: str, step: str = "") -> Deviation:
    return Deviation(entry=entry, what="", because="", judged=judged, why="", step=step)


def test_omitted_and_late_steps_lower_the_protocol_score(debrief_of: Any) -> None:
    """Twelve steps are due. Left out: tare, no reason noted; level-stand, open to the trainer.

    And wait-rest before both shots, denied by the records: 9 of 12.
    """
    left = ("tare", "level-stand", "wait-rest")
    days = [each for each in BOOK if each[0] not in left]
    departed = (departure(1, OPEN, "level-stand"), departure(2, DENIED, "wait-rest"))
    found = debrief_of([*days, *verdict("PASS", 90)], departed=departed)
    assert DUE == 12
    assert scores(found)["protocol"] == pytest.approx(9 / 12)
    late = [*days, ("tare", {}), *verdict("PASS", 90)]  # done after what it is for
    assert scores(debrief_of(late, departed=departed))["protocol"] == pytest.approx(9 / 12)


def test_unjustified_decisions_lower_the_record_score(debrief_of: Any) -> None:
    """Of four hits the windows reject the last. Rejected: 1, odd in its trace, and 2, by feeling.

    Accepted: 3, and 4 against the windows. Right are 1 and 3: 2 of 4.
    """
    decided = (
        ("reject", {"shot": 1, "because": "trace"}),
        ("reject", {"shot": 2, "because": "no"}),
        ("accept", {"shot": 3}),
        ("accept", {"shot": 4, "because": "near enough"}),
    )
    days: list[Asked] = [*BENCH]
    for each in decided:
        days += [*SHOT, (each[0], {"because": "", **each[1]})]
    first = len(BENCH) + len(SHOT) + 1
    departed = (departure(first, JUSTIFIED), departure(first + 7, DENIED))
    found = debrief_of(
        [*days, *verdict("PASS", 90)], departed=departed, reasons=("", "", "", "too slow")
    )
    assert scores(found)["record"] == pytest.approx(2 / 4)
    assert scores(found)["economy"] == pytest.approx(100 / (5 * (len(days) + 2)) * 2 / 4)


@pytest.mark.parametrize(("economy", "change"), [(0.3, "economy: "), (0.55, "result: ")])
def test_economy_is_to_improve_by_its_own_loss(economy: float, change: str) -> None:
    """Result .6, a factor of economy: 3 (.6 - .3) is more than 1 - .6, and 3 (.6 - .55) less."""
    values = {"result": (0.6, 1.0), "detection": (1.0, 1.0), "economy": (economy, 3.0)}
    scored = tuple(
        DayScore(name=name, value=value, weight=weight, because="")
        for name, (value, weight) in values.items()
    )
    assert _advice(scored) == ("detection: ", change)


def test_only_checks_without_a_sign_cost_time(debrief_of: Any) -> None:
    """Its five minutes do not count: 100 of 110 min again; those of a check nobody asked for do."""
    days = [("gauge-gates", {}), *BOOK, *verdict("PASS", 90)]
    for judged, minutes in ((JUSTIFIED, 5 * (len(days) - 1)), (OPEN, 5 * len(days))):
        found = debrief_of(days, departed=(departure(1, judged),))
        assert scores(found)["economy"] == pytest.approx(100 / minutes)


def test_the_u_of_a_cost_comes_from_the_hits_that_differ() -> None:
    """Hits 1, 2, 3, 4 of s² = 5/3; the mean of all less that of three: weights 1/4, thrice -1/12.

    u² = 5/3 (1/16 + 3/144) = 5/36.
    """
    metric = np.array([1.0, 2.0, 3.0, 4.0, 9.0])
    valid = np.array([True, True, True, True, False])

    def desk(weights: list[float]) -> Any:
        return SimpleNamespace(
            reduced=SimpleNamespace(
                hit_weights=SimpleNamespace(weights=np.array(weights)),
                shot_metric=metric,
                valid=valid,
            )
        )

    found = costs._scatter(desk([1 / 4] * 4 + [0]), desk([0, *[1 / 3] * 3, 0]))
    assert found == pytest.approx(sqrt(5 / 36), rel=1e-12)


def test_the_right_verdict_on_an_exempt_bat_is_measured() -> None:
    """Above the limit, but of one-piece wood: the rules ask no test of it."""
    told: Any = SimpleNamespace(sealed=SimpleNamespace(measurand={"metric": 0.6}))
    desk: Any = SimpleNamespace(
        rules=catalog.load("procedures", "bbcor", Procedure),
        preparation=SimpleNamespace(bat=None),
        session=SimpleNamespace(bat_construction="one-piece wood"),
    )
    apparatus: Any = SimpleNamespace(finish=lambda _: told)
    right = right_verdict(apparatus, desk, 0.6, 0.01, spoilt=False)
    assert right.word == "MEASURED"
    assert right.because == "no test required: one-piece wood (recalled, unverified)"
