"""The twin of a laboratory: days simulated from its records, to check what it states.

Each day has the bat, the balls and the scatter that the records state, and other errors of the
calibration constants within their stated uncertainties. The errors of many days show whether the
stated uncertainty is right, and days with every edge and count show which readings are unusual.
The study reads records only, never a sealed truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.files.folders import AnyRecords, Certified
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Json, StudyResult, frame
from virtual_lab.output.style import as_drawn, page_figure
from virtual_lab.output.tables import record, table_text
from virtual_lab.parameters import AnyLaboratory, HundredOrMore, Seed
from virtual_lab.studies.foreign import certify_records, replaced_rigs
from virtual_lab.studies.twin.days import SIDE_BY_SIDE, TwinDays
from virtual_lab.studies.twin.noticing import NoticedFault, noticed_faults
from virtual_lab.studies.twin.quantities import TwinQuantity, compare_quantities
from virtual_lab.studies.twin.readings import LEVEL, TWIN_READINGS, TwinReading, differing_readings
from virtual_lab.studies.twin.statement import Statement

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.output.page_figure import PageFigure

# smallest number of full days with which a reading can be unlike its twins, whatever their number
FEWEST_FULL = round(len(TWIN_READINGS) / LEVEL)
WORDS = (
    "Twin: the day simulated again with the bat, balls and instruments that the records state.\n"
    "Error: result of such a day minus the stated value. SI: unit of the quantity, 1 or m/s."
)
QUIET = (
    "The hits of the records agree better than their instruments and aim make likely; on the days\n"
    "they scatter more."
)
FAULT_WORDS = (
    "Noticed: by a flag, the verdict INVALID, or records that are refused. Sizes are shares of\n"
    "the fault in the catalog; a change of a whole number has its full size at each."
)
READING_WORDS = (
    "Tail probability: share of the days with an equally extreme reading; adjusted for the number\n"
    f"of readings (Holm). Below {LEVEL:g} a reading is unlike its twins. The days end early if\n"
    "more of them could show no such reading."
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Twin(StudyResult):
    """Tables that compare a laboratory with the simulated days of its twin."""

    bat: str
    procedure: str
    days: int  # number of days on which the instruments record only summary values
    invalid: int  # number of these days without a valid result
    rows: list[TwinQuantity]
    full_days: int = 0  # number of days with every edge and count that gave a result
    readings: tuple[TwinReading, ...] = ()  # () without such days
    faults: tuple[NoticedFault, ...] = ()  # faults that the laboratory can have, if requested
    remark: str = ""  # readings in which the days differ from the records

    name = "twin"

    @property
    def smallest(self) -> float:
        """The smallest adjusted tail probability that the number of full days can show."""
        return min(len(self.readings) / (1 + self.full_days), 1.0)

    @property
    def title(self) -> str:
        """Title with bat, procedure and number of days."""
        return f"{self.bat} by {self.procedure}, beside {self.days} days of its twin"

    @property
    def text(self) -> str:
        """The tables, each with an explanation below it."""
        days = f"{self.invalid} of the {self.days} days were INVALID and are left out."
        words = "\n".join(part for part in (WORDS, days, self.remark) if part)
        parts = [self.title, table_text(self.rows), words]
        if self.readings:
            least = f"The smallest that {self.full_days} days can show is {self.smallest:.3f}."
            parts += [table_text(self.readings), f"{READING_WORDS}\n{least}"]
            parts.append("\n".join(f"{row.reading}: {row.meaning}" for row in self.readings))
        if self.faults:
            parts += [table_text(self.faults), FAULT_WORDS]
        return "\n\n".join(parts)

    @property
    def parts(self) -> dict[str, Sequence[Any]]:
        """Rows of the further tables keyed by name, () if they were not requested."""
        return {"readings": self.readings, "faults": self.faults}

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables of the quantities, of the readings and of the faults."""
        others = {f"twin-{name}": frame(rows) for name, rows in self.parts.items() if rows}
        return {self.name: self.table} | others

    @property
    def document(self) -> Json:
        """The result for JSON."""
        numbers = ("bat", "procedure", "days", "invalid", "remark", "full_days")
        tables = {"quantities": self.rows, **self.parts}
        return {
            **{name: getattr(self, name) for name in numbers},
            "smallest_tail": self.smallest if self.readings else None,
            **{name: [dict(record(row)) for row in rows] for name, rows in tables.items()},
        }

    def draw(self) -> PageFigure:
        """Draw the ratio of the stated u to the standard deviation of the errors, and the tails."""
        names = [row.quantity.replace("_", " ") for row in self.rows]
        with page_figure(2.4) as figure:
            panels = figure.subplots(1, 2 if self.readings else 1, squeeze=False)[0]
            axes = panels[0]
            figure.suptitle(as_drawn(self.title), fontsize=8)
            ratio = np.array([row.u_ratio for row in self.rows])
            ends = np.array(
                [(row.u / row.error_sd_high, row.u / row.error_sd_low) for row in self.rows]
            )
            spread = np.abs(ends.T - ratio)
            axes.errorbar(ratio, names, xerr=spread, capsize=3, fmt="ok", markersize=3)
            axes.axvline(1, color="0.5", linewidth=0.6)
            axes.set(xlabel="stated $u$ / standard deviation of the errors", ymargin=0.1)
            axes.invert_yaxis()
            for tails in panels[1:]:
                of_readings = [row.reading for row in self.readings]
                adjusted = [row.adjusted_probability for row in self.readings]
                tails.plot(adjusted, of_readings, "ok", markersize=3)
                tails.axvline(LEVEL, color="0.5", linewidth=0.6)
                tails.set(
                    xscale="log",
                    xlabel="adjusted tail probability",
                    xlim=(self.smallest / 2, 1.5),
                    ymargin=0.1,
                )
                tails.invert_yaxis()
        return figure


