"""From passages to flights: speeds at the target, offset and slope, by least squares.

With quadratic drag the time to a distance is a known function of the distance divided by the speed
at the target, so time is linear in 1/speed for any number of gates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count
from math import prod

import numpy as np

from virtual_lab.measurement.reduction.gates import Passages
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Flights:
    """Flights from the gates, (..., shot); NaN: not seen."""

    speed_in: Array  # at the target [m/s]
    speed_out: Array
    offset: Array  # height of the ball's centre at the target, above the gates' zero [m]
    slope_in: Array  # height gained a metre of distance, on the way in
    slope_out: Array  # and on the way back


FlightModel = Callable[[Mapping[str, Array], Array], Flights]  # of constants, drag [1/m]


def gate_count(x: Mapping[str, object], stage: str) -> int:
    """Return the number of gates in a stage's calibration."""
    return next(gate for gate in count() if f"{stage}.gates.distance_{gate}" not in x)


def flights(x: Mapping[str, Array], stage: str, seen: Passages, drag: Array) -> Flights:
    """Return the flights of a stage's balls.

    Parameters
    ----------
    x
        Constants, numbers or columns (k, 1): distances of the gates, their heights where they
        measure them, the clock.
    seen
        Passages, (shot, way, gate).
    drag
        κ of each ball, (..., shot) [1/m].
    """
    from virtual_lab.measurement.reduction.flights_kernel import fit_heights, fit_speeds

    gates = range(gate_count(x, stage))
    tall = f"{stage}.gates.height_0" in x
    names = [f"{stage}.gates.clock", *(f"{stage}.gates.distance_{index}" for index in gates)]
    if tall:
        names += ["hall.gravity", *(f"{stage}.gates.height_{index}" for index in gates)]
    known = np.stack(np.broadcast_arrays(*(x[name] for name in names)), axis=-1)
    shape = np.broadcast_shapes(known.shape[:-1], np.shape(drag), seen.times.shape[:1])
    sets = np.broadcast_to(known.reshape(-1, len(names)), (prod(shape[:-1]), len(names)))
    clock, distances = sets[:, 0].copy(), sets[:, 1 : 1 + len(gates)].copy()
    drag = np.array(drag, ndmin=2, order="C")
    speeds, heights = np.full((2, *shape), np.nan), np.full((3, *shape), np.nan)
    by_set = -1, shape[-1]
    fit_speeds(_by_gate(seen.times), distances, clock, drag, speeds.reshape(2, *by_set))
    if tall:
        gravity, zeros = sets[:, 1 + len(gates)].copy(), sets[:, 2 + len(gates) :].copy()
        shown, flown = _by_gate(seen.heights), speeds.reshape(2, *by_set)
        fit_heights(shown, flown, distances, zeros, gravity, drag, heights.reshape(3, *by_set))
    return Flights(
        speed_in=speeds[0],
        speed_out=speeds[1],
        offset=heights[0],
        slope_in=heights[1],
        slope_out=heights[2],
    )


def timed(stage: str, seen: Passages) -> FlightModel:
    """Return `flights` of a stage's passages as a function of the constants."""
    return lambda x, drag: flights(x, stage, seen, drag)


def heights_moved(stage: str, seen: Passages) -> FlightModel:
    """Return the flights of one set of constants as `timed`, (3, shot), heights shifted by u.

    Each row shifts one of three quantities with independent errors: the height midway between the
    gates on the way in, the slope in, the slope out.
    """

    def moved(x: Mapping[str, Array], drag: Array) -> Flights:
        found = flights(x, stage, seen, drag)
        distances = np.array(
            [x[f"{stage}.gates.distance_{i}"] for i in range(gate_count(x, stage))]
        )
        known = np.isfinite(seen.heights)
        many = np.maximum(known.sum(axis=-1), 1)
        middle = known @ distances / many
        off = np.where(known, distances - middle[..., None], 0.0)
        squares = np.sum(np.where(known, seen.heights_u, 0.0) ** 2, axis=-1) / many
        base = np.sum(off**2, axis=-1)
        level = np.sqrt(squares / many)[:, 0]
        slope_in, slope_out = np.sqrt(squares / np.where(base > 0, base, np.inf)).T
        still = np.zeros_like(level)
        return Flights(
            speed_in=found.speed_in,
            speed_out=found.speed_out,
            offset=found.offset + np.stack([level, -middle[:, 0] * slope_in, still]),
            slope_in=found.slope_in + np.stack([still, slope_in, still]),
            slope_out=found.slope_out + np.stack([still, still, slope_out]),
        )

    return moved


def _by_gate(values: Array) -> Array:
    """Return (shot, way, gate) as (way, gate, shot): whole shots lie side by side."""
    return np.array(values.transpose(1, 2, 0), order="C")
