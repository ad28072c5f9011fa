"""Faults of a real day, played: caught as predicted, or leaving the bias that was predicted.

Every laboratory is played twice from the same seed, sound and with the fault, so a bias is that
of one day against the same day, and chance does not blur it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import hypot, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from virtual_lab import catalog
from virtual_lab.catalog.faults import FaultSheet, Prediction
from virtual_lab.errors import InputError
from virtual_lab.lab import TestSetup, certify_bat
from virtual_lab.measurement.certification import Certification
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.tables import Column

__all__ = ["PROCEDURES", "faults"]

PROCEDURES = ("astm-f1881", "bbcor")
CAUGHT = 0.95  # of the laboratories, at least
FALSE_ALARMS = 0.01  # of the sound ones, at most
FAR = 3.0  # standard uncertainties
RESULTS = ("e_A", "metric")
PARTS = ("bias", "bias_se", "predicted", "z")


def _share(row: Mapping[str, Any]) -> str:
    return f"{row['caught']:.0%} ({row['low']:.0%} to {row['high']:.0%})"


def _bias_text(row: Mapping[str, Any], what: str) -> str:
    if row[f"{what}_bias"] is None:
        return ""
    measured = f"{row[f'{what}_bias']:+.5f} ± {row[f'{what}_bias_se']:.5f}"
    if row[f"{what}_z"] is None:
        return measured
    return f"{measured}, predicted {row[f'{what}_predicted']:+.5f}, z {row[f'{what}_z']:+.1f}"


COLUMNS = {
    "procedure": Column("procedure"),
    "fault": Column("fault"),
    "prediction": Column("predicted"),
    "caught": Column("caught", "of the laboratories", _share),
    "by": Column("by"),
    "e_A_bias": Column("bias of e_A", form=lambda row: _bias_text(row, "e_A")),
    "metric_bias": Column("bias of the metric", "SI", lambda row: _bias_text(row, "metric")),
    "as_predicted": Column(
        "came out",
        form=lambda row: "as predicted" if row["as_predicted"] else "NOT as predicted",
    ),
}


@dataclass(frozen=True, slots=True)
class _Seen:
    """What the operator of one laboratory sees, and the numbers on the certificate."""

    catches: tuple[str, ...]
    efficiency: float
    metric: float


def faults(
    names: Sequence[str] = (),
    *,
    bat: str = "r161",
    procedures: Sequence[str] = (),
    laboratories: int = 60,
    seed: int = 1,
    progress: Progress = quiet,
) -> Rows:
    """Play faults in many laboratories and hold what comes of them against what was predicted.

    Parameters
    ----------
    names
        Faults in the catalog; none: every one.
    bat, procedures
        Names in the catalog; no procedures: all that the faults have predictions for.
    laboratories, seed
        How many seeds, and the first.
    progress
        Called with which fault is played, and where.

    Returns
    -------
    Rows
        A row a procedure and fault, the sound day first (``fault`` is ``none``): the share of
        the laboratories that caught it (a flag, or the verdict INVALID) with its Clopper-Pearson
        95 % interval and `by` what; bias of e_A and of the metric with their Monte Carlo
        standard errors, what was predicted, and `z` of the difference in standard uncertainties
        of both; and whether it came out `as predicted`.

    Raises
    ------
    InputError
        Unknown names, fewer than 2 laboratories, a procedure that no fault is predicted for, or
        a fault that is predicted for none of the procedures.
    """
    if laboratories < 2:
        raise InputError("", "laboratories", laboratories, "allowed: 2 and more")
    sheets = [catalog.load("faults", name, FaultSheet).spec for name in names or _every()]
    for procedure in procedures:
        catalog.find("procedures", procedure)
    if procedures:
        _require_played(sheets, procedures)
    seeds = range(seed, seed + laboratories)
    rows = []

    def counted(what: str) -> Iterator[int]:
        for number, each in enumerate(seeds):
            progress(f"{procedure}, {what}: laboratories", number, laboratories)
            yield each

    for procedure in procedures or PROCEDURES:
        predicted = {
            sheet.name: prediction
            for sheet in sheets
            for prediction in sheet.predictions
            if prediction.procedure == procedure
        }
        if not predicted:
            continue
        sound = [_play(bat, procedure, each, ()) for each in counted("no fault")]
        rows.append(_sound_row(procedure, sound))
        for name, prediction in predicted.items():
            spoiled = [_play(bat, procedure, each, (name,)) for each in counted(name)]
            rows.append(_row(name, prediction, spoiled, sound))
    title = f"faults of a real day, {laboratories} laboratories each"
    return Rows(name="faults", title=title, columns=COLUMNS, rows=rows)


def _require_played(sheets: Sequence[FaultSheet], procedures: Sequence[str]) -> None:
    """Refuse faults and procedures of which nothing would be played."""
    able = {sheet.name: {each.procedure for each in sheet.predictions} for sheet in sheets}
    for fault, own in able.items():
        if not own & set(procedures):
            allowed = f"it has predictions for {', '.join(sorted(own))}"
            raise InputError("", "fault", fault, f"{allowed}, not for {', '.join(procedures)}")
    known = set().union(*able.values())
    for procedure in procedures:
        if procedure not in known:
            allowed = f"these faults have predictions for {', '.join(sorted(known))}"
            raise InputError("", "procedure", procedure, allowed)


def _every() -> tuple[str, ...]:
    return catalog.names("faults")


def _play(bat: str, procedure: str, seed: int, on: tuple[str, ...]) -> _Seen:
    found = certify_bat(TestSetup.of(bat, procedure=procedure, seed=seed, faults=on)).certification
    metric = found.metric.value if found.metric else np.nan
    efficiency = found.quantities["collision_efficiency"].value if found.metric else np.nan
    return _Seen(catches=_catches(found), efficiency=efficiency, metric=metric)


def _catches(found: Certification) -> tuple[str, ...]:
    invalid = ("INVALID",) if found.verdict.value == "INVALID" else ()
    return (*invalid, *(flag.name for flag in found.flags))


def _sound_row(procedure: str, sound: Sequence[_Seen]) -> dict[str, Any]:
    caught = _caught("none", procedure, f"at most {FALSE_ALARMS:.0%}", sound)
    blank = {f"{what}_{part}": None for what in RESULTS for part in PARTS}
    return caught | blank | {"as_predicted": caught["low"] <= FALSE_ALARMS}


def _row(
    name: str, prediction: Prediction, spoiled: Sequence[_Seen], sound: Sequence[_Seen]
) -> dict[str, Any]:
    words = prediction.caught_by or "a bias"
    row = _caught(name, prediction.procedure, words, spoiled)
    both = list(zip(spoiled, sound, strict=True))
    efficiency = np.array([each.efficiency - twin.efficiency for each, twin in both])
    metric = np.array([each.metric - twin.metric for each, twin in both])
    row |= _bias("e_A", efficiency, prediction.efficiency_bias, prediction.efficiency_bias_u)
    row |= _bias("metric", metric, prediction.metric_bias, prediction.metric_bias_u)
    if prediction.caught_by:
        named = set(prediction.caught_by.split(", "))
        share = np.mean([bool(named & set(each.catches)) for each in spoiled])
        return row | {"as_predicted": bool(share >= CAUGHT)}
    near = [row[f"{what}_z"] is not None and abs(row[f"{what}_z"]) <= FAR for what in RESULTS]
    return row | {"as_predicted": all(near)}


def _caught(name: str, procedure: str, predicted: str, seen: Sequence[_Seen]) -> dict[str, Any]:
    many = sum(bool(each.catches) for each in seen)
    interval = binomtest(many, len(seen)).proportion_ci(0.95, "exact")
    by = Counter(catch for each in seen for catch in each.catches)
    return {
        "procedure": procedure,
        "fault": name,
        "prediction": predicted,
        "laboratories": len(seen),
        "caught": many / len(seen),
        "low": float(interval.low),
        "high": float(interval.high),
        "by": ", ".join(f"{catch} {number}" for catch, number in by.most_common()),
    }


def _bias(
    what: str, differences: NDArray[np.float64], predicted: float | None, trust: float | None
) -> dict[str, Any]:
    known = differences[np.isfinite(differences)]
    if known.size < 2:
        return {f"{what}_{part}": None for part in PARTS}
    bias, error = float(known.mean()), float(known.std(ddof=1)) / sqrt(known.size)
    z = None
    if predicted is not None and trust is not None:
        z = (bias - predicted) / hypot(error, trust)
    return {
        f"{what}_bias": bias,
        f"{what}_bias_se": error,
        f"{what}_predicted": predicted,
        f"{what}_z": z,
    }
