"""Parts of a campaign: the tests of a block as columns, and their Parquet file."""

from __future__ import annotations

import json
import platform
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.campaigns.digests import (
    DATA,
    FOOTER,
    NO_DIGEST,
    ChangedPartError,
    checked_file,
    checked_footer,
    with_digests,
)
from virtual_lab.campaigns.study import Study, StudyCase, Value
from virtual_lab.errors import VERSION, InputError, of_extra
from virtual_lab.files import parse_json, whole_file
from virtual_lab.files.dictionary import column_meaning
from virtual_lab.lab import BlockTest
from virtual_lab.lab.measurand import CONTINUOUS, WIDTH_KEY
from virtual_lab.measurement.procedure import Verdict
from virtual_lab.measurement.procedure.model import AS_FOUND
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress
from virtual_lab.uncertainty.budget import coverage_factors

if TYPE_CHECKING:
    import pyarrow as pa

ROWS = 8192  # largest number of laboratories per part: at least a second of work for a worker
COLUMN_SCHEMA = 4  # schema of the columns; parts of another schema are rejected
PROGRAM = {"program": VERSION, "schema": COLUMN_SCHEMA}  # version of program and columns
FIRST = 4  # number of laboratories tested to determine the columns of a study
FORM = {"compression": "zstd", "use_dictionary": False, "write_statistics": False}
ABOUT = b"virtual-lab"  # metadata key of a part's description
NOT_MADE = "not made"
LONGEST_REASON = 100  # length of the reason why a part is faulty [characters]
CONTRIBUTION = "contribution."  # prefix of the columns of the sources of uncertainty
Columns = dict[tuple[str, str], NDArray[Any]]  # values, (laboratory,), by name and unit
PartColumns = Mapping[str, tuple[str, str]]  # type and unit of a part's columns, keyed by name


@dataclass(frozen=True, slots=True)
class Block:
    """A block of consecutive laboratories of one case on one day. Its tests fill one part."""

    number: int  # number in the campaign, from 0
    case: StudyCase
    repeat: int
    first: int
    rows: int
    name: str  # name of its file

    def __str__(self) -> str:
        last, case = self.first + self.rows - 1, self.case
        changes = "".join(f", {key} = {value}" for key, value in case.change.items())
        of = f"{case.bat} by {case.procedure}{changes}, repeat {self.repeat}"
        return f"{of}, laboratories {self.first} to {last}"


def parquet() -> Any:
    """Return `pyarrow.parquet`. Raises `InputError` if the extra ``campaign`` is not installed."""
    return of_extra("pyarrow.parquet", "campaign", "a campaign")


def table_of(block: Block, seed: int, layout: PartColumns) -> pa.Table:
    """Return the tests of a block as a table, with one row per test and the columns of `layout`.

    `layout` has the type and the unit of each column, keyed by name. The metadata of a column state
    its unit and its meaning. A cell is null if the procedure does not have the column. `seed` is
    the seed of the study.

    Raises
    ------
    InputError
        A sheet cannot be used, or bat, ball, rigs and procedure do not fit together.
    ValueError
        The tests have a column that is not in `layout`.
    """
    import pyarrow as pa

    columns_made = _test_block(block, seed)
    if unforeseen := [name for name, _ in columns_made if name not in layout]:
        raise ValueError(f"its first laboratories have no {', '.join(unforeseen)}")
    arrays = {name: array for (name, _), array in columns_made.items()}
    blanks = pa.nulls(block.rows, pa.float64())
    columns = [arrays.get(name, blanks) for name in layout]
    types = zip(layout.items(), columns, strict=True)
    fields = [
        pa.field(name, each.type, metadata={"unit": unit, "meaning": meaning_of(name)})
        for (name, (_, unit)), each in types
    ]
    return pa.table(columns, schema=pa.schema(fields))


def meaning_of(column: str) -> str:
    """Return the meaning of a table column of a campaign, in words.

    For a column in the data dictionary, the meaning is taken from there. Any other column holds the
    values of a key that the study changes, and has the name of this key; the result is then "value
    of" and the name.
    """
    entry = column_meaning(column)
    return entry.meaning if entry else f"value of {column}"


