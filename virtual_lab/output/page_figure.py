"""A figure that shows itself in a notebook, and keeps its style in every file."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import style
from matplotlib.figure import Figure


class PageFigure(Figure):
    """A Matplotlib figure made without pyplot, so that no window opens and nothing stays in memory.

    Matplotlib makes some parts, such as ticks, only when a figure is written. `savefig` therefore
    uses the style in which the figure was drawn.
    """

    def __init__(self, *args: Any, look: Mapping[str, Any] | None = None, **options: Any) -> None:
        """Make an empty figure.

        Parameters
        ----------
        look
            Settings of Matplotlib that differ from its defaults.
        args, options
            As for `matplotlib.figure.Figure`.
        """
        super().__init__(*args, **options)
        self.look = dict(look or {})

    def savefig(self, fname: Any, **options: Any) -> None:
        """Write the figure into a file, like `matplotlib.figure.Figure.savefig`."""
        with style.context(self.look, after_reset=True):
            super().savefig(fname, **options)

    def write(self, path: str | Path | None) -> PageFigure:
        """Write the figure into a file if one is named, and return the figure."""
        if path is not None:
            self.savefig(path)
        return self

    def _repr_png_(self) -> bytes:
        """Return the PNG picture that a notebook shows."""
        file = BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()
