"""A clip to speeds: found, located, linked, fitted; what `virtual-lab track` runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.calibration.plane import Plane, distance_of, plane_of
from virtual_lab.video.clips.background import (
    Image,
    first_background,
    light_ball,
    uncovered_mean,
)
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import Clip, open_clip
from virtual_lab.video.clips.reading import Frame
from virtual_lab.video.locate.located import Flag, Located, part_of
from virtual_lab.video.locate.regions import Locator, Regions, squares
from virtual_lab.video.track.finding import HALVINGS, LEAST_RADIUS, Finder, finder
from virtual_lab.video.track.legs import Legs, Places, split
from virtual_lab.video.track.lines import Air
from virtual_lab.video.track.linking import Found, ball_track
from virtual_lab.video.track.starting import starts

__all__ = ["AT_ONCE", "Spotted", "Tracked", "expected_radius", "followed", "locate_in", "track"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NAMES = tuple(field.name for field in fields(Located))
AT_ONCE = 32  # frames whose regions are located together
LEAST = 3  # frames that locate the ball
USELESS = Flag.NOT_FOUND | Flag.CLIPPED | Flag.OVERLAP | Flag.POOR_FIT


@dataclass(frozen=True, slots=True, kw_only=True)
class Spotted:
    """A ball found roughly in a clip; arrays over the frames that show it, (frame,)."""

    clip: Clip
    frames: NDArray[np.intp]  # their numbers
    start: Located
    exposure: float  # [s]
    background: Image

    @property
    def times(self) -> Array:
        """Time of each frame [s]."""
        return self.clip.times[self.frames]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked(Spotted):
    """A ball followed through a clip."""

    located: Located
    plane: Plane
    legs: Legs


def track(
    path: Path,
    calibration: ClipCalibration,
    locator: Locator,
    *,
    say: Callable[[str], None] = lambda _: None,
) -> Tracked:
    """Return the way of the ball in a clip.

    Parameters
    ----------
    path
        The clip.
    calibration
        What is known of it.
    locator
        What takes a region to the ball's place in it.
    say
        Told what is under way.

    Raises
    ------
    InputError
        A clip that cannot be read, no ball, two balls, too few frames of it.
    """
    say(f"reading {path}")
    clip = open_clip(path, calibration)
    background = first_background(clip.samples, light=light_ball(clip.samples))
    expected = expected_radius(calibration)
    say("looking for the ball")
    found, halvings = _find(clip, background, expected)
    seeker = finder(background, clip.samples, clip.full_scale, halvings)
    background = _bare(clip, background, seeker)
    frames = np.array(list(found), dtype=np.intp)
    start, exposure = starts(clip, background, found, calibration.exposure_s)
    say(f"locating the ball in {len(frames)} frames")
    located = locate_in(clip, frames, background, start, locator)
    spotted = Spotted(
        clip=clip, frames=frames, start=start, exposure=exposure, background=background
    )
    return followed(spotted, located, calibration)


def followed(
    spotted: Spotted,
    located: Located,
    calibration: ClipCalibration,
) -> Tracked:
    """Return a located ball's way in the plane, and its flights.

    Parameters
    ----------
    spotted
        The ball.
    located
        Its places, frame by frame.
    calibration
        What is known of the clip.

    Raises
    ------
    InputError
        Too few frames that locate the ball, or nothing that sets the scale.
    """
    clip, frames, exposure = spotted.clip, spotted.frames, spotted.exposure
    against = located.flags & np.uint16(USELESS)
    good = against == 0
    where = str(clip.source.path)
    if good.sum() < LEAST:
        allowed = f"at least {LEAST} frames must show it whole and round"
        raise InputError(where, "frames that locate the ball", int(good.sum()), allowed)
    plane = plane_of(located, calibration, where)
    scale = plane.metres_per_pixel
    places = np.where(good[:, None], plane.places, np.nan)
    own = scale * np.hypot(located.x_u, located.y_u) / np.sqrt(2)
    pattern = 0.0
    if located.pattern_u is not None:
        pattern = float(np.nanmedian(located.pattern_u[good]))
    legs = split(
        Places(
            t=clip.times[frames],
            places=places,
            u=own,
            pattern_u=scale * pattern,
            exposure=exposure,
        ),
        Air(
            drag=calibration.drag_per_m,
            drag_u=calibration.drag_per_m_u,
            gravity=calibration.gravity_mps2,
        ),
        stamped=calibration.timestamps is not None,
    )
    flags = located.flags.copy()
    flags[legs.wild] |= np.uint16(Flag.JUMP)
    flags[legs.struck] |= np.uint16(Flag.CONTACT)
    for frame in legs.stepped:
        flags[frame] |= np.uint16(Flag.JUMP)
    found: dict[str, Any] = {each.name: getattr(spotted, each.name) for each in fields(Spotted)}
    return Tracked(**found, located=replace(located, flags=flags), plane=plane, legs=legs)


def locate_in(
    clip: Clip,
    frames: NDArray[np.intp],
    background: Image,
    start: Located,
    locator: Locator,
) -> Located:
    """Return the ball's places in some frames of a clip, region by region, so many at a time."""
    parts: list[Located] = []
    stream = clip.chosen(frames)
    for first in range(0, len(frames), AT_ONCE):
        some = part_of(start, np.arange(first, min(first + AT_ONCE, len(frames))))
        cuts = squares(some, clip.shape)
        pixels: list[Frame] = []
        for cut, (_, frame) in zip(cuts, stream, strict=False):
            pixels.append(frame[cut].copy())  # a view would keep its whole frame
        regions = Regions(
            pixels=np.stack(pixels),
            background=np.stack([background[cut] for cut in cuts]),
            corners=np.array([[cut[1].start, cut[0].start] for cut in cuts], float),
        )
        parts.append(locator(clip, regions, some))
    whole: dict[str, Any] = {name: _together(parts, name) for name in NAMES}
    return Located(**whole)


def _together(parts: list[Located], name: str) -> Any:
    values = [getattr(part, name) for part in parts]
    return None if values[0] is None else np.concatenate(values)


def expected_radius(calibration: ClipCalibration) -> float | None:
    """Return the ball's radius in the picture where the scale is known [pixels]."""
    diameter, scale = calibration.ball_diameter_m, calibration.metres_per_pixel
    if not diameter:
        return None
    if scale:
        return diameter / 2 / scale
    if camera := calibration.camera:
        far = distance_of(camera)
        return diameter / 2 * camera.matrix[0][0] / far if far else None
    return None


def _find(clip: Clip, background: Image, expected: float | None) -> tuple[Found, int]:
    """Return the ball's spots and how often frames were halved: finer until it is found."""
    coarsest = HALVINGS
    while coarsest and expected and expected / 2**coarsest < LEAST_RADIUS:
        coarsest -= 1
    for halvings in range(coarsest, -1, -1):
        seeker = finder(background, clip.samples, clip.full_scale, halvings)
        spots = [seeker.spots(frame) for frame in clip.frames()]
        try:
            return ball_track(spots, str(clip.source.path), expected), halvings
        except InputError as fault:
            if halvings == 0 or fault.key != "ball":
                raise
    raise AssertionError("the last round returns or raises")


def _bare(clip: Clip, first: Image, seeker: Finder) -> Image:
    """Return the background without anything that moved."""
    reach = 2.0 * 2**seeker.halvings
    covered = [
        [
            (spot.x, spot.y, 1.15 * spot.radius + np.hypot(spot.blur_x, spot.blur_y) / 2 + reach)
            for spot in seeker.spots(sample)
        ]
        for sample in clip.samples
    ]
    return uncovered_mean(clip.samples, first, covered)
