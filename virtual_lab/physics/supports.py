"""How the bat is held while it is struck."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from virtual_lab.errors import InputError

__all__ = ["Clamped", "Free", "Pinned", "Support", "support_place"]


@dataclass(frozen=True, slots=True)
class Free:
    """Not held at all: hands are too soft to matter while ball and bat touch."""


@dataclass(frozen=True, slots=True)
class Pinned:
    """A rigid, frictionless axis through the bat at `z` [m]."""

    z: float


@dataclass(frozen=True, slots=True)
class Clamped:
    """Neither moves nor turns at `z` [m]."""

    z: float


Support = Free | Pinned | Clamped


def support_place(support: Support, length: float) -> float | None:
    """Return where the bat is held [m], None for a free one. `InputError` if off the bat."""
    if isinstance(support, Free):
        return None
    if not (isfinite(support.z) and 0 <= support.z <= length):
        name = type(support).__name__.lower()
        raise InputError(f"{name} bat", "z", support.z, f"allowed: 0 to {length:g} m")
    return support.z
