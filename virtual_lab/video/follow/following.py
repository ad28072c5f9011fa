"""A clip to flights and contacts: what `virtual-lab track` finds in any clip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array, Mask
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.timing import uneven, usual_step
from virtual_lab.video.find.watching import Watched, in_region, repeated, watch
from virtual_lab.video.follow.contacts import Contact, Note, contacts_of
from virtual_lab.video.follow.doubts import Falls, against_size
from virtual_lab.video.follow.flights import FLIGHTS, beside, flights_of, outer_places
from virtual_lab.video.follow.joint import Fit, estimate_of
from virtual_lab.video.follow.kinds import MotionKind, motion_of, swings
from virtual_lab.video.follow.known import GRAVITY, ClipKnowledge
from virtual_lab.video.follow.models import EVEN_SHARE, FittedFlights, fits_of, refit
from virtual_lab.video.follow.pieces import GROWTH, Piece, pieces
from virtual_lab.video.follow.ruler import TILT_U, Ruler, level_tilt, rulers_of
from virtual_lab.video.follow.scene import FlightScene


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipSettings:
    """How a clip's scale, time and motion are judged."""

    rounds: int = 4  # that pieces grow in, each knowing the gravity that the last one found
    kept: float = 0.6  # of a flight's frames, that are a flight's if the ball is looked for again
    alike: float = 0.15  # of the radius, that a blob may differ by and needs no circle
    again: float = 0.9  # of the support without, that a ball looked for again must have
    same_pull: float = 0.01  # of gravity: nothing new will be found by it
    strays: float = 3.0  # standard uncertainties that a flight's end leaves its way by
    usual_readout: float = 0.5  # frames, of a phone
    hand_drift: float = 0.02  # of the longer side a second, each way: 0.005 to 0.03 in real clips
    drift_matters: float = 0.002  # of a flight's speed
    moved: float = 0.1  # radii a frame: a ball that moves less may well look the same
    least_repeats: int = 2  # among the frames of flights, to ask whether they stand for time
    every_other: float = 0.4  # of the frames that are repeats: every frame was stored twice
    thinned_periods: range = range(3, 11)  # frames, of those left out of 30 a second to make 25


CLIP = ClipSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredFlight:
    """A flight in metres and seconds."""

    first_frame: int
    last_frame: int
    places: int
    speed_in: Estimate  # where it begins: at the contact before, else at its first place
    speed_out: Estimate
    angle_in: Estimate  # of the velocity, from the picture's right, anticlockwise as seen [rad]
    angle_out: Estimate
    acceleration: Estimate | None  # its own, without drag; None: gravity is the only ruler


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowedClip:
    """What was followed through a clip."""

    clip: Clip
    watched: Watched
    known: ClipKnowledge
    scene: FlightScene
    pieces: list[Piece]
    ways: list[Piece]  # of the flights
    seconds: float  # of one step of `t`
    fit: Fit | None
    flights: list[MeasuredFlight]
    contacts: list[Contact]
    motion: MotionKind
    scale: PixelScale | None  # by the ruler
    checks: tuple[PixelScale, ...]  # by what else shows one
    gravity: Estimate | None  # that the flights share, by another ruler than gravity [m/s²]
    drag_per_m: float | None
    repeated: Mask  # (frame,)
    notes: tuple[Note, ...]

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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Search:
    """What was found by one reading of the clip's time."""

    scene: FlightScene
    support: float
    pieces: list[Piece] = field(default_factory=list)
    ways: list[Piece] = field(default_factory=list)
    pull: Array | None = None


def follow(
    clip: Clip, known: ClipKnowledge, *, progress: Callable[[str], None] = lambda _: None
) -> FollowedClip:
    """Return what moves in a clip and how."""
    progress("looking for the ball")
    watched = watch(
        clip, frames=known.frames, region=known.region, stands=known.stands, progress=progress
    )
    return following(clip, watched, known)


