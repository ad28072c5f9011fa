"""The interface between the reduction and the instruments that measure the flight of a ball.

Gates, light boards, a camera or the radar gun of another package each have one class that meets
`FlightReadings`. The reduction uses only this protocol, so it does not depend on the instrument.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.units import Array, Mask

Constants = Mapping[str, Array]
# selection of shots: a mask, or indices, negative for a missing shot
Shots = Mask | NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Flights:
    """Flights of a stage's balls, corrected by the calibration, (..., shot); NaN: not detected."""

    speed_in: Array  # speed at the target [m/s]
    speed_out: Array
    offset: Array  # height of the ball's center at the target above the instrument's zero [m]
    slope_in: Array  # height per meter of distance, incoming
    slope_out: Array  # height per meter of distance, rebound


FlightModel = Callable[[Constants, Array], Flights]  # function of constants and drag rate [1/m]


@dataclass(frozen=True, slots=True, kw_only=True)
class RawFlights(AlignedArrays):
    """Flights by an instrument's own clock and survey, before any correction, (..., shot).

    A flight that was not detected has NaN.
    """

    speed_in: Array  # [m/s]
    speed_out: Array
    contact: Array  # time at which the ball reaches the target [s]
    misfit: Array  # rms deviation of the readings from the flight, (shot, direction) [s], or NaN
    complete: Mask  # whether every part of the instrument detected the incoming ball

    aligned: ClassVar = EVERY_FIELD

    def part(self, chosen: Shots) -> Self:
        """Return the `chosen` shots, see `FlightReadings.part`."""
        return self.select(chosen)


@dataclass(frozen=True, slots=True, kw_only=True)
class RawFlightsU:
    """Standard uncertainties of raw flights from the readings alone, without the calibration.

    The arrays are (..., shot). A value is NaN if the readings do not determine it.
    """

    speed_in: Array  # [m/s]
    speed_out: Array
    contact: Array  # [s]

    @classmethod
    def nan_like(cls, like: Array) -> Self:
        """Return unknown uncertainties (NaN) in the shape of `like`."""
        none = np.full(np.shape(like), np.nan)
        return cls(speed_in=none, speed_out=none, contact=none)


class FlightReadings(Protocol):
    """Readings of the balls of a stage by one instrument."""

    @property
    def raw(self) -> RawFlights:
        """Flights before any correction."""
        ...

    @property
    def raw_u(self) -> RawFlightsU:
        """Standard uncertainties of the raw flights."""
        ...

    @property
    def shows_height(self) -> bool:
        """Whether `correct` returns the height at which each ball met the target."""
        ...

    def correct(self, x: Constants, drag: Array) -> Flights:
        """Return the flights for any values of the constants.

        Parameters
        ----------
        x
            Constants, numbers or columns (..., 1).
        drag
            Drag rate κ of each ball, (..., shot) [1/m].
        """
        ...

    def clock(self, x: Constants) -> Array:
        """Return the rate of the rig's clock: recorded time divided by true time.

        The encoders use the same clock.
        """
        ...

    def part(self, chosen: Shots) -> Self:
        """Return the shots of a mask, or of indices of any shape."""
        ...


def number_shots(owner: NDArray[np.intp], used: Mask, laboratories: int) -> NDArray[np.intp]:
    """Return the indices of the used shots of each laboratory in order, (laboratory, hit).

    The second axis is as long as the largest number of used shots in a laboratory, but at least 1.
    Shorter rows are filled with -1. `owner`, the index of the laboratory of each shot, and the mask
    `used` are (shot,).
    """
    shots = np.flatnonzero(used)
    shots = shots[np.argsort(owner[shots], kind="stable")]
    owners = owner[shots]
    counts = np.bincount(owners, minlength=laboratories)
    turn = np.arange(shots.size) - np.repeat(np.cumsum(counts) - counts, counts)
    numbers = np.full((laboratories, max(int(counts.max(initial=0)), 1)), -1, dtype=np.intp)
    numbers[owners, turn] = shots
    return numbers
