"""A rehearsal: a day on disk and the apparatus behind it, action by action.

The log, which any page may read, lies in one file; seed, salt and faults in another, which only
this module opens and only its owner may read.
"""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from virtual_lab.bench.actions import Action
from virtual_lab.bench.apparatus import Apparatus
from virtual_lab.bench.day import Day, DayEvent, decide, evolve, replayed
from virtual_lab.bench.desk import Desk
from virtual_lab.bench.entries import constant_of_entry, entry_of_constant
from virtual_lab.bench.log import LOG, DayLog, SequenceError
from virtual_lab.bench.operators import Operator
from virtual_lab.bench.scenario import Scenario
from virtual_lab.catalog import Entry, read
from virtual_lab.errors import InputError
from virtual_lab.files import read_json
from virtual_lab.lab import Laboratory, TestSetup
from virtual_lab.records.session import Session
from virtual_lab.streams import commitment

__all__ = ["LOG", "SECRET", "KeptDay", "done", "laboratory_of", "morning_of", "played", "taken"]

SECRET = "sealed.json"
SEED_BITS = 128


def laboratory_of(scenario: Scenario, seed: int, salt: bytes) -> Laboratory:
    """Return the laboratory of a scenario's day; `InputError` as `Laboratory.open`."""
    setup = TestSetup.of(
        scenario.bat, procedure=scenario.procedure, seed=seed, faults=scenario.faults
    )
    opened = Laboratory.open(setup)
    known = {
        "reality": setup.reality.value,
        "sealing": "rehearsal: the truth is opened at the debrief",
        "seed_commitment": commitment(salt, seed),
        "unverified_numbers": setup.unverified,
    }
    return replace(opened, salt=salt, session=replace(opened.session, simulation=known))


def morning_of(laboratory: Laboratory) -> Day:
    """Return the day before anything is done."""
    return Day(morning=laboratory.session, balls=laboratory.rules.spec.balls)


class KeptDay:
    """A day in a folder."""

    def __init__(self, folder: Path) -> None:
        """Take a day up again, wherever it was left.

        Raises `InputError` where the folder holds none, or its files cannot be used.
        """
        self.log = DayLog(folder / LOG)
        sealed = read_json(folder / SECRET)
        self.scenario = read(str(sealed["scenario"]), "scenario.toml", Scenario).spec
        laboratory = laboratory_of(
            self.scenario, int(sealed["seed"]), bytes.fromhex(sealed["salt"])
        )
        session = _session(self.log.morning["session"])
        self.apparatus = Apparatus(replace(laboratory, session=session))
        self.desk = Desk(replayed(morning_of(self.apparatus.laboratory), self.log.events()))

    @classmethod
    def begin(cls, folder: Path, scenario: Entry[Scenario], seed: int | None = None) -> Self:
        """Begin a day in a folder that holds none; a seed is drawn where none is given."""
        drawn = secrets.randbits(SEED_BITS) if seed is None else seed
        salt = secrets.token_bytes(16)
        laboratory = laboratory_of(scenario.spec, drawn, salt)
        folder.mkdir(parents=True, exist_ok=True)
        sealed = {
            "scenario": scenario.text,
            "seed": str(drawn),
            "salt": salt.hex(),
            "faults": list(scenario.spec.faults),
        }
        try:
            handle = os.open(folder / SECRET, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        except FileExistsError as fault:
            raise InputError(str(folder), "day", None, "one was begun here already") from fault
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(sealed, file)
            file.flush()
            os.fsync(file.fileno())
        morning = {
            "briefing": scenario.spec.briefing(),
            "session": _entry_of_session(laboratory.session),
        }
        DayLog.create(folder / LOG, morning)
        return cls(folder)

    @property
    def day(self) -> Day:
        return self.desk.day

    def taken(self, operator: Operator) -> Day:
        """Let an operator take the day to its end; `InputError` where what it asks cannot be."""
        for action in operator(lambda: self.desk):
            self.do(action)
        return self.day

    def do(self, action: Action, number: int | None = None) -> DayEvent:
        """Do an action: its event is on disk before it is returned.

        Raises
        ------
        SequenceError
            `number`, of the entry this is meant to be, is not the next one.
        InputError
            It cannot be done now, or what it needs is missing; nothing is written.
        """
        due = len(self.day.events) + 1
        if number is not None and number != due:
            allowed = f"entry {due} is next (sent twice, or from an older page?)"
            raise SequenceError("", "entry", number, allowed)
        event = done(self.apparatus, self.day, action)
        self.log.append(event)
        self.desk = self.desk.after(event)
        return event


def done(apparatus: Apparatus, day: Day, action: Action) -> DayEvent:
    """Return the event of an action on a day; `InputError` where it cannot be done."""
    price = decide(day, action)
    return replace(apparatus.play(day, action), seconds=price)


def played(apparatus: Apparatus, actions: Iterable[Action]) -> Day:
    """Return the day of some actions, taken in turn, that no log holds."""
    day = morning_of(apparatus.laboratory)
    for action in actions:
        day = evolve(day, done(apparatus, day, action))
    return day


def taken(apparatus: Apparatus, operator: Operator) -> Day:
    """Return the day as an operator takes it, that no log holds."""
    desks = [Desk(morning_of(apparatus.laboratory))]
    for action in operator(lambda: desks[-1]):
        day = desks[-1].day
        desks[:] = [desks[-1].after(done(apparatus, day, action))]
    return desks[-1].day


def _entry_of_session(session: Session) -> dict[str, Any]:
    return {
        "bat": session.bat,
        "ball": session.ball,
        "bat_sport": session.bat_sport,
        "ball_sport": session.ball_sport,
        "date": session.date,
        "rigs": dict(session.rigs),
        "procedure_text": session.procedure_text,
        "simulation": dict(session.simulation),
        "calibration": {
            name: entry_of_constant(known) for name, known in session.calibration.items()
        },
    }


def _session(entry: Mapping[str, Any]) -> Session:
    calibration = {name: constant_of_entry(known) for name, known in entry["calibration"].items()}
    return Session(**{**entry, "calibration": calibration, "records": {}})
