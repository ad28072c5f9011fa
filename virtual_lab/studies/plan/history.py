"""Scatter of a laboratory's hits on earlier days, and simulated balls with the same scatter."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.reading import Key
from virtual_lab.certificate.chain import result_folders
from virtual_lab.certificate.document import read_document
from virtual_lab.certificate.history import FEWEST, earlier_tests
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml, read_table
from virtual_lab.lab.setup import TestSetup
from virtual_lab.output.metrics import METRICS
from virtual_lab.records.record import require_numbers
from virtual_lab.sheets import toml_text
from virtual_lab.simulation.instruments.calibrated import StandardDeviation
from virtual_lab.studies.own_laboratory.ball import PLACES, adapted_scatters, with_scatter
from virtual_lab.uncertainty.scatter import bartlett_p
from virtual_lab.units import Array

DAYS = "daily.csv"  # table of a folder of daily checks
MOST = 1e6  # largest number of degrees of freedom of a day, so that other days still count
SIGNIFICANT = 0.05  # p-value of Bartlett's test below which days are not pooled


@dataclass(frozen=True, slots=True, kw_only=True)
class DailyScatter:
    """Variance of a hit on several days, arrays (day,)."""

    variance: Array  # variance of the metric [SI²], or of e0 of a hit at the wall
    dof: Array
    at_wall: bool

    @property
    def pooled(self) -> float:
        """Variance of a hit, pooled over the days by their degrees of freedom.

        Raises `InputError` for fewer than three days, and if the variances of the days differ more
        than chance explains.
        """
        days = self.variance.size
        if days < FEWEST:
            raise InputError("", "history", f"{days} days", f"allowed: {FEWEST} or more")
        p = bartlett_p(self.variance, self.dof)
        if p < SIGNIFICANT:
            allowed = (
                f"the scatter differs from day to day (Bartlett's test, p = {p:.2g}); allowed: "
                f"days that agree, p of at least {SIGNIFICANT}"
            )
            raise InputError("", "history", f"{days} days", allowed)
        return float(np.average(self.variance, weights=self.dof))


def read_history(folders: Sequence[Path], setup: TestSetup) -> DailyScatter:
    """Return the variance of the hits on each day of a history, with its degrees of freedom.

    The history is one of the following:

    * Several result folders. The variance is the variance of the metric.
    * One folder of daily checks. The variance is the variance of e0 (ball-wall restitution) of the
      hits at the wall.

    `setup` is the test that is planned.

    Raises
    ------
    InputError
        A folder has no result. There are fewer than three tests, or a test occurs twice. The tests
        are of another bat, procedure, rig or metric. The table of daily checks lacks a column.
    """
    if len(folders) == 1 and (folders[0] / DAYS).exists():
        return _of_daily_checks(folders[0] / DAYS)
    rules = setup.rules.spec
    wanted = METRICS[rules.metric]
    for folder in (inner for each in folders for inner in result_folders(each)):
        there = METRICS[read_document(folder / "certificate.json").metric.name]
        if there != wanted:
            texts = [f"{each.symbol} {each.unit}".rstrip() for each in (there, wanted)]
            raise InputError(str(folder), "metric", texts[0], f"allowed: {texts[1]}")
    kind = {"bat": setup.bat.spec.name, "procedure": setup.rules.text, "rig": setup.rig}
    tests = [each["metric"] for each in earlier_tests(folders, kind)]
    return DailyScatter(
        variance=np.concatenate([each.total for each in tests]),
        dof=np.concatenate([each.dof for each in tests]),
        at_wall=False,
    )


def _of_daily_checks(path: Path) -> DailyScatter:
    table, columns = read_table(path), ["ball_restitution_sd", "ball_restitution_dof"]
    for column in columns:
        if column not in table:
            allowed = "this column is missing; allowed: a table of virtual-lab daily"
            raise InputError(str(path), column, None, allowed)
    require_numbers(table[columns], str(path))
    for column in columns:
        values = table[column].to_numpy(float)
        if (wrong := ~((values > 0) & (values <= MOST))).any():
            row = int(wrong.argmax())
            allowed = f"must be above 0, up to {MOST:g}; see row {row + 1}"
            raise InputError(str(path), column, values[row], allowed)
    deviation, dof = table[columns].to_numpy(float).T
    return DailyScatter(variance=deviation**2, dof=dof, at_wall=True)


def balls_of(history: DailyScatter, bat: str, procedure: str, seed: int) -> dict[Key, str]:
    """Return the procedure's ball with its scatter adapted to the hits of earlier tests.

    With this ball, simulated hits have the same variance as the hits of the earlier tests. The
    result is a dictionary with one entry. Its key is (kind, name) of the ball's data sheet, and its
    value is the text of the sheet. Only the scatter of e0 from hit to hit is changed.

    `history` has the variance of a hit on each day of earlier tests. Raises `InputError` for fewer
    than three days, and if the variances of the days differ significantly.
    """
    rules = TestSetup.of(bat, procedure=procedure).rules
    document = deepcopy(parse_toml(*catalog.source("balls", rules.spec.ball)))
    document["spread"].pop(PLACES["bat"], None)  # one scatter of all hits
    pooled = StandardDeviation(sqrt(history.pooled), float(history.dof.sum()))
    place = "wall" if history.at_wall else "bat"
    (scatter,) = adapted_scatters(document, {place: pooled}, bat, rules, seed).values()
    adapted = with_scatter(document, {"wall": scatter.value}, "history")
    return {("balls", rules.spec.ball): toml_text(adapted)}
