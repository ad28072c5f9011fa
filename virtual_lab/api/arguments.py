"""The door of every public function: its arguments are read here, by their names.

One table says what each argument may be. A sheet takes the place of a name: its text is put in the
place of the catalog's file as long as the function runs.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import partial, wraps
from math import isnan
from operator import index
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from virtual_lab.errors import InputError, nearest
from virtual_lab.output.progress import show_progress
from virtual_lab.sheets import NAMED, Sheet

P = ParamSpec("P")
T = TypeVar("T")
LABORATORIES = "instruments"  # the argument that changes the laboratory itself
Store = dict[tuple[str, str], str]  # the texts of sheets, by kind and name


@dataclass(frozen=True, slots=True)
class ArgumentRule:
    """A rule for the values of an argument: the function that reads it, and the words for an error.

    `read` returns the value in the form that the function takes, and puts sheets into the store.
    It raises `TypeError` or `ValueError` for a value that is not allowed.
    """

    read: Callable[[Any, Store], Any]
    allowed: str
    several: bool = False  # whether a list is allowed


def _entry(kind: str) -> ArgumentRule:
    """Return the rule of one entry of the catalog: a name, a path or a sheet."""
    one = kind.removesuffix("s")

    def read(value: Any, store: Store) -> str:
        if not isinstance(value, Sheet):
            return _text(value, store)
        if value.kind != kind:
            raise TypeError(value.kind)
        if store.setdefault((kind, value.name), value.text) != value.text:
            way = "with_(name=…) gives one another" if kind in NAMED else "allowed: one of them"
            raise InputError("", kind, value.name, f"two different sheets have this name; {way}")
        return value.name

    where = f"vl.shelf('{kind}')"
    return ArgumentRule(read, f"a {one}: its name ({where}), a .toml file or a sheet, vl.{one}(…)")


def _several(one: ArgumentRule, what: str = "") -> ArgumentRule:
    """Return the rule of one value or a list of them, read as a tuple."""

    def read(value: Any, store: Store) -> tuple[Any, ...]:
        if isinstance(value, Sheet) or not _is_list(value):
            return (one.read(value, store),)
        values = tuple(one.read(each, store) for each in value)
        if not values:
            raise ValueError("empty")
        return values

    return ArgumentRule(read, f"{what or one.allowed}; one, or a list of at least one", True)


def _is_list(value: Any) -> bool:
    """Return whether a value is iterable in an order of its own, and no text or table of keys."""
    other = (str, bytes, Path, Mapping, Set)
    return isinstance(value, Iterable) and not isinstance(value, other)


def _text(value: Any, _store: Store) -> str:
    text = os.fspath(value)
    if not isinstance(text, str):
        raise TypeError(text)
    return text


def _word(value: Any, _store: Store) -> str:
    if not isinstance(value, str):
        raise TypeError(value)
    return value


def _path(value: Any, store: Store) -> Path:
    return Path(_text(value, store))


def _whole(value: Any, _store: Store, least: int = 0, most: int = 2**63 - 1) -> int:
    """Return a whole number from `least` to `most` as a Python int, from any integer type."""
    if isinstance(value, bool):
        raise TypeError(value)
    number = index(value)
    if not least <= number <= most:
        raise ValueError("beyond its limits")
    return number


def _seed(value: Any, store: Store) -> int:
    from virtual_lab.streams import LARGEST_SEED

    return _whole(value, store, most=LARGEST_SEED)


def _number(value: Any, _store: Store) -> float:
    if isinstance(value, bool | str):
        raise TypeError(value)
    return float(value)


def _certain_number(value: Any, store: Store) -> float:
    number = _number(value, store)
    if isnan(number):
        raise ValueError(number)
    return number


def _yes_or_no(value: Any, _store: Store) -> bool:
    if value not in (True, False):
        raise ValueError(value)
    return bool(value)


def _instruments(value: Any, store: Store) -> tuple[Sheet, ...]:
    given = (value,) if isinstance(value, Sheet) else tuple(value)
    for each in given:
        if not isinstance(each, Sheet) or each.kind not in ("instruments", "rigs"):
            raise TypeError(each)
        _entry(each.kind).read(each, store)
    return given


def _callable(value: Any, _store: Store) -> Any:
    if not callable(value):
        raise TypeError(value)
    return value


def _study(value: Any, store: Store) -> Path | dict[str, Any] | None:
    """Return the path of a study, or its keys and values, of which some are arguments too."""
    if value is None or not isinstance(value, Mapping):
        return None if value is None else _path(value, store)
    known = {key: ARGUMENTS[key].read for key in value if key in ARGUMENTS}
    return {key: known[key](each, store) if key in known else each for key, each in value.items()}


BAT, BALL, PROCEDURE = (_entry(kind) for kind in ("bats", "balls", "procedures"))
WORDS = {
    "reality": "real, noise-free or ideal",
    "rung": "rigid, modal or reference",
    "motion": "closed-form or pymunk",
    "correction": "METHOD:E0, such as 'trampoline:0.5'",
    "swing_law": "power or energy",
    "part": "collision, motion, camera, or uncertainty or laboratory of a chart",
    "kind": "bats, balls, procedures, instruments, rigs, conditions or faults",
    "board": "'charuco:14x9:40mm:30mm' or 'chessboard:14x9:40mm'",
    "plane": "the name of a picture",
    "blocks": "a share of the parts: '3/40' for the third fortieth",
    "dask": "the address of a scheduler: 'tcp://HOST:8786'",
    **dict.fromkeys(("height", "height_u", "square_u"), "a length with its unit: '36.5mm'"),
}
PATH = ArgumentRule(_path, "a path")
FOLDER = ArgumentRule(_path, "the path of a folder")
NAME = ArgumentRule(_text, "a name, or a path")
WHOLE = ArgumentRule(_whole, "one whole number from 0")
WHOLES = _several(WHOLE)
SEED = "one whole number from 0 to 2^128 - 1"
NUMBER = ArgumentRule(_number, "a number")
YES_OR_NO = ArgumentRule(_yes_or_no, "True or False")
FAULTS = _several(ArgumentRule(_word, ""), "names of faults (vl.shelf('faults'))")
ANY = ArgumentRule(lambda value, _store: value, "")
ARGUMENTS = {
    "bat": BAT,
    "bats": _several(BAT),
    "control_bat": BAT,
    "reference_inertia": ArgumentRule(BAT.read, f"{BAT.allowed}, or a text: '17000 oz in^2'"),
    "ball": BALL,
    "procedure": PROCEDURE,
    "procedures": _several(PROCEDURE),
    "camera": _entry("instruments"),
    "rig": _entry("rigs"),
    LABORATORIES: ArgumentRule(
        _instruments, "sheets of instruments: [vl.instrument('pivot-gates').with_(tick='2 us')]"
    ),
    "seed": ArgumentRule(_seed, f"{SEED}; for several, vl.sweep(laboratories=20)"),
    "operator_seed": ArgumentRule(_seed, SEED),
    "workers": ArgumentRule(partial(_whole, least=1), "one whole number from 1"),
    "faults": FAULTS,
    "names": FAULTS,
    "rules": WHOLES,
    "swings": _several(NUMBER),
    **dict.fromkeys(("drift", "step"), NUMBER),
    **dict.fromkeys(
        (
            *(
                "laboratories",
                "earlier_tests",
                "test",
                "clips",
                "days",
                "baseline",
                "hits",
                "since",
            ),
            *("members", "shots", "views", "number", "repeats"),
        ),
        WHOLE,
    ),
    **dict.fromkeys(("film", "individual", "pdf", "summed", "traces", "truth"), YES_OR_NO),
    **{key: ArgumentRule(_word, allowed) for key, allowed in WORDS.items()},
    **dict.fromkeys(("name", "path", "scenario"), NAME),
    **dict.fromkeys(("folder", "records", "certificates"), FOLDER),
    **dict.fromkeys(("folders", "history"), _several(FOLDER)),
    "paper": ArgumentRule(_word, "a4 or letter"),
    "script": PATH,
    "study": ArgumentRule(_study, "a study.toml, its keys and values, or None to resume"),
    **dict.fromkeys(("laboratory", "key", "replaces"), PATH),
    **dict.fromkeys(
        ("customer", "bat_serial", "bat_condition", "received", "notes", "reason"),
        ArgumentRule(_word, "a text"),
    ),
    "pictures": _several(PATH, "paths of pictures"),
    "progress": ArgumentRule(_callable, "a function that is called with a sentence"),
    "operator": ANY,
    "model": ArgumentRule(_callable, "a function of named inputs"),
    **dict.fromkeys(("inputs", "correlations", "prior"), ANY),
    **dict.fromkeys(("values", "groups", "parts", "operators"), ANY),
    "method": ArgumentRule(_word, "first-order, second-order or monte-carlo"),
    "uncertainty": ArgumentRule(_word, "first-order, second-order or monte-carlo"),
    "rule": ArgumentRule(_word, "stein or 7.9"),
    **dict.fromkeys(("digits", "draws", "points"), WHOLE),
    "validate": YES_OR_NO,
    **dict.fromkeys(
        ("probability", "value", "u", "lower", "upper", "dof", "guard", "r", "target"),
        ArgumentRule(_certain_number, "a number"),
    ),
}


def reads_arguments(function: Callable[P, T], name: str = "") -> Callable[P, T]:
    """Return a function whose arguments are read by the table; `name` is its public name.

    Every function with sheets among its arguments runs with them in the place of the catalog's.
    `InputError` for an argument that is missing, unknown or not allowed, and for an instrument
    that no rig of the test uses.
    """
    signature = inspect.signature(function)
    name = name or function.__name__

    @wraps(function)
    def called(*given: P.args, **named: P.kwargs) -> T:
        from virtual_lab import catalog

        store: Store = {}
        bound = _bound(name, signature, given, named)
        for key, value in bound.arguments.items():
            if value is not signature.parameters[key].default:
                bound.arguments[key] = _read(name, key, value, store)
        with catalog.sheets_in_place(store) as used:
            found = function(*bound.args, **bound.kwargs)
        for each in bound.arguments.get(LABORATORIES, ()):
            if (each.kind, each.name) not in used:
                known = sorted({one for kind, one in used if kind in ("instruments", "rigs")})
                allowed = f"no rig of this test uses it; in use: {', '.join(known) or 'none'}"
                raise InputError("", LABORATORIES, each.name, allowed)
        return found

    return called


def shows_progress(function: Callable[..., T]) -> Callable[..., T]:
    """Return a function whose `progress`, if it is not given, is shown on stderr."""

    @wraps(function)
    def called(*given: Any, **named: Any) -> T:
        if "progress" in named:
            return function(*given, **named)
        with show_progress() as progress:
            return function(*given, **named, progress=progress)

    return called


def takes_instruments(function: Callable[..., T]) -> Callable[..., T]:
    """Return a function with the argument `instruments`: sheets of instruments and rigs.

    They replace those of the catalog as long as the function runs.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def called(*given: Any, instruments: Sequence[Sheet] = (), **named: Any) -> T:
        return function(*given, **named)

    extra = inspect.Parameter(
        LABORATORIES, inspect.Parameter.KEYWORD_ONLY, default=(), annotation="Sequence[Sheet]"
    )
    parameters = [*signature.parameters.values(), extra]
    cast("Any", called).__signature__ = signature.replace(parameters=parameters)
    return called


