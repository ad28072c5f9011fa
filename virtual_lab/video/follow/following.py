"""From a clip to flights and contacts, as in the command `virtual-lab track`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from virtual_lab.errors import InputError, name_parameters
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array, Mask
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.timing import UNREAD, UNSURE_RATE
from virtual_lab.video.find.watching import Watched, repeats, watch
from virtual_lab.video.follow.contacts import Contact, contacts_of
from virtual_lab.video.follow.correction import apply_correction, require_moving_object
from virtual_lab.video.follow.doubts import (
    against_flights,
    against_gravity,
    against_size,
    of_camera,
    of_diameter,
    of_drag,
    of_positions,
)
from virtual_lab.video.follow.flights import REST, falls_freely
from virtual_lab.video.follow.joint import Fit, estimate_of, fit_flights
from virtual_lab.video.follow.knowledge import GRAVITY, ClipKnowledge, Note
from virtual_lab.video.follow.models import FittedFlights
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.registering import register
from virtual_lab.video.follow.ruler import Ruler, rulers_of
from virtual_lab.video.follow.searching import FlightsFound, search, step_of
from virtual_lab.video.follow.sharpening import NotSharpError, SharpBall, sharpen, wants_sharp
from virtual_lab.video.follow.turning import turn_back


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A flight in meters and seconds."""

    first_frame: int
    last_frame: int
    places: int
    # speed at the start of the flight: at the contact before it, otherwise at its first position
    speed_in: Estimate
    speed_out: Estimate
    # angle of the velocity from the right of the picture, counterclockwise [rad]
    angle_in: Estimate
    angle_out: Estimate
    # acceleration of this flight alone, without drag; None if only gravity sets the scale, or if g
    # is known
    acceleration: Estimate | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowedClip(FlightsFound):
    """A ball that was followed through a clip: its flights, contacts, scale and doubts."""

    clip: Clip
    watched: Watched
    knowledge: ClipKnowledge
    seconds: float  # duration of one step of `t` [s]
    fit: Fit | None
    flights: list[Flight]
    contacts: list[Contact]
    scale: PixelScale | None  # scale that is used
    checks: tuple[PixelScale, ...]  # other scales, for comparison
    # acceleration common to the flights, by a scale that does not come from gravity [m/s²]
    gravity: Estimate | None
    drag_per_m: Estimate | None
    sharp: SharpBall | None  # sharp positions of the ball, if the camera is calibrated
    notes: tuple[Note, ...]
    uncorrected: FollowedClip | None = None  # the result without positions by hand

    @property
    def flags(self) -> tuple[str, ...]:
        """Names of the flags (doubts about the result), in capitals."""
        return tuple(dict.fromkeys(flag for flag, _ in self.notes if flag))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on the flags, and remarks that raise no flag."""
        return tuple(dict.fromkeys(name_parameters(words) for _, words in self.notes if words))


def follow(
    clip: Clip, knowledge: ClipKnowledge, *, progress: Callable[[str], None] = lambda _: None
) -> FollowedClip:
    """Follow the ball through a clip, and return its flights, contacts, scale and doubts.

    A clip without a flight gives a result without flights, and a warning.

    Parameters
    ----------
    knowledge
        Scale, frame rate and other facts that the user stated.
    progress
        Function that is called with messages about the work.

    Raises
    ------
    InputError
        The stated frame rate implies an impossibly large g, or a calibrated clip has no scale. Or
        the user asked to compute the scale from gravity, but no flight is curved enough.
    """
    progress("looking for the ball")
    frames, region, tripod = knowledge.frames, knowledge.region, knowledge.tripod
    watched = watch(clip, frames=frames, region=region, tripod=tripod, progress=progress)
    return follow_blobs(clip, watched, knowledge, progress=progress)


def follow_blobs(
    clip: Clip,
    watched: Watched,
    knowledge: ClipKnowledge,
    *,
    progress: Callable[[str], None] = lambda _: None,
) -> FollowedClip:
    """Follow the ball through a clip with known moving blobs, and return a result as `follow` does.

    The errors are also those of `follow`.

    Parameters
    ----------
    watched
        Moving blobs, still background and drift of the clip.
    """
    same = repeats(watched)
    result, sharp, notes = search(clip, watched, knowledge, same), None, []
    if wants_sharp(knowledge, watched, result.ways) and not _while_moving(same, result.ways).any():
        try:
            scene, ways, sharp = sharpen(clip, watched, knowledge, result, progress)
            result = replace(result, scene=scene, ways=ways)
        except NotSharpError as why:
            notes = [("NOT_SHARP", f"{why}; the positions are those without calibration")]
    if sharp is None:
        watched, result = register(clip, watched, result)
        scene, ways = result.scene, result.ways
        if ways and not falls_freely(scene, ways, fit_flights(scene, ways)):
            result = replace(result, ways=[])
    made = partial(measure, clip, watched, knowledge, sharp=sharp, earlier=notes)
    if knowledge.by_hand is None:
        return made(result)
    require_moving_object(watched.blobs, knowledge.by_hand)
    track = made(apply_correction(result, knowledge.by_hand))
    with suppress(InputError):  # a track that could not be used, and was corrected therefore
        track = replace(track, uncorrected=made(result))
    return track


def measure(
    clip: Clip,
    watched: Watched,
    knowledge: ClipKnowledge,
    search: FlightsFound,
    *,
    sharp: SharpBall | None = None,
    earlier: Sequence[Note] = (),
) -> FollowedClip:
    """Return the flights, contacts and scale of a clip in SI units, with notes on doubtful points.

    The result has no flights if `search` has none, or if no scale is known. The frame rate comes
    from the file if the user stated none. If this rate contradicts g, a rate that agrees with g is
    used instead.

    Parameters
    ----------
    search
        Scene and flights. If `sharp` is given, their positions come from the outlines of the ball.
        Otherwise they come from the blobs, the regions that differ from the background.
    sharp
        The ball located by its outlines. None if only positions of blobs are known.
    earlier
        Notes on the clip from earlier steps.

    Raises
    ------
    InputError
        The stated frame rate implies an impossible g or an impossible diameter of the ball. Or the
        user asked to compute the scale from gravity, but no flight is curved enough.
    """
    pieces = search.pieces
    scene, ways = turn_back(search.scene, search.ways, watched)
    notes = [*earlier]
    for words in clip.warnings:
        # a fitted rate is not that of the file
        if knowledge.rate_of != GRAVITY or UNSURE_RATE not in words:
            notes.append(("FRAMES_UNREAD" if UNREAD in words else "", words))
    step, where = step_of(knowledge, scene, ways), str(clip.source.path)
    drift = 0.0 if knowledge.tripod else watched.still.unseen_drift(step)
    model = FittedFlights.of(scene, ways, drift) if ways else None
    if model and not sharp and (against := of_drag(model)):  # the fitted drag is used
        free = replace(search, scene=replace(search.scene, drag=None))
        return measure(clip, watched, knowledge, free, earlier=[*earlier, *against])
    if sharp and model:
        rulers = [Ruler.of(sharp.plane, knowledge)]
        notes += sharp.notes
        model = replace(model, rest=[*model.rest, *sharp.aside])
    else:
        ball = scene.blobs[[k for each in ways or pieces for k in each.blobs]]
        rulers = rulers_of(knowledge, ball, model, step, where)
    scale = rulers[0] if rulers else None
    shared, drag, flights = None, None, []
    contacts: list[Contact] = []
    if model and scale:
        if not sharp:
            # The background moves faster than in a hand if a codec hides the turn of a camera.
            unseen = drift if watched.still.hidden_drift > drift else 0.0
            notes += [*of_camera(model, unseen, knowledge.rate), *of_positions(model)]
        contacts, against = contacts_of(model, step, scale, sharp)
        size = next((each for each in rulers if each.source != GRAVITY), None)
        if size is None:
            against += of_diameter(scale, ways, knowledge.rate, where)
        alone: list[Estimate | None] = [None] * len(ways)
        if size and not sharp and scene.pull is None:
            shared, alone[:] = _falls(model, size, step)
            rest_u = next((each.rest_u for each in rulers if each.source == GRAVITY), 0.0)
            u = float(np.hypot(shared.u, shared.value * rest_u))
            off, fitted = against_gravity(knowledge, replace(shared, u=u), size, where)
            if fitted is not knowledge:
                found = replace(search, scene=replace(search.scene, **fitted.in_frames))
                return measure(clip, watched, fitted, found, earlier=[*earlier, *off])
            against += off
        flights = _flights(model, alone, contacts, scale, step)
        per_m = {"unit": 1 / scale.metres_per_pixel, "relative_u": scale.relative_u}
        drag = estimate_of(lambda fit: fit.drag, model.fit, model.rest, **per_m)
        notes += against
    notes += against_size(rulers)
    notes += against_flights(scene, watched, pieces, ways)
    if count := _while_moving(repeats(watched), ways or pieces).sum():
        words = f"{count} frames are stored twice while the ball moves; repeats are ignored"
        notes.append(("REPEATED_FRAMES", words))
    return FollowedClip(
        clip=clip,
        watched=watched,
        knowledge=knowledge,
        scene=scene,
        pieces=pieces,
        ways=ways,
        seconds=step,
        fit=model.fit if model else None,
        flights=flights,
        contacts=contacts,
        scale=scale,
        checks=tuple(rulers[1:]),
        gravity=shared,
        drag_per_m=drag,
        sharp=sharp,
        notes=tuple(notes),
    )


def _while_moving(same: Mask, ways: Sequence[Piece]) -> Mask:
    """Return a mask of the repeated frames during the motion of a ball, (frame,).

    At other times, equal frames are normal.
    """
    counted = np.zeros(len(same), bool)
    for way in ways:
        t, steps = way.frames, np.hypot(*np.diff(way.xy, axis=0).T) / np.diff(way.frames)
        for k in np.flatnonzero(steps > REST * way.radius):
            counted[t[k] + 1 : t[k + 1] + 1] = True
    counted &= same
    return counted if counted.sum() > 1 else np.zeros_like(counted)


def _flights(
    model: FittedFlights,
    alone: Sequence[Estimate | None],
    contacts: list[Contact],
    scale: Ruler,
    step: float,
) -> list[Flight]:
    """Return the flights in meters and seconds."""
    fit, others = model.fit, model.rest
    unit = scale.metres_per_pixel / step
    before = {each.before + 1: each.t for each in contacts}
    after = {each.before: each.t for each in contacts}
    flights = []
    for k, way in enumerate(model.ways):
        late = float(np.median(model.scene.late(way.blobs)))
        first, last = way.frames[[0, -1]].tolist()
        ends: dict[str, Any] = {"first_frame": first, "last_frame": last}
        for name, met, end in (("in", before, 1), ("out", after, -1)):
            t = met.get(k, float(way.t[::end][0]))
            speed_at = partial(_speed, k, t, late, scale)
            speed = estimate_of(speed_at, fit, others, unit=1 / step, relative_u=scale.rest_u)
            right, down = fit.at(k, t + fit.readout * late)[0, 2:]
            if k not in met and not way.sharp:
                off = max(fit.spread, float(np.hypot(*fit.residuals[k][::end][0])))
                speed = _let_go(speed, unit, off, np.array([right, down]), fit.pull[k])
            angle = Estimate(value=float(np.arctan2(-down, right)), u=speed.u / speed.value)
            ends |= {f"speed_{name}": speed, f"angle_{name}": angle}
        flights.append(Flight(places=len(way.t), acceleration=alone[k], **ends))
    return flights


def _falls(model: FittedFlights, scale: Ruler, step: float) -> tuple[Estimate, list[Estimate]]:
    """Return the common acceleration of the flights, and that of each flight [m/s²]."""
    level = replace(model.scene, readout=float(model.fit.readout), level_u=0.0)
    alike = fit_flights(level, model.ways, shared=False)
    scaling = {"unit": scale.metres_per_pixel / step**2, "relative_u": scale.relative_u}
    shared = estimate_of(lambda fit: fit.size, model.fit, (), **scaling)
    norm = partial(np.linalg.norm, axis=-1)
    pulls = [lambda fit, k=k: norm(fit.pull[..., k, :]) for k in range(len(model.ways))]
    return shared, [estimate_of(each, alike, (), **scaling) for each in pulls]


def _let_go(speed: Estimate, unit: float, off: float, velocity: Array, pull: Array) -> Estimate:
    """Return the speed at an end of a flight without a contact, with a u for the time of release.

    At the release the ball was closer to this end than the scatter of positions, or than `off`, the
    deviation of the last position.
    """
    size = float(np.hypot(*pull))
    if size == 0 or abs(velocity @ pull) > size**2 * (1 + np.sqrt(8 * off / size)):
        return speed
    across = abs(float(velocity[0] * pull[1] - velocity[1] * pull[0])) / size
    return replace(speed, u=float(np.hypot(speed.u, speed.value - unit * across)))


def _speed(flight: int, t: float, late: float, scale: Ruler, fit: Fit) -> Any:
    """Return the speed of a flight at the time `t` of the first row [m/frame].

    `late` is the share of the readout time at the row of the ball.
    """
    times = np.asarray(t + fit.readout * late)[..., None]
    return scale.unit(fit) * np.linalg.norm(fit.at(flight, times)[..., 0, 2:], axis=-1)
