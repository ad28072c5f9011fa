"""Time of each frame, and the reliability of a file's statements about it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.files import parse_table, read_text
from virtual_lab.units import MILLISECOND, Array
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.columns import numbers_in
from virtual_lab.video.clips.highspeed import HIGHSPEED
from virtual_lab.video.clips.source import Source

UNSURE_RATE = "the frame rate is the file's own"
UNREAD = "frames of the file can be read; the others are damaged"


def frame_times(
    source: Source, stamps: Array, calibration: ClipCalibration
) -> tuple[Array, tuple[str, ...]]:
    """Return the time of each frame, (frame,) [s], and a tuple of warnings.

    The times are the time stamps of the calibration if it has any. Otherwise the times are computed
    from the frame rate of the calibration. If the calibration states neither, the times are taken
    from the file.

    Parameters
    ----------
    stamps
        Time stamps in the file, (frame,) [s]; NaN for a missing one.

    Raises
    ------
    InputError
        The time stamps of the calibration cannot be read, are not one per frame, do not increase or
        are not finite. Or the calibration has no time stamps, and neither it nor the file states a
        frame rate.
    """
    count, nominal = len(stamps), calibration.frames_per_second
    kind, fastest = source.path.suffix.lower(), max(nominal or 0.0, source.rate or 0.0)
    rounding = MILLISECOND if _are_rounded(stamps) else 0.0
    warnings = [f"ignored: {', '.join(source.ignored)}"] if source.ignored else []
    if len(source.tracks) > 1:
        warnings.append(f"the file has {len(source.tracks)} video tracks; one of them is used")
    if source.tracks and count < 0.95 * (stated := source.declared * source.tracks[0].shown):
        warnings.append(f"{count} of {stated:.0f} {UNREAD}")
    if kind == ".avi" and fastest >= 2000:  # observed in real files
        warnings.append("AVI files lose frames without a warning at 2000 per second and above")
    if rounding * fastest > 0.5:
        warnings.append("the file rounds time stamps to 1 ms, so they do not show lost frames")
    if calibration.timestamps is not None:
        times = _read_stamps(Path(calibration.timestamps), count)
        if nominal and abs((rate := 1 / float(np.median(np.diff(times)))) / nominal - 1) >= 0.01:
            words = f"frames_per_second is {nominal:.6g}, but the time stamps are used"
            warnings.append(f"{words}: they mean {rate:.6g} frames per second")
    elif nominal:
        times = np.arange(count) / nominal
        if source.rate and abs(source.rate / nominal - 1) >= 0.01:
            words = f"the file states {source.rate:.6g} frames per second"
            warnings.append(f"{words}; the stated rate of {nominal:.6g} is used")
        steps = np.diff(stamps)
        # A comparison with NaN, a missing stamp, is False.
        if count > 2 and (gaps := np.flatnonzero(steps > 1.5 * np.median(steps) + rounding)).size:
            words = f"frames may be missing after frame {gaps[0]}"
            warnings.append(f"{words}: the file's time stamps jump there ({gaps.size} such jumps)")
    else:
        times, more = _own_times(source, stamps, rounding)
        warnings += more
    return times, tuple(warnings)


def _own_times(source: Source, stamps: Array, rounding: float) -> tuple[Array, list[str]]:
    """Return the time of each frame [s] from the file alone, and warnings.

    `rounding` is the step to which the time stamps are rounded [s].
    """
    if source.rate is None:
        allowed = "no frame rate (a still picture?); give {fps}, or timestamps in {calibration}"
        raise InputError(str(source.path), "frames_per_second", None, allowed)
    times, warnings = np.arange(len(stamps)) / source.rate, []
    if np.isfinite(stamps).all() and np.ptp(stamps - times) >= rounding:
        rising = _rising(stamps)
        if rising is None:
            warnings.append("the file's time stamps do not increase; its frame rate is used")
        elif (changed := np.flatnonzero(rising != stamps)).size:
            words = f"time stamps repeat or decrease ({changed.size} frames, the first is"
            warnings.append(f"{words} {changed[0]}); they are interpolated")
        times = times if rising is None else rising
    # High-speed cameras write the rate at which they film.
    if source.path.suffix.lower() not in HIGHSPEED:
        words = f"{UNSURE_RATE}, {1 / usual_step(times):.6g} per second"
        warnings.insert(0, f"{words}; a slow-motion file states its playback rate")
    return times, warnings


def _are_rounded(stamps: Array) -> bool:
    """Return whether all time stamps [s] are whole milliseconds, as in MKV, WebM and FLV."""
    count = stamps / MILLISECOND
    return bool((np.abs(np.rint(count) - count) < 1e-3).all())


def _rising(stamps: Array) -> Array | None:
    """Return increasing time stamps, (frame,) [s]; None if fewer than half of them can be used.

    If a stamp is not larger than the stamp before it, either may be wrong, so both are interpolated
    between their neighbors.
    """
    falls = np.flatnonzero(np.diff(stamps) <= 0)
    number = np.arange(len(stamps))
    good = np.setdiff1d(number, np.union1d(falls, falls + 1))
    steps = np.diff(stamps[good])
    if 2 * len(good) < len(stamps) or not steps.size or steps.min() <= 0:
        return None
    outside = number - np.clip(number, good[0], good[-1])
    return np.asarray(np.interp(number, good, stamps[good]) + outside * np.median(steps))


def usual_step(times: Array) -> float:
    """Return the usual time from one frame to the next [s].

    `times`, (frame,), are the time stamps of the frames [s]. The result is the mean of the steps
    between them. If the function `is_uneven` returns True for `times`, it is the median of the
    steps. For a single frame it is 1 s.
    """
    steps = np.diff(times)
    if not len(steps):
        return 1.0
    return float(np.median(steps) if is_uneven(times) else steps.mean())


def frame_steps(times: Array) -> Array:
    """Return the time of each frame since the first frame, in frame intervals, (frame,).

    `times`, (frame,), are in s. If the times are evenly spaced, the result is the index of each
    frame. Otherwise (see `is_uneven`) it is the time since the first frame divided by `usual_step`,
    the usual time between frames.
    """
    if is_uneven(times):
        return np.asarray((times - times[0]) / usual_step(times))
    return np.arange(len(times), dtype=float)


def is_uneven(times: Array) -> bool:
    """Return whether time stamps deviate from equal steps by a range of more than 0.3 of a step.

    `times`, (frame,), are the time stamps [s]. The range is the largest deviation minus the
    smallest. The result is True if a frame was lost, or if a phone films more slowly in the dark.
    It is False in two cases:

    * The rate is constant, at most 240 frames per second, and the time stamps are rounded to 1 ms.
    * There are fewer than three time stamps.
    """
    if len(times) < 3:
        return False
    off = times - np.linspace(times[0], times[-1], len(times))
    return bool(np.ptp(off) > 0.3 * np.median(np.diff(times)))


def _read_stamps(path: Path, count: int) -> Array:
    """Return the time stamps [s] in a CSV file: its only column, or the column time_s."""
    # largest time stamp of any clock, and smallest time between two frames [s]
    latest, step = 1e12, 1e-8
    text = read_text(path)
    # The first line is a number instead of a column name.
    bare = re.match(r'\s*"?[-+.\d][-+.\de]*"?\s', text, re.IGNORECASE)
    table = parse_table((f"time_s\n{text}" if bare else text).encode(), str(path))
    table.index -= bool(bare)
    name = "time_s" if len(table.columns) > 1 else table.columns[0]
    times = numbers_in(table, name, path, latest)
    if len(times) != count:
        raise InputError(str(path), "time stamps", len(times), f"the clip has {count} frames")
    if (falls := np.flatnonzero(np.diff(times) < step)).size:
        after, before = float(times[falls[0] + 1]), float(times[falls[0]])
        allowed = f"must be at least {step:g} s later than the one before, {before!r} s"
        raise InputError(str(path), f"time stamp {falls[0] + 1}", after, allowed)
    return times
