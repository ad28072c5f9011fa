"""Consistency checks of a session's records, in addition to the procedure's windows."""

from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Flag
from virtual_lab.measurement.diagnostics.flags import CHECKS, flags

__all__ = ["CHECKS", "Evidence", "Flag", "flags"]
