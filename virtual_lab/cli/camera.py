"""Commands for a camera: follow the ball in a clip, calibrate, simulate board pictures."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from virtual_lab import api
from virtual_lab.cli.plumbing import Answer, command, names, seed_option
from virtual_lab.errors import InputError

if TYPE_CHECKING:
    from virtual_lab.output.progress import Progress

board_option = click.option(
    "--board",
    "board",
    required=True,
    metavar="KIND:COLUMNSxROWS:SQUARE[:MARKER]",
    help="Calibration board: charuco:14x9:40mm:30mm or chessboard:14x9:40mm, counted in squares.",
)


def _beside_the_clip(asked: Mapping[str, Any]) -> Path:
    clip: Path = asked["clip"]
    return clip.parent / f"{clip.absolute().stem or 'clip'}-track"


@command("track", folder=_beside_the_clip)
@click.argument("clip", type=click.Path(path_type=Path))
@click.option(
    "--calibration",
    type=click.Path(path_type=Path),
    help="Calibration file, .toml: from 'calibrate', or with metres_per_pixel, "
    "frames_per_second, exposure_s, lens_blur_px, timestamps, …",
)
@click.option(
    "--ball",
    metavar="73mm±0.5mm",
    help="Ball diameter, in mm, cm, m or in; or a kind of ball, for its drag too: baseball, "
    "softball, another name in the catalog, or a .toml file.",
)
@click.option("--mass", metavar="145g", help="Mass of the ball, in g, kg or oz: gives its drag.")
@click.option(
    "--fps",
    type=float,
    help="Frames per second of real time, repeated frames included  [default: the file's, or where "
    "the ball would not fall with g by it, the rate that makes it]",
)
@click.option(
    "--exposure",
    metavar="1/120",
    help="Exposure time of a frame, in s or ms; a calibrated camera needs it, here or in its file.",
)
@click.option("--gravity", type=float, help="Local gravity [m/s²]  [default: 9.81 ± 0.025]")
@click.option("--frames", metavar="17:52", help="First and last frame to use.")
@click.option("--region", metavar="X,Y,W,H", help="Part of the picture to use [pixels].")
@click.option(
    "--ball-at",
    metavar="X,Y@FRAME",
    help="Where the ball is, if other objects move too.",
)
@click.option(
    "--scale",
    metavar="X,Y:X,Y=50cm",
    help="Two points [pixels] and their distance.",
)
@click.option(
    "--ruler",
    type=click.Choice(["gravity", "ball"]),
    help="What sets the scale without --scale: gravity (camera level to 5 deg) or the ball's size  "
    "[default: the one with the smaller uncertainty]",
)
@click.option("--readout", metavar="16ms", help="Readout time of a rolling shutter for one frame.")
@click.option(
    "--global-shutter",
    is_flag=True,
    help="No rolling shutter: all rows are exposed at once.",
)
@click.option(
    "--phone",
    is_flag=True,
    help="An ordinary phone's clip: its frame rate is true, its shutter may roll, and the ball's "
    "size is known to 1 %. Nothing more is then said of these.",
)
@click.option("--tripod", is_flag=True, help="The camera stands still.")
@click.option(
    "--level",
    is_flag=True,
    help="The camera is level and square to the flight to 1 deg, as on a levelled stand  "
    "[default: to 5 deg]",
)
@click.option(
    "--track",
    "corrected",
    type=click.Path(path_type=Path),
    help="track.csv of an earlier run, corrected by hand: use its positions and flights.",
)
@click.option("--film-of-track", is_flag=True, help="Also write the marked frames as a film.")
def track(clip: Path, progress: Progress, **asked: Any) -> Any:
    """Follow the ball through CLIP: flights, contacts, speeds, restitution, acceleration.

    CLIP is a video (MP4, MOV, AVI, MKV, WebM, GIF, CINE, MRAW), a folder of images in the order of
    their numbers (negative ones first), a TIFF stack, an animated WebP or PNG, or a .npy array.
    The folder CLIP-track beside it gets track, result, plot and contact sheet.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # no messages of OpenCV among ours
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    return api.track(clip, progress=progress, **asked)


@command("calibrate")
@click.argument("pictures", nargs=-1, required=True, type=click.Path(path_type=Path))
@board_option
@click.option(
    "--plane", metavar="PICTURE", help="Picture in which the board lies flat  [default: first]"
)
@click.option("--height", metavar="36.5mm", help="Height of the ball's plane above that board.")
@click.option("--height-u", metavar="1mm", help="Standard uncertainty of that height.")
@click.option("--square-u", metavar="5um", help="Standard uncertainty of the side of a square.")
@click.option(
    "--out",
    "target",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE",
    help="New calibration file, .toml; a picture of the residuals is written beside it.",
)
def calibrate(pictures: tuple[Path, ...], target: Path, progress: Progress, **asked: Any) -> Answer:
    """Calibrate the camera that took PICTURES of a board, for `track`.

    PICTURES are images, folders of images, TIFF stacks or clips. In one picture the board lies in
    the plane of the ball's flight, or below it by --height; in the others it is tilted by about
    30 deg.
    """
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")  # no messages of OpenCV among ours
    if target.suffix != ".toml":
        raise InputError("", "--out", str(target), "a name that ends in .toml")
    for file in (target, target.with_suffix(".png")):
        if file.exists():
            raise InputError("", "--out", str(file), "is there already; name another")
    progress("looking for the board")
    found = api.calibrate(pictures, **asked)
    found.save(target)
    return Answer(document=found.document, text=found.text, files=(target,))


@command("board", folder="board")
@click.option(
    "--camera",
    default="camera-overhead",
    show_default=True,
    shell_complete=names("instruments"),
    help="Camera: a name in the catalog or a .toml file.",
)
@board_option
@click.option("--views", type=int, default=10, show_default=True, help="Number of pictures.")
@seed_option("  [default: drawn]", None)
def board(board: str, **asked: Any) -> Answer:
    """Simulate pictures of a calibration board, to try `calibrate`."""
    where: dict[str, str] = {}
    files: list[Path] = []

    def save(folder: Path) -> None:
        api.board(folder, board=board, **asked)
        files.append(folder / "pictures")
        where.update(pictures=str(files[0]), truth=str(folder / "truth"))

    return Answer(document=where, text="", save=save, files=files)
