"""How e_A is read along the barrel of a pivoted bat, as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from virtual_lab.output.tables import table_text

__all__ = ["percussion_text"]

FORMS = {  # column: key in a row, format, scale
    "z, in": ("z_in", ".2f", 1.0),
    "e_A": ("e_A", ".4f", 1.0),
    "axis, N s": ("reaction_ns", "+.2f", 1.0),
    "axis, N": ("reaction_n", "+.0f", 1.0),
    "ring, mrad": ("ring_mrad", ".2f", 1.0),
    "seen": ("seen", ".0%", 1.0),
    "recoil: error": ("recoil_error", "+.2f", 1e3),
    "rms": ("recoil_rms", ".2f", 1e3),
    "u": ("recoil_u", ".2f", 1e3),
    "rebound: error": ("rebound_error", "+.2f", 1e3),
    "rms ": ("rebound_rms", ".2f", 1e3),
    "u ": ("rebound_u", ".2f", 1e3),
    "plain": ("plain_shift", "+.3f", 1e3),
    "loose": ("loose_shift", "+.3f", 1e3),
}


def percussion_text(rows: Sequence[Mapping[str, Any]], percussion_in: float) -> str:
    """Return a table of the places, and in words where the reading suffers."""
    cells = [
        {
            column: "" if row[key] is None else f"{scale * row[key]:{form}}"
            for column, (key, form, scale) in FORMS.items()
        }
        for row in rows
    ]
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
        f"errors, u and shifts of e_A in 1e-3, without and with randomness\n{table_text(cells)}\n\n"
        + "\n".join(words)
    )
