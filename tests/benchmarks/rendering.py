"""Rendered regions and full frames per second: ``python -m tests.benchmarks.rendering``.

Times are processor times on one core, which neighbors on a shared machine disturb less than
wall-clock time. Compilation is not included.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")

import sys
from collections.abc import Callable, Iterator
from itertools import islice

import numpy as np

from tests.benchmarks.machine import processor_seconds
from tests.benchmarks.rows import Row, tell
from tests.simulation.instruments.camera.scenes import bat_of, camera_of, course_of, spec_of
from virtual_lab import catalog
from virtual_lab.simulation.instruments.camera.ball import Light, axes_of, render_balls
from virtual_lab.simulation.instruments.camera.film import whole_frames
from virtual_lab.simulation.instruments.camera.spec import BallLook
from virtual_lab.streams import Streams

REGIONS, SIDE, FRAMES, ROUNDS = 300, 80, 25, 5
REGION_GOAL, FRAME_GOAL = 1000.0, 25.0
CENTRE = 39.5
LOOKS = {
    "plain": BallLook(albedo=0.85, seam_contrast=0.0),
    "stitched": BallLook(albedo=0.85, seam_contrast=0.6),
}
SOFT = Light(ambient=0.6, softness=0.6)


def main() -> None:
    """Measure, print the rows, and write them as CSV to the named files."""
    tell("rendering", _rows(), sys.argv[1:])


def _rows() -> Iterator[Row]:
    for name, look in LOOKS.items():
        for blur in (0.0, 2.0, 6.0, 40.0):
            goal = REGION_GOAL if blur <= 6 else None
            rate = REGIONS / processor_seconds(_balls(look, blur), ROUNDS)
            yield Row(
                part="regions",
                what=f"{name}, R 30, blur {blur:g} px, {SIDE} x {SIDE}",
                value=rate,
                unit="1/s",
                at_least=goal,
            )
    noisy = REGIONS / processor_seconds(_exposed(), ROUNDS)
    yield Row(part="regions", what="stitched, blur 2 px, with noise", value=noisy, unit="1/s")
    for name in (name for name in catalog.names("instruments") if name.startswith("camera-")):
        rate = FRAMES / processor_seconds(_frames(name), ROUNDS)
        yield Row(
            part="frames",
            what=f"{name}, ball, bat and noise",
            value=rate,
            unit="1/s",
            at_least=FRAME_GOAL,
        )


def _balls(look: BallLook, blur: float) -> Callable[[], np.ndarray]:
    """Return a function that renders balls at all phases and in random orientations."""
    draws = Streams(1)
    middle = CENTRE + draws.uniform("phase", (REGIONS, 1, 2))
    way = blur / 2 * np.array([[-1.0, -0.1], [1.0, 0.1]])
    orientation = axes_of(2 * draws.normal("axes", (REGIONS, 3)))
    corners = np.zeros((REGIONS, 2))

    def work() -> np.ndarray:
        rendered = render_balls(
            middle + way,
            30.0,
            corners,
            (SIDE, SIDE),
            sigma=0.65,
            look=look,
            light=SOFT,
            orientation=orientation,
        )
        return rendered.over(500.0, 20_000.0)

    return work


def _exposed() -> Callable[[], object]:
    balls = _balls(LOOKS["stitched"], 2.0)
    camera = camera_of(spec_of("camera-overhead"), Streams(1))
    corners = np.tile([[400, 300]], (REGIONS, 1))
    return lambda: camera.sensor.expose(balls(), corners, Streams(2), "regions")


def _frames(name: str) -> Callable[[], object]:
    spec = spec_of(name, frames_in=FRAMES, frames_out=FRAMES)
    camera, course = camera_of(spec, Streams(1)), course_of()
    bat = bat_of(course)

    def work() -> object:
        return [
            grey[0, 0]
            for _, grey in islice(
                whole_frames(camera, course, Streams(2), "f", np.arange(3), bat),
                FRAMES,
            )
        ]

    return work


if __name__ == "__main__":
    main()
