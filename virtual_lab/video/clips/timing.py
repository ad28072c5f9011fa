"""When each frame was taken, and what a file's own word on that is worth."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.files import read_text
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.reading import Source

__all__ = ["UNEVEN", "frame_times", "read_stamps", "usual_step"]

Array = NDArray[np.float64]

AVI_LOSES = 2000.0  # frames a second from which AVI was seen to drop frames without a word
MKV_STEP = 1e-3  # s, to which MKV rounds time stamps
ROUNDED = {".mkv", ".webm"}
UNEVEN = 1.3  # of the usual step between time stamps: such a one stands for lost frames
AGREE = 0.01  # rates closer than this are the same
COLUMN = "time_s"
LONG = 10_000  # characters of a line: no time stamps
STEP, LATEST = 1e-8, 1e12  # s, between two frames at least, and since any clock began


def frame_times(
    source: Source, stamps: Array, calibration: ClipCalibration
) -> tuple[Array, tuple[str, ...]]:
    """Return the time of each frame [s] and warnings.

    Parameters
    ----------
    source
        Where the frames come from.
    stamps
        Time stamps that came with the frames, (frame,), NaN where the file has none [s].
    calibration
        Time stamps of its own go before a frame rate, a frame rate before the file's word.

    Raises
    ------
    InputError
        Time stamps that are missing, too few or too many, that do not rise or are not finite.
    """
    count, given = len(stamps), calibration.frames_per_second
    rounded = source.path.suffix.lower() in ROUNDED
    warnings = _container(source, given)
    if calibration.timestamps is not None:
        times = read_stamps(Path(calibration.timestamps), count)
        if given and not _same(rate := 1 / float(np.median(np.diff(times))), given):
            warnings.append(
                f"the time stamps say {rate:.6g} frames a second, frames_per_second {given:.6g}: "
                "the time stamps were used"
            )
        return times, tuple(warnings)
    if given:
        if source.rate and not _same(source.rate, given):
            warnings.append(
                f"the file says {source.rate:.6g} frames a second, the calibration {given:.6g}: "
                "the calibration's were used"
            )
        if not rounded and (gaps := _gaps(stamps)).size:
            warnings.append(
                f"the file's time stamps jump after frame {gaps[0]} ({gaps.size} jumps in all): "
                "frames may be missing there"
            )
        return np.arange(count) / given, tuple(warnings)
    if source.rate is None:
        allowed = "the clip says nothing of time: give frames_per_second or timestamps"
        raise InputError(str(source.path), "frames_per_second", None, allowed)
    warnings.append(
        f"the frame rate is the file's own, {source.rate:.6g} a second: a slow-motion file "
        "declares the rate it plays at"
    )
    if rounded or not (np.isfinite(stamps).all() and (np.diff(stamps) > 0).all()):
        return np.arange(count) / source.rate, tuple(warnings)
    return stamps, tuple(warnings)


def usual_step(times: Array) -> float:
    """Return the time between frames [s]: the mean where it is even, else the median."""
    steps = np.diff(times)
    if not len(steps):
        return 1.0
    uneven = steps.max() > UNEVEN * float(np.median(steps))
    return float(np.median(steps) if uneven else steps.mean())


def read_stamps(path: Path, count: int) -> Array:
    """Return the time stamps [s] in a CSV file: one column, or the one called time_s."""
    lines = [line for line in read_text(path).splitlines() if len(line) < LONG]
    rows = [row for row in csv.reader(lines) if any(map(str.strip, row))]
    head = [cell.strip() for cell in rows[0]] if rows else []
    column = 0
    if (head and not _number(head[0])) or COLUMN in head:
        rows = rows[1:]
        if len(head) > 1 and COLUMN not in head:
            raise InputError(str(path), "columns", ", ".join(head), f"one must be {COLUMN!r}")
        column = head.index(COLUMN) if len(head) > 1 else 0
    elif len(head) > 1:
        raise InputError(str(path), "columns", len(head), f"name one {COLUMN!r} in a header")
    try:
        times = np.array([float(row[column]) for row in rows])
    except (ValueError, IndexError) as fault:
        raise InputError(str(path), "time stamps", None, f"cannot be read: {fault}") from fault
    if len(times) != count:
        raise InputError(str(path), "time stamps", len(times), f"the clip has {count} frames")
    if not (known := np.abs(times) <= LATEST).all():
        bad, allowed = int(np.argmin(known)), f"must be finite, and up to {LATEST:g} s"
        raise InputError(str(path), f"time stamp {bad}", float(times[bad]), allowed)
    if (falls := np.flatnonzero(np.diff(times) < STEP)).size:
        after, before = float(times[falls[0] + 1]), float(times[falls[0]])
        allowed = f"must be {STEP:g} s later than the one before, {before!r} s, or more"
        raise InputError(str(path), f"time stamp {falls[0] + 1}", after, allowed)
    return times


def _container(source: Source, given: float | None) -> list[str]:
    """Return what is known against the kind of file at this frame rate."""
    fastest = max(given or 0.0, source.rate or 0.0)
    kind = source.path.suffix.lower()
    if kind == ".avi" and fastest >= AVI_LOSES:
        return [f"AVI loses frames without a word at {AVI_LOSES:.0f} a second and above"]
    if kind in ROUNDED and fastest * MKV_STEP > 0.5:
        return ["MKV rounds time stamps to 1 ms: those of its own were not used"]
    return []


def _gaps(stamps: Array) -> NDArray[np.intp]:
    """Return the frames after which the stamps leave out at least one step."""
    steps = np.diff(stamps)
    if len(steps) < 2 or not np.isfinite(steps).all():
        return np.zeros(0, dtype=np.intp)
    usual = float(np.median(steps))
    return np.flatnonzero(steps > 1.5 * usual)


def _same(one: float, other: float) -> bool:
    return abs(one / other - 1) < AGREE


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
