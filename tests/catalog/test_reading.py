"""The catalog: shipped files are valid; each fault gives one line with the remedy."""

import csv
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigs.bench import BenchSpec
from tests.test_units import DEFINED
from virtual_lab import catalog
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.day.table import action_table
from virtual_lab.catalog.faults import FaultSheet
from virtual_lab.catalog.specs import BallSpec, Dimension, HoopMode, Spec
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.simulation.instruments.air import GravitySpec, HallAirSpec
from virtual_lab.simulation.instruments.camera.spec import CameraSpec
from virtual_lab.simulation.instruments.cannon import CannonSpec
from virtual_lab.simulation.instruments.climate import ClimateLoggerSpec
from virtual_lab.simulation.instruments.encoder import EncoderSpec
from virtual_lab.simulation.instruments.indicator import RuleSpec, ScaleSpec
from virtual_lab.simulation.instruments.light_board import LightBoardSpec
from virtual_lab.simulation.instruments.light_gate import LightGateSpec
from virtual_lab.simulation.instruments.pendulum import PendulumSpec
from virtual_lab.simulation.stations.rig import installed_rigs
from virtual_lab.streams import Quiet
from virtual_lab.studies.bats.profile import GameConditions

DATA = Path(__file__).parents[2] / "data"
PUBLISHED = Path(__file__).parents[1] / "studies" / "reference" / "published.csv"
INSTRUMENTS = {
    "air": HallAirSpec,
    "camera": CameraSpec,
    "cannon": CannonSpec,
    "climate-logger": ClimateLoggerSpec,
    "encoder": EncoderSpec,
    "gravity": GravitySpec,
    "light-board": LightBoardSpec,
    "light-gate": LightGateSpec,
    "pendulum": PendulumSpec,
    "rule": RuleSpec,
    "scale": ScaleSpec,
}
BAT = (DATA / "bats" / "r161.toml").read_text(encoding="utf-8")
BALL = (DATA / "balls" / "baseball-2003.toml").read_text(encoding="utf-8")
RULES = (DATA / "procedures" / "astm-f1881.toml").read_text(encoding="utf-8")
GATES = (DATA / "instruments" / "pivot-gates.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", catalog.names("bats"))
def test_every_bat_reads(name: str) -> None:
    """All shipped files are valid."""
    entry = catalog.load_bat(name)
    assert entry.spec.name == name
    assert entry.sheet
    assert catalog.title("bats", name) == entry.spec.title


@pytest.mark.parametrize("name", catalog.names("balls"))
def test_every_ball_reads(name: str) -> None:
    """All shipped files are valid."""
    assert catalog.load("balls", name, BallSpec).spec.name == name


@pytest.mark.parametrize("name", catalog.names("procedures"))
def test_every_procedure_reads_and_names_what_exists(name: str) -> None:
    """The rig of each procedure is installed, and its ball is in the catalog."""
    rules = catalog.load("procedures", name, Procedure).spec
    assert rules.name == name
    assert rules.rig in installed_rigs()
    assert rules.ball in catalog.names("balls")


@pytest.mark.parametrize("name", catalog.names("instruments"))
def test_every_instrument_reads(name: str) -> None:
    """Each file is read by its stated kind; an unknown kind would leave a file untested."""
    kind = tomllib.loads((DATA / "instruments" / f"{name}.toml").read_text("utf-8"))["kind"]
    assert catalog.load("instruments", name, INSTRUMENTS[kind]).spec.kind == kind


@pytest.mark.parametrize("name", catalog.names("conditions"))
def test_every_game_reads(name: str) -> None:
    """The ball of each game is in the catalog."""
    game = catalog.load("conditions", name, GameConditions).spec
    assert {game.ball, game.softball} <= set(catalog.names("balls"))


@pytest.mark.parametrize("name", catalog.names("faults"))
def test_every_fault_reads(name: str) -> None:
    """Its content is tested in tests/simulation/faults."""
    assert catalog.load("faults", name, FaultSheet).spec.name == name


def test_every_folder_of_the_catalog_is_read_here() -> None:
    """Each folder of the catalog has a test above; `page` and `forms` are tested elsewhere."""
    holding = {path.parent.name for path in DATA.glob("*/*.toml")}
    assert holding - {"forms", "page"} == {
        "bats",
        "balls",
        "bench",
        "conditions",
        "faults",
        "instruments",
        "procedures",
        "rigs",
    }


