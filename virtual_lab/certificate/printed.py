"""The values of a certificate as printed. They are rounded once, for all printed forms.

All values come from the certificate's document.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import compress
from math import isfinite, sqrt
from typing import Any

from virtual_lab.certificate.columns import SHOTS
from virtual_lab.certificate.document import (
    BatAsMeasured,
    CameraWord,
    CertificateDocument,
    ComparedResult,
    ControlRatio,
    CorrectionStated,
    MetricStated,
    OtherRecoil,
    ReboundCheck,
    RiskStated,
    Stated,
    WidthStated,
)
from virtual_lab.measurement.diagnostics import CALIBRATION_DUE, SCALE_DRIFT
from virtual_lab.output.metrics import METRICS, QUANTITIES, MetricFormat
from virtual_lab.output.rounding import both_units, decimals, digits, in_both_units, with_unit
from virtual_lab.records.constants import PER_SI, constant_of
from virtual_lab.records.particulars import InstrumentIdentity
from virtual_lab.units import INCH, OUNCE, OZ_IN2, ZERO_CELSIUS

NONE = "–"
SYMBOLS = {
    "bat_performance_factor": "BPF",
    "collision_efficiency": "e_A",
    "restitution": "e",
    "recoil_factor": "r",
    "ball_restitution": "e0",
}
STAGES = {"bench": "Bench", "balls": "Wall rig", "impact": "Bat rig", "hall": "Hall"}
INPUTS = {  # components of a budget that are not calibration constants: printed words and unit
    "hits": ("Scatter from hit to hit", ""),
    "choice of the place": ("Choice of the impact position", ""),
    "bat.mass": ("Bat mass, readings", "g"),
    "bat.length": ("Bat length, readings", "mm"),
    "bat.balance": ("Balance point, readings", "mm"),
    "bat.barrel_radius": ("Barrel radius, readings", "mm"),
    "bat.period": ("Pendulum period, readings", "ms"),
    "balls.repeatability": ("Ball restitution, wall hits of each ball", ""),
    "balls.slope_repeatability": ("Decrease of ball restitution with speed, wall hits", "s/m"),
    "procedure.place_slope_error": ("Slope of e_A along the barrel, at the aim", ""),
    "aim.across_square": ("cannon, mean square aim across the bat", "mm²"),
    "camera.clock": ("camera, clock rate", "ppm"),
    "camera.focal": ("camera, focal length", "px"),
    "camera.plane": ("camera, height of the line of fire", "mm"),
    "camera.place_x": ("camera, position along the flight", "mm"),
    "camera.place_y": ("camera, position along the bat", "mm"),
    "camera.place_z": ("camera, height", "mm"),
}
IDENTITY = {  # identification of an instrument: printed words
    "identity": "Identity",
    "certificate": "Certificate",
    "date": "Calibrated",
    "due": "Due",
    "traceability": "Traceable to",
}
CONDITIONS = {  # conditions of the hall: printed unit, its number per SI unit, its zero
    "temperature": ("°C", 1.0, ZERO_CELSIUS),
    "humidity": ("% relative humidity", 100.0, 0.0),
    "pressure": ("hPa", 1e-2, 0.0),
}
VERDICTS = {
    "PASS": "The bat meets the limit",
    "FAIL": "The bat does not meet the rules",
    "INVALID": "The test is not valid and gives no verdict on the bat",
    "MEASURED": "The procedure sets no limit",
}


def printed_values(document: CertificateDocument) -> dict[str, Any]:
    """Return everything that a certificate prints, keyed by name.

    The type of a value depends on its kind:

    * A number is a string in printed units, rounded to its uncertainty; a dash or "" if missing.
    * A table is a list of rows, or a dictionary with ``heads`` and ``rows``; its cells are strings.
    * A group of values, such as ``conditions``, is a dictionary of strings.
    * A value that only switches a part of the certificate on or off, such as ``swung``, is a bool.
    * The number of shots in ``rebound`` is an int; 0 if the check was not made.
    * A part that the certificate does not have is None, "" or an empty list.
    """
    rings = document.ring.frequencies_hz if document.ring else ()
    return {
        "number": document.number,
        "made_by": _made_by(document),
        "result": printed_result(document),
        "quantities": _quantities(document),
        "bat": _bat(document.bat),
        "width": _width(document.width_m),
        "correction": _correction(document.ball_correction),
        "as_found": _as_found(document),
        "choice": _choice(document),
        "about_flags": _about_flags(document),
        "not_checked": _not_checked(document),
        "shots": _shots(document),
        "along": _along(document),
        "swings": _swings(document),
        "budget": printed_budget(document),
        "rebound": _rebound(document.rebound_check),
        "camera": _camera(document.second_witness),
        "conditions": _conditions(document),
        "identification": _halves(_identification(document)),
        "not_stated": document.particulars.list_missing(
            *(["test.deviations"] if document.deviations else [])
        ),
        "unverified": _halves(_list_unverified_values(document)),
        "instruments": _instruments(document.particulars.instruments),
        "other_recoil": _other_recoil(document.recoil.other if document.states_result else None),
        "fitted": _number(document.ring.fitted_ms, 0) if document.ring else NONE,
        "rings": ", ".join(f"{pitch:.0f}" for pitch in rings),
        "swung": any(row.bat_speed_mph is not None for row in document.shots),
    }


def _made_by(document: CertificateDocument) -> str:
    """Return the versions of program and libraries, and the commit of a clone."""
    parts = [f"{name} {each}" for name, each in document.versions.items()]
    if commit := document.commit:
        parts.append(f"commit {commit.id[:12]}" + (" with changes" if commit.changes else ""))
    return ", ".join(parts)


def _not_checked(document: CertificateDocument) -> list[str]:
    """Return sentences on the checks for which the records are incomplete."""
    names = [name for name in document.not_checked if name != SCALE_DRIFT]
    sentences = (
        [f"Not checked, because the recorders stored no individual readings: {', '.join(names)}."]
        if names
        else []
    )
    if SCALE_DRIFT in document.not_checked:
        sentences.append(
            "Not checked, because no reference mass was weighed before and after the test: "
            f"{SCALE_DRIFT}."
        )
    return sentences


def _about_flags(document: CertificateDocument) -> str:
    """Return a sentence on the meaning of a test's flags; "" without flags."""
    names = {flag.name for flag in document.flags}
    sentences = []
    if names - {CALIBRATION_DUE}:
        sentences.append(
            "A flag means that the records are inconsistent. A flag that does not make the test "
            "invalid leaves the verdict unchanged; find its cause before you use the result."
        )
    if CALIBRATION_DUE in names:
        sentences.append(
            "An instrument that was overdue for calibration may have drifted. This leaves the "
            "verdict unchanged; have the instrument calibrated before you use the result."
        )
    return " ".join(sentences)


