"""The certificate's figures show the document's numbers to scale."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from tests.certificate.drawn import Plot, plots_of
from tests.laboratories import certified
from virtual_lab.certificate.document import CertificateDocument, risk_of
from virtual_lab.certificate.figures import (
    along_figure,
    certificate_figures,
    contact_figure,
    hits_figure,
    rebound_figure,
)
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.printed import printed_budget, printed_values
from virtual_lab.measurement.procedure.judge import Judgement
from virtual_lab.output.svg import Panel, description_of
from virtual_lab.units import INCH, MPH


@pytest.fixture(scope="module")
def document() -> CertificateDocument:
    return certificate(certified(seed=7).certification)


@pytest.fixture(scope="module")
def swung() -> CertificateDocument:
    return certificate(certified(procedure="proposed", seed=7).certification)


@pytest.fixture(scope="module")
def scan() -> CertificateDocument:
    return certificate(certified(procedure="ncaa-besr", seed=7).certification)


def lines(drawing: str) -> Iterator[np.ndarray]:
    """Yield the open paths of a figure as points (point, 2)."""
    for found in re.findall(r'<path d="M([\d. L-]+)" fill="none"', drawing):
        yield np.array([[float(each) for each in point.split()] for point in found.split("L")])


def same_shape(shown: np.ndarray, wanted: np.ndarray) -> None:
    """Return whether two rows of numbers agree up to scale and offset."""
    slope, level = np.polyfit(wanted, shown, 1)
    assert shown == pytest.approx(slope * wanted + level, abs=0.02)


def test_a_scan_has_its_curves_and_means_along_the_barrel(scan: CertificateDocument) -> None:
    """The figure has e_A, e, v_f and the metric; the curves are numpy's fits of the hits."""
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
    valid = [(row.impact_position_in, row.value) for row in scan.shots if not row.reason]
    places, values = np.array(valid).T
    assert along.degree == 5  # the curve for the width of the peak has this degree
    fitted = np.polyval(np.polyfit(places, values, along.degree), along.curve_in)
    assert along.quantities[-1].curve == pytest.approx(fitted, abs=1e-5)
    for row, mean, u in zip(
        scan.places, along.quantities[-1].mean, along.quantities[-1].u, strict=True
    ):
        own = values[np.isclose(places, row.impact_position_in)]
        assert mean == pytest.approx(own.mean())
        assert u == (pytest.approx(own.std(ddof=1) / own.size**0.5) if own.size > 1 else None)
    assert scan.metric.impact_position_in is not None
    read = np.interp(scan.metric.impact_position_in, along.read_in, along.read)
    assert read == pytest.approx(scan.metric.value, abs=2e-3)


@pytest.mark.parametrize("number", [3, 4])
def test_a_curve_along_the_barrel_needs_four_positions(number: int) -> None:
    test = certified(procedure="ncaa-besr", seed=7).certification
    place = test.readings.position
    far = place > np.unique(place[test.judgement.valid])[number - 1]
    reasons = np.where(far, "beyond", test.judgement.reasons).tolist()
    along = certificate(replace(test, judgement=Judgement(reasons=tuple(reasons)))).along
    assert (along is not None) == (number == 4)


def test_batted_speed_along_the_barrel_is_that_at_the_speeds_of_the_rules(
    scan: CertificateDocument,
) -> None:
    """The game of the rules: ball 70 mph, bat 66 mph at 6 in from its tip."""
    assert scan.along is not None
    assert scan.bat.length_m.value is not None
    found = {each.name: np.array(each.mean) for each in scan.along.quantities}
    e_a, place = (
        found["collision_efficiency"],
        np.array([row.impact_position_in for row in scan.places]),
    )
    lever = scan.bat.length_m.value / INCH - 6 - place
    bat = 66 * MPH * lever / (scan.bat.length_m.value / INCH - 12)
    assert found["batted_speed"] == pytest.approx(e_a * 70 * MPH + (1 + e_a) * bat, rel=1e-3)


