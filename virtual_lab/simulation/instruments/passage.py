"""True flights of a batch of balls to the target and back, as measured by gates and cameras."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from virtual_lab.relations.flight import time_after, time_before
from virtual_lab.simulation.instruments.calibrated import TrueConstant
from virtual_lab.units import Array

R = TypeVar("R", bound=Any)  # record of gates, with columns (shot, direction, gate, ...)


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """Flights of a batch: arrays (shot,), or numbers common to all shots.

    Distances are measured from the target toward the cannon, heights from the line of fire. If no
    instrument depends on the height of the incoming ball, its flight is level at height 0. Radius
    and gravity are numbers for one laboratory and arrays (shot,) for a block.
    """

    speed_in: Array  # speed at the target [m/s]
    speed_out: Array  # rebound speed along the line of fire [m/s]; without rebound ≤ 0 or NaN
    drag: Array  # [1/m]
    radius: TrueConstant  # [m]
    gravity: TrueConstant  # [m/s^2]
    height: Array | float = 0.0  # height of the ball's center at contact [m]
    slope_in: Array | float = 0.0  # height per meter of distance, incoming [m/m]
    slope_out: Array | float = 0.0  # height per meter of distance, rebound [m/m]
    plane: Array | float = 0.0  # distance of the contact from the nominal target [m]
    # position at the release, if it differs from that at first touch [m]
    height_out: Array | None = None
    plane_out: Array | None = None
    frame_distance: Array | None = None  # distance at which a frame stops the rebound [m]

    def inbound(self, distance: Array) -> tuple[Array, Array]:
        """Return time before contact [s] and height [m] at `distance` (shot or 1, …)."""
        ahead = distance - _column(self.plane, distance)
        time = time_before(ahead, _column(self.speed_in, distance), _column(self.drag, distance))
        return time, self._height(self.height, ahead, time, self.slope_in)

    def outbound(self, distance: Array) -> tuple[Array, Array]:
        """Return time after release [s], NaN without a rebound, and height [m]."""
        path = distance - _column(self.release_plane, distance)
        speed = np.where(self.speed_out > 0, self.speed_out, np.nan)
        time = time_after(path, _column(speed, distance), _column(self.drag, distance))
        return time, self._height(self.release_height, path, time, self.slope_out)

    @property
    def release_plane(self) -> Array | float:
        """Position at which the rebound begins, measured like `plane` [m]."""
        return self.plane if self.plane_out is None else self.plane_out

    @property
    def release_height(self) -> Array | float:
        """Height at which the rebound begins [m]."""
        return self.height if self.height_out is None else self.height_out

    def without_unreached(self, record: R, distances: Array) -> R:
        """Return a record of gates without the times of gates that a ball could not reach.

        `distances` are the distances of the gates from the target, (gate,) or (shot, gate) [m].
        """
        assert self.frame_distance is not None, "no frame stopped a ball"
        plane = np.broadcast_to(self.plane, self.frame_distance.shape)
        rows = np.flatnonzero(np.isfinite(self.frame_distance) | (plane >= distances.min(axis=-1)))
        gates = np.broadcast_to(distances, (plane.size, distances.shape[-1]))[rows]
        never = gates < plane[rows, None]
        is_unreached = np.stack([never, never | (gates > self.frame_distance[rows, None])], axis=1)
        columns = {name: getattr(record, name).copy() for name in record.columns}
        for values in columns.values():
            hidden = is_unreached.reshape(
                is_unreached.shape + (1,) * (values.ndim - is_unreached.ndim)
            )
            values[rows] = np.where(hidden, np.nan, values[rows])
            values.setflags(write=False)
        return replace(record, **columns)

    def trajectory_rows(self, *, out: bool) -> Array:
        """Return the flights in one direction as rows for compiled code, (5, shot).

        The rows are 1/speed [s/m], NaN without a ball; κ for the rebound or -κ for the incoming
        flight [1/m]; height; slope; plane.
        """
        speed = self.speed_out if out else self.speed_in
        with np.errstate(divide="ignore"):
            return np.stack(
                np.broadcast_arrays(
                    np.where(speed > 0, 1 / speed, np.nan),
                    self.drag if out else -self.drag,
                    self.release_height if out else self.height,
                    self.slope_out if out else self.slope_in,
                    self.release_plane if out else self.plane,
                )
            )

    def _height(
        self, height: Array | float, distance: Array, time: Array, slope: Array | float
    ) -> Array:
        fall = _column(self.gravity, time) / 2 * time**2
        return np.asarray(_column(height, distance) + _column(slope, distance) * distance - fall)


def _column(values: Array | float, like: Array) -> Array:
    """Return values (shot,) with axes added to broadcast with `like`; numbers do not change."""
    array = np.asarray(values)
    return array.reshape(array.shape + (1,) * (like.ndim - 1)) if array.ndim else array
