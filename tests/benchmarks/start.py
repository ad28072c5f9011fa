"""Start-up, first run and one certificate: ``python -m tests.benchmarks.start [CHECKOUT]``.

Commands run in processes of their own, with compiled kernels on disk. With CHECKOUT, another
working copy of this project with an environment in its folder `.venv`, the same commands run there
in turn, and the ratio of the processor times is given. Then the kernels are compiled into an empty
cache, by certificates of two procedures and a study of summed records. The last rows are the
packages that take longest to import and the functions that take longest to compile, without those
that they call. All times but those of imports are processor times.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numba.core import event

from tests.benchmarks.machine import processor_seconds
from tests.benchmarks.rows import Row, tell
from tests.benchmarks.throughput import LABORATORIES, certify_alone, certify_blocks, normal_time
from virtual_lab.simulation.instruments import RecordDetail

__all__ = ["main", "print_compile_times"]

ROOT = Path(__file__).parents[2]
ROUNDS = 7
WARM = {  # words of each command, its largest ratio and its largest time [s]
    "certify": ("certify r161 --seed 7 --out {new}", 0.70, None),
    "reduce": ("reduce {made}/records --out {new}", 0.70, None),
    "verify": ("verify {made}", 0.70, None),
    "score": ("score {made}", None, None),
    "--help": ("--help", None, 0.18),
    "--version": ("--version", None, 0.12),
    "list": ("list", None, 0.40),
}
COMPILED = {  # processor time of the first runs on 26 November 2026 [s]
    "certify r161": 14.8,
    "then by bbcor": 20.0,
    "then a summed study": 6.0,
}
SHARE = 0.6  # largest share of these times
LARGEST_MEMORY = 255  # [MB]
IMPORT = re.compile(r"import time:\s*(\d+) \|\s*\d+ \|\s*(\w+)")


def main() -> None:
    """Measure, print the rows, and write them as CSV to the named files."""
    folders = [Path(word) for word in sys.argv[1:] if Path(word).is_dir()]
    files = [word for word in sys.argv[1:] if not Path(word).is_dir()]
    tell("start", _rows(folders[0].resolve() if folders else None), files)


def _rows(other: Path | None) -> Iterator[Row]:
    with TemporaryDirectory() as folder:
        yield from _warm(Path(folder), other)
    yield from _alone()
    with TemporaryDirectory() as folder:
        yield from _first(Path(folder))


def _warm(folder: Path, other: Path | None) -> Iterator[Row]:
    checkouts = [ROOT, other] if other else [ROOT]
    made = {checkout: folder / f"made-{i}" for i, checkout in enumerate(checkouts)}
    numbers = count()
    for checkout, records in made.items():  # each reads the records that it wrote itself
        _run(checkout, f"certify r161 --seed 7 --out {records}")
    for name, (words, ratio, most) in WARM.items():
        spent: dict[Path, list[float]] = {checkout: [] for checkout in checkouts}
        for _ in range(ROUNDS):
            for checkout, times in spent.items():
                command = words.format(made=made[checkout], new=folder / str(next(numbers)))
                used = _run(checkout, command)
                times.append(used.ru_utime + used.ru_stime)
                if name == "certify" and checkout == ROOT:
                    memory = used.ru_maxrss * 1024 / 1e6
        least = {checkout: min(times) for checkout, times in spent.items()}
        yield Row(part="warm", what=name, value=least[ROOT], unit="s", at_most=most)
        if other:
            value = least[ROOT] / least[other]
            yield Row(part="warm", what=f"{name}, ratio", value=value, at_most=ratio)
    what = "certify, largest memory"
    yield Row(part="warm", what=what, value=memory, unit="MB", at_most=LARGEST_MEMORY)
    text = _run(ROOT, f"certify r161 --out {folder / 'timed'}", "-X", "importtime", stderr=folder)
    packages: Counter[str] = Counter()
    for microseconds, package in IMPORT.findall(text):
        packages[package] += int(microseconds)
    for package, microseconds in packages.most_common(5):
        yield Row(part="import", what=package, value=microseconds / 1e3, unit="ms by the clock")


def _run(checkout: Path, words: str, *options: str, stderr: Path | None = None) -> Any:
    """Run a command; return its use of resources, or with a folder for stderr the text there."""
    log = open(stderr / "stderr", "w+b") if stderr else subprocess.DEVNULL  # noqa: SIM115
    python = sys.executable if checkout == ROOT else checkout / ".venv" / "bin" / "python"
    process = subprocess.Popen(
        [python, *options, "-m", "virtual_lab", *words.split()],
        cwd=checkout,
        stdout=subprocess.DEVNULL,
        stderr=log,
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, words
    return (stderr / "stderr").read_text("utf-8") if stderr else used


def _alone() -> Iterator[Row]:
    import virtual_lab as vl

    seeds = count()
    full = processor_seconds(lambda: vl.certify("r161", seed=next(seeds)), 20)
    yield Row(part="process", what="a certificate in full", value=full, unit="s", at_most=0.12)
    blocks = processor_seconds(certify_blocks("bbcor"), 4) / LABORATORIES / normal_time()
    what = "bbcor in blocks, a certificate"
    yield Row(part="process", what=what, value=blocks, unit="normals", at_most=50_000)
    summed = 1e3 * processor_seconds(certify_alone(RecordDetail.SUMMED), 50)
    what = "one summed laboratory alone"
    yield Row(part="process", what=what, value=summed, unit="ms", at_most=8)


def _first(cache: Path) -> Iterator[Row]:
    program = "from tests.benchmarks.start import print_compile_times as run; run()"
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=ROOT,
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        check=True,
        text=True,
    )
    functions: Counter[str] = Counter()
    for line in done.stdout.splitlines():
        what, times = json.loads(line)
        most = SHARE * COMPILED[what]
        yield Row(part="compile", what=what, value=sum(times.values()), unit="s", at_most=most)
        functions.update(times)
    for function, seconds in functions.most_common(10):
        yield Row(part="compile", what=function, value=seconds, unit="s")


def print_compile_times() -> None:
    """Print the compile time of each function [s] for each of `COMPILED`, as a line of JSON each.

    The time of a function does not include that of the functions it calls.
    """
    import virtual_lab as vl

    listener = _CompileTimes()
    event.register("numba:compile", listener)
    works = (
        lambda: vl.certify("r161", seed=7),
        lambda: vl.certify("r161", procedure="bbcor", seed=7),
        lambda: vl.coverage("r161", laboratories=2),
    )
    for what, work in zip(COMPILED, works, strict=True):
        listener.times.clear()
        work()
        print(json.dumps([what, listener.times]))


class _CompileTimes(event.Listener):
    """Listener of numba that adds up the processor time of each function."""

    def __init__(self) -> None:
        self.times: Counter[str] = Counter()
        self.begun: list[float] = []

    def on_start(self, event: event.Event) -> None:
        self.begun.append(time.process_time())

    def on_end(self, event: event.Event) -> None:
        taken = time.process_time() - self.begun.pop()
        function = event.data["dispatcher"].py_func
        self.times[f"{function.__module__.rpartition('.')[2]}.{function.__name__}"] += taken
        if self.begun:  # the time of the caller
            self.begun[-1] += taken


if __name__ == "__main__":
    main()
