"""Data sheets of a laboratory from its records, against the sheets with which it was played."""

import shutil
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path

import numpy as np
import pytest

import virtual_lab as vl
from tests.studies.own_laboratory import play, rms_u, sample_in, table, texts_of, write_tester
from virtual_lab import api, catalog, lab
from virtual_lab.api.describing import describe
from virtual_lab.bench.entrance.review import summary
from virtual_lab.cli import cli
from virtual_lab.measurement.certification import certify_session
from virtual_lab.records.session import load_session
from virtual_lab.simulation.instruments.calibrated import StandardDeviation
from virtual_lab.simulation.stations.rig import Reality
from virtual_lab.studies.foreign import certify_records
from virtual_lab.studies.own_laboratory import ball
from virtual_lab.studies.own_laboratory.ball import sample_of_tests, with_scatter
from virtual_lab.studies.own_laboratory.own_laboratory import OwnLaboratory
from virtual_lab.studies.own_laboratory.scatter import without_outliers
from virtual_lab.studies.plan.sample import SampledTests
from virtual_lab.units import INCH

FOREIGN = Path(__file__).parents[1] / "foreign_laboratory" / "records"
TESTS = ball.TESTS


@pytest.fixture(autouse=True, scope="module")
def few_tests() -> Iterator[None]:
    """Let few simulated tests find the scatter of the hits, which most tests here do not need."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ball, "TESTS", 64)
        yield


@cache
def foreign(days: int = 1) -> OwnLaboratory:
    """Return the laboratory whose records are in `FOREIGN`, of the same day several times."""
    return vl.laboratory([FOREIGN] * days)


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor"])
def test_recovered_sheets_state_what_the_records_state(procedure: str, tmp_path: Path) -> None:
    """Also one u per board; a laboratory without noise states the numbers of its sheets."""
    (day,) = play(write_tester(tmp_path / "tester", procedure, 7), procedure, 7)
    stated = load_session(day / "records").calibration
    shutil.rmtree(day / "truth")
    ours = vl.laboratory(day)
    ours.save(tmp_path / "ours")
    with catalog.sheets_in_place(texts_of(tmp_path / "ours")):
        setup = lab.TestSetup.of("r161", procedure=procedure, seed=0, reality=Reality.NOISE_FREE)
        recovered = lab.Laboratory.open(setup).calibration
    of_instruments = recovered.keys() - {"ball.radius", "ball.restitution_slope"}
    assert of_instruments == stated.keys() - {"ball.radius", "ball.restitution_slope"}
    for name in of_instruments:
        for part in ("value", "u", "dof"):
            there = getattr(recovered[name], part)[0]
            assert there == pytest.approx(getattr(stated[name], part), rel=1e-9), (name, part)
    boards = [stated[f"impact.gates.height_{at}"].u for at in range(3) if procedure == "bbcor"]
    assert len(set(boards)) == len(boards)  # the records hold one u per board


def test_each_gate_has_the_u_of_its_place_in_the_list() -> None:
    gates = vl.instrument("pivot-gates").with_(distance_u=[0.1, 0.3])
    boards = vl.instrument("light-boards").with_(height_u=[0.1, 0.2, 0.3])
    with catalog.sheets_in_place({(each.kind, each.name): each.text for each in (gates, boards)}):
        for procedure, constant, known in (
            ("astm-f1881", "distance", [1e-4, 3e-4]),
            ("bbcor", "height", [1e-4, 2e-4, 3e-4]),
        ):
            setup = lab.TestSetup.of("r161", procedure=procedure, reality=Reality.NOISE_FREE)
            stated = lab.Laboratory.open(setup).calibration
            each = [stated[f"impact.gates.{constant}_{at}"].u[0] for at in range(len(known))]
            assert each == pytest.approx(known)
    with pytest.raises(vl.InputError, match="3 uncertainties of 2 gates"):
        vl.certify("r161", instruments=vl.instrument("pivot-gates").with_(distance_u=[1, 1, 1]))


def test_sealed_truth_is_never_read(tmp_path: Path) -> None:
    vl.certify("r161", seed=3).save(tmp_path / "day")
    written = []
    for folder in ("with", "without"):
        vl.laboratory(tmp_path / "day").save(tmp_path / folder)
        files = sorted(path for path in (tmp_path / folder).rglob("*.*") if path.is_file())
        written.append([(path.relative_to(tmp_path / folder), path.read_bytes()) for path in files])
        shutil.rmtree(tmp_path / "day" / "truth", ignore_errors=True)
    assert written[0] == written[1]
    assert len(written[0]) > 10


def test_numbers_that_no_record_states_stay(tmp_path: Path) -> None:
    """The mean aim of one day's marks is no standing aim, so the catalog's aim across stays."""
    ours = foreign()
    keys = {f"{row.sheet}/{row.key}" for row in ours.rows}
    assert "instruments/slow-cannon/across_scatter" in keys
    for key in ("across", "across_u", "fastest", "slope_scatter"):
        assert f"instruments/slow-cannon/{key}" not in keys
    ours.save(tmp_path / "ours")
    document = vl.Sheet.of("instruments", tmp_path / "ours/instruments/slow-cannon.toml").document
    usual = vl.instrument("slow-cannon").document
    assert document["across_u"] == usual["across_u"]
    assert "across" not in document
    assert document["along_u"]["source"] == "stated in the records of records"
    assert "identity" not in document
    every = [
        f"{kind}/{name}/{each.key}"
        for kind, name in texts_of(tmp_path / "ours")
        for each in vl.Sheet.of(kind, name).datums
    ]
    assert ours.kept == len(set(every) - keys)


def test_rigs_in_foreign_words_mean_the_usual_rigs(tmp_path: Path) -> None:
    shutil.copytree(FOREIGN, tmp_path / "records")
    form = tmp_path / "records" / "laboratory.toml"
    text = form.read_text("utf-8")
    text = text.replace('bench = "bench"\n', "")  # a stage without a rig
    form.write_text(text.replace('impact = "astm-pivot"', 'impact = "Pivot, hall 2"'), "utf-8")
    described, plain = vl.laboratory(form.parent), foreign()
    assert described.rows == plain.rows
    words = (
        "The records describe the rig of the stage impact as 'Pivot, hall 2'; astm-pivot stands "
        "for it."
    )
    assert described.remark == f"{words}\n{plain.remark}"


def test_two_stages_share_a_cannon_with_two_scatters(tmp_path: Path) -> None:
    vl.certify("r161", procedure="bbcor", seed=3).save(tmp_path / "day")
    ours = vl.laboratory(tmp_path / "day")
    session = certify_records(tmp_path / "day").session
    scatters = {row.sheet: row for row in ours.rows if row.key == "speed_scatter"}
    names = {f"instruments/ball-cannon-{rig}" for rig in ("ball-wall", "ball-cannon")}
    assert scatters.keys() == names
    assert len({row.ours for row in scatters.values()}) == 2
    ours.save(tmp_path / "ours")
    for rig in session.rigs.values():
        document = vl.Sheet.of("rigs", tmp_path / f"ours/rigs/{rig}.toml").document
        if "cannon" in document:
            assert document["cannon"] == f"ball-cannon-{rig}"


def test_scatters_of_several_days_are_pooled_as_variances() -> None:
    """Three values of standard deviations 1 and 7 with one degree of freedom each: √25."""
    days = [StandardDeviation(1.0, 1), StandardDeviation(7.0, 1)]
    assert StandardDeviation.pool(days) == StandardDeviation(5.0, 2)
    assert StandardDeviation.pool(days, known=9.0).value == 4.0
    first, second, both = foreign(), vl.laboratory(FOREIGN), foreign(2)
    assert first.rows == second.rows
    for one, pooled, _ in zip(first.rows, both.rows, count(), strict=False):
        assert one.ours == pytest.approx(pooled.ours)
        assert (one.low is None) == (pooled.low is None)
        if one.low is not None and pooled.low is not None:
            assert pooled.high is not None
            assert one.high is not None
            assert one.low <= pooled.low <= pooled.ours < pooled.high < one.high


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the laboratory whose records are in `FOREIGN`."""
    return foreign().save(tmp_path_factory.mktemp("ours") / "ours")


