"""Motion of the shots in a pymunk space, one shot at a time.

Each step uses the mean velocity of the exact motion, so its length does not affect the accuracy.
The length is chosen so that at the current speeds no body can pass through another. Ball and bat
never collide in pymunk: a step in which they would meet ends at their touch, and the velocities
after the contact are computed from the model's e_A and the angular momentum. The bat rebounds at
its stop. Posts and bars are pymunk shapes. The time of a contact with them is found with a swept
circle, the step ends at this time, and pymunk computes the rebound of the ball.
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
    move,
    nearness,
    obstacles,
    rebound,
    time_to_stop,
)
from virtual_lab.units import Array

ONE = np.zeros(1, dtype=np.int_)
SHARE = 0.9  # length of a step at the current speeds [share of the longest safe step]
OVERLAP = 1e-9  # overlap of ball and bar at the end of a step, which pymunk needs for contact [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class PymunkSettings:
    """Settings of the pymunk space in SI units; the defaults of pymunk itself are for pixels."""

    # step [s]; None: computed from the current speed. A shorter step is not more accurate.
    step: float | None = None
    iterations: int = 10
    slop: float = 1e-6  # tolerated overlap [m]

    def check(self, scene: ShotScene) -> None:
        """Raise `InputError` if a setting is unsafe for a scene."""
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
    """Return the longest safe time step [s], the same for all shots of the scene.

    The ball can touch the bat, the end stop, and the frames of gates. In one step, its distance
    from each of these bodies decreases by at most the radius of the ball plus the radius of the
    body. The ball therefore cannot pass through a body. The step is infinite if nothing moves.
    `state` is the state of the shots, (n,).
    """
    bat, ball = scene.bat, np.hypot(state.vx, state.vz)
    # largest lever arm at which ball and bat can meet within a step
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
    """Return the motion of the shots as pieces of free motion between contacts, sorted by shot.

    A shot that cannot be computed has no pieces. The field `refused` of the result, (shot,), states
    the reason, an `Obstacle`; it is an empty string for all other shots. Raises `InputError` for
    unsafe settings, or for a ball that touches the bat at the start.
    """
    gap = float(nearness(scene, scene.start).gap.min(initial=inf))
    if gap <= 0:
        allowed = "allowed: above 0, the ball starts in the open"
        raise InputError("motion", "gap to the bat [m]", gap, allowed)
    settings.check(scene)
    return carry(scene, settings)


def carry(scene: ShotScene, settings: PymunkSettings) -> PlayedShots:
    """Return the motion of the shots as pieces of free motion between contacts, sorted by shot.

    The result is that of `play_pymunk`, but the settings and the start are not checked.
    """
    shots = [_Shot(scene.alone(shot), settings) for shot in range(scene.shots)]
    pieces = [
        piece._replace(shot=np.array([number]))
        for number, shot in enumerate(shots)
        for piece in shot.play()
    ]
    nothing = Pieces.of(np.zeros(0), np.zeros(0), Target.START, ShotState.of().part(slice(0, 0)))
    return PlayedShots(
        refused=np.array([shot.refused for shot in shots], dtype=np.str_),
        pieces=Pieces.concatenate([nothing, *pieces]),
    )


class _Solid(NamedTuple):
    """A fixed object: its pymunk shape, its kind, and its frame if it represents the bars."""

    shape: Any
    kind: Target
    frame: GateFrame | None = None


class _Shot:
    """One shot in a pymunk space. Its x and y are x and z of the scene."""

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
        circle.elasticity = 1.0  # pymunk multiplies elasticities; only the object's matters
        circle.filter = pymunk.ShapeFilter(categories=1)  # only the ball meets fixed objects
        # Center and moment of inertia refer to the pivot, so the joint does no work.
        self.bat = pymunk.Body(1.0, float(scene.bat.inertia))
        self.bat.position = (0.0, float(scene.bat.axis))
        joint = pymunk.PivotJoint(self.space.static_body, self.bat, self.bat.position)
        self.space.add(self.ball, circle, self.bat, joint)
        self.solids = self._stand(self.space.static_body)
        self.ahead: _Solid | None = None  # object at the end of the current step
        self.space.on_collision(pre_solve=self._pass_others)

    def _stand(self, hall: Any) -> list[_Solid]:
        import pymunk

        solids = []
        if stop := self.scene.stop:
            post = stop.post(self.scene.bat)
            solids.append(
                (_Solid(pymunk.Circle(hall, stop.radius, post), Target.STOP), stop.restitution)
            )
        for frame in self.scene.frames:
            spec = frame.spec
            ends = [(float(frame.x), end) for end in frame.ends]
            bars = pymunk.Segment(hall, ends[0], ends[1], spec.radius)
            solids += [
                (_Solid(pymunk.Circle(hall, spec.radius, end), Target.FRAME), spec.restitution)
                for end in ends
            ]
            solids.append((_Solid(bars, Target.FRAME, frame), spec.restitution))
        for solid, restitution in solids:
            solid.shape.elasticity = restitution
            solid.shape.filter = pymunk.ShapeFilter(mask=1)
            self.space.add(solid.shape)
        return [solid for solid, _ in solids]

    def _pass_others(self, arbiter: Any, _space: Any, _data: Any) -> None:
        arbiter.process_collision = self.ahead is not None and self.ahead.shape in arbiter.shapes

    def play(self) -> list[Pieces]:
        """Return the pieces of the shot up to the end of the record; empty if it is rejected."""
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
        """Return the largest length of the next step [s]."""
        if self.settings.step is not None:
            return self.settings.step
        return SHARE * longest_step(self.scene, self.state)

    def _piece(self, struck: Target, *hit: Array) -> Pieces:
        self.struck.append(struck)
        return Pieces.of(ONE, np.array([self.now]), struck, self.state, *hit)

    def _carry(self, span: float) -> Array:
        """Let pymunk move the bodies by their mean velocities. Return the ball's, (2,) [m/s]."""
        if span == 0:
            return np.zeros(2)
        start, after = self.state, move(self.scene, self.state, np.array([span]), ONE)
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
        """Return the time at which ball and bat touch within a step [s], inf if they do not."""
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
        """Return the time of the contact with a post or bar within a step [s], inf if none."""
        self.ahead = None
        if not self.solids or step == 0:
            return inf
        scene, start = self.scene, self.state
        after = move(scene, start, np.array([step]), ONE)
        here, there = ((float(s.x[0]), float(s.z[0])) for s in (start, after))
        path = there[0] - here[0], there[1] - here[1]
        speed, first = float(np.hypot(start.vx[0], start.vz[0])), inf
        for solid in self.solids:
            hit = solid.shape.segment_query(here, there, scene.ball_radius)
            if not (hit and hit.shape) or hit.normal.dot(path) >= 0:
                continue
            # A ball that already overlaps an object by more than rounding rolls over it.
            if solid.shape.point_query(here).distance < scene.ball_radius - 1e-6:
                continue
            distance = hit.alpha * np.hypot(*path) + OVERLAP
            time = float(time_after(distance, speed, scene.ball_drag[0]))
            height = move(scene, start, np.array([time]), ONE).y
            cleared = solid.frame and solid.frame.clears(height, scene.ball_radius)[0]
            if time < first and not cleared:
                first, self.ahead = time, solid
        return first

    def _strike(self) -> Pieces:
        """Apply the collision of ball and bat, and return the new piece."""
        scene, near = self.scene, nearness(self.scene, self.state)
        efficiency = scene.efficiency(near.place, near.approach, ONE)
        self.state = rebound(scene, self.state, near, efficiency, ONE)
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
        """Return the piece after a rebound, with pymunk's velocity scaled to the step's end."""
        velocity = np.array(self.ball.velocity)
        if not (velocity - mean).any():
            raise RuntimeError(f"pymunk saw no contact with a frame at {self.now:.9g} s")
        assert self.ahead
        share = np.hypot(self.state.vx[0], self.state.vz[0]) / np.hypot(*mean)
        self.state = self.state._replace(vx=share * velocity[:1], vz=share * velocity[1:])
        return self._piece(self.ahead.kind)
