"""Position of the ball in the image windows of each shot, and its direction of flight."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.measurement.camera.filmed import CAMERA, Sightings
from virtual_lab.measurement.reduction.flights import Constants
from virtual_lab.records import ClipRecord, TrackRecord
from virtual_lab.units import Array, Mask
from virtual_lab.video.locate.located import Located, PlaceFlag, Regions, cut, part_of
from virtual_lab.video.locate.noise import ROUNDING, Noise
from virtual_lab.video.locate.sharp import place, standing_out

# distance from the ball's farthest position within which it may touch the bat [m]
NEAR_BAT = 8e-3
# smallest and largest number of used frames of a flight, inbound or outbound. More frames improve
# little, because the error caused by the pattern of the ball changes slowly.
LEAST_FRAMES, MOST_FRAMES = 4, 24
# uncertainty of the ovality of an outline off the axis, caused by lens and pose [share of the
# radius]
OVAL_U = 1e-3


def sight(record: ClipRecord | TrackRecord, x: Constants) -> Sightings:
    """Return the positions of the ball in the camera's frames [px], (shot, frame).

    A position is NaN if the ball was not located reliably in the frame.

    Parameters
    ----------
    record
        Image windows with their background, or positions that the camera itself tracked.
    x
        Calibration constants of the camera and the radius of the ball, keyed by name, such as
        ``impact.camera.focal`` and ``ball.radius``. Each is a single number.

    Raises
    ------
    InputError
        The record has windows without pixels, without background, or beyond the edge of the frame.
    """
    of = {name.removeprefix(CAMERA): float(x[name]) for name in x if name.startswith(CAMERA)}
    size, radius = of["focal"] / (of["place_z"] - of["plane"]), float(x["ball.radius"])  # [px/m, m]
    if isinstance(record, TrackRecord):
        still = np.zeros_like(record.u)
        return _ways(record.times, np.stack([record.x, record.y, record.u, still]), size)
    pixels, background = record.pixels, record.background
    if pixels is None or background is None:
        name = "pixels" if pixels is None else "background"
        raise InputError("impact/camera", name, None, "this array is missing")
    table = np.full((4, *record.times.shape), np.nan)
    for shot, times in enumerate(record.times):
        frames = np.flatnonzero(np.isfinite(times))
        if frames.size < LEAST_FRAMES:
            continue
        corners = np.stack([record.left[shot, frames], record.top[shot, frames]], axis=1)
        side = pixels.shape[2:]
        last = np.array(background.shape)[::-1] - side[::-1]
        if (wrong := ((corners < 0) | (corners > last)).any(axis=1)).any():
            allowed = f"allowed: windows within the frame, 0 to {last[0]}, 0 to {last[1]}"
            raise InputError("impact/camera", "left_px, top_px", corners[wrong][0], allowed)
        behind = cut(background, corners, side)
        regions = Regions(pixels=pixels[shot, frames], background=behind, corners=corners)
        began = _start(regions, size * radius)
        free, out = (each[0] for each in _free(times[None, frames], began[None, :, 0], size))
        used = np.concatenate([_spread(free & ~out), _spread(free & out)])
        blurs = _blurs(times[frames], began, out, of["exposure"])
        positions = place(
            part_of(regions, used),
            Located.start(began[used], size * radius, blurs[used]),
            noise=_noise(of),
            lens=of["blur"],
            middle=(of["centre_x"], of["centre_y"]),
            # The image of a sphere at the angle b from the axis is longer by the factor 1 / cos b.
            oval=(1 / (2 * of["focal"]) ** 2, OVAL_U),
        )
        useful = positions.usable & ((positions.flags & PlaceFlag.SATURATED) == 0)
        places = positions.x, positions.y, positions.u, positions.pattern_u
        table[:, shot, frames[used]] = np.where(useful, places, np.nan)
    return _ways(record.times, table, size)


def _noise(of: Mapping[str, float]) -> Noise:
    """Return the noise of a camera from its photon transfer measurement."""
    gain = of["gain"]
    dark = of["read_noise"] ** 2 + of["dark_signal"] ** 2
    return Noise(
        gain=gain,
        read=gain**2 * dark + ROUNDING,
        black=of["black_level"],
        prnu=of["photo_response"],
        full_scale=of["full_scale"],
    )


def _start(regions: Regions, radius: float) -> Array:
    """Return the approximate position of the ball in each window, frame pixels (window, 2)."""
    import cv2

    rows, columns = regions.pixels.shape[1:]
    off = regions.pixels.astype(np.float32) - regions.background
    middle = np.hypot(*np.ogrid[-rows / 2 : rows / 2, -columns / 2 : columns / 2]) < radius / 2
    centres = []
    for one in off:
        ball = cv2.moments(standing_out(one if np.median(one[middle]) > 0 else -one), True)
        centres.append(np.array([ball["m10"], ball["m01"]]) / max(ball["m00"], 1.0))
    return np.asarray(regions.corners + centres)


def _blurs(times: Array, places: Array, out: Mask, exposure: float) -> Array:
    """Return the ball's motion in each exposure at the median speed, shape of `places` [px]."""
    blurs = np.zeros(places.shape)
    for way in (~out, out):
        if way.sum() > 1:
            steps = np.diff(places[way], axis=0) / np.diff(times[way])[:, None]
            blurs[way] = exposure * np.median(steps, axis=0)
    return blurs


def _free(times: Array, x: Array, size: float) -> tuple[Mask, Mask]:
    """Return masks of the frames without contact with the bat, and of the frames after it."""
    finite = np.isfinite(times + x)
    forth = np.where(finite, x, -np.inf)
    out = np.arange(times.shape[1]) > forth.argmax(axis=1)[:, None]
    return finite & (x < forth.max(axis=1)[:, None] - NEAR_BAT * size), out


def _spread(free: Mask) -> NDArray[np.intp]:
    """Return at most `MOST_FRAMES` frames of a shot in free flight, evenly spread."""
    some = np.flatnonzero(free)
    count = min(some.size, MOST_FRAMES)
    return np.asarray(some[np.linspace(0, some.size - 1, count).round().astype(int)], np.intp)


def _ways(times: Array, places: Array, size: float) -> Sightings:
    """Return the sightings on the way in and out, without frames of a possible contact.

    `places` are x, y, u and pattern_u, (4, shot, frame).
    """
    free, out = _free(times, places[0] + places[2], size)
    for way in (~out, out):
        free &= ~(way & ((free & way).sum(axis=1) < LEAST_FRAMES)[:, None])
    times, x, y, u, pattern_u = np.where(free, [times, *places], np.nan)
    return Sightings(times=times, x=x, y=y, u=u, pattern_u=pattern_u, out=out)
