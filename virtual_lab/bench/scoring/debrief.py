"""The debrief of a day: truth, five scores, review of the faults, and most costly decisions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from itertools import zip_longest
from typing import Any

from virtual_lab import catalog
from virtual_lab.bench.day.actions import RESULT_QUANTITIES, typed_words
from virtual_lab.bench.day.day import Day
from virtual_lab.bench.day.desk import Desk, EnteredResult, HitResult
from virtual_lab.bench.day.doubts import fault_titles
from virtual_lab.bench.day.operators import operator_of
from virtual_lab.bench.day.protocol import StepDue, excuses_of, steps_due
from virtual_lab.bench.day.readings import suspected_faults
from virtual_lab.bench.day.scenario import SCORES, UNITS, Scenario
from virtual_lab.bench.day.table import PREPARING, action_table, detectable, remedy_of, repairs
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.stored_day import StoredDay, laboratory_of, run_operator
from virtual_lab.bench.pages.tally import run_chart
from virtual_lab.bench.scoring.costs import (
    CostlyDecision,
    actions_to_replay,
    costly_decisions,
    replay_day,
)
from virtual_lab.bench.scoring.deviations import (
    Deviation,
    deviations,
    extra_check_seconds,
)
from virtual_lab.bench.scoring.scores import (
    ScoredResult,
    before_repair,
    detection_score,
    economy_score,
    is_named,
    justified_rejections,
    protocol_score,
    record_score,
    result_score,
    right_verdict,
)
from virtual_lab.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class DayScore:
    """One score, from 0 to 1, with its explanation."""

    name: str
    value: float
    weight: float
    because: str


@dataclass(frozen=True, slots=True)
class Moment:
    """A moment of the day: entry, laboratory time [min], and number of shots fired so far."""

    entry: int
    minute: float
    shots: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeLine:
    """Moments at which a fault became visible, was named, and was repaired; None for never."""

    seen: Moment | None
    named: Moment | None
    acted: Moment | None

    @property
    def delay(self) -> str:
        """Time and shots from the first visible sign of the fault until it was named, in words.

        The string is empty if the fault never became visible or was never named.
        """
        if self.seen is None or self.named is None:
            return ""
        minutes = self.named.minute - self.seen.minute
        return f"{minutes:.0f} min and {self.named.shots - self.seen.shots} shots later"


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultReview:
    """A fault of the day: the checks that reveal it, its effect, and its time lines."""

    name: str
    checks: tuple[str, ...]  # titles of the actions that reveal it
    moved: float | None  # change of the metric by the fault [SI]; None if unknown
    yours: TimeLine
    expert: TimeLine


@dataclass(frozen=True, slots=True, kw_only=True)
class StepReview:
    """A step of the procedure: when it was due, whether it was done, and the noted reason."""

    title: str
    expected: str
    done: str
    excuse: str  # reason of a noted deviation; empty if there is none


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpertDay:
    """The day of the simulated expert with the same laboratory, bat and balls."""

    verdict: str
    confidence: float
    value: float | None
    minutes: float
    shots: int
    doubts: tuple[str, ...]
    checks: tuple[str, ...]  # titles of checks that the trainee did not make
    apart: str  # reason why the verdict differs from the trainee's correct verdict; or empty


@dataclass(frozen=True, slots=True, kw_only=True)
class Debrief:
    """The debrief of a day: scores, faults, decisions and truth. Numbers are SI."""

    title: str
    units: str  # printed units, a key of UNITS
    seal: str
    verdict: str
    confidence: float  # confidence in the verdict, 0 to 1
    brier: float  # Brier score of that confidence: 0 is best, 1 worst
    worst_doubt: str  # main suspected fault, logged with the verdict
    metric: str
    value: float | None
    u: float | None
    truth: float | None
    limit: float | None
    right_verdict: str
    right_because: str  # broken rule or reason for no judgment; or empty
    faults: tuple[str, ...]
    found: tuple[str, ...]
    missed: tuple[str, ...]
    false_alarms: tuple[str, ...]
    fault_reviews: tuple[FaultReview, ...]
    scores: tuple[DayScore, ...]
    keep: str
    change: str
    costly: tuple[CostlyDecision, ...]
    steps: tuple[StepReview, ...]
    deviations: tuple[Deviation, ...]
    own: tuple[EnteredResult, ...]
    # the trainee's and the expert's shots, in pairs
    hits: tuple[tuple[HitResult | None, HitResult | None], ...]
    expert: ExpertDay
    disputes: tuple[tuple[str, str], ...]  # disputed score, and the trainee's note
    practice: int  # entry from which an earlier day is repeated; 0: no practice
    chart: str  # run chart of the shots as SVG
    minutes: float
    shots: int
    # number, time [min], action, arguments in words
    entries: tuple[tuple[int, float, str, str], ...]

    @property
    def nothing_wrong(self) -> bool:
        """Whether the laboratory had no fault and the trainee made no error."""
        scored = {score.name: score.value for score in self.scores}
        no_error = scored["protocol"] == scored["record"] == 1
        return no_error and not (self.faults or self.costly or self.false_alarms)

    def document(self) -> dict[str, Any]:
        """Return the debrief as a JSON object, without the chart."""
        return {name: value for name, value in asdict(self).items() if name != "chart"}


def debrief(
    apparatus: Apparatus,
    taken_day: Day | Desk,
    scenario: Scenario,
    seal: str = "",
    *,
    expert: Day | None = None,
    scores_only: bool = False,
) -> Debrief:
    """Return the debrief of a day: its scores and explanations.

    Parameters
    ----------
    apparatus
        The machines of the day, with their true values.
    taken_day
        The day, or a `Desk` (the day with its reduced results). A desk that already holds the
        reduced results saves time.
    scenario
        The scenario with the faults of the day.
    seal
        Sentence about the sealed true values, which is printed in the debrief.
    expert
        The day of the simulated expert. If None, this day is simulated.
    scores_only
        Whether to leave out the effects of faults and decisions, and the run chart. They take
        most of the time.

    Raises
    ------
    InputError
        The day was not handed in.
    """
    desk = Desk(taken_day) if isinstance(taken_day, Day) else taken_day
    day = desk.day
    if not day.handed_in:
        allowed = "has not been handed in yet: reduce, give-verdict and hand-in are still to do"
        raise InputError("debrief", "day", None, allowed)
    results = tuple(
        desk.entered_results(entry.arguments) if (entry := desk.last("enter-result")) else ()
    )
    value, u = _result(desk, results)
    limit = desk.rules.spec.metric_limit
    verdict = desk.last("give-verdict")
    assert verdict is not None
    named = _named_faults(day, str(verdict.arguments["doubt"]))
    faults, rates = scenario.faults or (), scenario.may_go_wrong
    visible = _visible_faults(day) if faults or day.verdict == "INVALID" else {}
    faults_left = tuple(name for name in faults if name not in day.repaired_faults)
    right = right_verdict(apparatus, desk, value, u, spoilt=bool(faults_left))
    likely = {name for name in named if is_named(name, named, rates)}
    expert_desk = Desk(expert or expert_day(apparatus, day))
    reason = day.verdict == "INVALID" and bool(visible or desk.reasons_to_refuse)
    outcome = ScoredResult(
        value=value,
        u=u,
        right=right,
        verdict=day.verdict,
        reason=reason,
        avoidable=reason and not faults and not expert_desk.reasons_to_refuse,
        mendable=bool(faults) and all(remedy_of(name) for name in faults),
    )
    confidence = float(verdict.arguments["confidence"]) / 100
    brier = (confidence - (day.verdict == right.word or reason)) ** 2
    judged = list(deviations(desk))
    justified = justified_rejections(day, judged) | before_repair(day, faults)
    result = result_score(outcome)
    needless = extra_check_seconds(judged, desk)
    values = (
        result,
        detection_score(named, faults, rates),
        protocol_score(day, judged),
        record_score(desk, results, justified),
        economy_score(day, expert_desk.day, needless, result[0]),
    )
    scores = tuple(
        DayScore(name=name, value=score, weight=scenario.weights.get(name, 1.0), because=why)
        for name, (score, why) in zip(SCORES, values, strict=True)
    )
    keep, change = _advice(scores)
    return Debrief(
        title=scenario.title,
        units=scenario.units,
        seal=seal,
        verdict=day.verdict,
        confidence=confidence,
        brier=brier,
        worst_doubt=str(verdict.arguments["doubt"]),
        metric=desk.rules.spec.metric,
        value=value,
        u=u,
        truth=right.truth,
        limit=limit,
        right_verdict=right.word,
        right_because=right.because,
        faults=faults,
        found=tuple(name for name in faults if name in likely),
        missed=tuple(name for name in faults if name not in likely),
        false_alarms=tuple(name for name in named if name in likely - set(faults)),
        fault_reviews=tuple(_fault_reviews(apparatus, scenario, (desk, expert_desk), visible))
        if not scores_only
        else (),
        scores=scores,
        keep=keep,
        change=change,
        costly=()
        if scores_only
        else costly_decisions(apparatus, desk, right.truth, results, justified),
        steps=tuple(_steps(day)),
        deviations=tuple(judged),
        own=results,
        hits=tuple(zip_longest(desk.hits, expert_desk.hits)),
        expert=_expert_review(apparatus, expert_desk, desk, right.word, faults),
        disputes=tuple(
            (str(event.arguments["score"]), str(event.arguments["note"]))
            for event in day.events
            if event.action == "dispute-score"
        ),
        practice=day.practice,
        chart="" if scores_only else run_chart(desk, UNITS[scenario.units]),
        minutes=day.seconds / 60,
        shots=len(day.fired),
        entries=tuple(_entries(day)),
    )


def debrief_of(day: StoredDay, expert: Day | None = None) -> Debrief:
    """Return the debrief of a stored day. It states whether the seal is intact.

    A broken seal raises no error. `expert` is the day of the simulated expert, with which the
    trainee's day is compared. By default it is simulated now. Raises `InputError` if the day was
    not handed in.
    """
    return debrief(day.apparatus, day.desk, day.scenario, day.seal, expert=expert)


def expert_day(apparatus: Apparatus, day: Day) -> Day:
    """Return the day of the simulated expert in the trainee's laboratory.

    Machines, bat and balls are the same as in the trainee's `day`. In some scenarios, the first
    entries of `day` come from another laboratory. The expert then continues after these entries.
    """
    return run_operator(apparatus, operator_of("expert"), day.until(day.supplied_events))


def _result(desk: Desk, results: Iterable[EnteredResult]) -> tuple[float | None, float | None]:
    """Return the metric that the trainee reported and its standard uncertainty [SI].

    The entered metric replaces that of the records. Both are None if the day has no result.
    """
    if desk.result is None:
        return None, None
    entered = [e.entered for e in results if RESULT_QUANTITIES[e.name] == desk.rules.spec.metric]
    return (entered[0] if entered else desk.result[0]), desk.result[1]


def _named_faults(day: Day, worst: str) -> dict[str, float]:
    """Return the probability that the trainee gave to each fault that he or she named.

    A fault that is named only with the verdict gets 0.5.
    """
    named = {worst: 0.5} if worst in fault_titles() else {}
    for event in day.events:
        if event.action == "note-doubt" and event.number not in day.struck:
            named[str(event.arguments["doubt"])] = float(event.arguments["confidence"]) / 100
    return {name: sure for name, sure in named.items() if name in fault_titles()}


def _visible_faults(day: Day) -> dict[str, int]:
    """Return the first entry whose readings show a fault, for each visible fault."""
    visible: dict[str, int] = {}
    desk = Desk(day.until(0))
    for event in day.events:
        desk = desk.after(event)
        if event.records or event.shown:
            for doubt in suspected_faults(desk):
                visible.setdefault(doubt.fault, event.number)
    return visible


def _fault_reviews(
    apparatus: Apparatus, scenario: Scenario, desks: tuple[Desk, Desk], visible: Mapping[str, int]
) -> Iterator[FaultReview]:
    """Yield the review of each fault; `desks` are those of the trainee and of the expert."""
    (desk, expert_desk), sheets = desks, action_table().actions
    visible_to_expert = _visible_faults(expert_desk.day) if scenario.faults else {}
    for name in scenario.faults or ():
        yield FaultReview(
            name=name,
            checks=tuple(sheets[each].title for each in detectable()[name].actions),
            moved=_effect_of_fault(apparatus, scenario, desk, name),
            yours=_time_line(desk.day, name, visible),
            expert=_time_line(expert_desk.day, name, visible_to_expert),
        )


def _time_line(day: Day, fault: str, visible: Mapping[str, int]) -> TimeLine:
    """Return the moments at which a fault became visible, was named and was repaired."""
    remedy = remedy_of(fault)
    minutes = shots = 0.0
    moments: dict[str, Moment] = {}
    for event in day.events:
        minutes, shots = minutes + event.seconds / 60, shots + (event.action == "fire")
        moment = Moment(event.number, minutes, int(shots))
        if event.number == visible.get(fault):
            moments["seen"] = moment
        if event.number not in day.struck and event.arguments.get("doubt") == fault:
            moments.setdefault("named", moment)
        if remedy and event.action == remedy[0] and remedy[1].items() <= event.arguments.items():
            moments.setdefault("acted", moment)
    return TimeLine(**{name: moments.get(name) for name in ("seen", "named", "acted")})


def _effect_of_fault(
    apparatus: Apparatus, scenario: Scenario, desk: Desk, fault: str
) -> float | None:
    """Return the change of the metric by a fault [SI]: the day minus its replay without the fault.

    It is None if one of the two days has no result.
    """
    if desk.result is None:
        return None
    faults_left = tuple(name for name in scenario.faults or () if name != fault)
    laboratory = apparatus.laboratory
    with catalog.sheets_in_place(laboratory.sheets):
        machines = Apparatus(
            laboratory_of(replace(scenario, faults=faults_left), laboratory.seed, laboratory.salt)
        )
    try:
        result = replay_day(machines, actions_to_replay(desk.day), set()).result
    except InputError:
        return None
    return desk.result[0] - result[0] if result else None


def _advice(scores: tuple[DayScore, ...]) -> tuple[str, str]:
    """Return two sentences: on the best scores, and on the score that cost the most points."""
    top = max(score.value for score in scores)
    best = [score for score in scores if score.value > top - 0.005]
    # the score `result`, a factor of `economy`, is its highest value
    most = {"economy": next(score.value for score in scores if score.name == "result")}
    losses = [(most.get(score.name, 1.0) - score.value) * score.weight for score in scores]
    worst = scores[losses.index(max(losses))]
    change = f"{worst.name}: {worst.because}" if max(losses) > 0.02 else "nothing"
    because = best[0].because if len(best) == 1 else f"{top:.2f} each"
    return f"{', '.join(score.name for score in best)}: {because}", change


def _steps(day: Day) -> Iterator[StepReview]:
    """Yield the review of each step that was due."""
    sheets, notes = action_table().actions, excuses_of(day)
    due: dict[str, list[StepDue]] = {}
    for each in steps_due(day):
        due.setdefault(each.step, []).append(each)
    for step, times in due.items():
        omitted = [each for each in times if not each.done]
        shots = ", ".join(str(each.shot + 1) for each in omitted if each.shot is not None)
        plural = "s" if "," in shots else ""
        skipped = f"skipped before shot{plural} {shots}" if shots else "skipped"
        outcome = skipped if omitted else "done"
        before = f"before “{sheets[PREPARING[step]].title}”" if step in PREPARING else ""
        yield StepReview(
            title=sheets[step].title,
            expected=before or "before each shot",
            done=outcome,
            excuse=notes.get(step, ""),
        )


def _expert_review(
    apparatus: Apparatus,
    expert_desk: Desk,
    desk: Desk,
    right: str,
    faults: tuple[str, ...],
) -> ExpertDay:
    day, sheets = expert_desk.day, action_table().actions
    verdict = expert_desk.last("give-verdict")
    assert verdict is not None
    trainee_actions = {event.action for event in desk.day.events}
    named = [event for event in day.events if event.action == "note-doubt"]
    checks = dict.fromkeys(
        sheets[event.action].title
        for event in day.events
        if event.action not in trainee_actions
        and sheets[event.action].part in {"bench", "wall", "rig"}
    )
    value, u = expert_desk.result or (None, None)
    difference = ""
    if day.verdict != right:
        spoilt = bool(set(faults) - day.repaired_faults)
        expert_right = right_verdict(apparatus, expert_desk, value, u, spoilt=spoilt).word
        difference = _why_verdicts_differ(right, expert_right, expert_desk, desk)
    return ExpertDay(
        verdict=day.verdict,
        confidence=float(verdict.arguments["confidence"]) / 100,
        value=value,
        minutes=day.seconds / 60,
        shots=len(day.fired),
        doubts=tuple(str(event.arguments["doubt"]) for event in named),
        checks=tuple(checks),
        apart=difference,
    )


def _why_verdicts_differ(right: str, expert_right: str, expert_desk: Desk, desk: Desk) -> str:
    """Return the reason why the expert's verdict differs from `right`, as a sentence.

    `right` is the correct verdict of the trainee's day, `expert_right` that of the expert's day.
    """
    verdict = expert_desk.day.verdict
    if verdict == "INVALID":
        return (
            f"Both verdicts are right: despite the fault the result is within U of the truth, so "
            f"{right} is right; but an operator who sees a fault may also give INVALID, as the "
            "expert did"
        )
    if verdict != expert_right:
        return (
            "Here the expert is wrong by chance: the expert's result and the truth are on "
            f"different sides of the limit, so {expert_right} is right"
        )
    mends = repairs().keys()
    expert_actions, actions = (
        {each.action for each in day.events if each.constants or each.action in mends}
        for day in (expert_desk.day, desk.day)
    )
    expert_actions -= actions
    titles = " and ".join(
        action_table().actions[name].title.lower() for name in sorted(expert_actions)
    )
    reason = ", whose result is wrong by more than U" if desk.result else ", which has no result"
    response = f", who repaired the fault ({titles})" if titles else ""
    return (
        f"The correct verdicts differ: {right} for your day{reason if right == 'INVALID' else ''}; "
        f"{verdict} for the expert{response}"
    )


def _entries(day: Day) -> Iterator[tuple[int, float, str, str]]:
    seconds = 0.0
    for event in day.events:
        seconds += event.seconds
        typed = typed_words(event.action, event.arguments)
        yield event.number, seconds / 60, event.action, typed
