"""Faults of the catalog that a laboratory would notice, and the smallest size noticed.

Each fault is simulated in several sizes, on days of the twin with full records. A size of 1 is the
fault in the catalog.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.tables import column
from virtual_lab.simulation.faults import FaultSet, faults_at
from virtual_lab.simulation.faults.catalogue import CATALOGUE
from virtual_lab.simulation.faults.fault import Fault
from virtual_lab.simulation.faults.size import resize
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.studies.twin.days import TwinDays
from virtual_lab.units import Array

SIZES = (0.25, 0.5, 1.0, 2.0)  # sizes of a fault [its size in the catalog]
DAYS = 10  # number of days per fault and size
FIRST = 2**21  # number of the first of these days
# faults that a twin cannot simulate: its e_A does not follow from a stiffness of the bat
NOT_PLAYED = {"bat-cracked"}
NOTICED = 0.9  # share of the days on which a fault is noticed, for "from which size on"


@dataclass(frozen=True, slots=True, kw_only=True)
class NoticedFault:
    """A fault at one laboratory: the share of its days on which the test notices the fault.

    The test notices a fault by a flag, by the verdict INVALID, or by records that the reduction
    rejects.
    """

    fault: str = column("fault")
    # smallest size from which on the fault is noticed on 9 of 10 days; None: at no size
    noticed_from: float | None = column("noticed from", "its size", "g")
    noticed_at: Mapping[str, float] = column(  # share of days by size of the fault
        f"noticed at {', '.join(f'{size:g}' for size in SIZES)}",
        "of days",
        lambda row: ", ".join(f"{share:.0%}" for share in row.noticed_at.values()),
    )
    # median change of the metric by the full fault, on days with a result; None: none has one
    metric_shift: float | None = column("shift of the metric at 1", "stated u", "+.2f")


def noticed_faults(
    playing: TwinDays, u: float, progress: Progress = quiet, days: int = DAYS
) -> list[NoticedFault]:
    """Return one row per fault that the rigs can have: the share of days on which it is noticed.

    A row has this share for each size of the fault. The days are simulated from the records of the
    laboratory (days of its twin). Faults that cannot be simulated in this way are left out.

    Parameters
    ----------
    playing
        Generator of simulated test days of the laboratory.
    u
        Standard uncertainty of the metric, the main result of the test, as the laboratory states it
        [SI].
    progress
        Function that is called with a message, the number of faults done, and the total.
    days
        Number of days per fault and size.
    """
    impact = playing.statement.session.rigs["impact"]
    names = [name for name in faults_at(impact) if name not in NOT_PLAYED]
    sound = np.array([_error(playing, FIRST + day)[1] for day in range(days)])
    rows = []
    for number, name in enumerate(names, 1):
        rows.append(_fault_row(CATALOGUE[name], playing, u, sound))
        progress("faults", number, len(names))
    return rows


def _error(playing: TwinDays, day: int) -> tuple[bool, float]:
    """Return whether a day shows a fault, and the error of its metric, NaN without a result."""
    try:
        with np.errstate(all="ignore"):  # readings beyond all limits
            played = playing.play(day, RecordDetail.FULL)
    except InputError:  # the reduction rejects the records
        return True, np.nan
    certified = played.certified
    is_flagged = bool(certified.invalid[0]) or any(certified.checked.flags(0))
    error = certified.results["metric"].value - played.measurands["metric"]
    return is_flagged, float(error[0]) if certified.has_result[0] else np.nan


def _fault_row(fault: Fault, playing: TwinDays, u: float, sound: Array) -> NoticedFault:
    """Return the row of a fault; `sound` are the errors of the same days without it, (day,)."""
    shares, shift = [], None
    for size in SIZES:
        faulty = replace(playing, faults=FaultSet(faults=(resize(fault, size),)))
        days = [_error(faulty, FIRST + day) for day in range(sound.size)]
        shares.append(sum(is_flagged for is_flagged, _ in days) / sound.size)
        changes = np.array([error for _, error in days]) - sound
        if size == 1 and np.isfinite(changes).any():
            shift = float(np.nanmedian(changes)) / u
    missed = [at for at, share in enumerate(shares) if share < NOTICED]
    enough = SIZES[max(missed, default=-1) + 1 :]
    return NoticedFault(
        fault=fault.name,
        noticed_from=enough[0] if enough else None,
        noticed_at={f"{size:g}": share for size, share in zip(SIZES, shares, strict=True)},
        metric_shift=shift,
    )
