"""TOML files into specs, and every number's provenance beside them.

A catalog name (``r161``) is looked up in the shipped ``data``; anything that ends in
``.toml`` is a user's own file. Both go through the same reader, so both are checked alike.
"""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar, cast

from virtual_lab.catalog.specs import (
    BatSpec,
    BatSport,
    BatSpread,
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

DATA = Path(str(files("virtual_lab.data")))
KINDS = ("bats", "balls", "procedures", "instruments", "rigs", "conditions", "faults")
T = TypeVar("T")
Key = tuple[str, str]  # kind and name of an entry


@dataclass(frozen=True, slots=True)
class Datum:
    """One number of a file as written there, with where it comes from."""

    key: str
    value: Any
    unit: str
    source: str
    verified: bool
    note: str = ""


@dataclass(frozen=True, slots=True)
class SheetsInPlace:
    """Texts that stand in the place of files, and the keys of all entries read meanwhile."""

    texts: Mapping[Key, str]
    used: set[Key]


_in_place: ContextVar[SheetsInPlace | None] = ContextVar("in_place", default=None)


@dataclass(frozen=True, slots=True)
class Entry(Generic[T]):
    """A spec with the file text it came from and the provenance of its numbers."""

    spec: T
    text: str
    sheet: tuple[Datum, ...]


def require_kind(kind: str) -> None:
    """Refuse a kind that the catalog does not have."""
    if kind not in KINDS:
        raise InputError("", "kind", kind, f"{nearest(kind, KINDS)}known: {', '.join(KINDS)}")


@lru_cache
def names(kind: str) -> tuple[str, ...]:
    """Return the names the shipped catalog holds of one kind, sorted."""
    return tuple(sorted(path.stem for path in (DATA / kind).glob("*.toml")))


def title(kind: str, name: str) -> str:
    """Return the title line of a catalog file."""
    text, where = source(kind, name)
    document = parse_toml(text, where)
    if "title" not in document:
        raise InputError(where, "title", None, "this key is missing")
    return str(document["title"])


def find(kind: str, name: str) -> Path:
    """Return the file of a catalog name, or the user's own file where `name` ends in .toml.

    Raises `InputError` with the nearest names where there is no such file.
    """
    if name.endswith(".toml"):
        if not os.path.isfile(name):  # and no name that is too long for one
            raise InputError("", f"{Path(kind).name.removesuffix('s')} file", name, "no such file")
        return Path(name)
    known = names(kind)
    if name not in known:
        others = [other for other in KINDS if name in names(other)]
        hint = f"{name} is among the {others[0]}; " if others else nearest(name, known)
        allowed = f"{hint}known: {', '.join(known)}, or a .toml file"
        raise InputError("", Path(kind).name.removesuffix("s"), name, allowed)
    return DATA / kind / f"{name}.toml"


def sheet(kind: str, name: str) -> tuple[dict[str, Any], tuple[Datum, ...]]:
    """Return a file as it was parsed, and its numbers with their provenance."""
    document = parse_toml(*source(kind, name))
    numbers = load_bat(name).sheet if kind == "bats" else tuple(datums(document))
    return document, numbers


def unverified(kind: str, name: str) -> dict[str, str]:
    """Return, for a catalog entry and what it names in turn, how many numbers are unverified.

    A rig names its instruments; the result reads ``{"rigs/astm-pivot": "4 of 5", …}``.
    """
    document, numbers = sheet(kind, name)
    doubtful = sum(not datum.verified for datum in numbers)
    found = {f"{kind}/{name}": f"{doubtful} of {len(numbers)}"} if doubtful else {}
    instruments = names("instruments") if kind == "rigs" else ()
    for part in document.values():
        if part in instruments:
            found |= unverified("instruments", part)
    return found


def text(kind: str, name: str) -> str:
    """Return the text of a catalog entry's (or user's own) file."""
    return source(kind, name)[0]


def load(kind: str, name: str, spec: type[T]) -> Entry[T]:
    """Return the catalog entry (or user's file) `name`, read as `spec`."""
    return read(*source(kind, name), spec)


def read(text: str, where: str, spec: type[T]) -> Entry[T]:
    """Return the entry that TOML `text` holds; `where` names the file in errors."""
    return cast("Entry[T]", _read(text, where, cast("Hashable", spec)))


@lru_cache(maxsize=64)
def _read(text: str, where: str, spec: Hashable) -> Any:
    """Read a text once: a test reads its rules after every round."""
    document = parse_toml(text, where)
    return Entry(validate(document, where, cast("type", spec)), text, tuple(datums(document)))


def load_bat(name: str) -> Entry[BatSpec]:
    """Return a bat, either drawn in full or as a modification of another (``base = "…"``)."""
    return read_bat(*source("bats", name))


def read_bat(text: str, where: str) -> Entry[BatSpec]:
    """Return the bat that TOML `text` describes, resolving ``base`` in the catalog.

    A plain number may stand for the table of `wall_factor`; its source is then ``not stated``.
    """
    document = parse_toml(text, where)
    if "base" not in document:
        return Entry(validate(document, where, BatSpec), text, tuple(datums(document)))
    factor = document.get("wall_factor")
    if isinstance(factor, int | float):
        plain = {"value": factor, "unit": "1", "source": "not stated", "verified": False}
        document = {**document, "wall_factor": plain}
    change = validate(document, where, ModifiedBat)
    if change.base not in names("bats"):
        hint = nearest(change.base, names("bats"))
        raise InputError(where, "base", change.base, f"{hint}known: {', '.join(names('bats'))}")
    base = load_bat(change.base)
    own = {datum.key for datum in datums(document)}
    inherited = (datum for datum in base.sheet if not _replaced(datum.key, change, own))
    return Entry(_modified(base.spec, change, where), text, (*datums(document), *inherited))


@dataclass(frozen=True, slots=True, kw_only=True)
class ModifiedBat(Spec):
    """A bat made from another: thinner or thicker wall, weights added, hoop mode retuned.

    Without a `hoop` of its own the hoop mode of the base follows the wall, see
    `BatBody.with_wall`; without a `sport` the bat is of the base's.
    """

    name: Name
    title: Title
    base: str
    sport: BatSport | None = None
    wall_factor: Annotated[float | None, Dimension("number", 0.2, 5)] = None
    lumps: tuple[Lump, ...] = ()
    hoop: HoopMode | None = None
    spread: BatSpread | None = None
    published: PublishedBat | None = None


def _modified(base: BatSpec, change: ModifiedBat, where: str) -> BatSpec:
    if change.wall_factor is not None and base.body.profile.wall is None:
        allowed = f"none: {change.base} is solid, it has no wall to thin"
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
        published=change.published,
    )


