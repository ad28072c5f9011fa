"""The ball of a calibrated camera that stands, located as sharply as can be, frame by frame.

A frame during whose exposure the ball was struck belongs to neither flight; nor does one that
shows the ball pressed against what it struck, which the flight's other places deny.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.calibration.plane import RIM, Plane, plane_of, slopes_of
from virtual_lab.video.clips.calibration_file import CameraModel
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.reading import grey_of
from virtual_lab.video.clips.timing import usual_step
from virtual_lab.video.find.blobs import Blobs
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.flights import without_contacts
from virtual_lab.video.follow.joint import Fit, fit_flights
from virtual_lab.video.follow.knowledge import GRAVITY, ClipKnowledge, Note
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene
from virtual_lab.video.follow.searching import FlightsFound
from virtual_lab.video.locate.located import Located, PlaceFlag, Regions, cut, squares
from virtual_lab.video.locate.sharp import sharp_places


@dataclass(frozen=True, slots=True, kw_only=True)
class SharpnessSettings:
    """Thresholds for the frames of a flight, and for doubts about it."""

    least_frames: int = 3  # smallest number of frames of a flight
    # range of the ratio of a ball's radius to the expected one: other things are outside it. The
    # hull of a ball lit from the side is half a disc, half a radius wide
    size_ratios: tuple[float, float] = (0.4, 1.45)
    # smallest probability of a place's distance from its flight: a less likely place is rejected
    chance: float = 1e-3
    denied_share: float = 0.34  # largest share of a flight's places that are rejected
    # largest rms residual of a flight [u of a place, by noise and pattern together]
    crooked_u: float = 3.0
    trend: float = 0.004  # smallest relative change of the radius through a flight that matters
    # largest p-value of such a change: it is small because seams make neighbouring radii err alike
    trend_chance: float = 1e-6


SHARPNESS = SharpnessSettings()


class NotSharpError(Exception):
    """Why a ball cannot be located sharply."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SharpBall:
    """The ball located sharply; arrays over the frames that show it, (frame,)."""

    frames: NDArray[np.intp]
    located: Located
    plane: Plane
    off_plane: Array  # (flight, 2) velocity that a ball seems to have as it comes nearer [px/frame]
    notes: tuple[Note, ...] = ()
    # (flight, 2) change of the velocity of a flight half a degree off the plane
    slants: Array | None = None

    def aside(self, fit: Fit) -> list[tuple[Fit, float]]:
        """Return fits of flights that stay in the plane or leave it unseen, with their shares."""
        moves = [self.off_plane] if self.off_plane.any() else []
        if self.slants is not None:  # each flight by itself
            moves += [*(np.eye(len(self.slants))[..., None] * self.slants)]
        fits = []
        for move in moves:
            states = fit.states.copy()
            states[:, 2:] -= move
            vector = np.r_[fit.vector[: -states.size], states.ravel()]
            fits.append((fit.with_vector(vector), 1.0))
        return fits

    def metres(self, place: Array) -> Array:
        """Convert a place (2,) of the fit [pixels] to a place in the plane [m]."""
        return self.plane.metres_per_pixel * place * [1, self.plane.sense]

    def in_picture(self, place: Array, frame: float) -> Array:
        """Convert a place (2,) of the fit to the picture, well enough for a mark [pixels]."""
        away = np.abs(self.frames - frame)
        away[~np.isfinite(self.located.x)] = np.inf
        near = int(np.argmin(away))
        return np.asarray(self.located.places[near] + place - self.plane.flat[near])


def wants_sharp(knowledge: ClipKnowledge, watched: Watched, ways: Sequence[Piece]) -> bool:
    """Return whether a calibrated camera stands still, with whole frames and at most one hit."""
    calibration = knowledge.calibration
    # a file that gives rate or scale only replaces options; it asks for no outline fit
    has_camera = calibration is not None and (
        calibration.camera or calibration.lens_blur_px or calibration.exposure_s
    )
    if not has_camera or watched.still.drifts or watched.interlaced or knowledge.ruler == GRAVITY:
        return False
    return 0 < len(ways) <= 2


