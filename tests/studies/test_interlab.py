"""Laboratories compared: factors alone, the file, the control bat."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from math import hypot
from pathlib import Path

import numpy as np
import pytest

import virtual_lab as vl
from tests.studies.interlab import summarize
from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.files import parse_toml
from virtual_lab.lab.setup import TestSetup as Setup
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.simulation.stations.rig import Stage
from virtual_lab.streams import Quiet, Selected, Streams
from virtual_lab.studies.interlab import findings
from virtual_lab.studies.interlab.expected import ExpectedScatter, expected_scatter
from virtual_lab.studies.interlab.findings import ALL, InterlabTerm, _interaction, _precision
from virtual_lab.studies.interlab.playing import Play
from virtual_lab.studies.interlab.predicted import NominalTest
from virtual_lab.studies.interlab.study import (
    ClampFactor,
    Factors,
    LotFactor,
    StiffnessFactor,
    WallFactor,
    read_interlab,
    sheets_of,
)
from virtual_lab.units import Array

ASSUMED = 'source = "assumed", verified = false'
STUDY = f"""
procedures = ["astm-f1881"]
bats = ["ea70"]
laboratories = 4
exercises = 6
lots = 1
alone = 250
seed = 3
control = "r161"

[factors.calibration]

[factors.wall]
value = {{ value = 0.99, unit = "1", {ASSUMED} }}
spread = {{ value = 0.3, unit = "%", {ASSUMED} }}

[factors.clamp]
value = {{ value = 4, unit = "oz in^2", {ASSUMED} }}
spread = {{ value = 1, unit = "oz in^2", {ASSUMED} }}
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    return path


def test_factors_alone_agree_with_their_predictions(study: Path) -> None:
    """Bounds: 10 % and 4 standard errors of a standard deviation from 250 laboratories."""
    found = vl.interlab(study)
    rows = {(row.result, row.term): row for row in found}
    for factor in ("calibration", "wall", "clamp"):
        row = rows["as found", factor]
        assert row.simulated == pytest.approx(row.predicted, rel=0.1 + 4 / 500**0.5), factor
    s = {term: rows["as found", term].simulated or 0.0 for term in ("s_L", "s_r", "s_R")}
    assert s["s_R"] ** 2 == pytest.approx(s["s_L"] ** 2 + s["s_r"] ** 2)
    apart = f"less than {1.96 * 2**0.5 * s['s_R']:.3g} in 95 % of cases (2.8 s_R)"
    answer = f"ea70 by astm-f1881, as found: single tests of two laboratories differ by {apart}"
    assert found.text.startswith(answer)
    # a wall and calibrations that are common to both bats leave no scatter of laboratories
    cured = rows["as found, control bat r161", "s_L"].simulated or 0.0
    assert cured < s["s_L"] / 2
    # by hand: BPF is divided by an e0 that the wall lowers, so its share scatters by 0.3 %/0.99
    bpf = rows["as found", "wall"].simulated or 0.0
    assert bpf == pytest.approx(0.003 / 0.99 * 1.04, rel=0.2)
    found.plot(study.with_suffix(".svg"))
    again = vl.interlab(study, predict=True)
    assert all(row.simulated is None for row in again)
    assert [row.predicted for row in again] == [
        row.predicted for row in found if row.term in {each.term for each in again}
    ][: len(again)]


# results by hand: one row per laboratory, one column per lot; each repeat adds a share of the level
LEVELS = np.array([[1.00, 1.04], [1.20, 1.28]])
REPEATS = np.array([-0.01, 0.0, 0.01])


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenByHand(Play):
    """Two laboratories with two lots and three repeats, whose results are written down by hand.

    The control bat has twice the result of the bat, without scatter. The stated u are 1 in the
    first laboratory and 7 in the second. With one factor alone, three laboratories find 1, 2 and 3.
    """

    tests: list[int] = field(default_factory=list)  # numbers of the tests

    @contextmanager
    def round_robin(self, factors: Sequence[str], varied: tuple[str, ...]) -> Iterator[object]:
        yield Shared(setup=Setup.of(self.bat, procedure=self.procedure, seed=1))

    def _results(
        self, laboratories: Shared, count: int, *, valid: bool = False
    ) -> dict[str, Array]:
        setup = laboratories.setup
        if not valid:
            assert count == 3
            return {"as found": np.array([[1.0, 2.0, 3.0], np.ones(3)])}
        assert count == 2
        self.tests.append(setup.test)
        value = LEVELS[:, setup.lot]
        value = 2 * value if self.bat == "r161" else value * (1 + REPEATS[(setup.test - 1) % 3])
        return {"as found": np.array([value, [1.0, 7.0]])}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shared:
    """The only part of a `RoundRobin` that the results by hand need."""

    setup: Setup


