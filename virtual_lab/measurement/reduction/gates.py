"""Gates and boards: from edges to passages of the ball's center, and from these to flights.

The times of the two edges of a gate are symmetric about the passage of the ball's center, whatever
part of the beam triggers and wherever the ball passes. Their mean is therefore the time of passage.
Each beam of a board measures a chord of the ball. The squared chords as a function of height form a
parabola with its maximum at the height of the center. The means of the edges form a straight line,
whose value at this height is the time of passage.

With quadratic drag, the time to a distance is a known function of the distance, divided by the
speed at the target. Times are therefore linear in 1/speed, and flights are computed by least
squares for any number of gates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from math import prod
from typing import ClassVar, Self

import numpy as np

from virtual_lab.aligned import EVERY_FIELD, AlignedArrays
from virtual_lab.errors import InputError
from virtual_lab.measurement.reduction.flights import (
    Constants,
    FlightModel,
    Flights,
    RawFlights,
    RawFlightsU,
    Shots,
)
from virtual_lab.records import BoardRecord, GateRecord, PassageRecord
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

INBOUND, OUTBOUND = 0, 1
THICKNESS = ".gates.thickness"  # ending of a constant's name: thickness of a stage's beams [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class Passages(AlignedArrays):
    """Uncorrected times and heights of the ball's center, (..., shot, direction, gate).

    A passage that was not detected is NaN.
    """

    times: Array  # [s]
    heights: Array  # heights above the zeros of the gates [m]
    # standard uncertainty of each height, from the scatter of its edges; 0 without edges [m]
    heights_u: Array
    misfit: Array  # rms of the edges about the parabola and the line, (..., shot, direction) [s]

    aligned: ClassVar = EVERY_FIELD


def passages(
    record: GateRecord | BoardRecord | PassageRecord, *, lowest: float = 0.0, pitch: float = 1.0
) -> Passages:
    """Return times [s] and heights [m] at which the balls of a record passed the gates or boards.

    The arrays are (shot, direction, gate). A passage that was not detected is NaN; a board detects
    a ball that breaks at least four beams. Gates do not measure heights, so all their heights are
    NaN. For a `BoardRecord`, the field `heights_u` is the standard uncertainty of the heights. The
    field `misfit`, (shot, direction), is the rms deviation of the recorded edge times from the
    fitted passage of the ball [s]. For other records `heights_u` is 0 and `misfit` is NaN.

    Parameters
    ----------
    record
        Edges of gates or boards, or passages computed by the recorder.
    lowest, pitch
        For a board: height of the lowest beam above its zero, and distance between beams [m].
    """
    if isinstance(record, BoardRecord):
        return _of_boards(record, lowest, pitch)
    if isinstance(record, PassageRecord):
        times, heights = record.times, record.heights
    else:
        times = record.times.mean(axis=-1)
        heights = np.full(times.shape, np.nan)
    return Passages(
        times=times,
        heights=heights,
        heights_u=np.zeros(times.shape),
        misfit=np.full(times.shape[:2], np.nan),
    )


def _of_boards(record: BoardRecord, lowest: float, pitch: float) -> Passages:
    from virtual_lab.measurement.reduction.boards_kernel import fit_boards

    times, heights, heights_u = np.empty((3, *record.times.shape[:3]))
    misfit = np.empty(times.shape[:2])
    fit_boards(record.times, times, heights, heights_u, misfit)
    return Passages(
        times=times, heights=lowest + pitch * heights, heights_u=pitch * heights_u, misfit=misfit
    )


@dataclass(frozen=True, kw_only=True)
class GateReadings:
    """Passages of a stage's balls through its gates or boards."""

    stage: str
    passages: Passages
    distances: Array  # surveyed distances of the gates from the target, (..., gate) [m]
    shows_height: bool

    @classmethod
    def of(
        cls,
        record: GateRecord | BoardRecord | PassageRecord,
        calibration: Mapping[str, Estimate],
        stage: str,
    ) -> Self:
        """Return the readings of the gates or boards of a stage ("balls" or "impact").

        Raises `InputError` if the record and the calibration have different numbers of gates, or if
        the gates are not in the order of decreasing distance. Raises `KeyError` if the calibration
        lacks a constant.
        """
        of_boards = (
            {name: calibration[f"{stage}.gates.{name}"].value for name in ("lowest", "pitch")}
            if isinstance(record, BoardRecord)
            else {}
        )
        readings, surveyed = passages(record, **of_boards), gate_count(calibration, stage)
        if surveyed != readings.times.shape[2]:
            allowed = f"the calibration has distances of {surveyed} gates"
            raise InputError(f"{stage}/gates", "gates", readings.times.shape[2], allowed)
        distances = np.array([calibration[_distance(stage, k)].value for k in range(surveyed)])
        if not distances[0] > distances[-1]:
            raise InputError(
                "session.json",
                f"calibration.{_distance(stage, 0)}",
                distances[0],
                f"must be larger than the distance of the nearest gate, {distances[-1]:g} m",
            )
        heights = f"{stage}.gates.height_0" in calibration
        return cls(stage=stage, passages=readings, distances=distances, shows_height=heights)

    @cached_property
    def raw(self) -> RawFlights:
        """The flights between the first gate and the last, at a constant speed."""
        times = self.passages.times
        first, near = self.distances[..., 0, None], self.distances[..., -1, None]
        span = first - near
        time_in = times[..., INBOUND, -1] - times[..., INBOUND, 0]
        time_out = times[..., OUTBOUND, 0] - times[..., OUTBOUND, -1]
        with np.errstate(divide="ignore"):  # a slow clock may show two gates at the same tick
            speed_in, speed_out = span / time_in, span / time_out
        return RawFlights(
            speed_in=speed_in,
            speed_out=speed_out,
            contact=times[..., INBOUND, -1] + near * time_in / span,
            misfit=self.passages.misfit,
            complete=np.asarray(np.isfinite(times[..., INBOUND, :]).all(axis=-1)),
        )

    @property
    def raw_u(self) -> RawFlightsU:
        """Standard uncertainties of the raw flights, from the scatter of the gates about a line.

        They are NaN with fewer than three gates or two balls.
        """
        raw = self.raw
        slope_in, level = self._line_u(INBOUND)
        slope_out, _ = self._line_u(OUTBOUND)
        return RawFlightsU(
            speed_in=raw.speed_in**2 * slope_in,
            speed_out=raw.speed_out**2 * slope_out,
            contact=np.where(np.isfinite(raw.contact), level, np.nan),
        )

    def _line_u(self, direction: int) -> tuple[Array, Array]:
        """Return the u of slope [s/m] and zero [s] of a line through a ball's times, (..., 1).

        An error of a surveyed distance shifts all balls equally and is not an error of the
        readings, so the scatter is computed about the mean of the balls. The u is NaN with fewer
        than three gates or two balls.
        """
        times = self.passages.times[..., direction, :]
        gates = times.shape[-1]
        whole = np.isfinite(times).all(axis=-1, keepdims=True)
        balls = whole.sum(axis=-2)
        middle = self.distances.mean(axis=-1, keepdims=True)
        deviation = self.distances - middle
        base = np.sum(deviation**2, axis=-1, keepdims=True)
        centered = np.where(whole, times, 0.0)
        centered = centered - centered.mean(axis=-1, keepdims=True)
        lean = np.sum(centered * deviation[..., None, :], axis=-1, keepdims=True) / base[..., None]
        residual = centered - lean * deviation[..., None, :]
        residual -= residual.sum(axis=-2, keepdims=True) / np.maximum(balls, 1)[..., None]
        square = np.sum(np.where(whole, residual, 0.0) ** 2, axis=(-2, -1))[..., None]
        free = np.where((balls > 1) & (gates > 2), (gates - 2) * (balls - 1), np.nan)
        variance = square / free
        return np.sqrt(variance / base), np.sqrt(variance * (1 / gates + middle**2 / base))

    def correct(self, x: Constants, drag: Array) -> Flights:
        """Return the flights by least squares over the gates, see `FlightReadings`.

        `x` holds the distances of the gates, the rate of their clock, and the heights of boards.
        """
        return flights(x, self.stage, self.passages, drag)

    def clock(self, x: Constants) -> Array:
        """Return the rate of the gates' clock."""
        return x[f"{self.stage}.gates.clock"]

    def part(self, chosen: Shots) -> Self:
        """Return the readings of the `chosen` shots."""
        return replace(self, passages=self.passages.select(chosen))


