"""The log of a day: a database table that only grows, written before an action is answered.

Row 0 holds the start of the day, and each further row holds one event, counted from 1. An existing
number is rejected, so a button that is pressed twice makes one entry.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from dataclasses import fields
from pathlib import Path
from typing import Any

from virtual_lab.bench.day.day import Day, DayEvent
from virtual_lab.bench.day.entries import session_of_entry
from virtual_lab.catalog import read
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Procedure

LOG = "day.sqlite"  # file name in the folder of a day
SCHEMA = 2
TABLE = """
CREATE TABLE entries (number INTEGER PRIMARY KEY CHECK (number >= 0), entry TEXT NOT NULL) STRICT;
CREATE TRIGGER no_change BEFORE UPDATE ON entries BEGIN SELECT RAISE(ABORT, 'append only'); END;
CREATE TRIGGER no_loss BEFORE DELETE ON entries BEGIN SELECT RAISE(ABORT, 'append only'); END;
"""


class SequenceError(InputError):
    """Error: the number of an entry exists already (sent twice, or from an outdated page)."""


class DayLog:
    """The log of a day in one SQLite file. Raises `InputError` if the file is not a log."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise InputError(str(path), "log", None, "no such file")
        try:
            with closing(self._open()) as base:
                rows = base.execute("SELECT entry FROM entries WHERE number = 0").fetchall()
            self.morning: dict[str, Any] = json.loads(rows[0][0])
            schema = self.morning["schema"]
        except (sqlite3.DatabaseError, IndexError, KeyError, ValueError) as fault:
            raise InputError(
                str(path), "log", None, f"is not the log of a day ({fault})"
            ) from fault
        if schema != SCHEMA:
            raise InputError(str(path), "schema", schema, f"allowed: {SCHEMA}")

    @classmethod
    def create(cls, path: Path, morning: Mapping[str, Any]) -> DayLog:
        """Create a log file and write the start of the day. Raises `InputError` if it exists."""
        if path.exists():
            raise InputError(str(path), "log", None, "exists already")
        with closing(sqlite3.connect(path, isolation_level=None)) as base:
            base.execute("PRAGMA synchronous=FULL")
            base.executescript(f"BEGIN; {TABLE} COMMIT;")
            _put(base, 0, {"schema": SCHEMA, **morning})
        return cls(path)

    @property
    def first(self) -> Day:
        """The state of the day before its first event."""
        session, briefing = session_of_entry(self.morning["session"]), self.morning["briefing"]
        return Day(
            morning=session,
            balls=read(session.procedure_text, "procedure.toml", Procedure).spec.balls,
            supplied_events=int(self.morning["came_with"]),
            listed=briefing.get("may_go_wrong", {}),
            practice=briefing.get("practice", 0),
            checklists=briefing.get("checklists", False),
            remarks=briefing["feedback"] == "during",
            exam=briefing["feedback"] == "never",
        )

    def append(self, event: DayEvent) -> None:
        """Write an event to disk.

        Raises `SequenceError` if the event's number is not the next one.
        """
        with closing(self._open()) as base:
            base.execute("BEGIN IMMEDIATE")
            (last,) = base.execute("SELECT max(number) FROM entries").fetchone()
            if event.number != last + 1:
                base.execute("ROLLBACK")
                allowed = f"entry {last + 1} is next (sent twice, or from an older page?)"
                raise SequenceError("", "entry", event.number, allowed)
            entry = {each.name: getattr(event, each.name) for each in fields(event)}
            del entry["number"]
            _put(base, event.number, entry)
            base.execute("COMMIT")

    def events(self) -> list[DayEvent]:
        """Return all events, in order of their numbers."""
        with closing(self._open()) as base:
            rows = base.execute(
                "SELECT number, entry FROM entries WHERE number > 0 ORDER BY number"
            ).fetchall()
        return [_event(number, json.loads(entry)) for number, entry in rows]

    def _open(self) -> sqlite3.Connection:
        base = sqlite3.connect(self.path, isolation_level=None)
        base.execute("PRAGMA synchronous=FULL")
        base.execute("PRAGMA recursive_triggers=ON")  # otherwise OR REPLACE bypasses the triggers
        return base


def _put(base: sqlite3.Connection, number: int, document: Mapping[str, Any]) -> None:
    entry = json.dumps(document, allow_nan=False)
    base.execute("INSERT INTO entries (number, entry) VALUES (?, ?)", (number, entry))


def _event(number: int, entry: Mapping[str, Any]) -> DayEvent:
    display = tuple((quantity, value, unit) for quantity, value, unit in entry["shown"])
    return DayEvent(**{**entry, "number": number, "shown": display})
