"""State of a day: `decide` returns the price of an action or rejects it, `evolve` applies an event.

The state contains only information that a page may show, not the truth. The events contain the
readings of the instruments, so the log alone defines the day.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import reduce
from itertools import takewhile
from typing import Annotated, Any

from annotated_types import Ge

from virtual_lab.bench.day.actions import Action
from virtual_lab.bench.day.table import MAKE_READY, action_table, repairs
from virtual_lab.catalog.specs import Spec
from virtual_lab.errors import InputError
from virtual_lab.records.session import HitDecision, Session

AFTER_REDUCTION = frozenset(
    {"end-checklist", "note-doubt", "note-deviation", "give-verdict", "hand-in"}
)
DISPUTE = "dispute-score"  # the only action after the day is handed in
CHECKLISTS = frozenset({"start-checklist", "end-checklist"})
Display = tuple[tuple[str, int | float | str, str], ...]  # quantity, value, unit


@dataclass(frozen=True, slots=True, kw_only=True)
class DayEvent(Spec):
    """An action that was carried out, with price and readings, in a form that JSON can store."""

    number: int  # from 1
    action: str
    arguments: Mapping[str, Any]
    seconds: Annotated[float, Ge(0)]
    # instrument records by channel
    records: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    shown: Display = ()  # values on the display
    # changed calibration constants
    constants: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    sketch: Mapping[str, Any] = field(default_factory=dict)  # blurred top view of a shot


@dataclass(frozen=True, slots=True, kw_only=True)
class Day:
    """State of a day at the bench, without the truth."""

    morning: Session  # calibration constants before the first action
    balls: int
    supplied_events: int = 0  # number of events that another laboratory supplied
    # possible faults, each with its probability
    listed: Mapping[str, float] = field(default_factory=dict)
    practice: int = 0  # entry from which an earlier day is repeated; 0: no practice
    checklists: bool = False
    remarks: bool = False  # whether the page names an omitted step at once
    exam: bool = False  # whether the day gives no feedback
    operator: str = "trainee"
    events: tuple[DayEvent, ...] = ()
    seconds: float = 0.0
    done: Mapping[str, int] = field(default_factory=dict)  # number of times of each action
    struck: frozenset[int] = frozenset()  # events that were struck out
    repaired_faults: frozenset[str] = frozenset()  # faults that the repairs so far remove
    tared: bool = False
    level: bool = False
    clamped: bool = False
    ready: frozenset[str] = frozenset()  # steps of MAKE_READY done since the last shot
    scrap: int = 0  # number of shots since the scrap was cleared
    shift: tuple[tuple[float, float], ...] = ()  # requested moves of the aim, along and across [m]
    ball: int | None = None  # ball in the cannon, from 0
    retired: frozenset[int] = frozenset()
    place: float | None = None  # set impact position [m]
    fired: tuple[tuple[int, float], ...] = ()  # ball and time [s] of each shot
    decisions: Mapping[int, HitDecision] = field(default_factory=dict)  # keyed by shot, from 0
    reduced: bool = False
    verdict: str = ""
    handed_in: bool = False

    def times(self, action: str) -> int:
        """Return the number of times that an action was carried out."""
        return self.done.get(action, 0)

    def until(self, entry: int) -> Day:
        """Return the day after entry number `entry`; 0 is the day before its first entry."""
        names = takewhile(lambda name: name != "events", (each.name for each in fields(self)))
        first = Day(**{name: getattr(self, name) for name in names})
        return replay_events(first, self.events[:entry])


def decide(day: Day, action: Action) -> float:
    """Return the laboratory time that an action takes [s], if the action is allowed now.

    `day` is not changed. An action is rejected only if it is impossible now or would change reduced
    results. An action that is only a mistake is allowed.

    Raises
    ------
    InputError
        The action is rejected. The message states the reason.
    """
    name, arguments = action.name, action.arguments
    if day.handed_in and name != DISPUTE:
        raise InputError(name, "day", None, "has been handed in, so nothing can be added")
    if name == DISPUTE and not day.handed_in:
        raise InputError(name, "day", None, "has not been handed in yet")
    if name in CHECKLISTS and not day.checklists:
        raise InputError(name, "day", None, "has no checklists")
    if not has_instrument(day, name):
        part = action_table().actions[name].needs.rpartition(".")[2]
        raise InputError(name, "rig", None, f"has no {part}")
    if not _machines_are_present(day, name):
        raise InputError(
            name, "records", None, "came from another laboratory, so nothing can be measured again"
        )
    if day.reduced and not day.handed_in and name not in AFTER_REDUCTION:
        allowed = "has been reduced, so hits and readings can no longer change"
        raise InputError(name, "day", None, allowed)
    _require_for_shot(day, name, arguments)
    if name == "strike-out":
        _require_reading(day, int(arguments["entry"]))
    if name == "reduce" and not day.fired:
        raise InputError(name, "hits", None, "are missing: no shot has been fired at the bat yet")
    has_result = day.reduced or day.times("enter-result")
    if name == "give-verdict" and not has_result and arguments["verdict"] != "INVALID":
        allowed = "reduce or enter-result comes first; without a result only INVALID is allowed"
        raise InputError(name, "verdict", arguments["verdict"], allowed)
    if name == "hand-in" and not day.verdict:
        raise InputError(name, "verdict", None, "is missing: give-verdict comes first")
    return action_table().actions[name].minutes


def is_offered(day: Day, action: str) -> bool:
    """Return whether the page of a day offers an action.

    Before the day is handed in, the page offers the actions that this rig and this day allow. After
    that, it offers only the dispute of a score, or nothing in an exam. Raises `KeyError` for an
    unknown action.
    """
    if day.handed_in or action == DISPUTE:
        return day.handed_in and action == DISPUTE and not day.exam
    if action in CHECKLISTS:
        return day.checklists
    return _machines_are_present(day, action) and has_instrument(day, action)


def ready_steps(day: Day) -> tuple[str, ...]:
    """Return the names of the steps that make the rig ready for each shot, in order.

    A step is left out if it needs an instrument that the rig does not have.
    """
    return tuple(step for step in MAKE_READY if has_instrument(day, step))


def has_instrument(day: Day, action: str) -> bool:
    """Return whether the rig has the instrument that an action needs.

    The result is True for an action that needs no instrument. Before the laboratory is set up, its
    instruments are unknown, and the result is True for every action. Raises `KeyError` for an
    unknown action.
    """
    needs, calibration = action_table().actions[action].needs, day.morning.calibration
    return not calibration or any(key.startswith(needs) for key in calibration)


def _machines_are_present(day: Day, action: str) -> bool:
    """Return whether the machines that an action needs are present.

    On a day that began with the records of another laboratory there are no machines.
    """
    at_machines = len(day.events) < day.supplied_events or not day.supplied_events
    paperwork = {DISPUTE, "accept", "reject", "strike-out", "enter-result", "reduce"}
    return at_machines or action in paperwork | AFTER_REDUCTION | CHECKLISTS


def _require_for_shot(day: Day, name: str, arguments: Mapping[str, Any]) -> None:
    if name == "fire":
        if day.ball is None:
            raise InputError(name, "ball", None, "is missing: load-ball comes first")
        if day.place is None:
            raise InputError(name, "impact position", None, "is missing: set-place comes first")
    if name in {"load-ball", "retire-ball"}:
        ball = int(arguments["ball"])
        if ball > day.balls:
            raise InputError(name, "ball", ball, f"allowed: 1 to {day.balls}, the balls of the lot")
        if ball - 1 in day.retired:
            raise InputError(name, "ball", ball, "has been retired")
    if name in {"accept", "reject"} and int(arguments["shot"]) > len(day.fired):
        allowed = f"allowed: 1 to {len(day.fired)}" if day.fired else "no shot has been fired yet"
        raise InputError(name, "shot", arguments["shot"], allowed)


def _require_reading(day: Day, entry: int) -> None:
    actions = {event.number: event.action for event in day.events}
    lasting = {*AFTER, *CHECKLISTS, DISPUTE, "hit-wall"}  # the wall test wears the balls
    if entry not in actions or actions[entry] in lasting:
        allowed = "only readings can be struck out; reject a hit instead"
        raise InputError("strike-out", "entry", entry, allowed)
    if entry in day.struck:
        raise InputError("strike-out", "entry", entry, "has already been struck out")


def evolve(day: Day, event: DayEvent) -> Day:
    """Return the state of the day after one more event; `day` is unchanged.

    This function does not check whether the action is allowed; `decide` does.
    """
    day = replace(
        day,
        events=(*day.events, event),
        seconds=day.seconds + event.seconds,
        done={**day.done, event.action: day.times(event.action) + 1},
    )
    after = AFTER.get(event.action)
    return replace(day, **after(day, event.arguments)) if after else day


def replay_events(morning: Day, events: Iterable[DayEvent]) -> Day:
    """Return the state of a day after all `events`.

    `morning` is the state before the first event.
    """
    return reduce(evolve, events, morning)


Changes = Mapping[str, Any]  # fields of a day


def _set_position(day: Day, arguments: Changes) -> Changes:
    # a slow import, not needed for the first page
    from virtual_lab.measurement.procedure import round_to_setting

    place = float(round_to_setting(arguments["place"] / 1e3, exact=False))
    return {"place": place, "ready": day.ready - {"wait-rest"}}


def _record_decision(accepted: bool) -> Callable[[Day, Changes], Changes]:
    def record(day: Day, arguments: Changes) -> Changes:
        shot, is_supplied = arguments["shot"] - 1, len(day.events) <= day.supplied_events
        by = "the other laboratory" if is_supplied else day.operator
        decision = HitDecision(shot=shot, accepted=accepted, because=arguments["because"], by=by)
        return {"decisions": {**day.decisions, shot: decision}}

    return record


def _remove_faults(faults: tuple[str, ...]) -> Callable[[Day, Changes], Changes]:
    return lambda day, _: {"repaired_faults": day.repaired_faults | set(faults)}


def _mark_ready(step: str) -> Callable[[Day, Changes], Changes]:
    return lambda day, _: {"ready": day.ready | {step}}


AFTER: Mapping[str, Callable[[Day, Changes], Changes]] = {  # consequences of each action
    **{step: _mark_ready(step) for step in MAKE_READY},
    **{name: _remove_faults(each.mends) for name, each in repairs().items()},
    "tare": lambda *_: {"tared": True},
    "clear-pan": lambda day, _: {
        "tared": True,
        "repaired_faults": day.repaired_faults | set(repairs()["clear-pan"].mends),
    },
    "level-stand": lambda *_: {"level": True},
    "fit-clamp": lambda _, arguments: {"clamped": arguments["fitted"] == "yes"},
    "re-aim": lambda day, arguments: {
        "shift": (*day.shift, (arguments["along"] / 1e3, arguments["across"] / 1e3))
    },
    "set-place": _set_position,
    "load-ball": lambda _, arguments: {"ball": arguments["ball"] - 1},
    "retire-ball": lambda day, arguments: {
        "retired": day.retired | {arguments["ball"] - 1},
        "ball": None if day.ball == arguments["ball"] - 1 else day.ball,
    },
    "clear-scrap": lambda day, _: {"scrap": 0, "ready": day.ready | {"clear-scrap"}},
    "fire": lambda day, _: {
        "fired": (*day.fired, (day.ball, day.seconds)),
        "ready": frozenset(),
        "scrap": day.scrap + 1,
    },
    "accept": _record_decision(True),
    "reject": _record_decision(False),
    "strike-out": lambda day, arguments: {"struck": day.struck | {arguments["entry"]}},
    "reduce": lambda *_: {"reduced": True},
    "give-verdict": lambda _, arguments: {"verdict": arguments["verdict"]},
    "hand-in": lambda *_: {"handed_in": True},
}
