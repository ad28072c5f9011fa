"""All checks of a session, in the order of the day."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

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
from virtual_lab.measurement.diagnostics.flag import Flag
from virtual_lab.measurement.diagnostics.impact import (
    aim,
    ball_seen,
    boards_in_line,
    edges,
    encoder_fit,
    recoil_and_rebound,
)

CHECKS: Mapping[str, Callable[[Evidence], Iterator[Flag]]] = {
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
    "encoder-fit": encoder_fit,
    "recoil-and-rebound": recoil_and_rebound,
}


def flags(seen: Evidence) -> tuple[Flag, ...]:
    """Return the flags of a session, at most one per check: the most serious one."""
    found = (next(check(seen), None) for check in CHECKS.values())
    return tuple(flag for flag in found if flag)
