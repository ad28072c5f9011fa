"""Many tests as one table: bats, procedures and laboratories, one row per test."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from typing import TYPE_CHECKING, Any

from virtual_lab import catalog
from virtual_lab.lab import BatTest, Campaign
from virtual_lab.measurement.model import QUANTITIES
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress, quiet

if TYPE_CHECKING:
    import pandas as pd


def sweep_tests(
    bats: Sequence[str],
    procedures: Sequence[str],
    seeds: Sequence[int],
    *,
    progress: Progress = quiet,
) -> pd.DataFrame:
    """Return the tests as `virtual_lab.sweep` describes them.

    Raises
    ------
    InputError
        Unknown names, two bats or procedures of one name, files that cannot be used.
    """
    import pandas as pd

    catalog.require_own_names("bats", [catalog.load_bat(each).spec.name for each in bats])
    rules = [catalog.load("procedures", each, Procedure).spec.name for each in procedures]
    catalog.require_own_names("procedures", rules)
    rows: list[dict[str, Any]] = []
    total = len(bats) * len(procedures) * len(seeds)
    for bat in bats:
        for procedure in procedures:
            campaign = Campaign.of(bat, procedure)
            for seed in seeds:
                progress("tests", len(rows), total)
                rows.append(_row(seed, next(campaign.run(1, seed))))
    return pd.DataFrame(rows)


def _row(seed: int, tested: BatTest) -> dict[str, Any]:
    found, true = tested.certification, tested.sealed.measurand
    printed = METRICS[found.procedure.metric]
    budget = found.metric
    value, u = (budget.value, budget.u) if budget else (nan, nan)
    low, high = budget.interval_95 if budget else (nan, nan)
    numbers = {
        "value": value,
        "u": u,
        "low": low,
        "high": high,
        "true": true.get("metric", nan),
        "error": value - true.get("metric", nan),
    }
    row: dict[str, Any] = {
        "bat": found.session.bat,
        "procedure": found.procedure.name,
        "seed": seed,
        "verdict": found.verdict.value,
        "reason": "; ".join(found.reasons),
        "metric": printed.symbol,
        "unit": printed.unit,
    }
    row |= {name: number / printed.unit_si for name, number in numbers.items()}
    for name in QUANTITIES:
        one = found.quantities.get(name)
        row |= {
            name: one.value if one else nan,
            f"{name}_u": one.u if one else nan,
            f"{name}_true": true.get(name, nan),
        }
    return row
