"""Rounding as on certificates: the uncertainty to two digits, the value to the same decimal."""

from __future__ import annotations

from math import floor, log10

LEAST = 1e-9  # smallest uncertainty in print; smaller ones are rounding errors


def decimals(u: float) -> int:
    """Return the number of decimal places, at least 0, that prints `u` with two significant digits.

    The number is 6 if `u` is NaN or at most `LEAST`. It is 0 if `u` rounds to 10 or more, so a `u`
    of 100 or more is printed with more than two digits. Raises `OverflowError` if `u` is inf.
    """
    if not u > LEAST:
        return 6
    places = 1 - floor(log10(u))
    # 0.0996 rounds up to 0.10, which needs one decimal less for two digits
    return max(0, places - 1 if float(f"{u:.{max(0, places)}f}") >= 10 ** (2 - places) else places)


def digits(u: float) -> str:
    """Return an uncertainty as text with two significant digits, from 100 on as a whole number.

    The text is ``0`` if `u` is at most 1e-9, whatever its unit, and ``nan`` if it is NaN. Raises
    `OverflowError` if `u` is inf.
    """
    return "0" if u <= LEAST else f"{u:.{decimals(u)}f}"


def with_uncertainty(value: float, u: float, word: str = "u") -> str:
    """Return a value and its uncertainty as text, ``0.9470 (u 0.0048)``.

    Both have the same number of decimals, chosen so that `u` has two significant digits. `word` is
    printed instead of ``u``. If `u` is at most 1e-9, the value has six decimals and the text ends
    in ``(u 0)``. Raises `OverflowError` if `u` is inf.
    """
    return f"{value:.{decimals(u)}f} ({word} {digits(u)})"


def beyond(text: str, value: float, low: float, high: float, places: int) -> str:
    """Return a message about a value outside its limits, with enough decimals to tell them apart.

    Parameters
    ----------
    text
        Format string with ``{0:.{d}f}`` for the value, ``{1:.{d}f}`` and ``{2:.{d}f}`` for the
        lower and upper limit.
    value, low, high
        Value and limits in the unit of the text. A value that is within the limits or NaN is
        printed with `places` decimals.
    places
        Smallest number of decimals.
    """
    digits = places
    while low <= float(f"{value:.{digits}f}") <= high and not low <= value <= high:
        digits += 1
    return text.format(value, low, high, d=digits)
