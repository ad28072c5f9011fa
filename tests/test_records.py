"""Raw records: what they hold, their file form, and every way a file can be wrong."""

from dataclasses import FrozenInstanceError
from math import inf, nan

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from virtual_lab import records as module
from virtual_lab.errors import InputError
from virtual_lab.records import (
    RECORD_TYPES,
    AimMarks,
    EncoderRecord,
    GateRecord,
    MassReadings,
    PendulumRecord,
    Record,
    ShotLog,
    join,
)

FINITE = st.floats(allow_nan=False, allow_infinity=False)
SIZE = st.integers(1, 4)


@st.composite
def records(draw: st.DrawFn, kind: type[Record]) -> Record:
    """Draw a record of a kind: any axis lengths, any doubles, NaN where it may be missing."""
    sizes: dict[str, int] = {}
    arrays = {}
    for field, column in kind.columns.items():
        shape = tuple(sizes.setdefault(axis, draw(SIZE)) for axis in column.axes)
        numbers = FINITE | st.just(nan) if column.may_be_missing else FINITE
        arrays[field] = draw(hnp.arrays(np.float64, shape, elements=numbers))
    return kind(**arrays)


ANY = st.sampled_from(list(RECORD_TYPES.values())).flatmap(records)


def bits(record: Record) -> dict[str, tuple[tuple[int, ...], bytes]]:
    """Return shape and bits of every field, any NaN as one."""
    return {
        field: (values.shape, np.where(np.isnan(values), nan, values).tobytes())
        for field in record.columns
        for values in [getattr(record, field)]
    }


def test_every_type_is_registered() -> None:
    """A record type nobody can load would be written and lost."""
    defined = {kind for kind in vars(module).values() if isinstance(kind, type)}
    assert set(RECORD_TYPES.values()) == {
        kind for kind in defined if issubclass(kind, Record) and kind is not Record
    }


@given(record=ANY)
def test_through_a_table_bit_for_bit(record: Record) -> None:
    """The file form holds every row once, with whole-number indices counted by hand."""
    table = record.table()
    sizes = record.sizes()
    assert len(table) == np.prod(list(sizes.values()))
    assert list(table.columns[: len(sizes)]) == list(sizes)
    assert bits(type(record).from_table(table, "x.csv")) == bits(record)


@given(record=ANY, data=st.data())
def test_row_order_does_not_matter(record: Record, data: st.DataObject) -> None:
    """Somebody else's software may sort the rows as it likes."""
    table = record.table()
    order = data.draw(st.permutations(range(len(table))))
    shuffled = table.iloc[list(order)].reset_index(drop=True)
    assert bits(type(record).from_table(shuffled, "x.csv")) == bits(record)


def test_the_file_form_of_gates() -> None:
    """Written out by hand: one row an edge, an index column for each axis."""
    record = GateRecord(times=np.arange(8.0).reshape(1, 2, 2, 2))
    table = record.table()
    assert list(table.columns) == ["shot", "way", "gate", "edge", "time_s"]
    row = table[(table.way == 1) & (table.gate == 0) & (table.edge == 1)]
    assert row.time_s.tolist() == [5.0]


def test_records_cannot_be_changed() -> None:
    """What was written down stays: neither field nor array takes a new value."""
    mine = np.zeros((2, 3))
    record = MassReadings(readings=mine)
    with pytest.raises(FrozenInstanceError):
        record.readings = mine
    with pytest.raises(ValueError, match="read-only"):
        record.readings[0, 0] = 1.0
    mine[0, 0] = 5.0
    assert record.readings[0, 0] == 0.0


@pytest.mark.parametrize("shape", [(), (3,), (1, 2, 3)])
def test_wrong_number_of_axes(shape: tuple[int, ...]) -> None:
    """A reading is (item, repeat) and nothing else."""
    with pytest.raises(ValueError, match=r"readings needs axes \('item', 'repeat'\)"):
        MassReadings(readings=np.zeros(shape))


