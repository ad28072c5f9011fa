"""Which rung plays a shot: the cheapest that can, shot by shot, and why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.simulation.motion import closed_form, pymunk_scene
from virtual_lab.simulation.motion.outcome import Outcome
from virtual_lab.simulation.motion.scene import Scene
from virtual_lab.simulation.motion.settings import Settings
from virtual_lab.simulation.motion.touch import nearness, obstacle_gap

__all__ = ["RUNGS", "play"]

RUNGS = (closed_form.RUNG, pymunk_scene.RUNG)


def play(scene: Scene, rung: str | None = None, *, settings: Settings | None = None) -> Outcome:
    """Return what the shots of a scene come to.

    Parameters
    ----------
    scene : Scene
    rung : str, optional
        One of `RUNGS`, for all shots. Without it each shot has the closed form, or pymunk
        where that refuses it.
    settings : Settings, optional
        Of pymunk; without them its own, with a step short enough for the scene.

    Returns
    -------
    Outcome
        `rung` and `reason` tell what was taken and why, `refused` what no rung taken can do.

    Raises
    ------
    InputError
        An unknown rung, unsafe settings, a ball that starts inside something.
    """
    if rung is not None and rung not in RUNGS:
        raise InputError("motion", "rung", rung, f"allowed: {', '.join(RUNGS)}")
    _check_start(scene)
    if rung == pymunk_scene.RUNG:
        return pymunk_scene.play_pymunk(scene, settings)
    outcome = closed_form.play_closed_form(scene)
    beyond = np.flatnonzero(outcome.refused != "")
    if rung or not len(beyond):
        return outcome
    carried = pymunk_scene.play_pymunk(scene.part(beyond), settings)
    reasons = np.array([f"no closed form: {why}" for why in outcome.refused[beyond]])
    return outcome.merged(scene, beyond, replace(carried, reason=reasons))


def _check_start(scene: Scene) -> None:
    gaps = {"bat": nearness(scene, scene.start).gap}
    for obstacle in scene.obstacles:
        gap = obstacle_gap(obstacle, scene, scene.start)
        clear = ~obstacle.meets(scene.start.y, scene.balls.radius)
        gaps[obstacle.kind] = np.where(clear, np.inf, gap)
    for name, gap in gaps.items():
        if gap.min() <= 0:
            allowed = "allowed: above 0, the ball starts in the open"
            raise InputError("motion", f"gap to the {name} [m]", float(gap.min()), allowed)
