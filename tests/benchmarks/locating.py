"""What each way of locating the ball is worth: ``python -m tests.benchmarks.locating``.

The same pictures for all, cut from frames of 1280 x 800. Errors are root mean squares along an
axis; the bound is Cramer and Rao's of a plain ball with its radius unknown. Rates are in the
processor's own time on one core. A file's name as argument takes the rows as CSV; after `--only`
come the parts wanted.
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

from tests.benchmarks.machine import processor_seconds
from tests.benchmarks.rows import Row, tell
from tests.benchmarks.trackpy_peer import DEFAULTS, TRACKPY
from tests.video.scenes import Film
from virtual_lab.fidelity.camera_errors import score, seconds_a_picture
from virtual_lab.fidelity.camera_estimators import ESTIMATORS, OURS, PLAIN, SHARED, SHIPPED
from virtual_lab.fidelity.camera_pictures import pictures
from virtual_lab.fidelity.camera_scenes import BACK, HARD, SOFT, Batch, Case
from virtual_lab.video.find.blobs import blobs
from virtual_lab.video.find.still import still_of

RADII, BLURS = (15.0, 30.0, 60.0), (0.0, 6.0, 30.0, 80.0)
RATIOS, RISES = (96.0, 27.0, 5.0), (0.0, 25.0)  # rises: of the background over the ball [DN]
BLOCKS = 4
FIRST = Case()
SCENES = {
    "plain, flat": FIRST,
    "plain, slope": replace(FIRST, slope=0.5),
    "stitched, soft light": replace(FIRST, stitched=True, light=SOFT),
    "stitched, back light": replace(FIRST, stitched=True, light=BACK),
    "stitched, hard side light": replace(FIRST, stitched=True, light=HARD),
    "25 % out of frame": replace(FIRST, cut=0.25),
    "25 % behind the bat": replace(FIRST, covered=0.25),
}
AIMS = {SOFT: 0.010, BACK: 0.005, HARD: 0.10}  # pixels
MANY = 75  # pictures a phase of stitched balls: the worst are rare
FEW = 13  # pictures a phase where the slow take part
SLOW = 5  # pictures a phase that trackpy sees: it takes 0.2 s each
MEMORY = 300.0  # MB


def main() -> None:
    """Measure and print; with the name of a file, write the rows there too."""
    cv2.setNumThreads(1)
    warnings.simplefilter("ignore", UserWarning)  # trackpy's, of pictures without a maximum
    words = sys.argv[1:]
    only = words[words.index("--only") + 1 :] if "--only" in words else list(PARTS)
    paths = words[: words.index("--only") if "--only" in words else None]
    tell("locating", _parts(only), paths)


def _parts(only: list[str]) -> Iterator[Row]:
    for part in only:
        print(part)
        yield from PARTS[part]()


def _plain() -> Iterator[Row]:
    """Yield the spread of the plain ball's places, and their bias at every phase."""
    cases = product(RADII, BLURS, RATIOS, RISES)
    for seed, (radius, blur, snr, rise) in enumerate(cases):
        case = Case(radius=radius, blur=blur, snr=snr, slope=rise / (2 * radius + blur))
        name = f"R {radius:g}, L {blur:g}, SNR {snr:g}, rise {rise:g}"
        batches = (pictures(case, seed, block) for block in range(BLOCKS))
        scores = [score(batch, OURS[PLAIN](batch.given)) for batch in batches]
        aim = 1.3 if blur > 2 * radius else 1.1
        over, off = (
            float(np.sqrt(np.mean(np.square([getattr(each, name) for each in scores]))))
            for name in ("over_bound", "rms")
        )
        lost, unsaid = (
            float(np.mean([getattr(each, name) for each in scores])) for name in ("lost", "unsaid")
        )
        yield Row(
            part="plain",
            what=f"{name}: rms",
            value=over,
            unit="x CRLB",
            at_most=aim,
            note=f"+- 0.02; {off:.4f} px; lost {lost:.1%}, unsaid {unsaid:.1%}",
        )
        still = pictures(replace(case, quiet=True, phases=32, repeats=1))
        yield Row(
            part="plain",
            what=f"{name}: bias",
            value=score(still, OURS[PLAIN](still.given)).bias,
            unit="x CRLB",
            at_most=0.2,
            note="without noise, worst of 32 phases",
        )