def _conditions(document: CertificateDocument) -> dict[str, str]:
    """Return speeds and impact position of the hits as strings; "" for a missing value."""
    speed, place = document.v_rel_mph, document.impact_position_in
    return {
        "relative": "" if speed is None else with_unit(speed, "mph", ".2f"),
        "ball": with_unit(document.nominal_speed_mph, "mph", ".1f"),
        "bat": with_unit(document.nominal_bat_speed_mph, "mph", ".1f"),
        "place": _number(place, 2, ""),
        "place_mm": _number(None if place is None else place * INCH * 1e3, 1, ""),
    }


def _identification(document: CertificateDocument) -> list[list[str]]:
    """Return one row per item that identifies the test: its name and its value."""
    simulated, particulars = document.simulation is not None, document.particulars
    rigs = ", ".join(f"{rig} ({stage})" for stage, rig in document.rigs.items())
    day = document.date or "no date in the records"
    return [
        ["Bat", document.bat.name],
        ["Balls", document.ball.name],
        ["Procedure", f"{document.procedure.name}: {document.procedure.edition}"],
        ["Rigs", rigs],
        *([["Air in the hall", air]] if (air := _air(document)) else []),
        ["Computed by", f"Virtual laboratory{'' if simulated else ', from the records supplied'}"],
        *([] if particulars.test.begun else [["Tested", day]]),
        *map(list, particulars.list_statements(simulated=simulated)),
        *(["Deviation", each] for each in document.deviations),
    ]


