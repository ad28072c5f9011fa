"""The ball followed through a clip of a calibrated camera, located as sharply as can be."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.units import Array
from virtual_lab.video.calibration.plane import Plane, plane_of
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.reading import Frame, grey_of
from virtual_lab.video.clips.timing import usual_step
from virtual_lab.video.follow.following import FollowedClip
from virtual_lab.video.follow.pieces import GROWTH
from virtual_lab.video.locate.located import Located, PlaceFlag, Regions, part_of, squares
from virtual_lab.video.locate.sharp import Sharp
from virtual_lab.video.track.legs import Legs, Places, legs_of

Image = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackSettings:
    """Which blobs are the ball, and how its background and exposure are read."""

    together: int = 32  # frames whose regions are located at once
    least_frames: int = 3  # of each flight, that locate the ball
    size_ratio: float = 1.45  # to the radius expected: what is farther off is not the ball
    reach_steps: float = 1.5  # that a ball moves at most from where it was before
    exposure_frames: int = 8  # from which an exposure is read
    faint: float = 0.1  # of the ball's brightness: less is noise
    shown: int = 3  # frames that must show a pixel's background for their mean to be taken


TRACK = TrackSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """A ball located sharply through a clip; arrays over the frames that show it, (frame,)."""

    clip: Clip
    frames: NDArray[np.intp]  # their numbers
    times: Array  # [s], of frames that were left out too
    exposure: float  # [s]
    background: Image
    located: Located
    plane: Plane
    legs: Legs
    stepped: list[int]  # frames before which the ball steps ahead of its time stamps

    def pixels(self, metres: Array, time: float) -> Array:
        """Return where a place of the plane is seen, (2,), near enough for a mark."""
        away = np.abs(self.times - time)
        away[~np.isfinite(self.plane.places[:, 0])] = np.inf
        near = int(np.argmin(away))
        off = (metres - self.plane.places[near]) / self.plane.metres_per_pixel
        here = np.array([self.located.x[near], self.located.y[near]])
        return np.asarray(here + off * [1, self.plane.sense])


def sharpened(
    found: FollowedClip,
    calibration: ClipCalibration,
    *,
    progress: Callable[[str], None] = lambda _: None,
) -> Tracked:
    """Return the ball that was followed through a clip, located as sharply as can be.

    Raises
    ------
    InputError
        No ball, too few frames that locate it, or nothing that sets the scale.
    """
    clip, where = found.clip, str(found.clip.source.path)
    known, expected = found.known, None
    if known.ball and known.metres_per_pixel:
        expected = known.ball / 2 / known.metres_per_pixel
    longest = max(found.ways, key=lambda each: len(each.t), default=None)
    ratio = longest.radius / expected if longest and expected else 1.0
    if found.fit is None or not 1 / TRACK.size_ratio < ratio < TRACK.size_ratio:
        size = f" with a radius near {expected:.3g} pixels" if expected else ""
        allowed = f"not found: nothing round{size} was seen to fly through six frames or more"
        raise InputError(where, "ball", None, allowed)
    ball = _ball(found)
    frames = ball["frame"].astype(np.intp)
    of = np.argmin([np.abs(frames[:, None] - w.frames).min(axis=1) for w in found.ways], axis=0)
    times, stepped = _times(found, frames, stamped=calibration.timestamps is not None)
    velocities = [found.fit.at(k, way.t.mean())[0, 2:] for k, way in enumerate(found.ways)]
    background = _bare(found)
    start, exposure = _start(
        clip, background, ball, np.array(velocities)[of] / found.seconds, calibration.exposure_s
    )
    progress(f"locating the ball in {len(frames)} frames (its loops are compiled at the first use)")
    located = _located(clip, frames, background, start, Sharp(ball_radius=expected))
    useless = PlaceFlag.NOT_FOUND | PlaceFlag.CLIPPED | PlaceFlag.OVERLAP | PlaceFlag.POOR_FIT
    good = (located.flags & np.uint16(useless)) == 0
    flown = [np.isin(frames, way.frames) for way in found.ways]
    if min((good & each).sum() for each in flown) < TRACK.least_frames:
        allowed = (
            f"at least {TRACK.least_frames} frames of each flight must show it whole and round"
        )
        raise InputError(where, "frames that locate the ball", int(good.sum()), allowed)
    plane = plane_of(located, calibration, where)
    scale = plane.metres_per_pixel
    pattern = 0.0 if located.pattern_u is None else float(np.nanmedian(located.pattern_u[good]))
    legs = legs_of(
        Places(
            t=times,
            places=np.where(good[:, None], plane.places, np.nan),
            u=scale * np.hypot(located.x_u, located.y_u) / np.sqrt(2),
            pattern_u=scale * pattern,
            exposure=exposure,
            air=calibration,
        ),
        flown,
    )
    flags = located.flags.copy()
    flags[legs.wild | np.isin(frames, stepped)] |= np.uint16(PlaceFlag.JUMP)
    flags[legs.struck] |= np.uint16(PlaceFlag.CONTACT)
    return Tracked(
        clip=clip,
        frames=frames,
        times=times,
        exposure=exposure,
        background=background,
        located=replace(located, flags=flags),
        plane=plane,
        legs=legs,
        stepped=stepped,
    )


def _ball(found: FollowedClip) -> NDArray[np.void]:
    """Return the ball's blob in each frame that shows it: along its flights, between and beside."""
    blobs, ways = found.watched.found, found.ways
    flown = np.concatenate([way.frames for way in ways])
    known = dict(zip(flown.tolist(), np.concatenate([way.blobs for way in ways]), strict=True))
    radius, gap = max(each.radius for each in ways), GROWTH.gap_frames
    speed = max(float(np.hypot(*np.diff(way.xy, axis=0).T).max()) for way in ways)
    chosen = dict(known)
    for frame in range(flown.min() - gap, flown.max() + gap + 1):
        near = int(flown[np.argmin(np.abs(flown - frame))])
        there = np.flatnonzero(blobs["frame"] == frame)
        size = blobs["radius"][there]
        there = there[(size > 0.5 * radius) & (size < 1.6 * radius)]
        if frame in known or abs(near - frame) > gap or not there.size:
            continue
        last = blobs[known[near]]
        away = np.hypot(blobs["x"][there] - last["x"], blobs["y"][there] - last["y"])
        if away.min() < TRACK.reach_steps * speed * abs(near - frame) + 0.5 * radius:
            chosen[frame] = there[np.argmin(away)]
    return blobs[[chosen[frame] for frame in sorted(chosen)]]