def sharpen(
    clip: Clip,
    watched: Watched,
    knowledge: ClipKnowledge,
    search: FlightsFound,
    progress: Callable[[str], None],
) -> tuple[FlightScene, list[Piece], SharpBall]:
    """Locate the ball by its outline in each frame, and return scene, flights and ball with that.

    Raises
    ------
    NotSharpError
        The calibration lacks a key, no object has the ball's size, too few frames locate the ball,
        or their time stamps contradict the positions.
    InputError
        Nothing sets the scale.
    """
    calibration, scene, ways = knowledge.calibration, search.scene, search.ways
    assert calibration is not None
    lens, exposure = calibration.lens_blur_px, knowledge.exposure
    if lens is None or exposure is None:
        words = "lens_blur_px (virtual-lab calibrate measures it)"
        key = words if lens is None else "exposure_s (the camera's own setting)"
        raise NotSharpError(f"the calibration file does not give {key}")
    if calibration.timestamps is not None and (stepped := scene.lost(ways)):
        raise NotSharpError(
            f"before frame {min(stepped)} the ball moves farther than the time stamps explain"
        )
    blobs = watched.blobs[np.concatenate([way.blobs for way in ways])]
    frames, step = blobs["frame"].astype(np.intp), usual_step(clip.times)
    radius, expected = float(np.median(blobs["radius"])), None
    if knowledge.ball and knowledge.metres_per_pixel:
        expected = knowledge.ball / 2 / knowledge.metres_per_pixel
        least, most = SHARPNESS.size_ratios
        if not least < radius / expected < most:
            raise NotSharpError(f"no flying round object has a radius near {expected:.3g} pixels")
    coarse = fit_flights(scene, ways)
    velocity = np.concatenate([coarse.at(k, way.t)[:, 2:] for k, way in enumerate(ways)])
    places = np.stack([blobs["picture_x"], blobs["picture_y"]], axis=1)
    start = Located.start(places, radius, exposure / step * velocity)
    progress(f"locating the ball in {len(frames)} frames (its loops are compiled at the first use)")
    corners, side = squares(start, clip.shape)
    pictures = zip(corners, clip.chosen(frames), strict=True)
    regions = Regions(
        pixels=np.concatenate([cut(grey_of(frame), at[None], side) for at, (_, frame) in pictures]),
        background=cut(_background(clip, watched.blobs), corners, side),
        corners=corners,
    )
    located = sharp_places(clip, regions, start, lens=lens, ball_radius=expected)
    ball = SharpBall(
        frames=frames,
        located=located,
        plane=plane_of(located, calibration, str(clip.source.path)),
        off_plane=np.zeros((len(ways), 2)),
    )
    stamped = clip.times / step
    ways = [
        replace(way, t=stamped[way.frames] + np.round(way.t - scene.time[way.frames]))
        for way in ways
    ]
    return settle(scene, ways, ball, knowledge)


