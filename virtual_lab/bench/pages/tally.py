"""Tables and charts of a day: readings of all shots, run chart, residuals, pendulum periods."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from virtual_lab.bench.day.entries import record_of
from virtual_lab.bench.day.readings import blocking_times, gate_edges
from virtual_lab.bench.day.scenario import UNITS
from virtual_lab.output.svg import Panel, figure
from virtual_lab.records import BoardRecord, EncoderRecord, GateRecord, PendulumRecord
from virtual_lab.units import DEGREE, INCH, MPH, Array

if TYPE_CHECKING:
    from virtual_lab.bench.day.desk import Desk

# printed units of length and speed, each with its size in SI
Units = tuple[tuple[str, float], tuple[str, float]]


class PrintedColumn(NamedTuple):
    """A printed column of a table of readings."""

    title: str
    cells: list[str]
    words: bool = False  # True for text, which a page aligns to the left


def printed_column(title: str, values: Array, form: str) -> PrintedColumn:
    """Return a column of numbers, each in the format `form`.

    NaN and infinity are printed as "not measured".
    """
    number = (format(each, form) if np.isfinite(each) else "not measured" for each in values)
    return PrintedColumn(title, list(number))


def swings(desk: Desk) -> list[PrintedColumn]:
    """Return the readings of the pendulum as columns, with one row per release.

    The columns are the number of the release, the first and the last amplitude [°], the decrease
    from the first to the last period [ms], and all periods [s]. The list is empty before the
    pendulum has been swung.
    """
    event = desk.last("swing")
    if event is None:
        return []
    record = cast(PendulumRecord, record_of(event.records["pendulum"]))
    periods = np.diff(record.times, axis=1)
    each = ["  ".join(f"{period:.5f}" for period in swung) for swung in periods]
    return [
        printed_column("Release", np.arange(1.0, len(periods) + 1), ".0f"),
        printed_column("First amplitude [°]", record.first_amplitude / DEGREE, ".1f"),
        printed_column("Last amplitude [°]", record.last_amplitude / DEGREE, ".1f"),
        printed_column(
            "Decrease of the period [ms]", 1e3 * (periods[:, 0] - periods[:, -1]), "+z.3f"
        ),
        PrintedColumn("Periods [s]", each, words=True),
    ]


def convert_units(sentence: str, system: str) -> str:
    """Return a sentence in which inches and mph are converted to mm and m/s if `system` is "SI".

    For any other `system` the sentence is returned unchanged.
    """

    def convert(match: re.Match[str]) -> str:
        unit, factor, places = ("m/s", MPH, 2) if match[4] == "mph" else ("mm", 1e3 * INCH, 1)
        numbers = [f"{factor * float(each):.{places}f}" for each in (match[1], match[3]) if each]
        return f"{(match[2] or '').join(numbers)} {unit}"

    pattern = r"(-?[\d.]+)(?:( ± | to )([\d.]+))? (mph|in)\b(?: \([^()]* m/s\))?"
    return re.sub(pattern, convert, sentence) if system == "SI" else sentence


def tally(desk: Desk, system: str) -> list[PrintedColumn]:
    """Return the readings of all shots as columns, with one row per shot.

    The list is empty before the shots can be reduced. `system` is "SI" or "inch-ounce-mph".
    """
    if not desk.day.fired or desk.reduction_error:
        return []
    (length, metre), (speed, metre_a_second) = UNITS[system]
    reduction, impact = desk.reduction_by_rules, desk.session.records["impact"]
    incoming, back, chords = _gate_texts(impact["gates"], len(desk.day.fired))
    place = ".3f" if metre > 0.01 else ".1f"
    log: Any = impact["log"]

    columns = [
        printed_column("Shot", np.arange(1.0, len(desk.day.fired) + 1), ".0f"),
        printed_column("Ball", np.array([ball + 1.0 for ball, _ in desk.day.fired]), ".0f"),
        printed_column(f"Position set [{length}]", log.place / metre, place),
        printed_column(
            f"Position corrected by the aim paper [{length}]", reduction.position / metre, place
        ),
        printed_column(f"Speed [{speed}]", reduction.shots.speed / metre_a_second, ".2f"),
        PrintedColumn("Gates, incoming", incoming, words=True),
        PrintedColumn("Gates, rebound", back, words=True),
        printed_column("Blocking time, first gate / last gate", chords, ".4f"),
        printed_column("e_A by rebound", reduction.shots.rebound_efficiency, ".4f"),
    ]
    if turning := desk.readings.recoil:
        turn = desk.session.calibration["impact.encoder.counts_per_turn"].value / (2 * np.pi)
        columns += [
            printed_column("e_A by recoil", reduction.shots.recoil_efficiency, ".4f"),
            printed_column("Residual [counts]", turning.residual, ".3f"),
            printed_column("Angular rate before the hit [rad/s]", turning.before / turn, "+z.3f"),
        ]
    return columns


def _gate_texts(record: Any, shots: int) -> tuple[list[str], list[str], Array]:
    """Return three columns of `tally`, each with one value per shot.

    The first two are strings that name the gates that missed the incoming ball and the rebound. The
    third is the ratio of the times for which the incoming ball blocked the first and the last gate.
    """
    if not isinstance(record, GateRecord | BoardRecord):
        return ["–"] * shots, ["–"] * shots, np.full(shots, np.nan)
    complete = np.asarray(np.isfinite(gate_edges(record)).all(axis=-1))

    def words(gates: Any) -> str:
        missed = [str(gate + 1) for gate in np.flatnonzero(~gates)]
        return "all" if not missed else f"missed gate {', '.join(missed)}"

    passages = blocking_times(record)
    return (
        [words(each) for each in complete[:, 0]],
        [words(each) for each in complete[:, 1]],
        np.asarray(passages[:, 0] / passages[:, -1]),
    )


def run_chart(desk: Desk, units: Units) -> str:
    """Return an SVG chart of the speed and e_A of each shot.

    The chart shows the acceptance window of the speed and, except for a scan along the barrel, the
    mean of e_A ± 3 standard deviations. The string is empty if there are fewer than two shots, or
    if the shots cannot be reduced yet.
    """
    if len(desk.day.fired) < 2 or desk.reduction_error:
        return ""
    (_, _), (unit, metre_a_second) = units
    reduction, rules = desk.reduction_by_rules, desk.rules.spec
    number = np.arange(1.0, len(desk.day.fired) + 1)
    sides = {"left": 46.0, "right": 490.0, "x": (0.5, number[-1] + 0.5)}
    speed = reduction.shots.speed / metre_a_second
    nominal, tolerance = (
        rules.ball_speed / metre_a_second,
        rules.windows.speed_tolerance / metre_a_second,
    )
    first = _chart(number, speed, nominal, tolerance, 28.0, f"speed [{unit}]", sides)
    efficiency = reduction.shots.collision_efficiency
    sound = efficiency[np.array([not why for why in desk.reasons]) & np.isfinite(efficiency)]
    mean = float(np.mean(sound)) if sound.size else float("nan")
    spread = 3 * float(np.std(sound, ddof=1)) if sound.size > 1 else float("nan")
    panels = [first]
    if np.isfinite(spread) and not rules.scan:
        words = "e_A"
        panels.append(_chart(number, efficiency, mean, spread, 148.0, words, sides))
    panels[-1].x_label = "shot"
    chart = figure(
        panels,
        panels[-1].bottom + 34.0,
        "run-chart",
        "Run chart of the shots",
        "The numbers are in the table of instrument readings.",
    )
    return chart.replace('font-size="8"', 'font-size="9.5"')


def _chart(
    number: Array,
    values: Array,
    middle: float,
    tolerance: float,
    top: float,
    title: str,
    sides: Any,
) -> Panel:
    limits = (
        "mean ± 3 standard deviations of the hits within the windows"
        if title == "e_A"
        else "acceptance window"
    )
    finite = np.isfinite(values)
    half_height = max(
        1.6 * tolerance, float(np.max(np.abs(values[finite] - middle), initial=0.0)) * 1.1
    )
    panel = Panel(
        **sides,
        top=top,
        bottom=top + 78.0,
        y=(middle - half_height, middle + half_height),
        title=title,
    )
    panel.band(middle - tolerance, middle + tolerance, limits)
    panel.level(middle, width=0.7, dashes="5 2.5")
    panel.dots(list(number[finite]), list(values[finite]))
    missing = list(number[~finite])
    panel.dots(missing, [middle - 0.95 * half_height] * len(missing), cross=True)
    return panel


def residual_chart(desk: Desk, shot: int) -> str:
    """Return an SVG chart of the residuals [counts] of the encoder fit of a shot.

    `shot` is counted from 1. The string is empty if there is no encoder or no fit, or if fewer than
    40 samples were fitted.
    """
    record = desk.session.records.get("impact", {}).get("encoder")
    if not isinstance(record, EncoderRecord) or desk.reduction_error:
        return ""
    from virtual_lab.measurement.reduction.recoil import RECOIL, project, turn_and_rings

    readings = desk.readings
    fit = readings.recoil
    if fit is None or not np.isfinite(fit.span[shot - 1]):
        return ""
    after = record.times - readings.flights.raw.contact[shot - 1]
    span = float(fit.span[shot - 1])
    fitted = (after > RECOIL.settling_time) & (after <= RECOIL.settling_time + span)
    clock, counts = record.times[fitted], record.counts[shot - 1, fitted]
    if clock.size < 40:
        return ""
    rings = span * np.stack([fit.ring_frequency, fit.ring_decay], axis=1)
    residual = project(turn_and_rings((clock - clock[0]) / span, rings), counts)[1]
    sample = np.unique(np.linspace(0, clock.size - 1, 400).astype(int))
    half_height = max(1.5, 1.1 * float(np.abs(residual).max()))
    panel = Panel(
        left=46.0,
        right=490.0,
        top=28.0,
        bottom=108.0,
        x=(float(1e3 * clock[0]), float(1e3 * clock[-1])),
        y=(-half_height, half_height),
        title="residual of the encoder fit [counts]",
        x_label="time after the trigger [ms]",
    )
    panel.band(-0.5, 0.5, "± 0.5 counts: rounding to whole counts")
    panel.line(list(1e3 * clock[sample]), list(residual[sample]), width=0.8)
    words = f"{float(np.sqrt(np.mean(residual**2))):.2f} counts rms; rounding alone gives 0.29"
    chart = figure([panel], 142.0, "residual", f"Residual of the encoder fit, shot {shot}", words)
    return chart.replace('font-size="8"', 'font-size="9.5"')
