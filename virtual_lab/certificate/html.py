"""The certificate as a page a customer can read and print, and as a card for a notebook.

Everything printed comes from the certificate's document; the certification behind it gives
what the document leaves out: the shots and the raw record of the figures.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from math import isfinite, sqrt
from typing import Any

import numpy as np

from virtual_lab.certificate.camera import witness_rows
from virtual_lab.certificate.inputs import INPUTS, STAGES
from virtual_lab.measurement.certification import Certification
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import decimals
from virtual_lab.output.template import template
from virtual_lab.records import EncoderRecord
from virtual_lab.units import INCH, MPH, OUNCE, OZ_IN2

__all__ = ["certificate_page", "notebook_card"]

PACKAGE = "virtual_lab.certificate"
NONE = "–"
PLACES = 7  # decimals at most; what needs more is the computer's own arithmetic
NO_RING: Mapping[str, Any] = {"frequencies_hz": ()}
LEAST_SHARE = 1.0  # % of the variance; lesser components are summed in one line
VERDICTS = {
    "PASS": "the bat meets the limit",
    "FAIL": "the bat exceeds the limit",
    "INVALID": "the test was not valid, and nothing is said of the bat",
    "MEASURED": "the rules set no limit",
}


def certificate_page(document: dict[str, Any], certification: Certification) -> str:
    """Return the certificate as one HTML page that needs nothing but itself.

    Parameters
    ----------
    document
        What `virtual_lab.certificate.document.certificate` made of `certification`.
    certification
        For the table of shots and the figures.
    """
    from markupsafe import Markup

    from virtual_lab.certificate.figures import encoder_figure, hits_figure, swings_figure

    ring = document["ring"] or NO_RING
    return template(PACKAGE, "certificate.html").render(
        document=document,
        number=_number_of(document),
        result=_result(document, certification.procedure.valid_hits),
        quantities=_quantities(document),
        at_percussion=certification.procedure.place == "centre-of-percussion",
        bat=_bat(document["bat"]),
        width=_width(document["width_m"]),
        correction=_correction(document["ball_correction"]),
        choice=_choice(document),
        shots=_shots(certification),
        swings=_swings(document),
        swings_figure=Markup(swings_figure(certification)) if certification.swings else None,
        budget=_budget(document),
        rebound=_rebound(document, certification),
        witness=witness_rows(document["second_witness"]),
        # drawn by this package, text inside already escaped
        hits_figure=Markup(hits_figure(certification)),
        encoder_figure=Markup(encoder_figure(certification)) if _counted(certification) else None,
        rings=", ".join(f"{pitch:.0f}" for pitch in ring["frequencies_hz"]),
        swung=certification.readings.swing is not None,
    )


def notebook_card(document: dict[str, Any]) -> str:
    """Return verdict and result as a small piece of HTML for a notebook's output cell."""
    return template(PACKAGE, "card.html").render(document=document, result=_result(document, None))


