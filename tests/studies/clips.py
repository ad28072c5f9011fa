"""One filmed shot in each of many laboratories: coverage of the camera's intervals.

    python -m tests.studies.clips CLIPS CLIPS.CSV

Each laboratory has a random bat, random balls, calibration errors, spin and seams. Its camera
writes image windows, the tracker locates the ball in them, and v_in, v_out and e_A of the shot are
compared with their true values.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np

from virtual_lab.files.tables import write_csv
from virtual_lab.lab import Laboratory, TestSetup, prepare_day
from virtual_lab.lab.plans import with_records
from virtual_lab.measurement.camera.comparison import compare_camera
from virtual_lab.measurement.session_reduction import reduce_block
from virtual_lab.output.result import frame
from virtual_lab.output.tables import column, table_text
from virtual_lab.records.block import SessionBlock
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import ShotPlan, Stage
from virtual_lab.uncertainty.estimate import share_interval
from virtual_lab.units import INCH, Array

QUANTITIES = {  # names in the camera's u and in the truth
    "v_in": ("speed_in", "speed"),
    "v_out": ("speed_out", "rebound_speed"),
    "e_A": ("efficiency", "collision_efficiency"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ClipCoverage:
    """Coverage of the intervals of one quantity over clips. Errors are relative.

    A clip is missed if its shot was rejected or has no speed. `coverage_low` and `coverage_high`
    are the limits of the coverage (95 %, Clopper-Pearson).
    """

    quantity: str
    clips: int = column("clips with a result")
    missed_clips: int = column("clips without a result")
    coverage: float = column("intervals with the true value", form=".1%")
    coverage_low: float = column("  at least", form=".1%")
    coverage_high: float = column("  at most", form=".1%")
    rms_error_percent: float = column("rms error", "%", ".3f")
    rms_u_percent: float = column("rms of the stated u", "%", ".3f")
    bias_percent: float = column("mean error", "%", "+.4f")
    bias_se_percent: float = column("  its standard error", "%", ".4f")


def clip_coverage(clips: int, seed: int = 1, *, summed: bool = False) -> list[ClipCoverage]:
    """Return the coverage of the ball speeds v_in and v_out and of the collision efficiency e_A.

    R161 is tested by `bbcor`. The laboratories have the seeds from `seed` on. With `summed`, the
    camera writes positions of the ball with the least possible scatter instead of pictures.
    """
    clips_of_laboratories: list[Array] = []
    detail = RecordDetail.SUMMED if summed else RecordDetail.FULL
    for number in range(clips):
        setup = TestSetup.of(
            "r161",
            procedure="bbcor",
            rig="filmed-cannon",
            seed=seed + number,
            detail=RecordDetail.SUMMED,
        )
        clips_of_laboratories.append(_clip(Laboratory.open(setup), detail))
    values = np.array(clips_of_laboratories)
    return [_row(name, *values[:, place].T) for place, name in enumerate(QUANTITIES)]


def _clip(laboratory: Laboratory, detail: RecordDetail) -> Array:
    """Film one shot. Return value, u and true value of each quantity [SI], shape (quantity, 3).

    All values are NaN if the shot is rejected.
    """
    day = prepare_day(laboratory)
    ready, rules, stage = day.laboratory, laboratory.rules.spec, Stage.IMPACT
    plan = ShotPlan(
        slot=np.zeros(1, dtype=int),
        ball=np.zeros(1, dtype=int),
        speed=np.full(1, rules.ball_speed),
        place=np.full(1, 6 * INCH),
        detail=detail,
    )
    play = ready.stations[stage].play(plan, ready.specimen, ready.draws)
    session = with_records(day.session, stage, [play])
    block = SessionBlock.of(session)
    reduced, readings = reduce_block(block)
    camera = compare_camera(block, reduced, readings, reduced.hit_weights)
    assert camera is not None
    if not reduced.valid[0]:
        return np.full((len(QUANTITIES), 3), np.nan)
    flights = camera.filmed.flights
    measured = (flights.speed_in, flights.speed_out, camera.shots.rebound_efficiency)
    return np.array(
        [
            [value[0], camera.u[name][0], play.truth[true][0]]
            for value, (name, true) in zip(measured, QUANTITIES.values(), strict=True)
        ]
    )


def _row(quantity: str, value: Array, u: Array, true: Array) -> ClipCoverage:
    has_result = np.isfinite(value)
    error, u = (value - true)[has_result], u[has_result]
    covered = int((np.abs(error) <= 1.959964 * u).sum())
    low, high = share_interval(covered, error.size)
    relative = error / true[has_result]
    return ClipCoverage(
        quantity=quantity,
        clips=int(error.size),
        missed_clips=int((~has_result).sum()),
        coverage=covered / error.size,
        coverage_low=low,
        coverage_high=high,
        rms_error_percent=100 * sqrt(float(np.mean(relative**2))),
        rms_u_percent=100 * sqrt(float(np.mean((u / true[has_result]) ** 2))),
        bias_percent=100 * float(relative.mean()),
        bias_se_percent=100 * float(relative.std(ddof=1)) / sqrt(error.size),
    )


if __name__ == "__main__":
    rows = clip_coverage(int(sys.argv[1]))
    print(table_text(rows))
    write_csv(frame(rows), Path(sys.argv[2]))
