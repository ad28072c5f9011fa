"""The desk: all that can be worked out of a day's entries, which is all that a page shows.

Nothing here knows what is true; pages and operators are given a desk and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.bench.day.actions import OWN_RESULTS
from virtual_lab.bench.day.day import Day, DayEvent, Decision, evolve
from virtual_lab.bench.day.entries import record_of
from virtual_lab.bench.day.table import action_table
from virtual_lab.catalog import Entry, read
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Judgement, Procedure, next_places, outcome_of, to_set
from virtual_lab.records import Record, join
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.estimate import Estimate

if TYPE_CHECKING:  # the reduction takes a second to load, and a first page must not wait for it
    from virtual_lab.measurement.certification import Certification
    from virtual_lab.measurement.reduction.shot_algebra import ShotResults
    from virtual_lab.measurement.session_reduction import Preparation, SessionReduction

UNDECIDED = "undecided"
UNTOUCHED_BY_DECISIONS = frozenset({"session", "rules", "preparation", "by_rules", "missing"})
STAGES = {"hit-wall": "balls", "aim-paper": "impact"}  # whose records an action writes


def session_of(day: Day) -> Session:
    """Return the records as they stand: of what was read again, the last entry not struck out."""
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
    """Return the records with those of one shot more, as `session_of` has them."""
    impact = dict(session.records.get("impact", {}))
    for channel, entry in event.records.items():
        shot = record_of(entry)
        impact[channel] = join([impact[channel], shot]) if channel in impact else shot
    return replace(session, records={**session.records, "impact": impact})


@dataclass(frozen=True, slots=True, kw_only=True)
class DecidedHit:
    """A shot at the bat: what the records make of it [SI; None: not seen], and what was decided."""

    ball: int  # from 1
    place: float | None
    speed: float | None
    efficiency: float | None
    metric: float | None
    decision: str  # accepted, rejected or UNDECIDED
    because: str


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnResult:
    """A result that was entered, beside what the records give."""

    name: str  # of OWN_RESULTS
    entered: float
    reduced: float | None  # None: the records give none
    u: float | None

    @property
    def off(self) -> float | None:
        """By how many standard uncertainties it is off what the records give."""
        if self.reduced is None or not self.u:
            return None
        return (self.entered - self.reduced) / self.u

    @property
    def agrees(self) -> bool:
        off = self.off
        return off is not None and abs(off) <= action_table().consequences.own_agrees


@dataclass(frozen=True)
class Desk:
    """What is known on a day; the reductions are made when they are first asked for."""

    day: Day

    @cached_property
    def session(self) -> Session:
        return session_of(self.day)

    @cached_property
    def rules(self) -> Entry[Procedure]:
        return read(self.day.morning.procedure_text, "procedure.toml", Procedure)

    @cached_property
    def preparation(self) -> Preparation:
        """Of bat and balls; `InputError` names the record that is missing still."""
        from virtual_lab.measurement.session_reduction import prepare

        return prepare(self.session)

    @cached_property
    def by_rules(self) -> SessionReduction:
        """The hits so far, judged by the rules alone; `InputError` as `preparation`."""
        from virtual_lab.measurement.session_reduction import reduce_hits

        return reduce_hits(self.session, self.preparation)

    @cached_property
    def reduced(self) -> SessionReduction:
        """The hits so far, those counted that were accepted."""
        found = self.by_rules
        judgement = self._chosen(found.shots)
        return replace(
            found,
            judgement=judgement,
            outcome=outcome_of(
                found.procedure,
                found.readings.place,
                judgement.valid,
                found.shot_metric,
                found.sought,
            ),
        )

    @cached_property
    def certification(self) -> Certification:
        from virtual_lab.measurement.certification import evaluate

        return evaluate(self.session, self.reduced)

    @property
    def result(self) -> tuple[float, float] | None:
        """The metric and its standard uncertainty as the records give it; None: they give none."""
        if not self.day.fired or self.missing or self.certification.metric is None:
            return None
        metric = self.certification.metric
        return metric.value, metric.u

    def own(self, entered: Mapping[str, object]) -> list[OwnResult]:
        """Return each result of an entry beside that of the records."""
        given = self.certification.quantities if self.result else {}
        return [
            OwnResult(
                name=name,
                entered=float(str(entered[name])),
                reduced=float(given[key].value) if key in given else None,
                u=float(given[key].u) if key in given else None,
            )
            for name, key in OWN_RESULTS.items()
            if entered.get(name, "") != ""
        ]

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the rules would reject each hit; empty where they would not."""
        return self.by_rules.judgement.reasons if self.day.fired else ()

    @property
    def hits(self) -> list[DecidedHit]:
        """Every shot so far; nothing is made of any while something is missing."""
        rows = np.full((len(self.day.fired), 4), np.nan)
        if self.day.fired and not self.missing:
            shots, found = self.by_rules.shots, self.by_rules
            rows = np.stack(
                [found.readings.place, shots.speed, shots.collision_efficiency, found.shot_metric],
                axis=1,
            )
        seen = [[float(each) if np.isfinite(each) else None for each in row] for row in rows]
        chosen = [self.day.decisions.get(shot) for shot in range(len(rows))]
        return [
            DecidedHit(
                ball=ball + 1,
                place=place,
                speed=speed,
                efficiency=efficiency,
                metric=metric,
                decision=given.word if given else UNDECIDED,
                because=given.because if given else "",
            )
            for (ball, _), (place, speed, efficiency, metric), given in zip(
                self.day.fired, seen, chosen, strict=True
            )
        ]

    @cached_property
    def missing(self) -> str:
        """What keeps the hits from being reduced; empty where nothing does."""
        if not self.day.events:
            return "nothing has been measured yet"
        try:
            _ = self.by_rules if self.day.fired else self.preparation
        except InputError as fault:
            return str(fault)
        return ""

    @cached_property
    def next_place(self) -> float | None:
        """Where the rules ask for the next hit, as the rule is to be set [m]; None: nowhere."""
        from virtual_lab.measurement.reduction.observations import along_of

        rules, place = self.rules.spec, self.preparation.percussion
        if not self.day.fired:
            nothing = np.zeros(0)
            asked = next_places(rules, place, nothing, nothing.astype(bool), nothing)
        else:
            counted = self.reduced
            asked = next_places(
                rules, place, counted.readings.place, counted.judgement.valid, counted.sought.value
            )
        return (
            float(to_set(asked[:1] - along_of(self.session), exact=False)[0])
            if asked.size
            else None
        )

    @cached_property
    def waiting(self) -> tuple[int, ...]:
        """The undecided hits that are within the windows, shots from 0."""
        day = self.day
        if self.missing or day.reduced or day.handed_in:
            return ()
        return tuple(
            shot for shot, why in enumerate(self.reasons) if not why and shot not in day.decisions
        )

    @cached_property
    def with_waiting_accepted(self) -> Desk:
        """The desk as it would be if every hit of `waiting` were accepted."""
        accepted = Decision(accepted=True, because="within the windows")
        decisions = {**dict.fromkeys(self.waiting, accepted), **self.day.decisions}
        following = Desk(replace(self.day, decisions=decisions))
        kept = UNTOUCHED_BY_DECISIONS & self.__dict__.keys()
        following.__dict__.update({name: self.__dict__[name] for name in kept})
        return following

    @property
    def rule_off(self) -> bool:
        """Whether the rule is still to be set to the next place."""
        asked, stands = self.next_place, self.day.place
        return asked is not None and (stands is None or abs(asked - stands) > 1e-6)

    @property
    def next_ball(self) -> int:
        """The ball whose turn it is, from 0: those admitted, in rotation."""
        used = self.preparation.lot.used.copy()
        used[list(self.day.retired)] = False
        balls = np.flatnonzero(used if used.any() else ~used)
        return int(balls[len(self.day.fired) % balls.size])

    def last(self, action: str) -> DayEvent | None:
        """Return the last entry of an action that is not struck out."""
        found = [
            e for e in self.day.events if e.action == action and e.number not in self.day.struck
        ]
        return found[-1] if found else None

    def after(self, event: DayEvent) -> Desk:
        """Return the desk after an event; what it leaves as it was is not worked out again."""
        following, known = Desk(evolve(self.day, event)), self.__dict__
        kept = frozenset({"rules"})
        if event.action == "fire":
            kept = frozenset({"rules", "preparation"})
            if "session" in known:
                following.__dict__["session"] = _with_shot(self.session, event)
        elif not (event.records or event.constants or event.action == "strike-out"):
            kept = UNTOUCHED_BY_DECISIONS
        following.__dict__.update({name: known[name] for name in kept if name in known})
        return following

    def _chosen(self, results: ShotResults) -> Judgement:
        given = self.day.decisions
        reasons = [UNDECIDED] * len(results.speed)
        for shot, decision in given.items():
            reasons[shot] = "" if decision.accepted else decision.because
            if decision.accepted and not np.isfinite(results.collision_efficiency[shot]):
                reasons[shot] = "accepted, but its records give no e_A"
        return Judgement(reasons=tuple(reasons))
