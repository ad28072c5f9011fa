"""A clip to flights and contacts: what `virtual-lab track` says of any clip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.calibration.plane import PixelScale, distance_of
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.timing import UNEVEN, usual_step
from virtual_lab.video.find.watching import Watched, repeats, watch
from virtual_lab.video.follow.contacts import Contact, Note, contacts_of
from virtual_lab.video.follow.flights import FlightScene, beside, flights_of, joint_fit, readout_of
from virtual_lab.video.follow.joint import Fit
from virtual_lab.video.follow.kinds import MotionKind, motion_of
from virtual_lab.video.follow.pieces import Piece, pieces
from virtual_lab.video.follow.said import Said, from_fit, widened

__all__ = [
    "FlightSeen",
    "FollowedClip",
    "Known",
    "follow",
    "following",
    "known_of",
]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

GRAVITY = 9.80665  # m/s², CGPM 1901
ROUNDEST = 0.34  # of the places: those with the least blur show the ball's size
TOLD = 3.0  # u of the acceleration that it may be off g by, and a share of it
NEAR_G = 0.04
ALONE, FAR_G = 5.0, 0.1  # the same of a single flight
TILTED, TILTED_OFF = (
    0.6,
    0.03,
)  # factor that a perspective shrinks the misfit by, and how large it is
RECONCILED = 0.7  # of what flights' own accelerations differ by, if a perspective explains it
HAND_DRIFT = 0.02  # of the longer side a second, each way: 0.005 to 0.03 in real clips held by hand
DRIFT_MATTERS = 0.002  # of a flight's speed
NO_EDGES = (
    "the background has too few edges to show whether the camera moves: the u of speeds and "
    "restitutions covers a hand's usual drift; --tripod says that the camera stands"
)
BEHIND = 0.35  # of the difference between fits with and without drag, as u
MOVED = 0.1  # radii a frame: a ball that moves less may well look the same
LEAST_PERIOD, MOST_PERIOD = 3, 10  # frames, of those left out of 30 a second to make 25 or 24
ALTERNATE = 0.4  # of the frames that are repeats: every frame was stored twice
GROWN = 4  # times that pieces grow at most
SAME = 0.01  # of gravity: nothing new will be found by it
AT_ONCE = 2  # repeats among the frames of flights, to ask whether they stand for time that passed


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """What a person knows of a clip, SI."""

    rate: float  # pictures stored in a true second, repeats counted
    ball: float | None = None  # diameter [m]
    ball_u: float = 0.0
    metres_per_pixel: float | None = None
    metres_per_pixel_u: float = 0.0
    exposure: float | None = None  # [s]
    gravity: float = GRAVITY
    stands: bool = False  # the camera is known to
    readout: float | None = None  # [s]; None: unknown, up to a frame
    readout_axis: tuple[int, int] = (1, 1)
    frames: tuple[int, int] | None = None
    region: tuple[float, float, float, float] | None = None
    ball_at: tuple[float, float, int] | None = None  # x, y, frame


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightSeen:
    """A flight in metres and seconds."""

    first_frame: int
    last_frame: int
    places: int
    speed_in: Said  # where it begins: at the contact before, else at its first place
    speed_out: Said
    angle_in: Said  # of the velocity, from the picture's right, anticlockwise as seen [rad]
    angle_out: Said
    acceleration: Said  # its own, without drag


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowedClip:
    """What was followed through a clip."""

    clip: Clip
    watched: Watched
    known: Known
    scene: FlightScene
    pieces: list[Piece]
    ways: list[Piece]  # of the flights
    fit: Fit | None
    flights: list[FlightSeen]
    contacts: list[Contact]
    motion: MotionKind
    scale: PixelScale | None
    gravity: Said | None  # that the flights share [m/s²]
    drag_per_m: float | None
    repeated: Mask  # (frame,)
    notes: tuple[Note, ...]

    @property
    def seconds(self) -> float:
        """Of one step of `t`."""
        return _step(self.known, self.scene, self.ways) * _thinned(self.scene, self.ways)

    @property
    def lost(self) -> dict[int, int]:
        """How many frames were left out before some frames."""
        return self.scene.lost(self.ways)

    @property
    def flags(self) -> tuple[str, ...]:
        """What speaks against the result, in capitals."""
        return tuple(dict.fromkeys(flag for flag, _ in self.notes if flag))

    @property
    def warnings(self) -> tuple[str, ...]:
        """The same in sentences, and what only need be known."""
        return tuple(dict.fromkeys(words for _, words in self.notes))


def known_of(clip: Clip, calibration: ClipCalibration) -> Known:
    """Return what a calibration file says, as the following of any clip takes it.

    Whoever calibrates a camera is taken to have one that opens all its rows at once.
    """
    scale, camera = calibration.metres_per_pixel, calibration.camera
    if camera and (far := distance_of(camera)):
        scale = far / camera.matrix[0][0]
    return Known(
        rate=1 / usual_step(clip.times),
        ball=calibration.ball_diameter_m,
        ball_u=calibration.ball_diameter_m_u,
        metres_per_pixel=scale,
        metres_per_pixel_u=calibration.metres_per_pixel_u,
        exposure=calibration.exposure_s,
        gravity=float(np.hypot(*calibration.gravity_mps2)) or GRAVITY,
        readout=0.0,
        stands=True,
    )


def follow(
    clip: Clip, known: Known, *, progress: Callable[[str], None] = lambda _: None
) -> FollowedClip:
    """Return what moves in a clip and how."""
    progress("looking for the ball")
    watched = watch(
        clip,
        frames=known.frames,
        region=known.region,
        stands=known.stands,
        progress=progress,
    )
    return following(clip, watched, known)


def following(
    clip: Clip, watched: Watched, known: Known, given: Sequence[Piece] | None = None
) -> FollowedClip:
    """Return the same of a clip that was watched; `given`: ways corrected by hand."""
    same = repeats(watched.change)
    tries = [_flown(clip, watched, known, same, given, squeezed=False)]
    alternate = float(same.mean()) > ALTERNATE
    if same.sum() >= AT_ONCE and not alternate and given is None:
        tries.append(_flown(clip, watched, known, same, given, squeezed=True))
    _, scene, found, ways = max(tries, key=lambda each: each[0])
    return _said(clip, watched, known, scene, found, ways, same)


def _flown(
    clip: Clip,
    watched: Watched,
    known: Known,
    same: Mask,
    given: Sequence[Piece] | None,
    *,
    squeezed: bool,
) -> tuple[float, FlightScene, list[Piece], list[Piece]]:
    """Return support, scene, all pieces and the flights; squeezed: a repeat takes no time."""
    stamped = _times(clip)
    time = np.where(same, np.nan, stamped - np.cumsum(same) if squeezed else stamped)
    scene = _scene(clip, watched, known, time)
    scene = replace(scene, stamped=stamped, doubled=float(same.mean()) > ALTERNATE)
    if given is not None:
        return 0.0, scene, list(given), list(given)
    best: tuple[float, list[Piece], list[Piece]] = (-1.0, [], [])
    pull = None
    for _ in range(GROWN):  # again where gravity is known: through frames that are missing
        found = pieces(watched.found, time, pull)
        found = [p for p in found if not known.ball_at or _passes(watched, p, known.ball_at)]
        ways, fit = flights_of(scene, found)
        if (support := _support(scene, ways, fit) if fit else 0.0) > best[0]:
            best = support, found, ways
        before, pull = pull, fit.pull[0] if fit else None
        if pull is None or (
            before is not None and np.hypot(*(pull - before)) < SAME * np.hypot(*pull)
        ):
            break
    return best[0], scene, *best[1:]


def _times(clip: Clip) -> Array:
    """Return the time of each frame in steps; uneven time stamps of the file count."""
    steps = np.diff(clip.times)
    if len(steps) and steps.max() > UNEVEN * float(np.median(steps)):
        return np.asarray((clip.times - clip.times[0]) / usual_step(clip.times))
    return np.arange(clip.count, dtype=float)


def _scene(clip: Clip, watched: Watched, known: Known, time: Array) -> FlightScene:
    fall = None
    if known.metres_per_pixel:
        fall = known.gravity / known.metres_per_pixel / known.rate**2
    elif known.ball:
        fall = known.gravity / (known.ball / 2) / known.rate**2
    return FlightScene(
        found=watched.found,
        time=time,
        stamped=time,
        size=(clip.shape[1], clip.shape[0]),
        exposure=None if known.exposure is None else known.exposure * known.rate,
        fall=fall,
        fall_in_radii=known.metres_per_pixel is None,
        readout=None if known.readout is None else known.readout * known.rate,
        readout_axis=known.readout_axis,
    )


def _passes(watched: Watched, piece: Piece, at: tuple[float, float, int]) -> bool:
    """Return whether a piece is of the ball that is pointed at: it passes there or looks alike."""
    x, y, frame = at
    here = piece.frames == frame
    if here.any():
        return bool(np.hypot(*(piece.xy[here][0] - (x, y))) < 1.5 * piece.radius)
    some = watched.found[watched.found["frame"] == frame]
    if not len(some):
        return True
    one = some[int(np.argmin(np.hypot(some["x"] - x, some["y"] - y)))]
    ratio = piece.radius / one["radius"]
    colour = np.median(watched.found["colour"][piece.blobs], axis=0) - one["colour"]
    return bool(0.6 < ratio < 1.6 and np.abs(colour).max() < 60)


def _support(scene: FlightScene, ways: list[Piece], fit: Fit) -> float:
    """Return what speaks for flights: places beyond what was free to choose, over their scatter."""
    radius = float(np.median([each.radius for each in ways]))
    spare = sum(len(each.t) for each in ways) - 4 * len(ways) - len(scene.lost(ways))
    return spare / (0.02 + fit.spread / radius)


def _step(known: Known, scene: FlightScene, ways: Sequence[Piece]) -> float:
    """Return the seconds of a step of time: more than a picture's where repeats take no time.

    How many pictures are repeats shows where the ball flies; where nothing moves it does not.
    """
    counted = np.flatnonzero(np.isfinite(scene.time))
    if ways:
        counted = np.sort(np.concatenate([way.frames for way in ways]))
    if len(counted) < 2:
        return 1 / known.rate
    taken = scene.stamped[counted[-1]] - scene.stamped[counted[0]]
    return float(taken / (scene.time[counted[-1]] - scene.time[counted[0]]) / known.rate)


def _thinned(scene: FlightScene, ways: Sequence[Piece]) -> float:
    """Return the share of a stored picture's time that a step of time takes.

    Where every so manieth frame was left out the file's rate is that of what is left: a step is
    shorter. Frames that are lost here and there leave the rate as it was.
    """
    if sum(scene.lost(ways).values()) < AT_ONCE:
        return 1.0
    frames = [np.stack([way.frames[:-1], way.frames[1:]]) for way in ways]
    lost = np.concatenate([np.diff(w.t) - np.diff(scene.time[w.frames]) for w in ways])
    first, last = np.concatenate(frames, axis=1)
    for period in range(LEAST_PERIOD, MOST_PERIOD + 1):
        for phase in range(period):
            left_out = (last - phase) // period - (first - phase) // period
            if (left_out == np.rint(lost)).all():
                return period / (period + 1)
    return 1.0


def _said(
    clip: Clip,
    watched: Watched,
    known: Known,
    scene: FlightScene,
    found: list[Piece],
    ways: list[Piece],
    same: Mask,
) -> FollowedClip:
    notes: list[Note] = [("", words) for words in clip.warnings]
    lost = scene.lost(ways)
    step = _step(known, scene, ways) * _thinned(scene, ways)
    motion = motion_of(scene, found, ways, step)
    flights: list[FlightSeen] = []
    contacts: list[Contact] = []
    fit = other = scale = gravity = None
    if ways:
        readout = readout_of(scene, ways)
        fit = joint_fit(scene, ways, readout=readout)
        skewed = joint_fit(scene, ways, readout=readout, tilted=True)
        turned = float(np.hypot(*skewed.tilt)) * _extent(ways)
        if skewed.cost < TILTED * fit.cost and turned > TILTED_OFF:
            other = skewed
            if _apart(scene, ways, readout, tilted=True) < RECONCILED * _apart(
                scene, ways, readout
            ):
                fit, other = skewed, fit
            words = (
                "the acceleration changes over the picture as before a tilted camera: scale and "
                "speeds are those of its middle, by a fitted perspective where flights agree by "
                "that, and their u and the restitution's cover it"
            )
            notes.append(("TILTED", words))
    scale = scale_by_ball(watched, known, ways or found, fit)
    if fit and scale:
        if readout and scene.readout is None:
            words = (
                f"the shutter rolls: the flights fit a readout of about {readout:.2g} of a frame; "
                "give --readout to say how long it is"
            )
            notes.append(("ROLLING_SHUTTER", words))
        free = joint_fit(
            scene, ways, readout=readout, drag=False, shared=False, tilted=bool(fit.tilt.any())
        )
        others = [(free, BEHIND), *([(other, 1.0)] if other else [])]
        if not (known.stands or watched.still.shows_drift):
            hand = HAND_DRIFT * max(scene.size) * step
            others += [(fit.drifting(each), 1.0) for each in hand * np.eye(2)]
            if hand > DRIFT_MATTERS * min(float(np.hypot(*v)) for v in fit.states[:, 2:]):
                notes.append(("DRIFT_UNSEEN", NO_EDGES))
        contacts, said = contacts_of(scene, ways, fit, others, step, scale.metres_per_pixel)
        notes += said
        flights = _flights(scene, ways, fit, others, contacts, scale, step)
        unit = scale.metres_per_pixel / step**2
        gravity = _told(partial(_pull, 0), fit, [], scale).times(unit)
        notes += _against(known, ways, flights, scale, step)
    if ways and (more := beside(scene, ways, found)):
        first = min(int(each.frames[0]) for each in more)
        words = (
            f"another ball flies beside the one followed, from frame {first} on: --ball-at says "
            "which is meant; where they are alike flights may be mixed up"
        )
        notes.append(("SECOND_BALL", words))
    if lost:
        where = ", ".join(f"{n} before frame {frame}" for frame, n in sorted(lost.items())[:6])
        words = f"frames are missing though time stamps are even ({where}): time was mended"
        notes.append(("LOST_FRAMES", words))
    same = _while_moving(same, ways or found)
    if same.any():
        words = f"{same.sum()} frames are stored twice while the ball moves: a repeat is no place"
        notes.append(("REPEATED_FRAMES", words))
    return FollowedClip(
        clip=clip,
        watched=watched,
        known=known,
        scene=scene,
        pieces=found,
        ways=ways,
        fit=fit,
        flights=flights,
        contacts=contacts,
        motion=motion,
        scale=scale,
        gravity=gravity,
        drag_per_m=fit.drag / scale.metres_per_pixel if fit and scale else None,
        repeated=same,
        notes=tuple(notes),
    )


def _while_moving(same: Mask, ways: Sequence[Piece]) -> Mask:
    """Return which repeats stand while a ball moves: elsewhere frames may well show the same."""
    counted = np.zeros(len(same), bool)
    for way in ways:
        t, steps = way.frames, np.hypot(*np.diff(way.xy, axis=0).T) / np.diff(way.frames)
        for frame in np.flatnonzero(same[t[0] : t[-1] + 1]) + t[0]:
            k = int(np.searchsorted(t, frame))
            if 0 < k < len(t):
                counted[frame] = steps[k - 1] > MOVED * way.radius
    return counted if counted.sum() >= AT_ONCE else np.zeros(len(same), bool)


def _extent(ways: Sequence[Piece]) -> float:
    together = np.concatenate([each.xy for each in ways])
    return float(np.ptp(together, axis=0).max())


def scale_by_ball(
    watched: Watched, known: Known, ways: Sequence[Piece], fit: Fit | None
) -> PixelScale | None:
    """Return the scale: given, or by the ball's size in the pictures that blur it least."""
    if known.metres_per_pixel:
        relative = known.metres_per_pixel_u / known.metres_per_pixel
        return PixelScale(
            metres_per_pixel=known.metres_per_pixel, relative_u=relative, source="given"
        )
    if not known.ball or not ways:
        return None
    radius, radius_u = size_of(watched, np.concatenate([each.blobs for each in ways]), fit)
    relative = float(np.hypot(known.ball_u / known.ball, radius_u / radius))
    return PixelScale(
        metres_per_pixel=known.ball / (2 * radius), relative_u=relative, source="ball"
    )


