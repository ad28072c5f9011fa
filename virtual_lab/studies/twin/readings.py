"""Readings of a test that are unusual, compared with days with records of every edge and count.

Each reading is one number of a test, chosen so that it does not depend on the scale of a scatter,
because the twin takes this scale from the same records. Its tail probability is its rank among the
days.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.certification import Certification, Certifications, certify_reduction
from virtual_lab.measurement.reduction.gates import INBOUND
from virtual_lab.measurement.session_reduction import reduce_block
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.tables import column
from virtual_lab.records import BoardRecord, GateRecord, Record
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.studies.twin.days import TwinDays
from virtual_lab.units import Array

LEVEL = 0.02  # adjusted tail probability below which a reading is pointed at
ROUND = 25  # number of days after which the study looks whether more of them can matter
FIRST = 2**20  # number of the first day with full records, above those with summary values
TWO_SIDED = {"chords"}
TWIN_READINGS = {
    "hits": "largest deviation of a hit from the others at its position, in their scatter",
    "wall hits": "largest deviation of a wall hit from the others of its ball, in their scatter",
    "fit": "largest misfit of an encoder's or a board's record, divided by the median of the shots",
    "chords": "ratio of the ball diameters by the gates at the bat and by the gates at the wall",
    # its u is an estimate of few degrees of freedom in the records and on each day
    "rebound and recoil": "mean e_A from the recoil minus that from the rebound, divided by its u",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinReading:
    """A reading of the records beside those of the twin's days."""

    reading: str = column("reading")
    value: float = column("value", form=".4g")
    days_low: float = column("days: 2.5 %", form=".4g")
    days_median: float = column("median", form=".4g")
    days_high: float = column("97.5 %", form=".4g")
    tail_probability: float = column("tail probability", form=".3f")
    # adjusted for the number of readings, by Holm
    adjusted_probability: float = column("adjusted", form=".3f")
    finding: str = column("finding")
    meaning: str


@dataclass(frozen=True, slots=True)
class _Comparison:
    """One reading of the records beside those of the days, (day,)."""

    name: str
    value: float
    days: Array

    @property
    def tail(self) -> float:
        """Share of the days at least as extreme as the records, which count as one day."""
        value, days = self.value, self.days
        if self.name in TWO_SIDED:
            middle = np.median(days)
            value, days = abs(value - middle), np.abs(days - middle)
        return float((1 + np.sum(days >= value)) / (1 + days.size))

    @property
    def extreme(self) -> int:
        """Smallest number of these days that are at least as extreme as the records.

        In a two-sided reading the records can be on either side of the final median, so the side
        with fewer days counts.
        """
        above, below = np.sum(self.days >= self.value), np.sum(self.days <= self.value)
        return int(min(above, below) if self.name in TWO_SIDED else above)

    def row(self, adjusted: float) -> TwinReading:
        """Return the row of the table, given the adjusted tail probability."""
        low, median, high = np.quantile(self.days, (0.025, 0.5, 0.975)).tolist()
        return TwinReading(
            reading=self.name,
            value=self.value,
            days_low=low,
            days_median=median,
            days_high=high,
            tail_probability=self.tail,
            adjusted_probability=adjusted,
            finding="unlike its twins" if adjusted < LEVEL else "",
            meaning=TWIN_READINGS[self.name],
        )


def differing_readings(
    certification: Certification, playing: TwinDays, days: int, progress: Progress = quiet
) -> tuple[list[TwinReading], int]:
    """Compare the readings of a test with simulated days of the same laboratory, its twin.

    Return one row per reading, and a number of days. Each reading was compared with at least this
    number of simulated days.

    A reading is a number from `readings_of`. A row compares a reading of the test with the same
    reading on the simulated days. A reading that is NaN in the records, or NaN on all days, has no
    row. A day without a result or without the reading is replaced by a further day. At most twice
    `days` are simulated.

    The simulation ends early if the remaining days could not make any reading significant (Besag
    and Clifford 1991). The early end does not change which readings are significant.

    Parameters
    ----------
    certification
        The test, with records of every edge and count.
    playing
        Generator of simulated days of the laboratory, with the uncertainties that it stated.
    days
        Largest number of days to compare, each with records of every edge and count.
    progress
        Function that is called with a message, the number of days done, and the total.
    """
    block = certification.block
    ours = readings_of(certify_reduction(block, *reduce_block(block)))
    twins: list[Mapping[str, float]] = []
    compared: list[_Comparison] = []
    for day in range(2 * days):
        played = playing.play(FIRST + day, RecordDetail.FULL)
        if played.certified.sound.all():
            twins.append(readings_of(played.certified))
        progress("full days", min(len(twins), days), days)
        compared = _compare(ours, twins, days)
        smallest = [len(compared) * (1 + each.extreme) / (1 + days) for each in compared]
        settled = (day + 1) % ROUND == 0 and min(smallest, default=1.0) >= LEVEL
        if settled or (compared and all(each.days.size == days for each in compared)):
            break
    adjusted = holm(np.array([each.tail for each in compared])).tolist()
    rows = [each.row(tail) for each, tail in zip(compared, adjusted, strict=True)]
    return rows, min((each.days.size for each in compared), default=0)


