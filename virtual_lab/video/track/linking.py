"""Spots of many frames joined into the way of one ball, told from a bat and a second ball."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from math import hypot, log

from virtual_lab.errors import InputError
from virtual_lab.video.track.finding import Spot

__all__ = ["Track", "ball_track"]

Found = dict[int, Spot]  # by frame

GAP = 4  # frames a ball may be lost for before its track ends
LIKE = 0.3  # of the radius: spots of one ball differ by less from frame to frame
NEW_REACH = 9.0  # radii a ball may move in the first step of its track
STEADY = 1.3  # a step is at most this much longer than the last
LEAST = 4  # frames in which a ball must be seen
ROUND = 0.6  # of a ball's frames show it round
TRAVEL = 2.0  # radii a ball moves at least
RIVAL = 0.4  # of the ball's frames: another track as long as this is a second ball
NEAR_SIZE = 0.35  # of the expected radius: what is farther off is not the ball
JOIN = 8.0  # radii between the end of a track and the start of the next, of one ball


@dataclass(slots=True)
class Track:
    """Spots of one thing, by frame."""

    found: Found = field(default_factory=dict)

    @property
    def last(self) -> int:
        """The frame it was last seen in."""
        return next(reversed(self.found))

    @property
    def first(self) -> int:
        """The frame it was first seen in."""
        return next(iter(self.found))

    def radius(self) -> float:
        """Return the middle of its radii where it is whole [pixels]."""
        radii = sorted(spot.radius for spot in self.found.values() if not spot.cut)
        radii = radii or sorted(spot.radius for spot in self.found.values())
        return radii[len(radii) // 2]

    def velocity(self) -> tuple[float, float]:
        """Return its last step, pixels a frame; (0, 0) where it was seen once."""
        if len(self.found) < 2:
            return 0.0, 0.0
        (before, one), (after, two) = list(self.found.items())[-2:]
        span = after - before
        return (two.x - one.x) / span, (two.y - one.y) / span


def ball_track(spots: list[list[Spot]], where: str, radius: float | None = None) -> Found:
    """Return the ball's spot in each frame that shows it.

    Parameters
    ----------
    spots
        What moves in each frame.
    where
        The clip, for errors.
    radius
        Of the ball where it is known [pixels].

    Raises
    ------
    InputError
        No ball, or two at a time.
    """
    balls = [track for track in _tracks(spots) if _is_ball(track, radius)]
    if not balls:
        size = f" with a radius near {radius:.3g} pixels" if radius else ""
        allowed = f"nothing round{size} was seen to move through {LEAST} frames or more"
        raise InputError(where, "ball", None, f"not found: {allowed}")
    best = max(balls, key=lambda track: (len(track.found), track.first))
    for other in balls:
        if other is best or not _alike(other, best):
            continue
        shared = len(best.found.keys() & other.found.keys())
        if shared >= 3 and len(other.found) >= max(LEAST, RIVAL * len(best.found)):
            frames = sorted(best.found.keys() & other.found.keys())
            allowed = f"frames {frames[0]} to {frames[-1]} show two: cut or mask one"
            raise InputError(where, "balls", 2, allowed)
    return _joined(best, balls)


def _tracks(spots: list[list[Spot]]) -> list[Track]:
    """Return tracks grown frame by frame, the longest first to choose."""
    tracks: list[Track] = []
    alive: list[Track] = []
    for frame, seen in enumerate(spots):
        free = list(seen)
        alive = [track for track in alive if frame - track.last <= GAP]
        for track in sorted(alive, key=lambda track: -len(track.found)):
            costs = [(_cost(track, frame, spot), k) for k, spot in enumerate(free)]
            if costs and (best := min(costs))[0] < 1.0:
                track.found[frame] = free.pop(best[1])
        for spot in free:
            tracks.append(Track({frame: spot}))
            alive.append(tracks[-1])
    return tracks


def _cost(track: Track, frame: int, spot: Spot) -> float:
    """Return how ill a spot goes with a track; 1 and above: not at all."""
    last = track.found[track.last]
    span = frame - track.last
    size = abs(log(spot.radius / last.radius)) / LIKE
    if last.cut or spot.cut:
        size /= 3
    velocity = track.velocity()
    speed = hypot(*velocity)
    moved = hypot(spot.x - last.x, spot.y - last.y)
    aside = hypot(spot.x - last.x - velocity[0] * span, spot.y - last.y - velocity[1] * span)
    reach = STEADY * speed * span + 1.5 * last.radius
    if len(track.found) == 1:
        reach = NEW_REACH * last.radius * span
    if moved > reach or size >= 1 or spot.contrast * last.contrast < 0:
        return 1.0
    return 0.5 * min(aside, moved) / reach + 0.4 * size


def _is_ball(track: Track, radius: float | None) -> bool:
    whole = [spot for spot in track.found.values() if not spot.cut]
    if len(whole) < LEAST:
        return False
    own = track.radius()
    if radius and not 1 / (1 + NEAR_SIZE) < own / radius < 1 + NEAR_SIZE:
        return False
    first, last = whole[0], whole[-1]
    middle = whole[len(whole) // 2]
    travel = max(
        hypot(last.x - first.x, last.y - first.y), hypot(middle.x - first.x, middle.y - first.y)
    )
    long = sorted(hypot(spot.blur_x, spot.blur_y) for spot in whole)[len(whole) // 2]
    step = sorted(_steps(track))[len(track.found) // 2]
    return (
        sum(spot.round for spot in whole) >= ROUND * len(whole)
        and travel > TRAVEL * own
        and long < own + STEADY * step
    )


def _steps(track: Track) -> list[float]:
    """Return how far a thing moved a frame, the first twice."""
    seen = list(track.found.items())
    steps = [
        hypot(two.x - one.x, two.y - one.y) / (after - before)
        for (before, one), (after, two) in itertools.pairwise(seen)
    ]
    return [steps[0], *steps]


def _alike(one: Track, other: Track) -> bool:
    return abs(log(one.radius() / other.radius())) < LIKE


def _joined(best: Track, balls: list[Track]) -> Found:
    """Return a track with those before and after that take up where it ends."""
    found = dict(best.found)
    for other in sorted(balls, key=lambda track: track.first):
        if other is best or not _alike(other, best) or found.keys() & other.found.keys():
            continue
        both = sorted([found, other.found], key=min)
        end, start = both[0][max(both[0])], both[1][min(both[1])]
        if hypot(start.x - end.x, start.y - end.y) < JOIN * best.radius():
            found = dict(sorted((found | other.found).items()))
    return found
