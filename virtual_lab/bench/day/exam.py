"""An exam: a class of trainees with the same scenario at the same time, and their progress."""

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
    """Title, scenario and trainees of an exam."""

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
    """Return the title, the scenario and the trainees of an exam, read from a .toml file.

    Raises `InputError` if the file is not valid, or if its scenario is not meant for an exam.
    """
    sheet = read(read_text(path), str(path), ClassSheet).spec
    if load_scenario(sheet.scenario).spec.feedback != "never":
        allowed = 'allowed: a scenario with feedback = "never"'
        raise InputError(str(path), "scenario", sheet.scenario, allowed)
    return sheet


class WatchedDay(Protocol):
    """A day in an exam. A trainer can watch its progress."""

    @property
    def desk(self) -> Desk: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class TraineeProgress:
    """Progress of one trainee in an exam, without the truth."""

    name: str
    state: str
    entries: int
    minutes: str
    shots: int
    joined: str  # time of the last sign-in from another browser; empty if there was none


class Hall:
    """State of an exam. Trainees can work from its beginning to its end, set by the trainer."""

    def __init__(self, title: str, days: Mapping[str, WatchedDay]) -> None:
        self.title, self.days = title, days
        self.state = "not begun"
        self.joined: dict[str, str] = {}  # trainee: time of the last sign-in from another browser

    @property
    def is_open(self) -> bool:
        return self.state == "begun"

    def turn(self, word: str) -> None:
        """Begin the exam with the word "begin", or end it with "end".

        Raises `InputError` for any other word, or for a word that is not allowed in this state.
        """
        allowed = {"not begun": {"begin": "begun"}, "begun": {"end": "over"}}.get(self.state, {})
        if word not in allowed:
            raise InputError("exam", "do", word, f"is {self.state}; allowed: {list(allowed)}")
        self.state = allowed[word]

    def join_again(self, day: object) -> None:
        """Record the time at which the trainee of a day signed in from another browser."""
        name = next(name for name, trainee_day in self.days.items() if trainee_day is day)
        self.joined[name] = f"{datetime.now():%H:%M}"

    def trainees(self) -> Iterator[TraineeProgress]:
        """Yield the progress of each trainee."""
        for name, served in self.days.items():
            day = served.desk.day
            state = "at work" if day.events else "not begun"
            yield TraineeProgress(
                name=name,
                state="handed in" if day.handed_in else "reduced" if day.reduced else state,
                entries=len(day.events),
                minutes=f"{day.seconds / 60:.0f}",
                shots=len(day.fired),
                joined=self.joined.get(name, ""),
            )
