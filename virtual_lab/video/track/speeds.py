"""What sharp places say of a hit: speeds at the contact, angles, restitution, each with its u."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE
from virtual_lab.video.calibration.plane import RIM
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.follow.contacts import CONTACTS, Contact, Note, excessive
from virtual_lab.video.follow.following import FollowedClip
from virtual_lab.video.track.legs import StraightFlight
from virtual_lab.video.track.tracking import Tracked


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedSettings:
    """What speaks against the speeds of a hit."""

    off_upward: float = 30 * DEGREE  # that a change of velocity may be, to be a floor's
    crooked_u: float = 3.0  # of a place, noise and pattern together, that residuals scatter by
    least_frames: int = 5  # of a flight: fewer show little of their own scatter
    trend_frames: int = 8  # fewer show no trend of the radius
    trend: float = 0.004  # of the radius through a flight: less is no matter
    trend_u: float = 6.0  # standard uncertainties of it


SPEEDS = SpeedSettings()


def with_speeds(
    found: FollowedClip, tracked: Tracked, calibration: ClipCalibration
) -> FollowedClip:
    """Return what was followed with the speeds, contact and scale of its sharp places.

    The restitution is that of something at rest: the ratio of the speeds out and in; off a floor
    (gravity is known, and the velocity changes upward) of their parts along the vertical.
    """
    legs, plane = tracked.legs, tracked.plane
    clock_u = calibration.frames_per_second_u / (calibration.frames_per_second or 1.0)
    shared = float(np.hypot(plane.relative_u, clock_u))
    flights, off = [], []
    for used, flight, followed in zip(legs.used, legs.flights, found.flights, strict=False):
        off.append(nearing(tracked, used, flight))
        u = (flight.speed_u, flight.speed * shared, off[-1])
        speed = Estimate(value=flight.speed, u=float(np.linalg.norm(u)))
        angle = Estimate(
            value=float(np.arctan2(-plane.sense * flight.velocity[1], flight.velocity[0])),
            u=float(np.sqrt(flight.covariance[1, 1])) / flight.speed,
        )
        frames = tracked.frames[used]
        flights.append(
            replace(
                followed,
                first_frame=int(frames[0]),
                last_frame=int(frames[-1]),
                places=len(frames),
                speed_in=speed,
                speed_out=speed,
                angle_in=angle,
                angle_out=angle,
            )
        )
    contacts, notes = _contact(tracked, calibration, off)
    kept = [each for each in found.notes if each[0] not in {"ABOVE_ONE", "CONTACT_UNCLEAR"}]
    return replace(
        found,
        flights=flights,
        contacts=contacts,
        scale=plane,
        checks=(),
        drag_per_m=calibration.drag_per_m,
        notes=(*kept, *_against(tracked, calibration, off), *notes),
    )


def _contact(
    tracked: Tracked, calibration: ClipCalibration, off: list[float]
) -> tuple[list[Contact], list[Note]]:
    """Return the contact that two flights meet at, and what speaks against it."""
    legs, times = tracked.legs, tracked.times
    if len(legs.flights) < 2:
        return [], []
    before, after = legs.flights
    change = float(np.hypot(*(after.velocity - before.velocity)))
    both = float(np.sqrt(before.covariance[0, 0] + after.covariance[0, 0]))
    time = Estimate(value=before.time, u=both / change)
    # it lies between the last frame of the flight in and the first of the flight out
    first, last = times[legs.used[0]].max(), times[legs.used[1]].min()
    room = CONTACTS.coverage * time.u + tracked.exposure / 2
    if not first - room <= time.value <= last + room:
        words = (
            f"the flights are nearest to each other at {1e3 * time.value:.4g} ms, not between "
            f"{1e3 * first:.4g} and {1e3 * last:.4g} ms where one ends and the other begins: they "
            "are not those of one contact; no contact and no restitution are given"
        )
        return [], [("CONTACT_OUTSIDE", words)]
    restitution, kind = _restitution(before, after, calibration, off)
    why = excessive(restitution)
    place = (before.place + after.place) / 2
    start, step = float(tracked.clip.times[0]), float(np.median(np.diff(tracked.clip.times)))
    contact = Contact(
        before=0,
        after=1,
        t=(time.value - start) / step,
        frame=float(np.interp(time.value, times, tracked.frames)),
        time=time,
        kind=kind,
        restitution=None if why else restitution,
        place=tracked.pixels(place, time.value),
        metres=place,
        metres_u=float(np.hypot(both / 2, tracked.plane.relative_u * np.hypot(*place))),
    )
    return [contact], [("ABOVE_ONE", why)] if why else []


def _restitution(
    before: StraightFlight, after: StraightFlight, calibration: ClipCalibration, off: list[float]
) -> tuple[Estimate, str]:
    """Return the restitution and the kind of contact."""
    into, out, kind = before.speed, after.speed, "struck"
    down = np.array(calibration.gravity_mps2)
    down = down / (np.hypot(*down) or 1.0)
    change = after.velocity - before.velocity
    if -change @ down > np.cos(SPEEDS.off_upward) * np.hypot(*change):
        into, out = abs(float(before.velocity @ down)), abs(float(after.velocity @ down))
        kind = "floor"
    own = [np.sqrt(f.covariance[1, 1]) / v for f, v in ((before, into), (after, out))]
    own += [each / f.speed for f, each in ((before, off[0]), (after, off[1]))]
    relative = np.linalg.norm([*own, before.drag_u + after.drag_u])  # one drag takes from both
    return Estimate(value=out / into, u=float(out / into * relative)), kind


def _against(tracked: Tracked, calibration: ClipCalibration, off: list[float]) -> list[Note]:
    """Return what speaks against the flights."""
    legs, notes = tracked.legs, []
    if len(legs.flights) < 2:
        words = "the ball does not change its velocity: only one flight was found"
        notes.append(("NO_REBOUND", words))
    if tracked.stepped:
        words = (
            f"the ball steps ahead before frame {tracked.stepped[0]} by more than its time stamps "
            "say: a wrong one, or something else that was followed"
        )
        notes.append(("STEP", words))
    located, scale = tracked.located, tracked.plane.metres_per_pixel
    pattern = 0.0 if located.pattern_u is None else np.nanmedian(located.pattern_u)
    noise = scale * np.hypot(np.nanmedian(located.x_u), pattern)
    for name, flight, away in zip(("in", "out"), legs.flights, off, strict=False):
        if float(np.sqrt(np.mean(flight.residuals**2))) > SPEEDS.crooked_u * noise:
            words = (
                f"the flight {name} is no straight line: give gravity_mps2 or drag_per_m, or the "
                "ball was touched"
            )
            notes.append(("CROOKED", words))
        if (count := len(flight.residuals)) < SPEEDS.least_frames:
            notes.append(("FEW_FRAMES", f"only {count} frames show the flight {name}"))
        if away:
            words = (
                f"the ball changes its size in the flight {name}: it leaves the plane, which makes "
                f"its speed read {away:+.2g} m/s off"
            )
            notes.append(("OFF_PLANE", words))
    if calibration.exposure_s is None:
        words = f"exposure_s is not given: {tracked.exposure:.3g} s was read off the blur"
        notes.append(("", words))
    return notes


def nearing(tracked: Tracked, used: NDArray[np.bool_], flight: StraightFlight) -> float:
    """Return what a ball that comes nearer adds to its speed [m/s], 0 where none is seen to.

    `used`: frames of the flight, (frame,).
    """
    located = tracked.located
    good = used & np.isfinite(located.radius) & (located.flags == 0)
    if good.sum() < SPEEDS.trend_frames:
        return 0.0
    t = tracked.times[good] - tracked.times[good].mean()
    size = np.log(located.radius[good] / tracked.plane.sizes[good])
    rate = float(t @ size / (t @ t))
    rest = size - size.mean() - rate * t
    u = float(np.sqrt((rest @ rest) / (len(t) - 2) / (t @ t)))
    grown = rate * float(np.ptp(t))
    pattern = 0.0 if located.pattern_u is None else float(np.median(located.pattern_u[good]))
    least = max(SPEEDS.trend, 2 * RIM * pattern / float(np.median(located.radius[good])))
    if abs(grown) < least or abs(rate) < SPEEDS.trend_u * u:
        return 0.0
    rows, columns = tracked.clip.shape
    right = np.mean(located.x[good]) - (columns - 1) / 2
    along_y = tracked.plane.sense * (np.mean(located.y[good]) - (rows - 1) / 2)
    moved = rate * tracked.plane.metres_per_pixel * np.array([right, along_y])
    return float(moved @ flight.velocity) / flight.speed
