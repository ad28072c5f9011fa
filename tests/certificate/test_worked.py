"""Every number of certificate.json, readings.csv and page, computed from the records by hand.

`tests.certificate.worked` shares nothing with the program. Cases: the six procedures, one with
balls set aside and one with a control bat; the records are those that sum.
"""

from __future__ import annotations

import copy
import csv
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.certificate.worked import INCH, MPH, OUNCE, worked
from tests.laboratories import certify
from virtual_lab import catalog
from virtual_lab.api import Certificate
from virtual_lab.certificate.document import read_document
from virtual_lab.certificate.text import certificate_text
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.simulation.instruments import RecordDetail

OF_A_BALL = {"asa": "softball-34"}
SEEDS = {"astm-f1881": 3}  # ball 6 of this laboratory is set aside
CONTROLLED = "bbcor with a control bat"
CASES = [*catalog.names("procedures"), CONTROLLED]


@cache
def folder(case: str) -> Path:
    """Return a saved certificate, made once per process."""
    into = Path(mkdtemp(prefix="worked-"))
    procedure, given = case, {}
    if case == CONTROLLED:
        procedure = str(into / "controlled.toml")
        text = catalog.load("procedures", "bbcor", Procedure).text
        text = text.replace('method = "trampoline"', 'method = "control-bat"')
        Path(procedure).write_text(text)
        given = {"control_bat": "check-cylinder"}
    found = certify(
        OF_A_BALL.get(case, "r161"),
        procedure=procedure,
        seed=SEEDS.get(case, 1),
        detail=RecordDetail.SUMMED,
        **given,
    )
    control = found.control and Certificate(certification=found.control.certification)
    saved = Certificate(certification=found.certification, control=control)
    return saved.save(into / "certificate")


@cache
def document(case: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder(case) / "certificate.json").read_text("utf-8"))
    return found


@cache
def by_hand(case: str) -> dict[str, Any]:
    return worked(folder(case) / "records")


def same(found: Any, expected: Any, where: str, rel: float = 1e-7) -> Iterator[str]:
    """Yield the paths of numbers in the document that differ from those computed by hand."""
    if isinstance(expected, dict):
        for key, value in expected.items():
            yield from same(found[key], value, f"{where}.{key}", rel)
    elif isinstance(expected, list):
        if len(found) != len(expected):
            yield f"{where}: {len(found)} for {len(expected)}"
            return
        for number, value in enumerate(expected):
            yield from same(found[number], value, f"{where}.{number}", rel)
    elif isinstance(expected, str):
        if found != expected:
            yield f"{where}: {found}, worked: {expected}"
    elif expected is None or not np.isfinite(expected):
        if found is not None:
            yield f"{where}: {found}, worked: none"
    elif found is None or not math.isclose(found, expected, rel_tol=rel, abs_tol=1e-13):
        yield f"{where}: {found}, worked: {expected}"


@pytest.mark.parametrize("case", CASES)
def test_every_number_of_the_document_follows_from_the_records(case: str) -> None:
    stated, expected = document(case), by_hand(case)
    plain = (
        "metric",
        "bat",
        "nominal_speed_mph",
        "nominal_bat_speed_mph",
        "v_rel_mph",
        "impact_position_in",
        "swing_range",
        "places",
        "valid_hits",
        "shots",
        "rebound_check",
        "choice",
        "marginal",
    )
    quantities = {
        name
        for name in expected
        if isinstance(expected[name], dict) and set(expected[name]) == {"value", "u"}
    } - {"control", "as_found"}
    wrong = [
        each
        for name in (*plain, *sorted(quantities))
        for each in same(stated[name], expected[name], name)
    ]
    assert wrong == []
    assert quantities <= stated.keys()
    assert list(same(stated["recoil"]["other"], expected["other"], "other")) == []
    assert [each["ball"] for each in stated["ball"]["set_aside"]] == expected["set_aside"]


