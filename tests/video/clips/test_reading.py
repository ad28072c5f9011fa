"""Clips of every kind are read without change; a file that is no clip is refused in one line."""

import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.video.scenes import write_video
from virtual_lab.errors import InputError
from virtual_lab.video.clips.calibration_file import ClipCalibration, read_calibration
from virtual_lab.video.clips.clip import MEMORY, open_clip
from virtual_lab.video.clips.reading import grey_of, open_source, read_pictures
from virtual_lab.video.clips.source import Stamped

Frames = list[NDArray[np.generic]]
FAST = ClipCalibration(metres_per_pixel=1e-3, frames_per_second=5000.0)


def noise(count: int = 12, depth: type = np.uint8, shape: tuple[int, ...] = (40, 64)) -> Frames:
    rng = np.random.default_rng(3)
    most = 255 if depth is np.uint8 else 4095
    return [rng.integers(0, most + 1, shape).astype(depth) for _ in range(count)]


def folder(path: Path, frames: Frames, kind: str = ".png") -> Path:
    path.mkdir()
    for number, frame in enumerate(frames):  # numbers without leading zeros: sorted as people count
        cv2.imwrite(str(path / f"shot_{number}{kind}"), frame)
    return path


def stack(path: Path, frames: Frames) -> Path:
    cv2.imwritemulti(str(path), frames)
    return path


def array(path: Path, frames: Frames) -> Path:
    np.save(path, np.stack(frames))
    return path


WRITERS: dict[str, Callable[[Path, Frames], Path]] = {
    "mp4": lambda at, frames: write_video(at / "a.mp4", frames, 5000),
    "mov": lambda at, frames: write_video(at / "a.MOV", frames, 5000),
    "avi": lambda at, frames: write_video(at / "a.avi", frames, 500),
    "mkv": lambda at, frames: write_video(at / "a.mkv", frames, 5000),
    "png": lambda at, frames: folder(at / "a", frames),
    "tif": lambda at, frames: folder(at / "a", frames, ".tif"),
    "stack": lambda at, frames: stack(at / "a.tiff", frames),
    "npy": lambda at, frames: array(at / "a.npy", frames),
}


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.filterwarnings("ignore")
def test_frames_are_read_without_change(kind: str, depth: type, tmp_path: Path) -> None:
    frames = noise(depth=depth)
    source = open_source(WRITERS[kind](tmp_path, frames))
    read, stamps = zip(*source.pictures(), strict=True)
    np.testing.assert_array_equal(read, frames)
    for number in (7, 0, 11, 10):
        np.testing.assert_array_equal(source.frame(number, stamps), frames[number])


@pytest.mark.parametrize("kind", ["mp4", "png", "stack", "npy"])
def test_color_becomes_gray(kind: str, tmp_path: Path) -> None:
    frames = noise(shape=(40, 64, 3))
    read = [grey_of(frame) for frame, _ in open_source(WRITERS[kind](tmp_path, frames)).pictures()]
    grey = np.stack(frames) @ np.array([0.114, 0.587, 0.299])  # weights of ITU-R BT.601, blue first
    np.testing.assert_allclose(np.stack(read), grey, atol=1.0)


def test_opening_a_clip_gives_times_bits_and_samples(tmp_path: Path) -> None:
    frames = noise(100, np.uint16)
    clip = open_clip(array(tmp_path / "a.npy", frames), FAST)
    assert (clip.count, clip.shape, clip.full_scale) == (100, (40, 64), 4095.0)
    np.testing.assert_allclose(clip.times, np.arange(100) / 5000)
    assert len(clip.samples) <= MEMORY.samples
    np.testing.assert_array_equal(clip.samples, np.stack(frames)[clip.sampled])
    chosen = dict(clip.numbered_frames(np.array([3, 97])))
    assert chosen.keys() == {3, 97}
    np.testing.assert_array_equal(chosen[97], frames[97])
    assert clip.warnings == ()


def spoil_size(at: Path) -> Path:
    path = folder(at / "a", noise(4))
    cv2.imwrite(str(path / "shot_2.png"), noise(1, shape=(41, 64))[0])
    return path


def cut(path: Path, share: float) -> Path:
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    return path


def text(at: Path, name: str) -> Path:
    (at / name).write_text("not a clip " * 50)
    return at / name


def bare(path: Path) -> Path:
    path.mkdir()
    return path


def saved(at: Path, values: NDArray[np.generic]) -> Path:
    np.save(at / "a.npy", values)
    return at / "a.npy"


def cut_image(at: Path) -> Path:
    path = folder(at / "a", noise(3))
    cut(path / "shot_1.png", 0.02)
    return path


