"""Whole frames of a shot, as a lossless film with time stamps and as a preview."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.simulation.instruments.camera.camera import Camera
from virtual_lab.simulation.instruments.camera.scene import FilmedBat, background
from virtual_lab.simulation.instruments.camera.shots import Course
from virtual_lab.simulation.instruments.camera.spec import CameraSpec
from virtual_lab.streams import Draws, Slots

Frame = NDArray[Any]
PREVIEW_WIDTH = 480  # [px]


def whole_frames(
    camera: Camera,
    course: Course,
    draws: Draws,
    name: str,
    slots: Slots,
    bat: FilmedBat | None = None,
    count: int | None = None,
) -> Iterator[tuple[float, Frame]]:
    """Yield the time stamp [s] and the gray values, (row, column), of each frame of the first shot.

    Frames without the ball are yielded too. The time stamps are readings of the camera's clock.

    Parameters
    ----------
    camera, course
        The camera, and the flights of the ball.
    draws
        Random numbers.
    name, slots
        Name of the camera, and the number of each shot in its laboratory. They select the random
        numbers.
    bat
        Bat in the frames. If None, no bat is drawn.
    count
        Number of frames to yield, at equal steps. If None, all recorded frames are yielded.
    """
    spec = camera.spec
    frames = camera.frames(course, draws, name, slots, whole=True)
    empty_scene, numbers = background(spec), frames.numbers(slots)
    corner = np.zeros((1, 2), np.int64)
    selection = np.flatnonzero(frames.shot == 0)
    if count is not None:
        selection = selection[np.linspace(0, selection.size - 1, count).astype(int)]
    for number in selection:
        frame = frames.part(slice(number, number + 1))
        side = int(spec.window + np.abs(frame.blur).max())
        left, top = np.clip(
            np.rint(frame.outlines.middle[0] - side / 2), 0, [spec.sensor.columns, spec.sensor.rows]
        ).astype(np.int64)
        electrons = empty_scene.copy()
        if bat is not None:
            camera.put(bat, bat.angle(frame.shot, frame.time), corner, electrons[None])
        electrons *= np.float32(frame.brightness[0])
        pasted = empty_scene[top : top + side, left : left + side][None]
        if pasted.size:
            window = camera.render(frame, np.array([[left, top]]), pasted, bat)
            electrons[top : top + side, left : left + side] = window[0]
        frame_slot = numbers[number : number + 1]
        grey = camera.sensor.expose(
            electrons[None], corner, draws, f"{name}.whole", frame_slot, spec.clock.exposure
        )
        yield float(frame.stamp[0]), grey[0]


def write_films(stem: Path, frames: Iterable[tuple[float, Frame]], spec: CameraSpec) -> None:
    """Write ``STEM.mp4``, its time stamps in ``STEM.csv``, and a preview in ``STEM.webp``.

    A suffix of `stem` is replaced. `frames` yields time stamp [s] and gray values (row, column) of
    each frame. Raises `InputError` if there are no frames, or if a film cannot be written or
    verified.
    """
    import cv2

    small: list[Frame] = []

    def passing() -> Iterator[tuple[float, Frame]]:
        for stamp, grey in frames:
            rows = round(PREVIEW_WIDTH * grey.shape[0] / grey.shape[1])
            shape, method = (PREVIEW_WIDTH, rows), cv2.INTER_AREA
            small.append(cv2.resize(grey.astype(np.float32), shape, interpolation=method))
            yield stamp, grey

    write_clip(stem.with_suffix(".mp4"), passing(), spec.clock.frame_rate)
    write_preview(stem.with_suffix(".webp"), small, spec.sensor.full_scale)


def write_clip(path: Path, frames: Iterable[tuple[float, Frame]], rate: float) -> None:
    """Write gray frames as a lossless film, FFV1 in MP4, with their time stamps in ``NAME.csv``.

    `path` is the path of the film ``NAME.mp4``. `frames` yields the time stamp [s] and the gray
    values (row, column), of 8 or 16 bits, of each frame. `rate` is the number of frames per second.
    Because video writers can lose frames without an error, the film is read again: its frames are
    counted, and the first frame is compared.

    Raises `InputError` if there are no frames, if FFV1 cannot be written here, or if the film does
    not contain what was written.
    """
    import cv2

    writer = None
    first: Frame | None = None
    stamps: list[float] = []
    try:
        for stamp, grey in frames:
            if writer is None:
                first = grey.copy()
                writer = _writer(path, grey, rate)
            writer.write(grey)
            stamps.append(stamp)
    finally:
        if writer is not None:
            writer.release()
    if first is None:
        raise InputError(str(path), "frames", 0, "a film needs frames")
    reader = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG)
    reader.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    count, same = 0, False
    while True:
        more, grey = reader.read()
        if not more:
            break
        if count == 0:
            same = np.array_equal(np.squeeze(grey), first)
        count += 1
    reader.release()
    if count != len(stamps) or not same:
        raise InputError(str(path), "frames", count, f"{len(stamps)} were written")
    with path.with_suffix(".csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(["time_s"])
        table.writerows([f"{stamp:.9f}"] for stamp in stamps)


def _writer(path: Path, grey: Frame, rate: float) -> Any:
    import cv2

    deep = cv2.CV_16U if grey.dtype == np.uint16 else cv2.CV_8U
    options = [cv2.VIDEOWRITER_PROP_IS_COLOR, 0, cv2.VIDEOWRITER_PROP_DEPTH, deep]
    code = cv2.VideoWriter.fourcc(*"FFV1")
    size = (grey.shape[1], grey.shape[0])
    writer = cv2.VideoWriter(str(path.absolute()), cv2.CAP_FFMPEG, code, rate, size, options)
    if not writer.isOpened():
        raise InputError(str(path), "film", None, "FFV1 in MP4 cannot be written here")
    return writer


def write_preview(path: Path, small: Sequence[Frame], full_scale: float) -> None:
    """Write small frames as an animated WebP in slow motion, 25 frames per second.

    `small` holds the frames, (row, column) each, in gray values up to `full_scale`. The tones are
    square roots of the gray values, scaled so that the brightest pixel of all frames is white.
    Raises `InputError` if there are no frames, or if the file cannot be written.
    """
    import cv2

    animation = cv2.Animation()
    white = min(max((float(each.max()) for each in small), default=1.0), full_scale)
    tones = [255 * np.sqrt(np.clip(each / white, 0, 1)) for each in small]
    pictures = [cv2.cvtColor(tone.astype(np.uint8), cv2.COLOR_GRAY2BGRA) for tone in tones]
    if not pictures:
        raise InputError(str(path), "frames", 0, "a preview needs frames")
    animation.frames = pictures
    animation.durations = [round(1000 / 25.0)] * len(pictures)
    if not cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, 80]):
        raise InputError(str(path), "preview", None, "an animated WebP cannot be written here")
