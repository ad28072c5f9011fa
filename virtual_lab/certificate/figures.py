"""The certificate's figures, from its document.

Shape and line style carry the information, so the figures can be printed in black and white.
"""

from __future__ import annotations

from collections.abc import Sequence

from virtual_lab.certificate.document import CertificateDocument, EncoderTrace, ShotRow
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.svg import DASHED, PAGE_WIDTH, Panel, figure

LEFT, RIGHT, TOP = 46.0, PAGE_WIDTH - 4, 30.0  # pt
X_LABEL_ROOM = 32.0  # pt, below the axes


def certificate_figures(document: CertificateDocument) -> dict[str, str | None]:
    """Return the figures by name, as SVG; None: nothing to draw."""
    return {
        "hits_figure": hits_figure(document),
        "swings_figure": swings_figure(document) if document.swing_range else None,
        "encoder_figure": encoder_figure(document.encoder) if document.encoder else None,
    }


def hits_figure(document: CertificateDocument) -> str:
    """Return the metric hit by hit, over the place on a scan, and against the limit, as SVG."""
    metric, printed = document.metric, METRICS[document.metric.name]
    height = 166.0 if document.places else 122.0
    limit = None if metric.limit is None else metric.limit / printed.unit_si
    most = "no limit" if metric.limit is None else f"limit {printed.limit(metric.limit)}"
    stated = document.states_result
    panels = [_hits_panel(document, RIGHT - 136 if stated else RIGHT, height - X_LABEL_ROOM)]
    if stated:
        panels.append(_result_panel(document, RIGHT - 80, height - X_LABEL_ROOM))
    elif limit is not None:
        _put_limit(panels[0], limit, most)
    description = f"{len(document.shots)} shots, {document.valid_hits} valid; {most}"
    return figure(panels, height, "hits", f"{printed.symbol} of every hit", description)


def swings_figure(document: CertificateDocument) -> str:
    """Return the metric over the exponent of the swing law, with its 95 % intervals, as SVG."""
    printed = METRICS[document.metric.name]
    exponents = [row.exponent for row in document.swing_range]
    values = [row.value / printed.unit_si for row in document.swing_range]
    low, high = (
        [row.interval_95[end] / printed.unit_si for row in document.swing_range] for end in (0, 1)
    )
    wide = 0.05 * (exponents[-1] - exponents[0])
    panel = Panel(
        left=LEFT,
        right=RIGHT,
        top=TOP - 12,
        bottom=122 - X_LABEL_ROOM,
        x=(exponents[0] - wide, exponents[-1] + wide),
        y=_limits([*low, *high]),
        x_label="exponent n of the swing law",
        y_label=_axis_label(document),
        x_ticks=exponents,
    )
    panel.ribbon(exponents, low, high, "95 % interval")
    panel.line(exponents, values)
    panel.dots(exponents, values, printed.symbol, radius=1.6)
    if document.procedure.swing_exponent is not None:
        panel.upright(document.procedure.swing_exponent, "judged by this n")
    description = f"{printed.symbol} for exponents {exponents[0]:g} to {exponents[-1]:g}"
    return figure([panel], 122, "swings", f"{printed.symbol} over the swing law", description)


def encoder_figure(trace: EncoderTrace) -> str:
    """Return the encoder's record of one shot, with its turn and the ring, as SVG."""
    middle, bottom = (LEFT + RIGHT) / 2, 140 - X_LABEL_ROOM
    turn, ring = trace.turn, trace.ring
    whole = Panel(
        left=LEFT,
        right=middle - 12,
        top=TOP,
        bottom=bottom,
        x=(turn.time_ms[0], turn.time_ms[-1]),
        y=_limits(turn.angle_deg),
        title="the whole record",
        x_label="time after contact, ms",
        y_label="angle, °",
    )
    late = [number for number, time in enumerate(turn.time_ms) if time >= 0]
    whole.line(turn.time_ms, turn.angle_deg, "record", width=2.4, colour="#999")
    whole.line(
        [turn.time_ms[n] for n in late],
        [turn.fit_deg[n] for n in late],
        "turn of the joint fit",
        dashes="3.3 1.4",
    )
    rest = Panel(
        left=middle + 36,
        right=RIGHT,
        top=TOP,
        bottom=bottom,
        x=(0.0, round(ring.time_ms[-1])),
        y=_limits(ring.angle_deg),
        title="the record less the turn: the ring",
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
        f"Shot {trace.shot + 1}: angle of the bat against time after contact, with the turn of the "
        "joint fit, and what is left of the record less the turn: a bending ring."
    )
    title = f"Encoder record of shot {trace.shot + 1}"
    return figure([whole, rest], 140, "encoder", title, description)


