"""A test session: all raw records of a test, in memory and on disk.

On disk a session is a folder: ``session.json`` (tested bat, rigs, calibration constants),
``procedure.toml`` (the procedure as used), and for each stage a folder with one CSV file per
channel. It contains neither truth nor seed, and suffices for the complete reduction.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any, Literal

import numpy as np

from virtual_lab.catalog.specs import BatSport, Name, Real, Spec, Sport, Title, Whole
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError, nearest
from virtual_lab.files import inside, parse_table, read_bytes, read_json, read_text
from virtual_lab.records import RECORD_NAMES, RECORD_TYPES, Record
from virtual_lab.records.constants import require_plausible
from virtual_lab.uncertainty.estimate import Estimate

SCHEMA = 1
SESSION = "session.json"
OPTIONAL = (  # left out where the records do not say
    "bat_sport",
    "ball_sport",
    "laboratory",
    "customer",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """Raw records by stage and channel, with the calibration of the instruments."""

    bat: str
    ball: str
    rigs: Mapping[str, str]  # stage: name
    procedure_text: str
    calibration: Mapping[str, Estimate]  # "stage.instrument.constant"
    records: Mapping[str, Mapping[str, Record]]  # stage: channel: record
    date: str = ""  # of the test, as the laboratory writes dates
    bat_sport: str = ""  # what the bat is marked for, as its data sheet says; "": not known
    ball_sport: str = ""
    laboratory: str = ""
    customer: str = ""
    simulation: Mapping[str, Any]  # rungs, reality and seed commitment; {} for a real laboratory


def save_session(session: Session, folder: Path) -> None:
    """Write a session into `folder`, which must exist and be empty."""
    channels: dict[str, dict[str, Any]] = {}
    for stage, records in session.records.items():
        (folder / stage).mkdir()
        for channel, record in records.items():
            table = record.table()
            data = table.to_csv(index=False).encode()
            (folder / stage / f"{channel}.csv").write_bytes(data)
            channels.setdefault(stage, {})[channel] = {
                "record": RECORD_NAMES[type(record)],
                "rows": len(table),
                "sha256": hashlib.sha256(data).hexdigest(),
                **_attached(record, folder / stage / channel),
            }
    document = {
        "schema": SCHEMA,
        "bat": session.bat,
        "ball": session.ball,
        "date": session.date,
        **{key: getattr(session, key) for key in OPTIONAL if getattr(session, key)},
        "rigs": dict(session.rigs),
        "simulation": dict(session.simulation),
        "channels": channels,
        "calibration": {
            key: entry_of_constant(known) for key, known in session.calibration.items()
        },
    }
    (folder / "procedure.toml").write_text(session.procedure_text, encoding="utf-8")
    text = json.dumps(document, indent=1, allow_nan=False)
    (folder / SESSION).write_text(text + "\n", encoding="utf-8")


def _attached(record: Record, path: Path) -> dict[str, Any]:
    """Write the arrays beside a record's table; return their entry in session.json."""
    digests = {}
    for name in record.attached:
        values = getattr(record, name)
        if values is None:
            continue
        beside = path.with_name(f"{path.name}-{name}.npy")
        np.save(beside, values, allow_pickle=False)
        with beside.open("rb") as file:
            digests[name] = hashlib.file_digest(file, "sha256").hexdigest()
    return {"attached": digests} if digests else {}


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelEntry(Spec):
    """Entry of ``session.json`` for one channel's file."""

    record: str
    rows: Whole | None = None
    sha256: str | None = None
    attached: Mapping[str, str] = field(default_factory=dict)  # name: SHA-256 of the array


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantEntry(Spec):
    """Entry of ``session.json`` for one constant, SI."""

    value: Real
    u: Real
    dof: Real = inf
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionForm(Spec):
    """The keys of ``session.json``."""

    schema: Literal[1]
    bat: Name
    ball: Name
    rigs: Mapping[str, str]
    channels: Mapping[str, Mapping[str, ChannelEntry]]
    calibration: Mapping[str, ConstantEntry]
    date: Name = ""
    bat_sport: BatSport | Literal[""] = ""
    ball_sport: Sport | Literal[""] = ""
    laboratory: Title = ""
    customer: Title = ""
    simulation: Mapping[str, Any] = field(default_factory=dict)