def layouts_of(study: Study, progress: Progress) -> dict[str, PartColumns]:
    """Return the type and the unit of each column of a study, by procedure and column name.

    The names and their order are the same for all procedures. If a procedure does not have a
    column, the type and the unit come from the first procedure that has it.

    The columns are determined by testing the first laboratories of some cases. A case is a
    combination of bat, procedure and changed values. Cases are alike if they differ only in the
    size of changed numbers, and if the same numbers are 0 in all of them. The zeros matter because
    an uncertainty of 0 has no column. One case is tested from each group of cases that are alike.

    `progress` is called with a message, the number of cases tested, and the total. Raises
    `InputError` if a sheet cannot be used, or if bat, ball, rigs and procedure do not fit together.
    """
    alike = {
        (case.bat, case.procedure, *map(_kind, case.change.values())): case
        for case in reversed(study.cases)
    }
    layouts: dict[str, dict[str, tuple[str, str]]] = {each: {} for each in study.procedures}
    rows = min(FIRST, study.laboratories)
    for number, case in enumerate(reversed(alike.values())):
        progress("columns", number, len(alike))
        columns_made = _test_block(Block(0, case, 0, 0, rows, ""), study.seed)
        columns = {name: (str(array.type), unit) for (name, unit), array in columns_made.items()}
        layouts[case.procedure] |= columns
    every = {name: each for layout in reversed(layouts.values()) for name, each in layout.items()}
    names = dict.fromkeys(name for layout in layouts.values() for name in layout)
    order = sorted(names, key=lambda name: name.startswith(CONTRIBUTION))
    return {
        procedure: {name: layout.get(name, every[name]) for name in order}
        for procedure, layout in layouts.items()
    }


def _kind(value: Value) -> Any:
    """Return a value unchanged, or for a number whether it is 0.

    Two cases have the same columns if these results are equal.
    """
    if isinstance(value, tuple):
        return tuple(map(_kind, value))
    number = str(value).split(" ", maxsplit=1)[0]  # number in a string such as "0.1 mm"
    try:
        return float(number) == 0
    except ValueError:
        return value


def _test_block(block: Block, seed: int) -> dict[tuple[str, str], pa.Array]:
    """Return the tests of a block as columns by name and unit."""
    import pyarrow as pa

    case, numbers = block.case, np.arange(block.first, block.first + block.rows)
    texts, changed = case.apply_changes()
    with catalog.sheets_in_place(texts):
        shared = case.round_robin(seed, block.repeat)
        parts = [_columns(each) for each in shared.blocks(block.rows, seed, block.first)]
    metric = METRICS[shared.setup.rules.spec.metric]
    same = {
        ("bat", ""): case.bat,
        ("procedure", ""): case.procedure,
        **{(name, unit): value for name, (value, unit) in changed.items()},
        ("repeat", ""): block.repeat,
    }
    columns = {key: pa.repeat(value, block.rows) for key, value in same.items()}
    columns["laboratory", ""] = pa.array(numbers)
    columns["metric", ""] = pa.repeat(metric.symbol, block.rows)
    columns["unit", ""] = pa.repeat(metric.si_unit, block.rows)
    for key in dict.fromkeys(key for part in parts for key in part):
        # a quantity without uncertainty contributes nothing and has no column in this part
        values = [part[key] if key in part else 0 * part["u", key[1]] for part in parts]
        columns[key] = pa.array(np.concatenate(values), from_pandas=True)  # NaN is a blank
    return columns


def _columns(tested: BlockTest) -> Columns:
    """Return the results of the tests of a block of laboratories as columns."""
    certified, true = tested.certified, dict(tested.measurands)
    metric, unit = certified.results["metric"], METRICS[certified.procedure.metric].si_unit or "1"
    units = defaultdict(lambda: "1", {WIDTH_KEY: "m", CONTINUOUS: unit, AS_FOUND: unit})
    half_width = coverage_factors(metric.dof) * metric.u
    metric_columns = (
        metric.value,
        metric.u,
        metric.value - half_width,
        metric.value + half_width,
        true.pop("metric"),
    )
    names = ("value", "u", "low", "high", "true_value")
    columns: Columns = {
        (name, unit): values for name, values in zip(names, metric_columns, strict=True)
    }
    columns["dof", "1"] = metric.dof
    for name, budgets in certified.results.items():
        if name != "metric":
            columns[name, units[name]] = budgets.value
            columns[f"{name}_u", units[name]] = budgets.u
    for name, values in true.items():
        columns[f"{name}_true", units[name]] = values
    square, _ = metric.components.lines()
    for name, column in zip(metric.components.line_names, np.sqrt(square).T, strict=True):
        columns[f"{CONTRIBUTION}{name}", unit] = column
    flags = np.full(certified.has_result.size, "", object)
    for name, where in certified.checked.flagged.items():
        flags[where] = [f"{earlier_flags} {name}".strip() for earlier_flags in flags[where]]
    verdicts = np.array([verdict.value for verdict in certified.verdicts], object)
    blanked = {
        key: np.where(certified.has_result, values, np.nan) for key, values in columns.items()
    }
    return {("verdict", ""): verdicts, ("flag_names", ""): flags, **blanked}


