"""What a tracked clip says: speeds at the contact, angles, restitution, each with its u."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import DEGREE
from virtual_lab.video.calibration.plane import RIM
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.follow.said import Said, or_none
from virtual_lab.video.locate.located import PlaceFlag
from virtual_lab.video.track.legs import StraightFlight
from virtual_lab.video.track.tracking import Tracked

__all__ = ["Nearing", "Speeds", "document", "nearing", "speeds"]

Array = NDArray[np.float64]

UP = np.cos(30 * DEGREE)  # a change of velocity nearer to straight up than this is a floor's
CROOKED = 3.0  # u of a place that the residuals may scatter by, noise and pattern together
COVERAGE = 2.0  # u: what lies beyond is no chance
FEW = 5  # frames of a flight: fewer show little of their own scatter


GROWN = 0.004  # of the radius through a flight: less is no matter, nor what a pattern may make
SURE = 6.0  # standard uncertainties
TREND = 8  # frames: fewer show no trend


@dataclass(frozen=True, slots=True, kw_only=True)
class Speeds:
    """The result of a clip, SI and rad; None: the clip does not say."""

    speed_in: Said  # at the contact; without one, in the last frame
    speed_out: Said | None
    angle_in: Said  # of the velocity, from X (the image's right), anticlockwise as seen
    angle_out: Said | None
    restitution: Said | None
    restitution_of: str  # which speeds' ratio it is
    contact_time: Said | None
    contact_place: Array | None  # (2,) of the ball's centre [m]
    contact_place_u: float | None
    flags: tuple[str, ...]  # of the clip
    warnings: tuple[str, ...]


def speeds(tracked: Tracked, calibration: ClipCalibration) -> Speeds:
    """Return the speeds of a tracked clip.

    The restitution is that of something at rest: the ratio of the speeds out and in; off a floor
    (gravity is known, and the velocity changes upward) of their parts along the vertical.
    """
    legs = tracked.legs
    before, after = legs.flight_in, legs.flight_out
    clock_u = calibration.frames_per_second_u / (calibration.frames_per_second or 1.0)
    shared = float(np.hypot(tracked.plane.relative_u, clock_u))
    nears = {
        "in": nearing(tracked, legs.used_in, before),
        "out": nearing(tracked, legs.used_out, after) if after else None,
    }
    flags, warnings = _said_against(tracked, calibration, nears)
    off_in, off_out = (abs(each.speed) if each else 0.0 for each in nears.values())
    contact_time = place = place_u = None
    if after:
        change = float(np.hypot(*(after.velocity - before.velocity)))
        both = float(np.sqrt(before.covariance[0, 0] + after.covariance[0, 0]))
        contact_time = Said(value=before.time, u=both / change)
        place = (before.place + after.place) / 2
        place_u = float(np.hypot(both / 2, tracked.plane.relative_u * np.hypot(*place)))
    off = np.hypot(off_in / before.speed, off_out / after.speed if after else 0.0)
    restitution, of = _restitution(before, after, calibration, float(off))
    if contact_time and (why := _outside(tracked, contact_time)):
        contact_time = place = place_u = restitution = None
        flags, warnings = (*flags, "CONTACT_OUTSIDE"), (*warnings, why)
    if restitution and restitution.value - COVERAGE * restitution.u > 1:
        why = (
            f"the {of} have the ratio {restitution.value:.3g}, and nothing at rest gives back more "
            "than it takes: it moved, or something else was followed; no restitution is given"
        )
        restitution = None
        flags, warnings = (*flags, "ABOVE_ONE"), (*warnings, why)
    return Speeds(
        speed_in=_speed(before, shared, off_in),
        speed_out=_speed(after, shared, off_out) if after else None,
        angle_in=_angle(before, tracked.plane.sense),
        angle_out=_angle(after, tracked.plane.sense) if after else None,
        restitution=restitution,
        restitution_of=of,
        contact_time=contact_time,
        contact_place=place,
        contact_place_u=place_u,
        flags=flags,
        warnings=warnings,
    )


def document(tracked: Tracked, found: Speeds) -> dict[str, object]:
    """Return the result as JSON has it."""
    legs, located = tracked.legs, tracked.located
    place = found.contact_place
    return {
        "clip": tracked.clip.source.path.name,
        "speed_in_mps": found.speed_in.document(),
        "speed_out_mps": or_none(found.speed_out),
        "restitution": or_none(found.restitution),
        "restitution_of": found.restitution_of if found.restitution else None,
        "angle_in_deg": _degrees(found.angle_in),
        "angle_out_deg": _degrees(found.angle_out),
        "contact": None
        if found.contact_time is None or place is None
        else {
            "time_s": found.contact_time.document(),
            "x_m": float(place[0]),
            "y_m": float(place[1]),
            "u_m": found.contact_place_u,
        },
        "scale": {
            "metres_per_pixel": tracked.plane.metres_per_pixel,
            "relative_u": tracked.plane.relative_u,
            "from": tracked.plane.source,
        },
        "exposure_s": tracked.exposure,
        "counts": {
            "frames": tracked.clip.count,
            "with_ball": len(tracked.frames),
            "in": int(legs.used_in.sum()),
            "out": int(legs.used_out.sum()),
            "in_contact": int(legs.struck.sum()),
            "lost": sum(legs.lost.values()),
        },
        "flags": list(found.flags),
        "frame_flags": {
            flag.name: count
            for flag in PlaceFlag
            if flag.name and (count := int(((located.flags & flag) > 0).sum()))
        },
        "warnings": list(found.warnings),
    }


def _speed(flight: StraightFlight, shared: float, off: float) -> Said:
    u = np.hypot(np.hypot(flight.speed_u, flight.speed * shared), off)
    return Said(value=flight.speed, u=float(u))


def _angle(flight: StraightFlight, sense: float) -> Said:
    across = float(np.sqrt(flight.covariance[1, 1]))
    return Said(
        value=float(np.arctan2(-sense * flight.velocity[1], flight.velocity[0])),
        u=across / flight.speed,
    )


def _restitution(
    before: StraightFlight, after: StraightFlight | None, calibration: ClipCalibration, off: float
) -> tuple[Said | None, str]:
    if after is None:
        return None, ""
    into, out, of = before.speed, after.speed, "speeds"
    gravity = np.array(calibration.gravity_mps2)
    change = after.velocity - before.velocity
    if (pull := float(np.hypot(*gravity))) and -change @ gravity > UP * pull * np.hypot(*change):
        down = gravity / pull
        into, out = abs(float(before.velocity @ down)), abs(float(after.velocity @ down))
        of = "speeds along the vertical"
    relative = np.hypot(
        np.hypot(np.sqrt(before.covariance[1, 1]) / into, np.sqrt(after.covariance[1, 1]) / out),
        before.drag_u + after.drag_u,  # one drag takes from both
    )
    return Said(value=out / into, u=float(out / into * np.hypot(relative, off))), of


def _outside(tracked: Tracked, contact: Said) -> str:
    """Return what speaks against a contact that its flights do not meet at; nothing where they do.

    It lies between the last frame of the flight in and the first of the flight out.
    """
    assert tracked.legs.gap is not None
    first, last = tracked.legs.gap
    room = COVERAGE * contact.u + tracked.exposure / 2
    if first - room <= contact.value <= last + room:
        return ""
    return (
        f"the flights are nearest to each other at {1e3 * contact.value:.4g} ms, not between "
        f"{1e3 * first:.4g} and {1e3 * last:.4g} ms where one ends and the other begins: they are "
        "not those of one contact; no contact and no restitution are given"
    )


def _said_against(
    tracked: Tracked, calibration: ClipCalibration, nears: Mapping[str, Nearing | None]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return flags of the clip and sentences."""
    legs, warnings = tracked.legs, list(tracked.clip.warnings)
    flags = []
    if legs.flight_out is None:
        flags.append("NO_REBOUND")
        warnings.append("the ball does not change its velocity: only one flight was found")
    for frame, missing in legs.lost.items():
        flags.append("LOST_FRAMES")
        number = int(tracked.frames[frame])
        warnings.append(
            f"the ball steps ahead by {missing} frames' way before frame {number}: frames are "
            "missing there, and the time was mended by as many"
        )
    for frame, step in legs.stepped.items():
        flags.append("STEP")
        number = int(tracked.frames[frame])
        warnings.append(
            f"the ball's line steps by {1e3 * step:.2g} mm before frame {number}: a wrong time "
            "stamp, or something else that was followed"
        )
    noise = tracked.plane.metres_per_pixel * np.nanmedian(tracked.located.x_u)
    pattern = tracked.located.pattern_u
    if pattern is not None:
        noise = np.hypot(noise, tracked.plane.metres_per_pixel * np.nanmedian(pattern))
    for name, flight in (("in", legs.flight_in), ("out", legs.flight_out)):
        if flight is None:
            continue
        if float(np.sqrt(np.mean(flight.residuals**2))) > CROOKED * noise:
            flags.append("CROOKED")
            warnings.append(
                f"the flight {name} is no straight line: give gravity_mps2 or drag_per_m, or the "
                "ball was touched"
            )
        if flight.count < FEW:
            flags.append("FEW_FRAMES")
            warnings.append(f"only {flight.count} frames show the flight {name}")
    for name, each in nears.items():
        if each:
            flags.append("OFF_PLANE")
            warnings.append(
                f"the ball grows by {100 * each.grown:.2g} % in the flight {name}: it leaves the "
                f"plane, which makes its speed read {each.speed:+.2g} m/s off"
            )
    if calibration.exposure_s is None:
        warnings.append(f"exposure_s is not given: {tracked.exposure:.3g} s was read off the blur")
    return tuple(dict.fromkeys(flags)), tuple(warnings)


