"""Days of a stated laboratory: its rigs commissioned with stated constants, and tests in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any, cast

import numpy as np

from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import BatBody, BatSpec, BatSport, BatSpread, Material, Profile
from virtual_lab.errors import InputError
from virtual_lab.lab import Laboratory, TestDay, TestSetup
from virtual_lab.lab.laboratory import constant_name
from virtual_lab.lab.measurand import measurands
from virtual_lab.lab.setup import NO_FAULTS
from virtual_lab.measurement.certification import Certifications, certify_reduction
from virtual_lab.measurement.procedure.model import CONTROL
from virtual_lab.measurement.session_reduction import observe_hits
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.instruments import FittedStation, RecordDetail
from virtual_lab.simulation.physics.truth import TrueBalls, draw_balls
from virtual_lab.simulation.stations.rig import Specimen, Stage, Station, find_rig, knows_blocks
from virtual_lab.streams import Draws, Slots
from virtual_lab.studies.twin.collision import StatedBat
from virtual_lab.studies.twin.statement import Statement
from virtual_lab.uncertainty.estimate import Estimate, Estimates
from virtual_lab.units import Array, Mask

SALT = bytes(16)  # nothing of a twin is sealed
SIDE_BY_SIDE = 512  # number of days side by side
# material of a bat whose mass, balance and inertia replace those of its outline
MATERIAL = Material(density=700.0, youngs_modulus=1e10, shear_modulus=1e9, shear_coefficient=0.9)
NO_SPREAD = BatSpread(density=0.0, youngs_modulus=0.0, density_tilt=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedDays:
    """Tests on days of a twin, with the stated values that they should find."""

    certified: Certifications
    measurands: Mapping[str, Array]  # results of an error-free test keyed by name, (day,)

    @property
    def sound(self) -> Mask:
        """Days with a valid result, (day,)."""
        return self.certified.sound


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinDays:
    """Test days of a stated laboratory; each has its own errors of all stated constants."""

    statement: Statement
    seed: int
    wall_scatter: float  # standard deviation of the e0 of one hit at the wall
    hit_scatter: float  # the same at the bat, which stands for all scatter of a hit
    faults: FaultSet = NO_FAULTS

    @classmethod
    def fit(cls, statement: Statement, seed: int, days: int = SIDE_BY_SIDE) -> TwinDays:
        """Return days whose hits scatter as those of the records.

        Some of the scatter comes from the instruments and the aim. The rest is a scatter of e0,
        found from `days` days with and without one, because a variance is linear in the square of
        the latter. It is 0 if instruments and aim alone scatter at least as much as the records.
        Raises `InputError` if no day gives a valid result.
        """
        stated = np.array([statement.wall_variance, statement.hit_variance])
        trial = statement.wall_variance
        without, with_it = (
            cls(
                statement=statement, seed=seed, wall_scatter=scatter, hit_scatter=scatter
            )._mean_variances(days)
            for scatter in (0.0, sqrt(trial))
        )
        scatter = np.sqrt(trial * np.maximum(stated - without, 0.0) / (with_it - without))
        wall, hit = scatter.tolist()
        return cls(statement=statement, seed=seed, wall_scatter=wall, hit_scatter=hit)

    def _mean_variances(self, days: int) -> Array:
        """Return the mean variances of a hit at the wall and at the bat."""
        played = self.play(np.arange(days))
        test, metric = played.certified, played.certified.results["metric"]
        assert metric.scatter is not None
        preparation, hits = test.reduced.preparation, metric.scatter.variance
        number = (preparation.balls.ball[:, 0] == 0).sum(axis=1)
        wall = preparation.constants["balls.restitution_0"].u ** 2 * number
        repeated = played.sound & (hits.dof > 0)
        if not repeated.any():
            allowed = f"none of {days} days of its twin gives a valid result; needs half of them"
            raise InputError("", "folder", None, allowed)
        return np.array([wall.mean(), hits.total[repeated].mean()])

    def play(self, days: int | Slots, detail: RecordDetail = RecordDetail.SUMMED) -> PlayedDays:
        """Return the tests of the days with the numbers `days`, (n,), or of a single number.

        Records of every edge and count need a single number. Raises `InputError` if the session
        lacks a rig, or if a rig is not installed here or cannot be simulated in blocks.
        """
        day = TestDay.begin(self._laboratory(days, detail)).measure_bat().hit_wall()
        stated = self.statement.session.records["bench"]
        part_records = {
            key: each for key, each in day.sessions.records["bench"].items() if key in stated
        }
        records = {**day.sessions.records, "bench": part_records}
        day = replace(day, sessions=replace(day.sessions, records=records)).prepare()
        specimen = day.laboratory.specimen
        specimen = replace(specimen, balls=_with_scatter(specimen.balls, self.hit_scatter))
        day = replace(day, laboratory=replace(day.laboratory, specimen=specimen))
        while (shots := day.next_shots()).owner.size:
            day = day.fire(shots).judge()
        reduced, sessions = day.reduced, day.collect_records()
        assert reduced is not None
        readings = day.readings or observe_hits(sessions, reduced.preparation)
        certified = certify_reduction(sessions, reduced, readings)
        control = self.statement.session.calibration.get(CONTROL)
        true = measurands(
            self.statement.law,
            specimen,
            reduced,
            certified.hit_weights.weights,
            control.value if control else 1.0,
        )
        return PlayedDays(certified=certified, measurands=true)

    def blocks(self, days: int, first: int = 0) -> Iterator[PlayedDays]:
        """Yield the tests of `days` days whose instruments record only summary values, in blocks.

        The numbers of the days begin with `first`.
        """
        for begin in range(first, first + days, SIDE_BY_SIDE):
            yield self.play(np.arange(begin, min(begin + SIDE_BY_SIDE, first + days)))

    def _laboratory(self, days: int | Slots, detail: RecordDetail) -> Laboratory:
        statement, session = self.statement, self.statement.session
        if lacking := [stage.value for stage in Stage if stage.value not in session.rigs]:
            raise InputError("session.json", "rigs", None, f"missing: {', '.join(lacking)}")
        count = max(np.size(days), 1)
        setup = TestSetup(
            bat=_bat(statement),
            ball=Entry(spec=statement.ball, text="", sheet=()),
            rules=statement.rules,
            rig=session.rigs[Stage.IMPACT.value],
            unverified_rigs={},
            seed=self.seed,
            number=days,
            faults=self.faults,
            detail=detail,
            random_bat=False,
            history={key: _stack(each, count) for key, each in session.history.items()},
        )
        draws = setup.draws(self.seed)
        stations = {
            stage: self.faults.station(stage, _commission(stage, statement, draws))
            for stage in Stage
        }
        constants = {
            constant_name(stage, name): estimate
            for stage, station in stations.items()
            for name, estimate in station.calibration.items()
        }
        stated = {
            name: constants[name] if name in constants else _remeasure(name, estimate, draws, setup)
            for name, estimate in session.calibration.items()
        }
        entered = self.faults.calibration(cast("Mapping[str, Estimate]", stated))
        balls = draw_balls(statement.ball, statement.ball_mass.size, draws)
        shape = balls.mass.shape
        balls = replace(
            balls,
            mass=np.broadcast_to(statement.ball_mass, shape),
            restitution=np.broadcast_to(statement.ball_restitution, shape),
        )
        bat = StatedBat(name=session.bat, bodies=(setup.bat.spec.body,), measured=statement.law.bat)
        balls = _with_scatter(balls, self.wall_scatter)
        return Laboratory(
            setup=setup,
            seed=self.seed,
            salt=SALT,
            date=session.date,
            sealing="",
            draws=draws,
            collision=statement.law,
            stations=stations,
            specimen=Specimen(bat=bat, balls=balls, collision=statement.law),
            calibration={name: _stack(each, count) for name, each in entered.items()},
            box=np.zeros(np.shape(days), dtype=np.intp),
        )


def _commission(stage: Stage, statement: Statement, draws: Draws) -> Station:
    """Return a rig as records and constants state it; its true constants differ by their u."""
    name, records = statement.session.rigs[stage.value], statement.session.records[stage.value]
    rig = find_rig(name, stage)
    station: object = rig.commission(draws) if knows_blocks(rig) else None
    if not isinstance(station, FittedStation):
        allowed = "has no twin: it is simulated in one laboratory at a time"
        raise InputError("", f"{stage.value} rig", name, allowed)
    if foreign := ", ".join(records.keys() - rig.channels.keys()):
        allowed = f"has no twin: {name} records {', '.join(rig.channels)}"
        raise InputError("", f"{stage.value} records", foreign, allowed)
    scatter = statement.scatter[stage]
    parts: dict[str, Any] = {}
    for field, (part, instrument) in station.parts().items():
        prefix = constant_name(stage, f"{part}.")  # "hall." for air and gravity
        constants = {key: Estimate(value=value) for key, value in scatter.items()} | {
            key.removeprefix(prefix): estimate
            for key, estimate in statement.constants.items()
            if key.startswith(prefix)
        }
        channels = station.channels.get(part, (part,))
        part_records = [records[channel] for channel in channels if channel in records]
        parts[field] = instrument.restate(
            part_records, constants, draws, f"twin.{prefix.rstrip('.')}"
        )
    return cast("Station", replace(station, **parts).equip(records, scatter))


def _remeasure(
    name: str, estimate: Estimate, draws: Draws, setup: TestSetup
) -> Estimate | Estimates:
    """Return a constant of no instrument on the days: the ratio of a control bat with its u."""
    if name.startswith("ball.") or not estimate.u:
        return estimate
    error = np.reshape(draws.normal(f"twin.{name}"), setup.count)
    days = Estimates.stack([estimate] * setup.count)
    return replace(days, value=days.value + days.u * error)


def _stack(estimate: Estimate | Estimates, count: int) -> Estimates:
    return Estimates.stack([estimate] * count) if isinstance(estimate, Estimate) else estimate


def _bat(statement: Statement) -> Entry[BatSpec]:
    """Return a cylinder of the measured barrel; the measured rigid body replaces its mass."""
    session, length = statement.session, statement.law.bat.length
    profile = Profile(
        z=(0.0, length / 2, length), outer_diameter=(2 * statement.barrel_radius,) * 3
    )
    damping = statement.law.motion.damping_ratio
    spec = BatSpec(
        name=session.bat,
        title=session.bat,
        body=BatBody(profile=profile, material=MATERIAL, damping_ratio=damping),
        spread=NO_SPREAD,
        sport=cast("BatSport | None", session.bat_sport or None),
    )
    return Entry(spec=spec, text="", sheet=())


def _with_scatter(balls: TrueBalls, scatter: float) -> TrueBalls:
    spread = replace(balls.spec.spread, hit_restitution=scatter)
    return replace(balls, spec=replace(balls.spec, spread=spread))
