"""A clip tracked from what a person knows of it: document, words, files; for command and Python.

Any clip is followed; where a camera was calibrated, stands still and shows one contact at most, the
ball is then located as sharply as it can be, for the speeds of a hit.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from numbers import Real
from pathlib import Path
from types import UnionType
from typing import Any

from virtual_lab.errors import InputError, nearest
from virtual_lab.files import new_folder
from virtual_lab.video.clips import options
from virtual_lab.video.clips.calibration_file import ClipCalibration, read_calibration
from virtual_lab.video.clips.clip import Clip, open_clip
from virtual_lab.video.clips.reading import Frame, open_source
from virtual_lab.video.clips.timing import UNSURE_RATE
from virtual_lab.video.follow.correction import read_track
from virtual_lab.video.follow.following import FollowedClip, follow, following
from virtual_lab.video.follow.known import BALL, FILE, GRAVITY, ClipKnowledge, known_of
from virtual_lab.video.show.course import course_rows
from virtual_lab.video.show.track_text import (
    flight_rows,
    track_document,
    track_text,
    track_title,
    write_table,
)


def _within(text: str, least: float, most: float, allowed: str) -> Callable[[float], float]:
    """Form of a number that has a range."""

    def form(value: float) -> float:
        if not least <= value <= most:
            raise InputError("", text, value, f"allowed: {allowed}")
        return value

    return form


# of an option: the type of its value, an example, and what makes a quantity of it
OPTIONS: dict[str, tuple[type | UnionType, str, Callable[[Any], Any]]] = {
    "calibration": (str | Path, '"calibration.toml"', Path),
    "ball": (str, '"73mm±0.5mm" (a length carries its unit)', options.ball_of),
    "fps": (Real, "240", _within("--fps", 1, 1e7, "1 to 1e7 frames a second")),
    "exposure": (str, '"1/120" or "8ms"', partial(options.seconds_of, key="--exposure")),
    "gravity": (Real, "9.81", _within("--gravity", 0.1, 100, "0.1 to 100 m/s²")),
    "frames": (str, '"17:52"', options.frames_of),
    "region": (str, '"10,20,300,200"', options.region_of),
    "ball_at": (str, '"210,85@17"', options.place_of),
    "scale": (str, '"100,200:300,200=50cm"', options.scale_of),
    "ruler": (str, '"gravity"', str),
    "readout": (str, '"16ms"', partial(options.seconds_of, key="--readout")),
    "global_shutter": (bool, "True", bool),
    "phone": (bool, "True", bool),
    "tripod": (bool, "True", bool),
    "corrected": (str | Path, '"clip-track/track.csv"', Path),
}
UNSURE_BALL = "no u of the ball's diameter is given"
STANDING = (UNSURE_BALL, UNSURE_RATE)  # what most clips of phones have in common


def require_options(asked: Mapping[str, object]) -> None:
    """Raise `InputError` for an option that there is not, or a value of another type."""
    for name, value in asked.items():
        if name not in OPTIONS:
            allowed = f"{nearest(name, OPTIONS)}options: {', '.join(OPTIONS)}"
            raise InputError("", name, None, allowed)
        kind, expected, _ = OPTIONS[name]
        good = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        if not good and value is not None:
            raise InputError("", name, value, f"expected a value like {name}={expected}")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedClip:
    """The result."""

    followed: FollowedClip
    document: dict[str, Any]
    text: str
    title: str
    progress: Callable[[str], None] = field(default=lambda _: None)

    def save(self, folder: Path) -> None:
        """Write track.csv, speeds.csv, result.json, track.png, sheet.png, track.webp into a folder.

        Raises `InputError` where the folder is not empty or cannot be written.
        """
        from virtual_lab.video.show.pictures import Pictures

        self.progress("drawing")
        pictures = Pictures(self.followed)
        with new_folder(folder) as draft, ThreadPoolExecutor(1) as beside:
            film = beside.submit(pictures.write_film, draft / "track.webp")
            write_table(course_rows(pictures.places), draft / "track.csv")
            write_table(flight_rows(self.followed), draft / "speeds.csv")
            text = json.dumps(self.document, indent=2, allow_nan=False)
            (draft / "result.json").write_text(text + "\n", encoding="utf-8")
            pictures.draw(self.title, draft / "track.png")
            pictures.write_sheet(draft / "sheet.png")
            film.result()


def track_clip(
    file: Path | Frame,
    asked: Mapping[str, Any],
    *,
    progress: Callable[[str], None] = lambda _: None,
) -> TrackedClip:
    """Track the ball through a clip: a file, a folder, or an array of its frames.

    `asked`: what a person says, in words as on the command line, by the names of `OPTIONS`; None:
    nothing. Raises `InputError`: what cannot be read, words of another form, or no length known.
    """
    source = open_source(file)  # what is no clip needs no scale
    asked = {k: value for k, value in asked.items() if value is not None and value is not False}
    said = {name: OPTIONS[name][2](value) for name, value in asked.items()}
    calibration, notes = _calibration(said)
    progress(f"reading {source.path}")
    clip = open_clip(file, calibration)
    known = _for_clip(clip, calibration, said, asked)
    if "corrected" in said:
        watched, ways = read_track(said["corrected"], clip)
        found = following(clip, watched, known, ways)
    else:
        found = follow(clip, known, progress=progress)
    told = (*found.notes, *(("", words) for words in notes))
    if "phone" in said:  # says these at once
        told = tuple(e for e in told if e[0] != "READOUT_UNKNOWN" and not e[1].startswith(STANDING))
    found = replace(found, notes=told)
    # samples of a large clip take 50 MB, and have given what they can but how dark a picture is
    found = replace(found, clip=replace(clip, samples=clip.samples[:2].copy()))
    return TrackedClip(
        followed=found,
        document=track_document(found),
        text=track_text(found),
        title=track_title(found),
        progress=progress,
    )


def _calibration(said: Mapping[str, Any]) -> tuple[ClipCalibration, list[str]]:
    """Read the calibration, with what was said in place of its keys, and sentences."""
    keys: dict[str, Any] = {}
    assumed = False
    if "ball" in said:
        keys["ball_diameter_m"], keys["ball_diameter_m_u"], assumed = said["ball"]
    if "scale" in said:
        keys["metres_per_pixel"], keys["metres_per_pixel_u"] = said["scale"]
    if "fps" in said:
        keys |= {"frames_per_second": said["fps"], "frames_per_second_u": 0.0}
    file, ruler = said.get("calibration"), said.get("ruler")
    if file and "exposure" in said:  # else frames stored twice may be shorter
        keys["exposure_s"] = said["exposure"]
    calibration, notes = read_calibration(file, keys, ruler != GRAVITY), []
    if ruler and ruler not in (GRAVITY, BALL):
        raise InputError("", "--ruler", ruler, f"allowed: {GRAVITY}, {BALL}")
    if ruler and (calibration.metres_per_pixel or calibration.camera):
        raise InputError("", "--ruler", ruler, "a length in the picture is given: it is one")
    if ruler == BALL and not calibration.ball_diameter_m:
        raise InputError("", "--ruler", BALL, "its diameter is not known: give --ball")
    if assumed and not (calibration.metres_per_pixel or calibration.camera):
        diameter_u = 1e3 * calibration.ball_diameter_m_u
        notes = [f"{UNSURE_BALL}: {diameter_u:.2g} mm was assumed"]
    return calibration, notes


def _for_clip(
    clip: Clip, calibration: ClipCalibration, said: Mapping[str, Any], asked: Mapping[str, Any]
) -> ClipKnowledge:
    """Gather what is known of a clip that has been opened."""
    calibrated, where = "calibration" in said, str(clip.source.path)
    names = ("exposure", "gravity", "frames", "region", "ball_at", "readout", "ruler")
    more: dict[str, Any] = {
        "readout_axis": {90: (0, -1), 180: (1, -1), 270: (0, 1)}.get(clip.source.rotation, (1, 1)),
        "stands": "tripod" in said or calibrated,
        # sharp places, of a calibrated camera, know the ball's size better than gravity
        "ruler": BALL if calibrated else None,
    }
    more |= {name: said[name] for name in names if name in said}
    if "gravity" in said:
        more["gravity_u"] = 0.0
    if "global_shutter" in said:
        if "readout" in said:
            raise InputError(
                "", "--readout", asked["readout"], "a global shutter has none: give one"
            )
        more["readout"] = 0.0
    if "readout" not in more and not calibrated:
        # a faster one is of a laboratory's camera
        rate = clip.source.rate
        file = clip.source.path.is_file() and rate is not None and rate <= 480
        more["readout"] = None if file else 0.0
    if not calibrated or "corrected" in said:
        more["calibration"] = None  # nothing by which to locate the ball sharply
    if "phone" not in said and any(UNSURE_RATE in each for each in clip.warnings):
        more["rate_of"] = FILE
    known = replace(known_of(clip, calibration), **more)
    rows, columns = clip.shape
    if known.frames and known.frames[0] >= clip.count - 1:
        allowed = f"the clip has {clip.count} frames, 0 to {clip.count - 1}"
        raise InputError(where, "--frames", asked["frames"], allowed)
    if known.region and (known.region[0] >= columns or known.region[1] >= rows):
        allowed = f"a picture is {columns} x {rows} pixels"
        raise InputError(where, "--region", asked["region"], allowed)
    x, y, frame = known.ball_at or (0, 0, 0)
    if not (0 <= x < columns and 0 <= y < rows and frame < clip.count):
        allowed = f"a picture is {columns} x {rows} pixels, the last frame {clip.count - 1}"
        raise InputError(where, "--ball-at", asked["ball_at"], allowed)
    return known
