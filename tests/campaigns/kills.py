"""A campaign under kills: ``python -m tests.campaigns.kills kills.csv``, some minutes.

Each kind of process is killed at fixed times, or its writes fail; then the campaign is
resumed. In the end its files equal those of an undisturbed run, no other file is left, and no
process is left.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL
from tempfile import TemporaryDirectory

import pandas as pd

import virtual_lab as vl

STUDY = {
    "bats": ["r161"],
    "procedures": ["astm-f1881"],
    "laboratories": 2500,  # study whose parts take half a second
    "repeats": 12,
    "seed": 3,
}
PORT = 28786
PROGRAM = [sys.executable, "-m", "virtual_lab", "campaign", "resume"]
KILLS = {"worker": 15, "parent": 10, "dask worker": 5, "scheduler": 5, "failed write": 5}


@dataclass(frozen=True, kw_only=True)
class Row:
    """Result of a number of kills of one kind."""

    kind: str
    kills: int
    runs: int  # number of runs until the campaign was complete
    seconds: int
    equal_parts: int
    other_parts: int
    strays: int  # number of files and folders that are no part
    orphans: int  # number of remaining processes


def children(pid: int) -> list[int]:
    """Return the processes that a process started, in order."""
    found: list[int] = []
    with suppress(OSError):
        for task in Path(f"/proc/{pid}/task").glob("*/children"):
            found += map(int, task.read_text("utf-8").split())
    return sorted(found)


def contents(folder: Path) -> dict[str, bytes]:
    """Return the parts by name."""
    return {path.name: path.read_bytes() for path in (folder / "parts").glob("*.parquet")}


def orphans(folder: Path) -> int:
    """Return the number of worker processes of a campaign."""
    found = 0
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            words = path.read_bytes().decode().split("\0")
            found += "virtual_lab.processes.worker" in words and str(folder) in words
    return found


def moments(seed: int) -> Iterator[float]:
    """Yield waiting times [s] spread evenly from 0 to 3, as multiples of the golden section."""
    number = seed
    while True:
        number += 1
        yield 3 * (number * 0.6180339887 % 1)


Started = subprocess.Popen[bytes]


@contextmanager
def started(*words: str) -> Iterator[Started]:
    """Yield a process, and kill it at the end."""
    with subprocess.Popen(words, stdout=DEVNULL, stderr=DEVNULL) as process:
        try:
            yield process
        finally:
            process.kill()


def until_a_part(folder: Path, process: Started, before: int) -> None:
    """Wait until a run has made a part, so that its workers are busy."""
    while process.poll() is None and len(contents(folder)) <= before:
        time.sleep(0.05)


def of_workers(folder: Path, kills: int, wait: Iterator[float]) -> int:
    done = runs = 0
    while done < kills:
        lose_some(folder)
        with started(*PROGRAM, str(folder), "--workers", "2") as parent:
            runs += 1
            until_a_part(folder, parent, len(contents(folder)))
            for _ in range(3):  # arguments of a run
                time.sleep(next(wait) / 3)
                for child in children(parent.pid)[: done < kills]:
                    with suppress(ProcessLookupError):
                        os.kill(child, signal.SIGKILL)
                        done += 1
            parent.wait()
    return runs


def of_parents(folder: Path, kills: int, wait: Iterator[float]) -> int:
    for _ in range(kills):
        lose_some(folder)
        with started(*PROGRAM, str(folder), "--workers", "2") as parent:
            while len(children(parent.pid)) < 2 and parent.poll() is None:
                time.sleep(0.05)
            time.sleep(2 * next(wait))
            parent.kill()
        end = time.monotonic() + 10
        while orphans(folder) and time.monotonic() < end:
            time.sleep(0.05)
        assert orphans(folder) == 0
    return kills


def scheduler() -> AbstractContextManager[Started]:
    return started(*SCHEDULER, "--port", str(PORT), "--no-dashboard")


SCHEDULER = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
WORKER = [sys.executable, "-m", "distributed.cli.dask_worker", f"tcp://127.0.0.1:{PORT}"]
WORKER += ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
BY_DASK = ("--dask", f"tcp://127.0.0.1:{PORT}")


def of_dask_workers(folder: Path, kills: int, wait: Iterator[float]) -> int:
    lose_some(folder)
    with scheduler(), started(*WORKER) as steady:
        assert steady.poll() is None
        with started(*PROGRAM, str(folder), *BY_DASK) as parent:
            until_a_part(folder, parent, len(contents(folder)))
            for _ in range(kills):
                lose_some(folder)
                with started(*WORKER):
                    time.sleep(5 + next(wait))
            parent.wait()
    return 1


def of_schedulers(folder: Path, kills: int, wait: Iterator[float]) -> int:
    for _ in range(kills):
        lose_some(folder)
        words = (*PROGRAM, str(folder), *BY_DASK)
        with scheduler() as lost, started(*WORKER), started(*words) as parent:
            until_a_part(folder, parent, len(contents(folder)))
            time.sleep(next(wait) / 3)
            lost.kill()
            assert parent.wait(60) in (0, 2)
    return kills


def of_writes(folder: Path, kills: int, wait: Iterator[float]) -> int:
    """Limit the file size [kB] below that of a part, to simulate a full disk."""
    for number in range(kills):
        lose_some(folder)
        words = f"ulimit -f {20 * number + 20}; exec {' '.join(PROGRAM)} {folder} --workers 2"
        with started("bash", "-c", words) as parent:
            assert parent.wait() == 2
    return kills


def lose_some(folder: Path) -> None:
    """Remove some parts if none is missing, so that there is work."""
    there = sorted((folder / "parts").glob("*.parquet"))
    if len(there) == STUDY["repeats"]:
        for path in there[::2]:
            path.unlink()


OF: dict[str, Callable[[Path, int, Iterator[float]], int]] = {
    "worker": of_workers,
    "parent": of_parents,
    "dask worker": of_dask_workers,
    "scheduler": of_schedulers,
    "failed write": of_writes,
}


def killed(kind: str, kills: int, whole: Path, folder: Path) -> Row:
    """Return the effect of a number of kills on a new campaign; `whole` is an undisturbed one."""
    begun = time.monotonic()
    vl.campaign(STUDY, folder, blocks="1/12")
    runs = OF[kind](folder, kills, moments(len(kind)))
    while vl.campaign(None, folder).missing:
        runs += 1
    own, other = contents(folder), contents(whole)
    equal = sum(own.get(name) == data for name, data in other.items())
    there = [path.name for path in (folder / "parts").iterdir()]
    return Row(
        kind=kind,
        kills=kills,
        runs=runs + 1,
        seconds=round(time.monotonic() - begun),
        equal_parts=equal,
        other_parts=len(other) - equal,
        strays=len(set(there) - set(other)),
        orphans=orphans(folder),
    )


def main(path: str) -> None:
    """Write the table of all kinds of kills."""
    with TemporaryDirectory() as place:
        whole = Path(place) / "whole"
        vl.campaign(STUDY, whole)
        rows = []
        for kind, kills in KILLS.items():
            rows.append(killed(kind, kills, whole, Path(place) / kind.replace(" ", "-")))
            print(rows[-1], flush=True)
    pd.DataFrame(rows).to_csv(path, index=False)


if __name__ == "__main__":
    main(sys.argv[1])
