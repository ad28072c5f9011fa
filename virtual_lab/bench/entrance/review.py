"""Tools for a trainer: table of a class, replay of a day, scenario check."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import starmap
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import Any

from virtual_lab.bench.day.actions import Action
from virtual_lab.bench.day.day import DayEvent, evolve, replay_events
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.log import LOG, DayLog
from virtual_lab.bench.day.operators import operator_of
from virtual_lab.bench.day.scenario import Scenario, load_scenario
from virtual_lab.bench.day.table import action_table
from virtual_lab.bench.machines.stored_day import StoredDay, do_action
from virtual_lab.bench.scoring.debrief import debrief
from virtual_lab.bench.scoring.debrief_page import save_debrief
from virtual_lab.certificate.comparing import differences
from virtual_lab.errors import InputError
from virtual_lab.files.tables import quote
from virtual_lab.lab import BatTest
from virtual_lab.output.result import Rows
from virtual_lab.output.tables import column

TRIED = (1, 2, 3)  # seeds of the days with which a scenario is checked


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassDay:
    """One day of a trainee with its scores. The scores are None until the day is handed in.

    If the files of a day cannot be used, `seal` is a sentence that begins with "unusable", and
    `trainee` is the only other value.
    """

    trainee: str = column("trainee")  # name of the folder
    seal: str = column("seal", form=lambda row: row.seal.partition(":")[0])  # intact or BROKEN
    # whether playing the log again gives its entries
    replay_agrees: bool = column(
        "replay agrees", form=lambda row: "yes" if row.replay_agrees else "NO"
    )
    day_title: str = column("day")
    verdict: str = column("verdict")
    right_verdict: str | None = column("right")
    brier: float | None = column("Brier", form=".2f")
    result_score: float | None = column("result", form=".2f")
    detection_score: float | None = column("detection", form=".2f")
    protocol_score: float | None = column("protocol", form=".2f")
    record_score: float | None = column("record", form=".2f")
    economy_score: float | None = column("economy", form=".2f")
    faults_named: str = column("found")
    faults_missed: str = column("missed")
    false_alarms: str = column("false alarms")
    time_min: float = column("time", "min", ".0f")
    shots: int = column("shots")


# values of a row before they are computed
UNKNOWN: dict[str, Any] = dict.fromkeys(each.name for each in fields(ClassDay))


@dataclass(frozen=True, slots=True, kw_only=True)
class TriedDay:
    """A day on which a scenario was checked with a simulated operator."""

    operator: str = column("operator")
    seed: int = column("seed")
    time_min: float = column("time", "min", ".0f")
    shots: int = column("shots")
    verdict: str = column("verdict")
    faults_named: str = column("found")
    faults_missed: str = column("missed")
    false_alarms: str = column("false alarms")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedEntry:
    """A replayed entry, and whether the replay gives the same content as the log."""

    entry: int = column("entry")
    time_min: float = column("minute", form=".1f")
    action: str = column("action")
    entered: str = column("entered")
    shown: str = column("shown")
    same: bool = column("same", form=lambda row: "yes" if row.same else "NO")

    @property
    def text(self) -> str:
        """One line for the entry, and indented lines for what was entered and shown."""
        differs = "" if self.same else "  DIFFERS FROM THE LOG"
        lines = [f"{self.entry:5d}  {self.time_min:5.1f} min  {self.action}{differs}"]
        for name, words in (("entered", self.entered), ("shown", self.shown)):
            if words:
                indent = " " * 18
                lines.append(
                    fill(f"{name}: {words}", 100, initial_indent=indent, subsequent_indent=indent)
                )
        return "\n".join(lines)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Replay(Rows[PlayedEntry]):
    """The entries of a replayed day."""

    @property
    def text(self) -> str:
        """The title, one block of lines per entry, and the words on the comparison."""
        entries = "\n".join(row.text for row in self.rows)
        return "\n\n".join((self.title, entries, self.words))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ClassTable(Rows[ClassDay]):
    """The days of a class."""

    @property
    def code(self) -> int:
        """Exit code of the command: 4 if the files of a day cannot be used."""
        return 4 if self.words else 0


def summary(folder: str | Path) -> ClassTable:
    """Return a table of all days in the folders below `folder`, one row per day.

    `folder` is, for example, the folder of a class. The rows are sorted by folder. Practice days
    are left out. All columns are computed from the log and the sealed file of a day, never read
    from its debrief. The scores of a day are None until it is handed in. If a handed-in day has no
    debrief yet, this function writes the debrief into the folder of the day. If the files of a day
    cannot be used, the row and `words` state why. Raises `InputError` if there is no day.
    """
    place = Path(folder)
    rows = list[ClassDay]()
    for log in sorted(place.rglob(LOG)):
        trainee = str(log.parent.relative_to(place))
        try:
            rows += [] if DayLog(log).first.practice else [_outcome(log.parent, trainee)]
        except InputError as fault:
            stated = {"trainee": quote(trainee), "seal": f"unusable: {fault}"}
            rows.append(ClassDay(**UNKNOWN | stated))
    if not rows:
        raise InputError(str(place), "days", None, f"no folder in it holds a {LOG}")
    unusable = "\n".join(row.seal for row in rows if row.seal.startswith("unusable"))
    return ClassTable(name="class", title=f"days: {len(rows)}", rows=rows, words=unusable)


def _outcome(folder: Path, trainee: str) -> ClassDay:
    """Return the row of a day: all of it is computed from the log and the sealed file."""
    stored = StoredDay(folder)
    day, numbers, names = stored.day, dict[str, Any](), dict[str, str]()
    if day.handed_in:
        whole = not (folder / "debrief.html").exists()
        judged = debrief(
            stored.apparatus, stored.desk, stored.scenario, stored.seal, scores_only=not whole
        )
        if whole:
            save_debrief(judged, folder)
        numbers = {f"{each.name}_score": each.value for each in judged.scores}
        numbers |= {"brier": judged.brier, "right_verdict": judged.right_verdict}
        names = {key: " ".join(getattr(judged, key)) for key in ("found", "missed", "false_alarms")}
    known = {
        "trainee": quote(trainee),
        "seal": stored.seal.partition(":")[0],
        "replay_agrees": all(starmap(_is_same, _play_again(stored))),
        "day_title": quote(stored.scenario.title),
        "verdict": day.verdict if day.handed_in else "not handed in",
        "time_min": day.seconds / 60,
        "shots": len(day.fired),
        "faults_named": names.get("found", ""),
        "faults_missed": names.get("missed", ""),
        "false_alarms": names.get("false_alarms", ""),
    }
    return ClassDay(**UNKNOWN | known | numbers)


def _play_again(stored: StoredDay) -> Iterator[tuple[DayEvent, DayEvent]]:
    """Yield each entry of a day, and the same entry played again from the sealed file."""
    day = replace(stored.morning, morning=stored.apparatus.laboratory.session)
    for event in stored.day.events:
        action = Action(name=event.action, arguments=event.arguments)
        again = do_action(stored.apparatus, day, action)
        day = evolve(day, again)
        yield event, again


def _is_same(event: DayEvent, again: DayEvent) -> bool:
    """Return whether two entries differ at most by rounding."""
    stated, played = (
        json.dumps([getattr(entry, name) for name in entry.__slots__]) for entry in (event, again)
    )
    return stated == played or not any(differences(json.loads(stated), json.loads(played), LOG))


def play_day(folder: Path) -> BatTest:
    """Return the test of a stored day, played again from its log and its sealed file.

    Raises `InputError` if the files of the day cannot be used.
    """
    stored = StoredDay(folder)
    morning = replace(stored.morning, morning=stored.apparatus.laboratory.session)
    desk = Desk(replay_events(morning, (again for _, again in _play_again(stored))))
    return replace(stored.apparatus.finish(desk), certification=desk.certification)


def check_scenario(name: str | Path) -> Rows[TriedDay]:
    """Try a scenario out with simulated operators, and return one row per simulated day.

    The operators `book` and `expert` carry out the scenario on three days each, with the seeds 1, 2
    and 3, so there are six rows. Raises `InputError` with file, key and allowed values if the
    scenario is not valid.
    """
    entry = load_scenario(str(name))
    scenario = entry.spec
    rows = []
    for seed in TRIED:
        for operator in ("book", "expert"):
            with TemporaryDirectory(prefix="virtual-lab-day-") as parent:
                day = StoredDay.begin(Path(parent) / "day", entry, seed)
                after_day = day.run_operator(operator_of(operator))
            noted = [
                str(e.arguments["doubt"]) for e in after_day.events if e.action == "note-doubt"
            ]
            faults = day.scenario.faults or ()
            rows.append(
                TriedDay(
                    operator=operator,
                    seed=seed,
                    time_min=after_day.seconds / 60,
                    shots=len(after_day.fired),
                    verdict=after_day.verdict,
                    faults_named=" ".join(fault for fault in faults if fault in noted),
                    faults_missed=" ".join(fault for fault in faults if fault not in noted),
                    false_alarms=" ".join(each for each in noted if each not in faults),
                )
            )
    return Rows(
        name="scenario",
        title=f"{scenario.title}: the scenario is valid",
        rows=rows,
        words="\n".join(_advice(scenario, rows)),
    )


def _advice(scenario: Scenario, rows: list[TriedDay]) -> list[str]:
    expert = [row for row in rows if row.operator == "expert"]
    minutes, shots = max(row.time_min for row in expert), max(row.shots for row in expert)
    words = [f"an expert takes up to {minutes:.0f} min and {shots} shots"]
    if scenario.minutes / 60 < minutes or scenario.shots < shots:
        budget = f"{scenario.minutes / 60:.0f} min and {scenario.shots} shots"
        words.append(f"your scenario allows {budget}: a tight budget")
    if any(row.faults_missed for row in expert):
        words.append("an expert misses a fault on some of these days")
    if scenario.may_go_wrong and not any(row.faults_missed for row in rows):
        words.append("an operator who only follows the procedure finds every fault")
    return words


def replay(path: str | Path) -> Replay:
    """Repeat a day from its log; return one row per entry.

    A row states whether the repeated entry equals the entry in the log.

    Parameters
    ----------
    path
        The folder of the day, or its log ``day.sqlite``. The sealed file must be beside the log.

    Raises
    ------
    InputError
        The log or the sealed file does not exist or cannot be used, or the day was not handed in.
    """
    day = StoredDay(played_folder(path))
    sheets, seconds, rows = action_table().actions, 0.0, []
    for event, again in _play_again(day):
        seconds += event.seconds
        display = (f"{quantity} {value} {unit}".strip() for quantity, value, unit in event.shown)
        rows.append(
            PlayedEntry(
                entry=event.number,
                time_min=seconds / 60,
                action=sheets[event.action].title,
                entered=", ".join(f"{key} {value}" for key, value in event.arguments.items()),
                shown=", ".join(display),
                same=_is_same(event, again),
            )
        )
    differ = [str(row.entry) for row in rows if not row.same]
    words = (
        f"entries that differ from the log: {', '.join(differ)}" if differ else "all entries agree"
    )
    return Replay(name="replay", title=day.scenario.title, rows=rows, words=words)


def played_folder(path: str | Path) -> Path:
    """Return the folder of a day, given the folder itself or its log.

    Raises `InputError` if there is no log, or if the day was not handed in.
    """
    place = Path(path)
    log = place / LOG if place.is_dir() else place
    if log.name != LOG or not log.is_file():
        raise InputError("", "replay", str(path), f"allowed: an existing {LOG}, or its folder")
    if not any(event.action == "hand-in" for event in DayLog(log).events()):
        raise InputError(str(place), "day", None, "is not handed in yet")
    return log.parent
