"""Comparison of readings with their expected values: difference, u of the difference, limits.

The comparison uses only the displays and records of the day, and what the laboratory knew before:
certificates, control charts and rules. Page, debrief and simulated operators use the same rows. The
limits are in ``data/faults``, under ``found_by``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import hypot, inf, sqrt, tau
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from virtual_lab.bench.day.entries import record_of
from virtual_lab.bench.day.protocol import omitted_steps
from virtual_lab.bench.day.table import action_table, detectable, repairs
from virtual_lab.output.rounding import decimals, digits
from virtual_lab.records import BoardRecord, GateRecord, PendulumRecord, Record
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

if TYPE_CHECKING:
    from virtual_lab.bench.day.day import DayEvent
    from virtual_lab.bench.day.desk import Desk

CLOCK = "clock of the gates, fast"  # label of the display of compare-clock
SCRAPS = (
    0.2  # largest share of shots with sabot fragments ahead of the ball; 2 shots are always allowed
)
ROUGH_SHOTS = 3  # number of shots before the residuals of the encoder fit are compared
COUNTING = 1 / sqrt(12)  # rms error of rounding a smooth rotation to whole counts [counts]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckRow:
    """Comparison of one reading with its expected value, in the unit of the display."""

    fault: str  # fault that a reading beyond its limits indicates
    what: str  # name of the reading
    reading: float
    expected: float | None  # expected value; None if there is none
    u: float  # standard uncertainty of the difference; 0 for a count
    low: float  # lower limit of the reading
    high: float
    unit: str
    entry: int  # entry of the notebook
    words: tuple[object, ...] = ()  # strings for the placeholders of `what`

    @property
    def within(self) -> bool:
        return self.low <= self.reading <= self.high

    @property
    def printed(self) -> PrintedRow:
        places = decimals(self.u) if self.u else 0

        def number(value: float) -> str:
            return f"{value + 0.0:.{places}f}".replace("-0." + "0" * places, "0." + "0" * places)

        difference = None if self.expected is None else self.reading - self.expected
        limits = (
            f"± {number(self.high - self.expected)}"
            if self.expected is not None
            and abs(self.high + self.low - 2 * self.expected) < 1e-9 * max(1.0, abs(self.high))
            else f"{number(self.low)} to {number(self.high)}"
            if inf not in (-self.low, self.high)
            else f"at most {number(self.high)}"
            if self.high < inf
            else f"at least {number(self.low)}"
        )
        return PrintedRow(
            what=self.what,
            reading=number(self.reading),
            expected="–" if self.expected is None else number(self.expected),
            difference="–" if difference is None else f"{difference:+.{places}f}",
            u=digits(self.u) if self.u else "counted",
            limit=limits,
            unit=self.unit,
            word="within" if self.within else "beyond the limit",
        )

    @property
    def why(self) -> str:
        """The comparison as a sentence: reading, expected value, u and limit."""
        row = self.printed
        unit = f" {row.unit}" if row.unit else ""
        of = f", expected {row.expected}{unit}" if self.expected is not None else ""
        u = f", u {row.u}" if self.u else ""
        return f"{row.what} {row.reading}{unit}{of}{u}, limit {row.limit}{unit}"


class PrintedRow(NamedTuple):
    """The numbers of a `CheckRow` as printed."""

    what: str
    reading: str
    expected: str
    difference: str
    u: str
    limit: str
    unit: str
    word: str


def suspected_faults(desk: Desk) -> Iterator[CheckRow]:
    """Yield one row per suspected fault.

    Some readings indicate a fault if they are outside their limits. The fault is then suspected.
    The row is the table row of the first of these readings. The list ``unless`` of a fault names
    other faults that explain the same readings. The fault is left out if one of these other faults
    is suspected too. Nothing is yielded if all readings are within their limits.
    """
    first_rows: dict[str, CheckRow] = {}
    for row in rows_of(desk):
        if not row.within:
            first_rows.setdefault(row.fault, row)
    for name, row in first_rows.items():
        if not first_rows.keys() & set(detectable()[name].unless):
            yield row


def rows_of(desk: Desk) -> Iterator[CheckRow]:
    """Yield one row per reading that has limits, whether or not the reading is within them.

    Nothing is yielded if no such reading has been taken yet.
    """
    for look in LOOKS:
        yield from look(desk)


def _row(
    fault: str,
    event: DayEvent,
    reading: float,
    expected: float | None = None,
    u: float = 0.0,
    *words: object,
    **limits: float,
) -> CheckRow:
    """Return the comparison of a reading that can indicate `fault`.

    `words` fill the placeholders in the name of the reading. `limits` are `low` and `high`, or
    `tolerance` on both sides of the expected value. Without `limits` the tolerance is the multiple
    of `u` in the sheet of the fault.
    """
    sheet = detectable()[fault]
    low, high = limits.get("low", -inf), limits.get("high", inf)
    if expected is not None and not limits.keys() & {"low", "high"}:
        tolerance = limits.get("tolerance", sheet.beyond * u)
        low, high = expected - tolerance, expected + tolerance
    return CheckRow(
        fault=fault,
        what=sheet.reading.format(*words),
        reading=float(reading),
        expected=None if expected is None else float(expected),
        u=float(u),
        low=float(low),
        high=float(high),
        unit=sheet.unit,
        entry=event.number,
        words=words,
    )


def _limit(fault: str) -> float:
    return detectable()[fault].beyond


def _scatter(fault: str) -> float:
    """Return the standard deviation of a reading without a fault, from the sheet of the fault."""
    return detectable()[fault].u or 0.0


def _scale(desk: Desk) -> Iterator[CheckRow]:
    if event := desk.last("weigh-check-mass"):
        readings = [value for quantity, value in _numbers(event) if quantity.startswith("reading")]
        calibration, mass = desk.session.calibration, action_table().consequences.check_mass
        zero, span = calibration["bench.scale.zero"], calibration["bench.scale.span"]
        at = 1e3 * (span.value * mass + zero.value)
        u = 1e3 * hypot(zero.u, span.u * mass, calibration["bench.scale.resolution"].value)
        yield _row("scale-not-tared", event, float(np.mean(readings)), at, u)


def _bench(desk: Desk) -> Iterator[CheckRow]:
    bat, length, balance = (
        desk.last(name) for name in ("weigh-bat", "measure-length", "measure-balance")
    )
    calibration = desk.session.calibration
    if bat:
        u = 1e3 * hypot(
            calibration["bench.scale.zero"].u, calibration["bench.scale.resolution"].value
        )
        least = 800 * (1 - _limit("bat-ounces-as-grams"))
        yield _row("bat-ounces-as-grams", bat, _mean(bat), None, u, low=least)
    if length and balance and balance.arguments["end"] == "tip":
        length_mm, fault = _mean(length), "balance-from-knob"
        u = 1e3 * hypot(
            calibration["bench.stand.offset"].u, calibration["bench.stand.resolution"].value
        )
        share = _mean(balance) / length_mm
        yield _row(fault, balance, share, None, u / length_mm, high=_limit(fault))


def _pendulum(desk: Desk) -> Iterator[CheckRow]:
    # slow to load
    from virtual_lab.measurement.diagnostics.bench import DECAY_U, swing_slowing
    from virtual_lab.measurement.reduction.observations import Releases

    if swung := desk.last("swing"):
        record = cast(PendulumRecord, record_of(swung.records["pendulum"]))
        slowed = swing_slowing(Releases.of(record))
        if slowed and np.isfinite(slowed.times[0]):
            u = hypot(float(slowed.u[0]), DECAY_U)
            yield _row("pendulum-wide", swung, float(slowed.times[0]), 1.0, u)
    if alone := desk.last("swing-clamp"):
        key = "bench.pendulum.clamp_inertia"
        u = 1e6 * hypot(desk.day.morning.calibration[key].u, action_table().consequences.clamp_u)
        measured = dict(_numbers(alone))["clamp, measured"]
        entered = 1e6 * desk.session.calibration[key].value
        yield _row("clamp-forgotten", alone, measured, entered, u)


def _repeated_weighing(desk: Desk) -> Iterator[CheckRow]:
    event, actions = desk.last("reweigh-balls"), [each.action for each in desk.day.events]
    # without a tare before, the zero of the scale may have changed between the two weighings
    if event and "tare" in actions[: actions.index("weigh-balls")]:
        values = [value for _, value in _numbers(event)]
        u = 1e3 * desk.session.calibration["bench.scale.resolution"].value
        on_display, entered = float(np.mean(values[::2])), float(np.mean(values[1::2]))
        yield _row("ball-mass-typed", event, on_display, entered, u, len(values) // 2)


def _repeated_wall_hits(desk: Desk) -> Iterator[CheckRow]:
    event, morning = desk.last("recheck-balls"), desk.last("hit-wall")
    if event and morning:
        values = [value for _, value in _numbers(event)]
        today, before = (np.array(values[first::2]) for first in (0, 1))
        # an upper bound: repeats of one ball scatter less
        u = _lot_scatter(morning) / sqrt(today.size)
        ratio = float(np.mean(today / before))
        yield _row("wrong-lot", event, ratio, 1.0, u, high=1 + _limit("wrong-lot"))


def _pivot(desk: Desk) -> Iterator[CheckRow]:
    if event := desk.last("measure-pivot"):
        key = "impact.pivot.from_knob"
        surveyed = desk.day.morning.calibration[key]
        u = 1e3 * hypot(surveyed.u, action_table().consequences.pivot_rule_u)
        measured = dict(_numbers(event))["axis from the knob, measured"]
        yield _row("pivot-off", event, measured, 1e3 * desk.session.calibration[key].value, u)


def _clock(desk: Desk) -> Iterator[CheckRow]:
    for _, event, today, chart, sd in _chart_values(desk, "compare-clock"):
        yield _row("gate-clock", event, today, chart, sd)


def _lot(desk: Desk) -> Iterator[CheckRow]:
    weighed, hit = desk.last("weigh-balls"), desk.last("hit-wall")
    windows = desk.rules.spec.windows
    if weighed:
        usual = 1e3 * (windows.ball_mass_low + windows.ball_mass_high) / 2
        u = 1e3 * desk.session.calibration["bench.scale.resolution"].value
        least = usual * (1 - _limit("ounces-as-grams"))
        yield _row("ounces-as-grams", weighed, _mean(weighed), usual, u, low=least)
    if hit:
        ratios = np.array([value for _, value in _numbers(hit)])
        ratios[[ball for ball in desk.day.retired if ball < ratios.size]] = np.median(ratios)
        middle, worst = float(np.median(ratios)), int(ratios.argmin())
        u, least = _lot_scatter(hit) * middle, middle * (1 - _limit("ball-worn-out"))
        yield _row("ball-worn-out", hit, ratios[worst], middle, u, worst + 1, low=least)


def _lot_scatter(hit: DayEvent) -> float:
    """Return the relative standard deviation of e0 between the balls, without the lowest one."""
    ratios = np.sort([value for _, value in _numbers(hit)])[1:]
    return float(np.std(ratios, ddof=1) / np.mean(ratios))


def _gates(desk: Desk) -> Iterator[CheckRow]:
    event = desk.last("gauge-gates")
    values = dict(_numbers(event)) if event else {}
    gate = 1
    while event and f"gate {gate}, gauged" in values:
        key = f"impact.gates.distance_{gate - 1}"
        u = 1e3 * hypot(desk.day.morning.calibration[key].u, action_table().consequences.gauge_u)
        stated = 1e3 * desk.session.calibration[key].value
        yield _row("gate-moved", event, values[f"gate {gate}, gauged"], stated, u, gate)
        gate += 1


def _wall(desk: Desk) -> Iterator[CheckRow]:
    for _, event, today, chart, sd in _chart_values(desk, "fire-check-ball"):
        yield _row("wall-drift", event, today, chart, sd)


def _paper(desk: Desk) -> Iterator[CheckRow]:
    event = desk.last("aim-paper")
    if event is None:
        return
    values, calibration = dict(_numbers(event)), desk.session.calibration
    diameter = 2e3 * calibration["ball.radius"].value
    marks = record_of(event.records["aim"]) if event.records else None
    for direction, key in (("along", "impact.cannon.along"), ("across", "impact.pivot.height")):
        aim = calibration.get(key, Estimate(value=0.0))
        positions = np.asarray(getattr(marks, direction, np.zeros(1)))
        scatter = (
            float(np.std(positions, ddof=1) / sqrt(positions.size)) if positions.size > 1 else 0.0
        )
        fault, u = f"aim-{direction}", 1e3 * hypot(aim.u, scatter, 1e-4)
        mean, tolerance = values[f"mean {direction}"], _limit(f"aim-{direction}") * diameter
        yield _row(fault, event, mean, 1e3 * aim.value, u, tolerance=tolerance)


def _cylinder(desk: Desk) -> Iterator[CheckRow]:
    for name, event, today, chart, sd in _chart_values(desk, "fire-check-cylinder"):
        if name.startswith("rotation"):
            half = today < chart * (1 - _limit("encoder-half-counts"))
            fault = "encoder-half-counts" if half else "bearing-friction"
            least = chart * (1 - _limit("bearing-friction"))
            yield _row(fault, event, today, chart, sd, low=least)


def _taps(desk: Desk) -> Iterator[CheckRow]:
    taps = [e for e in desk.day.events if e.action == "tap-bat" and e.number not in desk.day.struck]
    if len(taps) > 1:
        first, last = (float(event.shown[0][1]) for event in (taps[0], taps[-1]))
        u, least = sqrt(2) * action_table().consequences.tap_u, 1 - _limit("bat-cracked")
        yield _row("bat-cracked", taps[-1], last, first, u, low=first * least)


def _shots(desk: Desk) -> Iterator[CheckRow]:
    """Yield the rows that follow from all shots since the last repair of the rig."""
    fired = [event for event in desk.day.events if event.action == "fire"]
    since = shots_before_repair(desk)
    if len(fired) == since or desk.reduction_error:
        return
    shots, readings, last = desk.reduction_by_rules.shots, desk.readings, fired[-1]
    missed = ~readings.flights.raw.complete[since:]
    yield _row("gate-misses", last, float(missed.sum()), 0.0, 0.0, missed.size, high=0.0)
    record = desk.session.records["impact"]["gates"]
    if isinstance(record, GateRecord | BoardRecord):
        yield from rows_of_edges(record, last, range(since, len(fired)))
    hurried = {(each.step, each.shot) for each in omitted_steps(desk.day)}
    waited = {
        step: [shot for shot in range(since, len(fired)) if (step, shot) not in hurried]
        for step in ("wait-pressure", "wait-rest")
    }
    nominal, tolerance = desk.rules.spec.ball_speed, desk.rules.spec.windows.speed_tolerance
    speeds = shots.speed[waited["wait-pressure"]]
    speeds = speeds[np.isfinite(speeds)]
    if speeds.size:
        fault, middle = "cannon-slow", float(np.median(speeds))
        u, least = _scatter(fault) * tolerance, nominal - _limit(fault) * tolerance
        yield _row(fault, last, middle, nominal, u, low=least)
    recoil, rate_limit = readings.recoil, desk.rules.spec.windows.rate_before
    if recoil is not None and rate_limit and waited["wait-rest"]:
        turn = desk.session.calibration["impact.encoder.counts_per_turn"].value / tau
        rate = float(np.median(np.abs(recoil.before[waited["wait-rest"]]))) / turn
        fault = "bat-not-at-rest"
        u, most = _scatter(fault) * rate_limit, _limit(fault) * rate_limit
        yield _row(fault, last, rate, 0.0, u, high=most)
    if recoil is not None and len(fired) - since >= ROUGH_SHOTS:
        rough = recoil.residual[since:]
        for fault, number, at in (
            ("encoder-slip", float(np.ptp(rough)), 0.0),
            ("encoder-play", float(rough.min()), COUNTING),
        ):
            yield _row(fault, last, number, at, _scatter(fault), high=_limit(fault))


def shots_before_repair(desk: Desk) -> int:
    """Return the number of shots that were fired before the last repair; 0 without a repair.

    A repair that removed no fault counts too.
    """
    fired = 0
    before = 0
    for event in desk.day.events:
        fired += event.action == "fire"
        if event.action in repairs():
            before = fired
    return before


def gate_edges(record: Record) -> Array:
    """Return the times of the edges of each gate [s], shape (shot, direction, gate, edge).

    Direction 0 is the incoming ball and 1 the rebound; edge 0 breaks the beam and 1 clears it. A
    missed edge is NaN. A board with several beams counts as broken while any beam is broken. Raises
    `AssertionError` for a record of anything but light gates or light boards.
    """
    assert isinstance(record, GateRecord | BoardRecord)
    broke, cleared = record.times[..., 0], record.times[..., 1]
    if broke.ndim == 4:  # boards have several beams
        broke, cleared = np.fmin.reduce(broke, axis=3), np.fmax.reduce(cleared, axis=3)
    return np.stack([broke, cleared], axis=-1)


def blocking_times(record: Record) -> Array:
    """Return the time for which the incoming ball blocks each gate [s], shape (shot, gate).

    The time is NaN if the gate missed an edge. Raises `AssertionError` for a record of anything but
    light gates or light boards.
    """
    return np.asarray(np.diff(gate_edges(record)[:, 0], axis=-1)[..., 0])


def rows_of_edges(record: Record, event: DayEvent, shots: range) -> Iterator[CheckRow]:
    """Yield the largest and the smallest ratio of blocking times over several shots, one row each.

    The ratio is the time for which the incoming ball blocks the first gate, divided by the time for
    which it blocks the last gate. It is 1 for a round ball. These two rows are left out if no shot
    has both times.

    Light boards have an additional first row with the number of ratios that are clearly too large.
    In these shots, a fragment of the sabot blocked the first gate before the ball did. The other
    two rows do not use these ratios.

    `event` is the entry of the notebook to which the rows refer. `shots` is the range of shots,
    counted from 0.
    """
    passages = blocking_times(record)[shots.start : shots.stop]
    ratio = passages[:, 0] / passages[:, -1]
    early = ratio > 1 + _limit("sabot-trip")
    if isinstance(record, BoardRecord):  # sabots shed a fragment now and then on any day
        most, words = (
            max(2.0, SCRAPS * early.size),
            (early.size, "a ball blocked the first gate too early"),
        )
        yield _row("sabot-trip", event, float(early.sum()), 0.0, 0.0, *words, high=most)
        ratio = np.where(early, np.nan, ratio)
    if not np.isfinite(ratio).any():
        return
    first, last = float(np.nanmax(ratio)), float(np.nanmin(ratio))
    usual = "ball-out-of-round"
    for fault, word, number, struck in (
        ("sabot-trip", "largest", first, first > 1 + _limit("sabot-trip")),
        ("gate-doubles", "smallest", last, last < 1 / (1 + _limit("gate-doubles"))),
    ):
        shot = shots.start + int(np.nanargmin(np.abs(ratio - number))) + 1
        row = _row(usual, event, number, 1.0, _scatter(usual), word, shot, tolerance=_limit(usual))
        yield replace(row, fault=fault) if struck else row


def _chart_values(desk: Desk, action: str) -> Iterator[tuple[str, DayEvent, float, float, float]]:
    """Yield name, entry, value today, chart mean and u of each quantity with a control chart."""
    event = desk.last(action)
    if event is None:
        return
    values = dict(_numbers(event))
    for name in dict.fromkeys(label.rpartition(", ")[0] for label in values):
        today, chart, sd = (
            values[f"{name}, {word}"] for word in ("today", "chart", "standard deviation of a day")
        )
        # The chart has only a dozen mornings, so its relative u is taken to be at least 0.2 %.
        u = sd if action == "compare-clock" else hypot(sd, 0.002 * chart)
        yield name, event, today, chart, u


def _mean(event: DayEvent) -> float:
    return float(np.mean([value for _, value in _numbers(event)]))


def _numbers(event: DayEvent) -> Iterator[tuple[str, float]]:
    for quantity, value, _ in event.shown:
        if not isinstance(value, str):
            yield quantity, float(value)


LOOKS = (
    _scale,
    _bench,
    _pendulum,
    _repeated_weighing,
    _lot,
    _gates,
    _pivot,
    _clock,
    _wall,
    _repeated_wall_hits,
    _paper,
    _cylinder,
    _taps,
    _shots,
)
