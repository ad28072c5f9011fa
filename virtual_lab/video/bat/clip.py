"""The bat in a clip through which a ball was followed: its angle by frame and its recoil."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.video.bat.angles import BatAngles, Recoil, bat_angles, recoil_of
from virtual_lab.video.bat.outline import find_outline
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.reading import grey_of
from virtual_lab.video.track.tracking import Tracked, uncovered_mean

PUSHED = 1e-3  # s about the contact: the bat is being pushed


@dataclass(frozen=True, slots=True, kw_only=True)
class BatSeen:
    """A bat through a clip."""

    angles: BatAngles
    recoil: Recoil


def find_bat(tracked: Tracked, calibration: ClipCalibration) -> BatSeen | None:
    """Return the bat that [bat] in a clip's calibration speaks of, None without.

    Raises `InputError`: no bat where it should be, no contact, too few frames that show the bat.
    """
    place, camera = calibration.bat, calibration.camera
    if place is None or camera is None:
        return None
    contact = tracked.legs.flights[0].time
    times, located = tracked.clip.times, tracked.located
    reach = located.radius + np.hypot(located.blur_x, located.blur_y) / 2 + 1
    balls = np.full((tracked.clip.count, 3), np.nan)  # x, y, reach [pixels], frame by frame
    balls[tracked.frames] = np.stack([located.x, located.y, reach], axis=1)
    before = np.flatnonzero(times < contact - max(PUSHED, tracked.exposure))
    # the ball and 8 pixels about it show nothing of what is behind it
    spots = [[(x, y, far + 8)] if isfinite(far) else [] for x, y, far in balls[before].tolist()]
    quiet = (grey_of(frame) for _, frame in tracked.clip.chosen(before))
    rest = uncovered_mean(quiet, tracked.background, spots)
    edges = find_outline(rest, place, camera)
    frames = zip(times.tolist(), map(grey_of, tracked.clip.pictures()), strict=True)
    angles = bat_angles(frames, edges, balls, pivoted=place.pivoted)
    if len(tracked.legs.flights) < 2:
        where = str(tracked.clip.source.path)
        raise InputError(where, "bat", None, "the ball is not seen to leave it: no recoil to read")
    return BatSeen(angles=angles, recoil=recoil_of(angles, contact, lasts=PUSHED))


def bat_document(found: BatSeen) -> dict[str, Any]:
    """Return it as JSON has it."""
    recoil = found.recoil
    return {
        "rate_rad_per_s": {"value": recoil.rate.value, "u": recoil.rate.u},
        "turn_began_s": {"value": recoil.contact.value, "u": recoil.contact.u},
        "chi_square": recoil.chi_square,
        "frames": {"seen": int((found.angles.points > 0).sum()), "after": recoil.frames},
    }


def bat_text(found: BatSeen) -> str:
    """Return the recoil in a line."""
    rate = with_uncertainty(found.recoil.rate.value, found.recoil.rate.u)
    return f"  {'bat recoil':12} {rate} rad/s, {found.recoil.frames} frames"


def write_bat_table(found: BatSeen, path: Path) -> None:
    """Write the bat's angles as CSV, a row a frame that shows it."""
    angles = found.angles
    lines = [
        f"{k},{float(angles.times[k])!r},{angles.angle[k]:.9g},{angles.u[k]:.3g},{angles.points[k]}"
        for k in np.flatnonzero(np.isfinite(angles.angle))
    ]
    path.write_text("\n".join(["frame,time_s,angle_rad,u_rad,points", *lines, ""]))
