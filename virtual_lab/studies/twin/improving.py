"""Changes that would lower a laboratory's u most: better instruments, more hits, more balls.

The budget of the metric gives the u that each change promises. The days of the twin, simulated
again with the change, show whether this u is reached.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import sqrt
from typing import NamedTuple

from virtual_lab import catalog
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.reduction.observations import REPEATABILITY
from virtual_lab.measurement.reduction.shot_algebra import SLOPE_ERROR
from virtual_lab.measurement.session_reduction import AIM_ALONG
from virtual_lab.output.tables import column
from virtual_lab.sheets import Sheet
from virtual_lab.studies.twin.days import TwinDays
from virtual_lab.studies.twin.statement import Statement
from virtual_lab.uncertainty.budget import HITS

SHOWN = 3  # number of changes that are simulated
HALVED = 0.75  # share of a variance that vanishes if its u is halved
DOUBLED = 0.5  # the same if the number of readings is doubled


@dataclass(frozen=True, slots=True, kw_only=True)
class Improvement:
    """A change of the laboratory, and the u of the metric with it."""

    change: str = column("change")
    planned_u: float = column("planned u", "SI", ".3g")  # from the budget
    error_sd: float = column("sd of the errors", "SI", ".3g")  # on days with the change
    error_sd_low: float = column(
        "  at least", "SI", ".3g"
    )  # 95 % interval of the standard deviation
    error_sd_high: float = column("  at most", "SI", ".3g")
    gain: float = column("lower by", form=".1%")  # planned u below the stated one


class Change(NamedTuple):
    """A change of the laboratory, and the predicted reduction of the metric's variance."""

    words: str
    variance: float
    apply: Callable[[Statement], Statement]


def changes_to_simulate(certification: Certification) -> list[Change]:
    """Return the changes of a laboratory that reduce the u of the metric, the most effective first.

    A change halves the u of one instrument, or doubles the number of hits, balls or wall hits. A
    change that reduces no term of the budget is left out. The certification must have a metric.
    """
    assert certification.metric is not None
    square = {part.name: part.contribution**2 for part in certification.metric.components}
    instruments: dict[str, float] = {}
    for name, variance in square.items():
        at = AIM_ALONG if name == SLOPE_ERROR else name
        if at in certification.session.calibration:
            instrument = at.rpartition(".")[0]
            instruments[instrument] = instruments.get(instrument, 0.0) + variance
    number = certification.procedure.valid_hits
    hits = f"{2 * number} instead of {number} hits per impact position"
    repeated = DOUBLED * square.get(REPEATABILITY, 0.0)
    changes = [
        *(
            Change(
                f"half the u of {_sheet_name(name, certification.session.rigs)}",
                HALVED * variance,
                _with_half_u(f"{name}."),
            )
            for name, variance in instruments.items()
        ),
        Change(hits, DOUBLED * square.get(HITS, 0.0), _with_double_hits),
        Change("twice as many balls", repeated, _with_double_balls),
        Change("twice as many wall hits", repeated, _with_double_wall_hits),
    ]
    return sorted((each for each in changes if each.variance > 0), key=lambda each: -each.variance)


def improvements(
    certification: Certification,
    playing: TwinDays,
    simulate: Callable[[TwinDays], tuple[float, float, float]],
) -> list[Improvement]:
    """Return at most three rows: the changes of a laboratory that reduce the u of the metric most.

    A change halves the u of one instrument, or doubles the number of hits, balls or wall hits. A
    row has these values:

    * the u predicted from the budget [SI];
    * the standard deviation of the errors on simulated days with the change;
    * the 95 % interval of this standard deviation.

    Parameters
    ----------
    certification
        The test. It must have a metric.
    playing
        Simulated days of the laboratory, without the change.
    simulate
        Function that simulates days with a change. It takes the days. It returns the standard
        deviation of the errors of the metric [SI], and the two limits of its 95 % interval.
    """
    assert certification.metric is not None
    rows, u = [], certification.metric.u
    for words, variance, apply in changes_to_simulate(certification)[:SHOWN]:
        sd, low, high = simulate(replace(playing, statement=apply(playing.statement)))
        planned = sqrt(max(u**2 - variance, 0.0))
        rows.append(
            Improvement(
                change=words,
                planned_u=planned,
                error_sd=sd,
                error_sd_low=low,
                error_sd_high=high,
                gain=1 - planned / u,
            )
        )
    return rows


def _sheet_name(instrument: str, rigs: Mapping[str, str]) -> str:
    """Return the name of the data sheet of an instrument such as ``impact.cannon``.

    A part of the rig's own sheet, such as the survey of its pivot, has the name of the part. The
    argument is returned if the catalog has no sheet of the rig. `rigs` are keyed by stage.
    """
    stage, _, part = instrument.partition(".")
    rig = rigs.get(stage, "")
    return catalog.rig_instruments(rig).get(part, part) if catalog.has("rigs", rig) else instrument


def _with_half_u(prefix: str) -> Callable[[Statement], Statement]:
    def apply(statement: Statement) -> Statement:
        session = statement.session
        calibration = {
            name: replace(each, u=each.u / 2) if name.startswith(prefix) else each
            for name, each in session.calibration.items()
        }
        return replace(statement, session=replace(session, calibration=calibration))

    return apply


def _with_double_hits(statement: Statement) -> Statement:
    rules, spec = statement.rules, statement.rules.spec
    sheet = Sheet("procedures", spec.name, rules.text).with_(
        valid_hits=2 * spec.valid_hits, attempts=2 * spec.attempts
    )
    changed = catalog.read(sheet.text, spec.name, Procedure)
    counts = replace(changed.spec, balls=spec.balls, wall_hits=spec.wall_hits)
    return replace(statement, rules=replace(changed, spec=counts))


def _with_double_balls(statement: Statement) -> Statement:
    spec = replace(statement.rules.spec, balls=2 * statement.rules.spec.balls)
    return replace(statement, rules=replace(statement.rules, spec=spec))


def _with_double_wall_hits(statement: Statement) -> Statement:
    spec = replace(statement.rules.spec, wall_hits=2 * statement.rules.spec.wall_hits)
    return replace(statement, rules=replace(statement.rules, spec=spec))
