"""Bat, balls and instruments as the records of a laboratory state them: measured values alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any, TypeGuard

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.outcome import curve_of
from virtual_lab.measurement.reduction.air import DENSITY, climate, climate_readings
from virtual_lab.measurement.reduction.gates import INBOUND
from virtual_lab.measurement.reduction.observations import reference_readings
from virtual_lab.measurement.session_reduction import Preparation, Reduction, reduce_block
from virtual_lab.records import (
    REFERENCE_MASS,
    AimMarks,
    BoardRecord,
    EncoderRecord,
    GateRecord,
    PendulumRecord,
    Record,
)
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.session import Session
from virtual_lab.simulation.instruments.climate import HallSpec
from virtual_lab.simulation.physics.beam import RigidBat
from virtual_lab.studies.twin.collision import (
    NO_RING,
    Ring,
    StatedCollision,
    StatedCurve,
)
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

Changes = dict[str, Any]  # values of a data sheet by name
SAME_PLACE = 1e-6  # resolution of an impact position [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedBalls:
    """The lot as measured, arrays (ball,)."""

    mass: Array  # [kg]
    restitution: Array  # e0 at `speed`
    speed: float  # mean nominal speed of the wall hits [m/s]
    slope: Estimate  # slope of e0 over speed [s/m]; without u if the wall was hit at several speeds
    radius: Estimate  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """A laboratory as its records state it. Nothing here depends on true values."""

    session: Session
    rules: Entry[Procedure]  # with the numbers of balls and wall hits of the records
    barrel_radius: float  # [m]
    balls: StatedBalls
    law: StatedCollision
    hit_variance: float  # variance of the metric of a hit at its impact position [SI]
    wall_variance: float  # variance of the e0 of one hit at the wall
    density: float | None  # density of the air from the climate, None: not read [kg/m³]
    across: Estimate | None  # mean height of the marks above the line of fire [m]
    bench: Changes  # changes of the bench's own sheet
    sheets: Mapping[str, Changes]  # changes of each instrument's sheet, by stage.instrument
    replayed: bool  # whether the records hold every edge and count

    @property
    def calibration(self) -> Mapping[str, Estimate]:
        """The stated constants."""
        return self.session.calibration


def stated_by(certification: Certification) -> Statement:
    """Return the laboratory as the records of a test state it.

    Raises
    ------
    InputError
        A test without a result, hits or wall hits that are all equal, or a single hit.
    """
    session, block = certification.session, certification.block
    if certification.metric is None:
        reason = "; ".join(certification.reasons)
        raise InputError("", "folder", None, f"needs a test with a result: {reason}")
    reduced, _ = reduce_block(block)
    preparation = reduced.preparation
    rules = _rules_of_records(preparation.procedure, block)
    variance = certification.first_order and certification.first_order.scatter
    hit_variance = float(variance.variance.total[0]) if variance else 0.0
    wall_variance = _wall_variance(preparation)
    for key, value in (("hits", hit_variance), ("wall hits", wall_variance)):
        if not value > 0:
            allowed = "all equal or not repeated, so that they show no scatter; needs repeats"
            raise InputError("", key, None, allowed)
    balls = _balls(preparation)
    marks = block.impact.get("aim")
    across = None
    if _several(marks):
        scatter = float(marks.across.std(ddof=1)) / sqrt(marks.across.size)
        across = Estimate(value=float(marks.across.mean()), u=scatter)
    air = climate_readings(block)
    constants = reduced.constants
    return Statement(
        session=session,
        rules=rules,
        barrel_radius=float(preparation.bat.barrel_radius.ravel()[0]),
        balls=balls,
        law=_law(reduced, certification, balls),
        hit_variance=hit_variance,
        wall_variance=wall_variance,
        density=float(constants[DENSITY].value[0]) if air is not None else None,
        across=across,
        bench=_bench_sheet(block, preparation),
        sheets=_sheets(block, reduced),
        replayed=all(
            isinstance(record, GateRecord | BoardRecord | EncoderRecord)
            for name, record in block.impact.items()
            if name in ("gates", "encoder", "swing")
        ),
    )


def _several(marks: Record | None) -> TypeGuard[AimMarks]:
    """Return whether there are aim marks that show a scatter."""
    return isinstance(marks, AimMarks) and marks.along.size > 1


def _rules_of_records(rules: Entry[Procedure], block: SessionBlock) -> Entry[Procedure]:
    """Return the rules with the numbers of balls and wall hits of the records."""
    spec, log = rules.spec, block.records["balls"]["log"]
    balls = block.records["bench"]["ball-mass"].sizes()["item"]
    hits = round(log.sizes()["shot"] / (balls * len(spec.wall_speeds)))
    return replace(rules, spec=replace(spec, balls=balls, wall_hits=max(hits, 1)))


def _wall_variance(preparation: Preparation) -> float:
    """Return the variance of the e0 of one hit at the wall, pooled over the balls."""
    of_mean = preparation.constants["balls.restitution_0"]
    hits = int((preparation.balls.ball[0, 0] == 0).sum())
    return float(of_mean.u[0]) ** 2 * hits


def _balls(preparation: Preparation) -> StatedBalls:
    lot, constants = preparation.lot, preparation.constants
    slope = constants["ball.restitution_slope"].row(0)
    measured = float(lot.slope.ravel()[0])
    if "balls.slope_repeatability" in constants:
        slope = Estimate(value=measured)
    return StatedBalls(
        mass=lot.mass[0, 0],
        restitution=lot.restitution[0, 0],
        speed=float(lot.speed.ravel()[0]),
        slope=slope,
        radius=constants["ball.radius"].row(0),
    )


def _law(reduced: Reduction, certification: Certification, balls: StatedBalls) -> StatedCollision:
    rules, shots, preparation = reduced.procedure, reduced.shots, reduced.preparation
    mass, z_cm, inertia, length = (
        float(getattr(preparation.bat, name).ravel()[0])
        for name in ("mass", "z_cm", "inertia_cm", "length")
    )
    axis = length - rules.pivot_from_knob
    used = preparation.used[0, 0]
    at_speed = rules.ball_speed + float(rules.turn_rate(length)) * axis - balls.speed
    fall = -float(rules.turn_rate(length))  # change of the relative speed along the bat [1/s]
    return StatedCollision(
        curve=_curve(reduced, shots.lot_collision_efficiency, certification),
        bat=RigidBat(
            length=length,
            mass=mass,
            first_moment=mass * z_cm,
            second_moment=inertia + mass * z_cm**2,
        ),
        axis=axis,
        free=rules.recoil == "free",
        ball_mass=float(balls.mass[used].mean()),
        ball_restitution=(
            float(balls.restitution[used].mean()) + balls.slope.value * at_speed,
            balls.slope.value * fall,
        ),
        ring=_ring(reduced, certification),
    )


def _curve(reduced: Reduction, e_A: Array, certification: Certification) -> StatedCurve:
    """Return the curve through the valid hits, (shot,)."""
    rules, used = reduced.procedure, certification.outcome.used
    valid = reduced.valid & np.isfinite(e_A)
    place = np.round(reduced.place / SAME_PLACE) * SAME_PLACE
    at, where = np.unique(place[valid], return_inverse=True)
    means = np.bincount(where, e_A[valid]) / np.bincount(where)
    if rules.scan is None:
        middle = np.array([reduced.place[valid].mean()])
        return StatedCurve(
            place=middle, efficiency=np.array([e_A[valid].mean()]), slope=rules.place_slope
        )
    fitted = curve_of(rules, reduced.place, used, e_A)
    if fitted is None or at.size == 1:
        return StatedCurve(place=at, efficiency=means)
    low, high = float(place[used].min()), float(place[used].max())
    inside = (at >= low) & (at <= high)
    means = np.where(inside, fitted(at), means)
    return StatedCurve(place=at, efficiency=means, fitted=fitted, ends=(low, high))


def _ring(reduced: Reduction, certification: Certification) -> Ring:
    """Return the mean vibration of the shots, from the frequencies and decays of the fit."""
    from virtual_lab.measurement.reduction.recoil import RECOIL, project, turn_and_rings

    record, fit = certification.block.impact.get("encoder"), certification.readings.recoil
    if not isinstance(record, EncoderRecord) or fit is None or not fit.ring_frequency.size:
        return NO_RING
    contact = certification.readings.flights.raw.contact
    valid = reduced.valid & np.isfinite(contact) & np.isfinite(fit.rate)
    after = record.times > np.nanmax(contact) + RECOIL.settling_time
    times = record.times[after]
    origin, span = times[0], times[-1] - times[0]
    rings = np.column_stack([fit.ring_frequency, fit.ring_decay]) * span
    basis = turn_and_rings((times - origin) / span, rings)
    terms, _ = project(basis, record.counts[valid][:, after].T)
    pairs = terms[RECOIL.polynomial_order + 1 :].reshape(len(rings), 2, -1)
    cosine, sine = pairs.swapaxes(0, 1)
    pace = 2j * np.pi * fit.ring_frequency - fit.ring_decay  # growth rate of each phasor [1/s]
    back = contact[valid] + RECOIL.contact_duration - origin
    phasor = (cosine - 1j * sine) * np.exp(np.outer(pace, back)) / fit.rate[valid]
    mean = phasor.mean(axis=1)
    omega = 2 * np.pi * fit.ring_frequency
    return Ring(
        angular_frequency=omega,
        damping_ratio=float(np.median(fit.ring_decay / omega)),
        angle=mean.real,
        rate=(mean * pace).real,
    )


def _scatter(readings: Array, step: float) -> float:
    """Return the scatter of repeated readings (item, repeat), without that of the rounding."""
    variance = float(readings.var(axis=1, ddof=1).mean()) - step**2 / 12
    return sqrt(max(variance, 0.0))


def _bench_sheet(block: SessionBlock, preparation: Preparation) -> Changes:
    """Return the numbers of readings, the reference mass and the climate of hall and store."""
    records, constants = block.records["bench"], block.calibration
    pendulum = records["pendulum"]
    assert isinstance(pendulum, PendulumRecord)
    sheet: Changes = {
        "repeats": records["bat-mass"].sizes()["repeat"],
        "releases": len(pendulum.times),
        "store": None,
    }
    if REFERENCE_MASS in records:
        zero, span = (float(constants[f"bench.scale.{key}"].value[0]) for key in ("zero", "span"))
        sheet["reference"] = (float(reference_readings(block).mean()) - zero) / span
    for part, channel in (("hall", "climate"), ("store", "store")):
        readings = climate_readings(block, channel)
        if readings is None:
            continue
        means = {name: float(at.mean()) for name, (at, _) in climate(block, readings).items()}
        sheet[part] = HallSpec(
            temperature=means["temperature"],
            temperature_spread=0.0,
            temperature_change=0.0,
            humidity=means["humidity"],
            humidity_spread=0.0,
            humidity_change=0.0,
        )
    return sheet


def _sheets(block: SessionBlock, reduced: Reduction) -> dict[str, Changes]:
    """Return the changes of the data sheets, by stage.instrument, that the records show."""
    bench, constants = block.records["bench"], block.calibration
    exact = {name: float(each.value[0]) for name, each in constants.items()}
    sheets: dict[str, Changes] = {}
    tables: Mapping[str, Any] = bench
    for name, channels in (
        ("scale", ("bat-mass", "ball-mass")),
        ("rule", ("length", "barrel-radius")),
        ("stand", ("balance",)),
    ):
        step = exact[f"bench.{name}.resolution"]
        parts = [_scatter(tables[each].readings, step) for each in channels]
        sheets[f"bench.{name}"] = {"resolution": step, "repeatability": float(np.mean(parts))}
    sheets["bench.pendulum"] = _pendulum_sheet(bench["pendulum"], exact)
    sheets["bench.climate"] = {
        name.removeprefix("bench.climate."): value
        for name, value in exact.items()
        if name.startswith("bench.climate.") and name.endswith("_resolution")
    }
    balls = reduced.preparation.balls
    seen = balls.flights.raw.speed_in[0, 0]
    speeds = [seen[balls.nominal_speed[0, 0] == at] for at in np.unique(balls.nominal_speed)]
    sheets["balls.cannon"] = {"speed_scatter": _spread(speeds)}
    fired = reduced.shots.speed[np.isfinite(reduced.shots.speed)]
    sheets["impact.cannon"] = {"speed_scatter": _spread([fired]), "mark_resolution": 0.0}
    marks = block.impact.get("aim")
    if _several(marks):
        sheets["impact.cannon"] |= {
            "along_scatter": float(marks.along.std(ddof=1)),
            "across_scatter": float(marks.across.std(ddof=1)),
            "marks": marks.along.size,
        }
    for stage in ("balls", "impact"):
        sheets[f"{stage}.gates"] = _gate_sheet(stage, block.records[stage].get("gates"), exact)
    for name in ("encoder", "swing"):
        if f"impact.{name}.counts_per_turn" in exact:
            turn = exact[f"impact.{name}.counts_per_turn"]
            sheets[f"impact.{name}"] = {"counts_per_turn": turn} | _recorder(block.impact.get(name))
    if "swing" in block.impact:
        rates = reduced.shots.swing_rate[np.isfinite(reduced.shots.swing_rate)]
        sheets["impact.drive"] = {"speed_scatter": _spread([rates]) / float(rates.mean())}
    return sheets


def _spread(groups: list[Array]) -> float:
    """Return the pooled standard deviation of groups of values."""
    several = [each for each in groups if each.size > 1]
    dof = sum(each.size - 1 for each in several)
    return sqrt(sum(float(each.var()) * each.size for each in several) / dof) if dof else 0.0


def _pendulum_sheet(record: Any, exact: Mapping[str, float]) -> Changes:
    swings = record.times.shape[1] - 1
    spans = record.times[:, -1] - record.times[:, 0]
    offset = exact["bench.pendulum.amplitude_offset"]
    first, last = record.first_amplitude.mean() - offset, record.last_amplitude.mean() - offset
    return {
        "swings": swings,
        "release_amplitude": float(first),
        "amplitude_decay": float(1 - (last / first) ** (1 / swings)) if last < first else 0.0,
        "amplitude_resolution": 0.0,
        "timer_resolution": 0.0,
        "timer_jitter": float(spans.std(ddof=1)) / sqrt(2),
    }


def _gate_sheet(stage: str, record: Any, exact: Mapping[str, float]) -> Changes:
    """Return positions of the gates, and the jitter of their edges if the record shows it."""
    prefix = f"{stage}.gates."
    numbers = range(sum(key.startswith(f"{prefix}distance_") for key in exact))
    sheet: Changes = {"distances": tuple(exact[f"{prefix}distance_{at}"] for at in numbers)}
    for key in ("lowest", "pitch"):
        if f"{prefix}{key}" in exact:
            sheet[key] = exact[f"{prefix}{key}"]
    if isinstance(record, BoardRecord):
        sheet |= {"beams": record.times.shape[3], "heights": ()}
    elif isinstance(record, GateRecord):
        # the chords of an incoming ball at two gates differ by the jitter of four edges
        chords = np.diff(record.times[:, INBOUND], axis=-1)[..., 0]
        apart = chords[:, 0] - chords[:, -1]
        apart = apart[np.isfinite(apart)]
        if apart.size > 1:
            sheet |= {"edge_jitter": float(apart.std(ddof=1)) / 2, "tick": 0.0}
    return sheet


def _recorder(record: Any) -> Changes:
    if not isinstance(record, EncoderRecord):
        return {}
    tick = float(record.times[1] - record.times[0])
    whole = bool(np.array_equal(record.counts, np.rint(record.counts)))
    return {
        "sample_rate": 1 / tick,
        "duration": record.times.size * tick,
        "whole_counts": whole,
    }


def ball_template(rules: Procedure) -> BallSpec:
    """Return the nominal ball of a procedure, for the duration of its contact with a wall."""
    return catalog.load("balls", rules.ball, BallSpec).spec
