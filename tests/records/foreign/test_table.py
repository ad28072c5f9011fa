"""Tables in any unit, order and numbering give the same record; faults are named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.records.test_records import ANY, FLIGHTS, bits, records
from virtual_lab.errors import InputError
from virtual_lab.records import RECORD_TYPES, GateRecord, MassReadings, PendulumRecord, Record
from virtual_lab.records.foreign.table import ChannelForm, column_names, read_channel
from virtual_lab.units import to_si

# whole numbers stay apart in whatever unit; what a unit makes of them is tested to 1e-14
WHOLE = st.integers(-(10**9), 10**9).map(float)
NAMES = {kind: name for name, kind in RECORD_TYPES.items()}
WHERE = "laboratory.toml [channels.x.y]"

INCH, OUNCE, MPH, DEGREE = 0.0254, 0.45359237 / 16, 0.44704, np.pi / 180
LENGTHS = {"m": 1, "mm": 1e-3, "cm": 1e-2, "in": INCH, "um": 1e-6}
TIMES = {"time_s": 1, "time_ms": 1e-3, "time_us": 1e-6, "time_min": 60}
COLUMNS = {  # every column of every record, and what its unit may be, written by hand
    "mass_kg": {"mass_kg": 1, "mass_g": 1e-3, "mass_oz": OUNCE, "mass_lb": 16 * OUNCE},
    "time_s": TIMES,
    "nominal_speed_m_per_s": {"nominal_speed_m_per_s": 1, "nominal_speed_mph": MPH},
    "counts": {"counts": 1},
    **{name: {name: 1} for name in ("left_px", "top_px", "x_px", "y_px", "u_px")},
    "ball": {"ball": 1},
    "counts_per_s": {"counts_per_s": 1},
    "u_counts_per_s": {"u_counts_per_s": 1},
    "counts_per_s_before": {"counts_per_s_before": 1},
    "counts_at_contact": {"counts_at_contact": 1},
    "temperature_K": {"temperature_K": 1, "temperature_mK": 1e-3},
    "humidity": {"humidity": 1, "humidity_percent": 0.01},
    "pressure_Pa": {"pressure_Pa": 1, "pressure_hPa": 100, "pressure_kPa": 1000},
    **{
        f"{name}_m": {f"{name}_{unit}": factor for unit, factor in LENGTHS.items()}
        for name in ("length", "along", "across", "place", "height")
    },
    **{
        f"{name}_rad": {f"{name}_rad": 1, f"{name}_mrad": 1e-3, f"{name}_deg": DEGREE}
        for name in ("first_amplitude", "last_amplitude")
    },
}


def axes_of(kind: type[Record]) -> list[str]:
    return list(dict.fromkeys(axis for column in kind.columns.values() for axis in column.axes))


def read(table: pd.DataFrame | bytes, form: ChannelForm, index_from: int = 0) -> Record:
    """Write a table to a file, and return the record that is read from it."""
    with TemporaryDirectory() as folder:
        data = table if isinstance(table, bytes) else table.to_csv(index=False).encode()
        (Path(folder) / form.file).write_bytes(data)
        return read_channel(form, Path(folder), index_from, WHERE)


def form_of(record: Record, **more: object) -> ChannelForm:
    return ChannelForm(record=NAMES[type(record)], file="theirs.csv", **more)


def is_blank(record: Record) -> bool:
    """Return whether a form is blank, which is an error."""
    return all(np.isnan(getattr(record, field)).all() for field in record.columns)


EVERY = {c.name: c for kind in RECORD_TYPES.values() for c in kind.columns.values()}


@pytest.mark.parametrize("column", EVERY)
def test_a_column_takes_every_unit_of_its_dimension(column: str) -> None:
    """Against the table written by hand above: the dimension of the unit, and a rate is no time."""
    names = column_names(EVERY[column])
    factors = {name: to_si(1.0, *unit) for name, unit in names.items()}
    for name in ("temperature_degC", "temperature_°C"):
        assert factors.pop(name, 274.15) == 274.15
    assert factors == pytest.approx(COLUMNS[column], rel=1e-15)


def test_a_climate_in_degrees_celsius_and_percent_is_read_in_si() -> None:
    table = pd.DataFrame(
        {"reading": [0, 1], "°C": [21.0, 21.5], "rh": [45, 47.5], "pressure_hPa": [1000, 1001]}
    )
    form = ChannelForm(
        record="climate",
        file="theirs.csv",
        columns={"temperature_degC": "°C", "humidity_percent": "rh"},
    )
    record = read(table, form, 0)
    np.testing.assert_allclose(record.temperature, [294.15, 294.65], rtol=1e-15)
    np.testing.assert_allclose(record.humidity, [0.45, 0.475], rtol=1e-15)


@given(
    record=st.sampled_from(list(RECORD_TYPES.values())).flatmap(lambda k: records(k, WHOLE)),
    data=st.data(),
    index_from=st.sampled_from([0, 1]),
)
@settings(max_examples=60)
def test_a_table_in_any_unit_is_read_in_si(
    record: Record, data: st.DataObject, index_from: int
) -> None:
    """A table in random units, with indices from 0 or 1, is read in SI."""
    table = record.table()
    for column in record.columns.values():
        units = COLUMNS[column.name]
        name = data.draw(st.sampled_from(sorted(units)))
        table[column.name] = table[column.name] / units[name] + index_from * column.is_index
        table = table.rename(columns={column.name: name})
    for axis in axes_of(type(record)):
        table[axis] += index_from
    assume(not is_blank(record))
    theirs = read(table, form_of(record), index_from)
    for field in record.columns:
        expected = getattr(record, field)
        assert getattr(theirs, field) == pytest.approx(expected, rel=1e-14, nan_ok=True)


@given(record=ANY, data=st.data())
@settings(max_examples=60)
def test_columns_in_any_order_and_by_any_name_give_the_same_bits(
    record: Record, data: st.DataObject
) -> None:
    """Permuted and renamed columns, shuffled rows and an ignored column give the same bits."""
    table = record.table()
    table = table[data.draw(st.permutations(list(table.columns)))]
    table = table.iloc[data.draw(st.permutations(range(len(table))))]
    renamed = data.draw(st.lists(st.sampled_from(list(table.columns)), unique=True))
    headers = {name: f"Their {name} [x]" for name in renamed}
    table = table.rename(columns=headers).assign(remarks="none")
    assume(not is_blank(record))
    form = form_of(record, columns=headers, ignore=("remarks",))
    assert bits(read(table, form)) == bits(record)


@given(times=st.lists(st.booleans(), min_size=16, max_size=16), index_from=st.sampled_from([0, 1]))
@settings(max_examples=30)
def test_a_table_with_one_row_per_shot_gives_its_record(times: list[bool], index_from: int) -> None:
    """Gates in a wide table with empty cells give the record from which it was written."""
    assume(any(times))
    seen = np.reshape(times, (2, 2, 2, 2))
    record = GateRecord(times=np.where(seen, FLIGHTS, nan))
    cells = {f"{w}{g}{e}": (w, g, e) for w, g, e in np.ndindex(2, 2, 2)}
    table = pd.DataFrame({name: record.times[:, *at] * 1e6 for name, at in cells.items()})
    wide = {
        name: dict(zip(("way", "gate", "edge"), (int(i) + index_from for i in at), strict=True))
        for name, at in cells.items()
    }
    by_number = table.assign(shot=np.arange(2) + index_from).iloc[::-1]
    form = form_of(record, wide={"time_us": wide})
    for theirs in (
        read(by_number, form, index_from),
        read(table, replace(form, rows="shot"), index_from),
    ):
        np.testing.assert_allclose(theirs.times, record.times, rtol=1e-15)


def test_rows_are_counted_within_what_the_table_tells_apart() -> None:
    """The readings of two items alternate and have no number."""
    table = pd.DataFrame({"item": [2, 1, 2, 1], "mass_g": [21.0, 11.0, 22.0, 12.0]})
    record = read(table, ChannelForm(record="mass-readings", file="x.csv", rows="repeat"), 1)
    assert record.readings == pytest.approx(np.array([[0.011, 0.012], [0.021, 0.022]]))


def test_a_table_of_one_item_needs_no_item_column() -> None:
    """The mass of a bat is one column of readings."""
    form = ChannelForm(record="mass-readings", file="x.csv", rows="repeat", fixed={"item": 1})
    record = read(b"mass_g\n881\n882\n", form, 1)
    assert record.readings == pytest.approx(np.array([[0.881, 0.882]]))


def test_amplitudes_stand_once_in_a_wide_table() -> None:
    """One row per release: its passages side by side, then the amplitudes."""
    cells = {f"t{n}": {"passage": n} for n in range(3)}
    form = ChannelForm(record="pendulum", file="x.csv", wide={"time_ms": cells})
    data = b"release,t0,t1,t2,first_amplitude_deg,last_amplitude_deg\n0,0,1400,2801,5,4\n"
    record = read(data, form)
    assert isinstance(record, PendulumRecord)
    assert record.times == pytest.approx(np.array([[0, 1.4, 2.801]]))
    assert record.first_amplitude == pytest.approx(np.radians([5]))
    assert record.last_amplitude == pytest.approx(np.radians([4]))


def test_a_common_value_is_needed_only_once() -> None:
    """A common clock, one amplitude per release: in any of its rows, or in all of them."""
    data = b"shot,sample,counts,time_ms\n0,0,5,1\n0,1,6,\n1,0,7,\n1,1,8,2\n"
    record = read(data, ChannelForm(record="encoder", file="x.csv"))
    assert record.counts.tolist() == [[5, 6], [7, 8]]
    assert record.times == pytest.approx(np.array([1e-3, 2e-3]))
    data = data.replace(b"1,0,7,\n", b"1,0,7,3\n")
    with pytest.raises(InputError, match="time_ms; needs a single value for each sample"):
        read(data, ChannelForm(record="encoder", file="x.csv"))


@pytest.mark.parametrize(
    ("data", "more"),
    [
        (b"\xef\xbb\xbfitem,repeat,mass_g\n0,0,1.5\n0,1,2.5\n", {}),
        (b"item,repeat,mass_g\r\n0,0,1.5\r\n0,1,2.5\r\n", {}),
        (b"item,repeat,mass_g\r0,0,1.5\r0,1,2.5\r", {}),
        (
            b"\xef\xbb\xbfitem;repeat;mass_g\r\n0;0;1,5\r\n0;1;2,5",
            {"delimiter": ";", "decimal": ","},
        ),
        (b"item\trepeat\tmass_g\n0\t0\t1.5\n0\t1\t2.5\n\n", {"delimiter": "\t"}),
        (b'"item", "repeat" , "mass_g"\n0, 0, 1.5\n0, 1, 2.5 \n', {}),
        (b'item,repeat,mass_g\n"0","0","1.5"\n0.0,1.0,2.5e0\n', {}),
    ],
    ids=["BOM", "CRLF", "CR", "spreadsheet", "tabs", "spaces", "quotes"],
)
def test_the_formats_of_spreadsheets_give_the_same_readings(data: bytes, more: dict) -> None:
    """Byte-order marks, line ends, separators, spaces and quotes do not change two readings."""
    form = ChannelForm(record="mass-readings", file="x.csv", **more)
    assert read(data, form).readings == pytest.approx(np.array([[1.5e-3, 2.5e-3]]), rel=1e-15)


GATES = GateRecord(times=FLIGHTS)
TABLE = GATES.table()
THEIRS = TABLE.assign(**{a: TABLE[a] + 1 for a in axes_of(GateRecord)}).rename(
    columns={"time_s": "t [us]"}
)
THEIRS["t [us]"] *= 1e6
FORM = form_of(GATES, columns={"time_us": "t [us]"})


def _cell(row: int, value: object) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table = table.astype({"t [us]": object})
        table.loc[row, "t [us]"] = value
        return table

    return change


def _as(text: str) -> Callable[[pd.DataFrame], bytes]:
    return lambda _: text.encode()


TEXT = THEIRS.to_csv(index=False)


@pytest.mark.parametrize(
    ("change", "key", "value", "allowed"),
    [
        (_cell(3, "60 mph"), "t [us]", "60 mph", "without unit"),
        (_cell(3, "60,5"), "t [us]", "60,5", "decimal comma"),
        (_cell(3, inf), "t [us]", inf, "finite"),
        (_cell(1, -5.0), "t [us]", -5.0, "clears before it breaks (shot 1, way 1, gate 1, edge 2)"),
        (_cell(2, -5.0), "t [us]", -5.0, "out of order (shot 1, way 1, gate 2, edge 1)"),
        (lambda t: t.assign(note=1), "columns", "note", "ignore"),
        (lambda t: t.assign(time_in=1), "columns", "time_in", "time_s or time_ms or time_us"),
        (lambda t: t.assign(time_s=1), "columns", "time_us, time_s", "same column"),
        (lambda t: t.assign(time_us=1), "columns", "time_us", "twice"),
        (lambda t: t.drop(columns="gate"), "columns", None, "missing: gate"),
        (lambda t: t.drop(columns="t [us]"), "columns", None, "lacks 't [us]'"),
        (_as(TEXT.replace("gate", "way", 1)), "columns", "way", "twice in the header"),
        (_as(TEXT.replace(",", ";")), "delimiter", "semicolon", "expected commas"),
        (_as(TEXT.replace(",", "\t")), "delimiter", "tab", "expected commas"),
        (_as(TEXT.replace(".0", ",0")), "line 2", "6 cells", "decimal commas"),
        (_as(TEXT[: TEXT.rindex(",")]), "line 17", "4 cells", "the header has 5"),
        (_as(""), "CSV", None, "empty"),
        (_as("\n \n"), "CSV", None, "empty"),
        (_as("\n" + TEXT), "CSV", None, "header"),
        (_as("x" * 200_000 + "\n1\n"), "CSV", None, "header"),
        (_as(TEXT.splitlines()[0]), "rows", 0, "no rows"),
        (_as("PK\x03\x04\x00\x00"), "CSV", None, "not text"),
        (lambda _: TEXT.encode("utf-16"), "CSV", None, "not text"),
        (lambda _: b"\xff\xd8\xff\xe0" + bytes(range(1, 99)), "CSV", None, "not UTF-8"),
        (lambda _: TEXT.encode() + b"\xff,1,1,1,1\n", "CSV", None, "cannot be read"),
        (lambda t: t.iloc[:-1], "rows", 15, "cut short"),
        (lambda t: pd.concat([t, t.iloc[:1]]), "rows", 17, ""),
        (
            lambda t: t.replace({"shot": {2: 3}}),
            "shot",
            2,
            "is missing, although the numbers go up to 3",
        ),
        (lambda t: t.assign(shot=t.shot - 1), "shot", 0.0, "1 and up"),
        (lambda t: t.assign(edge=t.edge == 2), "edge", "False", "numbers"),
        (lambda t: t.assign(shot="A1"), "shot", "A1", "numbers"),
        (lambda t: t[t.way == 1], "way", None, "needs 1 and 2, in and back"),
        (lambda t: t.assign(**{"t [us]": nan}), "time_us", None, "no numbers yet"),
    ],
)
def test_every_fault_of_a_foreign_table_is_named(
    change: Callable[[pd.DataFrame], pd.DataFrame | bytes],
    key: str,
    value: object,
    allowed: str,
) -> None:
    """One fault at a time in a valid table; messages use the numbers of the file."""
    np.testing.assert_allclose(read(THEIRS, FORM, 1).times, GATES.times, rtol=1e-15)
    with pytest.raises(InputError) as caught:
        read(change(THEIRS), FORM, 1)
    assert "\n" not in str(caught.value)
    assert "theirs.csv" in caught.value.where
    assert caught.value.key == key
    if value is not None:
        assert caught.value.value == (pytest.approx(value) if isinstance(value, float) else value)
    assert allowed in caught.value.allowed


@pytest.mark.parametrize(
    ("more", "key", "allowed"),
    [
        ({"record": "radar"}, "record", "allowed: mass-readings"),
        ({"columns": {"time_h": "t [us]"}}, "columns", "time_us"),
        ({"columns": {"time_us": "t"}}, "columns", "lacks 't'"),
        ({"ignore": ("note",)}, "columns", "lacks 'note'"),
        ({"fixed": {"beam": 1}}, "fixed", "shot, way, gate, edge"),
        ({"fixed": {"gate": 1}}, "fixed", "is also a column"),
        ({"rows": "row"}, "rows", "shot, way, gate, edge"),
        ({"rows": "shot"}, "rows", "is also a column"),
        ({"index_from": {"beam": 1}}, "index_from", "shot, way, gate, edge"),
        ({"wide": {"time_h": {}}}, "wide", "time_us"),
        ({"wide": {"time_us": {"a": {"gate": 1}}}}, "columns", "lacks 'a'"),
        ({"wide": {"time_us": {"gate": {"beam": 1}}}}, "wide.time_us.gate", "shot, way"),
        ({"wide": {"time_us": {"gate": {"gate": 1}}}}, "wide", "is also a column"),
        ({"wide": {"time_us": {}, "time_s": {}}}, "wide", "one value column"),
        ({"file": "nowhere.csv"}, "file", "cannot be read"),
    ],
)
def test_every_fault_of_a_channel_form_is_named(
    more: dict, key: str, allowed: str, tmp_path: Path
) -> None:
    """The table is valid, but the form describes it wrongly."""
    (tmp_path / "theirs.csv").write_text(TEXT)
    with pytest.raises(InputError) as caught:
        read_channel(replace(FORM, **more), tmp_path, 1, WHERE)
    assert "\n" not in str(caught.value)
    assert caught.value.key == key
    assert allowed in caught.value.allowed
    assert WHERE in str(caught.value) or "csv" in caught.value.where


def test_all_of_200_000_rows_are_checked() -> None:
    """All rows are read and checked: a time that decreases in the last row is found."""
    table = pd.DataFrame(
        {
            "time_ms": np.tile(np.arange(50_000.0), 4),
            "counts": np.arange(200_000),
            "shot": np.repeat(np.arange(4), 50_000) + 1,
        }
    )
    form = ChannelForm(record="encoder", file="x.csv", rows="sample")
    record = read(table, form, 1)
    assert record.counts.shape == (4, 50_000)
    assert record.counts[3, -1] == 199_999
    assert record.times[-1] == pytest.approx(49.999)
    table.loc[table.time_ms == 49_999, "time_ms"] = 0.0
    with pytest.raises(InputError, match=r"time_ms = 0.0; .*sample 50000"):
        read(table, form, 1)


def test_numbers_that_imply_too_many_readings_are_refused() -> None:
    """Shot numbers that imply 10^10 readings are refused, and no such array is allocated."""
    number = np.arange(200_000)
    table = pd.DataFrame({"item": number, "repeat": number, "mass_kg": 1.0})
    with pytest.raises(InputError, match="expected 40000000000 "):
        read(table, form_of(MassReadings(readings=np.ones((1, 2)))))
