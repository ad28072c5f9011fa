"""Input and output of the collision models: arrays over n scenes.

A scene is one collision: impact position, relative speed, and properties of the ball. The bat is at
rest before the collision. For a moving bat the scene has the relative speed, and ``v_bat`` is added
afterward (Eq. 3). The ball hits the axis of the bat at right angles.
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

# ranges of numbers for which a scene can be computed; within them a scene can still fail, with a
# message. The ranges of real balls are in their data sheets.
RANGES = {
    "relative_speed": (1e-9, 1e6),
    "ball_mass": (1e-6, 1e6),
    "ball_restitution": (1e-3, 1.0),
    "stiffness": (1e-3, 1e24),
    "exponent": (1.0, 10.0),
}


class Failure(IntEnum):
    """Reason why a scene gives no result."""

    SOUND = 0  # no failure
    OPEN = 1
    UNSETTLED = 2
    ENDLESS = 3

    @property
    def words(self) -> str:
        """Description for error messages."""
        return ("", "energy does not close", "finer steps disagree", "no end is found")[self]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenes:
    """Input of n collisions; every array has shape (n,). Create them with `Scenes.of`."""

    impact_position: Array  # distance from the barrel tip [m]
    relative_speed: Array  # relative speed of ball and bat at the impact position [m/s]
    ball_mass: Array  # [kg]
    ball_restitution: Array  # e0 at this relative speed
    stiffness: Array  # k of F = k u^a [N/m^a]
    exponent: Array  # a

    @classmethod
    def of(cls, **values: ArrayLike) -> Self:
        """Return scenes from numbers or arrays, one per field, broadcast to (n,) and checked.

        Raises
        ------
        InputError
            The shapes do not broadcast to one axis, the batch is empty, or a number is not finite
            or outside its range.
        """
        arrays = {name: np.asarray(value, dtype=np.float64) for name, value in values.items()}
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
        """Return scenes of a nominal ball, with its e0 at the relative speed."""
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
        """Return the `chosen` scenes: a slice, a mask or indices."""
        if isinstance(chosen, slice) and chosen == slice(len(self)):
            return self
        return replace(self, **{name: value[chosen] for name, value in self._arrays()})

    def require_on(self, length: float) -> None:
        """Raise `InputError` if a position lies beyond a bat of `length` [m]."""
        z = self.impact_position
        _require("impact_position", z, z <= length, f"0 to {length:g} m, the bat")

    def require_sound(self, failure: NDArray[np.int64], held: str) -> None:
        """Raise `InputError` for the first failed scene, stating its numbers and `held`."""
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
    """Shares of the ball's initial energy after the collision, each (n,); they add to 1."""

    ball: Array
    rigid: Array
    bending: Array
    hoop: Array
    hysteresis: Array

    @property
    def total(self) -> Array:
        """Sum of the shares."""
        return self.ball + self.rigid + self.bending + self.hoop + self.hysteresis


@dataclass(frozen=True, slots=True, kw_only=True)
class Collisions:
    """Results of n collisions, with modal displacements and velocities at the last release."""

    collision_efficiency: Array  # (n,), negative if the ball continues forward
    modal_displacements: Array  # (n, N) [kg^1/2 m], in the order of the model's `modes`
    modal_velocities: Array  # (n, N) [kg^1/2 m/s]
    contact_time: Array  # (n,), time from first touch to last release [s]
    impulse: Array  # (n,), impulse on the bat [N s]
    contacts: NDArray[np.int64]  # (n,), number of contacts, usually 1
    reloads: NDArray[np.int64]  # (n,), number of times the compression grew again before release
    redone: NDArray[np.int64]  # (n,), number of repetitions with finer steps
    energy: EnergySplit


def concatenate(parts: Sequence[Collisions]) -> Collisions:
    """Join the collisions of several parts of a batch, in order, and return them as one batch.

    All parts must come from the same model. A single part is returned as it is.
    """
    if len(parts) == 1:
        return parts[0]

    def whole(each: Sequence[Any]) -> dict[str, Any]:
        columns = [part.name for part in fields(each[0]) if part.name != "energy"]
        return {name: np.concatenate([getattr(one, name) for one in each]) for name in columns}

    energy = EnergySplit(**whole([part.energy for part in parts]))
    return replace(parts[0], energy=energy, **whole(parts))


class CollisionModel(Protocol):
    """A collision model of one bat with one support."""

    @property
    def name(self) -> str:
        """Name of the model."""
        ...

    @property
    def modes(self) -> Modes:
        """Modes of the bat, in the order of `Collisions.modal_velocities`."""
        ...

    def collide(self, scenes: Scenes) -> Collisions:
        """Return the collisions of the scenes.

        Raises `InputError` for a position beyond the bat or a scene that gives no result.
        """
        ...


def _require(key: str, value: Array, good: NDArray[np.bool_], allowed: str) -> None:
    if not good.all():
        raise InputError("scenes", key, float(value[~good][0]), f"allowed: {allowed}")
