"""Style of every figure: black and gray, thin lines, text that can be searched."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

LayoutName = Literal["constrained", "compressed", "tight", "none"]

PAGE_WIDTH_IN = 6.9  # text width of an A4 page [in]
STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "virtual-lab",
    "font.size": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "legend.frameon": False,
    "lines.linewidth": 0.9,
    "lines.markersize": 5,
}
INTERVAL_GREY = "0.85"  # gray of an interval; markers on it stay visible in greyscale print


def as_drawn(name: str) -> str:
    """Return a user's text escaped for Matplotlib.

    Matplotlib treats a $ as the start of a formula, and hides a label that begins with _. A
    backslash is therefore added before each $, and a space before a leading _.
    """
    return f"{' ' if name.startswith('_') else ''}{name}".replace("$", r"\$")


@contextmanager
def page_figure(
    height: float, width: float = PAGE_WIDTH_IN, *, layout: LayoutName | None = "constrained"
) -> Iterator[PageFigure]:
    """Yield an empty figure. All drawing within the context has the style of this program.

    Parameters
    ----------
    height
        Height of the figure [in].
    width
        Width of the figure [in]; by default the width of a page.
    layout
        Layout engine of Matplotlib; None selects Matplotlib's default.
    """
    from matplotlib import style

    from virtual_lab.output.page_figure import PageFigure

    with style.context(STYLE, after_reset=True):
        yield PageFigure(figsize=(width, height), dpi=150, layout=layout, look=STYLE)
