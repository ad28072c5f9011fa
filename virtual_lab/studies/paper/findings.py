"""All claims of the paper, in order, with our results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from virtual_lab.catalog.reading import DATA
from virtual_lab.files.tables import write_csv
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.tables import table_text
from virtual_lab.studies.paper import computed, examples, metrics, models, procedures
from virtual_lab.studies.paper.claim import Claim, Row, read_claims
from virtual_lab.studies.paper.page import draw_page, write_page

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

FINDERS = {
    name: finder
    for section in (computed, metrics, models, examples, procedures)
    for name, finder in vars(section).items()
    if callable(finder) and finder.__module__ == section.__name__
}
CLAIMS: tuple[Claim, ...] = (
    *read_claims(DATA / "paper" / "claims.csv", FINDERS),
    *examples.table_one(),
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Findings(StudyResult):
    """The claims with our results."""

    claims: tuple[Row, ...]

    name = "paper"

    @property
    def title(self) -> str:
        """Title with the number of claims that agree."""
        return f"The paper of 2003: {self.held} of {len(self.claims)} claims hold"

    @property
    def rows(self) -> list[Mapping[str, float | str | bool | None]]:
        """One row per claim, as for JSON."""
        return [row.document for row in self.claims]

    @property
    def text(self) -> str:
        """All claims in a table, and the reason of each that does not hold."""
        table = table_text([row.cells for row in self.claims])
        reasons = [f"\n{row.claim.name}: {row.claim.lost}" for row in self.claims if not row.holds]
        return f"{table}\n\n{self.held} of {len(self.claims)} hold{''.join(reasons)}"

    def draw(self) -> PageFigure:
        """Draw the paper's Figs. 2 to 4."""
        return draw_page()

    def fill(self, folder: Path) -> None:
        """Write table, picture and page."""
        write_csv(self.table, folder / "paper.csv")
        figure = draw_page()
        write_page(self.claims, figure, folder / "paper.html")
        figure.savefig(folder / "paper.png")

    @property
    def held(self) -> int:
        """Number of claims that agree."""
        return sum(row.holds for row in self.claims)

    @property
    def document(self) -> Json:
        """The result as a JSON object."""
        return {
            "claims": len(self.claims),
            "hold": self.held,
            "rows": self.rows,
        }


def paper(*, progress: Progress = quiet) -> Findings:
    """Compare every number, figure and claim of the 2003 paper with the result of this program.

    Parameters
    ----------
    progress
        Function that is called with a message, the number of claims done, and the total. If it is
        not given, the functions of `virtual_lab` and the commands show the progress on stderr.
    """
    rows: list[Row] = []
    for claim in CLAIMS:
        progress("claims", len(rows), len(CLAIMS))
        rows.append(claim.row())
    return Findings(claims=tuple(rows))