BAD: dict[str, tuple[Callable[[Path], Path], str]] = {
    "absent": (lambda at: at / "a.mp4", "no such file"),
    "not a video": (lambda at: text(at, "a.mp4"), "cannot be opened"),
    "not a stack": (lambda at: text(at, "a.tif"), "cannot be read"),
    "not an array": (lambda at: text(at, "a.npy"), "cannot be read as an array"),
    "empty folder": (lambda at: bare(at / "a"), "images = 0"),
    "no pixels": (
        lambda at: array(at / "a.npy", [np.zeros((0, 4, 4), np.uint8)]),
        "at least 8 x 8",
    ),
    "zero frames": (lambda at: saved(at, np.zeros((0, 40, 64), np.uint8)), "frames = 0"),
    "floats": (lambda at: saved(at, np.zeros((3, 40, 64))), "float64"),
    "cut MP4": (lambda at: cut(WRITERS["mp4"](at, noise()), 0.6), "cut short"),
    "cut AVI": (lambda at: cut(WRITERS["avi"](at, noise()), 0.6), "cut short"),
    "cut array": (lambda at: cut(WRITERS["npy"](at, noise()), 0.6), "cut short"),
    "cut image": (cut_image, "cut short"),
    "changing size": (spoil_size, "64 x 41"),
}


@pytest.mark.parametrize("fault", BAD)
def test_a_file_that_is_no_clip_is_refused(fault: str, tmp_path: Path) -> None:
    make, words = BAD[fault]
    with pytest.raises(InputError, match=words):
        open_clip(make(tmp_path), FAST)


def stamped(at: Path, content: str, count: int = 12) -> tuple[Path, ClipCalibration]:
    (at / "stamps.csv").write_text(content)
    (at / "cal.toml").write_text('metres_per_pixel = 1e-3\ntimestamps = "stamps.csv"\n')
    return array(at / "a.npy", noise(count)), read_calibration(at / "cal.toml")


@pytest.mark.parametrize(
    "content",
    ["0\n.1\n.3\n", "0E0\n1e-1\n3e-1\n", "time_s\n0\n.1\n.3\n", "frame,time_s\n0,0\n1,.1\n2,.3\n"],
)
def test_a_file_of_time_stamps_sets_the_times(content: str, tmp_path: Path) -> None:
    clip = open_clip(*stamped(tmp_path, content, count=3))
    np.testing.assert_array_equal(clip.times, [0, 0.1, 0.3])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("0\n.1\n", "time stamps = 2; the clip has 3"),
        ("0\n.1\n.2\n.3\n", "time stamps = 4; the clip has 3"),
        (
            "0\n.2\n.1\n",
            "time stamp 2 = 0.1; must be at least 1e-08 s later than the one before, 0.2",
        ),
        ("0\n.1\n.1\n", "time stamp 2"),
        ("0\nnan\n.2\n", "row 2: time_s = 'nan'; expected a number"),
        ("time_s\n0\n.1\ninf\n", "row 4: time_s = 'inf'; expected a number"),
        ("0\nx\n.2\n", "row 2: time_s = 'x'"),
        ("", "the file is empty"),
        ("frame,stamp\n0,0\n1,.1\n2,.2\n", "columns = 'frame, stamp'; needs 'time_s'"),
        ("0,.0\n1,.1\n2,.2\n", "needs 'time_s'"),
    ],
)
def test_bad_time_stamps_are_refused(content: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        open_clip(*stamped(tmp_path, content, count=3))


def test_missing_time_stamps_are_named(tmp_path: Path) -> None:
    path, calibration = stamped(tmp_path, "0\n", count=3)
    (tmp_path / "stamps.csv").unlink()
    with pytest.raises(InputError, match=r"stamps\.csv"):
        open_clip(path, calibration)
    with pytest.raises(InputError, match="frames_per_second"):
        open_clip(path, ClipCalibration(metres_per_pixel=1e-3))


def test_unreliable_rates_and_containers_give_a_warning(tmp_path: Path) -> None:
    """AVI at 10 kfps keeps 9 of 24 frames, MKV has steps of 1 ms, and slow motion plays at 30."""
    frames = noise()
    assert "AVI files lose" in " ".join(open_clip(WRITERS["avi"](tmp_path, frames), FAST).warnings)
    assert "1 ms" in " ".join(open_clip(WRITERS["mkv"](tmp_path, frames), FAST).warnings)
    slow = open_clip(write_video(tmp_path / "b.mp4", frames, 30), FAST)
    assert "30 frames per second; the stated rate of 5000 is used" in " ".join(slow.warnings)
    np.testing.assert_allclose(np.diff(slow.times), 1 / 5000)
    alone = ClipCalibration(metres_per_pixel=1e-3)
    by_file = open_clip(write_video(tmp_path / "b.mp4", frames, 240), alone)
    assert "file's own" in " ".join(by_file.warnings)
    np.testing.assert_allclose(np.diff(by_file.times), 1 / 240, rtol=1e-6)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("metres_per_pixel = 0.001\nfps = 3", "fps; unknown key"),
        ("metres_per_pixel = -1.0", "metres_per_pixel = -1.0"),
        ("frames_per_second = 5000", "the scale is unknown"),
        (
            "ball_diameter_m = 0.07\nframes_per_second = 1e3\nexposure_s = 0.1",
            "longer than the frame",
        ),
        (
            "ball_diameter_m = 0.07\n[camera]\nimage_size = [4, 3]",
            "camera.translation_m; these keys are m",
        ),
    ],
)
def test_bad_calibration_files_are_refused(content: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "cal.toml").write_text(content)
    with pytest.raises(InputError, match=words):
        read_calibration(tmp_path / "cal.toml")


