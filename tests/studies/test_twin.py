"""The twin: its days against shifted reductions, blind to the truth, clear about bad folders."""

import csv
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import virtual_lab as vl
from tests.laboratories import certified, setup_of
from tests.studies.twin import lines_of
from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.lab import certify_bat
from virtual_lab.measurement.certification import Certification, Certifications, certify_session
from virtual_lab.measurement.procedure.model import CONTROL
from virtual_lab.measurement.session_reduction import reduce_block
from virtual_lab.output.progress import quiet
from virtual_lab.records.session import Session, pack
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.faults.catalogue import CATALOGUE
from virtual_lab.simulation.faults.size import blend, resize
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.physics.beam import barrel_radius, rigid_bat
from virtual_lab.simulation.stations.rig import Reality
from virtual_lab.studies.foreign import certify_records
from virtual_lab.studies.twin import noticing, readings
from virtual_lab.studies.twin.days import TwinDays
from virtual_lab.studies.twin.quantities import compare_quantities
from virtual_lab.studies.twin.readings import (
    TWIN_READINGS,
    differing_readings,
    holm,
    largest_deviation,
)
from virtual_lab.studies.twin.statement import Statement
from virtual_lab.studies.twin.twin import Twin

FOREIGN = Path(__file__).parents[1] / "foreign_laboratory" / "records"
SCALE = "impact.encoder.scale"
DAYS = 400


@pytest.fixture(scope="module")
def certification() -> Certification:
    return certify_records(FOREIGN)


@pytest.fixture(scope="module")
def days(certification) -> TwinDays:
    return TwinDays.fit(Statement.of(certification), seed=1, days=256)


def with_constant(session: Session, key: str, **values: float) -> Session:
    changed = {key: replace(session.calibration[key], **values)}
    return replace(session, calibration={**session.calibration, **changed})


def test_an_uncertain_constant_moves_the_days_as_it_moves_the_reduction(
    certification, days
) -> None:
    """A constant with a large u adds the shift by which the same records are reduced with it."""
    session, u = certification.session, 0.003
    value = session.calibration[SCALE].value
    shifted = certify_session(with_constant(session, SCALE, value=value + u))
    shift = shifted.metric.value - certification.metric.value
    statement = replace(days.statement, session=with_constant(session, SCALE, u=u))
    (plain, *_), _ = compare_quantities(certification, days, DAYS)
    (wider, *_), _ = compare_quantities(certification, replace(days, statement=statement), DAYS)
    assert abs(shift) > plain.error_sd
    # the square of a standard deviation of 400 days has a standard error of 7 %
    assert wider.error_sd**2 == pytest.approx(plain.error_sd**2 + shift**2, rel=0.2)


def test_the_days_scatter_as_the_records_and_find_the_stated_result(certification, days) -> None:
    played = days.play(np.arange(DAYS))
    metric = played.certified.results["metric"]
    variance = metric.scatter.variance.total[played.certified.sound].mean()
    hits = certification.shot_metric[certification.judgement.valid]
    assert variance == pytest.approx(hits.var(ddof=1), rel=0.15)
    taken = [each.records["bench"] for each in (played.certified.block, certification.session)]
    assert taken[0].keys() == taken[1].keys()
    rows, invalid = compare_quantities(certification, days, DAYS)
    assert invalid < 0.02 * DAYS
    for row in rows:
        assert abs(row.mean_z) < 0.3, row.quantity
        assert row.u_ratio == pytest.approx(1, abs=0.25), row.quantity
        assert row.finding == "right"
    assert rows[0].value == certification.metric.value
    assert certification.procedure.metric not in [row.quantity for row in rows]