def test_the_numbers_stand_beside_the_curves(scan: CertificateDocument) -> None:
    shown = printed_values(scan)["along"]
    assert isinstance(shown, dict)
    assert len(shown["rows"]) == len(scan.places)
    assert all(len(row) == 2 + 2 * 4 for row in shown["rows"])


def test_the_contact_sheet_shows_every_shot_to_one_scale(document: CertificateDocument) -> None:
    """The first ring equals that of the encoder's figure, from the same record."""
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


def test_every_figure_has_words_and_no_color(
    document: CertificateDocument, scan: CertificateDocument
) -> None:
    """Every stroke and fill is gray."""
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
def test_an_axis_label_does_not_overlap_its_numbers(least: float) -> None:
    """Numbers end 5 pt from the axis; a sans-serif digit is .556 of its height wide."""
    drawn = Panel(
        left=100, right=200, top=0, bottom=100, x=(0, 1), y=(-least, least), y_label="what"
    ).svg()
    numbers = re.findall(r'text-anchor="end">([^<]+)<', drawn)
    (label,) = re.findall(r'<text x="([\d.]+)"[^>]*rotate', drawn)
    widest = 8 * 0.556 * max(len(words.replace(".", "").replace("−", "")) for words in numbers)
    assert float(label) + 2 < 100 - 5 - widest


# every mark in the units of its axes


def plots(drawing: str | None) -> list[Plot]:
    assert drawing is not None
    return plots_of(drawing)


def stands(plot: Plot, found: Any, wanted: Any) -> None:
    """Return whether marks agree with numbers to a few hundredths of a point of the page."""
    found, wanted = (np.array(each, float).reshape(-1, 2) for each in (found, wanted))
    assert found.shape == wanted.shape
    off = np.abs(found - wanted).max(axis=0, initial=0.0)
    assert (off <= plot.near()).all(), (found, wanted)


def styled(plot: Plot, words: str) -> list[np.ndarray]:
    return [points for style, points in plot.lines if words in style]


SOLID, LIMIT, UPRIGHT, READ = 'width="0.9"', 'width="1.4"', 'dasharray="1 1.6"', 'width="1.8"'


def test_the_hits_stand_where_the_document_has_them(
    document: CertificateDocument, scan: CertificateDocument
) -> None:
    """Shots count from 1; an invalid hit is a cross, an unused hit of a scan is a ring."""
    last = replace(document.shots[-1], reason="x", used=False)
    spoilt = replace(document, shots=(*document.shots[:-1], last))
    (hits, _) = plots(hits_figure(spoilt))
    dots = [(row.shot + 1, row.value) for row in spoilt.shots]
    stands(hits, hits.discs["black"], dots[:-1])
    stands(hits, hits.discs["cross"], dots[-1:])
    (along, _) = plots(hits_figure(scan))
    for fill, used in (("black", True), ("white", False)):
        rows = [row for row in scan.shots if row.used == used and not row.reason]
        stands(along, along.discs[fill], [(row.impact_position_in, row.value) for row in rows])
    assert [*hits.across.values()] == [str(row.shot + 1) for row in document.shots]
    unseen = replace(document.shots[2], value=None)
    gap = replace(document, shots=(*document.shots[:2], unseen, *document.shots[3:]))
    (hits, _) = plots(hits_figure(gap))
    assert len(hits.discs["black"]) == len(document.shots) - 1
    ((x, y, words),) = hits.words
    assert (words.strip(), y) == ("no value", pytest.approx(hits.bottom, abs=0.1))
    assert hits.x(x) == pytest.approx(3.12, abs=0.1)


def test_an_invalid_test_shows_its_hits_against_the_limit(document: CertificateDocument) -> None:
    drawn = hits_figure(replace(document, verdict="INVALID", reasons=("x",), risk=None))
    (hits,) = plots(drawn)
    (limit,) = styled(hits, LIMIT)
    assert limit[:, 1] == pytest.approx(1.2, abs=hits.near()[1])
    assert description_of(drawn).endswith("6 shots, 6 valid; limit 1.200")
    ((x, y, words),) = hits.words
    assert words == "limit 1.200"
    stands(hits, hits.points([(x, y)]), [(hits.x(hits.right), 1.2)])


