"""What moves around a collision, and what came of it: arrays over n shots.

Axes: x along the line of fire, z along the resting bat from its tip, y up. At angle 0 the bat's
axis lies on x = 0, its tip at z = 0. Angle and rate are positive as the bat recoils, so a bat
swung toward the ball has a negative rate. The bat turns about a vertical axis; its weight does
nothing. The barrel is a cylinder where it is struck: its taper moves the surface, no normal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from virtual_lab.catalog.specs import BallSpec, Profile
from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.scene import CollisionModel, Scenes

__all__ = [
    "Balls",
    "Barrel",
    "Bat",
    "Efficiency",
    "Obstacle",
    "Scene",
    "State",
    "Stops",
    "efficiency_of",
]

Array = NDArray[np.float64]
Efficiency = Callable[[Array, Array, Array, Array], Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Where ball and bat are and how they move, each (n,): SI, axes as in the module."""

    x: Array
    y: Array
    z: Array
    vx: Array
    vy: Array
    vz: Array
    angle: Array
    rate: Array

    @classmethod
    def of(cls, **given: ArrayLike) -> Self:
        """Broadcast numbers and arrays to (n,)."""
        names = [field.name for field in fields(cls)]
        arrays = np.broadcast_arrays(*(np.atleast_1d(given[name]) for name in names))
        return cls(**{n: np.array(a, dtype=float) for n, a in zip(names, arrays, strict=True)})

    def __len__(self) -> int:
        return len(self.x)

    def part(self, chosen: Any) -> Self:
        """Return some of the shots."""
        return replace(self, **{f.name: getattr(self, f.name)[chosen] for f in fields(self)})

    def with_part(self, chosen: Any, other: State) -> Self:
        """Return all shots, the chosen ones as `other` has them."""
        arrays = {f.name: getattr(self, f.name).copy() for f in fields(self)}
        for name, array in arrays.items():
            array[chosen] = getattr(other, name)
        return replace(self, **arrays)


@dataclass(frozen=True, slots=True, kw_only=True)
class Balls:
    """Of each shot its ball, (n,): mass [kg], e0, drag κ [1/m]; one radius [m]."""

    mass: Array
    restitution: Array
    drag: Array
    radius: float

    def part(self, chosen: Any) -> Self:
        """Return some of the shots."""
        names = ("mass", "restitution", "drag")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


