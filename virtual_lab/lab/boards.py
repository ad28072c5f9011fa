"""Simulated pictures of a calibration board by a camera of the catalog, with the true lens."""

from __future__ import annotations

import json
from pathlib import Path
from secrets import randbits

from virtual_lab import catalog
from virtual_lab.files import new_folder
from virtual_lab.relations.board import Board
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.spec import CameraSpec
from virtual_lab.simulation.instruments.camera.views import board_views
from virtual_lab.streams import SEED_BITS, Streams


def film_board(
    camera: str, board: Board, folder: Path, *, views: int = 10, seed: int | None = None
) -> Path:
    """Write simulated pictures of a calibration board into a new folder.

    The pictures are PNG files in ``folder/pictures``. The path of this folder is returned. The file
    ``truth/camera.json`` in `folder` holds the true lens and the true camera position in axes of
    the rig. In the first picture the board lies in the plane in which the ball flies.

    Parameters
    ----------
    camera
        Name in the catalog, or a .toml file.
    board
        The board to photograph.
    folder
        The new folder.
    views
        Number of pictures, 3 to 60.
    seed
        Seed of all random numbers; None draws a seed.

    Raises
    ------
    InputError
        The camera is unknown, or the seed is not between 0 and 2^128 - 1. The folder is not empty
        or cannot be written.
    """
    import cv2

    spec = catalog.load("instruments", camera, CameraSpec).spec
    seed = randbits(SEED_BITS) if seed is None else seed
    draws = Streams(seed)
    true = Camera.commission(spec, draws, "camera")
    with new_folder(folder) as draft:
        (draft / "pictures").mkdir()
        (draft / "truth").mkdir()
        for number, (grey, _) in enumerate(board_views(true, board, views, draws, "board")):
            cv2.imwrite(str(draft / "pictures" / f"view-{number:02d}.png"), grey)
        sealed = {"schema": 1, "seed": seed, "camera": camera, "constants": true.errors()}
        (draft / "truth" / "camera.json").write_text(json.dumps(sealed, indent=2) + "\n")
    return folder / "pictures"
