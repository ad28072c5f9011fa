"""Which rung plays a shot: the cheapest that can, shot by shot, and why."""

from __future__ import annotations

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.simulation.motion import closed_form, pymunk_scene
from virtual_lab.simulation.motion.played import Pieces, PlayedShots
from virtual_lab.simulation.motion.pymunk_scene import PymunkSettings
from virtual_lab.simulation.motion.scene import ShotScene
from virtual_lab.simulation.motion.touch import nearness

RUNGS = (closed_form.CLOSED_FORM, pymunk_scene.PYMUNK)


def play(
    scene: ShotScene, rung: str | None = None, *, settings: PymunkSettings | None = None
) -> PlayedShots:
    """Return what the shots of a scene come to.

    A `rung` of `RUNGS` plays all shots; without it each shot has the closed form, or pymunk where
    that refuses it. Without `settings` pymunk has its own, with a step short enough for the scene.
    `InputError` for an unknown rung, unsafe settings, a ball that starts inside the bat.
    """
    if rung is not None and rung not in RUNGS:
        raise InputError("motion", "rung", rung, f"allowed: {', '.join(RUNGS)}")
    gap = float(nearness(scene, scene.start).gap.min(initial=np.inf))
    if gap <= 0:
        allowed = "allowed: above 0, the ball starts in the open"
        raise InputError("motion", "gap to the bat [m]", gap, allowed)
    if rung == pymunk_scene.PYMUNK:
        return pymunk_scene.play_pymunk(scene, settings)
    cheap = closed_form.play_closed_form(scene)
    beyond = np.flatnonzero(cheap.refused != "")
    if rung or not len(beyond):
        return cheap
    dear = pymunk_scene.play_pymunk(scene.part(beyond), settings)
    rungs, refused = cheap.rung.copy(), cheap.refused.astype(np.object_)
    rungs[beyond], refused[beyond] = dear.rung, dear.refused
    pieces = Pieces.joined([cheap.pieces, dear.pieces._replace(shot=beyond[dear.pieces.shot])])
    return PlayedShots(rung=rungs, refused=refused.astype(np.str_), pieces=pieces)
