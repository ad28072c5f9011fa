"""Daily tests of a check standard: a steel cylinder in place of the bat.

The cylinder is measured once at the bench, and the check ball once at the wall rig. Then, on each
day, the ball is fired at the center of percussion of the cylinder, and e_A is computed from the
records. From a given day on, the impact rig may have a fault; the control charts do not use this
information.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError
from virtual_lab.lab import Laboratory, TestSetup, run_test
from virtual_lab.lab.plans import with_records
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.reduction.observations import along_of
from virtual_lab.measurement.session_reduction import (
    observe_hits,
    prepare,
    reduce_shots,
)
from virtual_lab.records.block import SessionBlock
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import ShotPlan, Stage
from virtual_lab.units import Array


def check_cylinder(
    days: int, hits: int, *, seed: int, faults: Sequence[str] = (), since: int = 1
) -> Array:
    """Return the mean measured collision efficiency at the check cylinder on each day, (day,).

    Only the valid hits are used.

    Parameters
    ----------
    days, hits
        Number of days, and number of hits per day, each at least 1.
    seed
        Seed of the laboratory. The hits of different days have different random errors.
    faults, since
        Names of faults of the impact rig, and the first day on which they occur, counted from 1.
        With a fault the instruments record every gate edge and encoder count, which takes thirty
        times as long.

    Raises
    ------
    InputError
        A fault is unknown or impossible for this rig, or a day has no valid hit.
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
    tested = run_test(laboratory).of(0).certification
    session, preparation = tested.session, prepare(tested.block)
    place = tested.readings.position[0] - along_of(session)
    # Complete records are reduced day by day, summed records all at once.
    together = 1 if faults else days
    values = []
    for first in range(1, days + 1, together):
        day = wrong if first >= since else FaultSet()
        station = day.station(stage, laboratory.stations[stage])
        beyond_the_test = 1_000_000 + first * hits
        plan = ShotPlan(
            slot=beyond_the_test + np.arange(together * hits),
            ball=np.zeros(together * hits, dtype=int),
            speed=np.full(together * hits, rules.ball_speed),
            place=np.full(together * hits, place),
            detail=setup.detail,
        )
        play = day.play(stage, station, plan, laboratory.specimen, laboratory.draws)
        recorded = SessionBlock.of(with_records(session, stage, [play]))
        readings = observe_hits(recorded, preparation)
        reduced = reduce_shots(recorded, preparation, readings)
        valid = reduced.valid.reshape(together, hits)
        for number, hit in enumerate(valid, first):
            if not hit.any():
                reason = reduced.judgement(readings).reasons[(number - first) * hits]
                allowed = f"no hit at the check cylinder is valid: {reason}"
                raise InputError("", "day", number, allowed)
        efficiency = reduced.shots.lot_collision_efficiency.reshape(together, hits)
        values.append(efficiency.mean(axis=1, where=valid))
    return np.concatenate(values)
