"""The desk: the results that follow from the entries of a day, for pages and operators.

The desk does not contain the truth. Pages and operators receive a desk and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.bench.day.actions import RESULT_QUANTITIES
from virtual_lab.bench.day.day import Day, DayEvent, evolve
from virtual_lab.bench.day.entries import record_of
from virtual_lab.bench.day.table import action_table
from virtual_lab.catalog import Entry, read
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import UNDECIDED, Procedure, judge_by, round_to_setting
from virtual_lab.records import Record, join
from virtual_lab.records.session import HitDecision, Session
from virtual_lab.uncertainty.estimate import Estimate

if TYPE_CHECKING:  # the reduction takes a second to load, too long for the first page
    from virtual_lab.measurement.certification import Certification
    from virtual_lab.measurement.reduction.observations import ImpactReadings
    from virtual_lab.measurement.session_reduction import Preparation, Reduction
    from virtual_lab.records.block import SessionBlock

UNTOUCHED_BY_DECISIONS = frozenset(
    {
        *("session", "block", "rules", "preparation", "readings", "reduction_by_rules"),
        *("reasons", "reduction_error"),
    }
)
STAGES = {"hit-wall": "balls", "aim-paper": "impact"}  # stage of the records of each action


def session_of(day: Day) -> Session:
    """Return the session of a day: its records and the calibration constants now in use.

    Records of struck-out entries are left out. If a reading was repeated, the session has only the
    last one. Before the first shot or the first use of aim paper, it has no impact records.
    """
    records: dict[str, dict[str, Record]] = {}
    calibration = dict(day.morning.calibration)
    shots: dict[str, list[Record]] = {}
    for event in day.events:
        if event.number in day.struck:
            continue
        calibration |= {key: Estimate(**entry) for key, entry in event.constants.items()}
        for channel, entry in event.records.items():
            if event.action == "fire":
                shots.setdefault(channel, []).append(record_of(entry))
            else:
                stage = STAGES.get(event.action, "bench")
                records.setdefault(stage, {})[channel] = record_of(entry)
    if shots:
        joined = {channel: join(parts) for channel, parts in shots.items()}
        records["impact"] = joined | records.get("impact", {})
    return replace(day.morning, calibration=calibration, records=records)


def _with_shot(session: Session, event: DayEvent) -> Session:
    """Return the session with the records of one more shot, equal to `session_of` after it."""
    impact = dict(session.records.get("impact", {}))
    for channel, entry in event.records.items():
        shot = record_of(entry)
        impact[channel] = join([impact[channel], shot]) if channel in impact else shot
    return replace(session, records={**session.records, "impact": impact})


@dataclass(frozen=True, slots=True, kw_only=True)
class HitResult:
    """Results of a shot at the bat [SI], None if not measured, and the decision about it."""

    ball: int  # from 1
    place: float | None
    speed: float | None
    efficiency: float | None
    metric: float | None
    decision: str  # accepted, rejected or UNDECIDED
    because: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EnteredResult:
    """A result that the trainee entered, and the same result reduced from the records."""

    name: str  # key of RESULT_QUANTITIES
    entered: float
    reduced: float | None  # None: the records give no result
    u: float | None

    @property
    def deviation(self) -> float | None:
        """Entered minus reduced result, in standard uncertainties; None without a reduced one."""
        if self.reduced is None or not self.u:
            return None
        return (self.entered - self.reduced) / self.u

    @property
    def agrees(self) -> bool:
        deviation = self.deviation
        return deviation is not None and abs(deviation) <= action_table().consequences.own_agrees


@dataclass(frozen=True)
class Desk:
    """Results of a day. Each is computed when it is first used, and cached."""

    day: Day

    @cached_property
    def session(self) -> Session:
        return session_of(self.day)

    @cached_property
    def block(self) -> SessionBlock:
        """The current records as a block of one."""
        from virtual_lab.records.block import SessionBlock

        return SessionBlock.of(self.session)

    @cached_property
    def rules(self) -> Entry[Procedure]:
        return read(self.day.morning.procedure_text, "procedure.toml", Procedure)

    @cached_property
    def preparation(self) -> Preparation:
        """Reduction of bat and balls. Raises `InputError` with the name of a missing record."""
        from virtual_lab.measurement.session_reduction import prepare

        return prepare(self.block)

    @cached_property
    def readings(self) -> ImpactReadings:
        """Readings of the hits so far. Raises `InputError` with the name of a missing record."""
        from virtual_lab.measurement.session_reduction import observe_hits

        return observe_hits(self.block, self.preparation)

    @cached_property
    def reduction_by_rules(self) -> Reduction:
        """Reduction of the hits so far; the rules decide about each hit.

        Raises `InputError` with the name of a missing record.
        """
        from virtual_lab.measurement.session_reduction import reduce_shots

        return reduce_shots(self.block, self.preparation, self.readings)

    @cached_property
    def reduced(self) -> Reduction:
        """Reduction of the hits so far; the trainee decides which hits are valid.

        Raises `InputError` with the name of a missing record.
        """
        return self.reduction_by_rules.judge_hits(
            judge_by(self.day.decisions.values()), self.readings
        )

    @cached_property
    def certification(self) -> Certification:
        from virtual_lab.measurement.certification import certify_reduction

        certifications = certify_reduction(self.block, self.reduced, self.readings)
        decisions = tuple(self.day.decisions.values())
        return certifications.row(0, lambda _: replace(self.session, decisions=decisions))

    @cached_property
    def reasons_to_refuse(self) -> tuple[str, ...]:
        """Reasons why the records make the test INVALID if the rules decide about each hit.

        These are flags, too large an uncertainty and, after the last attempt, missing hits. There
        is none without records that can be reduced.
        """
        from virtual_lab.measurement.certification import certify_reduction
        from virtual_lab.measurement.procedure import Verdict

        if not self.day.fired or self.reduction_error:
            return ()
        certified = certify_reduction(self.block, self.reduction_by_rules, self.readings)
        reasons = certified.reasons(0) if certified.verdicts[0] is Verdict.INVALID else ()
        is_over = len(self.day.fired) >= self.rules.spec.attempts
        missing = "" if is_over else certified.hit_weights.reasons[0]
        return tuple(reason for reason in reasons if reason != missing)

    @property
    def result(self) -> tuple[float, float] | None:
        """Metric and its standard uncertainty [SI]; None if the records give no result."""
        if not self.day.fired or self.reduction_error or self.certification.metric is None:
            return None
        metric = self.certification.metric
        return metric.value, metric.u

    def entered_results(self, entered: Mapping[str, object]) -> list[EnteredResult]:
        """Return the results that the trainee entered, each with the result of the records.

        Results that were not entered are left out. The result of the records, and its u, are None
        if the records do not give it.
        """
        quantities = self.certification.quantities if self.result else {}
        return [
            EnteredResult(
                name=name,
                entered=float(str(entered[name])),
                reduced=float(quantities[key].value) if key in quantities else None,
                u=float(quantities[key].u) if key in quantities else None,
            )
            for name, key in RESULT_QUANTITIES.items()
            if entered.get(name, "") != ""
        ]

    @cached_property
    def reasons(self) -> tuple[str, ...]:
        """For each hit, the reason why the rules reject it; an empty string if they accept it."""
        return self.reduction_by_rules.judgement(self.readings).reasons if self.day.fired else ()

    @property
    def hits(self) -> list[HitResult]:
        """One row per shot so far; all results are None while a record is missing."""
        rows = np.full((len(self.day.fired), 4), np.nan)
        if self.day.fired and not self.reduction_error:
            shots, reduction = self.reduction_by_rules.shots, self.reduction_by_rules
            rows = np.stack(
                [
                    reduction.position,
                    shots.speed,
                    shots.collision_efficiency,
                    reduction.shot_metric,
                ],
                axis=1,
            )
        results = [[float(each) if np.isfinite(each) else None for each in row] for row in rows]
        decisions = [self.day.decisions.get(shot) for shot in range(len(rows))]
        return [
            HitResult(
                ball=ball + 1,
                place=place,
                speed=speed,
                efficiency=efficiency,
                metric=metric,
                decision=decision.word if decision else UNDECIDED,
                because=decision.because if decision else "",
            )
            for (ball, _), (place, speed, efficiency, metric), decision in zip(
                self.day.fired, results, decisions, strict=True
            )
        ]

    @cached_property
    def reduction_error(self) -> str:
        """Reason why the hits cannot be reduced; an empty string if they can."""
        if not self.day.events:
            return "nothing has been measured yet"
        try:
            _ = self.reduction_by_rules if self.day.fired else self.preparation
        except InputError as fault:
            return str(fault)
        return ""

    @cached_property
    def next_position(self) -> float | None:
        """Next impact position by the rules [m from the tip]; None if no hit is needed.

        Raises `InputError` with the name of a missing record.
        """
        from virtual_lab.measurement.reduction.observations import along_of

        following = self.reduced.next_shots if self.day.fired else self.preparation.first_shots
        positions = following().position
        return (
            float(round_to_setting(positions[:1] - along_of(self.session), exact=False)[0])
            if positions.size
            else None
        )

    @cached_property
    def undecided_hits(self) -> tuple[int, ...]:
        """Undecided hits within the acceptance windows, as shot numbers from 0.

        There are none while a record is missing, or after the day was reduced or handed in.
        """
        day = self.day
        if self.reduction_error or day.reduced or day.handed_in:
            return ()
        return tuple(
            shot for shot, why in enumerate(self.reasons) if not why and shot not in day.decisions
        )

    @cached_property
    def with_undecided_accepted(self) -> Desk:
        """The desk as it would be if every hit in `undecided_hits` were accepted."""
        accepted = {
            shot: HitDecision(
                shot=shot, accepted=True, because="within the windows", by=self.day.operator
            )
            for shot in self.undecided_hits
        }
        decisions = {**accepted, **self.day.decisions}
        following = Desk(replace(self.day, decisions=decisions))
        names = UNTOUCHED_BY_DECISIONS & self.__dict__.keys()
        following.__dict__.update({name: self.__dict__[name] for name in names})
        return following

    @property
    def needs_position(self) -> bool:
        """Whether the impact position must still be set for the next shot."""
        position, rule = self.next_position, self.day.place
        return position is not None and (rule is None or abs(position - rule) > 1e-6)

    @property
    def next_ball(self) -> int:
        """Number of the next ball, from 0. The admitted balls take turns."""
        available = self.preparation.used[0, 0].copy()
        available[list(self.day.retired)] = False
        balls = np.flatnonzero(available if available.any() else ~available)
        return int(balls[len(self.day.fired) % balls.size])

    def last(self, action: str) -> DayEvent | None:
        """Return the last entry of an action that is not struck out; None if there is none."""
        events = [
            e for e in self.day.events if e.action == action and e.number not in self.day.struck
        ]
        return events[-1] if events else None

    def after(self, event: DayEvent) -> Desk:
        """Return the desk after one more event. Results that it does not change stay cached."""
        following, cache = Desk(evolve(self.day, event)), self.__dict__
        unchanged = frozenset({"rules"})
        if event.action == "fire":
            unchanged = frozenset({"rules", "preparation"})
            if "session" in cache:
                following.__dict__["session"] = _with_shot(self.session, event)
        elif not (event.records or event.constants or event.action == "strike-out"):
            unchanged = UNTOUCHED_BY_DECISIONS
        following.__dict__.update({name: cache[name] for name in unchanged if name in cache})
        return following
