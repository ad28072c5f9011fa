"""Raw records: their content, their file form, and all faults of a file."""

import re
from dataclasses import FrozenInstanceError
from math import inf, nan, prod

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
    BallRecord,
    EncoderRecord,
    GateRecord,
    MassReadings,
    PendulumRecord,
    Record,
    RecordColumn,
    ShotLog,
    TrackRecord,
    join,
)

FINITE = st.floats(-1e18, 1e18)
SIZE = st.integers(1, 4)


@st.composite
def records(
    draw: st.DrawFn, kind: type[Record], number: st.SearchStrategy[float] = FINITE
) -> Record:
    """Draw a random record: axis lengths, numbers, and NaN where a value may be missing.

    Times increase in the order of events, and numbers of items are whole.
    """
    sizes: dict[str, int] = {"way": 2, "edge": 2}
    arrays = {}
    for field, column in kind.columns.items():
        shape = tuple(sizes.setdefault(axis, draw(SIZE)) for axis in column.axes)
        numbers = number | st.just(nan) if column.may_be_missing else number
        if column.is_index:
            numbers = st.integers(0, 10).map(float)
        arrays[field] = draw(hnp.arrays(np.float64, shape, elements=numbers))
    if "times" in arrays:
        arrays["times"] = draw(in_order(kind.columns["times"], arrays["times"].shape, number))
    return kind(**arrays)


@st.composite
def in_order(
    draw: st.DrawFn, column: RecordColumn, shape: tuple[int, ...], number: st.SearchStrategy[float]
) -> np.ndarray:
    """Draw possible times: increasing, for a ball from gate to gate and back in reverse."""
    times = np.sort(draw(hnp.arrays(np.float64, prod(shape), elements=number, unique=True)))
    times = times.reshape(shape)
    if "way" not in column.axes:
        return times
    times[:, 1] = times[:, 1, ::-1]
    return np.where(draw(hnp.arrays(bool, shape)), nan, times)


ANY = st.sampled_from(list(RECORD_TYPES.values())).flatmap(records)


def bits(record: Record) -> dict[str, tuple[tuple[int, ...], bytes]]:
    """Return shape and bits of every field, with one bit pattern for all NaN."""
    return {
        field: (values.shape, np.where(np.isnan(values), nan, values).tobytes())
        for field in record.columns
        for values in [getattr(record, field)]
    }


def test_every_type_is_registered() -> None:
    """A record type that is not registered could be written but not loaded."""
    defined = {kind for kind in vars(module).values() if isinstance(kind, type)}
    assert set(RECORD_TYPES.values()) == {
        kind for kind in defined if issubclass(kind, Record) and kind not in {Record, BallRecord}
    }


@given(record=ANY)
def test_a_record_survives_a_table_bit_for_bit(record: Record) -> None:
    """The file has every row once; the whole-number indices are counted by hand."""
    table = record.table()
    sizes = record.sizes()
    assert len(table) == np.prod(list(sizes.values()))
    assert list(table.columns[: len(sizes)]) == list(sizes)
    assert bits(type(record).from_table(table, "x.csv")) == bits(record)


def test_shots_of_a_camera_may_have_different_numbers_of_frames() -> None:
    frames = np.array([[0.0, 1e-3], [0.0, nan]])
    record = TrackRecord(times=frames, x=frames, y=frames, u=frames)
    assert bits(TrackRecord.from_table(record.table(), "x.csv")) == bits(record)


@given(record=ANY, data=st.data())
def test_row_order_does_not_matter(record: Record, data: st.DataObject) -> None:
    """Rows in any order give the same record."""
    table = record.table()
    order = data.draw(st.permutations(range(len(table))))
    shuffled = table.iloc[list(order)].reset_index(drop=True)
    assert bits(type(record).from_table(shuffled, "x.csv")) == bits(record)


def test_the_table_of_gates_has_one_row_per_edge() -> None:
    """Written by hand: one row per edge, one index column per axis."""
    record = GateRecord(times=np.arange(8.0).reshape(1, 2, 2, 2))
    table = record.table()
    assert list(table.columns) == ["shot", "way", "gate", "edge", "time_s"]
    row = table[(table.way == 1) & (table.gate == 0) & (table.edge == 1)]
    assert row.time_s.tolist() == [5.0]


