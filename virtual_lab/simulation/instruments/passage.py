"""The true flights of a batch of balls, in to the target and back, that gates and cameras watch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from virtual_lab.relations.flight import time_after, time_before
from virtual_lab.simulation.instruments.calibrated import TrueConstant
from virtual_lab.units import Array

R = TypeVar("R", bound=Any)  # a record of gates: its columns are (shot, way, gate, ...)


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """Flights of a batch, shape (shot,) but for the numbers that all share.

    Distances count from the target toward the cannon, heights from the line of fire. A way in
    that no instrument heeds the height of is level and passes at the height 0. Radius and gravity
    are numbers of one laboratory, arrays (shot,) of a block.
    """

    speed_in: Array  # at the target [m/s]
    speed_out: Array  # along the line of fire [m/s]; not above 0: the ball does not come back
    drag: Array  # [1/m]
    radius: TrueConstant  # [m]
    gravity: TrueConstant  # [m/s^2]
    height: Array | float = 0.0  # of the ball's centre at contact [m]
    slope_in: Array | float = 0.0  # height gained a metre of distance, on the way in
    slope_out: Array | float = 0.0  # the same on the way back
    plane: Array | float = 0.0  # distance of the contact from where the target nominally is [m]
    # where ball and target parted, if elsewhere than they met [m]
    height_out: Array | None = None
    plane_out: Array | None = None
    reach: Array | None = None  # how far the ball comes back, if a frame stops it [m]

    def inbound(self, distance: Array) -> tuple[Array, Array]:
        """Return time before contact [s] and height [m] at `distance` (shot or 1, …)."""
        ahead = distance - _column(self.plane, distance)
        time = time_before(ahead, _column(self.speed_in, distance), _column(self.drag, distance))
        return time, self._height(self.height, ahead, time, self.slope_in)

    def outbound(self, distance: Array) -> tuple[Array, Array]:
        """Return time after leaving [s], NaN where the ball goes on, and height [m]."""
        back = distance - _column(self.parted_plane, distance)
        speed = np.where(self.speed_out > 0, self.speed_out, np.nan)
        time = time_after(back, _column(speed, distance), _column(self.drag, distance))
        return time, self._height(self.parted_height, back, time, self.slope_out)

    @property
    def parted_plane(self) -> Array | float:
        """Where the way back begins, as `plane` [m]."""
        return self.plane if self.plane_out is None else self.plane_out

    @property
    def parted_height(self) -> Array | float:
        """The height there [m]."""
        return self.height if self.height_out is None else self.height_out

    def seen(self, record: R, distances: Array) -> R:
        """Return a record of gates without the times of those that a frame kept the ball from.

        `distances` of the gates are (gate,) or (shot, gate) [m].
        """
        assert self.reach is not None, "no frame stopped a ball"
        plane = np.broadcast_to(self.plane, self.reach.shape)
        rows = np.flatnonzero(np.isfinite(self.reach) | (plane >= distances.min(axis=-1)))
        gates = np.broadcast_to(distances, (plane.size, distances.shape[-1]))[rows]
        never = gates < plane[rows, None]
        gone = np.stack([never, never | (gates > self.reach[rows, None])], axis=1)
        columns = {name: getattr(record, name).copy() for name in record.columns}
        for values in columns.values():
            hidden = gone.reshape(gone.shape + (1,) * (values.ndim - gone.ndim))
            values[rows] = np.where(hidden, np.nan, values[rows])
            values.setflags(write=False)
        return replace(record, **columns)

    def way(self, *, out: bool) -> Array:
        """Return the flights of one way as rows for compiled code, (5, shot).

        1/speed [s/m], NaN where no ball comes; κ ahead, -κ behind [1/m]; height, slope, plane.
        """
        speed = self.speed_out if out else self.speed_in
        with np.errstate(divide="ignore"):
            return np.stack(
                np.broadcast_arrays(
                    np.where(speed > 0, 1 / speed, np.nan),
                    self.drag if out else -self.drag,
                    self.parted_height if out else self.height,
                    self.slope_out if out else self.slope_in,
                    self.parted_plane if out else self.plane,
                )
            )

    def _height(
        self, height: Array | float, way: Array, time: Array, slope: Array | float
    ) -> Array:
        fall = _column(self.gravity, time) / 2 * time**2
        return np.asarray(_column(height, way) + _column(slope, way) * way - fall)


def _column(values: Array | float, like: Array) -> Array:
    """Return (shot,) values with axes added to stand beside `like`, numbers as they are."""
    array = np.asarray(values)
    return array.reshape(array.shape + (1,) * (like.ndim - 1)) if array.ndim else array
