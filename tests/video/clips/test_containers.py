"""Whole clips in every container give their true times; a clip that was cut short is refused."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from tests.video.clips.test_reading import cut, noise
from virtual_lab.errors import InputError
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import MEMORY, Clip, open_clip
from virtual_lab.video.clips.reading import open_source
from virtual_lab.video.clips.source import Source
from virtual_lab.video.clips.timing import UNREAD, frame_times, usual_step

Stamps = NDArray[np.float64]
ANY, NONE = ClipCalibration(metres_per_pixel=1e-3), ClipCalibration()
CLOCK = 6000  # ticks per second
COUNT = 30
EVEN = np.arange(COUNT) / 60
CHANGING = np.cumsum(np.repeat([1 / 60, 1 / 40], COUNT // 2)) - 1 / 60


def write(
    path: Path,
    stamps: Stamps,
    codec: str = "ffv1",
    *,
    sound: float = 0.0,
    hidden: int = 0,
    colours: str = "yuv420p",
    **options: str,
) -> Path:
    """Write frames, each with its own brightness, and `sound` seconds of silence.

    The first `hidden` frames have time stamps before 0.
    """
    with av.open(str(path), "w", options=options) as file:
        stream = file.add_stream(codec, Fraction(60))
        stream.width, stream.height, stream.pix_fmt = 64, 48, colours
        stream.codec_context.time_base = Fraction(1, 60 if path.suffix == ".avi" else CLOCK)
        stream.codec_context.gop_size, stream.bit_rate = 10, 4_000_000
        clock = stream.codec_context.time_base
        if sound:
            silence = file.add_stream("pcm_s16le", 8000, layout="mono")
        for number, stamp in enumerate(stamps - stamps[hidden]):
            picture = np.full((48, 64, 3), 8 * number % 256, np.uint8)
            frame = av.VideoFrame.from_ndarray(picture, "bgr24").reformat(format=colours)
            frame.pts, frame.time_base = round(stamp / clock), clock
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
        if sound:
            still = np.zeros((1, round(8000 * sound)), np.int16)
            heard = av.AudioFrame.from_ndarray(still, "s16", layout="mono")
            heard.sample_rate, heard.pts = 8000, 0
            file.mux(silence.encode(heard))
            file.mux(silence.encode())
    return path


def numbers_of(clip: Clip) -> list[int]:
    """Return the numbers of a clip's frames, read from their brightness."""
    return [round(float(picture.mean()) / 8) for picture in clip.pictures()]


def trimmed(at: Path) -> Path:
    """Write a clip whose first 12 frames are hidden by an edit list, as a phone's trim does."""
    silent = {"avoid_negative_ts": "disabled"}
    return write(at / "a.mp4", EVEN, "libx264", hidden=12, **silent)


WHOLE: dict[str, tuple[Callable[[Path], Path], Stamps]] = {
    "edit list": (trimmed, EVEN[:-12]),
    "audio longer": (lambda at: write(at / "a.mkv", EVEN, sound=1.0), EVEN),
    "audio far longer": (lambda at: write(at / "a.mkv", EVEN, sound=20.0), EVEN),
    "changing rate, MKV": (lambda at: write(at / "a.mkv", CHANGING), CHANGING),
    "changing rate, MP4": (lambda at: write(at / "a.mp4", CHANGING, "libx264"), CHANGING),
    "changing rate, TS": (lambda at: write(at / "a.ts", CHANGING, "libx264"), CHANGING),
    "changing rate, FLV": (lambda at: write(at / "a.flv", CHANGING, "libx264"), CHANGING),
    # container that fills the time between frames with empty frames
    "skipping AVI": (lambda at: write(at / "a.avi", 2 * EVEN, "mpeg4"), 2 * EVEN),
    "fragments": (lambda at: write(at / "a.mp4", EVEN, "libx264", movflags="frag_keyframe"), EVEN),
    "APNG": (lambda at: write(at / "a.apng", EVEN, "apng", colours="rgb24"), EVEN),
    "GIF": (lambda at: write(at / "a.gif", 1.2 * EVEN, "gif", colours="gray"), 1.2 * EVEN),
}


