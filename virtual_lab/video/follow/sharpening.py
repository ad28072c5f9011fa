"""Sharp location of the ball in each frame of a calibrated camera that stands still.

A frame belongs to no flight if the ball struck an object during its exposure. A frame in which the
ball is still in contact with the struck object belongs to no flight either, because its position
contradicts the other positions of the flight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.calibration.plane import Plane, foot_of, plane_of
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.reading import grey_of
from virtual_lab.video.clips.timing import usual_step
from virtual_lab.video.find.blobs import Blobs
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.flights import meetings, without_contacts
from virtual_lab.video.follow.joint import Fit, fit_flights, pattern_covariance
from virtual_lab.video.follow.knowledge import GRAVITY, STATED_LEVEL_U, ClipKnowledge, Note
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene
from virtual_lab.video.follow.searching import FlightsFound
from virtual_lab.video.locate.located import Located, PlaceFlag, Regions, cut, squares
from virtual_lab.video.locate.sharp import sharp_places

LEAST_FRAMES = 3  # smallest number of frames of a flight
# range of the ratio of a ball's radius to the expected radius, which excludes other objects. The
# hull of a ball lit from the side is half a disk, half a radius wide.
SIZE_RATIOS = (0.4, 1.45)
# smallest probability of the distance of a position from its flight; a less likely position is
# rejected
CHANCE = 1e-3
DENIED_SHARE = 0.34  # largest share of rejected positions of a flight
# largest misfit of a flight to its model: rms residual [u of a position from noise and pattern
# together], and slope to the plane [its u]
MISFIT_U = 3.0
# u of the growth of the radius in a flight [pixels], the change of the radius if the background
# becomes brighter by a tenth of the ball's contrast
GROWTH_U = 0.03


class NotSharpError(Exception):
    """The ball cannot be located sharply; the message states the reason."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SharpBall:
    """The sharply located ball; arrays over the frames that show it, (frame,)."""

    frames: NDArray[np.intp]
    located: Located
    plane: Plane
    notes: tuple[Note, ...] = ()
    # fits in which the slope of one flight to the plane is one standard uncertainty larger
    aside: tuple[Fit, ...] = ()

    def in_picture(self, place: Array, frame: float) -> Array:
        """Return the approximate position in the picture of a position (2,) of the fit [pixels]."""
        away = np.abs(self.frames - frame)
        away[~np.isfinite(self.located.x)] = np.inf
        near = int(np.argmin(away))
        return np.asarray(self.located.places[near] + place - self.plane.flat[near])


def wants_sharp(knowledge: ClipKnowledge, watched: Watched, ways: Sequence[Piece]) -> bool:
    """Return whether the ball should be located sharply, by its outline (`sharpen`).

    The result is True if all of these are true:

    * The calibration states the camera, the lens blur or the exposure. One of them is enough.
    * `watched` shows a camera that does not move and a clip that is not interlaced.
    * `ways` holds one or two flights.
    * The user did not request gravity as the source of the scale (`knowledge.ruler`), and states
      no positions by hand.

    `sharpen` may still fail.
    """
    calibration = knowledge.calibration
    # A file that only states rate or scale replaces options and is not a reason for an outline fit.
    has_camera = calibration.camera or calibration.lens_blur_px or calibration.exposure_s
    free = knowledge.by_hand is None and knowledge.ruler != GRAVITY
    still = not (watched.still.drifts or watched.interlaced)
    return bool(has_camera and free and still and 0 < len(ways) <= 2)


def sharpen(
    clip: Clip,
    watched: Watched,
    knowledge: ClipKnowledge,
    search: FlightsFound,
    progress: Callable[[str], None],
) -> tuple[FlightScene, list[Piece], SharpBall]:
    """Locate the ball by its outline in each frame of its flights.

    Return the scene with the gravity and drag of the calibration, the flights with the new
    positions, and the located ball.

    Parameters
    ----------
    search
        Scene and flights, with positions from the blobs, the regions that differ from the
        background.
    progress
        Function that is called with a message about the work.

    Raises
    ------
    NotSharpError
        The calibration lacks the lens blur or the exposure time, no object has the size of the
        ball, the ball is located in too few frames, or their time stamps contradict the positions.
    InputError
        The scale is unknown.
    """
    calibration, scene, ways = knowledge.calibration, search.scene, search.ways
    lens, exposure = calibration.lens_blur_px, knowledge.exposure
    if lens is None or exposure is None:
        words = "lens_blur_px (virtual-lab calibrate measures it)"
        key = words if lens is None else "exposure_s (the camera's own setting)"
        raise NotSharpError(f"the calibration file does not give {key}")
    if calibration.timestamps is not None and (stepped := scene.missing_frames(ways)):
        words = "the ball moves farther than the time stamps explain"
        raise NotSharpError(f"before frame {min(stepped)} {words}")
    blobs = watched.blobs[np.concatenate([way.blobs for way in ways])]
    frames, step = blobs["frame"].astype(np.intp), usual_step(clip.times)
    radius, expected = float(np.median(blobs["radius"])), None
    if knowledge.ball and knowledge.metres_per_pixel:
        expected = knowledge.ball / 2 / knowledge.metres_per_pixel
        least, most = SIZE_RATIOS
        if not least < radius / expected < most:
            raise NotSharpError(f"no flying round object has a radius near {expected:.3g} pixels")
    coarse = fit_flights(scene, ways)
    velocity = np.concatenate([coarse.at(k, way.t)[:, 2:] for k, way in enumerate(ways)])
    places = np.stack([blobs["picture_x"], blobs["picture_y"]], axis=1)
    start = Located.start(places, radius, exposure / step * velocity)
    progress(f"locating the ball in {len(frames)} frames (its loops are compiled at the first use)")
    corners, side = squares(start, clip.shape)
    pictures = zip(corners, clip.numbered_frames(frames), strict=True)
    regions = Regions(
        pixels=np.concatenate([cut(grey_of(frame), at[None], side) for at, (_, frame) in pictures]),
        background=cut(_background(clip, watched.blobs), corners, side),
        corners=corners,
    )
    located = sharp_places(clip, regions, start, lens=lens, ball_radius=expected)
    plane = plane_of(located, calibration, str(clip.source.path))
    ball = SharpBall(frames=frames, located=located, plane=plane)
    stamped = clip.times / step
    lost = [np.round(way.t - scene.time[way.frames]) for way in ways]
    pairs = zip(ways, lost, strict=True)
    ways = [replace(way, t=stamped[way.frames] + more) for way, more in pairs]
    return settle(scene, ways, ball, knowledge)


