"""Errors and times of methods to locate the ball: ``python -m tests.benchmarks.locating``.

All methods get the same pictures, cut from frames of 1280 x 800. Errors are root mean squares along
an axis; the limit is the Cramér-Rao bound of a plain ball in closed form. Times are processor
times on one core. Arguments are files for the rows as CSV; `--only` is followed by the parts to
measure.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")

import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

import cv2
import numpy as np

from tests.benchmarks.rows import Row, tell
from tests.benchmarks.trackpy_peer import TRACKPY
from tests.video.scenery.shot_study import hull_places, rms_error, sharp_places
from tests.video.scenery.shots import KINDS
from virtual_lab.fidelity.camera_errors import score_positions, seconds_per_picture
from virtual_lab.fidelity.camera_estimators import EDGE, ESTIMATORS, OURS
from virtual_lab.fidelity.camera_pictures import pictures
from virtual_lab.fidelity.camera_scenes import Case

RADII, BLURS, RATIOS = (15.0, 30.0, 60.0), (0.0, 6.0, 30.0), (96.0, 27.0, 5.0)
FIRST = Case()
SCENES = {
    "plain, flat": FIRST,
    "plain, slope": replace(FIRST, slope=0.5),
    "stitched, soft light": replace(FIRST, stitched=True, light="soft"),
    "stitched, back light": replace(FIRST, stitched=True, light="back"),
    "stitched, hard side light": replace(FIRST, stitched=True, light="hard side"),
    "25 % out of frame": replace(FIRST, cut=0.25),
    "25 % behind the bat": replace(FIRST, covered=0.25),
}
FEW = 13  # pictures per phase for all peers
SLOW = 5  # pictures per phase for trackpy, which takes 0.2 s for each
CLIPS = 40
MOST = {"plain": 0.005, "back": 0.015, "soft": 0.17, "hard": 0.08}  # largest errors of e_A [%]
MEMORY = 300.0  # largest memory [MB]


def main() -> None:
    """Measure, print the rows, and write them as CSV to the named files."""
    cv2.setNumThreads(1)
    warnings.simplefilter("ignore", UserWarning)  # trackpy, without a maximum
    words = sys.argv[1:]
    only = words[words.index("--only") + 1 :] if "--only" in words else list(PARTS)
    paths = words[: words.index("--only") if "--only" in words else None]
    tell("locating", _parts(only), paths)


def _parts(only: list[str]) -> Iterator[Row]:
    for part in only:
        print(part)
        yield from PARTS[part]()


def _shots() -> Iterator[Row]:
    """Yield the error of e_A per shot, on pictures rendered by another program."""
    for name, kind in KINDS.items():
        for way, places in (("edge fit", sharp_places), ("convex hull", hull_places)):
            yield Row(
                part="shots",
                what=f"{name}: {way}, e_A of a shot",
                value=100 * rms_error(kind, CLIPS, places),
                unit="%",
                at_most=MOST[name] if places is sharp_places else None,
                note=f"rms of {CLIPS} shots",
            )


def _plain() -> Iterator[Row]:
    """Yield the rms errors of a plain ball's positions, and their bias at every phase."""
    for seed, (radius, blur, snr) in enumerate(product(RADII, BLURS, RATIOS)):
        case = Case(radius=radius, blur=blur, snr=snr)
        batch = pictures(case, seed)
        score = score_positions(batch, OURS[EDGE](batch.inputs))
        still = pictures(replace(case, quiet=True, phases=32, repeats=1))
        bias = score_positions(still, OURS[EDGE](still.inputs)).bias
        yield Row(
            part="plain",
            what=f"R {radius:g}, L {blur:g}, SNR {snr:g}: rms",
            value=score.rms / batch.limit,
            unit="x limit",
            note=f"{score.rms:.4f} px; bias {bias:.2f} x limit at the worst of 32 phases; "
            f"lost {score.lost:.1%}, unsaid {score.unsaid:.1%}",
        )


def _peers() -> Iterator[Row]:
    """Yield errors and times of all estimators on the same pictures."""
    for scene, case in SCENES.items():
        batch = pictures(replace(case, repeats=FEW))
        few = pictures(replace(case, repeats=SLOW))
        for name, estimator in (ESTIMATORS | TRACKPY).items():
            sample = few if name in TRACKPY else batch
            score = score_positions(sample, estimator(sample.inputs))
            spent = seconds_per_picture(estimator, few.inputs, rounds=1)
            yield Row(
                part="peers",
                what=f"{scene}: {name}",
                value=score.rms if score.lost < 1 else np.nan,
                unit="px",
                note=f"{score.rms / batch.limit:.1f} x limit; {spent * 1e3:.2f} ms; "
                f"lost {score.lost:.0%}, flagged {score.flagged:.0%}, unsaid {score.unsaid:.1%}",
            )


def _memory() -> Iterator[Row]:
    output = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.streaming"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout.split()
    yield Row(
        part="memory",
        what=f"`track` of {output[1]} full frames",
        value=float(output[0]) / 1e6,
        unit="MB",
        at_most=MEMORY,
        note=f"peak of the whole process; {float(output[2]):.0f} s of processor time",
    )


PARTS: dict[str, Callable[[], Iterator[Row]]] = {
    "shots": _shots,
    "plain": _plain,
    "peers": _peers,
    "memory": _memory,
}

if __name__ == "__main__":
    main()
