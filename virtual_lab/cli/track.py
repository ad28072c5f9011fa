"""The command that measures a user's own clip."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

from virtual_lab.cli.shared import json_option, print_json, teller

__all__ = ["track"]


@click.command()
@click.argument("clip", type=click.Path(path_type=Path))
@click.option(
    "--calibration",
    type=click.Path(path_type=Path),
    help="TOML file: metres_per_pixel, frames_per_second, exposure_s, timestamps, …",
)
@click.option("--ball", metavar="73mm±0.5mm", help="The ball's diameter, in mm, cm, m or in.")
@click.option("--fps", type=float, help="Pictures stored in a true second, repeats counted.")
@click.option("--exposure", metavar="1/120", help="Time that a picture is exposed, in s, ms.")
@click.option("--gravity", type=float, help="Gravity where it was filmed [m/s²], 9.81 by default.")
@click.option("--frames", metavar="17:52", help="First and last frame to look at.")
@click.option("--region", metavar="X,Y,W,H", help="Part of the picture to look at [pixels].")
@click.option("--ball-at", metavar="X,Y@FRAME", help="Where the ball is, if others move too.")
@click.option("--scale", metavar="X,Y:X,Y=50cm", help="Two points and their distance.")
@click.option("--readout", metavar="16ms", help="Time a rolling shutter takes over the picture.")
@click.option("--global-shutter", is_flag=True, help="All rows are exposed at once.")
@click.option(
    "--track",
    "corrected",
    type=click.Path(path_type=Path),
    help="track.csv of an earlier run, corrected by hand: its places and flights are taken.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="New folder for track, result, plot, contact sheet and film  [default: CLIP-track]",
)
@json_option
def track(
    clip: Path,
    corrected: Path | None,
    out: Path | None,
    as_json: bool,
    **said: Any,
) -> None:
    """Follow the ball through CLIP: flights and contacts, speeds, restitution, gravity, track.

    CLIP is a video (MP4, MOV, AVI, MKV, CINE, MRAW), a folder of images, a TIFF stack or a .npy
    array.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # its faults are told as ours
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    from virtual_lab.files import check_new_folder, first_free
    from virtual_lab.video.show.tracked_clip import Asked, track_clip

    out = out or first_free(clip.parent / f"{clip.absolute().stem or 'clip'}-track")
    check_new_folder(out)
    found = track_clip(clip, Asked(track=corrected, **said), progress=teller())
    found.save(out)
    if as_json:
        print_json(found.document)
    else:
        click.echo(f"{found.text}\n\n{out}")
