"""Bat, balls and scatter as the records of a laboratory state them: measured values alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import BallSpec, BallSpread, RestitutionLine, Sport
from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.outcome import curve_of
from virtual_lab.measurement.reduction.air import DENSITY, climate_readings
from virtual_lab.measurement.session_reduction import Preparation, Reduction, reduce_block
from virtual_lab.records import EncoderRecord
from virtual_lab.records.kinds import PassageRecord, RateRecord
from virtual_lab.records.session import Session
from virtual_lab.simulation.physics.beam import RigidBat
from virtual_lab.simulation.stations.rig import Stage
from virtual_lab.studies.foreign import with_installed_rigs
from virtual_lab.studies.own_laboratory.scatter import scatter_of_shots
from virtual_lab.studies.twin.collision import RIGID, StatedCollision, StatedCurve, StatedMotion
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

SAME_PLACE = 1e-6  # resolution of an impact position [m]
FLOOR = 0.05  # smallest e0 of a ball


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """A laboratory as its records state it. Nothing here depends on true values."""

    session: Session
    rules: Entry[Procedure]  # with the numbers of balls and wall hits of the records
    barrel_radius: float  # [m]
    ball: BallSpec  # the measured lot; its radius and the slope of its e0 have their u
    ball_mass: Array  # [kg], (ball,)
    ball_restitution: Array  # e0 at the reference speed, (ball,)
    law: StatedCollision
    hit_variance: float  # variance of the metric of a hit at its impact position [SI]
    wall_variance: float  # variance of the e0 of one hit at the wall
    density: float | None  # density of the air from the climate, None: not read [kg/m³]
    # scatter of the ball's speed [m/s] and, relative, of a swung bat's angular rate, by stage
    scatter: Mapping[Stage, Mapping[str, float]]

    @property
    def constants(self) -> Mapping[str, Estimate]:
        """The stated constants; the density of the air is exact if the climate was read."""
        air = {} if self.density is None else {DENSITY: Estimate(value=self.density)}
        return {**self.session.calibration, **air}

    @property
    def replayed(self) -> bool:
        """Whether the records hold every edge and count."""
        records = self.session.records["impact"].values()
        return not any(isinstance(each, PassageRecord | RateRecord) for each in records)

    @classmethod
    def of(cls, certification: Certification) -> Statement:
        """Return the laboratory as the records of a test state it.

        Raises
        ------
        InputError
            A test without a result, hits or wall hits that are all equal, or a single hit.
        """
        block = certification.block
        if certification.metric is None:
            reason = "; ".join(certification.reasons)
            raise InputError("", "folder", None, f"needs a test with a result: {reason}")
        reduced, _ = reduce_block(block)
        preparation, climate = reduced.preparation, climate_readings(block)
        budget = certification.first_order
        hit_variance = float(budget.scatter.variance.total[0]) if budget and budget.scatter else 0.0
        wall_variance = _wall_variance(preparation)
        for key, value in (("hits", hit_variance), ("wall hits", wall_variance)):
            if not value > 0:
                allowed = "all equal or not repeated, so that they show no scatter; needs repeats"
                raise InputError("", key, None, allowed)
        ball = _ball(preparation, certification.session)
        return cls(
            session=with_installed_rigs(certification.session, certification.procedure.rig),
            rules=_rules(preparation, certification.session),
            barrel_radius=float(preparation.bat.barrel_radius.ravel()[0]),
            ball=ball,
            ball_mass=preparation.lot.mass[0, 0],
            ball_restitution=preparation.lot.best_restitution[0, 0],
            law=_law(reduced, certification, ball),
            hit_variance=hit_variance,
            wall_variance=wall_variance,
            density=float(reduced.constants[DENSITY].value[0]) if climate is not None else None,
            scatter={
                stage: {name: each.value for name, each in spreads.items()}
                for stage, spreads in scatter_of_shots(reduced).items()
            },
        )


def _rules(preparation: Preparation, session: Session) -> Entry[Procedure]:
    """Return the rules with the numbers of balls and wall hits of the records."""
    rules, records = preparation.procedure, session.records
    balls = records["bench"]["ball-mass"].sizes()["item"]
    hits = records["balls"]["log"].sizes()["shot"] / (balls * len(rules.spec.wall_speeds))
    return replace(rules, spec=replace(rules.spec, balls=balls, wall_hits=max(round(hits), 1)))


def _wall_variance(preparation: Preparation) -> float:
    """Return the variance of the e0 of one hit at the wall, pooled over the balls."""
    hits = int((preparation.balls.ball[0, 0] == 0).sum())
    return float(preparation.constants["balls.restitution_0"].u[0]) ** 2 * hits


def _ball(preparation: Preparation, session: Session) -> BallSpec:
    """Return the sheet of the measured lot; stiffness and force law are those of the catalog."""
    lot, constants = preparation.lot, preparation.constants
    radius = constants["ball.radius"].row(0)
    slope, slope_u = float(lot.slope.ravel()[0]), 0.0  # measured at several speeds
    if "balls.slope_repeatability" not in constants:
        slope, slope_u = (
            float(getattr(constants["ball.restitution_slope"], part)[0]) for part in ("value", "u")
        )
    template = catalog.load("balls", preparation.procedure.spec.ball, BallSpec).spec
    line = RestitutionLine(
        speed=float(lot.speed.ravel()[0]),
        value=float(lot.restitution[0, 0].mean()),
        slope=slope,
        slope_u=slope_u,
        floor=FLOOR,
    )
    return replace(
        template,
        radius=radius.value,
        radius_u=radius.u,
        stiffness_spread=0.0,
        restitution=line,
        spread=BallSpread(mass=0.0, restitution=0.0, hit_restitution=0.0),
        sport=cast("Sport | None", session.ball_sport or None),
        ageing=None,
        humidity=None,
    )


def _law(reduced: Reduction, certification: Certification, ball: BallSpec) -> StatedCollision:
    rules, preparation, line = reduced.procedure, reduced.preparation, ball.restitution
    mass, z_cm, inertia, length = (
        float(getattr(preparation.bat, name).ravel()[0])
        for name in ("mass", "z_cm", "inertia_cm", "length")
    )
    axis, turn_rate = length - rules.pivot_from_knob, float(rules.turn_rate(length))
    used, lot = preparation.used[0, 0], preparation.lot
    faster = rules.ball_speed + turn_rate * axis - line.speed  # at the tip
    return StatedCollision(
        curve=_curve(reduced, reduced.shots.lot_collision_efficiency, certification),
        bat=RigidBat(
            length=length,
            mass=mass,
            first_moment=mass * z_cm,
            second_moment=inertia + mass * z_cm**2,
        ),
        axis=axis,
        free=rules.recoil == "free",
        ball_mass=float(lot.mass[0, 0][used].mean()),
        ball_restitution=(
            float(lot.best_restitution[0, 0][used].mean()) + line.slope * faster,
            -line.slope * turn_rate,
        ),
        motion=_motion(reduced, certification),
    )


def _curve(reduced: Reduction, e_A: Array, certification: Certification) -> StatedCurve:
    """Return the curve through the valid hits, (shot,)."""
    rules, used = reduced.procedure, certification.hit_weights.used
    valid = reduced.valid & np.isfinite(e_A)
    if rules.scan is None:
        middle, mean = (np.array([each[valid].mean()]) for each in (reduced.position, e_A))
        return StatedCurve(place=middle, efficiency=mean, slope=rules.place_slope)
    place = np.round(reduced.position / SAME_PLACE) * SAME_PLACE
    at, where = np.unique(place[valid], return_inverse=True)
    means = np.bincount(where, e_A[valid]) / np.bincount(where)
    fitted = curve_of(rules, reduced.position, used, e_A)
    if fitted is None or at.size == 1:
        return StatedCurve(place=at, efficiency=means)
    low, high = float(place[used].min()), float(place[used].max())
    means = np.where((at >= low) & (at <= high), fitted(at), means)
    return StatedCurve(place=at, efficiency=means, fitted=fitted, ends=(low, high))


def _motion(reduced: Reduction, certification: Certification) -> StatedMotion:
    """Return the mean motion of the shots, with the frequencies and decays of the fit."""
    from virtual_lab.measurement.reduction.recoil import RECOIL, project, turn_and_rings

    record, fit = certification.block.impact.get("encoder"), certification.readings.recoil
    if not isinstance(record, EncoderRecord) or fit is None or not fit.ring_frequency.size:
        return RIGID
    contact = certification.readings.flights.raw.contact
    valid = reduced.valid & np.isfinite(contact) & np.isfinite(fit.rate)
    after = record.times > np.nanmax(contact) + RECOIL.settling_time
    times = record.times[after]
    origin, span = times[0], times[-1] - times[0]
    rings = np.column_stack([fit.ring_frequency, fit.ring_decay]) * span
    basis = turn_and_rings((times - origin) / span, rings)
    terms, _ = project(basis, record.counts[valid][:, after].T)
    cosine, sine = terms[RECOIL.polynomial_order + 1 :].reshape(len(rings), 2, -1).swapaxes(0, 1)
    pace = 2j * np.pi * fit.ring_frequency - fit.ring_decay  # growth rate of each phasor [1/s]
    back = contact[valid] + RECOIL.contact_duration - origin
    phasor = (cosine - 1j * sine) * np.exp(np.outer(pace, back)) / fit.rate[valid]
    mean = phasor.mean(axis=1)
    return StatedMotion(
        angular_frequencies=np.append(0.0, pace.imag),
        angle=np.append(0.0, mean.real),
        rate=np.append(1.0, (mean * pace).real),
        damping_ratio=float(np.median(fit.ring_decay / pace.imag)),
    )
