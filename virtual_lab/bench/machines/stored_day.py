"""A day in a folder on disk, with its apparatus.

One file holds the log, which any page may read. Another file holds seed, salt and faults; only this
module opens it, and only the owner of the file may read it.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from virtual_lab import catalog
from virtual_lab.bench.day.actions import Action
from virtual_lab.bench.day.day import Day, DayEvent, decide, evolve, replay_events
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.entries import entry_of_session
from virtual_lab.bench.day.log import LOG, DayLog, SequenceError
from virtual_lab.bench.day.operators import Operator, operator_of
from virtual_lab.bench.day.protocol import remarks
from virtual_lab.bench.day.scenario import Scenario
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.machines.sketching import has_camera
from virtual_lab.catalog import Entry, read
from virtual_lab.errors import InputError
from virtual_lab.files import new_folder, read_bytes, read_json
from virtual_lab.lab import Laboratory, TestSetup
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.streams import SEED_BITS

SECRET = "sealed.json"


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
    sealing = "rehearsal: the truth is opened at the debrief"
    return replace(Laboratory.open(setup), salt=salt, sealing=sealing)


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


class StoredDay:
    """A day in a folder: its log, desk, scenario and apparatus."""

    def __init__(self, folder: Path) -> None:
        """Continue the day in a folder.

        Raises `InputError` if the folder has no day or its files cannot be used.
        """
        self.folder = folder
        self.log = DayLog(folder / LOG)
        sealed = read_json(folder / SECRET)
        scenario = read(str(sealed["scenario"]), "scenario.toml", Scenario).spec
        self.scenario = replace(scenario, faults=tuple(sealed["faults"]))
        laboratory = laboratory_of(
            self.scenario, int(sealed["seed"]), bytes.fromhex(sealed["salt"])
        )
        self.morning = self.log.first
        self.apparatus = Apparatus(replace(laboratory, date=self.morning.morning.date))
        self.desk = Desk(replay_events(self.morning, self.log.events()))

    @classmethod
    def begin(cls, folder: Path, scenario: Entry[Scenario], seed: int | None = None) -> Self:
        """Begin a day in a new folder and return it. Without a `seed` a random one is used.

        The files are written together or not at all, so the folder is usable after a crash. Raises
        `InputError` if the folder exists or the scenario does not fit.
        """
        used_seed = secrets.randbits(SEED_BITS) if seed is None else seed
        salt = secrets.token_bytes(16)
        today = scenario.spec.draw_faults(used_seed)
        laboratory = laboratory_of(today, used_seed, salt)
        sealed = {
            "scenario": scenario.text,
            "seed": str(used_seed),
            "salt": salt.hex(),
            "faults": list(today.faults or ()),
            "truth": _individuals(laboratory),
        }
        content = json.dumps(sealed).encode()
        supplied = _records_of(today, laboratory, used_seed)
        with new_folder(folder) as draft:
            handle = os.open(draft / SECRET, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            log = DayLog.create(
                draft / LOG,
                {
                    "briefing": scenario.spec.briefing()
                    | {"commitment": _digest(content), "camera": has_camera(laboratory)},
                    "session": entry_of_session(laboratory.session),
                    "came_with": len(supplied),
                },
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
        first = int(log.morning["came_with"])
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
        commitment = self.log.morning["briefing"]["commitment"]
        content = read_bytes(self.folder / SECRET)
        if _digest(content) != commitment:
            return "BROKEN: the sealed file was changed after the day began"
        truth, computed = json.loads(content)["truth"], _individuals(self.apparatus.laboratory)
        same = all(np.allclose(truth[key], computed[key], rtol=1e-9, atol=0) for key in truth)
        if not same:
            return "BROKEN: this program computes another bat and other balls from the sealed seed"
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
            The action is impossible now, or a requirement is missing; nothing is written.
        """
        due = len(self.day.events) + 1
        if number is not None and number != due:
            allowed = f"entry {due} is next (sent twice, or from an older page?)"
            raise SequenceError("", "entry", number, allowed)
        event = do_action(self.apparatus, self.day, action)
        self.log.append(event)
        self.desk = self.desk.after(event)
        return event


def do_action(apparatus: Apparatus, day: Day, action: Action) -> DayEvent:
    """Carry out an action and return its event, with the time it takes [s] and any remarks.

    `day` does not change, and no file is written. Raises `InputError` if the action is rejected.
    """
    price = decide(day, action)
    event = replace(apparatus.play(day, action), seconds=price)
    notes = remarks(evolve(day, event)) if day.remarks else ()
    return replace(event, shown=(*event.shown, *notes))


def play_actions(apparatus: Apparatus, actions: Iterable[Action]) -> Day:
    """Return the day after a series of actions. The day is new and has no log.

    Raises `InputError` if an action is rejected.
    """
    return run_operator(apparatus, lambda _: iter(actions))


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


def _records_of(scenario: Scenario, laboratory: Laboratory, seed: int) -> tuple[DayEvent, ...]:
    """Return the events of another laboratory, without its verdict, if the scenario has one."""
    if not scenario.records_of:
        return ()
    events = run_operator(Apparatus(laboratory), operator_of(scenario.records_of, seed)).events
    verdict = {"note-doubt", "reduce", "give-verdict", "hand-in"}
    return tuple(event for event in events if event.action not in verdict)


def _individuals(laboratory: Laboratory) -> dict[str, Any]:
    """Return the true properties of this bat and these balls [SI], as a JSON object."""
    bat, balls = laboratory.specimen.bat.body.material, laboratory.specimen.balls
    return {
        "bat_youngs_modulus": bat.youngs_modulus,
        "bat_density": bat.density,
        "ball_mass": balls.mass.tolist(),
        "ball_restitution": balls.restitution.tolist(),
    }


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
