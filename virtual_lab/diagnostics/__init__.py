"""Does a session hang together? What its records say of themselves, beside the rules' windows."""

from virtual_lab.diagnostics.evidence import Evidence
from virtual_lab.diagnostics.flag import Flag
from virtual_lab.diagnostics.flags import CHECKS, flags

__all__ = ["CHECKS", "Evidence", "Flag", "flags"]
