"""Daily checks of a laboratory with check ball and check cylinder, and their control charts.

The charts show daily means: measured e0 of the check ball at the ball-wall rig, and e_A of the
steel cylinder at the impact rig. From a given day on, the wall may be loose or the impact rig may
have a fault; the charts do not use this information.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError
from virtual_lab.files.dictionary import with_units
from virtual_lab.lab.laboratory import constant_name
from virtual_lab.measurement.reduction.gates import GateReadings
from virtual_lab.measurement.reduction.observations import BallReadings, ball_constants
from virtual_lab.measurement.reduction.shot_algebra import measured_balls
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.tables import column, record, table_text
from virtual_lab.parameters import (
    AnyLaboratory,
    BaselineDays,
    CheckDays,
    CheckHits,
    LostShare,
    Positive,
    Seed,
)
from virtual_lab.records import GateRecord
from virtual_lab.sheets import AnyBall, Faults, Instruments, entry_name, words_of
from virtual_lab.simulation.collision.ladder import Ladder, probing_scenes
from virtual_lab.simulation.physics.ageing import lasting_loss
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.truth import TrueBalls, draw_balls, make_bat
from virtual_lab.simulation.stations.rig import (
    Reality,
    ShotPlan,
    Specimen,
    Stage,
    WallStation,
    find_rig,
)
from virtual_lab.studies.check_cylinder import check_cylinder
from virtual_lab.studies.control_charts import DayCharts, control_chart
from virtual_lab.studies.daily_chart import draw_control_chart
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import MPH, Array

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.output.page_figure import PageFigure

SPEED = 60 * MPH  # ball speed of the wall test [m/s]
CYLINDER = "check-cylinder"


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmCount:
    """Alarms of one rule or chart for a check standard.

    Alarms before the change are false, or are caused by an aging ball. An alarm on the day of the
    change has the delay 0.
    """

    standard: str
    rule: str = column("rule")
    first_alarm_day: int | None = column(
        "first alarm", "day", lambda row: _day(row.first_alarm_day)
    )
    earlier_alarms: int = column("alarms before the change", "days")
    delay_days: int | None = column("delay after it", "days", lambda row: _day(row.delay_days))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Daily(StudyResult):
    """Daily checks of one laboratory; arrays have the shape (day,)."""

    ball: str
    hits: int
    faults: tuple[str, ...]  # faults of the impact rig
    since: Positive | None  # first day of the change of wall or rig; None without a change
    values: Array  # mean measured e0 of the check ball
    scatter: Array  # standard deviation of e0 over the hits of the day
    wall: Array  # true rebound speed divided by that from a rigid wall
    charted: DayCharts
    cylinder: Array  # mean measured e_A of the check cylinder
    cylinder_charted: DayCharts

    @property
    def table(self) -> pd.DataFrame:
        """One row per day; the columns of the charts are empty in the baseline."""
        import pandas as pd

        charted, days = self.charted, self.values.size
        columns: dict[str, Array] = {
            "standardised": charted.standardised,
            "moving_range": charted.ranges,
            "ewma": charted.average,
            "cusum_up": charted.sum_up,
            "cusum_down": charted.sum_down,
        }
        blank = np.full(charted.baseline_days, np.nan)
        table = pd.DataFrame(
            {
                "day": np.arange(1, days + 1),
                "ball_restitution": self.values,
                "ball_restitution_sd": self.scatter,
                "ball_restitution_dof": np.full(days, self.hits - 1),
                "true_wall_ratio": self.wall,
            }
            | {name: np.concatenate([blank, values]) for name, values in columns.items()}
            | {
                "alarms": _alarm_names(charted),
                "cylinder_collision_efficiency": self.cylinder,
                "cylinder_alarms": _alarm_names(self.cylinder_charted),
            }
        )
        return with_units(table)

    @property
    def alarms(self) -> list[AlarmCount]:
        """Alarms of the ball, one row per rule or chart."""
        return _alarms(self.ball, self.charted, self.since)

    @property
    def cylinder_alarms(self) -> list[AlarmCount]:
        """Alarms of the cylinder, one row per rule or chart."""
        return _alarms(CYLINDER, self.cylinder_charted, self.since)

    name = "daily"

    @property
    def title(self) -> str:
        """Title with the check standards and the number of days."""
        return f"{self.values.size} days of {self.ball} and {CYLINDER}"

    @property
    def rows(self) -> list[AlarmCount]:
        """Alarms of both standards, one row per rule or chart."""
        return [*self.alarms, *self.cylinder_alarms]

    @property
    def text(self) -> str:
        """Tables of the alarms of both standards."""
        checks = (
            ("check ball at the wall, e0", self.alarms),
            ("check cylinder at the impact rig, e_A", self.cylinder_alarms),
        )
        return "\n\n".join(f"{words}\n{table_text(rows)}" for words, rows in checks)

    def draw(self) -> PageFigure:
        """Draw the control chart of the ball."""
        return draw_control_chart(self.values, self.charted, "$e_0$ of the check ball")

    def fill(self, folder: Path) -> None:
        """Write the table and the control charts of ball and cylinder."""
        super(Daily, self).fill(folder)
        label = "$e_A$ of the check cylinder"
        chart = draw_control_chart(self.cylinder, self.cylinder_charted, label)
        chart.savefig(folder / "cylinder.png")

    @property
    def document(self) -> Json:
        """The result for JSON."""
        rows = self.table.astype(object)
        return {
            "ball": self.ball,
            "hits_a_day": self.hits,
            "baseline": _baseline(self.charted),
            "cylinder_baseline": _baseline(self.cylinder_charted),
            "faults": list(self.faults),
            "changed_since_day": self.since,
            "alarms": [record(row) for row in self.alarms],
            "cylinder_alarms": [record(row) for row in self.cylinder_alarms],
            "days": rows.where(rows.notna(), None).to_dict("records"),
        }


def daily(
    *,
    ball: AnyBall = "check-ball",
    days: CheckDays = 60,
    baseline: BaselineDays = 25,
    hits: CheckHits = 10,
    drift: LostShare = 0.0,
    step: LostShare = 0.0,
    faults: Faults = (),
    since: Positive | None = None,
    seed: Seed = 1,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> Daily:
    """Draw control charts of daily checks.

    The checks of one laboratory are simulated.

    Parameters
    ----------
    ball
        Check ball for the wall: a name in the catalog or a .toml file. Aging lowers the restitution
        of some balls from day to day, and the charts include this. The check cylinder at the impact
        rig is always hit with the check ball of the catalog.
    days
        Number of mornings.
    baseline
        Number of days at the start, from which the limits are computed.
    hits
        Number of hits each morning.
    drift
        Loss of rebound speed at the wall per day, for example 0.0005. It is a fraction of the
        rebound speed from a rigid wall.
    step
        Sudden loss of rebound speed at the wall, as a fraction of the rebound speed from a rigid
        wall.
    faults
        Fault of the impact rig.

        Or a list of faults.
    since
        First day of drift, step and faults, counted from 1. By default the first day after the
        baseline.
    seed
        Seed of the laboratory. The hits of different days have different random errors.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with a message that names the current task. If it is not given, the
        functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        A number is out of range, or a ball or fault is unknown. The gates do not detect every
        rebound from the wall, because the rebound is too slow. A day has no valid hit at the
        cylinder.
    """
    ball, faults = entry_name(ball), words_of(faults)
    if baseline >= days:
        raise InputError("", "baseline", baseline, f"allowed: 5 to {days - 1}, fewer than the days")
    begin = baseline + 1 if since is None else since
    if begin > days:
        raise InputError("", "since", begin, f"allowed: 1 to {days}, the last day")
    days_since = np.maximum(np.arange(1, days + 1) - begin + 1, 0)
    wall = 1 - step * (days_since > 0) - drift * days_since
    if not wall[-1] > 0:
        allowed = f"a drift that leaves some rebound on all {days} days"
        raise InputError("", "drift", drift, f"allowed: {allowed}")
    spec = catalog.load("balls", ball, BallSpec).spec
    progress("check ball at the wall")
    values, scatter = _daily_checks(spec, wall, hits, seed).T
    progress("check cylinder at the impact rig")
    cylinder = check_cylinder(days, hits, seed=seed, faults=faults, since=begin)
    return Daily(
        ball=spec.name,
        hits=hits,
        faults=tuple(faults),
        since=begin if drift or step or faults else None,
        values=values,
        scatter=scatter,
        wall=wall,
        charted=control_chart(values, baseline),
        cylinder=cylinder,
        cylinder_charted=control_chart(cylinder, baseline),
    )


def _day(day: int | None) -> str:
    return "none" if day is None else str(day)


def _baseline(charted: DayCharts) -> dict[str, float]:
    base = charted.baseline
    return {"days": charted.baseline_days, "centre": base.centre, "sigma": base.sigma}


def _alarm_names(charted: DayCharts) -> list[str]:
    """Return the names of the alarms of each day, as text; empty in the baseline."""
    return [""] * charted.baseline_days + [
        "; ".join(name for name, days in charted.alarms.items() if days[day])
        for day in range(charted.standardised.size)
    ]


def _alarms(standard: str, charted: DayCharts, since: int | None) -> list[AlarmCount]:
    rows = []
    for name, flags in charted.alarms.items():
        days = np.flatnonzero(flags) + charted.baseline_days + 1
        began = np.inf if since is None else since
        after_change = days[days >= began]
        rows.append(
            AlarmCount(
                standard=standard,
                rule=name,
                first_alarm_day=int(days[0]) if days.size else None,
                earlier_alarms=int((days < began).sum()),
                delay_days=int(after_change[0] - began) if after_change.size else None,
            )
        )
    return rows


def _daily_checks(spec: BallSpec, wall: Array, hits: int, seed: int) -> Array:
    """Return mean and standard deviation of the measured e0 of the check ball, (day, 2)."""
    draws = Reality.REAL.draws(seed)
    station = find_rig("ball-wall", Stage.BALLS).commission(draws)
    assert isinstance(station, WallStation)
    calibration = {constant_name(Stage.BALLS, name): of for name, of in station.calibration.items()}
    cylinder = catalog.load_bat(CYLINDER).spec  # required by the specimen, but not used at the wall
    collision = Ladder(
        nominal=cylinder.body,
        support=Free(),
        probe=probing_scenes(spec, SPEED),
        standard_uncertainty=None,
    )
    balls = draw_balls(spec, 1, draws)
    first = np.zeros(hits, dtype=int)
    turns = np.arange(hits)
    plan = ShotPlan(slot=turns, ball=first, speed=np.full(hits, SPEED), place=np.zeros(hits))
    bat, values = make_bat(cylinder, draws), []
    for day, factor in enumerate(wall):
        play = station.with_wall(float(factor)).play(
            replace(plan, slot=day * hits + turns),
            Specimen(bat=bat, balls=balls, collision=collision),
            draws,
        )
        gates = play.records["gates"]
        assert isinstance(gates, GateRecord)
        values.append(_reduce_morning(gates, spec, plan, calibration))
        if not np.isfinite(values[-1][0]):
            allowed = "the gates did not detect every rebound; allowed: a livelier ball or wall"
            raise InputError("", "day", day + 1, allowed)
        balls = _aged_overnight(balls, play.truth["speed"])
    return np.array(values)


def _reduce_morning(
    gates: GateRecord, spec: BallSpec, plan: ShotPlan, calibration: Mapping[str, Estimate]
) -> tuple[float, float]:
    """Return mean and standard deviation of the measured e0 of the check ball on one day."""
    readings = BallReadings(
        mass=np.array([spec.mass]),
        ball=plan.ball,
        nominal_speed=plan.speed,
        flights=GateReadings.of(gates, calibration, Stage.BALLS.value),
    )
    mean = measured_balls(_constants(calibration, spec), readings).restitution[0]
    (u,) = ball_constants(readings)["balls.restitution_0"].u
    return float(mean), float(u) * sqrt(plan.ball.size)


def _constants(calibration: Mapping[str, Estimate], spec: BallSpec) -> dict[str, Array]:
    values = {name: estimate.value for name, estimate in calibration.items()}
    scale = {"bench.scale.zero": 0.0, "bench.scale.span": 1.0}
    ball = {"ball.radius": spec.radius, "ball.restitution_slope": spec.restitution.slope}
    error = {"balls.restitution_0": 0.0}
    return {name: np.array(value) for name, value in (values | scale | ball | error).items()}


def _aged_overnight(balls: TrueBalls, speed: Array) -> TrueBalls:
    """Return the check ball on the next day, with its permanent loss of e0."""
    ageing = balls.spec.ageing
    if ageing is None:
        return balls
    return replace(balls, restitution=balls.restitution - lasting_loss(ageing, speed).sum())
