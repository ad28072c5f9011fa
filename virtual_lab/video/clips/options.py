"""What a person says of a clip in words: `73mm±0.5mm`, `17:52`, `x,y@frame`, `1/120`."""

from __future__ import annotations

import re
from math import hypot

from virtual_lab.errors import InputError
from virtual_lab.relations.board import length_of


def ball_of(text: str) -> tuple[float, float, bool]:
    """Diameter of a ball, its u [m], and whether that was assumed: `73mm±0.5mm`."""
    diameter, u = _length_and_u(text, "--ball", 1.0)
    # a baseball's may vary by 1.4 %, a tennis ball's by 2.4 %
    return diameter, 0.01 * diameter if u is None else u, u is None


def _length_and_u(text: str, key: str, most: float) -> tuple[float, float | None]:
    """Length of 1 mm to `most` and its u [m], None where there is none: `73mm±0.5mm`."""
    size, sign, more = re.sub(r"\+/-|\+-", "±", text).partition("±")
    length = length_of(size, key, 1e-3, most)
    return length, length_of(more, key, 0.0, length / 2) if sign else None


def seconds_of(text: str, key: str) -> float:
    """Time [s]: `8ms`, `0.008 s`, `1/120`."""
    found = re.fullmatch(r"\s*([0-9.]+(?:e-?\d+)?)\s*(?:/\s*([0-9.]+)\s*)?([a-zµ]*)\s*", text)
    form = "expected a time with its unit, e.g. 8ms or 1/120"
    if not found or not (found[2] or found[3]):
        raise InputError("", key, text, form)
    try:
        unit = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}[found[3]]
        value = float(found[1]) / float(found[2] or 1) * unit
    except (KeyError, ValueError, ZeroDivisionError) as fault:
        raise InputError("", key, text, form) from fault
    if not value <= 1:
        raise InputError("", key, text, "allowed: 0 to 1 s")
    return value


def frames_of(text: str) -> tuple[int, int]:
    """First and last frame of a range: `17:52`."""
    found = re.fullmatch(r"\s*(\d{1,9})\s*:\s*(\d{1,9})\s*", text)
    if not found or int(found[2]) <= int(found[1]):
        raise InputError("", "--frames", text, "expected first:last, e.g. 17:52")
    return int(found[1]), int(found[2])


def region_of(text: str) -> tuple[float, float, float, float]:
    """Return x, y, width and height of a region of the picture [pixels]."""
    x, y, wide, high = _numbers(text, 4, "--region", "x,y,width,height in pixels")
    if wide <= 0 or high <= 0:
        raise InputError("", "--region", text, "width and height must be above 0")
    return x, y, wide, high


def place_of(text: str) -> tuple[float, float, int]:
    """Place and frame at which a person sees the ball: `x,y@frame`."""
    place, sign, frame = text.partition("@")
    if not sign or not frame.strip().isdecimal() or len(frame) > 9:
        raise InputError("", "--ball-at", text, "expected x,y@frame, e.g. 210,85@17")
    x, y = _numbers(place, 2, "--ball-at", "x,y@frame, e.g. 210,85@17")
    return x, y, int(frame)


def scale_of(text: str) -> tuple[float, float]:
    """Metres per pixel and their u by two points and their distance: `x,y:x,y=50cm`."""
    points, sign, length = text.partition("=")
    first, between, second = points.partition(":")
    form = "x,y:x,y=length, e.g. 100,200:300,200=50cm"
    if not sign or not between:
        raise InputError("", "--scale", text, f"expected {form}")
    one, other = (_numbers(each, 2, "--scale", form) for each in (first, second))
    apart = hypot(one[0] - other[0], one[1] - other[1])
    clicked = 1.0  # pixels, u of a point that a person gives
    if apart < 10 * clicked:
        raise InputError("", "--scale", text, f"the points are {apart:.3g} pixels apart: too near")
    metres, metres_u = _length_and_u(length, "--scale", 1000.0)
    relative = hypot((metres_u or 0.0) / metres, hypot(clicked, clicked) / apart)
    return metres / apart, metres / apart * relative


def _numbers(text: str, count: int, key: str, form: str) -> list[float]:
    try:
        found = [float(each) for each in text.split(",")]
        if len(found) != count or not all(abs(each) < 1e6 for each in found):
            raise ValueError(text)
    except ValueError as fault:
        raise InputError("", key, text, f"expected {form}") from fault
    return found
