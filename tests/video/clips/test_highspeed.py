"""Files of high-speed cameras, written here byte by byte."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import open_clip
from virtual_lab.video.clips.reading import open_source

SHAPE = (24, 32)
RNG = np.random.default_rng(4)
FRAMES = [RNG.integers(0, 4000, SHAPE).astype(np.uint16) for _ in range(7)]
SETUP = 84  # offset of the camera's setup [B]
CIHX = """<cih><fileInfo><date>-</date></fileInfo>
<deviceInfo><deviceName>-</deviceName></deviceInfo>
<recordInfo><recordRate>{rate}</recordRate><shutterSpeed>0.0001</shutterSpeed></recordInfo>
<frameInfo><totalFrame>{count}</totalFrame><recordedFrame>{count}</recordedFrame></frameInfo>
<imageDataInfo><resolution><width>32</width><height>24</height></resolution>
<effectiveBit><depth>12</depth><side>Lower</side></effectiveBit>
<colorInfo><bit>{bits}</bit></colorInfo></imageDataInfo>
<imageFileInfo><fileFormat>MRaw</fileFormat></imageFileInfo><basicInfo><comment>-</comment></basicInfo></cih>
"""


def write_cine(
    path: Path, frames: list[NDArray[np.uint16]], rate: float, blocks: bytes = b""
) -> Path:
    """Write 12-bit gray in 16 bits, bottom row first, as in Phantom's format."""
    head = bytearray(11000 + len(blocks))
    head[11000:] = blocks
    offsets = len(head)
    size = frames[0].nbytes
    first = offsets + 8 * len(frames)
    struct.pack_into("<2sHHHiIiI", head, 0, b"CI", 44, 0, 1, 0, len(frames), 0, len(frames))
    struct.pack_into("<III", head, 24, 44, SETUP, offsets)
    struct.pack_into("<IiiHHII", head, 44, 40, SHAPE[1], SHAPE[0], 1, 16, 0, size)
    struct.pack_into("<2sH", head, 224, b"ST", 11000 - SETUP)
    struct.pack_into("<I", head, 980, 12)  # significant bits
    struct.pack_into("<I", head, 1652, 20_000)  # exposure [ns]
    struct.pack_into("<f", head, 10472, 1.0)  # divisor of the stored frames: every frame is kept
    struct.pack_into("<d", head, 10484, rate)
    step = 8 + size
    table = struct.pack(f"<{len(frames)}q", *(first + k * step for k in range(len(frames))))
    images = b"".join(struct.pack("<II", 8, size) + each[::-1].tobytes() for each in frames)
    path.write_bytes(bytes(head) + table + images)
    return path


def write_mraw(path: Path, frames: list[NDArray[np.uint16]], rate: float, bits: int) -> Path:
    text = CIHX.format(rate=rate, count=len(frames), bits=bits)
    path.with_suffix(".cihx").write_text(text)
    data = b""
    for frame in frames:
        flat = frame.ravel()
        if bits == 12:
            one, two = flat[::2].astype(int), flat[1::2].astype(int)
            packed = [one >> 4, ((one & 15) << 4) | (two >> 8), two & 255]
            data += np.stack(packed, axis=1).astype(np.uint8).tobytes()
        else:
            data += flat.astype(np.uint8 if bits == 8 else np.uint16).tobytes()
    path.write_bytes(data)
    return path


def test_a_cine_file_is_read_without_change(tmp_path: Path) -> None:
    source = open_source(write_cine(tmp_path / "a.cine", FRAMES, 12000.0))
    assert (source.declared, source.rate) == (7, 12000.0)
    for (frame, _), true in zip(source.pictures(), FRAMES, strict=True):
        np.testing.assert_array_equal(frame, true)
    clip = open_clip(tmp_path / "a.cine", ClipCalibration())
    assert np.diff(clip.times) == pytest.approx(1 / 12000)


def test_a_cine_file_gives_time_stamps_and_exposure(tmp_path: Path) -> None:
    """Time stamps count 2^-32 s since 1970; the same time as a double would be wrong by 0.2 us."""
    times = np.array([0, 1, 2, 4, 5, 6, 7]) / 12000  # times with one frame missing
    ticks = np.round((times + 0.25) * 2**32).astype("<u8") + (np.uint64(1_700_000_000) << 32)
    blocks = b"".join(
        struct.pack("<IHH", 8 + len(data), kind, 0) + data
        for kind, data in ((1003, bytes(28)), (1002, ticks.tobytes()))
    )
    write_cine(tmp_path / "a.cine", FRAMES, 12000.0, blocks)
    clip = open_clip(tmp_path / "a.cine", ClipCalibration())
    assert clip.times == pytest.approx(times, abs=1e-9)
    assert clip.source.exposure == pytest.approx(20e-6, rel=1e-5)
    assert clip.warnings == ()


@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("suffix", [".mraw", ".cihx"])
def test_an_mraw_file_is_read_without_change(bits: int, suffix: str, tmp_path: Path) -> None:
    frames = [each & 255 if bits == 8 else each for each in FRAMES]
    write_mraw(tmp_path / "a.mraw", frames, 5000.0, bits)
    source = open_source(tmp_path / f"a{suffix}")
    assert (source.declared, source.rate) == (7, 5000.0)
    for (frame, _), true in zip(source.pictures(), frames, strict=True):
        np.testing.assert_array_equal(frame, true)


def test_an_unreadable_file_names_its_format_and_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.cine").write_bytes(b"CI" + bytes(50))
    with pytest.raises(InputError, match=r"\.cine; cannot be read"):
        open_source(tmp_path / "a.cine")
    (tmp_path / "a.mraw").write_bytes(bytes(50))
    with pytest.raises(InputError, match="is not beside it"):
        open_source(tmp_path / "a.mraw")
    cut = write_mraw(tmp_path / "b.mraw", FRAMES, 5000.0, 16)
    cut.write_bytes(cut.read_bytes()[:-100])
    with pytest.raises(InputError, match="frames that can be read = 6"):
        list(open_source(cut).pictures())
    monkeypatch.setitem(sys.modules, "cinereader", None)
    said = (
        r"a\.cine: \.cine needs the extra 'highspeed'; pip install cinereader pymraw, or in a clone"
    )
    with pytest.raises(InputError, match=said):
        open_source(tmp_path / "a.cine")
