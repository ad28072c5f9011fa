"""One filmed shot in each of many laboratories: coverage of the camera's intervals.

Each laboratory has a random bat, random balls, calibration errors, spin and seams. Its camera
writes image windows, the tracker locates the ball in them, and v_in, v_out and e_A of the shot are
compared with their true values.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.lab import Laboratory, TestSetup, prepare_day
from virtual_lab.lab.plans import with_records
from virtual_lab.measurement.camera.comparison import compare_camera
from virtual_lab.measurement.session_reduction import reduce_block
from virtual_lab.output.intervals import Interval, draw_intervals
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.tables import column
from virtual_lab.parameters import Seed
from virtual_lab.records.block import SessionBlock
from virtual_lab.sheets import AnyBat, AnyProcedure, Instruments, entry_name
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import ShotPlan, Stage
from virtual_lab.uncertainty.estimate import share_interval
from virtual_lab.units import INCH, Array

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

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


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ClipTable(Rows[ClipCoverage]):
    """Coverage of the intervals of each quantity."""

    def draw(self) -> PageFigure:
        """Draw the coverage of each quantity with its limits, beside 95 %."""
        return draw_intervals(
            [
                Interval(row.quantity, row.coverage, row.coverage_low, row.coverage_high)
                for row in self.rows
            ],
            self.title,
            "share of intervals that contain the true value (bars: 95 % limits)",
            references=(0.95,),
            words="nominal coverage",
        )


def clip_coverage(
    bat: AnyBat = "r161",
    *,
    procedure: AnyProcedure = "bbcor",
    clips: int = 2000,
    seed: Seed = 1,
    summed: bool = False,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> ClipTable:
    """Film one shot in each of many laboratories, and show the coverage of the 95 % intervals.

    The table has one row per quantity: the ball speeds v_in before and v_out after the hit, and the
    collision efficiency e_A.

    Parameters
    ----------
    bat
        The bat: a name in the catalog or a .toml file.

        Or a sheet, ``vl.bat("r161")``, whose values may be changed.
    procedure
        The test procedure: a name in the catalog or a .toml file. It must allow a ball cannon.

        Or a sheet: ``vl.procedure("bbcor").with_(valid_hits=8)``.
    clips
        Number of laboratories, each with one shot.
    seed
        Seed of the first laboratory; the others follow.
    summed
        Whether the camera writes summary values instead of pictures. These are positions of the
        ball with the least possible scatter.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with a message, the number of clips done, and the total. If it is
        not given, the functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        A name is unknown, `clips` is below 2, or fewer than 2 clips have a result.
    """
    bat, procedure = entry_name(bat), entry_name(procedure)
    if clips < 2:
        raise InputError("", "clips", clips, "allowed: at least 2")
    clips_of_laboratories: list[Array] = []
    detail = RecordDetail.SUMMED if summed else RecordDetail.FULL
    for number in range(clips):
        setup = TestSetup.of(
            bat,
            procedure=procedure,
            rig="filmed-cannon",
            seed=seed + number,
            detail=RecordDetail.SUMMED,
        )
        clips_of_laboratories.append(_clip(Laboratory.open(setup), detail))
        progress("clips", number + 1, clips)
    values = np.array(clips_of_laboratories)
    return ClipTable(
        name="clips",
        title=f"one shot at {bat} on film in each of {clips} laboratories, by {procedure}",
        across="quantity",
        rows=[_row(name, *values[:, place].T) for place, name in enumerate(QUANTITIES)],
    )


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
    if error.size < 2:
        allowed = f"only {error.size} of these gave a result; at least 2 are needed, so film more"
        raise InputError("", "clips", has_result.size, allowed)
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
