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

WORDS = ""  # unit of strings, booleans and integers that count or number things
# unit of a column whose unit is stated in each row (column `unit`), or else by the quantity
PER_ROW = "of the row"


class ColumnMeaning(NamedTuple):
    """Meaning of a column and its unit, "1" for pure numbers."""

    meaning: str
    unit: str = PURE.ucum


_M = ColumnMeaning
# a name that ends in a unit has this unit; the others state it here
COLUMNS: dict[str, ColumnMeaning] = {
    # bat, procedure and laboratory of a test
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
    "reason": _M("reason of the verdict; empty: PASS, or no limit", WORDS),
    "flag_names": _M("names of the flags, separated by blanks", WORDS),
    "metric": _M("symbol of the procedure's metric", WORDS),
    "quantity": _M("name of the quantity", WORDS),
    "unit": _M("unit of the row's values; empty: a pure number", WORDS),
    "value": _M("measured or computed value", PER_ROW),
    "u": _M("standard uncertainty of the value", PER_ROW),
    "dof": _M("effective degrees of freedom of u"),
    "low": _M("lower end of the 95 % interval of the value", PER_ROW),
    "high": _M("upper end of the 95 % interval of the value", PER_ROW),
    "true_value": _M("true value", PER_ROW),
    "error": _M("value minus true value", PER_ROW),
    "z": _M("error divided by u"),
    "held": _M("whether the 95 % interval holds the true value", WORDS),
    "formula_error": _M("metric by the formula minus that with the standard ball", PER_ROW),
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
    "bat_speed_mph": _M("speed of the bat at the impact position"),
    "batted_speed_mph": _M("speed of the batted ball in the field, v_f"),
    "contacts": _M("number of contacts of ball and bat in one impact"),
    "slope_per_in": _M("slope of e_A along the barrel", "1/in"),
    # curves of a bat
    "against": _M("bat that is subtracted", WORDS),
    "swing_exponent": _M("exponent n of the swing law in the field"),
    "peak_restitution": _M("largest e on the barrel"),
    "peak_bat_performance_factor": _M("largest BPF on the barrel"),
    "peak_collision_efficiency": _M("largest e_A on the barrel"),
    "peak_batted_speed_mph": _M("largest v_f on the barrel"),
    "peak_restitution_position_in": _M("impact position of the largest e"),
    "peak_bat_performance_factor_position_in": _M("impact position of the largest BPF"),
    "peak_collision_efficiency_position_in": _M("impact position of the largest e_A"),
    "peak_batted_speed_position_in": _M("impact position of the largest v_f"),
    "restitution_difference_percent": _M("difference of the largest e, relative"),
    "bat_performance_factor_difference_percent": _M("difference of the largest BPF, relative"),
    "collision_efficiency_difference_percent": _M("difference of the largest e_A, relative"),
    "batted_speed_difference_mph": _M("difference of the largest v_f"),
    "law": _M("force law of the ball", WORDS),
    "exponent": _M("exponent of the force law"),
    "stiffness": _M("stiffness of the ball in the force law", "N/m^exponent"),
    "wall_time_ms": _M("time of contact of the ball with a wall"),
    "wall_force_kn": _M("largest force of the ball on a wall", "kN"),
    # a bat fitted to measurements
    "lowest": _M("lowest value of the bats that fit the data", PER_ROW),
    "highest": _M("highest value of the bats that fit the data", PER_ROW),
    "is_measured": _M("whether the quantity is among the measurements", WORDS),
    "remark": _M("remark", WORDS),
    # an uncertainty budget
    "component": _M("source of uncertainty", WORDS),
    "evaluation": _M("type A (from scatter) or B of the evaluation of u", WORDS),
    "sensitivity": _M("change of the result per unit of the component", PER_ROW),
    "contribution": _M("contribution of the component to u of the result", PER_ROW),
    "share_percent": _M("share of the component in the square of u"),
    # inputs and outputs of a model
    "output": _M("name of the output", WORDS),
    "input": _M("name of the input", WORDS),
    "method": _M("method that propagates the uncertainty", WORDS),
    # faults
    "fault": _M("name of the fault; none: a day without one", WORDS),
    "prediction": _M("predicted sign of the fault", WORDS),
    "detected": _M("share of laboratories that detect the fault"),
    "detected_by": _M("flags and verdicts that detect it, with their numbers", WORDS),
    "collision_efficiency_predicted": _M("predicted mean error of e_A"),
    "collision_efficiency_z": _M("mean error of e_A minus prediction, divided by its u"),
    "metric_bias": _M("mean error of the metric", PER_ROW),
    "metric_predicted": _M("predicted mean error of the metric", PER_ROW),
    "metric_z": _M("mean error of the metric minus prediction, divided by its u"),
    "as_predicted": _M("whether the outcome is the predicted one", WORDS),
    # probability of PASS
    "best_of": _M("number of tests of which one must pass", WORDS),
    "errors_of": _M("simulated bat whose errors the row has", WORDS),
    "invalid_probability": _M("probability that none of these tests is valid"),
    "pass_probability": _M("probability of PASS"),
    "pass_probability_if_valid": _M("probability of PASS of tests that are not INVALID"),
    # bats ranked by a procedure and in the field
    "error_free": _M("metric in an error-free laboratory", PER_ROW),
    "procedure_swing_exponent": _M("exponent n of the procedure's own swing law; empty: none"),
    "error_free_difference": _M("difference of the metric in an error-free laboratory", PER_ROW),
    "mean_difference": _M("mean difference of the metric over the laboratories", PER_ROW),
    "sd_difference": _M("standard deviation of this difference", PER_ROW),
    "opposite_probability": _M(
        "probability that a laboratory ranks the bats opposite to the field"
    ),
    "opposite": _M("number of laboratories that do", WORDS),
    "opposite_low": _M("lower end of the 95 % interval of the share of these laboratories"),
    "opposite_high": _M("upper end of the 95 % interval of the share of these laboratories"),
    "ranking": _M("same order, opposite order, by chance, tie or no result", WORDS),
    # comparison of laboratories
    "result": _M("which result of the test", WORDS),
    "term": _M("standard deviation (s_r, s_lot, s_L, s_R) or the factor that causes it", WORDS),
    "predicted": _M("predicted standard deviation", PER_ROW),
    "simulated": _M("simulated standard deviation", PER_ROW),
    "agrees": _M("whether both agree", WORDS),
    "factor_spread": _M("spread of the factor between laboratories", WORDS),
    # a ball in a clip
    "frame": _M("number of the frame, with a fraction for a contact", WORDS),
    "time_s": _M("time since the first frame"),
    "x_px": _M("position of the ball to the right, in the still frame"),
    "y_px": _M("position of the ball downward, in the still frame"),
    "radius_px": _M("radius of the ball in the picture"),
    "x_m": _M("first coordinate of the ball in the plane of its flight"),
    "y_m": _M("second coordinate of the ball in the plane of its flight"),
    "chi_square": _M("chi-square of the fit to the edge of the ball, per degree of freedom"),
    "flight": _M("number of the flight, from 1; empty: outside of flights", WORDS),
    "drift_x_px": _M("drift of the camera to the right"),
    "drift_y_px": _M("drift of the camera downward"),
    "right_m_per_s": _M("velocity of the ball to the right"),
    "up_m_per_s": _M("velocity of the ball upward"),
    "first_frame": _M("number of the first frame of the flight", WORDS),
    "last_frame": _M("number of the last frame of the flight", WORDS),
    "positions": _M("number of positions of the flight", WORDS),
    "speed_in_m_per_s": _M("speed at the start of the flight"),
    "speed_out_m_per_s": _M("speed at the end of the flight"),
    "angle_in_deg": _M("direction at the start of the flight"),
    "angle_out_deg": _M("direction at the end of the flight"),
    "acceleration_m_per_s2": _M("acceleration of the flight"),
    "contact_kind": _M("what the ball hit at the end of the flight", WORDS),
    "contact_time_s": _M("time of this contact"),
    # clips
    "clips": _M("number of clips with a result", WORDS),
    "missed_clips": _M("number of clips without a result", WORDS),
    "rms_error_percent": _M("root mean square of the relative error"),
    "rms_u_percent": _M("root mean square of the relative u"),
    "bias_percent": _M("mean of the relative error"),
    # a laboratory beside its twin
    "error_sd": _M("standard deviation of the errors on the twin's days", PER_ROW),
    "u_ratio": _M("ratio of the stated u to the standard deviation of the errors"),
    "finding": _M("finding on u, or on the reading", WORDS),
    "reading": _M("name of the reading", WORDS),
    "days_low": _M("2.5 % quantile of the reading on the twin's days", PER_ROW),
    "days_median": _M("median of the reading on the twin's days", PER_ROW),
    "days_high": _M("97.5 % quantile of the reading on the twin's days", PER_ROW),
    "tail_probability": _M("share of days as extreme as the records"),
    "adjusted_probability": _M("tail probability adjusted for the number of readings, by Holm"),
    "meaning": _M("meaning of the reading", WORDS),
    "noticed_from": _M("smallest size, relative to the full fault, noticed on 9 of 10 days"),
    "metric_shift": _M("median change of the metric by the full fault, over u"),
    # check standards from day to day
    "day": _M("number of the day, from 1", WORDS),
    "ball_restitution_sd": _M("standard deviation of the e0 of the hits of the day"),
    "ball_restitution_dof": _M("degrees of freedom of this standard deviation"),
    "true_wall_ratio": _M("true ratio of the rebound speed to that from a rigid wall"),
    "standardised": _M("deviation from the baseline, in its standard deviations"),
    "moving_range": _M("difference from the day before, in the same unit"),
    "ewma": _M("exponentially weighted moving average, in the same unit"),
    "cusum_up": _M("cumulative sum of deviations above the baseline"),
    "cusum_down": _M("cumulative sum of deviations below the baseline"),
    "alarms": _M("rules and charts that raise an alarm, of the check ball", WORDS),
    "cylinder_collision_efficiency": _M("mean e_A of the check cylinder"),
    "cylinder_alarms": _M("rules and charts that raise an alarm, of the check cylinder", WORDS),
    "standard": _M("name of the check standard", WORDS),
    "rule": _M("name of the rule or chart", WORDS),
    "first_alarm_day": _M("number of the day of the first alarm after the change", WORDS),
    "earlier_alarms": _M("number of days with an alarm before the change", WORDS),
    "delay_days": _M("number of days from the change to the alarm", "d"),
    # rehearsed days
    "trainee": _M("name of the folder of the trainee's day", WORDS),
    "day_title": _M("title of the day", WORDS),
    "right_verdict": _M("correct verdict, given the truth", WORDS),
    "brier": _M("Brier score of the stated confidence"),
    "result_score": _M("score of the result, 0 to 1"),
    "detection_score": _M("score of the detection of faults, 0 to 1"),
    "protocol_score": _M("score of the protocol, 0 to 1"),
    "record_score": _M("score of the notebook, 0 to 1"),
    "economy_score": _M("score of time and shots, 0 to 1"),
    "faults_named": _M("faults of the day that were named, separated by blanks", WORDS),
    "faults_missed": _M("faults of the day that were not named, separated by blanks", WORDS),
    "false_alarms": _M("faults that were named but not there, separated by blanks", WORDS),
    "time_min": _M("time of the day", "min"),
    "shots": _M("number of shots", WORDS),
    "curve": _M("score or fault of a learning curve", WORDS),
    "mean_so_far": _M("mean of the value up to this day"),
    "operator": _M("name of the simulated operator", WORDS),
    "seed": _M("seed of the day", WORDS),
    "entry": _M("number of the entry in the log", WORDS),
    "action": _M("action of the operator", WORDS),
    "entered": _M("what the operator entered", WORDS),
    "shown": _M("what the page showed", WORDS),
    "seal": _M("whether the sealed file and the start of the log are intact", WORDS),
    "replay_agrees": _M("whether the replay gives the entries of the log", WORDS),
    "same": _M("whether the replay shows the same", WORDS),
    # the catalog
    "kind": _M("kind of the entry", WORDS),
    "name": _M("name of the entry", WORDS),
    "title": _M("title in one line", WORDS),
    "metric_of_continuous_curve": _M("maximum of the exact curve along the barrel", PER_ROW),
    "metric_with_standard_ball": _M("metric of the bat struck by the standard ball", PER_ROW),
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
    # a laboratory's own data sheets
    "sheet": _M("data sheet, as kind/name", WORDS),
    "ours": _M("number that the records state", PER_ROW),
    "catalog": _M("number in the catalog", PER_ROW),
    "record": _M("constant or channel of the records that states the number", WORDS),
    # plans of a laboratory
    "plan": _M("number of the plan, or present, single change or floor", WORDS),
    "exchanged": _M("instruments that the plan exchanges", WORDS),
    "hits": _M("number of valid hits per impact position", WORDS),
    "final_hits": _M("number of hits at the best position after a scan, 0 for none", WORDS),
    "balls": _M("number of balls", WORDS),
    "wall_hits": _M("number of wall hits per ball and speed", WORDS),
    "minutes": _M("time of one test by the actions at the rehearsal bench", "min"),
    "planned_u": _M("u of the metric with a change, predicted from the budget", PER_ROW),
    "simulated_u": _M("median u of simulated tests", PER_ROW),
    "price": _M("price of a plan, all tests and instruments", "of the column currency"),
    "currency": _M("currency of the price", WORDS),
    "reaches": _M(
        "yes or no, beyond two standard errors of the simulated u; otherwise not decided", WORDS
    ),
    "compared": _M("cost of the plan: chosen, equal to it, or higher", WORDS),
}
PATTERNS: dict[str, ColumnMeaning] = {  # names with a part, *, that depends on the table
    "contribution.*": _M("contribution of * to u", PER_ROW),
    "batted_speed_*_mph": _M("largest v_f on the barrel by the swing law *", "mph"),
    "noticed_at_*": _M("share of days on which the fault is noticed at the size *"),
    "*_modes": _M("largest error of e_A with * bending modes"),
    "verdict_*": _M("number of tests with the verdict *", WORDS),
    "flag_*": _M("number of tests with the flag *", WORDS),
    "coverage_by_u_*": _M("coverage of tenth * of the laboratories, smallest u first"),
    "coverage_by_dof_*": _M("coverage of tenth * of the laboratories, fewest dof first"),
}
ENDINGS = {  # meaning of a name with this ending; {} is the meaning of the rest
    "u": "standard uncertainty: {}",
    "true": "true value: {}",
    "low": "lower end of the 95 % interval: {}",
    "high": "upper end of the 95 % interval: {}",
    "se": "standard error: {}",
    "bias": "mean error: {}",
}


