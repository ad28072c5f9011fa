"""Reading of TOML files into specifications, with the source of each number.

A catalog name (``r161``) refers to the shipped ``data``; a name that ends in ``.toml`` is a file of
the user. One reader serves both, so both are checked in the same way.
"""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar, cast, get_args

from virtual_lab.catalog.specs import (
    BatSpec,
    BatSport,
    BatSpread,
    Construction,
    Dimension,
    HoopMode,
    Lump,
    Name,
    PublishedBat,
    Spec,
    Title,
)
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError, nearest
from virtual_lab.files import parse_toml, read_text
from virtual_lab.parameters import Kind
from virtual_lab.units import convert

PACKAGE = Path(__file__).parents[1]
# folder of the data sheets: in the installed package, or beside it in a clone
DATA = next(path for path in (PACKAGE / "data", PACKAGE.parent / "data") if path.is_dir())
KINDS: tuple[Kind, ...] = get_args(Kind)
LABELS = ("name", "title")  # keys of a sheet whose text is for people
T = TypeVar("T")
Key = tuple[str, str]  # kind and name of an entry


@dataclass(frozen=True, slots=True)
class Datum:
    """One number of a file as written there, with its source."""

    key: str
    value: Any
    unit: str
    source: str
    verified: bool
    note: str = ""

    def in_unit(self, unit: str) -> Any:
        """Return the number, or the list of numbers, in another unit of the same dimension."""
        if isinstance(self.value, list | tuple):
            return tuple(convert(each, self.unit, unit) for each in self.value)
        return convert(self.value, self.unit, unit)


@dataclass(frozen=True, slots=True)
class SheetsInPlace:
    """Texts that replace files, and the keys of all entries read in the meantime."""

    texts: Mapping[Key, str]
    used: set[Key]
    laboratory: str = ""  # folder of the laboratory; "": rigs of the catalog may be used, too


_in_place: ContextVar[SheetsInPlace | None] = ContextVar("in_place", default=None)


@dataclass(frozen=True, slots=True)
class Entry(Generic[T]):
    """A specification with the text of its file and the sources of its numbers."""

    spec: T
    text: str
    sheet: tuple[Datum, ...]


def require_kind(kind: str) -> None:
    """Raise `InputError` if the catalog has no such kind of entry.

    The kinds are those in `KINDS`, such as "bats".
    """
    if kind not in KINDS:
        raise InputError("", "kind", kind, f"{nearest(kind, KINDS)}allowed: {', '.join(KINDS)}")


@lru_cache
def names(kind: str) -> tuple[str, ...]:
    """Return the names of all entries of a kind in the shipped catalog, sorted.

    The names are without ``.toml``. The tuple is empty for an unknown kind.
    """
    return tuple(sorted(path.stem for path in (DATA / kind).glob("*.toml")))


def has(kind: str, name: str) -> bool:
    """Return whether the catalog has an entry, or one is in place of its files."""
    return name in names(kind) or (kind, name) in texts_in_place()


def title(kind: str, name: str) -> str:
    """Return the `title` of a catalog entry, or of the user's file if `name` ends in .toml.

    Raises `InputError` if there is no such entry or file, or if it is not TOML or has no title.
    """
    text, where = source(kind, name)
    document = parse_toml(text, where)
    if "title" not in document:
        raise InputError(where, "title", None, "this key is missing")
    return str(document["title"])


def find(kind: str, name: str) -> Path:
    """Return the path of a catalog entry's file, or of the user's file if `name` ends in .toml.

    Raises `InputError` if there is no such file or kind. For a name that does not end in .toml, the
    message suggests similar names.
    """
    if name.endswith(".toml"):
        if not os.path.isfile(name):  # False also for a name that is too long
            raise InputError("", f"{Path(kind).name.removesuffix('s')} file", name, "no such file")
        return Path(name)
    allowed_names = names(kind)
    if not allowed_names:
        require_kind(kind)
    if name not in allowed_names:
        others = [other for other in KINDS if name in names(other)]
        hint = f"{name} is among the {others[0]}; " if others else nearest(name, allowed_names)
        hint += "a procedure names its ball, or the file of one; " if others == ["balls"] else ""
        allowed = f"{hint}allowed: {', '.join(allowed_names)}, or a .toml file"
        raise InputError("", Path(kind).name.removesuffix("s"), name, allowed)
    return DATA / kind / f"{name}.toml"


