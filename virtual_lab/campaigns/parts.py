"""Parts of a campaign: the tests of a block as columns, and their Parquet file."""

from __future__ import annotations

import json
import platform
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.campaigns.study import StudyCase
from virtual_lab.errors import DISTRIBUTION, of_extra
from virtual_lab.files import whole_file
from virtual_lab.lab import BlockTest
from virtual_lab.lab.measurand import CONTINUOUS, WIDTH_KEY
from virtual_lab.output.metrics import METRICS
from virtual_lab.uncertainty.budget import coverage_factors

if TYPE_CHECKING:
    import pyarrow as pa

ROWS = 8192  # laboratories of a part: a second's work and more, as whoever hands it out needs
PROGRAM = {"program": version(DISTRIBUTION), "schema": 1}  # of the columns
FORM = {"compression": "zstd", "use_dictionary": False, "write_statistics": False}
ABOUT = b"virtual-lab"  # the key of a part's words about itself
NOT_MADE = "not made"
Columns = dict[tuple[str, str], NDArray[Any]]  # by name and unit, (laboratory,)


@dataclass(frozen=True, slots=True)
class Block:
    """The laboratories of one part: consecutive ones of a case on one day."""

    number: int  # in the campaign
    case: StudyCase
    repeat: int
    first: int
    rows: int
    name: str  # of its file

    def __str__(self) -> str:
        last, case = self.first + self.rows - 1, self.case
        changes = "".join(f", {key} = {value}" for key, value in case.change.items())
        of = f"{case.bat} by {case.procedure}{changes}, repeat {self.repeat}"
        return f"{of}, laboratories {self.first} to {last}"


def parquet() -> Any:
    """Return pyarrow's module of Parquet files; `InputError` without its extra."""
    return of_extra("pyarrow.parquet", "campaign", "a campaign")


def table_of(block: Block, seed: int) -> pa.Table:
    """Return the tests of a block as a table, with units in the metadata of its columns.

    A test without a result has blanks. `InputError` as `StudyCase.round_robin`.
    """
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
        # what is certain in some laboratories side by side contributes nothing, and has no column
        own = [part[key] if key in part else 0 * part["u", key[1]] for part in parts]
        columns[key] = pa.array(np.concatenate(own), from_pandas=True)  # NaN is a blank
    types = [(*key, column.type) for key, column in columns.items()]
    fields = [pa.field(name, own, metadata={"unit": unit}) for name, unit, own in types]
    return pa.table(list(columns.values()), schema=pa.schema(fields))


def _columns(tested: BlockTest) -> Columns:
    """Return what the tests of some laboratories gave."""
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
        columns[f"contribution.{name}", unit] = column
    flags = np.full(found.some.size, "", object)
    for name, where in found.checked.flagged.items():
        flags[where] = [f"{others} {name}".strip() for others in flags[where]]
    verdicts = np.array([verdict.value for verdict in found.verdicts], object)
    blanked = {key: np.where(found.some, one, np.nan) for key, one in columns.items()}
    return {("verdict", ""): verdicts, ("flags", ""): flags, **blanked}


def write_part(table: pa.Table, folder: Path, block: Block) -> None:
    """Write a part whole or not at all. `OSError` where the folder cannot be written."""
    words = {**PROGRAM, "name": block.name, "tests": str(block), "processor": processor()}
    table = table.replace_schema_metadata({ABOUT: json.dumps(words)})
    with whole_file(folder / block.name) as file:
        parquet().write_table(table, file, write_page_checksum=True, **FORM)


def wrong_with(path: Path, block: Block, *, whole: bool) -> tuple[str, str]:
    """Return what is wrong with the part of a block, '' if nothing, and what processor made it.

    By its footer, or by all its pages if `whole`.
    """
    import pyarrow as pa

    try:
        footer = parquet().read_metadata(path)
        words = json.loads((footer.metadata or {}).get(ABOUT, b"{}"))
        if whole:
            parquet().read_table(path, page_checksum_verification=True)
    except (OSError, ValueError, pa.ArrowException) as fault:
        return f"it cannot be read ({' '.join(str(fault).split())[:80]})", ""
    wrong = footer.num_rows != block.rows or words.get("name") != block.name
    return "it holds other tests" if wrong else "", words.get("processor", "")


@cache
def processor() -> str:
    """Return the family of this machine's processor; within one, columns have equal bits."""
    from llvmlite import binding

    return f"{platform.machine()} {binding.get_host_cpu_name()}"
