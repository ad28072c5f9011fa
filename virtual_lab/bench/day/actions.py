"""What can be asked for at the bench: actions by name, and the arguments that each takes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from types import MappingProxyType
from typing import Literal

from virtual_lab.bench.day.scenario import SCORES
from virtual_lab.bench.day.table import MAKE_READY, PREPARING, action_table, known_doubts
from virtual_lab.errors import InputError, nearest
from virtual_lab.units import DIMENSIONS, INCH, OUNCE

Value = str | float | int
LENGTHS = MappingProxyType({"mm": 1e-3, "cm": 1e-2, "in": INCH})
MASSES = MappingProxyType({"g": 1e-3, "oz": OUNCE})
TYPED = re.compile(r"([^a-zA-Z%]+?(?:[eE][+-]?\d+)?)\s*([a-zA-Z%/]+)")  # a number with its unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Argument:
    """One thing that an action is told."""

    name: str
    title: str
    kind: Literal["number", "whole", "choice", "text", "doubt"]
    unit: str = ""  # of a number
    default: Value | None = None  # None: it must be given
    low: float = -1e6
    high: float = 1e6
    choices: tuple[str, ...] = ()

    def read(self, raw: object, action: str, length: str = "mm") -> Value:
        """Return the value that was typed or sent; `InputError` where it is none.

        A bare number of a length is in the unit `length`.
        """
        if raw is None or (isinstance(raw, str) and not raw.strip()):
            if self.default is None:
                raise InputError(action, self.name, None, f"is missing: {self.title}")
            return self.default
        if self.kind == "text":
            text = str(raw).strip()
            if len(text) > 300 or not text.isprintable():
                allowed = "allowed: a line of up to 300 characters"
                raise InputError(action, self.name, text, allowed)
            return text
        if self.kind == "doubt":
            return doubt_of(str(raw).strip(), action, self.name)
        if self.kind == "choice":
            if raw not in self.choices:
                allowed = f"{nearest(raw, self.choices)}allowed: {', '.join(self.choices)}"
                raise InputError(action, self.name, raw, allowed)
            return str(raw)
        return self._number(raw, action, length)

    def _number(self, raw: object, action: str, length: str) -> Value:
        text = str(raw).strip()
        factor = self._factor(length) if self.unit == "mm" else 1.0
        if (typed := TYPED.fullmatch(text)) and self.unit:
            text, factor = typed[1], self._factor(typed[2])
        if re.fullmatch(r"[+-]?\d+,\d+", text):  # a decimal comma; 1,200,000 is none
            text = text.replace(",", ".")
        try:
            number = factor * float(text) if not isinstance(raw, bool) else float("nan")
        except ValueError:
            number = float("nan")
        whole = self.kind == "whole"
        fits = isfinite(number) and self.low <= number <= self.high
        if not fits or (whole and number != int(number)):
            kind = "whole numbers" if whole else "numbers"
            allowed = f"allowed: {kind} from {self.low:g} to {self.high:g} {self.unit}".rstrip()
            raise InputError(action, self.name, raw, allowed)
        return int(number) if whole else number

    def _factor(self, unit: str) -> float:
        """Return how many of the argument's own unit a unit is; NaN where it is another kind."""
        for units in DIMENSIONS.values():
            if {unit, self.unit} <= units.keys():
                return units[unit] / units[self.unit]
        return float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """One action asked for, its arguments read."""

    name: str
    arguments: Mapping[str, Value] = field(default_factory=dict)


def _choice(name: str, title: str, *choices: str) -> Argument:
    return Argument(name=name, title=title, kind="choice", choices=choices, default=choices[0])


def _text(name: str, title: str, default: str | None = None) -> Argument:
    return Argument(name=name, title=title, kind="text", default=default)


def _whole(name: str, title: str, high: float, default: int | None = None) -> Argument:
    return Argument(name=name, title=title, kind="whole", low=1, high=high, default=default)


def _number(
    name: str, title: str, low: float, high: float, *, unit: str = "", default: Value | None = None
) -> Argument:
    return Argument(
        name=name, title=title, kind="number", unit=unit, default=default, low=low, high=high
    )


