"""Every column of a table that a user gets is in the dictionary, with its unit."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, get_origin, get_type_hints

import pandas as pd
import pytest

import virtual_lab
import virtual_lab as vl
from virtual_lab.certificate.columns import SHOTS
from virtual_lab.certificate.document import BudgetLine
from virtual_lab.files.column_units import PURE, UNITS, unit_of
from virtual_lab.files.dictionary import (
    COLUMNS,
    PATTERNS,
    PER_ROW,
    WORDS,
    column_meaning,
    units_of,
    with_units,
)
from virtual_lab.output.tables import INLINE, Column
from virtual_lab.records import record_types
from virtual_lab.studies.bats.text import Peaks
from virtual_lab.studies.critique import BatRank, Pair
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.show.course import WRITTEN
from virtual_lab.video.show.track_text import OF_CONTACT, OF_FLIGHT, in_columns


def modules() -> Iterator[Any]:
    for each in pkgutil.walk_packages(virtual_lab.__path__, "virtual_lab."):
        if ".docs" not in each.name and "__main__" not in each.name:
            yield importlib.import_module(each.name)


def rows_of_tables() -> dict[str, type]:
    """Return all dataclasses with printed columns, and those of tables without."""
    kinds: dict[str, type] = {each.__name__: each for each in (BudgetLine, BatRank, Pair, Peaks)}
    for module in modules():
        for name, kind in vars(module).items():
            if isinstance(kind, type) and is_dataclass(kind) and kind.__module__ == module.__name__:
                printed = any(Column.__name__ in each.metadata for each in fields(kind))
                if printed:
                    kinds[name] = kind
    return kinds


ROWS = rows_of_tables()


def columns(kind: type) -> Iterator[str]:
    """Yield the columns of a row; those of a mapping depend on the study and are left out."""
    hints = get_type_hints(kind)
    for each in fields(kind):
        inner = hints[each.name]
        if is_dataclass(inner):
            prefix = "" if INLINE in each.metadata else f"{each.name}_"
            yield from (f"{prefix}{name}" for name in columns(inner))
        elif get_origin(inner) is not Mapping:
            yield each.name


@pytest.mark.parametrize("kind", ROWS)
def test_each_field_of_a_row_is_in_the_dictionary(kind: str) -> None:
    unknown = [name for name in columns(ROWS[kind]) if column_meaning(name) is None]
    assert unknown == []


def test_no_table_has_a_column_that_pandas_hides() -> None:
    """``table.flags`` and the like are attributes of a DataFrame, not its columns."""
    names = {*COLUMNS, *(name for kind in ROWS.values() for name in columns(kind))}
    names |= {each.name for each in SHOTS}
    names |= {each.name for kind in record_types().values() for each in kind.columns.values()}
    hidden = {name for name in names if hasattr(pd.DataFrame, name)}
    assert hidden <= {"mean", "median"}


def test_a_unit_in_a_name_is_the_unit_of_the_column() -> None:
    for name in COLUMNS:
        known = column_meaning(name)
        assert known is not None
        if unit_of(name) != PURE:
            assert known.unit == unit_of(name).text
    assert {each.text for each in UNITS.values()} >= {"mph", "in", "rad/s"}


def test_a_name_with_an_ending_follows_from_the_name_without_it() -> None:
    assert column_meaning("restitution_true") == (
        "true value: " + COLUMNS["restitution"].meaning,
        "1",
    )
    known = column_meaning("impact_position_u_in")
    assert known is not None
    assert known.unit == "in"
    assert known.meaning.startswith("standard uncertainty: impact position")
    assert column_meaning("coverage_by_u_3") == PATTERNS["coverage_by_u_*"]._replace(
        meaning="coverage of tenth 3 of the laboratories, smallest u first"
    )
    assert column_meaning("place") is None


def test_columns_get_the_unit_that_all_rows_have() -> None:
    table = pd.DataFrame({"unit": ["mph", "mph"], "value": [1.0, 2.0], "z": 0.0, "mine": 0})
    assert with_units(table).attrs["units"] == {"unit": WORDS, "value": "mph", "z": "1"}
    mixed = pd.DataFrame({"unit": ["mph", ""], "value": [1.0, 2.0]})
    assert with_units(mixed).attrs["units"]["value"] == PER_ROW


def test_the_tables_of_a_test_have_units() -> None:
    test = vl.certify("r161", seed=7)
    units = test.shots.attrs["units"]
    assert list(units) == list(test.shots.columns)
    assert (units["impact_position_in"], units["speed_mph"], units["restitution"]) == (
        "in",
        "mph",
        "1",
    )
    assert (units["shot"], units["reason"], units["used"]) == ("", "", "")
    assert test.budget.attrs["units"] == units_of(test.budget.columns)
    assert list(test.budget.attrs["units"]) == list(test.budget.columns)


def known(table: pd.DataFrame) -> None:
    """Assert that each column is in the dictionary, and has its unit."""
    assert [name for name in table if column_meaning(str(name)) is None] == []
    assert table.attrs["units"] == units_of(table.columns) or "unit" in table


def test_the_tables_that_are_computed_are_in_the_dictionary() -> None:
    compared = vl.profile("r161", "ea70")
    for table in (compared.table, *compared.tables.values(), vl.profile("r161").table):
        known(table)
    assert compared.table.attrs["units"]["batted_speed_mph"] == "mph"
    known(vl.daily(days=30).table)
    inputs = {"x": vl.Input(1.0, 0.1), "y": vl.Input(2.0, 0.1)}
    result = vl.propagate(lambda x, y: x * y, inputs)
    for table in (result.table, result.budget):
        known(table)
    known(vl.procedure("astm-f1881").numbers)
    known(vl.shelf("bats").table)


def test_the_tables_of_a_clip_are_in_the_dictionary() -> None:
    """The columns are those that the writers name; a clip itself takes seconds."""
    assert [name for name in WRITTEN if column_meaning(name) is None] == []
    flight = {"speed_in_m_per_s": Estimate(value=40.0, u=0.1), "contact_kind": "floor"}
    assert list(in_columns(flight)) == ["speed_in_m_per_s", "speed_in_u_m_per_s", "contact_kind"]
    keys = {*OF_FLIGHT, *OF_CONTACT}
    assert [key for key in keys if column_meaning(key) is None] == []
