"""Pymunk left to itself: what it makes of hits when it does the collision too.

Bodies have their own centre of mass, elasticities carry the restitution, and whatever step and
iterations are asked for are taken. Nothing is refused here: this is what
`virtual_lab.simulation.motion` is held against. The truth beside it is smooth contact of rigid
bodies, by hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Hit", "Rod", "energy_lost", "hit_of", "missed", "off_round_end", "round_hit"]

Array = NDArray[np.float64]
AFTER = 2  # steps after the first kick, in which a contact may still work
SLOP = 1e-5  # m, as small as pymunk bears well; its own is 0.1 m
BEYOND = 0.1  # m, past the bat, where a ball that was not thrown back is given up


@dataclass(frozen=True, slots=True, kw_only=True)
class Rod:
    """A rigid bat of one radius on an axis, and the ball that meets it: SI."""

    length: float
    radius: float
    axis: float  # from the tip
    mass: float
    z_cm: float
    inertia: float  # about the axis
    ball_mass: float
    ball_radius: float
    restitution: float

    @property
    def inertia_cm(self) -> float:
        return self.inertia - self.mass * (self.axis - self.z_cm) ** 2

    def recoil(self, lever: float) -> float:
        """Return r for a blow at a lever [m]."""
        return self.ball_mass * lever**2 / self.inertia

    def efficiency(self, place: Array, *_: Any) -> Array:
        """Return e_A with e = e0, as a scene of motion asks for it."""
        r = self.ball_mass * (self.axis - place) ** 2 / self.inertia
        return np.asarray((self.restitution - r) / (1 + r))


@dataclass(frozen=True, slots=True, kw_only=True)
class Hit:
    """How a ball and bat part: velocity in the plane [m/s], rate [rad/s]."""

    velocity: Array
    rate: float


def hit_of(
    rod: Rod,
    start: tuple[float, float],
    velocity: tuple[float, float],
    *,
    step: float,
    iterations: int = 10,
    slop: float = SLOP,
    angle: float = 0.0,
    rate: float = 0.0,
    round_end: bool = False,
) -> Hit:
    """Return how pymunk parts a ball and a pivoted bat, seen from above (x and z)."""
    import pymunk

    space = _space(iterations, slop)
    bat = pymunk.Body(rod.mass, rod.inertia_cm)
    arm = rod.axis - rod.z_cm
    bat.position = arm * np.sin(angle), rod.axis - arm * np.cos(angle)
    bat.angle, bat.angular_velocity = angle, rate
    bat.velocity = rate * arm * np.cos(angle), rate * arm * np.sin(angle)
    low, high, half = -rod.z_cm, rod.length - rod.z_cm, rod.radius
    if round_end:
        shape: Any = pymunk.Segment(bat, (0, low + half), (0, high), half)
    else:
        shape = pymunk.Poly(bat, [(-half, low), (half, low), (half, high), (-half, high)])
    shape.elasticity = rod.restitution
    joint = pymunk.PivotJoint(space.static_body, bat, (0.0, rod.axis))
    space.add(bat, joint, shape)
    ball = _ball(space, rod, start, velocity)
    _run(space, ball, step, lambda: ball.position.x > BEYOND)
    return Hit(velocity=np.array(ball.velocity), rate=float(bat.angular_velocity))


def round_hit(
    rod: Rod, start: tuple[float, float], speed: float, *, step: float, iterations: int = 10
) -> Hit:
    """Return how pymunk parts a ball and a round barrel, seen along the bat (x and y).

    The barrel stands for the mass that the whole bat opposes 6 in from its tip.
    """
    import pymunk

    space = _space(iterations, SLOP)
    barrel = pymunk.Body(rod.ball_mass / rod.recoil(rod.axis - 0.1524), float("inf"))
    shape = pymunk.Circle(barrel, rod.radius)
    shape.elasticity = rod.restitution
    space.add(barrel, shape)
    ball = _ball(space, rod, start, (speed, 0.0))
    _run(space, ball, step, lambda: ball.position.x > BEYOND)
    return Hit(velocity=np.array(ball.velocity), rate=0.0)


def missed(rod: Rod, speed: float, step: float, shots: int) -> float:
    """Return the share of `shots`, evenly spread over a step, that are not thrown back.

    The ball comes squarely at a place where it would be, so it jumped what it had to strike.
    """
    passed = 0
    for shot in range(shots):
        start = -0.2 - speed * step * (shot + 0.5) / shots
        hit = hit_of(rod, (start, 0.1524), (speed, 0.0), step=step)
        passed += bool(hit.velocity[0] >= 0)
    return passed / shots


def off_round_end(rod: Rod, place: float, speed: float) -> Array:
    """Return the velocity (x, z) off a resting bat whose tip is a half circle, by hand [m/s].

    Up to one radius from the tip the ball meets that circle, beyond it the straight side.
    """
    aside = np.arcsin(min(place - rod.radius, 0.0) / (rod.radius + rod.ball_radius))
    normal = np.array([-np.cos(aside), np.sin(aside)])
    lever = (rod.axis - max(place, rod.radius)) * np.cos(aside)
    gain = (1 + rod.restitution) / (1 + rod.recoil(lever)) * speed * np.cos(aside)
    return np.asarray(np.array([speed, 0.0]) + gain * normal)


def energy_lost(rod: Rod, rate: float, step: float, duration: float = 1.0) -> float:
    """Return the share of its energy a bat loses that turns freely on a `PivotJoint`."""
    import pymunk

    space = _space(10, SLOP)
    bat = pymunk.Body(rod.mass, rod.inertia_cm)
    bat.position, bat.angular_velocity = (0.0, rod.z_cm), rate
    bat.velocity = rate * (rod.axis - rod.z_cm), 0.0
    space.add(bat, pymunk.PivotJoint(space.static_body, bat, (0.0, rod.axis)))

    def energy() -> float:
        square = float(bat.velocity.dot(bat.velocity))
        return rod.mass / 2 * square + rod.inertia_cm / 2 * float(bat.angular_velocity) ** 2

    before = energy()
    for _ in range(round(duration / step)):
        space.step(step)
    return 1 - energy() / before


def _space(iterations: int, slop: float) -> Any:
    import pymunk

    space = pymunk.Space()
    space.iterations, space.collision_slop = iterations, slop
    return space


def _ball(space: Any, rod: Rod, start: tuple[float, float], velocity: tuple[float, float]) -> Any:
    import pymunk

    ball = pymunk.Body(rod.ball_mass, float("inf"))
    ball.position, ball.velocity = start, velocity
    shape = pymunk.Circle(ball, rod.ball_radius)
    shape.elasticity = 1.0
    space.add(ball, shape)
    return ball


def _run(space: Any, ball: Any, step: float, past: Callable[[], bool]) -> None:
    """Step until the ball has been kicked or is past the bat."""
    came = ball.velocity
    while ball.velocity == came and not past():
        space.step(step)
    for _ in range(AFTER):
        space.step(step)
