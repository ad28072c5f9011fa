"""The debrief: the truth opened, five scores, and the decisions that cost most.

What a decision cost is the day played again with that one mended and the same draws: by how much
nearer to the truth its result comes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from math import sqrt
from typing import Any

import numpy as np

from virtual_lab.bench.actions import ARGUMENTS, Action
from virtual_lab.bench.apparatus import Apparatus
from virtual_lab.bench.day import MAKE_READY, Day, Decision
from virtual_lab.bench.desk import Desk
from virtual_lab.bench.inspection import known_doubts
from virtual_lab.bench.keeping import played
from virtual_lab.bench.scenario import SCORES, Scenario
from virtual_lab.bench.table import action_table
from virtual_lab.errors import InputError
from virtual_lab.output.template import page_template

__all__ = ["CostlyDecision", "DayScore", "Debrief", "debrief", "debrief_page"]

PREPARING = {"tare": "weigh-bat", "level-stand": "measure-balance", "fit-clamp": "swing"}
SLIPS = {  # argument: why its default is right
    "entered_as": "the display's own unit",
    "end": "from the tip",
    "clock": "by the photogate",
}
MOST_MENDED = 12  # days played again
SHOWN = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class DayScore:
    """One score of 0 to 1, and what it rests on."""

    name: str
    value: float
    weight: float
    because: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CostlyDecision:
    """A decision, and by how much the result is farther from the truth for it."""

    entry: int  # of the notebook; 0: something left out
    what: str
    cost: float | None  # of the metric; None: without it there is a result, or there is none
    u: float  # standard uncertainty of the cost, from the scatter of the hits
    word: str  # cost, luck, or no result


@dataclass(frozen=True, slots=True, kw_only=True)
class Debrief:
    """What is told at the end of a day."""

    title: str
    verdict: str
    metric: str
    value: float | None
    u: float | None
    truth: float | None
    right_verdict: str
    faults: tuple[str, ...]
    found: tuple[str, ...]
    missed: tuple[str, ...]
    false_alarms: tuple[str, ...]
    scores: tuple[DayScore, ...]
    costly: tuple[CostlyDecision, ...]
    minutes: float
    shots: int
    entries: tuple[tuple[int, float, str, str], ...]  # number, minute, action, arguments

    def document(self) -> dict[str, Any]:
        """Return it in the form of JSON."""
        return asdict(self)


def debrief(apparatus: Apparatus, day: Day, scenario: Scenario) -> Debrief:
    """Open the truth of a day that was handed in; `InputError` of one that was not."""
    if not day.handed_in:
        raise InputError("debrief", "day", None, "is opened once the day is handed in")
    desk = Desk(day)
    value, u = _result(desk)
    truth = apparatus.finish(day).sealed.measurand.get("metric") if value is not None else None
    limit = desk.rules.spec.most
    named = {
        str(event.arguments["doubt"]): float(event.arguments["confidence"]) / 100
        for event in day.events
        if event.action == "note-doubt" and event.number not in day.struck
    }
    named = {name: sure for name, sure in named.items() if name in known_doubts()}
    faults = scenario.faults
    right = _right_verdict(value, u, truth, limit, spoilt=bool(faults))
    scores = (
        _result_score(value, u, truth, day.verdict, right, bool(set(faults) & set(named))),
        _detection_score(named, faults),
        _protocol_score(day),
        _record_score(desk),
        _economy_score(day, scenario),
    )
    return Debrief(
        title=scenario.title,
        verdict=day.verdict,
        metric=desk.rules.spec.metric,
        value=value,
        u=u,
        truth=truth,
        right_verdict=right,
        faults=faults,
        found=tuple(name for name in faults if name in named),
        missed=tuple(name for name in faults if name not in named),
        false_alarms=tuple(name for name in named if name not in faults),
        scores=tuple(
            DayScore(name=name, value=score, weight=scenario.weights.get(name, 1.0), because=why)
            for name, (score, why) in zip(SCORES, scores, strict=True)
        ),
        costly=_costly(apparatus, desk, value, truth),
        minutes=day.seconds / 60,
        shots=len(day.fired),
        entries=tuple(_entries(day)),
    )


def _result(desk: Desk) -> tuple[float | None, float | None]:
    if not desk.day.fired or desk.missing:
        return None, None
    metric = desk.certification.metric
    return (metric.value, metric.u) if metric else (None, None)


def _right_verdict(
    value: float | None,
    u: float | None,
    truth: float | None,
    limit: float | None,
    *,
    spoilt: bool,
) -> str:
    """Return the verdict of who knows the truth: INVALID where a fault put the result beyond U."""
    if value is None or u is None or truth is None:
        return "INVALID" if spoilt else "MEASURED"
    if spoilt and abs(value - truth) > 2 * u:
        return "INVALID"
    if limit is None:
        return "MEASURED"
    return "PASS" if truth <= limit else "FAIL"


def _result_score(
    value: float | None,
    u: float | None,
    truth: float | None,
    verdict: str,
    right: str,
    found: bool,
) -> tuple[float, str]:
    """Score |x - truth| / U with U = 2 u, and nothing for a false pass or a false fail.

    Who found a fault may refuse to judge, even where the result would have held.
    """
    if {verdict, right} == {"PASS", "FAIL"}:
        return 0.0, f"a false {verdict}: the bat is a {right}"
    if verdict == "INVALID" and (right == "INVALID" or found):
        return 1.0, "rightly not judged"
    if right == "INVALID":
        return 0.2, "judged on a faulty day, the result beyond its U"
    if value is None or u is None or truth is None:
        return 0.2, "no result, of a bat that could be judged"
    normalised = abs(value - truth) / (2 * u)
    fits = 1.0 if normalised <= 1 else 1 / normalised
    why = f"off by {value - truth:+.4f}, which is {normalised:.2f} of U = {2 * u:.4f}"
    return (fits, why) if verdict == right else (fits / 2, f"{why}; the verdict is not {right}")


def _detection_score(named: dict[str, float], faults: tuple[str, ...]) -> tuple[float, str]:
    """Score by Brier: a fault named with confidence p leaves (1 - p)², a false alarm p²."""
    lost = [(1 - named.get(fault, 0.0)) ** 2 for fault in faults]
    lost += [sure**2 for name, sure in named.items() if name not in faults]
    missed = sum(fault not in named for fault in faults)
    alarms = sum(name not in faults for name in named)
    words = f"{len(faults) - missed} of {len(faults)} faults found, {alarms} false alarms"
    return (1 - float(np.mean(lost)) if lost else 1.0), words


def _protocol_score(day: Day) -> tuple[float, str]:
    """Score the share of the steps of the book that were done before what they are for."""
    excused = " ".join(
        str(event.arguments["because"]) for event in day.events if event.action == "note-deviation"
    )
    left_out = [what for what, _ in _left_out(day) if what not in excused]
    due = len(PREPARING) + (len(MAKE_READY) + 1) * len(day.fired)
    words = f"{due - len(left_out)} of {due} steps done in time"
    if left_out:
        words += "; left out: " + ", ".join(sorted(set(left_out)))
    return (due - len(left_out)) / due, words


def _left_out(day: Day) -> Iterator[tuple[str, int]]:
    """Yield each step that was not done in time, and the place in the events it belongs to."""
    names = [event.action for event in day.events]
    for step, before in PREPARING.items():
        if before in names and step not in names[: names.index(before)]:
            yield step, names.index(before)
    since: set[str] = set()
    shot = 0
    for at, name in enumerate(names):
        if name != "fire":
            since.add(name)
            continue
        due = MAKE_READY if shot else tuple(s for s in MAKE_READY if s != "clear-scrap")
        for step in (*due, "load-ball"):
            if step not in since:
                yield step, at
        since.clear()
        shot += 1


def _record_score(desk: Desk) -> tuple[float, str]:
    """Score the share of hits whose decision is there and is that of the windows."""
    reasons = desk.reasons if not desk.missing else ()
    if not reasons:
        return 0.0, "no hit to decide on"
    given = desk.day.decisions
    right = sum(
        shot in given and given[shot].accepted == (not why) for shot, why in enumerate(reasons)
    )
    return right / len(reasons), f"{right} of {len(reasons)} hits decided as the windows have it"


def _economy_score(day: Day, scenario: Scenario) -> tuple[float, str]:
    minutes, shots = day.seconds / 60, max(len(day.fired), 1)
    share = min(1.0, scenario.minutes / max(day.seconds, 1.0)) * min(1.0, scenario.shots / shots)
    words = f"{minutes:.0f} min and {len(day.fired)} shots"
    return share, f"{words}; a good day takes {scenario.minutes / 60:.0f} and {scenario.shots}"


def _costly(
    apparatus: Apparatus, desk: Desk, value: float | None, truth: float | None
) -> tuple[CostlyDecision, ...]:
    """Return the decisions that cost most, each mended alone."""
    found = []
    for entry, what, actions, by_windows in list(_mended(desk))[:MOST_MENDED]:
        try:
            mended = _played_again(apparatus, actions, by_windows)
            other, _ = _result(mended)
        except InputError:
            continue
        if other is None and value is None:
            continue
        if other is None or value is None or truth is None:
            word = "no result without it" if other is None else "no result because of it"
            found.append(CostlyDecision(entry=entry, what=what, cost=None, u=0.0, word=word))
            continue
        cost = abs(value - truth) - abs(other - truth)
        if abs(cost) < 1e-9:
            continue
        u = _scatter(desk, mended)
        word = "cost" if cost > 0 else "luck: the mistake moved the result toward the truth"
        found.append(CostlyDecision(entry=entry, what=what, cost=cost, u=u, word=word))
    found.sort(key=lambda each: -(abs(each.cost) if each.cost is not None else np.inf))
    return tuple(found[:SHOWN])


def _scatter(one: Desk, other: Desk) -> float:
    """Return the standard uncertainty of the difference of two results from other hits counted."""
    first, second = (desk.reduced for desk in (one, other))
    differ = first.outcome.weights - second.outcome.weights
    metric = first.shot_metric[first.judgement.valid]
    if metric.size < 2 or not np.isfinite(differ).all():
        return 0.0
    return float(np.std(metric, ddof=1)) * sqrt(float(np.sum(differ**2)))


def _played_again(apparatus: Apparatus, actions: list[Action], by_windows: set[int]) -> Desk:
    """Return the desk of a day of other actions, some hits decided by the windows."""
    until = [a for a in actions if a.name not in {"reduce", "give-verdict", "hand-in"}]
    day = played(apparatus, until)
    reasons = Desk(day).reasons
    decided = {
        shot: Decision(accepted=not reasons[shot], because=reasons[shot]) for shot in by_windows
    }
    return Desk(replace(day, decisions={**day.decisions, **decided}))


def _mended(desk: Desk) -> Iterator[tuple[int, str, list[Action], set[int]]]:
    """Yield days with one decision mended: its entry, what it was, and the day's actions.

    With them the hits that are decided by the windows there: those that were so on the day.
    """
    day = desk.day
    actions = [Action(name=event.action, arguments=event.arguments) for event in day.events]
    reasons = desk.reasons if day.fired and not desk.missing else ()
    sheets = action_table().actions
    own = {
        shot
        for shot, chosen in day.decisions.items()
        if shot < len(reasons) and chosen.accepted == (not reasons[shot])
    }
    by_step: dict[str, list[int]] = {}
    for step, at in _left_out(day):
        if step != "load-ball":  # which ball it would have been nobody knows
            by_step.setdefault(step, []).append(at)
    for step, places in by_step.items():
        with_step = list(actions)
        for at in reversed(places):
            with_step.insert(at, Action(name=step, arguments=_defaults(step)))
        times = f", {len(places)} times" if len(places) > 1 else ""
        yield 0, f"left out: {sheets[step].title.lower()}{times}", with_step, own
    for number, action in enumerate(actions, 1):
        for key in SLIPS.keys() & action.arguments.keys():
            right = _defaults(action.name)[key]
            if action.arguments[key] != right:
                mended = Action(name=action.name, arguments={**action.arguments, key: right})
                what = f"{sheets[action.name].title.lower()}: {action.arguments[key]}"
                others = [*actions[: number - 1], mended, *actions[number:]]
                yield number, f"{what}, not {SLIPS[key]}", others, own
    for shot in sorted(day.decisions.keys() - own):
        if shot < len(reasons):
            word = "accepted" if day.decisions[shot].accepted else "rejected"
            why = reasons[shot] or "the windows have nothing against it"
            number = max(
                event.number
                for event in day.events
                if event.action in {"accept", "reject"} and event.arguments["shot"] == shot + 1
            )
            yield number, f"hit {shot + 1} {word}: {why}", actions, own | {shot}


def _defaults(action: str) -> dict[str, Any]:
    return {argument.name: argument.default for argument in ARGUMENTS.get(action, ())}


def _entries(day: Day) -> Iterator[tuple[int, float, str, str]]:
    seconds = 0.0
    for event in day.events:
        seconds += event.seconds
        given = ", ".join(f"{key} {value}" for key, value in event.arguments.items())
        yield event.number, seconds / 60, event.action, given.replace("_", " ")


def debrief_page(told: Debrief) -> str:
    """Return the debrief as one HTML page that needs nothing but itself."""
    return page_template("virtual_lab.bench", "debrief.html").render(
        told=told, sheets=action_table().actions, titles=known_doubts()
    )