def test_the_table_of_actions_reads() -> None:
    """Its content is tested in tests/bench."""
    assert action_table().actions


@pytest.mark.parametrize("name", catalog.names("bench/scenarios"))
def test_every_scenario_reads(name: str) -> None:
    assert load_scenario(name).spec.name == name


@pytest.mark.parametrize("name", catalog.names("rigs"))
def test_every_rig_file_is_read_by_its_rig(name: str) -> None:
    """A rig reads its file and those of its instruments when it is commissioned."""
    assert installed_rigs()[name].commission(Quiet()).calibration


def _sources(document: Any) -> Iterator[str]:
    if isinstance(document, dict):
        if {"value", "unit"} <= document.keys():
            yield document["source"]
        for item in document.values():
            yield from _sources(item)
    elif isinstance(document, list):
        for item in document:
            yield from _sources(item)


def test_every_source_key_is_explained() -> None:
    """Every source key of a number is explained, and every explanation is used."""
    explained = tomllib.loads((DATA / "sources.toml").read_text("utf-8"))
    file_of_key: dict[str, Path] = {}
    for path in sorted({*DATA.rglob("*/*.toml")} - {*DATA.glob("forms/*")}):
        document = tomllib.loads(path.read_text("utf-8"))
        file_of_key.update(dict.fromkeys(_sources(document), path))
    for path in [*sorted(DATA.glob("*/*.csv")), PUBLISHED]:
        with path.open(encoding="utf-8", newline="") as file:
            rows = csv.DictReader(line for line in file if not line.startswith("#"))
            file_of_key.update(dict.fromkeys((r["source"] for r in rows if r.get("source")), path))
    assert {key: str(path) for key, path in file_of_key.items() if key not in explained} == {}
    assert set(explained) - set(file_of_key) == set()
    assert all(entry["text"] for entry in explained.values())


def test_each_number_keeps_its_source_and_verification() -> None:
    """data/bats/r161.toml as shipped: the paper's length is verified, the fit is not."""
    sheet = {datum.key: datum for datum in catalog.load_bat("r161").sheet}
    assert sheet["published.length"].verified
    assert (sheet["published.length"].value, sheet["published.length"].unit) == (34, "in")
    assert not sheet["body.material.density"].verified
    assert sheet["body.material.shear_coefficient"].note == "solid round section"


@pytest.mark.parametrize(("name", "hint"), [("r116", "r161"), ("R161", "r161"), ("r-161", "r161")])
def test_unknown_bat_gets_a_suggestion(name: str, hint: str) -> None:
    """A typing error suggests the intended bat."""
    with pytest.raises(InputError) as caught:
        catalog.load_bat(name)
    assert str(caught.value).startswith(f"bat = '{name}'; did you mean {hint}")


def test_unknown_bat_unlike_any_gets_the_list() -> None:
    """Without a similar name, the message lists all known names."""
    with pytest.raises(InputError) as caught:
        catalog.load_bat("zzzzzzzz")
    assert "did you mean" not in str(caught.value)
    for name in catalog.names("bats"):
        assert name in str(caught.value)


READERS = {
    "bats": catalog.read_bat,
    "balls": lambda text, where: catalog.read(text, where, BallSpec),
    "procedures": lambda text, where: catalog.read(text, where, Procedure),
    "instruments": lambda text, where: catalog.read(text, where, LightGateSpec),
}


def _refused(text: str, kind: str = "bats") -> InputError:
    with pytest.raises(InputError) as caught:
        READERS[kind](text, "mine.toml")
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert len(sentence) < 400
    assert sentence.startswith("mine.toml: ")
    return caught.value


DENSITY = 'density = { value = 644.3, unit = "kg/m^3", source = "fit-table1", verified = false }'
WALL = 'wall = {{ value = [{}], unit = "in", source = "assumed", verified = false }}\n'


