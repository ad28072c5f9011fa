"""Types of the statements about a clip, `73mm±0.5mm`, `17:52`, `x,y@frame`, with their rules.

The rule of a type rejects a string of another form. The function that reads the string converts it
to SI units.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from math import hypot
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from virtual_lab.parameters import FILE, ParameterRule, read_word, real_number
from virtual_lab.sheets import AnyEntry, Sheet, entry_name, entry_rule

if TYPE_CHECKING:
    from numpy.typing import NDArray

LARGEST_BALL, LARGEST_SCALE = 1.0, 1000.0  # largest allowed diameter and distance [m]
CLICK_U = 1.0  # u of a point that a person gives [pixels]
# relative u of a diameter that is stated without u; the rules allow a baseball to vary by 1.4 %,
# and a tennis ball by 2.4 %
UNSTATED_U = 0.01


def read_if_stated(read: Callable[[Any], Any], value: object) -> Any:
    """Return the value that `read` gives for a statement, or None if nothing is stated."""
    return None if value is None else read(value)


def read_seconds(text: str) -> float:
    """Return a time in seconds from a string such as ``8ms`` or ``1/120``.

    A fraction such as ``1/120`` needs no unit. Raises `ValueError` for a string of another form,
    for any other number without a unit, and for a time outside 0 to 1 s. ``1/0`` raises
    `ZeroDivisionError`.
    """
    from virtual_lab.units import to_si

    form = r"^\s*([\d.e-]+)\s*(?:/\s*([\d.]+)\s*)?([mu]?s)?\s*$"
    ((number, divisor, unit),) = re.findall(form, text.replace("µ", "u"))
    if not (divisor or unit):
        raise ValueError(text)
    return _within(to_si(float(number) / float(divisor or 1), unit or "s", "time"), 0, 1)


def readout_keys(text: str) -> dict[str, float | None]:
    """Return a readout time [s] and its u from a string such as ``16ms`` or ``16ms±2ms``.

    The keys of the result are ``readout`` and ``readout_u``. A u that is not stated is None. Raises
    the errors of `read_seconds`.
    """
    time, more = _with_u(text)
    return {"readout": read_seconds(time), "readout_u": read_if_stated(read_seconds, more)}


def read_mass(text: str) -> float:
    """Return a mass in kilograms from a string such as ``145g``.

    Raises `ValueError` for a string of another form and for a mass outside 0.1 g to 10 kg, and
    `KeyError` for an unknown unit.
    """
    from virtual_lab.units import to_si

    ((number, unit),) = re.findall(r"^\s*([\d.e-]+)\s*([a-z]+)\s*$", text)
    return _within(to_si(float(number), unit, "mass"), 1e-4, 10)


def read_frames(text: str) -> tuple[int, int]:
    """Return the numbers of the first and last frame from a string such as ``17:52``.

    Frames are counted from 0. Raises `ValueError` for a string of another form, for a negative
    number, and if the first is not before the last.
    """
    first, last = map(int, text.split(":"))
    return int(_within(first, 0, last - 1)), last


def read_region(text: str) -> tuple[float, float, float, float]:
    """Return x, y, width and height [px] of a part of the picture from ``10,20,300,200``.

    x and y are the position of the part's upper left corner, counted from the upper left corner of
    the picture. Raises `ValueError` for a string of another form, for a width or height below 1 px,
    and for any number beyond ±1e6 px.
    """
    x, y, wide, high = _numbers(text, 4)
    return x, y, _within(wide, 1, 1e6), _within(high, 1, 1e6)


def read_position(text: str) -> tuple[float, float, int]:
    """Return x and y of a ball [px], and its frame number, from a string such as ``210,85@17``.

    x and y are counted from the upper left corner of the picture. Raises `ValueError` for a string
    of another form, and for x or y beyond ±1e6 px.
    """
    position, frame = text.split("@")
    x, y = _numbers(position, 2)
    return x, y, int(frame)


def scale_keys(text: str) -> dict[str, float]:
    """Return the scale of the picture [m/px] and its u, from two points and their distance.

    The keys of the result are ``metres_per_pixel`` and ``metres_per_pixel_u``, as in a calibration
    file. The string is ``X,Y:X,Y=50cm``, with both points in pixels. Each point has a u of 1 px.
    Raises `ValueError` for a string of another form or points closer than 10 px. Raises
    `InputError` for a length without a unit or outside 1 mm to 1000 m.
    """
    points, length = text.split("=")
    (x, y), (other_x, other_y) = (_numbers(each, 2) for each in points.split(":"))
    distance = _within(hypot(x - other_x, y - other_y), 10 * CLICK_U, 1e6)
    metres, metres_u = _length_and_u(length, "{scale}", LARGEST_SCALE)
    relative = hypot((metres_u or 0.0) / metres, hypot(CLICK_U, CLICK_U) / distance)
    scale = metres / distance
    return {"metres_per_pixel": scale, "metres_per_pixel_u": scale * relative}


def ball_keys(ball: AnyEntry) -> dict[str, Any]:
    """Return the diameter of the ball [m] and its u as calibration keys.

    The keys are ``ball_diameter_m``, ``ball_diameter_m_u`` and ``assumed``. `ball` is a diameter
    with its unit, the first letters of exactly one ball in the catalog, a .toml file, or a sheet.
    Unless `ball` is a diameter, the result also has the mass ``ball_mass`` [kg]. If no u is stated,
    a u of 1 % is assumed and ``assumed`` is True.

    Raises `ValueError` for letters that do not fit exactly one ball. Raises `InputError` for a
    diameter without a unit or outside 1 mm to 1 m, and for a file that is not the sheet of a ball.
    """
    spec = _ball_spec(entry_name(ball))
    if spec:
        diameter, u, more = 2 * spec.radius, 2 * spec.radius_u or None, {"ball_mass": spec.mass}
    else:
        diameter, u, more = *_length_and_u(entry_name(ball), "{ball}", LARGEST_BALL), {}
    u, assumed = UNSTATED_U * diameter if u is None else u, u is None
    return {"ball_diameter_m": diameter, "ball_diameter_m_u": u, "assumed": assumed} | more


def _ball_spec(text: str) -> Any:
    """Return the values of a ball's sheet, or None for a string that states a length.

    The string is the path of a file, or the first letters of exactly one name in the catalog.
    """
    from virtual_lab.catalog import load, names, texts_in_place
    from virtual_lab.catalog.specs import BallSpec

    if not text.endswith(".toml") and ("balls", text) not in texts_in_place():
        if re.match(r"\s*[-+.\d]", text):
            return None
        balls = names("balls")
        (text,) = [text] if text in balls else [each for each in balls if each.startswith(text)]
    return load("balls", text, BallSpec).spec


def _length_and_u(text: str, key: str, most: float) -> tuple[float, float | None]:
    """Return a length (1 mm to `most`) and its u [m] from `73mm±0.5mm`; u is None if not stated."""
    from virtual_lab.relations.board import length_of

    size, more = _with_u(text)
    length = length_of(size, key, 1e-3, most)
    return length, None if more is None else length_of(more, key, 0.0, length / 2)


def _with_u(text: str) -> tuple[str, str | None]:
    """Return the two sides of the sign ± as strings; the second is None without a sign."""
    size, sign, more = re.sub(r"\+/-|\+-", "±", text).partition("±")
    return size, more if sign else None


def _numbers(text: str, count: int) -> list[float]:
    numbers = [_within(float(each), -1e6, 1e6) for each in text.split(",")]
    if len(numbers) != count:
        raise ValueError(text)
    return numbers


def _within(value: float, least: float, most: float) -> float:
    if not least <= value <= most:
        raise ValueError(value)
    return value


def _text(convert: Callable[[str], object], allowed: str, metavar: str) -> ParameterRule:
    """Return the rule of a string that `convert` can read. The value remains the string."""

    def read(value: Any) -> str:
        convert(read_word(value))
        return str(value)

    return ParameterRule(read=read, allowed=allowed, metavar=metavar)


def _ball(value: Any) -> str | Sheet:
    """Return a ball in the form of an entry of the catalog, or a diameter as a string."""
    entry: str | Sheet = KIND.read(value)
    if isinstance(entry, str):
        ball_keys(entry)
    return entry


def _clip(value: Any) -> Any:
    """Return a path, or an array unchanged."""
    if isinstance(value, str | Path):
        return Path(value)
    import numpy as np

    if not isinstance(value, np.ndarray):
        raise TypeError(value)
    return value


KIND = entry_rule("balls")
BallOrDiameter = Annotated[
    AnyEntry,
    ParameterRule(
        read=_ball,
        allowed="a diameter with its unit, e.g. '73mm±0.5mm', or the name or .toml file of a ball",
        python=", or a sheet, vl.ball(…)",
        complete=KIND.complete,
        metavar="BALL|DIAMETER",
        kind="name",
    ),
]
StatedMass = Annotated[str, _text(read_mass, "a mass with its unit, e.g. '145g'", "MASS")]
Duration = Annotated[
    str, _text(read_seconds, "a time with its unit, 0 to 1 s, e.g. '8ms' or '1/120'", "TIME")
]
ReadoutTime = Annotated[
    str, _text(readout_keys, "a time with its unit, 0 to 1 s, e.g. '16ms' or '16ms±2ms'", "TIME")
]
FrameRange = Annotated[str, _text(read_frames, "first:last, e.g. '17:52'", "FIRST:LAST")]
PictureRegion = Annotated[
    str,
    _text(
        read_region,
        "x,y,width,height in pixels, 1 wide and high at least, e.g. '10,20,300,200'",
        "X,Y,WIDTH,HEIGHT",
    ),
]
BallPosition = Annotated[str, _text(read_position, "x,y@frame, e.g. '210,85@17'", "X,Y@FRAME")]
PictureScale = Annotated[
    str,
    _text(
        scale_keys,
        "x,y:x,y=length, 10 pixels apart or more, e.g. '9,20:300,20=50cm'",
        "X,Y:X,Y=LENGTH",
    ),
]
FrameRate = Annotated[
    float, real_number("1 to 1e7 frames per second, e.g. 240", lambda rate: 1 <= rate <= 1e7, "1/s")
]
StatedGravity = Annotated[
    float, real_number("0.1 to 100 m/s², e.g. 9.81", lambda gravity: 0.1 <= gravity <= 100, "m/s²")
]
AnyClip = Annotated[
    "str | Path | NDArray[Any]",
    replace(
        FILE,
        read=_clip,
        allowed="a path, or a numpy array (frame, row, column) of 8 or 16 bits with fps=",
        kind="clip",
    ),
]
StatedRuler = Literal["gravity", "ball"]
