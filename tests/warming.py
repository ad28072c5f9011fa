"""Compile the kernels once, before the tests' processes would all do so at the same time.

`python -m tests.warming bats` and so on for each of `PARTS`, in parallel.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

__all__ = ["kernels", "warm_kernels"]

ROOT = Path(__file__).parents[1]


def warm_kernels(tell: Callable[[str], object]) -> None:
    """Compile the kernels, one process per part, unless earlier runs left all of them on disk.

    `tell` prints a line. An interruption ends all processes, without a line of their own.
    """
    if all(map(_is_compiled, kernels())):
        return
    tell("compiling the numerical code, about a minute; later runs begin at once")
    command = [sys.executable, "-m", "tests.warming"]
    parts = [subprocess.Popen([*command, part], cwd=ROOT, start_new_session=True) for part in PARTS]
    try:
        for part in parts:
            part.wait()  # exit code ignored: a fault here also fails in a test, with its message
    finally:
        for part in parts:
            part.kill()


def kernels() -> list[Path]:
    """Return the modules whose functions are compiled and then kept on disk."""
    kept = re.compile(r"cache=True|\*\*KERNEL")
    modules = (ROOT / "virtual_lab").rglob("*.py")
    return [path for path in modules if kept.search(path.read_text("utf-8"))]


def _is_compiled(source: Path) -> bool:
    """Whether numba's cache has code of a module that is newer than its source."""
    indices = (source.parent / "__pycache__").glob(f"{source.stem}.*.nbi")
    return any(index.stat().st_mtime >= source.stat().st_mtime for index in indices)


def _bats() -> None:
    from tests.laboratories import certified
    from virtual_lab import lab

    for procedure in ("astm-f1881", "bbcor", "ncaa-besr"):
        certified(procedure=procedure)
        round_robin = lab.RoundRobin.of("r161", procedure)
        next(round_robin.run(1, 1))
        next(round_robin.blocks(2, 1))


def _scans() -> None:
    import numpy as np

    from virtual_lab import catalog
    from virtual_lab.measurement.procedure import Procedure, hit_weights_of, next_shots, shortfalls
    from virtual_lab.measurement.procedure.metric import Objective

    rules = catalog.load("procedures", "bbcor", Procedure).spec
    shot = np.arange(12.0)
    owner, place, valid = shot.astype(np.intp) % 2, 0.15 + 0 * shot, shot >= 0
    next_shots(rules, np.full(2, 0.15), owner, place, valid, shot)
    hit_weights_of(rules, 2, owner, place, valid, shot, Objective(shot, shot))
    shortfalls(rules, 2, owner, place, valid, shot)


def _camera() -> None:
    import numpy as np

    from tests.simulation.instruments.camera.scenes import (
        QUIET,
        SHOTS,
        bat_of,
        camera_of,
        course_of,
        spec_of,
    )
    from virtual_lab.fidelity.camera_estimators import EDGE, ESTIMATORS
    from virtual_lab.fidelity.camera_pictures import pictures
    from virtual_lab.fidelity.camera_scenes import Case

    for case in (Case(), Case(stitched=True, light="soft")):
        ESTIMATORS[EDGE](pictures(case).inputs)
    spec, course = spec_of("camera-overhead"), course_of()
    camera_of(spec, QUIET).watch(course, QUIET, "clip", np.arange(SHOTS), bat=bat_of(course))


def _motion() -> None:
    from tests.simulation.motion.scenes import play, scene

    play(scene(), "events")


def _alone() -> None:
    from tests.studies.paper.claims import CLAIMS
    from virtual_lab.studies.bats.profile import profiles

    profiles("r161", swings=(None,), ball="baseball-2003")[0]  # second contacts allowed
    next(claim for claim in CLAIMS if "r161 clamped against free" in claim.says).find()


def _others() -> None:
    _scans()  # scans first: the other process plays a test at one position before its scans
    _camera()
    _motion()
    _alone()


PARTS = {"bats": _bats, "others": _others}  # parts of similar duration

if __name__ == "__main__":
    PARTS[sys.argv[1]]()
