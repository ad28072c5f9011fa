"""The flights before a camera, and all that is true of each frame that it takes of them."""

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
    """The frames that show a ball, of all shots one after the other: arrays with a leading n."""

    layout: tuple[int, int]  # shots, and frames that are kept of each at most
    shot: Ints
    number: Ints  # of the frame among those of its shot
    time: Array  # the middle of the exposure, since the trigger [s]
    stamp: Array  # what the camera's clock says of it [s]
    position: Array  # of the ball in axes of the rig, (n, 3) [m]
    path: Array  # of the image of its centre during the exposure, (n, 4, 2) [px]
    shares: Array  # of the exposure that end at each point of the path, (n, 4)
    axes: Array  # of the ball in its rows, axes of the rig, (n, 3, 3)
    turn: Array  # rotation vector over the exposure, axes of the rig, (n, 3)
    outlines: Outlines
    brightness: Array  # of all lamps, relative

    @property
    def blur(self) -> Array:
        """Return how far the image moves during the exposure, (n, 2) [px]."""
        return np.asarray(self.path[:, -1] - self.path[:, 0])

    def part(self, some: slice) -> Self:
        """Return some of the frames."""
        own = {part.name: getattr(self, part.name) for part in fields(self)}
        del own["layout"]
        return replace(self, **{name: values[some] for name, values in own.items()})

    def numbers(self, slots: Slots) -> Slots:
        """Return each frame's number in its laboratory, (n,), from its shot's in `slots`."""
        return np.asarray(slots[self.shot] * self.layout[1] + self.number)

    def laid(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values (n, …) by shot and frame, NaN (0 in whole numbers) where there is none."""
        blank = np.nan if np.issubdtype(values.dtype, np.floating) else 0
        table = np.full((*self.layout, *values.shape[1:]), blank, values.dtype)
        table[self.shot, self.number] = values
        return table

    def truth(self) -> dict[str, Array]:
        """Return what is sealed: times [s], places [m], and where the images lie [px]."""
        outlines = self.outlines
        return {
            "frame_time": self.laid(self.time),
            "frame_position": self.laid(self.position),
            "frame_centre": self.laid(outlines.centre),  # of the ball
            "frame_outline": self.laid(outlines.middle),  # of what is seen of it
            "frame_radius": self.laid(outlines.radius),
            "frame_blur": self.laid(self.blur),
        }


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

    def at(self, shot: Ints, time: Array) -> Array:
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

    def axes(self, shot: Ints, time: Array) -> tuple[Array, Array]:
        """Return the ball's axes in their rows, (n, 3, 3), and its spin (n, 3) [rad/s]."""
        before = np.minimum(time - self.contact[shot], 0.0)[:, None]
        after = np.maximum(time - self.leaving[shot], 0.0)[:, None]
        turned = rotation(self.spin_out[shot] * after) @ rotation(self.spin_in[shot] * before)
        axes = np.swapaxes(turned @ rotation(self.stand[shot]), -1, -2)
        return axes, np.where(before < 0, self.spin_in[shot], self.spin_out[shot] * (after > 0))
