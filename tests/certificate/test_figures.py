"""The certificate's figures show the document's numbers to scale."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from tests.laboratories import certified
from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.figures import (
    along_figure,
    budget_figure,
    certificate_figures,
    contact_figure,
    rebound_figure,
)
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.printed import printed_budget, printed_values
from virtual_lab.output.svg import Panel, description_of
from virtual_lab.units import INCH, MPH


@pytest.fixture(scope="module")
def document() -> CertificateDocument:
    return certificate(certified(seed=7).certification)


@pytest.fixture(scope="module")
def scan() -> CertificateDocument:
    return certificate(certified(procedure="ncaa-besr", seed=7).certification)


def lines(drawing: str) -> Iterator[np.ndarray]:
    """Yield the open paths of a figure as points (point, 2)."""
    for found in re.findall(r'<path d="M([\d. L-]+)" fill="none"', drawing):
        yield np.array([[float(each) for each in point.split()] for point in found.split("L")])


def same_shape(shown: np.ndarray, wanted: np.ndarray) -> None:
    """Compare two rows of numbers up to scale and offset."""
    slope, level = np.polyfit(wanted, shown, 1)
    assert shown == pytest.approx(slope * wanted + level, abs=0.02)


def test_a_scan_has_its_curves_and_means_along_the_barrel(scan: CertificateDocument) -> None:
    """e_A, e, v_f and the metric; curves by numpy's own fit of the hits on the certificate."""
    along = scan.along
    assert along is not None
    assert [each.name for each in along.quantities] == [
        "collision_efficiency",
        "restitution",
        "batted_speed",
        "besr",
    ]
    drawn = along_figure(scan)
    curves = [points for points in lines(drawn) if len(points) == len(along.curve_in)]
    for each, points in zip(along.quantities, curves, strict=True):
        same_shape(-points[:, 1], np.array(each.curve))
        same_shape(points[:, 0], np.array(along.curve_in))
    valid = [(row.place_in, row.metric) for row in scan.shots if not row.reason]
    places, values = np.array(valid).T
    fitted = np.polyval(np.polyfit(places, values, along.degree), along.curve_in)
    assert along.quantities[-1].curve == pytest.approx(fitted, abs=1e-5)
    for row, mean, u in zip(
        scan.places, along.quantities[-1].mean, along.quantities[-1].u, strict=True
    ):
        own = values[np.isclose(places, row.place_in)]
        assert mean == pytest.approx(own.mean())
        assert u == (pytest.approx(own.std(ddof=1) / own.size**0.5) if own.size > 1 else None)
    assert scan.metric.place_in is not None
    read = np.interp(scan.metric.place_in, along.read_in, along.read)
    assert read == pytest.approx(scan.metric.value, abs=2e-3)


def test_batted_speed_along_the_barrel_is_that_at_the_speeds_of_the_rules(
    scan: CertificateDocument,
) -> None:
    """The rules' ball at 70 mph, the bat at 66 mph 6 in from its tip, turning about 6 in of it."""
    assert scan.along is not None
    assert scan.bat.length_m.value is not None
    found = {each.name: np.array(each.mean) for each in scan.along.quantities}
    e_a, place = found["collision_efficiency"], np.array([row.place_in for row in scan.places])
    lever = scan.bat.length_m.value / INCH - 6 - place
    bat = 66 * MPH * lever / (scan.bat.length_m.value / INCH - 12)
    assert found["batted_speed"] == pytest.approx(e_a * 70 * MPH + (1 + e_a) * bat, rel=1e-3)


def test_the_numbers_stand_beside_the_curves(scan: CertificateDocument) -> None:
    shown = printed_values(scan)["along"]
    assert isinstance(shown, dict)
    assert len(shown["rows"]) == len(scan.places)
    assert all(len(row) == 2 + 2 * 4 for row in shown["rows"])