def following(
    clip: Clip, watched: Watched, known: ClipKnowledge, given: list[Piece] | None = None
) -> FollowedClip:
    """Return the same of a clip that was watched; `given`: ways corrected by hand."""
    same = repeated(watched)
    scene = _scene(clip, watched, known, same, squeezed=False)
    if given is not None:
        return _measured(clip, watched, known, scene, given, given, same)
    tries = [_searched(watched, known, scene)]
    if same.sum() >= CLIP.least_repeats and not scene.doubled:
        squeezed = _scene(clip, watched, known, same, squeezed=True)
        tries.append(_searched(watched, known, squeezed))
    best = max(tries, key=lambda each: each.support)
    if best.pieces:
        looked = _again(watched, known, best.ways or best.pieces)
        again = _searched(looked, known, replace(best.scene, found=looked.found), best.pull)
        if again.support > CLIP.again * best.support and _kept(best.ways, again.ways):
            best, watched = again, looked
    return _measured(clip, watched, known, best.scene, best.pieces, best.ways, same)


def _again(watched: Watched, known: ClipKnowledge, ways: list[Piece]) -> Watched:
    """Return what was watched with the ball looked for again where it has no place."""
    radius = float(np.median(np.repeat([w.radius for w in ways], [len(w.t) for w in ways])))
    placed = np.concatenate([way.frames for way in ways])
    numbers = sorted(set(watched.thumbs) - set(placed.tolist()))
    circles = np.concatenate([watched.found[:0], *(watched.again(k, radius) for k in numbers)])
    clean = np.abs(watched.found["radius"] / radius - 1) < CLIP.alike
    clean &= watched.found["dirty"] < GROWTH.dirty
    for blob in watched.found[clean]:
        off = np.hypot(circles["x"] - blob["x"], circles["y"] - blob["y"])
        circles = circles[(circles["frame"] != blob["frame"]) | (off > 0.5 * radius)]
    whole = np.concatenate([watched.found, in_region(circles, known.region)])
    return replace(watched, found=whole[np.argsort(whole["frame"], kind="stable")])


def _kept(before: list[Piece], after: list[Piece]) -> bool:
    """Return whether most frames of each flight are those of flights still."""
    frames = np.concatenate([way.frames for way in after]) if after else np.zeros(0)
    return all(np.isin(way.frames, frames).mean() > CLIP.kept for way in before)


def _scene(
    clip: Clip, watched: Watched, known: ClipKnowledge, same: Mask, *, squeezed: bool
) -> FlightScene:
    """Return what is known before the search; squeezed: a repeat takes no time."""
    stamped = np.arange(clip.count, dtype=float)
    if uneven(clip.times):
        stamped = (clip.times - clip.times[0]) / usual_step(clip.times)
    length = known.metres_per_pixel or (known.ball and known.ball / 2)
    return FlightScene(
        found=watched.found,
        time=np.where(same, np.nan, stamped - np.cumsum(same) if squeezed else stamped),
        stamped=stamped,
        size=(clip.shape[1], clip.shape[0]),
        exposure=known.exposure and known.exposure * known.rate,
        fall=known.gravity / length / known.rate**2 if length else None,
        fall_in_radii=known.metres_per_pixel is None,
        readout=known.readout and known.readout * known.rate,
        doubled=float(same.mean()) > CLIP.every_other,
        readout_axis=known.readout_axis,
    )


def _searched(
    watched: Watched, known: ClipKnowledge, scene: FlightScene, pull: Array | None = None
) -> _Search:
    """Return what is found, by a gravity (2,) [px/frame²] that is known or not."""
    best = _Search(scene=scene, support=-1.0)
    for _ in range(CLIP.rounds):  # where gravity is known also through frames that are missing
        found = pieces(watched.found, scene.time, pull)
        found = [p for p in found if not known.ball_at or _passes(watched, p, known.ball_at)]
        ways, fit = flights_of(scene, found)
        if swings(found, ways):
            ways, fit = [], None
        support = _support(scene, ways, fit) if fit else 0.0
        before, pull = pull, fit.pull[0] if fit else None
        if support > best.support:
            best = _Search(scene=scene, support=support, pieces=found, ways=ways, pull=pull)
        if pull is None:
            break
        if before is not None and np.hypot(*(pull - before)) < CLIP.same_pull * np.hypot(*pull):
            break
    return best


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
    colour = np.median(watched.found["colour"][piece.blobs], axis=0) - one["colour"]
    return bool(0.6 < piece.radius / one["radius"] < 1.6 and np.abs(colour).max() < 60)


