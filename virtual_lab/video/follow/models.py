"""Flights fitted by a model and by others beside it, which show what the first one leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from virtual_lab.video.follow.flights import FLIGHTS, inner, readout_of
from virtual_lab.video.follow.joint import FLIGHT_FIT, Fit, fit_flights
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene

EVEN_SHARE = 1 / np.sqrt(3)  # of a difference is u, where anything up to it is as likely


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSettings:
    """When a perspective is believed, and what share of a difference is u."""

    tilt: float = 0.03  # of a perspective over the extent of the places, to be believed
    reconciled: float = 0.7  # of what flights' accelerations differ by, if that explains it
    drag_u: float = 0.35  # of the difference between fits with and without drag


MODELS = ModelSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedFlights:
    """A fit of flights, and fits by other models with the share of each difference that is u.

    A readout that nobody knows is tried at its longest for speeds, and next to the one that was
    found for restitutions.
    """

    fit: Fit
    other: Fit | None  # with a perspective or without, where that matters
    others: list[tuple[Fit, float]]
    longest: list[tuple[Fit, float]]  # readout
    near: list[tuple[Fit, float]]  # readout

    @classmethod
    def beside(
        cls,
        scene: FlightScene,
        ways: Sequence[Piece],
        fit: Fit,
        *,
        other: Fit | None = None,
        drift: float = 0.0,
        shared: bool = False,
    ) -> FittedFlights:
        """Fit flights by other models than `fit`.

        Parameters
        ----------
        other
            One of them already: with a perspective where `fit` has none, or without.
        drift
            Of the camera, each way, that the picture does not show [px/frame].
        shared
            Whether flights without drag share one g.
        """
        others = [(refit(scene, ways, fit, drag=False, shared=shared), MODELS.drag_u)]
        others += [(each, 1.0) for each in (refit(scene, inner(ways), fit), other) if each]
        others += [(fit.drifting(each), 1.0) for each in drift * np.eye(2) if drift]
        longest, near = [], []
        if scene.readout is None:
            longest = [(refit(scene, ways, fit, readout=1.0), EVEN_SHARE)]
            if fit.readout:
                next_to = fit.readout - FLIGHTS.readouts[1]
                near = [(refit(scene, ways, fit, readout=next_to), EVEN_SHARE)]
        return cls(fit=fit, other=other, others=others, longest=longest, near=near)


def fits_of(scene: FlightScene, ways: list[Piece]) -> tuple[Fit, Fit | None]:
    """Return the fit, and with or without a perspective another one where that matters."""
    readout = readout_of(scene, ways)
    tilts = (0.0, FLIGHT_FIT.tilt_u)
    flat, tilted = (fit_flights(scene, ways, readout=readout, tilt_u=each) for each in tilts)
    extent = np.ptp(np.concatenate([each.xy for each in ways]), axis=0).max()
    turned = np.hypot(*tilted.tilt) * extent > MODELS.tilt
    if tilted.cost >= FLIGHTS.tilted_misfit * flat.cost or not turned:
        return flat, None
    apart = []
    for each in tilts:
        own = fit_flights(scene, ways, readout=readout, shared=False, tilt_u=each)
        apart.append(np.ptp(np.hypot(*own.pull.T)))
    return (tilted, flat) if apart[1] < MODELS.reconciled * apart[0] else (flat, tilted)


def refit(scene: FlightScene, ways: Sequence[Piece], fit: Fit, **changed: Any) -> Fit:
    """Return a fit by the same model but for what is changed."""
    like = {"readout": fit.readout, "tilt_u": fit.tilt_u}
    return fit_flights(scene, ways, **like | changed)
