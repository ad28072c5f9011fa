"""A test session: all raw records of a test, in memory and on disk.

On disk a session is a folder: ``session.json`` (tested bat, rigs, calibration constants),
``procedure.toml`` (the procedure as used), and for each stage a folder with one CSV file per
channel. It contains neither truth nor seed, and suffices for the complete reduction.
``session.json`` states the origin of the records and the SHA-256 of every other file. A folder with
a changed or additional file is rejected. The digest of a simulated channel covers the value of the
key ``simulation`` and the file, so a changed origin cannot present simulated records as records of
another laboratory.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge

from virtual_lab.catalog.specs import (
    BatSport,
    Construction,
    Name,
    Real,
    Spec,
    Sport,
    Title,
    Whole,
    Words,
    YesNo,
)
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError, nearest
from virtual_lab.files import contents, parse_numbers, read_bytes, read_json, read_text
from virtual_lab.files.tables import csv_text
from virtual_lab.parameters import Propagation
from virtual_lab.records import Record, record_name, record_type, record_types
from virtual_lab.records.constants import require_plausible
from virtual_lab.records.origin import REHEARSAL, Origin, Simulated, Supplied
from virtual_lab.records.particulars import NOTHING_STATED, Particulars, particulars_of
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

SCHEMA = 4
PLAIN = 2  # schema in which the digest of a simulated channel covers only the file
SESSION, RULES = "session.json", "procedure.toml"
# keys that are left out if the laboratory does not know them
OPTIONAL = ("bat_sport", "ball_sport", "bat_construction")
# keys with the same values in file and session
COPIED = (
    *(*OPTIONAL, "bat", "ball", "rigs", "date", "uncertainty", "control_sha256"),
    *("boxes", "decisions"),
)
CHANGED = "the file was changed after session.json was written"
RECORD_CHANGED = "the file or the origin of the records was changed after session.json was written"


@dataclass(frozen=True, slots=True, kw_only=True)
class HitDecision(Spec):
    """Decision of a person to accept or reject a hit of a rehearsed test."""

    shot: Annotated[Whole, Ge(0)]
    """Number of the shot."""
    accepted: YesNo
    """Whether the hit was accepted; false: it was rejected."""
    because: Annotated[str, Words(300)] = ""
    """Reason of the person."""
    by: Name
    """Person who decided."""

    @property
    def word(self) -> str:
        """The decision as a participle."""
        return "accepted" if self.accepted else "rejected"


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """Raw records by stage and channel, with the calibration of the instruments."""

    bat: str
    ball: str
    rigs: Mapping[str, str]  # stage: name
    procedure_text: str
    calibration: Mapping[str, Estimate]  # "stage.instrument.constant"
    records: Mapping[str, Mapping[str, Record]]  # stage: channel: record
    origin: Origin
    date: str = ""  # date of the test, as the laboratory writes it
    bat_sport: str = ""  # sport of the bat by its data sheet; "": not known
    ball_sport: str = ""
    bat_construction: str = ""  # a word of `Construction`; "": not known
    particulars: Particulars = NOTHING_STATED
    # variance of a hit in the laboratory's earlier tests, by result
    history: Mapping[str, Estimate] = field(default_factory=dict)
    uncertainty: Propagation = "first-order"  # method of the evaluation
    # SHA-256 of session.json of the control bat's test; "": none
    control_sha256: str = ""
    boxes: int = 1  # number of boxes of balls that were opened; the balls are those of the last
    decisions: tuple[HitDecision, ...] = ()  # decisions of a person on the hits of a rehearsed day

    @property
    def is_rehearsed(self) -> bool:
        """Whether a person decided about the hits at the rehearsal bench."""
        return isinstance(self.origin, Simulated) and self.origin.sealing == REHEARSAL


@dataclass(frozen=True, slots=True, kw_only=True)
class PackedSession:
    """A session as the files of its folder, by their paths in it."""

    texts: Mapping[str, bytes]
    arrays: Mapping[str, Array]  # content of files in NumPy's format

    @property
    def digest(self) -> str:
        """SHA-256 of ``session.json``, which states the digests of all other files."""
        return digest_of_text(self.texts[SESSION])

    def write(self, folder: Path) -> None:
        """Write the files into `folder`, which must exist and be empty."""
        for name, data in self.texts.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(data)
        for name, values in self.arrays.items():
            np.save(folder / name, values, allow_pickle=False)


def pack(session: Session) -> PackedSession:
    """Return the files of a session as bytes and arrays, keyed by path in its folder.

    Nothing is written. The file ``session.json`` holds the SHA-256 of every other file. For the
    hash of a text file, CR LF is replaced by LF.

    A channel is one instrument's record. In a simulated session, the hash of a channel's file also
    covers the entry ``simulation`` of ``session.json``. The hash is then computed from this entry,
    followed by the file. The entry is JSON in one line with sorted keys.
    """
    channels: dict[str, dict[str, Any]] = {}
    start = _start_of_digests(session.origin)
    texts, arrays = dict[str, bytes](), dict[str, Array]()
    for stage, records in session.records.items():
        for channel, record in records.items():
            columns, name = record.table_columns(), f"{stage}/{channel}"
            data = texts[f"{name}.csv"] = csv_text(columns).encode()
            beside = {key: getattr(record, key) for key in record.attached}
            beside = {key: values for key, values in beside.items() if values is not None}
            arrays |= {f"{name}-{key}.npy": values for key, values in beside.items()}
            digests = {key: _digest_of_array(values, start) for key, values in beside.items()}
            channels.setdefault(stage, {})[channel] = {
                "record": record_name(record),
                "rows": next(iter(columns.values())).size,
                "sha256": digest_of_text(data, start),
                **({"attached": digests} if digests else {}),
            }
    rules = session.procedure_text.encode()
    document = {
        "schema": SCHEMA,
        **entry_of_origin(session.origin),
        "bat": session.bat,
        "ball": session.ball,
        "date": session.date,
        **{key: getattr(session, key) for key in OPTIONAL if getattr(session, key)},
        **({"boxes": session.boxes} if session.boxes > 1 else {}),
        **({"particulars": stated} if (stated := session.particulars.stated) else {}),
        "rigs": dict(session.rigs),
        "procedure_sha256": digest_of_text(rules),
        **({"control_sha256": session.control_sha256} if session.control_sha256 else {}),
        "channels": channels,
        "calibration": _entries(session.calibration),
        **({"history": _entries(session.history)} if session.history else {}),
        "uncertainty": session.uncertainty,
        **({"decisions": [asdict(one) for one in session.decisions]} if session.decisions else {}),
    }
    text = json.dumps(document, indent=1, allow_nan=False) + "\n"
    return PackedSession(texts={**texts, RULES: rules, SESSION: text.encode()}, arrays=arrays)


def save_session(session: Session, folder: Path) -> None:
    """Write the files of a session into `folder`, which must exist and be empty."""
    pack(session).write(folder)


def entry_of_origin(origin: Origin) -> dict[str, Any]:
    """Return the keys and values with which ``session.json`` states the origin of the records."""
    if isinstance(origin, Simulated):
        return {"origin": "simulated", "simulation": origin.as_json()}
    customer = {"customer": origin.customer} if origin.customer else {}
    return {"origin": "supplied", "laboratory": origin.laboratory, **customer}


def digest_of_text(data: bytes, start: bytes = b"") -> str:
    """Return the SHA-256 of text, as 64 hexadecimal digits.

    `start` is hashed before `data`. In `data`, line ends CR LF are replaced by LF, because a copy
    of the text may have changed them.
    """
    return hashlib.sha256(start + data.replace(b"\r\n", b"\n")).hexdigest()


def _start_of_digests(origin: Origin, schema: int = SCHEMA) -> bytes:
    """Return the bytes that are hashed before a channel's file: the JSON text of a simulation.

    They are empty for supplied records.
    """
    if isinstance(origin, Supplied) or schema == PLAIN:
        return b""
    return json.dumps(origin.as_json(), sort_keys=True).encode()


class _Hashed:
    """A file-like object that computes the digest of written bytes and does not store them."""

    def __init__(self, start: bytes) -> None:
        self.sha256 = hashlib.sha256(start)

    def write(self, data: bytes) -> None:
        self.sha256.update(data)


def _digest_of_array(values: Array, start: bytes) -> str:
    """Return the SHA-256 of `start` followed by the file of an array."""
    file = _Hashed(start)
    np.lib.format.write_array(file, np.asanyarray(values), allow_pickle=False)
    return file.sha256.hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelEntry(Spec):
    """Entry of ``session.json`` for one channel's file."""

    record: str
    """Kind of record."""
    rows: Whole
    """Number of rows of the file."""
    sha256: str
    """SHA-256 of the file; in a simulated session, of the JSON text of its origin and the file."""
    attached: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of each array beside the file, keyed by name; the same JSON text precedes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantEntry(Spec):
    """Entry of ``session.json`` for one constant, SI."""

    value: Real
    """Value [SI]."""
    u: Real
    """Standard uncertainty [SI]."""
    dof: Real = inf
    """Degrees of freedom of u."""
    source: str = ""
    """Origin of the value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionForm(Spec):
    """The keys of ``session.json``."""

    schema: Literal[2, 3, 4]
    """Number of the schema."""
    origin: Literal["simulated", "supplied"]
    """Origin of the records: this simulation, or another laboratory."""
    bat: Name
    """Name of the bat."""
    ball: Name
    """Name of the kind of ball."""
    rigs: Mapping[str, str]
    """Rig of each stage, by the name of the stage."""
    procedure_sha256: str
    """SHA-256 of procedure.toml."""
    channels: Mapping[str, Mapping[str, ChannelEntry]]
    """Files of the records, by stage and channel."""
    calibration: Mapping[str, ConstantEntry]
    """Calibration constants, by stage.instrument.constant."""
    date: Name = ""
    """Date of the test as the laboratory writes it."""
    bat_sport: BatSport | Literal[""] = ""
    """Sport for which the bat is marked; empty: not known."""
    ball_sport: Sport | Literal[""] = ""
    """Sport of the ball; empty: not known."""
    bat_construction: Construction | Literal[""] = ""
    """Construction of the bat; empty: not known."""
    simulation: Simulated | None = None
    """The simulation; null: supplied records."""
    laboratory: Title = ""
    """Laboratory that supplied the records; empty: a simulated test."""
    customer: Title = ""
    """Customer that the laboratory names; empty: not stated."""
    particulars: Mapping[str, Any] = field(default_factory=dict)
    """Particulars of the report."""
    history: Mapping[str, ConstantEntry] = field(default_factory=dict)
    """Variance of a hit in earlier tests of the laboratory, by result."""
    uncertainty: Propagation = "first-order"
    """Method by which the uncertainty is evaluated."""
    control_sha256: str = ""
    """SHA-256 of session.json of the control bat's test; empty: none."""
    boxes: Annotated[int, Ge(1)] = 1
    """Number of boxes of balls that were opened; the balls are those of the last."""
    decisions: tuple[HitDecision, ...] = ()
    """Decisions of a person on the hits; only a rehearsed day may have any."""


