"""Fits of flights by one model, and by alternative models that show its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from virtual_lab.units import DEGREE
from virtual_lab.video.follow.flights import meetings, readout_of
from virtual_lab.video.follow.joint import FLIGHT_FIT, Fit, Floor, fit_flights
from virtual_lab.video.follow.pieces import FAR_U, Piece
from virtual_lab.video.follow.scene import FOCAL, FlightScene

# u of a quantity that is uniformly distributed up to a difference, as a fraction of the difference
EVEN_SHARE = 1 / np.sqrt(3)
# deviation from level, or from square to the flight, beyond which a clip is flagged [rad]
STEEPEST = 10 * DEGREE
DRAG_SHARE = 0.25  # u of drag, as a fraction of the difference between fits with and without drag
OFF_NORMAL = 35 * DEGREE  # largest angle between a change of velocity and the normal [rad]

Others = Sequence[tuple[Fit, float]]  # other fits, and their u as a fraction of the difference


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedFlights:
    """Flights with their fit, and fits by other models.

    If the readout time is unknown, `longest` has fits with the longest one, for the u of speeds.
    """

    scene: FlightScene
    ways: Sequence[Piece]
    fit: Fit
    rest: Others
    tilted: bool = False  # whether the camera looks up or down by more than a level camera
    # fit for a level camera, for restitutions; None if the camera is tilted or calibrated, or if
    # contacts show the line of the floor
    level: FittedFlights | None = None
    longest: Others = ()  # fits with the longest readout

    @classmethod
    def of(cls, scene: FlightScene, ways: Sequence[Piece], drift: float = 0.0) -> FittedFlights:
        """Fit flights; `drift` is the camera's largest undetected drift per axis [px/frame]."""
        of_ways = partial(cls, scene=scene, ways=ways)
        if ways[0].sharp:  # flights of a calibrated camera that stands still
            fit = fit_flights(scene, ways)
            drag, u = scene.drag or (0.0, 0.0)
            more = fit_flights(replace(scene, drag=(drag + u, 0.0)), ways)
            return of_ways(fit=fit, rest=[(more, 1.0)])
        fit = fit_flights(scene, ways, readout=readout_of(scene, ways))
        if scene.pull is None:  # a known g gives the normal more accurately than the contacts
            fit = refit(scene, ways, fit, floor=_floor(ways, fit))
        flat = refit(scene, ways, fit, tilt=np.zeros(2))
        drifts = [drift * axis for axis in np.eye(2)] if drift else []
        rest = [(fit.with_drift(each), 1.0) for each in drifts]
        beside = [(flat.with_drift(each), 1.0) for each in drifts]
        if scene.drag is None:
            free = replace(scene, drag=(0.0, 0.0))
            rest.append((refit(free, ways, fit), DRAG_SHARE))
            beside.append((refit(free, ways, fit, tilt=np.zeros(2)), DRAG_SHARE))
        longest = []
        if scene.readout is None:
            longest = [(refit(scene, ways, fit, readout=1.0), EVEN_SHARE)]
        if np.hypot(*fit.tilt) > np.tan(STEEPEST) / FOCAL / max(scene.size):
            return of_ways(fit=fit, rest=[*rest, (flat, 1.0)], tilted=True, longest=longest)
        level = None if fit.floor else of_ways(fit=flat, rest=[*beside, (fit, 1.0)])
        return of_ways(fit=fit, rest=rest, longest=longest, level=level)


def refit(scene: FlightScene, ways: Sequence[Piece], fit: Fit, **changed: Any) -> Fit:
    """Fit the flights again with other options, and return the new fit.

    `changed` are arguments of `fit_flights`. Unless they are changed, the readout time and the
    contacts with a common floor are those of `fit`. All other arguments have their default values.
    """
    same: dict[str, Any] = {"readout": fit.readout, "floor": fit.floor}
    return fit_flights(scene, ways, **same | changed)


def _floor(ways: Sequence[Piece], fit: Fit) -> Floor:
    """Return contacts with one floor, far enough apart to show its slope with less than 0.2°."""
    contacts: list[tuple[int, float]] = []
    u = np.hypot(FLIGHT_FIT.slant_u, np.sqrt(np.trace(fit.covariance[:2, :2])) / fit.size)
    for k, t in meetings(ways, fit):
        change = fit.at(k, t)[0, 2:] - fit.at(k + 1, t)[0, 2:]
        if abs(np.angle(complex(*change) / fit.down)) > OFF_NORMAL:
            continue
        first = fit.meeting(*(contacts or [(k, t)])[0])
        line = complex(*(fit.meeting(k, t) - first)) / fit.down
        far = abs(line) > fit.spread / FLIGHT_FIT.slant_u
        if not contacts or (far and abs(line.real / line.imag) < FAR_U * u):
            contacts.append((k, t))
    return contacts if len(contacts) > 1 else ()
