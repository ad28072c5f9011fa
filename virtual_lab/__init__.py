"""A bat certification laboratory that does not exist, run exactly as a real one.

>>> import virtual_lab as vl
>>> certificate = vl.certify("r161", procedure="astm-f1881", seed=7)
>>> certificate.verdict
'PASS'

``help(vl)`` lists what there is; ``help(vl.certify)`` says how to use it. What takes a name (of a
bat, a ball, a procedure) takes the path of a .toml file or a sheet too, ``vl.procedure("bbcor")``.
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
    """Load what is asked for, once."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = getattr(api, name)
    return globals()[name]
