"""An exam: a class that takes one scenario at one time, and what its trainer sees meanwhile."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Protocol

from annotated_types import Len

from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.catalog import read
from virtual_lab.catalog.specs import Name, Spec, Title
from virtual_lab.errors import InputError
from virtual_lab.files import read_text


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassSheet(Spec):
    """Who takes an exam, and which."""

    title: Title
    scenario: str
    trainees: Annotated[tuple[Name, ...], Len(1, 50)]

    def __post_init__(self) -> None:
        for name in self.trainees:
            if not re.fullmatch(r"\w[\w .-]{0,59}", name):  # it names a folder
                raise ValueError(f"{name!r} names no folder; allowed: letters, digits, space . -")
        if len(set(self.trainees)) < len(self.trainees):
            raise ValueError("a trainee is named twice")


def load_class(path: Path) -> ClassSheet:
    """Return the class of a .toml file; `InputError` where it or its scenario is no exam."""
    found = read(read_text(path), str(path), ClassSheet).spec
    if load_scenario(found.scenario).spec.feedback != "never":
        allowed = 'allowed: a scenario with feedback = "never"'
        raise InputError(str(path), "scenario", found.scenario, allowed)
    return found


class WatchedDay(Protocol):
    """A day that is being taken."""

    @property
    def desk(self) -> Desk: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class TraineeShown:
    """How far a trainee is; nothing of the truth."""

    name: str
    state: str
    entries: int
    minutes: str
    shots: int
    joined: str  # again, when; empty: never lost


class Hall:
    """An exam that is going on: closed until the trainer begins it, and once it is over."""

    def __init__(self, title: str, days: Mapping[str, WatchedDay]) -> None:
        self.title, self.days = title, days
        self.state = "not begun"
        self.joined: dict[str, str] = {}  # again: trainee, and when

    @property
    def is_open(self) -> bool:
        return self.state == "begun"

    def turn(self, word: str) -> None:
        """Begin the exam, or end it for good; `InputError` of anything else."""
        allowed = {"not begun": {"begin": "begun"}, "begun": {"end": "over"}}.get(self.state, {})
        if word not in allowed:
            raise InputError("exam", "do", word, f"is {self.state}; allowed: {list(allowed)}")
        self.state = allowed[word]

    def join_again(self, day: object) -> None:
        """Note that the trainee of a day came back with the code, from another browser."""
        name = next(name for name, each in self.days.items() if each is day)
        self.joined[name] = f"{datetime.now():%H:%M}"

    def trainees(self) -> Iterator[TraineeShown]:
        """Yield how far each is."""
        for name, day in self.days.items():
            now = day.desk.day
            state = "at work" if now.events else "not begun"
            yield TraineeShown(
                name=name,
                state="handed in" if now.handed_in else "reduced" if now.reduced else state,
                entries=len(now.events),
                minutes=f"{now.seconds / 60:.0f}",
                shots=len(now.fired),
                joined=self.joined.get(name, ""),
            )