def _background(clip: Clip, moving: Blobs) -> Array:
    """Return the background: the mean of samples without moving objects, otherwise the median.

    The median contains a ball that remains at a contact for most of the time.
    """
    samples = clip.grey_samples()
    free = np.ones(samples.shape, np.uint8)
    for mask, number in zip(free, clip.sampled, strict=True):
        for blob in moving[moving["frame"] == number]:
            middle = round(float(blob["picture_x"])), round(float(blob["picture_y"]))
            cv2.circle(mask, middle, int(1.15 * blob["length"]) + 10, 0, -1)
    count = free.sum(axis=0)
    mean = samples.sum(axis=0, where=free > 0) / np.maximum(count, 1)
    return np.where(count > 0, mean, np.median(samples, axis=0))


def settle(
    scene: FlightScene, ways: list[Piece], ball: SharpBall, knowledge: ClipKnowledge
) -> tuple[FlightScene, list[Piece], SharpBall]:
    """Return scene, flights and located ball, with positions from the ball's outlines.

    The scene has the gravity and drag of the calibration. The plane is the plane in which the ball
    moves. The flights have the positions of `ball`, corrected for the height of the ball above the
    plane. The flights have no unusable positions, outliers, or positions near a contact.

    The returned ball has all positions. A usable position that is in no flight gets the flag
    `OFF_WAY`. Notes name each flight that leaves the plane or does not fit the model of a flight.
    The field `aside` of the returned ball has additional fits. In each of these fits, the angle
    between one flight and the plane is one standard uncertainty larger. The uncertainty of the
    results includes the differences between these fits and the main fit.

    Raises `NotSharpError` if too few positions of a flight remain.

    Parameters
    ----------
    ways
        Flights in the order of time, with positions from the blobs, the regions that differ from
        the background.
    ball
        The located ball. It has the positions of all flights in `ways`, in the same order.
    """
    calibration, located, plane = knowledge.calibration, ball.located, ball.plane
    good = located.usable
    parts = np.split(np.arange(len(good)), np.cumsum([len(way.t) for way in ways])[:-1])
    pattern = float(np.median(located.pattern_u[good])) if good.any() else 0.0
    pairs = zip((replace(way, sharp=True, pattern_u=pattern) for way in ways), parts, strict=True)
    full = [(replace(way, xy=plane.flat[k], u=located.u[k]), k) for way, k in pairs]
    ways = [way.part(good[k]) for way, k in full]
    scale, step = plane.metres_per_pixel, 1 / knowledge.rate
    scene = replace(
        scene,
        pull=np.array(calibration.gravity_mps2[:2]) * [1, plane.sense] * step**2 / scale,
        drag=(calibration.drag_per_m * scale, calibration.drag_per_m_u * scale),
        in_radii=False,
        readout=0.0,
    )
    agreed = [_reject_outliers(scene, way) for way in ways]
    apart = without_contacts(scene, agreed, fit_flights(scene, agreed))
    flown = [_reject_outliers(scene, way) for way in apart]
    flags = located.flags.copy()
    left_out = ~np.isin(ball.frames, np.concatenate([way.frames for way in flown]))
    flags[good & left_out] |= np.uint16(PlaceFlag.OFF_WAY)
    ball = replace(ball, located=replace(located, flags=flags))
    flown, aside, notes = _flatten(scene, flown, ball, knowledge)
    for k, (way, left) in enumerate(zip(flown, fit_flights(scene, flown).residuals, strict=True)):
        if np.sqrt(np.mean(left**2)) > MISFIT_U * np.hypot(np.median(way.u), way.pattern_u):
            why = "give gravity_mps2 or drag_per_m, or leave out frames with a touched ball"
            notes.append(("CROOKED", f"flight {k + 1} is not straight; {why}"))
    return scene, flown, replace(ball, aside=aside, notes=tuple(notes))


