"""Results of `virtual-lab track`: one table of flights, as text, JSON and CSV."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.errors import name_parameters
from virtual_lab.files.column_units import name_of_u
from virtual_lab.output.rounding import expanded, with_uncertainty
from virtual_lab.relations.flight import drag_rate
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE, miles_per_hour
from virtual_lab.video.calibration.plane import PixelScale
from virtual_lab.video.follow.contacts import Contact
from virtual_lab.video.follow.doubts import drag_difference
from virtual_lab.video.follow.following import Flight, FollowedClip
from virtual_lab.video.follow.knowledge import GRAVITY, frames_are
from virtual_lab.video.follow.ruler import DRAG_COEFFICIENT, SAID, off_u
from virtual_lab.video.show.course import course_of, course_table

if TYPE_CHECKING:
    import pandas as pd

SET = ["x_px", "y_px", "radius_px"]  # columns of a position that a user may change
CHANGED = 0.01  # smallest change by hand [pixels]; a file has seven digits
# flags of statements that the flights contradict, or that contradict each other
DOUBTFUL = {"GRAVITY", "BALL_SIZE", "READOUT"}
RATIOS = {"floor": "speeds along the vertical", "wall": "speeds along the level"}
Row = dict[str, Any]
ESTIMATED = {  # columns of measured values, each with a column of its u
    *("speed_in_m_per_s", "speed_out_m_per_s", "angle_in_deg", "angle_out_deg"),
    *("acceleration_m_per_s2", "contact_time_s", "restitution"),
}
OF_FLIGHT = (  # columns of a table of flights
    *("flight", "first_frame", "last_frame", "positions", "speed_in_m_per_s", "speed_out_m_per_s"),
    *("angle_in_deg", "angle_out_deg", "acceleration_m_per_s2"),
    *("contact_kind", "contact_time_s", "restitution"),
)
OF_CONTACT = ("time_s", "frame", "contact_kind", "restitution")  # columns of a table of contacts


def flight_rows(track: FollowedClip) -> list[Row]:
    """Return one dictionary per flight, with values of the flight and of the contact at its end.

    The keys are column names. A measured value is an estimate, or None if it is unknown. Without a
    contact at the end of the flight, the values of the contact are None.
    """
    contacts = {each.before: each for each in track.contacts}
    rows = [
        (
            *(k + 1, flight.first_frame, flight.last_frame, flight.places),
            *(flight.speed_in, flight.speed_out),
            *(_degrees(flight.angle_in), _degrees(flight.angle_out), flight.acceleration),
            *((met.kind, met.time, met.restitution) if met else (None, None, None)),
        )
        for k, flight in enumerate(track.flights)
        for met in [contacts.get(k)]
    ]
    return [dict(zip(OF_FLIGHT, row, strict=True)) for row in rows]


def contact_rows(track: FollowedClip) -> list[Row]:
    """Return one dictionary per contact; its keys are column names.

    ``frame`` is the time of the contact in frames, not rounded. ``restitution`` is an estimate, or
    None if no restitution is stated for this contact.
    """
    rows = ((each.time.value, each.frame, each.kind, each.restitution) for each in track.contacts)
    return [dict(zip(OF_CONTACT, row, strict=True)) for row in rows]


def in_columns(row: Mapping[str, Any]) -> Row:
    """Return a row in which each estimate is replaced by its value and its standard uncertainty.

    The value has the name of the column. The uncertainty of ``speed_mph`` is in ``speed_u_mph``.
    """
    cells: Row = {}
    for name, each in row.items():
        value, u = (each.value, each.u) if isinstance(each, Estimate) else (each, None)
        cells |= {name: value, name_of_u(name): u} if name in ESTIMATED else {name: value}
    return cells


def estimate_table(rows: Iterable[Mapping[str, Any]], names: Iterable[str]) -> pd.DataFrame:
    """Return the rows as a table; an estimate has a column for its value and one for its u.

    `names` are the keys of a row.
    """
    import pandas as pd

    return pd.DataFrame(map(in_columns, rows), columns=[*in_columns(dict.fromkeys(names))])


def track_document(track: FollowedClip) -> Row:
    """Return the result as a dictionary that can be written as JSON.

    An estimate is a dictionary of ``value`` and ``u``. ``contact``, ``restitution`` and
    ``restitution_of`` are None unless the clip has exactly one contact. ``speed_in_m_per_s`` and
    ``angle_in_deg`` are the values at the end of the incoming flight. ``speed_out_m_per_s`` and
    ``angle_out_deg`` are the values at the start of the outgoing flight. The two values of a
    missing flight are None. The incoming and the outgoing flight are:

    * with exactly one contact, the flights before and after it;
    * otherwise, with a single flight, this flight as the incoming one, and no outgoing one;
    * otherwise, if the ball was located sharply, the first and the second flight;
    * otherwise, neither.
    """
    before, after = _hit_flights(track)
    one = track.contacts[0] if len(track.contacts) == 1 else None
    knowledge, lost = track.knowledge, sum(track.scene.missing_frames(track.ways).values())
    rate, rate_u = knowledge.rate, knowledge.rate * knowledge.rate_u
    document = {
        "clip": track.clip.source.path.name,
        "motion": "flights" if track.flights else "none",
        "flights": flight_rows(track),
        "contacts": contact_rows(track),
        "gravity_mps2": track.gravity,
        "speed_in_m_per_s": before and before.speed_out,
        "speed_out_m_per_s": after and after.speed_in,
        "restitution": one and one.restitution,
        "restitution_of": RATIOS.get(one.kind, "speeds") if one and one.restitution else None,
        "angle_in_deg": before and _degrees(before.angle_out),
        "angle_out_deg": after and _degrees(after.angle_in),
        "contact": one and _contact(one),
        "scale": track.scale
        and {
            **_scale(track.scale),
            "roll_deg": _roll(track),
            "checks": [_scale(e) | {"off_u": off_u(track.scale, e)} for e in track.checks],
        },
        "frames_per_second": {"value": rate, "u": rate_u, "from": knowledge.rate_of},
        "exposure_s": knowledge.exposure,
        "drag_per_m": track.drag_per_m,
        "counts": {"frames": track.clip.count, "with_ball": _with_ball(track), "lost": lost},
        "flags": track.flags,
        "warnings": track.warnings,
    }
    text = json.dumps(document, default=lambda each: {"value": each.value, "u": each.u})
    return dict(json.loads(text))


def _contact(contact: Contact) -> Row:
    x, y = contact.metres.tolist()
    return {"time_s": contact.time, "x_m": x, "y_m": y, "u_m": contact.metres_u}


def _scale(scale: PixelScale) -> Row:
    said = {"metres_per_pixel": scale.metres_per_pixel, "relative_u": scale.relative_u}
    return said | {"from": scale.source}


def _roll(track: FollowedClip) -> float | None:
    """Return the angle of fitted gravity from down [deg], positive to the right, or None."""
    rulers = (track.scale, *track.checks)
    if track.fit is None or not any(each and each.source == GRAVITY for each in rulers):
        return None
    right, down = track.fit.pull[0]
    return float(np.arctan2(right, down) / DEGREE)


def _hit_flights(track: FollowedClip) -> list[Flight | None]:
    """Return the incoming and the outgoing flight as `track_document` defines them, or None."""
    if len(track.contacts) == 1:
        first = track.contacts[0].before
        return [*track.flights[first : first + 2]]
    alone = track.flights if track.sharp or len(track.flights) == 1 else []
    return [*alone, None, None][:2]


def _degrees(angle: Estimate) -> Estimate:
    return replace(angle, value=angle.value / DEGREE, u=angle.u / DEGREE)


def _with_ball(track: FollowedClip) -> int:
    """Return the number of frames that show the ball."""
    ways = track.ways or track.pieces
    return len(track.sharp.frames) if track.sharp else sum(len(each.t) for each in ways)


def track_text(track: FollowedClip) -> str:
    """Return flights and contacts of a followed clip as lines of text, with flags and warnings.

    The first line states the largest speed, or that there is no flight. A sentence that raises no
    flag is a note.
    """
    file, frames = track.clip.source.path.name, f"{track.clip.count} frames"
    lines = [f"no ball in flight was found in the {frames} of {file}"]
    if track.flights:
        lines = [_fastest(track), f"{file}: {frames}, the ball in {_with_ball(track)}; ± is 2 u"]
    contacts = {each.before: each for each in track.contacts}
    for k, flight in enumerate(track.flights):
        speeds, pull = [flight.speed_in, flight.speed_out], flight.acceleration
        if abs(speeds[0].value - speeds[1].value) < 0.1 * speeds[0].u:  # a hit, with a calibration
            speeds = speeds[:1]
        mph = " to ".join(f"{miles_per_hour(each.value):.2f}" for each in speeds)
        words = f"  flight {k + 1}: frames {flight.first_frame} to {flight.last_frame}, "
        words += f"{flight.places} positions, {' to '.join(map(_format, speeds))} m/s ({mph} mph)"
        if pull and pull.u < pull.value:  # otherwise the flight bends too little
            words += f", acceleration {_format(pull)} m/s²"
        lines.append(words)
        if contact := contacts.get(k):
            value, of = contact.restitution, RATIOS.get(contact.kind, "speeds")
            ratio = f"{_format(value)} (ratio of {of})" if value else "not stated"
            turn = track.flights[k + 1].angle_in.value - flight.angle_out.value
            words = f"  {contact.kind} at frame {contact.frame:.2f}, {contact.time.value:.4f} s: "
            lines.append(f"{words}restitution {ratio}, turned by {turn / DEGREE % 360:.1f} deg")
    lines += [f"  {_scale_said(track, track.scale)}"] if track.scale and track.flights else []
    lines += [f"  flags: {', '.join(track.flags)}"] if track.flags else []
    flagged = {name_parameters(words) for flag, words in track.notes if flag}
    lines += [f"  {'warning' if each in flagged else 'note'}: {each}" for each in track.warnings]
    return "\n".join(lines)


def correction_text(before: FollowedClip, track: FollowedClip) -> str:
    """Return a sentence on the frames whose positions were set by hand, and the answer before."""
    old, new = (course_table(course_of(each)).set_index("frame")[SET] for each in (before, track))
    apart = (old - new).abs().max(axis=1)
    done = {
        "changed": apart.index[apart > CHANGED],
        "removed": old.index.difference(new.index),
        "added": new.index.difference(old.index),
    }
    said = [f"{frames_are(frames.tolist())} {how}" for how, frames in done.items() if len(frames)]
    answer = _fastest(before) if before.flights else "no flight"
    return f"positions by hand: {', '.join(said) or 'none changed'}; before, {answer}"


def _fastest(track: FollowedClip) -> str:
    """Return the largest speed at an end of a flight, and the restitution after this flight."""
    ends = [
        (speed, f"at the {end} of flight {n}", n - 1)
        for n, flight in enumerate(track.flights, 1)
        for end, speed in (("start", flight.speed_in), ("end", flight.speed_out))
    ]
    speed, place, number = max(ends, key=lambda each: each[0].value)
    mph = expanded(miles_per_hour(speed.value), miles_per_hour(speed.u))
    ratios = [each.restitution for each in track.contacts if each.before == number]
    after = [f"; restitution {expanded(each.value, each.u)} after it" for each in ratios if each]
    after += [f"; doubtful: see {flag}" for flag in track.flags if flag in DOUBTFUL]
    return f"fastest: {expanded(speed.value, speed.u)} m/s ({mph} mph) {place}{''.join(after)}"


def _scale_said(track: FollowedClip, scale: PixelScale) -> str:
    """Return a sentence on the source of the scale, its u, and the deviations of other scales."""
    size, u = 1e3 * scale.metres_per_pixel, scale.relative_u
    said = f"scale {with_uncertainty(size, size * u)} mm per pixel from {SAID[scale.source]} "
    said += f"({100 * u:.2g} %)"
    for each in track.checks:
        ratio, apart_u = 1e3 * each.metres_per_pixel / size - 1, np.hypot(u, each.relative_u)
        said += f"; the scale from {SAID[each.source]} differs by {100 * ratio:+.2g} % (u of the "
        said += f"difference {100 * apart_u:.2g} %, "
        said += f"a difference of {abs(off_u(scale, each)):.1f} u)"
    if (drag := track.drag_per_m) and drag.value > 2 * drag.u:
        percent = with_uncertainty(100 * drag.value, 100 * drag.u)
        radius = scale.metres_per_pixel * float(np.median([each.radius for each in track.ways]))
        # the drag rate is inversely proportional to the mass
        grams = 1e3 * float(drag_rate(1.2, DRAG_COEFFICIENT, radius, drag.value))
        # relative u of the drag coefficient: a fifth
        mass = with_uncertainty(grams, grams * float(np.hypot(drag.u / drag.value, 0.2)))
        said += f"; the air takes {percent} % of the speed per meter, as of a ball of {mass} g"
        if (known := track.knowledge).drag and known.drag[0]:
            size = (known.ball or 2 * radius) / 2
            said += f" (stated: {1e3 * drag_rate(1.2, DRAG_COEFFICIENT, size, known.drag[0]):.3g} g"
            if track.scene.drag and track.fit and not track.sharp:  # otherwise it is not tested
                apart = drag_difference(track.scene, track.ways, track.fit)[1]
                said += f", a difference of {apart:.1f} u"
            said += ")"
    roll = _roll(track) or 0.0
    if abs(roll) >= 1:
        side = "right" if roll > 0 else "left"
        said += f"; gravity points {abs(roll):.0f} deg to the {side} of the picture's vertical"
    return said


def track_title(track: FollowedClip) -> str:
    """Return a title of one or more lines for a tracked clip.

    The first line has the file name of the clip, the words ``flights`` or ``no flight``, and the
    restitutions of the contacts. A second line lists the flags, if there are any. For a clip
    without a flight, each warning follows in its own line.
    """
    ratios = [_format(each.restitution) for each in track.contacts if each.restitution]
    parts = ["flights" if track.flights else "no flight"]
    parts += [f"restitution {', '.join(ratios)}"] if ratios else []
    lines = [f"{track.clip.source.path.name}: {'; '.join(parts)}"]
    lines += [f"flags: {', '.join(track.flags)}"] if track.flags else []
    return "\n".join([*lines, *(() if track.flights else track.warnings)])


def _format(result: Estimate) -> str:
    return with_uncertainty(result.value, result.u)
