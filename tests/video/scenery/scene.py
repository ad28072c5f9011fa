"""Descriptions of clips to be filmed, and their truth."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.video.scenery.backdrop import Backdrop
from tests.video.scenery.motion import Ball, Motion

__all__ = ["Actor", "BallTruth", "Frames", "Made", "Phone", "Scene", "TrueContact", "TrueFlight"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Pair = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Actor:
    """A ball with its motion."""

    motion: Motion
    ball: Ball = field(default_factory=Ball)


@dataclass(frozen=True, kw_only=True)
class Phone:
    """A camera: a pinhole that looks at the middle of the plane of the balls."""

    distance: float = 2.0  # distance of the plane [m]
    focal: float = 450.0  # focal length [px]
    pitch: float = 0.0  # angle downward [deg]
    yaw: float = 0.0  # angle to the right [deg]
    drift: float = 0.0  # extent over the clip [px], at most 1 px per frame
    pan: float = 0.0  # rate to the right in addition to the drift [px/s]
    turn: float = 0.0  # rotation over the clip about the picture's middle [deg]
    growth: float = 0.0  # magnification over the clip as the hand comes nearer [share]
    turns: bool = False  # drift and pan are turns about the lens, which change the perspective
    readout: float = 0.0  # time from the first row to the last [s]
    blur: float = 0.7  # standard deviation of lens and processing [px]
    noise: float = 1.5  # noise [gray values], at all brightnesses because it follows the gamma
    flicker: float = 0.0  # relative amplitude of the light
    mains: float = 0.0  # relative amplitude of a lamp at 100 Hz
    window: float = 0.0  # relative amplitude of such a lamp in a part of the picture
    gamma: float = 2.2


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A clip to be filmed.

    `stored`: all | doubled | repeated (some frames twice) | thinned (every sixth omitted)
    | lost (some omitted). `file_rate`: frame rate in the file, if not that of the stored frames.
    """

    name: str
    seed: int = 1
    size: tuple[int, int] = (320, 240)
    fps: float = 30.0  # exposures per second
    count: int = 75  # number of exposures
    exposure: float = 1 / 120  # exposure time [s]
    actors: tuple[Actor, ...] = ()
    phone: Phone = field(default_factory=Phone)
    backdrop: Backdrop = field(default_factory=Backdrop)
    floor: float | None = None  # height of the floor, below the axis [m]
    wall_behind: float = 0.3  # distance of the wall behind the balls [m]
    floor_shadow: float = 0.5  # share of the light at the point of contact
    wall_shadow: float = 0.06
    mirror: float = 0.0  # share of light that the floor reflects
    lamp: tuple[float, float, float] = (-0.35, -0.8, -0.5)  # direction to the lamp; y is down
    ambient: float = 0.5  # share of the light that comes from all sides
    stored: str = "all"
    file_rate: float | None = None
    rate_said: bool = True  # true rate is given to the tracker, not only that in the file
    rotation: int = 0  # angle by which a player turns the stored frames clockwise [deg]
    codec: str = "MJPG"  # MJPG | mp4v | VP80 | FFV1 | PNG, or as a phone writes: H264 | HEVC
    jpeg: int = 90  # quality; 100 leaves the frames unchanged before a codec other than MJPG
    crf: int = 26  # quality of a phone's codec: 18 is good, 34 bad
    true_stamps: bool = False  # stamp of each frame as a phone writes it, instead of an even rate


@dataclass(frozen=True, kw_only=True)
class Frames:
    """Truth of a ball in each stored frame."""

    exposure: NDArray[np.intp]  # number of the stored exposure
    time: Array  # middle of the exposure of the ball's row [s]
    x: Array  # position in the still frame, which has no drift [px]
    y: Array
    picture_x: Array  # position in the frame itself [px]
    picture_y: Array
    radius: Array  # px
    phase: tuple[str, ...]  # hand | flight | rolling | pendulum
    whole: Flags  # whole ball in the picture during the whole exposure
    touched: Flags  # hand or another ball on the ball or within 2 px
    contact: Flags  # contact, release or catch during the exposure
    repeat: Flags  # same exposure as in the frame before

    @property
    def readable(self) -> Flags:
        """Mask of frames with a whole ball in free flight and nothing else on it."""
        flying = np.array([phase == "flight" for phase in self.phase], bool)
        return flying & self.whole & ~self.touched & ~self.contact & ~self.repeat


@dataclass(frozen=True, kw_only=True)
class TrueFlight:
    """A free flight. The frames are the first and last stored ones in which it is readable."""

    first_frame: int
    last_frame: int
    places: int  # number of readable frames
    start: float  # s
    end: float
    velocity_start: Pair  # velocity, x right, y down [m/s]
    velocity_end: Pair


@dataclass(frozen=True, kw_only=True)
class TrueContact:
    """A contact; `frame` lies between stored frames, where a doubled frame counts as its first."""

    time: float
    frame: float
    kind: str  # floor | wall
    seen: bool  # whole ball in the picture
    restitution: float  # ratio of the speeds normal to the surface
    velocity_in: Pair
    velocity_out: Pair


@dataclass(frozen=True, kw_only=True)
class BallTruth:
    """Truth of one ball."""

    frames: Frames
    flights: tuple[TrueFlight, ...]
    contacts: tuple[TrueContact, ...]
    metres_per_pixel: float  # scale in the middle of the picture, as are the next two
    gravity_px: Pair  # px/s^2
    gravity: float  # m/s^2
    drag_per_metre: float
    diameter: float  # m


@dataclass(frozen=True, kw_only=True)
class Made:
    """A clip on disk; `truths` has one entry per ball."""

    path: Path
    scene: Scene
    exposures: NDArray[np.intp]  # number of the exposure, by stored frame
    times: Array  # middle of the exposure of the first row, by stored frame [s]
    drift: Array  # drift of the picture's middle at the first row, by stored frame, (frame, 2) [px]
    truths: tuple[BallTruth, ...]

    @property
    def truth(self) -> BallTruth:
        """Truth of the first ball."""
        return self.truths[0]
