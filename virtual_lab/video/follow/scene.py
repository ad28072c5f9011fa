"""Knowledge of a clip before its flights are known, in pixels and frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import Array
from virtual_lab.video.clips.calibration_file import EXACT
from virtual_lab.video.find.blobs import Blobs
from virtual_lab.video.follow.knowledge import LEVEL_U
from virtual_lab.video.follow.pieces import Piece

FOCAL = 0.8  # focal length of a phone [longer sides of the picture]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightScene:
    """Blobs, times, and knowledge of camera and scale."""

    blobs: Blobs
    time: Array  # time of each frame [frames]; NaN: a repeat
    stamped: Array  # time of each frame by its time stamp, repeats included [frames]
    size: tuple[int, int]  # columns, rows
    exposure: float | None  # [frames]
    fall: float | None = None  # g [lengths/frame²]
    drag: tuple[float, float] | None = None  # drag and its u, if known [1/length]
    # whether the unit of length in `fall` and `drag` is the ball's radius; otherwise it is the
    # pixel
    in_radii: bool = True
    readout: float | None = 0.0  # [frames]; None: unknown, at most 1
    readout_u: float = EXACT
    pull: Array | None = None  # g, if known, (2,) [px/frame²]
    # u of the camera's angle off level, and off square, a number or (2,) [rad]
    level_u: Array | float = LEVEL_U
    readout_axis: tuple[int, int] = (1, 1)  # axis of the picture (0: x), and direction along it
    # (blob, 2), change of positions by u of the focal length; None: the camera does not turn
    lens: Array | None = None

    @property
    def tilt_u(self) -> Array:
        """Standard uncertainty of the tilt of the perspective, (2,) or a number [1/px]."""
        return np.asarray(np.tan(self.level_u) / FOCAL / max(self.size))

    def gravity_of(self, radius: float) -> float | None:
        """Return gravity [px/frame²] for a ball of `radius` [pixels], None if it is unknown."""
        return self.fall and self.fall * (radius if self.in_radii else 1.0)

    def missing_frames(self, flights: Sequence[Piece]) -> dict[int, int]:
        """Return the number of missing frames before a frame, by the number of this frame.

        The dictionary is empty without flights, or if no frame is missing.
        """
        if not flights:
            return {}
        frames, t = (np.concatenate([getattr(e, n) for e in flights]) for n in ("frames", "t"))
        more = np.diff(t) - np.diff(self.time[frames])
        return {int(frames[k + 1]): round(more[k]) for k in np.flatnonzero(more > 0.5)}

    def ahead(self, one: Piece, other: Piece) -> float:
        """Return the number of frames that are missing from the file between two flights."""
        passed = self.time[other.frames[0]] - self.time[one.frames[-1]]
        return float(other.t[0] - one.t[-1] - passed)

    def late(self, blobs: NDArray[np.intp]) -> Array:
        """Return when blobs were read, as a fraction of the readout time, 0 to 1, (blob,)."""
        axis, sense = self.readout_axis
        at = self.blobs["picture_x" if axis == 0 else "picture_y"][blobs]
        share = np.clip(at / (self.size[axis] - 1), 0, 1)
        return np.asarray(share if sense > 0 else 1 - share)
