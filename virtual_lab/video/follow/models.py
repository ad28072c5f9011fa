"""Flights fitted by a model, and by others beside it that show what the first one leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from virtual_lab.video.follow.flights import FLIGHTS, readout_of
from virtual_lab.video.follow.joint import FLIGHT_FIT, Fit, fit_flights
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene

EVEN_SHARE = 1 / np.sqrt(3)  # of a difference is u, where anything up to it is as likely
STEEPEST = 2.0  # FLIGHT_FIT.level_u: a perspective that is larger is no level camera's
DRAG_SHARE = 0.35  # of the difference between fits with and without drag

Others = Sequence[tuple[Fit, float]]  # fits, with the share of the difference to each that is u


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedFlights:
    """A fit of flights, and fits by other models.

    A readout that nobody knows is tried at its longest for speeds, and next to the one that was
    found for restitutions.
    """

    fit: Fit
    rest: Others
    tilted: bool = False  # the camera looks up or down by more than a level one does
    dragless: Others = ()  # with one g
    parabolas: Others = ()  # each flight with its own
    longest: Others = ()  # readout
    near: Others = ()  # readout

    @classmethod
    def of(cls, scene: FlightScene, ways: Sequence[Piece], drift: float = 0.0) -> FittedFlights:
        """Fit flights; `drift`: of the camera, each way, that the picture hides [px/frame]."""
        if ways[0].u is not None:  # of a calibrated camera, that stands
            fit = fit_flights(scene, ways)
            drag, u = scene.drag or (0.0, 0.0)
            more = fit_flights(replace(scene, drag=(drag + u, 0.0)), ways)
            return cls(fit=fit, rest=[(more, 1.0)])
        fit = fit_flights(scene, ways, readout=readout_of(scene, ways))
        longest, near = [], []
        if scene.readout is None:
            longest = [(refit(scene, ways, fit, readout=1.0), EVEN_SHARE)]
            if fit.readout:
                next_to = fit.readout - FLIGHTS.readouts[0]
                near = [(refit(scene, ways, fit, readout=next_to), EVEN_SHARE)]
        tilt = float(np.hypot(*fit.tilt)) * max(scene.size)
        tilted = tilt > STEEPEST * FLIGHT_FIT.level_u
        return cls(
            fit=fit,
            tilted=tilted,
            rest=[
                *([(refit(scene, ways, fit, tilt_u=0.0), 1.0)] if tilted else []),
                *((fit.with_drift(each), 1.0) for each in drift * np.eye(2) if drift),
            ],
            dragless=[(refit(scene, ways, fit, drag=False), DRAG_SHARE)],
            parabolas=[(refit(scene, ways, fit, drag=False, shared=False), DRAG_SHARE)],
            longest=longest,
            near=near,
        )


def refit(scene: FlightScene, ways: Sequence[Piece], fit: Fit, **changed: Any) -> Fit:
    """Fit by the same model but for what is changed."""
    return fit_flights(scene, ways, **{"readout": fit.readout} | changed)
