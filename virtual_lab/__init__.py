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
        Sheet,
        Track,
        ball,
        bat,
        board,
        calibrate,
        certify,
        instrument,
        procedure,
        reduce,
        rig,
        sweep,
        track,
    )
    from virtual_lab.api.charts import chart, stability
    from virtual_lab.bench.running import rehearse
    from virtual_lab.errors import InputError
    from virtual_lab.fidelity.mode_convergence import convergence
    from virtual_lab.studies.bats.ball_law import sensitivity
    from virtual_lab.studies.bats.compare import Compared, profile
    from virtual_lab.studies.bats.fit_bat import fit_bat
    from virtual_lab.studies.bats.percussion import percussion
    from virtual_lab.studies.bats.profile import Profiled
    from virtual_lab.studies.bias import bias
    from virtual_lab.studies.clips import clip_coverage
    from virtual_lab.studies.coverage import coverage
    from virtual_lab.studies.critique import critique
    from virtual_lab.studies.daily import daily
    from virtual_lab.studies.effects import effects
    from virtual_lab.studies.faults import faults
    from virtual_lab.studies.inventory import shelf
    from virtual_lab.studies.paper import paper
    from virtual_lab.studies.place_slope import slope
    from virtual_lab.studies.score import score_folder as score
    from virtual_lab.studies.template import template

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
    found = import_module("virtual_lab.api").of(name)
    globals()[name] = found
    return found
