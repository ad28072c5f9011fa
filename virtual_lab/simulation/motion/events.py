"""Event-driven motion of all shots of a block, with stop, bars, posts and repeated contacts."""

from __future__ import annotations

import numpy as np

from virtual_lab.simulation.motion.played import Pieces, PlayedShots, Target
from virtual_lab.simulation.motion.scene import ShotScene, ShotState
from virtual_lab.simulation.motion.touch import Obstacle
from virtual_lab.simulation.physics.beam import radius_cubics
from virtual_lab.units import Array


def play_events(scene: ShotScene) -> PlayedShots:
    """Return the motion of the shots as pieces of free motion between contacts, sorted by shot.

    A shot that cannot be computed has no pieces. The field `refused` of the result, (shot,), states
    the reason, an `Obstacle`; it is an empty string for all other shots. The result of a shot does
    not depend on the other shots.
    """
    from virtual_lab.simulation.motion.event_kernel import MOST, Log, Own, Scene, carry_on

    count, bat, stop = scene.shots, scene.bat, scene.stop
    constants = np.empty((count, len(Own._fields)))
    columns = scene.ball_mass, scene.ball_drag, scene.ball_radius, scene.gravity, scene.duration
    for column, each in enumerate((*columns, bat.axis, bat.inertia)):
        constants[:, column] = each
    compiled = Scene(
        *radius_cubics(bat.profile),
        bat.steepest,
        stop.angle if stop else np.inf,
        stop.restitution if stop else 0.0,
        constants,
        _solids(scene),
    )
    rows = MOST + 2, count
    log = Log(
        rows=np.ones(count, dtype=np.int64),
        kind=np.zeros(rows, dtype=np.int8),
        time=np.zeros(rows),
        place=np.full(rows, np.nan),
        speed=np.full(rows, np.nan),
        state=np.empty((*rows, len(ShotState._fields))),
        waits=np.zeros(count, dtype=np.bool_),
        refused=np.zeros(count, dtype=np.int8),
    )
    log.state[0] = np.transpose(scene.start)
    shots, efficiency = np.arange(count), np.empty(0)
    while shots.size:
        carry_on(shots, efficiency, compiled, log)
        shots = shots[log.waits[shots]]
        last = log.rows[shots] - 1
        place, speed = log.place[last, shots], log.speed[last, shots]
        efficiency = np.asarray(scene.efficiency(place, speed, shots))
    lengths = np.where(log.refused, 0, log.rows)
    shot, row = np.nonzero(np.arange(lengths.max(initial=0)) < lengths[:, None])
    return PlayedShots(
        refused=np.array(["", *Obstacle])[log.refused],
        pieces=Pieces(
            shot,
            log.time[row, shot],
            np.array(list(Target))[log.kind[row, shot]],
            log.place[row, shot],
            log.speed[row, shot],
            ShotState(*log.state[row, shot].T.copy()),
        ),
    )


def _solids(scene: ShotScene) -> Array:
    """Return the table of the stop's post and the frames' bars and posts, (shot, solid, 10)."""
    from virtual_lab.simulation.motion.event_kernel import FRAME, SOLID, STOP

    none, alike = (np.nan,) * 4, list[tuple[float, ...]]()
    if stop := scene.stop:
        alike.append((0, 0, 0, stop.radius, stop.restitution, STOP, *none))
    for frame in scene.frames:
        what = frame.spec.radius, frame.spec.restitution, FRAME
        alike.append((0, *frame.ends, *what, *frame.heights))
        alike += [(0, end, end, *what, *none) for end in frame.ends]
    solids = np.empty((scene.shots, len(alike), len(SOLID)))
    solids[:] = np.reshape(alike, solids.shape[1:])
    radius = np.asarray(scene.ball_radius)[..., None]
    solids[:, :, SOLID.reach] += radius
    if stop:
        solids[:, 0, SOLID.x], z = stop.post(scene.bat)
        solids[:, 0, SOLID.low : SOLID.high + 1] = np.asarray(z)[..., None]
    for number, frame in enumerate(scene.frames):
        first = 3 * number + bool(stop)
        solids[:, first : first + 3, SOLID.x] = np.asarray(frame.x)[..., None]
        solids[:, first, SOLID.under :] += np.asarray(frame.up)[..., None]
        solids[:, first, SOLID.under :] += radius * (-1.0, 1.0, -1.0, 1.0)
    return solids