def test_the_bat_of_the_days_is_the_measured_rigid_body(certification, days) -> None:
    measured, bat = reduce_block(certification.block)[0].preparation.bat, days.statement.bat.spec
    rigid = rigid_bat(bat.body)
    assert rigid.mass == pytest.approx(measured.mass.item(), rel=1e-9)
    assert rigid.z_cm == pytest.approx(measured.z_cm.item(), rel=1e-9)
    assert rigid.inertia_cm == pytest.approx(measured.inertia_cm.item(), rel=1e-9)
    radius = barrel_radius(bat.body.profile)
    assert radius == pytest.approx(measured.barrel_radius.item(), rel=1e-9)


def test_the_ratio_of_a_control_bat_differs_by_its_u(tmp_path: Path) -> None:
    """The standard deviation of 400 days has a standard error of 3.5 %."""
    rules = tmp_path / "rules.toml"
    text = catalog.text("procedures", "bbcor")
    rules.write_text(text.replace('method = "trampoline"', 'method = "control-bat"'))
    tested = vl.certify("r161", procedure=rules, control_bat="check-cylinder", seed=7)
    days = TwinDays.fit(Statement.of(tested.certification), seed=1, days=64)
    stated = tested.certification.session.calibration[CONTROL]
    ratio = days.play(np.arange(DAYS)).laboratory.calibration[CONTROL].value
    assert ratio.mean() == pytest.approx(stated.value, abs=4 * stated.u / np.sqrt(DAYS))
    assert ratio.std(ddof=1) == pytest.approx(stated.u, rel=0.12)
    (metric, *_), _ = compare_quantities(tested.certification, days, DAYS)
    assert abs(metric.mean_z) < 0.3
    assert metric.u_ratio == pytest.approx(1, abs=0.25)


def test_a_u_that_is_too_small_is_found(certification, days) -> None:
    claimed = replace(certification, metric=replace(certification.metric, u=0.003))
    (metric, *_), _ = compare_quantities(claimed, days, DAYS)
    assert metric.finding == "too small"
    claimed = replace(certification, metric=replace(certification.metric, u=0.012))
    (metric, *_), _ = compare_quantities(claimed, days, DAYS)
    assert metric.finding == "too large"


def test_the_truth_behind_the_records_does_not_matter(tmp_path: Path) -> None:
    ours = certified()
    answers = []
    for name, truth in (("one", '{"measurand": {}}'), ("other", "no truth at all")):
        records = tmp_path / name / "records"
        records.mkdir(parents=True)
        pack(ours.certification.session).write(records)
        (tmp_path / name / "truth").mkdir()
        (tmp_path / name / "truth" / "truth.json").write_text(truth)
        answers.append(vl.twin(tmp_path / name, days=100, full_days=0, progress=quiet).document)
    answers.append(vl.twin(ours, days=100, full_days=0, progress=quiet).document)
    assert answers[0] == answers[1]
    assert answers[2]["quantities"] == answers[0]["quantities"]
    assert answers[0]["quantities"][0]["quantity"] == "metric"


def test_another_seed_plays_other_days(certification, days) -> None:
    one, other = (replace(days, seed=seed).play(np.arange(2)) for seed in (1, 2))
    values = [each.certified.results["metric"].value for each in (one, other)]
    assert not np.any(np.isclose(*values, rtol=1e-9))
    alone = days.play(1).certified.results["metric"].value[0]
    assert alone == pytest.approx(values[0][1], rel=1e-12)


