"""Simulation with pymunk alone, including the collision, for comparison with our motion models.

The bodies have their real centers of mass, elasticities represent the restitution, and any step and
number of iterations are accepted. The bat is rigid with one radius, and there is no air and no
friction, so that pymunk could be exact. The reference is the frictionless contact of rigid bodies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import cos, inf, sin
from typing import Any, Literal

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec, Profile
from virtual_lab.simulation.motion.closed_form import play_closed_form
from virtual_lab.simulation.motion.played import Target
from virtual_lab.simulation.motion.scene import PivotedBat, ShotScene, ShotState
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.units import INCH, Array

# shape of the bat: a straight side or a semicircular tip in the top view, or the section of the
# barrel as a disk that has the effective mass of the bat 6 in from its tip
Shape = Literal["side", "round tip", "section"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rod:
    """A rigid bat of one radius on a pivot, and a ball, in SI units."""

    length: float
    radius: float
    axis: float  # distance of the pivot from the tip
    mass: float
    z_cm: float
    inertia: float  # moment of inertia about the pivot
    ball_mass: float
    ball_radius: float
    restitution: float

    @property
    def inertia_cm(self) -> float:
        return self.inertia - self.mass * (self.axis - self.z_cm) ** 2

    @property
    def contact_distance(self) -> float:
        """Distance between the center of the ball and the axis of the bat at contact [m]."""
        return self.radius + self.ball_radius

    def recoil(self, lever: Any) -> Any:
        """Return the recoil factor r for an impact at the distance `lever` [m] from the pivot."""
        return self.ball_mass * lever**2 / self.inertia

    def efficiency(self, place: Array, *_: Any) -> Array:
        """Return e_A for e = e0 at `place` [m from the tip]; `ShotScene` passes more arguments."""
        r = self.recoil(self.axis - place)
        return np.asarray((self.restitution - r) / (1 + r))


@cache
def rod() -> Rod:
    """Return a bat of constant radius with the mass and inertia of R161, and a ball, in SI units.

    The ball is baseball-2003 with an e0 of 0.5. The pivot is 6 in from the knob.
    """
    beam = beam_of(catalog.load_bat("r161").spec.body)
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    axis = beam.length - 6 * INCH
    return Rod(
        length=beam.length,
        radius=0.0318,
        axis=axis,
        mass=beam.mass,
        z_cm=beam.z_cm,
        inertia=beam.inertia(axis),
        ball_mass=ball.mass,
        ball_radius=ball.radius,
        restitution=0.5,
    )


def rod_scene(
    start: dict[str, float],
    speed: float,
    step: float,
    shots: int,
    *,
    ahead: float = 0.12,
    duration: float | None = None,
) -> ShotScene:
    """Return shots at the bat of `rod`. Their contact times are spread evenly over one time step.

    Parameters
    ----------
    start
        Initial values of the state variables [SI], keyed by name, except `x`, which is computed.
        `vx` is `speed` by default, and all other variables are 0 by default.
    speed
        Speed of the ball [m/s].
    step
        Time step over which the contact times are spread [s].
    shots
        Number of shots.
    ahead
        Smallest distance of a ball from the axis of the bat at the start [m].
    duration
        Duration of each shot [s]. By default all shots end 5 ms after the last ball would reach the
        axis of the bat.
    """
    bat, many = rod(), np.ones(shots)
    distance = ahead + speed * step * (np.arange(shots) + 0.5) / shots
    return ShotScene(
        start=ShotState.of(**({"vx": speed} | start | {"x": -distance})),
        ball_mass=bat.ball_mass * many,
        ball_drag=0 * many,
        ball_radius=bat.ball_radius,
        bat=PivotedBat(
            Profile(z=(0.0, bat.length), outer_diameter=(2 * bat.radius, 2 * bat.radius)),
            bat.axis,
            bat.inertia,
        ),
        efficiency=bat.efficiency,
        duration=duration or float(distance.max()) / speed + 5e-3,
    )


def naive_errors(
    scene: ShotScene,
    step: float,
    *,
    iterations: int = 10,
    slop: float = 1e-5,
    shape: Shape = "side",
) -> Array:
    """Return the error of the ball's velocity after contact, computed with pymunk alone, (shot,).

    The error [m/s] is the magnitude of the difference from the exact velocity, in the plane of the
    simulation.

    Parameters
    ----------
    scene
        Shots at a bat. The bat must be the one that the function `rod` returns.
    step
        Time step [s].
    iterations
        Number of iterations of pymunk.
    slop
        Overlap of two bodies that pymunk allows [m].
    shape
        Shape of the bat in the plane of the simulation: a straight side, a semicircular tip, or the
        section of the barrel.
    """
    bat, errors = rod(), np.empty(scene.shots)
    thrown = np.array(play_closed_form(scene).first(Target.BAT).state[3:6]).T
    for shot in range(scene.shots):
        start = scene.start.part(shot)
        plane = [0, 1] if shape == "section" else [0, 2]
        true = thrown[shot, plane]
        if shape == "round tip":
            true = _off_round_tip(bat, float(start.z), float(start.vx))
        space = _space(iterations, slop)
        _stand(space, bat, shape, float(start.angle), float(start.rate))
        velocity = _hit(space, bat, np.array(start[:3])[plane], np.array(start[3:6])[plane], step)
        errors[shot] = np.linalg.norm(velocity - true)
    return errors


def missed_share(bat: Rod, speed: float, step: float, shots: int) -> float:
    """Return the share of shots in which the ball passes through the bat without a contact, 0 to 1.

    Every ball should rebound. A miss is an error of pymunk with the time step `step` [s]. The balls
    fly with `speed` [m/s] toward a point 6 in from the tip. Each shot has the contact at another
    time within a time step. These times are evenly spaced.
    """
    passed = 0
    for shot in range(shots):
        space = _space()
        _stand(space, bat)
        start = np.array([-0.2 - speed * step * (shot + 0.5) / shots, 6 * INCH])
        passed += bool(_hit(space, bat, start, np.array([speed, 0.0]), step)[0] >= 0)
    return passed / shots


def energy_loss_share(bat: Rod, rate: float, step: float) -> float:
    """Return the share of its energy that a rotating bat loses in one second in pymunk.

    The bat turns freely about a `PivotJoint`. `rate` is its angular rate [rad/s] and `step` the
    time step [s]. The exact share is 0. A negative result means that the bat gains energy.
    """
    space = _space()
    body = _stand(space, bat, rate=rate)
    before = body.kinetic_energy
    for _ in range(round(1.0 / step)):
        space.step(step)
    return float(1 - body.kinetic_energy / before)


def _space(iterations: int = 10, slop: float = 1e-5) -> Any:
    import pymunk

    space = pymunk.Space()
    space.iterations, space.collision_slop = iterations, slop  # pymunk's default slop is 0.1 m
    return space


def _stand(
    space: Any, bat: Rod, shape: Shape = "side", angle: float = 0.0, rate: float = 0.0
) -> Any:
    """Add the bat to a space. Return its body."""
    import pymunk

    if shape == "section":
        body = pymunk.Body(bat.ball_mass / bat.recoil(bat.axis - 6 * INCH), inf)
        outline: Any = pymunk.Circle(body, bat.radius)
    else:
        body, arm = pymunk.Body(bat.mass, bat.inertia_cm), bat.axis - bat.z_cm
        body.position = arm * sin(angle), bat.axis - arm * cos(angle)
        body.angle, body.angular_velocity = angle, rate
        body.velocity = rate * arm * cos(angle), rate * arm * sin(angle)
        space.add(body, pymunk.PivotJoint(space.static_body, body, (0.0, bat.axis)))
        low, high, half = -bat.z_cm, bat.length - bat.z_cm, bat.radius
        if shape == "side":
            corners = [(-half, low), (half, low), (half, high), (-half, high)]
            outline = pymunk.Poly(body, corners)
        else:
            outline = pymunk.Segment(body, (0, low + half), (0, high), half)
    outline.elasticity = bat.restitution
    space.add(outline, *([body] if shape == "section" else []))
    return body


def _hit(space: Any, bat: Rod, start: Array, velocity: Array, step: float) -> Array:
    """Return the velocity of the ball two steps after the contact, or behind the bat [m/s]."""
    import pymunk

    ball = pymunk.Body(bat.ball_mass, inf)
    ball.position, ball.velocity = tuple(start.tolist()), tuple(velocity.tolist())
    circle = pymunk.Circle(ball, bat.ball_radius)
    circle.elasticity = 1.0
    space.add(ball, circle)
    initial_velocity = ball.velocity
    while ball.velocity == initial_velocity and ball.position.x <= 0.1:
        space.step(step)
    for _ in range(2):  # steps in which the contact may continue
        space.step(step)
    return np.array(ball.velocity)


def _off_round_tip(bat: Rod, place: float, speed: float) -> Array:
    """Return the velocity (x, z) of the ball after a bat at rest with a semicircular tip [m/s].

    Within one radius from the tip the ball hits the semicircle, elsewhere the straight side.
    """
    aside = np.arcsin(min(place - bat.radius, 0.0) / bat.contact_distance)
    normal = np.array([-np.cos(aside), np.sin(aside)])
    lever = (bat.axis - max(place, bat.radius)) * np.cos(aside)
    gain = (1 + bat.restitution) / (1 + bat.recoil(lever)) * speed * np.cos(aside)
    return np.asarray(np.array([speed, 0.0]) + gain * normal)