def load_session(folder: Path) -> Session:
    """Return the session stored in `folder`, after comparing its files with their SHA-256 digests.

    Raises `InputError`, which names file and key, if a file is missing, damaged, changed or not
    listed in the session, or if a value is not allowed.
    """
    where = folder / SESSION
    form = validate(read_json(where), str(where), SessionForm)
    _require_listed(folder, form, where)
    rules = read_bytes(folder / RULES)
    if form.procedure_sha256 != digest_of_text(rules):
        raise InputError(str(folder / RULES), "sha256", None, CHANGED)
    session = session_of_form(form, read_text(folder / RULES), where)
    start = _start_of_digests(session.origin, form.schema)
    records = {
        stage: {
            channel: _record(folder, (stage, channel), entry, where, start)
            for channel, entry in channels.items()
        }
        for stage, channels in form.channels.items()
    }
    return replace(session, records=records)


def session_of_form(form: SessionForm, procedure_text: str, where: Path) -> Session:
    """Return the session of a form, without records.

    Raises `InputError`, which names the file `where`, for a value that is not allowed.
    """
    return Session(
        **{key: getattr(form, key) for key in COPIED},
        procedure_text=procedure_text,
        calibration={
            key: read_constant(entry, key, str(where)) for key, entry in form.calibration.items()
        },
        records={},
        origin=_origin(form, where),
        particulars=particulars_of(form.particulars, f"{where} [particulars]"),
        history={name: _variance(entry, name, str(where)) for name, entry in form.history.items()},
    )


