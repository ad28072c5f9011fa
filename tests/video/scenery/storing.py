"""Storage of a clip: the exposures that are stored, the codec, and the orientation."""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from struct import pack

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from tests.video.scenery.scene import Scene

__all__ = ["stored_exposures", "write"]

Picture = NDArray[np.uint8]

SUFFIX = {
    "MJPG": ".avi",
    "mp4v": ".mp4",
    "VP80": ".mkv",
    "FFV1": ".avi",
    "H264": ".mp4",
    "HEVC": ".mp4",
}
PHONE = {"H264": "libx264", "HEVC": "libx265"}
CLOCK = 90_000  # ticks per second in a phone's file
LATE = 0.05  # standard deviation of the time of a phone's next frame [frames]
TURNS = {90: cv2.ROTATE_90_COUNTERCLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_CLOCKWISE}
MATRICES = {90: (0, 1, -1, 0), 180: (-1, 0, 0, -1), 270: (0, -1, 1, 0)}  # matrices for a player
MATRIX_AT = 44  # offset of the matrix from the name of a track's header [B]


def stored_exposures(stored: str, count: int, seed: int) -> NDArray[np.intp]:
    """Return the number of the exposure in each stored frame."""
    every = np.arange(count)
    rng = np.random.default_rng([seed, 77])
    if stored == "all":
        return every
    if stored == "doubled":
        return np.repeat(every, 2)
    if stored == "repeated":
        return np.repeat(every, 1 + (rng.random(count) < 0.3))
    if stored == "thinned":
        return every[every % 6 != 4]
    if stored == "lost":
        return every[rng.random(count) >= 0.08]
    raise ValueError(stored)


def write(
    scene: Scene, pictures: Iterable[Picture], folder: Path, exposures: NDArray[np.intp]
) -> Path:
    """Store all pictures, and return the file (or the folder of PNG files).

    `exposures` are their numbers, by which a phone's time stamps may be set.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if scene.rotation:
        pictures = (cv2.rotate(each, TURNS[scene.rotation]) for each in pictures)
    if scene.jpeg < 100 and scene.codec not in ("MJPG", *PHONE):
        pictures = (_squeezed(each, scene.jpeg) for each in pictures)
    if scene.codec == "PNG":
        path = folder / scene.name
        path.mkdir()
        for number, picture in enumerate(pictures):
            cv2.imwrite(str(path / f"{number:05d}.png"), picture)
        return path
    path = folder / f"{scene.name}{SUFFIX[scene.codec]}"
    wide, high = scene.size if scene.rotation % 180 == 0 else scene.size[::-1]
    rate = scene.file_rate or {"doubled": 2.0, "thinned": 5 / 6}.get(scene.stored, 1.0) * scene.fps
    if scene.codec in PHONE:
        stamps = np.arange(len(exposures)) / rate
        if scene.true_stamps:
            late = LATE * np.random.default_rng([scene.seed, 78]).standard_normal(len(exposures))
            stamps = (exposures - exposures[0] + np.clip(late, -0.2, 0.2)) / scene.fps
        _film(path, scene, pictures, (wide, high), rate, stamps - stamps[0])
        _turn(path, scene.rotation)
        return path
    code = cv2.VideoWriter.fourcc(*scene.codec)
    # OpenCV's MJPG, because FFmpeg's takes no quality
    by = cv2.CAP_OPENCV_MJPEG if scene.codec == "MJPG" else cv2.CAP_FFMPEG
    writer = cv2.VideoWriter(str(path), by, code, rate, (wide, high))
    if scene.codec == "MJPG":
        writer.set(cv2.VIDEOWRITER_PROP_QUALITY, scene.jpeg)
    for picture in pictures:
        writer.write(picture)
    writer.release()
    _turn(path, scene.rotation)
    return path


def _film(
    path: Path,
    scene: Scene,
    pictures: Iterable[Picture],
    size: tuple[int, int],
    rate: float,
    stamps: NDArray[np.float64],
) -> None:
    """Write a phone's file: with B-frames, a key frame per second, and half the color."""
    options = {"crf": str(scene.crf), "preset": "veryfast", "bf": "2", "x265-params": "log-level=0"}
    options["x264-params"] = "asm=AVX2"  # x264 with AVX-512 writes one of several files
    with av.open(str(path), "w") as file:
        stream = file.add_stream(PHONE[scene.codec], Fraction(rate).limit_denominator(1001))
        stream.width, stream.height = size
        stream.pix_fmt, stream.options = "yuv420p", options
        stream.codec_context.time_base = Fraction(1, CLOCK)
        stream.codec_context.gop_size = max(12, round(rate))
        stream.codec_context.thread_count = 1
        for stamp, picture in zip(stamps, pictures, strict=True):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), "bgr24")
            frame.pts, frame.time_base = round(stamp * CLOCK), Fraction(1, CLOCK)
            file.mux(stream.encode(frame))
        file.mux(stream.encode())


def _squeezed(picture: Picture, quality: int) -> Picture:
    _, coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return cv2.imdecode(coded, cv2.IMREAD_COLOR)


def _turn(path: Path, degrees: int) -> None:
    """Write into the track's header the rotation that a player must apply."""
    if not degrees:
        return
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + MATRIX_AT
    a, b, c, d = (value << 16 for value in MATRICES[degrees])
    data[at : at + 36] = pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(data)
