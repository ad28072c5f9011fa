"""A logo is a small picture that cannot run or load anything."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from virtual_lab.errors import InputError
from virtual_lab.records.logo import logo_of, picture_in
from virtual_lab.records.particulars import particulars_of, read_particulars

DRAWING = """<?xml version="1.0"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "svg11.dtd">
<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"
  xmlns:ink="urn:editor" viewBox="0 0 20 10" onload="alert(1)" ink:version="1">
  <style>.a { fill: #123 }</style><style>@import url("x.css");</style>
  <script>alert(2)</script><ink:view/><animate attributeName="x"/>
  <defs><linearGradient id="g"><stop offset="0" stop-color="#456"/></linearGradient></defs>
  <rect class="a" width="20" height="10" fill="url(#g)" onclick="alert(3)"/>
  <path d="M0 0L20 10" style="stroke: url('//evil/x')" stroke="black"/>
  <use xlink:href="#g"/><use href="other.svg#g"/><image href="data:image/png;base64,xx"/>
  <a href="javascript:alert(4)"><rect width="1" height="1"/></a>
  <foreignObject><body xmlns="http://www.w3.org/1999/xhtml">html</body></foreignObject>
</svg>"""


def written(folder: Path, content: str | bytes = DRAWING, name: str = "logo.svg") -> str:
    data = content.encode() if isinstance(content, str) else content
    (folder / name).write_bytes(data)
    return name


def drawing(body: str = '<path d="M0 0h9v9"/>', size: str = 'viewBox="0 0 9 9"') -> bytes:
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{body}</svg>'.encode()


def nested(part: str, used: str, depth: int) -> bytes:
    """Return a drawing in which each part uses the previous one ten times: 10^depth squares."""
    body = '<defs><rect id="p0" width="1" height="1"/>'
    for n in range(1, depth + 1):
        inside = "".join(used.format(n - 1) for _ in range(10))
        body += f'<{part} id="p{n}">{inside}</{part}>'
    return drawing(f"{body}</defs>{used.format(depth)}")


def png(height: int = 8, width: int = 12) -> bytes:
    return cv2.imencode(".png", np.full((height, width, 3), 99, np.uint8))[1].tobytes()


def no_points() -> bytes:
    """Return a PNG with a size of 0 × 0 in its header."""
    whole = png()
    return whole[:16] + bytes(8) + whole[24:]


@pytest.mark.parametrize(
    "size", ["", 'width="12.5mm" height="100%"', 'width="+1e2" height=".5in" viewBox="-1,-1, 3 4"']
)
def test_a_drawing_of_a_size_is_kept(tmp_path: Path, size: str) -> None:
    """A drawing of a hundred shapes, each used a hundred times, is kept; styles load nothing."""
    logo_of(written(tmp_path, drawing(size=size)), tmp_path, "lab.toml")
    logo_of(written(tmp_path, nested("g", '<use href="#p{}"/>', 3)), tmp_path, "lab.toml")
    styled = drawing("<style>.a { mask: URL(#p) }</style>")
    _, data = picture_in(logo_of(written(tmp_path, styled), tmp_path, "lab.toml"))
    assert b"style" not in data


def test_a_drawing_keeps_its_shapes_alone(tmp_path: Path) -> None:
    kind, data = picture_in(logo_of(written(tmp_path), tmp_path, "lab.toml"))
    text = data.decode()
    assert kind == "svg"
    for kept in ("<rect", "<path", "fill: #123", "url(#g)", 'stroke="black"', 'href="#g"'):
        assert kept in text
    bad = r"script|alert|import|evil|other|image|javascript|html|<a |animate|on\w+=|urn:|DOCTYPE"
    assert not re.search(bad, text)


def test_a_logo_of_pixels_is_stored_unchanged(tmp_path: Path) -> None:
    address = logo_of(written(tmp_path, png(), "logo.png"), tmp_path, "lab.toml")
    assert picture_in(address) == ("png", png())


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("logo.gif", b"GIF89a", "allowed: a .png or .svg file"),
        ("logo.png", b"no picture", "is not a PNG picture"),
        ("logo.png", png()[:40], "is a PNG picture that cannot be read"),
        ("logo.png", png(3000, 3000), "3000 x 3000 pixels"),
        ("logo.svg", b"<svg", "is not an SVG drawing"),
        ("logo.svg", b"<html/>", "its root element is not <svg>"),
        ("logo.svg", b'<!DOCTYPE s [<!ENTITY a "b">]><svg/>', "declares its own document type"),
        (
            "logo.svg",
            f'<svg xmlns="http://www.w3.org/2000/svg"><path d="{"M0 0" * 60_000}"/></svg>',
            "allowed up to 200000",
        ),
        ("logo.png", no_points(), "0 x 0 pixels"),
        *(
            ("logo.svg", drawing(size=size), "has no valid size")
            for size in (
                'width="0" height="0"',
                'width="NaN" height="5"',
                'width="5" height="-5"',
                'width="0%" height="100%"',
                'width="1e300" height="1"',
                'viewBox="0 0 0 9"',
                'viewBox="0 0 NaN 9"',
                'viewBox="0 0 9"',
            )
        ),
        ("logo.svg", nested("g", '<use href="#p{}"/>', 9), r"has .*e\+09 shapes, allowed up to"),
        ("logo.svg", nested("mask", '<path mask="url(#p{})"/>', 9), r"has .*e\+09 shapes"),
        ("logo.svg", drawing('<g id="a"><use href="#a"/></g>'), "has inf shapes"),
        ("logo.svg", drawing("<g>" * 5000 + "</g>" * 5000), "nested too deeply"),
        ("../logo.svg", b"<svg/>", "is outside"),
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
    written(tmp_path)
    (tmp_path / "lab.toml").write_text('[laboratory]\nname = "L"\nlogo = "logo.svg"\n')
    found = read_particulars(tmp_path / "lab.toml", {})
    assert picture_in(found.laboratory.logo)[0] == "svg"
    assert particulars_of(found.stated, "session.json") == found
    with pytest.raises(InputError, match="cannot be read"):
        read_particulars(tmp_path / "lab.toml", {"laboratory.logo": "none.svg"})


@pytest.mark.parametrize(
    ("logo", "said"),
    [
        ("logo.svg", "must be a picture embedded"),
        ("data:image/gif;base64,R0lG", "must be a picture embedded"),
        ("data:image/png;base64,!", "must be a picture in base64"),
        ("data:image/svg+xml;base64,PHN2Zy8+", "root element"),
        (
            "data:image/svg+xml;base64,PHN2ZyB4bWxucz0iaHR0cDovL3d3dy53My5vcmcvMjAwMC9zdmciIG9ubG9hZD0ieCIvPg==",
            "must not contain scripts",
        ),
    ],
)
def test_a_record_with_another_logo_is_refused(logo: str, said: str) -> None:
    with pytest.raises(InputError, match=f"laboratory.logo.*{said}"):
        particulars_of({"laboratory": {"logo": logo}}, "session.json")
