"""Check of a parsed document against a specification, with errors that name key and value."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Any, TypeVar, cast, get_args, get_type_hints

from virtual_lab.errors import InputError, nearest

T = TypeVar("T")
Location = tuple[int | str, ...]  # keys and numbers of items, from the file down to a value
WORDS = {  # plain English for the validator's messages
    "Input should": "must",
    "String should have at least 1 character": "must not be empty",
    "Keys should": "Keys must",
    "Tuple should": "must",
    "a valid dictionary": "a table { key, value }",
    "a valid tuple": "a list",
    " after validation": "",
}


def validate(document: Mapping[str, Any], where: str, spec: type[T]) -> T:
    """Return a parsed document, converted to the class `spec`, with numbers in SI units.

    Raises `InputError` for the first value that does not fit. The message names the file `where`,
    the key and the value. All keys of the same table with the same error are named together, and
    missing keys beside unknown ones.
    """
    from pydantic import ValidationError

    try:
        return cast("T", _adapter(cast("Hashable", spec)).validate_python(document))
    except ValidationError as fault:
        errors = fault.errors(include_url=False)
        # a mistyped key gives two errors: one key is unknown, and one is missing
        unknown = [each for each in errors if each["type"] == "unexpected_keyword_argument"]
        error = (unknown or errors)[0]
        table = error["loc"][:-1]
        beside = [each for each in errors if each["loc"][:-1] == table]
        missing = [str(each["loc"][-1]) for each in beside if each["type"] == "missing"]
        places = [each["loc"] for each in beside if each["msg"] == error["msg"]]
        value = None
        if unknown:
            message = _unknown_keys(places, missing, _keys(spec, table))
        elif error["type"] == "missing":
            message = f"{'this key is' if len(missing) == 1 else 'these keys are'} missing"
        else:
            places = _distinct(document, places)
            value = _at(document, places[0]) if len(places) == 1 else None
            message = _unfit_value(error, spec, places[0])
        key = ", ".join(".".join(map(str, place)) for place in places)
        raise InputError(where, key or "file", value, message) from fault


def _unknown_keys(places: Sequence[Location], missing: list[str], allowed: list[str]) -> str:
    """Return the message about unknown keys of a table, with the keys that it lacks and allows."""
    hint = nearest(places[0][-1], missing) or nearest(places[0][-1], allowed)
    kind = f"unknown key, {hint}" if len(places) == 1 else "unknown keys; "
    lacking = f"missing: {', '.join(missing)}; " if missing else ""
    return f"{kind}{lacking}allowed: {', '.join(allowed)}"


def _unfit_value(error: Mapping[str, Any], spec: Any, place: Location) -> str:
    """Return the message about a value that does not fit, in plain English."""
    if error["type"] == "dataclass_type":
        return f"must be a table {{ {', '.join(_keys(spec, place))} }}"
    message = str(error["msg"]).removeprefix("Value error, ")
    for theirs, ours in WORDS.items():
        message = message.replace(theirs, ours)
    return message


@lru_cache(maxsize=64)
def _adapter(spec: Hashable) -> Any:
    """Return the validator of a specification, cached because it is slow to build."""
    from pydantic import TypeAdapter

    return TypeAdapter(cast("type", spec))


def _keys(spec: Any, location: Location) -> list[str]:
    """Return the keys allowed at a location, found by following the annotations of the specs."""
    for part in location:
        if is_dataclass(spec):
            spec = get_type_hints(spec)[str(part)]
        else:  # mapping by names, or sequence
            spec = get_args(spec)[-1 if isinstance(part, str) else 0]
        if type(None) in get_args(spec):
            spec = get_args(spec)[0]
    return [field.name for field in fields(spec)]


def _distinct(document: Any, locations: Sequence[Location]) -> list[Location]:
    """Return the places of errors in the document; only the first one for items of a list."""
    places = [*dict.fromkeys(_place(document, each) for each in locations)]
    return places[:1] if places[0] and isinstance(places[0][-1], int) else places


def _place(document: Any, location: Location) -> Location:
    """Return the location of an error in the document, without parts that the validator added."""
    for depth, part in enumerate(location):
        try:
            document = document[part]
        except (KeyError, IndexError, TypeError):
            return location[:depth]
    return location


def _at(document: Any, location: Location) -> Any:
    """Return the entry at the location of an error, with number and unit as written in the file."""
    for part in location:
        document = document[part]
    if not isinstance(document, Mapping):
        return document
    value, unit = document.get("value"), document.get("unit", "")
    return None if value is None else f"{value} {unit}".strip()