def _phases() -> Iterator[Row]:
    """Yield the bias that noise leaves, from many pictures at each phase."""
    means = []
    batch = pictures(FIRST)
    for block in range(8):
        batch = pictures(replace(FIRST, repeats=50), block=block)
        found = OURS[PLAIN](batch.given)
        off = np.stack([found.x - batch.x, found.y - batch.y]) / batch.x_bound
        means.append(off.reshape(2, FIRST.phases, -1).mean(axis=2))
    for axis, of_phase in zip("xy", np.mean(means, axis=0), strict=True):
        for phase, mean in enumerate(of_phase):
            yield Row(
                part="phases",
                what=f"plain, flat, bias in {axis} at phase {phase / FIRST.phases:g}",
                value=abs(mean),
                unit="x CRLB",
                at_most=0.2,
                note="400 pictures: +- 0.05",
            )


def _peers() -> Iterator[Row]:
    """Yield every estimator on the same pictures."""
    for scene, case in SCENES.items():
        batch = pictures(replace(case, repeats=FEW))
        few = pictures(replace(case, repeats=SLOW))
        still = pictures(replace(case, quiet=True, phases=32, repeats=1))
        for name, estimator in (ESTIMATORS | TRACKPY).items():
            seen = few if name in TRACKPY else batch
            found = score(seen, estimator(seen.given))
            spent = seconds_a_picture(estimator, few.given, rounds=1)
            said = f"{found.over_bound:.1f} x CRLB; {spent * 1e3:.2f} ms"
            if not case.stitched:
                bias = score(still, estimator(still.given)).bias
                said += f"; bias {bias:.2g} x CRLB, without noise"
            yield Row(
                part="peers",
                what=f"{scene}: {name}",
                value=found.rms if found.lost < 1 else np.nan,
                unit="px",
                note=f"{said}; lost {found.lost:.0%}, flagged {found.flagged:.0%}, "
                f"unsaid {found.unsaid:.1%}",
            )


def _stitched() -> Iterator[Row]:
    """Yield the stitched ball's places by the method made for it."""
    for light, blur in product((SOFT, BACK, HARD), (0.0, 2.0, 6.0)):
        yield from _held(Case(stitched=True, light=light, blur=blur), AIMS[light])
    for light, radius, snr in product((SOFT, BACK), (15.0, 60.0), (96.0, 27.0)):
        yield from _held(Case(stitched=True, light=light, radius=radius, snr=snr), AIMS[light])


def _held(case: Case, aim: float) -> Iterator[Row]:
    batch = pictures(replace(case, repeats=MANY))
    found = score(batch, SHIPPED[SHARED](batch.given))
    name = f"{case.light}, R {case.radius:g}, L {case.blur:g}, SNR {case.snr:g}"
    yield Row(
        part="stitched",
        what=name,
        value=found.rms,
        unit="px",
        at_most=max(aim, 1.3 * float(batch.x_bound.max())),
        note=f"{found.over_bound:.1f} x CRLB; lost {found.lost:.1%}, flagged {found.flagged:.0%}",
    )
    yield Row(
        part="stitched",
        what=f"{name}: unflagged outliers",
        value=100 * found.unsaid,
        unit="%",
        at_most=0.0,
        note="off by more than 5 of their own u",
    )


def _hidden() -> Iterator[Row]:
    for scene, aim in (("25 % out of frame", 0.005), ("25 % behind the bat", 0.010)):
        batch = pictures(SCENES[scene])
        found = score(batch, OURS[PLAIN](batch.given))
        note = f"{found.over_bound:.1f} x CRLB of what is seen" if "frame" in scene else ""
        yield Row(part="hidden", what=scene, value=found.rms, unit="px", at_most=aim, note=note)