def test_a_study_takes_instruments_rigs_and_particulars_of_a_laboratory(ours: Path) -> None:
    """Without noise, a test states the constants of the laboratory's records."""
    tested = vl.certify("r161", laboratory=ours, reality="noise-free")
    session, records = tested.certification.session, certify_records(FOREIGN).session
    for name in records.calibration.keys() - {"ball.radius", "ball.restitution_slope"}:
        assert session.calibration[name].u == pytest.approx(records.calibration[name].u), name
    assert session.particulars.instruments == records.particulars.instruments
    scale = vl.instrument("lab-scale").with_(zero_u="1 g")
    changed = vl.certify("r161", laboratory=ours, instruments=scale, reality="noise-free")
    calibration = changed.certification.session.calibration
    assert calibration["bench.scale.zero"].u == pytest.approx(1e-3)
    assert (
        calibration["impact.pivot.from_knob"].u == session.calibration["impact.pivot.from_knob"].u
    )


def test_a_rig_that_a_laboratory_does_not_have_is_refused(ours: Path) -> None:
    """The rig of the catalog never replaces it in silence, also for the second procedure."""
    refused = r"rig = 'ball-cannon'; not in this laboratory; allowed: astm-pivot, ball-wall"
    with pytest.raises(vl.InputError, match=refused):
        vl.sweep("r161", procedures=["astm-f1881", "bbcor"], laboratories=1, laboratory=ours)
    with pytest.raises(vl.InputError, match=refused):
        vl.campaign(
            {"bats": "r161", "procedures": "bbcor", "laboratories": 1, "seed": 1},
            ours.parent / "campaign",
            laboratory=ours,
        )
    with pytest.raises(vl.InputError, match="allowed: a folder with sheets in instruments, rigs"):
        vl.bias(laboratory=FOREIGN)
    with pytest.raises(vl.InputError, match="allowed: the folder of a labor"):
        vl.bias(laboratory=ours / "laboratory.csv")


