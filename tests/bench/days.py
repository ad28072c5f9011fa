"""Days at the bench that many tests look at, each laboratory opened once in a process."""

from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any

from virtual_lab.bench.day.actions import Action, action_of
from virtual_lab.bench.day.day import Day
from virtual_lab.bench.day.doubts import fault_sheets
from virtual_lab.bench.day.operators import Look, Operator, operator_of
from virtual_lab.bench.day.scenario import Scenario
from virtual_lab.bench.day.table import MAKE_READY, preparation
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.stored_day import laboratory_of, run_operator
from virtual_lab.bench.scoring.debrief import Debrief, debrief

__all__ = [
    "PLAIN",
    "after_plain",
    "apparatus",
    "asked",
    "day_of",
    "debrief_of",
    "detector",
    "experts",
    "play_actions",
    "scenario",
    "with_change",
    "without",
]

SEED, SALT = 3, b"salt of the tests"
PLACE_MM = 163.0  # the center of percussion of the bat of seed 3
SHOTS = 6  # of a detector
BALLS = (1, 2, 3, 4, 5, 6, 8)  # the rules set ball 7 aside
Asked = tuple[str, dict[str, Any]]
PLAIN: tuple[Asked, ...] = (  # what the rules ask for, seven balls of which one comes in slow
    *((name, {}) for name in preparation()),
    ("set-place", {"place": PLACE_MM}),
    *(
        each
        for shot, ball in enumerate(BALLS, 1)
        for each in (
            ("load-ball", {"ball": ball}),
            *((step, {}) for step in MAKE_READY),
            ("fire", {}),
            ("reject", {"shot": shot, "because": "slow"})
            if shot == 2
            else ("accept", {"shot": shot}),
        )
    ),
)


def detector(fault: str) -> Operator:
    """Return who makes the checks that a fault is found by, and nothing that they do not need."""
    found_by = fault_sheets()[fault].found_by
    assert found_by

    def checked(look: Look) -> Iterator[Action]:
        needed = (
            preparation() if "fire" in found_by.actions else ("tare", "level-stand", "fit-clamp")
        )
        yield from map(action_of, needed)
        for name in found_by.actions:
            if name == "fire":
                yield action_of("set-place", {"place": PLACE_MM})
                for _ in range(1 if "tap-bat" in found_by.actions else SHOTS):
                    yield action_of("load-ball", {"ball": look().next_ball + 1})
                    yield from map(action_of, MAKE_READY)
                    yield action_of("fire")
            elif name not in {*needed, *MAKE_READY}:
                yield action_of(name)

    return checked


def scenario(faults: tuple[str, ...] = (), **changes: Any) -> Scenario:
    given = {
        "name": "test",
        "title": "A test's day",
        "task": "Test it.",
        "bat": "r161",
        "procedure": "astm-f1881",
        "faults": faults,
        "minutes": 7800.0,
        "shots": 8,
    }
    return Scenario(**given | changes)


@cache
def apparatus(*faults: str) -> Apparatus:
    return Apparatus(laboratory_of(scenario(faults), SEED, SALT))


def asked(days: Iterable[Asked]) -> list[Action]:
    return [action_of(name, given) for name, given in days]


def without(*names: str) -> list[Asked]:
    """Return the plain day with some actions left out wherever they stand."""
    return [each for each in PLAIN if each[0] not in names]


def with_change(name: str, **arguments: Any) -> list[Asked]:
    """Return the plain day with an action's arguments changed."""
    return [(each, given | arguments if each == name else given) for each, given in PLAIN]


def play_actions(there: Apparatus, actions: Iterable[Action]) -> Day:
    """Return a new day after a series of actions."""
    return run_operator(there, lambda _: iter(actions))


def day_of(days: Iterable[Asked], *faults: str) -> Day:
    return play_actions(apparatus(*faults), asked(days))


@cache
def _plain() -> Day:
    return day_of(PLAIN)


def after_plain(*more: Asked) -> Day:
    """Return the plain day, and what is done after it."""
    return run_operator(apparatus(), lambda _: iter(asked(more)), _plain())


@cache
def experts(*faults: str) -> Day:
    """Return the expert's day that every debrief with these faults is held against."""
    return run_operator(apparatus(*faults), operator_of("expert"))


def debrief_of(day: Day, *faults: str, scores_only: bool = False) -> Debrief:
    """Return the debrief of a day of a test."""
    there, expert = apparatus(*faults), experts(*faults)
    return debrief(there, day, scenario(faults), expert=expert, scores_only=scores_only)
