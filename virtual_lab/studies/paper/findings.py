"""All claims of the paper, in order, with our results, and the page with its Figs. 2 to 4."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from virtual_lab.catalog.reading import DATA
from virtual_lab.files.tables import write_csv
from virtual_lab.output.chart_page import chart_page
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.style import page_figure
from virtual_lab.output.tables import table_text
from virtual_lab.studies.bats.compare import BatComparison
from virtual_lab.studies.bats.curves import plot_comparison, plot_profile
from virtual_lab.studies.paper import computed, examples, metrics, models, procedures
from virtual_lab.studies.paper.claim import Claim, Row, read_claims
from virtual_lab.studies.paper.computed import ALUMINIUM, BARREL, KNOB, WOOD, profiles_by_swing

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


def draw_page() -> PageFigure:
    """Return one figure with the paper's Figs. 2, 3 and 4 side by side.

    Fig. 2 is computed for the swing exponent 0, Figs. 3 and 4 for the exponents 0 and 0.5.
    """
    with page_figure(6.6, 12.6) as figure:
        grid = figure.add_gridspec(1, 3, wspace=0.03)
        parts = [figure.add_subfigure(grid[0, column]) for column in range(3)]
        above, below = parts[0].subplots(2, 1, sharex=True)
        plot_profile(above, below, profiles_by_swing(WOOD)[0.0].table)
        above.set_title("Fig. 2: wood, swung at 45 rad/s")
        bare = []
        pairs = (
            ("Fig. 3: wood and aluminum", WOOD, ALUMINIUM),
            ("Fig. 4: barrel- and knob-loaded", BARREL, KNOB),
        )
        for part, (title, first, second) in zip(parts[1:], pairs, strict=True):
            swung = tuple(profiles_by_swing(bat)[n] for bat in (first, second) for n in (0.0, 0.5))
            top, middle, bottom = panels = part.subplots(3, 1, sharex=True)
            plot_comparison(panels, BatComparison(profiles=swung).curves)
            top.set_title(title)
            for axes in (top, bottom):
                axes.legend(loc="lower center", ncols=2)
            bare.append(middle)
        for axes in figure.axes:
            if axes not in bare:
                low, high = axes.get_ylim()
                axes.set_ylim(low - 0.22 * (high - low), high)  # the legend is below the curves
    return figure


def write_page(rows: Sequence[Row], figure: PageFigure, path: Path) -> None:
    """Write one self-contained HTML page with a figure and the table of the paper's claims.

    `rows` are the claims, and `path` is the file. An existing file is overwritten.
    """
    table = [row.cells | {"reason": row.claim.lost or row.claim.why} for row in rows]
    title = "Characterizing the performance of baseball bats: the paper and the virtual laboratory"
    words = (
        "Figs. 2 to 4 of the paper of 2003 as this program computes them, and the numbers and "
        "statements of its Secs. II to VI: number in the paper, our result, deviation, tolerance, "
        "and the reason for the tolerance or for a disagreement."
    )
    path.write_text(chart_page(title, words, figure, table), encoding="utf-8")