@pytest.mark.parametrize("case", CASES)
def test_a_corrected_result_is_also_stated_without_correction(case: str) -> None:
    """Only with a correction in force; with its own u, on a line of its own."""
    expected, correction = by_hand(case)["as_found"], document(case)["ball_correction"]
    text = certificate_text(read_document(folder(case) / "certificate.json"))
    lines = [line for line in text.splitlines() if "as found, with these balls" in line]
    page = (folder(case) / "certificate.html").read_text("utf-8")
    assert ("as found, with these balls" in page) == bool(lines) == bool(correction)
    assert bool(correction) == (case in ("bbcor", "proposed", CONTROLLED))
    if correction:
        assert list(same(correction["as_found"], expected, "as_found")) == []
        unit = MPH if case == "proposed" else 1.0
        value, *si, u = re.findall(r"\d+\.\d+", lines[0])
        assert agrees(value, expected["value"] / unit)
        assert agrees(u, expected["u"] / unit)
        assert len(si) == (unit != 1.0)
        assert all(agrees(each, expected["value"]) for each in si)


@pytest.mark.parametrize("case", CASES)
def test_every_line_of_the_budget_follows_from_the_records(case: str) -> None:
    """Contributions agree to 1e-7 of u, because a constant may hardly matter."""
    lines = {line.pop("component"): line for line in copy.deepcopy(document(case)["budget"])}
    expected, u = copy.deepcopy(by_hand(case)["budget"]), by_hand(case)["metric"]["u"]
    assert {name.removeprefix("impact.aim.") for name in lines} == set(expected)
    for name, line in lines.items():
        own = expected[name.removeprefix("impact.aim.")]
        moved = own.pop("sensitivity") * own["u"]
        assert line.pop("sensitivity") * line["u"] == pytest.approx(moved, abs=1e-7 * u)
        assert line.pop("contribution") == pytest.approx(own.pop("contribution"), abs=1e-7 * u)
        assert line.pop("share_percent") == pytest.approx(own.pop("share_percent"), abs=1e-5)
        assert list(same(line, own, name)) == []
    shares = [line["share_percent"] for line in document(case)["budget"]]
    assert shares == sorted(shares, reverse=True)


@pytest.mark.parametrize("case", CASES)
def test_every_rejected_hit_breaks_the_stated_window(case: str) -> None:
    expected, stated = by_hand(case)["reasons"], document(case)["shots"]
    rejected = {hit["shot"]: hit["reason"] for hit in document(case)["rejected_hits"]}
    assert rejected == {shot["shot"]: shot["reason"] for shot in stated if shot["reason"]}
    for shot, (word, number) in zip(stated, expected, strict=True):
        assert word in shot["reason"]
        assert bool(word) == bool(shot["reason"])
        if math.isfinite(number):
            (first, *_) = re.findall(r"(?<![a-z])\d+\.\d+", shot["reason"])
            assert agrees(first, number), shot["reason"]


def test_the_width_of_a_scan_follows_from_the_records() -> None:
    stated, expected = document("bbcor")["width_m"], by_hand("bbcor")["width_m"]
    assert stated["value"] == pytest.approx(expected["value"], rel=1e-5)
    assert stated["u"] == pytest.approx(expected["u"], rel=1e-3)
    assert (stated["from_in"], stated["to_in"]) == pytest.approx(
        (expected["low"] / INCH, expected["high"] / INCH), rel=1e-5
    )
    assert stated["drop"] == 0.01
    assert [case for case in CASES if document(case)["width_m"]] == ["bbcor", CONTROLLED]


def test_the_ratio_of_the_control_bat_is_measured_over_known_e() -> None:
    """The ratio is e of its records over 0.5, by hand; the bat's e is divided by it."""
    own = worked(folder(CONTROLLED) / "control" / "records")["restitution"]
    stated = document(CONTROLLED)["ball_correction"]
    assert (stated["method"], stated["standard"]) == ("control-bat", 0.5)
    assert stated["control"]["value"] == pytest.approx(own["value"] / 0.5, rel=1e-9)
    assert stated["control"]["u"] == pytest.approx(own["u"] / 0.5, rel=1e-7)
    assert "e 0.5" in stated["control"]["source"]