def size_of(watched: Watched, blobs: NDArray[np.intp], fit: Fit | None) -> tuple[float, float]:
    """Return the radius of a ball and its u [pixels] by its roundest pictures.

    Blur draws an outline out by as much as it narrows it at half of the contrast, or little more,
    and so does shading: the mean of the axes is not biased. A perspective makes balls larger or
    smaller than in the middle of the picture, where the scale is taken.
    """
    some = watched.found[blobs[blobs >= 0]]
    ratio = some["length"] / some["radius"]
    size = (some["radius"] + some["length"]) / 2
    if fit:
        off = np.stack([some["x"], some["y"]], axis=1) - fit.centre
        size = size / (1 - off @ fit.tilt)
    least = ratio <= np.quantile(ratio, ROUNDEST)
    size = size[least]
    radius = float(np.median(size))
    scatter = 1.4826 * float(np.median(np.abs(size - radius)))
    edge = float(np.median(some["radius_u"][least]))
    return radius, float(np.hypot(edge, 0.5 * scatter))


def _flights(
    scene: FlightScene,
    ways: list[Piece],
    fit: Fit,
    others: list[tuple[Fit, float]],
    contacts: list[Contact],
    scale: PixelScale,
    step: float,
) -> list[FlightSeen]:
    """Return the flights; `others`: fits by other models, and their differences' share of u."""
    ways_of = {"shared": False, "tilted": bool(fit.tilt.any())}
    own = joint_fit(scene, ways, readout=fit.readout, **ways_of)
    tilted = any(each.tilt.any() for each, _ in others)
    owns = [(fit, 1.0)] if tilted and not fit.tilt.any() else []
    if scene.readout is None:  # any readout up to a frame is as likely
        rolled = joint_fit(scene, ways, readout=1.0, tilted=ways_of["tilted"])
        others = [*others, (rolled, 1 / np.sqrt(3))]
        owns.append((joint_fit(scene, ways, readout=1.0, **ways_of), 1 / np.sqrt(3)))
    unit = scale.metres_per_pixel / step
    before = {each.after: each.t for each in contacts}
    after = {each.before: each.t for each in contacts}
    found = []
    for k, way in enumerate(ways):
        late = float(np.median(scene.late(way.blobs)))
        ends = (before.get(k, float(way.t[0])), after.get(k, float(way.t[-1])))
        speeds = [_told(partial(_speed, k, t, late), fit, others, scale) for t in ends]
        ways_out = [fit.at(k, t + fit.readout * late)[0, 2:] for t in ends]
        angles = [
            Said(value=float(np.arctan2(-down, right)), u=speed.u / speed.value)
            for speed, (right, down) in zip(speeds, ways_out, strict=True)
        ]
        found.append(
            FlightSeen(
                first_frame=int(way.frames[0]),
                last_frame=int(way.frames[-1]),
                places=len(way.t),
                speed_in=speeds[0].times(unit),
                speed_out=speeds[1].times(unit),
                angle_in=angles[0],
                angle_out=angles[1],
                acceleration=_told(partial(_pull, k), own, owns, scale).times(unit / step),
            )
        )
    return found


