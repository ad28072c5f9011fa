"""The ball of a calibrated camera that stands, located as sharply as can be, frame by frame.

A frame during whose exposure the ball was struck belongs to neither flight; nor does one that
shows the ball pressed against what it struck, which its neighbours' way shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.calibration.plane import RIM, Plane, plane_of
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.reading import Frame, grey_of
from virtual_lab.video.clips.timing import usual_step
from virtual_lab.video.find.blobs import Blobs
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.flights import meetings, without_contacts
from virtual_lab.video.follow.joint import Fit, fit_flights
from virtual_lab.video.follow.known import GRAVITY, ClipKnowledge, Note
from virtual_lab.video.follow.pieces import FAR_U, Piece
from virtual_lab.video.follow.scene import FlightScene
from virtual_lab.video.follow.searching import FlightsFound
from virtual_lab.video.locate.located import Located, PlaceFlag, Regions, squares
from virtual_lab.video.locate.sharp import sharp_places

Image = NDArray[np.float32]
USELESS = PlaceFlag.NOT_FOUND | PlaceFlag.CLIPPED | PlaceFlag.OVERLAP | PlaceFlag.POOR_FIT


@dataclass(frozen=True, slots=True, kw_only=True)
class SharpnessSettings:
    """Which frames are of a flight, how its exposure is read, and what speaks against it."""

    least_frames: int = 3  # of a flight
    few_frames: int = 5  # fewer show little of their own scatter
    # of a ball's radius to the one expected: what is farther off is another thing; the hull of a
    # ball lit from the side is half a disc, half a radius wide
    size_ratios: tuple[float, float] = (0.4, 1.45)
    frames: int = 8  # from which an exposure is read, and at least a trend of the radius
    fast: float = 0.8  # of the greatest speed, at least: slower ones show less
    faint: float = 0.1  # of the ball's brightness: less is noise
    shown: int = 3  # frames that must show a pixel's background for their mean to be taken
    rounds: int = 3
    outlier_spreads: float = 8.0  # robust standard deviations: a place this far off is left out
    contact_share: float = 0.34  # of a flight's places: no contact is seen in more
    crooked_u: float = 3.0  # of a place, noise and pattern together, that residuals scatter by
    trend: float = 0.004  # of the radius through a flight: less is no matter
    trend_u: float = 6.0  # standard uncertainties of it


SHARPNESS = SharpnessSettings()


class NotSharpError(Exception):
    """Why a ball cannot be located sharply."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SharpBall:
    """The ball located sharply; arrays over the frames that show it, (frame,)."""

    frames: NDArray[np.intp]
    t: Array  # time [steps of a frame]
    located: Located
    plane: Plane
    exposure: float  # [s]
    background: Image
    off_plane: Array  # (flight, 2) velocity that a ball seems to have as it comes nearer [px/frame]
    notes: tuple[Note, ...]

    def aside(self, fit: Fit) -> list[tuple[Fit, float]]:
        """Fits of flights that stay in the plane, where they seem to leave it."""
        if not self.off_plane.any():
            return []
        states = fit.states.copy()
        states[:, 2:] -= self.off_plane
        return [(fit.with_vector(np.r_[fit.vector[: -states.size], states.ravel()]), 1.0)]

    def metres(self, place: Array) -> Array:
        """Place (2,) [m] in the plane of one by the fit [pixels]."""
        return self.plane.metres_per_pixel * place * [1, self.plane.sense]

    def pictured(self, place: Array, frame: float) -> Array:
        """Place in the picture (2,) of one by the fit, near enough for a mark [pixels]."""
        away = np.abs(self.frames - frame)
        away[~np.isfinite(self.located.x)] = np.inf
        near = int(np.argmin(away))
        here = np.array([self.located.x[near], self.located.y[near]])
        return np.asarray(here + place - flat_places(self.plane)[near])


def flat_places(plane: Plane) -> Array:
    """Places in a plane in pixels of its scale, the picture's way up, (frame, 2)."""
    return plane.places / plane.metres_per_pixel * [1, plane.sense]


def wants_sharp(known: ClipKnowledge, watched: Watched, ways: Sequence[Piece]) -> bool:
    """Whether the camera is calibrated and stands, and one hit at most is seen."""
    sharp = known.calibration is not None and not watched.still.drifts
    return sharp and known.ruler != GRAVITY and 0 < len(ways) <= 2


