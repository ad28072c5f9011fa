"""The descriptors of a result folder, read by the usual libraries."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from pathlib import Path

import frictionless
import pytest
from rocrate.rocrate import ROCrate

import virtual_lab as vl
from virtual_lab.certificate.columns import SHOTS
from virtual_lab.files.column_units import UNITS, unit_of
from virtual_lab.records import record_types
from virtual_lab.records.record import AXES
from virtual_lab.units import DIMENSIONS

HERE = Path(__file__).parents[1]
CELL = 131_072  # Python's limit for a cell [characters], before frictionless raises it
csv.field_size_limit(CELL)


@pytest.fixture(autouse=True)
def _cells_of_others() -> Iterator[None]:
    yield
    csv.field_size_limit(CELL)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Save a pivoted test, a scan on the swing machine, and records of another laboratory."""
    there = tmp_path_factory.mktemp("packages")
    return {
        "pivoted": vl.certify("r161", seed=7).save(there / "pivoted"),
        "swung": vl.certify("r161", procedure="ncaa-modified", seed=7).save(there / "swung"),
        "theirs": vl.reduce(HERE / "foreign_laboratory" / "records").save(there / "theirs"),
    }


@pytest.mark.parametrize("name", ["pivoted", "swung", "theirs"])
def test_frictionless_finds_every_table_valid(folders: dict[str, Path], name: str) -> None:
    """Every table, column and type is valid; a text in a column of numbers is found."""
    report = frictionless.validate(str(folders[name] / "datapackage.json"))
    assert report.valid, report.flatten(["title", "message"])
    tables = {str(each.relative_to(folders[name])) for each in folders[name].rglob("*.csv")}
    assert {task.place for task in report.tasks} == tables


def test_frictionless_finds_a_word_among_the_numbers(
    folders: dict[str, Path], tmp_path: Path
) -> None:
    package = json.loads((folders["pivoted"] / "datapackage.json").read_text("utf-8"))
    (resource,) = (each for each in package["resources"] if each["path"] == "readings.csv")
    (tmp_path / "datapackage.json").write_text(json.dumps({**package, "resources": [resource]}))
    text = (folders["pivoted"] / "readings.csv").read_text("utf-8")
    (tmp_path / "readings.csv").write_text(
        re.sub(r"(\n0,\d+),", r"\1,heavy,", text).replace("ball_mass_oz", "ball_mass_oz", 1)
    )
    assert not frictionless.validate(str(tmp_path / "datapackage.json")).valid


@pytest.mark.parametrize("name", ["pivoted", "theirs"])
def test_a_crate_lists_the_files_and_who_made_them(folders: dict[str, Path], name: str) -> None:
    folder = folders[name]
    crate = ROCrate(folder)
    listed = {entity.id for entity in crate.data_entities}
    here = {
        str(path.relative_to(folder))
        for path in folder.rglob("*")
        if path.is_file() and path.suffix and "truth" not in path.parts
    }
    assert listed == here - {"datapackage.json", "ro-crate-metadata.json"}
    action = crate.dereference("#test")
    assert action.type == "CreateAction"
    assert action["instrument"]["softwareVersion"] == vl.__version__
    assert "certificate.json" in {each.id for each in action["result"]}
    assert "records/session.json" in {each.id for each in action["object"]}
    assert crate.root_dataset["description"].startswith(
        "SIMULATED" if name == "pivoted" else "Computed by this program"
    )


def test_every_column_has_a_meaning_and_a_unit(folders: dict[str, Path]) -> None:
    for folder in folders.values():
        package = json.loads((folder / "datapackage.json").read_text("utf-8"))
        for resource in package["resources"]:
            for field in resource["schema"]["fields"]:
                assert field["description"]
                assert ("unit" in field) == (field["type"] in ("integer", "number"))


def test_each_axis_of_a_record_has_a_meaning() -> None:
    for kind in record_types().values():
        assert {*kind.axes()} <= AXES.keys()


def test_sizes_of_units_agree_with_the_table_of_units() -> None:
    """The oracle is the table of units in files."""
    known = {unit: size for units in DIMENSIONS.values() for unit, size in units.items()}
    for name, unit in UNITS.items():
        if name in known:
            assert unit.si == known[name]
    assert unit_of("video_speed_u_mph").ucum == "[mi_i]/h"
    assert unit_of("recoil_rad_per_s").ucum == "rad/s"
    assert unit_of("ball_mass_oz").ucum == "[oz_av]"
    assert unit_of("restitution").ucum == "1"
    assert len({each.name for each in SHOTS}) == len(SHOTS)
