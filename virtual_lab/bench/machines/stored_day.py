"""A day in a folder on disk, with its apparatus.

One file holds the log, which any page may read. Another file holds seed and salt; only this
module opens it, and only the owner of the file may read it.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Self

from annotated_types import Ge, Le

from virtual_lab import catalog
from virtual_lab.bench.day.actions import Action
from virtual_lab.bench.day.day import Day, DayEvent, decide, evolve
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.log import LOG, LOG_SCHEMA, DayLog, SequenceError
from virtual_lab.bench.day.operators import Operator, operator_of
from virtual_lab.bench.day.protocol import remarks
from virtual_lab.bench.day.scenario import Scenario
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.sketching import has_camera
from virtual_lab.catalog import Entry, read
from virtual_lab.catalog.specs import Spec, Whole
from virtual_lab.catalog.validation import validate
from virtual_lab.certificate.comparing import differences
from virtual_lab.errors import InputError
from virtual_lab.files import new_folder, read_bytes, read_json
from virtual_lab.lab import Laboratory, TestSetup
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.records.origin import REHEARSAL
from virtual_lab.records.session import SESSION, pack
from virtual_lab.streams import LARGEST_SEED, SEED_BITS

SECRET = "sealed.json"
PADDED = 4096  # size of the sealed file without its scenario and its sheets [B]


def laboratory_of(scenario: Scenario, seed: int, salt: bytes) -> Laboratory:
    """Return the simulated laboratory of a day, with the faults of `scenario`.

    `seed` determines the true values of the laboratory. `salt` is hashed together with the seed, to
    prove later that the seed was not changed. If the faults of the scenario are None, the
    laboratory has no faults. Raises `InputError` if the scenario names an unknown sheet, or sheets
    that do not fit together.
    """
    setup = TestSetup.of(
        scenario.bat,
        procedure=_rules(scenario),
        rig=scenario.rig or None,
        seed=seed,
        faults=scenario.faults or (),
    )
    return replace(Laboratory.open(setup), salt=salt, sealing=REHEARSAL)


def _rules(scenario: Scenario) -> Entry[Procedure]:
    """Return the procedure of a day, with the limit of the scenario if it has one."""
    rules = catalog.load("procedures", scenario.procedure, Procedure)
    if scenario.limit is None:
        return rules
    value = f'value = {scenario.limit!r}, unit = "1", source = "assumed", verified = false'
    line = re.compile(r"^limit\s*=\s*\{[^}]*\}", re.MULTILINE)
    text, count = line.subn(f"limit = {{ {value} }}", rules.text)
    if count != 1:
        raise InputError(
            scenario.name,
            "limit",
            scenario.limit,
            "the procedure has no limit that it could replace",
        )
    return catalog.read(text, f"procedures/{rules.spec.name}", Procedure)


@dataclass(frozen=True, slots=True, kw_only=True)
class SealedDay(Spec):
    """Form of the sealed file: scenario, seed and salt of a day, from which all truth follows."""

    scenario: str  # text of its file; its faults are drawn from the seed if it names none
    seed: Annotated[Whole, Ge(0), Le(LARGEST_SEED)]
    salt: str  # hexadecimal
    # texts of the sheets of its laboratory that are not those of the catalog, keyed by KIND/NAME
    sheets: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        bytes.fromhex(self.salt)

    def content(self) -> bytes:
        """Return the content of the file, padded so that its size tells nothing of the secrets."""
        content = json.dumps(asdict(self)).encode()
        secrets_size = len(content) - len(json.dumps(self.scenario)) - len(json.dumps(self.sheets))
        return content + b" " * (PADDED - secrets_size)


class StoredDay:
    """A day in a folder: its log, desk, scenario and apparatus."""

    def __init__(self, folder: Path) -> None:
        """Continue the day in a folder.

        Raises `InputError` if the folder has no day or its files cannot be used.
        """
        self.folder = folder
        self.log = DayLog(folder / LOG)
        path = folder / SECRET
        self.sealed = validate(read_json(path), str(path), SealedDay)
        scenario = read(self.sealed.scenario, f"{path} [scenario]", Scenario).spec
        self.scenario = scenario.draw_faults(self.sealed.seed)
        salt = bytes.fromhex(self.sealed.salt)
        with catalog.sheets_in_place(catalog.texts_of(self.sealed.sheets)):
            laboratory = laboratory_of(self.scenario, self.sealed.seed, salt)
        self.morning = self.log.first
        self.apparatus = Apparatus(replace(laboratory, date=self.morning.morning.date))
        self.desk = Desk(self.log.last)

    @classmethod
    def begin(
        cls,
        folder: Path,
        scenario: Entry[Scenario],
        seed: int | None = None,
        operator: str = "trainee",
    ) -> Self:
        """Begin a day in a new folder and return it. Without a `seed` a random one is used.

        `operator` is the person who decides about the hits. The files are written together or not
        at all, so the folder is usable after a crash. Raises `InputError` if the folder exists or
        the scenario does not fit.
        """
        used_seed = secrets.randbits(SEED_BITS) if seed is None else seed
        salt = secrets.token_bytes(16)
        today = scenario.spec.draw_faults(used_seed)
        laboratory = laboratory_of(today, used_seed, salt)
        sheets = {"/".join(key): text for key, text in laboratory.sheets.items()}
        sealed = SealedDay(scenario=scenario.text, seed=used_seed, salt=salt.hex(), sheets=sheets)
        content = sealed.content()
        supplied = _records_of(today, laboratory, used_seed)
        with new_folder(folder) as draft:
            handle = os.open(draft / SECRET, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            log = DayLog.create(
                draft / LOG, _start(today, laboratory, content, len(supplied), operator)
            )
            for event in supplied:
                log.append(event)
        return cls(folder)

    @classmethod
    def branch(cls, source: Path, entry: int, folder: Path) -> Self:
        """Begin a practice day in a new folder and return it.

        The day is a copy of a handed-in day up to and including `entry`, counted from 1, and
        continues with the same random numbers. It is marked as practice, because its truth has been
        revealed. Raises `InputError` if the source is not handed in, has no such entry before the
        day is handed in, or came with more records than `entry`.
        """
        log = DayLog(source / LOG)
        events = log.events()
        if not any(event.action == "hand-in" for event in events):
            raise InputError(str(source), "day", None, "has not been handed in yet")
        first = log.start.came_with
        last = next(event.number for event in events if event.action == "hand-in") - 1
        if not first <= entry <= last:
            raise InputError(str(source), "entry", entry, f"allowed: {first} to {last}")
        briefing = log.morning["briefing"] | {"practice": entry or 1, "feedback": "after"}
        with new_folder(folder) as draft:
            shutil.copyfile(source / SECRET, draft / SECRET)
            (draft / SECRET).chmod(0o600)
            again = DayLog.create(draft / LOG, log.morning | {"briefing": briefing})
            for event in events[:entry]:
                again.append(event)
        return cls(folder)

    @property
    def seal(self) -> str:
        """A sentence on the seal that begins with "intact" or "BROKEN"."""
        content, stated = read_bytes(self.folder / SECRET), self.log.start
        commitment = hashlib.sha256(content).hexdigest()
        if commitment != stated.briefing.commitment:
            return "BROKEN: the sealed file was changed after the day began"
        laboratory = self.apparatus.laboratory
        supplied = _records_of(self.scenario, laboratory, self.sealed.seed)
        parts = (self.scenario, laboratory, content, len(supplied), stated.briefing.operator)
        start = {"schema": LOG_SCHEMA, **_start(*parts)}
        if stated.briefing.practice:
            start["briefing"] |= {"practice": stated.briefing.practice, "feedback": "after"}
        if rows := list(differences(self.log.morning, start, LOG)):
            return f"BROKEN: the start of the log was changed ({rows[0].key})"
        return f"intact: the SHA-256 of the sealed file is {commitment}, as at the start of the day"

    @property
    def day(self) -> Day:
        return self.desk.day

    def run_operator(self, operator: Operator) -> Day:
        """Let an operator carry out the rest of the day. Return the day.

        Raises `InputError` for an impossible action; the entries before it stay in the log.
        """
        for action in operator(lambda: self.desk):
            self.do(action)
        return self.day

    def do(self, action: Action, number: int | None = None) -> DayEvent:
        """Carry out an action, write its event to disk, and return it.

        Raises
        ------
        SequenceError
            `number` is not the number of the next entry.
        InputError
            The action is impossible now, or a requirement is missing; nothing is written. A
            reduction without a result is impossible, because no hit can be decided after it.
        """
        due = len(self.day.events) + 1
        if number is not None and number != due:
            allowed = f"entry {due} is next (sent twice, or from an older page?)"
            raise SequenceError("", "entry", number, allowed)
        event = do_action(self.apparatus, self.day, action)
        if action.name == "reduce":  # not required in `do_action`: earlier logs may lack a result
            _require_result(self.desk)
        self.log.append(event)
        self.desk = self.desk.after(event)
        return event


def _require_result(desk: Desk) -> None:
    """Raise `InputError` if a reduction now would have no result; name the undecided hits."""
    if desk.result is not None:
        return
    day, reasons = desk.day, "; ".join(desk.certification.reasons)
    undecided = [str(shot + 1) for shot in range(len(day.fired)) if shot not in day.decisions]
    remedy = "correct the readings, fire again, or give the verdict INVALID without a result"
    if undecided:
        remedy = f"each must be accepted or rejected first; undecided: {', '.join(undecided)}"
    raise InputError("reduce", "hits", None, f"give no result ({reasons}): {remedy}")


def do_action(apparatus: Apparatus, day: Day, action: Action) -> DayEvent:
    """Carry out an action and return its event, with the time it takes [s] and any remarks.

    `day` does not change, and no file is written. Raises `InputError` if the action is rejected.
    """
    price = decide(day, action)
    event = replace(apparatus.play(day, action), seconds=price)
    notes = remarks(evolve(day, event)) if day.remarks else ()
    return replace(event, shown=(*event.shown, *notes))


def run_operator(
    apparatus: Apparatus,
    operator: Operator,
    morning: Day | None = None,
    listed: Mapping[str, float] = MappingProxyType({}),
) -> Day:
    """Carry out all actions of a simulated operator, and return the resulting day.

    No log is written.

    Parameters
    ----------
    apparatus
        The machines of the laboratory.
    operator
        The simulated operator.
    morning
        The day to continue. If None, a new day begins.
    listed
        Probability of each fault that a new day may have, keyed by fault name. It is ignored if
        `morning` is given.

    Raises
    ------
    InputError
        An action is rejected.
    """
    laboratory = apparatus.laboratory
    untouched = Day(morning=laboratory.session, balls=laboratory.rules.spec.balls, listed=listed)
    desks = [Desk(morning or untouched)]
    for action in operator(lambda: desks[-1]):
        day = desks[-1].day
        desks[:] = [desks[-1].after(do_action(apparatus, day, action))]
    return desks[-1].day


def _start(
    scenario: Scenario, laboratory: Laboratory, content: bytes, supplied: int, operator: str
) -> dict[str, Any]:
    """Return the start of the log of a day; `content` is that of the sealed file."""
    return {
        "briefing": {
            **scenario.briefing(),
            "commitment": hashlib.sha256(content).hexdigest(),
            "camera": has_camera(laboratory),
            "operator": operator,
        },
        "session": json.loads(pack(laboratory.session).texts[SESSION]),
        "procedure": laboratory.session.procedure_text,
        "came_with": supplied,
    }


def _records_of(scenario: Scenario, laboratory: Laboratory, seed: int) -> tuple[DayEvent, ...]:
    """Return the events of another laboratory, without its verdict, if the scenario has one."""
    if not scenario.records_of:
        return ()
    events = run_operator(Apparatus(laboratory), operator_of(scenario.records_of, seed)).events
    verdict = {"note-doubt", "reduce", "give-verdict", "hand-in"}
    return tuple(event for event in events if event.action not in verdict)
