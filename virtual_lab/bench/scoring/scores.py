"""The five scores of a day: result, detection, protocol, record and economy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from virtual_lab.bench.day.day import Day
from virtual_lab.bench.day.desk import Desk, EnteredResult
from virtual_lab.bench.day.protocol import omitted_steps, steps_due
from virtual_lab.bench.day.table import action_table, repairs
from virtual_lab.bench.machines.apparatus import Apparatus
from virtual_lab.bench.scoring.deviations import (
    DENIED,
    JUSTIFIED,
    Deviation,
)
from virtual_lab.measurement.procedure import sentences_of, unmet_rules, verdicts_of

FAULTY = "the day has a fault that was not repaired,"
MENDABLE = 0.6  # score of a justified INVALID if the fault could have been repaired
AVOIDABLE = 0.2  # the same if only the trainee's test gave the reason


class ScoredResult(NamedTuple):
    """The data that determine the score of a result."""

    value: float | None
    u: float | None
    right: RightVerdict
    verdict: str
    reason: bool  # whether the verdict is INVALID and the records support it
    avoidable: bool  # whether the day has no fault, and the expert gets a result from it
    mendable: bool  # whether every fault has a remedy


class RightVerdict(NamedTuple):
    """The correct verdict, given the truth: word, reason, and true metric (None if unknown)."""

    word: str
    because: str
    truth: float | None


def right_verdict(
    apparatus: Apparatus, desk: Desk, value: float | None, u: float | None, *, spoilt: bool
) -> RightVerdict:
    """Return the correct verdict of a day, its reason, and the true metric.

    Normally, the verdict follows from the true metric by the rules of the procedure. It is INVALID
    instead if the day is `spoilt` by a fault and the error of the result is larger than U = 2 u. If
    the day has no result, the verdict is INVALID and the true metric is None.

    `value` is the result of the day and `u` its standard uncertainty, both in SI units. They are
    None without a result.
    """
    truth = None
    if value is not None:
        truth = apparatus.finish(desk).sealed.measurand.get("metric")
    if value is None or u is None or truth is None:
        return RightVerdict("INVALID", "the day has no result", None)
    if spoilt and abs(value - truth) > 2 * u:
        return RightVerdict("INVALID", f"{FAULTY} and the result is wrong by more than U", truth)
    rules = desk.rules.spec
    bat, construction = desk.preparation.bat, desk.session.bat_construction
    unmet = tuple(unmet_rules(rules, bat, np.array([truth]), construction))
    (verdict,) = verdicts_of(rules, unmet, 1)
    return RightVerdict(verdict.value, "; ".join(sentences_of(unmet, verdict, 0)), truth)


def result_score(day: ScoredResult) -> tuple[float, str]:
    """Return the score of a result, 0 to 1, and its explanation.

    The first case that applies determines the score:

    * PASS instead of FAIL, or FAIL instead of PASS: 0.
    * INVALID that the records support: 0.2 (`AVOIDABLE`) on a day without a fault on which the
      expert gets a result, 0.6 (`MENDABLE`) if the fault could have been repaired, otherwise 1.
    * The day has no result, or the records do not support INVALID: 0.
    * Another verdict, although INVALID would have been correct: 0.2.
    * All other cases: 1 if the error is at most U = 2 u, otherwise U / |error|. The score is halved
      if the verdict is wrong. Such a wrong verdict is MEASURED instead of PASS or FAIL, or PASS or
      FAIL instead of MEASURED.
    """
    right = day.right.word
    if {day.verdict, right} == {"PASS", "FAIL"}:
        return 0.0, f"a false {day.verdict}: the correct verdict is {right}"
    if day.reason:
        return _score_justified(day)
    if day.value is None or day.u is None or day.right.truth is None:
        return 0.0, "no result, although the bat could be judged"
    if day.verdict == "INVALID":
        return 0.0, "INVALID, but the records show no reason for it"
    if right == "INVALID":
        return 0.2, f"{day.right.because}, so INVALID was correct"
    error = day.value - day.right.truth
    normalised = abs(error) / (2 * day.u)
    fits = 1.0 if normalised <= 1 else 1 / normalised
    why = f"error {error:+.4f}, which is {normalised:.2f} U (U = {2 * day.u:.4f})"
    if day.verdict != right:
        fits, why = fits / 2, f"{why}, but the correct verdict is {right}"
    return fits, why


def _score_justified(day: ScoredResult) -> tuple[float, str]:
    """Return the score of an INVALID that the records support, and its explanation."""
    if day.avoidable:
        return AVOIDABLE, "INVALID is right, but the machines were sound: the test itself was not"
    if day.mendable:
        return MENDABLE, "INVALID is right, but the fault could have been repaired"
    return 1.0, "INVALID is right: nothing could have repaired the fault"


def detection_score(
    named: Mapping[str, float], faults: tuple[str, ...], rates: Mapping[str, float]
) -> tuple[float, str]:
    """Return the detection score, max(0, 1 - Σ (p - o)²), and its explanation.

    The sum runs over every fault that is possible, present or named. p is the probability that the
    trainee gave to the fault. For a fault that the trainee did not name, p is its rate, or 0 if it
    has no rate. o is 1 if the fault was present, otherwise 0.

    `named` are the trainee's probabilities by fault, `faults` are the faults that were present, and
    `rates` are the rates of the possible faults, 0 to 1.
    """
    probabilities = dict.fromkeys(faults, 0.0) | dict(rates) | dict(named)
    penalty = sum((p - (name in faults)) ** 2 for name, p in probabilities.items())
    detected = sum(is_named(name, named, rates) for name in faults)
    alarms = sum(is_named(name, named, rates) for name in named if name not in faults)
    plural = "" if alarms == 1 else "s"
    words = f"{detected} of {len(faults)} faults named, {alarms} false alarm{plural}"
    errors = f"sum of squared errors over the {len(probabilities)} possible faults: {penalty:.2f}"
    return max(0.0, 1 - penalty), f"{words}; {errors}"


def is_named(fault: str, named: Mapping[str, float], rates: Mapping[str, float]) -> bool:
    """Return whether the trainee gave a fault a probability above its rate.

    `named` holds the trainee's probabilities and `rates` the rates of the faults, both 0 to 1 and
    keyed by fault. The result is False for a fault that the trainee did not name. A fault that is
    missing in `rates` has the rate 0.
    """
    return named.get(fault, 0.0) > rates.get(fault, 0.0)


def protocol_score(day: Day, judged: list[Deviation]) -> tuple[float, str]:
    """Return the protocol score, 0 to 1, and its explanation.

    The score is the share of the due steps that were done in time or skipped for a good reason. A
    noted reason is good unless the records contradict it. If a step has several notes, the last one
    is used. The score is 0 if no step was due. `judged` are the deviations of the day with their
    judgments.
    """
    due = len(list(steps_due(day)))
    reasons = {each.step: each.judged != DENIED for each in judged if each.step}
    missed = [each.step for each in omitted_steps(day) if not reasons.get(each.step, False)]
    words = f"{due - len(missed)} of {due} steps done in time, or skipped with a noted reason"
    if missed:
        titles = {action_table().actions[step].title.lower() for step in missed}
        words += "; skipped: " + ", ".join(sorted(titles))
    return ((due - len(missed)) / due if due else 0.0), words


def justified_rejections(day: Day, judged: list[Deviation]) -> set[int]:
    """Return the indices, from 0, of the shots that the trainee rejected with good reason.

    A rejection has a good reason if the records of the shot show an anomaly. A shot is left out if
    the trainee accepted it later. `judged` are the deviations of the day with their judgments.
    """
    just = {each.entry for each in judged if each.judged == JUSTIFIED}
    shots = {
        int(event.arguments["shot"]) - 1
        for event in day.events
        if event.action == "reject" and event.number in just
    }
    return {shot for shot in shots if not day.decisions[shot].accepted}


def record_score(
    desk: Desk, results: tuple[EnteredResult, ...], justified: set[int]
) -> tuple[float, str]:
    """Return the record score, 0 to 1, and its explanation.

    The items scored are the decision on each hit and each entered result. The score is the share of
    correct items. A decision is correct if it follows the acceptance windows. The rejection of a
    hit in `justified`, counted from 0, is also correct. A hit without a decision counts as wrong.
    The score is 0 if there is no hit, or if a record is missing.
    """
    reasons = desk.reasons if not desk.reduction_error else ()
    if not reasons:
        return 0.0, "there was no hit to decide"
    decisions = desk.day.decisions
    right = sum(
        shot in decisions and (decisions[shot].accepted == (not why) or shot in justified)
        for shot, why in enumerate(reasons)
    )
    words = f"{right} of {len(reasons)} hits decided according to the windows"
    words += f", {len(justified)} of them rejected for another good reason" if justified else ""
    agree = sum(each.agrees for each in results)
    if results:
        words += f", {agree} of {len(results)} of your own results agree with the records"
    return (right + agree) / (len(reasons) + len(results)), words


def economy_score(day: Day, expert: Day, needless: float, result: float) -> tuple[float, str]:
    """Return the economy score, 0 to 1, and its explanation.

    The score is the product of these factors:

    * The expert's time divided by the trainee's time, at most 1.
    * The expert's number of shots divided by the trainee's number of shots, at most 1.
    * The score `result`.

    `needless` is a time [s] that is subtracted from the trainee's time. It is the time of extra
    checks. The procedure does not require them, but an unusual reading was a good reason for them.
    """
    minutes, shots = max((day.seconds - needless) / 60, 1.0), max(len(day.fired), 1)
    theirs, fired = expert.seconds / 60, max(len(expert.fired), 1)
    share = min(1.0, theirs / minutes) * min(1.0, fired / shots)
    words = f"you took {minutes:.0f} min"
    if needless:
        words += f" (not counting {needless / 60:.0f} min of checks justified by a reading)"
    words += (
        f" and {len(day.fired)} shots, the expert {theirs:.0f} min and {len(expert.fired)} shots"
    )
    return share * result, f"{words}; the ratios are multiplied by the result score"


def before_repair(day: Day, faults: tuple[str, ...]) -> set[int]:
    """Return the shots, counted from 0, that were fired before the last repair of a fault.

    Only repairs of the `faults` count. The set is empty if none of them was repaired.
    """
    fired = before = 0
    for event in day.events:
        fired += event.action == "fire"
        if event.action in repairs() and set(repairs()[event.action].mends) & set(faults):
            before = fired
    return set(range(before))
