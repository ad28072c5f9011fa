"""Summary of a campaign: one row per combination of bat, procedure and changed settings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from virtual_lab.campaigns.parts import Part
from virtual_lab.campaigns.study import StudyCase
from virtual_lab.output.tables import Column
from virtual_lab.uncertainty.estimate import share_interval
from virtual_lab.units import Array

SUMMARY_WORDS = """\
Metric in SI, tests that are not INVALID. sd within: from day to day in a laboratory. bias: mean of
measured minus true value, and its standard error. coverage: 95 % intervals with the true value, and
its confidence interval (Clopper-Pearson). CSV and JSON also have true values above and below."""
READ = ["verdict", "flag_names", "value", "u", "low", "high", "true_value"]
VERDICTS = ("PASS", "FAIL", "MEASURED", "INVALID")
STATISTICS = ["mean", "sd", "sd_within", "rms_u", "bias", "bias_se", "coverage"]
STATISTICS += ["coverage_low", "coverage_high", "above", "below"]


def _list_counts(kind: str) -> Callable[[Mapping[str, Any]], str]:
    """Return a function of a row that lists its counts above 0 of verdicts or flags."""
    return lambda row: ", ".join(
        f"{name.removeprefix(kind)} {count}"
        for name, count in row.items()
        if name.startswith(kind) and count
    )


def summary_columns(changed: Iterable[str]) -> dict[str, Column]:
    """Return the columns of a summary table and their printed form, keyed by column name.

    `changed` lists the column names of the settings that the study changes.
    """
    keys = ["bat", "procedure", *changed, "tests", "missing"]
    return {
        **{key: Column(key.replace(".", " "), form=".5g") for key in keys},
        "verdicts": Column("verdicts", form=_list_counts("verdict_")),
        "flags": Column("flags", form=_list_counts("flag_")),
        "mean": Column("mean", form=".5g"),
        **{key: Column(key.replace("_", " "), form=".3g") for key in STATISTICS[1:-2]},
    }


def with_all_flags(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows of a summary, each with a count for every flag.

    Each flag that occurs in any row gets a count in all rows. The count is 0 in a row without this
    flag.
    """
    names = sorted({name for row in rows for name in row if name.startswith("flag_")})
    plain = [{name: row[name] for name in row if name not in names} for row in rows]
    counts = [{name: row.get(name, 0) for name in names} for row in rows]
    return [one | count for one, count in zip(plain, counts, strict=True)]


def summary_of(
    case: StudyCase, changed: Mapping[str, Any], unit: str, parts: Iterable[Part]
) -> dict[str, Any]:
    """Return the row of one case: numbers of tests, verdicts and flags, and statistics in SI units.

    The tests of a faulty part are counted as missing. A statistic is None if too few tests have a
    result.

    Parameters
    ----------
    case
        Combination of bat, procedure and changed settings.
    changed
        Values of the changed settings keyed by column name.
    unit
        SI unit of the metric; "" for a pure number.
    parts
        Parts of the case, with the content of their files. A part holds the tests of one block of
        laboratories on one day. The parts are sorted by block, then by day.
    """
    verdicts, flags = Counter[str](), Counter[str]()
    missing, about, sums = 0, np.nan, np.zeros(9)
    for _, days in groupby(parts, key=lambda part: part.block.first):
        of_days: list[Array] = []
        for part in days:
            if part.wrong:
                missing += part.block.rows
                continue
            verdict, flagged, *numbers = (one.to_numpy() for one in part.table(READ).columns)
            verdicts.update(verdict.tolist())
            flags.update(name for words in flagged.tolist() for name in words.split())
            sound = verdict != "INVALID"
            metric, u, low, high, true = (one[sound] for one in numbers)
            if np.isnan(about) and metric.size:
                # origin close to the mean, to keep the digits of sums of squares
                about = float(metric[0])
            deviation, error = metric - about, metric - true
            terms = (deviation, deviation**2, u**2, error, error**2, true > high, true < low)
            sums[:7] += [np.sum(term) for term in terms]
            of_days.append(np.where(sound, numbers[0] - about, np.nan))
        sums[7:] += _within(of_days)
    tests = verdicts.total()
    statistics = _statistics(tests - verdicts["INVALID"], about, sums)
    return {
        "bat": case.bat,
        "procedure": case.procedure,
        **changed,
        "tests": tests,
        "missing": missing,
        **{f"verdict_{name}": verdicts[name] for name in VERDICTS},
        "unit": unit,
        **dict(zip(STATISTICS, statistics, strict=True)),
        **{f"flag_{name}": count for name, count in flags.items()},
    }


def _within(of_days: Sequence[Array]) -> tuple[float, float]:
    """Return the sum of squares about the means of the laboratories, and its degrees of freedom.

    `of_days` has one array per day, shape (laboratory,), with NaN for INVALID tests.
    """
    finite = np.isfinite(of_days) & bool(of_days)
    many, values = np.maximum(finite.sum(axis=0), 1), np.where(finite, of_days, 0.0)
    deviation = np.where(finite, values - values.sum(axis=0) / many, 0.0)
    return float(np.sum(deviation**2)), float(np.sum(many - 1))


def _statistics(count: int, about: float, sums: Array) -> list[float | None]:
    """Return the `STATISTICS` [SI] from sums over `count` tests; None for undefined ones."""
    bounds = share_interval(count - int(sums[5] + sums[6]), count) if count else (np.nan, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        deviation, square, u, error, error_square, above, below = sums[:7] / count
        sd, se = (np.array([square - deviation**2, error_square - error**2]) / (count - 1)) ** 0.5
        within, rms_u, covered = (sums[7] / sums[8]) ** 0.5, u**0.5, 1 - above - below
    statistics = [
        about + deviation,
        sd * count**0.5,
        within,
        rms_u,
        error,
        se,
        covered,
        *bounds,
        above,
        below,
    ]
    return [float(one) if np.isfinite(one) else None for one in statistics]
