"""What `virtual-lab track` prints of a clip, and writes of it as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from virtual_lab.output.rounding import decimals, with_uncertainty
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE, miles_per_hour
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.follow.following import FollowedClip, MeasuredFlight
from virtual_lab.video.follow.ruler import SAID, off_u
from virtual_lab.video.locate.located import PlaceFlag

if TYPE_CHECKING:
    from virtual_lab.video.track.tracking import Tracked

RATIOS = {"floor": "speeds along the vertical", "wall": "speeds along the level"}


def track_document(found: FollowedClip, tracked: Tracked | None = None) -> dict[str, Any]:
    """Return the result; the keys of one contact are None where there is none, or several."""
    before, after = _hit(found, tracked)
    one = found.contacts[0] if len(found.contacts) == 1 else None
    scale, motion = found.scale, found.motion
    return {
        "clip": found.clip.source.path.name,
        "motion": motion.kind,
        "period_s": _value_and_u(motion.period),
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
        "exposure_s": tracked.exposure if tracked else found.known.exposure,
        "drag_per_m": found.drag_per_m,
        "counts": {
            "frames": found.clip.count,
            "with_ball": _with_ball(found, tracked),
            "in": before.places if before else 0,
            "out": after.places if after else 0,
            "in_contact": int(tracked.legs.struck.sum()) if tracked else 0,
            "lost": sum(found.lost.values()),
        },
        "flags": list(found.flags),
        "frame_flags": _frame_flags(tracked) if tracked else {},
        "warnings": list(found.warnings),
    }


def _hit(
    found: FollowedClip, tracked: Tracked | None
) -> tuple[MeasuredFlight | None, MeasuredFlight | None]:
    """Return the flights before and after one contact, or the only one."""
    if len(found.contacts) == 1:
        return found.flights[found.contacts[0].before], found.flights[found.contacts[0].after]
    if len(found.flights) == 1:
        return found.flights[0], None
    return (found.flights[0], found.flights[1]) if tracked else (None, None)


def _value_and_u(result: Estimate | None, unit: float = 1.0) -> dict[str, float] | None:
    return {"value": result.value / unit, "u": result.u / unit} if result else None


def _frame_flags(tracked: Tracked) -> dict[str, int]:
    counts = {str(e.name): int(((tracked.located.flags & e) > 0).sum()) for e in PlaceFlag}
    return {name: count for name, count in counts.items() if count}


def _with_ball(found: FollowedClip, tracked: Tracked | None) -> int:
    """Return how many frames show the ball."""
    if tracked:
        return len(tracked.frames)
    return sum([each.places for each in found.flights] or [len(each.t) for each in found.pieces])


def track_text(found: FollowedClip, tracked: Tracked | None = None) -> str:
    """Return the result in a few lines."""
    motion, flights = found.motion, found.flights
    lines = [
        f"{found.clip.source.path.name}: {found.clip.count} frames, {motion.kind}, "
        f"the ball in {_with_ball(found, tracked)}"
    ]
    if motion.period:
        lines.append(f"  period {_rounded(motion.period)} s")
    contacts = {each.before: each for each in found.contacts}
    for k, flight in enumerate(flights):
        speeds = [flight.speed_in, flight.speed_out][: 2 - (flight.speed_in == flight.speed_out)]
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
    """Return which ruler sets the scale, its u, and how far others are off."""
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
    """Return the result in a line."""
    parts = [found.motion.kind]
    ratios = [_plus_minus(each.restitution) for each in found.contacts if each.restitution]
    if ratios:
        parts.append(f"restitution {', '.join(ratios)} (k = 2)")
    return f"{found.clip.source.path.name}: {'; '.join(parts)}"


def _plus_minus(ratio: Estimate) -> str:
    """Return ``0.9470 ± 0.0096``, with twice the standard uncertainty."""
    places = decimals(2 * ratio.u)
    return f"{ratio.value:.{places}f} ± {2 * ratio.u:.{places}f}"


def _rounded(result: Estimate) -> str:
    return with_uncertainty(result.value, result.u)
