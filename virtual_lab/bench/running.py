"""A whole day without a page: an operator or a script takes it, and it is told what it cost."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from virtual_lab.bench.actions import Action
from virtual_lab.bench.day import evolve
from virtual_lab.bench.debrief import Debrief, debrief_page, debriefed
from virtual_lab.bench.keeping import LOG, SECRET, KeptDay, done
from virtual_lab.bench.log import entry_document
from virtual_lab.bench.operators import Operator, by_script, operator_of
from virtual_lab.bench.scenario import SCORES, load_scenario
from virtual_lab.bench.table import action_table
from virtual_lab.errors import InputError
from virtual_lab.files import new_folder, read_json
from virtual_lab.output.result import Json, Rows
from virtual_lab.output.tables import Column

__all__ = ["RehearsedDay", "check_scenario", "rehearse", "replay", "save_debrief", "summary"]

TRIED = (1, 2, 3)  # seeds that a scenario is tried with
FORMULA = ("=", "+", "-", "@")  # what a spreadsheet takes for one


@dataclass(frozen=True, kw_only=True)
class RehearsedDay:
    """A day that an operator has taken: its debrief, its log and its sealed file."""

    debrief: Debrief
    kept: Mapping[str, bytes]  # by the names of the files

    @property
    def document(self) -> dict[str, Any]:
        """The debrief in the form of JSON."""
        return self.debrief.document()

    @property
    def text(self) -> str:
        """The verdict, the scores and what cost most, in lines."""
        told = self.debrief
        lines = [f"{told.title}: {told.verdict} given, {told.right_verdict} right"]
        lines += [f"  {each.name:<10} {each.value:.2f}  {each.because}" for each in told.scores]
        for each in told.costly:
            cost = "" if each.cost is None else f" {each.cost:+.4f}"
            lines.append(f"  {each.word}{cost}: {each.what}")
        return "\n".join(lines)

    def save(self, folder: str | Path) -> Path:
        """Write log, sealed file and debrief into a new folder."""
        target = Path(folder)
        with new_folder(target) as draft:
            for name, content in self.kept.items():
                (draft / name).write_bytes(content)
            (draft / SECRET).chmod(0o600)
            save_debrief(self.debrief, draft)
        return target


def rehearse(
    scenario: str | Path = "plain-day",
    *,
    operator: str | Operator = "book",
    script: str | Path | None = None,
    seed: int | None = None,
    operator_seed: int = 0,
) -> RehearsedDay:
    """Let an operator take a day at the rehearsal bench.

    Parameters
    ----------
    scenario
        The name of one that ships, or the path of a .toml file.
    operator
        ``book``, ``expert``, ``careless``, ``cheating``, or a function that is given a function
        that returns the desk as it is, and yields actions.
    script
        The path of a .json file whose actions are taken in the operator's place.
    seed, operator_seed
        Of the laboratory (None draws one), and of the operator's slips.

    Raises
    ------
    InputError
        An unknown scenario, operator or action, one that cannot be done at its place, a day that
        was not handed in.
    """
    if script is not None:
        taker = by_script(read_json(Path(script)), str(script))
    else:
        taker = operator_of(operator, operator_seed) if isinstance(operator, str) else operator
    entry = load_scenario(str(scenario))
    with TemporaryDirectory(prefix="virtual-lab-day-") as place:
        folder = Path(place) / "day"
        kept = KeptDay.begin(folder, entry, seed)
        kept.taken(taker)
        told = debriefed(kept)
        files = {name: (folder / name).read_bytes() for name in (LOG, SECRET)}
    return RehearsedDay(debrief=told, kept=files)


def save_debrief(told: Debrief, folder: Path) -> None:
    """Write a debrief as ``debrief.json`` and ``debrief.html`` into a folder."""
    text = json.dumps(told.document(), indent=1, allow_nan=False)
    (folder / "debrief.json").write_text(text + "\n", encoding="utf-8")
    (folder / "debrief.html").write_text(debrief_page(told), encoding="utf-8")


def summary(folder: str | Path) -> Rows[Json]:
    """Return one table of the days that lie in folders below `folder`: a class.

    A day that was handed in and has no debrief yet is given one, beside its log.

    Raises `InputError` where there is no day.
    """
    place = Path(folder)
    logs = sorted(place.rglob(LOG))
    if not logs:
        raise InputError(str(place), "days", None, f"no folder in it holds a {LOG}")
    rows = [
        {"trainee": _cell(log.parent.relative_to(place)), **_outcome(log.parent)} for log in logs
    ]
    columns = {key: Column(key.replace("_", " "), form=".2f") for key in rows[0]}
    return Rows(name="class", title=f"{len(rows)} days", rows=rows, columns=columns)


def _outcome(folder: Path) -> dict[str, Any]:
    path = folder / "debrief.json"
    if not path.exists():
        kept = KeptDay(folder)
        if not kept.day.handed_in:
            none = dict.fromkeys((*SCORES, "brier", "right", "found", "missed", "false_alarms"))
            day = {"minutes": kept.day.seconds / 60, "shots": len(kept.day.fired)}
            return {"day": _cell(kept.scenario.title), "verdict": "open", **none, **day}
        save_debrief(debriefed(kept), folder)
    told = read_json(path)
    return {
        "day": _cell(told["title"]),
        "verdict": told["verdict"],
        **{each["name"]: each["value"] for each in told["scores"]},
        "brier": told["brier"],
        "right": told["right_verdict"],
        **{key: " ".join(told[key]) for key in ("found", "missed", "false_alarms")},
        "minutes": told["minutes"],
        "shots": told["shots"],
    }


def _cell(text: object) -> str:
    """Return what was typed as a cell of a table that no spreadsheet takes for a formula."""
    words = str(text)
    return f"'{words}" if words.startswith(FORMULA) else words


def check_scenario(scenario: str | Path) -> Rows[Json]:
    """Try a scenario with operators by the book and expert, for who writes one.

    Raises `InputError` where it cannot be played, with file, key and what is allowed.
    """
    entry = load_scenario(str(scenario))
    rows: list[dict[str, Any]] = []
    for seed in TRIED:
        for name in ("book", "expert"):
            with TemporaryDirectory(prefix="virtual-lab-day-") as place:
                day = KeptDay.begin(Path(place) / "day", entry, seed).taken(operator_of(name))
            noted = [e.arguments["doubt"] for e in day.events if e.action == "note-doubt"]
            faults = entry.spec.faults
            rows.append(
                {
                    "operator": name,
                    "seed": seed,
                    "minutes": day.seconds / 60,
                    "shots": len(day.fired),
                    "verdict": day.verdict,
                    "found": " ".join(fault for fault in faults if fault in noted),
                    "missed": " ".join(fault for fault in faults if fault not in noted),
                    "false_alarms": " ".join(str(each) for each in noted if each not in faults),
                }
            )
    expert = [row for row in rows if row["operator"] == "expert"]
    longest = max(row["minutes"] for row in expert)
    most = max(row["shots"] for row in expert)
    words = [f"an expert takes up to {longest:.0f} min and {most} shots"]
    given = entry.spec
    if given.minutes / 60 < longest or given.shots < most:
        words.append(f"you give {given.minutes / 60:.0f} min and {given.shots}: a tight budget")
    if any(row["missed"] for row in expert):
        words.append("an expert misses a fault on some of these days")
    if given.faults and not any(row["missed"] for row in rows):
        words.append("who keeps to the book finds every fault")
    return Rows(
        name="scenario",
        title=f"{given.title}: it can be played",
        rows=rows,
        columns={key: Column(key.replace("_", " "), form=".0f") for key in rows[0]},
        words="\n".join(words),
    )


def replay(path: str | Path) -> Rows[Json]:
    """Play a day back from its log: each entry as it was, and whether it comes out again.

    Parameters
    ----------
    path
        A log, ``day.sqlite``, with its sealed file beside it, or the folder of both.

    Raises
    ------
    InputError
        No log, or a day that was not handed in.
    """
    place = Path(path)
    kept = KeptDay(place if place.is_dir() else place.parent)
    if not kept.day.handed_in:
        raise InputError(str(place), "day", None, "is not handed in yet")
    sheets = action_table().actions
    day, rows = kept.morning, []
    for event in kept.day.events:
        action = Action(name=event.action, arguments=event.arguments)
        same = entry_document(done(kept.apparatus, day, action)) == entry_document(event)
        day = evolve(day, event)
        rows.append(
            {
                "entry": event.number,
                "minute": day.seconds / 60,
                "action": sheets[event.action].title,
                "entered": ", ".join(f"{key} {value}" for key, value in event.arguments.items()),
                "shown": ", ".join(
                    f"{what} {value} {unit}".strip() for what, value, unit in event.shown
                ),
                "same": "yes" if same else "NO",
            }
        )
    differ = [str(row["entry"]) for row in rows if row["same"] == "NO"]
    words = f"entries that come out otherwise: {', '.join(differ)}" if differ else "the same day"
    columns = {key: Column(key, form=".1f") for key in rows[0]}
    return Rows(name="replay", title=kept.scenario.title, rows=rows, columns=columns, words=words)
