"""A certificate as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from virtual_lab.certificate.camera import witness_text
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.output.tables import table_text
from virtual_lab.units import INCH

__all__ = ["certificate_text"]

WORDS = {
    "bat_performance_factor": "BPF",
    "collision_efficiency": "e_A",
    "restitution": "e",
    "recoil_factor": "r",
    "ball_restitution": "e0",
}


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
        lines += _choice_lines(document)
        lines += _width_lines(document["width_m"])
        lines += _swing_lines(metric, document["swing_range"])
        lines += _control_lines(document["ball_correction"])
        lines += witness_text(document["second_witness"])
    lines += [f"  invalid: {reason}" for reason in document["reasons"]]
    lines += [
        f"  {'meets' if finding['met'] else 'FAILS'}: {finding['sentence']}"
        for finding in document["findings"]
    ]
    lines += [f"  FLAG {flag['name']}: {flag['sentence']}" for flag in document["flags"]]
    lines.append(
        f"  {document['valid_hits']} valid hits, {len(document['rejected_hits'])} rejected"
    )
    lines += [f"    shot {hit['shot']}: {hit['reason']}" for hit in document["rejected_hits"]]
    lines += [
        f"  ball {each['ball']} set aside: {each['reason']}"
        for each in document["ball"]["set_aside"]
    ]
    lines.append(f"  {document['conditional_on']}")
    if document["statement"]:
        lines.append(f"  {document['statement']}")
    if "sealing" in document["simulation"]:
        lines.append(f"  {document['simulation']['sealing']}")
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


def _choice_lines(document: Mapping[str, Any]) -> list[str]:
    if document["choice"] is None:
        return []
    unit_si = METRICS[document["metric"]["name"]].unit_si
    raised = document["choice"]["correction"] / unit_si
    return [f"  raised by {raised:.2g}: what the place chosen lacks on average of the best one"]


def _width_lines(width: Mapping[str, Any] | None) -> list[str]:
    if width is None:
        return []
    along = width["value"] / INCH
    stated = (
        f"at least {along:.2f}" if width["at_least"] else with_uncertainty(along, width["u"] / INCH)
    )
    where = f"{width['from_in']:.2f} to {width['to_in']:.2f} in from the tip"
    return [f"  {stated} in wide within {width['drop']:g} of the curve's top, {where}"]


def _swing_lines(metric: Mapping[str, Any], results: Sequence[Mapping[str, Any]]) -> list[str]:
    if not results:
        return []
    printed = METRICS[metric["name"]]
    rows = [
        {
            "n": f"{row['exponent']:g}",
            f"{printed.symbol}, {printed.unit}": with_uncertainty(
                row["value"] / printed.unit_si, row["u"] / printed.unit_si
            ),
            "best place, in": f"{row['place_in']:.2f}",
        }
        for row in results
    ]
    return ["  for other exponents n of the swing law:"] + [
        f"    {line}" for line in table_text(rows).splitlines()
    ]


def _control_lines(correction: Mapping[str, Any] | None) -> list[str]:
    if correction is None or correction["control"] is None:
        return []
    control = correction["control"]
    ratio = with_uncertainty(control["value"], control["u"])
    return [f"  over {ratio} of the control bat with this lot ({control['source']})"]