def _times(
    found: FollowedClip, frames: NDArray[np.intp], *, stamped: bool
) -> tuple[Array, list[int]]:
    """Return the time of frames [s], mended where some were left out; those that stamps deny."""
    ahead = np.concatenate([way.t - found.scene.time[way.frames] for way in found.ways])
    ahead = np.interp(frames, np.concatenate([way.frames for way in found.ways]), ahead)
    times = found.clip.times[frames]
    if stamped:
        return times, sorted(found.lost)
    return times + np.round(ahead) * usual_step(found.clip.times), []


def _located(
    clip: Clip, frames: NDArray[np.intp], background: Image, start: Located, locator: Sharp
) -> Located:
    """Return the ball's places in some frames of a clip, region by region, so many at a time."""
    parts: list[Located] = []
    stream = clip.chosen(frames)
    for first in range(0, len(frames), TRACK.together):
        some = part_of(start, np.arange(first, min(first + TRACK.together, len(frames))))
        cuts = squares(some, clip.shape)
        regions = Regions(  # copies: a view would keep its whole frame
            pixels=np.stack(
                [grey_of(f[cut]).copy() for cut, (_, f) in zip(cuts, stream, strict=False)]
            ),
            background=np.stack([background[cut] for cut in cuts]),
            corners=np.array([[cut[1].start, cut[0].start] for cut in cuts], float),
        )
        parts.append(locator(clip, regions, some))
    whole: dict[str, Any] = {}
    for field in fields(Located):
        values = [getattr(part, field.name) for part in parts]
        whole[field.name] = None if values[0] is None else np.concatenate(values)
    return Located(**whole)


def _bare(found: FollowedClip) -> Image:
    """Return the background without anything that moved."""
    clip, blobs = found.clip, found.watched.found
    covered = []
    for number in clip.sampled.tolist():
        some = blobs[blobs["frame"] == number]
        reach = 1.15 * some["length"] + 8.0
        covered.append(list(zip(some["picture_x"], some["picture_y"], reach, strict=True)))
    samples = clip.grey_samples()
    return uncovered_mean(samples, middle_of(samples), covered)