def test_records_cannot_be_changed() -> None:
    """Neither a field nor an array of a record accepts a new value."""
    mine = np.zeros((2, 3))
    record = MassReadings(readings=mine)
    with pytest.raises(FrozenInstanceError):
        record.readings = mine
    with pytest.raises(ValueError, match="read-only"):
        record.readings[0, 0] = 1.0
    mine[0, 0] = 5.0
    assert record.readings[0, 0] == 0.0


@pytest.mark.parametrize("shape", [(), (3,), (1, 2, 3)])
def test_a_wrong_number_of_axes_is_refused(shape: tuple[int, ...]) -> None:
    """The shape of readings is (item, repeat)."""
    with pytest.raises(ValueError, match=r"readings needs the axes \('item', 'repeat'\)"):
        MassReadings(readings=np.zeros(shape))


def test_fields_of_different_lengths_are_refused() -> None:
    """One field has two shots, another has three."""
    with pytest.raises(
        ValueError, match="place has the length 3 along 'shot'; other columns have 2"
    ):
        ShotLog(ball=np.zeros(2), nominal_speed=np.ones(2), place=np.ones(3))


def test_joining_rounds_appends_their_shots() -> None:
    """Shots are appended; values of the session are those of the first round."""
    rounds = [EncoderRecord(counts=np.full((n, 3), float(n)), times=np.arange(3.0)) for n in (1, 2)]
    both = join(rounds)
    assert both.counts.tolist() == [[1.0] * 3, [2.0] * 3, [2.0] * 3]
    assert both.times.tolist() == [0.0, 1.0, 2.0]
    marks = AimMarks(along=np.ones(4), across=np.zeros(4))
    assert bits(join([marks, marks])) == bits(marks)


@pytest.mark.parametrize("record", [PendulumRecord, GateRecord])
def test_joining_a_single_record_returns_it(record: type[Record]) -> None:
    """Joining a single round returns it."""
    sizes = {"times": np.ones([2] * len(record.columns["times"].axes))}
    others = {name: np.ones(2) for name in record.columns if name != "times"}
    one = record(**sizes, **others)
    assert bits(join([one])) == bits(one)


FLIGHTS = np.arange(16.0).reshape(2, 2, 2, 2)  # two balls, in and back
FLIGHTS[:, 1] = FLIGHTS[:, 1, ::-1]
GATES = GateRecord(times=FLIGHTS).table()
LOG = ShotLog(ball=np.arange(2.0), nominal_speed=np.ones(2), place=np.ones(2)).table()
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
        (GateRecord, GATES, lambda t: t.replace({"shot": {1: 2}}), "shot", "go up to 2"),
        (GateRecord, GATES, lambda t: t[t.way == 0], "way", "needs 0 and 1, in and back"),
        (GateRecord, GATES, lambda t: t[t.edge == 0], "edge", "broke and cleared"),
        (ShotLog, LOG, _set("ball", 0.5), "ball", "whole numbers, 0 and up"),
        (ShotLog, LOG, _set("ball", -1), "ball", "whole numbers, 0 and up"),
        (EncoderRecord, ENCODER, _set("counts", nan), "counts", "finite"),
        (EncoderRecord, ENCODER, _set("counts", inf), "counts", "finite"),
        (EncoderRecord, ENCODER, _set("time_s", 7.0), "time_s", ""),
    ],
)
def test_every_fault_of_a_table_is_named(
    kind: type[Record], good: pd.DataFrame, change, key: str, allowed: str
) -> None:
    """One fault at a time in a valid table (the last: one clock, two times)."""
    kind.from_table(good, "x.csv")
    with pytest.raises(InputError) as caught:
        kind.from_table(change(good), "x.csv")
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.startswith("x.csv: ")
    assert caught.value.key == key
    assert allowed in caught.value.allowed


def test_the_offending_text_is_shown() -> None:
    """The message shows the cell that is no number, not another one of its column."""
    with pytest.raises(InputError) as caught:
        GateRecord.from_table(_set("time_s", "12 ms", row=3)(GATES), "x.csv")
    assert "12 ms" in str(caught.value)


