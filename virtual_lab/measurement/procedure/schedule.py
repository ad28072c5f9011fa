"""Impact positions: the center of percussion, or a scan that approaches the best position.

After each round the next impact positions are computed. They depend only on the shots so far, so a
later reduction of the records gives the same positions.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.measurement.procedure.rules import SETTING_STEP, Procedure, Scan
from virtual_lab.measurement.reduction.kinematics import centre_of_percussion
from virtual_lab.units import Array, Mask

if TYPE_CHECKING:
    from virtual_lab.measurement.procedure.scan_kernel import ScanRules


def percussion_position(bat: Mapping[str, float], pivot_from_knob: float) -> float:
    """Return the distance of the center of percussion from the barrel tip [m].

    `bat` holds the measured `mass`, `length`, `z_cm` and `inertia_cm` [SI]. `pivot_from_knob` is
    the distance of the pivot from the knob [m]. Source: Eq. (11) of Nathan (2003).
    """
    axis = bat["length"] - pivot_from_knob
    return float(centre_of_percussion(bat["z_cm"], bat["inertia_cm"], bat["mass"], axis))


def round_to_setting(positions: Array, *, exact: bool) -> Array:
    """Return positions [m] rounded to multiples of 0.5 mm, the resolution of the rig's setting.

    With `exact` they are returned unchanged. The result has the shape of `positions`.
    """
    return positions if exact else np.round(positions / SETTING_STEP) * SETTING_STEP


class NextShots(NamedTuple):
    """The next shots of a block, sorted by laboratory, (shot,)."""

    owner: NDArray[np.intp]  # laboratory of the shot
    position: Array  # impact position [m]


def next_shots(
    procedure: Procedure,
    percussion: Array,
    owner: NDArray[np.intp],
    position: Array,
    valid: Mask,
    objective: Array,
) -> NextShots:
    """Return laboratory and impact position of each shot in the next round of a block, (shot,).

    Positions are distances from the barrel tip [m]. A round may have several shots per laboratory.
    Without a scan, the round has one shot at the center of percussion for each missing valid hit.
    With a scan, it has the missing hits at the positions that the scan needs next. A laboratory
    gets at most as many shots as it has attempts left, and none if its test is complete.

    Parameters
    ----------
    procedure
        Test procedure. Only its numbers of hits and attempts and its scan are used.
    percussion
        Distance of the measured center of percussion from the tip, (laboratory,) [m].
    owner, position, valid, objective
        For each shot so far, in the order fired, (shot,): index of the laboratory, impact position
        from the tip [m], whether the hit is valid, and the quantity that the scan maximizes.
    """
    laboratories = np.arange(percussion.size)
    fired = np.bincount(owner, minlength=percussion.size)
    if procedure.scan is None:
        hits = np.bincount(owner, valid, percussion.size).astype(int)
        remaining = np.maximum(procedure.attempts - fired, 0)
        number = np.minimum(np.maximum(procedure.valid_hits - hits, 0), remaining)
        return NextShots(laboratories.repeat(number), percussion.repeat(number))
    from virtual_lab.measurement.procedure.scan_kernel import next_hits_of_block

    order, starts = sort_by_laboratory(owner, fired.size)
    number, out = np.empty(fired.size, np.int64), np.empty((fired.size, procedure.attempts))
    columns = position[order], valid[order], objective[order]
    next_hits_of_block(starts, *columns, scan_rules(procedure, procedure.scan), number, out)
    mask = np.arange(procedure.attempts) < number[:, None]
    return NextShots(laboratories.repeat(number), out[mask])


def sort_by_laboratory(
    owner: NDArray[np.intp], laboratories: int
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return the indices that sort shots by laboratory, and where each laboratory begins.

    The indices are (shot,), and the shots of one laboratory keep their order. The second array,
    `starts`, is (laboratory + 1,). Laboratory i has the sorted shots ``starts[i]:starts[i + 1]``.
    """
    fired = np.bincount(owner, minlength=laboratories)
    return np.argsort(owner, kind="stable"), np.append(0, np.cumsum(fired))


def scan_rules(procedure: Procedure, scan: Scan) -> ScanRules:
    """Return the rules of a scan [SI] as the named tuple that the compiled functions need."""
    from virtual_lab.measurement.procedure.scan_kernel import ScanRules

    return ScanRules(
        low=scan.low,
        high=scan.high,
        coarse_step=scan.coarse_step,
        fine_step=scan.fine_step,
        coarse_hits=scan.coarse_hits,
        fit_half_width=scan.fit_half_width,
        final_hits=scan.final_hits,
        consecutive=scan.consecutive,
        valid_hits=procedure.valid_hits,
        attempts=procedure.attempts,
        tolerance=SETTING_STEP / 2,
    )
