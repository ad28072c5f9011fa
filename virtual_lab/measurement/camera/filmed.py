"""Flights from a camera over the rig: straight lines in and out, with known drag and height.

With quadratic drag the transformed distance s = d exprel(±κd) is linear in time, with the slope v
at the target. Each flight is therefore fitted by a weighted straight line through the positions in
the frames, at any speed. The height of the ball, and thereby its distance from the camera, comes
from the gates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.measurement.reduction.flights import Constants, Flights
from virtual_lab.relations.flight import time_before
from virtual_lab.relations.pinhole import looking_down, undistort
from virtual_lab.units import Array, Mask

CAMERA = "impact.camera."  # beginning of the names of the camera's constants


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """Positions of the ball in free flight, arrays (shot, frame); NaN: not located reliably.

    Positions are in pixels of the whole frame, not corrected for distortion. Times are by the
    camera clock [s].
    """

    times: Array
    x: Array
    y: Array
    u: Array  # standard uncertainty of x, and of y, from noise, independent in every frame [px]
    pattern_u: Array  # the same, caused by the ball's pattern, similar in neighboring frames [px]
    out: Mask  # whether the ball flies out


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraResults:
    """Camera results of each shot, (..., shot); NaN: not seen."""

    flights: Flights  # flights by the camera, with the heights from the gates
    place: Array  # impact position, from the barrel tip [m]
    angle_in: Array  # angle of the incoming flight to the line of fire, toward the tip [rad]
    met: Array  # time of contact after the first used frame, by the camera's clock [s]


def reduce_film(x: Constants, sightings: Sightings, drag: Array, timed: Flights) -> CameraResults:
    """Return the ball's flights, impact position and angle from the camera's pictures, (shot,).

    The values are NaN for a shot in which the camera did not see the ball.

    Parameters
    ----------
    x
        Calibration constants keyed by name: numbers, or columns (k, 1) for k sets of constants.
        With columns, the results have the shape (k, shot).
    sightings
        Positions of the ball, (shot, frame).
    drag
        Drag rate κ of each ball, (..., shot) [1/m].
    timed
        Flights measured by the gates. The height of the ball in each frame is computed from their
        heights, slopes and speeds.
    """
    # The height changes slowly along the flight, so the distance of the ball from the target is
    # computed with the first set of constants only.
    used = {name for name in x if name.startswith(CAMERA)} | {"ball.radius"}
    first = {name: np.ravel(x[name])[:1, None] for name in used}
    level = np.asarray(timed.offset).reshape(-1, len(sightings.times))[:1, :, None]
    ahead = -_places(first, sightings, level)[0][0]
    slope = np.where(sightings.out, timed.slope_out[..., None], timed.slope_in[..., None])
    speed = np.where(sightings.out, timed.speed_out[..., None], timed.speed_in[..., None])
    fallen = x["hall.gravity"][..., None] / 2 * (ahead / speed) ** 2
    height = np.asarray(timed.offset)[..., None] + slope * ahead - fallen
    beyond, along = _places(x, sightings, height)
    ahead = -beyond
    kappa = np.asarray(drag)[..., None]
    way = time_before(ahead, 1.0, np.where(sightings.out, -kappa, kappa))
    clock = x[f"{CAMERA}clock"]
    speed_in, met = _line(sightings, ~sightings.out, way)
    speed_out, _ = _line(sightings, sightings.out, way)
    drift, aside = _line(sightings, ~sightings.out, along, at=met)
    return CameraResults(
        flights=replace(timed, speed_in=-speed_in * clock, speed_out=speed_out * clock),
        place=x[f"{CAMERA}over"] - aside,
        angle_in=np.arctan2(drift, -speed_in),
        met=met,
    )


def frames_u(x: Constants, sightings: Sightings, results: CameraResults) -> dict[str, Array]:
    """Return the u of the camera's results caused by errors in single frames, (shot,).

    The keys are ``speed_in`` and ``speed_out`` [m/s], ``efficiency`` (e_A), ``place`` [m] and
    ``angle`` [rad]. Noise is independent in every frame. The seam pattern causes similar errors in
    neighboring frames. Their correlation depends on the unknown spin, so the least favorable spin
    is assumed.
    """
    flights = results.flights
    scale = (x[f"{CAMERA}place_z"] - x[f"{CAMERA}plane"]) / x[f"{CAMERA}focal"]
    slope_in, middle, moment = _line_weights(sightings, ~sightings.out)
    slope_out, _, _ = _line_weights(sightings, sightings.out)
    at_contact = middle + slope_in * (results.met - moment)[:, None]
    u_in, u_out, at = (
        float(scale) * _u(sightings, part) for part in (slope_in, slope_out, at_contact)
    )
    ratio = np.hypot(u_in / flights.speed_in, u_out / flights.speed_out)
    return {
        "speed_in": u_in,
        "speed_out": u_out,
        "efficiency": ratio * flights.speed_out / flights.speed_in,
        "place": at,
        "angle": u_in / flights.speed_in,
    }


def _u(sightings: Sightings, parts: Array) -> Array:
    """Return the standard uncertainty of a weighted sum of the positions in the frames, (shot,).

    The weights are `parts`, (shot, frame). The result is in pixels if the weights have no unit.
    """
    used = parts != 0
    noise = np.sum(np.where(used, parts * sightings.u, 0.0) ** 2, axis=1)
    shifted = np.where(used, parts * sightings.pattern_u, 0.0)
    if not np.any(shifted):
        return np.asarray(np.sqrt(noise))
    times = _from_first(sightings)
    apart = times[:, :, None] - times[:, None, :]
    span = np.ptp(np.where(used, times, times.mean(axis=1)[:, None]), axis=1)
    worst = np.zeros(len(times))
    # correlation time of the pattern [share of the flight's duration]
    for lag in np.geomspace(0.02, 3.0, 16):
        like = np.exp(-0.5 * (apart / (lag * span[:, None, None])) ** 2)
        worst = np.fmax(worst, np.einsum("si,sij,sj->s", shifted, like, shifted))
    return np.asarray(np.sqrt(noise + worst))


def _places(x: Constants, sightings: Sightings, height: Array) -> tuple[Array, Array]:
    """Return X and Y of the ball's center in the rig's axes, (..., shot, frame) [m]."""

    def of(names: str) -> list[Array]:
        return [np.asarray(x[f"{CAMERA}{name}"])[..., None] for name in names.split()]

    # Many sets of constants share a lens, so each lens is computed once.
    columns = np.broadcast_arrays(*of("focal centre_x centre_y k1 k2 p1 p2 k3"))
    lenses, which = np.unique(np.reshape(columns, (8, -1)), axis=1, return_inverse=True)
    focal, centre_x, centre_y, *bend = lenses[..., None, None]
    flat = np.stack([(sightings.x - centre_x) / focal, (sightings.y - centre_y) / focal], axis=-1)
    u, v = np.moveaxis(undistort(flat, bend), -1, 0)
    # factor of the shift of a disk's middle from its center by lens distortion
    bent = 1 + 3 * bend[0] + 9 * bend[1] * (u**2 + v**2)
    u, v, bent = (each[which if columns[0].ndim > 1 else 0] for each in (u, v, bent))
    place_x, place_y, place_z, plane = of("place_x place_y place_z plane")
    below = place_z - plane - height
    # The image of a sphere is farther from the axis than its center's image, by 1 / (1 - R²/Z²).
    shrink = 1 - (np.asarray(x["ball.radius"])[..., None] / below) ** 2 * bent
    turn = looking_down(np.concatenate(of("tilt_x tilt_y tilt_z"), axis=-1))
    axes = np.moveaxis(turn[..., None, :, :], (-1, -2), (0, 1))
    right, up, away = (shrink * (u * a + v * b) + c for a, b, c in axes)
    return place_x - below / away * right, place_y - below / away * up


def _from_first(sightings: Sightings) -> Array:
    """Return the times after the first used frame, (shot, frame); 0 for frames not used."""
    times = np.where(np.isfinite(sightings.x), sightings.times, np.nan)
    first = np.nanmin(times, axis=1, initial=np.inf)[:, None]
    return np.asarray(np.nan_to_num(times - np.where(np.isfinite(first), first, 0.0)))


def _line_weights(sightings: Sightings, way: Mask) -> tuple[Array, Array, Array]:
    """Return the weights of the frames in the slope and in the mean of a line, and the mean time.

    The shapes are (shot, frame), (shot, frame) and (shot,). NaN: no frame.
    """
    weights = np.where(way & np.isfinite(sightings.x), 1 / sightings.u**2, 0.0)
    times = _from_first(sightings)
    total = weights.sum(axis=1)[:, None]
    middle = weights / np.where(total > 0, total, np.nan)
    moment = np.sum(middle * times, axis=1)
    off = times - moment[:, None]
    return weights * off / np.sum(weights * off**2, axis=1)[:, None], middle, moment


def _line(
    sightings: Sightings, way: Mask, values: Array, at: Array | None = None
) -> tuple[Array, Array]:
    """Return the slope of a weighted line, and its value at the time `at`.

    Without `at`, the second result is the time at which the line is 0.
    """
    slopes, middles, moment = _line_weights(sightings, way)
    used = np.where(middles > 0, values, 0.0)
    slope, middle = np.sum(slopes * used, axis=-1), np.sum(middles * used, axis=-1)
    if at is None:
        return slope, moment - middle / slope
    return slope, middle + slope * (at - moment)
