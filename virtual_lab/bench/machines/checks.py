"""Check standards: a check ball at the wall, and a steel cylinder in place of the bat.

The hits of today are compared with those of earlier days, when the laboratory had no fault. The
comparison uses only readings, no calibration constants.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from virtual_lab import catalog
from virtual_lab.bench.day.day import Display
from virtual_lab.bench.day.readings import CLOCK
from virtual_lab.bench.day.table import action_table
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.lab import Laboratory
from virtual_lab.lab.laboratory import collision_of
from virtual_lab.records import BoardRecord, EncoderRecord, GateRecord, Record
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.faults.fault import instrument_of
from virtual_lab.simulation.physics.truth import draw_balls, make_bat
from virtual_lab.simulation.stations.rig import ShotPlan, Specimen, Stage
from virtual_lab.units import MPH, Array

DAYS = 12  # number of earlier days on the control chart
FIRST_SLOT = 1_000_000  # number of the first shot on the chart, above all shots of the day


@dataclass(frozen=True)
class CheckStandards:
    """The check standards of a laboratory.

    Each method returns rows for the display: the value of today, and mean and standard deviation of
    the earlier days. `earlier` is the number of times that the standard was used before on this
    day.
    """

    laboratory: Laboratory

    def ball(self, earlier: int) -> Display:
        """Fire the check ball at the wall. Show the ratio of rebound to incoming speed."""

        def hit(laboratory: Laboratory, first: int, hits: int) -> Mapping[str, Array]:
            played = _with_standards(laboratory).play(Stage.BALLS, _plan(first, hits, place=0.0))
            return {"rebound speed / incoming speed": speed_ratio(played.records["gates"])}

        return self._against_chart(hit, earlier)

    def cylinder(self, earlier: int) -> Display:
        """Fire the check ball at the cylinder. Show the ratio of rebound to incoming speed.

        With an encoder also show the rotation [counts] times the time between the gates [s].
        """
        place = float(np.mean(catalog.load_bat("check-cylinder").spec.body.profile.z))

        def hit(laboratory: Laboratory, first: int, hits: int) -> Mapping[str, Array]:
            plan = _plan(first, hits, place=place)
            records = _with_standards(laboratory).play(Stage.IMPACT, plan).records
            ratios = {"ball's rebound speed / incoming speed": speed_ratio(records["gates"])}
            encoder = records.get("encoder")
            if isinstance(encoder, EncoderRecord):
                turn = encoder.counts[:, -1] - encoder.counts[:, 0]
                ratios["rotation × time between gates"] = turn * _flight_times(records["gates"])[0]
            return ratios

        return self._against_chart(hit, earlier)

    def clock(self, earlier: int) -> Display:
        """Compare the clock of the gates with a reference clock. Show its error [ppm]."""
        numbers = np.arange(DAYS + earlier + 1)
        errors = action_table().consequences.clock_u * self.laboratory.draws.normal(
            "rehearsal.clock", slots=numbers
        )
        today, before = (
            1e6 * (instrument_of(each.stations[Stage.IMPACT], "gates").clock - 1)
            for each in (self.laboratory, self._sound_laboratory)
        )
        return _chart_rows(CLOCK, today + 1e6 * errors[-1], before + 1e6 * errors[:DAYS], 1, "ppm")

    @cached_property
    def _sound_laboratory(self) -> Laboratory:
        """The laboratory on the earlier days, without faults."""
        return reopen_with(self.laboratory, FaultSet())

    def _against_chart(
        self, hit: Callable[[Laboratory, int, int], Mapping[str, Array]], earlier: int
    ) -> Display:
        """Return, for each quantity of `hit`, the mean of today and the values of the chart.

        The mean is "not measured" if no hit of today has a reading.
        """
        hits = action_table().consequences.check_hits
        today = hit(self.laboratory, FIRST_SLOT + hits * (DAYS + earlier), hits)
        chart = hit(self._sound_laboratory, FIRST_SLOT, hits * DAYS)
        rows: list[tuple[str, float | str, str]] = []
        for name, values in today.items():
            if not np.isfinite(values).any():
                rows.append((f"{name}, today", "not measured", ""))
                continue
            means = np.nanmean(chart[name].reshape(DAYS, hits), axis=1)
            rows += _chart_rows(name, float(np.nanmean(values)), means, 5, "")
        return tuple(rows)


def reopen_with(laboratory: Laboratory, faults: FaultSet) -> Laboratory:
    """Return a copy of the laboratory with other faults.

    Its seed, the salt for the digest of the seed, its calibration certificates and its date are
    unchanged.
    """
    setup = replace(
        laboratory.setup, faults=faults, seed=laboratory.seed, collision=laboratory.collision
    )
    papers = {
        name: getattr(laboratory, name) for name in ("salt", "sealing", "date", "calibration")
    }
    with catalog.sheets_in_place(laboratory.sheets):
        return replace(Laboratory.open(setup), **papers)


def _chart_rows(name: str, today: float, mornings: Array, places: int, unit: str) -> Display:
    """Return the rows of one quantity: today, mean of the chart, standard deviation of a day."""
    numbers = {
        "today": today,
        "chart": mornings.mean(),
        "standard deviation of a day": mornings.std(ddof=1),
    }
    return tuple(
        (f"{name}, {word}", round(float(at), places), unit) for word, at in numbers.items()
    )


def speed_ratio(gates: Record) -> Array:
    """Return the ratio of rebound speed to incoming speed of each shot, shape (shot,).

    Both are the average speed between the first and the last gate. The ratio is NaN if one of these
    two gates missed the ball. Raises `AssertionError` for a record of anything but light gates or
    light boards.
    """
    into, back = _flight_times(gates)
    return np.asarray(into / back)


def _flight_times(gates: Record) -> tuple[Array, Array]:
    """Return the times of flight between first and last gate [s], each of shape (shot,).

    The first array is for the incoming ball, the second for the rebound.
    """
    assert isinstance(gates, GateRecord | BoardRecord)
    middle = gates.times.mean(axis=-1)
    if isinstance(gates, BoardRecord):
        with warnings.catch_warnings():  # a board that missed the ball has no mean
            warnings.simplefilter("ignore", RuntimeWarning)
            middle = np.nanmean(middle, axis=-1)
    return middle[:, 0, -1] - middle[:, 0, 0], middle[:, 1, 0] - middle[:, 1, -1]


def _plan(first: int, hits: int, *, place: float) -> ShotPlan:
    return ShotPlan(
        slot=first + np.arange(hits),
        ball=np.zeros(hits, dtype=int),
        speed=np.full(hits, 60 * MPH),
        place=np.full(hits, place),
    )


def _with_standards(laboratory: Laboratory) -> Laboratory:
    """Return the laboratory with check ball and cylinder on its rigs, without faults of the lot."""
    faults = tuple(fault for fault in laboratory.setup.faults.faults if not fault.specimen)
    ball = catalog.load("balls", "check-ball", BallSpec).spec
    cylinder = catalog.load_bat("check-cylinder").spec
    return replace(
        laboratory,
        setup=replace(laboratory.setup, faults=FaultSet(faults=faults)),
        specimen=Specimen(
            bat=make_bat(cylinder, laboratory.draws),
            balls=draw_balls(ball, 1, laboratory.draws),
            collision=collision_of(cylinder, ball, laboratory.rules.spec),
        ),
    )
