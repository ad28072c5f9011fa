"""Functions for a camera: track a ball in a clip, calibrate, and simulate pictures of a board."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.api.clip_statements import (
    AnyClip,
    BallOrDiameter,
    BallPosition,
    Duration,
    FrameRange,
    FrameRate,
    PictureRegion,
    PictureScale,
    ReadoutTime,
    StatedGravity,
    StatedMass,
    StatedRuler,
    ball_keys,
    read_frames,
    read_if_stated,
    read_mass,
    read_position,
    read_region,
    read_seconds,
    readout_keys,
    scale_keys,
)
from virtual_lab.errors import InputError
from virtual_lab.files.dictionary import with_units
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import preformatted_html
from virtual_lab.parameters import (
    BoardText,
    File,
    Folder,
    LengthText,
    PictureName,
    PicturePaths,
    Seed,
    Views,
    paths_of,
)
from virtual_lab.sheets import AnyCamera, entry_name

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.output.page_figure import PageFigure
    from virtual_lab.video.calibration.calibrating import Calibrated
    from virtual_lab.video.follow.following import FollowedClip


@dataclass(frozen=True, kw_only=True, repr=False)
class Track:
    """Result of `track`: tables of flights, contacts and positions."""

    clip: FollowedClip
    progress: Progress = quiet
    film: bool = False  # whether `save` writes a film
    settings: str = ""  # arguments of the call that made it, as ``settings.toml``

    @cached_property
    def document(self) -> dict[str, Any]:
        """The result as in ``result.json``."""
        from virtual_lab.video.show.track_text import track_document

        return track_document(self.clip)

    @property
    def text(self) -> str:
        """The result for a terminal."""
        from virtual_lab.video.show.track_text import track_text

        return track_text(self.clip)

    @property
    def motion(self) -> str:
        """The word ``flights``, or ``none`` if no flight was detected."""
        return str(self.document["motion"])

    @cached_property
    def flights(self) -> pd.DataFrame:
        """One row per flight, as in ``speeds.csv``, each quantity with its u."""
        from virtual_lab.video.show.track_text import OF_FLIGHT, estimate_table, flight_rows

        return with_units(estimate_table(flight_rows(self.clip), OF_FLIGHT))

    @cached_property
    def contacts(self) -> pd.DataFrame:
        """One row per contact: time, frame, kind, restitution with its u."""
        from virtual_lab.video.show.track_text import OF_CONTACT, contact_rows, estimate_table

        return with_units(estimate_table(contact_rows(self.clip), OF_CONTACT))

    @cached_property
    def places(self) -> pd.DataFrame:
        """One row per position, as in ``track.csv``."""
        from virtual_lab.video.show.course import course_of, course_table

        return with_units(course_table(course_of(self.clip)))

    def plot(self, path: str | Path | None = None) -> PageFigure:
        """Return the plot of the track, as in ``track.png``. A notebook displays it.

        It shows a frame with the ball's positions, and below it positions, speeds and residuals
        against time.

        Parameters
        ----------
        path
            File to write; its name ends in .png, .svg or .pdf.
        """
        from virtual_lab.video.show.pictures import Pictures
        from virtual_lab.video.show.track_text import track_title

        return Pictures(self.clip).draw(track_title(self.clip)).write(path)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Write track, result, plot, contact sheet, and a film on request into a new folder.

        Parameters
        ----------
        folder
            The new folder.
        overwrite
            Replace a result folder of this name, as a whole.

        Raises
        ------
        InputError
            The folder is not empty, or is to be overwritten but is not a result folder, or cannot
            be written.
        """
        from virtual_lab.video.show.tracked_clip import save_track

        save_track(
            self.clip,
            Path(folder),
            self.progress,
            film=self.film,
            settings=self.settings,
            overwrite=overwrite,
        )
        return Path(folder)

    def _repr_html_(self) -> str:
        return preformatted_html(self.text)

    def __repr__(self) -> str:
        from virtual_lab.video.show.track_text import track_title

        return f"<Track of {track_title(self.clip)}>"


