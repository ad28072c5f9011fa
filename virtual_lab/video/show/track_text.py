"""What `virtual-lab track` prints."""

from __future__ import annotations

from math import hypot

from virtual_lab.output.rounding import decimals, with_uncertainty
from virtual_lab.units import DEGREE, miles_per_hour
from virtual_lab.video.follow.following import FollowedClip
from virtual_lab.video.follow.said import Said
from virtual_lab.video.track.speeds import Speeds
from virtual_lab.video.track.tracking import Tracked

__all__ = ["followed_text", "followed_title", "plus_minus", "track_text", "track_title"]


def track_text(tracked: Tracked, found: Speeds) -> str:
    """Return the result of a ball that was located sharply in a few lines."""
    legs = tracked.legs
    lines = [
        f"{tracked.clip.source.path.name}: {tracked.clip.count} frames, the ball in "
        f"{len(tracked.frames)}, {int(legs.used_in.sum())} of them in, "
        f"{int(legs.used_out.sum())} out",
        _line("speed in", found.speed_in, "m/s"),
    ]
    if found.speed_out and found.angle_out:
        turned = (found.angle_out.value - found.angle_in.value) / DEGREE % 360
        turned_u = hypot(found.angle_out.u, found.angle_in.u) / DEGREE
        lines.append(_line("speed out", found.speed_out, "m/s"))
        if found.restitution:
            of = f"ratio of {found.restitution_of}"
            lines.append(_line("restitution", found.restitution, of))
        lines.append(_line("turned by", Said(value=turned, u=turned_u), "deg"))
    if found.contact_time:
        ms = Said(value=1e3 * found.contact_time.value, u=1e3 * found.contact_time.u)
        lines.append(_line("contact at", ms, "ms"))
    return "\n".join([*lines, *_notes(found.flags, found.warnings)])


def followed_text(found: FollowedClip) -> str:
    """Return what was followed in a few lines."""
    places = sum(len(each.t) for each in found.ways or found.pieces)
    lines = [
        f"{found.clip.source.path.name}: {found.clip.count} frames, {found.motion.kind}, "
        f"the ball in {places}"
    ]
    if found.motion.period is not None and found.motion.period_u is not None:
        period = Said(value=found.motion.period, u=found.motion.period_u)
        lines.append(_line("period", period, "s"))
    by_flight = {each.before: each for each in found.contacts}
    for k, flight in enumerate(found.flights):
        into, out, pull = (
            with_uncertainty(each.value, each.u)
            for each in (flight.speed_in, flight.speed_out, flight.acceleration)
        )
        lines.append(
            f"  flight {k + 1}: frames {flight.first_frame} to {flight.last_frame}, "
            f"{flight.places} places, {into} to {out} m/s, acceleration {pull} m/s²"
        )
        if contact := by_flight.get(k):
            value = contact.restitution
            of = with_uncertainty(value.value, value.u) if value else "not stated"
            lines.append(
                f"  {contact.kind} at frame {contact.frame:.2f}, {contact.time.value:.4f} s: "
                f"restitution {of}"
            )
    return "\n".join([*lines, *_notes(found.flags, found.warnings)])


def track_title(tracked: Tracked, found: Speeds) -> str:
    """Return the result of a ball that was located sharply in a line."""
    parts = [f"in {plus_minus(found.speed_in)} m/s"]
    if found.speed_out:
        parts.append(f"out {plus_minus(found.speed_out)} m/s")
    if found.restitution:
        parts.append(f"ratio {plus_minus(found.restitution)}")
    return f"{tracked.clip.source.path.name}: {', '.join(parts)} (k = 2)"


def followed_title(found: FollowedClip) -> str:
    """Return what was followed in a line."""
    parts = [found.motion.kind]
    told = [plus_minus(each.restitution) for each in found.contacts if each.restitution]
    if told:
        parts.append(f"restitution {', '.join(told)} (k = 2)")
    return f"{found.clip.source.path.name}: {'; '.join(parts)}"


def plus_minus(said: Said) -> str:
    """Return ``0.9470 ± 0.0096``, with twice the standard uncertainty."""
    places = decimals(2 * said.u)
    return f"{said.value:.{places}f} ± {2 * said.u:.{places}f}"


def _notes(flags: tuple[str, ...], warnings: tuple[str, ...]) -> list[str]:
    told = [f"  flags: {', '.join(flags)}"] if flags else []
    return told + [f"  warning: {each}" for each in warnings]


def _line(name: str, said: Said, unit: str) -> str:
    mph = f", {miles_per_hour(said.value):.2f} mph" if unit == "m/s" else ""
    rounded = with_uncertainty(said.value, said.u)
    return f"  {name:12} {rounded} {unit}{mph}".rstrip()
