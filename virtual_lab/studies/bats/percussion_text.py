"""How e_A is read along the barrel of a pivoted bat, as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from virtual_lab.output.tables import Column, table_text

__all__ = ["percussion_text"]


def _milli(key: str, form: str) -> Callable[[Mapping[str, Any]], str]:
    """Return what prints a number in thousandths, blank where there is none."""
    return lambda row: "" if row[key] is None else f"{1e3 * row[key]:{form}}"


COLUMNS = {
    "z_in": Column("place from the tip", "in", ".2f"),
    "e_A": Column("true e_A", form=".4f"),
    "reaction_ns": Column("impulse on the axis", "N s", "+.2f"),
    "reaction_n": Column("mean force", "N", "+.0f"),
    "ring_mrad": Column("ring", "mrad", ".2f"),
    "seen": Column("rebounds seen", form=".0%"),
    "recoil_error": Column("by recoil: error", "1e-3", _milli("recoil_error", "+.2f")),
    "recoil_rms": Column("rms", "1e-3", _milli("recoil_rms", ".2f")),
    "recoil_u": Column("u", "1e-3", _milli("recoil_u", ".2f")),
    "rebound_error": Column("by rebound: error", "1e-3", _milli("rebound_error", "+.2f")),
    "rebound_rms": Column("rms", "1e-3", _milli("rebound_rms", ".2f")),
    "rebound_u": Column("u", "1e-3", _milli("rebound_u", ".2f")),
    "plain_shift": Column("shift, plain bearing", "1e-3", _milli("plain_shift", "+.3f")),
    "loose_shift": Column("shift, loose bearing", "1e-3", _milli("loose_shift", "+.3f")),
}


def percussion_text(rows: Sequence[Mapping[str, Any]], percussion_in: float) -> str:
    """Return a table of the places, and in words where the reading suffers."""
    near = min(rows, key=lambda row: abs(row["z_in"] - percussion_in))
    worst = max(rows, key=lambda row: abs(row["plain_shift"]))
    loose = max(rows, key=lambda row: abs(row["loose_shift"]))
    far = rows[-1]
    lost = [f"{row['z_in']:.3g}" for row in rows if row["seen"] < 0.5]
    words = [
        f"At the centre of percussion, {percussion_in:.2f} in, the axis bears "
        f"{near['reaction_ns']:+.2f} N s; at {worst['z_in']:.3g} in it bears "
        f"{worst['reaction_ns']:+.2f} N s, and a plain bearing shifts e_A by recoil by "
        f"{worst['plain_shift']:+.1e} there, "
        f"{abs(worst['plain_shift']) / worst['recoil_u']:.2f} of its u.",
        f"A loose bearing shifts it by {loose['loose_shift']:+.1e} at {loose['z_in']:.2f} in and "
        f"by {far['loose_shift']:+.0e} at {far['z_in']:.3g} in: play is an angle and no rate, but "
        "hard by the centre of percussion nothing presses the bat to take it up.",
    ]
    if lost:
        words.append(f"The gates miss most rebounds at {', '.join(lost)} in.")
    return (
        f"e_A by recoil and by rebound: error with nothing random; rms and u with randomness\n"
        f"{table_text(rows, COLUMNS)}\n\n" + "\n".join(words)
    )
