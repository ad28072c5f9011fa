"""Contacts between flights: time, kind of the struck object, and restitution."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array
from virtual_lab.video.follow.flights import bend_of, meetings
from virtual_lab.video.follow.joint import FLIGHT_FIT, Fit, estimate_of
from virtual_lab.video.follow.knowledge import Note
from virtual_lab.video.follow.models import OFF_NORMAL, FittedFlights
from virtual_lab.video.follow.pieces import GROWTH, Piece
from virtual_lab.video.follow.ruler import VAGUE, Ruler
from virtual_lab.video.follow.scene import FlightScene
from virtual_lab.video.follow.sharpening import SharpBall

# smallest speed along a floor or wall, before and after, at which a reversal means that the ball
# struck two objects [share of the speed into the floor or wall]
TURNED_BACK = 0.2
COVERAGE = 2.0  # coverage factor beyond which a difference is significant [u]


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """A contact between two flights."""

    before: int  # number of the flight before it
    t: float  # [steps]
    frame: float  # frame number, with a fraction between stored frames
    time: Estimate  # [s]
    kind: str  # floor | wall | struck
    restitution: Estimate | None
    place: Array  # (2,) still frame [pixels]
    metres: Array  # (2,) `place` in meters
    metres_u: float


def contacts_of(
    model: FittedFlights, step: float, scale: Ruler, sharp: SharpBall | None
) -> tuple[list[Contact], list[Note]]:
    """Return the contacts between consecutive flights, and notes on doubtful contacts.

    A contact is between the end of one flight and the beginning of the next flight. Two flights
    have no contact in two cases:

    * Their paths pass each other at a distance.
    * Their fitted paths, extended in time, meet before the first flight ends, or after the second
      flight begins.

    There is a note on each pair of consecutive flights without a contact: the contact was hidden,
    an object touched the ball, or one flight was taken for two.

    The restitution of a contact is None in these cases:

    * One of the flights is too short.
    * The struck surface is neither level nor upright, and g was not stated.
    * There is another reason. A note then states it.

    Parameters
    ----------
    model
        Flights in the order of time, their fit, and alternative fits for the u.
    step
        Duration of a time step [s].
    scale
        Scale of the positions in meters.
    sharp
        The ball located by its outlines; None if only positions of blobs are known.
    """
    notes: list[Note] = []
    contacts = []
    scene, ways, fit, others = model.scene, model.ways, model.fit, model.rest
    for k, near in meetings(ways, fit):
        t, into, out = _closest(fit, k, near)
        one, other = ways[k], ways[k + 1]
        late = fit.readout * float(np.median(scene.late(one.blobs[-2:])))
        time = estimate_of(lambda f: _closest(f, k, t)[0], fit, others, unit=step)  # noqa: B023
        # The contact must be between the last position of the incoming flight and the first
        # position of the outgoing flight.
        room = COVERAGE * time.u / step + (scene.exposure or 1.0) / 2
        if not one.t[-1] + late - room <= t <= other.t[0] + late + room:
            continue
        normal, kind = _normal(model, out - into)
        frame, ratio = _frame(scene, one, other, t - late), None
        long_enough = min(len(one.t), len(other.t)) >= (3 if sharp else GROWTH.least_places)
        if long_enough and kind != "other":
            ratio, flag, why = _restitution(model, k, t, normal, kind, sharp is not None)
            if flag:
                words = f"contact at frame {frame:.1f}: {why}; no restitution is stated"
                notes.append((flag, words))
        place = (fit.in_picture(k, t) + fit.in_picture(k + 1, t))[0] / 2
        metres = scale.metres_per_pixel * place
        if sharp:  # the fit is in the plane of the ball
            place, metres = sharp.in_picture(place, frame), metres * [1, sharp.plane.sense]
        else:  # in the still frame, where a camera that turns does not see the same position
            last = scene.blobs[one.blobs[-1]]
            place = place - one.xy[-1] + np.array([last["x"], last["y"]])
        ends = [estimate_of(partial(_place, axis, k, t), fit, others).u for axis in (0, 1)]
        place_u = scale.metres_per_pixel * float(np.sqrt(np.mean(np.square(ends))))
        contacts.append(
            Contact(
                before=k,
                t=t - late,
                frame=frame,
                time=replace(time, value=step * (t - late)),
                kind="struck" if kind == "other" else kind,
                restitution=ratio,
                place=np.asarray(place),
                metres=np.asarray(metres),
                metres_u=float(np.hypot(place_u, scale.relative_u * np.hypot(*metres))),
            )
        )
    met = {each.before for each in contacts}
    for k in set(range(len(ways) - 1)) - met:
        end, start = 1e3 * step * ways[k].t[-1], 1e3 * step * ways[k + 1].t[0]
        words = f"flights {k + 1} and {k + 2} do not meet between {end:.4g} and {start:.4g} ms,"
        why = "where one ends and the other begins, so no contact is stated"
        notes.append(("CONTACT_OUTSIDE", f"{words} {why}"))
    return contacts, notes


def _place(axis: int, first: int, t: float, fit: Fit) -> Array:
    """Return the coordinate, along an axis, of the nearest approach of two flights [pixels]."""
    return np.asarray(fit.meeting(first, t)[..., axis])


def _frame(scene: FlightScene, one: Piece, other: Piece, t: float) -> float:
    """Return the fractional frame number of a time between two flights, not counting repeats."""
    between = np.arange(one.frames[-1], other.frames[0] + 1)
    between = between[np.isfinite(scene.time[between])]
    times = scene.time[between] + one.t[-1] - scene.time[one.frames[-1]]
    times[-1] = other.t[0]
    return float(np.interp(t, times, between))


def _normal(model: FittedFlights, change: Array) -> tuple[Array | None, str]:
    """Return the normal (2,) and the kind of the struck object.

    Without a normal (None) only speeds can be compared.
    """
    along, fit, pull = change / np.hypot(*change), model.fit, model.scene.pull
    # flights that bend by less than a radius do not show the direction of g
    if not fit.down or (pull is None and bend_of(model.ways, fit.size) < 1.0):
        return None, "struck"
    up = -np.array([fit.down.real, fit.down.imag])
    side = np.array([-up[1], up[0]])
    for normal, kind in ((up, "floor"), (side, "wall"), (-side, "wall")):
        if along @ normal > np.cos(OFF_NORMAL):
            return normal, kind
    # If g is known, only the ratio of speeds is computed for a hit in any other direction.
    return None, "other" if pull is None else "struck"


def _closest(fit: Fit, first: int, t: float) -> tuple[Any, Array, Array]:
    """Return the time near `t` at which two flights are closest, and both velocities then."""
    before, after = (fit.at(k, t)[..., 0, :] for k in (first, first + 1))
    apart, change = np.split(after - before, 2, axis=-1)
    late = -(apart * change).sum(axis=-1) / np.maximum((change**2).sum(axis=-1), 1e-12)
    late = np.clip(late, -1.0, 1.0)  # [frames]
    moved = late[..., None, None] * fit.pull[..., first : first + 2, :]
    return t + late, before[..., 2:] + moved[..., 0, :], after[..., 2:] + moved[..., 1, :]


def _restitution(
    model: FittedFlights, first: int, t: float, normal: Array | None, kind: str, sharp: bool
) -> tuple[Estimate | None, str, str]:
    """Return the restitution, a flag and a reason; the last two are set if it is None."""
    fit = model.fit

    def ratio_of(some: Fit) -> Any:
        before, after = (each @ [1, 1j] for each in _closest(some, first, t)[1:])
        if normal is None:
            return np.abs(after) / np.abs(before)
        turned = (some.pull != fit.pull).any(axis=(-2, -1))  # a hidden drift turns no normal
        across = np.conj(complex(*normal) * np.where(turned, some.down / fit.down, 1.0))
        return -(after * across).real / (before * across).real

    ratio = estimate_of(ratio_of, fit, model.rest)
    if normal is not None:  # a floor is level, and a wall upright, within `slant_u`
        _, before, after = _closest(fit, first, t)
        side = np.array([-normal[1], normal[0]])
        along = np.array([before @ side, after @ side]) / abs(before @ normal)
        if along.prod() < 0 and np.abs(along).min() > TURNED_BACK:
            why = f"the ball also reverses along the {kind}, so it struck two surfaces"
            return None, "CONTACT_UNCLEAR", why
        slope = float((after + ratio.value * before) @ side / (before @ normal))
        if not sharp and not (kind == "floor" and fit.floor):
            ratio = replace(ratio, u=float(np.hypot(ratio.u, FLIGHT_FIT.slant_u * slope)))
    if ratio.value - COVERAGE * ratio.u > 1:
        why = "which needs a moving object, a clip that runs backward, or two different balls"
        return None, "ABOVE_ONE", f"the ratio of the speeds is {ratio.value:.3g}, {why}"
    if ratio.value <= 0:
        return None, "CONTACT_UNCLEAR", f"the ball passes through the {kind}"
    if ratio.u > VAGUE:
        return None, "CONTACT_UNCLEAR", "the flights are too uncertain"
    return ratio, "", ""