def _support(scene: FlightScene, ways: list[Piece], fit: Fit) -> float:
    """Return what speaks for flights: places beyond what was free to choose, over their scatter."""
    radius = float(np.median([each.radius for each in ways]))
    spare = sum(len(each.t) for each in ways) - 4 * len(ways) - len(scene.lost(ways))
    return spare / (0.02 + fit.spread / radius)


def _step(known: ClipKnowledge, scene: FlightScene, ways: Sequence[Piece]) -> float:
    """Return the seconds of a step of time: more than a picture's where repeats take no time.

    How many pictures are repeats shows where the ball flies; where nothing moves it does not.
    """
    counted = np.flatnonzero(np.isfinite(scene.time))
    if ways:
        counted = np.sort(np.concatenate([way.frames for way in ways]))
    if len(counted) < 2:
        return 1 / known.rate
    first, last = counted[0], counted[-1]
    steps = (scene.stamped[last] - scene.stamped[first]) / (scene.time[last] - scene.time[first])
    return float(steps * _thinned(scene, ways) / known.rate)


def _thinned(scene: FlightScene, ways: Sequence[Piece]) -> float:
    """Return the share of a stored picture's time that a step of time takes.

    Where every so manieth frame was left out the file's rate is that of what is left: a step is
    shorter. Frames that are lost here and there leave the rate as it was.
    """
    if sum(scene.lost(ways).values()) < CLIP.least_repeats:
        return 1.0
    first = np.concatenate([way.frames[:-1] for way in ways])
    last = np.concatenate([way.frames[1:] for way in ways])
    lost = np.concatenate([np.diff(w.t) - np.diff(scene.time[w.frames]) for w in ways])
    for period in CLIP.thinned_periods:
        for phase in range(period):
            left_out = (last - phase) // period - (first - phase) // period
            if (left_out == np.rint(lost)).all():
                return period / (period + 1)
    return 1.0


def _measured(
    clip: Clip,
    watched: Watched,
    known: ClipKnowledge,
    scene: FlightScene,
    found: list[Piece],
    ways: list[Piece],
    same: Mask,
) -> FollowedClip:
    """Return flights, contacts and scale in SI, and what speaks against them."""
    notes: list[Note] = [("", words) for words in clip.warnings]
    step = _step(known, scene, ways)
    flights: list[MeasuredFlight] = []
    contacts: list[Contact] = []
    fit = other = level = falls = None
    drift = 0.0  # of the camera, that nothing shows
    if not (known.stands or watched.still.shows_drift):
        drift = CLIP.hand_drift * max(scene.size) * step
    if ways:
        fit, other = fits_of(scene, ways)
        plumb = refit(scene, ways, fit, tilt_u=TILT_U)
        level = FittedFlights.beside(scene, ways, plumb, drift=drift, shared=True)
    ball = watched.found[[k for each in ways or found for k in each.blobs]]
    where = str(clip.source.path)
    lost, side = scene.lost(ways), max(scene.size)
    rulers = rulers_of(known, ball, fit, level, ways, side, step, where, mended=bool(lost))
    scale = rulers[0] if rulers else None
    if fit and level and scale:
        notes += _of_camera(scene, fit, other, drift)
        model = FittedFlights.beside(scene, ways, fit, other=other, drift=drift)
        unit = scale.metres_per_pixel
        contacts, against = contacts_of(scene, ways, fit, [*model.others, *model.near], step, unit)
        if size := next((each for each in rulers if each.source != GRAVITY), None):
            falls = _falls(known, scene, ways, model, level, size, step)
            falls.require_rate(where)
            against += falls.against()
        used = level if scale.source == GRAVITY else model
        flights = _flights(scene, ways, used, falls, contacts, scale, step)
        notes += against
        if known.readout is None and not fit.readout:
            rolled = refit(scene, ways, fit, readout=CLIP.usual_readout)
            other_contacts, _ = contacts_of(scene, ways, rolled, [], step, unit)
            notes.append(("READOUT_UNKNOWN", _of_readout(contacts, other_contacts)))
    notes += against_size(rulers)
    if ways and (more := beside(scene, ways, found)):
        first = min(int(each.frames[0]) for each in more)
        words = (
            f"another ball flies beside the one followed, from frame {first} on: --ball-at says "
            "which is meant; where they are alike flights may be mixed up"
        )
        notes.append(("SECOND_BALL", words))
    notes += _leaps(watched, ways)
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
        seconds=step,
        fit=fit,
        flights=flights,
        contacts=contacts,
        motion=motion_of(scene, found, ways, step),
        scale=scale,
        checks=tuple(rulers[1:]),
        gravity=falls.shared if falls else None,
        drag_per_m=fit.drag / scale.metres_per_pixel if fit and scale else None,
        repeated=same,
        notes=tuple(notes),
    )


