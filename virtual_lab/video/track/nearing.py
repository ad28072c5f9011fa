"""A ball that leaves the plane it is taken to fly in: it grows or shrinks, and seems to move.

One camera sees no height. A ball that comes nearer moves away from the picture's middle by itself,
by as much of its distance from there as it grows; what that makes of the speed is not corrected,
for the pattern of a ball may make it grow a little too, but told, and put into the uncertainty.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.calibration.plane import RIM
from virtual_lab.video.track.lines import Flight
from virtual_lab.video.track.tracking import Tracked

__all__ = ["Nearing", "nearing"]

GROWN = 0.004  # of the radius through a flight: less is no matter, nor what a pattern may make
SURE = 6.0  # standard uncertainties
FEW = 8  # frames: fewer tell no trend


class Nearing(NamedTuple):
    """A ball that comes nearer during a flight."""

    grown: float  # by how much of its radius
    speed: float  # what that adds to the speed [m/s]


def nearing(tracked: Tracked, used: NDArray[np.bool_], flight: Flight) -> Nearing | None:
    """Return how a flight leaves the plane, None where it stays in it as far as can be seen.

    Parameters
    ----------
    tracked
        The clip.
    used
        Frames of the flight, (frame,).
    flight
        Its line.
    """
    located = tracked.located
    good = used & np.isfinite(located.radius) & (located.flags == 0)
    if good.sum() < FEW:
        return None
    t = tracked.times[good] - tracked.times[good].mean()
    size = np.log(located.radius[good] / tracked.plane.sizes[good])
    rate = float(t @ size / (t @ t))
    rest = size - size.mean() - rate * t
    u = float(np.sqrt((rest @ rest) / (len(t) - 2) / (t @ t)))
    grown = rate * float(np.ptp(t))
    pattern = 0.0 if located.pattern_u is None else float(np.median(located.pattern_u[good]))
    least = max(GROWN, 2 * RIM * pattern / float(np.median(located.radius[good])))
    if abs(grown) < least or abs(rate) < SURE * u:
        return None
    rows, columns = tracked.clip.shape
    away = np.array(
        [
            np.mean(located.x[good]) - (columns - 1) / 2,
            tracked.plane.sense * (np.mean(located.y[good]) - (rows - 1) / 2),
        ]
    )
    moved = rate * tracked.plane.metres_per_pixel * away
    return Nearing(grown, float(moved @ flight.velocity) / flight.speed)
