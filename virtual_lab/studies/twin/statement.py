"""Instruments, bat, balls and scatter as the records of a laboratory state them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.reading import Key
from virtual_lab.catalog.specs import (
    NO_SPREAD,
    BallSpec,
    BatBody,
    BatSpec,
    BatSport,
    Lump,
    Material,
    Profile,
)
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.procedure.outcome import curve_of
from virtual_lab.measurement.session_reduction import Preparation, Reduction, reduce_block
from virtual_lab.records import EncoderRecord
from virtual_lab.records.kinds import PassageRecord, RateRecord
from virtual_lab.records.session import Session
from virtual_lab.sheets import toml_text
from virtual_lab.simulation.instruments.calibrated import StandardDeviation
from virtual_lab.simulation.physics.beam import RigidBat, rigid_bat
from virtual_lab.simulation.stations.rig import Stage, find_rig, knows_blocks
from virtual_lab.studies.foreign import with_installed_rigs
from virtual_lab.studies.own_laboratory.ball import scatter_of_hits, stated_ball
from virtual_lab.studies.own_laboratory.own_laboratory import restated_sheets, sheet_text
from virtual_lab.studies.own_laboratory.rig_sheets import Document, stated_rigs
from virtual_lab.studies.own_laboratory.scatter import scatter_of_shots
from virtual_lab.studies.twin.collision import RIGID, StatedCollision, StatedCurve, StatedMotion
from virtual_lab.units import Array

SAME_PLACE = 1e-6  # resolution of an impact position [m]
SOURCE = "stated in the records"
# material of a cylinder that weighs next to nothing; its lump has the mass of the bat
MATERIAL = Material(density=1e-3, youngs_modulus=1e10, shear_modulus=1e9, shear_coefficient=0.9)


@dataclass(frozen=True, kw_only=True)
class Statement:
    """A laboratory as its records state it. Nothing here depends on true values."""

    session: Session
    rules: Entry[Procedure]  # the numbers of balls and wall hits are those of the records
    bat: Entry[BatSpec]  # a bat of the measured mass, balance, inertia and barrel
    ball: Document  # content of the sheet of the measured lot
    law: StatedCollision
    # standard deviation of a hit: of e0 at the wall, and of the metric at the bat [SI]
    hit_scatters: Mapping[str, StandardDeviation]
    shot_scatters: Mapping[Stage, Mapping[str, StandardDeviation]]  # scatter of speeds by stage

    @cached_property
    def sheets(self) -> Mapping[Key, str]:
        """The texts of the sheets of rigs and instruments.

        Raises `InputError` if a rig is not installed here, if it cannot be simulated in blocks, or
        if it lacks a channel of the records.
        """
        session = self.session
        for stage in Stage:
            name = session.rigs[stage.value]
            rig = find_rig(name, stage)
            if not knows_blocks(rig):
                allowed = "has no twin: it is simulated in one laboratory at a time"
                raise InputError("", f"{stage.value} rig", name, allowed)
            if foreign := ", ".join(session.records[stage.value].keys() - rig.channels.keys()):
                allowed = f"has no twin: {name} records {', '.join(rig.channels)}"
                raise InputError("", f"{stage.value} records", foreign, allowed)
        rigs = {each.rig: each.statements for each in stated_rigs(session, self.shot_scatters)}
        return {
            key: sheet_text(parse_toml(*catalog.source(*base)), numbers, parts, SOURCE)
            for key, base, numbers, parts in restated_sheets(rigs)
        }

    @property
    def has_full_records(self) -> bool:
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
        if certification.metric is None:
            reason = "; ".join(certification.reasons)
            raise InputError("", "folder", None, f"needs a test with a result: {reason}")
        hit_scatters = scatter_of_hits(certification)
        for key, place in (("hits", "bat"), ("wall hits", "wall")):
            if place not in hit_scatters:
                allowed = "all equal or not repeated, so that they show no scatter; needs repeats"
                raise InputError("", key, None, allowed)
        reduced, _ = reduce_block(certification.block)
        ball, _ = stated_ball([certification])
        law = _law(reduced, certification, ball)
        session = with_installed_rigs(certification.session, certification.procedure.rig)
        return cls(
            session=session,
            rules=_rules(reduced.preparation, session),
            bat=_bat(reduced.preparation, session, law),
            ball=ball,
            law=law,
            hit_scatters=hit_scatters,
            shot_scatters=scatter_of_shots(reduced),
        )


def _rules(preparation: Preparation, session: Session) -> Entry[Procedure]:
    """Return the rules with the numbers of balls and wall hits of the records."""
    rules, records = preparation.procedure, session.records
    balls = records["bench"]["ball-mass"].sizes()["item"]
    hits = records["balls"]["log"].sizes()["shot"] / (balls * len(rules.spec.wall_speeds))
    return replace(rules, spec=replace(rules.spec, balls=balls, wall_hits=max(round(hits), 1)))


def _bat(preparation: Preparation, session: Session, law: StatedCollision) -> Entry[BatSpec]:
    """Return a cylinder of the measured barrel, with a lump for the measured rigid body."""
    wanted, length = law.bat, law.bat.length
    diameter = 2 * float(preparation.bat.barrel_radius.ravel()[0])
    profile = Profile(z=(0.0, length / 2, length), outer_diameter=(diameter,) * 3)
    body = BatBody(profile=profile, material=MATERIAL, damping_ratio=law.motion.damping_ratio)
    bare = rigid_bat(body)
    mass = wanted.mass - bare.mass
    z = (wanted.first_moment - bare.first_moment) / mass
    inertia = wanted.second_moment - bare.second_moment - mass * z**2
    lump = Lump(name="bat", z=z, mass=mass, inertia=inertia)
    spec = BatSpec(
        name=session.bat,
        title=session.bat,
        body=replace(body, lumps=(lump,)),
        spread=NO_SPREAD,
        sport=cast("BatSport | None", session.bat_sport or None),
    )
    return Entry(spec=spec, text="", sheet=())


def _law(reduced: Reduction, certification: Certification, ball: Document) -> StatedCollision:
    rules, preparation = reduced.procedure, reduced.preparation
    line = catalog.read(toml_text(ball), rules.ball, BallSpec).spec.restitution
    mass, z_cm, inertia, length = (
        float(getattr(preparation.bat, name).ravel()[0])
        for name in ("mass", "z_cm", "inertia_cm", "length")
    )
    axis, turn_rate = length - rules.pivot_from_knob, float(rules.turn_rate(length))
    used, lot = preparation.used[0, 0], preparation.lot
    faster = rules.ball_speed + turn_rate * axis - line.speed  # speed at the tip above `line.speed`
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