def sharpen(
    clip: Clip,
    watched: Watched,
    known: ClipKnowledge,
    found: FlightsFound,
    progress: Callable[[str], None],
) -> tuple[FlightScene, list[Piece], SharpBall]:
    """Scene, flights and ball by sharp places.

    Raises
    ------
    NotSharpError
        Nothing of the ball's size, or too few frames that locate it.
    InputError
        Nothing sets the scale.
    """
    calibration, scene, ways = known.calibration, found.scene, found.ways
    assert calibration is not None
    expected = None
    if known.ball and known.metres_per_pixel:
        expected = known.ball / 2 / known.metres_per_pixel
        least, most = SHARPNESS.size_ratios
        radius = max(ways, key=lambda each: len(each.t)).radius
        if not least < radius / expected < most:
            raise NotSharpError(
                f"nothing round with a radius near {expected:.3g} pixels was seen to fly"
            )
    blobs = watched.found[np.concatenate([way.blobs for way in ways])]
    frames, step = blobs["frame"].astype(np.intp), usual_step(clip.times)
    coarse = fit_flights(scene, ways)
    velocity = np.concatenate([coarse.at(k, way.t)[:, 2:] for k, way in enumerate(ways)])
    background = _bare(clip, watched.found)
    start, exposure = _start(clip, background, blobs, velocity / step, known.exposure)
    progress(f"locating the ball in {len(frames)} frames (its loops are compiled at the first use)")
    cuts = squares(start, clip.shape)
    seen = Regions(  # copies: a view would keep its whole frame
        pixels=np.stack(
            [
                grey_of(frame)[cut].copy()
                for cut, (_, frame) in zip(cuts, clip.chosen(frames), strict=True)
            ]
        ),
        background=np.stack([background[cut] for cut in cuts]),
        corners=np.array([[cut[1].start, cut[0].start] for cut in cuts], float),
    )
    located = sharp_places(clip, seen, start, ball_radius=expected, lens=calibration.lens_blur_px)
    good = (located.flags & np.uint16(USELESS)) == 0
    ends = np.cumsum([len(way.t) for way in ways])[:-1]
    if min(part.sum() for part in np.split(good, ends)) < SHARPNESS.least_frames:
        raise NotSharpError(
            f"fewer than {SHARPNESS.least_frames} frames of a flight show it whole and round "
            f"({good.sum()} in all)"
        )
    stamped = calibration.timestamps is not None
    ahead = np.concatenate([way.t - scene.time[way.frames] for way in ways])
    ball = SharpBall(
        frames=frames,
        t=clip.times[frames] / step + (0.0 if stamped else np.round(ahead)),
        located=located,
        plane=plane_of(located, calibration, str(clip.source.path)),
        exposure=exposure,
        background=background,
        off_plane=np.zeros((len(ways), 2)),
        notes=(),
    )
    return settle(scene, ways, ball, known, clip.shape)


def settle(
    scene: FlightScene,
    ways: list[Piece],
    ball: SharpBall,
    known: ClipKnowledge,
    shape: tuple[int, int],
) -> tuple[FlightScene, list[Piece], SharpBall]:
    """Settle which places are of the flights, and what speaks against them.

    Parameters
    ----------
    ways
        The flights' coarse places, one after another, are those of the ball.
    shape
        Rows and columns of a picture.
    """
    calibration, located, plane = known.calibration, ball.located, ball.plane
    assert calibration is not None
    good = (located.flags & np.uint16(USELESS)) == 0
    u, pattern = np.hypot(located.x_u, located.y_u) / np.sqrt(2), 0.0
    if located.pattern_u is not None:
        pattern = float(np.nanmedian(located.pattern_u[good]))
    lost = scene.lost(ways) if calibration.timestamps is not None else {}
    ends, flat = np.cumsum([len(way.t) for way in ways])[:-1], flat_places(plane)
    ways = [
        replace(way.part(good[own]), t=ball.t[some], xy=flat[some], u=u[some], pattern_u=pattern)
        for way, own in zip(ways, np.split(np.arange(len(good)), ends), strict=True)
        for some in [own[good[own]]]
    ]
    scale, step = plane.metres_per_pixel, 1 / known.rate
    scene = replace(
        scene,
        pull=np.array(calibration.gravity_mps2) * [1, plane.sense] * step**2 / scale,
        drag=(calibration.drag_per_m * scale, calibration.drag_per_m_u * scale),
        readout=0.0,
        exposure=ball.exposure / step,
    )
    kept = _without_far(scene, ways)
    freed = _without_struck(scene, kept)
    flags = located.flags.copy()
    for before, after, flag in ((ways, kept, PlaceFlag.JUMP), (kept, freed, PlaceFlag.CONTACT)):
        had, have = (np.concatenate([each.frames for each in some]) for some in (before, after))
        flags[np.isin(ball.frames, np.setdiff1d(had, have))] |= np.uint16(flag)
    ball = replace(
        ball,
        located=replace(located, flags=flags),
        off_plane=np.array([_approach(way, ball, shape) for way in freed]),
    )
    return scene, freed, replace(ball, notes=tuple(_against(scene, freed, ball, known, lost)))


