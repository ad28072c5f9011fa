"""A ball's course through a clip, place by place: what is drawn and written of any clip."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.units import DEGREE, Array, Mask
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.follow.following import FollowedClip
from virtual_lab.video.follow.sharpening import SharpBall
from virtual_lab.video.locate.located import PlaceFlag

COLUMNS = (
    *("frame", "time_s", "x_px", "y_px", "x_u_px", "y_u_px", "radius_px", "x_m", "y_m"),
    *("chi_square", "flight", "flags", "drift_x_px", "drift_y_px", "right_mps", "up_mps"),
)
FLIGHT_COLUMNS = (
    *("flight", "first_frame", "last_frame", "places", "speed_in_mps", "speed_in_u_mps"),
    *("speed_out_mps", "speed_out_u_mps", "angle_in_deg", "angle_in_u_deg", "angle_out_deg"),
    *("angle_out_u_deg", "contact_after", "contact_s", "restitution", "restitution_u"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BallCourse:
    """The places; arrays are (place,) unless said otherwise."""

    clip: Clip
    frames: NDArray[np.intp]
    times: Array  # [s]
    xy: Array  # (place, 2) in the still frame [pixels]
    drift: Array  # (place, 2) of the picture from the still frame [pixels]
    radius: Array
    reach: Array  # from the middle to the end of its blur
    u: Array  # (place, 2) [pixels]
    metres: Array  # (place, 2)
    chi_square: Array
    flight: list[str]  # name, "" outside of flights
    flags: list[str]
    residuals: Array  # (place, 2) off its flight, along and across [pixels]; NaN outside of flights
    velocity: Array  # (place, 2) of its flight, right and up [m/s]; NaN outside of flights
    up: float  # of the second of its metres: -1 where it runs down the picture
    contacts: list[tuple[float, float, float]]  # time [s], x, y in the still frame

    @property
    def flights(self) -> list[str]:
        """Names in order."""
        return [each for each in dict.fromkeys(self.flight) if each]

    def of(self, flight: str) -> Mask:
        """Places that belong to a flight, (place,); "": to none."""
        return np.array([each == flight for each in self.flight], bool)


def course_of(found: FollowedClip) -> BallCourse:
    """Course of a ball: of its flights, else of all its pieces."""
    if found.sharp:
        return _course_of_sharp(found, found.sharp)
    ways, clip = found.ways or found.pieces, found.clip
    if ways:
        frames = np.concatenate([way.frames for way in ways])
        some = found.watched.found[np.concatenate([way.blobs for way in ways])]
        times = found.seconds * np.concatenate([way.t for way in ways])
    else:  # some frames, to look at
        frames = np.unique(np.linspace(0, clip.count - 1, 12).astype(np.intp))
        names = ("x", "y", "picture_x", "picture_y", "radius", "length")
        some = np.full(len(frames), np.nan, [(name, float) for name in names])
        times = clip.times[frames]
    order = np.argsort(frames, kind="stable")
    frames, some, times = frames[order], some[order], times[order]
    xy = np.stack([some["x"], some["y"]], axis=1)
    spread = found.fit.spread if found.fit else np.nan
    return BallCourse(
        clip=clip,
        frames=frames,
        times=times,
        xy=xy,
        drift=np.nan_to_num(np.stack([some["picture_x"], some["picture_y"]], axis=1) - xy),
        radius=(some["radius"] + some["length"]) / 2,  # as the scale takes it
        reach=np.array(some["length"]),
        u=np.full((len(frames), 2), spread),
        metres=(found.scale.metres_per_pixel if found.scale else np.nan) * xy,
        chi_square=np.full(len(frames), np.nan),
        flags=[""] * len(frames),
        up=-1.0,
        **_by_flight(found, frames),
    )


def _course_of_sharp(found: FollowedClip, sharp: SharpBall) -> BallCourse:
    located = sharp.located
    return BallCourse(
        clip=found.clip,
        frames=sharp.frames,
        times=found.clip.times[sharp.frames],
        xy=np.stack([located.x, located.y], axis=1),
        drift=np.zeros((len(sharp.frames), 2)),
        radius=located.radius,
        reach=located.radius + np.hypot(located.blur_x, located.blur_y) / 2,
        u=np.stack([located.x_u, located.y_u], axis=1),
        metres=sharp.plane.places,
        chi_square=located.chi_square,
        flags=["|".join(str(e.name) for e in PlaceFlag(int(own))) for own in located.flags],
        up=-sharp.plane.sense,
        **_by_flight(found, sharp.frames),
    )


def _by_flight(found: FollowedClip, frames: NDArray[np.intp]) -> dict[str, Any]:
    """Names, residuals, speeds and contacts of flights, for a course of some frames."""
    flight = np.full(len(frames), "", object)
    residuals, speeds = np.full((2, len(frames), 2), np.nan)
    for k, way in enumerate(found.ways if found.fit and found.scale else []):
        assert found.fit is not None
        assert found.scale is not None
        own = np.searchsorted(frames, way.frames)
        states = found.fit.at(k, way.t)
        flight[own] = str(k + 1)
        residuals[own] = _turned(found.fit.residuals[k], states[len(way.t) // 2, 2:])
        speeds[own] = found.scale.metres_per_pixel / found.seconds * states[:, 2:] * [1, -1]
    return {
        "flight": flight.tolist(),
        "residuals": residuals,
        "velocity": speeds,
        "contacts": [(e.time.value, float(e.place[0]), float(e.place[1])) for e in found.contacts],
    }


def course_rows(course: BallCourse) -> Iterator[tuple[Any, ...]]:
    """Yield a row a place, in the order of `COLUMNS`; NaN: not known."""
    for k, frame in enumerate(course.frames):
        if np.isnan(course.xy[k]).all() and not course.flags[k]:
            continue
        places = (*course.xy[k], *course.u[k], course.radius[k], *course.metres[k])
        numbers = map(float, (course.times[k], *places, course.chi_square[k]))
        yield (
            int(frame),
            *numbers,
            course.flight[k],
            course.flags[k],
            *course.drift[k],
            *course.velocity[k],
        )


def write_table(course: BallCourse, path: Path) -> None:
    """Write the course as CSV, a row a place."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for frame, time, *cells in course_rows(course):
            words = [e if isinstance(e, str) else "" if np.isnan(e) else f"{e:.7g}" for e in cells]
            writer.writerow([frame, repr(time), *words])