@pytest.mark.parametrize(
    ("old", "new", "key", "value", "allowed"),
    [
        ('"kg/m^3"', '"kg"', "body.material.density", "644.3 kg", "allowed: kg/m^3"),
        (
            "value = 644.3",
            "value = -644.3",
            "body.material.density",
            "-644.3",
            "outside the range 100 to 30000 kg/m^3",
        ),
        ("value = 644.3", "value = nan", "body.material.density", "nan", "finite number"),
        ("value = 644.3", "value = -inf", "body.material.density", "-inf", "finite number"),
        ("value = 644.3", 'value = "644"', "body.material.density", "644", "number"),
        ("value = 644.3", "value = true", "body.material.density", "True", "number"),
        ("value = 644.3", "value = [644.3]", "body.material.density", "644.3", "number"),
        (DENSITY, "", "body.material.density", None, "missing"),
        (DENSITY, "density = 644.3", "body.material.density", "644.3", "{ value, unit"),
        (DENSITY, DENSITY + "\ncolour = 3", "body.material.colour", None, "unknown key"),
        ("verified = false }", 'verified = "no" }', "body.profile.z", None, "true or false"),
        ('source = "assumed", ', "", "body.profile.z", None, "lacks 'source'"),
        ('source = "assumed"', 'source = ""', "body.profile.z", None, "the origin of the number"),
        ('source = "assumed"', "source = 3", "body.profile.z", None, "the origin of the number"),
        ('source = "assumed"', 'sauce = "x"', "body.profile.z", None, "unknown key 'sauce'"),
        ('name = "r161"\n', "", "name", None, "this key is missing"),
        ("sport =", 'template = "wood"\nsport =', "template", None, "of which fit-bat makes a bat"),
        ('name = "r161"', "name = 161", "name", "161", "string"),
        ("[0, 2, 5, 8", "[0, 2, 8, 5", "body.profile", None, "z must increase"),
        ("[0, 2, 5, 8", "[0, 2, 2, 8", "body.profile", None, "z must increase"),
        ("[0, 2, 5, 8", "[1, 2, 5, 8", "body.profile", None, "start at 0"),
        ("[0, 2, 5, 8", "[0, 5, 8", "body.profile", None, "12 stations, but z has 11"),
        (
            "[2.2991,",
            "[-2.2991,",
            "body.profile.outer_diameter",
            None,
            "-2.2991 is outside the range 0.03",
        ),
        (
            "outer_diameter",
            WALL.format("1.16, " + ", ".join(["0.1"] * 11)) + "outer_diameter",
            "body.profile",
            None,
            "does not fit",
        ),
        ("value = 0.003", "value = 1", "body.damping_ratio", "1", "outside the range 0 to 0.2"),
        ("value = 0.9,", "value = 1.1,", "body.material.shear_coefficient", "1.1", "equal to 1"),
    ],
)
def test_every_fault_of_a_bat_file_is_named(
    old: str, new: str, key: str, value: str | None, allowed: str
) -> None:
    """One fault at a time in a valid file: key, value and remedy are named."""
    assert old in BAT
    fault = _refused(BAT.replace(old, new, 1))
    assert fault.key == key
    assert allowed in fault.allowed
    if value is not None:
        assert value in str(fault.value)
        assert value in str(fault)


@pytest.mark.parametrize(
    ("changes", "key", "allowed"),
    [
        ({"\nname": "\n# ", "\ntitle": "\n# "}, "name, title", "these keys are missing"),
        (
            {"\nname": "\nnam", "\ntitle": "\ntitel"},
            "nam, titel",
            "unknown keys; missing: name, title; allowed: name, title, body",
        ),
        ({"\nname": "\nnaem"}, "naem", "did you mean name? missing: name; allowed: name"),
        (
            {", verified = false": ""},
            "body.profile.z, body.profile.outer_diameter",
            "lacks 'verified'",
        ),
    ],
)
def test_the_keys_of_a_table_with_one_fault_are_named_together(
    changes: dict[str, str], key: str, allowed: str
) -> None:
    text = "\n" + BAT[BAT.index("name = ") :]
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    fault = _refused(text)
    assert fault.key == key
    assert allowed in fault.allowed


@dataclass(frozen=True, slots=True, kw_only=True)
class _Listed(Spec):
    rows: tuple[int, ...]


def test_of_the_items_of_a_list_the_first_is_named() -> None:
    with pytest.raises(InputError, match=r"^x: rows\.1 = 'a'; must be a valid integer"):
        validate({"rows": [1, "a", *"bcdefgh"]}, "x", _Listed)


