"""A fitted bat as a file: it has the measured values, and states what was not measured."""

import json
import re
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import virtual_lab
from tests.pictures import lines_of
from virtual_lab.catalog import load, load_bat
from virtual_lab.catalog.specs import NO_SPREAD
from virtual_lab.errors import InputError
from virtual_lab.files import parse_toml
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.studies.bats.bat_templates import TEMPLATES, BatMeasurements
from virtual_lab.studies.bats.fit_bat import FittedBat, _quantities, fit_bat, remark_on
from virtual_lab.studies.template import template
from virtual_lab.units import INCH, OUNCE, OZ_IN2

MEASURED = """
name = "mine"
title = "Mine \\"A\\""
template = "wood"
sport = "softball"
construction = "one-piece wood"
length = { value = 34, unit = "in", source = "rule", verified = true }
mass = { value = 31, unit = "oz", source = "scale", verified = true }
z_cm = { value = 11.3, unit = "in", source = "stand", verified = true }
inertia = { value = 17137, unit = "oz in^2", source = "pendulum", verified = true }
inertia_axis = { value = 33, unit = "in", source = "pendulum", verified = true }
"""
FREQUENCIES = """
bending_frequencies = { value = [164, 551], unit = "Hz", source = "tap", verified = true }
"""


def test_the_help_names_every_key() -> None:
    keys = {each.name.removesuffix("_u") for each in fields(BatMeasurements)}
    assert [key for key in keys if f"``{key}``" not in (fit_bat.__doc__ or "")] == []


def fill(form: str, numbers: Mapping[str, Any]) -> str:
    """Return a form with values in the lines of the keys of `numbers`, without their # signs."""
    for key, value in numbers.items():
        line = rf'(?m)^(?:# )?({key} = (?:\{{ value = )?)(?:\["\?", "\?"\]|".*?")'
        form, count = re.subn(line, rf"\g<1>{json.dumps(value)}", form)
        assert count == 1, key
    return form


@pytest.fixture
def form(tmp_path: Path) -> Path:
    return template("measurements", tmp_path / "form.toml")


def test_the_form_filled_in_with_the_numbers_of_the_page_is_fitted(form: Path) -> None:
    page = (Path(virtual_lab.__file__).parent / "docs" / "a-bat.md").read_text("utf-8")
    filled_in = page.partition("measured.toml <<'END'\n")[2].partition("END\n")[0]
    numbers = {
        key: each["value"] if isinstance(each, dict) else each
        for key, each in parse_toml(filled_in, "a-bat.md").items()
    }
    form.write_text(fill(form.read_text("utf-8"), numbers), "utf-8")
    fitted = fit_bat(form, members=2)
    measured = fitted.measured
    assert (measured.name, measured.template, measured.sport) == ("mybat", "wood", "baseball")
    found = (measured.length, measured.z_cm, measured.inertia_axis, measured.mass, measured.mass_u)
    expected = (33 * INCH, 10.9 * INCH, 27 * INCH, 30 * OUNCE, 0.02 * OUNCE)
    assert found == pytest.approx(expected)
    assert measured.inertia == pytest.approx(9900 * OZ_IN2)
    assert measured.bending_frequencies == (172, 575)
    assert fitted.members == 2


def test_each_line_of_the_form_can_be_used(form: Path) -> None:
    """Each number of a hollow bat, with its u, in the unit of the form."""
    numbers: dict[str, Any] = {
        "length": 33,
        "mass": 30,
        "z_cm": 13,
        "inertia": 9900,
        "inertia_axis": 27,
        "bending_frequencies": [200, 680],
        "barrel_nodes": [7, 5],
        "hoop_frequency": 1800,
        "hoop_modal_mass": 80,
    }
    us = {f"{key}_u": [0.1, 0.1] if isinstance(x, list) else 0.1 for key, x in numbers.items()}
    words = {"template": "hollow", "sport": "softball", "construction": "aluminum"}
    text = fill(form.read_text("utf-8"), numbers | us | words)
    form.write_text(text, "utf-8")
    assert parse_toml(text, "form").keys() == {each.name for each in fields(BatMeasurements)}
    measured = load("bats", str(form), BatMeasurements).spec
    assert measured.hoop_modal_mass == pytest.approx(0.080)
    assert measured.barrel_nodes_u == pytest.approx((0.1 * INCH, 0.1 * INCH))


def test_an_empty_form_is_refused_with_its_open_keys(form: Path) -> None:
    form.write_text(form.read_text("utf-8").replace('template = "?"', 'template = "wood"'))
    with pytest.raises(InputError, match=r"length, mass, z_cm, inertia, inertia_axis; .*quotes"):
        fit_bat(form)


@pytest.fixture(scope="module")
def weighed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, FittedBat]:
    """Return a file of measurements without frequencies, and the fitted bat."""
    source = tmp_path_factory.mktemp("fit") / "measured.toml"
    source.write_text(MEASURED)
    return source, fit_bat(str(source), members=3)


def test_the_file_reads_back_as_the_bat_that_was_measured(
    tmp_path: Path, weighed: tuple[Path, FittedBat]
) -> None:
    (_, fitted), target = weighed, tmp_path / "mine.toml"
    fitted.write(target)
    spec = load_bat(str(target)).spec
    beam = beam_of(spec.body)
    found = (beam.length, beam.mass, beam.z_cm, beam.inertia(33 * INCH))
    assert found == pytest.approx((34 * INCH, 31 * OUNCE, 11.3 * INCH, 17137 * OZ_IN2), rel=1e-5)
    assert spec.title == 'Mine "A"'
    assert (spec.sport, spec.construction) == ("softball", "one-piece wood")
    assert spec.spread == NO_SPREAD
    assert "peak e_A" in target.read_text()
    with pytest.raises(InputError, match="exists already"):
        fitted.write(target)


