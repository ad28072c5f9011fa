"""Runs of commands, each in a process of its own and with a folder that holds its state."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from virtual_lab.api.describing import REQUIRED
from virtual_lab.commands.call import bind
from virtual_lab.commands.command import Command
from virtual_lab.commands.running import prepare
from virtual_lab.errors import InputError
from virtual_lab.files import first_free, whole_file
from virtual_lab.page.fields import EXCEPTIONS, NEW
from virtual_lab.page.wording import WORDS
from virtual_lab.page.working import BLANK, CALL, OUTCOME, PROGRESS_LINE, carry_out_run
from virtual_lab.processes import Worker, WorkerLostError

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
        """Name of the command, given values as texts, and time of the start."""
        return _read(self.path / CALL)

    @property
    def began(self) -> float:
        """Time of the start [s since 1970]."""
        return float(self.call["began"])

    @cached_property
    def outcome(self) -> dict[str, Any]:
        """The outcome; blank while the run is in progress, and after it was ended."""
        return BLANK | _read(self.path / OUTCOME)

    @property
    def progress(self) -> str:
        """The current task, or an empty string."""
        with suppress(OSError):
            return (self.path / PROGRESS_LINE).read_text("utf-8")
        return ""

    @property
    def files(self) -> dict[str, Path]:
        """The written files by the name that the page shows."""
        found = {}
        for text in self.outcome["written"]:
            path = Path(text)
            inside = sorted(path.rglob("*")) if path.is_dir() else [path]
            for each in inside:
                if each.is_file():
                    found[str(each.relative_to(path.parent) if each != path else each.name)] = each
        return found


class Runs:
    """The runs in a folder. They survive the server, but those in progress end with it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.lock = folder, Lock()
        self.workers: dict[int, Worker] = {}  # of the runs in progress

    def start(self, command: Command, values: Mapping[str, Any]) -> StartedRun:
        """Start a run. Raises `InputError` for values that are not allowed, or if two are running.

        The values are those of a form; folder and files of the result are added.
        """
        stated = {key: each for key, each in values.items() if (command.name, key) not in NEW}
        bind(command, {**dict.fromkeys(_new_arguments(command), "x"), **stated})
        with self.lock:
            if len(self.workers) >= MOST:
                allowed = f"{MOST} runs are in progress; wait for one of them, or cancel it"
                raise InputError("", "", None, allowed)
            values = self._with_places(command, values)
            if command.name == "rehearse" and not {"operator", "script", "replay"} & {*values}:
                del values["out"]
                values |= {"open": True, "day": values.get("day") or str(self.folder / "day")}
            prepare(bind(command, values))
            home = self.folder / "runs"
            numbers = [int(each.name) for each in home.glob("[0-9]*")] if home.is_dir() else []
            path = home / f"{max(numbers, default=0) + 1:04}"
            path.mkdir(parents=True)
            content = {"command": command.name, "values": values, "began": time.time()}
            with whole_file(path / CALL) as file:
                file.write(json.dumps(content, default=str).encode())
            run = StartedRun(path, True)
            self.workers[run.number] = Worker(f"run {run.number}")
        Thread(target=self._carry_out, args=(run,), daemon=True).start()
        return run

    def _carry_out(self, run: StartedRun) -> None:
        with suppress(WorkerLostError):
            self.workers[run.number].call(carry_out_run, run.path)
        self.workers.pop(run.number).end()

    def _with_places(self, command: Command, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values with new folders and files below the folder of the page."""
        taken = {
            place
            for number in self.workers
            for key, place in _read(self.folder / "runs" / f"{number:04}" / CALL)["values"].items()
            if key in ("out", "folder", "csv")
        }
        fields, places = command.fields, dict(values)
        stated = {key: each for key, each in values.items() if (command.name, key) not in NEW}
        usual = prepare(bind(command, stated)) if command.output.folder else None
        stem = next(
            (values[key] for key in fields if key in values and command.takes_position(key)), ""
        )
        stem = Path(stem if isinstance(stem, str) else stem[0]).stem
        words = [command.name.replace(" ", "-"), *([stem] if stem else [])]
        name = usual.name if usual else "-".join(words)[:60]
        target = first_free(self.folder / name)
        while str(target) in taken:
            target = target.with_name(f"{target.name}-again")
        for key in ("out", *_new_arguments(command)):
            if key in fields:
                is_file = command.output.file or values.get("procedure") in WORDS["files"]
                ending = ".toml" if is_file else ""
                places[key] = str(first_free(target.with_name(target.name + ending)))
        for _, key in NEW:
            if places.get(key) is True:
                places[key] = str(first_free(self.folder / f"{target.name}-{key}"))
        if "csv" in fields and "out" not in fields:
            places["csv"] = str(first_free(target.with_name(f"{target.name}.csv")))
        return places

    def cancel(self, number: int) -> None:
        """End a run in progress; nothing of its result is left."""
        worker = self.workers.get(number)
        if worker:
            worker.dismiss()

    def end(self) -> None:
        """End all runs."""
        for number in list(self.workers):
            self.cancel(number)

    def get(self, number: int) -> StartedRun | None:
        """Return a run, or None if there is none with this number."""
        path = self.folder / "runs" / f"{number:04}"
        return StartedRun(path, number in self.workers) if (path / CALL).is_file() else None

    def all(self) -> list[StartedRun]:
        """Return all runs, the last first."""
        home = self.folder / "runs"
        names = sorted((int(each.name) for each in home.glob("[0-9]*")), reverse=True)
        return [run for number in names if (run := self.get(number))]


def _new_arguments(command: Command) -> list[str]:
    """Return the arguments of a command for which the page chooses a new folder."""
    required = [key for key, each in command.fields.items() if each.default is REQUIRED]
    return [key for key in required if key == "out" or (command.name, key) in EXCEPTIONS]


def _read(path: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return content