def write_part(table: pa.Table, folder: Path, block: Block) -> None:
    """Write the tests of a block to a Parquet file in `folder`.

    `table` holds the tests. The file is written completely or not at all. It replaces an older
    file. Raises `OSError` if the folder cannot be written, and `InputError` if the extra
    ``campaign`` is not installed.
    """
    words = {**PROGRAM, "name": block.name, "tests": str(block), "processor": processor()}
    words |= {DATA: NO_DIGEST, FOOTER: NO_DIGEST}
    buffer = BytesIO()
    with parquet().ParquetWriter(buffer, table.schema, write_page_checksum=True, **FORM) as writer:
        writer.write_table(table)
        writer.add_key_value_metadata({ABOUT: json.dumps(words)})
    with whole_file(folder / block.name) as file:
        file.write(with_digests(buffer.getvalue()))


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a campaign, with the tests of one block."""

    block: Block
    wrong: str  # fault of its file; empty if there is none
    processor: str = ""  # processor that computed it
    file: bytes = b""  # content of the file, if all of it was read

    def table(self, columns: Sequence[str] | None = None) -> pa.Table:
        """Return its tests as a table; by default with all columns."""
        import pyarrow as pa

        return parquet().read_table(pa.BufferReader(self.file), columns=columns)

    def unlike_study(self) -> list[str]:
        """Return the columns that contradict the block of the study, or each other.

        The file of this part must have been read as a whole.
        """
        block, case, limits = self.block, self.block.case, ["low", "value", "high"]
        keys = ["laboratory", "bat", "procedure", "repeat", "verdict"]
        tests = self.table([*keys, *limits]).to_pandas()
        rising = (tests.low < tests.value) & (tests.value < tests.high)
        contradictions = {
            "laboratory": tests.laboratory != np.arange(block.first, block.first + block.rows),
            "bat": tests.bat != case.bat,
            "procedure": tests.procedure != case.procedure,
            "repeat": tests.repeat != block.repeat,
            "verdict": ~tests.verdict.isin([each.value for each in Verdict]),
            "value": tests[limits].notna().any(axis=1) & ~rising,
        }
        return [name for name, where in contradictions.items() if where.any()]


def read_part(block: Block, layout: PartColumns, path: Path, *, whole: bool) -> Part:
    """Read and check the Parquet file of a block; return it as a `Part`.

    If `whole`, the whole file is checked, and the part contains it. Otherwise only the footer is
    read and checked. If the file is missing, changed or unreadable, or does not hold the tests of
    `block`, no error is raised. The field `wrong` of the part then states the fault. `layout` has
    the type and the unit of each column, keyed by name.
    """
    import pyarrow as pa

    try:
        file = checked_file(path) if whole else checked_footer(path)
        footer = parquet().read_metadata(pa.BufferReader(file))
        words = parse_json((footer.metadata or {}).get(ABOUT, b"").decode(), str(path))
        fields = footer.schema.to_arrow_schema()
    except ChangedPartError as fault:
        return Part(block, str(fault))
    except (OSError, ValueError, pa.ArrowException) as fault:
        why = fault.allowed if isinstance(fault, InputError) else f"cannot be read ({fault})"
        return Part(block, f"it {' '.join(why.split())[:LONGEST_REASON]}")
    if footer.num_rows != block.rows or words.get("name") != block.name:
        return Part(block, "it holds other tests")
    units = ((each.metadata or {}).get(b"unit", b"").decode() for each in fields)
    columns = {each.name: (str(each.type), unit) for each, unit in zip(fields, units, strict=True)}
    wrong = [name for name in (*layout, *columns) if columns.get(name) != layout.get(name)]
    if wrong or len(fields) > len(layout):
        return Part(block, f"its columns are not those of the study: {', '.join(wrong)}")
    part = Part(block, "", str(words.get("processor", "")), file if whole else b"")
    wrong = part.unlike_study() if whole else []
    return Part(block, f"these columns contradict the study: {', '.join(wrong)}") if wrong else part


@cache
def processor() -> str:
    """Return architecture and family of this computer's processor, such as ``x86_64 skylake``.

    Processors of the same family give the same results to the last bit.
    """
    from llvmlite import binding

    return f"{platform.machine()} {binding.get_host_cpu_name()}"
