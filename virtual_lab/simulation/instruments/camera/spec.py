"""Data sheets of a camera, its sensor, lens, pose, clock and light, and of the look of a ball."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Ge, Gt, Le, Len, Lt

from virtual_lab.catalog.specs import (
    Dimension,
    NonNegative,
    PositiveLength,
    PositiveNumber,
    Spec,
    YesNo,
)
from virtual_lab.simulation.instruments.calibrated import CalibratedSpec, stated_constant
from virtual_lab.uncertainty.estimate import Estimate

Length = Annotated[float, Dimension("length")]
LengthU = Annotated[float, Ge(0), Dimension("length")]
Time = Annotated[float, Ge(0), Dimension("time")]
Rate = Annotated[float, Ge(0), Dimension("rate")]
Number = Annotated[float, Dimension("number")]
Share = Annotated[float, Ge(0), Le(1), Dimension("number")]
Count = Annotated[int, Dimension("number", 1, 10_000)]  # number of pixels or frames
DISTORTION = ("k1", "k2", "p1", "p2", "k3")


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSpec(CalibratedSpec):
    """A sensor in the terms of EMVA 1288; electrons are photoelectrons."""

    other_errors: ClassVar[tuple[str, ...]] = (
        "read_noise",
        "dark_current",
        "photo_response",
        "dark_signal",
        "whole_counts",
    )

    columns: Count
    rows: Count
    pixel: PositiveLength
    quantum_efficiency: Annotated[float, Gt(0), Le(1), Dimension("number")]
    full_well: PositiveNumber  # [e]
    gain: PositiveNumber  # gray values per electron
    gain_u: NonNegative  # relative
    read_noise: NonNegative  # [e]
    dark_current: Annotated[float, Ge(0), Dimension("rate")]  # [e/s]
    photo_response: NonNegative  # PRNU, relative standard deviation between pixels
    dark_signal: NonNegative  # DSNU, standard deviation between pixels [e]
    black_level: NonNegative  # gray value without light
    bits: Annotated[int, Ge(1), Le(16), Dimension("number")]
    whole_counts: YesNo = True

    @property
    def full_scale(self) -> int:
        """Largest gray value."""
        return int(2**self.bits - 1)

    def certificate(self) -> dict[str, Estimate]:
        """Return the constants that a photon transfer measurement gives, with uncertainties."""
        return {"gain": stated_constant(self.gain, self.gain * self.gain_u)}


@dataclass(frozen=True, slots=True, kw_only=True)
class BallLook(Spec):
    """Look of a ball: its albedo and its darker seam."""

    albedo: Share
    seam_contrast: Share  # relative darkness of the seam, 0 for a plain ball
    seam_width: PositiveNumber = 0.14  # half width of the seam with its stitches [ball radii]
    neck: Annotated[float, Gt(0), Lt(1), Dimension("number")] = (
        0.34  # half distance between the seams [ball radii]
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LensSpec(CalibratedSpec):
    """A lens: a pinhole with distortion and blur."""

    focal_length: PositiveLength
    focal_length_u: NonNegative  # relative
    centre_u: LengthU
    distortion: Annotated[tuple[float, ...], Len(5, 5), Dimension("number")]  # k1, k2, p1, p2, k3
    distortion_u: Annotated[tuple[float, ...], Len(5, 5), Dimension("number")]
    # principal point relative to the center of the sensor
    centre: Annotated[tuple[float, ...], Len(2, 2), Dimension("length")] = (0.0, 0.0)
    blur: PositiveLength  # standard deviation of the image of a point on the sensor


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseSpec(CalibratedSpec):
    """Position and direction of the camera in axes of the rig.

    X points with the ball toward the bat, Y along the bat from pivot to tip, Z up. The origin is
    the ball's center at contact. Without tilt the camera looks straight down, with X to the right.
    """

    place: Annotated[tuple[float, ...], Len(3, 3), Dimension("length")]
    place_u: LengthU  # standard uncertainty of each coordinate
    tilt: Annotated[tuple[float, ...], Len(3, 3), Dimension("angle")]  # about X, Y and Z
    tilt_u: Annotated[float, Ge(0), Dimension("angle")]
    plane_u: LengthU
    plane: Annotated[float, Dimension("length")] = 0.0  # calibrated height of the line of fire


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockSpec(CalibratedSpec):
    """Clock of the camera. The time of a frame is the middle of its exposure."""

    other_errors: ClassVar[tuple[str, ...]] = ("drop_rate",)

    frame_rate: Annotated[float, Ge(500), Le(100_000), Dimension("frequency")]
    exposure: Annotated[float, Gt(0), Dimension("time")]
    clock_u: NonNegative
    clock_fast: Annotated[float, Gt(-1), Dimension("number")] = 0.0  # relative rate error
    jitter: Time  # standard deviation of a time stamp
    drop_rate: Annotated[float, Ge(0), Lt(1), Dimension("number")]  # share of frames lost

    def __post_init__(self) -> None:
        if self.exposure * self.frame_rate > 1:
            raise ValueError(
                f"an exposure of {self.exposure:g} s is longer than a frame, "
                f"{1 / self.frame_rate:g} s"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class LightSpec(CalibratedSpec):
    """Light on the ball and behind it, as the rate of photons that reach a pixel."""

    other_errors: ClassVar[tuple[str, ...]] = ("slope", "bowl", "flicker")

    ball: Rate  # rate from a white surface that faces the lamp
    ambient: Share  # share of the light from all directions
    # direction to the lamp in axes of the rig
    toward: Annotated[tuple[float, ...], Len(3, 3), Dimension("number")]
    softness: Share  # 0 for a distant lamp, 1 for one as large as half the sky
    background: Rate
    # relative rise of the background over width and height
    slope: Annotated[tuple[float, ...], Len(2, 2), Dimension("number")]
    bowl: Number  # relative rise of the background to a corner
    flicker: Share  # relative amplitude of the flicker
    flicker_frequency: Annotated[float, Ge(0), Dimension("frequency")]
    bat: Share  # albedo of the bat


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSpec(CalibratedSpec):
    """A camera over a rig."""

    kind: str
    title: str
    sensor: SensorSpec
    lens: LensSpec
    pose: PoseSpec
    clock: ClockSpec
    light: LightSpec
    ball: BallLook
    empty_frames: Count  # number of frames taken before the shots, for the background
    frames_in: Count  # number of frames before the contact
    frames_out: Count  # number of frames after the contact
    window: Count  # side of the recorded window [px]

    def __post_init__(self) -> None:
        if self.window > min(self.sensor.rows, self.sensor.columns):
            raise ValueError(f"a window of {self.window} px does not fit the sensor")

    @property
    def blur(self) -> float:
        """Standard deviation of the blur of the lens [px]."""
        return self.lens.blur / self.sensor.pixel

    @property
    def electrons_per_rate(self) -> float:
        """Electrons per frame for a rate of one photon per second on a pixel [e s]."""
        return self.sensor.quantum_efficiency * self.clock.exposure

    def certificate(self) -> dict[str, Estimate]:
        """Return the calibrated constants of lens, pose and clock; lengths on the sensor in pixels.

        ``place`` is the position of the pinhole in axes of the rig, ``tilt`` the rotation from the
        vertical view, and ``plane`` the height of the line of fire.
        """
        lens, pose, pixel = self.lens, self.pose, self.sensor.pixel
        focal = lens.focal_length / pixel
        stated = {
            "focal": stated_constant(focal, focal * lens.focal_length_u),
            "clock": stated_constant(1 + self.clock.clock_fast, self.clock.clock_u),
            "plane": stated_constant(pose.plane, pose.plane_u),
        }
        sides = self.sensor.columns, self.sensor.rows
        for axis, side, offset in zip("xy", sides, lens.centre, strict=True):
            middle = (side - 1) / 2 + offset / pixel
            stated[f"centre_{axis}"] = stated_constant(middle, lens.centre_u / pixel)
        for key, value, u in zip(DISTORTION, lens.distortion, lens.distortion_u, strict=True):
            stated[key] = stated_constant(value, u)
        for axis, tilt, at in zip("xyz", pose.tilt, pose.place, strict=True):
            stated[f"tilt_{axis}"] = stated_constant(tilt, pose.tilt_u)
            stated[f"place_{axis}"] = stated_constant(at, pose.place_u)
        return stated
