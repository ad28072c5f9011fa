"""The ball cannon with a high-speed camera above it, a second measurement of each shot.

The camera is fixed above the bat and looks down on the plane of flight. It films the incoming ball,
the bat and the rebound. The light boards time the same shots and measure the height of each ball,
which also gives its distance from the camera. The impact position is set at the cannon, so that the
bat stays at the position for which the camera was calibrated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from rigs.ball_cannon import BallCannon, BallCannonSpec, BallCannonStation, parts
from virtual_lab import catalog
from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import ClipRecord, Record
from virtual_lab.simulation.instruments import Instrument, InstrumentFactory, calibration_of
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.film import whole_frames, write_films
from virtual_lab.simulation.instruments.camera.scene import FilmedBat
from virtual_lab.simulation.instruments.camera.shots import Course
from virtual_lab.simulation.instruments.camera.spec import CameraSpec
from virtual_lab.simulation.physics.beam import beam_of, outer_diameter
from virtual_lab.simulation.stations.cannon_station import FiredShots
from virtual_lab.simulation.stations.rig import RigOutput, ShotPlan, Specimen
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

CLIP = "filmed-cannon.clip"
STATIONS = 80  # number of points of the bat's outline
Spin = Annotated[float, Ge(0), Dimension("angular speed")]


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmedCannonSpec(BallCannonSpec):
    """Data sheet of the rig: instruments of the ball cannon, camera, and spin of the balls."""

    camera: str
    # distance from the tip to the origin of the camera's Y
    over: Annotated[float, Gt(0), Dimension("length")]
    spin_in: Spin  # standard deviation about each axis
    spin_out: Spin


class FilmedCannon(BallCannon):
    """The filmed ball cannon."""

    name = "filmed-cannon"
    blocks = False  # a camera films in one laboratory at a time
    channels: Mapping[str, type[Record]] = {**BallCannon.channels, "camera": ClipRecord}

    def commission(self, draws: Draws, *, ideal: bool = False) -> FilmedCannonStation:
        spec = catalog.load("rigs", self.name, FilmedCannonSpec).spec
        factory = InstrumentFactory(draws=draws, ideal=ideal)
        camera = factory.commission(
            Camera.commission, CameraSpec, spec.camera, "filmed-cannon.camera"
        )
        return FilmedCannonStation(**parts(spec, factory), camera=camera, spec=spec)


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmedCannonStation(BallCannonStation):
    """The filmed ball cannon in one laboratory."""

    camera: Camera
    spec: FilmedCannonSpec

    def instruments(self) -> dict[str, Instrument]:
        return {**BallCannonStation.instruments(self), "camera": self.camera}

    @property
    def calibration(self) -> dict[str, Estimate]:
        over = Estimate(value=self.spec.over)
        return calibration_of(self.instruments()) | {"camera.over": over}

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Fire at the bat at rest, and time and film the ball in both directions."""
        fired = self.fire(plan, specimen, draws)
        timed = self.record_flights(fired, plan, draws)
        course, bat = self.scene(fired, plan, specimen, draws)
        clip, truth = self.camera.watch(course, draws, CLIP, plan.slot, plan.detail, bat)
        return RigOutput(records={**timed.records, "camera": clip}, truth={**timed.truth, **truth})

    def without_camera(self) -> BallCannonStation:
        """Return the rig with its camera off, which fires and times the same balls."""
        parts = {part.name: getattr(self, part.name) for part in fields(BallCannonStation)}
        return BallCannonStation(**parts)

    def frames(self, plan: ShotPlan, specimen: Specimen, draws: Draws, count: int) -> np.ndarray:
        """Return whole frames of the first shot of a plan, (count, row, column), from 0 to 1."""
        course, bat = self.scene(self.fire(plan, specimen, draws), plan, specimen, draws)
        pictures = whole_frames(self.camera, course, draws, CLIP, plan.slot, bat, count)
        return np.stack([grey for _, grey in pictures]) / self.camera.spec.sensor.full_scale

    def film(self, plan: ShotPlan, specimen: Specimen, draws: Draws, folder: Path) -> None:
        """Film the first shot of a plan in whole frames, with the same events as `play`."""
        fired = self.fire(plan, specimen, draws)
        course, bat = self.scene(fired, plan, specimen, draws)
        frames = whole_frames(self.camera, course, draws, CLIP, plan.slot, bat)
        write_films(folder / "shot-0", frames, self.camera.spec)

    def scene(
        self, fired: FiredShots, plan: ShotPlan, specimen: Specimen, draws: Draws
    ) -> tuple[Course, FilmedBat]:
        """Return the balls and the bat in front of the camera, in its calibrated axes."""
        body, radius = specimen.bat.body, fired.passage.radius

        def touching(place: float | np.ndarray, across: float | np.ndarray) -> np.ndarray:
            contact_distance = outer_diameter(body.profile, np.asarray(place)) / 2 + radius
            return np.asarray(np.sqrt(contact_distance**2 - np.square(across)))

        axis = body.length - self.holder.from_knob
        before = float(touching(self.spec.over, 0.0))  # from the ball's center to the bat's axis
        gap = touching(fired.bat.place, fired.bat.across) - before
        course = Course(
            passage=replace(fired.passage, plane=fired.passage.plane + gap),
            contact=fired.contact,
            leaving=fired.leaving,
            along=self.spec.over - fired.bat.place,
            spin_in=self._spin("in", self.spec.spin_in, plan, draws),
            spin_out=self._spin("out", self.spec.spin_out, plan, draws),
            stand=self._spin("stand", np.pi, plan, draws),
        )
        beam = beam_of(body)
        mass, lever = specimen.balls.mass[plan.ball], axis - fired.bat.place
        blow = (
            mass
            * fired.passage.speed_in
            * (1 + np.where(fired.flights.reached_bat, fired.impacts.efficiency, -1.0))
        )
        stations = np.linspace(0.0, body.length, STATIONS)
        bat = FilmedBat(
            pivot=(before, self.spec.over - axis),
            stations=axis - stations[::-1],
            half_widths=outer_diameter(body.profile, stations[::-1]) / 2,
            contact=fired.contact,
            rate=blow * lever / beam.inertia(axis),
        )
        return course, bat

    @staticmethod
    def _spin(name: str, scatter: float, plan: ShotPlan, draws: Draws) -> np.ndarray:
        numbers = draws.normal(f"filmed-cannon.spin.{name}", 3, plan.slot)
        return np.asarray(scatter * numbers)


RIG = FilmedCannon()
