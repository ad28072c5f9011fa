"""What goes into a collision and what comes out: arrays over n scenes.

The bat is at rest before the ball comes; a moving bat is the same scene at the relative
speed (``v_bat`` is added afterwards, Eq. 3). The ball meets the axis squarely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.modes import Modes
from virtual_lab.units import Array

# Numbers that can be computed with. Within them a scene may still be one that cannot be followed,
# which it says then; what balls there are is for their sheets to say.
RANGES = {
    "relative_speed": (1e-9, 1e6),
    "ball_mass": (1e-6, 1e6),
    "ball_restitution": (1e-3, 1.0),
    "stiffness": (1e-3, 1e24),
    "exponent": (1.0, 10.0),
}


class Failure(IntEnum):
    """Why nothing is to be made of what a scene came to."""

    SOUND = 0  # it is
    OPEN = 1
    UNSETTLED = 2
    ENDLESS = 3

    @property
    def words(self) -> str:
        """Say it."""
        return ("", "energy does not close", "finer steps disagree", "no end is found")[self]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenes:
    """Collisions to be, every array of shape (n,). Make them with `Scenes.of`."""

    impact_position: Array  # from the barrel tip [m]
    relative_speed: Array  # of ball and bat at the point of impact [m/s]
    ball_mass: Array  # [kg]
    ball_restitution: Array  # e0 at this relative speed
    stiffness: Array  # k of F = k u^a [N/m^a]
    exponent: Array  # a

    @classmethod
    def of(cls, **given: ArrayLike) -> Self:
        """Broadcast numbers and arrays, one of each field's name, to (n,) and check them.

        Raises
        ------
        InputError
            Shapes that do not broadcast to one axis, an empty batch, a number that is not
            finite, or one outside its range.
        """
        arrays = {name: np.asarray(value, dtype=np.float64) for name, value in given.items()}
        try:
            shape = np.broadcast_shapes((1,), *(array.shape for array in arrays.values()))
        except ValueError:
            shape = (0, 0)
        if len(shape) != 1 or shape[0] == 0:
            shapes = " ".join(str(array.shape) for array in arrays.values())
            raise InputError("scenes", "shapes", shapes, "allowed: all (n,) or numbers, n >= 1")
        return cls(**{name: np.broadcast_to(array, shape) for name, array in arrays.items()})

    @classmethod
    def with_ball(
        cls, ball: BallSpec, *, impact_position: ArrayLike, relative_speed: ArrayLike
    ) -> Self:
        """Return scenes of a nominal ball, its e0 taken at the relative speed."""
        return cls.of(
            impact_position=impact_position,
            relative_speed=relative_speed,
            ball_mass=ball.mass,
            ball_restitution=ball.restitution.at(relative_speed),
            stiffness=ball.stiffness,
            exponent=ball.exponent,
        )

    def __post_init__(self) -> None:
        for name, value in self._arrays():
            if not np.all(np.isfinite(value)):
                bad = value[~np.isfinite(value)][0]
                raise InputError("scenes", name, bad, "allowed: finite numbers")
        _require("impact_position", self.impact_position, self.impact_position >= 0, "0 and up")
        for name, (low, high) in RANGES.items():
            value = getattr(self, name)
            _require(name, value, (value >= low) & (value <= high), f"{low:g} to {high:g}")

    def __len__(self) -> int:
        return len(self.impact_position)

    def part(self, chosen: slice | NDArray[Any]) -> Self:
        """Return some of the scenes."""
        return replace(self, **{name: value[chosen] for name, value in self._arrays()})

    def require_on(self, length: float) -> None:
        """Raise `InputError` where a place lies beyond a bat of `length` [m]."""
        z = self.impact_position
        _require("impact_position", z, z <= length, f"0 to {length:g} m, the bat")

    def require_sound(self, failure: NDArray[np.int64], held: str) -> None:
        """Raise `InputError` that names the scene where one of a bat `held` so has failed."""
        failed = np.flatnonzero(failure)
        if failed.size:
            one = {name: f"{value[failed[0]]:.6g}" for name, value in self._arrays()}
            raise InputError(
                "collision",
                Failure(int(failure[failed[0]])).words,
                None,
                f"no result for a bat {held}, struck {one['impact_position']} m from its tip at "
                f"{one['relative_speed']} m/s by a ball of {one['ball_mass']} kg, "
                f"e0 {one['ball_restitution']}, k {one['stiffness']} N/m^{one['exponent']}",
            )

    def _arrays(self) -> list[tuple[str, Array]]:
        return [(field.name, getattr(self, field.name)) for field in fields(self)]


@dataclass(frozen=True, slots=True, kw_only=True)
class EnergySplit:
    """Shares of the ball's energy before contact, each (n,); they add to 1."""

    ball: Array
    rigid: Array
    bending: Array
    hoop: Array
    hysteresis: Array

    @property
    def total(self) -> Array:
        """Their sum."""
        return self.ball + self.rigid + self.bending + self.hoop + self.hysteresis


@dataclass(frozen=True, slots=True, kw_only=True)
class Collisions:
    """What n collisions came to. The modal state is that of the last release."""

    collision_efficiency: Array  # (n,), negative where the ball goes on
    modal_displacements: Array  # (n, N) [kg^1/2 m], modes as in the model's `modes`
    modal_velocities: Array  # (n, N) [kg^1/2 m/s]
    contact_time: Array  # (n,), first touch to last release [s]
    impulse: Array  # (n,), on the bat [N s]
    contacts: NDArray[np.int64]  # (n,), 1 unless ball and bat met again
    reloads: NDArray[np.int64]  # (n,), how often the compression turned round before release
    redone: NDArray[np.int64]  # (n,), 0 the first try did, 1 and 2 finer ones, 3 one by one
    energy: EnergySplit


def joined(parts: Sequence[Collisions]) -> Collisions:
    """Return the collisions of one model as one batch."""
    if len(parts) == 1:
        return parts[0]

    def whole(each: Sequence[Any]) -> dict[str, Any]:
        columns = [part.name for part in fields(each[0]) if part.name != "energy"]
        return {name: np.concatenate([getattr(one, name) for one in each]) for name in columns}

    energy = EnergySplit(**whole([part.energy for part in parts]))
    return replace(parts[0], energy=energy, **whole(parts))


class CollisionModel(Protocol):
    """One rung of the ladder, for one bat under one support."""

    @property
    def rung(self) -> str:
        """Name of the rung."""
        ...

    @property
    def modes(self) -> Modes:
        """The modes `Collisions.modal_velocities` counts."""
        ...

    def collide(self, scenes: Scenes) -> Collisions:
        """Return what the scenes come to.

        `InputError` where a place lies off the bat or one cannot be followed.
        """
        ...


def _require(key: str, value: Array, good: NDArray[np.bool_], allowed: str) -> None:
    if not good.all():
        raise InputError("scenes", key, float(value[~good][0]), f"allowed: {allowed}")