def test_another_cameras_calibration_is_refused(tmp_path: Path) -> None:
    camera = (
        "frames_per_second = 5000\n[camera]\nimage_size = [1280, 800]\n"
        "matrix = [[1800.0, 0.0, 640.0], [0.0, 1800.0, 400.0], [0.0, 0.0, 1.0]]\n"
        "distortion = [0.0, 0.0, 0.0, 0.0]\n"
        "rotation = [0.0, 0.0, 0.0]\ntranslation_m = [0.0, 0.0, 2.0]\n"
    )
    (tmp_path / "cal.toml").write_text(camera)
    calibration = read_calibration(tmp_path / "cal.toml")
    with pytest.raises(InputError, match="another camera's"):
        open_clip(array(tmp_path / "a.npy", noise()), calibration)


def test_given_keys_replace_those_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "cal.toml"
    path.write_text("ball_diameter_m = 0.07\nframes_per_second = 240\nexposure_s = 4e-3\n")
    other = read_calibration(path, {"ball_diameter_m": 0.073, "frames_per_second": 120.0})
    assert (other.ball_diameter_m, other.frames_per_second) == (0.073, 120)
    assert other.exposure_s == 4e-3
    with pytest.raises(InputError, match=r"cal.toml.*longer than the frame interval"):
        read_calibration(path, {"frames_per_second": 480.0})
    with pytest.raises(InputError, match="the scale is unknown"):
        read_calibration(None)


def test_motion_jpeg_shows_what_ffmpeg_shows(tmp_path: Path) -> None:
    """Frames and times agree with FFmpeg's; other frames are skipped, a broken one is named."""
    path, size = tmp_path / "a.avi", (64, 48)
    writer = cv2.VideoWriter(
        str(path), cv2.CAP_OPENCV_MJPEG, cv2.VideoWriter.fourcc(*"MJPG"), 50, size
    )
    ramp = np.add.outer(np.arange(size[1]), np.arange(size[0])).astype(np.uint8)
    for k in range(12):
        writer.write(np.stack([ramp + 8 * k, ramp, 255 - ramp], axis=-1))
    writer.release()
    source, theirs = open_source(path), cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    frames, stamps = zip(*source.pictures(), strict=True)
    np.testing.assert_allclose(stamps, np.arange(12) / 50)
    for frame in frames:
        assert np.abs(frame.astype(float) - theirs.read()[1]).mean() < 2
    assert not theirs.grab()
    assert [
        k for k, (frame, _) in enumerate(source.read(lambda k: k % 5 == 0, 0)) if frame is not None
    ] == [0, 5, 10]
    content = bytearray(path.read_bytes())
    at = [match.start() for match in re.finditer(b"\xff\xd8\xff", bytes(content))][7]
    content[at : at + 40] = bytes(40)
    path.write_bytes(content)
    with pytest.raises(InputError, match="frame 7; cannot be decoded"):
        list(open_source(path).pictures())


