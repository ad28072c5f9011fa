"""Results of `virtual-lab track`: one table of flights, as text, JSON and CSV."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE, miles_per_hour
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.follow.following import Flight, FollowedClip
from virtual_lab.video.follow.known import GRAVITY
from virtual_lab.video.follow.ruler import SAID, off_u

RATIOS = {"floor": "speeds along the vertical", "wall": "speeds along the level"}
Row = dict[str, Any]


def flight_rows(found: FollowedClip) -> list[Row]:
    """Return the rows of the flights, each with its final contact; values: estimates or None."""
    contacts = {each.before: each for each in found.contacts}
    return [
        {
            "flight": k + 1,
            "first_frame": flight.first_frame,
            "last_frame": flight.last_frame,
            "places": flight.places,
            "speed_in_mps": flight.speed_in,
            "speed_out_mps": flight.speed_out,
            "angle_in_deg": _degrees(flight.angle_in),
            "angle_out_deg": _degrees(flight.angle_out),
            "acceleration_mps2": flight.acceleration,
            "contact_after": met.kind if met else None,
            "contact_s": met.time if met else None,
            "restitution": met.restitution if met else None,
        }
        for k, flight in enumerate(found.flights)
        for met in [contacts.get(k)]
    ]


def contact_rows(found: FollowedClip) -> list[Row]:
    """Return the rows of the contacts; `frame` is a fractional number."""
    return [
        {"time_s": e.time.value, "frame": e.frame, "kind": e.kind, "restitution": e.restitution}
        for e in found.contacts
    ]


def in_columns(row: Mapping[str, Any]) -> Row:
    """Return a row with value and standard uncertainty of each estimate in separate columns."""
    cells: Row = {}
    for name, each in row.items():
        estimate = isinstance(each, Estimate)
        cells |= {name: each.value, f"{name}_u": each.u} if estimate else {name: each}
    return cells


def write_table(rows: Iterable[Mapping[str, Any]], path: Path) -> None:
    """Write rows as CSV; what is None or NaN stays empty."""
    cells = [{name: _cell(name, each) for name, each in in_columns(row).items()} for row in rows]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, dict.fromkeys(name for row in cells for name in row))
        writer.writeheader()
        writer.writerows(cells)


def _cell(name: str, value: object) -> object:
    # a time is written in full, because it identifies its frame
    if not isinstance(value, float) or name == "time_s":
        return value
    return "" if np.isnan(value) else f"{value:.7g}"


def _told(value: Any) -> Any:
    """Return a value for JSON."""
    if isinstance(value, Estimate):
        return {"value": value.value, "u": value.u}
    if isinstance(value, Mapping):
        return {name: _told(each) for name, each in value.items()}
    return [_told(each) for each in value] if isinstance(value, list | tuple) else value


def track_document(found: FollowedClip) -> Row:
    """Write the result for JSON; keys of one contact are None where there is none or several."""
    before, after = _hit(found)
    one = found.contacts[0] if len(found.contacts) == 1 else None
    rate = Estimate(value=found.known.rate, u=found.known.rate * found.known.rate_u)
    document = {
        "clip": found.clip.source.path.name,
        "motion": motion_of(found),
        "flights": flight_rows(found),
        "contacts": contact_rows(found),
        "gravity_mps2": found.gravity,
        "speed_in_mps": before and before.speed_out,
        "speed_out_mps": after and after.speed_in,
        "restitution": one and one.restitution,
        "restitution_of": RATIOS.get(one.kind, "speeds") if one and one.restitution else None,
        "angle_in_deg": before and _degrees(before.angle_out),
        "angle_out_deg": after and _degrees(after.angle_in),
        "contact": one
        and {
            "time_s": one.time,
            "x_m": float(one.metres[0]),
            "y_m": float(one.metres[1]),
            "u_m": one.metres_u,
        },
        "scale": found.scale
        and {
            **_scale(found.scale),
            "roll_deg": _roll(found),
            "checks": [_scale(e) | {"off_u": off_u(found.scale, e)} for e in found.checks],
        },
        "frames_per_second": _told(rate) | {"from": found.known.rate_of},
        "exposure_s": found.known.exposure,
        "drag_per_m": found.drag_per_m,
        "counts": {
            "frames": found.clip.count,
            "with_ball": _with_ball(found),
            "lost": sum(found.lost.values()),
        },
        "flags": found.flags,
        "warnings": found.warnings,
    }
    return {name: _told(each) for name, each in document.items()}


def _scale(scale: PixelScale) -> Row:
    return {
        "metres_per_pixel": scale.metres_per_pixel,
        "relative_u": scale.relative_u,
        "from": scale.source,
    }


def _roll(found: FollowedClip) -> float | None:
    """Return the angle [deg] of fitted gravity from the picture's down to its right, or None."""
    rulers = (found.scale, *found.checks)
    if found.fit is None or not any(each and each.source == GRAVITY for each in rulers):
        return None
    right, down = found.fit.pull[0]
    return float(np.arctan2(right, down) / DEGREE)


