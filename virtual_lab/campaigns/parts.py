"""Parts of a campaign: the tests of a block as columns, and their Parquet file."""

from __future__ import annotations

import json
import platform
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
from virtual_lab.lab import BlockTest
from virtual_lab.lab.measurand import CONTINUOUS, WIDTH_KEY
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress
from virtual_lab.uncertainty.budget import coverage_factors

if TYPE_CHECKING:
    import pyarrow as pa

ROWS = 8192  # largest number of laboratories per part: at least a second of work for a worker
PROGRAM = {"program": VERSION, "schema": 2}  # version of program and columns
FIRST = 4  # number of laboratories whose tests show the columns of a study
FORM = {"compression": "zstd", "use_dictionary": False, "write_statistics": False}
ABOUT = b"virtual-lab"  # metadata key of a part's description
NOT_MADE = "not made"
LONGEST_REASON = 100  # length of the reason why a part is faulty [characters]
CONTRIBUTION = "contribution."  # prefix of the columns of the sources of uncertainty
MEANINGS = {  # meaning of the columns that every part has
    "bat": "name of the bat",
    "procedure": "name of the procedure",
    "repeat": "number of the day",
    "number": "number of the laboratory",
    "verdict": "verdict of the test",
    "flags": "names of the flags, separated by blanks",
    "metric": "metric of the procedure",
    "u": "standard uncertainty of the metric",
    "low": "lower end of the 95 % coverage interval of the metric",
    "high": "upper end of the 95 % coverage interval of the metric",
    "true": "true value of the metric for this laboratory",
    "dof": "effective degrees of freedom of u",
}
Columns = dict[tuple[str, str], NDArray[Any]]  # values, (laboratory,), by name and unit
PartColumns = Mapping[str, tuple[str, str]]  # type and unit of a part's columns, by name


@dataclass(frozen=True, slots=True)
class Block:
    """A block of consecutive laboratories of one case on one day; it fills one part."""

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
    """Return pyarrow's module of Parquet files; `InputError` without its extra."""
    return of_extra("pyarrow.parquet", "campaign", "a campaign")


def table_of(block: Block, seed: int, layout: PartColumns) -> pa.Table:
    """Return the tests of a block as a table with the columns of `layout`.

    The metadata of a column are its unit and its meaning. A test without a result has blanks. So
    has a column that only other procedures have. `InputError` as `StudyCase.round_robin`;
    `ValueError` for a column that `layout` does not have.
    """
    import pyarrow as pa

    made = _made(block, seed)
    if unforeseen := [name for name, _ in made if name not in layout]:
        raise ValueError(f"its first laboratories have no {', '.join(unforeseen)}")
    arrays = {name: array for (name, _), array in made.items()}
    blanks = pa.nulls(block.rows, pa.float64())
    columns = [arrays.get(name, blanks) for name in layout]
    types = zip(layout.items(), columns, strict=True)
    fields = [
        pa.field(name, each.type, metadata={"unit": unit, "meaning": meaning_of(name)})
        for (name, (_, unit)), each in types
    ]
    return pa.table(columns, schema=pa.schema(fields))


def meaning_of(column: str) -> str:
    """Return the meaning of a column of a part. A key that the study changes means its value."""
    if column in MEANINGS:
        return MEANINGS[column]
    if column.startswith(CONTRIBUTION):
        return f"contribution of {column.removeprefix(CONTRIBUTION)} to u"
    for ending, words in (("_true", "true value"), ("_u", "standard uncertainty")):
        if (name := column.removesuffix(ending)) != column:
            return f"{words} of {name.replace('_', ' ')}"
    return f"value of {column.replace('_', ' ')}"


def layouts_of(study: Study, progress: Progress) -> dict[str, PartColumns]:
    """Return the columns of a study's parts, by procedure: the same names, in the same order.

    The first laboratories of the study's cases are tested. Of cases that differ only in the
    numbers of their changed keys, only the first is tested. A number of 0 makes a separate case,
    because an uncertainty of 0 contributes nothing and has no column. A column that a procedure
    does not have has the unit of the first procedure that has it.
    """
    alike = {
        (case.bat, case.procedure, *map(_kind, case.change.values())): case
        for case in reversed(study.cases)
    }
    layouts: dict[str, dict[str, tuple[str, str]]] = {each: {} for each in study.procedures}
    rows = min(FIRST, study.laboratories)
    for done, case in enumerate(reversed(alike.values())):
        progress("columns", done, len(alike))
        made = _made(Block(0, case, 0, 0, rows, ""), study.seed)
        columns = {name: (str(array.type), unit) for (name, unit), array in made.items()}
        layouts[case.procedure] |= columns
    every = {name: each for layout in reversed(layouts.values()) for name, each in layout.items()}
    names = dict.fromkeys(name for layout in layouts.values() for name in layout)
    order = sorted(names, key=lambda name: name.startswith(CONTRIBUTION))
    return {
        procedure: {name: layout.get(name, every[name]) for name in order}
        for procedure, layout in layouts.items()
    }


