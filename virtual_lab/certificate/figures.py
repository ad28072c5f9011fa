"""The certificate's figures, from its document.

Shape and line style carry the information, so the figures can be printed in black and white.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, exp

import numpy as np

from virtual_lab.certificate.document import CertificateDocument, EncoderTrace, ShotRow
from virtual_lab.certificate.printed import printed_budget, printed_size
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import with_axis_unit
from virtual_lab.output.svg import DASHED, PAGE_WIDTH, Panel, figure

LEFT, RIGHT, TOP = 46.0, PAGE_WIDTH - 6, 30.0  # edges of the panels [pt]
X_LABEL_HEIGHT = 32.0  # height of the labels below the axes [pt]


def certificate_figures(document: CertificateDocument) -> dict[str, str | None]:
    """Return the seven figures of a certificate as SVG elements, keyed by name.

    The value is None for a figure for which the certificate has no data.
    """
    return {
        "hits_figure": hits_figure(document),
        "along_figure": along_figure(document) if document.along else None,
        "swings_figure": swings_figure(document) if document.swing_range else None,
        "encoder_figure": encoder_figure(document.encoder) if document.encoder else None,
        "contact_figure": contact_figure(document) if document.contact_sheet else None,
        "budget_figure": budget_figure(document) if printed_budget(document) else None,
        "rebound_figure": rebound_figure(document),
    }


def hits_figure(document: CertificateDocument) -> str:
    """Return an SVG figure of the metric of each hit, and of the test result.

    The hits are drawn in the order of the shots. For a scan along the barrel, they are drawn
    against the impact position [in from the tip]. A second panel shows the test result with its
    limit. It is left out if the certificate states no test result.
    """
    metric, printed = document.metric, METRICS[document.metric.name]
    height = 166.0 if document.places else 122.0
    limit = printed.in_unit(metric.limit)
    most = "no limit" if metric.limit is None else f"limit {printed.limit(metric.limit)}"
    stated = document.states_result
    panels = [_hits_panel(document, RIGHT - 136 if stated else RIGHT, height - X_LABEL_HEIGHT)]
    if stated:
        panels.append(_result_panel(document, RIGHT - 80, height - X_LABEL_HEIGHT))
    elif limit is not None:
        _put_limit(panels[0], limit, most)
    description = f"{len(document.shots)} shots, {document.valid_hits} valid; {most}"
    return figure(panels, height, "hits", f"{printed.symbol} of every hit", description)


def along_figure(document: CertificateDocument) -> str:
    """Return an SVG plot of e_A, e, ball speed and metric along the barrel, with fitted curves.

    Positions are in inches from the tip. The other values are in the units printed on the
    certificate. Points are means, and bars are their standard uncertainties. The document must have
    curves along the barrel.
    """
    along = document.along
    assert along is not None
    pitch = (RIGHT - LEFT + 42) / len(along.quantities)
    panels: list[Panel] = []
    places = [row.impact_position_in for row in document.places]
    for number, each in enumerate(along.quantities):
        symbol, unit, size = printed_size(each.name)
        means = [value / size for value in each.mean]
        bars = [(u or 0.0) / size for u in each.u]
        edge = 0.04 * (places[-1] - places[0])
        ends = [mean + sign * u for mean, u in zip(means, bars, strict=True) for sign in (-1, 1)]
        panel = Panel(
            left=LEFT + number * pitch,
            right=LEFT + (number + 1) * pitch - 42,
            top=TOP,
            bottom=150 - X_LABEL_HEIGHT,
            x=(places[0] - edge, places[-1] + edge),
            y=_limits([*ends, *(value / size for value in each.curve)]),
            title=f"{symbol}, {unit}" if unit else symbol,  # too narrow for both units
            x_label="position from the tip, in",
        )
        label = "" if panels else "every hit"  # one label for all: a panel is too narrow for two
        panel.line(along.curve_in, [value / size for value in each.curve], label)
        if each.name == document.metric.name and along.read:
            read = [value / size for value in along.read]
            panel.line(along.read_in, read, "result", width=1.8, dashes="3.3 1.4")
        for place, mean, u in zip(places, means, bars, strict=True):
            panel.whisker(place, mean - u, mean + u, cap=2)
        panel.dots(places, means, radius=1.6)
        panels.append(panel)
    names = ", ".join(printed_size(each.name)[0] for each in along.quantities)
    description = (
        f"{names} at {len(document.places)} impact positions from "
        f"{places[0]:g} to {places[-1]:g} in from the tip: means with their "
        "standard uncertainty from the scatter, and a polynomial of degree "
        f"{along.degree} fitted to all valid hits"
    )
    return figure(panels, 150, "along", f"{names} along the barrel", description)


def budget_figure(document: CertificateDocument) -> str:
    """Return an SVG bar chart of the uncertainty budget of the metric.

    A bar is the share of one component in the variance [%]. The document must have a printed
    budget.
    """
    rows = printed_budget(document)
    levels = [float(-number) for number in range(len(rows))]
    shares = [float(row["share"]) for row in rows]
    height = 9.5 * len(rows) + X_LABEL_HEIGHT
    panel = Panel(
        left=205,
        right=RIGHT - 10,
        top=2,
        bottom=height - X_LABEL_HEIGHT,
        x=(0.0, 1.02 * max(shares)),
        y=(levels[-1] - 0.6, 0.6),
        x_label="share of the variance, %",
        y_ticks=levels,
        y_words=[row["words"] for row in rows],
    )
    for level, share in zip(levels, shares, strict=True):
        panel.shape((0, share, share, 0), (level - 0.3, level - 0.3, level + 0.3, level + 0.3))
    largest = f"{rows[0]['words']} {rows[0]['share']} %"
    description = f"{len(rows)} sources of uncertainty; {largest} of the variance"
    return figure([panel], height, "budget", "Uncertainty budget", description)


def rebound_figure(document: CertificateDocument) -> str | None:
    """Return an SVG figure that compares e_A from rebound with e_A from recoil, hit by hit.

    The first panel plots one against the other. The second panel plots the difference, rebound
    minus recoil, against the number of the shot. The result is None if fewer than two hits have
    both values, or if no valid hit has both.
    """
    both = [
        (row, row.recoil_efficiency, row.rebound_efficiency)
        for row in document.shots
        if row.recoil_efficiency is not None and row.rebound_efficiency is not None
    ]
    check = document.rebound_check
    if check is None or check.difference is None or len(both) < 2:
        return None
    ends = _limits([value for _, *pair in both for value in pair])
    middle, bottom = (LEFT + RIGHT) / 2, 130 - X_LABEL_HEIGHT
    against = Panel(
        left=LEFT,
        right=middle - 30,
        top=TOP - 12,
        bottom=bottom,
        x=ends,
        y=ends,
        x_label="e_A from the recoil",
        y_label="e_A from the rebound",
    )
    differences = [rebound - recoil for _, recoil, rebound in both]
    u = check.u or 0.0
    by_shot = Panel(
        left=middle + 36,
        right=RIGHT,
        top=TOP - 12,
        bottom=bottom,
        x=(0.4, len(document.shots) + 0.6),
        y=_limits([*differences, check.difference - u, check.difference + u, 0.0]),
        x_label="shot",
        y_label="rebound − recoil",
        x_ticks=[row.shot + 1.0 for row in document.shots] if len(document.shots) <= 30 else None,
    )
    by_shot.band(check.difference - u, check.difference + u, "mean ± u")
    by_shot.level(0.0, dashes=DASHED)
    against.line(ends, ends, "equal", dashes=DASHED)
    for valid, label in ((True, "valid hit"), (False, "invalid hit")):
        rows = [row for row in both if (not row[0].reason) == valid]
        if rows:
            _, recoil, rebound = zip(*rows, strict=True)
            against.dots(recoil, rebound, label, radius=2, cross=not valid)
            shots = [row.shot + 1.0 for row, *_ in rows]
            gaps = [one - other for _, other, one in rows]
            by_shot.dots(shots, gaps, radius=2, cross=not valid)
    description = (
        f"e_A from the rebound of the ball against e_A from the recoil of the bat, {len(both)} "
        f"hits; mean difference {check.difference:+.4f}"
    )
    title = "e_A from recoil and from rebound"
    return figure([against, by_shot], 130, "rebound", title, description)


def contact_figure(document: CertificateDocument) -> str:
    """Return an SVG figure of the encoder angle minus the fitted rotation [°], one panel per shot.

    Each panel shows the first 20 ms after contact. All panels have the same scale. The document
    must have at least one encoder record of this time.
    """
    sheet, reasons = document.contact_sheet, {row.shot: row.reason for row in document.shots}
    most = max((abs(angle) for each in sheet for angle in each.angle_deg), default=0.0) or 1.0
    wide, high, columns = 80.0, 50.0, 6
    panels = []
    for number, each in enumerate(sheet):
        left, top = wide * (number % columns) + 10, high * (number // columns) + 14
        time = [each.from_ms + each.step_ms * step for step in range(len(each.angle_deg))]
        panel = Panel(
            left=left,
            right=left + wide - 10,
            top=top,
            bottom=top + high - 16,
            x=(0.0, 20.0),
            y=(-most, most),
            x_ticks=(),
            y_ticks=(),
        )
        panel.level(0.0, width=0.3)
        panel.line(time, each.angle_deg, width=0.5)
        word = " (invalid)" if reasons.get(each.shot) else ""
        panel.note(0.0, most, f"{each.shot + 1}{word}", anchor="start")
        panels.append(panel)
    height = high * ceil(len(sheet) / columns) + 4
    description = (
        f"Encoder records minus the fitted rotation, {len(sheet)} shots, the first 20 ms after "
        f"contact, all on a scale from −{most:.2g}° to {most:.2g}°"
    )
    return figure(panels, height, "contact", "Contact sheet of the shots", description)


def swings_figure(document: CertificateDocument) -> str:
    """Return an SVG plot of the metric and its 95 % interval against the exponent of the swing law.

    In the swing law, the angular speed of a bat is proportional to I^-n. I is its moment of inertia
    and n the exponent. The document must have the metric for several exponents.
    """
    printed = METRICS[document.metric.name]
    exponents = [row.exponent for row in document.swing_range]
    values = [printed.in_unit(row.value) for row in document.swing_range]
    low, high = (
        [printed.in_unit(row.interval_95[end]) for row in document.swing_range] for end in (0, 1)
    )
    wide = 0.05 * (exponents[-1] - exponents[0])
    panel = Panel(
        left=LEFT,
        right=RIGHT,
        top=TOP - 12,
        bottom=122 - X_LABEL_HEIGHT,
        x=(exponents[0] - wide, exponents[-1] + wide),
        y=_limits([*low, *high]),
        x_label="exponent n of the swing law",
        y_label=with_axis_unit(printed.symbol, printed.unit),
        x_ticks=exponents,
    )
    panel.ribbon(exponents, low, high, "95 % interval")
    panel.line(exponents, values)
    panel.dots(exponents, values, printed.symbol, radius=1.6)
    if document.procedure.swing_exponent is not None:
        panel.upright(document.procedure.swing_exponent, "n of the verdict")
    description = f"{printed.symbol} for exponents {exponents[0]:g} to {exponents[-1]:g}"
    title = f"{printed.symbol} against the exponent of the swing law"
    return figure([panel], 122, "swings", title, description)


def encoder_figure(trace: EncoderTrace) -> str:
    """Return an SVG figure of the encoder record of one shot, with two panels.

    The first panel shows the angle [deg] with the fitted rotation. The second shows the record
    minus this rotation, with the fitted vibration. Both are plotted against the time after contact
    [ms].
    """
    middle, bottom = (LEFT + RIGHT) / 2, 140 - X_LABEL_HEIGHT
    turn, ring = trace.turn, trace.ring
    whole = Panel(
        left=LEFT,
        right=middle - 12,
        top=TOP,
        bottom=bottom,
        x=(turn.time_ms[0], turn.time_ms[-1]),
        y=_limits(turn.angle_deg),
        title="whole record",
        x_label="time after contact, ms",
        y_label="angle, °",
    )
    late = [number for number, time in enumerate(turn.time_ms) if time >= 0]
    whole.line(turn.time_ms, turn.angle_deg, "record", width=2.4, colour="#999")
    whole.line(
        [turn.time_ms[n] for n in late],
        [turn.fit_deg[n] for n in late],
        "fitted rotation",
        dashes="3.3 1.4",
    )
    rest = Panel(
        left=middle + 36,
        right=RIGHT,
        top=TOP,
        bottom=bottom,
        x=(0.0, round(ring.time_ms[-1])),
        y=_limits(ring.angle_deg),
        title="record minus fitted rotation",
        x_label="time after contact, ms",
        y_label="angle, °",
    )
    settled = [number for number, time in enumerate(ring.time_ms) if time > trace.settled_ms]
    rest.dots(ring.time_ms, ring.angle_deg, "record", radius=0.8, fill="#888")
    rest.line(
        [ring.time_ms[n] for n in settled], [ring.fit_deg[n] for n in settled], "fit", width=0.7
    )
    rest.upright(trace.settled_ms)
    description = (
        f"Shot {trace.shot + 1}: angle of the bat against time after contact, with the fitted "
        "rotation, and the bending vibration: the record minus the fitted rotation."
    )
    title = f"Encoder record of shot {trace.shot + 1}"
    return figure([whole, rest], 140, "encoder", title, description)


def _hits_panel(document: CertificateDocument, right: float, bottom: float) -> Panel:
    metric, printed = document.metric, METRICS[document.metric.name]
    scan = bool(document.places)
    across = [row.impact_position_in if scan else row.shot + 1.0 for row in document.shots]
    measured = [(x, row) for x, row in zip(across, document.shots, strict=True) if row.value]
    heights = [printed.in_unit(row.value) for _, row in measured if row.value is not None]
    interval = [printed.in_unit(bound) for bound in metric.interval_95 or ()]
    if not document.states_result and metric.limit is not None:
        heights.append(printed.in_unit(metric.limit))
    edge = 0.05 * (max(across) - min(across)) if scan else 0.6
    panel = Panel(
        left=LEFT,
        right=right,
        top=TOP,
        bottom=bottom,
        x=(min(across) - edge, max(across, default=0.0) + edge)
        if scan
        else (1 - edge, max(len(across), 2) + edge),
        y=_limits([*heights, *interval]),
        title="along the barrel" if scan else "hit by hit",
        x_label="position from the tip, in" if scan else "shot",
        y_label=with_axis_unit(printed.symbol, printed.unit),
        x_ticks=None if scan or len(across) > 30 else across,
    )
    if document.states_result and metric.value is not None:
        which = "result" if scan else "mean"
        panel.band(interval[0], interval[1], f"95 % interval of the {which}")
        panel.level(printed.in_unit(metric.value), which)
    for label, rows, fill, cross in _kinds(measured, scan):
        points = [(x, printed.in_unit(row.value)) for x, row in rows if row.value is not None]
        if points:
            xs, ys = zip(*points, strict=True)
            panel.dots(xs, ys, label, fill=fill, cross=cross)
    if not scan:
        for x, row in zip(across, document.shots, strict=True):
            if row.value is None:
                panel.note(x + 0.12, panel.y[0], " no value", anchor="start", upright=True)
    return panel


def _kinds(
    measured: Sequence[tuple[float, ShotRow]], scan: bool
) -> list[tuple[str, list[tuple[float, ShotRow]], str, bool]]:
    """Return label, hits, color of the disk, and whether it has a cross, for each kind of hit."""
    valid = [(x, row) for x, row in measured if not row.reason]
    if scan:
        return [
            ("other valid hit", [(x, row) for x, row in valid if not row.used], "white", False),
            ("hit in the result", [(x, row) for x, row in valid if row.used], "black", False),
        ]
    invalid = [(x, row) for x, row in measured if row.reason]
    return [("valid hit", valid, "black", False), ("invalid hit", invalid, "none", True)]


def _result_panel(document: CertificateDocument, left: float, bottom: float) -> Panel:
    metric, printed = document.metric, METRICS[document.metric.name]
    assert metric.value is not None
    assert metric.interval_95 is not None
    value, low, high = (printed.in_unit(number) for number in (metric.value, *metric.interval_95))
    limit = printed.in_unit(metric.limit)
    against = value if limit is None else limit
    half_width = max(abs(against - value), high - value, 0.01)
    panel = Panel(
        left=left,
        right=RIGHT,
        top=TOP,
        bottom=bottom,
        x=(-1.0, 1.0),
        y=(min(against, low) - 0.3 * half_width, max(against, high) + 0.3 * half_width),
        title="no limit is set" if limit is None else "against the limit",
        x_label="result, 95 % interval\nand distribution",
        x_ticks=(),
    )
    panel.whisker(-0.6, low, high)
    panel.dots([-0.6], [value], radius=1.6)
    if metric.u:
        _put_density(panel, value, printed.in_unit(metric.u), limit, document)
    if limit is not None and metric.limit is not None:
        _put_limit(panel, limit, f"limit {printed.limit(metric.limit)}")
    return panel


def _put_density(
    panel: Panel, value: float, u: float, limit: float | None, document: CertificateDocument
) -> None:
    """Draw the distribution of the result; the filled part beyond the limit is the risk."""
    low, high = panel.y
    steps = (*np.linspace(low, high, 201).tolist(), *(value + u * n / 8 for n in range(-36, 37)))
    heights = sorted(each for each in steps if low <= each <= high)
    dof, base = document.metric.dof, -0.2
    across = [base + 1.2 * _density((each - value) / u, dof) for each in heights]
    panel.line(across, heights, width=0.7)
    if document.risk is None or limit is None:
        return
    above = document.risk.of == "false acceptance"
    wrong = [
        (x, y)
        for x, y in zip(across, heights, strict=True)
        if (y > limit) == above and x - base > 1e-3
    ]
    if wrong:
        xs, ys = zip(*wrong, strict=True)
        panel.shape((base, *xs, base), (ys[0], *ys, ys[-1]))


def _density(deviation: float, dof: float | None) -> float:
    """Return Student's density at a `deviation` [u], relative to its maximum."""
    return exp(-(deviation**2) / 2) if dof is None else (1 + deviation**2 / dof) ** (-(dof + 1) / 2)


def _put_limit(panel: Panel, limit: float, words: str) -> None:
    panel.level(limit, width=1.4, dashes=DASHED)
    panel.note(panel.x[1], limit, words)


def _limits(values: Sequence[float]) -> tuple[float, float]:
    """Return limits of an axis with a margin about the values."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    # an axis spans at least 2e-3, so that nearly equal hits look equal
    margin = max(0.12 * (high - low), (2e-3 - (high - low)) / 2)
    return low - margin, high + margin
