"""One radius for all regions of a flight, which makes each of their places sharper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.locate.located import Located
from virtual_lab.video.locate.stitched_ball.edge import Edged

__all__ = ["POOLED", "with_one_radius"]

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

POOLED = 6  # regions of a flight at least that tell what all share
STRANGE = 3.0  # standard uncertainties that a radius may be off by
LEAST_U = 0.004  # pixels, of a radius that is shared
STEPS = 6  # of a fit that trusts what is far off less and less


def with_one_radius(found: Edged, oval: Array, flight: Ints) -> Located:
    """Return places told anew by what all regions of a flight together say of the ball's radius.

    Where a fit's own radius is far from that, a pattern at the rim was taken for the outline:
    the place may be off by as much.

    Parameters
    ----------
    found
        Fits of outlines.
    oval
        By how much of itself each outline is longer one way and shorter the other, (region,).
    flight
        Which flight each region shows, (region,); of fewer than `POOLED` good regions each keeps
        its own radius.
    """
    located, own = found.located, found.covariance[:, 2, 2]
    radius, radius_u = _radius(found, oval, flight)
    off = radius - located.radius
    gain = found.covariance[:, :2, 2] / (own + radius_u**2)[:, None]
    total = np.diagonal(found.covariance, axis1=1, axis2=2)[:, :2]
    left = np.sqrt(np.clip(1 - gain * found.covariance[:, :2, 2] / total, 0.0, 1.0))
    strange = np.where(np.abs(off) > STRANGE * np.hypot(found.radius_u, radius_u), off, 0.0)
    pattern = [found.x_pattern_u * left[:, 0], found.y_pattern_u * left[:, 1], strange, strange]
    return replace(
        located,
        x=located.x + gain[:, 0] * off,
        y=located.y + gain[:, 1] * off,
        radius=located.radius + own / (own + radius_u**2) * off,
        x_u=located.x_u * left[:, 0],
        y_u=located.y_u * left[:, 1],
        pattern_u=np.sqrt(np.sum(np.square(pattern), axis=0) / 2),
    )


def _radius(found: Edged, oval: Array, flight: Ints) -> tuple[Array, Array]:
    """Return each region's radius as all of its flight tell it, and its uncertainty [pixel].

    The scale may slope over the picture, and a sphere's radius grows as its oval does. Where too
    few tell, a region's own radius, with an uncertainty that is infinite.
    """
    located = found.located
    radius, radius_u = located.radius.copy(), np.full(len(flight), np.inf)
    good = (located.flags == 0) & np.isfinite(found.radius_u)
    _, of = np.unique(flight, return_inverse=True)
    told = np.flatnonzero((np.bincount(of, good) >= POOLED)[of])
    if not told.size:
        return radius, radius_u
    _, of = np.unique(of[told], return_inverse=True)
    use = good[told]

    def laid(values: Array) -> Array:
        return _by_flight(of[use], values[use])

    places = np.stack([located.x, located.y], axis=1)[told]
    off = np.nan_to_num(places - np.nanmean(laid(places), axis=1)[of]) / 1000.0
    design = np.column_stack([np.ones(len(off)), off]) * (1 + oval[told])[:, None]
    solved, inverse, usual = _fit(laid(design), laid(radius[told]), laid(found.radius_u[told]))
    radius[told] = np.einsum("ri,ri->r", design, solved[of])
    spread = np.zeros(len(usual))
    np.maximum.at(spread, of, np.einsum("ri,rij,rj->r", design, inverse[of], design))
    radius_u[told] = np.maximum(LEAST_U, usual * np.sqrt(spread))[of]
    return radius, radius_u


def _fit(design: Array, told: Array, u: Array) -> tuple[Array, Array, Array]:
    """Return each flight's radius and its slopes, their covariance per that of noise, and noise.

    Radii told and their u are (flight, region), the design (flight, region, 3); NaN: none.
    """
    slope = np.diag([0.0, 1.0, 1.0])  # 1 px over 1000: as much as a camera is likely to be tilted
    shown, known = np.nan_to_num(design), np.nan_to_num(told)
    trust, usual = np.nan_to_num(1 / u**2), np.ones(len(u))
    for _ in range(STEPS):
        inverse = np.linalg.inv(np.einsum("fri,fr,frj->fij", shown, trust, shown) + slope)
        solved = np.einsum("fij,frj,fr->fi", inverse, shown, trust * known)
        left = np.abs(told - np.einsum("fri,fi->fr", shown, solved)) / u
        usual = np.maximum(1.4826 * np.nanmedian(left, axis=1), 1.0)
        trust = np.nan_to_num(1 / (u**2 * np.maximum(1.0, left / (2 * usual[:, None]))))
    return solved, inverse, usual


def _by_flight(of: Ints, values: Array) -> Array:
    """Return values of regions by flight, (flight, region, ...), NaN where there is none."""
    order = np.argsort(of, kind="stable")
    slot = np.argsort(order, kind="stable") - np.searchsorted(of[order], of)
    table = np.full((of.max() + 1, slot.max() + 1, *values.shape[1:]), np.nan)
    table[of, slot] = values
    return table
