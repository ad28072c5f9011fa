"""Speed against accuracy, and where the numerics hold: the studies of `fidelity` as results."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from virtual_lab.errors import InputError, nearest
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import StudyResult

__all__ = ["Chart", "chart", "stability"]

PARTS = ("collision", "motion", "camera")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Chart(StudyResult):
    """A chart or a map of one part of a scene."""

    part: str
    kind: str
    rows: list[dict[str, Any]]

    @property
    def name(self) -> str:
        return f"{self.kind}-{self.part}"

    @property
    def title(self) -> str:
        """What is shown of what."""
        return f"{self.kind} of the {self.part}"

    @property
    def text(self) -> str:
        """The table, or the maps in letters."""
        return str(_study(self.part, self.kind).text(self.rows))

    def save(self, folder: str | Path) -> Path:
        """Write table, picture and, of a chart, the page into a new folder."""
        _study(self.part, self.kind).save(self.rows, Path(folder))
        return Path(folder)


def chart(part: str, *, progress: Progress = quiet) -> Chart:
    """Return the error of every model of a part against its time.

    Parameters
    ----------
    part
        ``collision``, ``motion`` or ``camera``.
    progress
        Told what is measured.

    Raises
    ------
    InputError
        Another part.
    """
    return _measured(part, "chart", progress)


def stability(part: str, *, progress: Progress = quiet) -> Chart:
    """Return the map of where the numerics of a part hold; parameters as `chart`."""
    return _measured(part, "stability", progress)


def _measured(part: str, kind: str, progress: Progress) -> Chart:
    if part not in PARTS:
        allowed = f"{nearest(part, PARTS)}allowed: {', '.join(PARTS)}"
        raise InputError("", kind, part, allowed)
    return Chart(part=part, kind=kind, rows=_study(part, kind).measure(say=progress))


def _study(part: str, kind: str) -> Any:
    """Return the module of `fidelity` that can `measure`, `save` and print `text`."""
    return import_module(f"virtual_lab.fidelity.{part}_{kind}")
