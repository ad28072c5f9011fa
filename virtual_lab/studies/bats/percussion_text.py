"""Errors of e_A along the barrel of a pivoted bat, as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any

from virtual_lab.output.tables import column, table_text


def _milli(key: str, form: str) -> Callable[[Any], str]:
    """Return what prints a number in thousandths, blank where there is none."""

    def text(row: object) -> str:
        value = getattr(row, key)
        return "" if value is None else f"{1e3 * value:{form}}"

    return text


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadError:
    """e_A by one method; None if no rebound was seen."""

    error: float | None = column("error", "1e-3", _milli("error", "+.2f"))  # with nothing random
    rms: float | None = column("rms", "1e-3", _milli("rms", ".2f"))  # of errors over laboratories
    u: float | None = column("u", "1e-3", _milli("u", ".2f"))  # stated, over laboratories


@dataclass(frozen=True, slots=True, kw_only=True)
class Struck:
    """A place of the bat: nominal values, and readings from recoil and rebound."""

    z_in: float = column("place from the tip", "in", ".2f")
    e_A: float = column("true e_A", form=".4f")
    reaction_ns: float = column("impulse on the axis", "N s", "+.2f")  # > 0: along the ball's way
    reaction_n: float = column("mean force", "N", "+.0f")
    ring_mrad: float = column("ring", "mrad", ".2f")  # of bending, its amplitude at the encoder
    seen: float = column("rebounds seen", form=".0%")
    recoil: ReadError
    rebound: ReadError
    plain_shift: float = column("shift, plain bearing", "1e-3", _milli("plain_shift", "+.3f"))
    loose_shift: float = column("shift, loose bearing", "1e-3", _milli("loose_shift", "+.3f"))


def percussion_text(rows: Sequence[Struck], percussion_in: float) -> str:
    """Return a table of the places, and sentences on the largest errors."""
    near = min(rows, key=lambda row: abs(row.z_in - percussion_in))
    worst = max(rows, key=lambda row: abs(row.plain_shift))
    loose = max(rows, key=lambda row: abs(row.loose_shift))
    far = rows[-1]
    lost = [f"{row.z_in:.3g}" for row in rows if row.seen < 0.5]
    words = [
        f"At the centre of percussion, {percussion_in:.2f} in, the axis bears "
        f"{near.reaction_ns:+.2f} N s; at {worst.z_in:.3g} in it bears "
        f"{worst.reaction_ns:+.2f} N s, and a plain bearing shifts e_A by recoil by "
        f"{worst.plain_shift:+.1e} there, "
        f"{abs(worst.plain_shift) / (worst.recoil.u or nan):.2f} of its u.",
        f"A loose bearing shifts it by {loose.loose_shift:+.1e} at {loose.z_in:.2f} in and "
        f"by {far.loose_shift:+.0e} at {far.z_in:.3g} in: play is an angle and no rate, but "
        "hard by the centre of percussion nothing presses the bat to take it up.",
    ]
    if lost:
        words.append(f"The gates miss most rebounds at {', '.join(lost)} in.")
    return (
        f"e_A by recoil and by rebound: error with nothing random; rms and u with randomness\n"
        f"{table_text(rows)}\n\n" + "\n".join(words)
    )
