"""Benchmark of the collision solver: ``python -m tests.benchmarks.collision``.

It measures speed against peers on the same core in the same run, largest errors on many scenes
(which takes a quarter of an hour), the surrogate, and memory. Rows state the target and whether it
was reached.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from tests.benchmarks.accuracy import SCENES, accuracy
from tests.benchmarks.machine import seconds
from tests.benchmarks.rows import Row, line, write_csv
from tests.benchmarks.scenes import default_model
from tests.benchmarks.speed import speed
from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.surrogate import Surrogate

__all__ = ["main"]

SURROGATE = "surrogate of the default model: R161, the box of `model chart collision`"
MEMORY = "memory"
TOLERANCES = (1e-4, 1e-5, 1e-6)
POINTS, SEED = 100_000, 11
BATCH, MOST = 1_000_000, 1.0  # scenes, and largest growth of memory [GB]


def main() -> None:
    """Measure the chosen parts, and print each row as it comes."""
    chosen = _arguments()
    parts: dict[str, Callable[[], Iterator[Row]]] = {
        "speed": speed,
        "accuracy": lambda: accuracy(chosen.scenes, chosen.seed),
        "surrogate": surrogate,
        "memory": memory,
    }
    used = ", ".join(f"{package} {version(package)}" for package in ("numpy", "scipy", "numba"))
    print(f"collision solver, {datetime.now(UTC):%Y-%m-%d}, one core; {used}")
    print("columns: value and unit, largest error of e_A in the same run, figure to reach, note")
    rows, last = [], ""
    for name, measure in parts.items():
        if chosen.only not in (None, name):
            continue
        for row in measure():
            if row.part != last:
                print(f"\n{row.part}")
            last = row.part
            rows.append(row)
            print(line(row), flush=True)
    if chosen.csv:
        write_csv(rows, chosen.csv)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--only", choices=("speed", "accuracy", "surrogate", "memory"))
    parser.add_argument("--scenes", type=int, default=SCENES, help="of accuracy (%(default)s)")
    parser.add_argument(
        "--seed", type=int, default=1, help="of accuracy: other seeds, fresh scenes"
    )
    parser.add_argument("--csv", type=Path, help="write the rows here too")
    return parser.parse_args()


def surrogate() -> Iterator[Row]:
    """Yield the times and errors of building and using the surrogate."""
    import numpy as np

    from virtual_lab.fidelity.collision_chart import _box

    model, box = default_model("r161"), _box()
    scenes = box.scenes(np.random.default_rng(SEED).uniform(-1, 1, (4, POINTS)))
    true = model.collide(scenes).collision_efficiency
    for tolerance in TOLERANCES:
        what = f"surrogate, tolerance {tolerance:g}"
        try:
            built = Surrogate.build(model, box, tolerance=tolerance)
        except InputError as problem:
            yield Row(part=SURROGATE, what=what, note=f"skipped: {problem}")
            continue
        time = seconds(lambda at=tolerance: Surrogate.build(model, box, tolerance=at))
        note = f"{built.coefficients.size} nodes"
        yield Row(part=SURROGATE, what=f"{what}: build", value=time * 1e3, unit="ms", note=note)
        error = float(np.abs(built.efficiency(scenes) - true).max())
        time = seconds(lambda chart=built: chart.efficiency(scenes)) / POINTS
        yield Row(
            part=SURROGATE,
            what=f"{what}: a shot",
            value=time * 1e9,
            unit="ns",
            error=error,
            note=f"error on {POINTS} points; {built.error:.1e} by its own",
        )


def memory() -> Iterator[Row]:
    """Measure the growth of memory in a separate process, which keeps nothing else."""
    what = f"memory, growth in {BATCH:,} collisions, default model"
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.memory", str(BATCH)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        reason = done.stderr.strip().splitlines()[-1]
        yield Row(part=MEMORY, what=what, note=f"skipped: {reason}")
        return
    yield Row(part=MEMORY, what=what, value=int(done.stdout) / 1e9, unit="GB", at_most=MOST)


if __name__ == "__main__":
    main()
