"""A simulated laboratory that certifies baseball bats and works like a real one.

>>> import virtual_lab as vl
>>> certificate = vl.certify("r161", procedure="astm-f1881", seed=7)
>>> certificate.verdict
'PASS'

``help(vl)`` lists all functions; ``help(vl.certify)`` describes one. Wherever a function takes the
name of a bat, ball or procedure it also takes the path of a .toml file or a sheet, such as
``vl.procedure("bbcor")``.
"""

from typing import TYPE_CHECKING, Any

from virtual_lab import api

if TYPE_CHECKING:
    from virtual_lab.api import *  # noqa: F403
    from virtual_lab.bench.running import rehearse

__all__ = ["__version__", "rehearse"]
__all__ += api.__all__
__version__ = "0.1.0"


def __dir__() -> list[str]:
    return sorted(__all__)


def __getattr__(name: str) -> Any:
    """Load an attribute at its first use."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = getattr(api, name)
    return globals()[name]