@pytest.mark.parametrize("kind", WHOLE)
@pytest.mark.parametrize("most_bytes", [MEMORY.most_bytes, 1.0])
def test_whole_clips_are_read_with_their_times(
    kind: str, most_bytes: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Times are right in memory or not, and if the container counts frames that it lacks."""
    monkeypatch.setattr(
        "virtual_lab.video.clips.clip.MEMORY",
        replace(MEMORY, most_bytes=most_bytes, samples=9, least_samples=9),
    )
    make, times = WHOLE[kind]
    clip = open_clip(make(tmp_path), ANY)
    first = 12 if kind == "edit list" else 0
    assert numbers_of(clip) == list(range(first, COUNT))
    rounding = 0.0 if kind in ("edit list", "fragments") else 1e-3
    np.testing.assert_allclose(clip.times, times - times[0], rtol=0, atol=rounding / 2 + 1e-5)
    assert 5 <= len(clip.samples) <= 18
    assert not [each for each in clip.warnings if "stamp" in each]


LATER = np.arange(150) / 60  # times of a clip with fifteen key frames
UNEVEN = np.cumsum(np.repeat([1 / 60, 1 / 15, 1 / 240], 50)) - 1 / 60
SOUGHT: dict[str, Callable[[Path], Path]] = {
    "B-frames": lambda at: write(at / "a.mp4", LATER, "libx264"),
    "B-frames across key frames": lambda at: write(at / "a.mp4", LATER, "libx265"),
    "uneven": lambda at: write(at / "a.mp4", UNEVEN, "libx264"),
    "uneven, TS": lambda at: write(at / "a.ts", UNEVEN, "libx264"),
    "edit list": trimmed,
    "WebM": lambda at: write(at / "a.webm", LATER, "libvpx"),
    "equal time stamps": lambda at: write(at / "a.mkv", LATER / 40),
}


@pytest.mark.parametrize("kind", SOUGHT)
def test_a_frame_of_a_video_is_found_by_its_number(kind: str, tmp_path: Path) -> None:
    """In any order, each is the same as when the clip is read from its start."""
    source = open_source(SOUGHT[kind](tmp_path))
    frames, stamps = zip(*source.pictures(), strict=True)
    assert (len(set(stamps)) < len(stamps)) == (kind == "equal time stamps")
    order = np.random.default_rng(5).permutation(len(frames))[:20]
    for number in (len(frames) - 1, 17, 16, 0, 1, *order):
        np.testing.assert_array_equal(source.frame(number, stamps), frames[number])
        assert number == 0 or np.any(frames[number] != frames[number - 1])


CUT: dict[str, Callable[[Path], Path]] = {
    "index first": lambda at: write(at / "a.mp4", EVEN, "libx264", movflags="faststart"),
    "fragments": lambda at: write(at / "a.mov", EVEN, "libx264", movflags="frag_keyframe"),
    "MKV": lambda at: write(at / "a.mkv", EVEN),
    "MKV with sound": lambda at: write(at / "a.mkv", EVEN, sound=2.0),
    "WebM": lambda at: write(at / "a.webm", EVEN, "libvpx"),
    "AVI": lambda at: write(at / "a.avi", EVEN, "mpeg4"),
    "GIF": lambda at: write(at / "a.gif", EVEN, "gif", colours="gray"),
    "APNG": lambda at: write(at / "a.apng", EVEN, "apng", colours="rgb24"),
}


@pytest.mark.parametrize("kind", CUT)
def test_a_clip_that_was_cut_short_is_refused(kind: str, tmp_path: Path) -> None:
    whole = CUT[kind](tmp_path)
    assert open_clip(whole, ANY).count == COUNT
    with pytest.raises(InputError, match="was it cut short"):
        open_clip(cut(whole, 0.8), ANY)


def test_a_length_beyond_that_of_any_file_is_no_traceback(tmp_path: Path) -> None:
    """A box of MP4 can state 64 bits, more than a file can have or a program can seek."""
    path = tmp_path / "a.mp4"
    for length in (2**62, 2**63, 2**64 - 1):
        path.write_bytes(b"\0\0\0\1moov" + length.to_bytes(8, "big") + bytes(64))
        with pytest.raises(InputError, match="was it cut short"):
            open_clip(path, ANY)


def test_a_colon_in_a_name_is_no_protocol(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("12:30:05.mp4", "data:a.mp4"):
        write(tmp_path / "a.mp4", EVEN, "libx264").rename(name)
        assert open_clip(Path(name), ANY).count == COUNT


def _altered(path: Path, name: bytes, place: int, new: bytes) -> Path:
    """Write other bytes at a place after the first occurrence of a name in a file."""
    data = bytearray(path.read_bytes())
    at = data.index(name) + place
    data[at : at + len(new)] = new
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("rotation", [0, 90])
def test_pixels_that_are_not_square_are_stretched(rotation: int, tmp_path: Path) -> None:
    """The pixels of the stored picture, 64 x 48, are 4:3, also if a player turns the picture."""
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", Fraction(60))
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.sample_aspect_ratio = Fraction(4, 3)
        for _ in range(8):
            file.mux(stream.encode(av.VideoFrame(64, 48, "yuv420p")))
        file.mux(stream.encode())
    if rotation:
        turned = b"".join(n.to_bytes(4, "big", signed=True) for n in (0, 1 << 16, 0, -1 << 16, 0))
        _altered(path, b"tkhd", 44, turned)
    size = next(open_clip(path, ANY).pictures()).shape[:2]
    assert size == ((85, 48) if rotation else (48, 85))


def test_jpegs_are_turned_as_their_exif_says(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # a phone held upright
    for k in range(3):
        Image.new("RGB", (64, 48)).save(tmp_path / f"{k}.jpg", exif=exif)
    assert next(open_source(tmp_path).pictures())[0].shape[:2] == (64, 48)


def test_a_mirrored_clip_is_refused(tmp_path: Path) -> None:
    path = _altered(
        write(tmp_path / "a.mp4", EVEN), b"tkhd", 44, (-1 << 16).to_bytes(4, "big", signed=True)
    )
    with pytest.raises(InputError, match="mirrored"):
        open_clip(path, ANY)


def test_a_codec_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", EVEN, "libx264")
    with pytest.raises(InputError, match="zzz1"):
        open_clip(_altered(path, b"stsd", 16, b"zzz1"), ANY)


def test_a_second_video_track_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as file:
        streams = [file.add_stream("libx264", Fraction(60)) for _ in range(2)]
        for stream in streams:
            stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for stream in streams:
            for _ in range(8):
                file.mux(stream.encode(av.VideoFrame(64, 48, "yuv420p")))
            file.mux(stream.encode())
    assert any("2 video tracks" in each for each in open_clip(path, ANY).warnings)


def test_frames_that_cannot_be_read_are_counted(tmp_path: Path) -> None:
    """A file whose index points to 30 frames of which 12 are zeros; hidden frames do not count."""
    path = write(tmp_path / "a.mp4", EVEN, "mjpeg", colours="yuvj420p")
    data = path.read_bytes()
    start = data.index(b"mdat")
    middle = data.index(b"\xff\xd8", start + int(0.6 * (data.index(b"moov") - start)))
    end = data.index(b"moov") - 4
    path.write_bytes(data[:middle] + bytes(end - middle) + data[end:])
    clip = open_clip(path, ANY)
    assert clip.count < 25
    assert any(f"{clip.count} of 30 {UNREAD}" in each for each in clip.warnings)
    (tmp_path / "b").mkdir()
    assert not any(UNREAD in each for each in open_clip(trimmed(tmp_path / "b"), ANY).warnings)


def test_the_rate_of_the_warning_is_that_of_the_times(tmp_path: Path) -> None:
    clip = open_clip(write(tmp_path / "a.mp4", np.sort(np.r_[EVEN, 0.2501]), "libx264"), NONE)
    assert any(f"{1 / usual_step(clip.times):.6g} per second" in each for each in clip.warnings)


def test_rounded_time_stamps_of_an_even_clip_leave_its_rate(tmp_path: Path) -> None:
    """MKV stores 240 frames per second as steps of 4 and 5 ms, and 4000 as four equal stamps."""
    for rate in (240, 4000):
        path, size = tmp_path / f"{rate}.mkv", (64, 48)
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), rate, size)
        for picture in noise(COUNT, shape=(48, 64, 3)):
            writer.write(picture)
        writer.release()
        np.testing.assert_allclose(open_clip(path, ANY).times, np.arange(COUNT) / rate, rtol=1e-9)


@pytest.mark.parametrize(
    ("stamps", "times"),
    [
        ([0, 1, 2, 2, 4, 5], [0, 1, 2, 3, 4, 5]),
        ([0, 1, 3, 3, 4, 5], [0, 1, 2, 3, 4, 5]),  # stamp of the earlier of two equal ones is wrong
        ([0, 1, 3, 2, 4, 6], [0, 1, 2, 3, 4, 6]),
        ([0, 0, 2, 3, 4, 5], [0, 1, 2, 3, 4, 5]),
        ([0, 1, 2, 3, 4, 4], [0, 1, 2, 3, 4, 5]),
        ([0, 1, 2, 7, 8, 8, 10], [0, 1, 2, 7, 8, 9, 10]),  # gap that stays
    ],
)
def test_a_repeated_time_stamp_spoils_its_frame_alone(stamps: list[int], times: list[int]) -> None:
    at = 0.0503 * np.array(stamps)
    result, warnings = frame_times(_source(len(at)), at, ANY)
    assert "time stamps repeat or decrease" in warnings[-1]
    first = at[2] if stamps[1] == 0 else at[0]
    expected = 0.0503 * np.array(times)
    np.testing.assert_allclose(result - first, expected - (expected[2] if stamps[1] == 0 else 0))


def test_time_stamps_most_of_which_repeat_are_not_used() -> None:
    at = np.array([0, 0, 0, 1, 1, 1, 2, 2, 2, 7.0])
    result, warnings = frame_times(_source(len(at)), at, ANY)
    np.testing.assert_allclose(result, np.arange(10) / 20)
    assert "do not increase" in warnings[-1]


def _source(count: int) -> Source:
    return Source(path=Path("a.mp4"), declared=count, rate=20.0, read=lambda *_: iter(()))


def test_an_animated_webp_is_read_and_needs_a_rate(tmp_path: Path) -> None:
    animation, path = cv2.Animation(), tmp_path / "a.webp"
    animation.frames = [np.full((24, 32, 3), 20 * k, np.uint8) for k in range(10)]
    animation.durations = [20] * 10
    cv2.imwriteanimation(str(path), animation)
    clip = open_clip(path, ClipCalibration(metres_per_pixel=1e-3, frames_per_second=50))
    grey = [float(picture[..., :3].mean()) for picture in clip.pictures()]
    np.testing.assert_allclose(grey, 20 * np.arange(10), atol=4)
    with pytest.raises(InputError, match=r"a still picture\?\); give fps=, or .* calibration="):
        open_clip(path, ANY)


def test_a_png_that_moves_is_a_clip(tmp_path: Path) -> None:
    moving = write(tmp_path / "a.apng", EVEN, "apng", colours="rgb24").rename(tmp_path / "a.png")
    assert numbers_of(open_clip(moving, ANY)) == list(range(COUNT))


@pytest.mark.parametrize(
    "names",
    [
        ["shot-0011", "shot-0002", "shot-0001", "shot00000", "shot00001", "shot00010"],
        ["cam1-10", "cam1-9", "cam10", "cam11", "cam110"],  # name that ends in a digit
        ["s-2", "s-1", "s+0", "s+1", "s+10"],
        ["shot_-10", "shot_-9"],  # frames before the trigger only
        ["-10", "-9", "0", "7"],
        ["shot-9", "shot-10", "shot-11"],  # hyphen between words
        ["2024-01-05-9", "2024-01-05-10"],
        ["shot9", "shot10"],
    ],
)
def test_a_sign_belongs_to_a_number(names: list[str], tmp_path: Path) -> None:
    """Cameras give negative numbers to the pictures before a trigger."""
    (tmp_path / "a").mkdir()
    for number, name in enumerate(names):
        picture = np.full((8, 8), 20 * number, np.uint8)
        cv2.imwrite(str(tmp_path / "a" / f"{name}.png"), picture)
    read = [int(picture[0, 0]) for picture, _ in open_source(tmp_path / "a").pictures()]
    assert read == [20 * number for number in range(len(names))]
