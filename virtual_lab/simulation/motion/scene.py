"""One pivoted bat, one ball a shot, the stop of the bat and the frames of the gates.

Axes: x along the line of fire, z along the resting bat from its tip, y up. At angle 0 the bat's
axis lies on x = 0, its tip at z = 0. Angle and rate are positive as the bat recoils, so a bat
swung toward the ball has a negative rate. The bat turns about a vertical axis without friction;
its weight does nothing. The barrel is a cylinder where it is struck: its taper moves the surface,
no normal.
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
        """Broadcast numbers and arrays to (n,); what is not given is 0."""
        wanted = (np.atleast_1d(given.get(name, 0.0)) for name in cls._fields)
        return cls(*(np.array(each, dtype=float) for each in np.broadcast_arrays(*wanted)))

    @classmethod
    def joined(cls, states: list[ShotState]) -> Self:
        """Return the shots of several states one after the other."""
        return cls(*np.concatenate([np.array(state) for state in states], axis=1))

    def part(self, chosen: Any) -> Self:
        """Return some of the shots."""
        return type(self)(*(each[chosen] for each in self))


@dataclass(frozen=True)
class PivotedBat:
    """A bat on its axis, `axis` [m] from the tip, and its moment of inertia about it [kg m²].

    One axis for all shots, or (n,).
    """

    profile: Profile
    axis: Array | float
    inertia: Array | float

    @property
    def length(self) -> float:
        return self.profile.z[-1]

    @cached_property
    def widest(self) -> float:
        """Greatest radius [m]."""
        return max(self.profile.outer_diameter) / 2

    @cached_property
    def thinnest(self) -> float:
        """Least radius of the outer third, where balls strike [m]."""
        return float(np.min(self.radius(np.linspace(0.0, self.length / 3, 50))))

    @cached_property
    def steepest(self) -> float:
        """Greatest slope of the radius, a bound: a cubic of Fritsch and Carlson keeps to 3."""
        z, d = np.array(self.profile.z), np.array(self.profile.outer_diameter)
        return float(1.5 * np.abs(np.diff(d) / np.diff(z)).max())

    def radius(self, place: Array) -> Array:
        """Return the radius [m] at places from the tip; beyond the ends, that of the end."""
        return outer_diameter(self.profile, np.clip(place, 0.0, self.length)) / 2


@dataclass(frozen=True, slots=True, kw_only=True)
class StopSpec(Spec):
    """A post that ends the recoil of the bat."""

    angle: Annotated[float, Gt(0), Dimension("angle")]  # of the bat that rests on it
    reach: Annotated[float, Gt(0), Dimension("length")]  # from the axis to the post
    radius: Annotated[float, Gt(0), Dimension("length")]
    restitution: Share  # of the bat's rate, and of a ball that meets the post

    def post(self, bat: PivotedBat) -> tuple[Any, Any]:
        """Return x and z of the post on which a bat rests by its widest place [m]."""
        way = self.angle + np.arcsin(bat.widest / self.reach)
        return self.reach * np.sin(way), bat.axis - self.reach * np.cos(way)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameSpec(Spec):
    """The frame around every gate: two posts, a bar above and one below."""

    bottom: Annotated[float, Dimension("length")]  # of the opening, from the line of fire
    top: Annotated[float, Dimension("length")]
    tip_side: Annotated[float, Dimension("length")]  # of the opening, along the bat from its tip
    knob_side: Annotated[float, Dimension("length")]
    radius: Annotated[float, Gt(0), Dimension("length")]  # of bars and posts
    restitution: Share

    def __post_init__(self) -> None:
        if not (self.bottom < 0 < self.top and self.tip_side < self.knob_side):
            raise ValueError("the opening must lie about the line of fire")


class GateFrame(NamedTuple):
    """A frame in the plane x of its gate, `up` [m] that the bat's axis is below the line of fire.

    Both are of all shots, or each one's own, (n,). A ball whose outline is not within the opening
    as it comes to the plane is thrown back in the plan, as if smooth. One that comes down on a bar
    while it passes rolls over it.
    """

    spec: FrameSpec
    x: Array | float
    up: Array | float = 0.0

    @property
    def ends(self) -> tuple[float, float]:
        """Axes of its posts, along the bat from its tip [m]."""
        return self.spec.tip_side - self.spec.radius, self.spec.knob_side + self.spec.radius

    @property
    def heights(self) -> tuple[float, float, float, float]:
        """Lower and upper faces of the bars, from below, from the line of fire [m]."""
        spec, bar = self.spec, 2 * self.spec.radius
        return spec.bottom - bar, spec.bottom, spec.top, spec.top + bar

    def clears(self, height: ArrayLike, ball_radius: float | Array) -> NDArray[np.bool_]:
        """Return whether balls at heights [m] above the bat's axis pass between or beside bars."""
        y, (under, bottom, top, over) = np.asarray(height) - self.up, self.heights
        inside = (bottom + ball_radius < y) & (y < top - ball_radius)
        return np.asarray(inside | (y < under - ball_radius) | (y > over + ball_radius))


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotScene:
    """Shots to be played, each from time 0 to `duration` [s], at one bat.

    What may be a number or an array (n,) is one of all shots, or each one's own. `efficiency` gives
    e_A for places [m], normal relative speeds [m/s] and numbers of shots, at first contacts and
    later ones alike; the contact takes no time here.
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
        """Return the scene of one shot; what may be a number is one."""

        def own(each: Array | float) -> float:
            return float(np.broadcast_to(each, (self.shots,))[shot])

        one = slice(shot, shot + 1)
        return replace(
            self,
            start=self.start.part(one),
            ball_mass=self.ball_mass[one],
            ball_drag=self.ball_drag[one],
            ball_radius=own(self.ball_radius),
            bat=replace(self.bat, axis=own(self.bat.axis), inertia=own(self.bat.inertia)),
            efficiency=lambda place, speed, _: self.efficiency(place, speed, np.array([shot])),
            duration=own(self.duration),
            gravity=own(self.gravity),
            frames=tuple(each._replace(x=own(each.x), up=own(each.up)) for each in self.frames),
        )
