"""Tests per second of a campaign: ``python -m tests.campaigns.rates rates.csv``.

Neighbors on a shared machine disturb such times: each row has the time of numpy's normal numbers
around it, and two ways that are to be compared take turns. Past start-up: from the first part to
the last.
"""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

import virtual_lab as vl
from tests.campaigns.kills import BY_DASK, WORKER, scheduler, started

STUDY = {"bats": ["r161"], "procedures": ["astm-f1881"], "seed": 1}
MANY, FEW, TURNS = 200_000, 81_920, 5  # number of laboratories, and per alternating run: ten parts


@dataclass(frozen=True, kw_only=True)
class Rate:
    """Speed of a campaign with one kind of workers."""

    way: str
    tests: int
    seconds: float  # total time [s]
    tests_a_second: float  # total time [s]
    past_start_up: float | None  # tests a second
    normal_ns: float  # time of one normal number [ns]
    normals_a_test: float  # start-up [share of the total time]
    bytes_a_test: float


def normal_ns() -> float:
    """Return the time of one normal number of numpy [ns], the median of nine tries."""
    generator, times = np.random.default_rng(1), []
    for _ in range(9):
        begun = time.perf_counter()
        generator.standard_normal(10**6)
        times.append(1e3 * (time.perf_counter() - begun))
    return median(times)


def rate(way: str, laboratories: int) -> Rate:
    """Return the rate for ``1 worker``, ``2 workers``, ``2 separate`` or ``2 of Dask``."""
    seen: list[tuple[float, int]] = []

    def progress(_text: str, done: int = 0, _total: int = 0) -> None:
        seen.append((time.monotonic(), done))

    with TemporaryDirectory() as place:
        folder, study = Path(place) / "campaign", {**STUDY, "laboratories": laboratories}
        vl.campaign(study, folder, blocks="1/1000000")  # file that is no part
        before, begun = normal_ns(), time.monotonic()
        if way == "2 separate":
            words = [sys.executable, "-m", "virtual_lab", "campaign", "resume", str(folder)]
            shares = [[*words, "--blocks", f"{one}/2"] for one in (1, 2)]
            for each in [subprocess.Popen(share, stdout=subprocess.DEVNULL) for share in shares]:
                assert each.wait() == 0
        elif way == "2 of Dask":
            vl.campaign(None, folder, dask=BY_DASK[1], progress=progress)
        else:
            vl.campaign(None, folder, workers=int(way[0]), progress=progress)
        seconds, after = time.monotonic() - begun, normal_ns()
        parts = list((folder / "parts").iterdir())
        size = sum(path.stat().st_size for path in parts)
        assert len(vl.Campaign.open(folder).table) == laboratories
    steps = [(at, done) for at, done in seen if done]
    past = (steps[-1][1] - steps[0][1]) / (steps[-1][0] - steps[0][0]) if steps else None
    normal = (before + after) / 2
    return Rate(
        way=way,
        tests=laboratories,
        seconds=seconds,
        tests_a_second=laboratories / seconds,
        past_start_up=past,
        normal_ns=normal,
        normals_a_test=seconds / laboratories / normal * 1e9,
        bytes_a_test=size / laboratories,
    )


def main(path: str) -> None:
    """Write the table: many laboratories once, few in alternating runs."""
    rows = [rate(way, MANY) for way in ("1 worker", "2 workers")]
    rows += [rate(way, FEW) for _ in range(TURNS) for way in ("2 workers", "2 separate")]
    with ExitStack() as stack:
        stack.enter_context(scheduler())
        for _ in range(2):
            stack.enter_context(started(*WORKER))
        time.sleep(10)
        rate("2 of Dask", FEW)  # workers import what they need
        rows += [rate(way, FEW) for _ in range(TURNS) for way in ("2 workers", "2 of Dask")]
    table = pd.DataFrame(rows)
    table.round(3).to_csv(path, index=False)
    print(table.to_string())


if __name__ == "__main__":
    main(sys.argv[1])