def _bound(
    name: str, signature: inspect.Signature, given: Sequence[Any], named: Mapping[str, Any]
) -> inspect.BoundArguments:
    """Return the arguments of a call by name; `InputError` for those that do not fit."""
    own = signature.parameters
    for key in named:
        if key not in own:
            allowed = f"unknown argument, {nearest(key, own)}allowed: {', '.join(own)}"
            raise InputError(f"vl.{name}", key, None, allowed)
    by_place = [key for key, each in own.items() if each.kind is not each.KEYWORD_ONLY]
    if len(given) > len(by_place):
        others = [f"{key}=…" for key in own if key not in by_place]
        allowed = f"write it by name: {', '.join(others)}" if others else "is too many"
        if by_place and ARGUMENTS[by_place[-1]].several:
            allowed = f"several {by_place[-1]} are one list, [A, B]; or {allowed}"
        raise InputError(
            f"vl.{name}", f"argument {len(by_place) + 1}", given[len(by_place)], allowed
        )
    try:
        return signature.bind(*given, **named)
    except TypeError as fault:
        for key in by_place[len(given) :]:
            if own[key].default is inspect.Parameter.empty and key not in named:
                allowed = f"is missing; allowed: {ARGUMENTS[key].allowed}"
                raise InputError(f"vl.{name}", key, None, allowed) from fault
        raise InputError(f"vl.{name}", str(fault), None, f"allowed: {', '.join(own)}") from fault


def _read(name: str, key: str, value: Any, store: Store) -> Any:
    argument = ARGUMENTS[key]
    try:
        return argument.read(value, store)
    except InputError:
        raise
    except (TypeError, ValueError, OverflowError) as fault:
        allowed = f"allowed: {argument.allowed}"
        if callable(getattr(value, name, None)) and not isinstance(value, str):
            allowed = f"has a function of its own: write .{name}() after it"
        shown = key if value is not None else f"{key} = None"
        raise InputError("", shown, value, allowed) from fault
