"""A campaign in a few numbers: a row for each bat, procedure and change."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from virtual_lab.campaigns.parts import Block, parquet
from virtual_lab.campaigns.study import StudyCase
from virtual_lab.output.tables import Column
from virtual_lab.units import Array

SUMMARY_WORDS = (
    "Of the metric, in tests that are not INVALID. sd: standard deviation, and that within a\n"
    "laboratory, from day to day. u: as stated. Error: measured minus true value. Coverage: 95 %\n"
    "intervals with the true value, and its own 95 % confidence interval (Clopper-Pearson)."
)
READ = ["verdict", "flags", "metric", "u", "low", "high", "true"]


def _counts(key: str) -> Any:
    return lambda row: ", ".join(f"{name} {value}" for name, value in row[key].items())


SUMMARY_COLUMNS = {
    "bat": Column("bat"),
    "procedure": Column("procedure"),
    "change": Column("changed", form=_counts("change")),
    "tests": Column("tests"),
    "missing": Column("not made"),
    "verdicts": Column("verdicts", form=_counts("verdicts")),
    "mean": Column("mean", "SI", ".6g"),
    "sd": Column("sd", "SI", ".3g"),
    "sd_within": Column("sd within", "SI", ".3g"),
    "rms_u": Column("rms u", "SI", ".3g"),
    "bias": Column("mean error", "SI", "+.1e"),
    "bias_se": Column("its se", "SI", ".1e"),
    "coverage": Column("coverage", form=".2%"),
    "coverage_low": Column("at least", form=".2%"),
    "coverage_high": Column("at most", form=".2%"),
}


def summary_of(
    case: StudyCase, parts: Path, states: Iterable[tuple[Block, str, str]]
) -> dict[str, Any]:
    """Return the row of a case from its parts, one after another; SI.

    `states` are its blocks, in order, each with what is wrong with its part: then its tests count
    as missing. A number that too few tests give is None.
    """
    verdicts, flags = Counter[str](), Counter[str]()
    missing, about, sums = 0, np.nan, np.zeros(9)
    for _, days in groupby(states, key=lambda each: each[0].first):
        of_days: list[Array] = []
        for block, wrong, _ in days:
            if wrong:
                missing += block.rows
                continue
            table = parquet().read_table(parts / block.name, columns=READ)
            verdict, flagged, *numbers = (one.to_numpy() for one in table.columns)
            verdicts.update(verdict.tolist())
            flags.update(name for words in flagged.tolist() for name in words.split())
            sound = verdict != "INVALID"
            metric, u, low, high, true = (one[sound] for one in numbers)
            if np.isnan(about) and metric.size:
                about = float(metric[0])  # sums of squares about it lose no digits
            off, error = metric - about, metric - true
            terms = (off, off**2, u**2, error, error**2, true > high, true < low)
            sums[:7] += [np.sum(term) for term in terms]
            of_days.append(np.where(sound, numbers[0] - about, np.nan))
        sums[7:] += _within(of_days)
    tests = verdicts.total()
    return {
        **{"bat": case.bat, "procedure": case.procedure, "change": dict(case.change)},
        **{"tests": tests, "missing": missing, "verdicts": _sorted(verdicts)},
        **{"flags": _sorted(flags), **_statistics(tests - verdicts["INVALID"], about, sums)},
    }


def _sorted(counts: Counter[str]) -> dict[str, int]:
    return dict(sorted(counts.items()))


def _within(of_days: Sequence[Array]) -> tuple[float, float]:
    """Return the sum of squares about each laboratory's own mean, and its degrees of freedom."""
    if not of_days:
        return 0.0, 0.0
    some = np.isfinite(of_days)
    many, values = np.maximum(some.sum(axis=0), 1), np.where(some, of_days, 0.0)
    off = np.where(some, values - values.sum(axis=0) / many, 0.0)
    return float(np.sum(off**2)), float(np.sum(many - 1))


def _statistics(count: int, about: float, sums: Array) -> dict[str, float | None]:
    """Return the columns that the sums over `count` tests give."""
    from scipy.stats import binomtest  # half a second to load, which no worker needs

    with np.errstate(divide="ignore", invalid="ignore"):
        off, square, u, error, own, above, below = sums[:7] / count
        freedom = count - 1
        held = count - int(sums[5] + sums[6])
        bounds = binomtest(held, count).proportion_ci(0.95, "exact") if count else (np.nan, np.nan)
        found = {
            "mean": about + off,
            "sd": np.sqrt((square - off**2) * count / freedom),
            "sd_within": np.sqrt(sums[7] / sums[8]),
            "rms_u": np.sqrt(u),
            "bias": error,
            "bias_se": np.sqrt((own - error**2) / freedom),
            "coverage": np.divide(held, count),
            "coverage_low": bounds[0],
            "coverage_high": bounds[1],
            "above": above,
            "below": below,
        }
    return {name: float(one) if np.isfinite(one) else None for name, one in found.items()}
