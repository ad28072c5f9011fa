"""A bat certification laboratory that does not exist, run exactly as a real one.

>>> import virtual_lab as vl
>>> certificate = vl.certify("r161", procedure="astm-f1881", seed=7)
>>> certificate.verdict
'PASS'
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from virtual_lab.api import Certificate, Track, certify, reduce, track
    from virtual_lab.errors import InputError
    from virtual_lab.studies.bats.profile import Profiled, profile

__all__ = [
    "Certificate",
    "InputError",
    "Profiled",
    "Track",
    "__version__",
    "certify",
    "profile",
    "reduce",
    "track",
]
__version__ = "0.1.0"

_HOMES = {
    "Certificate": "virtual_lab.api",
    "certify": "virtual_lab.api",
    "reduce": "virtual_lab.api",
    "Track": "virtual_lab.api",
    "track": "virtual_lab.api",
    "InputError": "virtual_lab.errors",
    "Profiled": "virtual_lab.studies.bats.profile",
    "profile": "virtual_lab.studies.bats.profile",
}


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> object:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