def sheet(kind: str, name: str) -> tuple[dict[str, Any], tuple[Datum, ...]]:
    """Return the content of a catalog entry's file, and its numbers with their sources.

    The first result is a mapping with values and units as written in the file. The second result
    has one `Datum` per number.

    The file of a bat may state only the changes of a base bat. In this case, the mapping has only
    these changes. The second result also has the unchanged numbers of the base bat.

    Raises `InputError` for an unknown entry, for a file that is not TOML, and for an invalid bat.
    Raises `KeyError` for a number without ``source`` or ``verified``.
    """
    text, where = source(kind, name)
    numbers = load_bat(name).sheet if kind == "bats" else _numbers(text, where)
    return _parse(text, where), numbers


def rig_instruments(rig: str) -> dict[str, str]:
    """Return the names of the instruments of a rig, keyed by part, such as ``gates``.

    The mapping is empty for a rig without a data sheet: another package supplies it. Raises
    `InputError` for a sheet that is not TOML.
    """
    if not has("rigs", rig):
        return {}
    document = _parse(*source("rigs", rig))
    return {
        part: name
        for part, name in document.items()
        if part not in LABELS and isinstance(name, str) and has("instruments", name)
    }


def count_unverified(kind: str, name: str) -> dict[str, str]:
    """Return the numbers of unverified values of a catalog entry and of a rig's instruments.

    The result has one item per sheet, in the form ``{"rigs/astm-pivot": "4 of 5", …}``. Here 4 of 5
    values are unverified. A sheet without unverified values is left out. Raises the errors of
    `sheet`.
    """
    numbers = sheet(kind, name)[1]
    doubtful = sum(not datum.verified for datum in numbers)
    counts = {f"{kind}/{name}": f"{doubtful} of {len(numbers)}"} if doubtful else {}
    for instrument in rig_instruments(name).values() if kind == "rigs" else ():
        counts |= count_unverified("instruments", instrument)
    return counts


def text(kind: str, name: str) -> str:
    """Return the text of a catalog entry's file, or of the user's file if `name` ends in .toml.

    If `sheets_in_place` replaces the entry, its replacement text is returned. Raises `InputError`
    if there is no such file, or if it is not UTF-8 or larger than 20 MB.
    """
    return source(kind, name)[0]


def load(kind: str, name: str, spec: type[T]) -> Entry[T]:
    """Return an entry of the catalog, or the user's file if `name` ends in .toml.

    The content is converted to the class `spec`, with numbers in SI units. Raises `InputError` if
    there is no such file, or if its content does not fit `spec`.
    """
    return read(*source(kind, name), spec)


def read(text: str, where: str, spec: type[T]) -> Entry[T]:
    """Return the entry that a TOML `text` describes, converted to the class `spec`.

    Numbers are converted to SI units. `where` is the name of the file in error messages. Raises
    `InputError` for a string that is not TOML or does not fit `spec`. The last 64 results are
    cached: the same arguments then return the same object.
    """
    return cast("Entry[T]", _read(text, where, cast("Hashable", spec)))


@lru_cache(maxsize=64)
def _read(text: str, where: str, spec: Hashable) -> Any:
    """Return the entry in a TOML string, cached because a test reads its rules every round."""
    spec_read: Any = validate(_parse(text, where), where, cast("type", spec))
    return Entry(spec_read, text, _numbers(text, where))


@lru_cache(maxsize=128)
def _parse(text: str, where: str) -> dict[str, Any]:
    """Return the content of a TOML text. It is cached, so callers must not change it."""
    return parse_toml(text, where)