def _air(document: CertificateDocument) -> str:
    """Return the readings of the air at the start and the end, and its density."""
    parts = []
    for each in document.conditions:
        unit, size, zero = CONDITIONS[each.name]
        u = each.u * size
        ends = [f"{end * size - zero:.{decimals(u)}f}" for end in (each.at_start, each.at_end)]
        parts.append(f"{' to '.join(dict.fromkeys(ends))} {unit} (u = {digits(u)})")
    if document.air_density_kg_per_m3:
        density = _with_u(document.air_density_kg_per_m3)
        parts.append(f"{density['value']} kg/m³ (u = {density['u']})")
    return "; ".join(parts)


def _halves(rows: list[list[str]]) -> list[list[list[str]]]:
    """Return rows in two halves, to be printed side by side, without empty halves."""
    half = (len(rows) + 1) // 2
    return [part for part in (rows[:half], rows[half:]) if part]


def _list_unverified_values(document: CertificateDocument) -> list[list[str]]:
    """Return key, value and source of the procedure's unverified values."""
    return [
        [
            each.key.replace("windows.", "window.").replace(".", ": ").replace("_", " "),
            each.value.replace("[", "").replace("]", ""),
            each.source,
        ]
        for each in document.unverified
    ]


def _instruments(stated: Mapping[str, InstrumentIdentity]) -> dict[str, object] | None:
    """Return heads and rows of the instruments, without empty columns."""
    every = [(name, *(getattr(each, key) for key in IDENTITY)) for name, each in stated.items()]
    if not every:
        return None
    filled = [any(column) for column in zip(*every, strict=True)]
    return {
        "heads": list(compress(("Instrument", *IDENTITY.values()), filled)),
        "rows": [[cell or NONE for cell in compress(row, filled)] for row in every],
    }


def _other_recoil(other: OtherRecoil | None) -> dict[str, str] | None:
    """Return the results that the same e_A gives with the recoil factor of the other support."""
    if other is None:
        return None
    return {
        "which": other.which,
        "recoil_factor": _number(other.recoil_factor, 4),
        "restitution": _number(other.restitution, 4),
        "bat_performance_factor": _number(other.bat_performance_factor, 4),
    }


def _swings(document: CertificateDocument) -> list[dict[str, str]]:
    """Return the printed metric for each exponent of the swing law."""
    metric = METRICS[document.metric.name]
    rows = []
    for row in document.swing_range:
        places = decimals(metric.in_unit(row.u))
        value, u, low, high = (
            _number(metric.in_unit(each), places, unit=metric.unit)
            for each in (row.value, row.u, *row.interval_95)
        )
        rows.append(
            {
                "exponent": f"{row.exponent:g}",
                "value": value,
                "u": u,
                "interval": f"{low} to {high}",
                "place": f"{row.impact_position_in:.2f}",
            }
        )
    return rows


def printed_result(document: CertificateDocument) -> dict[str, object]:
    """Return verdict, result, limit and number of hits in printed units, keyed by name.

    The values are strings, except for three bools:

    * `stated`: there is a result.
    * `decides`: the limit decides on the result; the bat meets every other rule.
    * `uncertain`: u is not printed as 0.

    Some documents state no result, for example for an INVALID test. The dictionary then has no
    `uncertain`, and no keys for the measured value, its uncertainty and its interval.
    """
    metric, verdict = document.metric, document.verdict
    printed = METRICS[metric.name]
    hits = f"{document.valid_hits} valid {'hit' if document.valid_hits == 1 else 'hits'}"
    if verdict == "INVALID":
        hits += f" ({document.procedure.hits_needed} required)"
    sentence = VERDICTS[verdict]
    stated = _format_result(metric, printed) if document.states_result else {}
    limit = "none" if metric.limit is None else printed.limit(metric.limit)
    if verdict == "PASS":
        sentence = f"{sentence}: {stated['value_text']} does not exceed {limit}"
    if document.reasons:
        joint = " for this bat; " if verdict == "MEASURED" else ": "
        sentence += joint + "; ".join(document.reasons)
    if document.risk:
        sentence = f"{sentence}. {_risk(document.risk)}"
    return {
        "words": printed.words,
        "symbol": printed.symbol,
        "unit": both_units(printed.unit),
        "verdict": verdict,
        "said": sentence,
        "hits": hits,
        "limit": limit,
        "stated": bool(stated),
        "u_first_order": _first_order(document) if stated else "",
        "decides": verdict in ("PASS", "FAIL")
        and bool(stated)
        and all(finding.met for finding in document.findings),
        **stated,
    }


