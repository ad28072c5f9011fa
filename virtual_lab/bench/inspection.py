"""What a sharp eye makes of a day's entries: each doubt with the fault it points to.

Everything here is read off the displays and records of the day, and off what the laboratory knew
before it: certificates, charts, the rules.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from math import hypot

import numpy as np

from virtual_lab import catalog
from virtual_lab.bench.day import DayEvent
from virtual_lab.bench.desk import Desk
from virtual_lab.bench.table import action_table

__all__ = ["Doubt", "doubts", "known_doubts", "remedied_by_gauge"]

SIGMAS = 4.0  # beyond which a display is not what it should be
WORST_MORNING = 0.002  # of a chart's mean: no chart of a dozen mornings is known better
CRACK = 0.015  # of the first bending frequency
HALF = 0.75  # of the turn on the chart
HEAVY = 1.5e-3  # kg, of the lot beyond the middle of the rule, with a scale that shows right
FLAGGED = {  # flag of the diagnostics: the fault of the catalog that it most often means
    "wall-drift": "wall-drift",
    "lot-rules": "ounces-as-grams",
    "bat-shape": "bat-ounces-as-grams",
    "pendulum-swing": "pendulum-wide",
    "ball-seen": "gate-misses",
    "edges": "gate-doubles",
    "aim": "aim-across",
    "encoder-fit": "encoder-slip",
    "recoil-and-rebound": "encoder-half-counts",
    "chords": "ball-out-of-round",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """A fault that something on the day points to."""

    fault: str
    why: str
    confidence: float  # 0 to 1


@cache
def known_doubts() -> dict[str, str]:
    """Return the faults one may name, and their titles: what can go wrong in a laboratory."""
    return {name: catalog.title("faults", name) for name in catalog.names("faults")}


def doubts(desk: Desk) -> Iterator[Doubt]:
    """Yield what the day so far points to, each fault once."""
    seen: set[str] = set()
    for check in (_scale, _gates, _wall, _cylinder, _taps, _flags):
        for doubt in check(desk):
            if doubt.fault not in seen:
                seen.add(doubt.fault)
                yield doubt


def remedied_by_gauge(desk: Desk) -> bool:
    """Return whether a gate stands elsewhere than its certificate says, and was gauged."""
    return any(True for _ in _gates(desk)) and not any(
        event.constants for event in desk.day.events if event.action == "gauge-gates"
    )


def _scale(desk: Desk) -> Iterator[Doubt]:
    event = desk.last("weigh-check-mass")
    if event is None:
        return
    readings = [value for what, value in _numbers(event) if what.startswith("reading")]
    known, mass = desk.session.calibration, action_table().consequences.check_mass
    zero, span = known["bench.scale.zero"], known["bench.scale.span"]
    step = known["bench.scale.resolution"].value
    off = float(np.mean(readings)) * 1e-3 - (span.value * mass + zero.value)
    if abs(off) > SIGMAS * hypot(zero.u, span.u * mass, step):
        yield Doubt(
            fault="scale-not-tared",
            why=f"the check mass shows {off * 1e3:+.1f} g",
            confidence=0.95,
        )


def _gates(desk: Desk) -> Iterator[Doubt]:
    event = desk.last("gauge-gates")
    if event is None:
        return
    shown = dict(_numbers(event))
    gauge_u = action_table().consequences.gauge_u
    for gate in (1, 2, 3):
        if f"gate {gate}, gauged" not in shown:
            return
        off = (shown[f"gate {gate}, gauged"] - shown[f"gate {gate}, certificate"]) * 1e-3
        known = desk.day.morning.calibration[f"impact.gates.distance_{gate - 1}"]
        if abs(off) > SIGMAS * hypot(known.u, gauge_u):
            yield Doubt(
                fault="gate-moved",
                why=f"gate {gate} stands {off * 1e3:+.2f} mm from its certificate's place",
                confidence=0.9,
            )


def _wall(desk: Desk) -> Iterator[Doubt]:
    for name, ratio, sigmas in _charted(desk, "fire-check-ball"):
        if abs(sigmas) > SIGMAS:
            why = f"{name} of the check ball is {ratio:.3f} of the chart's"
            yield Doubt(fault="wall-drift", why=why, confidence=0.8)


def _cylinder(desk: Desk) -> Iterator[Doubt]:
    for name, ratio, sigmas in _charted(desk, "fire-check-cylinder"):
        if abs(sigmas) <= SIGMAS:
            continue
        why = f"{name} at the cylinder is {ratio:.3f} of the chart's"
        if not name.startswith("turn"):
            yield Doubt(fault="aim-across", why=why, confidence=0.4)
        elif ratio < HALF:
            yield Doubt(fault="encoder-half-counts", why=why, confidence=0.95)
        else:
            yield Doubt(fault="bearing-friction", why=why, confidence=0.5)


def _taps(desk: Desk) -> Iterator[Doubt]:
    taps = [e for e in desk.day.events if e.action == "tap-bat" and e.number not in desk.day.struck]
    if len(taps) < 2:
        return
    first, last = (float(event.shown[0][1]) for event in (taps[0], taps[-1]))
    if last < first * (1 - CRACK):
        why = f"the bat rings at {last:g} Hz, before the first shot at {first:g} Hz"
        yield Doubt(fault="bat-cracked", why=why, confidence=0.95)


def _flags(desk: Desk) -> Iterator[Doubt]:
    if not desk.day.fired or desk.missing:
        return
    for flag in desk.certification.flags:
        if flag.name in FLAGGED:
            yield Doubt(fault=FLAGGED[flag.name], why=flag.sentence, confidence=0.6)


def _charted(desk: Desk, action: str) -> Iterator[tuple[str, float, float]]:
    """Yield each number of a check standard: over its chart's mean, and off it in sigmas."""
    event = desk.last(action)
    if event is None:
        return
    shown = dict(_numbers(event))
    for name in dict.fromkeys(what.rpartition(", ")[0] for what in shown):
        today, chart, sd = (
            shown[f"{name}, {word}"]
            for word in ("today", "chart", "standard deviation of a morning")
        )
        yield name, today / chart, (today - chart) / hypot(sd, WORST_MORNING * chart)


def _numbers(event: DayEvent) -> Iterator[tuple[str, float]]:
    for what, value, _ in event.shown:
        if not isinstance(value, str):
            yield what, float(value)
