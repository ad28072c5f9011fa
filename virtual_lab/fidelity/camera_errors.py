"""How far off places are: spread, bias by phase, what is lost, flagged, or wrong unsaid."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.fidelity.camera_estimators import Estimator
from virtual_lab.fidelity.camera_scenes import Batch, EstimatorInput
from virtual_lab.video.locate.located import Located

BEYOND = 5.0  # standard uncertainties: no error of a sound picture is as large


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceScore:
    """Of many pictures; those without a place count in `lost` alone."""

    rms: float  # of an error along an axis [pixel]
    bias: float  # worst mean of a phase, over the limit
    lost: float  # share without a place
    flagged: float  # share with a place and a flag
    unsaid: float  # share off by more than five of its own standard uncertainties, unflagged


def score_places(batch: Batch, found: Located) -> PlaceScore:
    """Return what places are worth."""
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
    """Return which places are off by more than five of their uncertainties with no flag for it.

    A method that states no uncertainty is taken at the limit.
    """
    pattern = np.nan_to_num(found.pattern_u)
    wrong = np.zeros(batch.x.shape, bool)
    for place, u, true in ((found.x, found.x_u, batch.x), (found.y, found.y_u, batch.y)):
        said = np.hypot(np.where(np.isnan(u), batch.limit, u), pattern)
        wrong |= np.abs(place - true) > BEYOND * said
    return np.asarray(wrong & (found.flags == 0))


def seconds_a_picture(estimator: Estimator, given: EstimatorInput, rounds: int = 3) -> float:
    """Return the least processor time a picture takes [s]; done once before."""
    estimator(given)
    times = []
    for _ in range(rounds):
        begun = time.process_time()
        estimator(given)
        times.append(time.process_time() - begun)
    return min(times) / len(given.seen.pixels)