def _told(
    quantity: Callable[[Fit], float], fit: Fit, others: list[tuple[Fit, float]], scale: PixelScale
) -> Said:
    """Return what follows from a fit [pixels], its u with what other models say and the scale's."""
    said = from_fit(fit, quantity)
    off = (share * (said.value - quantity(other)) for other, share in others)
    return widened(said, *off, said.value * scale.relative_u)


def _apart(scene: FlightScene, ways: list[Piece], readout: float, *, tilted: bool = False) -> float:
    """Return by how much the flights' own accelerations differ."""
    own = joint_fit(scene, ways, readout=readout, shared=False, tilted=tilted)
    return float(np.ptp(np.hypot(*own.pull.T)))


def _pull(flight: int, fit: Fit) -> float:
    return float(np.hypot(*fit.pull[flight]))


def _speed(flight: int, t: float, late: float, fit: Fit) -> float:
    """Return a flight's speed at a time of the first row; the ball was read so `late`."""
    return float(np.hypot(*fit.at(flight, t + fit.readout * late)[0, 2:]))


def _against(
    known: Known, ways: list[Piece], flights: list[FlightSeen], scale: PixelScale, step: float
) -> list[Note]:
    """Return what speaks against scale, ball, frame rate and shutter."""
    notes = []
    bends = [
        each
        for way, each in zip(ways, flights, strict=True)
        if max(known.gravity, each.acceleration.value) * (step * np.ptp(way.t)) ** 2 / 8
        > scale.metres_per_pixel * way.radius
    ]
    if bends:
        weight = np.array([1 / max(each.acceleration.u, 1e-9) ** 2 for each in bends])
        value = float(np.average([each.acceleration.value for each in bends], weights=weight))
        u = float(np.min([each.acceleration.u for each in bends]))
        told = [(value, u, TOLD, NEAR_G)]
        told += [(each.acceleration.value, each.acceleration.u, ALONE, FAR_G) for each in bends]
        wrong = [
            v for v, u, k, part in told if abs(v - known.gravity) > max(k * u, part * known.gravity)
        ]
        if wrong:
            value = wrong[0]
            words = (
                f"the ball falls with {value:.3g} m/s², not {known.gravity:.3g}: the scale, the "
                "ball's diameter or the frame rate is wrong (slow motion declares the rate it "
                "plays at: --fps), and every speed with it"
            )
            notes.append(("GRAVITY", words))
    if known.readout is None and flights:
        words = (
            "neither --readout nor --global-shutter is given: a shutter may roll for up to a "
            "frame, and the speeds' u covers that; a restitution's does not"
        )
        notes.append(("READOUT_UNKNOWN", words))
    return notes