def _number_of(document: Mapping[str, Any]) -> str:
    """Return the first digits of the SHA-256 of ``certificate.json``, so anyone can check it."""
    text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _swings(document: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the metric for each exponent of the swing law, in print."""
    unit_si = METRICS[document["metric"]["name"]].unit_si
    rows = []
    for row in document["swing_range"]:
        places = decimals(row["u"] / unit_si)
        low, high = (bound / unit_si for bound in row["interval_95"])
        rows.append(
            {
                "exponent": f"{row['exponent']:g}",
                "value": _number(row["value"] / unit_si, places),
                "u": _number(row["u"] / unit_si, places),
                "interval": f"{_number(low, places)} to {_number(high, places)}",
                "place": f"{row['place_in']:.2f}",
            }
        )
    return rows


def _counted(certification: Certification) -> bool:
    """Return whether there are counts to show, and a contact to show them from."""
    counts = certification.session.records["impact"].get("encoder")
    return isinstance(counts, EncoderRecord) and bool(np.isfinite(certification.shots.speed).any())


def _result(document: Mapping[str, Any], needed: int | None) -> dict[str, Any]:
    metric, verdict = document["metric"], document["verdict"]
    printed = METRICS[metric["name"]]
    hits = f"{document['valid_hits']} valid hits"
    if verdict == "INVALID" and needed:
        hits += f", the procedure asks for {needed}"
    limit, unit = metric["limit"], f" {printed.unit}" if printed.unit else ""
    result = {
        "words": printed.words,
        "symbol": printed.symbol,
        "unit": unit,
        "verdict": verdict,
        "said": VERDICTS[verdict],
        "hits": hits,
        "limit": "none" if limit is None else f"{limit / printed.unit_si:.{printed.places}f}{unit}",
        "stated": metric["value"] is not None,
    }
    return result | _stated(metric, printed.unit_si) if result["stated"] else result


def _stated(metric: Mapping[str, Any], unit_si: float) -> dict[str, Any]:
    """Return value, expanded uncertainty and interval as printed, all to the same place."""
    value, u, *interval = (
        number / unit_si for number in (metric["value"], metric["u"], *metric["interval_95"])
    )
    low, high = interval
    expanded, dof = high - value, metric["degrees_of_freedom"]
    places, certain = _places(expanded), _digits(u) == "0"
    return {
        "uncertain": not certain,
        "value": f"{value:.{places}f}",
        "expanded": _digits(expanded),
        "low": f"{low:.{places}f}",
        "high": f"{high:.{places}f}",
        "u": _digits(u),
        "u_type_a": _digits(metric["u_type_a"] / unit_si),
        "u_type_b": _digits(metric["u_type_b"] / unit_si),
        "k": NONE if certain else f"{expanded / u:.2f}",
        "dof": "∞" if dof is None else f"{dof:.1f}" if dof < 100 else f"{dof:.0f}",
    }


def _quantities(document: Mapping[str, Any]) -> list[dict[str, str]]:
    which = document["recoil"]["which"]
    rows = [
        ("Collision efficiency", "e", "A", "collision_efficiency"),
        ("Restitution of ball and bat", "e", "", "restitution"),
        (f"Recoil factor, {which} bat", "r", "", "recoil_factor"),
        ("Restitution, ball on a wall", "e", "0", "ball_restitution"),
    ]
    return [
        {"words": words, "letter": letter, "index": index, **_with_u(document[name])}
        for words, letter, index, name in rows
        if name in document
    ]


def _bat(bat: Mapping[str, Any]) -> list[dict[str, str]]:
    rows = [
        ("Mass", "mass_kg", "oz", 1 / OUNCE, "g", 1e3),
        ("Length", "length_m", "in", 1 / INCH, "mm", 1e3),
        ("Balance point", "z_cm_m", "in", 1 / INCH, "mm", 1e3),
        ("Moment of inertia", "inertia_cm_kg_m2", "oz in²", 1 / OZ_IN2, "g m²", 1e3),
    ]
    return [
        {
            "words": words,
            "unit": unit,
            "si_unit": si_unit,
            **_with_u(bat[name], factor),
            "si": _with_u(bat[name], si_factor)["value"],
            "si_u": _with_u(bat[name], si_factor)["u"],
        }
        for words, name, unit, factor, si_unit, si_factor in rows
    ]


def _correction(correction: Mapping[str, Any] | None) -> str:
    """Return what was done about balls that are not the standard one, as a sentence."""
    if correction is None:
        return ""
    standard, control = correction["standard"], correction["control"]
    if control is None:
        return f"carried to a ball of e0 {standard:g} by the method {correction['method']}"
    known = _with_u(control)
    return (
        f"divided by {known['value']} (u = {known['u']}), what the control bat gave with this "
        f"lot of balls over the {standard:g} it is known by"
    )


def _choice(document: Mapping[str, Any]) -> str:
    """Return by how much the value is raised for the place chosen by a scan, with its unit."""
    if document["choice"] is None:
        return ""
    printed = METRICS[document["metric"]["name"]]
    unit = f" {printed.unit}" if printed.unit else ""
    return f"{_digits(document['choice']['correction'] / printed.unit_si)}{unit}"


def _width(width: Mapping[str, Any] | None) -> dict[str, str] | None:
    if width is None:
        return None
    stated = _with_u(width, 1 / INCH)
    if width["at_least"]:
        stated = {"value": _number(width["value"] / INCH, 2), "u": ""}
    ends = {"low": _number(width["from_in"], 2), "high": _number(width["to_in"], 2)}
    return stated | ends | {"drop": f"{width['drop']:g}"}


def _shots(certification: Certification) -> list[dict[str, Any]]:
    shots, reasons = certification.shots, certification.judgement.reasons
    unit_si = METRICS[certification.procedure.metric].unit_si
    return [
        {
            "shot": shot,
            "place": _number(shots.place[shot] / INCH, 2),
            "speed": _number(shots.speed[shot] / MPH, 2, "not seen"),
            "bat_speed": _number(shots.bat_speed[shot] / MPH, 2),
            "recoil": _number(shots.recoil_rate[shot], 3),
            "by_recoil": _number(shots.recoil_efficiency[shot], 4),
            "by_rebound": _number(shots.rebound_efficiency[shot], 4, "not seen"),
            "factor": _number(certification.shot_metric[shot] / unit_si, 4),
            "reason": reason,
        }
        for shot, reason in enumerate(reasons)
    ]


def _budget(document: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the components that matter, and in the last line all others together."""
    unit_si = METRICS[document["metric"]["name"]].unit_si
    rows, u = document["budget"], (document["metric"]["u"] or 0.0) / unit_si
    if not rows or _digits(u) == "0":
        return []
    places = _places(u) + 1
    large = [row for row in rows if row["share_percent"] >= LEAST_SHARE]
    small = rows[len(large) :]  # rows come largest first
    lines = [
        {
            **_input(row["component"], row["u"]),
            "type": row["type"],
            "contribution": f"{row['contribution'] / unit_si:.{places}f}",
            "share": f"{row['share_percent']:.1f}",
        }
        for row in large
    ]
    if small:
        rest = sqrt(sum(row["contribution"] ** 2 for row in small)) / unit_si
        lines.append(
            {
                "words": f"All others ({len(small)}), each below {LEAST_SHARE:.0f} %",
                "u": "",
                "type": ", ".join(sorted({row["type"] for row in small})),
                "contribution": f"{rest:.{places}f}",
                "share": f"{sum(row['share_percent'] for row in small):.1f}",
            }
        )
    return lines


def _input(name: str, u: float) -> dict[str, str]:
    """Return what a budget calls a constant, and its uncertainty in a handy unit."""
    stage, _, rest = name.partition(".")
    if gate := re.fullmatch(r"gates\.(distance|height)_(\d+)", rest):
        words, unit, factor = f"light gates, {gate[1]} of gate {int(gate[2]) + 1}", "mm", 1e3
    elif name in INPUTS:
        words, unit, factor = INPUTS[name]
        return {"words": words, "u": f"{_digits(u * factor)} {unit}".strip()}
    elif rest in INPUTS and stage in STAGES:
        words, unit, factor = INPUTS[rest]
    else:
        return {"words": name, "u": f"{u:.2g} (SI)"}
    return {
        "words": f"{STAGES.get(stage, stage)}: {words}",
        "u": f"{_digits(u * factor)} {unit}".strip(),
    }


def _rebound(document: Mapping[str, Any], certification: Certification) -> dict[str, Any]:
    check, shots = document["rebound_check"], certification.shots
    if check is None:
        return {"shots": 0}
    gap = (shots.rebound_efficiency - shots.recoil_efficiency)[certification.judgement.valid]
    gap = gap[np.isfinite(gap)]
    if not check["shots"]:
        return {"shots": 0}
    return {
        "shots": check["shots"],
        "by_rebound": _number(check["collision_efficiency"], 4),
        "by_recoil": _number(check["collision_efficiency"] - check["difference"], 4),
        "difference": f"{round(check['difference'], 4) + 0.0:+.4f}".replace("-", "−"),
        "u": _number(gap.std(ddof=1) / sqrt(gap.size), 4) if gap.size > 1 else "",
    }


def _with_u(known: Mapping[str, float | None], factor: float = 1.0) -> dict[str, str]:
    value, u = known["value"], known["u"]
    if value is None or u is None:
        return {"value": NONE, "u": NONE}
    return {"value": f"{value * factor:.{_places(u * factor)}f}", "u": _digits(u * factor)}


def _places(u: float) -> int:
    return min(decimals(u), PLACES)


def _digits(u: float) -> str:
    """Return an uncertainty to two significant digits, 0 where it is only arithmetic."""
    return f"{u:.{_places(u)}f}" if u > 0.5 * 10**-PLACES else "0"


def _number(value: float | None, places: int, otherwise: str = NONE) -> str:
    if value is None or not isfinite(value):
        return otherwise
    return f"{value:.{places}f}".replace("-", "−")
