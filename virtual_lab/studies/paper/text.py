"""Text of the study of the paper for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from virtual_lab.output.tables import table_text
from virtual_lab.studies.paper.claim import Row


def paper_text(rows: Sequence[Row]) -> str:
    """Return one table of all claims, and the number that agree."""
    held = sum(row.holds for row in rows)
    return f"{table_text(cells(rows))}\n\n{held} of {len(rows)} hold"


def cells(rows: Sequence[Row]) -> list[dict[str, str]]:
    """Return the claims as texts, a row each."""
    return [
        {
            "section": row.claim.section,
            "where": row.claim.where,
            "claim": row.claim.says,
            "paper": "" if row.claim.paper is None else _number(row.claim.paper),
            "found": _number(row.found),
            "deviation": "" if row.deviation is None else _signed(row.deviation),
            "tolerance": row.claim.tolerance,
            "unit": row.claim.unit,
            "holds": "yes" if row.holds else "NO",
        }
        for row in rows
    ]


def _number(value: float) -> str:
    """Return four digits, more of what is a thousand and above."""
    if abs(value) >= 1000:
        return f"{value:.0f}"
    return f"{value:.1e}" if 0 < abs(value) < 1e-3 else f"{value:.4g}"


def _signed(value: float) -> str:
    if abs(value) < 1e-12:  # rounding
        return "0"
    return f"{'-' if value < 0 else '+'}{_number(abs(value))}"
