"""The numbers that decide on a fault, each worked out from what an action shows."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, inf
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from virtual_lab.bench.day import readings
from virtual_lab.bench.day.day import DayEvent
from virtual_lab.bench.day.readings import CheckRow, rows_of
from virtual_lab.bench.day.table import detectable
from virtual_lab.bench.pages.tally import _gate_texts, convert_units, printed_column
from virtual_lab.bench.pages.traces import traces_of
from virtual_lab.records import GateRecord
from virtual_lab.uncertainty.estimate import Estimate

MM = 1e-3
CONSEQUENCES = SimpleNamespace(
    check_mass=0.5, gauge_u=0.3 * MM, pivot_rule_u=1.2 * MM, clamp_u=8e-6, tap_u=0.5
)
KNOWN = {
    "bench.scale.zero": Estimate(value=1e-3, u=0.2e-3),
    "bench.scale.span": Estimate(value=1.002, u=0.4e-3),  # of 500 g: .2 g
    "bench.scale.resolution": Estimate(value=0.1e-3),
    "bench.stand.offset": Estimate(value=0.0, u=0.3e-3),
    "bench.stand.resolution": Estimate(value=0.4e-3),
    "bench.pendulum.clamp_inertia": Estimate(value=2e-4, u=6e-6),
    "impact.pivot.from_knob": Estimate(value=0.152, u=0.5 * MM),
    "impact.gates.distance_0": Estimate(value=0.9, u=0.4 * MM),
    "impact.gates.distance_1": Estimate(value=0.3, u=0.4 * MM),
    "impact.cannon.along": Estimate(value=1.5 * MM),
    "impact.pivot.height": Estimate(value=-2.0 * MM),
    "ball.radius": Estimate(value=36.5 * MM),
}
CHART = "standard deviation of a day"
Display = tuple[tuple[str, float | str, str], ...]


def desk(*events: tuple[str, dict[str, float], dict[str, Any]]) -> Any:
    done = [
        DayEvent(
            number=number,
            action=name,
            arguments=given,
            seconds=60.0,
            shown=tuple((what, value, "") for what, value in shown.items()),
        )
        for number, (name, shown, given) in enumerate(events, 1)
    ]

    def last(action: str) -> DayEvent | None:
        found = [event for event in done if event.action == action]
        return found[-1] if found else None

    day = SimpleNamespace(
        events=done,
        struck=frozenset(),
        retired=frozenset(),
        morning=SimpleNamespace(calibration=KNOWN),
        fired=(),
    )
    window = SimpleNamespace(ball_mass_low=0.142, ball_mass_high=0.146)
    return SimpleNamespace(
        day=day,
        last=last,
        session=SimpleNamespace(calibration=KNOWN),
        rules=SimpleNamespace(spec=SimpleNamespace(windows=window)),
    )


def row_of(fault: str, *events: tuple[str, dict[str, float], dict[str, Any]]) -> CheckRow:
    (row,) = (each for each in rows_of(desk(*events)) if each.fault == fault)
    return row


@pytest.fixture
def number(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Deviation of the reading that decides on a fault, in u, after some actions."""
    table = SimpleNamespace(consequences=CONSEQUENCES)
    monkeypatch.setattr(readings, "action_table", lambda: table)

    def found(fault: str, *events: tuple[str, dict[str, float], dict[str, Any]]) -> float:
        row = row_of(fault, *events)
        assert row.expected is not None
        return abs(row.reading - row.expected) / row.u

    return found


def shown(action: str, **numbers: float) -> tuple[str, dict[str, float], dict[str, Any]]:
    return action, {what.replace("_", " "): value for what, value in numbers.items()}, {}


def test_the_check_mass_deviates_by_3_u(number: Any) -> None:
    """1.002 · 500 g + 1 g = 502.0 g; shown 502.9: .9 over √(.2² + .2² + .1²) = .3."""
    event = ("weigh-check-mass", {"reading 1": 502.8, "reading 2": 503.0, "shows": 1.0}, {})
    assert number("scale-not-tared", event) == pytest.approx(3)


def test_masses_typed_in_ounces_are_below_their_limit() -> None:
    """A bat has .4 of 800 g at least; balls half of the windows' middle, 144 g."""
    row = row_of("bat-ounces-as-grams", shown("weigh-bat", reading_1=31.0, reading_2=31.4))
    assert (row.reading, row.low, row.within) == (pytest.approx(31.2), pytest.approx(320), False)
    row = row_of("ounces-as-grams", shown("weigh-balls", ball_1=5.0, ball_2=5.2))
    assert (row.reading, row.low, row.within) == (pytest.approx(5.1), pytest.approx(72), False)


