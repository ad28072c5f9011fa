"""A clip tracked from what a person knows of it: document, words, files; for command and Python.

Any clip is followed; where a camera was calibrated, stands still and shows one contact at most, the
ball is then located as sharply as it can be, for the speeds of a hit.
"""

from __future__ import annotations

import json
from collections.abc import Callable
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
from virtual_lab.video.show.course import BallCourse, course_of, write_speeds, write_table
from virtual_lab.video.show.track_text import track_document, track_text, track_title

OPTIONS: dict[str, tuple[type | UnionType, str]] = {  # of an option's value, and an example
    "calibration": (str | Path, '"calibration.toml"'),
    "ball": (str, '"73mm±0.5mm" (a length carries its unit)'),
    "fps": (Real, "240"),
    "exposure": (str, '"1/120" or "8ms"'),
    "gravity": (Real, "9.81"),
    "frames": (str, '"17:52"'),
    "region": (str, '"10,20,300,200"'),
    "ball_at": (str, '"210,85@17"'),
    "scale": (str, '"100,200:300,200=50cm"'),
    "ruler": (str, '"gravity"'),
    "readout": (str, '"16ms"'),
    "global_shutter": (bool, "True"),
    "phone": (bool, "True"),
    "tripod": (bool, "True"),
    "corrected": (str | Path, '"clip-track/track.csv"'),
}
FILES = ("calibration", "corrected")
UNSURE_BALL = "no u of the ball's diameter is given"
STANDING = (UNSURE_BALL, UNSURE_RATE)  # what most clips of phones have in common


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What a person says, in words as on the command line; None: nothing."""

    calibration: Path | None = None
    ball: str | None = None
    fps: float | None = None
    exposure: str | None = None
    gravity: float | None = None
    frames: str | None = None
    region: str | None = None
    ball_at: str | None = None
    scale: str | None = None
    ruler: str | None = None
    readout: str | None = None
    global_shutter: bool = False
    phone: bool = False
    tripod: bool = False
    corrected: Path | None = None  # track.csv of an earlier run

    @classmethod
    def of(cls, **said: object) -> Asked:
        """Take what a person says in Python, of any type.

        Raises `InputError`: an option that there is not, or a value of another type.
        """
        for name, value in said.items():
            if name not in OPTIONS:
                allowed = f"{nearest(name, OPTIONS)}options: {', '.join(OPTIONS)}"
                raise InputError("", name, None, allowed)
            kind, expected = OPTIONS[name]
            good = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
            if not good and value is not None:
                raise InputError("", name, value, f"expected a value like {name}={expected}")
        files = {k: Path(v) for k, v in said.items() if k in FILES and isinstance(v, str | Path)}
        return cls(**said | files)  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedClip:
    """The result."""

    followed: FollowedClip
    course: BallCourse
    document: dict[str, Any]
    text: str
    title: str
    progress: Callable[[str], None] = field(default=lambda _: None)

    def save(self, folder: Path) -> None:
        """Write track.csv, speeds.csv, result.json, track.png, sheet.png, track.webp into a folder.

        Raises `InputError` where the folder is not empty or cannot be written.
        """
        from virtual_lab.video.show import pictures as drawn

        self.progress("drawing")
        pictures = drawn.pictures_of(self.course, self.followed.watched.thumbs)
        with new_folder(folder) as draft, ThreadPoolExecutor(1) as beside:
            film = beside.submit(drawn.write_film, self.course, pictures, draft / "track.webp")
            write_table(self.course, draft / "track.csv")
            write_speeds(self.followed, draft / "speeds.csv")
            text = json.dumps(self.document, indent=2, allow_nan=False)
            (draft / "result.json").write_text(text + "\n", encoding="utf-8")
            drawn.draw_track(self.course, pictures, self.title, draft / "track.png")
            drawn.write_sheet(self.course, pictures, draft / "sheet.png")
            film.result()


def track_clip(
    file: Path | Frame, asked: Asked, *, progress: Callable[[str], None] = lambda _: None
) -> TrackedClip:
    """Return the ball's way through a clip: a file, a folder, or an array of its frames.

    Raises `InputError`: what cannot be read, words of another form, or no length known.
    """
    source = open_source(file)  # what is no clip needs no scale
    calibration, said, notes = _known(asked)
    progress(f"reading {source.path}")
    clip = open_clip(file, calibration)
    known = _for_clip(clip, calibration, said, asked)
    if asked.corrected:
        watched, ways = read_track(asked.corrected, clip)
        found = following(clip, watched, known, ways)
    else:
        found = follow(clip, known, progress=progress)
    told = (*found.notes, *(("", words) for words in notes))
    if asked.phone:  # says these at once
        told = tuple(e for e in told if e[0] != "READOUT_UNKNOWN" and not e[1].startswith(STANDING))
    found = replace(found, notes=told)
    # samples of a large clip take 50 MB, and have given what they can but how dark a picture is
    found = replace(found, clip=replace(clip, samples=clip.samples[:2].copy()))
    return TrackedClip(
        followed=found,
        course=course_of(found),
        document=track_document(found),
        text=track_text(found),
        title=track_title(found),
        progress=progress,
    )


def _known(asked: Asked) -> tuple[ClipCalibration, dict[str, Any], list[str]]:
    """Return the calibration with what was said beside it, the rest, and sentences."""
    keys: dict[str, Any] = {}  # of a calibration file, that words replace
    said: dict[str, Any] = {}
    assumed = False
    if asked.ball is not None:
        ball, ball_u, assumed = options.ball_of(asked.ball)
        keys |= {"ball_diameter_m": ball, "ball_diameter_m_u": ball_u}
    if asked.scale is not None:
        scale, scale_u = options.scale_of(asked.scale)
        keys |= {"metres_per_pixel": scale, "metres_per_pixel_u": scale_u}
    if asked.fps is not None:
        if not 1 <= asked.fps <= 1e7:
            raise InputError("", "--fps", asked.fps, "allowed: 1 to 1e7 frames a second")
        keys |= {"frames_per_second": asked.fps, "frames_per_second_u": 0.0}
    forms: dict[str, Callable[[str], Any]] = {
        "exposure": partial(options.seconds_of, key="--exposure"),
        "readout": partial(options.seconds_of, key="--readout"),
        "frames": options.frames_of,
        "region": options.region_of,
        "ball_at": options.place_of,
    }
    for name, form in forms.items():
        if (text := getattr(asked, name)) is not None:
            said[name] = form(text)
    if asked.calibration and "exposure" in said:  # else frames stored twice may be shorter
        keys["exposure_s"] = said["exposure"]
    if asked.gravity is not None:
        if not 0.1 <= asked.gravity <= 100:
            raise InputError("", "--gravity", asked.gravity, "allowed: 0.1 to 100 m/s²")
        said |= {"gravity": asked.gravity, "gravity_u": 0.0}
    if asked.readout is not None and asked.global_shutter:
        raise InputError("", "--readout", asked.readout, "a global shutter has none: give one")
    if asked.global_shutter:
        said["readout"] = 0.0
    calibration, notes = read_calibration(asked.calibration, keys, asked.ruler != GRAVITY), []
    said["ruler"] = _ruler(calibration, asked)
    if assumed and not (calibration.metres_per_pixel or calibration.camera):
        diameter_u = 1e3 * calibration.ball_diameter_m_u
        notes = [f"{UNSURE_BALL}: {diameter_u:.2g} mm was assumed"]
    return calibration, said, notes


def _ruler(calibration: ClipCalibration, asked: Asked) -> str | None:
    """Choose the ruler where no length in the picture is one; None: the surer one.

    Sharp places, of a calibrated camera, know the ball's size better than gravity.
    """
    if asked.ruler is None:
        return BALL if asked.calibration else None
    if asked.ruler not in (GRAVITY, BALL):
        raise InputError("", "--ruler", asked.ruler, f"allowed: {GRAVITY}, {BALL}")
    if calibration.metres_per_pixel or calibration.camera:
        raise InputError("", "--ruler", asked.ruler, "a length in the picture is given: it is one")
    if asked.ruler == BALL and not calibration.ball_diameter_m:
        raise InputError("", "--ruler", BALL, "its diameter is not known: give --ball")
    return asked.ruler


def _for_clip(
    clip: Clip, calibration: ClipCalibration, said: dict[str, Any], asked: Asked
) -> ClipKnowledge:
    """Gather what is known of a clip that has been opened."""
    axes = {90: (0, -1), 180: (1, -1), 270: (0, 1)}
    said = {"readout_axis": axes.get(clip.source.rotation, (1, 1))} | said
    said["stands"] = asked.tripod or asked.calibration is not None
    if "readout" not in said and asked.calibration is None:
        # a faster one is of a laboratory's camera
        rate = clip.source.rate
        file = clip.source.path.is_file() and rate is not None and rate <= 480
        said["readout"] = None if file else 0.0
    if asked.calibration is None or asked.corrected is not None:
        said["calibration"] = None  # nothing by which to locate the ball sharply
    if any(UNSURE_RATE in each for each in clip.warnings):
        said["rate_of"] = FILE
    known, where = replace(known_of(clip, calibration), **said), str(clip.source.path)
    rows, columns = clip.shape
    if known.frames and known.frames[0] >= clip.count - 1:
        allowed = f"the clip has {clip.count} frames, 0 to {clip.count - 1}"
        raise InputError(where, "--frames", asked.frames, allowed)
    if known.region and (known.region[0] >= columns or known.region[1] >= rows):
        raise InputError(where, "--region", asked.region, f"a picture is {columns} x {rows} pixels")
    x, y, frame = known.ball_at or (0, 0, 0)
    if not (0 <= x < columns and 0 <= y < rows and frame < clip.count):
        allowed = f"a picture is {columns} x {rows} pixels, the last frame {clip.count - 1}"
        raise InputError(where, "--ball-at", asked.ball_at, allowed)
    return known
