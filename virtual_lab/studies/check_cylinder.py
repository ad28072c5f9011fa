"""A laboratory's sessions with its check standard: a steel cylinder in place of the bat.

The bench measures the cylinder and the wall rig the check balls once; then, session by session,
one ball is fired at its centre of percussion, and pivot rig and reduction give e_A. The impact rig
may have a fault from a given day on; the charts have no information about it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError
from virtual_lab.lab import Laboratory, TestSetup, by_the_book
from virtual_lab.lab.plans import with_records
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.reduction.observations import along_of
from virtual_lab.measurement.session_reduction import reduce_session
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.rig import ShotPlan, Stage
from virtual_lab.units import Array


def check_cylinder(
    days: int, hits: int, *, seed: int, faults: Sequence[str] = (), since: int = 1
) -> Array:
    """Return the cylinder's measured e_A session by session, the mean of its valid hits, (day,).

    Parameters
    ----------
    days, hits
        Sessions, and hits in each.
    seed
        Seed of the laboratory; its hits are numbered through all sessions.
    faults, since
        Faults of the impact rig, and their first day, counted from 1. Faults may change every
        edge and count, so with a fault the instruments write complete records, which takes thirty
        times as long.

    Raises
    ------
    InputError
        An unknown fault, or one that this rig cannot have; a day without a valid hit.
    """
    stage, procedure = Stage.IMPACT, "astm-f1881"
    rules = catalog.load("procedures", procedure, Procedure).spec
    wrong = FaultSet.of(faults, rig=rules.rig)
    setup = TestSetup.of(
        "check-cylinder",
        procedure=procedure,
        seed=seed,
        detail=RecordDetail.FULL if faults else RecordDetail.SUMMED,
    )
    laboratory = Laboratory.open(replace(setup, ball=catalog.load("balls", "check-ball", BallSpec)))
    session = by_the_book(laboratory).of(0).certification.session
    plan = ShotPlan(
        slot=np.arange(hits),
        ball=np.zeros(hits, dtype=int),
        speed=np.full(hits, rules.ball_speed),
        place=np.full(hits, reduce_session(session).readings.place[0] - along_of(session)),
        detail=setup.detail,
    )
    values = []
    for number in range(1, days + 1):
        day = wrong if number >= since else FaultSet()
        station = day.station(stage, laboratory.stations[stage])
        beyond_the_test = 1_000_000 + number * hits
        today = replace(plan, slot=beyond_the_test + plan.slot)
        play = day.play(stage, station, today, laboratory.specimen, laboratory.draws)
        found = reduce_session(with_records(session, stage, [play]))
        valid = found.judgement.valid
        if not valid.any():
            reason = found.judgement.reasons[0]
            raise InputError("", "day", number, f"no hit at the check cylinder is valid: {reason}")
        values.append(float(found.shots.lot_collision_efficiency[valid].mean()))
    return np.array(values)