def _hit(found: FollowedClip) -> list[Flight | None]:
    """Return the flights before and after one contact, or the only flight."""
    if len(found.contacts) == 1:
        return [found.flights[k] for k in (found.contacts[0].before, found.contacts[0].after)]
    alone = found.flights if found.sharp or len(found.flights) == 1 else []
    return [*alone, None, None][:2]


def _degrees(angle: Estimate) -> Estimate:
    return replace(angle, value=angle.value / DEGREE, u=angle.u / DEGREE)


def motion_of(found: FollowedClip) -> str:
    """Return the motion that a clip shows: flights or none."""
    return "flights" if found.flights else "none"


def _with_ball(found: FollowedClip) -> int:
    """Count of frames that show the ball."""
    ways = found.ways or found.pieces
    return len(found.sharp.frames) if found.sharp else sum(len(each.t) for each in ways)


def track_text(found: FollowedClip) -> str:
    """Write the result in a few lines."""
    lines = [
        f"{found.clip.source.path.name}: {found.clip.count} frames, {motion_of(found)}, "
        f"the ball in {_with_ball(found)}"
    ]
    contacts = {each.before: each for each in found.contacts}
    for k, row in enumerate(flight_rows(found)):
        speeds = [row["speed_in_mps"], row["speed_out_mps"]]
        if abs(speeds[0].value - speeds[1].value) < 0.1 * speeds[0].u:  # a hit's, by a calibration
            speeds = speeds[:1]
        mph = " to ".join(f"{miles_per_hour(each.value):.2f}" for each in speeds)
        words = (
            f"  flight {k + 1}: frames {row['first_frame']} to {row['last_frame']}, "
            f"{row['places']} places, {' to '.join(map(_rounded, speeds))} m/s ({mph} mph)"
        )
        pull = row["acceleration_mps2"]
        if pull and pull.u < pull.value:  # else the flight bends too little to show it
            words += f", acceleration {_rounded(pull)} m/s²"
        lines.append(words)
        if contact := contacts.get(k):
            value, of = contact.restitution, RATIOS.get(contact.kind, "speeds")
            turned = found.flights[contact.after].angle_in.value / DEGREE
            turned -= row["angle_out_deg"].value
            lines.append(
                f"  {contact.kind} at frame {contact.frame:.2f}, {contact.time.value:.4f} s: "
                f"restitution {f'{_rounded(value)} (ratio of {of})' if value else 'not stated'}, "
                f"turned by {turned % 360:.1f} deg"
            )
    if found.scale and found.flights:
        lines.append(f"  {_scale_said(found, found.scale)}")
    lines += [f"  flags: {', '.join(found.flags)}"] if found.flags else []
    return "\n".join([*lines, *(f"  warning: {each}" for each in found.warnings)])


def _scale_said(found: FollowedClip, scale: PixelScale) -> str:
    """Return a sentence on the ruler of the scale, its u, and the deviation of the others."""
    size = 1e3 * scale.metres_per_pixel
    said = (
        f"scale {with_uncertainty(size, size * scale.relative_u)} mm a pixel "
        f"by {SAID[scale.source]} ({100 * scale.relative_u:.2g} %)"
    )
    for each in found.checks:
        ratio = 100 * (each.metres_per_pixel / scale.metres_per_pixel - 1)
        said += (
            f"; by {SAID[each.source]} {ratio:+.2g} % (u {100 * each.relative_u:.2g} %, "
            f"{abs(off_u(scale, each)):.1f} u off)"
        )
    roll = _roll(found) or 0.0
    if abs(roll) >= 1:
        side = "right" if roll > 0 else "left"
        said += f"; gravity points {abs(roll):.0f} deg to the {side} of the picture's down"
    return said


def track_title(found: FollowedClip) -> str:
    """Write the result in a line, and the flags; without a flight, why and what to try."""
    ratios = [_rounded(each.restitution) for each in found.contacts if each.restitution]
    parts = [motion_of(found), *([f"restitution {', '.join(ratios)}"] if ratios else [])]
    lines = [f"{found.clip.source.path.name}: {'; '.join(parts)}"]
    lines += [f"flags: {', '.join(found.flags)}"] if found.flags else []
    return "\n".join([*lines, *(() if found.flights else found.warnings)])


def _rounded(result: Estimate) -> str:
    return with_uncertainty(result.value, result.u)
