"""Where each ball is at any time, in and out, and how it has turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.flight import distance_after
from virtual_lab.relations.pinhole import rotation
from virtual_lab.simulation.arrays import Array
from virtual_lab.simulation.instruments.passage import Passage

__all__ = ["Course"]

Shots = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Flights of a batch and their spin, in axes of the rig; arrays with a leading shot axis.

    X runs with the ball toward the bat, Y along the bat to its tip, Z up; spins are rotation
    vectors a second.
    """

    passage: Passage
    contact: Array  # (shot,) [s]
    leaving: Array  # (shot,) [s]
    along: Array  # Y of the flight, (shot,) [m]
    spin_in: Array  # (shot, 3) [rad/s]
    spin_out: Array  # (shot, 3) [rad/s]
    stand: Array  # rotation vector of the ball at contact, (shot, 3)

    def at(self, shot: Shots, time: Array) -> Array:
        """Return the ball's centre of each of n shots at a time, (n, 3) [m].

        While it touches, the centre goes on, stops and turns back on a cubic that has the
        speeds in and out at its ends.
        """
        flight, shots = self.passage, len(self.contact)

        def of(values: Array | float) -> Array:
            return np.asarray(np.broadcast_to(np.asarray(values, dtype=np.float64), shots)[shot])

        drag, speed_in, speed_out = (
            of(v) for v in (flight.drag, flight.speed_in, flight.speed_out)
        )
        before = np.maximum(self.contact[shot] - time, 0.0)
        after = np.maximum(time - self.leaving[shot], 0.0)
        lasts = self.leaving[shot] - self.contact[shot]
        share = np.clip((time - self.contact[shot]) / np.where(lasts > 0, lasts, 1.0), 0.0, 1.0)
        pressed = lasts * share * (1 - share) * (speed_in * (1 - share) + speed_out * share)
        way_in = distance_after(before, speed_in, -drag)
        way_out = distance_after(after, speed_out, drag)
        plane = np.where(after > 0, of(flight.parted_plane), of(flight.plane))
        x = pressed - way_in - way_out - plane
        rise = of(flight.slope_in) * way_in + of(flight.slope_out) * way_out
        height = np.where(after > 0, of(flight.parted_height), of(flight.height))
        z = height + rise - flight.gravity / 2 * (before**2 + after**2)
        return np.stack([x, self.along[shot], z], axis=1)

    def axes(self, shot: Shots, time: Array) -> tuple[Array, Array]:
        """Return the ball's axes in their rows, (n, 3, 3), and its spin (n, 3) [rad/s]."""
        before = np.minimum(time - self.contact[shot], 0.0)[:, None]
        after = np.maximum(time - self.leaving[shot], 0.0)[:, None]
        turned = rotation(self.spin_out[shot] * after) @ rotation(self.spin_in[shot] * before)
        axes = np.swapaxes(turned @ rotation(self.stand[shot]), -1, -2)
        return axes, np.where(before < 0, self.spin_in[shot], self.spin_out[shot] * (after > 0))
