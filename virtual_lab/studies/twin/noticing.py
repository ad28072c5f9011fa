"""Faults of the catalogue that a laboratory would notice, and the smallest size noticed.

Each fault is played on full days of the twin in several sizes, as a share of the fault in the
catalogue. The days of a fault are kept in a folder, so that an interrupted study goes on.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.files import read_json
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.tables import column
from virtual_lab.records.session import pack
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.faults.catalogue import CATALOGUE
from virtual_lab.simulation.faults.fault import Fault
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.studies.twin.days import TwinDays
from virtual_lab.units import Array

SIZES = (0.25, 0.5, 1.0, 2.0)  # sizes of a fault [its size in the catalogue]
DAYS = 10  # number of days per fault and size
FIRST = 2**21  # number of the first of these days
# faults that a twin cannot play: its balls have no law of humidity, and its bat no stiffness
NOT_PLAYED = {"balls-not-conditioned", "bat-cracked"}
NO_SIZE = {"records-swapped"}  # faults that are there or not
NOTICED = 0.9  # share of the days on which a fault is noticed, for "from which size on"


@dataclass(frozen=True, slots=True, kw_only=True)
class NoticedFault:
    """A fault at one laboratory: the share of its days on which the test shows it.

    It does so by a flag, by the verdict INVALID, or by records that the reduction refuses.
    """

    fault: str = column("fault")
    # smallest size from which on the fault is noticed on 9 of 10 days; None: at no size
    noticed_from: float | None = column("noticed from", "its size", "g")
    shares: tuple[float, ...] = column(
        f"noticed at {', '.join(f'{size:g}' for size in SIZES)}",
        "of days",
        lambda row: ", ".join(f"{share:.0%}" for share in row.shares),
    )
    # median change of the metric by the full fault, on days with a result; None: none has one
    shift: float | None = column("shift of the metric at 1", "stated u", "+.2f")


def noticed_faults(
    playing: TwinDays, u: float, folder: Path, progress: Progress = quiet, days: int = DAYS
) -> list[NoticedFault]:
    """Return one row per fault that the laboratory's rigs can have.

    Faults that a twin cannot play are left out.

    Parameters
    ----------
    playing
        Days of the twin of the laboratory.
    u
        Stated u of the metric [SI].
    folder
        Folder of the days played so far; it is made if there is none.
    progress
        Function that is called with a text, the number of faults done, and the total.
    days
        Number of days per fault and size.

    Raises
    ------
    InputError
        A folder of other days.
    """
    digest = pack(playing.statement.session).digest
    _require_same(folder, {"session": digest, "seed": playing.seed, "days": days})
    names = [name for name in sorted(CATALOGUE) if _can_occur(name, playing)]
    rows: list[NoticedFault] = []
    numbers = range(FIRST, FIRST + days)
    sound: list[float] = []
    for number, name in enumerate(names, 1):
        path = folder / f"{name}.json"
        if not path.exists():
            sound = sound or [_error(playing, day)[1] for day in numbers]
            _write(path, asdict(_played(CATALOGUE[name], playing, u, np.array(sound))))
        row = read_json(path)
        rows.append(NoticedFault(**{**row, "shares": tuple(row["shares"])}))
        progress("faults", number, len(names))
    return rows


def _can_occur(name: str, playing: TwinDays) -> bool:
    if name in NOT_PLAYED:
        return False
    try:
        FaultSet.of([name], rig=playing.statement.session.rigs["impact"])
    except InputError:
        return False
    return True


def _error(playing: TwinDays, day: int) -> tuple[bool, float]:
    """Return whether a day shows a fault, and the error of its metric, NaN without a result."""
    try:
        with np.errstate(all="ignore"):  # readings beyond all limits
            played = playing.play(day, RecordDetail.FULL)
    except InputError:  # the reduction refuses the records
        return True, np.nan
    certified = played.certified
    shown = bool(certified.invalid[0]) or any(certified.checked.flags(0))
    error = certified.results["metric"].value - played.measurands["metric"]
    return shown, float(error[0]) if certified.some[0] else np.nan


def _played(fault: Fault, playing: TwinDays, u: float, sound: Array) -> NoticedFault:
    """Return the row of a fault; `sound` are the errors of the same days without it, (day,)."""
    shares, shift = [], None
    for size in SIZES:
        faulty = replace(playing, faults=FaultSet(faults=(sized(fault, size),)))
        shown, errors = zip(
            *(_error(faulty, FIRST + day) for day in range(sound.size)), strict=True
        )
        shares.append(sum(shown) / sound.size)
        changes = np.array(errors) - sound
        if size == 1 and np.isfinite(changes).any():
            shift = float(np.nanmedian(changes)) / u
    enough = np.array(shares) >= NOTICED
    from_there = [size for at, size in enumerate(SIZES) if enough[at:].all()]
    return NoticedFault(
        fault=fault.name,
        noticed_from=from_there[0] if from_there else None,
        shares=tuple(shares),
        shift=shift,
    )


def sized(fault: Fault, size: float) -> Fault:
    """Return a fault whose changes of numbers are multiplied by `size`.

    Changes of whole numbers and texts keep their full size, and so do readings that the fault adds
    or removes. A fault in `NO_SIZE` is returned unchanged.
    """
    if fault.name in NO_SIZE:
        return fault

    def scaled(hook: Callable[[Any], Any] | None) -> Any:
        return hook and (lambda before: _scaled(before, hook(before), size))

    def record(before: Any, context: Any) -> Mapping[str, Any]:
        assert fault.record is not None
        changed = fault.record(before, context)
        return {name: blend(getattr(before, name), after, size) for name, after in changed.items()}

    return replace(
        fault,
        station=scaled(fault.station),
        specimen=scaled(fault.specimen),
        plan=scaled(fault.plan),
        calibration=scaled(fault.calibration),
        record=record if fault.record else None,
    )


def _scaled(before: Any, after: Any, size: float) -> Any:
    return None if after is None else blend(before, after, size)


def blend(before: Any, after: Any, size: float) -> Any:
    """Return `before` with its change to `after` multiplied by `size`, number by number.

    Whole numbers, texts and the keys of a mapping are those of `after`, and so are numbers that are
    not finite in `before` or in `after`.
    """
    if before is after:
        return before
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        return {key: blend(before.get(key, each), each, size) for key, each in after.items()}
    if is_dataclass(before) and type(before) is type(after):
        whole: Any = after
        names = [part.name for part in fields(before)]
        parts = {key: blend(getattr(before, key), getattr(after, key), size) for key in names}
        return replace(whole, **parts)
    if np.asarray(before).dtype.kind != "f" or np.asarray(after).dtype.kind != "f":
        return after
    both = np.isfinite(before) & np.isfinite(after)
    with np.errstate(invalid="ignore"):
        blended = np.where(both, before + size * (np.asarray(after) - before), after)
    return blended if isinstance(after, np.ndarray) else float(blended)


def _require_same(folder: Path, settings: Mapping[str, Any]) -> None:
    path = folder / "faults.json"
    folder.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        _write(path, settings)
    elif read_json(path) != settings:
        allowed = "has days of other records, another seed or number; allowed: a new folder"
        raise InputError("", "faults", str(folder), allowed)


def _write(path: Path, document: Any) -> None:
    """Write a file at once, so that an interruption leaves no part of it."""
    draft = path.with_suffix(".part")
    draft.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    os.replace(draft, path)
