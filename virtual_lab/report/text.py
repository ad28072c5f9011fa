"""Certificates, scores, sheets and profiles as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from virtual_lab.report.metrics import METRICS
from virtual_lab.report.rounding import with_uncertainty
from virtual_lab.report.witness import witness_text
from virtual_lab.specs import PublishedBat
from virtual_lab.units import INCH, OUNCE, OZ_IN2

__all__ = [
    "certificate_text",
    "comparison_text",
    "number",
    "profile_text",
    "score_text",
    "sensitivity_text",
    "sheet_text",
    "table_text",
]

WORDS = {
    "bat_performance_factor": "BPF",
    "collision_efficiency": "e_A",
    "restitution": "e",
    "recoil_factor": "r",
    "ball_restitution": "e0",
}


def table_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows of one shape as a table with a header, columns as wide as they need."""
    if not rows:
        return "nothing"
    cells = [[_cell(value) for value in row.values()] for row in rows]
    lines = [list(rows[0]), *cells]
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def certificate_text(document: Mapping[str, Any]) -> str:
    """Return what a certificate says, in a dozen lines."""
    metric, procedure = document["metric"], document["procedure"]
    marginal = ", marginal: the limit lies within the 95 % interval" if document["marginal"] else ""
    lines = [
        f"{document['bat']['name']} by {procedure['name']} ({procedure['edition']})",
        f"  {document['verdict']}{marginal}",
    ]
    if metric["value"] is not None:
        lines.append("  " + _metric_line(metric))
        lines += [
            f"  {word:4} {with_uncertainty(document[name]['value'], document[name]['u'])}"
            f"{'   ' + document['recoil']['which'] if name == 'recoil_factor' else ''}"
            for name, word in WORDS.items()
            if name in document
        ]
        place = document["impact_position_in"]
        lines.append(f"  at {document['v_rel_mph']:.2f} mph, {place:.2f} in from the tip")
        lines += _width_lines(document["width_m"])
        lines += _control_lines(document["ball_correction"])
        lines += witness_text(document["second_witness"])
    if document["incomplete"]:
        lines.append(f"  incomplete: {document['incomplete']}")
    lines += [
        f"  {'meets' if finding['met'] else 'FAILS'}: {finding['sentence']}"
        for finding in document["findings"]
    ]
    lines += [f"  FLAG {flag['name']}: {flag['sentence']}" for flag in document["flags"]]
    lines.append(
        f"  {document['valid_hits']} valid hits, {len(document['rejected_hits'])} rejected"
    )
    lines += [f"    shot {hit['shot']}: {hit['reason']}" for hit in document["rejected_hits"]]
    if document["unverified"]:
        lines.append(f"  rests on {len(document['unverified'])} unverified values of the procedure")
    if document["statement"]:
        lines.append(f"  {document['statement']}")
    return "\n".join(lines)


def _metric_line(metric: Mapping[str, Any]) -> str:
    printed = METRICS[metric["name"]]
    value, u, limit = (
        None if number is None else number / printed.unit_si
        for number in (metric["value"], metric["u"], metric["limit"])
    )
    low, high = (bound / printed.unit_si for bound in metric["interval_95"])
    assert value is not None
    assert u is not None
    unit = f" {printed.unit}" if printed.unit else ""
    most = "no limit" if limit is None else f"limit {limit:.{printed.places}f}"
    places = printed.places + 1
    return (
        f"{printed.symbol:4} {with_uncertainty(value, u)}{unit}"
        f"   95 % interval {low:.{places}f} to {high:.{places}f}, {most}"
    )


def _width_lines(width: Mapping[str, Any] | None) -> list[str]:
    if width is None:
        return []
    along = width["value"] / INCH
    stated = (
        f"at least {along:.2f}" if width["at_least"] else with_uncertainty(along, width["u"] / INCH)
    )
    where = f"{width['from_in']:.2f} to {width['to_in']:.2f} in from the tip"
    return [f"  {stated} in wide within {width['drop']:g} of the curve's top, {where}"]


def _control_lines(correction: Mapping[str, Any] | None) -> list[str]:
    if correction is None or correction["control"] is None:
        return []
    control = correction["control"]
    ratio = with_uncertainty(control["value"], control["u"])
    return [f"  over {ratio} of the control bat with this lot ({control['source']})"]


def score_text(document: Mapping[str, Any]) -> str:
    """Return measured against true as a table."""
    rows = [
        {
            "quantity": name,
            "measured": number(row["measured"]),
            "u": number(row["u"]),
            "true": number(row["true"]),
            "error": number(row["error"], "+.6f"),
            "error/u": number(row["z"], "+.2f"),
        }
        for name, row in document.items()
        if name != "seal"
    ]
    seal = document["seal"]
    note = "" if seal == "whole" else ": the truth is not the one the certificate was issued with"
    return f"{table_text(rows)}\nseal {seal}{note}"


