"""The command that measures a user's own clip."""

from __future__ import annotations

import json
import os
from pathlib import Path

import click

from virtual_lab.cli.shared import json_option, print_json, teller

__all__ = ["track"]

BALLS = (1e-3, 1.0)  # m, the diameter


@click.command()
@click.argument("clip", type=click.Path(path_type=Path))
@click.option(
    "--calibration",
    type=click.Path(path_type=Path),
    help="TOML file: metres_per_pixel, frames_per_second, exposure_s, timestamps, …",
)
@click.option("--ball", metavar="73mm", help="The ball's diameter, in mm, cm, m or in.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="New folder for track, result, plot, contact sheet and film  [default: CLIP-track]",
)
@json_option
def track(
    clip: Path,
    calibration: Path | None,
    ball: str | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Follow the ball through CLIP: speeds before and after a contact, restitution, track.

    CLIP is a video (MP4, MOV, AVI, MKV), a folder of images, a TIFF stack or a .npy array.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # its faults are told as ours
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    from virtual_lab.files import check_new_folder, first_free, new_folder
    from virtual_lab.relations.board import length_of
    from virtual_lab.video.bat.clip import bat_document, find_bat, recoil_in
    from virtual_lab.video.clips.calibration_file import read_calibration
    from virtual_lab.video.locate.sharp import Sharp
    from virtual_lab.video.show.bat_plot import bat_text, draw_bat, write_bat_table
    from virtual_lab.video.show.track_film import write_film, write_sheet
    from virtual_lab.video.show.track_plot import draw_track
    from virtual_lab.video.show.track_text import track_text, write_table
    from virtual_lab.video.track.speeds import document, speeds
    from virtual_lab.video.track.tracking import expected_radius
    from virtual_lab.video.track.tracking import track as run

    out = out or first_free(clip.parent / f"{clip.absolute().stem or 'clip'}-track")
    check_new_folder(out)
    known = read_calibration(
        calibration, ball_diameter=None if ball is None else length_of(ball, "--ball", *BALLS)
    )
    say = teller()
    tracked = run(clip, known, Sharp(ball_radius=expected_radius(known)), say=say)
    there = find_bat(tracked, known)
    found = speeds(tracked, known)
    bat = recoil_in(tracked, there) if there else None
    result = document(tracked, found) | ({"bat": bat_document(bat)} if bat else {})
    say("drawing")
    with new_folder(out) as folder:
        write_table(tracked, folder / "track.csv")
        (folder / "result.json").write_text(json.dumps(result, indent=2, allow_nan=False) + "\n")
        draw_track(tracked, found, folder / "track.png")
        write_sheet(tracked, folder / "sheet.png")
        write_film(tracked, folder / "track.webp")
        if bat:
            write_bat_table(bat, folder / "bat.csv")
            draw_bat(bat, folder / "bat.png")
    if as_json:
        print_json(result)
    else:
        speeds_told = "\n".join([track_text(tracked, found), *([bat_text(bat)] if bat else [])])
        told = [speeds_told, str(out)]
        click.echo("\n\n".join(told))