@pytest.mark.parametrize("dof", [4.0, None])
def test_the_result_figure_shows_students_density_and_the_limit(
    document: CertificateDocument, dof: float | None
) -> None:
    """Interval, value, limit and scipy's density, scaled to its maximum; the risk is filled."""
    value, u = 0.95, 0.01
    half = u * (stats.t.ppf(0.975, dof) if dof else 1.96)
    metric = replace(
        document.metric,
        value=value,
        u=u,
        interval_95=(value - 0.9 * half, value + half),  # intervals by draws may be asymmetric
        dof=dof,
        limit=value + u,
    )
    risk = risk_of(metric, "PASS", eligible=True)
    near = replace(document, metric=metric, risk=risk)
    (hits, against) = plots(hits_figure(near))
    stands(hits, hits.shapes[0][1][:, 1], (value + half, value - 0.9 * half))
    (level,) = styled(hits, SOLID)
    assert level[:, 1] == pytest.approx(value, abs=hits.near()[1])
    ((_, low, high),) = against.whiskers
    rows = [*against.discs["black"], (0.0, low), (0.0, high)]
    assert [row[1] for row in rows] == pytest.approx(
        [value, value - 0.9 * half, value + half], abs=against.near()[1]
    )
    (limit,) = styled(against, LIMIT)
    assert limit[:, 1] == pytest.approx(value + u, abs=against.near()[1])
    (curve,) = styled(against, 'width="0.7"')
    law = stats.t(dof, value, u) if dof else stats.norm(value, u)
    across, heights = curve[:, 0], curve[:, 1]
    assert heights.min() < value - 0.9 * half
    assert heights.max() > value + half
    base = across.max() - np.ptp(across) / (1 - law.pdf(heights).min() / law.pdf(value))
    share = (across - base) / (across.max() - base)
    assert share == pytest.approx(law.pdf(heights) / law.pdf(value), abs=2e-3)
    ((fill, wrong),) = against.shapes
    assert fill == "black"
    assert wrong[:, 1].min() > value + u - against.near()[1]
    assert wrong[:, 1].min() < value + 1.2 * u
    failed = replace(near, verdict="FAIL", risk=risk_of(metric, "FAIL", eligible=True))
    ((_, wrong),) = plots(hits_figure(failed))[1].shapes
    assert wrong[:, 1].max() < value + u + against.near()[1]
    assert plots(hits_figure(document))[1].shapes == []  # result far from its limit


@pytest.mark.parametrize("rules", ["scan", "swung"])
def test_bars_along_the_barrel_are_one_u_to_either_side(
    rules: str, request: pytest.FixtureRequest
) -> None:
    """Curves, means and positions equal the document's, in the unit of each title."""
    scan: CertificateDocument = request.getfixturevalue(rules)
    along = scan.along
    assert along is not None
    places = [row.impact_position_in for row in scan.places]
    drawn = plots(certificate_figures(scan)["along_figure"])
    for plot, each in zip(drawn, along.quantities, strict=True):
        size = MPH if each.name == "batted_speed" else 1.0
        mean, u = np.array(each.mean) / size, np.array([one or 0.0 for one in each.u]) / size
        stands(plot, plot.discs["black"], [*zip(places, mean, strict=True)])
        assert len(plot.whiskers) == len(places)
        x, low, high = np.transpose(plot.whiskers)
        stands(plot, [*zip(x, low, strict=True)], [*zip(places, mean - u, strict=True)])
        stands(plot, [*zip(x, high, strict=True)], [*zip(places, mean + u, strict=True)])
        (curve,) = styled(plot, SOLID)
        stands(plot, curve, np.transpose([along.curve_in, np.array(each.curve) / size]))
        if each.name == scan.metric.name:
            (read,) = styled(plot, READ)
            stands(plot, read, np.transpose([along.read_in, np.array(along.read) / size]))
        else:
            assert styled(plot, READ) == []


