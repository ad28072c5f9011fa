"""The twin of a laboratory: days played from its records, to check its stated uncertainty.

Each day has the bat, the balls and the scatter that the records state, and other errors of the
calibration constants within their stated uncertainties. The study reads records only, never a
sealed truth.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import Certification
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.style import as_drawn, figure_file
from virtual_lab.output.tables import column, record, table_text
from virtual_lab.parameters import Folder, Seed
from virtual_lab.records.session import SESSION
from virtual_lab.studies.foreign import certify_folder
from virtual_lab.studies.twin.days import SIDE_BY_SIDE, TwinDays, scattered_as_stated
from virtual_lab.studies.twin.statement import stated_by
from virtual_lab.units import Array

RECORDS = "records"  # folder of the records in a result folder
TOLERANCE = 0.1  # largest harmless error of a stated u: that of its coverage is then below 2 %
FEWEST = 100  # smallest number of days; their standard deviation then has an error of 7 %
WORDS = (
    "Twin: the day played again with the bat, balls and instruments that the records state.\n"
    "Error: result of such a day minus the stated value. SI: unit of the quantity, 1 or m/s."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinQuantity:
    """The stated uncertainty of one quantity beside the errors of the twin's days."""

    quantity: str = column("quantity")
    value: float = column("value", "SI", ".5g")
    u: float = column("stated u", "SI", ".3g")
    sd: float = column("sd of the errors", "SI", ".3g")
    low: float = column("  at least", "SI", ".3g")  # 95 % interval of the standard deviation
    high: float = column("  at most", "SI", ".3g")
    ratio: float = column("u / sd", form=".3f")
    bias: float = column("mean error", "u", "+.3f")
    bias_se: float = column("  its standard error", "u", ".3f")
    finding: str = column("stated u")

    @classmethod
    def of(cls, quantity: str, value: float, u: float, errors: Array) -> TwinQuantity:
        """Return the row of a quantity from the errors of the days, (day,)."""
        sd, dof = float(errors.std(ddof=1)), errors.size - 1
        low, high = (sd * float(np.sqrt(dof / chi2.ppf(p, dof))) for p in (0.975, 0.025))
        finding = "right"
        if u < low * (1 - TOLERANCE):
            finding = "too small"
        elif u > high * (1 + TOLERANCE):
            finding = "too large"
        return cls(
            quantity=quantity,
            value=value,
            u=u,
            sd=sd,
            low=low,
            high=high,
            ratio=u / sd,
            bias=float(errors.mean()) / u,
            bias_se=sd / u / float(np.sqrt(errors.size)),
            finding=finding,
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Twin(StudyResult):
    """A laboratory beside its twin."""

    bat: str
    procedure: str
    days: int  # number of days whose instruments write sums
    invalid: int  # number of these days without a valid result
    rows: list[TwinQuantity]

    name = "twin"

    @property
    def title(self) -> str:
        """Title with bat, procedure and number of days."""
        return f"{self.bat} by {self.procedure}, beside {self.days} days of its twin"

    @property
    def text(self) -> str:
        """The tables, with the words beneath them."""
        days = f"{self.invalid} of the {self.days} days were INVALID and are left out."
        return "\n\n".join([self.title, table_text(self.rows), f"{WORDS}\n{days}"])

    @property
    def document(self) -> Json:
        """The result for JSON."""
        return {
            "bat": self.bat,
            "procedure": self.procedure,
            "days": self.days,
            "invalid": self.invalid,
            "quantities": [dict(record(row)) for row in self.rows],
        }

    def draw(self, path: Path) -> None:
        """Draw the stated u of each quantity over the standard deviation of its errors."""
        names = [row.quantity.replace("_", " ") for row in self.rows]
        with figure_file(path, 2.4) as figure:
            axes = figure.subplots()
            figure.suptitle(as_drawn(self.title), fontsize=8)
            ratio = np.array([row.ratio for row in self.rows])
            ends = np.array([(row.u / row.high, row.u / row.low) for row in self.rows])
            spread = np.abs(ends.T - ratio)
            axes.errorbar(ratio, names, xerr=spread, capsize=3, fmt="ok", markersize=3)
            axes.axvline(1, color="0.5", linewidth=0.6)
            axes.set(xlabel="stated $u$ / standard deviation of the twin's errors", ymargin=0.1)
            axes.invert_yaxis()


def twin(folder: Folder, *, days: int = 1000, seed: Seed = 1, progress: Progress = quiet) -> Twin:
    """Play a laboratory's day again as its records state it, and check its uncertainty.

    The table has one row per quantity, the metric first: the stated u beside the standard deviation
    of the errors of many days. Records are read, but never a sealed truth.

    Parameters
    ----------
    folder
        Result folder of ``certify``, its folder ``records``, or the folder of another laboratory
        with its ``laboratory.toml``.
    days
        Number of days; at least 100.
    seed
        Seed of the days.
    progress
        Function that is called with the number of days played and in total.

    Raises
    ------
    InputError
        A folder whose records cannot be used or give no result, whose readings do not repeat or
        are all equal, or whose rigs are not installed here.
    """
    if days < FEWEST:
        raise InputError("", "days", days, f"allowed: at least {FEWEST}")
    certification = certify_records(Path(folder))
    playing = scattered_as_stated(stated_by(certification), seed)
    rows, invalid = summed_days(certification, playing, days, progress)
    return Twin(
        bat=certification.session.bat,
        procedure=certification.procedure.name,
        days=days,
        invalid=invalid,
        rows=rows,
    )


def certify_records(folder: Path) -> Certification:
    """Return the certification of a result folder's records, or of a folder of records."""
    inner = folder / RECORDS
    return certify_folder(inner if (inner / SESSION).exists() else folder, lambda each: each)


def summed_days(
    certification: Certification, playing: TwinDays, days: int, progress: Progress = quiet
) -> tuple[list[TwinQuantity], int]:
    """Return one row per quantity, and the number of days without a valid result."""
    assert certification.metric is not None
    stated = {"metric": certification.metric, **certification.quantities}
    errors: dict[str, list[Array]] = {name: [] for name in stated}
    played = 0
    for block in playing.blocks(days, first=SIDE_BY_SIDE):  # after the days that give the scatter
        sound = block.sound
        for name, parts in errors.items():
            error = block.certified.results[name].value - block.measurands[name]
            parts.append(error[sound])
        played += sound.size
        progress("days", played, days)
    valid = sum(part.size for part in errors["metric"])
    if valid < days / 2:
        allowed = f"only {valid} of {days} days of its twin give a valid result; needs half of them"
        raise InputError("", "folder", None, allowed)
    rows = [
        TwinQuantity.of(name, budget.value, budget.u, np.concatenate(errors[name]))
        for name, budget in stated.items()
    ]
    return rows, days - valid