# file in the folder of a laboratory, and the sheet whose text it has: end of the message
UNUSED = {
    ("balls/mine.toml", "baseball-2003"): (
        r"balls/mine.toml: file = 'mine'; replaces no sheet; allowed: baseball-2003, check-ball"
    ),
    ("balls/baseball-2003.toml", "check-ball"): (
        r"2003.toml: name = 'check-ball'; allowed: baseball-2003, the name of the file"
    ),
    ("instruments/pivot-gate.toml", "pivot-gates"): "did you mean pivot-gates.* allowed: balance-",
    ("rigs/mine.toml", "astm-pivot"): "file = 'mine'; replaces no sheet; .*astm-pivot",
    (
        "bats/r161.toml",
        "r161",
    ): "bats/r161.toml: .* replaces no sheet; allowed: instruments, rigs, b",
    ("procedures/bbcor.toml", "bbcor"): "replaces no sheet; allowed: instruments, ri",
}


@pytest.mark.parametrize(("file", "sheet"), UNUSED)
def test_a_sheet_of_a_laboratory_that_no_test_would_use_is_refused(
    file: str, sheet: str, tmp_path: Path
) -> None:
    """The sheet of the catalog never replaces it in silence."""
    kind, _ = file.split("/")
    (tmp_path / kind).mkdir()
    vl.Sheet.of(kind, sheet).save(tmp_path / file)
    with pytest.raises(vl.InputError, match=UNUSED[file, sheet]):
        vl.coverage(laboratory=tmp_path, laboratories=2, summed=True)


def test_an_instrument_that_a_rig_of_the_laboratory_names_is_used(tmp_path: Path) -> None:
    """The title of a coverage study names the laboratory. A ball may have the name of its file."""
    for kind in ("rigs", "instruments", "balls"):
        (tmp_path / kind).mkdir()
    for name in ("bench", "ball-wall"):
        vl.rig(name).save(tmp_path / f"rigs/{name}.toml")
    vl.rig("astm-pivot").with_(gates="mine").save(tmp_path / "rigs/astm-pivot.toml")
    vl.instrument("pivot-gates").save(tmp_path / "instruments/mine.toml")
    vl.ball("check-ball").save(tmp_path / "balls/check-ball.toml.toml")
    found = vl.coverage(laboratory=tmp_path, laboratories=2, summed=True)
    assert found.title.startswith(f"r161 by astm-f1881 in the laboratory {tmp_path}: the 95 % inte")


def test_faults_are_played_in_a_laboratory_that_has_one_rig(ours: Path) -> None:
    found = vl.faults("clamp-forgotten", procedures="astm-f1881", laboratory=ours, laboratories=2)
    assert [row.fault for row in found] == ["none", "clamp-forgotten"]


def test_every_study_that_plays_tests_takes_a_laboratory() -> None:
    described = {
        name: describe(*place).parameters for name, place in api.PLACES.items() if name.islower()
    }
    takes = {name for name, parameters in described.items() if "laboratory" in parameters}
    of_instruments = {name for name, parameters in described.items() if "instruments" in parameters}
    assert takes == of_instruments | {"twin", "interlab"}
    assert "laboratory" in describe("virtual_lab.commands.rehearse", "day").parameters


