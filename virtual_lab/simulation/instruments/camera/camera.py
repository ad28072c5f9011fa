"""The camera of one laboratory: frames of the flights, and the records that it writes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sqrt
from statistics import NormalDist
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records import ClipRecord, TrackRecord
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, draw_constants
from virtual_lab.simulation.instruments.camera.ball import Light, render_balls
from virtual_lab.simulation.instruments.camera.lens import TrueLens
from virtual_lab.simulation.instruments.camera.scene import FilmedBat, background, flicker, windows
from virtual_lab.simulation.instruments.camera.sensor import Sensor
from virtual_lab.simulation.instruments.camera.shots import Course, Frames
from virtual_lab.simulation.instruments.camera.spec import CameraSpec
from virtual_lab.streams import Draws, Slots
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

Pixels = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Camera(CalibratedInstrument[CameraSpec]):
    """A camera with its true lens, pose, clock and sensor."""

    sensor: Sensor

    @classmethod
    def commission(cls, spec: CameraSpec, draws: Draws, name: str) -> Self:
        sensor = Sensor.commission(spec.sensor, draws, f"{name}.sensor")
        return cls(spec, *draw_constants(spec.certificate(), draws, name), sensor)

    def exact(self) -> dict[str, Estimate]:
        clock = self.spec.clock
        return {
            "exposure": Estimate(value=clock.exposure),
            "jitter": Estimate(value=clock.jitter),
            "blur": Estimate(value=self.spec.blur),
        } | self.sensor.calibration()

    def errors(self) -> dict[str, float]:
        return {**self.true, **self.sensor.errors()}

    def with_true(self, **true: float) -> Self:
        of_camera = {key: value for key, value in true.items() if key in self.true}
        others = {key: value for key, value in true.items() if key not in of_camera}
        return replace(
            self, true={**self.true, **of_camera}, sensor=self.sensor.with_true(**others)
        )

    @property
    def lens(self) -> TrueLens:
        """True lens and pose."""
        return TrueLens.of(self.true)

    @property
    def clock(self) -> float:
        """Seconds of the camera's clock per true second."""
        return float(self.true["clock"])

    @property
    def plane(self) -> float:
        """Height of the rig's line of fire in the calibrated axes [m]."""
        return float(self.true["plane"])

    def frames(
        self, course: Course, draws: Draws, name: str, slots: Slots, *, whole: bool = False
    ) -> Frames:
        """Return the frames of a batch of shots that show the center of the ball.

        With `whole` the frames without the ball are returned too. The camera runs freely, so the
        contact occurs at a random time between two frames.
        """
        spec, lens, clock = self.spec, self.lens, self.clock
        lift = np.array([0.0, 0.0, self.plane])
        shots, rate, exposure = len(course.contact), spec.clock.frame_rate, spec.clock.exposure
        phase = draws.uniform(f"{name}.phase", slots=slots)
        first = np.ceil(course.contact * rate * clock - phase) - spec.frames_in
        count = spec.frames_in + spec.frames_out
        stamps = (first[:, None] + np.arange(count) + phase[:, None]) / rate
        times = stamps / clock
        missing = draws.uniform(f"{name}.lost", count, slots) + 0.5 < spec.clock.drop_rate
        shot = np.repeat(np.arange(shots), count)
        position = course.at(shot, times.ravel())
        image = lens.to_pixels(lens.to_camera(position + lift))
        inside = (image >= -0.5).all(axis=1)
        inside &= (image < [spec.sensor.columns - 0.5, spec.sensor.rows - 0.5]).all(axis=1)
        recorded = (inside.reshape(shots, count) | whole) & ~missing
        row, column = np.nonzero(recorded)
        time = times[row, column]
        ends = time + exposure / 2 * np.array([[-1.0], [1.0]])
        touch = np.clip([course.contact[row], course.leaving[row]], ends[0], ends[1])
        points = np.stack([ends[0], touch[0], touch[1], ends[1]], axis=1)
        path = np.stack(
            [lens.to_pixels(lens.to_camera(course.at(row, when) + lift)) for when in points.T],
            axis=1,
        )
        jitter = spec.clock.jitter * draws.normal(f"{name}.jitter", count, slots)
        axes, spin = course.axes(row, time)
        centres = position.reshape(shots, count, 3)[row, column]
        return Frames(
            layout=(shots, count),
            shot=row,
            number=(np.cumsum(recorded, axis=1) - 1)[row, column],
            time=time,
            stamp=(stamps + jitter)[row, column],
            position=centres,
            path=path,
            shares=(points - ends[0][:, None]) / exposure,
            axes=axes,
            turn=spin * exposure,
            outlines=lens.outlines(centres + lift, course.passage.radius),
            brightness=flicker(spec, time, draws.uniform(f"{name}.flicker", slots=slots)[row]),
        )

    def watch(
        self,
        course: Course,
        draws: Draws,
        name: str,
        slots: Slots,
        detail: RecordDetail = RecordDetail.FULL,
        bat: FilmedBat | None = None,
    ) -> tuple[ClipRecord | TrackRecord, dict[str, Array]]:
        """Return the record of a batch of shots, and the true values of its frames.

        The true values are the result of `Frames.truth`, (shot, frame, …), NaN for a missing frame.
        """
        frames = self.frames(course, draws, name, slots)
        if detail is RecordDetail.FULL:
            return self._clip(frames, draws, name, slots, bat), frames.truth()
        return self._track(frames, draws, name, slots), frames.truth()

    def render(
        self, frames: Frames, corners: NDArray[np.int64], behind: Pixels, bat: FilmedBat | None
    ) -> Pixels:
        """Return the expected electrons in windows of the picture, (n, row, column).

        `corners`, (n, 2), are the first pixel (x, y) of each window. `behind`, (n, row, column),
        are the electrons without ball and bat, for steady lamps.
        """
        spec = self.spec
        balls = render_balls(
            frames.path,
            frames.outlines.radius,
            corners,
            (behind.shape[1], behind.shape[2]),
            sigma=spec.blur,
            look=spec.ball,
            light=self.light,
            orientation=frames.axes @ self.lens.rotation.T,
            turn=frames.turn @ self.lens.rotation.T,
            times=frames.shares,
            warp=frames.outlines.warp,
            view=frames.outlines.view,
        )
        steady = balls.over(behind, spec.light.ball * spec.electrons_per_rate)
        if bat is not None:
            self.put(bat, bat.angle(frames.shot, frames.time), corners, steady)
        return np.asarray(steady * frames.brightness[:, None, None], np.float32)

    def put(
        self, bat: FilmedBat, angle: Array, corners: NDArray[np.int64], electrons: Pixels
    ) -> None:
        """Draw a bat at angles (n,) [rad] into windows with the first pixels `corners`, (n, 2)."""
        from virtual_lab.simulation.instruments.camera.scene_kernel import hide_behind

        spec, light = self.spec, self.light
        near, far = bat.edges(angle, self.lens)
        hide_behind(
            near,
            far,
            corners,
            np.array([*light.toward, light.ambient, light.softness]),
            spec.light.ball * spec.electrons_per_rate * spec.light.bat,
            sqrt(spec.blur**2 + 1 / 12),
            electrons,
        )

    @property
    def light(self) -> Light:
        """Light on the ball, in axes of the camera."""
        light = self.spec.light
        toward = self.lens.rotation @ np.asarray(light.toward)
        x, y, z = toward / np.linalg.norm(toward)
        return Light(
            ambient=light.ambient, toward=(float(x), float(y), float(z)), softness=light.softness
        )

    def _clip(
        self, frames: Frames, draws: Draws, name: str, slots: Slots, bat: FilmedBat | None
    ) -> ClipRecord:
        spec = self.spec
        most = np.array([spec.sensor.columns, spec.sensor.rows]) - spec.window
        corners = np.rint(frames.outlines.middle - spec.window / 2).astype(np.int64)
        corners = np.clip(corners, 0, most)
        empty_scene, numbers = background(spec), frames.numbers(slots)
        pixels: list[NDArray[Any]] = []
        batch_size = 256  # number of windows that are rendered together
        for start in range(0, len(corners), batch_size):
            part = slice(start, start + batch_size)
            behind = windows(empty_scene, corners[part], spec.window)
            electrons = self.render(frames.part(part), corners[part], behind, bat)
            pixels.append(
                self.sensor.expose(
                    electrons,
                    corners[part],
                    draws,
                    f"{name}.window",
                    numbers[part],
                    spec.clock.exposure,
                )
            )
        whole = np.concatenate(pixels) if pixels else np.empty((0, spec.window, spec.window))
        return ClipRecord(
            times=frames.as_table(frames.stamp),
            left=frames.as_table(corners[:, 0].astype(np.float64)),
            top=frames.as_table(corners[:, 1].astype(np.float64)),
            pixels=frames.as_table(whole),
            background=self.empty(draws, f"{name}.empty", bat),
        )

    def empty(self, draws: Draws, name: str, bat: FilmedBat | None = None) -> Pixels:
        """Return the mean of the frames taken before the shots, with noise, (row, column)."""
        spec = self.spec
        behind = background(spec)[None]
        if bat is not None:
            self.put(bat, np.zeros(1), np.zeros((1, 2), np.int64), behind)
        phases = draws.uniform(f"{name}.flicker", spec.empty_frames)
        burn = float(flicker(spec, np.zeros(spec.empty_frames), phases).mean())
        return self.sensor.mean_of(
            behind[0] * np.float32(burn), spec.empty_frames, draws, name, spec.clock.exposure
        )

    def _track(self, frames: Frames, draws: Draws, name: str, slots: Slots) -> TrackRecord:
        """Return positions as if from an ideal tracker, with 1.1 times the smallest possible u.

        For an edge of contrast C in noise of variance V, the Cramér-Rao bound of a disk is
        V/C² · 2s/(√π R) at rest and V/C² · L/(4R) along a blur L ≫ s. V is the variance of the
        pixels on the edge: 1/V is averaged with the squared slope of the edge as weight.
        """
        spec, light = self.spec, self.light
        shine = light.ambient + (1 - light.ambient) * (light.softness / (1 + light.softness))
        ball = spec.light.ball * spec.electrons_per_rate * spec.ball.albedo * shine
        behind = spec.light.background * spec.electrons_per_rate
        across = NormalDist()
        edge = np.linspace(-3, 3, 31)  # distance from the edge [standard deviations of the blur]
        steep = np.array([across.pdf(z) ** 2 for z in edge])
        mean = np.array([behind + (ball - behind) * across.cdf(z) for z in edge])
        noise = steep.sum() / (steep / (mean + spec.sensor.read_noise**2)).sum()
        still = 2 * sqrt((spec.blur**2 + 1 / 12) / pi)
        wide = np.hypot(still, np.linalg.norm(frames.blur, axis=1) / 4)
        u = 1.1 * np.sqrt(noise * wide / frames.outlines.radius) / abs(ball - behind)
        error = u[:, None] * draws.normal(f"{name}.sums", 2, frames.numbers(slots))
        x, y = (frames.outlines.middle + error).T
        return TrackRecord(
            times=frames.as_table(frames.stamp),
            x=frames.as_table(x),
            y=frames.as_table(y),
            u=frames.as_table(u),
        )
