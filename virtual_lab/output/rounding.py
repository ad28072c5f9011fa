"""Rounding as certificates do: the uncertainty to two digits, the value to the same place."""

from __future__ import annotations

from math import floor, log10


def decimals(u: float) -> int:
    """Return the decimal places that leave `u` two significant digits; 6 where u is 0."""
    if not u > 0:
        return 6
    places = 1 - floor(log10(u))
    # 0.0996 rounds up to 0.10, which has its two digits a place earlier
    return max(0, places - 1 if float(f"{u:.{max(0, places)}f}") >= 10 ** (2 - places) else places)


def with_uncertainty(value: float, u: float, word: str = "u") -> str:
    """Return ``0.9470 (u 0.0048)``."""
    places = decimals(u)
    return f"{value:.{places}f} ({word} {u:.{places}f})"