def _origin(form: SessionForm, where: Path) -> Origin:
    """Return the origin of a session.

    Raises `InputError` if a key of this origin is missing, or if a key of the other origin is
    stated.
    """
    simulated = form.origin == "simulated"
    needed = "simulation" if simulated else "laboratory"
    excluded = ("laboratory", "customer") if simulated else ("simulation",)
    for key in excluded:
        if getattr(form, key):
            allowed = f"not allowed: the origin of these records is {form.origin!r}"
            raise InputError(str(where), key, None, allowed)
    if not getattr(form, needed):
        allowed = f"this key is missing: the origin of these records is {form.origin!r}"
        raise InputError(str(where), needed, None, allowed)
    if form.simulation:
        return form.simulation
    return Supplied(laboratory=form.laboratory, customer=form.customer)


def _require_listed(folder: Path, form: SessionForm, where: Path) -> None:
    """Refuse a folder with links, pipes or files that ``session.json`` does not name."""
    listed = {SESSION, RULES}
    for stage, channels in form.channels.items():
        for channel, entry in channels.items():
            require_channel(stage, channel, where)
            listed.add(f"{stage}/{channel}.csv")
            listed.update(f"{stage}/{channel}-{name}.npy" for name in entry.attached)
    for name, kind in contents(folder).items():
        if kind != "file":
            allowed = "allowed in a folder of records: ordinary files and folders"
            raise InputError(str(folder / name), "file", f"a {kind}", allowed)
        if name not in listed:
            raise InputError(str(folder / name), "file", None, f"is not listed in {where}")


