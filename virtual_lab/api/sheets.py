"""Catalog entries (sheets) as objects: read them, or change values for a call.

A changed sheet keeps source and verification of every unchanged number; a changed number has the
source ``changed`` and is not verified. The title of the sheet lists the changes.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass
from functools import cached_property, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from virtual_lab.errors import InputError, nearest
from virtual_lab.files import parse_toml

if TYPE_CHECKING:
    import pandas as pd

T = TypeVar("T")
NAMED = ("bats", "balls", "procedures")  # kinds whose changed sheets take another name
NUMBER = re.compile(r"\s*([-+.\d][-+.\deE]*)\s+(\S.*?)\s*")  # a number and its unit
LONGEST_TITLE = 200


@dataclass(frozen=True, repr=False)
class Sheet:
    """A sheet of the catalog, or of a user's file.

    `kind` is ``bats``, ``balls``, ``procedures``, ``instruments``, ``rigs``, …; `name` its name
    or path; `text` the TOML.
    """

    kind: str
    name: str
    text: str

    @classmethod
    def of(cls, kind: str, name: str | Path) -> Sheet:
        """Return the sheet of a catalog name or a .toml file; `InputError` if there is none."""
        from virtual_lab import catalog

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
    def numbers(self) -> pd.DataFrame:
        """One row per number: key, value, unit, source, verified, note."""
        import pandas as pd

        from virtual_lab import catalog

        return pd.DataFrame([asdict(each) for each in catalog.datums(self.document)])

    @property
    def spec(self) -> Any:
        """The frozen dataclass of a bat, a ball or a procedure: its numbers as SI floats."""
        if self.kind not in NAMED:
            raise InputError("", "spec", self.name, "allowed: of bats, balls and procedures")
        return self._entry(self.name).spec

    def with_(self, changes: Mapping[str, Any] | None = None, /, **named: Any) -> Sheet:
        """Return the sheet with other values.

        Parameters
        ----------
        changes, named
            New values by key; a key within a table has a dot, ``{"windows.rebound_angle": 5}``.
            A number, or a list of numbers, is in the unit of the sheet; a text ``"5 deg"`` may
            have another unit of the same quantity. None removes an optional key.

        Raises
        ------
        InputError
            An unknown key, a value that is not allowed, a unit of another quantity.
        """
        every = {**(changes or {}), **named}
        document = deepcopy(self.document)
        for key, value in every.items():
            self._set(document, key.split("."), key, value)
        name = self.name
        if self.kind in NAMED:
            if "name" not in every:
                own = str(document.get("name", Path(name).stem))
                document["name"] = own if own.endswith("-changed") else f"{own}-changed"
            name = str(document["name"])
        if "title" not in every:
            title = f"{document['title']}; changed: {', '.join(every)}"
            document["title"] = title[:LONGEST_TITLE]
        changed = Sheet(self.kind, name, toml_text(document))
        changed._check(name)
        return changed

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
                raise self._unknown(document, table, key)
            document = inner
        old = document.get(last)
        if old is None and self.kind not in NAMED:
            raise self._unknown(document, last, key)
        if value is None:
            if old is None:
                raise self._unknown(document, last, key)
            del document[last]
        elif isinstance(value, Mapping):
            inner = document.setdefault(last, {})
            for name, each in value.items():
                self._set(inner, [name], f"{key}.{name}", each)
        else:
            document[last] = self._written(old, key, value)

    def _written(self, old: Any, key: str, value: Any) -> Any:
        """Return a value in the form of a file."""
        known = {"source": "changed", "verified": False}
        if isinstance(value, bool) or (isinstance(value, str) and isinstance(old, str)):
            return value
        number = NUMBER.fullmatch(value) if isinstance(value, str) else None
        if number:
            try:
                return {"value": float(number[1]), "unit": number[2], **known}
            except ValueError:
                pass
        if isinstance(value, str):
            if _is_number(old):
                allowed = f"allowed: a number in {old['unit']}, or with its unit: '5 {old['unit']}'"
                raise InputError(self.name, key, value, allowed)
            return value
        plain = [_plain(each) for each in value] if _is_list(value) else _plain(value)
        return {"value": plain, "unit": old["unit"] if _is_number(old) else "1", **known}

    def _unknown(self, document: Mapping[str, Any], name: str, key: str) -> InputError:
        known = [each for each in document if each not in ("name", "title", "kind")]
        allowed = f"unknown key, {nearest(name, known)}known here: {', '.join(known)}"
        return InputError(self.name, key, None, allowed)

    def _check(self, where: str) -> None:
        """Refuse an unusable sheet; sheets of instruments are checked at their use."""
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


def with_sheets(function: Callable[..., T]) -> Callable[..., T]:
    """Return a function that accepts sheets and paths instead of names.

    It also accepts `instruments`: sheets of instruments and rigs with changed values, which
    replace those of the catalog.
    """

    @wraps(function)
    def called(*given: Any, instruments: Sequence[Sheet] = (), **named: Any) -> T:
        from virtual_lab import catalog

        found: dict[tuple[str, str], str] = {}
        for each in instruments:
            if not isinstance(each, Sheet):
                allowed = "allowed: sheets, such as vl.instrument('pivot-gates').with_(tick='2 us')"
                raise InputError("", "instruments", each, allowed)
            found[each.kind, each.name] = each.text
        names = [_named(value, found) for value in given]
        keys = {key: _named(value, found) for key, value in named.items()}
        with catalog.sheets_in_place(found):
            return function(*names, **keys)

    signature = inspect.signature(function)
    extra = inspect.Parameter(
        "instruments", inspect.Parameter.KEYWORD_ONLY, default=(), annotation="Sequence[Sheet]"
    )
    parameters = [*signature.parameters.values(), extra]
    cast("Any", called).__signature__ = signature.replace(parameters=parameters)
    return called


def _named(value: Any, found: dict[tuple[str, str], str]) -> Any:
    """Return the name of a sheet (its text is stored) or path, or the names of a list."""
    if isinstance(value, Sheet):
        found[value.kind, value.name] = value.text
        return value.name
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, list | tuple):
        return type(value)(_named(each, found) for each in value)
    return value


def toml_text(document: Mapping[str, Any]) -> str:
    """Return a sheet as TOML."""
    return "\n".join(_lines(document, "")) + "\n"


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
        return repr(value)  # nan and inf too, which are refused where they are read
    return json.dumps(value, ensure_ascii=False)  # its texts, numbers and truths are TOML's


def _is_number(value: Any) -> bool:
    return isinstance(value, dict) and "value" in value


def _is_table(value: Any) -> bool:
    """Return whether a value needs separate lines: a table that is no number, or tables."""
    if isinstance(value, dict):
        return not _is_number(value)
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict)


def _is_list(value: Any) -> bool:
    return not isinstance(value, str) and hasattr(value, "__iter__")


def _plain(value: Any) -> Any:
    """Return a number of any type as a Python number."""
    return value.item() if hasattr(value, "item") else value