def test_fields_that_disagree() -> None:
    """Two shots in one field, three in another."""
    with pytest.raises(ValueError, match="place has 3 along 'shot', others 2"):
        ShotLog(ball=np.zeros(2), nominal_speed=np.ones(2), place=np.ones(3))


def test_join_of_rounds() -> None:
    """Shots are appended, what belongs to the session is kept from the first round."""
    rounds = [EncoderRecord(counts=np.full((n, 3), float(n)), times=np.arange(3.0)) for n in (1, 2)]
    both = join(rounds)
    assert both.counts.tolist() == [[1.0] * 3, [2.0] * 3, [2.0] * 3]
    assert both.times.tolist() == [0.0, 1.0, 2.0]
    marks = AimMarks(along=np.ones(4), across=np.zeros(4))
    assert bits(join([marks, marks])) == bits(marks)


@pytest.mark.parametrize("record", [PendulumRecord, GateRecord])
def test_join_of_one_is_itself(record: type[Record]) -> None:
    """One round is a session of one round."""
    sizes = {"times": np.ones([2] * len(record.columns["times"].axes))}
    others = {name: np.ones(2) for name in record.columns if name != "times"}
    one = record(**sizes, **others)
    assert bits(join([one])) == bits(one)


GATES = GateRecord(times=np.arange(16.0).reshape(2, 2, 2, 2)).table()
ENCODER = EncoderRecord(counts=np.arange(6.0).reshape(2, 3), times=np.arange(3.0)).table()


def _set(column: str, value: object, row: int = -1):
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table = table.astype({column: object}) if isinstance(value, str) else table.copy()
        if isinstance(value, float):
            table[column] = table[column].astype(float)
        table.loc[table.index[row], column] = value
        return table

    return change


@pytest.mark.parametrize(
    ("kind", "good", "change", "key", "allowed"),
    [
        (GateRecord, GATES, lambda t: t.iloc[:-1], "rows", "expected 16"),
        (GateRecord, GATES, lambda t: t.iloc[:0], "rows", "expected"),
        (GateRecord, GATES, lambda t: t.drop(columns="gate"), "columns", "shot, way, gate, edge"),
        (GateRecord, GATES, lambda t: t.rename(columns={"way": "Way"}), "columns", "shot, way"),
        (GateRecord, GATES, lambda t: t.assign(note=1), "columns", "shot, way"),
        (GateRecord, GATES, lambda t: t[t.columns[::-1]], "columns", "shot, way"),
        (GateRecord, GATES, _set("time_s", "12 ms"), "time_s", "numbers"),
        (GateRecord, GATES, _set("time_s", inf), "time_s", "finite"),
        (GateRecord, GATES, _set("shot", 0), "rows", "same shot"),
        (GateRecord, GATES, _set("edge", 0.5), "edge", "whole numbers"),
        (GateRecord, GATES, _set("edge", -1), "edge", "whole numbers"),
        (GateRecord, GATES, _set("edge", nan), "edge", "whole numbers"),
        (GateRecord, GATES, _set("shot", 2), "rows", "expected 24"),
        (EncoderRecord, ENCODER, _set("counts", nan), "counts", "finite"),
        (EncoderRecord, ENCODER, _set("counts", inf), "counts", "finite"),
        (EncoderRecord, ENCODER, _set("time_s", 7.0), "time_s", ""),
    ],
)
def test_a_bad_table(
    kind: type[Record], good: pd.DataFrame, change, key: str, allowed: str
) -> None:
    """Each fault alone in a table that otherwise reads (the last: one clock, two times)."""
    kind.from_table(good, "x.csv")
    with pytest.raises(InputError) as caught:
        kind.from_table(change(good), "x.csv")
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.startswith("x.csv: ")
    assert caught.value.key == key
    assert allowed in caught.value.allowed


def test_the_offending_text_is_shown() -> None:
    """Not just any cell of the column: the one that is no number."""
    with pytest.raises(InputError) as caught:
        GateRecord.from_table(_set("time_s", "12 ms", row=3)(GATES), "x.csv")
    assert "12 ms" in str(caught.value)
