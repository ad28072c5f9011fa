"""A few shots filmed by cameras of the catalog."""

from dataclasses import replace

import numpy as np

from virtual_lab import catalog
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.scene import FilmedBat
from virtual_lab.simulation.instruments.camera.shots import Course
from virtual_lab.simulation.instruments.camera.spec import CameraSpec
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.streams import Draws, Quiet, Streams

SHOTS = 3
TOUCHED = 7e-4  # contact time [s]


def spec_of(name: str, **changes: object) -> CameraSpec:
    """Return a camera sheet of the catalog with few frames per shot, changed by `changes`."""
    spec = catalog.load("instruments", name, CameraSpec).spec
    return replace(spec, **{"frames_in": 12, "frames_out": 20, "empty_frames": 2, **changes})


def camera_of(spec: CameraSpec, draws: Draws) -> Camera:
    """Return a camera of a sheet."""
    return Camera.commission(spec, draws, "camera")


def course_of(seed: int = 5) -> Course:
    """Return flights at about 62.6 m/s in and 13 m/s out, with spin, slope and drag."""
    draws = Streams(seed)
    contact = 0.0123 + 1e-4 * draws.normal("contact", SHOTS)
    passage = Passage(
        speed_in=62.6 + draws.normal("in", SHOTS),
        speed_out=13 + draws.normal("out", SHOTS),
        drag=np.full(SHOTS, 0.0069),
        radius=0.0365,
        gravity=9.80665,
        height=3e-3 * draws.normal("height", SHOTS),
        slope_in=2e-3 * draws.normal("slope", SHOTS),
        slope_out=0.05 * draws.normal("rise", SHOTS),
    )
    return Course(
        passage=passage,
        contact=contact,
        leaving=contact + TOUCHED,
        along=2e-3 * draws.normal("along", SHOTS),
        spin_in=20 * draws.normal("spin in", (SHOTS, 3)),
        spin_out=100 * draws.normal("spin out", (SHOTS, 3)),
        stand=2 * draws.normal("stand", (SHOTS, 3)),
    )


def bat_of(course: Course) -> FilmedBat:
    """Return a bat whose surface is at the ball's surface at contact, and which recoils."""
    stations = np.linspace(-0.1, 0.75, 60)
    return FilmedBat(
        pivot=(0.0695, -0.6),
        stations=stations,
        half_widths=np.interp(stations, [-0.1, 0.25, 0.55, 0.75], [0.012, 0.016, 0.033, 0.033]),
        contact=course.contact,
        rate=np.full(SHOTS, 12.0),
    )


QUIET = Quiet()