@lru_cache(maxsize=128)
def _numbers(text: str, where: str) -> tuple[Datum, ...]:
    return tuple(datums(_parse(text, where)))


def load_bat(name: str) -> Entry[BatSpec]:
    """Return a bat of the catalog, or of the user's file if `name` ends in .toml.

    Numbers are in SI units. The file describes a complete bat, or a modification of a catalog bat
    (``base = "…"``). Raises `InputError` if there is no such file, if it is not a valid bat, or if
    its base is not in the catalog.
    """
    return read_bat(*source("bats", name))


def read_bat(text: str, where: str) -> Entry[BatSpec]:
    """Return the bat that a TOML `text` describes, with numbers in SI units.

    A text with the key ``base`` describes a modified bat. ``base`` is the name of a bat in the
    catalog, and the text states only the values that differ from this bat. In such a text
    `wall_factor` can be a plain number instead of a table. Its source is then ``not stated``.
    `where` is the name of the file in error messages. Raises `InputError` for an invalid text and
    for an unknown base.
    """
    document = _parse(text, where)
    if "template" in document:
        allowed = "a file of measurements, of which fit-bat makes a bat; allowed: a bat"
        raise InputError(where, "template", document["template"], allowed)
    if "base" not in document:
        return Entry(validate(document, where, BatSpec), text, _numbers(text, where))
    factor = document.get("wall_factor")
    if isinstance(factor, int | float):
        plain = {"value": factor, "unit": "1", "source": "not stated", "verified": False}
        document = {**document, "wall_factor": plain}
    change = validate(document, where, ModifiedBat)
    if change.base not in names("bats"):
        hint = nearest(change.base, names("bats"))
        raise InputError(where, "base", change.base, f"{hint}allowed: {', '.join(names('bats'))}")
    base = load_bat(change.base)
    numbers = tuple(datums(document))
    changed = {datum.key for datum in numbers}
    inherited = (datum for datum in base.sheet if not _is_replaced(datum.key, change, changed))
    return Entry(_modify(base.spec, change, where), text, (*numbers, *inherited))


@dataclass(frozen=True, slots=True, kw_only=True)
class ModifiedBat(Spec):
    """A modification of a catalog bat: other wall thickness, added weights, or other hoop mode.

    Without `hoop` the hoop mode of the base is adapted to the wall thickness (see
    `BatBody.with_wall`). Without `sport` the bat has the sport of its base, and without
    `construction` its construction.
    """

    name: Name
    title: Title
    base: str
    sport: BatSport | None = None
    construction: Construction | None = None
    wall_factor: Annotated[float | None, Dimension("number", 0.2, 5)] = None
    lumps: tuple[Lump, ...] = ()
    hoop: HoopMode | None = None
    spread: BatSpread | None = None
    published: PublishedBat | None = None


def _modify(base: BatSpec, change: ModifiedBat, where: str) -> BatSpec:
    if change.wall_factor is not None and base.body.profile.wall is None:
        allowed = f"leave it out: {change.base} is solid and has no wall"
        raise InputError(where, "wall_factor", f"{change.wall_factor:g}", allowed)
    try:
        body = base.body.with_wall(1.0 if change.wall_factor is None else change.wall_factor)
        body = replace(body, lumps=(*body.lumps, *change.lumps), hoop=change.hoop or body.hoop)
    except ValueError as fault:
        raise InputError(where, "wall_factor, lumps", None, str(fault)) from fault
    return BatSpec(
        name=change.name,
        title=change.title,
        body=body,
        spread=change.spread or base.spread,
        sport=change.sport or base.sport,
        construction=change.construction or base.construction,
        published=change.published,
    )


def _is_replaced(key: str, change: ModifiedBat, changed: set[str]) -> bool:
    if key.startswith("published"):
        return True
    if key.startswith("body.hoop"):
        return change.hoop is not None
    return key in changed


