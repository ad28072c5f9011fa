"""Rounding as on certificates: the uncertainty to two digits, the value to the same decimal."""

from __future__ import annotations

from math import floor, inf, log10

from virtual_lab.units import MPH

LEAST = 1e-9  # smallest uncertainty in print; smaller ones are rounding errors


def decimals(u: float) -> int:
    """Return the number of decimal places that prints `u` with two significant digits, at least 0.

    The number is 0 if `u` rounds to 10 or more. A `u` of 100 or more therefore keeps all its digits
    before the decimal point. The number is 6 if `u` is NaN, infinite, or at most 1e-9 (`LEAST`).
    """
    if not LEAST < u < inf:
        return 6
    places = 1 - floor(log10(u))
    # 0.0996 rounds up to 0.10, which needs one decimal less for two digits
    return max(0, places - 1 if float(f"{u:.{max(0, places)}f}") >= 10 ** (2 - places) else places)


def digits(u: float) -> str:
    """Return an uncertainty as text, normally with two significant digits.

    There are three exceptions:

    * From 100 on, the text is a whole number with all its digits.
    * If `u` is at most 1e-9 in any unit, the text is ``0``.
    * If `u` is not finite, the text is ``nan`` or ``inf``.
    """
    return "0" if u <= LEAST else f"{u:.{decimals(u)}f}"


def with_uncertainty(value: float, u: float) -> str:
    """Return a value and its uncertainty as text, such as ``0.9470 (u 0.0048)``.

    `u` has two significant digits, and the value has as many decimals as `u`. If `u` is at most
    1e-9, the value has six decimals and the text ends in ``(u 0)``. The value also has six decimals
    if `u` is not finite.
    """
    return f"{value:.{decimals(u)}f} (u {digits(u)})"


def expanded(value: float, u: float) -> str:
    """Return a value and its expanded uncertainty 2 u as text, such as ``0.947 ± 0.010``."""
    return f"{value:.{decimals(2 * u)}f} ± {digits(2 * u)}"


def both_units(unit: str) -> str:
    """Return the unit of a column as printed. A speed in mph is printed in m/s too."""
    return "mph (m/s)" if unit == "mph" else unit


def in_both_units(value: float, unit: str, form: str) -> str:
    """Return a number in the format `form`; a speed in mph as ``60.00 (26.82)``, then in m/s."""
    text = f"{value:{form}}"
    return f"{text} ({value * MPH:{form}})" if unit == "mph" else text


def with_unit(value: float, unit: str, form: str) -> str:
    """Return a number and its unit as text; a speed in both units: ``60.00 mph (26.82 m/s)``."""
    text = f"{value:{form}} {unit}".rstrip()
    other, size = {"mph": ("m/s", MPH), "m/s": ("mph", 1 / MPH)}.get(unit, ("", 1.0))
    return f"{text} ({value * size:{form}} {other})" if other else text


def with_axis_unit(name: str, unit: str) -> str:
    """Return the label of an axis, which for mph also states the size of the unit in m/s."""
    return f"{name}, {unit}{f' (1 mph = {MPH:.3f} m/s)' if unit == 'mph' else ''}".rstrip(", ")


def limit_message(text: str, value: float, low: float, high: float, places: int) -> str:
    """Return a message about a value outside its limits.

    The message has enough decimals that the printed value is also outside the printed limits.

    Parameters
    ----------
    text
        Format string with ``{0:.{d}f}`` for the value, ``{1:.{d}f}`` for the lower limit and
        ``{2:.{d}f}`` for the upper limit. ``{3:.{d}f}`` is a value in mph, converted to m/s.
    value, low, high
        Value and limits in the unit of the text. A value that is within the limits or NaN is
        printed with `places` decimals.
    places
        Smallest number of decimals.
    """
    digits = places
    while low <= float(f"{value:.{digits}f}") <= high and not low <= value <= high:
        digits += 1
    return text.format(value, low, high, value * MPH, d=digits)
