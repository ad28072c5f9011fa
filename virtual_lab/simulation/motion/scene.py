"""Scene of the shots: a pivoted bat, one ball per shot, the stop of the bat, frames of the gates.

Axes: x along the line of fire, z along the resting bat from its tip, y up. At angle 0 the bat's
axis is at x = 0 and its tip at z = 0. Angle and rate are positive in recoil, so a bat swung toward
the ball has a negative rate. The bat rotates about a vertical axis without friction, so its weight
has no effect. At the impact position the barrel is treated as a cylinder with the radius of the
tapered barrel, so the normal of its surface is not tilted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import ArrayLike, NDArray

from virtual_lab.catalog.specs import Dimension, Profile, Spec
from virtual_lab.simulation.physics.beam import outer_diameter
from virtual_lab.units import Array

Share = Annotated[float, Ge(0), Le(1), Dimension("number")]


class ShotState(NamedTuple):
    """Positions and velocities of ball and bat, each (n,) in SI units, with the module's axes."""

    x: Array
    y: Array
    z: Array
    vx: Array
    vy: Array
    vz: Array
    angle: Array
    rate: Array

    @classmethod
    def of(cls, **values: ArrayLike) -> Self:
        """Return a state from numbers or arrays, broadcast to (n,). Omitted ones are 0."""
        columns = (np.atleast_1d(values.get(name, 0.0)) for name in cls._fields)
        return cls(*(np.array(each, dtype=float) for each in np.broadcast_arrays(*columns)))

    @classmethod
    def concatenate(cls, states: list[ShotState]) -> Self:
        """Return one state with the shots of several states, one after another."""
        return cls(*np.concatenate([np.array(state) for state in states], axis=1))

    def part(self, chosen: Any) -> Self:
        """Return the `chosen` shots."""
        return type(self)(*(each[chosen] for each in self))


@dataclass(frozen=True)
class PivotedBat:
    """A bat on a pivot at `axis` [m from the tip], with its inertia about the pivot [kg m²].

    Both are numbers for all shots, or arrays (n,).
    """

    profile: Profile
    axis: Array | float
    inertia: Array | float

    @property
    def length(self) -> float:
        return self.profile.z[-1]

    @cached_property
    def widest(self) -> float:
        """Largest radius [m]."""
        return max(self.profile.outer_diameter) / 2

    @cached_property
    def thinnest(self) -> float:
        """Smallest radius of the third at the tip, where balls strike [m]."""
        return float(np.min(self.radius(np.linspace(0.0, self.length / 3, 50))))

    @cached_property
    def steepest(self) -> float:
        """Upper bound of the slope of the radius: 3 times the secant for Fritsch-Carlson cubics."""
        z, d = np.array(self.profile.z), np.array(self.profile.outer_diameter)
        return float(1.5 * np.abs(np.diff(d) / np.diff(z)).max())

    def radius(self, place: Array) -> Array:
        """Return the radius [m] at distances from the tip; beyond an end it is constant."""
        return outer_diameter(self.profile, np.clip(place, 0.0, self.length)) / 2


@dataclass(frozen=True, slots=True, kw_only=True)
class StopSpec(Spec):
    """A post that ends the recoil of the bat."""

    angle: Annotated[float, Gt(0), Dimension("angle")]  # angle of the bat at the stop
    reach: Annotated[float, Gt(0), Dimension("length")]  # distance of the post from the pivot
    radius: Annotated[float, Gt(0), Dimension("length")]
    restitution: Share  # restitution of the bat's rate, and of a ball that hits the post

    def post(self, bat: PivotedBat) -> tuple[Any, Any]:
        """Return x and z of the post [m], which the bat touches with its largest radius."""
        direction = self.angle + np.arcsin(bat.widest / self.reach)
        return self.reach * np.sin(direction), bat.axis - self.reach * np.cos(direction)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameSpec(Spec):
    """The frame around each gate: two posts, with one bar above and one below the opening."""

    bottom: Annotated[float, Dimension("length")]  # height of the opening's lower edge
    top: Annotated[float, Dimension("length")]
    tip_side: Annotated[float, Dimension("length")]  # edge of the opening, from the bat's tip
    knob_side: Annotated[float, Dimension("length")]
    radius: Annotated[float, Gt(0), Dimension("length")]  # radius of bars and posts
    restitution: Share

    def __post_init__(self) -> None:
        if not (self.bottom < 0 < self.top and self.tip_side < self.knob_side):
            raise ValueError("the opening must lie about the line of fire")


class GateFrame(NamedTuple):
    """A frame in the plane `x` of its gate. The line of fire is `up` [m] above the bat's axis.

    `x` and `up` are numbers for all shots, or arrays (n,). A ball that is not completely inside the
    opening when it reaches the plane rebounds horizontally without friction. A ball that descends
    onto a bar while it passes rolls over the bar.
    """

    spec: FrameSpec
    x: Array | float
    up: Array | float = 0.0

    @property
    def ends(self) -> tuple[float, float]:
        """Axes of the two posts, as distances along the bat from its tip [m]."""
        return self.spec.tip_side - self.spec.radius, self.spec.knob_side + self.spec.radius

    @property
    def heights(self) -> tuple[float, float, float, float]:
        """Heights of the faces of the two bars above the line of fire [m], from the lowest up."""
        spec, bar = self.spec, 2 * self.spec.radius
        return spec.bottom - bar, spec.bottom, spec.top, spec.top + bar

    def clears(self, height: ArrayLike, ball_radius: float | Array) -> NDArray[np.bool_]:
        """Return a mask of the balls that pass between, under or over the bars.

        `height` [m] is measured from the bat's axis.
        """
        y, (under, bottom, top, over) = np.asarray(height) - self.up, self.heights
        inside = (bottom + ball_radius < y) & (y < top - ball_radius)
        return np.asarray(inside | (y < under - ball_radius) | (y > over + ball_radius))


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotScene:
    """Input of n shots at one bat, each from time 0 to `duration` [s].

    A number applies to all shots; an array has the shape (n,). `efficiency` returns e_A for impact
    positions [m], normal relative speeds [m/s] and indices of shots, for first and later contacts.
    Contacts are instantaneous in a scene.
    """

    start: ShotState
    ball_mass: Array  # [kg]
    ball_drag: Array  # κ [1/m]
    ball_radius: Array | float
    bat: PivotedBat
    efficiency: Callable[[Array, Array, Any], Array]
    duration: Array | float
    gravity: Array | float = 0.0
    stop: StopSpec | None = None
    frames: tuple[GateFrame, ...] = ()

    @property
    def shots(self) -> int:
        return len(self.start.x)

    def alone(self, shot: int) -> Self:
        """Return the scene of one shot, with numbers instead of arrays where possible."""

        def value(each: Array | float) -> float:
            return float(np.broadcast_to(each, (self.shots,))[shot])

        one = slice(shot, shot + 1)
        return replace(
            self,
            start=self.start.part(one),
            ball_mass=self.ball_mass[one],
            ball_drag=self.ball_drag[one],
            ball_radius=value(self.ball_radius),
            bat=replace(self.bat, axis=value(self.bat.axis), inertia=value(self.bat.inertia)),
            efficiency=lambda place, speed, _: self.efficiency(place, speed, np.array([shot])),
            duration=value(self.duration),
            gravity=value(self.gravity),
            frames=tuple(each._replace(x=value(each.x), up=value(each.up)) for each in self.frames),
        )
