"""Memory for tracking a ball through a long clip of full frames.

Run in a separate process; prints the peak [B], the number of frames, and the processor time [s].
Another process writes the clip, so that its memory does not count.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

COUNT, RATE = 2000, 5000.0
BANKS = 8  # number of pictures with different noise


def main(folder: Path) -> None:
    """Track a clip and print the memory, frames and time."""
    import cv2

    from tests.benchmarks.memory import _status
    from tests.video.follow.test_sharp_clips import track_hit
    from virtual_lab.video.clips.calibration_file import ClipCalibration

    cv2.setNumThreads(1)
    path = folder / "clip.mp4"
    command = [sys.executable, "-m", "tests.benchmarks.streaming", "--write", str(path)]
    subprocess.run(command, check=True)
    calibration = ClipCalibration(frames_per_second=RATE, metres_per_pixel=1e-3, exposure_s=1e-5)
    begun = time.process_time()
    followed = track_hit(path, calibration)
    assert followed.sharp is not None
    assert len(followed.sharp.frames) > COUNT // 2
    print(_status("VmHWM"), COUNT, time.process_time() - begun)


def write(path: Path) -> None:
    """Write a lossless clip of a ball that crosses full frames and returns."""
    from dataclasses import replace

    import numpy as np

    from tests.video.scenes import Film, matte
    from virtual_lab.simulation.instruments.camera.film import write_clip

    film = Film(
        shape=(800, 1280),
        radius=30.0,
        contact=(1180.0, 400.0),
        velocity_in=(1.1, 0.05),
        velocity_out=(-1.0, 0.1),
        before=COUNT / 2,
        count=COUNT,
    )
    behind = np.stack(list(replace(film, count=BANKS, before=-9 * COUNT).frames()))

    def frames() -> Iterator[tuple[float, Any]]:
        for k, (x, y) in enumerate(zip(*film.places(), strict=True)):
            picture, share = behind[k % BANKS], matte(film.shape, x, y, film.radius)
            grey = np.round(picture * (1 - share) + film.light * share).astype(np.uint8)
            yield k / RATE, grey

    write_clip(path, frames(), RATE)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--write"]:
        write(Path(sys.argv[2]))
    else:
        with tempfile.TemporaryDirectory() as made:
            main(Path(made))