def _first_order(document: CertificateDocument) -> str:
    """Return the combined u of the budget's lines as printed; "" if it prints like the stated u."""
    metric = METRICS[document.metric.name]
    combined = sqrt(sum(row.contribution**2 for row in document.budget))
    printed = digits(metric.in_unit(combined))
    return "" if printed == digits(metric.in_unit(document.metric.u or 0.0)) else printed


def _risk(risk: RiskStated) -> str:
    """Return a sentence on the specific risk of a verdict, without its period."""
    percent = 100 * risk.probability
    chance = f"is {percent:.2g} %" if percent >= 0.01 else "is below 0.01 %"
    side = "exceeds" if risk.of == "false acceptance" else "does not exceed"
    return (
        f"The risk that the true value {side} the limit {chance} (specific risk of {risk.of}, "
        "computed from this result alone, without a prior)"
    )


def _format_result(metric: MetricStated, printed: MetricFormat) -> dict[str, object]:
    """Return value, expanded uncertainty and interval as printed; {} without a result."""
    values = (metric.value, metric.u, metric.u_type_a, metric.u_type_b, *(metric.interval_95 or ()))
    numbers = [number for number in values if number is not None]
    if len(numbers) < len(values) or metric.interval_95 is None:
        return {}
    value, *_, low, high = numbers
    u, u_type_a, u_type_b = map(printed.in_unit, numbers[1:4])

    def write(number: float, size: float) -> str:
        return f"{number / size:.{decimals((high - value) / size)}f}"

    def expanded(size: float) -> str:
        return digits((high - value) / size)

    size, dof, certain = printed.unit_si, metric.dof, digits(u) == "0"
    return {
        "uncertain": not certain,
        "value": write(value, size),
        "expanded": expanded(size),
        "text": printed.text(lambda size: f"{write(value, size)} ± {expanded(size)}"),
        "value_text": printed.text(lambda size: write(value, size)),
        "interval": printed.text(lambda size: f"{write(low, size)} to {write(high, size)}"),
        "u": digits(u),
        "u_type_a": digits(u_type_a),
        "u_type_b": digits(u_type_b),
        "k": NONE if certain else f"{(high - value) / size / u:.2f}",
        "dof": "∞" if dof is None else f"{dof:.1f}" if dof < 100 else f"{dof:.0f}",
    }


def _quantities(document: CertificateDocument) -> list[dict[str, str]]:
    rows = [
        ("Bat performance factor", "BPF", "bat_performance_factor"),
        ("Collision efficiency", "e_A", "collision_efficiency"),
        ("Restitution of ball and bat", "e", "restitution"),
        (f"Recoil factor, {document.recoil.which} bat", "r", "recoil_factor"),
        ("Restitution, ball on a wall", "e_0", "ball_restitution"),
    ]
    quantities = document.quantities
    return [
        {"words": words, "symbol": symbol, **_with_u(quantities[name])}
        for words, symbol, name in rows
        if name in quantities and quantities[name].value is not None
    ]


def _bat(bat: BatAsMeasured) -> list[dict[str, str]]:
    rows = [
        ("Mass", bat.mass_kg, "oz", 1 / OUNCE, "g", 1e3),
        ("Length", bat.length_m, "in", 1 / INCH, "mm", 1e3),
        ("Balance point", bat.z_cm_m, "in", 1 / INCH, "mm", 1e3),
        ("Moment of inertia", bat.inertia_cm_kg_m2, "oz in²", 1 / OZ_IN2, "g m²", 1e3),
    ]
    return [
        {
            "words": words,
            "unit": unit,
            "si_unit": si_unit,
            **_with_u(stated, factor),
            "si": _with_u(stated, si_factor)["value"],
            "si_u": _with_u(stated, si_factor)["u"],
        }
        for words, stated, unit, factor, si_unit, si_factor in rows
    ]


def _correction(correction: CorrectionStated | None) -> str:
    """Return a sentence on the correction for balls that differ from the standard ball."""
    if correction is None:
        return ""
    standard, control = correction.standard, correction.control
    if control is None:
        return (
            f"is converted to a ball with e0 = {standard:g} by the method {correction.method}, a "
            "formula of this program that no standard states; its own error is not in u"
        )
    ratio = _with_u(control)
    return (
        f"has been divided by {ratio['value']} (u = {ratio['u']}), the ratio of the control bat's "
        f"e with this lot of balls to its reference value {standard:g}"
    )