def _leaps(watched: Watched, ways: Sequence[Piece]) -> list[Note]:
    """Return what speaks against a background that leaps from the first flight to the last."""
    frames = np.concatenate([way.frames for way in ways]) if ways else np.zeros(1)
    leaps = {k: by for k, by in watched.leaps.items() if frames.min() < k <= frames.max()}
    words = (
        f"the background leaps by {max(leaps.values(), default=0.0):.2g} pixels (before frame "
        f"{min(leaps, default=0)}): the camera's drift was lost there, and flights about it may be "
        "bent or broken; --tripod says that the camera stands"
    )
    return [("DRIFT_LEAPS", words)] if leaps else []


def _while_moving(same: Mask, ways: Sequence[Piece]) -> Mask:
    """Return which repeats stand while a ball moves: elsewhere frames may well show the same."""
    counted = np.zeros(len(same), bool)
    for way in ways:
        t, steps = way.frames, np.hypot(*np.diff(way.xy, axis=0).T) / np.diff(way.frames)
        for k in np.flatnonzero(steps > CLIP.moved * way.radius):
            counted[t[k] + 1 : t[k + 1] + 1] = True
    counted &= same
    return counted if counted.sum() >= CLIP.least_repeats else np.zeros_like(counted)


def _flights(
    scene: FlightScene,
    ways: list[Piece],
    model: FittedFlights,
    falls: Falls | None,
    contacts: list[Contact],
    scale: Ruler,
    step: float,
) -> list[MeasuredFlight]:
    """Return the flights."""
    fit, others = model.fit, [*model.others, *model.longest]
    unit = scale.metres_per_pixel / step
    before = {each.after: each.t for each in contacts}
    after = {each.before: each.t for each in contacts}
    found = []
    for k, way in enumerate(ways):
        late = float(np.median(scene.late(way.blobs)))
        ends = []
        for met, end in ((before, 1), (after, -1)):
            t = met.get(k, float(way.t[::end][0]))
            speed_at = partial(_speed, k, t, late, scale)
            speed = estimate_of(speed_at, fit, others, unit=1 / step, relative_u=scale.rest_u)
            right, down = fit.at(k, t + fit.readout * late)[0, 2:]
            if k not in met:
                left = fit.residuals[k][::end]
                off = max(fit.spread, float(np.hypot(*left[0])))
                speed = _let_go(speed, unit, off, np.array([right, down]), fit.pull[k])
                strays = unit * _strays(way.t[::end], left, fit.spread)
                speed = replace(speed, u=float(np.hypot(speed.u, strays)))
            angle = Estimate(value=float(np.arctan2(-down, right)), u=speed.u / speed.value)
            ends.append((speed, angle))
        (speed_in, angle_in), (speed_out, angle_out) = ends
        found.append(
            MeasuredFlight(
                first_frame=int(way.frames[0]),
                last_frame=int(way.frames[-1]),
                places=len(way.t),
                speed_in=speed_in,
                speed_out=speed_out,
                angle_in=angle_in,
                angle_out=angle_out,
                acceleration=falls.pulls[k] if falls else None,
            )
        )
    return found