def test_balls_set_aside_are_in_no_mean() -> None:
    """Ball 6 of this laboratory is too lively; the message states its e0 and the limits."""
    (stated,) = document("astm-f1881")["ball"]["set_aside"]
    assert stated["ball"] == 6
    said = r"e0 0\.5\d{3} at 60 mph \(26\.82 m/s\), allowed 0\.525 to 0\.555"
    assert re.fullmatch(said, stated["reason"])


@pytest.mark.parametrize("case", CASES)
def test_every_number_of_the_readings_follows_from_the_records(case: str) -> None:
    with (folder(case) / "readings.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    expected = by_hand(case)["readings"]
    unchecked = {"shot", "reason", "encoder_residual_counts", "swing_residual_counts"}
    assert rows[0].keys() - unchecked == expected.keys()
    for name, column in expected.items():
        for row, value in zip(rows, column, strict=True):
            if isinstance(value, bool | np.bool_):
                assert row[name] == str(bool(value))
            elif np.isfinite(value):
                assert float(row[name]) == pytest.approx(value, rel=1e-7, abs=1e-12), name
            else:
                assert row[name] == ""


@pytest.mark.parametrize("case", CASES)
def test_every_unverified_value_is_the_procedures(case: str) -> None:
    sheet = tomllib.loads((folder(case) / "records" / "procedure.toml").read_text("utf-8"))

    def doubtful(part: dict[str, Any], above: str = "") -> Iterator[tuple[str, str, str]]:
        for key, each in part.items():
            if isinstance(each, dict) and "verified" not in each:
                yield from doubtful(each, f"{above}{key}.")
            elif isinstance(each, dict) and not each["verified"]:
                unit = "" if each["unit"] == "1" else f" {each['unit']}"
                yield f"{above}{key}", f"{each['value']}{unit}", each["source"]

    stated = [(each["key"], each["value"], each["source"]) for each in document(case)["unverified"]]
    assert sorted(stated) == sorted(doubtful(sheet))


# section: the page


def agrees(text: str, value: float) -> bool:
    """Return whether a printed number equals `value` to half of its last digit.

    A speed [mph] is followed by the same in m/s.
    """
    text, _, metric = text.partition(" (")
    if metric and not agrees(metric.rstrip(")"), value * MPH):
        return False
    printed = text.replace("\N{MINUS SIGN}", "-").replace("+", "")
    half = 0.5 * 10.0 ** -len(printed.partition(".")[2])
    return abs(float(printed) - value) <= half * (1 + 1e-6)


def has_two_digits(text: str) -> bool:
    text = text.partition(" (")[0]
    return text == "0" or len(text.replace(".", "").lstrip("0")) == 2 or "." not in text


def cells(row: ElementTree.Element) -> list[str]:
    return [" ".join("".join(cell.itertext()).split()) for cell in row]


@cache
def page(case: str) -> ElementTree.Element:
    return ElementTree.parse(folder(case) / "certificate.html").getroot()


def rows_under(case: str, heading: str) -> list[list[str]]:
    """Return the cells of the table below a heading; [] without a table."""
    below = False
    for each in page(case).iter():
        if each.tag == "h2":
            below = "".join(each.itertext()).startswith(heading)
        if below and each.tag == "table":
            return [cells(row) for part in each if part.tag != "thead" for row in part.iter("tr")]
    return []


def words(case: str) -> str:
    parts = [
        "".join(each.itertext())
        for each in page(case).iter()
        if each.tag in {"p", "caption", "figcaption", "dd"}
    ]
    return " ".join(" ".join(parts).split())


@pytest.mark.parametrize("case", CASES)
def test_the_pages_bat_is_the_documents_in_both_units(case: str) -> None:
    stated, rows = document(case)["bat"], rows_under(case, "The bat as measured")
    units = {
        "Mass": ("mass_kg", "oz", OUNCE, "g", 1e-3),
        "Length": ("length_m", "in", INCH, "mm", 1e-3),
        "Balance point": ("z_cm_m", "in", INCH, "mm", 1e-3),
        "Moment of inertia": ("inertia_cm_kg_m2", "oz in²", OUNCE * INCH**2, "g m²", 1e-3),
    }
    assert {row[0] for row in rows} == units.keys()
    for name, value, u, si, si_u in rows:
        key, unit, size, si_unit, si_size = units[name]
        for shown, shown_u, wanted, by in ((value, u, unit, size), (si, si_u, si_unit, si_size)):
            number, _, ending = shown.partition(" ")
            assert ending == wanted
            assert agrees(number, stated[key]["value"] / by), name
            assert agrees(shown_u, stated[key]["u"] / by), name
            assert has_two_digits(shown_u)


@pytest.mark.parametrize("case", CASES)
def test_the_pages_quantities_are_the_documents(case: str) -> None:
    stated = document(case)
    keys = {
        "Bat performance factor": ("BPF", "bat_performance_factor"),
        "Collision efficiency": ("eA", "collision_efficiency"),
        "Restitution of ball and bat": ("e", "restitution"),
        "Restitution, ball on a wall": ("e0", "ball_restitution"),
        f"Recoil factor, {stated['recoil']['which']} bat": ("r", "recoil_factor"),
    }
    rows = rows_under(case, "Measured quantities")
    assert {keys[row[0]][1] for row in rows} == {key for _, key in keys.values() if key in stated}
    for name, symbol, value, u in rows:
        expected_symbol, key = keys[name]
        assert symbol == expected_symbol
        assert agrees(value, stated[key]["value"])
        assert agrees(u, stated[key]["u"])
        assert has_two_digits(u)


@pytest.mark.parametrize("case", CASES)
def test_the_pages_result_is_the_documents(case: str) -> None:
    stated, text = document(case)["metric"], words(case)
    unit, size = ("", 1.0)
    if stated["name"] == "batted_speed":
        unit, size = (r" mph \(([\d.]+) ± ([\d.]+) m/s\)", MPH)
    value, u = stated["value"] / size, stated["u"] / size
    low, high = (each / size for each in stated["interval_95"])
    (found,) = re.findall(
        rf"= ([\d.]+) ± ([\d.]+){unit} 95 % interval [\d.]+ to [\d.]+.*? "
        r"\(k = ([\d.]+), ν = ([\d.∞]+)\)",
        text,
    )
    expected = [value, high - value, *([value * MPH, (high - value) * MPH] if unit else [])]
    assert all(map(agrees, found, [*expected, (high - value) / u, stated["dof"]]))
    assert has_two_digits(found[1])
    of = r" mph \(([\d.]+) to ([\d.]+) m/s\)" if unit else ""
    (found,) = re.findall(rf"interval ([\d.]+) to ([\d.]+){of}", text)
    assert all(map(agrees, found, (low, high, low * size, high * size)))
    (found,) = re.findall(
        r"Combined type A contributions: ([\d.]+)\. Combined type B contributions: ([\d.]+)\.", text
    )
    assert agrees(found[0], stated["u_type_a"] / size)
    assert agrees(found[1], stated["u_type_b"] / size)
    (limit,) = re.findall(r"Limit of \w+: (none|\d+\.\d+)", text)
    assert limit == "none" if stated["limit"] is None else agrees(limit, stated["limit"] / size)
    assert f"The test has {document(case)['valid_hits']} valid hits" in text


@pytest.mark.parametrize("case", CASES)
def test_the_pages_sentences_have_the_documents_numbers(case: str) -> None:
    stated, text = document(case), words(case)

    def number(pattern: str) -> str:
        (found,) = re.findall(pattern, text)
        return str(found)

    speed = stated["v_rel_mph"]
    assert agrees(
        number(r"Mean relative speed of ball and bat in the valid hits: ([\d.]+) mph"), speed
    )
    assert agrees(number(r"in the valid hits: [\d.]+ mph \(([\d.]+) m/s\)"), speed * MPH)
    assert agrees(number(r"Nominal speed of the ball: ([\d.]+) mph"), stated["nominal_speed_mph"])
    if stated["nominal_bat_speed_mph"]:
        swung = number(r"of the bat 6 in from its tip: ([\d.]+) mph")
        assert agrees(swung, stated["nominal_bat_speed_mph"])
    place = stated["impact_position_in"]
    assert agrees(
        number(r"mpact position(?: of the result)?: ([\d.]+) in \([\d.]+ mm\) from the barrel end"),
        place,
    )
    assert agrees(
        number(r"mpact position(?: of the result)?: [\d.]+ in \(([\d.]+) mm\)"), place * 25.4
    )
    other = stated["recoil"]["other"]
    which = {"free": "pivoted", "pivoted": "free"}[stated["recoil"]["which"]]
    given = (
        rf"recoil factor of a {which} bat, r = (\d\S+), the same eA would give e = (\d\S+) "
        r"and BPF = ([\d.]+)"
    )
    (found,) = re.findall(given, text)
    for shown, key in zip(
        found, ("recoil_factor", "restitution", "bat_performance_factor"), strict=True
    ):
        assert agrees(shown.rstrip(".,"), other[key])
    if stated["choice"]:
        assert agrees(number(r"final hits plus (\d\.\d+)"), stated["choice"]["correction"])
    if stated["ball_correction"] and stated["ball_correction"]["control"]:
        control = stated["ball_correction"]["control"]
        assert agrees(number(r"divided by ([\d.]+) \(u"), control["value"])
        assert agrees(number(r"divided by [\d.]+ \(u = ([\d.]+)\)"), control["u"])
    if stated["width_m"]:
        width = stated["width_m"]
        (found,) = re.findall(
            r"over ([\d.]+) in \(u = ([\d.]+) in\) of the barrel, from ([\d.]+) in to ([\d.]+) in",
            text,
        )
        shown = (width["value"] / INCH, width["u"] / INCH, width["from_in"], width["to_in"])
        assert all(map(agrees, found, shown))
    for each in stated["ball"]["set_aside"]:
        assert f"ball {each['ball'] + 1} set aside: {each['reason']}" in text


@pytest.mark.parametrize("case", CASES)
def test_the_pages_hits_are_the_documents(case: str) -> None:
    stated, rows = document(case), rows_under(case, "Hits")
    size = MPH if stated["metric"]["name"] == "batted_speed" else 1.0
    columns = ["shot"]
    columns += ["impact_position_in"] if stated["places"] else []
    columns += ["speed_mph"]
    columns += ["bat_speed_mph"] if stated["nominal_bat_speed_mph"] else []
    columns += ["recoil_rad_per_s", "recoil_efficiency"] if stated["ring"] else []
    columns += ["rebound_efficiency", "value"]
    assert len(rows) == len(stated["shots"])
    for row, shot in zip(rows, stated["shots"], strict=True):
        assert len(row) == len(columns) + 1
        for shown, key in zip(row, columns, strict=False):
            if key == "shot":
                assert shown == str(shot[key] + 1)  # shots are printed from 1
            elif shot[key] is None:
                assert shown in {"not measured", "–"}
            else:
                assert agrees(shown, shot[key] / (size if key == "value" else 1.0)), key
        assert row[-1] == (f"invalid: {shot['reason']}" if shot["reason"] else "valid")


@pytest.mark.parametrize("case", CASES)
def test_the_pages_means_along_the_barrel_are_the_documents(case: str) -> None:
    """Speeds and their u in both units; a mean of one hit has no u."""
    stated, rows = document(case)["along"], rows_under(case, "Along the barrel")
    assert len(rows) == (len(document(case)["places"]) if stated else 0)
    for number, (_, hits, *shown) in enumerate(rows):
        for each, mean, u in zip(stated["quantities"], shown[::2], shown[1::2], strict=True):
            size = MPH if each["unit"] == "m/s" else 1.0
            assert agrees(mean, each["mean"][number] / size)
            assert (u == "–") == (hits == "1") == (each["u"][number] is None)
            if u != "–":
                assert agrees(u, each["u"][number] / size)
                assert has_two_digits(u)
                places = [len(each.split()[0].partition(".")[2]) for each in (mean, u)]
                assert places[0] == places[1]


@pytest.mark.parametrize("case", CASES)
def test_the_pages_air_is_the_documents(case: str) -> None:
    """0 °C is 273.15 K, a humidity of 1 is 100 %, 1 hPa is 100 Pa; each u has two digits."""
    stated = document(case)
    (air,) = [
        each.text or ""
        for part in page(case).iter("dl")
        for head, each in zip(part.iter("dt"), part.iter("dd"), strict=True)
        if head.text == "Air in the hall"
    ]
    *shown, density = air.split("; ")
    zeros, sizes = (273.15, 0.0, 0.0), (1.0, 0.01, 100.0)
    for line, each, zero, size in zip(shown, stated["conditions"], zeros, sizes, strict=True):
        start, end, u = re.findall(r"[\d.]+", line)
        assert agrees(start, each["at_start"] / size - zero)
        assert agrees(end, each["at_end"] / size - zero)
        assert agrees(u, each["u"] / size)
        assert has_two_digits(u)
        assert {len(part.partition(".")[2]) for part in (start, end)} == {len(u.partition(".")[2])}
    value, u = re.findall(r"\d+\.\d+", density)
    assert agrees(value, stated["air_density_kg_per_m3"]["value"])
    assert agrees(u, stated["air_density_kg_per_m3"]["u"])


@pytest.mark.parametrize("case", CASES)
def test_the_ball_off_a_bat_at_rest_is_a_rebound_and_no_batted_ball(case: str) -> None:
    """Its speed is e_A times that of the ball; `bbcor` defines no game."""
    stated = document(case)
    rules = tomllib.loads((folder(case) / "records" / "procedure.toml").read_text("utf-8"))
    if not stated["along"]:
        return
    at_rest = "game" not in rules and "bat_speed" not in rules
    assert at_rest == (case in {"bbcor", CONTROLLED})
    along = {each["name"]: each for each in stated["along"]["quantities"]}
    assert ("rebound_speed" in along) == at_rest == ("batted_speed" not in along)
    heads = {"".join(each.itertext()) for each in page(case).iter("th")}
    assert ("rebound speedmph (m/s)" in heads) == at_rest == ("vfmph (m/s)" not in heads)
    assert ("rebound speed, mph" in drawing(case, "along")) == at_rest
    if at_rest:
        assert along["rebound_speed"]["unit"] == "m/s"
        back = stated["nominal_speed_mph"] * MPH * np.array(along["collision_efficiency"]["mean"])
        assert along["rebound_speed"]["mean"] == pytest.approx(back)


SIZES = {
    "g": 1e-3, "mm": 1e-3, "mm²": 1e-6, "mm/s²": 1e-3, "ms": 1e-3, "ppm": 1e-6, "mrad": 1e-3,
    "g m²": 1e-3, "g m": 1e-3, "kg/m³": 1.0, "s/m": 1.0, "": 1.0,
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_pages_budget_is_the_documents(case: str) -> None:
    stated, rows = document(case), rows_under(case, "Uncertainty budget")
    size = MPH if stated["metric"]["name"] == "batted_speed" else 1.0
    *lines, others, combined = rows
    shown = [line for line in stated["budget"] if line["share_percent"] >= 1]
    assert len(lines) == len(shown) > 0
    for (_, kind, u, moved, share), line in zip(lines, shown, strict=True):
        number, _, unit = u.partition(" ")
        assert kind == line["evaluation"]
        assert agrees(number, line["u"] / SIZES[unit])
        assert has_two_digits(number)
        assert agrees(moved, line["contribution"] / size)
        assert agrees(share, line["share_percent"])
    small = [line for line in stated["budget"] if line["share_percent"] < 1]
    assert others[0] == f"All others ({len(small)}), each below 1 %"
    assert agrees(others[3], math.sqrt(sum(line["contribution"] ** 2 for line in small)) / size)
    assert agrees(others[4], sum(line["share_percent"] for line in small))
    assert agrees(combined[3], stated["metric"]["u"] / size)


def test_the_pages_check_by_the_rebound_is_the_documents() -> None:
    case = "astm-f1881"
    stated, text = document(case)["rebound_check"], words(case)
    assert stated["shots"] > 1
    pattern = (
        r"rebound in (\d+) of (\d+) valid hits\. For these hits the mean eA is (\d\S+) by the "
        r"rebound of the ball and (\d\S+) by the recoil of the bat\. The difference is "
        r"(\S+?\d+)[,.]"
    )
    ((shots, valid, rebound, recoil, difference),) = re.findall(pattern, text)
    assert (int(shots), int(valid)) == (stated["shots"], document(case)["valid_hits"])
    seen = [each for each in document(case)["shots"] if not each["reason"]]
    seen = [each for each in seen if each["rebound_efficiency"] is not None]
    assert agrees(rebound, np.mean([each["rebound_efficiency"] for each in seen]))
    assert agrees(recoil, np.mean([each["recoil_efficiency"] for each in seen]))
    assert agrees(difference, stated["difference"])
    ((u,),) = [re.findall(r"uncertainty of ([\d.]+) from the scatter", text)]
    assert agrees(u, stated["u"])


def test_the_pages_swing_laws_are_the_documents() -> None:
    rows, stated = rows_under("proposed", "Other swing laws"), document("proposed")["swing_range"]
    assert len(rows) == len(stated) == 6
    for (exponent, value, u, interval, place), row in zip(rows, stated, strict=True):
        assert agrees(exponent, row["exponent"])
        assert agrees(value, row["value"] / MPH)
        assert agrees(u, row["u"] / MPH)
        low, _, high = interval.partition(" to ")
        assert agrees(low, row["interval_95"][0] / MPH)
        assert agrees(high, row["interval_95"][1] / MPH)
        assert agrees(place, row["impact_position_in"])


@pytest.mark.parametrize("case", CASES)
def test_the_text_has_the_documents_numbers(case: str) -> None:
    """For six hits ν is 5 to 20, so t u is not 2 u."""
    stated = document(case)
    text = certificate_text(read_document(folder(case) / "certificate.json"))
    metric = stated["metric"]
    size = MPH if metric["name"] == "batted_speed" else 1.0
    (found,) = re.findall(
        r"^  \S+ +([\d.]+) ± ([\d.]+).* \(u ([\d.]+)\).*95 % interval ([\d.]+) to ([\d.]+).* "
        r"\(k = ([\d.]+)\), (?:no limit|limit ([\d.]+))",
        text,
        re.MULTILINE,
    )
    half = metric["interval_95"][1] - metric["value"]
    expected = [metric["value"], half, metric["u"], *metric["interval_95"]]
    assert all(map(agrees, found, [each / size for each in expected]))
    assert agrees(found[5], half / metric["u"])
    assert found[6] == "" if metric["limit"] is None else agrees(found[6], metric["limit"] / size)
    symbols = {"BPF": "bat_performance_factor", "e_A": "collision_efficiency", "e": "restitution"}
    for symbol, key in (symbols | {"r": "recoil_factor", "e0": "ball_restitution"}).items():
        if key in stated:
            *_, found = re.findall(rf"^  {symbol} +([\d.]+) \(u ([\d.]+)\)", text, re.MULTILINE)
            assert agrees(found[0], stated[key]["value"])
            assert agrees(found[1], stated[key]["u"])
    (parts,) = re.findall(r"^  largest parts of u²: (.*)$", text, re.MULTILINE)
    shares = [line["share_percent"] for line in stated["budget"]]  # largest first
    shown = [share for share in shares if share >= 1]
    shown = [*shown, sum(shares) - sum(shown)][:3]
    found = re.findall(r"([\d.]+) %(?:;|$)", parts)
    assert len(found) == len(shown)
    assert all(map(agrees, found, shown))
    speed = r" +([\d.]+ \([\d.]+\))"
    laws = re.findall(rf"^    ([\d.]+){speed}{speed} +([\d.]+)$", text, re.MULTILINE)
    assert len(laws) == len(stated["swing_range"])
    for shown, row in zip(laws, stated["swing_range"], strict=True):
        numbers = (row["exponent"], row["value"] / MPH, row["u"] / MPH, row["impact_position_in"])
        assert all(map(agrees, shown, numbers))
    width = stated["width_m"]
    found = re.findall(
        r"^  within .* along ([\d.]+) \(u ([\d.]+)\) in of barrel, ([\d.]+) to ([\d.]+) in from",
        text,
        re.MULTILINE,
    )
    assert len(found) == bool(width)
    if width:
        sizes = (width["value"] / INCH, width["u"] / INCH, width["from_in"], width["to_in"])
        assert all(map(agrees, found[0], sizes))
    form = r"at ([\d.]+) mph \(([\d.]+) m/s\), ([\d.]+) in from the tip"
    (found,) = re.findall(form, text)
    speed = stated["v_rel_mph"]
    assert all(map(agrees, found, (speed, speed * MPH, stated["impact_position_in"])))


# section: the figures

SVG = "{http://www.w3.org/2000/svg}"
WORD = r"<text x=\"([\d.]+)\" y=\"([\d.]+)\" text-anchor=\"end\">([\d.−]+)</text>"


def drawing(case: str, name: str) -> str:
    (found,) = [
        each
        for each in page(case).iter(f"{SVG}svg")
        if (each.get("aria-labelledby") or "").startswith(name)
    ]
    return ElementTree.tostring(found, encoding="unicode").replace("ns0:", "").replace("html:", "")


def read_off(drawn: str, left: float) -> Callable[[float], float]:
    """Return the scale from heights to values of a panel, from the ticks at `left`."""
    ticks = [
        (float(y) - 2.8, float(value.replace("−", "-")))
        for x, y, value in re.findall(WORD, drawn)
        if abs(float(x) + 5 - left) < 0.01
    ]
    assert len(ticks) > 1
    heights, values = np.transpose(ticks)
    slope, level = np.polyfit(heights, values, 1)
    return lambda height: float(level + slope * height)


@pytest.mark.parametrize("case", ["astm-f1881", "ncaa-modified", "bbcor"])
def test_the_figure_of_the_hits_shows_interval_result_and_limit_to_scale(case: str) -> None:
    """Marks agree with the ticks to a hundredth of a point."""
    metric, drawn = document(case)["metric"], drawing(case, "hits")
    size = MPH if metric["name"] == "batted_speed" else 1.0
    value, low, high, limit = (
        each / size for each in (metric["value"], *metric["interval_95"], metric["limit"])
    )
    (whisker,) = re.findall(r'd="M([\d.]+) ([\d.]+)V([\d.]+)M[^"]*h8"', drawn)
    lefts = sorted({float(x) + 5 for x, _, _ in re.findall(WORD, drawn)})
    first, second = lefts[0], lefts[-1]
    along, against = read_off(drawn, first), read_off(drawn, second)
    near = 0.02 * abs(against(1.0) - against(0.0))
    assert [against(float(y)) for y in whisker[1:]] == pytest.approx([high, low], abs=near)
    (line,) = re.findall(
        r'd="M[\d.]+ ([\d.]+)L[\d.]+ ([\d.]+)"[^>]*stroke-dasharray="5 2.5"', drawn
    )
    assert [against(float(y)) for y in line] == pytest.approx([limit, limit], abs=near)
    near = 0.02 * abs(along(1.0) - along(0.0))
    band = re.findall(r'd="M[\d.]+ ([\d.]+)H[\d.]+V([\d.]+)H[^"]*Z" fill="#d9d9d9"', drawn)[0]
    assert [along(float(y)) for y in band] == pytest.approx([high, low], abs=near)
    level = re.findall(r'd="M[\d.]+ ([\d.]+)L[\d.]+ ([\d.]+)" fill="none" stroke="black"', drawn)[0]
    assert [along(float(y)) for y in level] == pytest.approx([value, value], abs=near)


def test_the_figure_of_the_swing_laws_shows_values_and_intervals_to_scale() -> None:
    rows, drawn = document("proposed")["swing_range"], drawing("proposed", "swings")
    height = read_off(drawn, 46.0)
    near = 0.02 * abs(height(1.0) - height(0.0))
    (ribbon,) = re.findall(r'd="M([^"HV]+)Z" fill="#d9d9d9"', drawn)
    shown = [height(float(point.split()[1])) for point in ribbon.split("L")]
    low, high = np.transpose([row["interval_95"] for row in rows]) / MPH
    assert shown == pytest.approx([*low, *high[::-1]], abs=near)
    dots = re.findall(r'translate\([\d.]+,([\d.]+)\)"><circle r="1.6"', drawn)[: len(rows)]
    values = [row["value"] / MPH for row in rows]
    assert [height(float(y)) for y in dots] == pytest.approx(values, abs=near)