def test_a_clip_that_fits_in_memory_is_decoded_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A small clip stays readable without its file, a medium one until release, a large one not."""
    path = tmp_path / "clip.npy"
    frames = np.arange(30 * 8 * 9).astype(np.uint8).reshape(30, 8, 9)
    size = frames.nbytes
    for whole, sampled, there, later in (
        (size, size, True, True),
        (size, size - 1, True, False),
        (size - 1, size - 1, False, False),
    ):
        small = replace(MEMORY, most_bytes=whole, most_sampled=sampled)
        monkeypatch.setattr("virtual_lab.video.clips.clip.MEMORY", small)
        np.save(path, frames)
        clip = open_clip(path, FAST)
        path.unlink()
        for each, stays in ((clip, there), (clip.trim_memory(), later)):
            if stays:
                np.testing.assert_array_equal(np.stack(list(each.pictures())), frames)
                assert [number for number, _ in each.numbered_frames(np.array([7, 3]))] == [3, 7]
            else:
                with pytest.raises(FileNotFoundError):
                    list(each.pictures())


def test_chosen_frames_alone_are_decoded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "virtual_lab.video.clips.clip.MEMORY", replace(MEMORY, most_bytes=1, most_sampled=1)
    )
    clip, decoded = open_clip(np.stack(noise(40)), FAST), []
    source = clip.source

    def read(wanted: Callable[[int], bool], start: int) -> Stamped:
        for number, (frame, stamp) in enumerate(source.read(wanted, start)):
            decoded.append(number) if wanted(number) else None
            yield frame, stamp

    clip = replace(clip, source=replace(source, read=read))
    assert [number for number, _ in clip.numbered_frames(np.array([31, 4, 9]))] == [4, 9, 31]
    assert decoded == [4, 9, 31]


def test_a_file_without_a_frame_count_is_sampled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """If the header holds no count, evenly spaced frames are kept as samples."""
    source = replace(open_source(np.zeros((100, 8, 9), np.uint8)), declared=0)
    monkeypatch.setattr("virtual_lab.video.clips.clip.open_source", lambda _: source)
    monkeypatch.setattr(
        "virtual_lab.video.clips.clip.MEMORY",
        replace(MEMORY, most_bytes=10 * 8 * 9, most_sampled=10 * 8 * 9),
    )
    clip = open_clip(Path("made"), FAST)
    assert clip.count == 100
    np.testing.assert_array_equal(clip.sampled, np.arange(0, 100, 8))
    assert len(clip.samples) == 13


def bomb(path: Path, wide: int, high: int) -> Path:
    """Write a picture of 11 x 9 pixels (TIFF: two pages) whose last header states another size."""
    page = np.zeros((9, 11), np.uint8)
    cv2.imwritemulti(str(path), [page] * 2) if path.suffix == ".tif" else cv2.imwrite(
        str(path), page
    )
    content = bytearray(path.read_bytes())
    if path.suffix == ".png":
        struct.pack_into(">II", content, 16, wide, high)
        struct.pack_into(">I", content, 29, zlib.crc32(content[12:29]))
    elif path.suffix == ".tif":
        for tag, old, new in ((256, 11, wide), (257, 9, high)):
            entry = struct.pack("<HHII", tag, 3, 1, old)
            struct.pack_into("<HHII", content, content.rindex(entry), tag, 3, 1, new)
    elif path.suffix == ".jpg":
        struct.pack_into(">HH", content, content.index(b"\xff\xc0") + 5, high, wide)
    else:
        struct.pack_into("<ii", content, 18, wide, -high)
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("side", [9_000, 31_000])
@pytest.mark.parametrize("kind", [".png", ".tif", ".jpg", ".bmp"])
def test_a_picture_too_large_is_refused_by_its_header(kind: str, side: int, tmp_path: Path) -> None:
    """Eight files of some kilobytes declare up to 7.2 GiB of pixels; none is decoded."""
    (tmp_path / "shots").mkdir()
    for k in range(8):
        bomb(tmp_path / "shots" / f"{k}{kind}", side, side)
    said = "size.*allowed: up to 50 million pixels in a picture"
    with pytest.raises(InputError, match=said):
        open_source(tmp_path / "shots")
    with pytest.raises(InputError, match=said):
        next(read_pictures([tmp_path / "shots" / f"3{kind}"]))


def test_litter_among_pictures_is_ignored_and_named(tmp_path: Path) -> None:
    """A file ._0.png of macOS has the ending of a picture, and is none."""
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((9, 11), number, np.uint8))
    for name in ("._0.png", ".DS_Store"):
        (tmp_path / name).write_bytes(b"litter")
    clip = open_clip(tmp_path, ClipCalibration(frames_per_second=100.0))
    assert clip.count == 3
    assert clip.warnings == ("ignored: .DS_Store, ._0.png",)


def test_a_stack_with_a_page_too_large_is_refused_by_its_header(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="size = '9000 x 9000'"):
        open_source(bomb(tmp_path / "stack.tif", 9_000, 9_000))


def test_an_array_file_of_pictures_too_large_is_refused_by_its_header(tmp_path: Path) -> None:
    np.lib.format.open_memmap(tmp_path / "a.npy", "w+", np.uint8, (2, 9000, 9000))
    with pytest.raises(InputError, match="size = '9000 x 9000'"):
        open_source(tmp_path / "a.npy")
