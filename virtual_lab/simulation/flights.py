"""The rungs of the motion at a rig: flights in closed form, or played shot by shot in pymunk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.relations.flight import time_before
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.simulation.motion import play
from virtual_lab.simulation.motion.scene import Balls, Barrel, Bat, Scene, State
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.rig import Motion, ShotPlan, Specimen
from virtual_lab.simulation.truth import TrueBalls

__all__ = ["at_rest"]

Array = NDArray[np.float64]
FAR = 1.0  # m before the contact, where a scene begins
AFTER = 1e-3  # s, that a scene goes on after the contact: the ball has parted


def at_rest(
    passage: Passage,
    order: ShotPlan,
    specimen: Specimen,
    pivot_from_knob: float,
    place: Array,
    across: Array,
    efficiency: Array,
) -> Passage:
    """Return the flights at a pivoted bat at rest by the order's rung of the motion.

    By pymunk each shot is played from `FAR` up to its rebound, and what it comes to replaces
    the speeds, the slope of the way back and the place of contact. The blow is that of a level
    ball, as it is in closed form.

    Parameters
    ----------
    passage : Passage
        In closed form.
    pivot_from_knob : float
        [m].
    place, across, efficiency : (shot,) array
        Of the ball's centre from the tip, and above the bat's axis [m]; e_A.

    Raises
    ------
    InputError
        A shot that pymunk cannot play.
    """
    if order.motion is Motion.CLOSED_FORM:
        return passage
    body = specimen.bat.body
    barrel, axis = Barrel(body.profile), body.length - pivot_from_knob
    touching = -np.sqrt((barrel.radius(place) + passage.radius) ** 2 - across**2)
    span = time_before(FAR, passage.speed_in, passage.drag)
    start = State.of(
        x=touching - FAR,
        y=across - passage.gravity / 2 * span**2,
        z=place,
        vx=passage.speed_in * np.exp(passage.drag * FAR),
        vy=passage.gravity * span,
        vz=0.0,
        angle=0.0,
        rate=0.0,
    )
    balls = _balls(specimen.balls, order, passage)
    bat = Bat(barrel=barrel, axis=axis, inertia=beam_of(body).inertia(axis))
    found = np.empty((4, len(start)))
    for shot in range(len(start)):
        found[:, shot] = _played(
            Scene(
                start=start.part([shot]),
                balls=balls.part([shot]),
                bat=bat,
                efficiency=lambda *_, given=efficiency[shot]: np.array([given]),
                duration=float(span[shot]) + AFTER,
                gravity=passage.gravity,
            )
        )
    met, speed_in, speed_out, rise = found
    return replace(
        passage,
        speed_in=speed_in,
        speed_out=speed_out,
        slope_out=rise / np.where(speed_out == 0, np.nan, speed_out),
        plane=touching - met,
    )


def _balls(balls: TrueBalls, order: ShotPlan, passage: Passage) -> Balls:
    return Balls(
        mass=balls.mass[order.ball],
        restitution=balls.restitution[order.ball],
        drag=np.broadcast_to(passage.drag, order.ball.shape),
        radius=passage.radius,
    )


def _played(scene: Scene) -> tuple[float, float, float, float]:
    """Return of one shot the ball's x at contact, speeds in, back and up [m, m/s]."""
    outcome = play(scene, rung=Motion.PYMUNK.value)
    why = str(outcome.refused[0]) or ("" if np.isfinite(outcome.time[0]) else "the ball misses")
    if why:
        raise InputError("", "motion", Motion.PYMUNK.value, f"allowed: closed-form; {why}")
    # at a contact the track has the state after it
    before = outcome.track.at(scene, np.nextafter(outcome.time, 0.0))
    back, up = -outcome.ball_velocity[0, 0], outcome.ball_velocity[0, 1]
    return float(before.x[0, 0]), float(before.vx[0, 0]), float(back), float(up)
