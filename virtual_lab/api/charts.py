"""Speed against accuracy, and the valid range of the numerics: the studies of `fidelity`."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from virtual_lab.errors import InputError, nearest
from virtual_lab.output.progress import Progress, quiet

if TYPE_CHECKING:
    from virtual_lab.fidelity.results import SpeedChart, StabilityMap

PARTS = ("collision", "motion", "camera")
CHARTED = (*PARTS, "uncertainty", "laboratory")


def chart(part: str, *, progress: Progress = quiet) -> SpeedChart:
    """Return error and run time of every model of a part.

    Parameters
    ----------
    part
        ``collision``, ``motion``, ``camera``, ``uncertainty``: methods to propagate it, or
        ``laboratory``: all parts of a test.
    progress
        Called with the present task.

    Raises
    ------
    InputError
        Another part.
    """
    found: SpeedChart = _study(part, "chart", CHARTED)(progress)
    return found


def stability(part: str, *, progress: Progress = quiet) -> StabilityMap:
    """Return a map of the conditions under which the numerical methods of a part are valid.

    Each point of the map is accurate, inaccurate, unstable or refused.

    Parameters
    ----------
    part
        ``collision``, ``motion`` or ``camera``.
    progress
        Function called with the current step.

    Raises
    ------
    InputError
        Any other part.
    """
    found: StabilityMap = _study(part, "stability", PARTS)(progress)
    return found


def _study(part: str, kind: str, parts: Sequence[str]) -> Any:
    if part not in parts:
        allowed = f"{nearest(part, parts)}allowed: {', '.join(parts)}"
        raise InputError("", kind, part, allowed)
    return getattr(import_module(f"virtual_lab.fidelity.{part}_{kind}"), f"{part}_{kind}")
