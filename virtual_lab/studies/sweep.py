"""Many tests as a table, one row per combination of bat, procedure and laboratory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab import catalog
from virtual_lab.files.dictionary import with_units
from virtual_lab.lab import BatTest, BlockTest, RoundRobin
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.model import QUANTITIES
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.sheets import CHANGED, Sheet
from virtual_lab.uncertainty.budget import interval_95
from virtual_lab.units import name_with_unit

if TYPE_CHECKING:
    import pandas as pd

Numbers = Mapping[str, float]


def sweep_tests(
    bats: Sequence[str],
    procedures: Sequence[str],
    laboratories: int,
    seed: int,
    *,
    individual: bool = False,
    summed: bool = True,
    keep: Callable[[BatTest], object] | None = None,
    workers: int = 1,
    progress: Progress = quiet,
) -> pd.DataFrame:
    """Return a table with one row per test, with the columns of `virtual_lab.sweep`.

    The rows are sorted by bat, then by procedure, both in the order of the arguments, then by the
    number of the laboratory. A test without a result also has a row.

    Parameters
    ----------
    bats, procedures
        Names in the catalog, or paths of .toml files.
    laboratories
        Number of laboratories. Each is identified by `seed` and its number, from 0.
    seed
        Seed of the study, common to all laboratories.
    individual
        Whether each laboratory tests an individual bat. Otherwise all test the nominal bat. If
        `summed` is False, the bats are always individual.
    summed
        Whether the instruments record only summary values. Otherwise they record every reading.
    keep
        Function to call with each test. Its result is ignored. It must be picklable if `workers` is
        above 1. None: no call.
    workers
        Number of processes.
    progress
        Function that is called with a message, the number of tests done, and the total.

    Raises
    ------
    InputError
        A name is unknown, two bats or two procedures have the same name, or a file cannot be used.
    """
    import pandas as pd

    catalog.require_own_names("bats", [catalog.load_bat(each).spec.name for each in bats])
    rules = [catalog.load("procedures", each, Procedure).spec.name for each in procedures]
    catalog.require_own_names("procedures", rules)
    of_bats, units_of_bats = changed_numbers("bats", bats)
    of_procedures, units = changed_numbers("procedures", procedures)
    units = units_of_bats | units
    rows: list[dict[str, Any]] = []
    take = partial(_rows, keep=keep)
    total = len(bats) * len(procedures) * laboratories
    for bat in bats:
        for procedure in procedures:
            round_robin = RoundRobin.of(bat, procedure, summed=summed, individual=individual)
            name, first = round_robin.setup.bat.spec.name, len(rows)
            keys = {**of_bats[bat], **of_procedures[procedure]}
            for part in round_robin.each_block(take, laboratories, seed, workers):
                rows += [
                    {"bat": name, **keys, **row, "laboratory": len(rows) - first + number}
                    for number, row in enumerate(part)
                ]
                progress("tests", len(rows), total)
    leading = ["bat", "procedure", *units, "laboratory", "verdict", "reason", "metric", "unit"]
    table = pd.DataFrame(rows)
    table = with_units(table[[*leading, *(name for name in rows[0] if name not in leading)]])
    table.attrs["units"] |= units
    return table


def changed_numbers(
    kind: str, names: Sequence[str]
) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Return the numbers that the user changed in one or more data sheets, and their units.

    There are two results:

    * the numbers of each sheet, keyed by the name of the sheet and then by column;
    * the unit of each column.

    Each changed number has one column for all sheets, also for those in which it is unchanged. It
    is NaN for a sheet that lacks its key. Lists of numbers are ignored.

    The name of a column is the key of the number. If the unit is not 1, the unit follows. It is the
    unit in the first sheet that has the key.

    Parameters
    ----------
    kind
        ``bats`` or ``procedures``.
    names
        Names or paths of the sheets.

    Raises
    ------
    InputError
        A sheet is unknown or cannot be read.
    """
    sheets = {name: {each.key: each for each in Sheet.of(kind, name).datums} for name in names}
    changed = dict.fromkeys(
        key
        for datums in sheets.values()
        for key, each in datums.items()
        if each.source == CHANGED and isinstance(each.value, int | float)
    )
    columns: dict[str, dict[str, float]] = {name: {} for name in names}
    units = {}
    for key in changed:
        unit = next(datums[key].unit for datums in sheets.values() if key in datums)
        column = name_with_unit(key, unit)
        units[column] = unit
        for name, datums in sheets.items():
            columns[name][column] = float(datums[key].in_unit(unit)) if key in datums else nan
    return columns, units


def _rows(
    tested: BlockTest, *, keep: Callable[[BatTest], object] | None = None
) -> list[dict[str, Any]]:
    certified, verdicts, rows = tested.certified, tested.certified.verdicts, []
    for index in range(len(verdicts)):
        has_result = bool(certified.has_result[index])
        results = {
            name: (float(each.value[index]), float(each.u[index]), float(each.dof[index]))
            for name, each in certified.results.items()
        }
        true = {name: float(each[index]) for name, each in tested.measurands.items()}
        reason = "; ".join(certified.reasons(index))
        stated = results if has_result else {}
        if keep:
            keep(tested.of(index))
        rows.append(_row(certified.procedure, verdicts[index].value, reason, stated, true))
    return rows


def _row(
    rules: Procedure,
    verdict: str,
    reason: str,
    results: Mapping[str, tuple[float, float, float]],
    true: Numbers,
) -> dict[str, Any]:
    """Return a row; `results` are value, u and ν by quantity, empty for a test without a result."""
    printed = METRICS[rules.metric]
    value, u, dof = results.get("metric", (nan, nan, nan))
    low, high = interval_95(value, u, dof)
    of_metric = true.get("metric", nan)
    numbers = {
        "value": value,
        "u": u,
        "low": low,
        "high": high,
        "true_value": of_metric,
        "error": value - of_metric,
    }
    row: dict[str, Any] = {
        "procedure": rules.name,
        "verdict": verdict,
        "reason": reason,
        "metric": printed.symbol,
        "unit": printed.unit,
    }
    row |= {name: printed.in_unit(number) for name, number in numbers.items()}
    for name in QUANTITIES:
        value_si, u_si, _ = results.get(name, (nan, nan, nan))
        row |= {name: value_si, f"{name}_u": u_si, f"{name}_true": true.get(name, np.nan)}
    return row
