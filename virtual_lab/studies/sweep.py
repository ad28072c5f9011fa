"""Many tests as one table: bats, procedures and laboratories, one row per test."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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
    progress: Progress = quiet,
) -> pd.DataFrame:
    """Return the tests as `virtual_lab.sweep` describes them.

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
    total = len(bats) * len(procedures) * laboratories
    for bat in bats:
        for procedure in procedures:
            round_robin = RoundRobin.of(bat, procedure, individual=individual)
            for number, row in enumerate(_rows(round_robin, laboratories, seed)):
                progress("tests", len(rows), total)
                rows.append({"bat": round_robin.setup.bat.spec.name, **row, "laboratory": number})
    return pd.DataFrame(rows)[[*LEADING, *(name for name in rows[0] if name not in LEADING)]]


LEADING = ["bat", "procedure", "laboratory", "verdict", "reason", "metric", "unit"]


def _rows(round_robin: RoundRobin, laboratories: int, seed: int) -> Iterator[dict[str, Any]]:
    if round_robin.in_blocks:
        for block in round_robin.blocks(laboratories, seed):
            yield from _of_block(round_robin, block)
    else:
        for tested in round_robin.run(laboratories, seed):
            yield _of_test(round_robin, tested)


def _of_block(round_robin: RoundRobin, tested: BlockTest) -> Iterator[dict[str, Any]]:
    found, verdicts = tested.certified, tested.certified.verdicts
    for one in range(len(verdicts)):
        some = bool(found.some[one])
        results = {
            name: (float(each.value[one]), float(each.u[one]), float(each.dof[one]))
            for name, each in found.results.items()
        }
        true = {name: float(each[one]) for name, each in tested.measurands.items()}
        reason = "; ".join(found.reasons(one))
        yield _row(round_robin, verdicts[one].value, reason, results if some else {}, true)


def _of_test(round_robin: RoundRobin, tested: BatTest) -> dict[str, Any]:
    found = tested.certification
    budgets = {**found.quantities, **({"metric": found.metric} if found.metric else {})}
    results = {name: (each.value, each.u, each.dof) for name, each in budgets.items()}
    true = tested.sealed.measurand
    return _row(round_robin, found.verdict.value, "; ".join(found.reasons), results, true)


def _row(
    round_robin: RoundRobin,
    verdict: str,
    reason: str,
    results: Mapping[str, tuple[float, float, float]],
    true: Numbers,
) -> dict[str, Any]:
    """Return a row; `results` are value, u and ν by name, {} where the test gave none."""
    rules = round_robin.setup.rules.spec
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
