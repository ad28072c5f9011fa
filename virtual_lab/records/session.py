"""A test session: everything raw that a laboratory hands over, in memory and on disk.

On disk a session is a folder: ``session.json`` (what was tested, with which rigs, and what
their calibrations say), ``procedure.toml`` (the rules, as they were), and one CSV file a
channel in a folder a stage. It holds no truth and no seed, and it is enough to repeat the
whole reduction.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.files import parse_table, read_bytes, read_json, read_text
from virtual_lab.records import RECORD_TYPES, Record
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["SCHEMA", "Session", "load_session", "save_session"]

SCHEMA = 1
OPTIONAL = (  # left out where the records do not say
    "bat_sport",
    "ball_sport",
    "laboratory",
    "customer",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """Raw records by stage and channel, and what is known of the instruments that wrote them."""

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
    names = {record: name for name, record in RECORD_TYPES.items()}
    for stage, records in session.records.items():
        (folder / stage).mkdir()
        for channel, record in records.items():
            table = record.table()
            data = table.to_csv(index=False).encode()
            (folder / stage / f"{channel}.csv").write_bytes(data)
            channels.setdefault(stage, {})[channel] = {
                "record": names[type(record)],
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
        "calibration": {key: _written(known) for key, known in session.calibration.items()},
    }
    (folder / "procedure.toml").write_text(session.procedure_text, encoding="utf-8")
    text = json.dumps(document, indent=1, allow_nan=False)
    (folder / "session.json").write_text(text + "\n", encoding="utf-8")


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


def load_session(folder: Path) -> Session:
    """Read a session. `InputError` names the file, key and mend where it cannot be used."""
    where = folder / "session.json"
    document = read_json(where)
    for key in ("bat", "ball", "rigs", "channels", "calibration"):
        if key not in document:
            raise InputError(str(where), key, None, "this key is missing")
    if document.get("schema") != SCHEMA:
        raise InputError(str(where), "schema", document.get("schema"), f"allowed: {SCHEMA}")
    for key in ("rigs", "channels", "calibration"):
        _require_table(document[key], key, where)
    _require_table(document.get("simulation", {}), "simulation", where)
    for stage, channels in document["channels"].items():
        _require_table(channels, f"channels.{stage}", where)
        for channel, entry in channels.items():
            _require_table(entry, f"channels.{stage}.{channel}", where)
    return Session(
        bat=document["bat"],
        ball=document["ball"],
        rigs=document["rigs"],
        procedure_text=read_text(folder / "procedure.toml"),
        calibration={
            key: _known(entry, f"calibration.{key}", where)
            for key, entry in document["calibration"].items()
        },
        records={
            stage: {
                channel: _record(folder / stage / f"{channel}.csv", entry, where)
                for channel, entry in channels.items()
            }
            for stage, channels in document["channels"].items()
        },
        date=str(document.get("date", "")),
        **{key: str(document.get(key, "")) for key in OPTIONAL},
        simulation=document.get("simulation", {}),
    )


def _require_table(entry: object, key: str, where: Path) -> None:
    if not isinstance(entry, Mapping):
        raise InputError(str(where), key, str(entry), "expected an object { … }")


def _written(known: Estimate) -> dict[str, Any]:
    entry: dict[str, Any] = {"value": known.value, "u": known.u}
    if known.dof != inf:
        entry["dof"] = known.dof
    if known.source:
        entry["source"] = known.source
    return entry


def _known(entry: Any, key: str, where: Path) -> Estimate:
    try:
        return Estimate(
            value=float(entry["value"]),
            u=float(entry["u"]),
            dof=float(entry.get("dof", inf)),
            source=str(entry.get("source", "")),
        )
    except (TypeError, KeyError, AttributeError, OverflowError) as fault:
        allowed = "expected { value, u } and, where limited, dof: numbers, SI"
        raise InputError(str(where), key, str(entry), allowed) from fault
    except ValueError as fault:
        raise InputError(str(where), key, None, str(fault)) from fault


def _record(path: Path, entry: Mapping[str, Any], where: Path) -> Record:
    kind = str(entry.get("record"))
    if kind not in RECORD_TYPES:
        raise InputError(
            str(where), f"{path.stem}.record", kind, f"allowed: {', '.join(RECORD_TYPES)}"
        )
    data = read_bytes(path)
    table = parse_table(data, str(path))
    if "rows" in entry and entry["rows"] != len(table):
        raise InputError(
            str(path),
            "rows",
            len(table),
            f"session.json says {entry['rows']} (is the record cut short?)",
        )
    if "sha256" in entry and entry["sha256"] != hashlib.sha256(data).hexdigest():
        raise InputError(
            str(path),
            "sha256",
            None,
            "not the record session.json was written with (if the change is meant, drop the key)",
        )
    record = RECORD_TYPES[kind].from_table(table, str(path))
    return _with_arrays(record, entry, path)


def _with_arrays(record: Record, entry: Mapping[str, Any], path: Path) -> Record:
    """Return a record with the arrays that lie beside its table, read as they are needed."""
    listed = entry.get("attached", {})
    _require_table(listed, f"{path.stem}.attached", path)
    for name, digest in listed.items():
        beside = path.with_name(f"{path.stem}-{name}.npy")
        if name not in record.attached:
            allowed = f"allowed: {', '.join(record.attached) or 'nothing'}"
            raise InputError(str(path), "attached", name, allowed)
        try:
            with beside.open("rb") as file:
                same = hashlib.file_digest(file, "sha256").hexdigest() == digest
            values = np.load(beside, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError) as fault:
            raise InputError(str(beside), "file", None, f"cannot be read ({fault})") from fault
        if not same:
            raise InputError(
                str(beside), "sha256", None, "not the array session.json was written with"
            )
        try:
            record = replace(record, **{name: values})
        except ValueError as fault:
            raise InputError(str(beside), "shape", str(values.shape), str(fault)) from fault
    return record
