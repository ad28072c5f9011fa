"""The seam between the instruments that watch the ball and the reduction.

Gates, boards, a camera, another maker's radar gun: each is one class that meets `FlightReadings`.
The reduction asks for nothing else, so another instrument changes nothing in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array, Mask

Constants = Mapping[str, Array]
Shots = (
    Mask | NDArray[np.intp]
)  # some of them: a mask, or their numbers, below 0 where there is none


@dataclass(frozen=True, slots=True, kw_only=True)
class Flights:
    """Flights of a stage's balls, corrected by the calibration, (..., shot); NaN: not seen."""

    speed_in: Array  # at the target [m/s]
    speed_out: Array
    offset: Array  # height of the ball's centre at the target, above the instrument's zero [m]
    slope_in: Array  # height gained a metre of distance, on the way in
    slope_out: Array  # and on the way back


FlightModel = Callable[[Constants, Array], Flights]  # of constants, drag [1/m]


@dataclass(frozen=True, slots=True, kw_only=True)
class RawFlights:
    """Flights by an instrument's own clock and survey, before any correction, (..., shot).

    NaN: not seen.
    """

    speed_in: Array  # [m/s]
    speed_out: Array
    contact: Array  # time at which the ball reaches the target [s]
    misfit: Array  # rms of the readings about one flight, (shot, way) [s]; NaN: not known
    complete: Mask  # every part of the instrument saw the ball come in

    def part(self, chosen: Shots) -> Self:
        """Return some of the shots, see `some_of`."""
        own = {each.name: some_of(getattr(self, each.name), chosen) for each in fields(self)}
        return type(self)(**own)


@dataclass(frozen=True, slots=True, kw_only=True)
class RawFlightsU:
    """Standard uncertainties of raw flights by the readings alone, without the calibration.

    (..., shot); NaN where the readings hold nothing that shows them.
    """

    speed_in: Array  # [m/s]
    speed_out: Array
    contact: Array  # [s]

    @classmethod
    def unknown(cls, like: Array) -> Self:
        """Return those of an instrument that shows none, of the shape of `like`."""
        none = np.full(np.shape(like), np.nan)
        return cls(speed_in=none, speed_out=none, contact=none)


class FlightReadings(Protocol):
    """Readings of a stage's balls by one instrument."""

    @property
    def raw(self) -> RawFlights:
        """The flights before any correction."""
        ...

    @property
    def raw_u(self) -> RawFlightsU:
        """Their standard uncertainties."""
        ...

    @property
    def shows_height(self) -> bool:
        """True if `corrected` gives the height at which each ball met the target."""
        ...

    def corrected(self, x: Constants, drag: Array) -> Flights:
        """Return the flights for any values of the constants.

        Parameters
        ----------
        x
            Constants, numbers or columns (..., 1).
        drag
            κ of each ball, (..., shot) [1/m].
        """
        ...

    def clock(self, x: Constants) -> Array:
        """Return the rate of the rig's clock, which an encoder shares: time shown over true."""
        ...

    def part(self, chosen: Shots) -> Self:
        """Return some of the shots: those of a mask, or by their numbers in any shape."""
        ...


def some_of(values: NDArray[Any], chosen: Shots, none: Any = np.nan) -> NDArray[Any]:
    """Return some of the values of shots, (shot, ...), and `none` (False) of one that is none."""
    found = values[chosen]
    if chosen.dtype != bool and (missing := chosen < 0).any():
        found[missing] = False if found.dtype == bool else none
    return found


def numbered(owner: NDArray[np.intp], used: Mask, laboratories: int) -> NDArray[np.intp]:
    """Return the numbers of the shots of each laboratory that are used, (laboratory, hit).

    In the order fired; -1 fills up where one has fewer than another.
    """
    shots = np.flatnonzero(used)
    shots = shots[np.argsort(owner[shots], kind="stable")]
    own = owner[shots]
    many = np.bincount(own, minlength=laboratories)
    turn = np.arange(shots.size) - np.repeat(np.cumsum(many) - many, many)
    found = np.full((laboratories, max(int(many.max(initial=0)), 1)), -1, dtype=np.intp)
    found[own, turn] = shots
    return found
