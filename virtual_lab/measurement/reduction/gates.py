"""From gate and board records to passages: time and height of the ball's centre at each gate.

The two edges of a gate lie symmetrically about the passage of the centre, whatever part of the
beam triggers and wherever the ball passes, so their mean is the time of passage. Each beam of a
board measures a chord of the ball: the squares of the chords over height form a parabola with its
maximum at the height of the centre; the means of the edges form a line that gives the time there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records import BoardRecord, GateRecord, PassageRecord
from virtual_lab.units import Array

INBOUND, OUTBOUND = 0, 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Passages:
    """Uncorrected times and heights of the centre, (shot, way, gate); NaN: not seen."""

    times: Array  # [s]
    heights: Array  # above the gates' own zeros [m]
    heights_u: Array  # of each height, by the scatter of its edges; 0 where there are none [m]
    misfit: Array  # rms of the edges about the parabola and the line, (shot, way) [s]

    def part(self, chosen: NDArray[np.bool_]) -> Passages:
        """Return some of the shots."""
        return Passages(
            times=self.times[chosen],
            heights=self.heights[chosen],
            heights_u=self.heights_u[chosen],
            misfit=self.misfit[chosen],
        )

    @property
    def duration_in(self) -> Array:
        """Time from the first gate to the last [s], (shot,)."""
        return np.asarray(self.times[:, INBOUND, -1] - self.times[:, INBOUND, 0])

    @property
    def duration_out(self) -> Array:
        """Time of the returning ball from the last gate to the first [s], (shot,)."""
        return np.asarray(self.times[:, OUTBOUND, 0] - self.times[:, OUTBOUND, -1])


def passages(
    record: GateRecord | BoardRecord | PassageRecord, *, lowest: float = 0.0, pitch: float = 1.0
) -> Passages:
    """Return the passages a record holds.

    Parameters
    ----------
    record
        Edges of gates or boards, or passages computed by the recorder.
    lowest, pitch
        For a board: height of the lowest beam above its zero, and distance between beams [m].
    """
    if isinstance(record, BoardRecord):
        return _of_boards(record, lowest, pitch)
    if isinstance(record, PassageRecord):
        times, heights = record.times, record.heights
    else:
        times = record.times.mean(axis=-1)
        heights = np.full(times.shape, np.nan)
    return Passages(
        times=times,
        heights=heights,
        heights_u=np.zeros(times.shape),
        misfit=np.full(times.shape[:2], np.nan),
    )


def _of_boards(record: BoardRecord, lowest: float, pitch: float) -> Passages:
    from virtual_lab.measurement.reduction.boards_kernel import fit_boards

    times, heights, heights_u = np.empty((3, *record.times.shape[:3]))
    misfit = np.empty(times.shape[:2])
    fit_boards(record.times, times, heights, heights_u, misfit)
    return Passages(
        times=times, heights=lowest + pitch * heights, heights_u=pitch * heights_u, misfit=misfit
    )