def test_the_swing_laws_stand_at_their_exponents(swung: CertificateDocument) -> None:
    """The dotted line is at the exponent that the rules judge by."""
    (plot,) = plots(certificate_figures(swung)["swings_figure"])
    rows = swung.swing_range
    stands(plot, plot.discs["black"], [(row.exponent, row.value / MPH) for row in rows])
    ((_, ribbon),) = plot.shapes
    low, high = ([(row.exponent, row.interval_95[k] / MPH) for row in rows] for k in (0, 1))
    stands(plot, ribbon, [*low, *high[::-1]])
    (judged,) = styled(plot, UPRIGHT)
    exponent = swung.procedure.swing_exponent
    assert judged[:, 0] == pytest.approx(exponent, abs=plot.near()[0])
    (line,) = styled(plot, SOLID)
    stands(plot, line, [(row.exponent, row.value / MPH) for row in rows])


def test_the_bars_of_the_budget_are_the_shares_of_the_words_beside_them(
    document: CertificateDocument,
) -> None:
    drawn = certificate_figures(document)["budget_figure"]
    (plot,) = plots(drawn)
    rows = printed_budget(document)
    heights = sorted(plot.upward)
    assert [plot.upward[height] for height in heights] == [row["words"] for row in rows]
    for height, (_, bar), row in zip(heights, plot.shapes, rows, strict=True):
        ends = bar[:, 0].min(), bar[:, 0].max()
        assert ends == pytest.approx((0, float(row["share"])), abs=plot.near()[0])
        assert bar[:, 1].mean() == pytest.approx(height, abs=0.02)


def test_recoil_and_rebound_stand_against_each_other(document: CertificateDocument) -> None:
    """Both on equal scales, and their difference hit by hit, with its mean ± u."""
    *_, last = (row.shot for row in document.shots if row.rebound_efficiency is not None)
    spoilt = (replace(row, reason="x" if row.shot == last else "") for row in document.shots)
    document = replace(document, shots=tuple(spoilt))
    (both, apart) = plots(rebound_figure(document))
    seen = [
        (row.shot + 1, row.recoil_efficiency, row.rebound_efficiency)
        for row in document.shots
        if row.rebound_efficiency is not None and row.recoil_efficiency is not None
    ]
    stands(both, both.discs["black"], [row[1:] for row in seen[:-1]])
    stands(both, both.discs["cross"], [seen[-1][1:]])
    (equal,) = styled(both, "dasharray")
    assert equal[:, 0] == pytest.approx(equal[:, 1], abs=2 * sum(both.near()))
    gaps = [(shot, after - by) for shot, by, after in seen]
    stands(apart, apart.discs["black"], gaps[:-1])
    stands(apart, apart.discs["cross"], gaps[-1:])
    check = document.rebound_check
    assert check is not None
    assert check.difference is not None
    assert check.u is not None
    ends = check.difference + check.u, check.difference - check.u
    assert apart.shapes[0][1][:, 1] == pytest.approx(ends, abs=apart.near()[1])
    (level,) = styled(apart, "dasharray")
    assert level[:, 1] == pytest.approx(0.0, abs=apart.near()[1])


def test_the_encoder_figure_shows_record_and_fit_over_time(document: CertificateDocument) -> None:
    """Left: record and rotation after contact. Right: ring, with its fit from the dotted line."""
    trace = document.encoder
    assert trace is not None
    (whole, rest) = plots(certificate_figures(document)["encoder_figure"])
    turn, ring = trace.turn, trace.ring
    (record,) = styled(whole, "#999")
    stands(whole, record, np.transpose([turn.time_ms, turn.angle_deg]))
    (fit,) = styled(whole, "dasharray")
    after = [*zip(turn.time_ms, turn.fit_deg, strict=True)]
    stands(whole, fit, [row for row in after if row[0] >= 0])
    stands(rest, rest.discs["#888"], np.transpose([ring.time_ms, ring.angle_deg]))
    (settled,) = styled(rest, UPRIGHT)
    assert settled[:, 0] == pytest.approx(trace.settled_ms, abs=rest.near()[0])
    (fit,) = (points for style, points in rest.lines if style.endswith('width="0.7"'))
    after = [*zip(ring.time_ms, ring.fit_deg, strict=True)]
    stands(rest, fit, [row for row in after if row[0] > trace.settled_ms])


