"""Pages of certificates compared with stored pictures.

``python -m tests.certificate.test_pictures`` makes the pictures again: look at each before it is
kept. Typst sets them with the fonts of its own wheel, so no machine has others.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import typst

from tests.certificate.test_html import case
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.pdf import inputs_of_pdf, source_of_pdf

PICTURES = Path(__file__).with_name("pictures")
DOTS_PER_INCH = 50
CASES = {"pass": "a4", "no valid hit": "letter", "scan with fresh hits": "a4"}
GREY, SHARE = 48, 0.002  # tolerance of a pixel, out of 255; tolerated share of pixels


def pages(name: str) -> list[np.ndarray]:
    """Return the pages of a case in gray, with versions that do not change."""
    document = replace(certificate(case(name)), versions={"virtual-lab": "0"}, date="2026-11-25")
    drawn = typst.compile(
        source_of_pdf(),
        format="png",
        ppi=DOTS_PER_INCH,
        sys_inputs=inputs_of_pdf(document, CASES[name]),
        ignore_system_fonts=True,
    )
    drawn = [drawn] if isinstance(drawn, bytes) else drawn
    return [cv2.imdecode(np.frombuffer(each, np.uint8), cv2.IMREAD_GRAYSCALE) for each in drawn]


def kept(name: str, number: int) -> Path:
    return PICTURES / f"{name.replace(' ', '-')}-{number}.png"


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Return the share of pixels that differ between blurred pages; one more digit is tolerated."""
    assert one.shape == other.shape
    soft = [cv2.GaussianBlur(each, (5, 5), 0).astype(int) for each in (one, other)]
    return float(np.mean(np.abs(soft[0] - soft[1]) > GREY))


@pytest.mark.parametrize("name", CASES)
def test_pages_look_as_they_did(name: str) -> None:
    drawn = pages(name)
    assert kept(name, len(drawn)).exists()
    assert not kept(name, len(drawn) + 1).exists()
    for number, page in enumerate(drawn, start=1):
        picture = cv2.imread(str(kept(name, number)), cv2.IMREAD_GRAYSCALE)
        assert difference(page, picture) < SHARE, number


def test_a_paragraph_gone_is_a_difference() -> None:
    """A strip of some lines has no text."""
    (first, *_) = pages("pass")
    changed = first.copy()
    dark = np.flatnonzero(first.min(axis=1) < 128)
    middle = dark[dark.size // 2]
    changed[middle - 15 : middle + 15] = 255
    assert difference(first, changed) > SHARE


if __name__ == "__main__":
    PICTURES.mkdir(exist_ok=True)
    for old in PICTURES.glob("*.png"):
        old.unlink()
    for name in CASES:
        for number, page in enumerate(pages(name), start=1):
            cv2.imwrite(str(kept(name, number)), page, [cv2.IMWRITE_PNG_COMPRESSION, 9])