def test_folders_that_state_no_day_are_refused_in_one_line(tmp_path: Path) -> None:
    session = certified().certification.session
    impact = {
        name: record.select(slice(1)) if "shot" in record.sizes() else record
        for name, record in session.records["impact"].items()
    }
    one_hit = replace(session, records={**session.records, "impact": impact})
    with pytest.raises(InputError, match="needs a test with a result: fewer than two hits"):
        Statement.of(certify_session(one_hit))
    equal = certified(reality=Reality.NOISE_FREE).certification
    with pytest.raises(InputError, match="hits; all equal or not repeated"):
        Statement.of(equal)
    bench = session.records["bench"]
    once = replace(bench["bat-mass"], readings=bench["bat-mass"].readings[:, :1])
    records = {**session.records, "bench": {**bench, "bat-mass": once}}
    (tmp_path / "records").mkdir()
    pack(replace(session, records=records)).write(tmp_path / "records")
    with pytest.raises(InputError, match=r"repeats = 1; needs at least 2 readings"):
        vl.twin(tmp_path, progress=quiet)
    with pytest.raises(InputError, match="days = 10; allowed: one whole number from 100"):
        vl.twin(FOREIGN, days=10, progress=quiet)
    with pytest.raises(InputError, match="full_days = 200; allowed: 0, or at least 250"):
        vl.twin(FOREIGN, full_days=200, progress=quiet)
    with pytest.raises(InputError, match=r"session.json"):
        vl.twin(tmp_path / "nothing", progress=quiet)
    with pytest.raises(InputError, match=r"impact rig = 'filmed-cannon'; has no twin"):
        TwinDays.fit(
            replace(
                Statement.of(certified().certification),
                session=replace(session, rigs={**session.rigs, "impact": "filmed-cannon"}),
            ),
            seed=1,
        )
    unknown = replace(certified().certification.session, rigs={**session.rigs, "impact": "mine"})
    statement = Statement.of(certify_session(unknown))
    with pytest.raises(InputError, match=r"impact rig = 'mine'; .*installed"):
        TwinDays.fit(statement, seed=1)


def test_balls_that_the_procedure_rejects_are_refused_in_one_line() -> None:
    """The wall of a laboratory drifts so far that e0 is above the limit of the procedure."""
    setup = replace(
        setup_of("r161", procedure="astm-f1881", seed=3), faults=sized_set("wall-drift", 8)
    )
    words = r"ball_restitution = '0.525 to 0.555'; the mean ball of the records has 0.[67]"
    with pytest.raises(InputError, match=words):
        Statement.of(certify_bat(setup).certification)


def test_a_laboratory_that_describes_its_rigs_has_the_days_of_our_rigs(tmp_path: Path) -> None:
    """Descriptions and an optional constant change no number of the days."""
    shutil.copytree(FOREIGN, tmp_path / "lab")
    form = tmp_path / "lab" / "laboratory.toml"
    text = form.read_text("utf-8").replace('bench = "bench"', 'bench = "Scale and pendulum, 1998"')
    text = text.replace('impact = "astm-pivot"', 'impact = "Air cannon and pivot, hall 2"')
    form.write_text(
        text + '"impact.gates.thickness" = { value = 1, unit = "mm", u = 0.1 }\n', "utf-8"
    )
    ours, described = (
        vl.twin(folder, days=100, full_days=0, progress=quiet) for folder in (FOREIGN, form.parent)
    )
    assert [row.error_sd for row in described.rows] == [row.error_sd for row in ours.rows]
    assert described.rows[0].error_sd > 0
    session = certify_records(form.parent).session
    records = {**session.records, "impact": {**session.records["impact"]}}
    records["impact"]["radar"] = records["impact"]["log"]
    statement = Statement.of(certify_session(session))
    foreign = replace(statement, session=replace(statement.session, records=records))
    with pytest.raises(InputError, match="impact records = 'radar'; has no twin: astm-pivot recor"):
        TwinDays.fit(foreign, seed=1)


def test_a_twin_without_a_result_is_refused_in_one_line(certification, days) -> None:
    """An aim so uncertain that the u of the metric is above the limit on every day."""
    name = "impact.cannon.along"
    wide = with_constant(certification.session, name, u=0.03)
    statement = replace(days.statement, session=wide)
    with pytest.raises(InputError, match="none of 8 days of its twin gives a valid result"):
        TwinDays.fit(statement, seed=1, days=8)