def _as_found(document: CertificateDocument) -> dict[str, str] | None:
    """Return the metric with the balls of this test, with its unit; None without a correction."""
    correction = document.ball_correction
    if correction is None or correction.as_found is None or not document.states_result:
        return None
    printed, stated = METRICS[document.metric.name], correction.as_found
    text = printed.text(lambda size: _with_u(stated, 1 / size)["value"])
    return {**_with_u(stated, 1 / printed.unit_si), "text": text}


def _choice(document: CertificateDocument) -> str:
    """Return the correction for choosing the best position of a scan, with its unit."""
    if document.choice is None:
        return ""
    more = document.choice.correction
    return METRICS[document.metric.name].text(lambda size: digits(more / size))


def _width(width: WidthStated | None) -> dict[str, str] | None:
    if width is None:
        return None
    stated = (
        {"value": _number(width.value / INCH, 2), "u": ""}
        if width.u is None
        else _with_u(width, 1 / INCH)
    )
    ends = {"low": _number(width.from_in, 2), "high": _number(width.to_in, 2)}
    return stated | ends | {"drop": f"{width.drop:g}"}


def _shots(document: CertificateDocument) -> dict[str, object]:
    """Return heads, and one row per shot, without empty columns."""
    metric, heads, columns = METRICS[document.metric.name], [], []
    for name, column in ((each.row, each.printed) for each in SHOTS if each.printed):
        values = [getattr(row, name) for row in document.shots]
        blank = column.otherwise is None and all(value is None for value in values)
        if blank or (name == "impact_position_in" and not document.places):
            continue
        symbol, unit = column.symbol, column.unit
        if symbol == "metric":
            symbol, unit, values = metric.symbol, metric.unit, [*map(metric.in_unit, values)]
        heads.append({"symbol": symbol, "words": column.words, "unit": both_units(unit)})
        form = column.places, column.otherwise or NONE, unit
        columns.append([_number(value, *form) for value in values])
    cells = zip(*columns, strict=True)
    rows = [
        {"cells": [str(row.shot + 1), *each], "reason": row.reason}  # shots are printed from 1
        for row, each in zip(document.shots, cells, strict=True)
    ]
    return {"heads": heads, "rows": rows}


def _along(document: CertificateDocument) -> dict[str, object] | None:
    """Return symbols, units, means and u of a scan's quantities at each impact position."""
    if document.along is None:
        return None
    sizes = [printed_size(each.name) for each in document.along.quantities]
    rows = []
    fewest = [  # decimals of the mean of a single hit, which has no u
        min((decimals(u / size) for u in each.u if u is not None), default=4)
        for each, (_, _, size) in zip(document.along.quantities, sizes, strict=True)
    ]
    for number, place in enumerate(document.places):
        row = [_number(place.impact_position_in, 2), str(place.hits)]
        for each, (_, unit, size), few in zip(
            document.along.quantities, sizes, fewest, strict=True
        ):
            u = each.u[number]
            u = u if u is None else u / size
            places = few if u is None else decimals(u)
            row += [_number(value, places, unit=unit) for value in (each.mean[number] / size, u)]
        rows.append(row)
    heads = [{"symbol": symbol, "words": "", "unit": both_units(unit)} for symbol, unit, _ in sizes]
    return {"heads": heads, "rows": rows}


def printed_size(name: str) -> tuple[str, str, float]:
    """Return the symbol of a quantity, its printed unit, and the size of this unit in SI.

    A ratio has an empty unit and the size 1. Raises `KeyError` for an unknown name.
    """
    if name not in QUANTITIES:
        return SYMBOLS[name], "", 1.0
    printed = QUANTITIES[name]
    return printed.symbol, printed.unit, printed.unit_si


