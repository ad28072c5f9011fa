"""Shots one by one: a pymunk space carries ball and bat, one shot at a time.

Each step is given the mean velocity of the exact motion, so that its length costs no accuracy: it
is that in which nothing can pass through anything, by the speeds as they then are.
Ball and bat never collide in pymunk: the step that would bring them together ends at their touch,
and the collision model's e_A and the angular momentum say how they part. The bat turns back at its
stop. Posts and bars are pymunk's own shapes: a swept circle shows when the ball comes to one, the
step ends there, and pymunk throws the ball back.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, sin
from typing import Any, NamedTuple

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.relations.flight import time_after
from virtual_lab.simulation.motion.played import Pieces, PlayedShots, Target
from virtual_lab.simulation.motion.scene import GateFrame, ShotScene, ShotState
from virtual_lab.simulation.motion.touch import (
    Obstacle,
    first_touch,
    moved,
    nearness,
    obstacles,
    parted,
    time_to_stop,
)
from virtual_lab.units import Array

ONE = np.zeros(1, dtype=np.int_)
SHARE = 0.9  # of the longest safe step, what one by the present speed takes
OVERLAP = 1e-9  # m, of a ball and a post or bar: pymunk sees no contact before they overlap


@dataclass(frozen=True, slots=True, kw_only=True)
class PymunkSettings:
    """Of the pymunk space, SI: its own defaults are for pixels."""

    step: float | None = None  # [s]; None: by the present speed. A shorter one is no better
    iterations: int = 10
    slop: float = 1e-6  # overlap that is left alone [m]

    def check(self, scene: ShotScene) -> None:
        """Raise `InputError` where a setting is unsafe for a scene."""
        most, step = longest_step(scene, scene.start), self.step
        for key, value, good, allowed in (
            (
                "step",
                step,
                step is None or 1e-7 <= step < most,
                f"from 1e-07 s, below {most:.3g} s",
            ),
            ("iterations", self.iterations, 10 <= self.iterations <= 1000, "10 to 1000"),
            ("slop", self.slop, 0 <= self.slop <= 1e-4, "0 to 0.0001 m"),
        ):
            if not good:
                raise InputError("motion settings", key, value, f"allowed: {allowed}")


USUAL = PymunkSettings()


def longest_step(scene: ShotScene, state: ShotState) -> float:
    """Time [s] in which no ball and what it should strike close by their radii.

    In a longer step the ball could pass through. Infinite where nothing moves.

    Parameters
    ----------
    state
        (n,): the shots of the scene at one moment. Between contacts they only slow down.
    """
    bat, ball = scene.bat, np.hypot(state.vx, state.vz)
    # where the bat is as the ball comes to it, within a step
    lever = np.hypot(state.x, state.z - bat.axis) + scene.ball_radius + bat.widest
    closing = ball + np.abs(state.rate) * np.minimum(lever, bat.axis)
    solids = [frame.spec.radius for frame in scene.frames]
    solids += [scene.stop.radius] if scene.stop else []
    with np.errstate(divide="ignore"):
        steps = (scene.ball_radius + bat.thinnest) / closing
        if solids:
            steps = np.minimum(steps, (scene.ball_radius + min(solids)) / ball)
    return float(steps.min())


def play_pymunk(scene: ShotScene, settings: PymunkSettings = USUAL) -> PlayedShots:
    """Return the results of the shots.

    `InputError` for unsafe settings, a ball that starts inside the bat.
    """
    gap = float(nearness(scene, scene.start).gap.min(initial=inf))
    if gap <= 0:
        allowed = "allowed: above 0, the ball starts in the open"
        raise InputError("motion", "gap to the bat [m]", gap, allowed)
    settings.check(scene)
    return carry(scene, settings)


def carry(scene: ShotScene, settings: PymunkSettings) -> PlayedShots:
    """Return the results of the shots, by settings as they are; those refused have no pieces."""
    shots = [_Shot(scene.alone(shot), settings) for shot in range(scene.shots)]
    pieces = [
        piece._replace(shot=np.array([number]))
        for number, shot in enumerate(shots)
        for piece in shot.play()
    ]
    nothing = Pieces.of(np.zeros(0), np.zeros(0), Target.START, ShotState.of().part(slice(0, 0)))
    return PlayedShots(
        refused=np.array([shot.refused for shot in shots], dtype=np.str_),
        pieces=Pieces.joined([nothing, *pieces]),
    )


class _Solid(NamedTuple):
    """What stands in the hall: its shape, its name, and the frame whose bars it stands for."""

    shape: Any
    kind: Target
    frame: GateFrame | None = None


class _Shot:
    """One shot on its way through a pymunk space, whose x and y are x and z of the scene."""

    def __init__(self, scene: ShotScene, settings: PymunkSettings) -> None:
        import pymunk

        self.scene, self.settings = scene, settings
        self.state, self.now, self.refused = scene.start, 0.0, ""
        self.struck: list[Target] = []
        self.touching = False
        self.end = float(scene.duration)
        self.space = pymunk.Space()
        self.space.iterations, self.space.collision_slop = settings.iterations, settings.slop
        self.ball = pymunk.Body(float(scene.ball_mass[0]), inf)
        circle = pymunk.Circle(self.ball, float(scene.ball_radius))
        circle.elasticity = 1.0  # pymunk multiplies: the solid's own stands
        circle.filter = pymunk.ShapeFilter(categories=1)  # it alone meets what stands
        # centre and moment are those of its axis: the joint does no work, whatever the step
        self.bat = pymunk.Body(1.0, float(scene.bat.inertia))
        self.bat.position = (0.0, float(scene.bat.axis))
        joint = pymunk.PivotJoint(self.space.static_body, self.bat, self.bat.position)
        self.space.add(self.ball, circle, self.bat, joint)
        self.solids = self._stand(self.space.static_body)
        self.ahead: _Solid | None = None  # what this step ends at
        self.space.on_collision(pre_solve=self._pass_others)

    def _stand(self, hall: Any) -> list[_Solid]:
        import pymunk

        found = []
        if stop := self.scene.stop:
            post = stop.post(self.scene.bat)
            found.append(
                (_Solid(pymunk.Circle(hall, stop.radius, post), Target.STOP), stop.restitution)
            )
        for frame in self.scene.frames:
            spec = frame.spec
            ends = [(float(frame.x), end) for end in frame.ends]
            bars = pymunk.Segment(hall, ends[0], ends[1], spec.radius)
            found += [
                (_Solid(pymunk.Circle(hall, spec.radius, end), Target.FRAME), spec.restitution)
                for end in ends
            ]
            found.append((_Solid(bars, Target.FRAME, frame), spec.restitution))
        for solid, restitution in found:
            solid.shape.elasticity = restitution
            solid.shape.filter = pymunk.ShapeFilter(mask=1)
            self.space.add(solid.shape)
        return [solid for solid, _ in found]

    def _pass_others(self, arbiter: Any, _space: Any, _data: Any) -> None:
        arbiter.process_collision = self.ahead is not None and self.ahead.shape in arbiter.shapes

    def play(self) -> list[Pieces]:
        """Carry the shot to the end of the record; a refused one has no pieces."""
        pieces = [Pieces.of(ONE, np.zeros(1), Target.START, self.state)]
        while self.now < self.end and not self.refused:
            step = min(self._longest(), self.end - self.now)
            touch = self._touch(step)
            stop = float(time_to_stop(self.scene, self.state)[0])
            solid = self._solid(min(step, touch, stop))
            span = min(step, touch, stop, solid)
            mean = self._carry(span)
            self.now += span
            if solid <= span:
                pieces.append(self._rebound(mean))
            elif stop <= span:
                pieces.append(self._turn_back())
            elif touch <= span:
                pieces.append(self._strike())
            if len(self.struck) > 100:
                self.refused = Obstacle.MANY
        return [] if self.refused else pieces

    def _longest(self) -> float:
        """Return how long the next step may be [s]."""
        if self.settings.step is not None:
            return self.settings.step
        return SHARE * longest_step(self.scene, self.state)

    def _piece(self, struck: Target, *hit: Array) -> Pieces:
        self.struck.append(struck)
        return Pieces.of(ONE, np.array([self.now]), struck, self.state, *hit)

    def _carry(self, span: float) -> Array:
        """Let pymunk move the bodies by their mean velocities [m/s]; return the ball's, (2,)."""
        if span == 0:
            return np.zeros(2)
        start, after = self.state, moved(self.scene, self.state, np.array([span]), ONE)
        mean = np.array([after.x[0] - start.x[0], after.z[0] - start.z[0]]) / span
        self.ball.position = float(start.x[0]), float(start.z[0])
        self.ball.velocity = float(mean[0]), float(mean[1])
        self.bat.angle, self.bat.angular_velocity = float(start.angle[0]), float(start.rate[0])
        self.space.step(span)
        x, z = self.ball.position
        self.state = after._replace(
            x=np.array([x]), z=np.array([z]), angle=np.array([self.bat.angle])
        )
        return mean

    def _touch(self, step: float) -> float:
        """Return when ball and bat touch within a step [s], inf if they do not."""
        start, bat = self.state, self.scene.bat
        x, z, angle = float(start.x[0]), float(start.z[0]) - bat.axis, float(start.angle[0])
        swept = np.hypot(start.vx[0], start.vz[0]) + abs(start.rate[0]) * np.hypot(x, z)
        if (
            abs(x * cos(angle) + z * sin(angle))
            > self.scene.ball_radius + bat.widest + 2 * swept * step
        ):
            self.touching = False
            return inf
        until = np.array([step])
        return float(first_touch(self.scene, start, until, ONE, parting=self.touching)[0])

    def _solid(self, step: float) -> float:
        """Return when the ball comes to a post or bar within a step [s], inf if it does not."""
        self.ahead = None
        if not self.solids or step == 0:
            return inf
        scene, start = self.scene, self.state
        after = moved(scene, start, np.array([step]), ONE)
        here, there = ((float(s.x[0]), float(s.z[0])) for s in (start, after))
        way = there[0] - here[0], there[1] - here[1]
        speed, first = float(np.hypot(start.vx[0], start.vz[0])), inf
        for solid in self.solids:
            hit = solid.shape.segment_query(here, there, scene.ball_radius)
            if not (hit and hit.shape) or hit.normal.dot(way) >= 0:
                continue
            # one it is already over, by more than rounding explains, it rolls over
            if solid.shape.point_query(here).distance < scene.ball_radius - 1e-6:
                continue
            flown = hit.alpha * np.hypot(*way) + OVERLAP
            time = float(time_after(flown, speed, scene.ball_drag[0]))
            height = moved(scene, start, np.array([time]), ONE).y
            cleared = solid.frame and solid.frame.clears(height, scene.ball_radius)[0]
            if time < first and not cleared:
                first, self.ahead = time, solid
        return first

    def _strike(self) -> Pieces:
        """Part ball and bat by the collision model."""
        scene, near = self.scene, nearness(self.scene, self.state)
        efficiency = scene.efficiency(near.place, near.approach, ONE)
        self.state = parted(scene, self.state, near, efficiency, ONE)
        self.refused = str(obstacles(scene, near, self.state)[0])
        self.touching = True
        again = Target.BAT in self.struck
        return self._piece(Target.BAT_AGAIN if again else Target.BAT, near.place, near.approach)

    def _turn_back(self) -> Pieces:
        assert self.scene.stop
        angle, rate = np.array([self.scene.stop.angle]), self.state.rate
        self.state = self.state._replace(angle=angle, rate=-self.scene.stop.restitution * rate)
        return self._piece(Target.STOP)

    def _rebound(self, mean: Array) -> Pieces:
        """Take the velocity pymunk gave the ball, scaled from the step's mean to its end's."""
        went = np.array(self.ball.velocity)
        if not (went - mean).any():
            raise RuntimeError(f"pymunk saw no contact with a frame at {self.now:.9g} s")
        assert self.ahead
        share = np.hypot(self.state.vx[0], self.state.vz[0]) / np.hypot(*mean)
        self.state = self.state._replace(vx=share * went[:1], vz=share * went[1:])
        return self._piece(self.ahead.kind)
