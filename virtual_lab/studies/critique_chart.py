"""Chart of the probability of a wrong ranking, one cell per pair of bats and procedure."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin
from typing import TYPE_CHECKING, Any, NamedTuple

from virtual_lab.output.style import as_drawn, page_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from virtual_lab.output.page_figure import PageFigure


class Mark(NamedTuple):
    """Marker, size and colors of a verdict."""

    words: str
    marker: str
    size: float  # size of the marker [pt]
    face: str
    edge: str
    ink: str  # color of the number


class PageLayout(NamedTuple):
    """Dimensions of the page [in]."""

    cell: float = 0.32
    least_width: float = 7.2  # smallest width, which the sentences at the top and the legend need
    right: float = 0.1
    above: float = 1.05
    below: float = 1.6  # smallest height below the panels; more for long names
    legend: float = 0.3
    letter: float = 0.06  # width per letter of a name
    gap: float = 0.62  # gap between panels, with the differences in the field


MARKS = {
    "same order": Mark("same order, reliably", "o", 17, "#56b4e9", "#0072b2", "black"),
    "by chance": Mark("order by chance", "D", 14, "#f0e442", "#8a7f00", "black"),
    "opposite order": Mark("opposite order, reliably", "s", 17, "#b34a00", "black", "white"),
    "tie": Mark("no difference in the field", "_", 8, "0.5", "0.5", "0.5"),
    "no result": Mark("no test result", "x", 8, "0.5", "0.5", "0.5"),
}
PAGE = PageLayout()
SLANT = 55  # angle of the procedures' names [°]


def draw_critique(pairs: pd.DataFrame) -> PageFigure:
    """Draw the probability that a laboratory ranks two bats in the wrong order.

    There is one panel per exponent n of the swing law. A panel has one row per pair of bats and one
    column per procedure. The number in a cell is the probability, in percent, that the order is
    opposite to the order of the bats in the field.

    Parameters
    ----------
    pairs
        The table of `Critique`, one row per pair of bats, exponent and procedure; at least one row.
    """
    rows: list[Any] = list(pairs.itertuples())
    swings = list(dict.fromkeys(row.swing_exponent for row in rows))
    bats = list(dict.fromkeys((row.bat, row.against) for row in rows))
    procedures = {row.procedure: _procedure_label(row) for row in rows}
    letters = max(len(name.replace("$", "")) for name in procedures.values())
    longest = PAGE.letter * letters  # length of the longest name, which is slanted
    down, aside = sin(radians(SLANT)) * longest, cos(radians(SLANT)) * longest
    bottom = max(PAGE.below, PAGE.legend + down)
    names_width = PAGE.gap + PAGE.letter * max(len(_pair_name(pair)) for pair in bats)
    left_of_all = max(names_width, aside)
    panel = PAGE.cell * len(procedures), PAGE.cell * len(bats)
    panels = PAGE.gap * (len(swings) - 1) + panel[0] * len(swings)
    width = max(left_of_all + PAGE.right + panels, PAGE.least_width)
    height = PAGE.above + bottom + panel[1]
    sentences = (
        ("Does the test rank two bats in the same order as play on the field?", 0.2, 10),
        (
            "Number: probability [%] that a laboratory finds the opposite order; "
            "reliably: at least 95 %.",
            0.41,
            7.5,
        ),
        (
            "$\\Delta v_f$: difference of the largest batted-ball speeds in the field, first minus "
            "second bat (1 mph = 0.447 m/s); swing law: $I^{-n}$.",
            0.56,
            7.5,
        ),
    )
    with page_figure(height, width, layout=None) as figure:
        for i, n in enumerate(swings):
            left = left_of_all + i * (panel[0] + PAGE.gap)
            box = (left / width, bottom / height, panel[0] / width, panel[1] / height)
            axes = figure.add_axes(box)
            swing_rows = [row for row in rows if row.swing_exponent == n]
            _panel(axes, swing_rows, bats, procedures)
            axes.set_title(f"$n={n:g}$", pad=12, loc="center")
            if i == 0:
                axes.set_yticks(range(len(bats)), [as_drawn(_pair_name(pair)) for pair in bats])
                axes.tick_params(axis="y", pad=30)
        for text, below, size in sentences:
            figure.text(0.08 / width, 1 - below / height, text, fontsize=size, va="center")
        verdicts = set(pairs["ranking"])
        handles = [_handle(verdict) for verdict in MARKS if verdict in verdicts]
        figure.legend(handles=handles, loc="lower center", ncols=len(handles), handletextpad=0.3)
    return figure


def _panel(
    axes: Axes, rows: Sequence[Any], bats: list[tuple[str, str]], procedures: dict[str, str]
) -> None:
    from pandas import isna

    for row in rows:
        x, y = list(procedures).index(row.procedure), bats.index((row.bat, row.against))
        mark = MARKS[row.ranking]
        axes.plot(
            x,
            y,
            mark.marker,
            markersize=mark.size,
            markerfacecolor=mark.face,
            markeredgecolor=mark.edge,
            markeredgewidth=0.8,
            zorder=2,
        )
        if not isna(row.opposite_probability):
            percent = _percent(row.opposite_probability)
            axes.text(
                x, y, percent, ha="center", va="center", fontsize=6.5, color=mark.ink, zorder=3
            )
    for y, pair in enumerate(bats):
        difference = next(
            row.batted_speed_difference_mph for row in rows if (row.bat, row.against) == pair
        )
        axes.text(
            -0.62, y, f"{difference:+.1f}".replace("-", "−"), ha="right", va="center", fontsize=7
        )
    axes.text(-0.62, -0.62, "$\\Delta v_f$, mph", ha="right", va="bottom", fontsize=6.5)
    axes.set_xlim(-0.5, len(procedures) - 0.5)
    axes.set_ylim(len(bats) - 0.5, -0.5)
    axes.set_xticks(
        range(len(procedures)),
        procedures.values(),
        rotation=SLANT,
        ha="right",
        rotation_mode="anchor",
    )
    axes.set_yticks([])
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    for edge_at in range(len(bats) + 1):
        axes.axhline(edge_at - 0.5, color="0.85", linewidth=0.5, zorder=1)


def _pair_name(pair: tuple[str, str]) -> str:
    return " – ".join(pair)


def _procedure_label(row: Any) -> str:
    from pandas import isna

    exponent = (
        "" if isna(row.procedure_swing_exponent) else f", $n={row.procedure_swing_exponent:g}$"
    )
    metric = {"e": "$e$", "v_f": "$v_f$"}.get(row.metric, row.metric)
    return f"{as_drawn(row.procedure)} ({metric}{exponent})"


def _handle(verdict: str) -> Any:
    from matplotlib.lines import Line2D

    mark = MARKS[verdict]
    return Line2D(
        [],
        [],
        linestyle="",
        marker=mark.marker,
        markersize=7,
        label=mark.words,
        markerfacecolor=mark.face,
        markeredgecolor=mark.edge,
    )


def _percent(probability: float) -> str:
    """Return a probability [%] as printed; "<1" if it rounds to 0, ">99" if it rounds to 100."""
    percent = 100 * probability
    if percent < 0.5:
        return "<1"
    return ">99" if percent > 99.5 else f"{percent:.0f}"