def _without_far(scene: FlightScene, ways: list[Piece]) -> list[Piece]:
    """Flights without places far off their ways: at most a quarter, the farthest."""
    for _ in range(SHARPNESS.rounds):
        kept = []
        for way, left in zip(ways, fit_flights(scene, ways).residuals, strict=True):
            assert way.u is not None
            off = np.hypot(*left.T)
            usual = max(float(np.median(off)), float(np.median(way.u)), way.pattern_u)
            most = np.sort(off)[::-1][len(off) // 4]
            far = (off > SHARPNESS.outlier_spreads * usual) & (off > most)
            kept.append(way.part(~far) if len(off) >= 2 * SHARPNESS.least_frames else way)
        ways = kept
    return ways


def _without_struck(scene: FlightScene, ways: list[Piece]) -> list[Piece]:
    """Flights without the places of a contact, and those next to it that their ways deny."""
    for _ in range(SHARPNESS.rounds):
        ways = without_contacts(scene, ways)
        for k, _ in meetings(ways, fit_flights(scene, ways)):
            ways = [*ways[:k], _clear(scene, ways[k], -1), _clear(scene, ways[k + 1], 0)]
    return ways


def _clear(scene: FlightScene, way: Piece, end: int) -> Piece:
    """Flight without the places at an end (0: its first, -1: its last) that the others deny."""
    least = max(SHARPNESS.least_frames, (1 - SHARPNESS.contact_share) * len(way.t))
    while len(way.t) > least:
        others = way.part(slice(1, None) if end == 0 else slice(-1))
        fit = fit_flights(scene, [others])
        t, off = float(way.t[end]), way.xy[end] - fit.at(0, way.t[end])[0, :2]
        late = t - fit.middles[0]
        slope = np.array([[1, 0, late, 0], [0, 1, 0, late]])
        known = slope @ fit.covariance[-4:, -4:] @ slope.T
        assert way.u is not None
        scatter = float(np.sqrt(np.mean(fit.residuals[0] ** 2)))
        own = max(float(way.u[end]), way.pattern_u, scatter)
        if np.hypot(*off) <= FAR_U * np.sqrt(own**2 + np.trace(known) / 2):
            break
        way = others
    return way


def _approach(way: Piece, ball: SharpBall, shape: tuple[int, int]) -> Array:
    """Velocity (2,) that a ball seems to have as it comes nearer [px/frame], 0: it does not."""
    located = ball.located
    good = np.isin(ball.frames, way.frames) & (located.flags == 0)
    if good.sum() < SHARPNESS.frames:
        return np.zeros(2)
    t = ball.t[good] - ball.t[good].mean()
    size = np.log(located.radius[good] / ball.plane.sizes[good])
    rate = float(t @ size / (t @ t))
    rest = size - size.mean() - rate * t
    u = float(np.sqrt((rest @ rest) / (len(t) - 2) / (t @ t)))
    grown, radius = abs(rate) * float(np.ptp(t)), float(np.median(located.radius[good]))
    if grown < max(SHARPNESS.trend, 2 * RIM * way.pattern_u / radius):
        return np.zeros(2)
    if abs(rate) < SHARPNESS.trend_u * u:
        return np.zeros(2)
    middle = (np.array(shape[::-1]) - 1) / 2
    place = np.array([located.x[good].mean(), located.y[good].mean()])
    return np.asarray(rate * (place - middle))


def _against(
    scene: FlightScene,
    ways: Sequence[Piece],
    ball: SharpBall,
    known: ClipKnowledge,
    stepped: dict[int, int],
) -> list[Note]:
    """Say what speaks against sharp flights."""
    notes, fit = [], fit_flights(scene, ways)
    if len(ways) < 2:
        words = "the ball does not change its velocity: only one flight was found"
        notes.append(("NO_REBOUND", words))
    if stepped:
        words = (
            f"the ball steps ahead before frame {min(stepped)} by more than its time stamps say: "
            "a wrong one, or something else that was followed"
        )
        notes.append(("STEP", words))
    names = ("in", "out") if len(ways) > 1 else ("",)
    for k, (name, way, left) in enumerate(zip(names, ways, fit.residuals, strict=True)):
        assert way.u is not None
        noise = np.hypot(np.median(way.u), way.pattern_u)
        if float(np.sqrt(np.mean(left**2))) > SHARPNESS.crooked_u * noise:
            words = (
                f"the flight {name} is no straight line: give gravity_mps2 or drag_per_m, or the "
                "ball was touched"
            )
            notes.append(("CROOKED", words))
        if len(left) < SHARPNESS.few_frames:
            notes.append(("FEW_FRAMES", f"only {len(left)} frames show the flight {name}"))
        if ball.off_plane[k].any():
            velocity = fit.states[k, 2:]
            along = ball.off_plane[k] @ velocity / np.hypot(*velocity)
            off = along * ball.plane.metres_per_pixel * known.rate
            words = (
                f"the ball changes its size in the flight {name}: it leaves the plane, which makes "
                f"its speed read {off:+.2g} m/s off"
            )
            notes.append(("OFF_PLANE", words))
    if known.exposure is None:
        notes.append(("", f"exposure_s is not given: {ball.exposure:.3g} s was read off the blur"))
    return notes


def _bare(clip: Clip, blobs: Blobs) -> Image:
    """Background without anything that moved, a mean [DN]."""
    covered = []
    for number in clip.sampled.tolist():
        some = blobs[blobs["frame"] == number]
        reach = 1.15 * some["length"] + 8.0
        covered.append(zip(some["picture_x"], some["picture_y"], reach, strict=True))
    return uncovered_mean(clip.grey_samples(), covered)


def _start(
    clip: Clip, background: Image, ball: Blobs, velocity: Array, exposure: float | None
) -> tuple[Located, float]:
    """Where to start in each frame, and the exposure [s], read off the blur if unknown.

    Parameters
    ----------
    ball
        Its blob in each frame.
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
    """Exposure that makes the ball as long as it is [s], a frame's at most.

    The matte of a blurred disc has L²/12 more variance along the blur L than across it.
    """
    speed = np.hypot(*velocity.T)
    rows, columns = background.shape
    reach = 1.6 * start.radius + 4
    inside = (start.x > reach) & (start.x < columns - reach)
    inside &= (start.y > reach) & (start.y < rows - reach)
    fast = np.flatnonzero(inside & (speed > SHARPNESS.fast * speed.max()))
    if not fast.size:
        return 0.0
    count = min(fast.size, SHARPNESS.frames)
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
    """Variance of a ball's matte along a direction, less that across it [pixels²]."""
    x, y, radius = float(start.x[k]), float(start.y[k]), float(start.radius[k])
    reach = 1.6 * radius + 4
    place = np.s_[int(y - reach) : int(y + reach) + 1, int(x - reach) : int(x + reach) + 1]
    rows, columns = np.mgrid[place]
    away = np.hypot(columns - x, rows - y)
    off = frame[place] - background[place]
    light = float(np.median(off[away < 0.5 * radius]))
    share = np.clip(np.where(away < reach, off / light, 0.0), 0.0, 1.0) if light else off * 0.0
    share[share < SHARPNESS.faint] = 0.0
    total = max(float(share.sum()), 1.0)
    mean_x, mean_y = (share * columns).sum() / total, (share * rows).sum() / total
    u = (columns - mean_x) * along[0] + (rows - mean_y) * along[1]
    w = (rows - mean_y) * along[0] - (columns - mean_x) * along[1]
    return float((share * (u**2 - w**2)).sum() / total)


def uncovered_mean(
    samples: Frame, covered: Sequence[Iterable[tuple[float, float, float]]]
) -> Image:
    """Mean of samples (sample, row, column) where nothing that moves covers them, else the median.

    `covered`: x, y and reach [pixels] of what moves in each.
    """
    total, count = np.zeros((2, *samples.shape[1:]), np.float32)
    for sample, spots in zip(samples, covered, strict=True):
        free = np.ones(sample.shape, np.uint8)
        for x, y, reach in spots:
            cv2.circle(free, (round(x), round(y)), int(np.ceil(reach)) + 1, 0, -1)
        total += free * sample
        count += free
    mean, rows, columns = total / np.maximum(count, 1), *np.nonzero(count < SHARPNESS.shown)
    mean[rows, columns] = np.median(samples[:, rows, columns], axis=0)
    return np.asarray(mean, np.float32)