def load_session(folder: Path) -> Session:
    """Read a session. `InputError` names file, key and what is allowed."""
    where = folder / SESSION
    form = validate(read_json(where), str(where), SessionForm)
    return Session(
        bat=form.bat,
        ball=form.ball,
        rigs=form.rigs,
        procedure_text=read_text(inside(folder, "procedure.toml", str(where), "procedure")),
        calibration={key: _known(entry, key, where) for key, entry in form.calibration.items()},
        records={
            stage: {
                channel: _record(folder, (stage, channel), entry, where)
                for channel, entry in channels.items()
            }
            for stage, channels in form.channels.items()
        },
        date=form.date,
        **{key: getattr(form, key) for key in OPTIONAL},
        simulation=form.simulation,
    )


def require_channel(stage: str, channel: str, where: Path) -> None:
    """Refuse names of a stage and a channel that could lead out of the folder they lie in."""
    for name in (stage, channel):
        if not re.fullmatch(r"[\w-]{1,100}", name, re.ASCII):
            allowed = "allowed as names: letters, digits, - and _"
            raise InputError(str(where), "channels", name, allowed)


def entry_of_constant(known: Estimate) -> dict[str, Any]:
    """Return a constant as a table of JSON, without what is not stated."""
    entry: dict[str, Any] = {"value": known.value, "u": known.u}
    if known.dof != inf:
        entry["dof"] = known.dof
    if known.source:
        entry["source"] = known.source
    return entry


def _known(entry: ConstantEntry, key: str, where: Path) -> Estimate:
    try:
        known = Estimate(value=entry.value, u=entry.u, dof=entry.dof, source=entry.source)
    except ValueError as fault:
        raise InputError(str(where), f"calibration.{key}", None, str(fault)) from fault
    require_plausible(key, known, str(where))
    return known


def _record(folder: Path, name: tuple[str, str], entry: ChannelEntry, where: Path) -> Record:
    require_channel(*name, where)
    key = f"channels.{'.'.join(name)}"
    if entry.record not in RECORD_TYPES:
        allowed = f"{nearest(entry.record, RECORD_TYPES)}allowed: {', '.join(RECORD_TYPES)}"
        raise InputError(str(where), f"{key}.record", entry.record, allowed)
    path = inside(folder, f"{'/'.join(name)}.csv", str(where), key)
    data = read_bytes(path)
    table = parse_table(data, str(path))
    if entry.rows not in (None, len(table)):
        allowed = f"session.json says {entry.rows} (is the record cut short?)"
        raise InputError(str(path), "rows", len(table), allowed)
    if entry.sha256 not in (None, hashlib.sha256(data).hexdigest()):
        raise InputError(
            str(path),
            "sha256",
            None,
            "the file was changed after session.json was written (if on purpose, remove this key)",
        )
    record = RECORD_TYPES[entry.record].from_table(table, str(path))
    return _with_arrays(record, entry, path)


def _with_arrays(record: Record, entry: ChannelEntry, path: Path) -> Record:
    """Return a record with the arrays beside its table, which are read when needed."""
    for name, digest in entry.attached.items():
        if name not in record.attached:
            allowed = f"allowed: {', '.join(record.attached) or 'nothing'}"
            raise InputError(str(path), "attached", name, allowed)
        beside = inside(path.parent, f"{path.stem}-{name}.npy", str(path), "attached")
        try:
            with beside.open("rb") as file:
                same = hashlib.file_digest(file, "sha256").hexdigest() == digest
            values = np.load(beside, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError) as fault:
            raise InputError(str(beside), "file", None, f"cannot be read ({fault})") from fault
        if not same:
            raise InputError(
                str(beside), "sha256", None, "the file was changed after session.json was written"
            )
        try:
            record = replace(record, **{name: values})
        except ValueError as fault:
            raise InputError(str(beside), "shape", str(values.shape), str(fault)) from fault
    return record