def column_meaning(name: str) -> ColumnMeaning | None:
    """Return the meaning and unit of a column, or None if its name is not in the dictionary.

    The dictionary also covers derived names, which have one of the `ENDINGS` before the unit. For
    example, the meaning of ``speed_u_mph`` is derived from the meaning of ``speed_mph``.
    """
    unit = unit_of(name)
    if name in COLUMNS:
        entry = COLUMNS[name]
        return entry if unit == PURE else entry._replace(unit=unit.text)
    for pattern, entry in PATTERNS.items():
        if match := re.fullmatch(re.escape(pattern).replace(r"\*", "(.+)"), name):
            return entry._replace(meaning=entry.meaning.replace("*", match[1]))
    parts = name.split("_")
    for at, ending in enumerate(parts):
        if at and ending in ENDINGS:
            stem = column_meaning("_".join(parts[:at] + parts[at + 1 :]))
            if stem:
                return stem._replace(meaning=ENDINGS[ending].format(stem.meaning))
    return None


def units_of(columns: Iterable[str]) -> dict[str, str]:
    """Return the units of columns, keyed by column name.

    A column for which `column_meaning` has no entry is left out.
    """
    entries = {name: column_meaning(name) for name in columns}
    return {name: each.unit for name, each in entries.items() if each}


def with_units(table: pd.DataFrame) -> pd.DataFrame:
    """Store the units of a table's columns in its ``attrs["units"]``, and return the same table.

    ``attrs["units"]`` is a dictionary from column name to unit. A unit is "" for strings and
    counts, and "1" for pure numbers. A column that `column_meaning` does not know is left out.

    Some columns can have a different unit in each row. A table with such columns has a column
    ``unit`` with the unit of each row. If this unit is the same in all rows, it is stored as the
    unit of these columns. Otherwise ``of the row`` is stored.
    """
    units = units_of(map(str, table.columns))
    stated = set(table["unit"]) if "unit" in table else set()
    if len(stated) == 1:
        row_unit = stated.pop() or PURE.ucum
        units = {name: row_unit if unit == PER_ROW else unit for name, unit in units.items()}
    table.attrs["units"] = units
    return table
