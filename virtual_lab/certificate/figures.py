"""The certificate's figures as inline SVG: black and grey, text as text, the same every time.

What a figure says is told by shape and line style, so it survives a black-and-white printer.
"""

from __future__ import annotations

import io
import re
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.reduction.recoil import DEGREE, SETTLE
from virtual_lab.output.metrics import METRICS, Printed
from virtual_lab.output.style import BAND, STYLE, WIDTH
from virtual_lab.records import EncoderRecord
from virtual_lab.units import INCH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["encoder_figure", "hits_figure", "swings_figure"]

Array = NDArray[np.float64]

RING_SHOWN = 20e-3  # s, the slowest ring is seen to turn a few times
LEAST_RANGE = 2e-3  # of the metric's axis: hits all alike are shown as such
EVERY = 8  # of the slow turn's samples drawn: more would only make the page heavier


def hits_figure(certification: Certification) -> str:
    """Return the metric hit by hit, over the place on a scan, and against the limit, as SVG."""
    metric, printed = certification.metric, METRICS[certification.procedure.metric]
    draw_hits = _draw_scan if certification.procedure.scan else _draw_hits

    def draw(figure: Figure) -> None:
        if metric is None:
            draw_hits(figure.add_subplot(), certification, printed, with_limit=True)
            return
        left, right = figure.subplots(1, 2, width_ratios=(3, 1))
        draw_hits(left, certification, printed, with_limit=False)
        _draw_result(right, certification, printed)

    valid, fired = (
        int(certification.judgement.valid.sum()),
        len(certification.judgement.reasons),
    )
    limit = certification.procedure.most
    most = "no limit" if limit is None else f"limit {limit / printed.unit_si:.{printed.places}f}"
    description = f"{fired} shots, {valid} valid; {most}"
    height = 2.3 if certification.procedure.scan else 1.5
    return _svg(draw, height, "hits", f"{printed.symbol} of every hit", description)


def swings_figure(certification: Certification) -> str:
    """Return the metric over the exponent of the swing law, with its 95 % intervals, as SVG."""
    printed = METRICS[certification.procedure.metric]
    unit_si, results = printed.unit_si, certification.swings
    exponents = np.array([result.exponent for result in results])
    values = np.array([result.budget.value for result in results]) / unit_si
    intervals = np.array([result.budget.interval_95 for result in results]) / unit_si
    game = certification.procedure.game
    assert game is not None

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        axes.fill_between(
            exponents, *intervals.T, facecolor=BAND, edgecolor="none", label="95 % interval"
        )
        axes.plot(exponents, values, "o-", color="black", markersize=3, label=printed.symbol)
        axes.axvline(
            game.exponent, color="black", linewidth=0.6, linestyle=":", label="judged by this n"
        )
        axes.set(xlabel="exponent n of the swing law", xticks=exponents)
        _finish(axes, printed, "")

    description = f"{printed.symbol} for exponents {exponents.min():g} to {exponents.max():g}"
    return _svg(draw, 1.7, "swings", f"{printed.symbol} over the swing law", description)


def encoder_figure(certification: Certification) -> str:
    """Return the encoder's record of one shot, with its fit and the ring, as SVG.

    The turn and the ring are fitted here anew, at the frequencies and decays that the
    reduction found for all shots together: a display, no result is taken from it.
    """
    shot = _shot_to_show(certification)
    after, angle = _shot_record(certification, shot)
    recoil = certification.readings.recoil
    assert recoil is not None
    turn, ring = _fit(after, angle, recoil.ring_frequency, recoil.ring_decay)

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        _draw_turn(left, after, angle, turn)
        _draw_ring(right, after, angle - turn, ring)

    description = (
        f"Shot {shot}: angle of the bat against time after contact, with the turn of the "
        f"joint fit, and what is left of the record less the turn: a bending ring of "
        f"{len(recoil.ring_frequency)} frequencies."
    )
    return _svg(draw, 1.95, "encoder", f"Encoder record of shot {shot}", description)


def _shot_to_show(certification: Certification) -> int:
    """Return the first valid shot, the first whose contact the gates saw where none is valid."""
    shown = certification.judgement.valid
    if not shown.any():
        shown = np.isfinite(certification.shots.speed)
    return int(shown.argmax())


