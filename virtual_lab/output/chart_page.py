"""A chart and the table of its numbers, as one self-contained HTML page."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from virtual_lab.output.template import page_template

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def chart_page(title: str, words: str, figure: Figure, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a self-contained HTML page with a figure and its table.

    Parameters
    ----------
    title
        Heading of the page.
    words
        Description of the figure.
    figure
        Figure, inserted as SVG.
    rows
        Rows of the table, at least one, all with the same keys. The keys are the column heads.
        Numbers are rounded to three significant digits; None gives an empty cell.
    """
    from markupsafe import Markup
    from matplotlib import rc_context

    drawn = io.StringIO()
    with rc_context({"svg.hashsalt": title}):
        figure.savefig(drawn, format="svg", metadata={"Date": None})
    svg = drawn.getvalue()
    columns = list(rows[0])
    return page_template("virtual_lab.output", "chart.html").render(
        title=title,
        words=words,
        figure=Markup(svg[svg.index("<svg") :]),  # this package draws the SVG
        columns=columns,
        texts=sum(isinstance(rows[0][name], str) for name in columns),
        rows=[[_cell(row[name]) for name in columns] for row in rows],
    )


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else f"{float(f'{value:.3g}'):g}"
