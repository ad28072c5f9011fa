"""Errors of located positions: rms error, bias, and shares of lost, flagged or wrong positions."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.fidelity.camera_estimators import Estimator
from virtual_lab.fidelity.camera_scenes import Batch, EstimatorInput
from virtual_lab.video.locate.located import Located

BEYOND = 5.0  # smallest error of a wrong position [standard uncertainties]


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionScore:
    """Errors of positions in many pictures. A picture without a position counts only as lost."""

    rms: float  # root mean square error along an axis [px]
    bias: float  # largest mean error at one position within a pixel, relative to the limit
    lost: float  # share of pictures without a position
    flagged: float  # share of pictures with a position and a flag
    unsaid: float  # share of pictures with a wrong position (error above 5 u) and no flag


def score_positions(batch: Batch, located: Located) -> PositionScore:
    """Return the score of the located positions in a batch of pictures.

    * `rms`: rms error along an axis [px].
    * `bias`: largest absolute bias along an axis, divided by the limit of the batch (no unit).
    * `lost`: share of pictures without a position, 0 to 1.
    * `flagged`: share of pictures with a position and a flag, 0 to 1.
    * `unsaid`: share of pictures with an error above 5 u but without a flag, 0 to 1.

    The limit of the batch is the smallest possible standard uncertainty of a position. A bias is a
    mean error. The mean is over all pictures in which the true x has the same fraction of a pixel.
    If no picture has a position, `rms` and `bias` are inf, `lost` is 1 and the other shares are 0.
    """
    errors = np.stack([located.x - batch.x, located.y - batch.y])
    finite = np.isfinite(errors).all(axis=0)
    if not finite.any():
        return PositionScore(rms=np.inf, bias=np.inf, lost=1.0, flagged=0.0, unsaid=0.0)
    _, phase = np.unique(np.round(batch.x % 1.0, 6), return_inverse=True)
    means = [errors[:, finite & (phase == k)].mean(axis=1) for k in np.unique(phase[finite])]
    return PositionScore(
        rms=float(np.sqrt(np.mean(errors[:, finite] ** 2))),
        bias=float(np.abs(means).max() / batch.limit),
        lost=float(1 - finite.mean()),
        flagged=float((finite & (located.flags != 0)).mean()),
        unsaid=float(wrong_unsaid(batch, located).mean()),
    )


def wrong_unsaid(batch: Batch, located: Located) -> NDArray[np.bool_]:
    """Return the mask of positions with an error above 5 u and without a flag, shape (picture,).

    The error along x or along y must be above 5 u. u includes the uncertainty from the pattern of
    the ball. If a method states no u, ``batch.limit`` is used instead. This is the smallest
    possible standard uncertainty of a position. The mask is False for a picture without a position.
    """
    pattern = np.nan_to_num(located.pattern_u)
    wrong = np.zeros(batch.x.shape, bool)
    for place, u, true in ((located.x, located.x_u, batch.x), (located.y, located.y_u, batch.y)):
        total_u = np.hypot(np.where(np.isnan(u), batch.limit, u), pattern)
        wrong |= np.abs(place - true) > BEYOND * total_u
    return np.asarray(wrong & (located.flags == 0))


def seconds_per_picture(estimator: Estimator, inputs: EstimatorInput, rounds: int = 3) -> float:
    """Return the CPU time that an estimator needs per picture [s].

    A run locates the ball in all pictures of `inputs`. The result is the shortest time of `rounds`
    runs after a warm-up.
    """
    estimator(inputs)
    times = []
    for _ in range(rounds):
        begun = time.process_time()
        estimator(inputs)
        times.append(time.process_time() - begun)
    return min(times) / len(inputs.regions.pixels)