def source(kind: str, name: str) -> tuple[str, str]:
    """Return the text of an entry, and the name of its file for error messages.

    The second result is the file name for an entry of the catalog, and the path for a user's file.
    If the entry is replaced by `sheets_in_place`, the replacement text and `name` are returned.
    Raises `InputError` for a rig that the laboratory in place does not have.
    Raises `InputError` if there is no such file, or if it is not UTF-8 or larger than 20 MB.
    """
    in_place = _in_place.get()
    if in_place is not None:
        in_place.used.add((kind, name))
        if (kind, name) in in_place.texts:
            return in_place.texts[kind, name], name
        if kind == "rigs" and in_place.laboratory:
            ours = [each for of, each in in_place.texts if of == kind]
            allowed = f"not in this laboratory; allowed: {', '.join(ours) or 'no rig'}"
            raise InputError(in_place.laboratory, "rig", name, allowed)
    if name in names(kind):
        return _shipped_text(kind, name), f"{name}.toml"
    path = find(kind, name)
    return read_text(path), path.name if path.is_relative_to(DATA) else str(path)


@cache
def _shipped_text(kind: str, name: str) -> str:
    """Return the text of a shipped file, cached because each laboratory reads its instruments."""
    return read_text(find(kind, name))


def is_shipped(kind: str, name: str, text: str) -> bool:
    """Return whether `text` is that of the catalog's own file, whatever replaces it at present."""
    return name in names(kind) and _shipped_text(kind, name) == text


@contextmanager
def sheets_in_place(texts: Mapping[Key, str], laboratory: str = "") -> Iterator[Set[Key]]:
    """Replace files of the catalog by `texts` within the context.

    The keys of `texts` are (kind, name). The context yields a set with the keys of all entries read
    within it. The set grows with each entry that is read. Contexts can be nested. An inner text
    then replaces an outer text with the same key.

    `laboratory` is the folder of a laboratory that has only the rigs of `texts`. Within the context
    the sheet of another rig raises `InputError`.
    """
    outer = _in_place.get()
    before = outer or SheetsInPlace({}, set())
    laboratory = laboratory or before.laboratory
    in_place = SheetsInPlace({**before.texts, **texts}, set(), laboratory)
    token = _in_place.set(in_place)
    try:
        yield in_place.used
    finally:
        _in_place.reset(token)
        if outer:
            outer.used.update(in_place.used)


def texts_of(sheets: Mapping[str, str]) -> dict[Key, str]:
    """Return texts of sheets keyed by kind and name, given those keyed by ``KIND/NAME``."""
    parts = ((*key.partition("/"), text) for key, text in sheets.items())
    return {(kind, name): text for kind, _, name, text in parts}


def texts_in_place() -> Mapping[Key, str]:
    """Return the texts that replace catalog files in the current context, keyed by (kind, name).

    The mapping is empty outside `sheets_in_place`.
    """
    in_place = _in_place.get()
    return in_place.texts if in_place else {}


def require_own_names(key: str, names: Sequence[str]) -> None:
    """Raise `InputError` if two of `names` are equal, because tables could not distinguish them.

    `key` is the name of the argument in the error message.
    """
    for name in names:
        if names.count(name) > 1:
            raise InputError("", key, name, "is given twice; allowed: different names")


def datums(document: Any, prefix: str = "") -> Iterator[Datum]:
    """Yield each number of a parsed file with its unit and source, in the order of the file.

    Values and units are those written in the file. The key of a number is its path, such as
    ``body.lumps.knob.mass``. An item of a list is named in the path by its ``name``, or by its
    index if it has no name. Values without a unit are skipped. `prefix` is put before each key.
    Raises `KeyError` for a number without ``source`` or ``verified``.
    """
    if isinstance(document, Mapping):
        if "value" in document and "unit" in document:
            yield Datum(
                prefix,
                document["value"],
                document["unit"],
                document["source"],
                document["verified"],
                document.get("note", ""),
            )
            return
        for key, item in document.items():
            yield from datums(item, f"{prefix}.{key}" if prefix else key)
    elif isinstance(document, list):
        for index, item in enumerate(document):
            label = item.get("name", index) if isinstance(item, Mapping) else index
            yield from datums(item, f"{prefix}.{label}")
