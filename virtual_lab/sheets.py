"""Catalog entries (sheets) as objects: read them, or change values for a call.

A changed sheet keeps source and verification of every unchanged number; a changed number has the
source ``changed`` and is not verified. The name of a changed bat, ball or procedure contains the
changes, ``astm-f1881 (valid_hits=9)``, so that two variants never share a row of a table. The title
of every changed sheet lists the changed keys.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from virtual_lab.errors import InputError, nearest
from virtual_lab.files import parse_toml, read_text
from virtual_lab.parameters import (
    FILE,
    SEED,
    WHOLE,
    ParameterRule,
    read_name,
    read_path,
    read_word,
    several,
)

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.catalog.reading import Datum

NAMED = ("bats", "balls", "procedures")  # kinds of sheet with a new name after a change
NUMBER = re.compile(r"\s*([-+.\d][-+.\deE]*)\s+(\S.*?)\s*")  # a number and its unit
OF_LABORATORY = ("instruments", "rigs", "balls")  # kinds of sheets of a laboratory
CHANGED = "changed"  # source of a number that `Sheet.with_` changed
OF_EVERY_TEST = ("bench", "ball-wall")  # rigs that do not fire at bats
OMITTED = ("progress", "sign")  # arguments that no settings file has; a key is private
REVEALING = ("seed", "faults", "instruments")  # arguments that would reveal the truth of a test
LEFT_OUT = (
    "# seed and changes of the laboratory are left out, because they would reveal the truth\n"
)
LONGEST_TITLE = 200
LONGEST_NAME = 100
UNFIT = re.compile(r"[^\w .,=+()°µ±²³-]+")  # characters that some system rejects in file names


@dataclass(frozen=True, repr=False)
class Sheet:
    """A sheet of the catalog, or of a user's file.

    `kind` is ``bats``, ``balls``, ``procedures``, ``instruments``, ``rigs``, …; `name` is its name
    or path, and `text` its TOML. `origin` is the name of the sheet or file from which it was made,
    and `changes` holds the values that were changed since, by key.
    """

    kind: str
    name: str
    text: str
    origin: str = ""
    changes: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(cls, kind: str, name: str | Path) -> Sheet:
        """Return the sheet of a catalog name or .toml file; `InputError` if there is none."""
        from virtual_lab import catalog

        catalog.require_kind(kind)
        text, where = catalog.source(kind, str(name))
        sheet = cls(kind, str(name), text)
        sheet._check(where)
        return sheet

    @cached_property
    def document(self) -> dict[str, Any]:
        """The parsed sheet."""
        return parse_toml(self.text, self.name)

    @property
    def title(self) -> str:
        """The title in one line."""
        return str(self.document["title"])

    @property
    def datums(self) -> tuple[Datum, ...]:
        """The numbers as written in the file, each with unit and source."""
        from virtual_lab import catalog

        return tuple(catalog.datums(self.document))

    @property
    def numbers(self) -> pd.DataFrame:
        """One row per number: key, value, unit, source, verified, note."""
        import pandas as pd

        from virtual_lab.files.dictionary import with_units

        return with_units(pd.DataFrame([asdict(each) for each in self.datums]))

    @property
    def spec(self) -> Any:
        """The frozen dataclass of a bat, a ball or a procedure, with its numbers as SI floats.

        Raises `InputError` for a sheet of another kind.
        """
        if self.kind not in NAMED:
            raise InputError("", "spec", self.name, "allowed: of bats, balls and procedures")
        return self._entry(self.name).spec

    def with_(self, changes: Mapping[str, Any] | None = None, /, **named: Any) -> Sheet:
        """Return the sheet with other values.

        Parameters
        ----------
        changes, named
            New values by key; a key within a table has a dot, ``{"windows.rebound_angle": 5}``. A
            number, or a list of numbers, is in the unit of the sheet; a string ``"5 deg"`` may have
            another unit of the same quantity. None removes an optional key.

        Raises
        ------
        InputError
            A key is unknown, a value is not allowed, or a unit is one of another quantity.
        """
        if not isinstance(changes, Mapping | None):
            allowed = "allowed: keys and values, {'windows.rebound_angle': 5} or valid_hits=9"
            raise InputError(self.name, "with_", changes, allowed)
        every = {**(changes or {}), **named}
        document = deepcopy(self.document)
        for key, value in every.items():
            self._set(document, key.split("."), key, value)
        if "title" not in every:
            title = f"{document['title']}; changed: {', '.join(every)}"
            document["title"] = title[:LONGEST_TITLE]
        if self.kind not in NAMED:  # rigs refer to instruments by name, so the name must not change
            changed = Sheet(self.kind, self.name, toml_text(document))
        else:
            changed = self._rename(document, every)
        try:
            changed._check(changed.name)
        except InputError as fault:
            fault = self._nested_key_error(every) or fault
            raise fault.with_traceback(None) from None  # only the caller's line helps
        return changed

    def _nested_key_error(self, every: Mapping[str, Any]) -> InputError | None:
        """Return the error for a key without its table, if a table of this sheet has this key."""
        keys = [datum.key for datum in self.datums]
        for key in every:
            within = [each for each in keys if each.endswith(f".{key}")]
            if within and key not in self.document:
                allowed = f"unknown key, did you mean {' or '.join(within)}?"
                return InputError(self.name, key, None, allowed)
        return None

    def _rename(self, document: dict[str, Any], every: Mapping[str, Any]) -> Sheet:
        """Return the sheet of a changed document, with a name that contains the changes.

        If the changes contain a name, this name is used.
        """
        from virtual_lab import catalog

        if "name" in every:
            name = every["name"]
            if not isinstance(name, str) or not name.strip():
                raise InputError(self.name, "name", name, "allowed: a string")
            if name in catalog.names(self.kind):
                allowed = "is the name of an entry of the catalog; allowed: another name"
                raise InputError(self.name, "name", name, allowed)
            return Sheet(self.kind, name, toml_text(document))
        origin = self.origin or str(document.get("name", Path(self.name).stem))
        changes = dict(self.changes) | {key: _in_name(value) for key, value in _flatten(every)}
        name = f"{origin} ({', '.join(f'{key}={value}' for key, value in changes.items())})"
        if len(name) > LONGEST_NAME:
            digest = hashlib.sha256(name.encode()).hexdigest()[:8]
            name = f"{name[: LONGEST_NAME - len(digest) - 3]}… {digest})"
        document["name"] = name
        return Sheet(self.kind, name, toml_text(document), origin, tuple(changes.items()))

    def save(self, path: str | Path) -> Path:
        """Write the sheet as a .toml file, which can be used by its path."""
        target = Path(path)
        target.write_text(self.text, encoding="utf-8")
        return target

    def _set(self, document: dict[str, Any], keys: Sequence[str], key: str, value: Any) -> None:
        *tables, last = keys
        for table in tables:
            inner = document.get(table)
            if not isinstance(inner, dict) or _is_number(inner):
                raise self._unknown_key_error(document, table, key)
            document = inner
        old = document.get(last)
        if old is None and self.kind not in NAMED:
            raise self._unknown_key_error(document, last, key)
        if value is None:
            if old is None:
                raise self._unknown_key_error(document, last, key)
            del document[last]
        elif isinstance(value, Mapping):
            inner = document.setdefault(last, {})
            for name, each in value.items():
                self._set(inner, [name], f"{key}.{name}", each)
        else:
            document[last] = self._as_in_file(old, key, value)

    def _as_in_file(self, old: Any, key: str, value: Any) -> Any:
        """Return a new value in the form in which a file states it."""
        provenance = {"source": CHANGED, "verified": False}
        if isinstance(value, bool) or (isinstance(value, str) and isinstance(old, str)):
            return value
        number = NUMBER.fullmatch(value) if isinstance(value, str) else None
        if number:
            try:
                return {"value": float(number[1]), "unit": number[2], **provenance}
            except ValueError:
                pass
        if isinstance(value, str):
            if _is_number(old):
                allowed = f"allowed: a number in {old['unit']}, or with its unit: '5 {old['unit']}'"
                raise InputError(self.name, key, value, allowed)
            return value
        plain = [_plain(each) for each in value] if _is_list(value) else _plain(value)
        return {"value": plain, "unit": old["unit"] if _is_number(old) else "1", **provenance}

    def _unknown_key_error(self, document: Mapping[str, Any], name: str, key: str) -> InputError:
        keys = [each for each in document if each not in ("name", "title", "kind")]
        allowed = f"unknown key, {nearest(name, keys)}allowed: {', '.join(keys)}"
        return InputError(self.name, key, None, allowed)

    def _check(self, where: str) -> None:
        """Refuse an unusable sheet. Sheets of instruments are checked when they are used."""
        if self.kind in NAMED:
            self._entry(where)

    def _entry(self, where: str) -> Any:
        from virtual_lab import catalog

        if self.kind == "bats":
            return catalog.read_bat(self.text, where)
        if self.kind == "balls":
            from virtual_lab.catalog.specs import BallSpec

            return catalog.read(self.text, where, BallSpec)
        from virtual_lab.measurement.procedure import Procedure

        return catalog.read(self.text, where, Procedure)

    def __repr__(self) -> str:
        return f"<{self.kind.removesuffix('s')} {self.name}: {self.title}>"

    def _repr_html_(self) -> str:
        table = self.numbers.to_html(index=False)
        return f"<p><b>{self.name}</b>: {self.title}</p>{table}"


AnyEntry = str | Path | Sheet
AnyEntries = str | Path | Sheet | Sequence[str | Path | Sheet]


def entry_name(entry: AnyEntry) -> str:
    """Return the name of a sheet. If `entry` is a name or a path, return it as a string."""
    return entry.name if isinstance(entry, Sheet) else str(entry)


def entry_names(entries: AnyEntries) -> tuple[str, ...]:
    """Return the names or paths of catalog entries as a tuple.

    `entries` is one entry or a list of entries. An entry is a name, a path or a sheet.
    """
    if isinstance(entries, str | Path | Sheet):
        return (entry_name(entries),)
    return tuple(map(entry_name, entries))


def words_of(words: str | Sequence[str]) -> tuple[str, ...]:
    """Return a list of words as a tuple; a single word becomes a tuple with one element."""
    return (words,) if isinstance(words, str) else tuple(words)


def entry_rule(kind: str) -> ParameterRule:
    """Return the rule for a parameter that takes an entry of the catalog.

    The value of the parameter is a name in the catalog, the path of a .toml file, or a `Sheet` (an
    entry that may have changed values). `kind` is the kind of entry, such as ``bats``. The rule
    rejects a sheet of another kind, but it does not check whether a named entry exists.
    """
    one = kind.removesuffix("s")

    def read(value: Any) -> str | Sheet:
        if not isinstance(value, Sheet):
            return read_name(value)
        if value.kind != kind:
            raise TypeError(value.kind)
        return value

    return ParameterRule(
        read=read,
        allowed=f"a {one}: its name (vl.shelf('{kind}')), a .toml file or a sheet, vl.{one}(…)",
        complete=lambda: _titles(kind),
        metavar=one.upper(),
        kind="name",
    )


def _titles(*kinds: str) -> dict[str, str]:
    """Return the titles of catalog entries, keyed by name."""
    from virtual_lab import catalog

    every = kinds or catalog.KINDS
    return {name: catalog.title(kind, name) for kind in every for name in catalog.names(kind)}


def _rigs_at_bats() -> dict[str, str]:
    """Return the titles of the installed rigs that fire at bats; empty for a rig without sheet.

    No rig is loaded, because this would load the simulation.
    """
    titles = _titles("rigs")
    rigs = (each.name for each in sorted(entry_points(group="virtual_lab.rigs")))
    return {name: titles.get(name, "") for name in rigs if name not in OF_EVERY_TEST}


def _instrument(value: Any) -> Sheet:
    if isinstance(value, str) and "=" in value:
        return _instrument_in_file(value)
    if not isinstance(value, Sheet) or value.kind not in ("instruments", "rigs"):
        raise TypeError(value)
    return value


def _instruments(value: Any) -> tuple[Sheet, ...]:
    return tuple(map(_instrument, [value] if isinstance(value, Sheet | str) else value))


def _instrument_in_file(text: str) -> Sheet:
    """Return the sheet in FILE under the NAME of an instrument or rig, from ``NAME=FILE``."""
    name, _, path = text.partition("=")
    if not path:
        raise InputError(
            "", "instrument", text, "allowed: NAME=FILE, for example pivot-gates=mine.toml"
        )
    kind = "rigs" if name in _titles("rigs") else "instruments"
    return replacement(Sheet.of(kind, name), Path(path))


def replacement(sheet: Sheet, path: Path) -> Sheet:
    """Return the sheet in a file, to be used in place of `sheet`, under its name.

    Raises `InputError` if the file cannot be read, or is for another kind of instrument.
    """
    text, where = Sheet.of(sheet.kind, path).text, str(path)
    kind, wanted = (each.get("kind") for each in (parse_toml(text, where), sheet.document))
    if kind != wanted:
        allowed = f"allowed: {wanted!r}, the kind of {sheet.name}"
        raise InputError(where, "kind", kind or "", allowed)
    return Sheet(sheet.kind, sheet.name, text, origin=where)


def sheets_in(folder: Path) -> tuple[Sheet, ...]:
    """Return the sheets in the folder of a laboratory, under the names of their files.

    Raises `InputError` if the folder has none, or a sheet that no test would use. A laboratory has
    no bats and no procedures. A sheet has the name of one of the catalog. An instrument may also
    have a name that is in a rig's sheet of the folder.
    """
    from virtual_lab import catalog

    paths = [path for kind in catalog.KINDS for path in sorted((folder / kind).glob("*.toml"))]
    sheets = [Sheet.of(path.parent.name, path) for path in paths]
    if not sheets:
        missing = "" if folder.exists() else "no such file; "
        allowed = f"{missing}allowed: a folder with sheets in {', '.join(OF_LABORATORY)}"
        raise InputError("", "laboratory", str(folder), allowed)
    parts = [part for each in sheets if each.kind == "rigs" for part in each.document.values()]
    for path, sheet in zip(paths, sheets, strict=True):
        names = catalog.names(sheet.kind) if sheet.kind in OF_LABORATORY else ()
        usable = (*names, *parts) if sheet.kind == "instruments" else names
        # a procedure may name the file of its ball, so `laboratory` may write ball.toml.toml
        if path.stem not in usable and not path.stem.endswith(".toml"):
            allowed = f"{nearest(path.stem, names)}allowed: {', '.join(names or OF_LABORATORY)}"
            raise InputError(str(path), "file", path.stem, f"replaces no sheet; {allowed}")
        name = path.name.partition(".toml")[0]
        if (stated := sheet.document.get("name", name)) != name:
            raise InputError(str(path), "name", stated, f"allowed: {name}, the name of the file")
    return tuple(replace(each, name=Path(each.name).stem, origin=each.name) for each in sheets)


def _study(value: Any) -> Path | dict[str, Any]:
    """Return the path of a study, or its keys and values."""
    if not isinstance(value, Mapping):
        return read_path(value)
    return {key: STUDY[key].read(each) if key in STUDY else each for key, each in value.items()}


BAT, PROCEDURE = entry_rule("bats"), entry_rule("procedures")
BATS, PROCEDURES = several(BAT), several(PROCEDURE)
INSTRUMENT = ParameterRule(
    read=_instrument,
    parse=_instrument_in_file,
    allowed="[vl.instrument('pivot-gates').with_(tick='2 us')]; a ball: procedure.with_(ball=FILE)",
    complete=lambda: {f"{name}=": title for name, title in _titles("instruments", "rigs").items()},
    metavar="NAME=FILE",
    kind="name",
)
# rules of the keys of a campaign's study
STUDY = {
    "bats": BATS,
    "procedures": PROCEDURES,
    "laboratories": WHOLE,
    "repeats": WHOLE,
    "seed": SEED,
}

AnyName = Annotated[
    str | Path,
    ParameterRule(
        read=read_name, allowed="a name, or a path", complete=_titles, metavar="NAME", kind="name"
    ),
]
AnyScenario = Annotated[
    str | Path,
    ParameterRule(
        read=read_name,
        allowed="a scenario: its name, or a .toml file",
        complete=lambda: _titles("bench/scenarios"),
        metavar="SCENARIO",
        kind="name",
    ),
]
AnyBat = Annotated[AnyEntry, BAT]
AnyBats = Annotated[AnyEntries, BATS]
AnyBall = Annotated[AnyEntry, entry_rule("balls")]
AnyProcedure = Annotated[AnyEntry, PROCEDURE]
FORM_TITLES = {  # forms besides those of a procedure
    "laboratory": "Particulars of a laboratory, for its certificates",
    "measurements": "Measurements of a bat of your own, to fit a bat to them",
    "prices": "Prices of instruments and time, for a plan",
}
AnyForm = Annotated[
    AnyEntry, replace(PROCEDURE, complete=lambda: _titles("procedures") | FORM_TITLES)
]
AnyProcedures = Annotated[AnyEntries, PROCEDURES]
AnyCamera = Annotated[AnyEntry, entry_rule("instruments")]
AnyRig = Annotated[AnyEntry, replace(entry_rule("rigs"), complete=_rigs_at_bats)]
Faults = Annotated[
    str | Sequence[str],
    several(
        ParameterRule(
            read=read_word,
            allowed="",
            complete=lambda: _titles("faults"),
            metavar="FAULT",
            kind="name",
            closed=True,
        ),
        "names of faults (vl.shelf('faults'))",
    ),
]
Instruments = Annotated[
    Sheet | Sequence[Sheet], replace(INSTRUMENT, read=_instruments, several=INSTRUMENT)
]
AnyStudy = Annotated[
    str | Path | Mapping[str, Any],
    replace(FILE, read=_study, allowed="a study.toml, its keys and values, or None to resume"),
]


def sheet_at(rigs: Mapping[str, str], key: str) -> tuple[Sheet, str]:
    """Return the data sheet of a rig or of one of its instruments, and the key in this sheet.

    For the key ``impact.gates.distance_u``, for example, the results are the sheet of the
    instrument and ``distance_u``. The function does not check whether the sheet has this key.

    Parameters
    ----------
    rigs
        Names or paths of rigs, keyed by stage.
    key
        Stage and key of the rig's sheet, for example ``impact.pivot.from_knob_u``. For a key of an
        instrument's sheet: stage, instrument and key, for example ``impact.gates.distance_u``.

    Raises
    ------
    InputError
        The stage is unknown, or no key follows it. The sheet of the rig or instrument does not
        exist or is not a TOML file.
    """
    stage, _, key_in_rig = key.partition(".")
    if stage not in rigs or not key_in_rig:
        allowed = f"{nearest(stage, rigs)}allowed: {', '.join(rigs)}, a dot, a key of a sheet"
        raise InputError("", "key", key, allowed)
    rig = Sheet.of("rigs", rigs[stage])
    part, _, inner_key = key_in_rig.partition(".")
    named = rig.document.get(part)
    return (
        (Sheet.of("instruments", named), inner_key)
        if inner_key and isinstance(named, str)
        else (rig, key_in_rig)
    )


def settings_text(call: str, arguments: Mapping[str, Any], *, sealed: bool) -> str:
    """Return the arguments of a call as the TOML text of a settings file, for ``--config``.

    The text begins with `call`, as a comment. Arguments that are None, and those in `OMITTED`, are
    left out. Of an absolute path only the name is written, because the folder may be handed on. An
    argument that a file cannot contain (a sheet with changed values, an array, a function) is
    only described in a comment.

    If `sealed` is True, seed, faults and changed instruments are omitted, because they would reveal
    the truth. A comment says so, whether they were stated or not.
    """
    settings, changed = {}, [f"# {call}\n", *([LEFT_OUT] if sealed else [])]
    for key, value in arguments.items():
        if value is not None and key not in OMITTED and not (sealed and key in REVEALING):
            listed = isinstance(value, list | tuple)
            values = [_setting(each) for each in (value if listed else [value])]
            if None in values:
                changed.append(f"# {key}: {_description(value)}\n")
            else:
                settings[key] = values if listed else values[0]
    return "".join(changed) + toml_text(settings)


def _description(value: Any) -> str:
    """Return a description of an argument that a file cannot contain."""
    values = value if isinstance(value, list | tuple) else [value]
    sheets = any(isinstance(each, Sheet) for each in values)
    return "sheets with changed values" if sheets else f"{type(values[0]).__name__} of the program"


def _setting(value: Any) -> Any:
    """Return an argument as a value of a file; None if a file cannot contain it."""
    if isinstance(value, Sheet):
        if value.origin.endswith(".toml"):
            return f"{value.name}={_unrooted(value.origin)}"
        has_file = value.name in _titles(value.kind) or value.name.endswith(".toml")
        same = has_file and value == Sheet.of(value.kind, value.name)
        return _unrooted(value.name) if same else None
    if isinstance(value, Path) or (isinstance(value, str) and value.endswith(".toml")):
        return _unrooted(value)
    value = value if getattr(value, "ndim", 0) else _plain(value)
    return value if isinstance(value, str | bool | int | float) else None


def _unrooted(path: str | Path) -> str:
    """Return a relative path unchanged, and of an absolute one the name."""
    return Path(path).name if Path(path).is_absolute() else str(path)


def toml_text(document: Mapping[str, Any]) -> str:
    """Return a sheet, or another nested mapping, as TOML text.

    Raises `InputError` for a value that TOML cannot hold, such as None.
    """
    return "\n".join(_lines(document, "")) + "\n"


def document_text(document: str | Path | Mapping[str, Any], name: str) -> tuple[str, str]:
    """Return a document as TOML text, and its place in messages.

    The document is a file, or its keys and values. The place of the latter is `name`.
    """
    if isinstance(document, Mapping):
        return toml_text(document), name
    return read_text(Path(document)), str(document)


def _lines(table: Mapping[str, Any], prefix: str) -> list[str]:
    plain = {key: value for key, value in table.items() if not _is_table(value)}
    lines = [f"{key} = {_inline(value)}" for key, value in plain.items()]
    for key, value in table.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict) and key not in plain:
            lines += ["", f"[{name}]", *_lines(value, f"{name}.")]
        elif key not in plain:
            for item in value:
                lines += ["", f"[[{name}]]", *_lines(item, f"{name}.")]
    return lines


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_inline(each)}' for key, each in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    if isinstance(value, float):
        return repr(value)  # also nan and inf, which the reader of the file rejects
    if isinstance(value, datetime.date):
        return value.isoformat()
    try:
        if value is None:
            raise TypeError
        return json.dumps(value, ensure_ascii=False)  # JSON and TOML write strings and bools alike
    except (TypeError, ValueError) as fault:  # ValueError: a number of thousands of digits
        allowed = (
            "cannot be written in a sheet; allowed: strings, files, numbers, bools, lists, tables"
        )
        raise InputError("", "value", value, allowed) from fault


def _is_number(value: Any) -> bool:
    return isinstance(value, dict) and {"value", "unit"} <= value.keys()


def _is_table(value: Any) -> bool:
    """Return whether a value needs separate lines: a table that is not a quantity, or tables."""
    if isinstance(value, dict):
        return not _is_number(value)
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict)


def _flatten(changes: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values within nested tables, with dotted keys."""
    for key, value in changes.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _in_name(value: Any) -> str:
    """Return a new value as part of a name, with characters that are allowed in file names."""
    if _is_list(value):
        return " ".join(_in_name(each) for each in value)
    text = "none" if value is None else str(_plain(value))
    return UNFIT.sub("_", re.sub(r"(?<=\w)/(?=\w)", " per ", text)).strip()


def _is_list(value: Any) -> bool:
    return not isinstance(value, str) and hasattr(value, "__iter__")


def _plain(value: Any) -> Any:
    """Return a number of any type as a Python number."""
    return value.item() if hasattr(value, "item") else value
