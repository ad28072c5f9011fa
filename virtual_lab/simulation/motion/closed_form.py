"""One contact of ball and bat between free flights, in closed form for all shots at once.

This model has no stop, no frames and no second contact; the models `events` and `pymunk_scene` do.
"""

from __future__ import annotations

import numpy as np

from virtual_lab.simulation.motion.played import Pieces, PlayedShots, Target
from virtual_lab.simulation.motion.scene import ShotScene
from virtual_lab.simulation.motion.touch import first_touch, move, nearness, obstacles, rebound


def play_closed_form(scene: ShotScene) -> PlayedShots:
    """Return the motion of the shots as pieces of free motion between contacts, sorted by shot.

    A shot that the closed form cannot compute has no pieces. The field `refused` of the result,
    (shot,), states the reason, an `Obstacle`; it is an empty string for all other shots.
    """
    everyone = np.arange(scene.shots)
    time = first_touch(scene, scene.start, np.full(scene.shots, scene.duration), everyone)
    hit = np.flatnonzero(np.isfinite(time))
    before = move(scene, scene.start.part(hit), time[hit], hit)
    near = nearness(scene, before)
    after = rebound(scene, before, near, scene.efficiency(near.place, near.approach, hit), hit)
    why = obstacles(scene, near, after)
    refused = np.zeros(scene.shots, dtype=why.dtype)
    refused[hit] = why
    starts = np.flatnonzero(refused == "")
    first_pieces = Pieces.of(starts, np.zeros(len(starts)), Target.START, scene.start.part(starts))
    struck = Pieces.of(hit, time[hit], Target.BAT, after, near.place, near.approach)
    return PlayedShots(
        refused=refused, pieces=Pieces.concatenate([first_pieces, struck.part(why == "")])
    )