def test_a_balance_from_the_knob_is_above_its_limit() -> None:
    """561 of 850 mm, at most .55; .5 mm of 850."""
    length = shown("measure-length", reading=850.0)
    row = row_of(
        "balance-from-knob", length, ("measure-balance", {"reading": 561.0}, {"end": "tip"})
    )
    assert (row.reading, row.high, row.within) == (pytest.approx(0.66), 0.55, False)
    assert row.u == pytest.approx(0.5 / 850)


def test_the_inertia_of_the_clamp_deviates_by_3_u(number: Any) -> None:
    """30 kg mm² over √(6² + 8²)."""
    event = ("swing-clamp", {"clamp, measured": 230.0, "clamp, as entered": 200.0}, {})
    assert number("clamp-forgotten", event) == pytest.approx(3)


def test_wrong_entries_of_ball_masses_deviate_by_3_u(number: Any) -> None:
    """The displays 144.2 and 145.0, entered 144.0 and 144.6: .3 g off, of steps of .1 g."""
    again = {
        "ball 1, display": 144.2,
        "ball 1, entered": 144.0,
        "ball 2, display": 145.0,
        "ball 2, entered": 144.6,
    }
    events = shown("tare"), shown("weigh-balls", ball_1=144.0), ("reweigh-balls", again, {})
    assert number("ball-mass-typed", *events) == pytest.approx(3)


def test_balls_of_the_wrong_lot_exceed_their_limit() -> None:
    """1.02 and 1.04 of the morning's: 1.03, of two balls of a lot with s = .01/.56 relative."""
    morning = shown("hit-wall", a=0.55, b=0.57, c=0.56, d=0.55)  # the slowest is left out
    again = {"ball 1, now": 0.561, "ball 1": 0.55, "ball 2, now": 0.5928, "ball 2": 0.57}
    row = row_of("wrong-lot", morning, ("recheck-balls", again, {}))
    assert (row.reading, row.high) == (pytest.approx(1.03), pytest.approx(1.02))
    assert row.u == pytest.approx(0.01 / 0.56 / 2**0.5)


def test_a_worn_out_ball_is_below_its_limit() -> None:
    """.54 where the middle of five is .6, and 4 % less is allowed."""
    row = row_of("ball-worn-out", shown("hit-wall", a=0.6, b=0.61, c=0.54, d=0.6, e=0.59))
    assert (row.reading, row.expected, row.low) == (0.54, 0.6, pytest.approx(0.576))
    assert "ball 3" in row.what


def test_a_displaced_axis_deviates_by_3_u(number: Any) -> None:
    """3.9 mm off, over √(.5² + 1.2²) = 1.3 mm."""
    event = {
        "axis from the knob, measured": 148.1,
        "axis from the knob, surveyed": 152.0,
    }
    assert number("pivot-off", ("measure-pivot", event, {})) == pytest.approx(3)


def test_a_wrong_gate_clock_deviates_by_3_u(number: Any) -> None:
    name = readings.CLOCK
    event = {f"{name}, today": -9.0, f"{name}, chart": 6.0, f"{name}, {CHART}": 5.0}
    assert number("gate-clock", ("compare-clock", event, {})) == pytest.approx(3)


def test_a_displaced_gate_deviates_and_the_other_one_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """1 mm off its certificate's place, over √(.4² + .3²) = .5 mm; the other one stands."""
    event = {
        "gate 1, gauged": 900.0,
        "gate 1, certificate": 900.0,
        "gate 2, gauged": 301.0,
        "gate 2, certificate": 300.0,
    }
    table = SimpleNamespace(consequences=CONSEQUENCES)
    monkeypatch.setattr(readings, "action_table", lambda: table)
    found = [row for row in rows_of(desk(("gauge-gates", event, {}))) if "moved" in row.fault]
    assert [row.reading - (row.expected or 0) for row in found] == pytest.approx([0, 1])
    assert [row.u for row in found] == pytest.approx([0.5, 0.5])


