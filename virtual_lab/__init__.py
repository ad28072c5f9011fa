"""A simulated laboratory that certifies baseball bats and works like a real one.

>>> import virtual_lab as vl
>>> certificate = vl.certify("r161", procedure="astm-f1881", seed=7)
>>> certificate.verdict
'PASS'

``help(vl)`` lists all functions; ``help(vl.certify)`` describes one. Wherever a function takes the
name of a bat, ball or procedure it also takes the path of a .toml file or a sheet, such as
``vl.procedure("bbcor")``.
"""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

# The matrices here are small: threads inside one product wait for one another, and burn the
# processor while they do. Read as numpy loads; who has set one of them, or all, is left alone.
if "OMP_NUM_THREADS" not in os.environ:
    for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
        os.environ.setdefault(variable, "1")

from virtual_lab import api
from virtual_lab.errors import VERSION
from virtual_lab.files.caches import provide_cache

provide_cache(Path(__file__).parent)  # read as numba loads

if TYPE_CHECKING:
    from virtual_lab.api import *  # noqa: F403

__all__ = ["__version__"]
__all__ += list(api.PLACES)
__version__ = VERSION


def __dir__() -> list[str]:
    return sorted(__all__)


if not TYPE_CHECKING:  # a reader of types would take any name for one of ours

    def __getattr__(name: str) -> Any:
        """Load an attribute at its first use."""
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = getattr(api, name)
        return globals()[name]
