"""Judgment of deviations from the procedure: omitted steps, rejected hits, additional checks.

A deviation is judged by the readings that the trainee had at that time. If they neither support nor
contradict the reason, the trainer must judge it, and it costs no points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import inf, tau

import numpy as np

from virtual_lab.bench.day.day import DayEvent
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.protocol import omitted_steps
from virtual_lab.bench.day.readings import CheckRow, rows_of, rows_of_edges, suspected_faults
from virtual_lab.bench.day.table import PREPARING, action_table, detectable
from virtual_lab.output.rounding import limit_message
from virtual_lab.records import BoardRecord, GateRecord

JUSTIFIED, DENIED, OPEN = "justified", "not supported by the records", "for the trainer to judge"
SEEN = {
    "bat again": "bat and ball touched a second time",
    "stop": "the bat hit its stop",
    "frame": "the ball hit the frame of a gate",
}
# whether the records support a reason, None if they do not show it, and an explanation
Evidence = tuple[bool | None, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """A deviation from the procedure, and its judgment."""

    entry: int
    what: str  # description
    because: str  # reason given by the trainee
    judged: str  # JUSTIFIED, DENIED or OPEN
    why: str  # evidence from the records
    step: str = ""  # name of an omitted step; else empty


def deviations(desk: Desk) -> Iterator[Deviation]:
    """Yield the judgment of each deviation from the procedure, in the order of the log entries.

    There are three kinds of deviation:

    * The trainee noted that a step was omitted.
    * The trainee rejected a hit that was within the acceptance windows.
    * The trainee did a check that the procedure does not require. It is only yielded if an earlier
      reading beyond its limit was a good reason for the check.

    Two kinds of entry are not judged: entries that the trainee struck out, and entries that another
    laboratory supplied.
    """
    before = Desk(desk.day.until(0))
    for event in desk.day.events:
        if event.number not in desk.day.struck and event.number > desk.day.supplied_events:
            yield from JUDGES.get(event.action, _judge_check)(before, event)
        before = before.after(event)


def extra_check_seconds(judged: list[Deviation], desk: Desk) -> float:
    """Return the total time [s] of the additional checks that an earlier reading justified.

    A check is additional if the procedure does not require it. It is justified if an earlier
    reading of an instrument was beyond its limit. The economy score does not count the time of
    these checks. `judged` are the deviations of the day with their judgments.
    """
    entries = {each.entry for each in judged if each.judged == JUSTIFIED}
    return sum(
        event.seconds
        for event in desk.day.events
        if event.number in entries and event.action not in JUDGES
    )


def anomaly_of(desk: Desk, shot: int) -> str:
    """Return the anomaly that the records of a shot show, in words; empty if there is none.

    Shots are counted from 0. The acceptance windows are not considered. Raises `IndexError` if the
    shot has not been fired.
    """
    fired = [event for event in desk.day.events if event.action == "fire"][shot]
    for struck in fired.sketch.get("struck", ()):
        if struck in SEEN:
            return SEEN[struck]
    for row in _edges(desk, shot):
        if not row.within:
            return row.why
    turning = None if desk.reduction_error else desk.readings.recoil
    if turning is not None:
        rough = turning.residual[shot] - float(np.median(turning.residual))
        if rough > detectable()["encoder-slip"].beyond:
            residual = "the residual of the encoder fit was"
            return f"{residual} {rough:.2f} counts rms above that of the other shots"
    return ""


def _judge_deviation(desk: Desk, event: DayEvent) -> Iterator[Deviation]:
    """Yield the judgment of a noted omission, by the evidence for its reason."""
    step, day = str(event.arguments["step"]), desk.day
    omitted = [each for each in omitted_steps(day) if each.step == step]
    shots = [each.shot for each in omitted if each.shot is not None]
    if omitted and all(each.before < day.supplied_events for each in omitted):
        reason: Evidence = (None, "another laboratory skipped it")
    elif step in PREPARING and _is_repeated_after(desk, step):
        title = action_table().actions[PREPARING[step]].title.lower()
        reason = (True, f"corrected later: the step was done, and “{title}” was repeated after it")
    elif step == "tare":
        reason = _zero_evidence(desk)
    elif step in BY_SHOT and shots and not desk.reduction_error:
        evidence = [BY_SHOT[step](desk, shot) for shot in shots]
        contradicting = [each for each in evidence if each[0] is not True]
        reason = (contradicting or evidence)[0]
    else:
        reason = (None, "no record shows whether there was a reason")
    sheets = action_table().actions
    yield Deviation(
        entry=event.number,
        what=f"skipped: {sheets[step].title.lower() if step in sheets else step}",
        because=str(event.arguments["because"]),
        judged={True: JUSTIFIED, False: DENIED, None: OPEN}[reason[0]],
        why=reason[1],
        step=step,
    )


def _judge_rejection(desk: Desk, event: DayEvent) -> Iterator[Deviation]:
    """Yield the judgment of a rejection, if the hit was within the windows."""
    shot = int(event.arguments["shot"]) - 1
    if desk.reduction_error or desk.reasons[shot]:
        return
    anomaly_text = anomaly_of(desk, shot)
    yield Deviation(
        entry=event.number,
        what=f"hit {shot + 1} rejected although it is within the windows",
        because=str(event.arguments["because"]),
        judged=JUSTIFIED if anomaly_text else DENIED,
        why=anomaly_text or "its records show nothing unusual",
    )


def _judge_check(desk: Desk, event: DayEvent) -> Iterator[Deviation]:
    """Yield an additional check, if an earlier reading beyond its limit justified it."""
    sheet = action_table().actions[event.action]
    checks = {name for detection in detectable().values() for name in detection.actions}
    if sheet.in_book or event.action not in checks:
        return
    for doubt in suspected_faults(desk):
        if event.action in detectable()[doubt.fault].actions:
            yield Deviation(
                entry=event.number,
                what=f"additional check: {sheet.title.lower()}",
                because="",
                judged=JUSTIFIED,
                why=f"{doubt.why}; the time of this check is not counted",
            )
            return


def _is_repeated_after(desk: Desk, step: str) -> bool:
    """Return whether an omitted step was done later, followed by the action that needs it."""
    actions = [event.action for event in desk.day.events]
    return step in actions and PREPARING[step] in actions[actions.index(step) :]


def _zero_evidence(desk: Desk) -> Evidence:
    for row in rows_of(desk):
        if row.fault == "scale-not-tared" and row.expected is not None:
            zeroed = abs(row.reading - row.expected) < 2.0 * row.u
            return (True if zeroed else None if row.within else False), row.why
    return None, "the check mass had not been weighed by then"


def _edges(desk: Desk, shot: int) -> list[CheckRow]:
    """Return the rows on the blocking times of one shot, from 0; empty if an edge is missing."""
    fired = [event for event in desk.day.events if event.action == "fire"][shot]
    record = desk.session.records["impact"]["gates"]
    if not isinstance(record, GateRecord | BoardRecord):
        return []
    return list(rows_of_edges(record, fired, range(shot, shot + 1)))


def _rest_evidence(desk: Desk, shot: int) -> Evidence:
    turning, allowed = desk.readings.recoil, desk.rules.spec.windows.rate_before
    if turning is None or allowed is None:
        return None, "without an encoder no record shows whether the bat moved"
    turn = desk.session.calibration["impact.encoder.counts_per_turn"].value / tau
    rate = abs(float(turning.before[shot])) / turn
    text = (
        f"the bat turned at {{0:.{{d}}f}} rad/s before hit {shot + 1}; allowed: {{2:.{{d}}f}} rad/s"
    )
    return rate <= allowed, limit_message(text, rate, -inf, allowed, 3)


def _speed_evidence(desk: Desk, shot: int) -> Evidence:
    nominal, speed = desk.rules.spec.ball_speed, float(desk.reduction_by_rules.shots.speed[shot])
    tolerance = desk.rules.spec.windows.speed_tolerance
    if not np.isfinite(speed):
        return None, f"the speed of shot {shot + 1} was not measured"
    text = (
        f"the speed of shot {shot + 1} was off by {{0:+.{{d}}f}} m/s; allowed: ± {{2:.{{d}}f}} m/s"
    )
    return abs(speed - nominal) <= tolerance, limit_message(
        text, speed - nominal, -tolerance, tolerance, 2
    )


def _gate_evidence(desk: Desk, shot: int) -> Evidence:
    rows = _edges(desk, shot)
    if not rows:
        return None, f"a gate missed shot {shot + 1}"
    tripped = any(row.fault == "sabot-trip" and not row.within for row in rows)
    return not tripped, rows[0].why


def _ball_evidence(desk: Desk, shot: int) -> Evidence:
    rest_time, fired = action_table().consequences.ball_rest, desk.day.fired
    ball, at = fired[shot]
    earlier = [second for ball_fired, second in fired[:shot] if ball_fired == ball]
    rested = (at - earlier[-1]) / 60 if earlier else float("inf")
    required = f"required: {rest_time / 60:.0f} min"
    why = f"the ball of shot {shot + 1} had rested {rested:.0f} min; {required}"
    return rested * 60 >= rest_time, why if earlier else f"it was the first hit of ball {ball + 1}"


# evidence whether a shot needed the step
BY_SHOT: Mapping[str, Callable[[Desk, int], Evidence]] = {
    "zero-encoder": _rest_evidence,  # the initial count is subtracted: no error if the bat rests
    "wait-rest": _rest_evidence,
    "wait-pressure": _speed_evidence,
    "clear-scrap": _gate_evidence,
    "load-ball": _ball_evidence,
}
JUDGES: Mapping[str, Callable[[Desk, DayEvent], Iterator[Deviation]]] = {
    "note-deviation": _judge_deviation,
    "reject": _judge_rejection,
}