def test_settings_state_the_laboratory_and_can_be_read_back(
    ours: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ours.parent)
    words = ["slope", "r161", "ea70", "--laboratory", "ours"]
    cli.main([*words, "--out", "one"], standalone_mode=False)
    assert 'laboratory = "ours"' in Path("one/settings.toml").read_text("utf-8")
    cli.main(["slope", "--config", "one/settings.toml", "--out", "two"], standalone_mode=False)
    cli.main([*words[:3], "--out", "usual"], standalone_mode=False)
    one, two, usual = (
        Path(f"{name}/slope.csv").read_text("utf-8") for name in ("one", "two", "usual")
    )
    assert one == two != usual
    capsys.readouterr()


def test_an_operator_rehearses_in_a_laboratory(ours: Path, tmp_path: Path) -> None:
    """The stored day holds the sheets, so it can be played again without the laboratory."""
    day = vl.rehearse(operator="book", seed=1, laboratory=ours)
    assert day.desk.certification.session.calibration["impact.cannon.along"].value == 0.0
    day.save(tmp_path / "day")
    (row,) = summary(tmp_path)
    assert (row.seal, row.replay_agrees) == ("intact", True)
    assert vl.score(tmp_path / "day").state == "whole"


def test_the_scatter_at_the_bat_is_that_of_its_own_key() -> None:
    """Hits at the wall keep their scatter bit for bit; without the key both are the same."""
    ball = vl.ball("baseball-2003").document
    rules = lab.TestSetup.of("r161", procedure="astm-f1881").rules
    usual, same, still, double = (
        sample_of_tests(each, "r161", rules, 5)
        for each in (ball, *(with_scatter(ball, {"bat": each}) for each in (0.0037, 0.0, 0.0074)))
    )
    assert np.array_equal(usual.total, same.total, equal_nan=True)
    assert np.array_equal(usual.wall_variance, still.wall_variance, equal_nan=True)
    variances = [each.total[usual.has_result].mean() for each in (still, usual, double)]
    assert np.ptp(variances) / np.diff(variances)[0] == pytest.approx(4, rel=0.1)


