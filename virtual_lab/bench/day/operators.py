"""Simulated operators, who carry out a day without a page.

An operator is a generator of actions. Before each action it can look at the desk, which contains
the same information as a page.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.day import ready_steps
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.protocol import excuses_of, omitted_steps
from virtual_lab.bench.day.readings import suspected_faults
from virtual_lab.bench.day.table import (
    action_table,
    detectable,
    preparation,
    remedy_of,
)
from virtual_lab.errors import InputError, nearest
from virtual_lab.streams import Streams

Look = Callable[[], Desk]
Operator = Callable[[Look], Iterator[Action]]
FIRST_SHOTS = 3  # number of shots after which the expert fires at the check cylinder
BEFORE = "fired before the repair"


@dataclass(frozen=True)
class Habits:
    """Deviations of an operator from the procedure. The operator's seed decides when they occur."""

    seed: int = 0
    forgets: float = 0.0  # probability of omitting a step of preparation
    hurries: float = 0.0  # probability of timing by hand or with few swings
    waves_through: float = 0.0  # probability of accepting a hit that the rules reject
    checks: bool = False  # whether the operator makes all checks and repairs the faults
    listed: bool = False  # whether these checks are only those for the scenario's listed faults
    wants: bool = False  # whether the operator rejects high hits to get a low result

    def checks_of(self, listed: Mapping[str, float]) -> set[str]:
        """Return the names of the checks that the operator makes; empty if `checks` is False."""
        detection = detectable()
        faults = [name for name in listed if name in detection] if self.listed else list(detection)
        return (
            {each for name in faults for each in detection[name].actions} if self.checks else set()
        )

    def slips(self, chance: float, slip: str, number: int = 0) -> bool:
        """Return whether a slip occurs, with probability `chance`, on the given occasion."""
        number_drawn = Streams(self.seed).uniform(f"operator.{slip}", slots=np.array([number]))
        return bool(number_drawn[0] + 0.5 < chance)


def _take(look: Look, habits: Habits) -> Iterator[Action]:
    """Yield all actions of a day by the procedure, with the deviations of the operator."""
    if look().day.supplied_events:
        yield from _decide_hits(look)
        yield from _end(look, habits)
        return
    checks = habits.checks_of(look().day.listed)
    for name in preparation():
        careful = name in {"tare", "level-stand", "fit-clamp"}
        if careful and habits.slips(habits.forgets, name):
            continue
        yield action_of(name, _arguments_of(name, habits))
        for check, sheet in action_table().actions.items():
            if check in checks and sheet.check_after == name:
                yield action_of(check)
        if checks:
            yield from _repair_faults(look)
    yield from _hits(look, habits)
    yield from _end(look, habits)


def _decide_hits(look: Look) -> Iterator[Action]:
    """Yield corrected decisions on the hits of another laboratory, and notes on omitted steps."""
    for shot, why in enumerate(look().reasons if not look().reduction_error else ()):
        decision = look().day.decisions.get(shot)
        if decision is None or decision.accepted == bool(why):
            because = {"because": why} if why else {}
            yield action_of("reject" if why else "accept", {"shot": shot + 1, **because})
    excuses = excuses_of(look().day)
    steps = dict.fromkeys(
        each.step for each in omitted_steps(look().day) if each.step not in excuses
    )
    for step in steps:
        yield action_of("note-deviation", {"step": step, "because": "left out in the records"})


def _repair_faults(look: Look) -> Iterator[Action]:
    """Yield, for each suspected fault, a note, the repair, and the readings to repeat."""
    while new := [
        row for row in suspected_faults(look()) if row.fault not in _noted_faults(look())
    ]:
        row, sheets = new[0], action_table().actions
        sure = 100 * detectable()[row.fault].sure
        yield action_of("note-doubt", {"doubt": row.fault, "confidence": sure})
        remedy = None if look().day.supplied_events else remedy_of(row.fault)
        if remedy is None:
            continue
        name, arguments = remedy
        worn = {"ball": int(str(row.words[0]))} if name == "retire-ball" else {}
        yield action_of(name, {**arguments, **worn})
        again = [each for each in sheets[name].again if look().day.times(each)]
        yield from map(action_of, again)
        if sheets[name].part == "rig" or "hit-wall" in again:
            yield from _reject_earlier_shots(look, sheets[name].title)


def _reject_earlier_shots(look: Look, repair: str) -> Iterator[Action]:
    """Yield the rejection of each shot that was fired before a repair."""
    day = look().day
    for shot in range(len(day.fired)):
        if shot not in day.decisions or day.decisions[shot].accepted:
            yield action_of("reject", {"shot": shot + 1, "because": f"{BEFORE} “{repair}”"})


def _noted_faults(desk: Desk) -> set[str]:
    return {str(e.arguments["doubt"]) for e in desk.day.events if e.action == "note-doubt"}


def _arguments_of(name: str, habits: Habits) -> Mapping[str, object]:
    if name != "swing" or not habits.slips(habits.hurries, "swing"):
        return {}
    return {"clock": "hand", "swings": 3, "amplitude": 15}


