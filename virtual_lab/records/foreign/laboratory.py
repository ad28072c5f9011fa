"""From a folder of another laboratory (``laboratory.toml`` and tables) to a session."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from virtual_lab import catalog
from virtual_lab.catalog.specs import BatSport, Construction, Name, Spec, Sport, Title
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import LISTED, InputError
from virtual_lab.files import inside, parse_toml, read_text
from virtual_lab.records.foreign.constants import read_constants
from virtual_lab.records.foreign.table import ChannelForm, FirstIndex, read_channel
from virtual_lab.records.origin import Supplied
from virtual_lab.records.particulars import particulars_of
from virtual_lab.records.session import Session, require_channel

FORM = "laboratory.toml"
BLANK = "?"  # placeholder in a form for a value to fill in
HEADER = re.compile(r"\s*\[([\w.-]+)\]")  # head of a table in TOML
UNFILLED = re.compile(r"""\s*"?([\w.-]+)"?\s*=(?:.*=)?\s*["']\?["']""")  # line with a placeholder


@dataclass(frozen=True, slots=True, kw_only=True)
class LaboratoryForm(Spec):
    """The keys of the form; channels and calibration are read separately."""

    bat: Name
    ball: Name
    procedure: str
    rigs: Mapping[str, str]  # stage: name
    calibration: Mapping[str, Any]  # "stage.instrument.constant"
    channels: Mapping[str, Mapping[str, Any]]  # stage: channel
    laboratory: Title
    date: str | datetime.date = ""
    bat_sport: BatSport | Literal[""] = ""
    ball_sport: Sport | Literal[""] = ""
    bat_construction: Construction | Literal[""] = ""
    customer: Title = ""
    particulars: Mapping[str, Any] = field(default_factory=dict)
    index_from: FirstIndex = 0


def load_laboratory(folder: Path) -> Session:
    """Return the session that another laboratory supplied as a form and tables, in SI.

    The form is the file ``laboratory.toml`` in `folder`. It names the files with the tables.

    Raises
    ------
    InputError
        The form is incomplete, keys, units or columns do not fit, a constant is not plausible, a
        table cannot be read, or times decrease. The message names file, key, value and what is
        allowed.
    """
    path = folder / FORM
    form = _read_form(path)
    records: dict[str, dict[str, Any]] = {}
    faults = []
    for stage, channels in form.channels.items():
        for channel, entry in channels.items():
            try:
                record = _record(entry, (stage, channel), folder, form)
            except InputError as fault:
                faults.append(fault)
            else:
                records.setdefault(stage, {})[channel] = record
    if len(faults) > 1:
        allowed = LISTED.join(["cannot be used:", *map(str, faults)])
        raise InputError(str(path), f"{len(faults)} tables", None, allowed)
    if faults:
        raise faults[0]
    return Session(
        bat=form.bat,
        ball=form.ball,
        date=str(form.date),
        bat_sport=form.bat_sport,
        ball_sport=form.ball_sport,
        bat_construction=form.bat_construction,
        origin=Supplied(laboratory=form.laboratory, customer=form.customer),
        particulars=particulars_of(form.particulars, f"{path} [particulars]", folder=path.parent),
        rigs=form.rigs,
        procedure_text=_procedure_text(form.procedure, folder, path),
        calibration=read_constants(form.calibration, str(path)),
        records=records,
    )


def _record(entry: Any, name: tuple[str, str], folder: Path, form: LaboratoryForm) -> Any:
    require_channel(*name, folder / FORM)
    where = f"{folder / FORM} [channels.{'.'.join(name)}]"
    channel = validate(entry, where, ChannelForm)
    return read_channel(channel, folder, form.index_from, where)


def _read_form(path: Path) -> LaboratoryForm:
    text = read_text(path)
    document = parse_toml(text, str(path))
    unfilled, allowed = list(_unfilled_lines(text)), f"not filled in yet ({BLANK!r})"
    if len(unfilled) == 1:
        raise InputError(str(path), unfilled[0], None, allowed)
    if unfilled:
        allowed = LISTED.join([f"{allowed}:", *unfilled])
        raise InputError(str(path), f"{len(unfilled)} lines", None, allowed)
    return validate(document, str(path), LaboratoryForm)


def _unfilled_lines(text: str) -> Iterator[str]:
    """Yield number and key of each line of a form with a value that is not filled in."""
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        if header := HEADER.match(line):
            table = f"{header[1]}."
        elif gap := UNFILLED.match(line):
            yield f"line {number}: {table}{gap[1]}"


def procedure_name(folder: Path) -> str:
    """Return the procedure stated by another laboratory, a catalog name or the path of a file.

    The laboratory stated the test procedure in the form (a TOML file) in `folder`. A returned path
    begins with `folder`. Raises `InputError` if the form is missing or incomplete, or if the file
    is outside the folder.
    """
    return _procedure(_read_form(folder / FORM).procedure, folder)


def _procedure(name: str, folder: Path) -> str:
    if not name.endswith(".toml"):
        return name
    return str(inside(folder, name, str(folder / FORM), "procedure"))


def _procedure_text(name: str, folder: Path, where: Path) -> str:
    try:
        return catalog.text("procedures", _procedure(name, folder))
    except InputError as fault:
        raise InputError(str(where), fault.key, fault.value, fault.allowed) from fault
