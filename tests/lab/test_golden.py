"""The golden table: each laboratory gives the result stored in the table."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from pathlib import Path

import pytest

from tests.lab.golden.make import Case, Row, cases, differences, row_of, table, write

FEW = [  # tests of every rig, together with tests/lab/test_round_robin
    Case(kind="summed", procedure="astm-f1881", bat="r161", number=2),
    Case(kind="summed", procedure="bbcor", bat="ea70", number=2),
    Case(kind="full", procedure="asa", bat="softball-34", number=1),
    Case(kind="fault", procedure="astm-f1881", bat="r161", what="gate-moved"),
    Case(kind="operator", procedure="", bat="", what="careless"),
]
ROW = Row(
    kind="summed", procedure="astm-f1881", bat="r161", metric=0.95, u=0.007, dof=12.0, truth=0.94,
    shots=7, scenes=0, verdict="PASS", flags="chords+aim",
)  # fmt: skip


@pytest.mark.parametrize("case", FEW, ids=lambda case: f"{case.kind}-{case.procedure}{case.what}")
def test_a_few_tests_agree_with_the_golden_table(case: Case) -> None:
    """Results agree to 1e-9, on any processor."""
    assert differences(row_of(case), table()[case], value=1e-9, dof=1e-6) == []


@pytest.mark.long
def test_every_test_agrees_with_the_golden_table() -> None:
    """Results agree to 1e-12, ν to 1e-9, on the processor family that made the table."""
    assert list(table()) == list(cases())
    found = {case: differences(row_of(case), row) for case, row in table().items()}
    assert {case: lines for case, lines in found.items() if lines} == {}


def test_the_table_holds_every_bit(tmp_path: Path) -> None:
    rows = [ROW, replace(ROW, number=1, metric=nan, u=nan, dof=nan, verdict="INVALID")]
    rows.append(replace(ROW, number=2, metric=0.1 + 0.2))
    write(rows, tmp_path / "table.csv")
    found = table(tmp_path / "table.csv")
    assert [repr(row) for row in found.values()] == [repr(row) for row in rows]
    assert [case.number for case in found] == [0, 1, 2]


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        ({"metric": 0.95 * (1 + 2e-12)}, "metric"),
        ({"u": 0.007 * (1 - 2e-12)}, "u"),
        ({"u": nan}, "u"),
        ({"truth": 0.94 * (1 + 2e-12)}, "truth"),
        ({"dof": 12 * (1 + 2e-9)}, "dof"),
        ({"shots": 8}, "shots"),
        ({"verdict": "FAIL"}, "verdict"),
        ({"flags": "chords"}, "flags"),
    ],
)
def test_a_difference_from_the_table_is_named(changed: dict[str, object], name: str) -> None:
    (line,) = differences(replace(ROW, **changed), ROW)
    assert line.startswith(f"{name}: ")


def test_less_than_the_share_is_no_difference() -> None:
    """Tolerances: ν 1e-9; all numbers 1e-8 if a scene was played."""
    near = replace(ROW, metric=0.95 * (1 + 5e-13), dof=12 * (1 + 5e-10))
    assert differences(near, ROW) == []
    played = replace(ROW, scenes=1)
    assert differences(replace(played, u=0.007 * (1 + 5e-9)), played) == []
    assert differences(replace(played, u=0.007 * (1 + 2e-8)), played) != []


def test_the_table_asks_for_every_procedure_fault_and_operator() -> None:
    """Six procedures, two bats, 300 summed and 20 full laboratories; 28 faults, five operators."""
    every = list(cases())
    assert len(every) == len(set(every)) == 6 * 2 * (300 + 20) + 28 + 5
