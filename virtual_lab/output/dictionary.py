"""Dictionary of the columns of tables: one name per meaning, with its unit.

It covers the tables that functions return and that ``--csv`` and ``save`` write. Records and the
table of shots have dictionaries of their own, beside the code that writes them
(`virtual_lab.records`, `virtual_lab.certificate.columns`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

from virtual_lab.files.column_units import PURE, unit_of

if TYPE_CHECKING:
    import pandas as pd

WORDS = ""  # unit of texts, truth values and whole numbers that count or number things
PER_ROW = "of the row"  # that in the column `unit`; without this column, that of the quantity


class ColumnMeaning(NamedTuple):
    """Meaning of a column and its unit, "1" for pure numbers."""

    meaning: str
    unit: str = PURE.ucum


_M = ColumnMeaning
# the unit of a name that ends in a unit is the one in the name
COLUMNS: dict[str, ColumnMeaning] = {
    # what was tested
    "bat": _M("name of the bat", WORDS),
    "ball_name": _M("name of the ball", WORDS),
    "procedure": _M("name of the procedure", WORDS),
    "laboratory": _M("number of the laboratory, from 0", WORDS),
    "laboratory_name": _M("name of the laboratory", WORDS),
    "repeat": _M("number of the day of the laboratory, from 0", WORDS),
    "certificate": _M("number of the certificate", WORDS),
    "folder": _M("name of the result folder", WORDS),
    # result of a test or of a quantity
    "verdict": _M("verdict of the test: PASS, FAIL, INVALID or MEASURED", WORDS),
    "marginal": _M("whether the limit is within the 95 % interval", WORDS),
    "reason": _M("reason of FAIL or INVALID, else empty", WORDS),
    "flag_names": _M("names of the flags, separated by blanks", WORDS),
    "metric": _M("symbol of the procedure's metric", WORDS),
    "quantity": _M("name of the quantity", WORDS),
    "unit": _M("unit of the row's values; empty: a pure number", WORDS),
    "value": _M("measured or computed value", PER_ROW),
    "u": _M("standard uncertainty of the value", PER_ROW),
    "dof": _M("effective degrees of freedom of u"),
    "low": _M("lower end of the 95 % interval of the value", PER_ROW),
    "high": _M("upper end of the 95 % interval of the value", PER_ROW),
    "true": _M("true value", PER_ROW),
    "error": _M("value minus true value", PER_ROW),
    "z": _M("error divided by u"),
    "limit": _M("limit of the procedure for the metric", PER_ROW),
    "risk": _M("risk of a wrong verdict, with no knowledge of the bat before the test"),
    "valid_hits": _M("number of valid hits", WORDS),
    # quantities, in SI unless the name has another unit
    "restitution": _M("coefficient of restitution e of ball and bat"),
    "collision_efficiency": _M("collision efficiency e_A"),
    "ball_restitution": _M("coefficient of restitution e0 of the ball on a rigid wall"),
    "recoil_factor": _M("recoil factor r"),
    "bat_performance_factor": _M("bat performance factor e / e0"),
    "impact_position_in": _M("impact position, distance from the barrel tip"),
    # an uncertainty budget
    "component": _M("source of uncertainty", WORDS),
    "evaluation": _M("type A (from scatter) or B of the evaluation of u", WORDS),
    "sensitivity": _M("change of the result per unit of the component", PER_ROW),
    "contribution": _M("contribution of the component to u of the result", PER_ROW),
    "share_percent": _M("share of the component in the square of u"),
    "metric_of_continuous_curve": _M("maximum of the exact curve along the barrel", PER_ROW),
    "metric_as_found": _M("metric before the correction for the balls", PER_ROW),
    "width_m": _M("width of the curve along the barrel at the stated drop"),
    # a sheet of the catalog
    "source": _M("source of the number or of the term", WORDS),
    "verified": _M("whether somebody read the number in the source itself", WORDS),
    "note": _M("note", WORDS),
    # comparison of a result folder with its records
    "file": _M("name of the file", WORDS),
    "key": _M("key, column or line in a file", WORDS),
    "stated": _M("content of the file", WORDS),
    "expected": _M("content by the rest of the folder or by this program", WORDS),
    "state": _M("altered, or differs if another program made it", WORDS),
    # statistics over many laboratories
    "tests": _M("number of tests", WORDS),
    "missing": _M("number of tests without a sound part", WORDS),
    "mean": _M("mean of the value", PER_ROW),
    "sd": _M("standard deviation of the value", PER_ROW),
    "sd_within": _M("standard deviation of the value within a laboratory", PER_ROW),
    "laboratories": _M("number of laboratories with a result", WORDS),
    "invalid": _M("number of laboratories with an INVALID test", WORDS),
    "rejected": _M("share of hits that the procedure rejected"),
    "coverage": _M("share of 95 % intervals with the true value"),
    "above": _M("share of true values above the interval"),
    "below": _M("share of true values below the interval"),
    "mean_z": _M("mean of error divided by u"),
    "sd_z": _M("standard deviation of error divided by u"),
    "rms_error": _M("root mean square of the error", PER_ROW),
    "rms_u": _M("root mean square of the stated u", PER_ROW),
    "bias": _M("mean of the error", PER_ROW),
    "expected_bias": _M("bias that the method is expected to have", PER_ROW),
    # plans of a laboratory
    "plan": _M("number of the plan, or present, single change or floor", WORDS),
    "exchanged": _M("instruments that the plan exchanges", WORDS),
    "hits": _M("number of valid hits per impact position", WORDS),
    "final_hits": _M("number of hits at the best position after a scan, 0 for none", WORDS),
    "balls": _M("number of balls", WORDS),
    "wall_hits": _M("number of wall hits per ball and speed", WORDS),
    "minutes": _M("time of one test by the actions at the rehearsal bench", "min"),
    "price": _M("price of a plan, all tests and instruments", "of the column currency"),
    "currency": _M("currency of the price", WORDS),
    "planned_u": _M("median u predicted from the budget", PER_ROW),
    "simulated_u": _M("median u of simulated tests", PER_ROW),
    "reaches": _M("whether the simulated u reaches the target, within two standard errors", WORDS),
}
PATTERNS: dict[str, ColumnMeaning] = {  # names with a part, *, that depends on the table
    "contribution.*": _M("contribution of * to u", PER_ROW),
    "verdict_*": _M("number of tests with the verdict *", WORDS),
    "flag_*": _M("number of tests with the flag *", WORDS),
    "coverage_by_u_*": _M("coverage of tenth * of the laboratories, smallest u first"),
    "coverage_by_dof_*": _M("coverage of tenth * of the laboratories, fewest dof first"),
}
ENDINGS = {  # of names that follow from another name
    "u": "standard uncertainty: {}",
    "true": "true value: {}",
    "low": "lower end of the 95 % interval: {}",
    "high": "upper end of the 95 % interval: {}",
    "se": "standard error: {}",
}


def column_meaning(name: str) -> ColumnMeaning | None:
    """Return meaning and unit of a column, or None for a name that is not in the dictionary.

    A name with an ending such as ``_u``, before its unit if it has one, follows from the name
    without it.
    """
    unit = unit_of(name)
    if name in COLUMNS:
        known = COLUMNS[name]
        return known if unit == PURE else known._replace(unit=unit.text)
    for pattern, known in PATTERNS.items():
        if match := re.fullmatch(re.escape(pattern).replace(r"\*", "(.+)"), name):
            return known._replace(meaning=known.meaning.replace("*", match[1]))
    parts = name.split("_")
    for at, ending in enumerate(parts):
        if at and ending in ENDINGS:
            stem = column_meaning("_".join(parts[:at] + parts[at + 1 :]))
            if stem:
                return stem._replace(meaning=ENDINGS[ending].format(stem.meaning))
    return None


def units_of(columns: Iterable[str]) -> dict[str, str]:
    """Return the units of the columns that are in the dictionary, by name."""
    known = {name: column_meaning(name) for name in columns}
    return {name: each.unit for name, each in known.items() if each}


def with_units(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with the units of its columns in ``attrs["units"]``.

    The unit is empty for texts and counts, and "1" for pure numbers. Where all rows have the same
    `unit`, columns in this unit get it; otherwise their unit is ``of the row``.
    """
    units = units_of(map(str, table.columns))
    stated = set(table["unit"]) if "unit" in table else set()
    if len(stated) == 1:
        row_unit = stated.pop() or PURE.ucum
        units = {name: row_unit if unit == PER_ROW else unit for name, unit in units.items()}
    table.attrs["units"] = units
    return table
