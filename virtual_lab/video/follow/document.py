"""A followed clip as JSON has it."""

from __future__ import annotations

from typing import Any

import numpy as np

from virtual_lab.units import DEGREE
from virtual_lab.video.follow.contacts import Contact
from virtual_lab.video.follow.following import Flight, Followed
from virtual_lab.video.follow.said import Said, or_none

__all__ = ["contact_document", "flight_document", "followed_document"]


def flight_document(flight: Flight) -> dict[str, Any]:
    """Return a flight as JSON has it; frames are those of its first and last place."""
    return {
        "first_frame": flight.first_frame,
        "last_frame": flight.last_frame,
        "places": flight.places,
        "speed_in_mps": flight.speed_in.document(),
        "speed_out_mps": flight.speed_out.document(),
        "acceleration_mps2": flight.acceleration.document(),
    }


def contact_document(contact: Contact) -> dict[str, Any]:
    """Return a contact as JSON has it; its frame lies between stored ones."""
    return {
        "time_s": contact.time.value,
        "frame": contact.frame,
        "kind": contact.kind,
        "restitution": or_none(contact.restitution),
    }


def followed_document(found: Followed) -> dict[str, Any]:
    """Return the result; the keys of one contact are None where there is none, or several."""
    one = found.contacts[0] if len(found.contacts) == 1 else None
    before = after = None
    if one:
        before, after = found.flights[one.before], found.flights[one.after]
    elif len(found.flights) == 1:
        before = found.flights[0]
    scale = found.scale
    of = "" if one is None else {"floor": " along the vertical", "wall": " along the level"}
    words = f"speeds{of.get(one.kind, '')}" if one and isinstance(of, dict) else None
    unit = scale.metres_per_pixel if scale else float("nan")
    return {
        "clip": found.clip.source.path.name,
        "motion": found.motion.kind,
        "period_s": None
        if found.motion.period is None or found.motion.period_u is None
        else {"value": found.motion.period, "u": found.motion.period_u},
        "flights": [flight_document(each) for each in found.flights],
        "contacts": [contact_document(each) for each in found.contacts],
        "gravity_mps2": or_none(found.gravity),
        "speed_in_mps": or_none(before.speed_out if before else None),
        "speed_out_mps": or_none(after.speed_in if after else None),
        "restitution": or_none(one.restitution if one else None),
        "restitution_of": words if one and one.restitution else None,
        "angle_in_deg": _angle(before.velocity_out, before.speed_out) if before else None,
        "angle_out_deg": _angle(after.velocity_in, after.speed_in) if after else None,
        "contact": None
        if one is None
        else {
            "time_s": one.time.document(),
            "x_m": unit * float(one.place[0]),
            "y_m": unit * float(one.place[1]),
            "u_m": unit * (found.fit.spread if found.fit else 0.0),
        },
        "scale": None
        if scale is None
        else {
            "metres_per_pixel": scale.metres_per_pixel,
            "relative_u": scale.relative_u,
            "from": scale.source,
        },
        "exposure_s": found.known.exposure,
        "drag_per_m": found.flights[0].drag_per_m if found.flights else None,
        "counts": {
            "frames": found.clip.count,
            "with_ball": sum(len(each.t) for each in found.ways or found.pieces),
            "in": before.places if before else 0,
            "out": after.places if after else 0,
            "in_contact": 0,
            "lost": sum(n for way in found.ways for n in way.lost.values()),
            "repeated": int(found.repeated.sum()),
        },
        "flags": list(found.flags),
        "frame_flags": {},
        "warnings": list(found.warnings),
    }


def _angle(velocity: np.ndarray, speed: Said) -> dict[str, float]:
    value = float(np.arctan2(-velocity[1], velocity[0]))
    return Said(value=value / DEGREE, u=speed.u / max(speed.value, 1e-12) / DEGREE).document()