def _hits_panel(document: CertificateDocument, right: float, bottom: float) -> Panel:
    metric, unit_si = document.metric, METRICS[document.metric.name].unit_si
    scan = bool(document.places)
    across = [row.place_in if scan else row.shot + 1.0 for row in document.shots]
    seen = [(x, row) for x, row in zip(across, document.shots, strict=True) if row.metric]
    heights = [row.metric / unit_si for _, row in seen if row.metric is not None]
    interval = [bound / unit_si for bound in metric.interval_95 or ()]
    if not document.states_result and metric.limit is not None:
        heights.append(metric.limit / unit_si)
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
        x_label="place from the tip, in" if scan else "shot",
        y_label=_axis_label(document),
        x_ticks=None if scan or len(across) > 30 else across,
    )
    if document.states_result and metric.value is not None:
        panel.band(interval[0], interval[1], "95 % interval")
        panel.level(metric.value / unit_si, "result" if scan else "mean")
    for label, rows, fill, cross in _kinds(seen, scan):
        points = [(x, row.metric / unit_si) for x, row in rows if row.metric is not None]
        if points:
            xs, ys = zip(*points, strict=True)
            panel.dots(xs, ys, label, fill=fill, cross=cross)
    if not scan:
        for x, row in zip(across, document.shots, strict=True):
            if row.metric is None:
                panel.note(x + 0.12, panel.y[0], " no value", anchor="start", upright=True)
    return panel


def _kinds(
    seen: Sequence[tuple[float, ShotRow]], scan: bool
) -> list[tuple[str, list[tuple[float, ShotRow]], str, bool]]:
    """Return the kinds of hits to be marked: label, hits, fill of the disc, whether a cross."""
    valid = [(x, row) for x, row in seen if not row.reason]
    if scan:
        return [
            ("other valid hit", [(x, row) for x, row in valid if not row.used], "white", False),
            ("in the result", [(x, row) for x, row in valid if row.used], "black", False),
        ]
    invalid = [(x, row) for x, row in seen if row.reason]
    return [("valid hit", valid, "black", False), ("invalid hit", invalid, "none", True)]


def _result_panel(document: CertificateDocument, left: float, bottom: float) -> Panel:
    metric, printed = document.metric, METRICS[document.metric.name]
    assert metric.value is not None
    assert metric.interval_95 is not None
    value, low, high = (number / printed.unit_si for number in (metric.value, *metric.interval_95))
    limit = None if metric.limit is None else metric.limit / printed.unit_si
    against = value if limit is None else limit
    reach = max(abs(against - value), high - value, 0.01)
    panel = Panel(
        left=left,
        right=RIGHT,
        top=TOP,
        bottom=bottom,
        x=(-1.0, 1.0),
        y=(min(against, low) - 0.3 * reach, max(against, high) + 0.3 * reach),
        title="no limit is set" if limit is None else "against the limit",
        x_label="result and its\n95 % interval",
        x_ticks=(),
    )
    panel.whisker(0.0, low, high)
    panel.dots([0.0], [value], radius=1.6)
    if limit is not None and metric.limit is not None:
        _put_limit(panel, limit, f"limit {printed.limit(metric.limit)}")
    return panel


def _put_limit(panel: Panel, limit: float, words: str) -> None:
    panel.level(limit, width=1.4, dashes=DASHED)
    panel.note(panel.x[1], limit, words)


def _axis_label(document: CertificateDocument) -> str:
    printed = METRICS[document.metric.name]
    return f"{printed.symbol}, {printed.unit}" if printed.unit else printed.symbol


def _limits(values: Sequence[float]) -> tuple[float, float]:
    """Return limits of an axis with some room about the values."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    # hits all alike are shown as such
    room = max(0.12 * (high - low), (2e-3 - (high - low)) / 2)
    return low - room, high + room
