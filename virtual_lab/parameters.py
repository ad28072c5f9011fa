"""Types of public parameters. Each type contains its rule, for Python and for the command line.

A rule has a reader, a sentence on the allowed values, and a completer. A ``Literal`` and the plain
types need no explicit rule, because `rule_of` derives it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from math import inf, isnan
from operator import index
from os import fspath
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

SETTINGS = "settings.toml"  # file in a result folder with the arguments of its call
OUT = "out"  # folder of results in the current folder, which is created when it is needed
SEED_BITS = 128  # length of a random seed, too long for trial and error
LARGEST_SEED = 2**SEED_BITS - 1


RuleKind = Literal["text", "number", "flag", "choice", "name", "file", "folder", "clip"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRule:
    """The rule for the values of a parameter.

    `read` converts a Python value to the form that the function takes. It raises `TypeError` or
    `ValueError` for a value that is not allowed. `parse` converts a word of the command line to a
    Python value. `complete` returns names that are allowed, each with its title, or an empty one.
    """

    read: Callable[[Any], Any]
    allowed: str
    parse: Callable[[str], Any] = str
    complete: Callable[[], Mapping[str, str]] = dict
    metavar: str = "TEXT"
    kind: RuleKind = "text"
    several: ParameterRule | None = None  # rule of one value, if the parameter takes a list
    closed: bool = False  # whether only the names of `complete` are allowed
    limits: str = ""  # limits of a number in words, such as “at least 2”
    unit: str = ""  # unit of a number
    holds: tuple[str, ...] = ()  # kinds of content that a folder may have; empty: any
    python: str = ""  # advice for Python, appended to the sentence on the allowed values


def read_word(value: Any) -> str:
    """Return a string unchanged. Raise `TypeError` for any other value."""
    if not isinstance(value, str):
        raise TypeError(value)
    return value


def read_name(value: Any) -> str:
    """Return a name or a path as a string. Raise `TypeError` for any other value."""
    return read_word(fspath(value))


def read_path(value: Any) -> Path:
    """Return a name or a path as a `Path`. Raise `TypeError` for any other value."""
    return Path(read_name(value))


def read_keys_or_path(value: Any) -> Any:
    """Return a mapping as a dictionary, or the path of a file as a `Path`."""
    return dict(value) if isinstance(value, Mapping) else read_path(value)


def read_folder(value: Any) -> Path:
    """Return the path of a folder. Raise `ValueError` for the path of a file."""
    path = read_path(value)
    if path.is_file():
        raise ValueError(path)
    return path


def read_number(value: Any) -> float:
    """Return a number of any numeric type as a float. NaN is allowed.

    Raises `TypeError` for a string, a boolean, or another value that is not a number.
    """
    if isinstance(value, bool | str):
        raise TypeError(value)
    return float(value)


def read_callable(value: Any) -> Any:
    """Return a function unchanged. Raise `TypeError` for a value that cannot be called."""
    if not callable(value):
        raise TypeError(value)
    return value


def _certain(value: Any) -> float:
    number = read_number(value)
    if isnan(number):
        raise ValueError(number)
    return number


def _yes_or_no(value: Any) -> bool:
    if not isinstance(value, bool):
        raise TypeError(value)
    return value


def whole(least: int = 0, most: int = 2**63 - 1, words: str = "") -> ParameterRule:
    """Return the rule of a parameter that is a whole number from `least` to `most`, both included.

    Any integer type is allowed, but no boolean. The rule has a description of the allowed values.

    Parameters
    ----------
    least, most
        Limits of the number.
    words
        Limits in words. With “1 to 50” the description is “one whole number from 1 to 50”. If
        `words` is empty, `least` is used, for example “one whole number from 1”.
    """

    def read(value: Any) -> int:
        if isinstance(value, bool):
            raise TypeError(value)
        number = index(value)
        if not least <= number <= most:
            raise ValueError("beyond its limits")
        return number

    return ParameterRule(
        read=read,
        allowed=f"one whole number from {words or least}",
        parse=int,
        metavar="NUMBER",
        kind="number",
        limits=words or (f"at least {least}" if least else ""),
    )


def real_number(words: str, allows: Callable[[float], bool], unit: str = "") -> ParameterRule:
    """Return the rule of a parameter that is a number for which `allows` returns True.

    `words` is the text that describes the allowed values, and `unit` their unit.
    """

    def read(value: Any) -> float:
        number = read_number(value)
        if not allows(number):
            raise ValueError("beyond its limits")
        return number

    limits = words.split(",", maxsplit=1)[0]
    allowed = f"a number, {words}"
    return replace(NUMBER, read=read, allowed=allowed, limits=limits, unit=unit)


def choice(*values: str) -> ParameterRule:
    """Return the rule of a parameter that is one of the words `values`.

    Raises `ValueError` if there are no `values`.
    """

    def read(value: Any) -> str:
        if read_word(value) not in values:
            raise ValueError(value)
        return str(value)

    *others, last = values
    allowed = f"{', '.join(others)} or {last}" if others else last
    return ParameterRule(
        read=read,
        allowed=allowed,
        complete=lambda: dict.fromkeys(values, ""),
        metavar=f"[{'|'.join(values)}]",
        kind="choice",
        closed=True,
    )


def several(one: ParameterRule, words: str = "") -> ParameterRule:
    """Return the rule of a parameter for which one value or a non-empty list is allowed.

    The value or list is converted to a tuple. The rule `one` checks and converts each value.
    Messages describe the allowed values by `words`, or by the text of the rule `one` if `words` is
    empty.
    """

    def read(value: Any) -> tuple[Any, ...]:
        if not _is_list(value):
            return (one.read(value),)
        values = tuple(one.read(item) for item in value)
        if not values:
            raise ValueError("empty")
        return values

    allowed = f"{words or one.allowed}; one, or a list of at least one"
    return replace(one, read=read, allowed=allowed, parse=str, several=one)


def _is_list(value: Any) -> bool:
    """Return whether a value is a sequence of items, and not a string, a mapping or a sheet."""
    return isinstance(value, Iterable) and not isinstance(value, str | bytes | Path | Mapping | Set)


WHOLE = whole()
NUMBER = ParameterRule(
    read=read_number, allowed="a number", parse=float, metavar="NUMBER", kind="number"
)
CERTAIN_NUMBER = replace(NUMBER, read=_certain)
FLAG = ParameterRule(read=_yes_or_no, allowed="True or False", kind="flag")
TEXT = ParameterRule(read=read_word, allowed="a string")
FILE = ParameterRule(read=read_path, allowed="a path", metavar="FILE", kind="file")
FOLDER = ParameterRule(
    read=read_path, allowed="the path of a folder", metavar="FOLDER", kind="folder"
)
ANYTHING = ParameterRule(read=lambda value: value, allowed="")
PLAIN: Mapping[Any, ParameterRule] = {
    bool: FLAG,
    int: WHOLE,
    float: NUMBER,
    str: TEXT,
    Path: FILE,
}

SEED = replace(
    whole(0, LARGEST_SEED, f"0 to 2^{SEED_BITS} - 1"),
    limits="",
    python="; for several, vl.sweep(laboratories=20)",
)

Seed = Annotated[int, SEED]
OperatorSeed = Annotated[int, replace(SEED, python="")]
Positive = Annotated[int, whole(1)]
TwoOrMore = Annotated[int, whole(2)]
HundredOrMore = Annotated[int, whole(100)]
Views = Annotated[int, whole(3, 60, "3 to 60")]
CheckDays = Annotated[int, whole(6, 10_000, "6 to 10000")]
BaselineDays = Annotated[int, whole(5)]
CheckHits = Annotated[int, whole(2, 1000, "2 to 1000")]
AboveZero = Annotated[float, real_number("more than 0, finite", lambda x: 0 < x < inf)]
LostShare = Annotated[float, real_number("at least 0 and below 1", lambda x: 0 <= x < 1)]
SwingExponents = Annotated[
    float | Sequence[float], several(real_number("0 to 0.5", lambda x: 0 <= x <= 0.5))
]
Port = Annotated[int, whole(1024, 65535, "1024 to 65535")]
Trainees = Annotated[int, whole(1, 50, "1 to 50")]
Certain = Annotated[float, CERTAIN_NUMBER]
Numbers = Annotated[float | Sequence[float], several(NUMBER)]
BoardText = Annotated[
    str,
    replace(
        TEXT,
        allowed="'charuco:14x9:40mm:30mm' or 'chessboard:14x9:40mm'",
        metavar="KIND:COLUMNSxROWS:SQUARE[:MARKER]",
    ),
]
LengthText = Annotated[str, replace(TEXT, allowed="a length with its unit: '36.5mm'")]
PictureName = Annotated[str, replace(TEXT, allowed="the name of a picture")]
Share = Annotated[
    str,
    replace(TEXT, allowed="a share of the parts: '3/40' for the third fortieth", metavar="N/M"),
]
Address = Annotated[
    str,
    replace(TEXT, allowed="the address of a scheduler: 'tcp://HOST:8786'", metavar="ADDRESS"),
]
File = Annotated[str | Path, FILE]
PicturePaths = Annotated[str | Path | Sequence[str | Path], several(FILE, "paths of pictures")]
AnyParticulars = Annotated[
    str | Path | Mapping[str, Any],
    ParameterRule(
        read=read_keys_or_path,
        allowed="a file of particulars, its keys and values, or the folder of a laboratory",
        metavar="FILE",
        kind="file",
    ),
]
AnyDocument = Annotated[
    str | Path | Mapping[str, Any],
    replace(FILE, read=read_keys_or_path, allowed="a file, or its keys and values"),
]
Folder = Annotated[str | Path, FOLDER]
AnyLaboratory = Annotated[
    str | Path,
    replace(
        FOLDER,
        read=read_folder,
        allowed="the folder of a laboratory, made by laboratory",
        holds=("laboratory",),
    ),
]
Kind = Literal["bats", "balls", "procedures", "instruments", "rigs", "conditions", "faults"]
Paper = Literal["a4", "letter"]
RealityName = Literal["real", "noise-free", "ideal"]
MotionName = Literal["closed-form", "pymunk"]
StablePart = Literal["collision", "camera"]
ChartedPart = Literal["collision", "motion", "camera"]
OperatorName = Literal["expert", "careful", "book", "careless", "cheating"]
DrawsRule = Literal["stein", "7.9"]
Propagation = Literal["first-order", "second-order", "monte-carlo"]
AnyModel = Annotated[
    Callable[..., Any], ParameterRule(read=read_callable, allowed="a function of named inputs")
]


def paths_of(folders: str | Path | Sequence[str | Path]) -> tuple[Path, ...]:
    """Return a path, or the paths of a list, as a tuple of `Path` objects."""
    return (Path(folders),) if isinstance(folders, str | Path) else tuple(map(Path, folders))


def values_of(values: float | Sequence[float]) -> tuple[float, ...]:
    """Return a number, or the numbers of a list, as a tuple of floats."""
    return (float(values),) if isinstance(values, int | float) else tuple(map(float, values))


def rule_of(annotation: Any) -> ParameterRule:
    """Return the rule for the values of a parameter with the type `annotation`.

    An `Annotated` type contains its rule. A plain type, such as float, has the rule in `PLAIN`. A
    `Literal` of strings allows only these strings. Any other type has the rule `ANYTHING`, which
    allows every value.
    """
    for note in getattr(annotation, "__metadata__", ()):
        if isinstance(note, ParameterRule):
            return note
    if get_origin(annotation) is Literal:
        values = get_args(annotation)
        return choice(*values) if all(isinstance(each, str) for each in values) else ANYTHING
    return PLAIN.get(annotation, ANYTHING)