@pytest.mark.parametrize(
    ("kind", "text", "old", "new", "key", "allowed"),
    [
        (
            "balls",
            BALL,
            "value = 5.125",
            "value = -5.125",
            "mass",
            "-5.125 is outside the range 0.35",
        ),
        ("balls", BALL, "value = -0.001", "value = 0.001", "restitution.slope", "equal to 0"),
        (
            "balls",
            BALL,
            "value = 0.55",
            "value = 1.01",
            "restitution.value",
            "outside the range 0.05 to 1",
        ),
        (
            "balls",
            BALL,
            "value = 0.55",
            "value = 0.007",
            "restitution.value",
            "outside the range 0.05 to 1",
        ),
        ("balls", BALL, "exponent = { value = 1", "exponent = { value = 9", "exponent", "1 to 5"),
        ("balls", BALL, "value = 3.23e6", "value = 1e14", "file", "by 1 cm is 1e+12 N; allowed"),
        ("balls", BALL, "value = 3.23e6", "value = 1e2", "file", "by 1 cm is 1 N; allowed: 100"),
        ("balls", BALL, 'unit = "oz"', 'unit = "in"', "mass", "allowed: kg, g, oz, lb"),
        (
            "procedures",
            RULES,
            "hits = { value = 6,",
            "hits = { value = 6.5,",
            "valid_hits",
            "integer",
        ),
        (
            "procedures",
            RULES,
            "attempts = { value = 12,",
            "attempts = { value = 5,",
            "file",
            "5 attempts cannot give 6",
        ),
        ("procedures", RULES, '"pivoted"', '"held"', "recoil", "'pivoted'"),
        (
            "procedures",
            RULES,
            "value = 1.2",
            "value = 0",
            "file",
            "limit is 0; it must be greater than 0",
        ),
        ("procedures", RULES, "[windows]", "[widows]", "widows", "did you mean windows?"),
        ("instruments", GATES, "[0.5502, 0.2499]", "[0.2499, 0.5502]", "file", "must fall"),
        ("instruments", GATES, "[0.5502, 0.2499]", "[0.5502]", "distances", "at least 2"),
        ("instruments", GATES, "value = 20,", "value = -20,", "clock_u", "equal to 0"),
    ],
)
def test_every_fault_of_another_sheet_is_named(
    kind: str, text: str, old: str, new: str, key: str, allowed: str
) -> None:
    """One fault at a time in a valid shipped file."""
    assert old in text
    fault = _refused(text.replace(old, new, 1), kind)
    assert fault.key == key
    assert allowed in fault.allowed


def test_broken_toml_names_the_line() -> None:
    """The message keeps the line that the TOML parser reports."""
    fault = _refused('name = "x"\ntitle = \n')
    assert fault.key == "TOML"
    assert "line 2" in fault.allowed


def test_a_file_that_is_not_utf8_is_named(tmp_path: Path) -> None:
    """The message names a file that was saved in Latin-1."""
    path = tmp_path / "latin.toml"
    path.write_bytes('title = "Schläger"\n'.encode("latin-1"))
    with pytest.raises(InputError) as caught:
        catalog.load_bat(str(path))
    assert "\n" not in str(caught.value)
    assert "latin.toml" in str(caught.value)
    assert "not UTF-8 text" in str(caught.value)


@pytest.mark.parametrize("name", ["nowhere.toml", ""])
def test_a_missing_file_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    """A path that does not exist, a folder, and an empty name."""
    with pytest.raises(InputError) as caught:
        catalog.load_bat(str(tmp_path / name) if name else "")
    assert "\n" not in str(caught.value)


def test_a_users_own_file_reads_like_the_catalogs(tmp_path: Path) -> None:
    """The same text in a user's file gives the same specification."""
    path = tmp_path / "mine.toml"
    path.write_text(BAT, encoding="utf-8")
    assert catalog.load_bat(str(path)).spec == catalog.load_bat("r161").spec


def test_a_title_is_asked_of_a_file_without_one(tmp_path: Path) -> None:
    """A missing title is an error in one line, not a traceback."""
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\n', encoding="utf-8")
    with pytest.raises(InputError, match="title"):
        catalog.title("bats", str(path))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample(Spec):
    """Quantities of any size."""

    density: Annotated[float, Dimension("density")]
    modulus: Annotated[float, Dimension("modulus")]
    share: Annotated[float, Dimension("number")]


