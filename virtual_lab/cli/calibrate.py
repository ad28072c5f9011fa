"""Commands that calibrate a camera with pictures of a board, and make such pictures."""

from __future__ import annotations

import os
from pathlib import Path

import click

from virtual_lab.cli.shared import json_option, names, print_json, teller
from virtual_lab.errors import InputError

__all__ = ["board", "calibrate"]

board_option = click.option(
    "--board",
    "pattern",
    required=True,
    metavar="KIND:COLUMNSxROWS:SQUARE[:MARKER]",
    help="charuco:14x9:40mm:30mm or chessboard:14x9:40mm, counted in squares.",
)


@click.command()
@click.argument("pictures", nargs=-1, required=True, type=click.Path(path_type=Path))
@board_option
@click.option("--plane", metavar="PICTURE", help="In which the board lies flat  [default: first]")
@click.option("--height", metavar="36.5mm", help="Of the ball's plane over the board there.")
@click.option("--height-u", metavar="1mm", help="Its standard uncertainty.")
@click.option("--square-u", metavar="5um", help="Standard uncertainty of a square's side.")
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, help="File to write, .toml; + .png."
)
@json_option
def calibrate(
    pictures: tuple[Path, ...],
    pattern: str,
    plane: str | None,
    height: str | None,
    height_u: str | None,
    square_u: str | None,
    out: Path,
    as_json: bool,
) -> None:
    """Calibrate the camera that took PICTURES of a board, for `track`.

    PICTURES are images, folders of them, TIFF stacks or clips. In one, the board lies in the plane
    the ball will fly in, or below it by --height; in the others it is held askew, 30 deg or so.
    """
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")  # its faults are told as ours
    from virtual_lab.files import new_files
    from virtual_lab.relations.board import board_of, length_of
    from virtual_lab.video.calibration.calibrating import Plan, calibrate_camera
    from virtual_lab.video.clips.reading import read_pictures
    from virtual_lab.video.show.calibration import (
        calibration_document,
        calibration_text,
        calibration_toml,
        draw_calibration,
    )

    drawing = out.with_suffix(".png")
    if out.suffix != ".toml":
        raise InputError("", "--out", str(out), "a name that ends in .toml")
    for file in (out, drawing):
        if file.exists():
            raise InputError("", "--out", str(file), "is there already; name another")
    known = board_of(pattern)
    plan = Plan(
        board=known,
        square_u=length_of(square_u or "0m", "--square-u", 0, known.square / 10),
        height=length_of(height or "0m", "--height", -10, 10),
        height_u=length_of(height_u or "0m", "--height-u", 0, 0.1),
        plane=plane,
    )
    say = teller()
    say("looking for the board")
    found = calibrate_camera(read_pictures(pictures), plan)
    with new_files(out.parent) as draft:
        draw_calibration(found, draft / drawing.name)
        (draft / out.name).write_text(calibration_toml(found), encoding="utf-8")
    if as_json:
        print_json(calibration_document(found))
    else:
        click.echo(f"{calibration_text(found)}\n\n{out}")


@click.command()
@click.option(
    "--camera",
    default="camera-overhead",
    show_default=True,
    shell_complete=names("instruments"),
    help="Name in the catalog, or a .toml file.",
)
@board_option
@click.option("--views", type=int, default=10, show_default=True, help="How many pictures.")
@click.option("--seed", type=click.IntRange(min=0), help="Of everything random.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    help="New folder for pictures/ and truth/.",
)
@json_option
def board(
    camera: str, pattern: str, views: int, seed: int | None, out: Path, as_json: bool
) -> None:
    """Take pictures of a calibration board with a simulated camera, to rehearse `calibrate`."""
    from virtual_lab.files import check_new_folder
    from virtual_lab.relations.board import board_of

    check_new_folder(out)
    known = board_of(pattern)
    from virtual_lab.lab.boards import film_board

    pictures = film_board(camera, known, out, views=views, seed=seed)
    if as_json:
        print_json({"pictures": str(pictures), "truth": str(out / "truth")})
    else:
        click.echo(pictures)
