"""How the bat is held while it is struck."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite

from virtual_lab.errors import InputError

__all__ = ["Clamped", "Free", "Pinned", "Support", "support_place", "support_words"]


@dataclass(frozen=True, slots=True)
class Free:
    """Not held at all: hands are too soft to matter while ball and bat touch."""


@dataclass(frozen=True, slots=True)
class Pinned:
    """A frictionless axis through the bat at `z` [m], rigid or on a spring across the bat.

    A rigid one holds the bat in place. One of finite stiffness [N/m] lets it bounce there: one
    more mode, the lowest but for the turn, counted among the bending ones.
    """

    z: float
    stiffness: float = inf


@dataclass(frozen=True, slots=True)
class Clamped:
    """Neither moves nor turns at `z` [m]."""

    z: float


Support = Free | Pinned | Clamped


def support_place(support: Support, length: float) -> float | None:
    """Return where the bat is held [m], None for a free one.

    Raises `InputError` for a place off the bat or a pivot without a positive stiffness.
    """
    if isinstance(support, Free):
        return None
    if not (isfinite(support.z) and 0 <= support.z <= length):
        name = type(support).__name__.lower()
        raise InputError(f"{name} bat", "z", support.z, f"allowed: 0 to {length:g} m")
    if isinstance(support, Pinned) and not support.stiffness > 0:
        value = support.stiffness
        raise InputError("pinned bat", "stiffness", value, "allowed: above 0 N/m; 0 is a free bat")
    return support.z


def support_words(support: Support) -> str:
    """Return how the bat is held in words."""
    match support:
        case Free():
            return "free"
        case Clamped(z=z):
            return f"clamped at {z:.6g} m"
        case Pinned(z=z, stiffness=k):
            return f"pinned at {z:.6g} m" + (f" on a spring of {k:.6g} N/m" if isfinite(k) else "")