@dataclass(frozen=True)
class Barrel:
    """Outline of a bat: its radius over the place from the tip."""

    profile: Profile

    @cached_property
    def _radius(self) -> PchipInterpolator:
        half = np.array(self.profile.outer_diameter) / 2
        return PchipInterpolator(np.array(self.profile.z), half)

    @cached_property
    def _slope(self) -> Any:
        return self._radius.derivative()

    @property
    def length(self) -> float:
        return self.profile.z[-1]

    @cached_property
    def widest(self) -> float:
        """Greatest radius [m]."""
        return max(self.profile.outer_diameter) / 2

    @cached_property
    def steepest(self) -> float:
        """Greatest slope of the radius, a bound: a cubic of Fritsch and Carlson keeps to 3."""
        z, d = np.array(self.profile.z), np.array(self.profile.outer_diameter)
        return float(1.5 * np.abs(np.diff(d) / np.diff(z)).max())

    def radius(self, place: Array) -> Array:
        """Return the radius [m]; beyond the ends, that of the end."""
        return np.asarray(self._radius(np.clip(place, 0.0, self.length)))

    def slope(self, place: Array) -> Array:
        """Return the slope of the radius; beyond the ends, none."""
        on = (place >= 0) & (place <= self.length)
        return np.where(on, self._slope(np.clip(place, 0.0, self.length)), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bat:
    """A bat on its axis, and the torques of bearing and air: c, c ω and c ω²."""

    barrel: Barrel
    axis: float  # from the tip [m]
    inertia: float  # about the axis [kg m²]
    constant_torque: float = 0.0  # [N m]
    viscous_torque: float = 0.0  # [N m s]
    air_torque: float = 0.0  # [N m s²]

    @property
    def friction(self) -> dict[str, float]:
        """Torques over the moment of inertia, as `physics.coasting` takes them."""
        return {
            "constant": self.constant_torque / self.inertia,
            "linear": self.viscous_torque / self.inertia,
            "quadratic": self.air_torque / self.inertia,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Stops:
    """Angles [rad] the bat cannot pass, and the share of its rate it keeps there."""

    low: float
    high: float
    restitution: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """What stands in the hall: upright, round-edged, between two points of the plan.

    A post has both points in one. A ball strikes it if, where their outlines meet in the plan,
    its own outline reaches between `low` and `high`; it rebounds in the plan, as if smooth. What
    stops the bat are `Stops`: it swings past obstacles.
    """

    kind: str  # "frame" or "wall"
    x: tuple[float, float]
    z: tuple[float, float]
    radius: float
    restitution: float
    low: float = -np.inf
    high: float = np.inf

    def meets(self, height: ArrayLike, ball_radius: float) -> NDArray[np.bool_]:
        """Return whether balls at a `height` [m] reach between the edges."""
        y = np.asarray(height)
        return np.asarray((y > self.low - ball_radius) & (y < self.high + ball_radius))


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Shots to be played, all from time 0 to `duration` [s] at one bat.

    `efficiency` gives e_A for places [m], normal relative speeds [m/s], ball masses and e0 at
    first contacts and later ones alike; the contact takes no time here.

    Raises
    ------
    InputError
        A number outside its range, or a start inside the bat or beyond a stop.
    """

    start: State
    balls: Balls
    bat: Bat
    efficiency: Efficiency
    duration: float
    gravity: float = 0.0
    stops: Stops | None = None
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        for part in (self.start, self.balls):
            for field in fields(part):
                value = np.atleast_1d(getattr(part, field.name))
                _require(field.name, value, np.isfinite(value), "finite numbers")
                if field.name != "radius" and len(value) != len(self.start):
                    raise InputError("motion", field.name, len(value), "allowed: one a shot")
        e0, low = self.balls.restitution, self.balls.drag >= 0
        _require("mass", self.balls.mass, self.balls.mass > 0, "above 0")
        _require("restitution", e0, (e0 > 0) & (e0 <= 1), "above 0, to 1")
        _require("drag", self.balls.drag, low, "0 and up")
        for name, number in (
            ("radius", self.balls.radius),
            ("inertia", self.bat.inertia),
            ("duration", self.duration),
        ):
            _require(name, number, number > 0 and np.isfinite(number), "above 0, finite")
        length = self.bat.barrel.length
        _require("axis", self.bat.axis, 0 < self.bat.axis <= length, f"on the bat, to {length:g}")
        for name, number in self.bat.friction.items():
            _require(f"{name} torque", number, number >= 0, "0 and up")
        self._check_surroundings()

    def __len__(self) -> int:
        return len(self.start)

    def part(self, chosen: Any) -> Self:
        """Return some of the shots."""
        return replace(self, start=self.start.part(chosen), balls=self.balls.part(chosen))

    def _check_surroundings(self) -> None:
        for obstacle in self.obstacles:
            kind, e = obstacle.kind, obstacle.restitution
            if kind not in ("frame", "wall"):
                raise InputError("motion", "obstacle kind", kind, "allowed: frame, wall")
            _require("obstacle radius", obstacle.radius, obstacle.radius > 0, "above 0")
            _require("obstacle restitution", e, 0 <= e <= 1, "0 to 1")
        if self.stops:
            low, high, angle = self.stops.low, self.stops.high, self.start.angle
            _require("stops", low, low < high, f"low below high, {high:g}")
            _require("angle", angle, (low <= angle) & (angle <= high), f"{low:g} to {high:g}")
            e = self.stops.restitution
            _require("stop restitution", e, 0 <= e <= 1, "0 to 1")


def efficiency_of(model: CollisionModel, ball: BallSpec) -> Efficiency:
    """Return the e_A of a rung of the collision ladder, the ball's law as specified."""

    def efficiency(place: Array, speed: Array, mass: Array, restitution: Array) -> Array:
        scenes = Scenes.of(
            impact_position=place,
            relative_speed=speed,
            ball_mass=mass,
            ball_restitution=restitution,
            stiffness=ball.stiffness,
            exponent=ball.exponent,
        )
        return model.collide(scenes).collision_efficiency

    return efficiency


def _require(key: str, value: ArrayLike, good: ArrayLike, allowed: str) -> None:
    bad = np.atleast_1d(value)[~np.atleast_1d(good)]
    if len(bad):
        raise InputError("motion", key, float(bad[0]), f"allowed: {allowed}")