def _camera(camera: CameraWord | None) -> list[dict[str, str]]:
    """Return one row per quantity that the camera measured in addition; [] without a camera."""
    rows = []
    for name, symbol in (
        ("collision_efficiency", "e_A"),
        ("restitution", "e"),
        ("bat_performance_factor", "BPF"),
    ):
        compared: ComparedResult | None = getattr(camera, name, None)
        if compared is None:
            continue
        difference = compared.difference
        assert difference.value is not None
        assert difference.u is not None
        places = decimals(difference.u)
        row = {"symbol": symbol, "agree": "agree" if compared.agree else "disagree"}
        for by in ("gates", "video", "joined"):
            stated: Stated = getattr(compared, by)
            assert stated.u is not None
            row[by] = _number(stated.value, places)
            row[f"{by}_u"] = digits(stated.u)
        row["difference"] = f"{difference.value + 0.0:+.{places}f}".replace("-", "−")
        row["difference_u"] = digits(difference.u)
        rows.append(row)
    return rows


def printed_budget(document: CertificateDocument) -> list[dict[str, str]]:
    """Return the printed rows of the uncertainty budget. All values are strings.

    Each component with at least 1 % of the variance has a row. If there are smaller components, a
    last row combines them. The list is empty without a result, without a budget, or if u is printed
    as 0. A row has these keys:

    * ``words``: name of the input.
    * ``u``: uncertainty of the input with its unit; "" in the last row of smaller components.
    * ``type``: type of the evaluation, A, B or both.
    * ``contribution``: contribution to u of the metric, in the printed unit of the metric.
    * ``share``: share of the variance [%].
    """
    metric = METRICS[document.metric.name]
    rows, u = document.budget, metric.in_unit(document.metric.u or 0.0)
    if not document.states_result or not rows or digits(u) == "0":
        return []
    places = decimals(u) + 1
    large = [row for row in rows if row.share_percent >= 1]
    small = rows[len(large) :]  # rows are sorted, largest first
    lines = [
        {
            **printed_source(row.component, row.u),
            "type": row.evaluation,
            "contribution": f"{metric.in_unit(row.contribution):.{places}f}",
            "share": f"{row.share_percent:.1f}",
        }
        for row in large
    ]
    if small:
        contribution = metric.in_unit(sqrt(sum(row.contribution**2 for row in small)))
        lines.append(
            {
                "words": f"All others ({len(small)}), each below 1 %",
                "u": "",
                "type": ", ".join(sorted({row.evaluation for row in small})),
                "contribution": f"{contribution:.{places}f}",
                "share": f"{sum(row.share_percent for row in small):.1f}",
            }
        )
    return lines


def printed_source(name: str, u: float) -> dict[str, str]:
    """Return the words for a component of a budget, and its u [SI] in a suitable unit."""
    stage, _, rest = name.partition(".")
    number = re.search(r"_(\d+)$", name)
    if name in INPUTS:
        words, unit = INPUTS[name]
    elif constant := constant_of(name):
        words, unit = constant.words, constant.printed
        if number:
            words = words.format(number=int(number[1]) + 1)
        if stage in STAGES:
            words = f"{STAGES[stage]}: {words}"
    elif rest in INPUTS and stage in STAGES:
        words, unit = INPUTS[rest]
        words = f"{STAGES[stage]}: {words}"
    else:
        return {"words": name, "u": f"{u:.2g} (SI)"}
    return {"words": words, "u": f"{digits(u * PER_SI[unit])} {unit}".strip()}


def _rebound(check: ReboundCheck | None) -> dict[str, object]:
    if check is None or check.collision_efficiency is None or check.difference is None:
        return {"shots": 0}
    return {
        "shots": check.shots,
        "by_rebound": _number(check.collision_efficiency, 4),
        "by_recoil": _number(check.collision_efficiency - check.difference, 4),
        "difference": f"{round(check.difference, 4) + 0.0:+.4f}".replace("-", "−"),
        "u": "" if check.u is None else _number(check.u, 4),
    }


def _with_u(stated: Stated | WidthStated | ControlRatio, factor: float = 1.0) -> dict[str, str]:
    value, u = stated.value, stated.u
    if value is None or u is None:
        return {"value": NONE, "u": NONE}
    return {"value": f"{value * factor:.{decimals(u * factor)}f}", "u": digits(u * factor)}


def _number(value: float | None, places: int, otherwise: str = NONE, unit: str = "") -> str:
    if value is None or not isfinite(value):
        return otherwise
    return in_both_units(value, unit, f".{places}f").replace("-", "−")