def _draw_hits(
    axes: Axes, certification: Certification, printed: Printed, *, with_limit: bool
) -> None:
    values, valid = certification.shot_metric / printed.unit_si, certification.judgement.valid
    shot = np.arange(values.size)
    _draw_interval(axes, certification, printed, "mean")
    if with_limit:
        _draw_limit(axes, certification, printed)
    if valid.any():
        axes.plot(shot[valid], values[valid], "o", color="black", label="valid hit")
    if not valid.all():
        axes.plot(shot[~valid], values[~valid], "x", color="black", label="invalid hit")
    for missing in shot[~np.isfinite(values)]:
        axes.annotate(
            "no value",
            (missing, 0.02),
            xycoords=("data", "axes fraction"),
            rotation=90,
            ha="center",
            va="bottom",
        )
    axes.set(xlabel="shot", xlim=(-0.6, max(values.size, 2) - 0.4))
    axes.set_xticks(shot)
    _finish(axes, printed, "hit by hit")


def _draw_scan(
    axes: Axes, certification: Certification, printed: Printed, *, with_limit: bool
) -> None:
    values, valid = certification.shot_metric / printed.unit_si, certification.judgement.valid
    place, used = certification.readings.place / INCH, certification.outcome.used
    _draw_interval(axes, certification, printed, "result")
    if with_limit:
        _draw_limit(axes, certification, printed)
    if (valid & ~used).any():
        axes.plot(
            place[valid & ~used],
            values[valid & ~used],
            "o",
            markerfacecolor="white",
            color="black",
            label="other valid hit",
        )
    if (valid & used).any():
        axes.plot(
            place[valid & used], values[valid & used], "o", color="black", label="in the result"
        )
    axes.set(xlabel="place from the tip, in")
    _finish(axes, printed, "along the barrel")


def _draw_interval(axes: Axes, certification: Certification, printed: Printed, label: str) -> None:
    metric = certification.metric
    if metric is not None:
        low, high = (bound / printed.unit_si for bound in metric.interval_95)
        axes.axhspan(low, high, facecolor=BAND, edgecolor="none", label="95 % interval")
        axes.axhline(metric.value / printed.unit_si, color="black", label=label)


def _finish(axes: Axes, printed: Printed, title: str) -> None:
    axes.set_ylabel(f"{printed.symbol}, {printed.unit}" if printed.unit else printed.symbol)
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.margins(y=0.12)
    low, high = axes.get_ylim()
    if high - low < LEAST_RANGE:
        axes.set_ylim((low + high - LEAST_RANGE) / 2, (low + high + LEAST_RANGE) / 2)
    axes.set_title(title, pad=16)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 0.98), ncols=4, borderpad=0, handlelength=1.4)


def _draw_result(axes: Axes, certification: Certification, printed: Printed) -> None:
    metric, most = certification.metric, certification.procedure.most
    assert metric is not None
    value = metric.value / printed.unit_si
    half = metric.interval_95[1] / printed.unit_si - value
    limit = value if most is None else most / printed.unit_si
    axes.errorbar(0, value, half, fmt="o", color="black", markersize=3, capsize=5, linewidth=0.9)
    _draw_limit(axes, certification, printed)
    reach = max(abs(limit - value), half, 0.01)
    axes.set_ylim(min(limit, value - half) - 0.3 * reach, max(limit, value + half) + 0.3 * reach)
    axes.set(xlim=(-1, 1), xticks=[])
    axes.set_xlabel("result and its\n95 % interval")
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_title("against the limit" if most is not None else "no limit is set", pad=16)


def _draw_limit(axes: Axes, certification: Certification, printed: Printed) -> None:
    most = certification.procedure.most
    if most is None:
        return
    limit = most / printed.unit_si
    axes.axhline(limit, color="black", linewidth=1.4, linestyle=(0, (5, 2.5)))
    axes.annotate(
        f"limit {limit:.{printed.places}f}",
        (1, limit),
        xycoords=("axes fraction", "data"),
        xytext=(0, 2),
        textcoords="offset points",
        ha="right",
        va="bottom",
    )


