"""Content of the pages "Rules" and "Instruments"."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from virtual_lab import catalog
from virtual_lab.bench.day.day import Day, has_instrument
from virtual_lab.bench.day.doubts import fault_sheets
from virtual_lab.bench.day.table import action_table, remedy_of, repairs
from virtual_lab.errors import InputError
from virtual_lab.output.rounding import decimals, digits
from virtual_lab.units import DEGREE, DIMENSIONS

if TYPE_CHECKING:
    from virtual_lab.bench.day.desk import Desk
    from virtual_lab.uncertainty.estimate import Estimate

SCALES = {"mm": 1e3, "ppm": 1e6, "deg": 1 / DEGREE, "kg mm²": 1e6, "kg mm": 1e3, "g": 1e3, "%": 1e2}


@cache
def wall() -> Mapping[str, Any]:
    """Return the content of ``data/bench/wall.toml``.

    It holds the texts for the pages of rules and instruments.
    """
    return catalog.sheet("bench", "wall")[0]


class PrintedRule(NamedTuple):
    """One rule, as printed."""

    what: str
    value: str
    note: str


class PrintedConstant(NamedTuple):
    """One constant of a certificate, as printed."""

    what: str
    value: str
    u: str
    unit: str
    today: str  # value measured today that replaces the certified value; or empty


class PrintedInstrument(NamedTuple):
    """An instrument with its certificate, as printed."""

    name: str
    sheet: str  # title of its data sheet
    due: str
    constants: list[PrintedConstant]


def rules_of(desk: Desk) -> list[PrintedRule]:
    """Return one row per number in the sheet of the procedure.

    The number is printed in the unit of the rule book, followed by the SI unit if it differs.
    """
    words = wall()["rules"]
    order = {key: place for place, key in enumerate(words)}
    return [
        PrintedRule(words.get(each.key, _words(each.key)), _quantity(each), each.note)
        for each in sorted(desk.rules.sheet, key=lambda each: order.get(each.key, len(order)))
    ]


def instruments_of(desk: Desk) -> Iterator[PrintedInstrument]:
    """Yield one row per instrument, with its printed calibration constants.

    The instruments are in the order of their first constants in the calibration at the beginning of
    the day.
    """
    morning, session = desk.day.morning, desk.session
    groups: dict[tuple[str, str], list[PrintedConstant]] = {}
    for key, stated in morning.calibration.items():
        rig, part, *rest = key.split(".")
        part = "lot" if rig == "ball" else part
        current = session.calibration.get(key, stated)
        constant = _constant(key, ".".join(rest) or key.rpartition(".")[2], stated, current)
        groups.setdefault((rig, part), []).append(constant)
    for (rig, part), constants in groups.items():
        yield PrintedInstrument(
            name=f"{wall()['rooms'].get(rig, rig)}: {wall()['parts'].get(part, part).lower()}",
            sheet=_sheet(morning.rigs.get(rig, ""), part),
            due=f"{morning.date[:4]}-12-31",  # certificates hold for a calendar year
            constants=constants,
        )


def prices(day: Day) -> list[tuple[str, str, str]]:
    """Return one row of strings per action: title, time [min], and effect of its omission.

    Repairs are left out. Actions that need an instrument that the rig does not have are left out
    too.
    """
    return [
        (each.title, f"{each.minutes / 60:g}", each.skipped)
        for name, each in action_table().actions.items()
        if name not in repairs() and has_instrument(day, name)
    ]


def _constant(key: str, name: str, stated: Estimate, current: Estimate) -> PrintedConstant:
    unit, factor, zero = _printed_unit(key)
    value, u = (stated.value - zero) * factor, stated.u * factor
    places = decimals(u) if u else 6
    text = f"{value:.{places}f}" if u else f"{value:g}"
    changed = f"{(current.value - zero) * factor:.{places}f}" if current != stated else ""
    if numbered := re.fullmatch(r"(\w+)_(\d+)", name):
        name = f"gate {int(numbered[2]) + 1}, {numbered[1]}"
    name = wall()["names"].get(name, name)
    return PrintedConstant(_words(name), text, digits(u) if u else "–", unit, changed)


def _printed_unit(key: str) -> tuple[str, float, float]:
    """Return the printed unit of a constant, the factor from SI to it, and the SI value of 0."""
    name = key.rpartition(".")[2].rstrip("_0123456789")
    name = "span" if key.endswith("encoder.scale") else name
    weighed = key.startswith("bench.scale") and name != "span"
    unit = "g" if weighed else wall()["constants"].get(name, "")
    return unit, SCALES.get(unit, 1.0), 1.0 if unit == "ppm" else 0.0


def _sheet(rig: str, part: str) -> str:
    """Return the title of the data sheet of an instrument at a rig; empty if it has none."""
    try:
        document = catalog.sheet("rigs", rig)[0]
        return str(catalog.sheet("instruments", str(document[part]))[0]["title"])
    except (InputError, KeyError):
        return ""


def _words(key: str) -> str:
    return key.replace(".", ": ").replace("_", " ").capitalize()


def _quantity(datum: catalog.Datum) -> str:
    """Return a number of a data sheet as printed, for example "90 mph (40.23 m/s)"."""
    numbers = datum.value if isinstance(datum.value, list) else [datum.value]

    def format_numbers(unit: str, factor: float, form: str) -> str:
        words = ", ".join(format(float(each) * factor, form) for each in numbers)
        return f"{words} {unit if unit != '1' else ''}".strip().replace("^2", "²")

    for dimension, units in DIMENSIONS.items():
        si = wall()["units"].get(dimension, datum.unit)
        if datum.unit in units and si != datum.unit:
            beside = format_numbers(si, units[datum.unit] / units[si], ".4g")
            return f"{format_numbers(datum.unit, 1.0, '.6g')} ({beside})"
    return format_numbers(datum.unit, 1.0, ".6g")


def may_go_wrong(listed: Mapping[str, float]) -> list[tuple[str, str, str]]:
    """Return one row of strings per listed fault: title, rate [%], and remedy.

    `listed` are the probabilities of the faults, 0 to 1, keyed by name. The remedy is the title of
    an action, or "none: the test is INVALID". Raises `KeyError` for an unknown fault.
    """
    sheets, rows = action_table().actions, []
    for name, rate in listed.items():
        remedy = remedy_of(name)
        cure = f"“{sheets[remedy[0]].title}”" if remedy else "none: the test is INVALID"
        rows.append((fault_sheets()[name].title, f"{100 * rate:g}", cure))
    return rows


def wall_pages(desk: Desk, briefing: Mapping[str, Any]) -> dict[str, Any]:
    """Return the template variables of the papers on the laboratory's wall, keyed by name.

    The papers are the rules, the sheets of the instruments, the prices of the actions, and the
    possible faults.
    """
    return {
        "rules": desk.rules.spec,
        "rows": rules_of(desk),
        "laboratory": briefing.get("laboratory", {}),
        "invalid": wall()["invalid"],
        "instruments": list(instruments_of(desk)) if desk.day.morning.calibration else [],
        "prices": prices(desk.day),
        "may_go_wrong": may_go_wrong(briefing.get("may_go_wrong", {})),
    }
