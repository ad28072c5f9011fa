"""Contacts: when two flights meet, what was struck, and its restitution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE, Array
from virtual_lab.video.follow.flights import FLIGHTS, meetings
from virtual_lab.video.follow.joint import Fit, estimate_of
from virtual_lab.video.follow.pieces import Piece
from virtual_lab.video.follow.scene import FlightScene

Note = tuple[str, str]  # a flag in capitals, "" where none need be raised, and a sentence


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactSettings:
    """What is a contact, with what, and when its restitution is stated."""

    least_change: float = 0.2  # of the speed: a smaller change is no contact
    off_normal: float = 35 * DEGREE  # that a change of velocity may be, to be along it
    slant_u: float = 0.5 * DEGREE  # of a floor or a wall off g, and of g as the camera sees it
    turned_back: float = 0.2  # of the speed into it, along a floor or wall: it was struck twice
    least_u: float = 0.001  # of a restitution: no clip shows more
    vague_u: float = 0.25  # of a restitution that says nothing
    coverage: float = 2.0  # u: what lies beyond is no chance


CONTACTS = ContactSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """Between two flights."""

    before: int  # number of the flight
    after: int
    t: float  # [steps]
    frame: float  # between stored frames
    time: Estimate  # [s]
    kind: str  # floor | wall | struck
    restitution: Estimate | None
    place: Array  # (2,) still frame [pixels]
    metres: Array  # the same [m]
    metres_u: float


def contacts_of(
    scene: FlightScene,
    ways: list[Piece],
    fit: Fit,
    others: Sequence[tuple[Fit, float]],
    step: float,
    unit: float,
) -> tuple[list[Contact], list[Note]]:
    """Return the contacts, and what speaks against them.

    Parameters
    ----------
    fit
        Of flights that share g and drag.
    others
        By other models (parabolas, each on its own; with a perspective or without), and what share
        of a difference is u.
    step
        Seconds of a step of time.
    unit
        Metres of a pixel.
    """
    notes: list[Note] = []
    found = []
    for k, t in meetings(ways, fit):
        one, other = ways[k], ways[k + 1]
        into, out = fit.at(k, t)[0, 2:], fit.at(k + 1, t)[0, 2:]
        if np.hypot(*(out - into)) < CONTACTS.least_change * np.hypot(*into):
            continue
        normal, kind = _normal(fit.pull[0], out - into, ways)
        frame, place = _frame(scene, one, other, t), fit.pictured(k, t) + fit.pictured(k + 1, t)
        late = fit.readout * float(np.median(scene.late(one.blobs[-2:])))
        time = estimate_of(lambda f: _closest(f, k, t)[0], fit, unit=step)  # noqa: B023
        ratio = None
        if min(len(one.t), len(other.t)) >= FLIGHTS.side_places and kind != "other":
            ratio, flag, why = _restitution(fit, others, k, t, normal, kind)
            if flag:
                notes.append((flag, f"contact at frame {frame:.1f}: {why}"))
        found.append(
            Contact(
                before=k,
                after=k + 1,
                t=t - late,
                frame=frame - late,
                time=replace(time, value=step * (t - late)),
                kind="struck" if kind == "other" else kind,
                restitution=ratio,
                place=place[0] / 2,
                metres=unit * place[0] / 2,
                metres_u=unit * fit.spread,
            )
        )
    return found, notes


def _frame(scene: FlightScene, one: Piece, other: Piece, t: float) -> float:
    """Return the frame of a time between two flights, between stored ones; repeats do not count."""
    between = np.arange(one.frames[-1], other.frames[0] + 1)
    between = between[np.isfinite(scene.time[between])]
    times = scene.time[between] + one.t[-1] - scene.time[one.frames[-1]]
    times[-1] = other.t[0]
    return float(np.interp(t, times, between))


def _normal(pull: Array, change: Array, ways: list[Piece]) -> tuple[Array | None, str]:
    """Return the normal of what was struck, None where speeds are all there is, and its kind."""
    along, size = change / np.hypot(*change), float(np.hypot(*pull))
    longest = max(float(np.ptp(each.t)) for each in ways)
    if size * longest**2 / 8 < FLIGHTS.sag * ways[0].radius:
        return None, "struck"
    up = -pull / size
    side = np.array([-up[1], up[0]])
    for normal, kind in ((up, "floor"), (side, "wall"), (-side, "wall")):
        if along @ normal > np.cos(CONTACTS.off_normal):
            return normal, kind
    return None, "other"


def _closest(fit: Fit, first: int, t: float) -> tuple[float, Array, Array]:
    """Return when two flights are nearest to each other, near a time, and their velocities."""
    before, after = fit.at(first, t)[0], fit.at(first + 1, t)[0]
    apart, change = (after - before)[:2], (after - before)[2:]
    late = float(np.clip(-(apart @ change) / max(float(change @ change), 1e-12), -1, 1))
    return (
        t + late,
        before[2:] + late * fit.pull[first],
        after[2:] + late * fit.pull[first + 1],
    )


def _restitution(
    fit: Fit,
    others: Sequence[tuple[Fit, float]],
    first: int,
    t: float,
    normal: Array | None,
    kind: str,
) -> tuple[Estimate | None, str, str]:
    """Return the restitution, or None with a flag and why."""

    def ratio_of(some: Fit) -> float:
        _, before, after = _closest(some, first, t)
        if normal is None:
            return float(np.hypot(*after) / np.hypot(*before))
        return float(-(after @ normal) / (before @ normal))

    ratio = estimate_of(ratio_of, fit, others, relative_u=CONTACTS.least_u)
    if normal is not None:  # a floor is level, a wall upright, but for so much
        _, before, after = _closest(fit, first, t)
        side = np.array([-normal[1], normal[0]])
        along = np.array([before @ side, after @ side]) / abs(before @ normal)
        if along.prod() < 0 and np.abs(along).min() > CONTACTS.turned_back:
            why = f"the ball turns back along the {kind}, too: it met two; no restitution is given"
            return None, "CONTACT_UNCLEAR", why
        slope = float((after + ratio.value * before) @ side / (before @ normal))
        ratio = replace(ratio, u=float(np.hypot(ratio.u, CONTACTS.slant_u * slope)))
    if why := excessive(ratio):
        return None, "ABOVE_ONE", why
    if ratio.value <= 0:
        return None, "CONTACT_UNCLEAR", f"the ball goes on through the {kind}; none is given"
    if ratio.u > CONTACTS.vague_u:
        return None, "CONTACT_UNCLEAR", "the flights say too little of it; no restitution is given"
    return ratio, "", ""


def excessive(ratio: Estimate) -> str:
    """Return what speaks against a ratio of speeds as a restitution, "" where nothing does."""
    if ratio.value - CONTACTS.coverage * ratio.u <= 1:
        return ""
    return (
        f"the speeds have the ratio {ratio.value:.3g}, and nothing at rest gives back more than it "
        "takes: it moved, or something else was followed; no restitution is given"
    )