def _draw_turn(axes: Axes, after: Array, angle: Array, turn: Array) -> None:
    late = after >= 0
    axes.plot(after[::EVERY] * 1e3, angle[::EVERY], color="0.6", linewidth=2.4, label="record")
    axes.plot(
        after[late][::EVERY] * 1e3,
        turn[late][::EVERY],
        color="black",
        linestyle="--",
        label="turn of the joint fit",
    )
    axes.set(xlabel="time after contact, ms", ylabel="angle, °")
    axes.set_title("the whole record")
    axes.legend(loc="upper left", borderpad=0.2)


def _draw_ring(axes: Axes, after: Array, rest: Array, ring: Array) -> None:
    shown = (after >= 0) & (after <= RING_SHOWN)
    fitted = shown & (after > SETTLE)
    axes.plot(after[shown] * 1e3, rest[shown], ".", color="0.55", markersize=2.5, label="record")
    axes.plot(after[fitted] * 1e3, ring[fitted], color="black", linewidth=0.7, label="fit")
    axes.axvline(SETTLE * 1e3, color="black", linewidth=0.6, linestyle=":")
    low, high = float(rest[shown].min()), float(rest[shown].max())
    room = max(high - low, 1e-3)
    axes.set_ylim(low - 0.08 * room, high + 0.25 * room)  # the legend's own strip above the ring
    axes.set(xlabel="time after contact, ms", ylabel="angle, °")
    axes.set_title("the record less the turn: the ring")
    axes.legend(loc="upper right", ncols=2, borderpad=0.2, markerscale=2)


def _shot_record(certification: Certification, shot: int) -> tuple[Array, Array]:
    """Return time after contact [s] and angle [°] of one shot, (sample,)."""
    session = certification.session
    encoder = session.records["impact"]["encoder"]
    assert isinstance(encoder, EncoderRecord)
    known, seen = session.calibration, certification.readings.passages
    last = seen.times.shape[2] - 1
    far = known["impact.gates.distance_0"].value
    near = known[f"impact.gates.distance_{last}"].value
    contact = seen.times[shot, 0, -1] + near * seen.duration_in[shot] / (far - near)
    turn = known["impact.encoder.counts_per_turn"].value * known["impact.encoder.scale"].value
    return encoder.times - contact, encoder.counts[shot] * (360 / turn)


def _fit(after: Array, angle: Array, frequency: Array, decay: Array) -> tuple[Array, Array]:
    """Return turn and ring, (sample,): powers of time beside rings of known pitch and decay."""
    fitted = after > SETTLE
    columns = [(after / after[-1]) ** power for power in range(DEGREE + 1)]
    for pitch, loss in zip(frequency, decay, strict=True):
        # before contact there is no ring, and an envelope run backwards would overflow
        envelope, phase = np.exp(-loss * np.maximum(after, 0)), 2 * np.pi * pitch * after
        columns += [envelope * np.cos(phase), envelope * np.sin(phase)]
    basis = np.stack(columns, axis=1)
    weights = np.linalg.lstsq(basis[fitted], angle[fitted], rcond=None)[0]
    turns = DEGREE + 1
    return basis[:, :turns] @ weights[:turns], basis[:, turns:] @ weights[turns:]


def _svg(draw: Any, height: float, name: str, title: str, description: str) -> str:
    """Return what `draw` puts on a figure as an SVG element to stand inside a page."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE, after_reset=True):  # whatever the user's own style is
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        draw(figure)
        written = io.StringIO()
        figure.savefig(written, format="svg", transparent=True, metadata={"Date": None})
    text = re.sub(r"<metadata>.*?</metadata>", "", written.getvalue(), flags=re.DOTALL)
    text = text[text.index("<svg") :]
    # ids are unique in a page, and two figures both have an "axes_1"
    # hundredths of a point are finer than any printer; the page gets lighter by half
    text = re.sub(r'\b(d|x|y)="[^"]*"', lambda found: _shorter(found[0]), text)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'href="#|url\(#', lambda found: f"{found[0]}{name}-", text)
    size = re.search(r'viewBox="[^"]*"', text)
    assert size is not None
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'{size[0]} role="img" aria-labelledby="{name}-title {name}-description">'
        f'<title id="{name}-title">{escape(title)}</title>'
        f'<desc id="{name}-description">{escape(description)}</desc>'
    )
    return head + text[text.index(">") + 1 :].strip()


def _shorter(coordinates: str) -> str:
    return re.sub(r"\d+\.\d+", lambda found: f"{float(found[0]):.2f}", coordinates)
