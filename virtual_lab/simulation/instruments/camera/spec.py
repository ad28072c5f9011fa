"""What data sheets say of a camera and its sensor, and how what stands before it looks."""

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
from virtual_lab.simulation.instruments.calibrated import CalibratedSpec, certified
from virtual_lab.uncertainty.estimate import Estimate

Length = Annotated[float, Dimension("length")]
LengthU = Annotated[float, Ge(0), Dimension("length")]
Time = Annotated[float, Ge(0), Dimension("time")]
Rate = Annotated[float, Ge(0), Dimension("rate")]
Number = Annotated[float, Dimension("number")]
Share = Annotated[float, Ge(0), Le(1), Dimension("number")]
Count = Annotated[int, Dimension("number", 1, 10_000)]  # of pixels
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
    gain: PositiveNumber  # grey values an electron
    gain_u: NonNegative  # relative
    read_noise: NonNegative  # [e]
    dark_current: Annotated[float, Ge(0), Dimension("rate")]  # [e/s]
    photo_response: NonNegative  # its non-uniformity, PRNU: relative, pixel to pixel
    dark_signal: NonNegative  # its non-uniformity, DSNU: pixel to pixel [e]
    black_level: NonNegative  # grey value without light
    bits: Annotated[int, Ge(1), Le(16), Dimension("number")]
    whole_counts: YesNo = True

    @property
    def full_scale(self) -> int:
        """The greatest grey value."""
        return int(2**self.bits - 1)

    def certificate(self) -> dict[str, Estimate]:
        """Return what a photon transfer measurement found with an uncertainty."""
        return {"gain": certified(self.gain, self.gain * self.gain_u)}


@dataclass(frozen=True, slots=True, kw_only=True)
class BallLook(Spec):
    """How a ball looks: its albedo, and how its seam is darker."""

    albedo: Share
    seam_contrast: Share  # how much darker the seam is, as a share; 0: a plain ball
    seam_width: PositiveNumber = 0.14  # half of it, stitches and all, in radii of the ball
    neck: Annotated[float, Gt(0), Lt(1), Dimension("number")] = (
        0.34  # half, between seams, in radii
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LensSpec(CalibratedSpec):
    """A lens as calibrated: a pinhole with distortion, and how it blurs."""

    focal_length: PositiveLength
    focal_length_u: NonNegative  # relative
    centre_u: LengthU
    distortion: Annotated[tuple[float, ...], Len(5, 5), Dimension("number")]  # k1, k2, p1, p2, k3
    distortion_u: Annotated[tuple[float, ...], Len(5, 5), Dimension("number")]
    # where the axis meets the sensor, from its middle, on the sensor
    centre: Annotated[tuple[float, ...], Len(2, 2), Dimension("length")] = (0.0, 0.0)
    blur: PositiveLength  # standard deviation of a point's image, on the sensor


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseSpec(CalibratedSpec):
    """Where the camera hangs and what it looks at, in axes of the rig.

    X runs with the ball toward the bat, Y along the bat from pivot to tip, Z up; the origin is
    the ball's centre at contact. Not tilted it looks straight down with X to the right.
    """

    place: Annotated[tuple[float, ...], Len(3, 3), Dimension("length")]
    place_u: LengthU  # each way
    tilt: Annotated[tuple[float, ...], Len(3, 3), Dimension("angle")]  # about X, Y and Z
    tilt_u: Annotated[float, Ge(0), Dimension("angle")]
    plane_u: LengthU
    plane: Annotated[float, Dimension("length")] = 0.0  # height of the line of fire, as calibrated


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockSpec(CalibratedSpec):
    """When frames are taken and for how long; a frame's time is the middle of its exposure."""

    other_errors: ClassVar[tuple[str, ...]] = ("drop_rate",)

    frame_rate: Annotated[float, Ge(500), Le(100_000), Dimension("frequency")]
    exposure: Annotated[float, Gt(0), Dimension("time")]
    clock_u: NonNegative
    clock_fast: Annotated[float, Gt(-1), Dimension("number")] = (
        0.0  # its seconds a true one, less 1
    )
    jitter: Time  # of a time stamp about the frame's time
    drop_rate: Annotated[float, Ge(0), Lt(1), Dimension("number")]  # share of frames lost

    def __post_init__(self) -> None:
        if self.exposure * self.frame_rate > 1:
            raise ValueError(
                f"an exposure of {self.exposure:g} s is longer than a frame, "
                f"{1 / self.frame_rate:g} s"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class LightSpec(CalibratedSpec):
    """Light on the ball and behind it, as photons that reach a pixel."""

    other_errors: ClassVar[tuple[str, ...]] = ("slope", "bowl", "flicker")

    ball: Rate  # from a white surface that squarely faces the lamp
    ambient: Share  # of it, from everywhere
    toward: Annotated[
        tuple[float, ...], Len(3, 3), Dimension("number")
    ]  # the lamp, axes of the rig
    softness: Share  # 0: a lamp far away; 1: as large as half the sky
    background: Rate
    slope: Annotated[
        tuple[float, ...], Len(2, 2), Dimension("number")
    ]  # rise over width and height
    bowl: Number  # relative rise of the background to a corner
    flicker: Share  # amplitude
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
    empty_frames: Count  # taken before the shots, for their background
    frames_in: Count  # kept of those before contact
    frames_out: Count  # and of those after it
    window: Count  # side of what is kept of each frame [px]

    def __post_init__(self) -> None:
        if self.window > min(self.sensor.rows, self.sensor.columns):
            raise ValueError(f"a window of {self.window} px does not fit the sensor")

    @property
    def blur(self) -> float:
        """Standard deviation of the lens's blur [px]."""
        return self.lens.blur / self.sensor.pixel

    @property
    def exposed(self) -> float:
        """Electrons for each photon a second that reaches a pixel [e s]."""
        return self.sensor.quantum_efficiency * self.clock.exposure

    def certificate(self) -> dict[str, Estimate]:
        """Return what its calibration found but for the sensor's, lengths on it in pixels.

        ``place`` is where the pinhole is in axes of the rig and ``tilt`` how the camera is turned
        from looking straight down; ``plane`` is the height of the line of fire.
        """
        lens, pose, pixel = self.lens, self.pose, self.sensor.pixel
        focal = lens.focal_length / pixel
        stated = {
            "focal": certified(focal, focal * lens.focal_length_u),
            "clock": certified(1 + self.clock.clock_fast, self.clock.clock_u),
            "plane": certified(pose.plane, pose.plane_u),
        }
        sides = self.sensor.columns, self.sensor.rows
        for axis, side, off in zip("xy", sides, lens.centre, strict=True):
            middle = (side - 1) / 2 + off / pixel
            stated[f"centre_{axis}"] = certified(middle, lens.centre_u / pixel)
        for key, value, u in zip(DISTORTION, lens.distortion, lens.distortion_u, strict=True):
            stated[key] = certified(value, u)
        for axis, tilt, at in zip("xyz", pose.tilt, pose.place, strict=True):
            stated[f"tilt_{axis}"] = certified(tilt, pose.tilt_u)
            stated[f"place_{axis}"] = certified(at, pose.place_u)
        return stated
