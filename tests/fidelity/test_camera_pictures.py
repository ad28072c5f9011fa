"""The pictures on which estimators are compared, and the benchmark at a small scale."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from tests.video.spectrum import disc
from virtual_lab.fidelity.camera_errors import score_positions
from virtual_lab.fidelity.camera_estimators import CV2, EDGE, OURS
from virtual_lab.fidelity.camera_pictures import CASE, pictures
from virtual_lab.fidelity.camera_scenes import FULL_SCALE, Case

FEW = Case(phases=4, repeats=10)


@pytest.mark.parametrize("light", ["even", "back"])
def test_a_quiet_picture_is_the_exact_one(light: Literal["even", "back"]) -> None:
    """The oracle is the disk's spectrum, for two positions of the ball on a sloped background."""
    case = Case(radius=15, blur=6, slope=0.2, light=light, quiet=True, phases=2, repeats=1)
    batch, size = pictures(case), 128
    ball, level = case.levels
    behind = level + 0.2 * (np.arange(case.side) - (case.side - 1) / 2)
    for k in range(2):
        x, y = batch.x[k], batch.y[k]
        x, y = np.array([x, y]) - batch.inputs.regions.corners[k]
        off = (size - case.side) // 2
        inside = slice(off, off + case.side)
        m = disc(size, x + off, y + off, 15, CASE.lens, case.shift)[inside, inside]
        exact = behind * (1 - m) + ball * m
        assert np.abs(batch.inputs.regions.pixels[k] - exact).max() < 1e-3 * 150


def test_the_noise_gives_the_requested_contrast() -> None:
    """Contrast over the standard deviation halfway up the edge; bound of 4 standard errors."""
    for snr in (96.0, 27.0, 5.0):
        case = Case(snr=snr, phases=1, repeats=20)
        ball, level = case.levels
        pixels = pictures(case).inputs.regions.pixels.astype(float)
        middle = int((case.side - 1) / 2)
        core = pixels[:, middle - 10 : middle + 10, middle - 10 : middle + 10]
        noise, size = case.noise, core.size
        expected = noise.gain * ball + noise.read
        assert core.var() == pytest.approx(expected, rel=4 * np.sqrt(2 / size))
        half = np.sqrt(noise.gain * (ball + level) / 2 + noise.read)
        assert (ball - level) / half == pytest.approx(snr, rel=0.02)


def test_blocks_differ_and_are_reproducible() -> None:
    first, again, other = pictures(FEW), pictures(FEW), pictures(FEW, block=1)
    assert np.array_equal(first.inputs.regions.pixels, again.inputs.regions.pixels)
    assert not np.array_equal(first.inputs.regions.pixels, other.inputs.regions.pixels)
    assert not np.array_equal(first.x, other.x)


def test_the_frame_and_the_bat_hide_a_part_of_the_ball() -> None:
    """The frame's edge and the bat each hide a quarter of the diameter."""
    gone = pictures(replace(FEW, cut=0.25)).inputs
    side = gone.regions.pixels.shape[2]
    right = gone.regions.corners[:, 0] + side - 1
    assert (right == CASE.frame[1] - 1).all()
    away = right + 0.5 - pictures(replace(FEW, cut=0.25)).x
    assert away == pytest.approx(np.full(away.size, 15.0), abs=1.0)
    behind = pictures(replace(FEW, covered=0.25)).inputs
    assert abs(behind.regions.pixels[..., -5:].mean() - CASE.bat) < 0.5
    hot = pictures(replace(FEW, hot=50)).inputs.regions.pixels
    assert 30 < (hot == FULL_SCALE).sum(axis=(1, 2)).mean() <= 50


@pytest.mark.parametrize(
    "case",
    [
        Case(phases=4, repeats=10),
        Case(phases=4, slope=0.5, repeats=10),
        Case(radius=15, blur=6, snr=27, slope=0.5, phases=4, repeats=10),
        Case(radius=15, blur=20, snr=27, phases=4, repeats=10),
    ],
)
def test_the_edge_fit_is_near_the_limit(case: Case) -> None:
    """The errors are within about twice the limit of a plain ball of unknown brightness."""
    batch = pictures(case)
    score = score_positions(batch, OURS[EDGE](batch.inputs))
    assert 0.8 < score.rms / batch.limit < 2.2
    assert (score.lost, score.flagged, score.unsaid) == (0, 0, 0)


def test_hidden_balls_are_flagged() -> None:
    for case in (replace(FEW, cut=0.25), replace(FEW, covered=0.25)):
        batch = pictures(case)
        assert score_positions(batch, OURS[EDGE](batch.inputs)).flagged == 1


def test_estimators_of_opencv_have_their_known_errors() -> None:
    """Errors are within a factor of two of those measured beforehand [px]."""
    batch = pictures(Case(phases=4, repeats=5))
    planned = {
        "contour moments": 0.026,
        "convex hull": 0.026,
        "fitEllipse": 0.026,
        "minEnclosingCircle": 0.026,
        "matte moments": 0.0037,
        "phaseCorrelate": 0.10,
        "matchTemplate, parabola": 0.0060,
        "ECC on the matte": 0.0020,
        "HoughCircles": 0.30,
    }
    assert planned.keys() == CV2.keys()
    for name, usual in planned.items():
        score = score_positions(batch, CV2[name](batch.inputs))
        assert usual / 2 < score.rms < 2 * usual, name
        assert score.lost == 0
