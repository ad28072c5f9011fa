"""Days of a stated laboratory: its rigs commissioned with stated constants, and tests in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, cast

import numpy as np

from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import (
    BallSpread,
    BatBody,
    BatSpec,
    BatSpread,
    Material,
    Profile,
    RestitutionLine,
)
from virtual_lab.errors import InputError
from virtual_lab.lab import Laboratory, TestDay, TestSetup
from virtual_lab.lab.laboratory import constant_name
from virtual_lab.lab.measurand import measurands
from virtual_lab.lab.setup import NO_FAULTS
from virtual_lab.measurement.certification import Certifications, evaluate
from virtual_lab.measurement.procedure.model import CONTROL
from virtual_lab.measurement.session_reduction import observe_hits
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.instruments import FittedStation, RecordDetail
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, drawn
from virtual_lab.simulation.physics.truth import TrueBalls
from virtual_lab.simulation.stations.rig import (
    ImpactStation,
    Specimen,
    Stage,
    Station,
    find_rig,
    knows_blocks,
)
from virtual_lab.streams import Draws
from virtual_lab.studies.twin.collision import StatedBat
from virtual_lab.studies.twin.statement import Statement, ball_template
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
    measurands: Mapping[str, Array]  # results of an error-free test by name, (day,)

    @property
    def sound(self) -> Mask:
        """Days with a valid result, (day,)."""
        return self.certified.some & ~self.certified.invalid


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinDays:
    """Test days of a stated laboratory; each has its own errors of all stated constants."""

    statement: Statement
    seed: int
    wall_scatter: float  # standard deviation of the e0 of one hit at the wall
    hit_scatter: float  # the same at the bat, which stands for all scatter of a hit
    faults: FaultSet = NO_FAULTS

    def play(self, days: Any, detail: RecordDetail = RecordDetail.SUMMED) -> PlayedDays:
        """Return the tests of the days with the numbers `days`, (n,), or of a single number.

        Records of every edge and count need a single number. Raises `InputError` if the session
        lacks a rig, or if a rig is not installed here or cannot be simulated in blocks.
        """
        laboratory = self._laboratory(days, detail)
        day = TestDay.begin(laboratory).measure_bat().hit_wall()
        stated = self.statement.session.records["bench"]
        kept = {
            name: record for name, record in day.sessions.records["bench"].items() if name in stated
        }
        records = {**day.sessions.records, "bench": kept}
        day = replace(day, sessions=replace(day.sessions, records=records)).prepare()
        specimen = day.laboratory.specimen
        balls = _with_scatter(specimen.balls, self.hit_scatter)
        impact = replace(day.laboratory, specimen=replace(specimen, balls=balls))
        day = replace(day, laboratory=impact)
        while (shots := day.next_shots()).owner.size:
            day = day.fire(shots).judge()
        reduced, sessions = day.reduced, day.collect_records()
        assert reduced is not None
        readings = day.readings or observe_hits(sessions, reduced.preparation)
        certified = evaluate(sessions, reduced, readings)
        control = self.statement.calibration.get(CONTROL)
        true = measurands(
            cast("ImpactStation", self.statement.law),  # has `outcome`, the only method called
            day.laboratory.specimen,
            reduced,
            certified.outcome.weights,
            control.value if control else 1.0,
        )
        return PlayedDays(certified=certified, measurands=true)

    def blocks(self, days: int, first: int = 0) -> Iterator[PlayedDays]:
        """Yield the tests of `days` days whose instruments write sums, in blocks.

        The numbers of the days begin with `first`.
        """
        for begin in range(first, first + days, SIDE_BY_SIDE):
            yield self.play(np.arange(begin, min(begin + SIDE_BY_SIDE, first + days)))

    def _laboratory(self, days: Any, detail: RecordDetail) -> Laboratory:
        statement, law = self.statement, self.statement.law
        stated_rigs = statement.session.rigs
        rigs = {stage: stated_rigs[stage.value] for stage in Stage if stage.value in stated_rigs}
        setup = TestSetup(
            bat=Entry(spec=_bat_sheet(statement), text="", sheet=()),
            ball=Entry(spec=ball_template(statement.rules.spec), text="", sheet=()),
            rules=statement.rules,
            rig=rigs[Stage.IMPACT],
            doubtful_rigs={},
            seed=self.seed,
            number=days,
            faults=self.faults,
            detail=detail,
            made=False,
            history={
                name: Estimates.stack([each] * max(np.size(days), 1))
                for name, each in statement.session.history.items()
            },
        )
        draws = setup.draws(self.seed)
        if lacking := [each.value for each in Stage if each not in rigs]:
            raise InputError("session.json", "rigs", None, f"missing: {', '.join(lacking)}")
        stations = {
            stage: self.faults.station(stage, _commissioned(stage, rig, statement, draws))
            for stage, rig in rigs.items()
        }
        known = {
            constant_name(stage, name): estimate
            for stage, station in stations.items()
            for name, estimate in station.calibration.items()
        }
        stated = {
            name: self._stated(name, estimate, known, draws)
            for name, estimate in statement.calibration.items()
        }
        entered = self.faults.calibration(cast("Any", stated))
        balls = _balls(statement, draws, setup.shape, self.wall_scatter)
        bat = StatedBat(name=statement.session.bat, bodies=(_body(statement),), measured=law.bat)
        return Laboratory(
            setup=setup,
            seed=self.seed,
            salt=SALT,
            date=statement.session.date,
            sealing="",
            draws=draws,
            collision=law,
            stations=stations,
            specimen=Specimen(bat=bat, balls=balls, collision=law),
            calibration={name: _stack(each, setup.count) for name, each in entered.items()},
        )

    @staticmethod
    def _stated(
        name: str, estimate: Estimate, known: Mapping[str, Any], draws: Draws
    ) -> Estimate | Estimates:
        """Return a constant as known on the days.

        One of no instrument, the ratio of a control bat, was measured anew, with its u.
        """
        if name in known:
            return cast("Estimates", known[name])
        if name.startswith("ball.") or not estimate.u:
            return estimate
        error = draws.normal(f"twin.{name}")
        shape = np.shape(error) or (1,)
        return Estimates(
            value=estimate.value + estimate.u * np.reshape(error, shape),
            u=np.full(shape, estimate.u),
            dof=np.full(shape, estimate.dof),
        )


def scattered_as_stated(statement: Statement, seed: int, days: int = SIDE_BY_SIDE) -> TwinDays:
    """Return days whose hits scatter as those of the records.

    Some of the scatter comes from the instruments and the aim. The rest is a scatter of e0, found
    from days with and without one, because a variance is linear in the square of the latter. It is
    0 if instruments and aim alone scatter at least as much as the records.
    """
    squares = np.zeros(2)
    stated = np.array([statement.wall_variance, statement.hit_variance])
    trial = np.full(2, statement.wall_variance)
    without, with_it = (
        _mean_variances(
            TwinDays(
                statement=statement,
                seed=seed,
                wall_scatter=float(np.sqrt(square[0])),
                hit_scatter=float(np.sqrt(square[1])),
            ),
            days,
        )
        for square in (squares, trial)
    )
    scatter = np.sqrt(trial * np.maximum(stated - without, 0.0) / (with_it - without))
    wall, hit = scatter.tolist()
    return TwinDays(statement=statement, seed=seed, wall_scatter=wall, hit_scatter=hit)


def _mean_variances(days: TwinDays, number: int) -> Array:
    """Return the mean variances of a hit at the wall and at the bat."""
    played = days.play(np.arange(number))
    test, sound = played.certified, played.sound
    preparation, metric = test.reduced.preparation, test.results["metric"]
    assert metric.scatter is not None
    hits = (preparation.balls.ball[:, 0] == 0).sum(axis=1)
    wall = preparation.constants["balls.restitution_0"].u ** 2 * hits
    total = metric.scatter.variance
    counted = sound & (total.dof > 0)
    return np.array([wall.mean(), total.total[counted].mean()])


def _stack(estimate: Estimate | Estimates, count: int) -> Estimates:
    return estimate if isinstance(estimate, Estimates) else Estimates.stack([estimate] * count)


def _commissioned(stage: Stage, rig: str, statement: Statement, draws: Draws) -> Station:
    """Return a rig with the stated constants, and true ones that differ by their u."""
    installed = find_rig(rig, stage)
    if not knows_blocks(installed):
        allowed = "has no twin: it is simulated in one laboratory at a time"
        raise InputError("", f"{stage.value} rig", rig, allowed)
    station: Any = installed.commission(draws)
    assert isinstance(station, FittedStation)
    for part in fields(cast("Any", station)):
        old = getattr(station, part.name)
        if isinstance(old, CalibratedInstrument):
            station = replace(
                station, **{part.name: _restated(stage, station, old, statement, draws)}
            )
    if stage is Stage.BENCH:
        station = replace(station, spec=replace(station.spec, **statement.bench))
    drive = statement.sheets.get("impact.drive")
    if stage is Stage.IMPACT and drive and hasattr(station, "drive"):
        station = replace(station, drive=replace(station.drive, **drive))
    return cast("Station", station)


def _restated(
    stage: Stage, station: Any, old: Any, statement: Statement, draws: Draws
) -> CalibratedInstrument[Any]:
    named = [name for name, each in station.instruments().items() if each is old]
    part = named[0] if named else _field_name(station, old)
    spec = replace(old.spec, **statement.sheets.get(f"{stage.value}.{part}", {}))
    prefix = constant_name(stage, f"{part}.")
    name = prefix.rstrip(".")  # of the hall for its air and gravity, which all stages share
    fresh = type(old).commission(spec, draws, f"twin.{name}")
    exact = fresh.exact()
    sheet = {
        key.removeprefix(prefix): estimate
        for key, estimate in statement.calibration.items()
        if key.startswith(prefix) and key.removeprefix(prefix) not in exact
    }
    stated, true = drawn(sheet, draws, f"twin.{name}")
    if stage is Stage.IMPACT and part == "cannon" and statement.across:
        across = statement.across
        true["across"] = across.value + across.u * draws.normal("twin.across")
    true = {**fresh.true, **true}
    if "density" in true and statement.density is not None:
        true["density"] = np.full(np.shape(true["density"]), statement.density)[()]
    return cast("CalibratedInstrument[Any]", replace(fresh, stated=stated, true=true))


def _field_name(station: Any, instrument: Any) -> str:
    return next(part.name for part in fields(station) if getattr(station, part.name) is instrument)


def _body(statement: Statement) -> BatBody:
    """Return a cylinder of the measured barrel; the measured rigid body replaces its mass."""
    length, across = statement.law.bat.length, 2 * statement.barrel_radius
    profile = Profile(z=(0.0, length / 2, length), outer_diameter=(across,) * 3)
    return BatBody(
        profile=profile, material=MATERIAL, damping_ratio=statement.law.ring.damping_ratio
    )


def _bat_sheet(statement: Statement) -> BatSpec:
    session = statement.session
    return BatSpec(
        name=session.bat,
        title=session.bat,
        body=_body(statement),
        spread=NO_SPREAD,
        sport=cast("Any", session.bat_sport or None),
    )


def _balls(
    statement: Statement, draws: Draws, shape: tuple[int, ...], wall_scatter: float
) -> TrueBalls:
    """Return the measured lot; its radius and the slope of its e0 differ by their u."""
    balls = statement.balls
    radius, slope = (
        each.value + each.u * draws.normal(f"twin.{name}")
        for name, each in (("ball.radius", balls.radius), ("ball.slope", balls.slope))
    )
    sport: Any = statement.session.ball_sport or None
    level = np.full(shape, float(balls.restitution.mean()))[()]
    line: Any = RestitutionLine(
        speed=balls.speed, value=cast("Any", level), slope=cast("Any", slope), floor=0.05
    )
    spread = BallSpread(mass=0.0, restitution=0.0, hit_restitution=wall_scatter)
    spec = replace(
        ball_template(statement.rules.spec),
        radius=cast("Any", radius),
        stiffness_spread=0.0,
        restitution=line,
        spread=spread,
        sport=sport,
        ageing=None,
        humidity=None,
    )
    spec = replace(spec, stiffness=cast("Any", np.full(shape, spec.stiffness)[()]))
    whole = (*shape, balls.mass.size)
    return TrueBalls(
        spec=spec,
        mass=np.broadcast_to(balls.mass, whole),
        restitution=np.broadcast_to(balls.restitution, whole),
    )


def _with_scatter(balls: TrueBalls, scatter: float) -> TrueBalls:
    spread = replace(balls.spec.spread, hit_restitution=scatter)
    return replace(balls, spec=replace(balls.spec, spread=spread))