def _start(
    clip: Clip,
    background: Image,
    ball: NDArray[np.void],
    velocity: Array,
    exposure: float | None,
) -> tuple[Located, float]:
    """Return where to start in each frame, and the exposure [s], read off the blur if unknown.

    Parameters
    ----------
    ball
        Its blob in each frame that shows it, an array of `find.blobs.BLOB`.
    velocity
        Of it, (frame, 2) [pixels/s].
    """
    whole = ball[~ball["cut"]] if not ball["cut"].all() else ball
    unknown, zero = np.full(len(ball), np.nan), np.zeros(len(ball))
    start = Located(
        x=ball["picture_x"].copy(),
        y=ball["picture_y"].copy(),
        radius=np.full(len(ball), float(np.median(whole["radius"]))),
        x_u=unknown,
        y_u=unknown,
        blur_x=zero,
        blur_y=zero,
        chi_square=unknown,
        flags=np.zeros(len(ball), np.uint16),
    )
    if exposure is None:
        frames = ball["frame"].astype(np.intp)
        exposure = _exposure(clip, background, start, frames, velocity)
    blur_x, blur_y = exposure * velocity.T
    return replace(start, blur_x=blur_x, blur_y=blur_y), exposure


def _exposure(
    clip: Clip, background: Image, start: Located, frames: NDArray[np.intp], velocity: Array
) -> float:
    """Return the exposure that makes the ball as long as it is [s], a frame's at most.

    The matte of a blurred disc has L²/12 more variance along the blur L than across it.
    """
    speed = np.hypot(*velocity.T)
    rows, columns = background.shape
    reach = 1.6 * start.radius + 4
    inside = (start.x > reach) & (start.x < columns - reach)
    inside &= (start.y > reach) & (start.y < rows - reach)
    fast = np.flatnonzero(inside & (speed > 0.5 * speed.max()))
    if not fast.size:
        return 0.0
    count = min(fast.size, TRACK.exposure_frames)
    tried = fast[np.linspace(0, fast.size - 1, count).astype(int)]
    squares = []
    for k, (_, frame) in zip(tried, clip.chosen(frames[tried]), strict=True):
        squares.append(
            12 * _longer(grey_of(frame), background, start, int(k), velocity[k] / speed[k])
        )
    squared = float(np.median(squares)) / float(np.mean(speed[tried] ** 2))
    step = float(np.median(np.diff(clip.times)))
    return min(float(np.sqrt(max(squared, 0.0))), step)


def _longer(frame: Frame, background: Image, start: Located, k: int, along: Array) -> float:
    """Return the variance of a ball's matte along a direction, less that across it [pixels²]."""
    x, y, radius = float(start.x[k]), float(start.y[k]), float(start.radius[k])
    reach = 1.6 * radius + 4
    place = np.s_[int(y - reach) : int(y + reach) + 1, int(x - reach) : int(x + reach) + 1]
    rows, columns = np.mgrid[place]
    away = np.hypot(columns - x, rows - y)
    off = frame[place] - background[place]
    light = float(np.median(off[away < 0.5 * radius]))
    share = np.clip(np.where(away < reach, off / light, 0.0), 0.0, 1.0) if light else off * 0.0
    share[share < TRACK.faint] = 0.0
    total = max(float(share.sum()), 1.0)
    mean_x, mean_y = (share * columns).sum() / total, (share * rows).sum() / total
    u = (columns - mean_x) * along[0] + (rows - mean_y) * along[1]
    w = (rows - mean_y) * along[0] - (columns - mean_x) * along[1]
    return float((share * (u**2 - w**2)).sum() / total)


def middle_of(samples: Frame) -> Image:
    """Return the median of samples, (row, column)."""
    # in parts: a sorted stack of whole frames would need the memory of them all
    parts = np.array_split(samples, max(1, samples.shape[1] // 64), axis=1)
    return np.concatenate([np.median(part, axis=0) for part in parts]).astype(np.float32)


def uncovered_mean(
    samples: Iterable[Frame], first: Image, covered: Iterable[list[tuple[float, float, float]]]
) -> Image:
    """Return the mean of the samples where the ball did not cover them.

    Parameters
    ----------
    samples
        Pictures, (row, column) each.
    first
        What is taken where fewer than three samples show the background.
    covered
        x, y and reach [pixels] of what moves in each sample.
    """
    total, count = np.zeros((2, *first.shape), np.float32)
    for sample, spots in zip(samples, covered, strict=True):
        free = np.ones(first.shape, np.uint8)
        for x, y, reach in spots:
            cv2.circle(free, (round(x), round(y)), int(np.ceil(reach)) + 1, 0, -1)
        total += free * sample
        count += free
    return np.where(count >= TRACK.shown, total / np.maximum(count, 1), first).astype(np.float32)
