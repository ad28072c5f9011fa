"""Consistency checks of a session's records, in addition to the procedure's windows."""

from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Discrepancy, Flag
from virtual_lab.measurement.diagnostics.flags import (
    CALIBRATION_DUE,
    CHECKS,
    SCALE_DRIFT,
    Checked,
    check,
    decisions_elsewhere,
    overdue,
)

__all__ = [
    "CALIBRATION_DUE",
    "CHECKS",
    "SCALE_DRIFT",
    "Checked",
    "Discrepancy",
    "Evidence",
    "Flag",
    "check",
    "decisions_elsewhere",
    "overdue",
]
