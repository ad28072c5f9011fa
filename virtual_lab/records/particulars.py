"""Particulars of a report: laboratory, customer, bat, place, dates, and authorizing person.

These are the common requirements for reports of ISO/IEC 17025:2017, 7.8.2.1. Each may be left out;
one line of the certificate lists the missing ones.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from virtual_lab.catalog.specs import ReadEntry, Spec, Title
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.files import read_toml
from virtual_lab.records.logo import Logo, logo_of


@dataclass(frozen=True, slots=True)
class Calendar(ReadEntry):
    """Annotation of a field whose file entry is a day, as a date or as text; empty: not stated."""

    def read(self, raw: object) -> object:
        """Return the day as text. Raises `ValueError` for a string that is not a day."""
        if isinstance(raw, datetime.date):
            return raw.isoformat()
        if isinstance(raw, str) and raw:
            try:
                return datetime.date.fromisoformat(raw).isoformat()
            except ValueError:
                raise ValueError("must be a day such as 2026-11-25") from None
        return raw


Day = Annotated[str, Calendar()]


@dataclass(frozen=True, slots=True, kw_only=True)
class TestingLaboratory(Spec):
    """The laboratory. `place` is the place of the test, if it is not the address."""

    name: Title = ""
    """Name of the laboratory."""
    address: Title = ""
    """Address of the laboratory."""
    place: Title = ""
    """Place of the test, if it is not the address."""
    logo: Logo = ""
    """Logo as a data: address; in a file of particulars, the name of a picture file beside it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Customer(Spec):
    """The customer for whom the bat was tested."""

    name: Title = ""
    """Name of the customer."""
    address: Title = ""
    """Address of the customer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TestItem(Spec):
    """The tested bat, as it was received."""

    maker: Title = ""
    """Maker of the bat."""
    model: Title = ""
    """Model of the bat."""
    serial: Title = ""
    """Serial number of the bat."""
    condition: Title = ""
    """Condition of the bat."""
    received: Day = ""
    """Day on which the bat was received."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TestCourse(Spec):
    """Days and operator of the test, deviations, and notes."""

    begun: Day = ""
    """First day of the test."""
    ended: Day = ""
    """Last day of the test."""
    issued: Day = ""
    """Day on which the report was issued."""
    operator: Title = ""
    """Operator of the test."""
    deviations: Title = ""
    """Deviations from the procedure."""
    outside_providers: Title = ""
    """Work by outside providers."""
    notes: Title = ""
    """Notes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Authoriser(Spec):
    """The person who authorizes the report."""

    name: Title
    """Name of the person."""
    role: Title
    """Role of the person in the laboratory."""

    def __post_init__(self) -> None:
        if not (self.name and self.role):
            raise ValueError(
                "needs a name and a role; leave this table out if nobody authorizes it"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplacedReport(Spec):
    """The report that this one replaces, with the reason (ISO/IEC 17025:2017, 7.8.8)."""

    number: Title
    """Number of the replaced certificate."""
    digest: Title
    """SHA-256 of its certificate.json with LF line ends."""
    folder: Title
    """Name of its folder, beside that of this report."""
    reason: Title
    """Reason for the replacement."""

    def __post_init__(self) -> None:
        if not self.reason:
            raise ValueError("needs a reason")
        if self.folder in (".", "..") or Path(self.folder).name != self.folder:
            raise ValueError("needs the name of a folder beside that of this report")


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentIdentity(Spec):
    """Identity of an instrument, and its calibration."""

    identity: Title
    """Identity of the instrument, such as its serial number."""
    certificate: Title = ""
    """Number of the calibration certificate."""
    date: Day = ""
    """Day of the calibration."""
    due: Day = ""
    """Day on which the next calibration is due."""
    traceability: Title = ""
    """Laboratory or standard to which the calibration is traceable."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Particulars(Spec):
    """Statements of a report beside its results. An empty string and None mean: not stated."""

    laboratory: TestingLaboratory = TestingLaboratory()
    """The laboratory."""
    customer: Customer = Customer()
    """The customer."""
    bat: TestItem = TestItem()
    """The tested bat, as it was received."""
    test: TestCourse = TestCourse()
    """Course of the test."""
    authorised_by: Authoriser | None = None
    """Person who authorizes the report; null: not stated."""
    replaces: ReplacedReport | None = None
    """Report that this one replaces; null: none."""
    instruments: Mapping[str, InstrumentIdentity] = field(default_factory=dict)
    """Identities of instruments, by the name of the instrument."""

    @property
    def stated(self) -> dict[str, Any]:
        """The stated particulars, as tables of JSON."""
        return _without_empty(asdict(self))

    def list_statements(self, *, simulated: bool) -> Iterator[tuple[str, str]]:
        """Yield the printed name and the value of each stated particular, in the order of a report.

        In a simulated test, the line of the authorizing person is marked as simulated.
        """
        for row in PRINTED:
            if value := row.of(self):
                marked = simulated and row.key == "authorised_by"
                yield row.words, f"{value} (SIMULATED)" if marked else value

    def list_missing(self, *elsewhere: str) -> list[str]:
        """Return the names of the particulars that are not stated, in words.

        The keys `elsewhere` are left out, because the report states them at another place.
        """
        left_out = ("replaces", *elsewhere)  # most reports replace no other
        rows = (row for row in PRINTED if row.key not in left_out)
        return [row.words.lower() for row in rows if not row.of(self)]


