"""Errors of located positions: spread, bias by phase, and shares lost, flagged or wrong."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.fidelity.camera_estimators import Estimator
from virtual_lab.fidelity.camera_scenes import Batch, EstimatorInput
from virtual_lab.video.locate.located import Located

BEYOND = 5.0  # error beyond which a position is wrong [standard uncertainties]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceScore:
    """Errors of the positions in many pictures. Pictures without a position count as lost only."""

    rms: float  # root mean square error along an axis [px]
    bias: float  # largest mean error of a phase, relative to the limit
    lost: float  # share of pictures without a position
    flagged: float  # share of pictures with a position and a flag
    unsaid: float  # share with an error above five stated standard uncertainties and no flag


def score_places(batch: Batch, found: Located) -> PlaceScore:
    """Return the errors of the positions in a batch of pictures."""
    off = np.stack([found.x - batch.x, found.y - batch.y])
    here = np.isfinite(off).all(axis=0)
    if not here.any():
        return PlaceScore(rms=np.inf, bias=np.inf, lost=1.0, flagged=0.0, unsaid=0.0)
    _, phase = np.unique(np.round(batch.x % 1.0, 6), return_inverse=True)
    means = [off[:, here & (phase == k)].mean(axis=1) for k in np.unique(phase[here])]
    return PlaceScore(
        rms=float(np.sqrt(np.mean(off[:, here] ** 2))),
        bias=float(np.abs(means).max() / batch.limit),
        lost=float(1 - here.mean()),
        flagged=float((here & (found.flags != 0)).mean()),
        unsaid=float(wrong_unsaid(batch, found).mean()),
    )


def wrong_unsaid(batch: Batch, found: Located) -> NDArray[np.bool_]:
    """Return a mask of positions with an error above five standard uncertainties and no flag.

    If a method states no uncertainty, the limit is used.
    """
    pattern = np.nan_to_num(found.pattern_u)
    wrong = np.zeros(batch.x.shape, bool)
    for place, u, true in ((found.x, found.x_u, batch.x), (found.y, found.y_u, batch.y)):
        said = np.hypot(np.where(np.isnan(u), batch.limit, u), pattern)
        wrong |= np.abs(place - true) > BEYOND * said
    return np.asarray(wrong & (found.flags == 0))


def seconds_a_picture(estimator: Estimator, given: EstimatorInput, rounds: int = 3) -> float:
    """Return the shortest processor time per picture [s], after one run to warm up."""
    estimator(given)
    times = []
    for _ in range(rounds):
        begun = time.process_time()
        estimator(given)
        times.append(time.process_time() - begun)
    return min(times) / len(given.seen.pixels)