def test_parameters_unlike_those_of_other_bats_are_named(weighed: tuple[Path, FittedBat]) -> None:
    """2.4 typical spreads away is usual; the density, 650 ± 50 kg/m³, is beyond 2.5."""
    wood = TEMPLATES["wood"]
    signs = np.where(wood.usual == 650.0, -2.6, 2.4)
    parameters = wood.usual + signs * wood.spread
    _, fitted = weighed
    odd = replace(fitted, fitted=replace(fitted.fitted, parameters=parameters))
    assert odd.unusual.endswith("Deviations in typical spreads: density -2.6.")
    rows = {row.quantity: row for row in fitted.spread}
    peak, place, spot = (rows[n] for n in ("peak e_A", "position of peak e_A", "sweet spot"))
    top = (
        f"peak e_A of mine: {peak.value:.3f} ({peak.lowest:.3f} to {peak.highest:.3f} among the "
        f"bats that fit), {place.value:.1f} in from the tip"
    )
    at = f"sweet spot {spot.value:.1f} in from the tip ({spot.lowest:.1f} to {spot.highest:.1f})"
    answer = f"{top}; {at}"
    assert odd.text.splitlines()[0] == f"{answer}. {odd.unusual}"
    assert f"# {answer}. {odd.unusual}\n" in odd.toml
    usual = replace(fitted, fitted=replace(fitted.fitted, parameters=wood.usual))
    assert usual.text.splitlines()[0] == answer
    ended = replace(usual, spread=[replace(row, remark="at an end") for row in fitted.spread])
    assert ended.text.splitlines()[0] == f"{top}, at an end; {at}"
    assert "free bat, standard ball of its sport, 160 mph" in usual.text


def test_the_picture_has_the_spread_in_percent(weighed: tuple[Path, FittedBat]) -> None:
    """A quantity that was not measured is hollow."""
    _, fitted = weighed
    figure = fitted.plot()
    spread = [row for row in fitted.spread if row.value]
    ends = [
        sorted(100 * (end / row.value - 1) for end in (row.lowest, row.highest)) for row in spread
    ]
    assert lines_of(figure) == [pytest.approx((low, 0.0, high)) for low, high in ends]
    dots = [each for each in figure.axes[0].lines if len(each.get_xdata()) == 1]
    labels = [each.get_text() for each in figure.axes[0].get_yticklabels()]
    assert not any(each.endswith(" 1") for each in labels)
    hollow = [each.get_markerfacecolor() == "white" for each in dots]
    assert hollow == [not row.is_measured for row in spread]


def test_measuring_more_leaves_less_open(tmp_path: Path, weighed: tuple[Path, FittedBat]) -> None:
    source, fitted = weighed
    less = {row.quantity: row for row in fitted.spread}
    path = tmp_path / "tapped.toml"
    path.write_text(MEASURED + FREQUENCIES)
    more = {row.quantity: row for row in fit_bat(str(path), members=3).spread}
    assert less["f1"].highest - less["f1"].lowest > 5
    assert not less["f1"].is_measured
    assert more["f1"].is_measured
    assert more["f1"].highest - more["f1"].lowest < 0.01
    assert more["f2"].value == pytest.approx(551, rel=1e-5)
    assert less["e_A at 7 in"].sd > more["e_A at 7 in"].sd > 1e-4
    for row in more.values():
        assert row.lowest <= row.value <= row.highest
    # fits without frequencies are fast, and use the same draws
    assert fit_bat(str(source), members=3).spread == fitted.spread


def test_the_nodes_of_a_catalog_bat_are_those_of_table_one() -> None:
    """R161: the node of the second mode is nearer to the tip."""
    measured = SimpleNamespace(inertia_axis=33 * INCH, sport=None)
    _, values = _quantities(load_bat("r161").spec.body, measured)
    found = [values[name] for name in ("f1", "f2", "node1", "node2")]
    assert found == pytest.approx([164, 551, 6.8, 5.2], rel=0.01)


@pytest.mark.parametrize("bat", ["ea70", "softball-34"])
def test_the_sweet_spot_is_that_of_the_profile(bat: str) -> None:
    """Its e_A falls with speed: with that at 160 mph v_f of a softball is 0.2 mph less."""
    spec = load_bat(bat).spec
    _, values = _quantities(spec.body, SimpleNamespace(inertia_axis=33 * INCH, sport=spec.sport))
    top = virtual_lab.profile(bat).peaks["batted_speed_mph"]
    assert values["largest v_f"] == pytest.approx(top.value, abs=0.02)
    assert values["sweet spot"] == pytest.approx(top.place, abs=0.03)


def test_the_other_bats_fit_varied_data(tmp_path: Path) -> None:
    """An inertia of 17 137 ± 40 000 oz in² may vary below mass times distance². No bat has that."""
    path = tmp_path / "vague.toml"
    vague = 'inertia_u = { value = 40000, unit = "oz in^2", source = "guess", verified = false }'
    path.write_text(MEASURED + vague)
    assert fit_bat(str(path), members=2).members == 1


def test_a_peak_at_the_end_of_its_range_is_marked() -> None:
    assert "2 to 10 in" in remark_on("position of peak e_A", 10.0, 8.0)
    assert "2 to 10 in" in remark_on("sweet spot", 5.0, 2.0)
    assert remark_on("position of peak e_A", 2.1, 9.9) == remark_on("e_A at 9 in", 2.0, 10.0) == ""
