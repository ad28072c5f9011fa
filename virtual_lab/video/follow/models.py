"""Fit of the flights of a clip, and the fits that show its remaining uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from virtual_lab.units import DEGREE, Mask
from virtual_lab.video.follow.flights import FLIGHTS, meetings
from virtual_lab.video.follow.joint import FLIGHT_FIT, Fit, Floor, fit_flights
from virtual_lab.video.follow.pieces import FAR_U, Piece
from virtual_lab.video.follow.scene import FOCAL, FlightScene

# deviation from level, or from square to the flight, beyond which a clip is flagged [rad]
STEEPEST = 10 * DEGREE
OFF_NORMAL = 35 * DEGREE  # largest angle between a change of velocity and the normal [rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedFlights:
    """Flights with their fit, and fits that show effects which the fit cannot show."""

    scene: FlightScene
    ways: Sequence[Piece]
    fit: Fit
    rest: Sequence[Fit]  # alternative fits, each of which differs from `fit` by one u

    @property
    def tilted(self) -> bool:
        """Whether the camera looks up or down by more than a level camera."""
        least = np.tan(STEEPEST) / FOCAL / max(self.scene.size)
        return bool(np.hypot(*self.fit.tilt) > least)

    @classmethod
    def of(cls, scene: FlightScene, ways: Sequence[Piece], drift: float = 0.0) -> FittedFlights:
        """Fit flights; `drift` is the camera's largest undetected drift per axis [px/frame]."""
        # A drift that turns back bends a flight by an eighth of its path, as slowly as a pattern.
        bends = [np.hypot(each.pattern_u, drift * np.ptp(each.t) / 8) for each in ways]
        ways = [replace(e, pattern_u=float(u)) for e, u in zip(ways, bends, strict=True)]
        fit = fit_flights(scene, ways)
        if ways[0].sharp:  # flights of a calibrated camera that stands still
            drag, u = scene.drag or (0.0, 0.0)
            rest = [fit_flights(replace(scene, drag=(drag + u, 0.0)), ways)]
        else:
            if scene.pull is None:  # a known g gives the normal more accurately than the contacts
                fit = fit_flights(scene, ways, floor=_floor(ways, fit))
            rest = [fit.with_drift(drift * axis) for axis in np.eye(2)] if drift else []
            # false positions move the fit, and the scatter does not show by how much
            off = positions_off(ways, fit)
            inner = [way.part(~mask) for way, mask in zip(ways, off, strict=True)]
            if np.any(np.concatenate(off)) and min(len(each.t) for each in inner) > 3:
                rest.append(fit_flights(scene, inner, floor=fit.floor))
        return cls(scene=scene, ways=ways, fit=fit, rest=rest)


def positions_off(ways: Sequence[Piece], fit: Fit) -> list[Mask]:
    """Return a mask of the positions that are far from the fit, (position,), for each flight.

    Three successive positions are far if all are beyond a limit, and one if it is beyond twice this
    limit. No sharp position is far, because outliers of sharp positions are left out of the fit.
    """
    masks = []
    for way, left in zip(ways, fit.residuals, strict=True):
        least = max(FAR_U * fit.spread, FLIGHTS.end_room * way.radius)
        off = np.hypot(*left.T) / (np.inf if way.sharp else least)
        masks.append(np.asarray((off > 2) | ndimage.binary_opening(off > 1, [True] * 3)))
    return masks


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
