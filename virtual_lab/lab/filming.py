"""Video of one shot of a test in whole frames, with the calibration file that `track` reads."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from pathlib import Path

from virtual_lab.measurement.reduction.flights import FlightReadings
from virtual_lab.records.session import Session
from virtual_lab.relations.flight import drag_rate
from virtual_lab.relations.pinhole import looking_down
from virtual_lab.simulation.stations.rig import FilmingStation, ShotPlan, Specimen
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

CALIBRATION = """\
# What the laboratory knows of its camera and of this shot. Axes of the rig: X along the flight,
# Y along the bat to its tip, Z up.
timestamps = "shot-0.csv"
exposure_s = {exposure!r}
lens_blur_px = {blur!r}
ball_diameter_m = {diameter!r}
drag_per_m = {drag!r}
drag_per_m_u = {drag_u!r}
gravity_mps2 = [0.0, 0.0, {fall!r}]

[camera]
image_size = {size}
matrix = [[{focal!r}, 0.0, {centre_x!r}], [0.0, {focal!r}, {centre_y!r}], [0.0, 0.0, 1.0]]
distortion = {distortion}
rotation = {rotation}
translation_m = {translation}
plane_height_m = {plane!r}
plane_height_u_m = {plane_u!r}
relative_scale_u = {scale_u!r}
"""


def film_of(
    station: FilmingStation,
    plan: ShotPlan,
    specimen: Specimen,
    draws: Draws,
    session: Session,
    timed: FlightReadings,
) -> Callable[[Path], None]:
    """Return a function that films the first shot at the bat and writes the video into a folder.

    The returned function takes the folder, which must exist. It writes the frames, their times, and
    the calibration file ``calibration.toml``.

    Parameters
    ----------
    station
        Station that fires balls at the bat and has a camera.
    plan
        Shots of the first round.
    specimen
        Tested bat and balls.
    draws
        Random numbers of the test.
    session
        Records of the test, with the bench readings of the bat.
    timed
        Flights of the shots as the gates read them. If the gates measure heights, the calibration
        file states the height of the ball at the bat.
    """
    sensor = station.camera.spec.sensor

    def film(folder: Path) -> None:
        station.film(plan, specimen, draws, folder)
        text = _calibration(session, timed, specimen.balls.spec.mass, (sensor.columns, sensor.rows))
        (folder / "calibration.toml").write_text(text, encoding="utf-8")

    return film


def _calibration(
    session: Session, timed: FlightReadings, ball_mass: float, size: tuple[int, int]
) -> str:
    """Return the calibration file of a session's camera, for a ball of `ball_mass` [kg].

    The ball's plane is at the height that the gates measured at the bat, if they did. `size` is the
    width and height of the camera's pictures [px].
    """
    import cv2
    import numpy as np

    constants = session.calibration

    def of(name: str) -> Estimate:
        return constants[f"impact.camera.{name}"]

    def value(name: str) -> float:
        return of(name).value

    turn = looking_down([value(f"tilt_{axis}") for axis in "xyz"])
    place = np.array([value(f"place_{axis}") for axis in "xyz"])
    air, coefficient = constants["hall.air.density"], constants["hall.air.drag_coefficient"]
    radius = constants["ball.radius"].value
    drag = float(drag_rate(air.value, coefficient.value, radius, ball_mass))
    share = hypot(air.u / (air.value or 1.0), coefficient.u / (coefficient.value or 1.0))
    best = {name: np.asarray(each.value) for name, each in constants.items()}
    flights = timed.correct(best, np.full(timed.raw.speed_in.shape, drag))
    height = float(np.nan_to_num(np.ravel(flights.offset)[0])) if timed.shows_height else 0.0
    scale_u = hypot(of("focal").u / value("focal"), of("place_z").u / value("place_z"))
    return CALIBRATION.format(
        exposure=value("exposure"),
        blur=value("blur"),
        diameter=2 * radius,
        drag=drag,
        drag_u=drag * share,
        fall=-constants["hall.gravity"].value,
        size=list(size),
        focal=value("focal"),
        centre_x=value("centre_x"),
        centre_y=value("centre_y"),
        distortion=[value(name) for name in ("k1", "k2", "p1", "p2", "k3")],
        rotation=cv2.Rodrigues(turn)[0].ravel().tolist(),
        translation=(-turn @ place).tolist(),
        plane=value("plane") + height,
        plane_u=of("plane").u,
        scale_u=scale_u,
    )