OWN_RESULTS = MappingProxyType(  # typed: the quantity of the reduction
    {
        "r": "recoil_factor",
        "e_A": "collision_efficiency",
        "e": "restitution",
        "BPF": "bat_performance_factor",
    }
)
VERDICTS = ("PASS", "FAIL", "INVALID", "MEASURED")
MASS = _choice("entered_as", "scale in g, entered as", *MASSES)
LENGTH = _choice("entered_as", "rule in mm, entered as", *LENGTHS)
BALL = _whole("ball", "ball", 1000)
SHOT = _whole("shot", "shot", 10_000)
REASON = _text("because", "because")

ARGUMENTS: Mapping[str, tuple[Argument, ...]] = MappingProxyType(
    {
        "weigh-bat": (MASS,),
        "weigh-balls": (MASS,),
        "measure-length": (LENGTH,),
        "measure-barrel": (LENGTH,),
        "measure-balance": (_choice("end", "measured from", "tip", "knob"), LENGTH),
        "fit-clamp": (_choice("fitted", "on the bat", "yes", "no"),),
        "swing": (
            _number("amplitude", "let go at", 0.5, 45, unit="deg", default=4.0),
            _whole("swings", "swings", 100, default=10),
            _choice("clock", "timed by", "photogate", "hand"),
        ),
        "swing-clamp": (_choice("use", "use the inertia", "entered", "measured"),),
        "gauge-gates": (_choice("use", "reduce with", "certificate", "gauge"),),
        "re-aim": (
            _number("along", "along the bat, to the knob", -50, 50, unit="mm", default=0.0),
            _number("across", "up", -50, 50, unit="mm", default=0.0),
        ),
        "set-place": (_number("place", "from the tip", 0, 1500, unit="mm"),),
        "load-ball": (BALL,),
        "retire-ball": (BALL, REASON),
        "accept": (SHOT, _text("because", "because", default="within the windows")),
        "reject": (SHOT, REASON),
        "strike-out": (_whole("entry", "entry", 100_000), REASON),
        "note-doubt": (
            Argument(name="doubt", title="what is wrong", kind="doubt"),
            _number("confidence", "how sure", 0, 100, unit="%", default=70.0),
        ),
        "note-deviation": (
            _choice("step", "of", "another", *PREPARING, *MAKE_READY, "load-ball"),
            REASON,
        ),
        "enter-result": tuple(_number(name, name, -2, 5, default="") for name in OWN_RESULTS),
        "give-verdict": (
            replace(_choice("verdict", "verdict", *VERDICTS), default=None),
            _number("confidence", "how certain", 0, 100, unit="%", default=90.0),
            Argument(name="doubt", title="worst doubt", kind="doubt", default="none"),
        ),
        "dispute-score": (_choice("score", "score", *SCORES), _text("note", "because")),
    }
)


def doubt_of(words: str, action: str, key: str) -> str:
    """Return the fault of a title; `InputError` asks back where the words are nearly one.

    Words of one's own begin with “other:”, and name no fault.
    """
    known = known_doubts()
    by_title = {title.lower(): name for name, title in known.items()}
    if words in {*known, "none", "no result"}:
        return words
    if words.lower() in by_title:
        return by_title[words.lower()]
    if words.lower().startswith("other:") and len(words) <= 300 and words.isprintable():
        return words
    near = nearest(words, known.values())
    allowed = f"{near}allowed: a title of the list, none, or your own words after “other:”"
    raise InputError(action, key, words, allowed)


def action_of(
    name: str, arguments: Mapping[str, object] | None = None, length: str = "mm"
) -> Action:
    """Return the action of a name with its arguments read, bare lengths in the unit `length`.

    Raises
    ------
    InputError
        No such action, an argument that it does not take, is missing or does not fit.
    """
    known = action_table().actions
    if name not in known:
        allowed = f"{nearest(name, known)}known: {', '.join(known)}"
        raise InputError("", "action", name, allowed)
    given = dict(arguments or {})
    takes = {argument.name: argument for argument in ARGUMENTS.get(name, ())}
    if strange := [key for key in given if key not in takes]:
        allowed = f"allowed: {', '.join(takes) or 'no argument'}"
        raise InputError(name, str(strange[0]), None, allowed)
    read = {key: argument.read(given.get(key), name, length) for key, argument in takes.items()}
    return Action(name=name, arguments=read)