def _kind(value: Value) -> Any:
    """Return the part of a changed value that may affect the columns: text, or whether it is 0."""
    if isinstance(value, tuple):
        return tuple(map(_kind, value))
    number = str(value).split(" ", maxsplit=1)[0]  # number in a text such as "0.1 mm"
    try:
        return float(number) == 0
    except ValueError:
        return value


def _made(block: Block, seed: int) -> dict[tuple[str, str], pa.Array]:
    """Return the tests of a block as columns by name and unit."""
    import pyarrow as pa

    case, numbers = block.case, np.arange(block.first, block.first + block.rows)
    texts, units = case.changed()
    with catalog.sheets_in_place(texts):
        shared = case.round_robin(seed, block.repeat)
        parts = [_columns(each) for each in shared.blocks(block.rows, seed, block.first)]
    same = {"bat": case.bat, "procedure": case.procedure, **case.change, "repeat": block.repeat}
    columns = {
        (name, units.get(name, "")): pa.repeat(one, block.rows) for name, one in same.items()
    }
    columns["number", ""] = pa.array(numbers)
    for key in dict.fromkeys(key for part in parts for key in part):
        # a quantity without uncertainty in a part contributes nothing, and has no column there
        own = [part[key] if key in part else 0 * part["u", key[1]] for part in parts]
        columns[key] = pa.array(np.concatenate(own), from_pandas=True)  # NaN is a blank
    return columns


def _columns(tested: BlockTest) -> Columns:
    """Return the results of the tests of some laboratories as columns."""
    found, true = tested.certified, dict(tested.measurands)
    metric, unit = found.results["metric"], METRICS[found.procedure.metric].si_unit or "1"
    reach = coverage_factors(metric.dof) * metric.u
    own = (metric.value, metric.u, metric.value - reach, metric.value + reach, true.pop("metric"))
    names = ("metric", "u", "low", "high", "true")
    columns: Columns = {(name, unit): one for name, one in zip(names, own, strict=True)}
    columns["dof", "1"] = metric.dof
    for name, budgets in found.results.items():
        if name != "metric":
            columns[name, "1"], columns[f"{name}_u", "1"] = budgets.value, budgets.u
    for name, values in true.items():
        columns[f"{name}_true", {WIDTH_KEY: "m", CONTINUOUS: unit}.get(name, "1")] = values
    square, _ = metric.components.lines()
    for name, column in zip(metric.components.line_names, np.sqrt(square).T, strict=True):
        columns[f"{CONTRIBUTION}{name}", unit] = column
    flags = np.full(found.some.size, "", object)
    for name, where in found.checked.flagged.items():
        flags[where] = [f"{others} {name}".strip() for others in flags[where]]
    verdicts = np.array([verdict.value for verdict in found.verdicts], object)
    blanked = {key: np.where(found.some, one, np.nan) for key, one in columns.items()}
    return {("verdict", ""): verdicts, ("flags", ""): flags, **blanked}


def write_part(table: pa.Table, folder: Path, block: Block) -> None:
    """Write a part completely or not at all. `OSError` if the folder cannot be written."""
    words = {**PROGRAM, "name": block.name, "tests": str(block), "processor": processor()}
    words |= {DATA: NO_DIGEST, FOOTER: NO_DIGEST}
    made = BytesIO()
    with parquet().ParquetWriter(made, table.schema, write_page_checksum=True, **FORM) as writer:
        writer.write_table(table)
        writer.add_key_value_metadata({ABOUT: json.dumps(words)})
    with whole_file(folder / block.name) as file:
        file.write(with_digests(made.getvalue()))


@dataclass(frozen=True, slots=True)
class Part:
    """The part of a campaign that one block fills, and its faults."""

    block: Block
    wrong: str  # fault of its file; '' if there is none
    processor: str = ""  # processor that made it
    file: bytes = b""  # content of the file, if all of it was read

    def table(self, columns: Sequence[str] | None = None) -> pa.Table:
        """Return its tests."""
        import pyarrow as pa

        return parquet().read_table(pa.BufferReader(self.file), columns=columns)


def read_part(block: Block, layout: PartColumns, path: Path, *, whole: bool) -> Part:
    """Return the part of a block in a file, checked by its footer, or completely if `whole`."""
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
    return Part(block, "", str(words.get("processor", "")), file if whole else b"")


@cache
def processor() -> str:
    """Return the family of this machine's processor; within it, results agree to the last bit."""
    from llvmlite import binding

    return f"{platform.machine()} {binding.get_host_cpu_name()}"