def _replaced(key: str, change: ModifiedBat, own: set[str]) -> bool:
    if key.startswith("published"):
        return True
    if key.startswith("body.hoop"):
        return change.hoop is not None
    return key in own


def source(kind: str, name: str) -> tuple[str, str]:
    """Return an entry's text, and its name in errors: of one that ships, without its folder."""
    given = _in_place.get()
    if given is not None:
        given.used.add((kind, name))
        if (kind, name) in given.texts:
            return given.texts[kind, name], name
    if name in names(kind):
        return _shipped(kind, name), f"{name}.toml"
    path = find(kind, name)
    return read_text(path), path.name if path.is_relative_to(DATA) else str(path)


@cache
def _shipped(kind: str, name: str) -> str:
    """Read a text once: the rigs ask for their instruments in every laboratory."""
    return read_text(find(kind, name))


@contextmanager
def sheets_in_place(texts: Mapping[Key, str]) -> Iterator[Set[Key]]:
    """Let texts stand in the place of files, by kind and name, as long as the context lasts.

    Yields the keys of all entries that are read meanwhile.
    """
    outer = _in_place.get()
    given = SheetsInPlace({**(outer.texts if outer else {}), **texts}, set())
    token = _in_place.set(given)
    try:
        yield given.used
    finally:
        _in_place.reset(token)
        if outer:
            outer.used.update(given.used)


def texts_in_place() -> Mapping[Key, str]:
    """Return the texts that stand in the place of files now."""
    given = _in_place.get()
    return given.texts if given else {}


def require_own_names(key: str, names: Sequence[str]) -> None:
    """Refuse two entries of one name, as tables would take them for one."""
    for name in names:
        if names.count(name) > 1:
            raise InputError("", key, name, "is given twice; each needs its own name")


def datums(document: Any, prefix: str = "") -> Iterator[Datum]:
    """Yield the numbers of a parsed file with their provenance."""
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
