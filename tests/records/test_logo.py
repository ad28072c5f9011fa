"""A logo is a small picture that cannot run or load anything."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from virtual_lab.errors import InputError
from virtual_lab.records.logo import logo_of, picture_in
from virtual_lab.records.particulars import particulars_of, read_particulars


def written(folder: Path, content: bytes, name: str = "logo.png") -> str:
    (folder / name).write_bytes(content)
    return name


def png(height: int = 8, width: int = 12) -> bytes:
    return cv2.imencode(".png", np.full((height, width, 3), 99, np.uint8))[1].tobytes()


def no_points() -> bytes:
    """Return a PNG with a size of 0 × 0 in its header."""
    whole = png()
    return whole[:16] + bytes(8) + whole[24:]


def test_a_logo_of_pixels_is_stored_unchanged(tmp_path: Path) -> None:
    address = logo_of(written(tmp_path, png()), tmp_path, "lab.toml")
    assert picture_in(address) == png()


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("logo.gif", b"GIF89a", "allowed: a .png file"),
        ("logo.svg", b"<svg/>", "a browser saves an SVG as PNG"),
        ("logo.png", b"no picture", "is not a PNG picture"),
        ("logo.png", png()[:40], "is a PNG picture that cannot be read"),
        ("logo.png", png(3000, 3000), "3000 x 3000 pixels"),
        ("logo.png", png() + bytes(200_000), "allowed up to 200000"),
        ("logo.png", no_points(), "0 x 0 pixels"),
        ("../logo.png", png(), "is outside"),
    ],
)
def test_an_unsuitable_picture_is_refused_in_one_line(
    tmp_path: Path, name: str, content: bytes, said: str
) -> None:
    folder = tmp_path / "lab"
    folder.mkdir()
    written(folder, content, name)
    with pytest.raises(InputError, match=f"lab.toml: laboratory.logo = .*{said}") as caught:
        logo_of(name, folder, "lab.toml")
    assert "\n" not in str(caught.value)


def test_a_logo_is_read_beside_the_file_of_particulars(tmp_path: Path) -> None:
    written(tmp_path, png())
    (tmp_path / "lab.toml").write_text('[laboratory]\nname = "L"\nlogo = "logo.png"\n')
    found = read_particulars(tmp_path / "lab.toml")
    assert picture_in(found.laboratory.logo) == png()
    assert particulars_of(found.stated, "session.json") == found
    with pytest.raises(InputError, match="cannot be read"):
        read_particulars({"laboratory": {"logo": "none.png"}})


@pytest.mark.parametrize(
    ("logo", "said"),
    [
        ("logo.png", "must be a PNG picture embedded"),
        ("data:image/gif;base64,R0lG", "must be a PNG picture embedded"),
        ("data:image/png;base64,!", "must be a picture in base64"),
        ("data:image/png;base64,AAAA", "is not a PNG picture"),
    ],
)
def test_a_record_with_another_logo_is_refused(logo: str, said: str) -> None:
    with pytest.raises(InputError, match=f"laboratory.logo.*{said}"):
        particulars_of({"laboratory": {"logo": logo}}, "session.json")