def _reject_outliers(scene: FlightScene, way: Piece) -> Piece:
    """Return the flight without outliers, the largest residual removed first.

    Raises `NotSharpError` if too few positions remain.
    """
    if len(way.t) < LEAST_FRAMES:
        words = "frames of a flight show the ball complete, round and apart from other objects"
        raise NotSharpError(f"fewer than {LEAST_FRAMES} {words}")
    least = max(LEAST_FRAMES, (1 - DENIED_SHARE) * len(way.t))
    while len(way.t) > least:
        (left,) = fit_flights(scene, [way]).residuals
        weight = way.u**-2 / np.sum(way.u**-2)
        late = way.t - weight @ way.t
        # 1 minus the leverage of each position
        free = 1 - weight - weight * late**2 / (weight @ late**2)
        squares, spare = (left**2).sum(axis=1) / free, 2 * (len(way.t) - 3)
        # variance of the other positions, at least that expected from noise and pattern
        scatter = np.maximum((free @ squares - squares) / spare, way.u**2 + way.pattern_u**2)
        # p-value by the F distribution, for two axes
        chance = (1 + squares / scatter / spare) ** (-spare / 2)
        if chance.min() > CHANCE:
            break
        way = way.part(np.arange(len(chance)) != np.argmin(chance))
    return way


def _flatten(
    scene: FlightScene, ways: list[Piece], ball: SharpBall, knowledge: ClipKnowledge
) -> tuple[list[Piece], tuple[Fit, ...], list[Note]]:
    """Return the flights projected to the plane, fits with other slopes to the plane, and notes.

    A ball at the height h above the plane, seen by a camera at the distance Z, looks larger and
    farther from the foot of the camera by the factor 1 + h/Z. h is 0 at the contact. The rate of h
    is estimated from the growth of the ball's image. For the first flight there is also prior
    knowledge, a slope of 0 with a u of half a degree, unless the growth contradicts it.
    """
    calibration, plane = knowledge.calibration, ball.plane
    camera, fit, notes = calibration.camera, fit_flights(scene, ways), []
    # For an unknown camera the axis passes the center of the picture, and the distance is infinite.
    foot, far, bend = (np.array(scene.size) - 1) / 2, np.inf, 0.0
    if camera:
        *middle, over = foot_of(camera)
        foot = np.array(middle) * [1, plane.sense] / plane.metres_per_pixel
        far = abs(over) / plane.metres_per_pixel
        (fall,) = calibration.gravity_mps2[2:] or (0.0,)
        bend = fall / over / knowledge.rate**2 / 2
    starts = [(ways[0].t[-1] + way.t[0]) / 2 for way in ways[1:]] or [ways[0].t.mean()]
    (start,) = [t for _, t in meetings(ways, fit)] or starts
    climbs = []
    for k, way in enumerate(ways):
        rows, late = np.isin(ball.frames, way.frames), way.t - start
        grown = np.log(ball.located.radius[rows] / plane.sizes[rows]) - bend * late**2
        climb, u = _growth_rate(way, grown, late)
        before = STATED_LEVEL_U * float(np.hypot(*fit.states[k, 2:])) / far
        if abs(climb) > MISFIT_U * np.hypot(u, before):
            words = f"flight {k + 1} leaves the plane: the ball's picture grows by "
            notes.append(("OFF_PLANE", f"{words}{100 * climb * np.ptp(late):+.2g} % in it"))
        elif k == 0 or not camera:  # the second flight can have any direction
            share = before**2 / (before**2 + u**2)
            climb, u = share * climb, np.sqrt(share) * u
        climbs.append((climb, u))

    def flat(moved: int | None = None) -> list[Piece]:
        pieces = []
        for k, (way, (climb, u)) in enumerate(zip(ways, climbs, strict=True)):
            late = (way.t - start)[:, None]
            nearer = (climb + u * (k == moved)) * late + bend * late**2
            pieces.append(replace(way, xy=foot + (way.xy - foot) / (1 + nearer)))
        return pieces

    aside = [fit_flights(scene, flat(k)) for k, (_, u) in enumerate(climbs) if u]
    return flat(), tuple(aside), notes


def _growth_rate(way: Piece, grown: Array, late: Array) -> tuple[float, float]:
    """Return the growth rate of a ball's radius, from its logarithms `grown`, and u [1/frame].

    `late`, (position,), is the time of each logarithm [frames]. The pattern of the ball and the
    light change the radius slowly, by as much as they change the position.
    """
    u = way.u / way.radius
    relative = replace(way, u=u, pattern_u=way.pattern_u / way.radius)
    line, noise = np.polyfit(late, grown, 1, w=1 / u, cov="unscaled")
    left = (grown - np.polyval(line, late))[:, None]
    pattern = pattern_covariance(relative, left, late - late.mean())
    light = GROWTH_U / way.radius / np.ptp(late)
    return float(line[0]), float(np.sqrt(noise[0, 0] + pattern[1, 1] + light**2))