def test_the_bars_are_as_long_as_the_shares(document: CertificateDocument) -> None:
    shares = [float(row["share"]) for row in printed_budget(document)]
    bars = re.findall(r'<path d="M([\d.]+) [\d.]+L([\d.]+)', budget_figure(document))
    lengths = np.array([float(end) - float(start) for start, end in bars])
    assert lengths == pytest.approx(lengths[0] * np.array(shares) / shares[0], abs=0.05)


def test_recoil_and_rebound_stand_against_each_other(document: CertificateDocument) -> None:
    both = [
        (row.recoil_efficiency, row.rebound_efficiency)
        for row in document.shots
        if row.rebound_efficiency is not None
    ]
    drawn = rebound_figure(document)
    assert drawn is not None
    found = re.findall(r'translate\(([\d.]+),([\d.]+)\)"><circle r="2"', drawn)
    dots = np.array(found[: len(both)], dtype=float)
    recoil, rebound = np.array(both, dtype=float).T
    same_shape(dots[:, 0], recoil)
    same_shape(-dots[:, 1], rebound)


def test_the_contact_sheet_shows_every_shot_to_one_scale(document: CertificateDocument) -> None:
    """The first is the ring of the encoder's own figure, of the same record."""
    sheet, drawn = document.contact_sheet, contact_figure(document)
    assert [each.shot for each in sheet] == [row.shot for row in document.shots]
    shown = [points for points in lines(drawn) if len(points) == len(sheet[0].angle_deg)]
    heights = np.concatenate([-np.diff(points[:, 1]) for points in shown])
    angles = np.concatenate([np.diff(each.angle_deg) for each in sheet])
    assert heights == pytest.approx(angles * heights[0] / angles[0], abs=0.05)
    trace = document.encoder
    assert trace is not None
    own = sheet[trace.shot]
    time = own.from_ms + own.step_ms * np.arange(len(own.angle_deg))
    ring = np.interp(time, trace.ring.time_ms, trace.ring.angle_deg)
    assert np.std(ring - own.angle_deg) < 0.1 * np.std(ring)


def test_the_part_beyond_the_limit_is_black(document: CertificateDocument) -> None:
    """Of a result near its limit; of one far from it there is none."""
    metric = document.metric
    assert metric.value is not None
    assert metric.u is not None
    near = replace(document, metric=replace(metric, limit=metric.value + metric.u))
    black = 'Z" fill="black"'
    assert black in str(certificate_figures(near)["hits_figure"])
    assert black not in str(certificate_figures(document)["hits_figure"])


def test_every_figure_has_words_and_no_colour(
    document: CertificateDocument, scan: CertificateDocument
) -> None:
    """Readable in grey: every stroke and fill is one."""
    for drawn in (*certificate_figures(document).values(), *certificate_figures(scan).values()):
        if drawn is not None:
            assert len(description_of(drawn)) > 20
            for colour in re.findall(r'(?:fill|stroke)="(#\w+)"', drawn):
                digits = colour.lstrip("#")
                part = len(digits) // 3
                assert len({digits[n * part : (n + 1) * part] for n in range(3)}) == 1


def test_an_invalid_test_has_no_distribution_and_no_budget(
    document: CertificateDocument,
) -> None:
    invalid = replace(document, verdict="INVALID", reasons=("x",), risk=None)
    found = certificate_figures(invalid)
    assert found["budget_figure"] is None
    assert "distribution" not in str(found["hits_figure"])


@pytest.mark.parametrize("least", [1.0, 1e-2, 1e-4])
def test_the_label_of_an_axis_stands_beside_its_numbers(least: float) -> None:
    """Numbers end 5 pt from the axis; a digit of a sans-serif font is .556 of its height wide."""
    drawn = Panel(
        left=100, right=200, top=0, bottom=100, x=(0, 1), y=(-least, least), y_label="what"
    ).drawn()
    numbers = re.findall(r'text-anchor="end">([^<]+)<', drawn)
    (label,) = re.findall(r'<text x="([\d.]+)"[^>]*rotate', drawn)
    widest = 8 * 0.556 * max(len(words.replace(".", "").replace("−", "")) for words in numbers)
    assert float(label) + 2 < 100 - 5 - widest
