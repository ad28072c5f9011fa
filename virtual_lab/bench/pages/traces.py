"""Records of one shot, gates and encoder against time, as a drawing with a cursor and as tables."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from virtual_lab.bench.day.entries import record_of
from virtual_lab.bench.day.readings import gate_edges
from virtual_lab.output.svg import Panel
from virtual_lab.units import Array


class Passing(NamedTuple):
    """Times of one passage through a gate [ms], as printed."""

    direction: str
    gate: int
    broke: str
    cleared: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Traces:
    """Drawing (gates above, encoder below) and tables of the records of one shot."""

    shot: int
    drawn: str  # SVG
    data: str  # data of the cursor as JSON: axis limits, edges [ms], samples
    height: float
    first: float  # start of the time axis [ms]
    last: float  # end of the time axis [ms]
    passings: tuple[Passing, ...]
    samples: tuple[tuple[str, int], ...]  # time [ms] and counts
    summary: str


def traces_of(shot: int, records: Mapping[str, Any]) -> Traces:
    """Return the drawing of the records of one shot, and tables of their values against time [ms].

    Parameters
    ----------
    shot
        Number of the shot, from 1.
    records
        Records of the shot as JSON objects, keyed by channel. Without an encoder record the table
        of samples is empty.

    Raises
    ------
    KeyError
        There is no record with the key "gates".
    """
    edges = _edges(records["gates"])
    encoder = records.get("encoder") or records.get("swing")
    times = counts = np.zeros(0)
    if encoder and encoder["kind"] == "encoder":
        times = np.array(encoder["times"], dtype=float) * 1e3
        counts = np.array(encoder["counts"][0], dtype=float)
    finite = edges[np.isfinite(edges)]
    last = float(max([*finite * 1.05, *times[-1:], 1.0]))
    first = float(min([*finite * 1.05, 0.0]))  # scrap can break a beam before the trigger
    gates = edges.shape[1]
    bottom = 40.0 + 30.0 * gates
    panels = [_gate_panel(edges, (first, last), bottom)]
    if times.size:
        sample = np.unique(np.linspace(0, times.size - 1, 240).astype(int))
        times, counts = times[sample], counts[sample]
        panels.append(_encoder_panel(times, counts, (first, last), bottom + 52.0))
    panels[-1].x_label = "time after the trigger [ms]"
    data = {
        "left": panels[0].left,
        "right": panels[0].right,
        "first": round(first, 1),
        "last": round(last, 1),
        "gates": [_of_gate(edges, gate) for gate in range(gates)],
        "times": [round(float(t), 2) for t in times],
        "counts": [int(c) for c in counts],
    }
    rows = np.unique(np.linspace(0, times.size - 1, min(26, times.size)).astype(int))
    missing = int((~np.isfinite(edges).all(axis=-1)).sum())  # gates without one edge or both
    return Traces(
        shot=shot,
        drawn="".join(panel.svg() for panel in panels),
        data=json.dumps(data, separators=(",", ":")),
        height=panels[-1].bottom + 32.0,
        first=round(first, 1),
        last=round(last, 1),
        passings=tuple(
            Passing(direction, gate + 1, *(_ms(t) for t in edges[number, gate]))
            for number, direction in enumerate(("incoming", "rebound"))
            for gate in range(gates)
        ),
        samples=tuple((f"{times[at]:.1f}", int(counts[at])) for at in rows),
        summary=_summary(gates, missing, counts),
    )


def _edges(entry: Mapping[str, Any]) -> Array:
    """Return the times of the edges [ms], shape (direction, gate, edge); NaN if missed."""
    if entry["kind"] not in {"gates", "boards"}:
        return np.full((2, 1, 2), np.nan)
    return np.asarray(1e3 * gate_edges(record_of(entry))[0])


def _of_gate(edges: Array, gate: int) -> list[list[float]]:
    pairs = edges[:, gate]
    return [[round(float(t), 3) for t in pair] for pair in pairs if np.isfinite(pair).all()]


def _gate_panel(edges: Array, time: tuple[float, float], bottom: float) -> Panel:
    gates = edges.shape[1]
    low = 0.62  # drop of a line while its beam is broken [distance of two lines]
    title = "gates (a line drops while the beam is broken)"
    panel = _panel(34.0, bottom, time, (1 - low - 0.2, gates + 0.25), title)
    for gate in range(gates):
        x, y = [time[0]], [gate + 1.0]
        for broke, cleared in _of_gate(edges, gate):
            x += [broke, broke, cleared, cleared]
            y += [gate + 1.0, gate + 1 - low, gate + 1 - low, gate + 1.0]
        panel.line([*x, time[1]], [*y, gate + 1.0], width=1.3)
    return panel


def _encoder_panel(times: Array, counts: Array, time: tuple[float, float], top: float) -> Panel:
    low, high = float(counts.min()), float(counts.max())
    y = low - 0.03 * (high - low + 1), high + 0.05 * (high - low + 1)
    panel = _panel(top, top + 110.0, time, y, "encoder [counts]")
    panel.line(list(times), list(counts), width=1.3)
    return panel


def _panel(
    top: float, bottom: float, time: tuple[float, float], y: tuple[float, float], title: str
) -> Panel:
    return Panel(left=40.0, right=352.0, top=top, bottom=bottom, x=time, y=y, title=title)


def _ms(time: float) -> str:
    return f"{time:.3f}" if np.isfinite(time) else "not detected"


def _summary(gates: int, missing: int, counts: Array) -> str:
    passed = 2 * gates - missing
    words = f"the gates detected {passed} of {2 * gates} passages of the ball"
    if counts.size:
        words += f"; the encoder count went from {int(counts[0])} to {int(counts[-1])}"
    return words
