"""All claims in the order of the paper, with what is found of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from virtual_lab.files import new_folder
from virtual_lab.studies.paper import conclusions, examples, metrics, models, procedures
from virtual_lab.studies.paper.claim import Claim, Row
from virtual_lab.studies.paper.page import draw_page, write_page

__all__ = ["CLAIMS", "Findings", "paper", "save_paper"]

CLAIMS: tuple[Claim, ...] = (
    *metrics.CLAIMS,
    *models.CLAIMS,
    *examples.CLAIMS,
    *procedures.CLAIMS,
    *conclusions.CLAIMS,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """The claims with what was found."""

    rows: tuple[Row, ...]

    @property
    def held(self) -> int:
        """How many rows hold."""
        return sum(row.holds for row in self.rows)

    @property
    def document(self) -> dict[str, Any]:
        """All of it for JSON."""
        return {
            "claims": len(self.rows),
            "hold": self.held,
            "rows": [row.document for row in self.rows],
        }


def paper(*, say: Callable[[str], None] = lambda _: None) -> Findings:
    """Return every claim of the paper with what is found; `say` is called with each section."""
    rows: list[Row] = []
    for claim in CLAIMS:
        if not rows or rows[-1].claim.section != claim.section:
            say(f"Sec. {claim.section}")
        rows.append(claim.row())
    return Findings(rows=tuple(rows))


def save_paper(found: Findings, folder: Path) -> None:
    """Write ``paper.csv``, ``paper.html`` and ``paper.png`` into a new folder."""
    import pandas as pd

    with new_folder(folder) as draft:
        pd.DataFrame([row.document for row in found.rows]).to_csv(draft / "paper.csv", index=False)
        figure = draw_page()
        write_page(found.rows, figure, draft / "paper.html")
        figure.savefig(draft / "paper.png")