def test_a_check_standard_deviates_from_its_chart(number: Any) -> None:
    """.52 where the chart has .5 ± .003, itself known to .2 %: .02 over √(.003² + .001²)."""

    def charted(name: str, today: float) -> dict[str, float]:
        return {f"{name}, today": today, f"{name}, chart": 0.5, f"{name}, {CHART}": 0.003}

    event = ("fire-check-ball", charted("rebound speed / incoming speed", 0.48), {})
    assert number("wall-drift", event) == pytest.approx(0.02 / hypot(0.003, 0.001))
    turned = charted("ball's rebound speed / incoming speed", 0.5) | charted(
        "rotation × time between gates", 0.48
    )
    event = ("fire-check-cylinder", turned, {})
    row = row_of("bearing-friction", event)
    assert (row.within, row.low) == (False, pytest.approx(0.5 * 0.975))
    turned |= charted("rotation × time between gates", 0.25)
    assert not row_of("encoder-half-counts", ("fire-check-cylinder", turned, {})).within


def test_a_cracked_bat_rings_below_its_first_frequency(number: Any) -> None:
    """From 170 to 153 Hz, of two taps of .5 Hz each; 2 % less is allowed."""
    taps = [("tap-bat", {"frequency": each}, {}) for each in (170.0, 160.0, 153.0)]
    assert number("bat-cracked", *taps) == pytest.approx(17 / (0.5 * 2**0.5))
    assert row_of("bat-cracked", *taps).low == pytest.approx(170 * 0.98)


@pytest.mark.parametrize(("off", "decides"), [(0.7, True), (0.051, True), (0.049, False)])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("way", "aimed"), [("along", 1.5), ("across", -2.0)])
def test_the_aim_is_judged_in_ball_diameters(
    way: str, aimed: float, sign: int, off: float, decides: bool
) -> None:
    """Of 73 mm, from where the cannon is known to aim along, from the axis' height across."""
    event = {"mean along": 1.5, "mean across": -2.0} | {f"mean {way}": aimed + sign * off * 73.0}
    row = row_of(f"aim-{way}", ("aim-paper", event, {}))
    assert row.reading - (row.expected or 0) == pytest.approx(sign * off * 73)
    assert detectable()[f"aim-{way}"].beyond == 0.05
    assert row.within is not decides


def test_a_row_is_printed_to_the_second_digit_of_u() -> None:
    """Numbers to the two digits of u; either limit, or both."""
    row = CheckRow(
        fault="gate-moved",
        what="gate 1 from the bat",
        reading=250.04,
        expected=249.9,
        u=0.0884,
        low=249.9 - 4 * 0.0884,
        high=249.9 + 4 * 0.0884,
        unit="mm",
        entry=3,
    )
    printed = row.printed
    assert printed[1:6] == ("250.040", "249.900", "+0.140", "0.088", "± 0.354")
    assert (row.within, printed.word) == (True, "within")
    assert replace(row, low=250.1).printed.word == "beyond the limit"
    assert replace(row, low=-inf, expected=None).printed.limit == "at most 250.254"
    assert replace(row, high=inf, low=249.0).printed.limit == "at least 249.000"


@pytest.mark.parametrize(
    ("said", "printed"),
    [
        (
            "ball speed 131.58 mph (58.82 m/s), allowed 136 ± 2 mph (60.8 ± 0.89 m/s)",
            "ball speed 58.82 m/s, allowed 60.80 ± 0.89 m/s",
        ),
        (
            "impact position set to 2 in, allowed 3 to 9 in",
            "impact position set to 50.8 mm, allowed 76.2 to 228.6 mm",
        ),
        (
            "rebound angle 12.2 deg, allowed 12.0 deg",
            "rebound angle 12.2 deg, allowed 12.0 deg",
        ),
    ],
)
def test_a_day_has_one_system_of_units(said: str, printed: str) -> None:
    assert convert_units(said, "SI") == printed
    assert convert_units(said, "inch-ounce-mph") == said


def test_a_value_that_rounds_to_zero_has_no_minus() -> None:
    column = printed_column("Shortened by [ms]", np.array([-4e-4, 4e-4, -6e-4, np.nan]), "+z.3f")
    assert column.cells == ["+0.000", "+0.000", "-0.001", "not measured"]


def test_gates_and_traces_count_the_same_missed_gates() -> None:
    """A gate that recorded only the beginning of a rebound has missed it, in table and drawing."""
    times = np.array([[[[1.0, 1.2], [2.0, 2.2]], [[4.0, np.nan], [3.0, 3.2]]]])  # ms
    _, rebound, _ = _gate_texts(GateRecord(times=times / 1e3), 1)
    assert rebound == ["missed gate 1"]
    entry = {"kind": "gates", "times": [[[[1, 1.2], [2, 2.2]], [[4, None], [3, 3.2]]]]}
    assert "detected 3 of 4 passages" in traces_of(1, {"gates": entry}).summary