def test_holm_adjusts_each_tail_for_those_that_remain() -> None:
    """An example by hand: .005 x 4, .01 x 3, .03 x 2, .04 x 1, none below the one before."""
    assert holm(np.array([0.01, 0.04, 0.03, 0.005])) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_the_largest_deviation_agrees_with_grubbs_test() -> None:
    values = np.array([1.0, 2.0, 3.0, 10.0])  # mean 4, s² = 50/3; 6 / √(1 - 1/4) / s
    assert largest_deviation(values, np.zeros(4)) == pytest.approx(6 / np.sqrt(0.75 * 50 / 3))
    assert np.isnan(largest_deviation(values, np.arange(4)))
    assert np.isnan(largest_deviation(np.ones(4), np.zeros(4)))


def test_the_days_end_when_no_reading_can_be_unlike_its_twins(
    certification, days, monkeypatch
) -> None:
    """Made-up days: a row per reading, its value in the records, and what each day has.

    A day as extreme as the records settles a one-sided reading, because 5 x 2/251 > .02. A
    two-sided reading needs one day on each side: the median of all days may be on either one.
    """
    own = {"hits": 2.0, "wall hits": 2.0, "fit": 2.0, "chords": 0.5, "rebound and recoil": 0.5}
    extreme = {"hits": 3, "wall hits": 7, "fit": 11, "chords": (5, 130), "rebound and recoil": (9,)}
    played: list[int] = []

    def readings_of_day(day: int) -> dict[str, float]:
        one_sided = {name: 3.0 if day == extreme[name] else 1.0 for name in list(own)[:3]}
        below, above = (day == at for at in extreme["chords"])
        return one_sided | {
            "chords": 0.4 if below else 0.6 if above else 0.45,
            "rebound and recoil": np.nan if day % 25 == 1 else day % 2,
        }

    answers = iter([own])

    def read(day: SimpleNamespace | Certifications) -> dict[str, float]:
        return readings_of_day(day.day) if isinstance(day, SimpleNamespace) else next(answers)

    def play(self: TwinDays, day: int, detail: RecordDetail) -> Any:
        played.append(day - readings.FIRST)
        certified = SimpleNamespace(sound=np.array([day % 50 != 0]), day=played[-1])
        return SimpleNamespace(certified=certified)

    monkeypatch.setattr(readings, "readings_of", read)
    monkeypatch.setattr(TwinDays, "play", play)
    rows, number = differing_readings(certification, days, 250)
    assert len(played) == 150  # the second of the chords' days is in the sixth round
    whole = [(day + readings.FIRST) % 50 != 0 and day % 25 != 1 for day in played]
    assert number == sum(whole)
    assert [row.finding for row in rows] == [""] * 5
    extreme["hits"] = -1
    played.clear()
    answers = iter([own])
    rows, number = differing_readings(certification, days, 250)
    assert number == 250  # days without a result or a reading are replaced
    whole = [(day + readings.FIRST) % 50 != 0 and day % 25 != 1 for day in played]
    assert sum(whole) == 250
    assert [row.finding for row in rows] == ["unlike its twins"] + [""] * 4
    assert rows[0].tail_probability == pytest.approx(1 / 251)


def test_altered_records_look_unlike_their_twins(certification, days) -> None:
    """One wall hit, and the gates at the bat, which then show balls that are too large."""
    session = certification.session
    wall, bat = (session.records[stage]["gates"].times.copy() for stage in ("balls", "impact"))
    wall[0, 1] += 1e-3 * np.array([[2.0], [1.0]])
    bat[..., 1] += 10e-6
    records = {
        stage: {
            name: replace(record, times=times) if name == "gates" else record
            for name, record in session.records[stage].items()
        }
        for stage, times in (("balls", wall), ("impact", bat))
    }
    altered = certify_session(replace(session, records={**session.records, **records}))
    sound, _ = differing_readings(certification, days, 9)
    odd, _ = differing_readings(altered, days, 9)
    tails = [{row.reading: row.tail_probability for row in rows} for rows in (sound, odd)]
    for reading in ("wall hits", "chords"):
        assert tails[0][reading] > 0.1, reading
        assert tails[1][reading] == pytest.approx(0.1), reading