def _background(clip: Clip, moving: Blobs) -> Array:
    """Return the background: the mean of samples if nothing covers them, else their median.

    A ball that dwells at a contact stands in the median, too.
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
    """Select the places that belong to the flights, and note doubts about them.

    The places of the flights `ways`, joined in order, are those in `ball`, one by one. Raises
    `NotSharpError` if too few places remain.
    """
    calibration, located, plane = knowledge.calibration, ball.located, ball.plane
    assert calibration is not None
    assert knowledge.exposure is not None
    good = located.usable
    parts = np.split(np.arange(len(good)), np.cumsum([len(way.t) for way in ways])[:-1])
    pattern = float(np.median(located.pattern_u[good])) if good.any() else 0.0
    ways = [
        replace(way, xy=plane.flat[rows], u=located.u[rows], pattern_u=pattern).part(good[rows])
        for way, rows in zip(ways, parts, strict=True)
    ]
    scale, step = plane.metres_per_pixel, 1 / knowledge.rate
    scene = replace(
        scene,
        pull=np.array(calibration.gravity_mps2) * [1, plane.sense] * step**2 / scale,
        drag=(calibration.drag_per_m * scale, calibration.drag_per_m_u * scale),
        in_radii=False,
        readout=0.0,
        exposure=knowledge.exposure / step,
    )
    agreed = [_reject_outliers(scene, way) for way in ways]
    flown = [_reject_outliers(scene, way) for way in without_contacts(scene, agreed)]
    flags = located.flags.copy()
    left_out = ~np.isin(ball.frames, np.concatenate([way.frames for way in flown]))
    flags[good & left_out] |= np.uint16(PlaceFlag.OFF_WAY)
    ball = replace(ball, located=replace(located, flags=flags))
    ball = replace(ball, off_plane=np.array([_approach(scene, way, ball) for way in flown]))
    if calibration.camera:
        fit = fit_flights(scene, flown)
        ball = replace(ball, slants=_slants(calibration.camera, fit, flown, plane))
    return scene, flown, replace(ball, notes=tuple(_against(scene, flown, ball, knowledge)))


def _reject_outliers(scene: FlightScene, way: Piece) -> Piece:
    """Return the flight without outliers, the largest residual removed first.

    Raises `NotSharpError`: too few places.
    """
    if len(way.t) < (few := SHARPNESS.least_frames):
        raise NotSharpError(
            f"fewer than {few} frames of a flight show the ball complete, round and apart from "
            "other objects"
        )
    least = max(few, (1 - SHARPNESS.denied_share) * len(way.t))
    while len(way.t) > least:
        assert way.u is not None
        (left,) = fit_flights(scene, [way]).residuals
        weight = way.u**-2 / np.sum(way.u**-2)
        late = way.t - weight @ way.t
        # 1 minus the leverage of each place
        free = 1 - weight - weight * late**2 / (weight @ late**2)
        squares, spare = (left**2).sum(axis=1) / free, 2 * (len(way.t) - 3)
        # variance of the other places, at least the one expected from noise and pattern
        scatter = np.maximum((free @ squares - squares) / spare, way.u**2 + way.pattern_u**2)
        # p-value by the F distribution, for two axes
        chance = (1 + squares / scatter / spare) ** (-spare / 2)
        if chance.min() > SHARPNESS.chance:
            break
        way = way.part(np.arange(len(chance)) != np.argmin(chance))
    return way


def _slants(camera: CameraModel, fit: Fit, flights: Sequence[Piece], plane: Plane) -> Array:
    """Return the apparent extra velocity (flight, 2) of a flight half a degree off the plane.

    At X off the camera's foot and Z from the camera, v_z reads as X/Z v_z along the plane.
    """
    flip = [1, plane.sense]
    middles = np.array([flight.xy.mean(axis=0) * flip for flight in flights])
    slopes = slopes_of(camera, middles * plane.metres_per_pixel) * flip
    return np.asarray(np.tan(np.radians(0.5)) * np.hypot(*fit.states[:, 2:].T)[:, None] * slopes)


def _approach(scene: FlightScene, way: Piece, ball: SharpBall) -> Array:
    """Return the apparent velocity (2,) of an approaching ball [px/frame]; 0: it does not."""
    from scipy.stats import linregress

    rows = np.isin(ball.frames, way.frames) & (ball.located.flags == 0)
    if rows.sum() < SHARPNESS.least_frames:
        return np.zeros(2)
    radii, t = ball.located.radius[rows], way.t[np.isin(way.frames, ball.frames[rows])]
    trend = linregress(t, np.log(radii / ball.plane.sizes[rows]))
    least = max(SHARPNESS.trend, 2 * RIM * way.pattern_u / float(np.median(radii)))
    if abs(trend.slope) * np.ptp(t) < least or trend.pvalue > SHARPNESS.trend_chance:
        return np.zeros(2)
    middle = (np.array(scene.size) - 1) / 2
    return np.asarray(trend.slope * (ball.located.places[rows].mean(axis=0) - middle))


def _against(
    scene: FlightScene, ways: Sequence[Piece], ball: SharpBall, knowledge: ClipKnowledge
) -> Iterator[Note]:
    """Yield notes against sharp flights."""
    fit = fit_flights(scene, ways)
    for k, (way, left, off) in enumerate(zip(ways, fit.residuals, ball.off_plane, strict=True)):
        assert way.u is not None
        noise = np.hypot(np.median(way.u), way.pattern_u)
        if float(np.sqrt(np.mean(left**2))) > SHARPNESS.crooked_u * noise:
            yield (
                "CROOKED",
                f"flight {k + 1} is not straight; give gravity_mps2 or drag_per_m, or leave out "
                "frames in which the ball is touched",
            )
        if off.any():
            velocity = fit.states[k, 2:]
            along = off @ velocity / np.hypot(*velocity)
            faster = along * ball.plane.metres_per_pixel * knowledge.rate
            yield (
                "OFF_PLANE",
                f"the size of the ball changes in flight {k + 1}, so it leaves its plane; this "
                f"shifts its speed by {faster:+.2g} m/s",
            )
