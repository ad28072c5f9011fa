"""What a clip is made from, and what is true of it."""

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
    """A ball and how it moves."""

    motion: Motion
    ball: Ball = field(default_factory=Ball)


@dataclass(frozen=True, kw_only=True)
class Phone:
    """A camera: a pinhole that looks at the middle of the plane of the balls."""

    distance: float = 2.0  # m
    focal: float = 450.0  # px
    pitch: float = 0.0  # deg, looking down
    yaw: float = 0.0  # deg, looking to the right
    drift: float = 0.0  # px over the clip, at most 1 px a frame
    pan: float = 0.0  # px/s to the right, beside the drift
    turn: float = 0.0  # deg over the clip, about the picture's middle
    growth: float = 0.0  # share over the clip: the hand comes nearer, or the lens focuses
    readout: float = 0.0  # s from the first row to the last
    blur: float = 0.7  # px, standard deviation of lens and processing
    noise: float = 1.5  # grey values, at all brightnesses as after a gamma
    flicker: float = 0.0  # relative amplitude of the light
    mains: float = 0.0  # the same of a lamp, at 100 Hz
    window: float = 0.0  # the same, of a part of the picture alone
    gamma: float = 2.2


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A clip to be filmed.

    `stored`: all | doubled | repeated (some frames twice) | thinned (every sixth left out)
    | lost (some left out). `file_rate`: of the file, where it is not that of the frames stored.
    """

    name: str
    seed: int = 1
    size: tuple[int, int] = (320, 240)
    fps: float = 30.0  # exposures a second
    count: int = 75  # exposures
    exposure: float = 1 / 120  # s
    actors: tuple[Actor, ...] = ()
    phone: Phone = field(default_factory=Phone)
    backdrop: Backdrop = field(default_factory=Backdrop)
    floor: float | None = None  # m below the axis
    wall_behind: float = 0.3  # m behind the balls
    floor_shadow: float = 0.5  # share of the light at the place of contact
    wall_shadow: float = 0.06
    mirror: float = 0.0  # share of light the floor reflects
    stored: str = "all"
    file_rate: float | None = None
    rate_said: bool = True  # whoever follows it knows the true rate, not the file's alone
    rotation: int = 0  # deg clockwise that a player has to turn the stored frames
    codec: str = "MJPG"  # MJPG | mp4v | VP80 | FFV1 | PNG, or as a phone writes: H264 | HEVC
    jpeg: int = 90  # quality; before another codec 100 leaves the frames as they are
    crf: int = 26  # a phone's quality: 18 is good, 34 bad
    true_stamps: bool = False  # of a phone: each frame's own time, not those of an even rate


@dataclass(frozen=True, kw_only=True)
class Frames:
    """What is true of a ball in each stored frame; NaN where there is none."""

    exposure: NDArray[np.intp]  # number of the exposure that was stored
    time: Array  # s, middle of the exposure of the row the ball is in
    x: Array  # px in the still frame: the picture without drift
    y: Array
    picture_x: Array  # px in this very frame
    picture_y: Array
    radius: Array  # px
    phase: tuple[str, ...]  # hand | flight | rolling | pendulum
    whole: Flags  # all of the ball is in the picture, all the exposure
    touched: Flags  # a hand or another ball is on it or within 2 px
    contact: Flags  # the exposure spans a contact, a release or a catch
    repeat: Flags  # the same exposure as in the frame before

    @property
    def readable(self) -> Flags:
        """Frames with a whole ball in free flight and nothing else on it."""
        flying = np.array([phase == "flight" for phase in self.phase], bool)
        return flying & self.whole & ~self.touched & ~self.contact & ~self.repeat


@dataclass(frozen=True, kw_only=True)
class TrueFlight:
    """A free flight; frames are the first and last stored ones in which it can be read."""

    first_frame: int
    last_frame: int
    places: int  # readable frames
    start: float  # s
    end: float
    velocity_start: Pair  # m/s, x right, y down
    velocity_end: Pair


@dataclass(frozen=True, kw_only=True)
class TrueContact:
    """A contact; `frame` is between stored frames, the first of a doubled one counting."""

    time: float
    frame: float
    kind: str  # floor | wall
    seen: bool  # with all of the ball in the picture
    restitution: float  # of the speeds normal to the surface
    velocity_in: Pair
    velocity_out: Pair


@dataclass(frozen=True, kw_only=True)
class BallTruth:
    """All that is true of one ball."""

    frames: Frames
    flights: tuple[TrueFlight, ...]
    contacts: tuple[TrueContact, ...]
    metres_per_pixel: float  # in the middle of the picture, as are the next two
    gravity_px: Pair  # px/s^2
    gravity: float  # m/s^2
    drag_per_metre: float
    diameter: float  # m


@dataclass(frozen=True, kw_only=True)
class Made:
    """A clip on disk; `truths` has one ball after another, `truth` is the first one's."""

    path: Path
    scene: Scene
    exposures: NDArray[np.intp]  # by stored frame
    times: Array  # by stored frame: middle of the exposure of the first row [s]
    drift: Array  # by stored frame, (frame, 2): of the picture's middle, first row [px]
    truths: tuple[BallTruth, ...]

    @property
    def truth(self) -> BallTruth:
        """The first ball's."""
        return self.truths[0]
