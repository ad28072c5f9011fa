"""Flights in front of a camera, and the true values of each of its frames."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.relations.flight import distance_after
from virtual_lab.relations.pinhole import rotation
from virtual_lab.simulation.instruments.camera.lens import Outlines
from virtual_lab.simulation.instruments.passage import Passage
from virtual_lab.streams import Slots
from virtual_lab.units import Array

Ints = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """The n frames of all shots that show a ball: arrays with a leading axis of n."""

    layout: tuple[int, int]  # number of shots, and largest number of frames per shot
    shot: Ints
    number: Ints  # number of the frame within its shot
    time: Array  # middle of the exposure after the trigger [s]
    stamp: Array  # time stamp of the camera's clock [s]
    position: Array  # (n, 3), position of the ball in axes of the rig [m]
    path: Array  # (n, 4, 2), path of the image of its center during the exposure [px]
    shares: Array  # (n, 4), time of each point of the path [share of the exposure]
    axes: Array  # (n, 3, 3), axes of the ball as rows, in axes of the rig
    turn: Array  # (n, 3), rotation vector over the exposure, in axes of the rig
    outlines: Outlines
    brightness: Array  # relative brightness of the lamps

    @property
    def blur(self) -> Array:
        """Motion of the image during the exposure, (n, 2) [px]."""
        return np.asarray(self.path[:, -1] - self.path[:, 0])

    def part(self, some: slice) -> Self:
        """Return the frames of a slice."""
        arrays = {part.name: getattr(self, part.name) for part in fields(self)}
        del arrays["layout"]
        return replace(self, **{name: values[some] for name, values in arrays.items()})

    def numbers(self, slots: Slots) -> Slots:
        """Return the number of each frame in its laboratory, (n,), from the slots of the shots."""
        return np.asarray(slots[self.shot] * self.layout[1] + self.number)

    def as_table(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values (n, …) as a table (shot, frame, …), with NaN or 0 for a missing frame."""
        blank = np.nan if np.issubdtype(values.dtype, np.floating) else 0
        table = np.full((*self.layout, *values.shape[1:]), blank, values.dtype)
        table[self.shot, self.number] = values
        return table

    def truth(self) -> dict[str, Array]:
        """Return the true values to be sealed: times [s], positions [m], image positions [px]."""
        outlines = self.outlines
        return {
            "frame_time": self.as_table(self.time),
            "frame_position": self.as_table(self.position),
            "frame_centre": self.as_table(outlines.centre),  # image of the ball's center
            "frame_outline": self.as_table(outlines.middle),  # centroid of its outline
            "frame_radius": self.as_table(outlines.radius),
            "frame_blur": self.as_table(self.blur),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Flights of a batch and their spin, in axes of the rig; arrays with a leading shot axis.

    X points with the ball toward the bat, Y along the bat to its tip, Z up. A spin is a rotation
    vector per second.
    """

    passage: Passage
    contact: Array  # (shot,), time of first touch [s]
    leaving: Array  # (shot,), time of release [s]
    along: Array  # (shot,), Y of the flight [m]
    spin_in: Array  # (shot, 3) [rad/s]
    spin_out: Array  # (shot, 3) [rad/s]
    stand: Array  # (shot, 3), rotation vector of the ball at contact

    def at(self, shot: Ints, time: Array) -> Array:
        """Return the position of the ball's center for n pairs of shot and time, (n, 3) [m].

        During the contact the center moves on a cubic that has the incoming and the rebound speed
        at its ends.
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
        distance_in = distance_after(before, speed_in, -drag)
        distance_out = distance_after(after, speed_out, drag)
        plane = np.where(after > 0, of(flight.release_plane), of(flight.plane))
        x = pressed - distance_in - distance_out - plane
        rise = of(flight.slope_in) * distance_in + of(flight.slope_out) * distance_out
        height = np.where(after > 0, of(flight.release_height), of(flight.height))
        z = height + rise - flight.gravity / 2 * (before**2 + after**2)
        return np.stack([x, self.along[shot], z], axis=1)

    def axes(self, shot: Ints, time: Array) -> tuple[Array, Array]:
        """Return the ball's axes as rows, (n, 3, 3), and its spin, (n, 3) [rad/s]."""
        before = np.minimum(time - self.contact[shot], 0.0)[:, None]
        after = np.maximum(time - self.leaving[shot], 0.0)[:, None]
        orientation = rotation(self.spin_out[shot] * after) @ rotation(self.spin_in[shot] * before)
        axes = np.swapaxes(orientation @ rotation(self.stand[shot]), -1, -2)
        return axes, np.where(before < 0, self.spin_in[shot], self.spin_out[shot] * (after > 0))