def sheet_text(document: Mapping[str, Any]) -> str:
    """Return a specification: words, numbers with source, and what the sources are."""
    rows = [
        {
            "key": number["key"],
            "value": number["value"],
            "unit": number["unit"].removesuffix("1") if number["unit"] == "1" else number["unit"],
            "source": number["source"] + ("" if number["verified"] else " (unverified)"),
            "note": number["note"],
        }
        for number in document["numbers"]
    ]
    parts = [f"{document['name']}: {document['title']} ({document['kind']})"]
    parts += [f"  {key}: {value}" for key, value in document["words"].items()]
    if rows:
        parts += ["", table_text(rows)]
    if "slowest_rebound" in document:
        parts += ["", _rebound_line(document["slowest_rebound"])]
    parts += [""] + [f"{key}: {text}" for key, text in document["sources"].items()]
    return "\n".join(parts).rstrip()


def _rebound_line(slowest: Mapping[str, Any]) -> str:
    gates = ", ".join(
        f"{gate['speed_mph']:.1f} mph at {gate['distance_m']:g} m" for gate in slowest["at_gates"]
    )
    return (
        f"slowest level rebound seen, {slowest['fall_mm']:g} mm of fall: {gates}; "
        f"two gates tell a speed: from {slowest['told_mph']:.1f} mph"
    )


def profile_text(document: Mapping[str, Any], published: PublishedBat | None) -> str:
    """Return a bat's properties, beside the published ones where there are any, and its curve."""
    computed = {
        "mass_oz": document["mass_oz"],
        "z_cm_in": document["z_cm_in"],
        "i_cm_oz_in2": document["i_cm_oz_in2"],
        "i_knob_oz_in2": document["i_knob_oz_in2"],
        **{f"f{i + 1}_hz": f for i, f in enumerate(document["modal_frequencies_hz"][:4])},
        **{f"node{i + 1}_in": node for i, node in enumerate(document["barrel_nodes_in"])},
    }
    said = _published(published)
    rows = [
        {
            "property": name,
            "computed": f"{value:.6g}",
            "published": number(said.get(name), "g"),
        }
        for name, value in computed.items()
    ]
    columns = ("z_in", "e", "r", "e_A", "v_bat_mph", "v_f_mph")
    forms = ("5.2f", ".4f", ".4f", "+.4f", ".2f", ".2f")
    curve = [
        {name: f"{document[name][i]:{form}}" for name, form in zip(columns, forms, strict=True)}
        for i in range(len(document["z_in"]))
    ]
    return f"{table_text(rows)}\n\n{table_text(curve)}"


def comparison_text(
    peaks: Sequence[Mapping[str, Any]], differences: Sequence[Mapping[str, Any]]
) -> str:
    """Return the peaks of several bats, and how far they lie from those of the first."""
    forms = {"e": ".4f", "BPF": ".4f", "e_A": ".4f", "v_f_mph": ".2f"}
    tops = [
        {"bat": row["bat"], "n": f"{row['n']:g}"}
        | {name: f"{row[name]:{form}} @ {row[f'{name}_at_in']:.2f}" for name, form in forms.items()}
        for row in peaks
    ]
    apart = [
        {"bat": f"{row['bat']} against {row['against']}", "n": f"{row['n']:g}"}
        | {name: f"{row[f'{name}_percent']:+.1f} %" for name in ("e", "BPF", "e_A")}
        | {"v_f": f"{row['v_f_mph']:+.2f} mph"}
        for row in differences
    ]
    return f"peak @ inches from the tip\n{table_text(tops)}\n\n{table_text(apart)}"


def sensitivity_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return what each law of the ball makes of a bat, and how far the results spread."""
    forms = {"e": ".4f", "BPF": ".4f", "e_A": ".4f", "v_f_mph": ".2f"}
    cells = [
        {
            "law": row["law"],
            "exponent": f"{row['exponent']:g}",
            "wall, ms": f"{row['wall_time_ms']:.3f}",
            "wall, kN": f"{row['wall_force_kn']:.1f}",
        }
        | {name: f"{row[name]:{form}} @ {row[f'{name}_at_in']:.2f}" for name, form in forms.items()}
        for row in rows
    ]
    apart = {
        name: max(row[name] for row in rows) - min(row[name] for row in rows)
        for pair in forms
        for name in (pair, f"{pair}_at_in")
    }
    spread = {"law": "spread", "exponent": "", "wall, ms": "", "wall, kN": ""} | {
        name: f"{apart[name]:{form}} @ {apart[f'{name}_at_in']:.2f}" for name, form in forms.items()
    }
    return f"{rows[0]['bat']}: peak @ inches from the tip\n{table_text([*cells, spread])}"


def _published(bat: PublishedBat | None) -> dict[str, float]:
    if bat is None:
        return {}
    return {
        "mass_oz": bat.mass / OUNCE,
        "z_cm_in": bat.z_cm / INCH,
        "i_cm_oz_in2": bat.inertia_cm / OZ_IN2,
        "i_knob_oz_in2": bat.inertia_knob / OZ_IN2,
        **{f"f{i + 1}_hz": f for i, f in enumerate(bat.bending_frequencies)},
        **{f"node{i + 1}_in": node / INCH for i, node in enumerate(bat.barrel_nodes)},
    }


def number(value: float | None, form: str = ".6f") -> str:
    return "" if value is None else f"{value:{form}}"


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(f"{item:g}" for item in value)
    return str(value)
