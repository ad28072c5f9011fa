"""Values that a user gives for a clip on the command line: `73mm±0.5mm`, `17:52`, `x,y@frame`."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from math import hypot
from os import fspath
from pathlib import Path
from typing import Any

from virtual_lab.catalog import load, names, texts_in_place
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError
from virtual_lab.relations.board import length_of
from virtual_lab.units import DEGREE, to_si
from virtual_lab.video.follow.knowledge import BALL, GRAVITY

# quantities in SI units, by keys of a calibration file and names of other knowledge of a clip
Said = dict[str, Any]


def said_of(options: Mapping[str, Any]) -> Said:
    """Return the quantities that options state; None and False state nothing.

    Raises `InputError` for a value of another type or form.
    """
    said: Said = {}
    for name, value in options.items():
        allowed, read = OPTIONS[name]
        try:
            said |= {} if value is None or value is False else read(value)
        except InputError:
            raise
        except (ArithmeticError, AttributeError, TypeError, ValueError) as fault:
            raise InputError("", key_of(name), value, f"expected {allowed}") from fault
    return said


def key_of(name: str) -> str:
    """Return an option in the form of the command line."""
    return f"--{name.replace('_', '-')}"


def _yes(name: str, meant: object, value: object) -> Said:
    if value is not True:
        raise TypeError(value)
    return {name: meant}


def _within(value: float, least: float, most: float) -> float:
    if isinstance(value, bool) or not least <= value <= most:
        raise ValueError(value)
    return value


def _ball(ball: str | Path) -> Said:
    spec = _ball_sheet(fspath(ball))
    if spec:
        diameter, u, more = 2 * spec.radius, 2 * spec.radius_u or None, {"ball_mass": spec.mass}
    else:
        diameter, u, more = *_length_and_u(str(ball), "--ball", 1.0), {}
    # u of 1 % if none is stated: a baseball's diameter may vary by 1.4 %, a tennis ball's by 2.4 %
    u, assumed = 0.01 * diameter if u is None else u, u is None
    return {"ball_diameter_m": diameter, "ball_diameter_m_u": u, "assumed": assumed} | more


def _ball_sheet(text: str) -> BallSpec | None:
    """Return the sheet of a ball: a file, or the catalog name that starts with `text`; or None."""
    if text.endswith(".toml") or ("balls", text) in texts_in_place():
        return load("balls", text, BallSpec).spec
    if re.match(r"\s*[-+.\d]", text):
        return None
    (name,) = [text] if text in BALLS else [each for each in BALLS if each.startswith(text)]
    return load("balls", name, BallSpec).spec


def _length_and_u(text: str, key: str, most: float) -> tuple[float, float | None]:
    """Return a length of 1 mm to `most` and its u [m] from `73mm±0.5mm`; None: no u."""
    size, sign, more = re.sub(r"\+/-|\+-", "±", text).partition("±")
    length = length_of(size, key, 1e-3, most)
    return length, length_of(more, key, 0.0, length / 2) if sign else None


def _rate(rate: float) -> Said:
    return {"frames_per_second": _within(rate, 1, 1e7), "frames_per_second_u": 0.0}


def _gravity(gravity: float) -> Said:
    return {"gravity": _within(gravity, 0.1, 100), "gravity_u": 0.0}


def _seconds(name: str, text: str) -> Said:
    form = r"\s*([\d.e-]+)\s*(?:/\s*([\d.]+)\s*)?([mu]?s)?\s*"
    match = re.fullmatch(form, text.replace("µ", "u"))
    if not match or not (match[2] or match[3]):
        raise ValueError(text)
    value = to_si(float(match[1]) / float(match[2] or 1), match[3] or "s", "time")
    return {name: _within(value, 0, 1)}


def _mass(text: str) -> Said:
    match = re.fullmatch(r"\s*([\d.e-]+)\s*([a-z]+)\s*", text)
    if not match:
        raise ValueError(text)
    return {"mass": _within(to_si(float(match[1]), match[2], "mass"), 1e-4, 10)}


def _frames(text: str) -> Said:
    first, last = map(int, text.split(":"))
    return {"frames": (int(_within(first, 0, last - 1)), last)}


def _region(text: str) -> Said:
    x, y, wide, high = _numbers(text, 4)
    return {"region": (x, y, _within(wide, 1, 1e6), _within(high, 1, 1e6))}


def _place(text: str) -> Said:
    place, frame = text.split("@")
    return {"ball_at": (*_numbers(place, 2), int(frame))}


def _scale(text: str) -> Said:
    points, length = text.split("=")
    (x, y), (other_x, other_y) = (_numbers(each, 2) for each in points.split(":"))
    clicked = 1.0  # u of a point that a person gives [pixels]
    apart = _within(hypot(x - other_x, y - other_y), 10 * clicked, 1e6)
    metres, metres_u = _length_and_u(length, "--scale", 1000.0)
    relative = hypot((metres_u or 0.0) / metres, hypot(clicked, clicked) / apart)
    scale = metres / apart
    return {"metres_per_pixel": scale, "metres_per_pixel_u": scale * relative}


def _ruler(text: str) -> Said:
    if text not in (GRAVITY, BALL):
        raise ValueError(text)
    return {"ruler": text}


def _numbers(text: str, count: int) -> list[float]:
    numbers = [_within(float(each), -1e6, 1e6) for each in text.split(",")]
    if len(numbers) != count:
        raise ValueError(text)
    return numbers


BALLS = names("balls")
FILE, TIME, YES = 'a path, e.g. "calibration.toml"', "a time with its unit, up to 1 s", "True"
# expected form of each option's value, and function that converts it to quantities
OPTIONS: dict[str, tuple[str, Callable[[Any], Said]]] = {
    "calibration": (FILE, lambda path: {"file": Path(path)}),
    "ball": (
        'a diameter with its unit, e.g. "73mm±0.5mm", the .toml file of a ball, or a name (its '
        f"beginning will do): {', '.join(BALLS)}",
        _ball,
    ),
    "fps": ("1 to 1e7 frames a second, e.g. 240", _rate),
    "mass": ('a mass with its unit, e.g. "145g"', _mass),
    "exposure": (f'{TIME}, e.g. "8ms" or "1/120"', partial(_seconds, "exposure")),
    "gravity": ("0.1 to 100 m/s², e.g. 9.81", _gravity),
    "frames": ('first:last, e.g. "17:52"', _frames),
    "region": (
        'x,y,width,height in pixels, 1 wide and high at least, e.g. "10,20,300,200"',
        _region,
    ),
    "ball_at": ('x,y@frame, e.g. "210,85@17"', _place),
    "scale": ('x,y:x,y=length, 10 pixels apart or more, e.g. "9,20:300,20=50cm"', _scale),
    "ruler": (f"{GRAVITY} or {BALL}", _ruler),
    "readout": (f'{TIME}, e.g. "16ms"', partial(_seconds, "readout")),
    "global_shutter": (YES, partial(_yes, "readout", 0.0)),
    "phone": (YES, partial(_yes, "phone", True)),
    "tripod": (YES, partial(_yes, "stands", True)),
    # u of the camera's level: a degree is two u
    "level": (YES, partial(_yes, "level_u", 0.5 * DEGREE)),
    "corrected": (FILE, lambda path: {"corrected": Path(path)}),
}
