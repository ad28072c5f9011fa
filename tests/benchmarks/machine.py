"""Speed of the machine: its vector instructions, and timers."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["Work", "in_turn", "processor_seconds", "seconds", "vectors"]

Floats = NDArray[np.float64]
Work = Callable[[], object]

REPEATS = 7


def in_turn(works: Mapping[str, Work], rounds: int) -> dict[str, Floats]:
    """Return the processor times [s] of several works, each (rounds,), which are run in turn.

    A neighbor that takes the processor for a second then slows all of them. Each work runs once
    before, because it may compile.
    """
    times: dict[str, list[float]] = {name: [] for name in works}
    for work in works.values():
        work()
    for _ in range(rounds):
        for name, work in works.items():
            start = time.process_time()
            work()
            times[name].append(time.process_time() - start)
    return {name: np.array(values) for name, values in times.items()}


def seconds(work: Work, repeats: int = REPEATS) -> float:
    """Return the median processor time of a work [s]."""
    return float(np.median(in_turn({"": work}, repeats)[""]))


def processor_seconds(work: Work, rounds: int) -> float:
    """Return the median processor time of a work [s], after a first run, which may compile.

    Neighbors on a shared machine disturb it less than they disturb wall-clock time.
    """
    times = []
    for _ in range(rounds + 1):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return float(np.median(times[1:]))


def vectors() -> str:
    """Return the widest vector instructions that the processor reports."""
    try:
        flags = set(Path("/proc/cpuinfo").read_text("utf-8").split())
    except OSError:
        return "unknown"
    return "AVX-512" if "avx512f" in flags else "AVX2" if "avx2" in flags else "less than AVX2"
