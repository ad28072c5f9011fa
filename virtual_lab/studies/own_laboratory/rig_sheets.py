"""Data sheets of a rig and its instruments that state the constants of a laboratory's records.

Which key of a sheet states which constant is found by a trial: the key is changed, the rig is
commissioned without random errors, and its certificates are compared with those before. Thus sheets
of any package can be used, without a table of their keys.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache
from math import isclose, isfinite
from typing import Any, NamedTuple

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.reading import Key
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml
from virtual_lab.lab.laboratory import constant_name
from virtual_lab.records import Record
from virtual_lab.records.session import Session
from virtual_lab.sheets import toml_text
from virtual_lab.simulation.instruments import FittedStation
from virtual_lab.simulation.instruments.calibrated import StandardDeviation
from virtual_lab.simulation.stations.rig import Stage, Station, find_rig
from virtual_lab.streams import Quiet
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DIMENSIONS, from_si

TRIALS = (2.0, 1.001, 0.999)  # factors by which a key is changed; some keys are limited to a range
DIGITS = 12  # significant digits of a number in a recovered sheet
CLOSE = 1e-9  # relative tolerance of two numbers that are the same statement
PARTS = ("value", "u", "dof")  # parts of a constant
Document = dict[str, Any]  # content of a sheet's file


@dataclass(frozen=True, slots=True)
class StatedNumber:
    """A number of a sheet as the records state it."""

    value: Any  # number or list of numbers, in the unit of the sheet
    record: str  # constant or channel that states it
    spread: StandardDeviation | None = None  # scatter of the readings [SI], for an estimated number

    @classmethod
    def of(cls, shown: Any, record: str, unit: str) -> StatedNumber:
        """Return a number, a tuple of numbers or a scatter [SI] in the unit of a sheet."""
        if isinstance(shown, StandardDeviation):
            return cls(in_unit(shown.value, unit), record, shown)
        if isinstance(shown, tuple):
            return cls([in_unit(each, unit) for each in shown], record)
        return cls(in_unit(shown, unit), record)


SheetNumbers = dict[str, StatedNumber | None]  # keyed by key of a sheet; None: key removed
Statements = dict[Key, SheetNumbers]


class RigSheets:
    """Data sheets of a rig and its instruments, and the statements of records about them."""

    def __init__(self, rig: str, stage: Stage) -> None:
        self.rig, self.stage = rig, stage
        self.parts = catalog.rig_instruments(rig)
        keys = [("instruments", name) for name in self.parts.values()]
        keys += [("rigs", rig)] if catalog.has("rigs", rig) else []
        self.documents = {key: deepcopy(parse_toml(*catalog.source(*key))) for key in keys}
        self.statements: Statements = {key: {} for key in keys}

    @property
    def station(self) -> Station:
        """The rig with these sheets, without random errors."""
        texts = {key: toml_text(each) for key, each in self.documents.items()}
        with catalog.sheets_in_place(texts):
            return find_rig(self.rig, self.stage).commission(Quiet())

    @property
    def constants(self) -> dict[str, Estimate]:
        """The constants that these sheets state, keyed by name in a session.

        There are none if the sheets are not allowed.
        """
        try:
            constants = self.station.calibration
        except InputError:
            return {}
        return {constant_name(self.stage, name): each for name, each in constants.items()}

    def _effects(self, before: Mapping[str, Estimate]) -> list[tuple[str, str, float, float]]:
        """Return constant, part, and its value before and now, for each part that has changed."""
        now = self.constants
        return [
            (name, part, getattr(before[name], part), getattr(now[name], part))
            for name in before
            for part in PARTS
            if name in now and getattr(before[name], part) != getattr(now[name], part)
        ]

    def enter(
        self,
        records: Mapping[str, Record],
        constants: Mapping[str, Estimate],
        measured: Mapping[str, StandardDeviation],
    ) -> None:
        """Enter numbers that the raw records show in the sheets, after the stated constants.

        `constants` are those of the session. `measured` are scatters of the shots, keyed by the
        names that `FittedStation.numbers_in` takes.
        """
        station, stage = self.station, self.stage.value
        if not isinstance(station, FittedStation):
            return
        for part, (name, instrument) in station.parts().items():
            prefix = constant_name(self.stage, f"{name}.")
            known = {
                key.removeprefix(prefix): each.value
                for key, each in constants.items()
                if key.startswith(prefix)
            }
            channels = [key for key in station.channels.get(name, (name,)) if key in records]
            shown = instrument.spec.numbers_in([records[key] for key in channels], known)
            sheet, where = self.parts.get(part, ""), ", ".join(f"{stage}/{key}" for key in channels)
            self._enter(("instruments", sheet), shown, where)
            self._enter(("instruments", sheet), measured, f"{stage}/gates")
        self._enter(("rigs", self.rig), station.numbers_in(records, measured), stage)

    def _enter(self, sheet: Key, shown: Mapping[str, Any], record: str) -> None:
        """Enter numbers [SI] at their keys of a sheet, unless a constant states them already.

        Numbers without a key are left out, and so are empty lists and scatters of 0.
        """
        statements = self.statements.get(sheet, {})
        for path, table, last in numbers_of(self.documents.get(sheet, {})):
            if path in shown:
                number = StatedNumber.of(shown[path], record, table[last]["unit"])
                old = np.size(table[last]["value"])
                stated = path in statements and np.size(number.value) in (1, old)
                if not stated and number.value != [] and (number.value or not number.spread):
                    table[last]["value"] = number.value
                    statements[path] = number

    def state(self, wanted: Mapping[str, Estimate]) -> None:
        """Change the sheets so that they state the constants of a session [SI], keyed by name.

        A key for all gates becomes a list if the records state a different u of each gate. A
        constant that no key states is left as it is.
        """
        for _ in range(2):  # the degrees of freedom of a u have no effect before it is above 0
            texts = tuple((key, toml_text(each)) for key, each in self.documents.items())
            for (sheet, path), responses in responses_of(self.rig, self.stage, texts).items():
                solutions = {
                    response: response.solve(wanted[response.constant])
                    for response in responses
                    if response.constant in wanted
                }
                if solutions:
                    self._write(sheet, path, solutions)
            now = self.constants
            if all(_agrees(now[name], wanted[name]) for name in now.keys() & wanted.keys()):
                break

    def _write(self, sheet: Key, path: str, solutions: Mapping[Response, float]) -> None:
        table, last = inner_table(self.documents[sheet], path)
        record = ", ".join(dict.fromkeys(each.constant for each in solutions))
        if not all(map(isfinite, solutions.values())):  # the records state no degrees of freedom
            if table.pop(last, None) is not None:
                self.statements[sheet][path] = None
            return
        old = table.setdefault(last, {"value": 1.0, "unit": "1", "source": "", "verified": True})
        value, numbers = old["value"], list(solutions.values())
        if isinstance(value, list):
            old["value"] = list(value)
            for response, number in solutions.items():
                old["value"][response.at] = number
        else:
            same = all(isclose(each, numbers[0], rel_tol=CLOSE) for each in numbers)
            old["value"] = numbers[0] if same else numbers
        if self.constants:
            self.statements[sheet][path] = StatedNumber(old["value"], record)
        else:  # the sheet has one number for all constants
            old["value"] = value


class Response(NamedTuple):
    """Effect of a number of a sheet on a constant of a certificate."""

    at: int  # index of the number in its list, 0 without a list
    number: float  # number in the sheet
    constant: str
    part: str  # part of the constant, one of `PARTS`
    now: float  # value of this part
    slope: float  # change of this value per change of the number

    def solve(self, wanted: Estimate) -> float:
        """Return the number with which the constant is as `wanted`."""
        target = getattr(wanted, self.part)
        if target == self.now:
            return self.number
        return _rounded(self.number + (target - self.now) / self.slope)


@lru_cache(maxsize=64)
def responses_of(
    rig: str, stage: Stage, texts: tuple[tuple[Key, str], ...]
) -> Mapping[tuple[Key, str], list[Response]]:
    """Return the effects of each number of a rig's sheets, keyed by sheet and key.

    Numbers without an effect are left out. For a key ``NAME_u`` without a key ``NAME_dof``, the
    effect of this second key is returned, too.
    """
    with catalog.sheets_in_place(dict(texts)):
        sheets = RigSheets(rig, stage)
    now, responses = sheets.constants, dict[tuple[Key, str], list[Response]]()
    for sheet, document in sheets.documents.items():
        for path, table, last in list(numbers_of(document)):
            number = table[last]
            value = number["value"]
            elements = value if isinstance(value, list) else [value]
            found: list[Response] = []
            for at, element in enumerate(elements):
                trials = [element * factor for factor in TRIALS] if element else [1.0, 1e-3]
                for trial in trials:
                    changed = [*elements[:at], trial, *elements[at + 1 :]]
                    number["value"] = changed if isinstance(value, list) else trial
                    if effects := sheets._effects(now):
                        step = trial - element
                        found += [
                            Response(at, element, name, part, before, (after - before) / step)
                            for name, part, before, after in effects
                        ]
                        break
            number["value"] = value
            if found:
                responses[sheet, path] = found
            dof = f"{last.removesuffix('_u')}_dof"
            if last.endswith("_u") and dof not in table:
                table[dof] = {"value": 1.0, "unit": "1", "source": "trial", "verified": True}
                responses[sheet, f"{path.removesuffix('_u')}_dof"] = [
                    Response(0, 0.0, name, part, 0.0, 1.0)
                    for name, part, *_ in sheets._effects(now)
                ]
                del table[dof]
    return responses


def stated_rigs(
    session: Session, scatter: Mapping[Stage, Mapping[str, StandardDeviation]]
) -> list[RigSheets]:
    """Return the sheets of a session's rigs, one per stage, with its statements entered.

    `scatter` is that of the shots, see `scatter_of_shots`.
    """
    rigs = []
    for stage in Stage:
        sheets = RigSheets(session.rigs[stage.value], stage)
        sheets.state(session.calibration)
        sheets.enter(session.records[stage.value], session.calibration, scatter[stage])
        rigs.append(sheets)
    return rigs


def _agrees(now: Estimate, wanted: Estimate) -> bool:
    return all(isclose(getattr(now, part), getattr(wanted, part), rel_tol=CLOSE) for part in PARTS)


def _rounded(number: float) -> float:
    return float(f"{number:.{DIGITS}g}")


def enter_numbers(document: Document, numbers: Mapping[str, tuple[Any, str]]) -> SheetNumbers:
    """Return the statements of numbers [SI] and their records, in the units of a sheet."""
    units = {path: table[last]["unit"] for path, table, last in numbers_of(document)}
    return {
        path: StatedNumber.of(shown, record, units.get(path, "1"))
        for path, (shown, record) in numbers.items()
    }


def in_unit(number: float, unit: str) -> float:
    """Return a number [SI] in the unit of a sheet."""
    dimension = next(name for name, units in DIMENSIONS.items() if unit in units)
    return _rounded(from_si(number, unit, dimension))


def numbers_of(document: Document, above: str = "") -> Iterator[tuple[str, Document, str]]:
    """Yield path, table and key in this table of each number of a sheet."""
    for key, value in document.items():
        if isinstance(value, dict) and {"value", "unit"} <= value.keys():
            yield f"{above}{key}", document, key
        elif isinstance(value, dict):
            yield from numbers_of(value, f"{above}{key}.")


def inner_table(document: Document, path: str) -> tuple[Document, str]:
    """Return the table of a sheet that has the key at the end of a path, and this key."""
    *tables, last = path.split(".")
    for each in tables:
        document = document[each]
    return document, last


def write_numbers(
    document: Document, numbers: Mapping[str, StatedNumber | None], source: str
) -> Document:
    """Change numbers of a sheet's content and their `source`, and return it."""
    for path, number in numbers.items():
        table, last = inner_table(document, path)
        if number is None:
            del table[last]
        else:
            unit = table.get(last, {"unit": "1"})["unit"]
            value = {"value": number.value, "unit": unit}
            table[last] = {**value, "source": source, "verified": True}
    return document
