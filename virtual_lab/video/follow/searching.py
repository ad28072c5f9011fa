"""Search for the flights of a clip, with each possible interpretation of its frame times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from virtual_lab.units import Mask
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.timing import frame_steps
from virtual_lab.video.find.watching import Watched
from virtual_lab.video.follow.flights import flights_of, positions_of
from virtual_lab.video.follow.joint import Fit
from virtual_lab.video.follow.knowledge import GRAVITY, ClipKnowledge
from virtual_lab.video.follow.pieces import Piece, pieces
from virtual_lab.video.follow.scene import FlightScene

EVERY_OTHER = 0.4  # share of repeats among the frames above which every frame was stored twice


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightsFound:
    """Flights by one interpretation of the frame times."""

    scene: FlightScene
    pieces: list[Piece] = field(default_factory=list)
    ways: list[Piece] = field(default_factory=list)  # positions of each flight


def search(clip: Clip, watched: Watched, knowledge: ClipKnowledge, same: Mask) -> FlightsFound:
    """Return the flights of the ball, and the scene with the frame times that fit them best.

    `same`, (frame,), is the mask of the repeated frames. A repeated frame shows the same picture as
    the frame before. There are two interpretations:

    * A repeated frame takes as long as any other frame. The frame times are then the time stamps.
    * A repeated frame takes no time. All later frames are then earlier by one frame.

    With fewer than two repeated frames, the first interpretation is used. If more than 40 % of the
    frames are repeated, every frame was stored twice, and the second one is used. Otherwise both
    are tried. If pieces of motion contain blobs that are the dark side of a ball, the search is
    repeated without such blobs. The result with more positions on flights and less scatter is used.
    """
    doubled = same.mean() > EVERY_OTHER
    readings = sorted({doubled, doubled or same.sum() > 1})
    scenes = [clip_scene(clip, watched, knowledge, same, squeezed=each) for each in readings]
    results, shaded = [_read(watched, knowledge, each) for each in scenes], watched.blobs["shaded"]
    if any(shaded[piece.blobs].any() for _, each in results for piece in each.pieces):
        blobs = watched.blobs.copy()
        blobs["cut"] |= shaded
        results += [_read(watched, knowledge, replace(each, blobs=blobs)) for each in scenes]
    return max(results, key=lambda each: each[0])[1]


def clip_scene(
    clip: Clip, watched: Watched, knowledge: ClipKnowledge, same: Mask, *, squeezed: bool
) -> FlightScene:
    """Return the scene of a clip: blobs, frame times, and properties of camera and scale.

    Positions are in pixels and times in frames. The scene holds the acceleration of gravity
    (`fall`) and the air drag (`drag`). Their unit of length is the pixel if the scale of the
    picture is known. Otherwise it is the radius of the ball, and `in_radii` is True. `fall` and
    `drag` are None if neither scale nor diameter is known. `fall` is also None if most frames are
    stored twice.

    Parameters
    ----------
    same
        Mask of the repeated frames, (frame,). The time of a repeated frame is NaN.
    squeezed
        True if a repeated frame was added by the file and no time passed. The times of all later
        frames are then one frame earlier. If False, they are kept.
    """
    stamped = frame_steps(clip.times)
    length = knowledge.metres_per_pixel or (knowledge.ball and knowledge.ball / 2)
    drag, fall, pull = knowledge.drag, None, None
    # If every frame is stored twice, the clip may have been filmed at another rate than it is
    # played.
    if length and same.mean() <= EVERY_OTHER:
        # approximate number of pictures per time step
        step = 1 / (1 - same.mean()) if squeezed else 1.0
        fall = knowledge.gravity / length * (step / knowledge.rate) ** 2
    if knowledge.pull and knowledge.metres_per_pixel and knowledge.ruler != GRAVITY:
        pull = np.array(knowledge.pull) / knowledge.metres_per_pixel / knowledge.rate**2
    return FlightScene(
        blobs=watched.blobs,
        time=np.where(same, np.nan, stamped - np.cumsum(same) if squeezed else stamped),
        stamped=stamped,
        size=(clip.shape[1], clip.shape[0]),
        fall=fall,
        drag=(drag[0] * length, drag[1] * length) if drag and length else None,
        in_radii=knowledge.metres_per_pixel is None,
        pull=pull,
        level_u=knowledge.level_u,
        readout_axis=knowledge.readout_axis,
        **knowledge.in_frames,
    )


def _read(
    watched: Watched, knowledge: ClipKnowledge, scene: FlightScene
) -> tuple[float, FlightsFound]:
    """Return the support for the flights with one interpretation of the times, and the flights."""
    best, pull, before = (-1.0, FlightsFound(scene=scene)), None, None
    for _ in range(2):  # with gravity known, the second round can bridge missing frames
        candidates = pieces(scene.blobs, scene.time, pull)
        if knowledge.ball_at:
            candidates = [p for p in candidates if _passes(watched, p, knowledge.ball_at)]
        if positions_of(candidates) == before:
            break
        ways, fit = flights_of(scene, candidates)
        support = _support(scene, ways, fit) if fit else 0.0
        if support > best[0]:
            best = support, FlightsFound(scene=scene, pieces=candidates, ways=ways)
        if fit is None:
            break
        pull, before = fit.pull[0], positions_of(candidates)
    return best


def _passes(watched: Watched, piece: Piece, at: tuple[float, float, int]) -> bool:
    """Return whether a piece belongs to the selected ball: it passes `at` or looks like it."""
    (x, y, frame), blobs = at, watched.blobs
    away = np.hypot(blobs["picture_x"] - x, blobs["picture_y"] - y)
    here = piece.frames == frame
    if here.any():
        return bool(away[piece.blobs[here][0]] < 1.5 * piece.radius)
    some = np.flatnonzero(blobs["frame"] == frame)
    if not some.size:
        return True
    one = blobs[some[away[some].argmin()]]
    colour = np.median(blobs["colour"][piece.blobs], axis=0) - one["colour"]
    return bool(0.6 < piece.radius / one["radius"] < 1.6 and np.abs(colour).max() < 60)


def _support(scene: FlightScene, ways: list[Piece], fit: Fit) -> float:
    """Return the support for flights: number of redundant positions divided by their scatter.

    Flights that show the lit side of the ball and flights that show its dark side are shifted
    against each other, so only one side counts.
    """
    radius = float(np.median([each.radius for each in ways]))
    counts = np.array([len(each.t) for each in ways])
    lit = np.array([scene.blobs["lit"][each.blobs].mean() > 0.5 for each in ways])
    spare = max(counts @ lit, counts @ ~lit) - 5 * len(ways) - len(scene.missing_frames(ways))
    return float(spare / (0.02 + fit.spread / radius))


def step_of(knowledge: ClipKnowledge, scene: FlightScene, ways: Sequence[Piece]) -> float:
    """Return the duration of one time step of `scene.time` [s].

    A frame that only repeats the previous picture takes no step in `scene.time`. Without such
    frames, a step is the frame interval, 1 / rate. With such frames, fewer steps cover the same
    time, and a step is longer.

    The steps are counted during the flights `ways`. If there are no flights, they are counted in
    the whole clip. With fewer than two frames the result is 1 / rate.
    """
    counted = np.flatnonzero(np.isfinite(scene.time))
    if ways:
        counted = np.sort(np.concatenate([way.frames for way in ways]))
    if len(counted) < 2:
        return 1 / knowledge.rate
    first, last = counted[0], counted[-1]
    steps = (scene.stamped[last] - scene.stamped[first]) / (scene.time[last] - scene.time[first])
    return float(steps / knowledge.rate)
