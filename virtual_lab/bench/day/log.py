"""The log of a day: a database table that only grows, written before an action is answered.

Row 0 holds the start of the day, and each further row holds one event, counted from 1, with the
digest of the row before it. An existing number is rejected, so a button that is pressed twice makes
one entry.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Ge

from virtual_lab.bench.day.actions import action_of
from virtual_lab.bench.day.day import Day, DayEvent, decide, evolve
from virtual_lab.bench.day.entries import record_of
from virtual_lab.bench.day.scenario import DayBriefing
from virtual_lab.catalog import read
from virtual_lab.catalog.specs import Spec, Whole
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.files import parse_json, read_bytes
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.records.session import (
    ConstantEntry,
    SessionForm,
    digest_of_text,
    read_constant,
    session_of_form,
)

LOG = "day.sqlite"  # file name in the folder of a day
LOG_SCHEMA = 3
ROWS = "SELECT number, entry FROM entries ORDER BY number"
TABLE = """
CREATE TABLE entries (number INTEGER PRIMARY KEY CHECK (number >= 0), entry TEXT NOT NULL) STRICT;
CREATE TRIGGER no_change BEFORE UPDATE ON entries BEGIN SELECT RAISE(ABORT, 'append only'); END;
CREATE TRIGGER no_loss BEFORE DELETE ON entries BEGIN SELECT RAISE(ABORT, 'append only'); END;
"""


class SequenceError(InputError):
    """Error: the number of an entry exists already (sent twice, or from an outdated page)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LogStart(Spec):
    """Form of row 0: the start of the day."""

    schema: Literal[3]  # LOG_SCHEMA
    briefing: DayBriefing
    session: SessionForm
    procedure: str  # text of the rules
    came_with: Annotated[Whole, Ge(0)]  # number of events that another laboratory supplied


class DayLog:
    """The log of a day in one SQLite file. Raises `InputError` if the file is not a log."""

    def __init__(self, path: Path) -> None:
        self.path = path
        read_bytes(path, last=0)  # neither missing nor a pipe
        self.morning = parse_json(self._texts()[0], f"{path}, entry 0")

    @cached_property
    def start(self) -> LogStart:
        """Row 0. Raises `InputError` if it is not the start of a day."""
        return validate(self.morning, f"{self.path}, entry 0", LogStart)

    @classmethod
    def create(cls, path: Path, morning: Mapping[str, Any]) -> DayLog:
        """Create a log file and write the start of the day. Raises `InputError` if it exists."""
        if path.exists():
            raise InputError(str(path), "log", None, "exists already")
        with closing(sqlite3.connect(path, isolation_level=None)) as base:
            base.execute("PRAGMA synchronous=FULL")
            base.executescript(f"BEGIN; {TABLE} COMMIT;")
            _put(base, 0, {"schema": LOG_SCHEMA, **morning})
        return cls(path)

    @property
    def first(self) -> Day:
        """The state of the day before its first event. Raises `InputError` for wrong rules."""
        start, briefing = self.start, self.start.briefing
        return Day(
            morning=session_of_form(start.session, start.procedure, self.path),
            balls=read(start.procedure, f"{self.path} [procedure]", Procedure).spec.balls,
            supplied_events=self.start.came_with,
            listed=briefing.may_go_wrong,
            practice=briefing.practice,
            checklists=briefing.checklists,
            remarks=briefing.feedback == "during",
            exam=briefing.feedback == "never",
            operator=briefing.operator,
        )

    @property
    def last(self) -> Day:
        """The state of the day after its last event.

        Raises `InputError` for an event that was impossible then, or has records that cannot be
        used.
        """
        day = self.first
        for event in self.events():
            try:
                decide(day, action_of(event.action, event.arguments))
                for entry in event.records.values():
                    record_of(entry)
                for key, entry in event.constants.items():
                    read_constant(validate(entry, key, ConstantEntry), key, key)
            except InputError as fault:
                where = f"{self.path}, entry {event.number}"
                raise InputError(where, "event", event.action, str(fault)) from fault
            day = evolve(day, event)
        return day

    def append(self, event: DayEvent) -> None:
        """Write an event to disk.

        Raises `SequenceError` if the event's number is not the next one.
        """
        with self._open() as base:
            base.execute("BEGIN IMMEDIATE")
            ((last, text),) = base.execute(f"{ROWS} DESC LIMIT 1")
            if event.number != last + 1:
                base.execute("ROLLBACK")
                allowed = f"entry {last + 1} is next (sent twice, or from an older page?)"
                raise SequenceError("", "entry", event.number, allowed)
            entry = {each.name: getattr(event, each.name) for each in fields(event)}
            del entry["number"]
            _put(base, event.number, entry | {"after": digest_of_text(text.encode())})
            base.execute("COMMIT")

    def events(self) -> list[DayEvent]:
        """Return all events, in order of their numbers.

        Raises `InputError` for an event without the right form, and if the entry before an event
        is not the one after which it was written.
        """
        texts, events = self._texts(), list[DayEvent]()
        for number, (before, text) in enumerate(pairwise(texts), 1):
            where = f"{self.path}, entry {number}"
            entry = parse_json(text, where)
            if entry.pop("after", None) != digest_of_text(before.encode()):
                raise InputError(where, "after", None, "the entry before it was changed later")
            events.append(validate({**entry, "number": number}, where, DayEvent))
        return events

    def _texts(self) -> list[str]:
        """Return the texts of all rows, in order of their numbers; at least one."""
        try:
            with self._open() as base:
                return [str(text) for _, text in base.execute(ROWS)] or [""]
        except sqlite3.DatabaseError as fault:
            allowed = f"is not the log of a day ({fault})"
            raise InputError(str(self.path), "log", None, allowed) from fault

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        with closing(sqlite3.connect(self.path, isolation_level=None)) as base:
            base.execute("PRAGMA synchronous=FULL")
            base.execute("PRAGMA recursive_triggers=ON")  # otherwise OR REPLACE bypasses triggers
            yield base


def _put(base: sqlite3.Connection, number: int, document: Mapping[str, Any]) -> None:
    entry = json.dumps(document, allow_nan=False)
    base.execute("INSERT INTO entries (number, entry) VALUES (?, ?)", (number, entry))
