"""All checks of a session, in the order of the day."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from virtual_lab.measurement.diagnostics.bench import (
    bat_shape,
    check_standard,
    lot_rules,
    pendulum_swing,
    sports,
    wall_drift,
)
from virtual_lab.measurement.diagnostics.chords import chords
from virtual_lab.measurement.diagnostics.evidence import Evidence
from virtual_lab.measurement.diagnostics.flag import Discrepancy, Flag
from virtual_lab.measurement.diagnostics.impact import (
    aim,
    ball_seen,
    boards_in_line,
    edges,
    encoder_fit,
    encoder_halves,
    recoil_and_rebound,
    records_repeated,
)
from virtual_lab.records import PassageRecord, RateRecord

CHECKS: Mapping[str, Callable[[Evidence], Iterator[Flag | Discrepancy]]] = {
    "sports": sports,
    "check-standard": check_standard,
    "bat-shape": bat_shape,
    "pendulum-swing": pendulum_swing,
    "lot-rules": lot_rules,
    "wall-drift": wall_drift,
    "chords": chords,
    "ball-seen": ball_seen,
    "edges": edges,
    "boards-in-line": boards_in_line,
    "aim": aim,
    "records-repeated": records_repeated,
    "encoder-fit": encoder_fit,
    "encoder-halves": encoder_halves,
    "recoil-and-rebound": recoil_and_rebound,
}


OF_READINGS = {  # checks of what a recorder that sums up does not keep
    PassageRecord: ("chords", "edges"),
    RateRecord: ("encoder-fit", "encoder-halves"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """What the checks of a session found."""

    flags: tuple[Flag, ...]  # at most one a check: the most serious one
    pairs: tuple[Discrepancy, ...]  # the differences compared with their uncertainties
    left_out: tuple[str, ...]  # checks of readings that a recorder which sums up does not keep


def check(seen: Evidence) -> Checked:
    """Return what the checks find in a session."""
    every = [tuple(one(seen)) for one in CHECKS.values()]
    flags = [tuple(_raised(found)) for found in every]
    kinds = {type(record) for record in seen.session.records["impact"].values()}
    return Checked(
        flags=tuple(max(own, key=lambda flag: flag.invalidates) for own in flags if own),
        pairs=tuple(found for own in every for found in own if isinstance(found, Discrepancy)),
        left_out=tuple(name for kind, own in OF_READINGS.items() if kind in kinds for name in own),
    )


def _raised(found: Iterable[Flag | Discrepancy]) -> Iterator[Flag]:
    for each in found:
        flag = each.flag if isinstance(each, Discrepancy) else each
        if flag:
            yield flag
