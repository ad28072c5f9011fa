"""Whether a camera's places lean with where between its pixels the ball is: a test on a clip.

Let a ball move slowly through the picture, at no simple fraction of a pixel a frame. Its way is
smooth; whatever comes and goes with each pixel it crosses is the locating's own error, the bias
that pixels make. Way and bias are fitted together, so that neither takes the other's part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError

__all__ = ["PhaseBias", "phase_bias"]

Array = NDArray[np.float64]
SMOOTH = 4  # terms of the way: a cubic
WAVES = 2  # a pixel, and half of one
COUNT = SMOOTH + 2 * WAVES
BINS = 8  # of a pixel
LEAST = 4 * COUNT  # frames
MOST = 4.0  # times the u that evenly spread phases would give: these do not tell
CERTAIN = 0.999


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseBias:
    """Along one axis of the picture, in pixels."""

    frames: int
    bias: float  # at the worst phase
    bias_u: float  # standard uncertainty
    scatter: float  # standard deviation of what neither way nor bias explains
    seen: bool  # more than noise would make once in a thousand clips
    phases: Array  # (bin,) middles, 0 at a pixel's centre
    means: Array  # (bin,) of the places about their way; NaN where there is none
    counts: NDArray[np.int64]  # (bin,)


def phase_bias(places: Array, times: Array, where: str = "phases") -> PhaseBias:
    """Return the bias of places along an axis as a function of the phase between pixels.

    Parameters
    ----------
    places
        Of the ball, all of one flight, (frame,) [pixel]; NaN where it was not found.
    times
        (frame,), in any unit.

    Raises
    ------
    InputError
        Too few frames, or phases that do not tell: a ball that stands, or moves by whole pixels.
    """
    from scipy.special import chdtri

    here = np.isfinite(places)
    x, t = places[here], times[here]
    if x.size < LEAST:
        raise InputError(where, "frames", int(x.size), f"allowed: {LEAST} or more of one flight")
    span = 2 * (t - t.min()) / np.ptp(t) - 1
    way = np.polynomial.legendre.legvander(span, SMOOTH - 1)
    fitted = way @ np.linalg.lstsq(way, x, rcond=None)[0]
    waves = _waves(fitted)  # by the way: the places' own errors would lean on themselves
    design = np.concatenate([way, waves], axis=1)
    inverse = np.linalg.pinv(design.T @ design, hermitian=True)[SMOOTH:, SMOOTH:]
    even = np.eye(2 * WAVES) * 2 / x.size
    rank = np.linalg.matrix_rank(design, tol=1e-3 * np.sqrt(x.size))
    if rank < COUNT or np.trace(inverse) > MOST**2 * np.trace(even):
        allowed = "a way of some pixels, at no simple fraction of a pixel a frame"
        raise InputError(where, "phases", _filled(fitted), f"of {BINS} seen; allowed: {allowed}")
    solved = np.linalg.lstsq(design, x, rcond=None)[0]
    left = x - design @ solved
    scatter = float(np.sqrt(left @ left / (x.size - COUNT)))
    own = solved[SMOOTH:]
    fine = _waves(np.arange(64) / 64)
    bias = fine @ own
    worst = int(np.argmax(np.abs(bias)))
    strength = own @ np.linalg.solve(inverse, own) / max(scatter, 1e-12) ** 2
    means, counts = _binned(fitted, x - way @ solved[:SMOOTH])
    return PhaseBias(
        frames=int(x.size),
        bias=float(abs(bias[worst])),
        bias_u=scatter * float(np.sqrt(fine[worst] @ inverse @ fine[worst])),
        scatter=scatter,
        seen=bool(strength > chdtri(2 * WAVES, 1 - CERTAIN)),
        phases=np.arange(BINS) / BINS,
        means=means,
        counts=counts,
    )


def _waves(places: Array) -> Array:
    """Return waves that come again with each pixel, (place, 2 WAVES)."""
    turn = 2 * np.pi * places[:, None] * (1 + np.arange(WAVES))
    return np.concatenate([np.cos(turn), np.sin(turn)], axis=1)


def _bins(places: Array) -> NDArray[np.int64]:
    return np.asarray(np.round(BINS * (places % 1.0)), np.int64) % BINS


def _filled(places: Array) -> int:
    return int(np.unique(_bins(places)).size)


def _binned(places: Array, off: Array) -> tuple[Array, NDArray[np.int64]]:
    counts = np.bincount(_bins(places), minlength=BINS)
    sums = np.bincount(_bins(places), weights=off, minlength=BINS)
    means = np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
    return means, counts.astype(np.int64)
