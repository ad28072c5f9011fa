"""Compliance with the procedure: the steps that were due, and whether they were done in time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from virtual_lab.bench.day.day import Day, Display, ready_steps
from virtual_lab.bench.day.table import PREPARING, action_table


@dataclass(frozen=True, slots=True, kw_only=True)
class StepDue:
    """A step that was due before event `before` (index from 0), and whether it was done in time."""

    step: str
    before: int
    done: bool
    shot: int | None = None  # number of the shot, from 0; None for a step that is due once


def steps_due(day: Day) -> Iterator[StepDue]:
    """Yield each step that was due up to now, whether done or not, in the order of the day.

    The steps that prepare a shot are due once per shot. The removal of sabot scrap is not due
    before the first shot, because there is no scrap yet.
    """
    since: set[str] = set()
    actions: set[str] = set()
    shot = 0
    for at, event in enumerate(day.events):
        for step, before in PREPARING.items():
            if event.action == before and before not in actions:
                yield StepDue(step=step, before=at, done=step in actions)
        actions.add(event.action)
        since.add(event.action)
        if event.action == "fire":
            for step in (*ready_steps(day), "load-ball"):
                if shot or step != "clear-scrap":  # no scrap before the first shot
                    yield StepDue(step=step, before=at, done=step in since, shot=shot)
            since.clear()
            shot += 1


def omitted_steps(day: Day) -> list[StepDue]:
    """Return the steps that were due but not done in time, in order; empty if there are none."""
    return [each for each in steps_due(day) if not each.done]


def excuses_of(day: Day) -> dict[str, str]:
    """Return the trainee's reasons for skipping steps, keyed by the name of the step.

    The last note on a step counts. Struck-out notes are left out. A step without a note is not in
    the result.
    """
    return {
        str(event.arguments["step"]): str(event.arguments["because"])
        for event in day.events
        if event.action == "note-deviation" and event.number not in day.struck
    }


def remarks(day: Day) -> Display:
    """Return one row for each step that the last event required and that was not done in time.

    A row holds the text "skipped: " with the title of the step, the effect of the omission, and an
    empty unit. The tuple is empty if no required step was skipped. Steps required by earlier events
    are not listed.
    """
    last = len(day.events) - 1
    sheets = action_table().actions
    return tuple(
        (f"skipped: {sheets[each.step].title.lower()}", sheets[each.step].skipped, "")
        for each in omitted_steps(day)
        if each.before == last
    )


def checklist(day: Day, *, end: bool) -> Display:
    """Return the checklist before the first shot, or the checklist before the verdict if `end`.

    There is one row per item: its title, the word "done" or "not done", and an empty unit.
    """
    sheets = action_table().actions
    if not end:
        lines = {
            each.title: day.times(name) > 0 for name, each in sheets.items() if each.on_checklist
        }
    else:
        names = [event.action for event in day.events]
        after = names[len(names) - names[::-1].index("fire") :] if "fire" in names else names
        undecided = [shot + 1 for shot in range(len(day.fired)) if shot not in day.decisions]
        lines = {
            f"{sheets['tap-bat'].title} again": "tap-bat" in after,
            "Every hit accepted or rejected": not undecided,
            "A reason noted for every skipped step": {each.step for each in omitted_steps(day)}
            <= excuses_of(day).keys(),
        }
    return tuple((title, "done" if done else "not done", "") for title, done in lines.items())