def test_a_fault_of_half_the_size_moves_half_as_far(days) -> None:
    """The moved gate and the damped readings of another unit, changed by hand."""
    moved = {size: replace(days, faults=sized_set("gate-moved", size)) for size in (0.0, 0.5, 1.0)}
    at = [
        each.play(0, RecordDetail.FULL).laboratory.impact.gates.true["distance_1"]
        for each in moved.values()
    ]
    assert at[2] - at[0] == pytest.approx(1e-3)
    assert at[1] - at[0] == pytest.approx((at[2] - at[0]) / 2)
    before = {"a": np.array([1.0, np.nan, 3.0]), "b": 7, "c": 1.0}
    after = {"a": np.array([2.0, 5.0, np.nan]), "b": 9, "c": 3.0}
    half = blend(before, after, 0.5)
    np.testing.assert_array_equal(half["a"], [1.5, 5.0, np.nan])
    assert (half["b"], half["c"]) == (9, 2.0)
    assert blend((1.0, 2.0), (3.0, np.inf), 0.5) == (2.0, np.inf)
    assert blend((1.0,), (3.0,), 0.5) == (2.0,)


def test_all_stages_of_a_day_have_one_air_and_one_gravity(days) -> None:
    stations = days.play(np.arange(2)).laboratory.stations.values()
    for part, constant in (("air", "drag_coefficient"), ("hall", "gravity")):
        values = [getattr(each, part).true[constant] for each in stations]
        assert len(values) == 3
        assert values[0][0] != values[0][1]
        np.testing.assert_array_equal(values, [values[0]] * 3)


def sized_set(name: str, size: float) -> FaultSet:
    return FaultSet(faults=(resize(CATALOGUE[name], size),))


def test_a_fault_is_noticed_from_some_size_on(days, monkeypatch) -> None:
    few = ["gate-moved", "ounces-as-grams", "sabot-trip"]
    monkeypatch.setattr(noticing, "faults_at", lambda rig: few)
    monkeypatch.setattr(noticing, "SIZES", (1e-4, 1.0))
    shown = {row.fault: row for row in noticing.noticed_faults(days, 0.006, days=1)}
    assert list(shown) == few
    assert shown["ounces-as-grams"].noticed_from == 1.0
    assert shown["gate-moved"].noticed_at["0.0001"] == 0.0


def test_the_page_states_the_stored_laboratories() -> None:
    """No more than 9 of 200 sound laboratories are pointed at; that is 2 % and 2.5 sigma."""
    stored = sorted(Path(__file__).parent.glob("twin-2*.csv"))[-1]
    with stored.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    page = (Path(vl.__file__).parent / "docs" / "studies" / "twin.md").read_text("utf-8")
    lines = lines_of(rows)
    assert [line for line in lines if line not in page] == []
    assert stored.name in page
    for line in lines[:2]:
        _, _, laboratories, *_, unlike, _ = line.split("|")
        assert int(unlike) <= 9 / 200 * int(laboratories)


def test_the_picture_and_the_text(certification, days, tmp_path: Path) -> None:
    quantities, invalid = compare_quantities(certification, days, DAYS)
    rows, played = differing_readings(certification, days, 3)
    assert [row.reading for row in rows] == list(TWIN_READINGS)
    result = Twin(
        bat="r161",
        procedure="astm-f1881",
        days=DAYS,
        invalid=invalid,
        rows=quantities,
        full_days=played,
        readings=tuple(rows),
    )
    assert result.document["smallest_tail"] == 1.0  # five readings, three days
    assert "The smallest that 3 days can show is 1.000." in result.text
    assert "beside 400 days of its twin" in result.text
    assert result.text.count("\nmetric ") == 1  # one line says all of a quantity
    assert result.table["quantity"][0] == "metric"
    assert list(result.tables) == ["twin", "twin-readings"]
    result.plot(tmp_path / "twin.png")
    assert (tmp_path / "twin.png").read_bytes().startswith(b"\x89PNG")
