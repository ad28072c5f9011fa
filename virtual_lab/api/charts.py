"""Speed against accuracy, and the valid range of the numerics: the studies of `fidelity`."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from virtual_lab.output.progress import Progress, quiet
from virtual_lab.parameters import ChartedPart, StablePart

if TYPE_CHECKING:
    from virtual_lab.fidelity.results import SpeedChart, StabilityMap


def chart(part: ChartedPart, *, progress: Progress = quiet) -> SpeedChart:
    """Show error and run time of the models of a part.

    A part of the laboratory has several models or methods.

    Parameters
    ----------
    part
        Part of the laboratory: ``collision``, ``motion`` or ``camera``.
    progress
        Function that is called with a message that names the current task. If it is not given, the
        functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        The part is unknown.
    """
    result: SpeedChart = _study(part, "chart")(progress)
    return result


def stability(part: StablePart, *, progress: Progress = quiet) -> StabilityMap:
    """Show the conditions under which numerical methods are valid.

    Each cell of a map has a state, such as good, inaccurate or unstable. In the maps of the
    collision, a cell is marked as refused if the program rejects its settings.

    Parameters
    ----------
    part
        Part of the laboratory: ``collision`` or ``camera``.
    progress
        Function that is called with a message that names the current task. If it is not given, the
        functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        The part is unknown.
    """
    result: StabilityMap = _study(part, "stability")(progress)
    return result


def _study(part: str, kind: str) -> Any:
    return getattr(import_module(f"virtual_lab.fidelity.{part}_{kind}"), f"{part}_{kind}")