def test_the_contact_sheet_has_its_shots_from_left_to_right(document: CertificateDocument) -> None:
    """Each shot spans 0 to 20 ms and a symmetric range about a line at 0; rejects are marked."""
    first = replace(document.shots[0], reason="x")
    drawn = contact_figure(replace(document, shots=(first, *document.shots[1:])))
    sheet, shown = document.contact_sheet, plots_of(drawn)
    most = max(abs(angle) for each in sheet for angle in each.angle_deg)
    words = [word for plot in shown for *_, word in plot.words]
    numbers = [str(each.shot + 1) for each in sheet]
    assert words == [f"{numbers[0]} (invalid)", *numbers[1:]]
    for plot, each in zip(shown, sheet, strict=True):
        (level,) = styled(plot, 'width="0.3"')
        assert level[:, 1] == pytest.approx((plot.top + plot.bottom) / 2, abs=0.02)
        (record,) = styled(plot, 'width="0.5"')
        time = each.from_ms + each.step_ms * np.arange(len(each.angle_deg))
        x = plot.left + time / 20 * (plot.right - plot.left)
        y = level[0, 1] - np.array(each.angle_deg) / most * (plot.bottom - plot.top) / 2
        assert np.abs(record - np.transpose([x, y])).max() < 0.02


def test_axes_say_what_they_show_and_in_which_unit(
    document: CertificateDocument, scan: CertificateDocument, swung: CertificateDocument
) -> None:
    """Titles and labels appear as often as expected."""
    place, shot = "position from the tip, in", "shot"
    speed = "vf, mph (1 mph = 0.447 m/s)"
    for made, name, labels in (
        (document, "hits_figure", ["hit by hit", shot, "BPF", "against the limit"]),
        (scan, "hits_figure", ["along the barrel", place, "BESR", "against the limit"]),
        (swung, "hits_figure", ["along the barrel", place, speed, "no limit is set"]),
        (scan, "along_figure", ["eA", "e", "vf, mph", "BESR", *[place] * 4]),
        (swung, "along_figure", ["eA", "e", "vf, mph", *[place] * 3]),
        (swung, "swings_figure", ["exponent n of the swing law", speed]),
        (document, "budget_figure", ["share of the variance, %"]),
        (document, "rebound_figure", ["eA from the recoil", "eA from the rebound", shot]),
        (document, "encoder_figure", ["whole record", *["time after contact, ms"] * 2]),
    ):
        drawn = certificate_figures(made)[name]
        assert drawn is not None
        texts = re.findall(r"<text[^>]*>(.*?)</text>", drawn)
        words = [re.sub(r"<[^>]+>|&#8203;", "", text) for text in texts]
        for label in labels:
            assert words.count(label) == labels.count(label), (name, label)


def test_a_legend_has_the_sign_of_what_it_names(
    document: CertificateDocument, swung: CertificateDocument
) -> None:
    """A gray band, a solid line for the result, a cross for an invalid hit, a dotted line for n."""
    last = replace(document.shots[-1], reason="x", used=False)
    spoilt = hits_figure(replace(document, shots=(*document.shots[:-1], last)))
    swings = str(certificate_figures(swung)["swings_figure"])
    for drawn, label, sign in (
        (spoilt, "95 % interval of the mean", 'V3H0Z" fill="#d9d9d9"'),
        (spoilt, "mean", 'd="M0 0H14" stroke="black" stroke-width="0.9"/>'),
        (spoilt, "valid hit", '<circle r="2.4" fill="black"'),
        (spoilt, "invalid hit", '<path d="M-2.4 -2.4L2.4 2.4M-2.4 2.4L2.4 -2.4"'),
        (swings, "n of the verdict", 'stroke-dasharray="1 1.6"'),
        (swings, "95 % interval", 'V3H0Z" fill="#d9d9d9"'),
    ):
        before = drawn[: drawn.index(f">{label}</text>")]
        assert sign in before[before.rindex('<g transform="translate(') - 60 :], label
