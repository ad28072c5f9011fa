"""Check of a parsed document against a specification, with errors that name key and value."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Any, TypeVar, cast, get_args, get_type_hints

from virtual_lab.errors import InputError, nearest

T = TypeVar("T")
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
        table, is_missing = error["loc"][:-1], error["type"] == "missing"
        beside = [each for each in errors if each["loc"][:-1] == table]
        missing = [str(each["loc"][-1]) for each in beside if each["type"] == "missing"]
        places = [each["loc"] for each in beside if each["msg"] == error["msg"]]
        if not is_missing:
            places = [*dict.fromkeys(_place(document, each) for each in places)]
        if any(isinstance(name, int) for name in places[0][-1:]):  # one of many items of a list
            places = places[:1]
        key = ", ".join(".".join(map(str, place)) for place in places)
        value = None if is_missing or len(places) > 1 else _at(document, places[0])
        message = error["msg"].removeprefix("Value error, ")
        for theirs, ours in WORDS.items():
            message = message.replace(theirs, ours)
        if error["type"] == "dataclass_type":
            message = f"must be a table {{ {', '.join(_keys(spec, places[0]))} }}"
        if is_missing:
            message = f"{'this key is' if len(missing) == 1 else 'these keys are'} missing"
        if unknown:
            keys = _keys(spec, table)
            hint = nearest(places[0][-1], missing) or nearest(places[0][-1], keys)
            kind = f"unknown key, {hint}" if len(places) == 1 else "unknown keys; "
            others = f"missing: {', '.join(missing)}; " if missing else ""
            value, message = None, f"{kind}{others}allowed: {', '.join(keys)}"
        raise InputError(where, key or "file", value, message) from fault


@lru_cache(maxsize=64)
def _adapter(spec: Hashable) -> Any:
    """Return the validator of a specification, cached because it is slow to build."""
    from pydantic import TypeAdapter

    return TypeAdapter(cast("type", spec))


def _keys(spec: Any, location: tuple[int | str, ...]) -> list[str]:
    """Return the keys allowed at a location, found by following the annotations of the specs."""
    for part in location:
        if is_dataclass(spec):
            spec = get_type_hints(spec)[str(part)]
        else:  # mapping by names, or sequence
            spec = get_args(spec)[-1 if isinstance(part, str) else 0]
        if type(None) in get_args(spec):
            spec = get_args(spec)[0]
    return [field.name for field in fields(spec)]


def _place(document: Any, location: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Return the location of an error in the document, without parts that the validator added."""
    for depth, part in enumerate(location):
        try:
            document = document[part]
        except (KeyError, IndexError, TypeError):
            return location[:depth]
    return location


def _at(document: Any, location: tuple[int | str, ...]) -> Any:
    """Return the entry at the location of an error, with number and unit as written in the file."""
    for part in location:
        document = document[part]
    if isinstance(document, Mapping):
        return (
            f"{document['value']} {document.get('unit', '')}".strip()
            if "value" in document
            else None
        )
    return document
