"""The cost of decisions: the day replayed with one decision corrected and the same draws."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from math import sqrt
from typing import Any

import numpy as np

from virtual_lab.bench.day.actions import ARGUMENTS, OWN_RESULTS, Action
from virtual_lab.bench.day.day import Decision
from virtual_lab.bench.day.desk import Desk, OwnResult
from virtual_lab.bench.day.protocol import left_out
from virtual_lab.bench.day.table import (
    action_table,
)
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.keeping import played
from virtual_lab.errors import InputError

SLIPS = {  # argument: reason why its default is right
    "entered_as": "in the unit of the display",
    "end": "from the tip",
    "clock": "by the photogate",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CostlyDecision:
    """A decision, and the increase of the error of the result that it caused."""

    entry: int  # entry of the notebook; 0: an omission
    what: str
    cost: float | None  # increase of the error of the metric; None: one day has no result
    u: float  # standard uncertainty of the cost, from the scatter of the hits
    word: str  # cost, luck, or no result


def costly(
    apparatus: Apparatus, desk: Desk, truth: float | None, own: tuple[OwnResult, ...], odd: set[int]
) -> tuple[CostlyDecision, ...]:
    """Return the most costly decisions, each corrected alone. `odd` hits were rightly rejected."""
    found: list[CostlyDecision] = []
    value = desk.result[0] if desk.result else None
    entered = desk.last("enter-result")
    for each in own:
        if OWN_RESULTS[each.name] == desk.rules.spec.metric and value is not None and entered:
            found += _cost(entered.number, f"entered {each.name}", each.entered, value, truth, 0.0)
    for entry, what, actions, by_windows in islice(_mended(desk, odd), 12):
        try:
            mended = played_again(apparatus, actions, by_windows)
        except InputError:
            continue
        other = mended.result[0] if mended.result else None
        u = _scatter(desk, mended) if value is not None and other is not None else 0.0
        found += _cost(entry, what, value, other, truth, u)
    found.sort(key=lambda each: -(abs(each.cost) if each.cost is not None else np.inf))
    return tuple(found[:3])


def _cost(
    entry: int, what: str, value: float | None, other: float | None, truth: float | None, u: float
) -> Iterator[CostlyDecision]:
    """Yield the cost of a decision that gave `value` instead of `other`, if there is one."""
    if value is None and other is None:
        return
    if value is None or other is None or truth is None:
        word = (
            "without it there is no result" if other is None else "because of it there is no result"
        )
        yield CostlyDecision(entry=entry, what=what, cost=None, u=0.0, word=word)
        return
    cost = abs(value - truth) - abs(other - truth)
    if abs(cost) >= 1e-9:
        word = "cost" if cost > 0 else "luck: the mistake moved the result closer to the truth"
        yield CostlyDecision(entry=entry, what=what, cost=cost, u=u, word=word)


def _scatter(one: Desk, other: Desk) -> float:
    """Return the standard uncertainty of the difference of two results from different hits."""
    first, second = (desk.reduced for desk in (one, other))
    differ = first.outcome.weights - second.outcome.weights
    metric = first.shot_metric[first.judgement.valid]
    if metric.size < 2 or not np.isfinite(differ).all():
        return 0.0
    return float(np.std(metric, ddof=1)) * sqrt(float(np.sum(differ**2)))


def played_again(apparatus: Apparatus, actions: list[Action], by_windows: set[int]) -> Desk:
    """Return the desk of a day with other actions; hits `by_windows` are decided by the windows."""
    result = ("reduce", "enter-result", "give-verdict", "hand-in", "dispute-score")
    until = [a for a in actions if a.name not in result]
    day = played(apparatus, until)
    reasons = Desk(day).reasons
    decided = {
        shot: Decision(accepted=not reasons[shot], because=reasons[shot]) for shot in by_windows
    }
    return Desk(replace(day, decisions={**day.decisions, **decided}))


def _mended(desk: Desk, odd: set[int]) -> Iterator[tuple[int, str, list[Action], set[int]]]:
    """Yield days with one decision corrected: its entry, its description, and the actions.

    The last element holds the hits that were decided by the windows on the day.
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
    for each in left_out(day):
        if each.step != "load-ball":  # the right ball is unknown
            by_step.setdefault(each.step, []).append(each.before)
    for step, places in by_step.items():
        with_step = list(actions)
        for at in reversed(places):
            with_step.insert(at, Action(name=step, arguments=_defaults(step)))
        times = f", {len(places)} times" if len(places) > 1 else ""
        yield 0, f"skipped: {sheets[step].title.lower()}{times}", with_step, own
    for number, action in enumerate(actions, 1):
        for key in SLIPS.keys() & action.arguments.keys():
            right = _defaults(action.name)[key]
            if action.arguments[key] != right:
                mended = Action(name=action.name, arguments={**action.arguments, key: right})
                what = f"{sheets[action.name].title.lower()}: {action.arguments[key]}"
                others = [*actions[: number - 1], mended, *actions[number:]]
                yield number, f"{what} instead of {SLIPS[key]}", others, own
    for shot in sorted(day.decisions.keys() - own - odd):
        if shot < len(reasons):
            word = day.decisions[shot].word
            why = reasons[shot] or "it is within all windows"
            number = max(
                event.number
                for event in day.events
                if event.action in {"accept", "reject"} and event.arguments["shot"] == shot + 1
            )
            yield number, f"hit {shot + 1} {word} ({why})", actions, own | {shot}


def _defaults(action: str) -> dict[str, Any]:
    return {argument.name: argument.default for argument in ARGUMENTS.get(action, ())}
