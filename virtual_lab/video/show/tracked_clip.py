"""Tracking of a clip with the user's statements, for the command and for Python.

The ball is followed in any clip. If the camera was calibrated and does not move, and the clip has
at most one contact, the ball is then located sharply, for the speeds of a hit.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from virtual_lab.errors import InputError
from virtual_lab.files import new_folder
from virtual_lab.relations.flight import drag_rate
from virtual_lab.video.clips.calibration_file import ClipCalibration, read_calibration
from virtual_lab.video.clips.clip import Clip, open_clip
from virtual_lab.video.clips.reading import open_source
from virtual_lab.video.clips.source import Frame
from virtual_lab.video.clips.timing import UNSURE_RATE
from virtual_lab.video.follow.correction import read_track
from virtual_lab.video.follow.following import FollowedClip, follow
from virtual_lab.video.follow.knowledge import (
    BALL,
    FILE,
    GIVEN,
    GRAVITY,
    ClipKnowledge,
    Note,
    knowledge_of,
)
from virtual_lab.video.follow.ruler import DRAG_COEFFICIENT
from virtual_lab.video.show.course import course_table
from virtual_lab.video.show.track_text import (
    OF_FLIGHT,
    correction_text,
    estimate_table,
    flight_rows,
    track_document,
    track_title,
)

# statements of the user in SI units. The names are keys of a calibration file, fields of
# `ClipKnowledge`, and `file`, `corrected`, `phone`, `mass`, `ball_mass`, `exposure` and `assumed`.
Said = Mapping[str, Any]
UNSURE_BALL = "no u of the ball's diameter is given"
STANDING = (UNSURE_BALL, UNSURE_RATE)  # beginnings of remarks that apply to most clips of phones


def track_clip(
    file: Path | Frame, said: Said, *, progress: Callable[[str], None] = lambda _: None
) -> FollowedClip:
    """Track the ball through a clip, and return its flights, contacts, scale and notes (warnings).

    If no flight is found, the result has no flights and a note.

    Parameters
    ----------
    file
        A file, a folder of pictures, or an array of frames.
    said
        Facts that the user stated about the clip, keyed by name (see `Said`), in SI units.
    progress
        Function that is called with messages about the work.

    Raises
    ------
    InputError
        A file cannot be read. A statement is not allowed or does not fit the clip. The scale is
        unknown. The frame rate implies an impossible value of g. The user asked to compute the
        scale from gravity, but no flight is curved enough.
    """
    # The file is opened first, because a file that is not a clip needs no scale.
    source = open_source(file)
    calibration, notes = _calibration(said)
    progress(f"reading {source.path}")
    clip = open_clip(file, calibration)
    if clip.count < 2:
        raise InputError(str(source.path), "frames", clip.count, "motion needs at least two")
    track = follow(clip, _knowledge(clip, calibration, said), progress=progress)
    messages = (*track.notes, *notes)
    if "phone" in said:  # the option makes these notes unnecessary
        messages = tuple(each for each in messages if not each[1].startswith(STANDING))
        messages = tuple(each for each in messages if each[0] != "READOUT_UNKNOWN")
    if track.uncorrected:
        messages = (("", correction_text(track.uncorrected, track)), *messages)
    return replace(track, notes=messages, uncorrected=None, clip=clip.trim_memory())


def _calibration(said: Said) -> tuple[ClipCalibration, list[Note]]:
    """Return the calibration, with stated values instead of those of the file, and notes."""
    file, ruler = said.get("file"), said.get("ruler")
    keys = {each.name: said[each.name] for each in fields(ClipCalibration) if each.name in said}
    # without a file, frames stored twice may be closer in time than the exposure
    if file and "exposure" in said:
        keys["exposure_s"] = said["exposure"]
    calibration = read_calibration(file, keys, ruler != GRAVITY)
    # A stated mass replaces the drag in the file; the mass of a kind of ball does not.
    mass = said.get("mass", said.get("ball_mass") if not calibration.drag_per_m else None)
    if mass:
        if not (diameter := calibration.ball_diameter_m):
            allowed = "the drag depends on the ball's size; give {ball}"
            raise InputError("", "{mass}", f"{1e3 * mass:g}g", allowed)
        drag = float(drag_rate(1.2, DRAG_COEFFICIENT, diameter / 2, mass))
        # Seams, roughness and speed change C_d by a fifth, far more than the mass of a ball varies.
        calibration = replace(calibration, drag_per_m=drag, drag_per_m_u=drag / 5)
    if calibration.metres_per_pixel or calibration.camera:
        if ruler:
            allowed = "leave it out: the given length in the picture is the ruler"
            raise InputError("", "{ruler}", ruler, allowed)
    elif said.get("assumed"):
        diameter_u = 1e3 * calibration.ball_diameter_m_u
        return calibration, [("", f"{UNSURE_BALL}: {diameter_u:.2g} mm was assumed")]
    return calibration, []


def _knowledge(clip: Clip, calibration: ClipCalibration, said: Said) -> ClipKnowledge:
    """Return the facts about an opened clip. Raises `InputError` if a statement does not fit."""
    calibrated, rate, turn = "file" in said, clip.source.rate, clip.source.rotation
    # A faster clip comes from a laboratory's camera.
    rolls = not calibrated and clip.source.path.is_file() and rate is not None and rate <= 480
    unsure = "phone" not in said and any(UNSURE_RATE in each for each in clip.warnings)
    more = {each.name: said[each.name] for each in fields(ClipKnowledge) if each.name in said}
    knowledge = replace(
        knowledge_of(clip, calibration),
        **{
            "readout": None if rolls else 0.0,
            "readout_axis": {90: (0, -1), 180: (1, -1), 270: (0, 1)}.get(int(turn or 0), (1, 1)),
            "rate_of": FILE if unsure else GIVEN,
            "tripod": calibrated,
            # With a calibrated camera, the size of the ball is more accurate than gravity.
            "ruler": BALL if calibrated else None,
            # Without a calibrated camera, the ball cannot be located sharply.
            "calibration": calibration if calibrated else ClipCalibration(),
            "by_hand": read_track(said["corrected"], clip) if "corrected" in said else None,
        }
        | more,
    )
    rows, columns = clip.shape
    first, (left, top, *_) = (knowledge.frames or (0,))[0], knowledge.region or (0, 0)
    x, y, frame = knowledge.ball_at or (0, 0, 0)
    within = {
        "frames": first < clip.count - 1,
        "region": left < columns and top < rows,
        "ball_at": 0 <= x < columns and 0 <= y < rows and 0 <= frame < clip.count,
        # A file may store every frame twice, which is not known yet.
        "readout": (knowledge.readout or 0.0) * knowledge.rate <= 2,
    }
    for name in (each for each in within if not within[each]):
        allowed = f"a picture is {columns} x {rows} pixels, the last frame {clip.count - 1}"
        allowed += f", the longest readout time {2 / knowledge.rate:.3g} s"
        raise InputError(str(clip.source.path), f"{{{name}}}", said[name], allowed)
    return knowledge


def save_track(
    track: FollowedClip,
    folder: Path,
    progress: Callable[[str], None] = lambda _: None,
    *,
    film: bool = False,
    settings: str = "",
    overwrite: bool = False,
) -> None:
    """Write track.csv, speeds.csv, result.json, track.png and sheet.png into a new folder.

    Parameters
    ----------
    progress
        Function that is called with messages about the work.
    film
        Whether to write the film track.webp too.
    settings
        Text of the file settings.toml. If it is empty, the file is not written.
    overwrite
        Whether an earlier result in `folder` may be replaced. The earlier result must have a
        settings.toml.

    Raises
    ------
    InputError
        The folder is not empty and must not be replaced, is the current folder, or cannot be
        written.
    """
    from virtual_lab.video.show.pictures import Pictures

    progress("drawing")
    pictures = Pictures(track)
    with new_folder(folder, settings, overwrite=overwrite) as draft:
        # A time is written in full, because it identifies its frame.
        course = course_table(pictures.places).astype({"time_s": object})
        speeds = estimate_table(flight_rows(track), OF_FLIGHT)
        for name, table in (("track", course), ("speeds", speeds)):
            table.to_csv(draft / f"{name}.csv", index=False, float_format="%.7g")
        text = json.dumps(track_document(track), indent=2, allow_nan=False)
        (draft / "result.json").write_text(text + "\n", encoding="utf-8")
        figure = pictures.draw(track_title(track))
        figure.savefig(draft / "track.png", pil_kwargs={"compress_level": 3})
        pictures.write_sheet(draft / "sheet.png")
        if film:
            pictures.write_film(draft / "track.webp")
