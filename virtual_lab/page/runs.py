"""Runs of commands, each in a process of its own and with a folder that holds its state."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from virtual_lab import api
from virtual_lab.api.describing import REQUIRED
from virtual_lab.commands.call import bind
from virtual_lab.commands.command import Command
from virtual_lab.commands.output import LONGEST_NAME
from virtual_lab.commands.running import check_target
from virtual_lab.errors import InputError
from virtual_lab.files import first_free, new_folder, parse_toml, read_text
from virtual_lab.page.fields import RUNS, choices_in, is_new
from virtual_lab.page.wording import texts, title_of
from virtual_lab.page.working import (
    BLANK,
    CALL,
    OUTCOME,
    PROGRESS_LINE,
    SAID,
    answer_of,
    carry_out_run,
    serves_bench,
    write_json,
)
from virtual_lab.parameters import SETTINGS
from virtual_lab.processes import Worker, WorkerLostError
from virtual_lab.sheets import FORM_TITLES

Values = Mapping[str, Any]  # values of a call by name of the field
CHOSEN = ("out", "csv")  # fields of which a user does not think
LARGEST = 10**6  # above all numbers of runs
MOST = 2  # runs at the same time


@dataclass(frozen=True)
class StartedRun:
    """A run, as its folder describes it."""

    path: Path
    live: bool

    @property
    def number(self) -> int:
        """The number of the run, from 1."""
        return int(self.path.name)

    @cached_property
    def call(self) -> dict[str, Any]:
        """Name of the command, values as texts, time of the start, number of the corrected run."""
        return _read(self.path / CALL)

    @property
    def values(self) -> dict[str, Any]:
        """The given values, without what the page chose."""
        return {key: each for key, each in self.call["values"].items() if key not in CHOSEN}

    def is_of(self, other: StartedRun) -> bool:
        """Return whether the run used what an earlier one wrote, or corrects its track."""
        used = {text for each in self.values.values() for text in texts(each)}
        uses = used & {*other.outcome["written"]} and other.call["began"] < self.call["began"]
        return bool(uses) or self.call.get("of") == other.path.name

    @property
    def values_text(self) -> str:
        """The given values in one line, without what the page chose."""
        values = self.values
        # the name of a corrected track begins with that of its clip
        start = f"{Path(str(values.get('clip'))).name}-"
        return ", ".join(
            title_of(key).lower() if each is True else Path(text).name.removeprefix(start)
            for key, each in values.items()
            for text in texts(each)
        )[:80]

    @cached_property
    def outcome(self) -> dict[str, Any]:
        """The outcome; blank while the run is in progress, and after it was ended.

        A bench has one as soon as the debrief of its day is saved.
        """
        debrief = _read(Path(self.day) / "debrief.json") if self.day else {}
        said = "{title}: verdict {verdict}, correct {right_verdict}"
        rehearsed = {"answer": said.format_map(debrief), "written": [self.day]} if debrief else {}
        return BLANK | _read(self.path / OUTCOME) | rehearsed

    @property
    def day(self) -> str:
        """The folder of the day at the bench that the run serves; empty for another command."""
        return str(self.call["values"].get("day", "")) if serves_bench(self.call) else ""

    @property
    def addresses(self) -> list[tuple[str, str]]:
        """The users of the bench that the run serves, each with the address to open."""
        return re.findall(r"(?m)^([^,:]+).*: open (http\S+)", self._text(SAID))

    def _text(self, name: str) -> str:
        """Return the text of a file of the run, empty without the file."""
        with suppress(OSError):
            return (self.path / name).read_text("utf-8")
        return ""

    @property
    def stage(self) -> str:
        """The number of links that the page of a run in progress has."""
        return str(len(self.addresses) + len(self.outcome["written"])) if self.day else ""

    @property
    def progress(self) -> str:
        """The current task, or an empty string."""
        return self._text(PROGRESS_LINE)

    @property
    def files(self) -> dict[str, Path]:
        """The written files by the name that the page shows."""
        return {
            str(each.relative_to(path.parent)): each
            for path in map(Path, self.outcome["written"])
            for each in (path, *sorted(path.rglob("*")))
            if each.is_file()
        }


class Runs:
    """The runs in a folder. They survive the server, but those in progress end with it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.lock = folder, Lock()
        self.workers: dict[int, Worker] = {}  # processes of the runs in progress, by number

    def start(self, command: Command, values: Values, of: StartedRun | None) -> StartedRun:
        """Start a run. Raises `InputError` for values that are not allowed, or if two are running.

        The values are those of a form; folders and files of the result are added. `of` is the run
        whose result the form corrects.
        """
        new = _new_fields(command, values)
        command.require(bind(command, {**values, **dict.fromkeys(new, "x")}).values)
        with self.lock:
            if len(self.workers) >= MOST:
                allowed = f"{MOST} runs are in progress; wait for one of them, or cancel it"
                raise InputError("", "", None, allowed)
            number = self._next()
            values = {**values, **self._places(command, values, new, number)}
            check_target(bind(command, values))
            call = {"command": command.name, "values": values, "began": time.time()}
            path = self._store(number, {CALL: {**call, "of": of and of.path.name}})
            self.workers[number] = Worker(f"run {number}")
        run = StartedRun(path, True)
        Thread(target=self._carry_out, args=(run,), daemon=True).start()
        return run

    def adopt(self) -> None:
        """Make a run of each result that the command line has written below the folder.

        Nothing is done while a run is in progress, whose result may be there before its outcome.
        """
        with self.lock:
            known = {text for run in self.all() for text in run.outcome["written"]}
            results = [] if self.workers else [*dict(choices_in(self.folder, ("result",), ()))]
            for text in [each for each in reversed(results) if each not in known]:
                with suppress(InputError, OSError, KeyError, TypeError):  # a damaged folder
                    self._adopt(Path(text))

    def _adopt(self, result: Path) -> None:
        certificate, settings = result / "certificate.json", result / SETTINGS
        outcome = {**answer_of(api.show(certificate)), "written": [str(result)]}
        values = parse_toml(read_text(settings), str(settings)) if settings.exists() else {}
        name = "certify" if (result / "truth").is_dir() else "reduce"
        call = {"command": name, "values": values, "began": certificate.stat().st_mtime}
        self._store(self._next(), {OUTCOME: outcome, CALL: call})

    def _store(self, number: int, documents: Mapping[str, Any]) -> Path:
        """Write the documents of a run into its new folder, all of them or none."""
        path = self._folder(number)
        path.parent.mkdir(parents=True, exist_ok=True)
        with new_folder(path) as draft:
            for name, document in documents.items():
                write_json(draft / name, document)
        return path

    def _next(self) -> int:
        return max([0, *(int(each.name) for each in self._folders())]) + 1

    def _carry_out(self, run: StartedRun) -> None:
        with suppress(WorkerLostError, OSError):  # a killed worker, a full disk
            self.workers[run.number].call(carry_out_run, run.path)
        self.workers.pop(run.number).end()

    def _places(self, command: Command, values: Values, new: list[str], number: int) -> Values:
        """Return new folders and files below the folder of the page, by name of the field."""
        stated = {key: each for key, each in values.items() if key not in new}
        usual = check_target(bind(command, stated)) if command.output.folder else None
        first = [texts(each) for key, each in stated.items() if command.takes_position(key)]
        words = [*command.name.split(), *(Path(each[0]).stem for each in first[:1])]
        name = usual.name if usual else "-".join(words)[:LONGEST_NAME]
        live = str([_read(self._folder(each) / CALL) for each in self.workers])
        places: dict[str, Any] = {}
        for key in new:
            full = name if key in ("out", "csv", "folder") else f"{name}-{key}"
            is_file = command.output.file or values.get("procedure") in FORM_TITLES
            ending = ".csv" if key == "csv" else ".toml" if is_file else ""
            path = first_free(self.folder / f"{full}{ending}")
            taken = str(path) in live  # a run in progress will write there
            places[key] = str(self.folder / f"{full}-run-{number}{ending}" if taken else path)
        if serves_bench({"command": command.name, "values": values}):
            return {"day": values.get("day") or places["out"]}
        return places

    def _folder(self, number: int) -> Path:
        return self.folder / RUNS / f"{number:04}"

    def _folders(self) -> list[Path]:
        return sorted((self.folder / RUNS).glob("[0-9]*"), reverse=True)

    def cancel(self, number: int) -> None:
        """End a run in progress; nothing of its result is left."""
        if worker := self.workers.get(number):
            worker.dismiss()

    def end(self) -> None:
        """End all runs."""
        for number in list(self.workers):
            self.cancel(number)

    def get(self, number: int) -> StartedRun | None:
        """Return a run, or None if there is none with this number."""
        path = self._folder(min(number, LARGEST))
        return StartedRun(path, number in self.workers) if (path / CALL).is_file() else None

    def all(self) -> list[StartedRun]:
        """Return all runs, the last first."""
        return [run for each in self._folders() if (run := self.get(int(each.name)))]


def _new_fields(command: Command, values: Values) -> list[str]:
    """Return the fields for which the page names a new folder or file."""
    fields = command.fields
    result = [key for key in ("out", "csv") if key in fields][:1]
    needed = (key for key, each in fields.items() if is_new(each) and each.default is REQUIRED)
    return [*result, *needed, *(key for key in values if is_new(fields[key]))]


def _read(path: Path) -> dict[str, Any]:
    with suppress(OSError, ValueError):
        return dict(json.loads(path.read_text("utf-8")))
    return {}