def _hits(look: Look, habits: Habits) -> Iterator[Action]:
    """Yield shots and decisions until the rules need no further hit."""
    while not look().reduction_error and (place := look().next_position) is not None:
        shot = len(look().day.fired)
        if look().needs_position:
            yield action_of("set-place", {"place": round(place * 1e3, 3)})
        if not (shot and habits.slips(habits.forgets, "load-ball", shot)):
            yield action_of("load-ball", {"ball": look().next_ball + 1})
        for step in ready_steps(look().day):
            if not habits.slips(habits.forgets, step, shot):
                yield action_of(step)
        yield action_of("fire")
        if shot + 1 == FIRST_SHOTS and "fire-check-cylinder" in habits.checks_of(look().day.listed):
            yield action_of("fire-check-cylinder")
        if habits.checks:
            yield from _repair_faults(look)
        if shot not in look().day.decisions:
            yield _decision(look(), habits)


def _decision(desk: Desk, habits: Habits) -> Action:
    shot = len(desk.day.fired)
    why = desk.reasons[-1]
    waved = habits.slips(habits.waves_through, "accept", shot) or (habits.wants and _lowest(desk))
    if why and not waved:
        return action_of("reject", {"shot": shot, "because": why})
    if why:
        return action_of("accept", {"shot": shot, "because": "near enough"})
    if habits.wants and _can_spare(desk) and not _lowest(desk):
        return action_of("reject", {"shot": shot, "because": "did not sound right"})
    return action_of("accept", {"shot": shot})


def _lowest(desk: Desk) -> bool:
    """Return whether the metric of the last hit is the lowest so far."""
    metric = desk.reduction_by_rules.shot_metric
    return bool(np.isfinite(metric[-1]) and metric[-1] <= np.nanmin(metric))


def _can_spare(desk: Desk) -> bool:
    """Return whether enough attempts are left if the last hit is rejected."""
    attempts_left = desk.rules.spec.attempts - len(desk.day.fired)
    return attempts_left >= desk.rules.spec.valid_hits - int(desk.reduced.valid.sum())


def _end(look: Look, habits: Habits) -> Iterator[Action]:
    certain: dict[str, float] = {}
    if habits.checks:
        if "tap-bat" in habits.checks_of(look().day.listed) and not look().day.supplied_events:
            yield action_of("tap-bat")
        yield from _repair_faults(look)
        sure = {doubt.fault: detectable()[doubt.fault].sure for doubt in suspected_faults(look())}
        certain = {fault: each for fault, each in sure.items() if each >= 0.9}
    if look().result is None:
        yield action_of("give-verdict", {"verdict": "INVALID", "doubt": "no result"})
    else:
        yield action_of("reduce")
        verdict = look().certification.verdict.value
        invalid = bool(certain) or verdict == "INVALID"
        confidence = max(certain.values(), default=0.9) if invalid else _confidence(look())
        arguments = {
            "verdict": "INVALID" if invalid else verdict,
            "confidence": round(100 * confidence, 1),
            "doubt": next(iter(certain), "none"),
        }
        yield action_of("give-verdict", arguments)
    yield action_of("hand-in")


def _confidence(desk: Desk) -> float:
    """Return the probability that the true metric is on the same side of the limit as the result.

    It is 0.9 if there is no result or no limit, or if the bat breaks another rule.
    """
    result, limit = desk.result, desk.rules.spec.metric_limit
    if result is None or limit is None or not all(f.met for f in desk.certification.findings):
        return 0.9
    value, u = result
    return NormalDist().cdf(abs(value - limit) / u)


HABITS = {
    "book": Habits(),
    "expert": Habits(checks=True),
    "careful": Habits(checks=True, listed=True),
    "careless": Habits(forgets=0.3, hurries=0.6, waves_through=0.5),
    "cheating": Habits(wants=True),
}


def operator_of(name: str, seed: int = 0) -> Operator:
    """Return the simulated operator with this name.

    An operator is a function that yields one action after another. `seed` determines the mistakes
    that the operator makes. Raises `InputError` for an unknown name.
    """
    if name not in HABITS:
        allowed = f"{nearest(name, HABITS)}allowed: {', '.join(HABITS)}"
        raise InputError("", "operator", name, allowed)
    habits = replace(HABITS[name], seed=seed)
    return lambda look: _take(look, habits)


def by_script(script: Mapping[str, Any], where: str) -> Operator:
    """Return an operator that carries out a list of actions.

    Parameters
    ----------
    script
        ``{"actions": [{"do": NAME, ARGUMENT: VALUE, …}, …]}``.
    where
        Name of the script in error messages.

    Raises
    ------
    InputError
        The list is missing or empty, or an entry is not a valid action; the message gives its
        number.
    """
    entries = script.get("actions")
    if not isinstance(entries, list) or not entries:
        raise InputError(where, "actions", None, 'expected a list of {"do": NAME, …}')
    actions = []
    for number, entry in enumerate(entries, 1):
        if not isinstance(entry, dict) or not isinstance(entry.get("do"), str):
            raise InputError(where, f"actions[{number}]", entry, 'expected {"do": NAME, …}')
        arguments = {key: value for key, value in entry.items() if key != "do"}
        try:
            actions.append(action_of(entry["do"], arguments))
        except InputError as fault:
            raise InputError(where, f"actions[{number}]", None, str(fault)) from fault
    return lambda _: iter(actions)