def track(
    clip: AnyClip,
    *,
    ball: BallOrDiameter | None = None,
    mass: StatedMass | None = None,
    fps: FrameRate | None = None,
    exposure: Duration | None = None,
    gravity: StatedGravity | None = None,
    frames: FrameRange | None = None,
    region: PictureRegion | None = None,
    ball_at: BallPosition | None = None,
    scale: PictureScale | None = None,
    ruler: StatedRuler | None = None,
    readout: ReadoutTime | None = None,
    global_shutter: bool = False,
    phone: bool = False,
    tripod: bool = False,
    level: bool = False,
    calibration: File | None = None,
    corrected: File | None = None,
    film_of_track: bool = False,
    progress: Progress = quiet,
) -> Track:
    """Measure a ball in a video clip.

    The result has flights, contacts, speeds and restitution. The clip is a video (MP4, MOV, AVI,
    MKV, WebM, GIF, CINE, MRAW), a folder of numbered images, a TIFF stack, an animated WebP or PNG,
    or a .npy array. Images are sorted by number, and negative numbers come first. If no ball is
    found, the result has no flights and a warning.

    Parameters
    ----------
    clip
        File or folder of the clip.

        An array of 8 or 16 bits is also allowed. Its shape is (frame, row, column) or (frame, row,
        column, color), and `fps` is then required.
    ball
        Diameter of the ball with its unit, for example ``73mm±0.5mm``. Or a type of ball, which
        also sets the drag: a name in the catalog, the first letters of exactly one name, such as
        ``baseball``, or a .toml file.

        A `Sheet` of a ball is also allowed. A number without a unit is rejected.
    mass
        Mass of the ball in g, kg or oz, for example ``145g``. It is used to compute the drag, and
        replaces the mass of the type of ball.
    fps
        Frames per second of real time, including repeated frames; for slow motion, the rate with
        which it was filmed. By default the frame rate in the file. If this rate contradicts g, the
        rate is computed from the fall of the ball.
    exposure
        Exposure time of a frame, for example ``1/120`` or ``8ms``. With a calibration file, the
        exposure time must be stated here or in the calibration file.
    gravity
        Local gravity [m/s²]. By default 9.81 ± 0.025.
    frames
        First and last frame to use, counted from 0, for example ``17:52``.
    region
        Part of the picture to use: left, top, width and height [pixels].
    ball_at
        Position of the ball in one frame [pixels from the upper left corner]. It is needed if
        other objects move too.
    scale
        Two points of the picture [pixels] and the distance between them, for example
        ``100,50:400,50=50cm``.
    ruler
        Source of the scale if none is stated: ``gravity`` (camera level to 5 deg) or the size of
        the ``ball``. By default the source with the smaller uncertainty.
    readout
        Readout time of a rolling shutter for one frame, for example ``16ms`` or ``16ms±2ms``. At
        most 2/fps is allowed, because a file may store every frame twice.
    global_shutter
        The shutter is global: all rows are exposed at once. That of a phone is not; stated as
        global, its speeds may be off by 10 %.
    phone
        Clip of an ordinary phone: the frame rate of the file is correct unless `fps` is given (for
        slow motion, give it), the shutter may roll, and the size of the ball is known to 1 % unless
        its u is given. Warnings about these assumptions are omitted.
    tripod
        The camera does not move.
    level
        The camera is level and square to the flight within 1 deg, as on a leveled tripod. By
        default, 5 deg is assumed.
    calibration
        Calibration file, .toml, made by `calibrate` or by hand.

        Its keys are metres_per_pixel, frames_per_second, exposure_s, lens_blur_px, timestamps and
        others.
    corrected
        File ``track.csv`` of an earlier run, corrected by hand. Its x and y are the position in the
        frame minus the drift x and y of the same row; the page of `open` takes clicks instead. Its
        frames, positions, sizes and flights are used. The rest is found in the clip again, with the
        statements of this call, so that an unchanged file gives the same result.
    film_of_track
        Also write the marked frames as a film, ``track.webp``, when the result is saved: all frames
        with positions, at most 400.
    progress
        Function that is called with a message that names the current task. If it is not given, the
        functions of `virtual_lab` and the commands show the progress on stderr.

    Returns
    -------
    Track
        Tables of flights, contacts and positions. The method ``save`` writes the files.

    Raises
    ------
    InputError
        The clip cannot be read, an option is unknown, or a value does not have the form that is
        described above.
    """
    import numpy as np

    from virtual_lab.video.follow.knowledge import STATED_LEVEL_U
    from virtual_lab.video.show.tracked_clip import track_clip

    if readout and global_shutter:
        allowed = "a global shutter has no readout time; leave one out"
        raise InputError("", "{readout}", readout, allowed)
    statements = {
        **(read_if_stated(ball_keys, ball) or {}),
        **(read_if_stated(scale_keys, scale) or {}),
        **(read_if_stated(readout_keys, "0s" if global_shutter else readout) or {}),
        "frames_per_second": fps,
        "frames_per_second_u": None if fps is None else 0.0,
        "gravity": gravity,
        "gravity_u": None if gravity is None else 0.0,
        "mass": read_if_stated(read_mass, mass),
        "exposure": read_if_stated(read_seconds, exposure),
        "frames": read_if_stated(read_frames, frames),
        "region": read_if_stated(read_region, region),
        "ball_at": read_if_stated(read_position, ball_at),
        "ruler": ruler,
        "phone": phone or None,
        "tripod": tripod or None,
        "level_u": STATED_LEVEL_U if level else None,
        "file": read_if_stated(Path, calibration),
        "corrected": read_if_stated(Path, corrected),
    }
    file = clip if isinstance(clip, np.ndarray) else Path(clip)
    said = {key: value for key, value in statements.items() if value is not None}
    result = track_clip(file, said, progress=progress)
    return Track(clip=result, progress=progress, film=film_of_track)


