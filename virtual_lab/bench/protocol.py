"""The procedure kept or not: which of its steps were done before what they are for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from virtual_lab.bench.day import MAKE_READY, Day

__all__ = ["STEPS", "StepDue", "left_out", "steps_due"]

PREPARING = {"tare": "weigh-bat", "level-stand": "measure-balance", "fit-clamp": "swing"}
STEPS = (*PREPARING, *MAKE_READY, "load-ball")


@dataclass(frozen=True, slots=True, kw_only=True)
class StepDue:
    """A step, the place in a day's events of what it had to come before, and whether it did."""

    step: str
    before: int
    done: bool
    shot: int | None = None  # from 0


def steps_due(day: Day) -> Iterator[StepDue]:
    """Yield every step that was due on a day so far, in the order they were due."""
    since: set[str] = set()
    seen: set[str] = set()
    shot = 0
    for at, event in enumerate(day.events):
        for step, before in PREPARING.items():
            if event.action == before and before not in seen:
                yield StepDue(step=step, before=at, done=step in seen)
        seen.add(event.action)
        since.add(event.action)
        if event.action == "fire":
            for step in (*MAKE_READY, "load-ball"):
                if shot or step != "clear-scrap":  # before the first shot there is none
                    yield StepDue(step=step, before=at, done=step in since, shot=shot)
            since.clear()
            shot += 1


def left_out(day: Day) -> list[StepDue]:
    """Return the steps that were not done in time."""
    return [each for each in steps_due(day) if not each.done]
