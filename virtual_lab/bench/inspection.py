"""What a sharp eye makes of a day's entries: each doubt with the fault it points to.

Everything here is read off the displays and records of the day, and off what the laboratory knew
before it: certificates, charts, the rules. How large a number must be to mean a fault stands in
``data/faults``, under ``found_by``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from math import hypot, tau
from types import MappingProxyType
from typing import cast

import numpy as np

from virtual_lab import catalog
from virtual_lab.bench.day import DayEvent
from virtual_lab.bench.desk import Desk
from virtual_lab.bench.entries import record_of
from virtual_lab.bench.protocol import left_out
from virtual_lab.bench.table import action_table
from virtual_lab.catalog.faults import FaultSheet, FoundBy
from virtual_lab.records import GateRecord, PendulumRecord

CLOCK = "clock of the gates, fast"  # as compare-clock shows it


@dataclass(frozen=True, slots=True)
class Sign:
    """A number that decides whether a fault is there, and where it was seen."""

    fault: str
    number: float
    why: str

    @property
    def decides(self) -> bool:
        """Whether the number is as large as the fault makes it."""
        known = detectable().get(self.fault)
        return known is not None and self.number > known.beyond


@cache
def fault_sheets() -> Mapping[str, FaultSheet]:
    """Return what is known of all that can go wrong in a laboratory."""
    return MappingProxyType(
        {name: catalog.load("faults", name, FaultSheet).spec for name in catalog.names("faults")}
    )


def known_doubts() -> dict[str, str]:
    """Return the faults one may name, and their titles."""
    return {name: sheet.title for name, sheet in fault_sheets().items()}


@cache
def detectable() -> Mapping[str, FoundBy]:
    """Return the faults that a check at the bench finds, and how."""
    found = {name: sheet.found_by for name, sheet in fault_sheets().items() if sheet.found_by}
    return MappingProxyType(found)


def doubts(desk: Desk) -> Iterator[Sign]:
    """Yield the signs of a fault that the day so far shows, one of each fault."""
    found: dict[str, Sign] = {}
    for sign in signs(desk):
        if sign.decides:
            found.setdefault(sign.fault, sign)
    for name, sign in found.items():
        if not found.keys() & set(detectable()[name].unless):
            yield sign


def remedied_by_gauge(desk: Desk) -> bool:
    """Return whether a gate stands elsewhere than its certificate says, and was gauged."""
    return any(doubt.fault == "gate-moved" for doubt in doubts(desk)) and not any(
        event.constants for event in desk.day.events if event.action == "gauge-gates"
    )


def signs(desk: Desk) -> Iterator[Sign]:
    """Yield every number that may decide on a fault, whether it does or not."""
    for look in LOOKS:
        yield from look(desk)


def _scale(desk: Desk) -> Iterator[Sign]:
    event = desk.last("weigh-check-mass")
    if event is None:
        return
    readings = [value for what, value in _numbers(event) if what.startswith("reading")]
    known, mass = desk.session.calibration, action_table().consequences.check_mass
    zero, span = known["bench.scale.zero"], known["bench.scale.span"]
    step = known["bench.scale.resolution"].value
    off = float(np.mean(readings)) * 1e-3 - (span.value * mass + zero.value)
    number = abs(off) / hypot(zero.u, span.u * mass, step)
    yield Sign("scale-not-tared", number, f"the check mass shows {off * 1e3:+.1f} g")


def _bench(desk: Desk) -> Iterator[Sign]:
    bat, length, balance = (
        desk.last(name) for name in ("weigh-bat", "measure-length", "measure-balance")
    )
    if bat:
        mass = _mean(bat)
        yield Sign("bat-ounces-as-grams", 1 - mass / 800, f"a bat of {mass:.0f} g")
    if length and balance and balance.arguments["end"] == "tip":
        share = _mean(balance) / _mean(length)
        yield Sign("balance-from-knob", share, f"balance point at {share:.2f} of the length")


def _pendulum(desk: Desk) -> Iterator[Sign]:
    from virtual_lab.measurement.diagnostics.bench import DECAY_U, swing_slowing  # slow to load

    swung, alone = desk.last("swing"), _shown(desk, "swing-clamp")
    slowed = (
        swing_slowing(cast(PendulumRecord, record_of(swung.records["pendulum"]))) if swung else None
    )
    if slowed and np.isfinite(slowed.times[0]):
        times, u = float(slowed.times[0]), float(slowed.u[0])
        why = f"the periods shorten {times:.1f} times as much as the amplitudes read allow"
        yield Sign("pendulum-wide", abs(times - 1) / hypot(u, DECAY_U), why)
    if alone:
        off = alone["clamp, measured"] - alone["clamp, as entered"]
        known = desk.session.calibration["bench.pendulum.clamp_inertia"]
        number = abs(off) * 1e-6 / hypot(known.u, action_table().consequences.clamp_u)
        why = f"the clamp alone has {off:+.0f} kg mm² off what was entered"
        yield Sign("clamp-forgotten", number, why)


def _weighed_again(desk: Desk) -> Iterator[Sign]:
    shown, done = _shown(desk, "reweigh-balls"), [each.action for each in desk.day.events]
    if shown and "tare" in done[: done.index("weigh-balls")]:  # else the scale may have changed
        off = np.mean([v if "display" in what else -v for what, v in shown.items()]) * 2e-3
        step = desk.session.calibration["bench.scale.resolution"].value
        why = f"the display shows a ball {off * 1e3:+.2f} g off what was entered"
        yield Sign("ball-mass-typed", abs(float(off)) / step, why)


def _hit_again(desk: Desk) -> Iterator[Sign]:
    if shown := list(_shown(desk, "recheck-balls").values()):
        again, morning = (np.array(shown[first::2]) for first in (0, 1))
        more = float(np.mean(again / morning)) - 1
        why = f"the balls at the rig come back {more:+.1%} faster than this morning"
        yield Sign("wrong-lot", more, why)


def _pivot(desk: Desk) -> Iterator[Sign]:
    if shown := _shown(desk, "measure-pivot"):
        off = (shown["axis from the knob, measured"] - shown["axis from the knob, surveyed"]) * 1e-3
        known = desk.session.calibration["impact.pivot.from_knob"]
        why = f"the axis is {off * 1e3:+.1f} mm from where it was surveyed"
        number = abs(off) / hypot(known.u, action_table().consequences.pivot_rule_u)
        yield Sign("pivot-off", number, why)


def _clock(desk: Desk) -> Iterator[Sign]:
    if shown := _shown(desk, "compare-clock"):
        off = shown[f"{CLOCK}, today"] - shown[f"{CLOCK}, chart"]
        why = f"the gates' clock runs {off:+.0f} ppm off its chart"
        u = shown[f"{CLOCK}, standard deviation of a morning"]
        yield Sign("gate-clock", abs(off) / u, why)


def _lot(desk: Desk) -> Iterator[Sign]:
    weighed, hit = desk.last("weigh-balls"), desk.last("hit-wall")
    windows = desk.rules.spec.windows
    if weighed:
        mass = _mean(weighed)
        usual = (windows.ball_mass_low + windows.ball_mass_high) / 2
        yield Sign("ounces-as-grams", 1 - mass * 1e-3 / usual, f"balls of {mass:.1f} g")
    if hit:
        ratios = np.array([value for _, value in _numbers(hit)])
        lacks = 1 - ratios / np.median(ratios)
        worst = int(lacks.argmax())
        why = f"ball {worst + 1} comes back {lacks[worst]:.1%} slower than the lot"
        yield Sign("ball-worn-out", float(lacks[worst]), why)


def _gates(desk: Desk) -> Iterator[Sign]:
    shown = _shown(desk, "gauge-gates")
    gauge_u = action_table().consequences.gauge_u
    gate = 1
    while f"gate {gate}, gauged" in shown:
        off = (shown[f"gate {gate}, gauged"] - shown[f"gate {gate}, certificate"]) * 1e-3
        known = desk.day.morning.calibration[f"impact.gates.distance_{gate - 1}"]
        why = f"gate {gate} stands {off * 1e3:+.2f} mm from its certificate's place"
        yield Sign("gate-moved", abs(off) / hypot(known.u, gauge_u), why)
        gate += 1


def _wall(desk: Desk) -> Iterator[Sign]:
    for name, ratio, sigmas in _charted(desk, "fire-check-ball"):
        why = f"{name} of the check ball is {ratio:.3f} of the chart's"
        yield Sign("wall-drift", abs(sigmas), why)


def _paper(desk: Desk) -> Iterator[Sign]:
    shown = _shown(desk, "aim-paper")
    if not shown:
        return
    known = desk.session.calibration
    across = 2 * known["ball.radius"].value
    for way, aimed in (("along", "impact.cannon.along"), ("across", "impact.pivot.height")):
        at = known[aimed].value if aimed in known else 0.0
        off = shown[f"mean {way}"] * 1e-3 - at
        why = f"the marks lie {off * 1e3:+.1f} mm off the aim {way} the bat"
        yield Sign(f"aim-{way}", abs(off) / across, why)


def _cylinder(desk: Desk) -> Iterator[Sign]:
    for name, ratio, _ in _charted(desk, "fire-check-cylinder"):
        if name.startswith("turn"):
            why = f"{name} at the cylinder is {ratio:.3f} of the chart's"
            yield Sign("encoder-half-counts", 1 - ratio, why)
            yield Sign("bearing-friction", 1 - ratio, why)


def _taps(desk: Desk) -> Iterator[Sign]:
    taps = [e for e in desk.day.events if e.action == "tap-bat" and e.number not in desk.day.struck]
    if len(taps) > 1:
        first, last = (float(event.shown[0][1]) for event in (taps[0], taps[-1]))
        why = f"the bat rings at {last:g} Hz, before at {first:g} Hz"
        yield Sign("bat-cracked", 1 - last / first, why)


def _shots(desk: Desk) -> Iterator[Sign]:
    if not desk.day.fired or desk.missing:
        return
    found = desk.by_rules
    missed = ~found.readings.seen.raw.complete
    why = f"a gate did not see {missed.sum()} of {missed.size} balls come in"
    yield Sign("gate-misses", float(missed.mean()), why)
    record = desk.session.records["impact"]["gates"]
    if isinstance(record, GateRecord):
        yield from signs_of_edges(record)
    hurried = {(each.step, each.shot) for each in left_out(desk.day)}
    waited = {
        step: [shot for shot in range(missed.size) if (step, shot) not in hurried]
        for step in ("wait-pressure", "wait-rest")
    }
    asked = desk.rules.spec.ball_speed
    speeds = found.shots.speed[waited["wait-pressure"]]
    speeds = speeds[np.isfinite(speeds)]
    if speeds.size:
        slow = 1 - float(np.median(speeds)) / asked
        yield Sign("cannon-slow", slow, f"the middle of the shots is {slow:.1%} slow")
    turning, allowed = found.readings.recoil, desk.rules.spec.windows.rate_before
    if turning is not None and allowed and waited["wait-rest"]:
        turn = desk.session.calibration["impact.encoder.counts_per_turn"].value / tau
        rate = float(np.median(np.abs(turning.before[waited["wait-rest"]]))) / turn
        why = f"the bat, waited for, turns at {rate:.2f} rad/s before it is hit"
        yield Sign("bat-not-at-rest", rate / allowed, why)
    if turning is not None:
        rough = turning.residual
        why = f"a smooth turn leaves {rough.min():.2f} to {rough.max():.2f} counts rms of the shots"
        yield Sign("encoder-slip", float(np.ptp(rough)), why)
        yield Sign("encoder-play", float(rough.min()), why)


def signs_of_edges(record: GateRecord) -> Iterator[Sign]:
    """Hold how long each ball breaks the first beam and the last against each other."""
    long = record.times[..., 1] - record.times[..., 0]
    ratio = long[:, :, 0] / long[:, :, -1]
    into = ratio[np.isfinite(ratio[:, 0]), 0]
    if into.size:
        why = "a ball looks {:.0%} longer at the {} gate than at the {}"
        first, last = float(into.max()) - 1, 1 / float(into.min()) - 1
        yield Sign("sabot-trip", first, why.format(first, "first", "last"))
        yield Sign("gate-doubles", last, why.format(last, "last", "first"))
        off = float(np.nanmax(np.abs(ratio - 1)))
        yield Sign("ball-out-of-round", off, f"balls look up to {off:.1%} longer at one gate")


def _charted(desk: Desk, action: str) -> Iterator[tuple[str, float, float]]:
    """Yield each number of a check standard: over its chart's mean, and off it in sigmas."""
    shown = _shown(desk, action)
    for name in dict.fromkeys(what.rpartition(", ")[0] for what in shown):
        today, chart, sd = (
            shown[f"{name}, {word}"]
            for word in ("today", "chart", "standard deviation of a morning")
        )
        # no chart of a dozen mornings is known better than to 0.2 %
        yield name, today / chart, (today - chart) / hypot(sd, 0.002 * chart)


def _shown(desk: Desk, action: str) -> dict[str, float]:
    """Return the numbers that an action showed last, by their names; {} before it was done."""
    event = desk.last(action)
    return dict(_numbers(event)) if event else {}


def _mean(event: DayEvent) -> float:
    return float(np.mean([value for _, value in _numbers(event)]))


def _numbers(event: DayEvent) -> Iterator[tuple[str, float]]:
    for what, value, _ in event.shown:
        if not isinstance(value, str):
            yield what, float(value)


LOOKS = (
    _scale,
    _bench,
    _pendulum,
    _weighed_again,
    _lot,
    _gates,
    _pivot,
    _clock,
    _wall,
    _hit_again,
    _paper,
    _cylinder,
    _taps,
    _shots,
)
