"""Simulated faults of a test day: detection and bias compared with predictions.

Every laboratory is simulated twice with the same random numbers, with and without the fault, so
the difference is the effect of the fault and not of chance.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from virtual_lab import catalog
from virtual_lab.catalog.faults import FaultSheet, Prediction
from virtual_lab.errors import InputError
from virtual_lab.lab import RoundRobin, TestSetup
from virtual_lab.measurement.certification import Certification
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.tables import column
from virtual_lab.parameters import Seed
from virtual_lab.sheets import (
    AnyBat,
    AnyProcedures,
    Faults,
    Instruments,
    entry_name,
    entry_names,
    words_of,
)

PROCEDURES = ("astm-f1881", "bbcor")


def _share(row: FaultOutcome) -> str:
    return f"{row.caught:.0%} ({row.low:.0%} to {row.high:.0%})"


def _bias_text(found: Bias) -> str:
    if found.bias is None:
        return ""
    measured = f"{found.bias:+.5f} ± {found.bias_se:.5f}"
    if found.z is None:
        return measured
    return f"{measured}, predicted {found.predicted:+.5f}, z {found.z:+.1f}"


def _outcome(row: FaultOutcome) -> str:
    return "as predicted" if row.as_predicted else "NOT as predicted"


@dataclass(frozen=True, slots=True)
class Bias:
    """Bias of a result: mean over laboratories, its standard error, and the prediction.

    All None if fewer than two laboratories have the result.
    """

    bias: float | None = None
    bias_se: float | None = None
    predicted: float | None = None
    z: float | None = None  # bias minus prediction [combined standard uncertainties]

    @classmethod
    def of(
        cls, differences: NDArray[np.float64], predicted: float | None, trust: float | None
    ) -> Bias:
        """Return the bias of differences, (laboratory,), with a prediction and its u."""
        known = differences[np.isfinite(differences)]
        if known.size < 2:
            return cls()
        bias, error = float(known.mean()), float(known.std(ddof=1)) / sqrt(known.size)
        z = None
        if predicted is not None and trust is not None:
            z = (bias - predicted) / hypot(error, trust)
        return cls(bias, error, predicted, z)

    @property
    def near(self) -> bool:
        """Whether the bias agrees with the prediction."""
        return self.z is not None and abs(self.z) <= 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultOutcome:
    """Outcome of a fault in tests by a procedure; fault ``none`` is a day without one.

    A laboratory detects (catches) a fault by a flag or by the verdict INVALID; `low` and `high`
    bound the fraction of such laboratories (Clopper-Pearson).
    """

    procedure: str = column("procedure")
    fault: str = column("fault")
    prediction: str = column("predicted")
    laboratories: int
    caught: float = column("detected", "of laboratories", _share)
    low: float
    high: float
    by: str = column("detected by")
    e_A: Bias = column("bias of e_A", form=lambda row: _bias_text(row.e_A))
    metric: Bias = column("bias of the metric", "SI", lambda row: _bias_text(row.metric))
    as_predicted: bool = column("outcome", form=_outcome)


@dataclass(frozen=True, slots=True)
class _Seen:
    """Flags that the operator of one laboratory sees, and the numbers on the certificate."""

    catches: tuple[str, ...]
    efficiency: float
    metric: float


def faults(
    names: Faults = (),
    *,
    bat: AnyBat = "r161",
    procedures: AnyProcedures = (),
    laboratories: int = 60,
    seed: Seed = 1,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> Rows[FaultOutcome]:
    """Simulate faults in many laboratories, and compare detection and bias with predictions.

    Parameters
    ----------
    names
        Faults of the catalog. By default all.
    bat
        The bat: a name in the catalog or a .toml file.

        Or a sheet, ``vl.bat("r161")``, whose values may be changed.
    procedures
        Test procedure: a name in the catalog or a .toml file. By default all with predictions of
        the faults.

        Or a sheet, or a list of several.
    laboratories
        Number of simulated laboratories, each with other balls and calibration errors.
    seed
        Seed of the study; its laboratories are taken by number, from 0.
    instruments
        Instruments and rigs with changed values, in place of those of the catalog.

        Sheets: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with the fault and the procedure that are simulated.

    Returns
    -------
    Rows
        One row per procedure and fault, the sound day first.

    Raises
    ------
    InputError
        Unknown names, fewer than 2 laboratories, a procedure that no fault is predicted for, or
        a fault that is predicted for none of the procedures.
    """
    names, bat, procedures = words_of(names), entry_name(bat), entry_names(procedures)
    if laboratories < 2:
        raise InputError("", "laboratories", laboratories, "allowed: 2 and more")
    sheets = [
        catalog.load("faults", name, FaultSheet).spec for name in names or catalog.names("faults")
    ]
    for procedure in procedures:
        catalog.text("procedures", procedure)
    if procedures:
        _require_played(sheets, procedures)
    rows = []

    def played(what: str, *on: str) -> list[_Seen]:
        shared = RoundRobin.shared(TestSetup.of(bat, procedure=procedure, faults=on))
        found: list[_Seen] = []
        for tested in shared.run(laboratories, seed):
            progress(f"{procedure}, {what}: laboratories", len(found), laboratories)
            found.append(_seen(tested.certification))
        return found

    for procedure in procedures or PROCEDURES:
        predicted = {
            sheet.name: prediction
            for sheet in sheets
            for prediction in sheet.predictions
            if prediction.procedure == procedure
        }
        if not predicted:
            continue
        sound = played("no fault")
        rows.append(_row("none", procedure, None, sound, sound))
        for name, prediction in predicted.items():
            rows.append(_row(name, procedure, prediction, played(name, name), sound))
    title = f"faults of a real day, {laboratories} laboratories each"
    return Rows(name="faults", title=title, rows=rows)


def _require_played(sheets: Sequence[FaultSheet], procedures: Sequence[str]) -> None:
    """Refuse faults and procedures for which there is nothing to simulate."""
    able = {sheet.name: {each.procedure for each in sheet.predictions} for sheet in sheets}
    known = set().union(*able.values())
    for procedure in procedures:
        if procedure not in known:
            allowed = f"these faults have predictions for {', '.join(sorted(known))}"
            raise InputError("", "procedure", procedure, allowed)
    for fault, own in able.items():
        if not own & set(procedures):
            allowed = f"it has predictions for {', '.join(sorted(own))}"
            raise InputError("", "fault", fault, f"{allowed}, not for {', '.join(procedures)}")


def _seen(found: Certification) -> _Seen:
    metric = found.metric.value if found.metric else np.nan
    efficiency = found.quantities["collision_efficiency"].value if found.metric else np.nan
    invalid = ("INVALID",) if found.verdict.value == "INVALID" else ()
    catches = (*invalid, *(flag.name for flag in found.flags))
    return _Seen(catches=catches, efficiency=efficiency, metric=metric)


def _row(
    fault: str,
    procedure: str,
    prediction: Prediction | None,
    seen: Sequence[_Seen],
    sound: Sequence[_Seen],
) -> FaultOutcome:
    """Return the outcome of a fault, or without a prediction of the sound day."""
    many = sum(bool(each.catches) for each in seen)
    interval = binomtest(many, len(seen)).proportion_ci(0.95, "exact")
    by = Counter(catch for each in seen for catch in each.catches)
    if prediction is None:
        predicted, e_A, metric = "at most 1%", Bias(), Bias()
        right = bool(interval.low <= 0.01)
    else:
        predicted = prediction.caught_by or "a bias"
        both = list(zip(seen, sound, strict=True))
        e_A = Bias.of(
            np.array([each.efficiency - twin.efficiency for each, twin in both]),
            prediction.efficiency_bias,
            prediction.efficiency_bias_u,
        )
        metric = Bias.of(
            np.array([each.metric - twin.metric for each, twin in both]),
            prediction.metric_bias,
            prediction.metric_bias_u,
        )
        named = set((prediction.caught_by or "").split(", "))
        caught = float(np.mean([bool(named & set(each.catches)) for each in seen])) >= 0.95
        right = caught if prediction.caught_by else e_A.near and metric.near
    return FaultOutcome(
        procedure=procedure,
        fault=fault,
        prediction=predicted,
        laboratories=len(seen),
        caught=many / len(seen),
        low=float(interval.low),
        high=float(interval.high),
        by=", ".join(f"{catch} {number}" for catch, number in by.most_common()),
        e_A=e_A,
        metric=metric,
        as_predicted=right,
    )
