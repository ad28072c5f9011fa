"""All checks of a session, in the order of the day."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from virtual_lab.measurement.diagnostics.bench import (
    air_read_and_stated,
    bat_shape,
    check_standard,
    lot_rules,
    pendulum_even,
    pendulum_swing,
    scale_drift,
    sports,
    store,
    wall_drift,
)
from virtual_lab.measurement.diagnostics.boards import boards_in_line, heights
from virtual_lab.measurement.diagnostics.chords import chords
from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Answer, Discrepancy, Flag, Pairs
from virtual_lab.measurement.diagnostics.impact import (
    aim,
    ball_seen,
    edges,
    encoder_fit,
    encoder_halves,
    recoil_and_rebound,
)
from virtual_lab.measurement.diagnostics.repeats import records_repeated
from virtual_lab.records import REFERENCE_MASS, PassageRecord, RateRecord, Record
from virtual_lab.records.particulars import Particulars
from virtual_lab.records.session import Session
from virtual_lab.units import Mask

CALIBRATION_DUE, DECISIONS = "calibration-due", "decisions"
SCALE_DRIFT = "scale-drift"
CHECKS: Mapping[str, Callable[[Evidence], Iterator[Answer]]] = {
    "sports": sports,
    "check-standard": check_standard,
    "bat-shape": bat_shape,
    SCALE_DRIFT: scale_drift,
    "pendulum-swing": pendulum_swing,
    "pendulum-even": pendulum_even,
    "air-density": air_read_and_stated,
    "store": store,
    "lot-rules": lot_rules,
    "wall-drift": wall_drift,
    "chords": chords,
    "ball-seen": ball_seen,
    "edges": edges,
    "boards-in-line": boards_in_line,
    "heights": heights,
    "aim": aim,
    "records-repeated": records_repeated,
    "encoder-fit": encoder_fit,
    "encoder-halves": encoder_halves,
    "recoil-and-rebound": recoil_and_rebound,
}

# checks of readings that a recorder does not keep if it stores only results
OF_READINGS: Mapping[type[Record], tuple[str, ...]] = {
    PassageRecord: ("chords", "edges", "records-repeated"),
    RateRecord: ("encoder-fit", "encoder-halves", "records-repeated"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """Results of all checks of a block."""

    answers: tuple[tuple[Answer, ...], ...]  # answers of each check, in the order of the test day
    left_out: tuple[str, ...]  # checks for which the records lack the readings

    def flags(self, laboratory: int) -> Iterator[Flag]:
        """Yield the flags in one laboratory, at most one per check: the most serious one."""
        for answers in self.answers:
            candidates = [flag for each in answers if (flag := each.row(laboratory))]
            if candidates:
                yield max(candidates, key=lambda flag: flag.invalidates)

    def pairs(self, laboratory: int) -> Iterator[Discrepancy]:
        """Yield the differences in one laboratory that were compared with their uncertainties."""
        for each in (one for answers in self.answers for one in answers if isinstance(one, Pairs)):
            if difference := each.difference(laboratory):
                yield difference

    @property
    def voids(self) -> Mapping[str, Mask]:
        """Mask of the laboratories in which a check rules out a verdict, keyed by check name."""
        return {
            name: np.logical_or.reduce([each.voids for each in answers])
            for name, answers in zip(CHECKS, self.answers, strict=True)
            if answers
        }

    @property
    def flagged(self) -> Mapping[str, Mask]:
        """Mask of the laboratories in which a check raises a flag, keyed by check name."""
        return {
            name: np.logical_or.reduce([each.where for each in answers])
            for name, answers in zip(CHECKS, self.answers, strict=True)
            if answers
        }


def check(evidence: Evidence) -> Checked:
    """Return the results of all checks for a block of sessions.

    `Checked.answers` has one tuple per check, in the order of the test day. The tuple has the
    results that the check yields, possibly none. A result states which laboratories raise the flag
    of the check. There may be no such laboratory.

    `Checked.left_out` names the checks that cannot be done because the records lack the readings.
    """
    kinds: set[type[Record]] = {type(record) for record in evidence.block.impact.values()}
    unweighed = REFERENCE_MASS not in evidence.block.records["bench"]
    return Checked(
        answers=tuple(tuple(one(evidence)) for one in CHECKS.values()),
        left_out=tuple(
            name
            for name in CHECKS
            if any(name in OF_READINGS.get(kind, ()) for kind in kinds)
            or (unweighed and name == SCALE_DRIFT)
        ),
    )


def overdue(particulars: Particulars, date: str) -> Iterator[Flag]:
    """Yield a flag for each instrument with a calibration that was due before the day of the test.

    The day of the test is read from the particulars. If they do not state it, it is `date`. Both
    have the ISO form, such as 2026-05-31. Nothing is yielded for an instrument without a due date.
    Nothing at all is yielded if the day of the test is not known.
    """
    day = particulars.test.begun or date
    for name, each in particulars.instruments.items():
        if each.due and day and each.due < day:
            sentence = f"the calibration of {name} ({each.identity}) was due on {each.due}"
            yield Flag(name=CALIBRATION_DUE, sentence=f"{sentence}, but the test was on {day}")


def decisions_elsewhere(session: Session) -> Iterator[Flag]:
    """Yield a flag if the records hold decisions on hits, but are not those of a rehearsed day."""
    if session.decisions and not session.is_rehearsed:
        count = len(session.decisions)
        sentence = f"the records hold {count} decisions of a person on hits, which were not obeyed"
        yield Flag(name=DECISIONS, sentence=f"{sentence}: only a rehearsed day may hold any")
