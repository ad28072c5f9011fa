"""Many tests as one table: bats, procedures and laboratories, one row per test."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.lab import BatTest, BlockTest, RoundRobin
from virtual_lab.measurement.model import QUANTITIES
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.uncertainty.budget import interval_95

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
    """Return the tests as `virtual_lab.sweep` describes them.

    `keep`, a function that can be pickled, is called with each test. Without `summed` instruments
    write every reading, and every bat is an individual.

    Raises
    ------
    InputError
        Unknown names, two bats or procedures of one name, files that cannot be used, no laboratory.
    """
    import pandas as pd

    if laboratories < 1:
        raise InputError("", "laboratories", laboratories, "allowed: 1 and more")
    catalog.require_own_names("bats", [catalog.load_bat(each).spec.name for each in bats])
    rules = [catalog.load("procedures", each, Procedure).spec.name for each in procedures]
    catalog.require_own_names("procedures", rules)
    rows: list[dict[str, Any]] = []
    take = partial(_rows, keep=keep)
    total = len(bats) * len(procedures) * laboratories
    for bat in bats:
        for procedure in procedures:
            round_robin = RoundRobin.of(bat, procedure, summed=summed, individual=individual)
            name, first = round_robin.setup.bat.spec.name, len(rows)
            for part in round_robin.each_block(take, laboratories, seed, workers):
                rows += [
                    {"bat": name, **row, "laboratory": len(rows) - first + number}
                    for number, row in enumerate(part)
                ]
                progress("tests", len(rows), total)
    return pd.DataFrame(rows)[[*LEADING, *(name for name in rows[0] if name not in LEADING)]]


LEADING = ["bat", "procedure", "laboratory", "verdict", "reason", "metric", "unit"]


def _rows(
    tested: BlockTest, *, keep: Callable[[BatTest], object] | None = None
) -> list[dict[str, Any]]:
    found, verdicts, rows = tested.certified, tested.certified.verdicts, []
    for one in range(len(verdicts)):
        some = bool(found.some[one])
        results = {
            name: (float(each.value[one]), float(each.u[one]), float(each.dof[one]))
            for name, each in found.results.items()
        }
        true = {name: float(each[one]) for name, each in tested.measurands.items()}
        reason = "; ".join(found.reasons(one))
        given = results if some else {}
        if keep:
            keep(tested.of(one))
        rows.append(_row(found.procedure, verdicts[one].value, reason, given, true))
    return rows


def _row(
    rules: Procedure,
    verdict: str,
    reason: str,
    results: Mapping[str, tuple[float, float, float]],
    true: Numbers,
) -> dict[str, Any]:
    """Return a row; `results` are value, u and ν by name, {} where the test gave none."""
    printed = METRICS[rules.metric]
    value, u, dof = results.get("metric", (nan, nan, nan))
    low, high = interval_95(value, u, dof)
    of_metric = true.get("metric", nan)
    numbers = {
        "value": value,
        "u": u,
        "low": low,
        "high": high,
        "true": of_metric,
        "error": value - of_metric,
    }
    row: dict[str, Any] = {
        "procedure": rules.name,
        "verdict": verdict,
        "reason": reason,
        "metric": printed.symbol,
        "unit": printed.unit,
    }
    row |= {name: number / printed.unit_si for name, number in numbers.items()}
    for name in QUANTITIES:
        own, own_u, _ = results.get(name, (nan, nan, nan))
        row |= {name: own, f"{name}_u": own_u, f"{name}_true": true.get(name, np.nan)}
    return row
