"""The study of a campaign, its cases, and the sheets that a case changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from math import prod
from typing import Annotated, TypeAlias

import numpy as np
from annotated_types import Ge, Le, MinLen

from virtual_lab import catalog
from virtual_lab.catalog.reading import Key
from virtual_lab.catalog.specs import Real, Spec, Whole, YesNo
from virtual_lab.errors import InputError
from virtual_lab.lab import RoundRobin
from virtual_lab.lab.setup import TestSetup
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.sheets import Sheet, sheet_at
from virtual_lab.streams import LABORATORIES, LARGEST_SEED
from virtual_lab.units import name_with_unit

MOST_CASES, MOST_REPEATS = 10_000, 1_000
IN_STUDY = "study"  # place of an error in a study that has no file
# new value of a key: numbers in the unit of the sheet, or a string, which may contain a unit
Value: TypeAlias = "Real | str | tuple[Real, ...]"
Values: TypeAlias = "tuple[Real, ...] | tuple[str, ...] | tuple[tuple[Real, ...], ...]"


@dataclass(frozen=True, slots=True, kw_only=True)
class Study(Spec):
    """All combinations of bats, procedures and changed sheets, in laboratories, on several days.

    All cases have the same laboratories, counted from 0. `change` maps keys of the sheets of a rig
    or of its instruments to new values: ``"impact.gates.distance_u"`` is the key ``distance_u`` of
    the instrument that the impact rig names as its gates. Several keys give all combinations.
    """

    bats: Annotated[tuple[str, ...], MinLen(1)]
    procedures: Annotated[tuple[str, ...], MinLen(1)]
    laboratories: Annotated[Whole, Ge(1), Le(LABORATORIES)]
    repeats: Annotated[Whole, Ge(1), Le(MOST_REPEATS)] = 1  # number of days per laboratory
    seed: Annotated[Whole, Ge(0), Le(LARGEST_SEED)]
    individual: YesNo = False
    change: Mapping[str, Annotated[Values, MinLen(1)]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        catalog.require_own_names("bats", self.bats)
        catalog.require_own_names("procedures", self.procedures)
        if prod(map(len, (self.bats, self.procedures, *self.change.values()))) > MOST_CASES:
            raise ValueError(f"the values have more than {MOST_CASES} combinations")

    @property
    def cases(self) -> tuple[StudyCase, ...]:
        """All combinations of bats, procedures and values of the changes, in this order."""
        return tuple(
            StudyCase(bat, procedure, self.individual, dict(zip(self.change, values, strict=True)))
            for bat, procedure in product(self.bats, self.procedures)
            for values in product(*(tuple[Value, ...](each) for each in self.change.values()))
        )

    def sheets(self, progress: Progress = quiet) -> dict[str, str]:
        """Return the texts of all data sheets that the tests read, keyed by ``kind/name``.

        Raises `InputError` if the tests cannot use a value of the study.
        """
        texts: dict[str, str] = {}
        for number, case in enumerate(self.cases):
            progress("cases", number, len(self.cases))
            with catalog.sheets_in_place({}) as sheets_read:
                changed = case.apply_changes()[0]
                try:
                    with catalog.sheets_in_place(changed):
                        case.round_robin(self.seed)
                except InputError as fault:
                    if fault.where not in {name for _, name in changed}:
                        raise
                    key = f"change.{', '.join(case.change)}"
                    raise InputError(IN_STUDY, key, None, str(fault)) from fault
                texts |= {"/".join(key): catalog.source(*key)[0] for key in sheets_read}
        return texts


@dataclass(frozen=True, slots=True)
class StudyCase:
    """One bat, one procedure and one value of each changed key."""

    bat: str
    procedure: str
    individual: bool
    change: Mapping[str, Value]

    def apply_changes(self) -> tuple[dict[Key, str], dict[str, tuple[Value, str]]]:
        """Return the texts of the changed sheets, and value and unit of each changed key.

        Values and units are keyed by column name: the key, and its unit unless that is 1. A number
        is in the unit of the unchanged sheet; a string has the unit "".

        Raises `InputError` if no rig of the procedure and no instrument of these rigs has the key.
        """
        setup = TestSetup.of(self.bat, procedure=self.procedure)
        texts, columns = dict[Key, str](), dict[str, tuple[Value, str]]()
        for key, value in self.change.items():
            with catalog.sheets_in_place(texts):
                rigs = {stage.value: rig for stage, rig in setup.rigs.items()}
                try:
                    sheet, sheet_key = sheet_at(rigs, key)
                    changed = sheet.with_({sheet_key: value})
                    number = _number_of(sheet, sheet_key, changed)
                except ValueError as fault:
                    raise InputError(IN_STUDY, f"change.{key}", value, str(fault)) from fault
            texts[sheet.kind, sheet.name] = changed.text
            if number is None:
                columns[key] = (value, "")
            else:
                columns[name_with_unit(key, number[1])] = number
        return texts, columns

    def round_robin(self, seed: int, repeat: int = 0) -> RoundRobin:
        """Return the laboratories of this case on a day, with the changed sheets in place.

        Raises `InputError` if a sheet cannot be used, if bat or ball does not fit the procedure, or
        if the rigs cannot simulate several laboratories at once.
        """
        shared = RoundRobin.of(self.bat, self.procedure, individual=self.individual)
        if not shared.in_blocks:
            allowed = "its rigs cannot simulate several laboratories at once"
            raise InputError("", "procedure", self.procedure, allowed)
        shared.laboratory(seed)  # loads all sheets and checks that they fit together
        return replace(shared, setup=replace(shared.setup, test=repeat or None, same_bat=True))


def _number_of(sheet: Sheet, key: str, changed: Sheet) -> tuple[Value, str] | None:
    """Return the number of a changed sheet in the unit of `sheet`, and this unit.

    The number may be a list; the result is None for a key that is not a number. Raises `ValueError`
    for a unit of another dimension.
    """
    before, now = ([each for each in one.datums if each.key == key] for one in (sheet, changed))
    if not (before and now):
        return None
    unit = before[0].unit
    return np.asarray(now[0].in_unit(unit), float).tolist(), unit