def _swap(times: np.ndarray, *places: tuple[int, ...]) -> np.ndarray:
    """Return the times with two of them exchanged."""
    times = times.copy()
    one, other = places
    times[one], times[other] = times[other].copy(), times[one].copy()
    return times


@pytest.mark.parametrize(
    ("one", "other", "fault", "at"),
    [
        ((1, 0, 1, 0), (1, 0, 1, 1), "clears before it breaks", "shot 1, way 0, gate 1, edge 1"),
        ((1, 1, 0, 0), (1, 1, 0, 1), "clears before it breaks", "shot 1, way 1, gate 0, edge 1"),
        ((0, 0, 0), (0, 0, 1), "out of order", "shot 0, way 0, gate 1, edge 0"),
        ((1, 1, 0), (1, 1, 1), "out of order", "shot 1, way 1, gate 1, edge 0"),
        ((1, 0), (1, 1), "out of order", "shot 1, way 0, gate 1, edge 0"),
    ],
)
def test_times_out_of_order_are_named_with_shot_and_gate(
    one: tuple[int, ...], other: tuple[int, ...], fault: str, at: str
) -> None:
    """One exchange at a time; the message counts from 0 or from the file's first number."""
    table = GateRecord(times=_swap(FLIGHTS, one, other)).table()
    with pytest.raises(InputError, match=f"{fault}.*{at}") as caught:
        GateRecord.from_table(table, "x.csv")
    assert caught.value.key == "time_s"
    theirs = table.assign(**{axis: table[axis] + 1 for axis in table if axis != "time_s"})
    with pytest.raises(InputError, match=fault) as shifted:
        GateRecord.from_table(theirs, "x.csv", dict.fromkeys(("shot", "way", "gate", "edge"), 1))
    numbers = [int(number) + 1 for number in re.findall(r"\d+", at)]
    assert [int(n) for n in re.findall(r" (\d+)[,)]", shifted.value.allowed)] == numbers


def test_a_ball_that_returns_before_it_arrives_is_refused() -> None:
    """All times of the flight back are in order, but before the flight in."""
    with pytest.raises(InputError, match="returns before it arrives"):
        GateRecord.from_table(
            GateRecord(times=FLIGHTS - 9 * np.reshape([0.0, 1.0], (2, 1, 1))).table(), "x.csv"
        )


def test_the_order_of_times_is_checked_across_a_blind_gate() -> None:
    """The middle of three gates is blind; the last may still not come before the first."""
    times = np.full((1, 2, 3, 2), nan)
    times[0, 0, 0], times[0, 0, 2] = (2.0, 3.0), (1.0, 4.0)
    with pytest.raises(InputError, match=r"out of order.*gate 2, edge 0"):
        GateRecord.from_table(GateRecord(times=times).table(), "x.csv")


def test_gates_may_be_nearer_than_a_ball_is_long() -> None:
    """The second beam breaks before the first clears, or on the same tick of a slow clock."""
    times = np.full((1, 2, 2, 2), nan)
    times[0, 0] = [[0.0, 3.0], [1.0, 4.0]]
    record = GateRecord(times=times)
    assert bits(GateRecord.from_table(record.table(), "x.csv")) == bits(record)
    level = GateRecord(times=np.zeros((1, 2, 2, 2)))
    assert bits(GateRecord.from_table(level.table(), "x.csv")) == bits(level)


@pytest.mark.parametrize("time", [1.0, 0.5])
def test_a_clock_that_does_not_rise_is_refused(time: float) -> None:
    """The clock of an encoder or pendulum stops or runs back; the message names the sample."""
    counts = EncoderRecord(counts=np.zeros((2, 3)), times=np.array([0.0, 1.0, time]))
    with pytest.raises(InputError, match=f"time_s = {time}; .*sample 2"):
        EncoderRecord.from_table(counts.table(), "x.csv")
    swings = PendulumRecord(
        times=np.array([[0.0, 1.0, 2.0], [0.0, 1.0, time]]),
        first_amplitude=np.ones(2),
        last_amplitude=np.ones(2),
    )
    with pytest.raises(InputError, match=f"time_s = {time}; .*release 1, passage 2"):
        PendulumRecord.from_table(swings.table(), "x.csv")