def test_recovered_hits_scatter_as_those_of_the_tester(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four days of a laboratory whose hits scatter more at the wall than at the bat."""
    monkeypatch.setattr(ball, "TESTS", TESTS)
    monkeypatch.setattr(ball, "LUCK", "{0}: {1}, rms {2:.5g} {3}")
    tester = write_tester(tmp_path / "tester", "astm-f1881", seed=4)
    sheet = vl.Sheet.of("balls", tester / "balls/baseball-2003.toml")
    true = {each.key: each.value for each in sheet.datums}
    days = play(tester, "astm-f1881", seed=9, days=4)
    ours, alone = vl.laboratory(days), vl.laboratory(days[0])
    rows = {row.key: row for row in ours.rows if row.sheet == "balls/baseball-2003"}
    for key in ("hit_restitution", "bat_hit_restitution", "restitution", "mass"):
        row = rows[f"spread.{key}"]
        assert row.low is not None
        assert row.high is not None
        assert row.low < true[f"spread.{key}"] < row.high, key
        (first,) = (each for each in alone.rows if each.key == f"spread.{key}")
        assert first.low is not None
        assert first.high is not None
        assert row.high - row.low < first.high - first.low, key  # pooling helps
    ours.save(tmp_path / "ours")
    u = sample_in(tmp_path / "ours", "astm-f1881", 1024, seed=1).u
    assert ours.remark.count(f"rms {np.sqrt(np.mean(u**2)):.5g} ") == 4
    ratio = rms_u(tmp_path / "ours", "astm-f1881") / rms_u(tester, "astm-f1881")
    assert ratio == pytest.approx(1, abs=0.12)


def test_simulated_tests_have_the_hits_of_the_records(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rms of u is that of tests with 24 hits, also if the rules require only six."""
    monkeypatch.setattr(ball, "LUCK", "{1} {2}")
    rules = vl.procedure("astm-f1881")
    many = vl.certify("r161", procedure=rules.with_(valid_hits=24, attempts=72), seed=4)
    session = replace(many.certification.session, procedure_text=rules.text)
    (remark,) = ball.ball_of_tests([certify_session(session)])[2]
    u, rms = map(float, remark.split()[:2])
    assert u == pytest.approx(many.certification.metric.u)
    assert rms == pytest.approx(u, rel=0.12)  # with six hits 1.4 times larger


def test_hits_near_the_best_position_of_a_scan_show_the_scatter_too() -> None:
    certificate = vl.certify("r161", procedure="bbcor", seed=7)
    half_width = certificate.certification.procedure.scan.fit_half_width / INCH
    hits = certificate.shots.query("valid")
    best = hits.loc[hits["used"], "impact_position_in"].mean()
    near = hits[(hits["impact_position_in"] - best).abs() < half_width + 0.01]
    groups = near.groupby([near["impact_position_in"].round(3), "used"])["metric_restitution"]
    dof = groups.size() - 1
    variance = groups.var().fillna(0) @ dof / dof.sum()
    found = ball.scatter_of_hits(certificate.certification)["bat"]
    assert found.dof == dof.sum() > 15
    assert found.total == pytest.approx(np.sqrt(variance), rel=1e-6)
    simulated = SampledTests.of(lab.RoundRobin.of("r161", "bbcor"), 1, seed=7).pooled
    assert simulated == pytest.approx(variance, rel=0.02)  # records of a test are rounded


def test_hits_at_the_bat_scatter_by_the_error_of_e0_of_their_ball_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Hits at the wall scatter twice as usual, and those at the bat half as much."""
    monkeypatch.setattr(ball, "TESTS", TESTS)
    document, true = vl.ball("baseball-2003").document, {"wall": 0.0074, "bat": 0.0018}
    rules = lab.TestSetup.of("r161", procedure="astm-f1881").rules

    def simulate(scatters: Mapping[str, float]) -> SampledTests:
        return sample_of_tests(with_scatter(document, scatters), "r161", rules, seed=3)

    played = simulate(true)
    shown = {"bat": played.total, "wall": played.wall_variance}
    wanted = {
        place: StandardDeviation(np.sqrt(each[played.has_result].mean()), 30)
        for place, each in shown.items()
    }
    found = ball.hit_scatters(wanted, simulate)
    assert {place: each.value for place, each in found.items()} == pytest.approx(true, rel=0.03)


def test_intervals_of_a_scatter_hold_without_its_known_part() -> None:
    """Readings that scatter by 1 and, of other causes, by 0.3 or 1.5."""
    chance = np.random.default_rng(8)
    for other, readings in ((0.3, 6), (1.5, 6), (1.5, 50)):
        shown = [
            StandardDeviation.of(each)._replace(known=other**2)
            for each in chance.normal(0, np.hypot(1, other), (4000, readings))
        ]
        held = [low <= 1 <= high for low, high in (each.interval for each in shown)]
        assert np.mean(held) == pytest.approx(0.95, abs=0.012)
        squares = [each.total**2 - each.known for each in shown]
        assert np.mean(squares) == pytest.approx(1, abs=0.15)
    assert StandardDeviation(3.0, 5, 5.0).value == 2.0
    assert StandardDeviation(3.0, 5, 5.0).scaled(2) == (6.0, 5, 20.0)


def test_few_sound_shots_keep_their_scatter() -> None:
    """A limit of 6 median deviations would take 9 % off the variance of six shots."""
    shots = np.random.default_rng(9).normal(60, 0.2, (4000, 6))
    variances = [without_outliers(each).var(ddof=1) for each in shots]
    assert np.mean(variances) == pytest.approx(0.2**2, rel=0.03)


def test_folders_with_other_constants_or_other_scatter_are_named(tmp_path: Path) -> None:
    shutil.copytree(FOREIGN, tmp_path / "earlier")
    form = tmp_path / "earlier" / "laboratory.toml"
    text = form.read_text("utf-8")
    assert text.count("u = 0.00176") == 1
    form.write_text(text.replace("u = 0.00176", "u = 0.002"), "utf-8")
    words = "The folders state different constants of bench.scale; those of records are used."
    assert words in vl.laboratory([form.parent, FOREIGN]).remark.splitlines()
    assert "different" not in foreign(2).remark


def test_fragments_before_the_ball_are_no_scatter_of_its_speed() -> None:
    """A shot whose speed a fragment spoils is left out; values of a normal scatter stay."""
    speeds = np.random.default_rng(5).normal(60.8, 0.18, 60)
    spoilt = np.concatenate([speeds, [59.8, np.nan]])
    assert np.array_equal(without_outliers(spoilt), speeds)


def test_the_page_states_the_stored_laboratories() -> None:
    (stored,) = Path(__file__).parent.glob("own-laboratory-*.csv")
    page = (Path(vl.__file__).parent / "docs" / "your-laboratory.md").read_text("utf-8")
    assert stored.name in page
    assert [line for line in table(stored) if line not in page] == []