def _rates() -> Iterator[Row]:
    """Yield regions a second, and that over trackpy's in the same run."""
    batch: Batch = pictures(FIRST)
    few = pictures(replace(FIRST, repeats=1))
    peers = {name: seconds_a_picture(peer, few.given) for name, peer in TRACKPY.items()}
    errors = {name: score(few, peer(few.given)).rms for name, peer in TRACKPY.items()}
    for name, estimator in (OURS | SHIPPED).items():  # noise and lens are learnt once a clip
        spent = seconds_a_picture(estimator, batch.given)
        yield Row(
            part="rates",
            what=f"{name}, R 30, L 2",
            value=1 / spent,
            unit="1/s",
            at_least=1000.0 if name in (PLAIN, SHARED) else None,
            note=f"error {score(batch, estimator(batch.given)).rms:.4f} px",
        )
        for peer, slow in peers.items():
            yield Row(
                part="rates",
                what=f"{name}, over {peer}",
                value=slow / spent,
                unit="x",
                at_least=100.0 if name == PLAIN and peer == DEFAULTS else None,
                note=f"its error {errors[peer]:.4f} px",
            )
    stitched = pictures(SCENES["stitched, soft light"])
    for name in ("edge fit", SHARED):
        estimator = (OURS | SHIPPED)[name]
        yield Row(
            part="rates",
            what=f"{name}, stitched, R 30, L 2",
            value=1 / seconds_a_picture(estimator, stitched.given),
            unit="1/s",
            note=f"error {score(stitched, estimator(stitched.given)).rms:.4f} px",
        )


def _finding() -> Iterator[Row]:
    """Yield the time it takes to find the ball in a full frame."""
    film = Film(shape=(800, 1280), radius=30.0, contact=(900.0, 400.0), count=20, bat=True)
    frames = np.stack(list(film.frames()))
    still, none = still_of(list(frames), 8, stands=True), np.zeros(2)
    off = []
    for frame, x, y in zip(frames, *film.places(), strict=True):
        found = blobs(0, frame, still.shrunk(frame), none, still)
        off.append(float(np.hypot(found["x"] - x, found["y"] - y).min()))
    spent = processor_seconds(
        lambda: blobs(0, frames[3], still.shrunk(frames[3]), none, still), rounds=50
    )
    note = f"off by {np.median(off):.2f} px, at worst {max(off):.2f}"
    yield Row(
        part="finding",
        what="ball found in a full frame",
        value=spent * 1e3,
        unit="ms",
        at_most=12.0,
        note=note,
    )
    import trackpy

    away = cv2.absdiff(frames[3], still.background)
    for name, work in {
        "trackpy locate": lambda: trackpy.locate(
            away, 71, topn=1, noise_size=10, percentile=99, characterize=False
        ),
        "HoughCircles": lambda: cv2.HoughCircles(
            away, cv2.HOUGH_GRADIENT, 1, 50, param1=120, param2=20, minRadius=25, maxRadius=35
        ),
    }.items():
        spent = processor_seconds(work, rounds=1)
        yield Row(part="finding", what=f"{name} in it", value=spent * 1e3, unit="ms")


def _memory() -> Iterator[Row]:
    told = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.streaming"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout.split()
    yield Row(
        part="memory",
        what=f"`track` of {told[1]} full frames",
        value=float(told[0]) / 1e6,
        unit="MB",
        at_most=MEMORY,
        note=f"peak of the whole process; {float(told[2]):.0f} s of processor time",
    )


PARTS: dict[str, Callable[[], Iterator[Row]]] = {
    "plain": _plain,
    "phases": _phases,
    "peers": _peers,
    "stitched": _stitched,
    "hidden": _hidden,
    "rates": _rates,
    "finding": _finding,
    "memory": _memory,
}

if __name__ == "__main__":
    main()
