"""What `virtual-lab track` prints of a clip, and writes of it as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE, miles_per_hour
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.follow.following import Flight, FollowedClip
from virtual_lab.video.follow.ruler import SAID, off_u
from virtual_lab.video.locate.located import PlaceFlag

RATIOS = {"floor": "speeds along the vertical", "wall": "speeds along the level"}


def motion_of(found: FollowedClip) -> str:
    """Motion that a clip shows: flights or none."""
    return "flights" if found.flights else "none"


def track_document(found: FollowedClip) -> dict[str, Any]:
    """Write the result for JSON; keys of one contact are None where there is none or several."""
    before, after = _hit(found)
    one = found.contacts[0] if len(found.contacts) == 1 else None
    scale = found.scale
    return {
        "clip": found.clip.source.path.name,
        "motion": motion_of(found),
        "flights": [
            {
                "first_frame": each.first_frame,
                "last_frame": each.last_frame,
                "places": each.places,
                "speed_in_mps": _value_and_u(each.speed_in),
                "speed_out_mps": _value_and_u(each.speed_out),
                "acceleration_mps2": _value_and_u(each.acceleration),
            }
            for each in found.flights
        ],
        "contacts": [
            {
                "time_s": each.time.value,
                "frame": each.frame,  # between stored ones
                "kind": each.kind,
                "restitution": _value_and_u(each.restitution),
            }
            for each in found.contacts
        ],
        "gravity_mps2": _value_and_u(found.gravity),
        "speed_in_mps": _value_and_u(before.speed_out if before else None),
        "speed_out_mps": _value_and_u(after.speed_in if after else None),
        "restitution": _value_and_u(one.restitution if one else None),
        "restitution_of": RATIOS.get(one.kind, "speeds") if one and one.restitution else None,
        "angle_in_deg": _value_and_u(before.angle_out if before else None, DEGREE),
        "angle_out_deg": _value_and_u(after.angle_in if after else None, DEGREE),
        "contact": None
        if one is None
        else {
            "time_s": _value_and_u(one.time),
            "x_m": float(one.metres[0]),
            "y_m": float(one.metres[1]),
            "u_m": one.metres_u,
        },
        "scale": None
        if scale is None
        else {
            "metres_per_pixel": scale.metres_per_pixel,
            "relative_u": scale.relative_u,
            "from": scale.source,
            "checks": [
                {
                    "metres_per_pixel": each.metres_per_pixel,
                    "relative_u": each.relative_u,
                    "from": each.source,
                    "off_u": off_u(scale, each),
                }
                for each in found.checks
            ],
        },
        "frames_per_second": {
            "value": found.known.rate,
            "u": found.known.rate * found.known.rate_u,
            "from": found.known.rate_of,
        },
        "exposure_s": found.sharp.exposure if found.sharp else found.known.exposure,
        "drag_per_m": found.drag_per_m,
        "counts": {
            "frames": found.clip.count,
            "with_ball": _with_ball(found),
            "in": before.places if before else 0,
            "out": after.places if after else 0,
            "in_contact": _in_contact(found),
            "lost": sum(found.lost.values()),
        },
        "flags": list(found.flags),
        "frame_flags": _frame_flags(found),
        "warnings": list(found.warnings),
    }


def _hit(found: FollowedClip) -> tuple[Flight | None, Flight | None]:
    """Flights before and after one contact, or the only one."""
    if len(found.contacts) == 1:
        return found.flights[found.contacts[0].before], found.flights[found.contacts[0].after]
    if len(found.flights) == 1:
        return found.flights[0], None
    return (found.flights[0], found.flights[1]) if found.sharp else (None, None)


def _value_and_u(result: Estimate | None, unit: float = 1.0) -> dict[str, float] | None:
    return {"value": result.value / unit, "u": result.u / unit} if result else None


def _frame_flags(found: FollowedClip) -> dict[str, int]:
    flags = found.sharp.located.flags if found.sharp else np.zeros(0, np.uint16)
    return {str(e.name): count for e in PlaceFlag if (count := int(((flags & e) > 0).sum()))}


def _in_contact(found: FollowedClip) -> int:
    """Count of frames between the flights of a sharp hit, in which it is struck."""
    if not found.sharp or not found.contacts:
        return 0
    before, after = found.flights[:2]
    return after.first_frame - before.last_frame - 1


def _with_ball(found: FollowedClip) -> int:
    """Count of frames that show the ball."""
    if found.sharp:
        return len(found.sharp.frames)
    return sum([each.places for each in found.flights] or [len(each.t) for each in found.pieces])


def track_text(found: FollowedClip) -> str:
    """Write the result in a few lines."""
    flights = found.flights
    lines = [
        f"{found.clip.source.path.name}: {found.clip.count} frames, {motion_of(found)}, "
        f"the ball in {_with_ball(found)}"
    ]
    contacts = {each.before: each for each in found.contacts}
    for k, flight in enumerate(flights):
        speeds = [flight.speed_in, flight.speed_out]
        if abs(speeds[0].value - speeds[1].value) < 0.1 * speeds[0].u:  # a hit's, by a calibration
            speeds = speeds[:1]
        mph = " to ".join(f"{miles_per_hour(each.value):.2f}" for each in speeds)
        words = (
            f"  flight {k + 1}: frames {flight.first_frame} to {flight.last_frame}, "
            f"{flight.places} places, {' to '.join(map(_rounded, speeds))} m/s ({mph} mph)"
        )
        pull = flight.acceleration
        if pull and pull.u < pull.value:  # else it bends too little to say
            words += f", acceleration {_rounded(pull)} m/s²"
        lines.append(words)
        if contact := contacts.get(k):
            value = contact.restitution
            of = RATIOS.get(contact.kind, "speeds")
            turned = flights[contact.after].angle_in.value - flight.angle_out.value
            lines.append(
                f"  {contact.kind} at frame {contact.frame:.2f}, {contact.time.value:.4f} s: "
                f"restitution {f'{_rounded(value)} (ratio of {of})' if value else 'not stated'}, "
                f"turned by {turned / DEGREE % 360:.1f} deg"
            )
    if found.scale and flights:
        lines.append(f"  {_scale_said(found.scale, found.checks)}")
    lines += [f"  flags: {', '.join(found.flags)}"] if found.flags else []
    return "\n".join([*lines, *(f"  warning: {each}" for each in found.warnings)])


def _scale_said(scale: PixelScale, checks: Sequence[PixelScale]) -> str:
    """Say which ruler sets the scale, its u, and how far others are off."""
    said = (
        f"scale {with_uncertainty(1e3 * scale.metres_per_pixel, 1e3 * _scale_u(scale))} mm a pixel "
        f"by {SAID[scale.source]} ({100 * scale.relative_u:.2g} %)"
    )
    for each in checks:
        ratio = 100 * (each.metres_per_pixel / scale.metres_per_pixel - 1)
        said += (
            f"; by {SAID[each.source]} {ratio:+.2g} % (u {100 * each.relative_u:.2g} %, "
            f"{abs(off_u(scale, each)):.1f} u off)"
        )
    return said


def _scale_u(scale: PixelScale) -> float:
    return scale.metres_per_pixel * scale.relative_u


def track_title(found: FollowedClip) -> str:
    """Write the result in a line, and the flags."""
    ratios = [_rounded(each.restitution) for each in found.contacts if each.restitution]
    parts = [motion_of(found), *([f"restitution {', '.join(ratios)}"] if ratios else [])]
    title = f"{found.clip.source.path.name}: {'; '.join(parts)}"
    return f"{title}\nflags: {', '.join(found.flags)}" if found.flags else title


def _rounded(result: Estimate) -> str:
    return with_uncertainty(result.value, result.u)
