"""Width of a metric along the barrel: the length on which it stays near its maximum.

One polynomial is fitted to all valid hits of a scan, coarse and fine. The width is the length on
which the polynomial is at most `Scan.width_drop` below its maximum. For the catalog's bats by
``bbcor``, without noise, this gives widths of 1.4 to 1.8 in, with errors up to 0.03 in. Calibration
errors raise or lower the whole curve. They shift its ends by less than a tenth of the shift that
the scatter of the hits causes, so u is computed from the scatter alone. Hits on the flanks scatter
more than those at the maximum, so each residual is used separately (estimator HC3, MacKinnon and
White 1985, conservative with few hits). In 500 laboratories 94 % of the 95 % intervals contained
the true value.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from virtual_lab.measurement.procedure import Procedure
from virtual_lab.uncertainty.budget import HITS, Budget, combine_components, type_a_component
from virtual_lab.units import Array, Mask


class Span(NamedTuple):
    """An interval around a maximum, and whether each of its ends is only the end of the data."""

    low: float
    high: float
    low_cut_off: bool
    high_cut_off: bool

    @property
    def width(self) -> float:
        """Width of the interval, a lower limit if an end is cut off."""
        return self.high - self.low

    @property
    def whole(self) -> bool:
        """Whether neither end is cut off."""
        return not (self.low_cut_off or self.high_cut_off)

    def scale(self, middle: float, unit: float) -> Span:
        """Return the interval for positions ``middle + unit * position``."""
        return self._replace(low=middle + unit * self.low, high=middle + unit * self.high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Width:
    """The interval in which the fitted curve is at most `drop` below its maximum."""

    drop: float  # allowed drop of the metric
    span: Span  # interval, from the tip [m]
    budget: Budget  # budget of the width [m]; a lower limit without u if the span is cut off


def width_of(procedure: Procedure, position: Array, valid: Mask, metric: Array) -> Width | None:
    """Return the length of barrel on which the metric of one bat stays near its maximum [m].

    A curve is fitted to the metric of the valid hits. On the returned length, the curve is below
    its maximum by at most `width_drop`, a value that the procedure states for its scan. The result
    also states the two ends of the length, as distances from the barrel tip [m]. Return None if the
    procedure states no `width_drop`, or if the valid hits have fewer than seven different
    positions. If the curve does not drop by `width_drop` within the data, the width is a lower
    limit without u.

    Parameters
    ----------
    procedure
        Test procedure. Only its scan is used.
    position, valid, metric
        Impact position from the barrel tip [m], mask of the valid hits, and metric, (shot,).
    """
    if procedure.scan is None or procedure.scan.width_drop is None:
        return None
    drop, position, metric = procedure.scan.width_drop, position[valid], metric[valid]
    degree = 5  # a lower degree is too stiff beside the maximum, a higher one follows the noise
    if np.unique(np.round(position, 6)).size < degree + 2:
        return None
    middle, half = (position.max() + position.min()) / 2, float(np.ptp(position)) / 2
    powers = np.arange(degree + 1)
    design = ((position - middle) / half)[:, None] ** powers
    solved = np.linalg.pinv(design)
    curve = Polynomial(solved @ metric)
    turns = _real(curve.deriv())
    candidates = np.concatenate([[-1.0, 1.0], turns[np.abs(turns) < 1]])
    top = float(candidates[np.argmax(curve(candidates))])
    span = _level_span(_real(curve - (curve(top) - drop)), top, -1.0, 1.0)
    # An end shifts by the change of the curve relative to its maximum, divided by the slope.
    low, high = (
        (end**powers - top**powers) @ solved / -curve.deriv()(end) for end in (span.low, span.high)
    )
    peak = span.scale(middle, half)
    residual = metric - design @ solved @ metric
    free = 1 - np.sum(design * solved.T, axis=1)
    u = float(np.linalg.norm(half * (high - low) * residual / free))
    width, width_u = np.array([peak.width]), np.array([u if span.whole else 0.0])
    scattered = type_a_component(HITS, width, width_u, position.size - powers.size)
    return Width(drop=drop, span=peak, budget=combine_components(width, scattered).row(0))


def _real(curve: Polynomial) -> Array:
    roots = curve.roots()
    return np.asarray(roots.real[np.abs(roots.imag) < 1e-9], dtype=np.float64)


def _level_span(crossings: Array, top: float, low: float, high: float) -> Span:
    """Return the interval around `top` between the nearest crossings of a level.

    An end without a crossing between `low` and `high` is cut off there.
    """
    below = crossings[(crossings >= low) & (crossings < top)]
    above = crossings[(crossings > top) & (crossings <= high)]
    return Span(
        low=float(below.max()) if below.size else low,
        high=float(above.min()) if above.size else high,
        low_cut_off=not below.size,
        high_cut_off=not above.size,
    )
