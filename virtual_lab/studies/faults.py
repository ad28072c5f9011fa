"""Simulated faults of a test day: their detection and bias, compared with predictions.

Each laboratory is simulated twice with the same random numbers, with and without the fault, so the
difference is the effect of the fault alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from virtual_lab import catalog
from virtual_lab.catalog.faults import FaultSheet, Prediction
from virtual_lab.errors import InputError
from virtual_lab.lab import RoundRobin, TestSetup
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.output.intervals import Interval, draw_intervals
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.tables import column
from virtual_lab.parameters import AnyLaboratory, Seed, TwoOrMore
from virtual_lab.sheets import (
    AnyBat,
    AnyProcedures,
    Faults,
    Instruments,
    entry_name,
    entry_names,
    words_of,
)
from virtual_lab.uncertainty.estimate import share_interval

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

PROCEDURES = ("astm-f1881", "bbcor")


def _share(row: FaultOutcome) -> str:
    return f"{row.detected:.0%} ({row.detected_low:.0%} to {row.detected_high:.0%})"


def _bias_text(bias: Bias) -> str:
    if bias.bias is None:
        return ""
    measured = f"{bias.bias:+.5f} ± {bias.bias_se:.5f}"
    if bias.z is None:
        return measured
    return f"{measured}, predicted {bias.predicted:+.5f}, z {bias.z:+.1f}"


def _outcome(row: FaultOutcome) -> str:
    return "as predicted" if row.as_predicted else "NOT as predicted"


@dataclass(frozen=True, slots=True)
class Bias:
    """Bias of a result: mean over laboratories, its standard error, and the prediction.

    All fields are None if fewer than two laboratories have the result.
    """

    bias: float | None = None
    bias_se: float | None = None
    predicted: float | None = None
    z: float | None = None  # bias minus prediction [combined standard uncertainties]

    @classmethod
    def of(
        cls, differences: NDArray[np.float64], predicted: float | None, trust: float | None
    ) -> Bias:
        """Return the bias, which is the mean of `differences`, shape (laboratory,).

        `predicted` is the prediction and `trust` its standard uncertainty. NaN is left out.
        """
        finite = differences[np.isfinite(differences)]
        if finite.size < 2:
            return cls()
        bias, error = float(finite.mean()), float(finite.std(ddof=1)) / sqrt(finite.size)
        z = None
        if predicted is not None and trust is not None:
            z = (bias - predicted) / hypot(error, trust)
        return cls(bias, error, predicted, z)

    @property
    def near(self) -> bool:
        """Whether bias and prediction differ by at most 3 u; False without a prediction."""
        return self.z is not None and abs(self.z) <= 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultOutcome:
    """Outcome of a fault in tests by a procedure. The fault ``none`` is a day without a fault.

    A laboratory detects a fault by a flag or by the verdict INVALID. `detected_low` and
    `detected_high` are the limits of the share of such laboratories (95 %, Clopper-Pearson). The
    bias of the metric is in `unit`, its SI unit.
    """

    procedure: str = column("procedure")
    fault: str = column("fault")
    prediction: str = column("predicted")
    laboratories: int
    detected: float = column("detected", "of laboratories", _share)
    detected_low: float
    detected_high: float
    detected_by: str = column("detected by")
    collision_efficiency: Bias = column(
        "bias of e_A", form=lambda row: _bias_text(row.collision_efficiency)
    )
    unit: str
    metric: Bias = column("bias of the metric", "SI", lambda row: _bias_text(row.metric))
    as_predicted: bool = column("outcome", form=_outcome)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FaultTable(Rows[FaultOutcome]):
    """Outcomes of faults in tests by procedures."""

    def draw(self) -> PageFigure:
        """Draw the fraction of laboratories that detect each fault, with its limits."""
        return draw_intervals(
            [
                Interval(
                    f"{row.fault}, {row.procedure}",
                    row.detected,
                    row.detected_low,
                    row.detected_high,
                    not row.as_predicted,
                )
                for row in self.rows
            ],
            self.title,
            "fraction of laboratories that detect the fault (bars: 95 % limits)",
            hollow="not as predicted",
        )


@dataclass(frozen=True, slots=True)
class _Detection:
    """Signs of a fault in one laboratory, and the results on its certificate."""

    catches: tuple[str, ...]
    efficiency: float
    metric: float


def faults(
    names: Faults = (),
    *,
    bat: AnyBat = "r161",
    procedures: AnyProcedures = (),
    laboratories: TwoOrMore = 60,
    seed: Seed = 1,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> FaultTable:
    """Show which faults are noticed.

    Each fault is simulated in many laboratories. Detection and bias are compared with predictions,
    which are those for the laboratory of the catalog.

    Parameters
    ----------
    names
        Faults of the catalog. By default all.
    bat
        The bat: a name in the catalog or a .toml file.

        Or a sheet, ``vl.bat("r161")``, whose values may be changed.
    procedures
        Test procedure: a name in the catalog or a .toml file. By default all procedures with
        predictions of the faults.

        In Python, a sheet such as ``vl.procedure("bbcor")``, or a list, is also allowed.
    laboratories
        Number of simulated laboratories, each with other balls and calibration errors.
    seed
        Seed of the study. The laboratories are numbered from 0. The seed and this number identify a
        laboratory.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with three arguments: a message with the names of the procedure and
        the fault, the number of laboratories done, and the total number of laboratories. If it is
        not given, the functions of `virtual_lab` and the commands show the progress on stderr.

    Returns
    -------
    FaultTable
        Table with one row per procedure and fault. The first row of a procedure is a day without a
        fault.

    Raises
    ------
    InputError
        A name is unknown, or a procedure or fault has no prediction.
    """
    names, bat, procedures = words_of(names), entry_name(bat), entry_names(procedures)
    sheets = [
        catalog.load("faults", name, FaultSheet).spec for name in names or catalog.names("faults")
    ]
    for procedure in procedures:
        catalog.text("procedures", procedure)
    if procedures:
        _require_predictions(sheets, procedures)
    rows = []

    def run_laboratories(label: str, *fault_names: str) -> list[_Detection]:
        shared = RoundRobin.with_common_model(
            TestSetup.of(bat, procedure=procedure, faults=fault_names)
        )
        outcomes: list[_Detection] = []
        for tested in shared.run(laboratories, seed):
            progress(f"{procedure}, {label}: laboratories", len(outcomes), laboratories)
            outcomes.append(_detect(tested.certification))
        return outcomes

    for procedure in procedures or PROCEDURES:
        predicted = {
            sheet.name: prediction
            for sheet in sheets
            for prediction in sheet.predictions
            if prediction.procedure == procedure
        }
        if not predicted:
            continue
        sound = run_laboratories("no fault")
        rows.append(_row("none", procedure, None, sound, sound))
        for name, prediction in predicted.items():
            rows.append(_row(name, procedure, prediction, run_laboratories(name, name), sound))
    title = f"faults of a real day, {laboratories} laboratories each"
    return FaultTable(name="faults", title=title, rows=rows)


def _require_predictions(sheets: Sequence[FaultSheet], procedures: Sequence[str]) -> None:
    """Raise `InputError` if a procedure or a fault has no prediction."""
    able = {sheet.name: {each.procedure for each in sheet.predictions} for sheet in sheets}
    predicted = set().union(*able.values())
    for procedure in procedures:
        if procedure not in predicted:
            allowed = f"these faults have predictions for {', '.join(sorted(predicted))}"
            raise InputError("", "procedure", procedure, allowed)
    for fault, predicted_for in able.items():
        if not predicted_for & set(procedures):
            allowed = f"the fault has predictions only for {', '.join(sorted(predicted_for))}"
            raise InputError("", "fault", fault, f"{allowed}, not for {', '.join(procedures)}")


def _detect(certification: Certification) -> _Detection:
    metric = certification.metric.value if certification.metric else np.nan
    efficiency = (
        certification.quantities["collision_efficiency"].value if certification.metric else np.nan
    )
    invalid = ("INVALID",) if certification.verdict.value == "INVALID" else ()
    catches = (*invalid, *(flag.name for flag in certification.flags))
    return _Detection(catches=catches, efficiency=efficiency, metric=metric)


def _row(
    fault: str,
    procedure: str,
    prediction: Prediction | None,
    detections: Sequence[_Detection],
    sound: Sequence[_Detection],
) -> FaultOutcome:
    """Return the outcome of a fault. Without a `prediction` it is the day without a fault."""
    many = sum(bool(each.catches) for each in detections)
    low, high = share_interval(many, len(detections))
    by = Counter(catch for each in detections for catch in each.catches)
    if prediction is None:
        predicted, e_A, metric = "at most 1%", Bias(), Bias()
        as_predicted = low <= 0.01
    else:
        predicted = prediction.caught_by or "a bias"
        both = list(zip(detections, sound, strict=True))
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
        caught = float(np.mean([bool(named & set(each.catches)) for each in detections])) >= 0.95
        as_predicted = caught if prediction.caught_by else e_A.near and metric.near
    rules = catalog.load("procedures", procedure, Procedure).spec
    return FaultOutcome(
        procedure=procedure,
        fault=fault,
        prediction=predicted,
        laboratories=len(detections),
        detected=many / len(detections),
        detected_low=low,
        detected_high=high,
        detected_by=", ".join(f"{catch} {number}" for catch, number in by.most_common()),
        collision_efficiency=e_A,
        unit=METRICS[rules.metric].si_unit,
        metric=metric,
        as_predicted=as_predicted,
    )