@dataclass(frozen=True, kw_only=True, repr=False)
class Calibration:
    """A camera calibrated with pictures of a board."""

    camera: Calibrated

    @property
    def document(self) -> dict[str, Any]:
        """Lens, pose and scale with their uncertainties."""
        from virtual_lab.video.show.calibration import calibration_document

        return calibration_document(self.camera)

    @property
    def text(self) -> str:
        """The calibration for a terminal."""
        from virtual_lab.video.show.calibration import calibration_text

        return calibration_text(self.camera)

    def plot(self, path: str | Path | None = None) -> PageFigure:
        """Return a plot of the residuals of the board's corners. A notebook displays it.

        Parameters
        ----------
        path
            File to write; its name ends in .png, .svg or .pdf.
        """
        from virtual_lab.video.show.calibration import draw_calibration

        return draw_calibration(self.camera).write(path)

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the .toml file that `track` reads, and a picture of the residuals beside it.

        Parameters
        ----------
        path
            The .toml file.
        overwrite
            Replace existing files of these names.

        Raises
        ------
        InputError
            A file exists already, or the folder cannot be written.
        """
        from virtual_lab.files import new_files
        from virtual_lab.video.show.calibration import calibration_toml

        target = Path(path)
        with new_files(target.parent, overwrite=overwrite) as draft:
            self.plot(draft / target.with_suffix(".png").name)
            (draft / target.name).write_text(calibration_toml(self.camera), encoding="utf-8")
        return target

    def _repr_html_(self) -> str:
        return preformatted_html(self.text)

    def __repr__(self) -> str:
        return f"<Calibration with {len(self.document['views'])} pictures of a board>"


def calibrate(
    pictures: PicturePaths,
    *,
    board: BoardText,
    plane: PictureName | None = None,
    height: LengthText | None = None,
    height_u: LengthText | None = None,
    square_u: LengthText | None = None,
) -> Calibration:
    """Calibrate a camera for ``track``.

    It is calibrated by pictures of a board. In one picture the board is in the plane of the ball's
    flight, or parallel to this plane at a known distance. In the other pictures the board is tilted
    by about 30 deg.

    Parameters
    ----------
    pictures
        Images, folders of images, TIFF stacks or clips.
    board
        Calibration board, ``charuco:14x9:40mm:30mm`` or ``chessboard:14x9:40mm``: columns and rows
        of squares, side of a square, and side of a ChArUco marker.
    plane
        File name of the picture in which the board is in the ball's plane or parallel to it. By
        default the first picture.
    height
        Distance from the board in this picture to the ball's plane, positive toward the camera, for
        example ``36.5mm``. By default 0.
    height_u
        Standard uncertainty of `height`, for example ``1mm``. By default 0.
    square_u
        Standard uncertainty of the side of a square, for example ``5um``. By default 0.

    Returns
    -------
    Calibration
        The calibrated camera. The method ``save`` writes the file that ``track`` reads.

    Raises
    ------
    InputError
        Pictures cannot be read or do not show the board, or a length has no unit.
    """
    from virtual_lab.files import litter
    from virtual_lab.relations.board import board_of, length_of
    from virtual_lab.video.calibration.calibrating import Plan
    from virtual_lab.video.calibration.calibrating import calibrate_camera as fit
    from virtual_lab.video.clips.reading import read_pictures

    target = board_of(board)
    plan = Plan(
        board=target,
        square_u=length_of(square_u or "0m", "{square_u}", 0, target.square / 10),
        height=length_of(height or "0m", "{height}", -10, 10),
        height_u=length_of(height_u or "0m", "{height_u}", 0, 0.1),
        plane=plane,
    )
    paths = paths_of(pictures)
    camera = fit(read_pictures(paths), plan)
    if ignored := [name for path in paths for name in litter(path)]:
        warnings = (*camera.warnings, f"ignored: {', '.join(ignored)}")
        camera = replace(camera, warnings=warnings)
    return Calibration(camera=camera)


def board(
    folder: Folder,
    *,
    board: BoardText,
    camera: AnyCamera = "camera-overhead",
    views: Views = 10,
    seed: Seed | None = None,
) -> Path:
    """Simulate pictures to try ``calibrate``.

    They show a calibration board, and are written to a new folder.

    Parameters
    ----------
    folder
        The new folder. It gets ``pictures/``, and ``truth/`` with the true lens. Its path is
        returned.
    board
        Calibration board, ``charuco:14x9:40mm:30mm`` or ``chessboard:14x9:40mm``: columns and rows
        of squares, side of a square, and side of a ChArUco marker.
    camera
        Camera: a name in the catalog or a .toml file.

        In Python, a `Sheet` of a camera is also allowed.
    views
        Number of pictures, 3 to 60.
    seed
        Seed of all random numbers. By default a random seed.

    Raises
    ------
    InputError
        The board or the camera is not valid, or the folder is not empty or cannot be written.
    """
    from virtual_lab.lab.boards import film_board
    from virtual_lab.relations.board import board_of

    target = Path(folder)
    film_board(entry_name(camera), board_of(board), target, views=views, seed=seed)
    return target