def _compare(
    ours: Mapping[str, float], twins: list[Mapping[str, float]], most: int
) -> list[_Comparison]:
    """Return a comparison for each reading of the records, with the first `most` days that have it.

    A reading that is missing on all days is left out.
    """
    compared = []
    for name, value in ours.items():
        days = np.array([each.get(name, np.nan) for each in twins])
        days = days[np.isfinite(days)][:most]
        if np.isfinite(value) and days.size:
            compared.append(_Comparison(name, value, days))
    return compared


def holm(tails: Array) -> Array:
    """Return p-values adjusted for the number of tests (Holm 1979), shape (n,), at most 1.

    `tails` are the p-values (tail probabilities) before the adjustment, (n,). The result has their
    order.
    """
    order = np.argsort(tails, kind="stable")
    steps = np.maximum.accumulate((tails.size - np.arange(tails.size)) * tails[order])
    adjusted = np.empty(tails.size)
    adjusted[order] = np.minimum(steps, 1.0)
    return adjusted


def readings_of(certified: Certifications) -> dict[str, float]:
    """Return the readings `TWIN_READINGS` of a test, keyed by name, all dimensionless.

    `certified` is a block that contains one test. There are five readings:

    * "hits" is the largest deviation of a hit from the mean of its group, in units of the scatter.
      Hits in a group have the same impact position.
    * "wall hits" is the same for hits at the wall. Wall hits in a group have the same ball and
      nominal speed.
    * "fit" is the largest misfit of the record of an encoder or a light board, divided by the
      median misfit of the shots.
    * "chords" is the diameter of the ball by the gates at the bat, divided by the diameter by the
      gates at the wall.
    * "rebound and recoil" compares the mean e_A from the recoil of the bat with the mean e_A from
      the rebound of the ball. It is their absolute difference, divided by the standard uncertainty
      of the difference.

    The readings "hits" and "wall hits" are NaN if there is no scatter (see `largest_deviation`).
    The other three are missing if the records do not contain their values.
    """
    reduced, readings, block = certified.reduced, certified.readings, certified.block
    valid, balls = reduced.valid, reduced.preparation.balls
    wall = balls.flights.raw
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.ravel(wall.speed_out / wall.speed_in)
    is_reading = np.ravel(balls.ball) >= 0
    of_ball = np.ravel(balls.ball) + 1j * np.ravel(balls.nominal_speed)
    place = np.round(reduced.position[valid], 6)
    rows = {
        "hits": largest_deviation(reduced.shot_metric[valid], place),
        "wall hits": largest_deviation(ratio[is_reading], of_ball[is_reading]),
    }
    turn = readings.recoil or readings.swing
    raw = readings.flights.raw
    misfits = turn.residual if turn is not None else np.ravel(np.max(raw.misfit, axis=-1))
    misfits = misfits[np.isfinite(misfits)]
    if misfits.size:
        rows["fit"] = float(misfits.max() / np.median(misfits))
    diameters = [
        _diameter(block.records[stage]["gates"], np.ravel(speed))
        for stage, speed in (("impact", raw.speed_in), ("balls", wall.speed_in))
    ]
    if np.isfinite(diameters).all():
        rows["chords"] = diameters[0] / diameters[1]
    differences = {each.name: each.sigmas for each in certified.checked.pairs(0)}
    if "recoil-and-rebound" in differences:
        rows["rebound and recoil"] = differences["recoil-and-rebound"]
    return rows


def largest_deviation(values: Array, groups: NDArray[np.number]) -> float:
    """Return the largest absolute deviation of a value from the mean of its group, dimensionless.

    The deviation is divided by s √(1 - 1/k). Here s is the pooled standard deviation within the
    groups, and k is the size of the group. The result is NaN if no group has two values, or if the
    values of every group are equal. `values` has the shape (n,). `groups`, (n,), is the label of
    the group of each value.
    """
    _, group, number = np.unique(groups, return_inverse=True, return_counts=True)
    several = number[group] > 1
    if not several.any():
        return float("nan")
    values, group = values[several], group[several]
    means = np.bincount(group, values, number.size) / number
    deviations = values - means[group]
    scatter = float(np.sqrt(np.sum(deviations**2) / (values.size - np.unique(group).size)))
    if not scatter > 0:
        return float("nan")
    return float(np.max(np.abs(deviations) / np.sqrt(1 - 1 / number[group])) / scatter)


def _diameter(record: Record, speed: Array) -> float:
    """Return the median chord of the incoming balls over the shots [m], NaN without edges.

    The chord of a shot on a board is the longest of its beams.
    """
    if not isinstance(record, GateRecord | BoardRecord):
        return float("nan")
    lasting = np.diff(record.times[:, INBOUND], axis=-1)[..., 0]
    if isinstance(record, BoardRecord):
        lasting = np.where(np.isfinite(lasting), lasting, -np.inf).max(axis=-1)
    chords = np.where(np.isfinite(lasting), lasting, np.nan).mean(axis=-1) * speed
    chords = chords[np.isfinite(chords)]
    return float(np.median(chords)) if chords.size else float("nan")
