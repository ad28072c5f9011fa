"""The cheap rung: one contact of ball and bat between free flights, all shots at once.

It refuses, shot by shot and with the reason, what it cannot do: a stop reached within the
record, an obstacle in the way, a second contact, a blow on the edge of the tip or the knob.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.simulation.motion.outcome import BAT, Events, Outcome
from virtual_lab.simulation.motion.scene import Obstacle, Scene, State
from virtual_lab.simulation.motion.touch import (
    Nearness,
    after_contact,
    first_touch,
    first_zero,
    moved,
    nearness,
    obstacle_gap,
)
from virtual_lab.simulation.motion.track import Track
from virtual_lab.simulation.physics.coasting import time_to_turn

__all__ = ["EDGE", "FOLLOWED", "GRAZED", "RUNG", "effective", "play_closed_form"]

Array = NDArray[np.float64]
RUNG = "closed-form"
EDGE = "the ball strikes the edge of the bat's end, where no collision model holds"
STOPPED = "the bat reaches a stop within the record"
GRAZED = "the ball grazes the bat by less than its roundness is known"
FOLLOWED = "the bat follows faster than the ball leaves it: no such e_A can be"


def play_closed_form(scene: Scene) -> Outcome:
    """Return what the shots come to; those refused hold NaN.

    Raises
    ------
    InputError
        From the scene's `efficiency`.
    """
    count = len(scene)
    until = np.full(count, scene.duration)
    time = first_touch(scene, scene.start, until)
    hit = np.flatnonzero(np.isfinite(time))
    before = moved(scene, scene.start.part(hit), time[hit], hit)
    near = nearness(scene, before)
    edge = (near.place < 0) | (near.place > scene.bat.barrel.length)
    refusals = _Refusals(count)
    refusals.note(hit[edge], time[hit[edge]], EDGE)
    grazed = ~edge & (near.approach <= 0)
    refusals.note(hit[grazed], time[hit[grazed]], GRAZED)
    on = ~edge & ~grazed
    hit = hit[on]
    before, near = before.part(on), _part(near, on)
    efficiency = effective(scene, near, hit)
    after = after_contact(scene, before, near, efficiency, hit)
    followed = hit[nearness(scene, after).opening <= 0]
    refusals.note(followed, time[followed], FOLLOWED)
    left = until[hit] - time[hit]
    again = time[hit] + first_touch(scene, after, left, parting=True, shots=hit)
    refusals.note(hit, again, "ball and bat meet again")
    flown = np.minimum(time, until)
    for shots, state, span, began in (
        (np.arange(count), scene.start, flown, np.zeros(count)),
        (hit, after, left, time[hit]),
    ):
        refusals.note(shots, began + _stopped(scene, state, span), STOPPED)
        for obstacle in scene.obstacles:
            met = began + _met(obstacle, scene, shots, state, span)
            refusals.note(shots, met, f"a {obstacle.kind} stands in the ball's way")
    return _outcome(scene, time, hit, near, efficiency, after, refusals.why)


def effective(scene: Scene, near: Nearness, shots: NDArray[np.int_]) -> Array:
    """Return the scene's e_A for contacts of these shots, which are on the bat.

    Raises
    ------
    InputError
        An e_A that is no number: nothing could be said of what follows.
    """
    if not len(shots):
        return np.zeros(0)
    balls = scene.balls
    given = near.place, near.approach, balls.mass[shots], balls.restitution[shots]
    found = np.asarray(scene.efficiency(*given), dtype=float)
    if not np.isfinite(found).all():
        bad = float(found[~np.isfinite(found)][0])
        raise InputError("motion", "efficiency", bad, "allowed: finite numbers")
    return found


class _Refusals:
    """Of each shot the first thing, in time, that the closed form cannot do."""

    def __init__(self, shots: int) -> None:
        self.why: NDArray[np.object_] = np.full(shots, "", dtype=object)
        self.when = np.full(shots, np.inf)

    def note(self, shots: NDArray[np.int_], times: Array, why: str) -> None:
        """Note a reason that arises in shots at times [s], inf where it does not."""
        first = times < self.when[shots]
        self.why[shots[first]] = why
        self.when[shots[first]] = times[first]


def _stopped(scene: Scene, state: State, span: Array) -> Array:
    """Return when the bat comes to a stop within a span [s]; inf where it does not."""
    if not scene.stops:
        return np.full(len(state), np.inf)
    limit = np.where(state.rate > 0, scene.stops.high, scene.stops.low)
    time = time_to_turn(state.rate, limit - state.angle, **scene.bat.friction)
    return np.where((time <= span) & (state.rate != 0), time, np.inf)


def _met(
    obstacle: Obstacle, scene: Scene, shots: NDArray[np.int_], state: State, span: Array
) -> Array:
    """Return when flights from `state` strike an obstacle within a span [s]; inf if not."""

    def gap(time: Array, part: NDArray[np.int_]) -> tuple[Array, Array]:
        here = moved(scene, state.part(part), time, shots[part])
        return obstacle_gap(obstacle, scene, here), np.hypot(here.vx, here.vz)

    time = first_zero(gap, np.zeros(len(shots)), span)
    met = np.isfinite(time)
    height = moved(scene, state, np.where(met, time, 0.0), shots).y
    return np.where(obstacle.meets(height, scene.balls.radius), time, np.inf)


def _part(near: Nearness, chosen: NDArray[np.bool_]) -> Nearness:
    return Nearness(**{name: getattr(near, name)[chosen] for name in Nearness.__slots__})


def _outcome(
    scene: Scene,
    time: Array,
    hit: NDArray[np.int_],
    near: Nearness,
    efficiency: Array,
    after: State,
    refused: NDArray[np.object_],
) -> Outcome:
    count = len(scene)
    good = refused == ""

    def of_hits(values: Array) -> Array:
        whole = np.full((count, *values.shape[1:]), np.nan)
        whole[hit] = values
        whole[~good] = np.nan
        return whole

    # the last free motion of each shot, and when it began
    last = scene.start.with_part(hit, after)
    began = np.zeros(count)
    began[hit] = time[hit]
    end = moved(scene, last, scene.duration - began)
    nothing = np.full(int((~good).sum()), np.nan)
    end = end.with_part(~good, State(**dict.fromkeys(State.__slots__, nothing)))
    sound = good[hit]
    columns = hit[sound], time[hit][sound], near.place[sound], near.approach[sound]
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return Outcome(
        rung=np.full(count, RUNG),
        reason=np.where(good, "closed form does all of it", "").astype(np.str_),
        refused=refused.astype(np.str_),
        time=of_hits(time[hit]),
        place=of_hits(near.place),
        relative_speed=of_hits(near.approach),
        collision_efficiency=of_hits(efficiency),
        ball_velocity=of_hits(np.stack([after.vx, after.vy, after.vz], axis=-1)),
        bat_rate=of_hits(after.rate),
        end=end,
        pivot_drift=np.where(good, 0.0, np.nan),
        events=Events.of([(shot, when, BAT, z, v) for shot, when, z, v in rows]),
        track=Track.of(
            scene,
            [
                (np.flatnonzero(good), np.zeros(int(good.sum())), scene.start.part(good)),
                (hit[sound], time[hit][sound], after.part(sound)),
            ],
        ),
    )