def twin(
    folder: AnyRecords,
    *,
    days: HundredOrMore = 1000,
    full_days: int = 250,
    faults: bool = False,
    seed: Seed = 1,
    laboratory: AnyLaboratory | None = None,
    progress: Progress = quiet,
) -> Twin:
    """Check the stated u of a test day.

    The day is simulated again from its records. The first table has one row per quantity, the
    metric first. It compares the stated u with the standard deviation of the errors of many
    simulated days. The second table compares readings of the records with the same readings on the
    simulated days, to find unusual ones. Only records are read, never the sealed true values.

    Parameters
    ----------
    folder
        Result folder of ``certify``, its folder ``records``, or the folder of another laboratory
        with its ``laboratory.toml``. Or a certificate, as ``certify`` returns it.
    days
        Number of days on which the instruments record only summary values; at least 100.
    full_days
        Largest number of days on which the instruments record every gate edge and encoder count, to
        compare the readings. It must be 0 or at least 250, because a reading cannot be significant
        with fewer days. The simulation ends earlier if the remaining days cannot make a reading
        significant. No such days are simulated for records of summary values.
    faults
        Simulate each fault of the catalog that the rigs can have in four sizes. This takes a few
        minutes.
    seed
        Seed of the days.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    progress
        Function that is called with a message, the number of days or faults done, and the total. If
        it is not given, the functions of `virtual_lab` and the commands show the progress on
        stderr.

    Raises
    ------
    InputError
        A number is too small. The records in the folder cannot be used, or give no result. The
        procedure would reject most of their balls. Hits or
        wall hits are not repeated or are all equal, so that they show no scatter. Fewer than half
        of the simulated days give a valid result. A rig is not installed here. `faults` is given
        for records of summary values.
    """
    if full_days and full_days < FEWEST_FULL:
        raise InputError("", "full_days", full_days, f"allowed: 0, or at least {FEWEST_FULL}")
    certification = (
        folder.certification if isinstance(folder, Certified) else certify_records(Path(folder))
    )
    statement = Statement.of(certification)
    playing = TwinDays.fit(statement, seed, min(days, SIDE_BY_SIDE))
    rows, invalid = compare_quantities(certification, playing, days, progress)
    noticed: list[NoticedFault] = []
    if faults:
        if not statement.has_full_records:
            allowed = "needs records of every edge and count"
            raise InputError("", "faults", None, allowed)
        assert certification.metric is not None
        noticed = noticed_faults(playing, certification.metric.u, progress)
    readings: list[TwinReading] = []
    played = 0
    if full_days and statement.has_full_records:
        readings, played = differing_readings(certification, playing, full_days, progress)
    return Twin(
        bat=certification.session.bat,
        procedure=certification.procedure.name,
        days=days,
        invalid=invalid,
        rows=rows,
        full_days=played,
        readings=tuple(readings),
        faults=tuple(noticed),
        remark="\n".join(
            [
                *replaced_rigs(certification.session, statement.session),
                *([] if playing.scatters["bat"] else [QUIET]),
            ]
        ),
    )