def write_speeds(found: FollowedClip, path: Path) -> None:
    """Write the flights as CSV, a row each, with the contact that ends it; u: one standard one."""
    contacts = {each.before: each for each in found.contacts}
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(FLIGHT_COLUMNS)
        for k, flight in enumerate(found.flights):
            speeds, angles = (
                [f"{each / unit:.6g}" for one in pair for each in (one.value, one.u)]
                for pair, unit in (
                    ((flight.speed_in, flight.speed_out), 1.0),
                    ((flight.angle_in, flight.angle_out), DEGREE),
                )
            )
            ended = ["", "", "", ""]
            if met := contacts.get(k):
                ratio = met.restitution
                ended = [met.kind, f"{met.time.value:.7g}"]
                ended += [f"{ratio.value:.6g}", f"{ratio.u:.3g}"] if ratio else ["", ""]
            frames = (flight.first_frame, flight.last_frame, flight.places)
            writer.writerow([k + 1, *frames, *speeds, *angles, *ended])


def _turned(left: Array, velocity: Array) -> Array:
    """Return residuals along and across a velocity, (place, 2)."""
    cos, sin = velocity / max(float(np.hypot(*velocity)), 1e-12)
    return np.asarray(left @ np.array([[cos, -sin], [sin, cos]]))