def _distance(stage: str, gate: int) -> str:
    return f"{stage}.gates.distance_{gate}"


def gate_count(x: Mapping[str, object], stage: str) -> int:
    """Return the number of gates with a calibrated distance in a stage, 0 if there are none.

    `x` are the constants keyed by name, and `stage` is "balls" or "impact".
    """
    return next(gate for gate in count() if f"{stage}.gates.distance_{gate}" not in x)


def flights(x: Constants, stage: str, passages: Passages, drag: Array) -> Flights:
    """Return the flights of the balls in a stage, extrapolated to the target, (..., shot).

    A flight has these values at the target:

    * Speeds of the incoming and of the rebounding ball [m/s]. A speed is NaN if fewer than two
      gates detected the ball in its direction.
    * Slopes of the paths of the incoming and of the rebounding ball. A slope is the change of
      height per meter. It is NaN in the same case.
    * Height of the incoming ball [m].

    Height and slopes are NaN for all shots if the gates do not measure heights.

    Parameters
    ----------
    x
        Calibration constants keyed by name, numbers or columns (..., 1): distances of the gates and
        rate of their clock. Light boards also need their heights and the acceleration of gravity.
    stage
        First part of the constants' names: "balls" for hits at the wall, "impact" for shots at the
        bat.
    passages
        Passages of the balls through the gates, (..., shot, direction, gate).
    drag
        Drag rate κ of each ball, (..., shot) [1/m].
    """
    from virtual_lab.measurement.reduction.flights_kernel import fit_heights, fit_speeds

    gates = range(gate_count(x, stage))
    has_heights = f"{stage}.gates.height_0" in x
    names = [f"{stage}.gates.clock", *(f"{stage}.gates.distance_{index}" for index in gates)]
    if has_heights:
        names += ["hall.gravity", *(f"{stage}.gates.height_{index}" for index in gates)]
    columns = np.stack(np.broadcast_arrays(*(x[name] for name in names)), axis=-1)
    *leading, shots, _, _ = passages.times.shape
    # Each set of constants is a row. Several rows may have the same shots.
    rows = np.broadcast_shapes(columns.shape[:-2], np.shape(drag)[:-1], tuple(leading))
    row_count = prod(rows)
    # These are copies, because numba would compile again for views and read-only arrays.
    batch = np.array(np.broadcast_to(np.arange(prod(leading)).reshape(leading), rows)).reshape(
        row_count
    )
    if columns.ndim == 1:
        columns = columns[None]
    sets = np.broadcast_to(columns[..., 0, :], (*rows, len(names))).reshape(row_count, len(names))
    clock, distances = sets[:, 0].copy(), sets[:, 1 : 1 + len(gates)].copy()
    drag = np.array(np.broadcast_to(drag, (*rows, shots)), order="C").reshape(row_count, shots)
    speeds, heights = np.full((2, row_count, shots), np.nan), np.full((3, row_count, shots), np.nan)
    fit_speeds(_by_gate(passages.times), batch, distances, clock, drag, speeds)
    if has_heights:
        gravity, zeros = sets[:, 1 + len(gates)].copy(), sets[:, 2 + len(gates) :].copy()
        heights_read = _by_gate(passages.heights)
        fit_heights(heights_read, batch, speeds, distances, zeros, gravity, drag, heights)
    speed_in, speed_out = speeds.reshape(2, *rows, shots)
    offset, slope_in, slope_out = heights.reshape(3, *rows, shots)
    return Flights(
        speed_in=speed_in,
        speed_out=speed_out,
        offset=offset,
        slope_in=slope_in,
        slope_out=slope_out,
    )