def _of_camera(scene: FlightScene, fit: Fit, other: Fit | None, drift: float) -> list[Note]:
    """Return what the flights show of the camera; `drift`: that nothing shows [px/frame]."""
    notes = []
    if other:
        words = (
            "the acceleration changes over the picture as before a tilted camera: scale and "
            "speeds are those of its middle, by a fitted perspective where flights agree by "
            "that, and their u and the restitution's cover it"
        )
        notes.append(("TILTED", words))
    if fit.readout and scene.readout is None:
        words = (
            f"the shutter rolls: the flights fit a readout of about {fit.readout:.2g} of a "
            "frame, and the speeds' u covers any up to a frame; --readout says how long it is"
        )
        notes.append(("ROLLING_SHUTTER", words))
    if drift > CLIP.drift_matters * np.hypot(*fit.states[:, 2:].T).min():
        words = (
            "the background has too few edges to show whether the camera moves: the u of "
            "speeds and restitutions covers a hand's usual drift; --tripod says that the "
            "camera stands"
        )
        notes.append(("DRIFT_UNSEEN", words))
    return notes


def _falls(
    known: ClipKnowledge,
    scene: FlightScene,
    ways: list[Piece],
    model: FittedFlights,
    level: FittedFlights,
    scale: Ruler,
    step: float,
) -> Falls:
    """Return each flight's acceleration by a ruler, and that of all before a camera so level."""
    own = refit(scene, ways, model.fit, shared=False)
    tilted = [each.tilt.any() for each in (model.fit, *(other for other, _ in model.others))]
    owns = [(model.fit, 1.0)] if not tilted[0] and any(tilted) else []
    if scene.readout is None:
        owns.append((refit(scene, ways, model.fit, readout=1.0, shared=False), EVEN_SHARE))
    unit, relative_u = scale.metres_per_pixel / step**2, scale.relative_u
    all_of = level
    if not level_tilt(float(np.hypot(*level.fit.tilt)) * max(scene.size)):
        all_of = model
    others = [*all_of.longest, *([(model.other, EVEN_SHARE)] if model.other else [])]
    return Falls(
        known=known,
        ways=ways,
        pulls=[
            estimate_of(partial(_pull, k), own, owns, unit=unit, relative_u=relative_u)
            for k in range(len(ways))
        ],
        shared=estimate_of(partial(_pull, 0), all_of.fit, others, unit=unit, relative_u=relative_u),
        scale=scale,
        step=step,
    )


def _let_go(speed: Estimate, unit: float, off: float, velocity: Array, pull: Array) -> Estimate:
    """Return the speed at a flight's free end; its u covers the uncertain time of the release.

    Just after a release the ball has moved by less than places scatter, or than the last is `off`.
    """
    size = float(np.hypot(*pull))
    if size == 0:
        return speed
    falls = float(velocity @ pull) / size
    if abs(falls) > size * (1 + np.sqrt(8 * off / size)):
        return speed
    across = abs(float(velocity[0] * pull[1] - velocity[1] * pull[0])) / size
    return replace(speed, u=float(np.hypot(speed.u, speed.value - unit * across)))


def _strays(t: Array, left: Array, spread: float) -> float:
    """Return how fast the first places leave their flight's way, 0 where chance explains it.

    A ball that still rolls or is still held has another speed there [pixels/frame].
    """
    some = slice(max(FLIGHTS.side_places, outer_places(len(t))))
    late = t[some] - t[some].mean()
    size = float(np.linalg.norm(late))
    speed = float(np.hypot(*(late @ left[some]))) / size**2
    return speed if speed * size > CLIP.strays * spread else 0.0


def _pull(flight: int, fit: Fit) -> float:
    return float(np.hypot(*fit.pull[flight]))


def _speed(flight: int, t: float, late: float, scale: Ruler, fit: Fit) -> float:
    """Return a flight's speed at a time of the first row [m/frame]; the ball was read so `late`."""
    return scale.unit(fit) * float(np.hypot(*fit.at(flight, t + fit.readout * late)[0, 2:]))


def _of_readout(contacts: list[Contact], rolled: list[Contact]) -> str:
    """Return what a readout nobody speaks of may change, by contacts found with the usual one."""
    by = {each.before: each.restitution for each in rolled}
    pairs = [(each.restitution, by.get(each.before)) for each in contacts]
    most = max((abs(one.value - other.value) for one, other in pairs if one and other), default=0.0)
    words = (
        "neither --readout nor --global-shutter is given: a shutter may roll for up to a "
        "frame, and the speeds' u covers that"
    )
    if not any(one for one, _ in pairs):
        return words
    return f"{words}; a restitution's does not: half a frame would change one by {most:.2g}"
