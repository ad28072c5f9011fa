"""A certificate as plain text for a terminal, from its document."""

from __future__ import annotations

from collections.abc import Sequence

from virtual_lab.certificate.document import (
    CameraWord,
    CertificateDocument,
    ComparedResult,
    CorrectionStated,
    MetricStated,
    Stated,
    SwingRow,
    WidthStated,
)
from virtual_lab.certificate.printed import SYMBOLS
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.output.tables import table_text
from virtual_lab.records.particulars import Particulars
from virtual_lab.units import INCH


def certificate_text(document: CertificateDocument) -> str:
    """Return the certificate as text of about a dozen lines."""
    metric, procedure = document.metric, document.procedure
    marginal = ", marginal: the limit lies within the 95 % interval" if document.marginal else ""
    said = f": {'; '.join(document.reasons)}" if document.verdict == "FAIL" else ""
    lines = [
        f"{document.bat.name} by {procedure.name} ({procedure.edition})",
        f"  {document.verdict}{said}{marginal}",
    ]
    if document.states_result:
        lines.append("  " + _metric_line(metric))
        lines += [
            f"  {SYMBOLS[name]:4} {_with_u(stated)}"
            f"{'   ' + document.recoil.which if name == 'recoil_factor' else ''}"
            for name, stated in document.quantities.items()
        ]
        lines.append(
            f"  at {document.v_rel_mph:.2f} mph, {document.impact_position_in:.2f} in from the tip"
        )
        lines += _choice_lines(document)
        lines += _width_lines(document.width_m)
        lines += _swing_lines(metric, document.swing_range)
        lines += _control_lines(document.ball_correction)
        lines += _camera_lines(document.second_witness)
    if document.verdict == "INVALID":
        lines += [f"  invalid: {reason}" for reason in document.reasons]
    lines += [
        f"  {'meets' if finding.met else 'does not meet'}: {finding.sentence}"
        for finding in document.findings
    ]
    lines += [f"  FLAG {flag.name}: {flag.sentence}" for flag in document.flags]
    if document.not_checked:
        lines.append(f"  not checked, as recorders summed up: {', '.join(document.not_checked)}")
    lines.append(f"  {document.valid_hits} valid hits, {len(document.rejected_hits)} rejected")
    lines += [f"    shot {hit.shot + 1}: {hit.reason}" for hit in document.rejected_hits]
    lines += [
        f"  ball {each.ball + 1} set aside: {each.reason}" for each in document.ball.set_aside
    ]
    lines += _particulars_lines(document.particulars, simulated=document.simulation is not None)
    lines.append(f"  {document.conditional_on}")
    lines.append(f"  {document.statement}")
    if document.simulation:
        lines.append(f"  {document.simulation.sealing}")
    return "\n".join(lines)


def _metric_line(metric: MetricStated) -> str:
    printed = METRICS[metric.name]
    assert metric.value is not None
    assert metric.u is not None
    assert metric.interval_95 is not None
    low, high = (bound / printed.unit_si for bound in metric.interval_95)
    unit = f" {printed.unit}" if printed.unit else ""
    most = "no limit" if metric.limit is None else f"limit {printed.limit(metric.limit)}"
    places = printed.places + 1
    value = with_uncertainty(metric.value / printed.unit_si, metric.u / printed.unit_si)
    interval = f"95 % interval {low:.{places}f} to {high:.{places}f}"
    return f"{printed.symbol:4} {value}{unit}   {interval}, {most}"


def _particulars_lines(particulars: Particulars, *, simulated: bool) -> list[str]:
    """Return what is stated, and what is not; none where nothing is."""
    lines = [f"  {words}: {value}" for words, value in particulars.printed(simulated=simulated)]
    if lines and particulars.not_stated:
        lines.append(f"  Not stated: {', '.join(particulars.not_stated)}")
    used = [f"{name} {each.identity}" for name, each in particulars.instruments.items()]
    return [*lines, f"  Instruments: {', '.join(used)}"] if used else lines


def _choice_lines(document: CertificateDocument) -> list[str]:
    if document.choice is None:
        return []
    raised = document.choice.correction / METRICS[document.metric.name].unit_si
    return [f"  raised by {raised:.2g}: mean shortfall of the chosen place against the best one"]


def _width_lines(width: WidthStated | None) -> list[str]:
    if width is None:
        return []
    along = width.value / INCH
    stated = f"at least {along:.2f}" if width.u is None else with_uncertainty(along, width.u / INCH)
    where = f"{width.from_in:.2f} to {width.to_in:.2f} in from the tip"
    return [f"  {stated} in of barrel within {width.drop:g} of the curve's maximum, {where}"]


def _swing_lines(metric: MetricStated, results: Sequence[SwingRow]) -> list[str]:
    if not results:
        return []
    printed = METRICS[metric.name]
    rows = [
        {
            "n": f"{row.exponent:g}",
            f"{printed.symbol}, {printed.unit}": with_uncertainty(
                row.value / printed.unit_si, row.u / printed.unit_si
            ),
            "best place, in": f"{row.place_in:.2f}",
        }
        for row in results
    ]
    return ["  for other exponents n of the swing law:"] + [
        f"    {line}" for line in table_text(rows).splitlines()
    ]


def _control_lines(correction: CorrectionStated | None) -> list[str]:
    if correction is None or correction.control is None:
        return []
    control = correction.control
    ratio = with_uncertainty(control.value, control.u)
    return [f"  divided by {ratio}, from the control bat with these balls ({control.source})"]


def _camera_lines(camera: CameraWord | None) -> list[str]:
    """Return the results of the camera for the same hits."""
    if camera is None:
        return []
    if not camera.hits:
        return ["  the camera saw no valid hit well enough"]
    missed = f", {camera.missed} more not seen well" if camera.missed else ""
    lines = [f"  gates and video for {camera.hits} hits{missed}:"]
    for name in ("collision_efficiency", "restitution", "bat_performance_factor"):
        compared: ComparedResult | None = getattr(camera, name)
        if compared is None:
            continue
        ways = ("gates", compared.gates), ("video", compared.video), ("joined", compared.joined)
        values = ", ".join(f"{way} {_with_u(stated)}" for way, stated in ways)
        agreed = "agree" if compared.agree else "DISAGREE"
        off = _with_u(compared.difference)
        lines.append(f"    {SYMBOLS[name]:4} {values}; {agreed}, difference {off}")
    return lines


def _with_u(stated: Stated) -> str:
    assert stated.value is not None
    assert stated.u is not None
    return with_uncertainty(stated.value, stated.u)
