"""Page with the paper's Figs. 2 to 4, as this program computes them, and the table of claims."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from virtual_lab.output.chart_page import chart_page
from virtual_lab.output.style import page_figure
from virtual_lab.studies.bats.compare import BatComparison
from virtual_lab.studies.bats.curves import plot_comparison, plot_profile
from virtual_lab.studies.paper.claim import Row
from virtual_lab.studies.paper.computed import ALUMINIUM, BARREL, KNOB, WOOD, profiles_by_swing

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure


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
