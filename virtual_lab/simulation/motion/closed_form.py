"""The cheap rung: one contact of ball and bat between free flights, all shots at once.

It refuses, shot by shot and with the reason, what it cannot do: a stop reached within the
record, a frame in the way, a second contact, a blow on the edge of the tip or the knob.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.flight import time_after
from virtual_lab.simulation.motion.played import Pieces, PlayedShots, Target
from virtual_lab.simulation.motion.scene import GateFrame, ShotScene, ShotState
from virtual_lab.simulation.motion.touch import (
    Nearness,
    first_touch,
    moved,
    nearness,
    parted,
    time_to_stop,
)
from virtual_lab.units import Array

CLOSED_FORM = "closed-form"


class Obstacle(StrEnum):
    """Why a rung cannot do a shot, in the order of precedence."""

    EDGE = "the ball strikes the edge of the bat's end, where no collision model holds"
    GRAZED = "the ball grazes the bat by less than its roundness is known"
    FOLLOWED = "the bat follows faster than the ball leaves it: no such e_A can be"
    AGAIN = "ball and bat meet again"
    STOPPED = "the bat reaches its stop within the record"
    FRAMED = "the frame of a gate stands in the ball's way"


def play_closed_form(scene: ShotScene) -> PlayedShots:
    """Return what the shots come to; those refused have no pieces."""
    everyone, count = np.arange(scene.shots), scene.shots
    until = np.full(count, scene.duration)
    time = first_touch(scene, scene.start, until, everyone)
    hit = np.flatnonzero(np.isfinite(time))
    before = moved(scene, scene.start.part(hit), time[hit], hit)
    near = nearness(scene, before)
    after = parted(scene, before, near, scene.efficiency(near.place, near.approach, hit), hit)
    why = {reason: np.full(count, np.inf) for reason in Obstacle}  # and when it arises [s]
    edge = (near.place < 0) | (near.place > scene.bat.length)
    for reason, struck in (
        (Obstacle.EDGE, edge),
        (Obstacle.GRAZED, ~edge & (near.approach <= 0)),
        (Obstacle.FOLLOWED, ~edge & (near.approach > 0) & (nearness(scene, after).approach >= 0)),
    ):
        why[reason][hit[struck]] = time[hit[struck]]
    good = ~edge & np.isinf(why[Obstacle.GRAZED][hit]) & np.isinf(why[Obstacle.FOLLOWED][hit])
    hit, after = hit[good], after.part(good)
    near = Nearness(*(each[..., good] for each in near))
    left = until[hit] - time[hit]
    why[Obstacle.AGAIN][hit] = time[hit] + first_touch(scene, after, left, hit, parting=True)
    for shots, state, span, began in (
        (everyone, scene.start, np.minimum(time, until), np.zeros(count)),
        (hit, after, left, time[hit]),
    ):
        stops = time_to_stop(scene, state)
        met = np.where(stops <= span, began + stops, np.inf)
        why[Obstacle.STOPPED][shots] = np.minimum(why[Obstacle.STOPPED][shots], met)
        for frame in scene.frames:
            met = began + _met(frame, scene, shots, state, span)
            why[Obstacle.FRAMED][shots] = np.minimum(why[Obstacle.FRAMED][shots], met)
    when = np.stack(list(why.values()))
    refused = np.where(
        np.isfinite(when.min(axis=0)), np.array(list(Obstacle))[when.argmin(axis=0)], ""
    )
    done, sound = refused == "", refused[hit] == ""
    starts = np.flatnonzero(done)
    return PlayedShots(
        rung=np.full(count, CLOSED_FORM),
        refused=refused,
        pieces=Pieces.joined(
            [
                Pieces.of(starts, np.zeros(len(starts)), Target.START, scene.start.part(starts)),
                Pieces.of(hit, time[hit], Target.BAT, after, near.place, near.approach).part(sound),
            ]
        ),
    )


def _met(
    frame: GateFrame, scene: ShotScene, shots: NDArray[np.int_], state: ShotState, span: Array
) -> Array:
    """Return when flights come to a frame they do not clear within a span [s]; inf if not."""
    spec, radius = frame.spec, scene.ball_radius
    speed = np.hypot(state.vx, state.vz)
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = np.abs(frame.x - state.x) - spec.radius - radius
        way = np.where((frame.x - state.x) * state.vx > 0, ahead * speed / np.abs(state.vx), np.nan)
        time = np.where(way >= 0, time_after(way, speed, scene.ball_drag[shots]), np.inf)
    here = moved(scene, state, np.where(time < span, time, 0.0), shots)
    # how far aside a ball goes while it is between the posts
    aside = 2 * (spec.radius + radius) * np.abs(state.vz) / np.where(state.vx, state.vx, 1.0)
    beside = (here.z - np.abs(aside) < spec.tip_side + radius) | (
        here.z + np.abs(aside) > spec.knob_side - radius
    )
    return np.where((time < span) & (beside | ~frame.clears(here.y, radius)), time, np.inf)