def require_channel(stage: str, channel: str, where: Path) -> None:
    """Raise `InputError` if the name of a stage or channel is unsafe as part of a file name.

    A safe name has 1 to 100 characters: ASCII letters, digits, - and _. `where` is the file that
    contains the names; the error message names it.
    """
    for name in (stage, channel):
        if not re.fullmatch(r"[\w-]{1,100}", name, re.ASCII):
            allowed = "allowed in names: letters, digits, - and _"
            raise InputError(str(where), "channels", name, allowed)


def _entries(constants: Mapping[str, Estimate]) -> dict[str, Any]:
    return {key: entry_of_constant(each) for key, each in constants.items()}


def entry_of_constant(constant: Estimate) -> dict[str, Any]:
    """Return a calibration constant as a JSON object.

    The keys ``value`` and ``u`` (standard uncertainty) are in SI units. The key ``dof`` is omitted
    if the degrees of freedom are infinite, and ``source`` is omitted if it is empty.
    """
    entry: dict[str, Any] = {"value": constant.value, "u": constant.u}
    if constant.dof != inf:
        entry["dof"] = constant.dof
    if constant.source:
        entry["source"] = constant.source
    return entry


def read_constant(entry: ConstantEntry, key: str, where: str) -> Estimate:
    """Return a calibration constant from its entry in the file `where`.

    Raises `InputError` if the constant `key` cannot have this value or this uncertainty.
    """
    constant = _estimate(entry, f"calibration.{key}", where)
    require_plausible(key, constant, where)
    return constant


def _variance(entry: ConstantEntry, name: str, where: str) -> Estimate:
    variance = _estimate(entry, f"history.{name}", where)
    if variance.dof == inf:
        allowed = "allowed: finite degrees of freedom"
        raise InputError(where, f"history.{name}.dof", None, allowed)
    return variance


def _estimate(entry: ConstantEntry, key: str, where: str) -> Estimate:
    try:
        return Estimate(value=entry.value, u=entry.u, dof=entry.dof, source=entry.source)
    except ValueError as fault:
        raise InputError(where, key, None, str(fault)) from fault


def _record(
    folder: Path, name: tuple[str, str], entry: ChannelEntry, where: Path, start: bytes
) -> Record:
    key = f"channels.{'.'.join(name)}"
    kind = record_type(entry.record)
    if kind is None:
        kinds = record_types()
        allowed = f"{nearest(entry.record, kinds)}allowed: {', '.join(kinds)}"
        raise InputError(str(where), f"{key}.record", entry.record, allowed)
    path = folder / f"{'/'.join(name)}.csv"
    data = read_bytes(path)
    table = parse_numbers(data, str(path))
    rows = len(next(iter(table.values())))
    if entry.rows != rows:
        allowed = f"session.json says {entry.rows} (is the record cut short?)"
        raise InputError(str(path), "rows", rows, allowed)
    if entry.sha256 != digest_of_text(data, start):
        raise InputError(str(path), "sha256", None, RECORD_CHANGED)
    record = kind.from_table(table, str(path))
    return _with_arrays(record, entry, path, start)


def _with_arrays(record: Record, entry: ChannelEntry, path: Path, start: bytes) -> Record:
    """Return a record with the arrays stored beside its table, which are read when needed."""
    for name, digest in entry.attached.items():
        if name not in record.attached:
            allowed = f"allowed: {', '.join(record.attached) or 'nothing'}"
            raise InputError(str(path), "attached", name, allowed)
        beside = path.with_name(f"{path.stem}-{name}.npy")
        try:
            with beside.open("rb") as file:
                sha256 = hashlib.file_digest(file, lambda: hashlib.sha256(start)).hexdigest()
            values = np.load(beside, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError) as fault:
            raise InputError(str(beside), "file", None, f"cannot be read ({fault})") from fault
        if sha256 != digest:
            raise InputError(str(beside), "sha256", None, RECORD_CHANGED)
        try:
            record = replace(record, **{name: values})
        except ValueError as fault:
            raise InputError(str(beside), "shape", str(values.shape), str(fault)) from fault
    return record
