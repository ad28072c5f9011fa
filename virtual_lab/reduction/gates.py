"""Gate and board records to passages: when, and how high, the ball's centre passed each gate.

A gate's two edges lie symmetrically about the passage of the centre, whatever part of the
beam trips it and however the ball passes it, so their mean is the passage. A board's beams
each see a chord: the squares of the chords fall along a parabola whose top is the height of
the centre, and the means of their edges along a line that passes through its time there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records import BoardRecord, GateRecord, PassageRecord

__all__ = ["Passages", "passages"]

Array = NDArray[np.float64]
INBOUND, OUTBOUND = 0, 1
FEWEST_BEAMS = 4  # broken, for a parabola and a word on how well it fits


@dataclass(frozen=True, slots=True, kw_only=True)
class Passages:
    """Shown times and heights of the centre at each gate, (shot, way, gate); NaN: not seen."""

    times: Array  # [s]
    heights: Array  # above the gates' own zeros [m]
    misfit: Array  # rms of the edges about the parabola and the line, (shot, way) [s]

    def part(self, chosen: NDArray[np.bool_]) -> Passages:
        """Return some of the shots."""
        return Passages(
            times=self.times[chosen], heights=self.heights[chosen], misfit=self.misfit[chosen]
        )

    @property
    def duration_in(self) -> Array:
        """Time from the first gate to the last [s], (shot,)."""
        return np.asarray(self.times[:, INBOUND, -1] - self.times[:, INBOUND, 0])

    @property
    def duration_out(self) -> Array:
        """The same for the ball coming back: from the last gate to the first [s]."""
        return np.asarray(self.times[:, OUTBOUND, 0] - self.times[:, OUTBOUND, -1])


def passages(
    record: GateRecord | BoardRecord | PassageRecord, *, lowest: float = 0.0, pitch: float = 1.0
) -> Passages:
    """Return the passages a record holds.

    Parameters
    ----------
    record
        Edges of gates or boards, or passages a recorder has summed up itself.
    lowest, pitch
        Of a board: height of its lowest beam above its zero, and from beam to beam [m].
    """
    if isinstance(record, BoardRecord):
        return _of_boards(record, lowest, pitch)
    if isinstance(record, PassageRecord):
        times, heights = record.times, record.heights
    else:
        times = record.times.mean(axis=-1)
        heights = np.full(times.shape, np.nan)
    return Passages(times=times, heights=heights, misfit=np.full(times.shape[:2], np.nan))


def _of_boards(record: BoardRecord, lowest: float, pitch: float) -> Passages:
    middle, chord = record.times.mean(axis=-1), np.diff(record.times, axis=-1)[..., 0]
    broken = np.isfinite(chord)
    many = broken.sum(axis=-1)
    count = np.where(many >= FEWEST_BEAMS, many, np.nan)
    beams = np.arange(middle.shape[-1], dtype=float)
    about = (broken @ beams) / count
    place = np.where(broken, beams - about[..., None], 0.0)  # of the beams broken, in pitches
    longest = np.where(broken, chord, 0.0).max(axis=-1)[..., None]
    scale = np.where(longest > 0, longest, 1.0)
    square = (np.where(broken, chord, 0.0) / scale) ** 2
    # an edge's noise moves the square of a chord in proportion to the chord
    weight = np.where(broken, 1 / np.maximum(square, 1e-2), 0.0)
    moments = np.stack([(weight * place**power).sum(axis=-1) for power in range(5)], axis=-1)
    matrix = np.stack([moments[..., i : i + 3] for i in range(3)], axis=-2)
    right = np.stack([(weight * square * place**power).sum(axis=-1) for power in range(3)], axis=-1)
    known = np.isfinite(count)
    matrix = np.where(known[..., None, None], matrix, np.eye(3))
    parabola = np.linalg.solve(matrix, right[..., None])[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        top = -parabola[..., 1] / (2 * parabola[..., 2])
        fitted = sum(parabola[..., k, None] * place**k for k in range(3))
        spread = (place**2).sum(axis=-1)
        shown = np.where(broken, middle, 0.0)
        mean = shown.sum(axis=-1) / count
        lean = (place * np.where(broken, middle - mean[..., None], 0.0)).sum(axis=-1) / spread
        off_line = np.where(broken, middle - mean[..., None] - lean[..., None] * place, 0.0)
        off_top = np.where(
            broken, scale * (square - fitted) / (2 * np.sqrt(np.maximum(square, 1e-2))), 0.0
        )
    inside = known & (np.abs(top) < middle.shape[-1])
    degrees = np.where(inside, 2 * many - 5, 0).sum(axis=-1)
    rest = np.where(inside[..., None], off_line**2 + off_top**2 / 4, 0.0).sum(axis=(-1, -2))
    return Passages(
        times=np.where(inside, mean + lean * np.where(inside, top, 0.0), np.nan),
        heights=np.where(inside, lowest + pitch * (about + top), np.nan),
        misfit=np.sqrt(rest / np.where(degrees > 0, degrees, np.nan)),
    )
