"""The look of every figure: black and grey, thin lines, text as text."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
INTERVAL_GREY = "0.85"  # grey of an interval; markers on it stay visible in greyscale print


def as_drawn(name: str) -> str:
    """Return a user's text escaped for Matplotlib, where $ begins a formula and _ hides a label.

    A text that begins with _ gets a space before it.
    """
    return f"{' ' if name.startswith('_') else ''}{name}".replace("$", r"\$")


@contextmanager
def figure_file(path: Path, height: float) -> Iterator[Figure]:
    """Yield an empty figure as wide as a page, and write it into a file at the end.

    Parameters
    ----------
    path
        File to write, its format by the name's ending.
    height
        Height of the figure [in].
    """
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE, after_reset=True):
        figure = Figure(figsize=(PAGE_WIDTH_IN, height), dpi=150, layout="constrained")
        yield figure
        figure.savefig(path)
