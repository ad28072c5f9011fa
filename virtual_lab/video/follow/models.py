"""Flights fitted by a model, and by alternative models that show the uncertainty of the first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from virtual_lab.units import DEGREE
from virtual_lab.video.follow.flights import readout_of
from virtual_lab.video.follow.joint import FLIGHT_FIT, Fit, fit_flights
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene

# share of a difference that is u, if all values up to it are equally likely
EVEN_SHARE = 1 / np.sqrt(3)
# angle off level, or off square to the flight, beyond which a clip is flagged [rad]
STEEPEST = 10 * DEGREE
DRAG_SHARE = 0.35  # share of the difference between fits with and without drag that is u

Others = Sequence[tuple[Fit, float]]  # fits, with the share of the difference to each that is u


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedFlights:
    """A fit of flights, and fits by other models.

    If the readout is unknown, the longest one is tried for the speeds.
    """

    fit: Fit
    rest: Others
    tilted: bool = False  # the camera looks up or down by more than a level one does
    # the same fits for a level camera, for restitutions; None: the camera is tilted, or calibrated
    level: FittedFlights | None = None
    dragless: Others = ()  # fits without drag, with one g for all flights
    parabolas: Others = ()  # fits without drag, with one g per flight
    longest: Others = ()  # fits with the longest readout

    @classmethod
    def of(cls, scene: FlightScene, ways: Sequence[Piece], drift: float = 0.0) -> FittedFlights:
        """Fit flights; `drift`: of the camera, each way, that the picture hides [px/frame]."""
        if ways[0].u is not None:  # flights of a calibrated camera that stands still
            fit = fit_flights(scene, ways)
            drag, u = scene.drag or (0.0, 0.0)
            more = fit_flights(replace(scene, drag=(drag + u, 0.0)), ways)
            return cls(fit=fit, rest=[(more, 1.0)])
        fit = fit_flights(scene, ways, readout=readout_of(scene, ways))
        tilt = float(np.hypot(*fit.tilt)) * max(scene.size) * FLIGHT_FIT.focal
        flat = refit(scene, ways, fit, tilted=False)
        if tilt > np.tan(STEEPEST):
            found = cls._beside(scene, ways, fit, drift)
            return replace(found, tilted=True, rest=[*found.rest, (flat, 1.0)])
        level = cls._beside(replace(scene, level_u=0.0), ways, flat, drift)
        level = replace(level, rest=[*level.rest, (fit, 1.0)])
        return replace(cls._beside(scene, ways, fit, drift), level=level)

    @classmethod
    def _beside(
        cls, scene: FlightScene, ways: Sequence[Piece], fit: Fit, drift: float
    ) -> FittedFlights:
        """Fit of a scene with the fits by alternative models."""
        longest = []
        if scene.readout is None:
            longest = [(refit(scene, ways, fit, readout=1.0), EVEN_SHARE)]
        dragless, parabolas = [], []
        if scene.drag is None:
            dragless = [(refit(scene, ways, fit, drag=False), DRAG_SHARE)]
            parabolas = [(refit(scene, ways, fit, drag=False, shared=False), DRAG_SHARE)]
        return cls(
            fit=fit,
            rest=[(fit.with_drift(each), 1.0) for each in drift * np.eye(2) if drift],
            dragless=dragless,
            parabolas=parabolas,
            longest=longest,
        )


def refit(scene: FlightScene, ways: Sequence[Piece], fit: Fit, **changed: Any) -> Fit:
    """Fit by the same model but for what is changed."""
    return fit_flights(scene, ways, **{"readout": fit.readout} | changed)