def _degrees(angle: Said | None) -> dict[str, float] | None:
    if angle is None:
        return None
    return Said(value=angle.value / DEGREE, u=angle.u / DEGREE).document()


class Nearing(NamedTuple):
    """A ball that comes nearer during a flight."""

    grown: float  # by how much of its radius
    speed: float  # what that adds to the speed [m/s]


def nearing(tracked: Tracked, used: NDArray[np.bool_], flight: StraightFlight) -> Nearing | None:
    """Return how a flight leaves the plane, None where it stays in it as far as can be seen.

    Parameters
    ----------
    tracked
        The clip.
    used
        Frames of the flight, (frame,).
    flight
        Its line.
    """
    located = tracked.located
    good = used & np.isfinite(located.radius) & (located.flags == 0)
    if good.sum() < TREND:
        return None
    t = tracked.times[good] - tracked.times[good].mean()
    size = np.log(located.radius[good] / tracked.plane.sizes[good])
    rate = float(t @ size / (t @ t))
    rest = size - size.mean() - rate * t
    u = float(np.sqrt((rest @ rest) / (len(t) - 2) / (t @ t)))
    grown = rate * float(np.ptp(t))
    pattern = 0.0 if located.pattern_u is None else float(np.median(located.pattern_u[good]))
    least = max(GROWN, 2 * RIM * pattern / float(np.median(located.radius[good])))
    if abs(grown) < least or abs(rate) < SURE * u:
        return None
    rows, columns = tracked.clip.shape
    away = np.array(
        [
            np.mean(located.x[good]) - (columns - 1) / 2,
            tracked.plane.sense * (np.mean(located.y[good]) - (rows - 1) / 2),
        ]
    )
    moved = rate * tracked.plane.metres_per_pixel * away
    return Nearing(grown, float(moved @ flight.velocity) / flight.speed)
