"""Consistency checks of a session's records, in addition to the procedure's windows."""

from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Discrepancy, Flag
from virtual_lab.measurement.diagnostics.flags import CHECKS, BlockChecked, Checked, check, overdue

__all__ = [
    "CHECKS",
    "BlockChecked",
    "Checked",
    "Discrepancy",
    "Evidence",
    "Flag",
    "check",
    "overdue",
]