NOTHING_STATED = Particulars()


class Particular(NamedTuple):
    """One line of a report: its key in the file, and its printed words."""

    key: str
    words: str

    def of(self, particulars: Particulars) -> str:
        """Return the value of this line in `particulars` as text, "" if it is not stated."""
        value: Any = particulars
        for part in self.key.split("."):
            value = getattr(value, part)
        if isinstance(value, Authoriser):
            return f"{value.name}, {value.role}"
        if isinstance(value, ReplacedReport):
            return f"certificate {value.number}: {value.reason}"
        return value or ""


PRINTED = (
    Particular("laboratory.name", "Laboratory"),
    Particular("laboratory.address", "Address of the laboratory"),
    Particular("laboratory.place", "Place of the test"),
    Particular("customer.name", "Customer"),
    Particular("customer.address", "Address of the customer"),
    Particular("bat.maker", "Maker of the bat"),
    Particular("bat.model", "Model of the bat"),
    Particular("bat.serial", "Serial number of the bat"),
    Particular("bat.condition", "Condition of the bat"),
    Particular("bat.received", "Bat received"),
    Particular("test.begun", "Test begun"),
    Particular("test.ended", "Test ended"),
    Particular("test.issued", "Report issued"),
    Particular("test.operator", "Operator"),
    Particular("test.deviations", "Deviations from the procedure"),
    Particular("test.outside_providers", "Outside providers"),
    Particular("test.notes", "Notes"),
    Particular("authorised_by", "Authorized by"),
    Particular("replaces", "Replaces"),
)
PARTICULARS = "particulars.toml"  # file of particulars in the folder of a laboratory
IN_TURN = ("bat.received", "test.begun", "test.ended", "test.issued")  # days in the order of time


def read_particulars(file: Path | Mapping[str, Any] | None) -> Particulars:
    """Return the particulars of a test from a file.

    Particulars are what a certificate states about the laboratory, the customer, the bat and the
    instruments. `file` is the path of the file, or its keys and values. If it is None, nothing is
    stated. The logo is the name of a file in the folder of `file`. If `file` is not a path, the
    logo is in the current folder.

    Raises
    ------
    InputError
        The file cannot be read, a key is unknown, a value cannot be printed, a day is not a date,
        or days are in the wrong order. The message names file, key, value and what is allowed.
    """
    if isinstance(file, Path) and file.is_dir():  # the folder of a laboratory
        file = file / PARTICULARS if (file / PARTICULARS).exists() else None
    if isinstance(file, Path):
        return particulars_of(read_toml(file), str(file), folder=file.parent)
    return particulars_of(dict(file or {}), "laboratory", folder=Path())


def particulars_of(
    document: Mapping[str, Any], where: str, *, folder: Path | None = None
) -> Particulars:
    """Return the particulars of a test from the keys and values of a document.

    They state laboratory, customer, bat, persons and the like. Raises `InputError` in the same
    cases as `read_particulars`.

    Parameters
    ----------
    where
        Name of the document for error messages.
    folder
        Folder of the file of the logo. State it if the document contains the name of this file. By
        default the document must contain the picture itself.
    """
    table = document.get("laboratory")
    if folder is not None and isinstance(table, Mapping) and isinstance(table.get("logo"), str):
        logo = table["logo"] and logo_of(table["logo"], folder, where)
        document = {**document, "laboratory": {**table, "logo": logo}}
    particulars = validate(document, where, Particulars)
    before = Particular("", "")
    for key in IN_TURN:
        day_row = Particular(key, key)
        day, earlier = day_row.of(particulars), before.of(particulars) if before.key else ""
        if day and earlier and day < earlier:
            raise InputError(where, key, day, f"allowed: {earlier} ({before.key}) or later")
        before = day_row if day else before
    return particulars


def _without_empty(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables without empty entries."""
    inner = {
        key: _without_empty(each) if isinstance(each, dict) else each
        for key, each in tables.items()
    }
    return {key: each for key, each in inner.items() if each}