@given(value=st.floats(1e-6, 1e6), unit=st.sampled_from(list(DEFINED["modulus"])))
def test_a_quantity_in_toml_is_read_exactly(value: float, unit: str) -> None:
    """TOML keeps a double (repr round trip); the SI value is the rational product."""
    text = f"""
density = {{ value = {value!r}, unit = "kg/m^3", source = "s", verified = true }}
modulus = {{ value = {value!r}, unit = "{unit}", source = "s", verified = true }}
share = {{ value = 50, unit = "%", source = "s", verified = true }}
"""
    entry = catalog.read(text, "mine.toml", Sample)
    assert entry.spec.density == value
    assert entry.spec.share == 0.5
    expected = float(DEFINED["modulus"][unit]) * value
    assert entry.spec.modulus == pytest.approx(expected, rel=4e-16)
    assert [datum.value for datum in entry.sheet] == [value, value, 50]


FACTOR = '{ value = 0.9, unit = "1", source = "assumed", verified = false }'
MODIFIED = f"""
name = "thin"
title = "EA70, thinner"
base = "ea70"
wall_factor = {FACTOR}
"""


def test_a_modified_bat_differs_from_its_base_only_by_the_change() -> None:
    """Walls times 0.9 and one added weight; other values keep their provenance."""
    weight = """
[[lumps]]
name = "insert"
z = { value = 1, unit = "in", source = "assumed", verified = false }
mass = { value = 1, unit = "oz", source = "assumed", verified = false }
"""
    base = catalog.load_bat("ea70")
    bat = catalog.read_bat(MODIFIED + weight, "mine.toml")
    assert bat.spec.body.profile.wall == pytest.approx(
        [0.9 * wall for wall in base.spec.body.profile.wall], rel=1e-15
    )
    assert bat.spec.body.profile.outer_diameter == base.spec.body.profile.outer_diameter
    assert bat.spec.body.material == base.spec.body.material
    assert bat.spec.body.lumps[:-1] == base.spec.body.lumps
    assert bat.spec.body.lumps[-1].mass == pytest.approx(0.028349523125, rel=1e-15)
    assert bat.spec.published is None
    keys = [datum.key for datum in bat.sheet]
    assert "wall_factor" in keys
    assert "body.material.density" in keys
    assert not any(key.startswith("published") for key in keys)


def test_the_hoop_mode_follows_the_wall_like_a_ring() -> None:
    """A thin ring that bends into an oval: Rayleigh's quotient of w = cos 2θ, v = −½ sin 2θ.

    Bending E t³/12R³ ∫(w'' + w)² dθ over mass ρ t R ∫(w² + v²) dθ, per length of tube. EA70's
    wall and middle radius make it 2.1 kHz at 6 in, below its 2.5 kHz as the barrel's ends
    hold on to it.
    """
    bats = [catalog.load_bat("ea70").spec.body, catalog.read_bat(MODIFIED, "m").spec.body]
    angle = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    w, v, bent = np.cos(2 * angle), -np.sin(2 * angle) / 2, -3 * np.cos(2 * angle)
    radius = 1.25 * 0.0254 - 3.1e-3 / 2
    frequency, mass = [], []
    for body in bats:
        assert body.profile.wall is not None
        t, material = body.profile.wall[1], body.material
        stiffness = material.youngs_modulus * t**3 / 12 / radius**3 * np.sum(bent**2)
        mass.append(material.density * t * radius * np.sum(w**2 + v**2))
        frequency.append(np.sqrt(stiffness / mass[-1]) / 2 / np.pi)
    assert 2000 < frequency[0] < 2200
    whole, thin = (body.hoop for body in bats)
    assert whole is not None
    assert thin is not None
    assert thin.frequency / whole.frequency == pytest.approx(frequency[1] / frequency[0], rel=1e-12)
    assert thin.modal_mass / whole.modal_mass == pytest.approx(mass[1] / mass[0], rel=1e-12)