def heights_moved(readings: GateReadings) -> FlightModel:
    """Return a function that computes the flights three times, with one quantity shifted each time.

    The three quantities have independent errors: the height midway between the gates on the way in,
    the slope in, and the slope out. Each quantity is shifted by one standard uncertainty. The
    speeds are not shifted. The function takes one set of constants and the drag rate κ of the balls
    [1/m]. It returns flights whose heights and slopes have the shape (3, shot). Row i has the
    values with quantity i shifted.
    """
    stage, passages = readings.stage, readings.passages

    def move(x: Constants, drag: Array) -> Flights:
        flights = readings.correct(x, drag)
        distances = np.array(
            [x[f"{stage}.gates.distance_{i}"] for i in range(gate_count(x, stage))]
        )
        finite = np.isfinite(passages.heights)
        many = np.maximum(finite.sum(axis=-1), 1)
        middle = finite @ distances / many
        deviation = np.where(finite, distances - middle[..., None], 0.0)
        squares = np.sum(np.where(finite, passages.heights_u, 0.0) ** 2, axis=-1) / many
        base = np.sum(deviation**2, axis=-1)
        level = np.sqrt(squares / many)[:, 0]
        slope_in, slope_out = np.sqrt(squares / np.where(base > 0, base, np.inf)).T
        still = np.zeros_like(level)
        return Flights(
            speed_in=flights.speed_in,
            speed_out=flights.speed_out,
            offset=flights.offset + np.stack([level, -middle[:, 0] * slope_in, still]),
            slope_in=flights.slope_in + np.stack([still, slope_in, still]),
            slope_out=flights.slope_out + np.stack([still, still, slope_out]),
        )

    return move


def _by_gate(values: Array) -> Array:
    """Return values (..., shot, direction, gate) in the layout (batch, direction, gate, shot)."""
    flat = values.reshape(-1, *values.shape[-3:])
    return np.array(flat.transpose(0, 2, 3, 1), order="C")
