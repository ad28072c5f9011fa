"""A bat certification laboratory that does not exist, run exactly as a real one.

>>> import virtual_lab as vl
>>> certificate = vl.certify("r161", procedure="astm-f1881", seed=7)
>>> certificate.verdict
'PASS'

``help(vl)`` lists what there is; ``help(vl.certify)`` says how to use it. What takes a name (of a
bat, a ball, a procedure) takes the path of a .toml file or a sheet too, ``vl.procedure("bbcor")``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from virtual_lab.api import (
        Calibration,
        Certificate,
        Compared,
        InputError,
        Profiled,
        Sheet,
        Track,
        ball,
        bat,
        bias,
        board,
        calibrate,
        certify,
        chart,
        clip_coverage,
        convergence,
        coverage,
        critique,
        daily,
        effects,
        faults,
        fit_bat,
        instrument,
        paper,
        percussion,
        procedure,
        profile,
        reduce,
        rig,
        score,
        sensitivity,
        shelf,
        show,
        slope,
        stability,
        sweep,
        template,
        track,
    )
    from virtual_lab.bench.running import rehearse

__all__ = [
    "Calibration",
    "Certificate",
    "Compared",
    "InputError",
    "Profiled",
    "Sheet",
    "Track",
    "__version__",
    "ball",
    "bat",
    "bias",
    "board",
    "calibrate",
    "certify",
    "chart",
    "clip_coverage",
    "convergence",
    "coverage",
    "critique",
    "daily",
    "effects",
    "faults",
    "fit_bat",
    "instrument",
    "paper",
    "percussion",
    "procedure",
    "profile",
    "reduce",
    "rehearse",
    "rig",
    "score",
    "sensitivity",
    "shelf",
    "show",
    "slope",
    "stability",
    "sweep",
    "template",
    "track",
]
__version__ = "0.1.0"


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> object:
    """Load what is asked for, once."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module("virtual_lab.api"), name)
    globals()[name] = found
    return found