def test_two_lots_and_three_repeats_with_a_control_bat_by_hand(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = read_interlab(study)
    spec = replace(entry.spec, laboratories=2, exercises=1, lots=2, repeats=3, alone=3)
    factors = Factors(
        lot=LotFactor(), stiffness=StiffnessFactor(), wall=WallFactor(), clamp=ClampFactor()
    )
    spec = replace(spec, factors=factors)
    play = WrittenByHand(
        study=replace(entry, spec=spec), bat="ea70", procedure="astm-f1881", tests=[]
    )
    blank = dict.fromkeys(("simulated", "simulated_se", "agrees"))
    names = {"bat": "ea70", "procedure": "astm-f1881", "result": "as found", "unit": ""}
    predicted = {"lot": 0.03, "stiffness": 0.04, "wall": 1.0, "clamp": 2.0, ALL: 9.0}
    rows = {
        term: InterlabTerm(
            **names, **blank, term=term, predicted=effect, factor_spread="", source=""
        )
        for term, effect in predicted.items()
    }
    monkeypatch.setattr(findings, "_predictions", lambda play: {"as found": rows})
    (plain, _), (cured, _) = findings._results(play)
    assert sorted(play.tests) == list(range(1, 13))  # no two tests have the same number
    found = {row.term: row for row in plain}
    # s_r² = .01² (1 + 1.04² + 1.2² + 1.28²)/4; the lots of a laboratory differ by .04 and .08, and
    # the laboratories by 1.24 − 1.02
    s_r = 0.01 * 1.29**0.5
    lot_mean_square = 3 * (0.04**2 + 0.08**2) / 4
    s_lot = ((lot_mean_square - s_r**2) / 3) ** 0.5
    s_L = (0.22**2 / 2 - lot_mean_square / 6) ** 0.5
    sds = {"s_r": s_r, "s_lot": s_lot, "s_L": s_L, "s_R": hypot(s_r, s_lot, s_L)}
    assert {term: found[term].simulated for term in sds} == pytest.approx(sds)
    assert found["s_lot"].predicted == pytest.approx(0.05)  # of lot and stiffness
    assert found["stated u"].simulated == pytest.approx(5.0)
    for factor, agrees in (("lot", False), ("wall", True), ("clamp", False)):
        row = found[factor]
        assert (row.simulated, row.simulated_se, row.agrees) == (1.0, 0.5, agrees), factor
    # the control has the same lots, so only the repeats remain: a share of the mean of all levels
    after = {row.term: row.simulated for row in cured}
    s_r = 0.01 * 1.13
    assert after == pytest.approx({"s_r": s_r, "s_lot": 0.0, "s_L": 0.0, "s_R": s_r})


def test_a_lot_has_other_random_numbers_than_the_test_of_its_number() -> None:
    setup = Setup.of("r161", procedure="astm-f1881", seed=4)
    third_lot = replace(setup, test=1, lot=3).lot_draws(4).normal("lot", 5)
    assert (third_lot != setup.draws(4, 3).normal("lot", 5)).all()
    assert (third_lot == replace(setup, test=2, lot=3).lot_draws(4).normal("lot", 5)).all()
    assert (third_lot != replace(setup, test=1, lot=2).lot_draws(4).normal("lot", 5)).all()


def test_the_effect_of_a_lot_by_hand() -> None:
    """BPF is e/e0; with e = .6 and e0 = .5, ∂e/∂e0 = .4 gives .8 by the true e0, −2.4 by the other.

    The window is .53 to .56 at 30 m/s, where a lot has .55 − .002 (30 − 26) = .542 ± .01.
    """
    rules = catalog.load("procedures", "astm-f1881", Procedure).spec
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    window = {"low": 0.53, "high": 0.56, "speed": 30.0}
    windows = {f"ball_restitution_{key}": value for key, value in window.items()}
    line = {"speed": 26.0, "value": 0.55, "slope": -0.002, "value_u": 0.01, "slope_u": 1e-3}
    point = NominalTest(
        procedure=replace(
            rules, wall_speeds=(28.0,), windows=replace(rules.windows, **windows), correction=None
        ),
        ball=replace(ball, restitution=replace(ball.restitution, **line)),
        bat=catalog.load_bat("r161").spec,
        humidity_spread=0.0,
        place=0.0,
        speed=60.0,
        e=0.6,
        e0=0.5,
        r=0.2,
        inertia=0.2,
        calibrations={"as found": 0.0},
        radii={"as found": 0.003},
    )
    point.__dict__["derivatives"] = 0.4, 0.0
    e0 = np.linspace(0.53, 0.56, 30_001)
    chance = np.exp(-0.5 * ((e0 - 0.542) / 0.01) ** 2)
    mean, square = (np.average(e0**power, weights=chance) for power in (1, 2))
    level = (0.8 - 2.4) * (square - mean**2) ** 0.5
    slope = (0.8 * (60 - 26) - 2.4 * (28 - 26)) * 1e-3
    effect = LotFactor().effect(point, "as found")
    assert effect == pytest.approx(hypot(level, slope, 0.003), rel=1e-3)


def test_each_number_of_a_study_changes_its_own_number_of_a_sheet(study: Path) -> None:
    """The numbers 1 to 9 and where they are found in the sheets, by hand."""
    keys = (
        ("lot", "level", "1"),
        ("lot", "slope", "1/mph"),
        ("lot", "radius", "mm"),
        ("stiffness", "spread", "%"),
        ("store", "spread", "%"),
        ("wall", "value", "1"),
        ("wall", "spread", "%"),
        ("clamp", "value", "oz in^2"),
        ("clamp", "spread", "oz in^2"),
    )
    text = STUDY.split("[factors", maxsplit=1)[0]
    for number, (factor, key, unit) in enumerate(keys):
        value = (0.01, 1e-4, 1, 4, 5, 0.9, 7, 8, 9)[number]
        text += f'factors.{factor}.{key} = {{ value = {value}, unit = "{unit}", {ASSUMED} }}\n'
    study.write_text(text)
    factors = ("lot", "stiffness", "store", "wall", "clamp")
    changed = sheets_of(read_interlab(study), "astm-f1881", factors)
    numbers = {}
    for (kind, name), sheet in changed.items():
        before = numbers_of(tomllib.loads(catalog.text(kind, name)))
        after = numbers_of(tomllib.loads(sheet))
        numbers[name] = {key: each for key, each in after.items() if each != before.get(key)}
    assert numbers == {
        "baseball-2003": {
            "restitution.value_u": 0.01,
            "restitution.slope_u": 1e-4,
            "radius_u": 1,
            "stiffness_spread": 4,
        },
        "bench": {"store.humidity_spread": 5},
        "ball-wall": {"wall_restitution": 0.9, "wall_spread": 7},
        "astm-pivot": {"pivot.clamp_inertia": 8, "pivot.clamp_spread": 9},
    }


def numbers_of(table: dict, prefix: str = "") -> dict[str, object]:
    """Return the values of a sheet by dotted key, each in the unit of the sheet."""
    numbers: dict[str, object] = {}
    for key, entry in table.items():
        if isinstance(entry, dict) and "value" in entry and not isinstance(entry["value"], dict):
            numbers[prefix + key] = entry["value"]
        elif isinstance(entry, dict):
            numbers |= numbers_of(entry, f"{prefix}{key}.")
    return numbers


def test_a_factor_that_is_left_out_stays_nominal(study: Path) -> None:
    """Without calibrations, the certificates' constants are the true ones in every laboratory."""
    entry = read_interlab(study)
    factors = Factors(lot=LotFactor())
    spec = replace(entry.spec, exercises=1, factors=factors)
    play = Play(study=replace(entry, spec=spec), bat="ea70", procedure="astm-f1881")
    with play.round_robin((), spec.varied_streams) as shared:
        first, second = (shared.laboratory(3, number) for number in (1, 2))
    for stage in (Stage.BENCH, Stage.BALLS, Stage.IMPACT):
        assert first.stations[stage].true_constants == second.stations[stage].true_constants
    lots = [each.specimen.balls.spec.restitution.slope for each in (first, second)]
    assert lots[0] != lots[1]
    assert first.specimen.balls.spec.stiffness == second.specimen.balls.spec.stiffness


def test_a_study_may_be_a_mapping(study: Path) -> None:
    keys = parse_toml(STUDY, "")
    predicted = vl.interlab(keys, predict=True)
    assert list(predicted) == list(vl.interlab(study, predict=True))
    assert "<img" not in predicted._repr_html_()
    with pytest.raises(vl.InputError, match=r"^study: laboratories = 'four'"):
        vl.interlab(keys | {"laboratories": "four"}, predict=True)


def test_an_empty_factor_has_the_spread_of_the_users_own_sheet(study: Path) -> None:
    """The stiffness alone has no spread in the catalog, but 2 % in this ball."""
    ball = vl.ball("baseball-2003").with_(stiffness_spread="2 %").save(study.with_name("ball.toml"))
    rules = vl.procedure("astm-f1881").with_(ball=str(ball)).save(study.with_name("rules.toml"))
    text = STUDY.replace('"astm-f1881"', f'"{rules}"')
    study.write_text(text.replace("[factors.wall]", "[factors.stiffness]\n[factors.wall]"))
    found = vl.interlab(study, predict=True)
    rows = {row.term: row for row in found}
    assert rows["stiffness"].factor_spread == "spread 2 %"
    assert f"spread 2 %; {rows['stiffness'].source}" in " ".join(found.text.split())
    assert rows["stiffness"].predicted > 0


def test_selected_draws_are_those_of_the_streams() -> None:
    streams = Streams(1, (), np.arange(3))
    draws = Selected(streams, Quiet(np.arange(3)), ("*", "-lot.*"))
    assert (draws.normal("lot", 2) == streams.normal("lot", 2)).all()
    assert not draws.normal("lot.level").any()
    assert not draws.at(np.array([0, 2])).uniform("lot.store", slots=np.zeros(2, int)).any()


def test_the_clamp_takes_its_share_of_the_angular_momentum() -> None:
    """Full records: e falls by (1 + e) I_clamp/(I_p + I_clamp), with e and I_p of the same test."""
    inertia = 2e-3
    number = f'{{ value = {inertia}, unit = "kg m^2", {ASSUMED} }}'
    text = catalog.text("rigs", "astm-pivot").replace(
        "[pivot]", f"[pivot]\nclamp_inertia = {number}"
    )
    plain = vl.certify("r161", reality="noise-free").certification
    with catalog.sheets_in_place({("rigs", "astm-pivot"): text}):
        clamped = vl.certify("r161", reality="noise-free").certification
    bat, e = plain.bat, plain.quantities["restitution"].value
    lever = bat["length"].value - 6 * 0.0254 - bat["z_cm"].value
    whole = bat["inertia_cm"].value + bat["mass"].value * lever**2
    change = clamped.quantities["restitution"].value - e
    assert change == pytest.approx(-(1 + e) * inertia / (whole + inertia), rel=0.02)


def test_laboratories_with_an_invalid_test_are_left_out() -> None:
    values = np.random.default_rng(1).normal(size=(3, 4, 2, 2))
    values[0, 1, 0, 1] = values[2, 0, 1, 0] = np.nan
    left = np.concatenate([values[0, :1], values[0, 2:], values[1, :1]])  # the first four
    precision = _precision(values)
    assert precision.mean.shape == (2,)
    assert precision.mean[0] == pytest.approx(left.mean())
    with pytest.raises(vl.InputError, match="at least 2 whose tests are all valid, of 12"):
        _precision(np.full((3, 4, 2, 2), np.nan))


KEYS = "bat", "procedure", "result", "term"
STORED = sorted(Path(__file__).parent.glob("interlab-2*.csv"))[-1]


def test_the_shipped_table_is_that_of_the_stored_study() -> None:
    with STORED.open(encoding="utf-8", newline="") as file:
        rows = summarize(csv.DictReader(file))
    for row in rows:
        stored = expected_scatter(row["bat"], row["procedure"])
        assert stored is not None
        for key, value in asdict(stored).items():
            wanted = row[key] if isinstance(value, str) else pytest.approx(row[key], rel=1e-3)
            assert value == wanted, (row["bat"], key)
    unknown = expected_scatter("a bat of mine", "bbcor")
    assert unknown is not None
    of_others = [row["reproducibility"] for row in rows if row["procedure"] == "bbcor"]
    assert min(of_others) < max(of_others) == pytest.approx(unknown.reproducibility, rel=1e-3)
    assert expected_scatter("r161", "mine") is None


def test_the_page_states_the_stored_study() -> None:
    """Every number of the first table, to its last printed digit."""
    page = (Path(vl.__file__).parent / "docs" / "studies" / "laboratories.md").read_text("utf-8")
    lines = page.split("# Laboratories compared")[1].split("\n\n")[2].splitlines()[2:]
    with STORED.open(encoding="utf-8", newline="") as file:
        rows = {tuple(row[key] for key in KEYS): row["simulated"] for row in csv.DictReader(file)}
    for line in lines:
        where, bat, *cells = (cell.strip() for cell in line.strip("| ").split("|"))
        procedure, result = where.replace("`", "").split(", ")
        terms = [(result, term) for term in ("s_r", "s_lot", "s_L", "s_R")]
        for cell in cells.pop(4).split("; "):
            number, control = cell.rstrip(")").split(" (")
            cells.append(number)
            terms.append((f"{result}, control bat {control}", "s_R"))
        terms.insert(4, (result, "stated u"))
        for cell, (name, term) in zip(cells, terms, strict=True):
            unit = 10.0 ** -len(cell.split(".")[1])
            found = float(rows[bat, procedure, name, term])
            assert abs(float(cell) - found) <= 0.51 * unit, (line, term)


def test_a_scatter_is_compared_with_that_of_the_study() -> None:
    """The 1 % limit of χ² with 4 degrees of freedom is 13.28 = 4 · 3.32."""
    stored = expected_scatter("r161", "bbcor")
    assert stored is not None
    s_R = stored.reproducibility
    assert "is what laboratories differ by" in stored.explain(s_R, 5)
    assert "is what laboratories differ by" in stored.explain((3.31**0.5) * s_R, 5)
    assert "is larger than that" in stored.explain((3.33**0.5) * s_R, 5)
    assert "is smaller than that" in stored.explain(0.01 * s_R, 5)


def test_a_study_with_one_lot_is_summarised_without_a_scatter_of_lots() -> None:
    common = {"bat": "r161", "procedure": "bbcor", "result": "as found"}
    found = {"s_r": 0.003, "s_L": 0.004, "s_R": 0.005, "lot": 0.0035, "wall": 0.001}
    (row,) = summarize(common | {"term": term, "simulated": str(sd)} for term, sd in found.items())
    assert (row["lots"], row["cause"]) == (None, "lot")
    said = ExpectedScatter(**row).explain(0.005, 5)
    assert "repeats 0.003, laboratories 0.004; largest cause: lot" in said


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("laboratories = 4", "laboratories = 1", "laboratories = 1; must be greater than or"),
        ("seed = 3", "seed = 3\nrepeats = 1", "repeats = 1; must be greater than or equal to 2"),
        ("alone = 250", "alone = 1", "alone = 1 shows no scatter"),
        ("seed = 3", "seed = 3\nrepeat = 2", "repeat; unknown key, did you mean repeats"),
        ("[factors.wall]", "[factors.walls]", "walls"),
        (
            "[factors.wall]",
            "[factors.stiffness]\n[factors.wall]",
            "factors.stiffness; has no effect, because balls/baseball-2003 has no stiffness_spread",
        ),
        ('0.99, unit = "1"', '0.99, unit = "mph"', "unit 'mph' is not a unit of number"),
        ('"ea70"', '"ea71"', "'ea71'; did you mean ea70"),
        ('"astm-f1881"', '"astm"', "'astm'; did you mean"),
    ],
)
def test_wrong_input_gives_one_line(study: Path, old: str, new: str, said: str) -> None:
    study.write_text(STUDY.replace(old, new, 1))
    with pytest.raises(vl.InputError) as caught:
        vl.interlab(study)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_interaction_is_the_variance_that_the_single_factors_lack() -> None:
    """13² - 3² - 4² = 12², and 0² - 3² - 4² = -5²."""
    row = InterlabTerm(**dict.fromkeys(InterlabTerm.__slots__))
    assert [_interaction([3.0, 4.0], each, 9, row).simulated for each in (13.0, 0.0)] == [12, -5]
