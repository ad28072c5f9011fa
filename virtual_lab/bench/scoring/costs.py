"""The effect of decisions: the day is replayed with one decision corrected and the same draws."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from math import sqrt
from typing import Any

import numpy as np

from virtual_lab.bench.day.actions import ARGUMENTS, RESULT_QUANTITIES, Action, action_of
from virtual_lab.bench.day.day import CHECKLISTS, DISPUTE, Day, DayEvent
from virtual_lab.bench.day.desk import Desk, EnteredResult
from virtual_lab.bench.day.operators import Look
from virtual_lab.bench.day.protocol import omitted_steps
from virtual_lab.bench.day.table import action_table
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.stored_day import run_operator
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import UNDECIDED
from virtual_lab.records.session import HitDecision

SLIPS = {  # correct choice of each argument, in words
    "entered_as": "in the unit of the display",
    "end": "from the tip",
    "clock": "by the photogate",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CostlyDecision:
    """A decision, and the change of the error of the result that it caused."""

    entry: int  # entry of the notebook; 0: an omission
    what: str  # description
    cost: float | None  # increase of |error| of the metric; None if a day has no result
    u: float  # standard uncertainty of the cost, from the scatter of the hits
    word: str  # the effect in words


def costly_decisions(
    apparatus: Apparatus,
    desk: Desk,
    truth: float | None,
    results: tuple[EnteredResult, ...],
    justified: set[int],
) -> tuple[CostlyDecision, ...]:
    """Return up to three wrong decisions with the largest effect on the error of the result.

    For each wrong decision, the day is replayed with only this decision corrected. The effect is
    the change of the absolute error of the result. The decision with the largest effect is first.

    Some decisions have no effect in numbers, because the day has a result only with the wrong
    decision, or only without it. These decisions come before all others. The tuple is empty if no
    decision changed the error.

    Parameters
    ----------
    apparatus
        The machines of the laboratory.
    desk
        The trainee's day with its reduced results.
    truth
        True metric [SI]; None if it is unknown, so that no error of a result is known.
    results
        Results that the trainee entered.
    justified
        Indices of the shots that were rejected for a good reason, counted from 0. These rejections
        are not corrected.
    """
    decisions: list[CostlyDecision] = []
    value = desk.result[0] if desk.result else None
    entered = desk.last("enter-result")
    for result in results:
        is_metric = RESULT_QUANTITIES[result.name] == desk.rules.spec.metric
        if is_metric and value is not None and entered:
            what = f"entered {result.name}"
            decisions += _cost(entered.number, what, result.entered, value, truth, 0.0)
    for entry, description, actions, by_windows in islice(_corrected_days(desk, justified), 12):
        try:
            corrected = replay_day(apparatus, actions, by_windows)
        except InputError:
            continue
        corrected_value = corrected.result[0] if corrected.result else None
        u = _scatter(desk, corrected) if value is not None and corrected_value is not None else 0.0
        decisions += _cost(entry, description, value, corrected_value, truth, u)
    decisions.sort(key=lambda result: -(abs(result.cost) if result.cost is not None else np.inf))
    return tuple(decisions[:3])


def _cost(
    entry: int,
    description: str,
    value: float | None,
    corrected_value: float | None,
    truth: float | None,
    u: float,
) -> Iterator[CostlyDecision]:
    """Yield the effect of a decision that gave `value` instead of `corrected_value`, if any."""
    if value is None and corrected_value is None:
        return
    if value is None or corrected_value is None:
        word = "this decision prevents a result"
        if corrected_value is None:
            word = "there is no result without this decision"
        yield CostlyDecision(entry=entry, what=description, cost=None, u=0.0, word=word)
        return
    if truth is None:
        return
    cost = abs(value - truth) - abs(corrected_value - truth)
    if abs(cost) >= 1e-9:
        word = "cost" if cost > 0 else "luck: the mistake moved the result closer to the truth"
        yield CostlyDecision(entry=entry, what=description, cost=cost, u=u, word=word)


def _scatter(day: Desk, corrected: Desk) -> float:
    """Return the standard uncertainty of the difference of two results with different hits.

    It is 0 with fewer than two valid hits.
    """
    first, second = (desk.reduced for desk in (day, corrected))
    weights = first.hit_weights.weights - second.hit_weights.weights
    metric = first.shot_metric[first.valid]
    if metric.size < 2 or not np.isfinite(weights).all():
        return 0.0
    return float(np.std(metric, ddof=1)) * sqrt(float(np.sum(weights**2)))


def replay_day(apparatus: Apparatus, actions: list[Action], by_windows: set[int]) -> Desk:
    """Repeat the given actions on a new day, and return the `Desk` (the results) of this day.

    The shots in `by_windows`, counted from 0, are accepted or rejected by the acceptance windows
    instead of by the trainee. Impact positions without a value are those that the rules require on
    the new day. Checklists and all actions after the measurement, such as a verdict, are left out.
    Raises `InputError` if an action is impossible, or if a record that the acceptance windows need
    is missing.
    """
    # a new day rejects checklists, which change nothing
    left_out = {"reduce", "enter-result", "give-verdict", "hand-in", DISPUTE, *CHECKLISTS}

    def play(look: Look) -> Iterator[Action]:
        for each in actions:
            if each.name == "set-place" and not each.arguments:
                if (place := look().next_position) is not None:
                    yield action_of("set-place", {"place": 1e3 * place})
            elif each.name not in left_out:
                yield each

    day = run_operator(apparatus, play)
    reasons = Desk(day).reasons
    decided = {
        shot: HitDecision(
            shot=shot, accepted=not reasons[shot], because=reasons[shot], by="the windows"
        )
        for shot in by_windows
    }
    return Desk(replace(day, decisions={**day.decisions, **decided}))


def actions_to_replay(day: Day) -> list[Action]:
    """Return the actions of a day for `replay_day`.

    An impact position that the rules required then has no value, so that it follows from the
    readings of the replayed day, for example from another balance point.
    """
    return [
        Action(name=event.action, arguments={} if _is_required(day, event) else event.arguments)
        for event in day.events
    ]


def _is_required(day: Day, event: DayEvent) -> bool:
    """Return whether an entry sets the impact position that the rules required at that time."""
    if event.action != "set-place":
        return False
    desk = Desk(day.until(event.number))
    return not (desk.reduction_error or desk.next_position is None or desk.needs_position)


def _corrected_days(
    desk: Desk, justified: set[int]
) -> Iterator[tuple[int, str, list[Action], set[int]]]:
    """Yield one tuple per wrong decision, with the actions of a day in which it is corrected.

    A tuple holds the entry number of the decision (0 for an omitted step), its description, all
    actions of the corrected day, and the shots to be judged by the acceptance windows.
    """
    day = desk.day
    actions = actions_to_replay(day)
    reasons = desk.reasons if day.fired and not desk.reduction_error else ()
    sheets = action_table().actions
    accepted = {shot for shot, decision in day.decisions.items() if decision.accepted}
    # an undecided hit counts as little as a rejected one
    by_windows = {shot for shot, why in enumerate(reasons) if (shot in accepted) == (not why)}
    by_step: dict[str, list[int]] = {}
    for each in omitted_steps(day):
        if each.step != "load-ball":  # the ball that should have been loaded is unknown
            by_step.setdefault(each.step, []).append(each.before)
    for step, places in by_step.items():
        with_step = list(actions)
        for at in reversed(places):
            with_step.insert(at, Action(name=step, arguments=_defaults(step)))
        times = f", {len(places)} times" if len(places) > 1 else ""
        yield 0, f"skipped: {sheets[step].title.lower()}{times}", with_step, by_windows
    for number, action in enumerate(actions, 1):
        for key in SLIPS.keys() & action.arguments.keys():
            default = _defaults(action.name)[key]
            if action.arguments[key] != default:
                corrected = Action(name=action.name, arguments={**action.arguments, key: default})
                choice = f"{action.arguments[key]} instead of {SLIPS[key]}"
                description = f"{sheets[action.name].title.lower()}: {choice}"
                corrected_actions = [*actions[: number - 1], corrected, *actions[number:]]
                yield number, description, corrected_actions, by_windows
    wrong = sorted(set(range(len(reasons))) - by_windows - justified)
    if desk.result is None and len(wrong) > 1:  # correcting one may not give a result
        description = f"{len(wrong)} hits undecided, or decided against the windows"
        yield 0, description, actions, by_windows.union(wrong)
    for shot in wrong:
        word = day.decisions[shot].word if shot in day.decisions else UNDECIDED
        reason = reasons[shot] or "it is within all windows"
        entries = (
            event.number
            for event in day.events
            if event.action in {"accept", "reject"} and event.arguments["shot"] == shot + 1
        )
        description = f"hit {shot + 1} {word} ({reason})"
        yield max(entries, default=0), description, actions, by_windows | {shot}


def _defaults(action: str) -> dict[str, Any]:
    return {argument.name: argument.default for argument in ARGUMENTS.get(action, ())}
