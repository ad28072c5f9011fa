"""Rounding as certificates do: the uncertainty to two digits, the value to the same place."""

from __future__ import annotations

from math import floor, log10

LEAST = 1e-9  # smallest uncertainty in print; smaller ones are rounding errors


def decimals(u: float) -> int:
    """Return the number of decimal places that leaves `u` two significant digits, at least 0.

    The number is 6 if u is 0, rounding error only, or NaN.
    """
    if not u > LEAST:
        return 6
    places = 1 - floor(log10(u))
    # 0.0996 rounds up to 0.10, whose two digits need one decimal less
    return max(0, places - 1 if float(f"{u:.{max(0, places)}f}") >= 10 ** (2 - places) else places)


def digits(u: float) -> str:
    """Return an uncertainty as text with two significant digits; ``0`` for rounding error only."""
    return "0" if u <= LEAST else f"{u:.{decimals(u)}f}"


def with_uncertainty(value: float, u: float, word: str = "u") -> str:
    """Return a value and its uncertainty as text, ``0.9470 (u 0.0048)``.

    Both have the decimal places that leave `u` two significant digits. `word` replaces the u. A u
    of 0 gives six decimal places and ``(u 0)``.
    """
    return f"{value:.{decimals(u)}f} ({word} {digits(u)})"


def beyond(text: str, value: float, low: float, high: float, places: int) -> str:
    """Return a text about a value outside its limits, with enough decimals to show that it is.

    Parameters
    ----------
    text
        Has ``{0:.{d}f}`` for the value, ``{1:.{d}f}`` and ``{2:.{d}f}`` for the limits.
    value, low, high
        In the unit of the text; a value within the limits is printed with `places`.
    places
        Fewest decimal places.
    """
    digits = places
    while low <= float(f"{value:.{digits}f}") <= high and not low <= value <= high:
        digits += 1
    return text.format(value, low, high, d=digits)