def test_a_stated_hoop_mode_does_not_change_with_the_wall() -> None:
    own = """
[hoop]
frequency = { value = 2, unit = "kHz", source = "heard", verified = false }
modal_mass = { value = 0.3, unit = "kg", source = "assumed", verified = false }
"""
    hoop = catalog.read_bat(MODIFIED + own, "mine.toml").spec.body.hoop
    assert hoop == HoopMode(frequency=2000.0, modal_mass=0.3)


def test_a_wall_factor_may_be_a_plain_number() -> None:
    """The same bat; its sheet says that no source was stated."""
    full = catalog.read_bat(MODIFIED, "mine.toml")
    plain = catalog.read_bat(MODIFIED.replace(FACTOR, "0.9"), "mine.toml")
    assert plain.spec == full.spec
    assert [datum.key for datum in plain.sheet] == [datum.key for datum in full.sheet]
    (datum,) = [datum for datum in plain.sheet if datum.key == "wall_factor"]
    assert (datum.value, datum.unit) == (0.9, "1")
    assert (datum.source, datum.verified) == ("not stated", False)


@pytest.mark.parametrize("base", catalog.names("bats"))
def test_a_bat_may_be_its_base_with_nothing_but_a_name_or_a_sport_of_its_own(base: str) -> None:
    """The base may be a solid bat, because no wall is thinned."""
    text = f'name = "twin"\ntitle = "Twin"\nbase = "{base}"\n'
    whole, twin = catalog.load_bat(base).spec, catalog.read_bat(text, "mine.toml").spec
    assert (twin.body, twin.spread, twin.sport) == (whole.body, whole.spread, whole.sport)
    other = "softball" if whole.sport == "baseball" else "baseball"
    assert catalog.read_bat(f'{text}sport = "{other}"\n', "mine.toml").spec.sport == other


@pytest.mark.parametrize(
    ("old", "new", "key", "allowed"),
    [
        ('"ea70"', '"r161"', "wall_factor", "r161 is solid"),
        ('"ea70"', '"ea77"', "ea77", "did you mean ea70"),
        ("value = 0.9", "value = 0", "wall_factor", "outside the range 0.2 to 5"),
        ("value = 0.9", "value = 50", "wall_factor", "outside the range 0.2 to 5"),
        (FACTOR, "50", "wall_factor", "outside the range 0.2 to 5"),
        (FACTOR, "true", "wall_factor", "a finite number"),
        (FACTOR, '"0.9"', "wall_factor", "expected a table"),
        ('base = "ea70"', 'base = "ea70"\ncolour = "red"', "colour", "unknown key"),
    ],
)
def test_every_fault_of_a_modified_bat_is_named(old: str, new: str, key: str, allowed: str) -> None:
    """One line names the remedy, and the file if the change is wrong."""
    with pytest.raises(InputError) as caught:
        catalog.read_bat(MODIFIED.replace(old, new), "mine.toml")
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert key in sentence
    assert allowed in sentence
    assert "mine.toml" in sentence


def test_a_bat_based_on_itself_is_refused(tmp_path: Path) -> None:
    """A circular chain of bases is bad input, not a stack overflow."""
    path = tmp_path / "loop.toml"
    path.write_text(MODIFIED.replace("ea70", str(path)), encoding="utf-8")
    with pytest.raises(InputError, match="base"):
        catalog.load_bat(str(path))


def test_an_unknown_kind_is_named() -> None:
    with pytest.raises(InputError, match=r"^kind = 'bat'; did you mean bats"):
        catalog.find("bat", "r161")


def test_a_hall_in_degrees_celsius_and_percent() -> None:
    """The mean may be in °C; its spread is a difference, which is in K."""
    bench = (DATA / "rigs" / "bench.toml").read_text(encoding="utf-8")
    kelvin = bench.replace('value = 294.15, unit = "K"', 'value = 21, unit = "degC"')
    assert kelvin.count("degC") == 2
    hall = catalog.read(kelvin, "mine.toml", BenchSpec).spec.hall
    assert (hall.temperature, hall.humidity) == (294.15, 0.45)
    spread = bench.replace('value = 1.5, unit = "K"', 'value = 1.5, unit = "degC"')
    with pytest.raises(
        InputError, match=r"mine\.toml: hall\.temperature_spread = '1\.5 degC'"
    ) as no:
        catalog.read(spread, "mine.toml", BenchSpec)
    assert str(no.value).endswith("not a unit of temperature difference, allowed: K, mK")
