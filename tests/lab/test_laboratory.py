"""The whole laboratory: accuracy, reproducibility and ends of a test."""

import hashlib
import re
from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import virtual_lab as vl
from tests.conftest import PROCEDURE, Play
from tests.laboratories import certify, opened
from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.errors import InputError
from virtual_lab.lab.measurand import CONTINUOUS, STANDARD_BALL, WIDTH_KEY
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.measurement.procedure import Procedure, Verdict
from virtual_lab.measurement.procedure.model import AS_FOUND, QUANTITIES
from virtual_lab.records import GateRecord, Record
from virtual_lab.records.session import load_session, save_session
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.instruments.light_gate import LightGates
from virtual_lab.simulation.physics.beam import Pinned
from virtual_lab.simulation.physics.truth import draw_balls, make_bat
from virtual_lab.simulation.stations.rig import Reality, ShotPlan, Specimen, Stage, find_rig
from virtual_lab.streams import Streams

BATS = catalog.names("bats")
BASEBALL = ["r161", "ea70", "barrel-loaded", "knob-loaded"]
RECOVERED = ("bat_performance_factor", "restitution", "collision_efficiency", "recoil_factor")
SEEDS = range(24)
RIGS = [
    ("bench", Stage.BENCH),
    ("ball-wall", Stage.BALLS),
    *((name, Stage.IMPACT) for name in ("astm-pivot", "ball-cannon", "ncaa-swing")),
]


def numbers(certification: Certification) -> dict[str, tuple[float, ...]]:
    """Return every number of a certification's budgets."""
    return {
        name: (budget.value, budget.u, budget.dof, *budget.interval_95)
        for name, budget in (certification.quantities | dict(certification.bat)).items()
    }


def _bats(procedure: str) -> list[str]:
    """Return the bats of the procedure's sport, all of them for the fastest procedure."""
    ball = catalog.load("procedures", procedure, Procedure).spec.ball
    if procedure == PROCEDURE:
        return BATS
    return ["softball-34", "softball-wood-34"] if "softball" in ball else BASEBALL


EACH = [(name, bat) for name in catalog.names("procedures") for bat in _bats(name)]


@pytest.mark.parametrize(("procedure", "bat"), EACH)
def test_ideal_laboratory_recovers_the_truth(procedure: str, bat: str, played: Play) -> None:
    """With perfect instruments and nominal individuals only algebra remains, to 1e-9."""
    tested = played(bat, Reality.IDEAL, procedure=procedure)
    found, true = tested.certification, tested.sealed.measurand
    assert found.hit_weights.reasons == ("",)
    assert found.metric is not None
    assert found.metric.value == pytest.approx(true["metric"], rel=1e-9)
    beside = {"metric", CONTINUOUS, STANDARD_BALL, WIDTH_KEY}
    known = QUANTITIES.keys() | ({AS_FOUND} if found.procedure.normalized else set())
    assert found.quantities.keys() == known == true.keys() - beside
    for name, budget in found.quantities.items():
        assert budget.value == pytest.approx(true[name], rel=1e-9), name
    lost = {reason for reason in found.judgement.reasons if reason}
    assert lost <= {"the gates missed the returning ball"}
    if found.procedure.scan is None:
        assert not lost


def test_a_noise_free_laboratory_measures_e_a_within_1e_3(
    played: Play, capsys: pytest.CaptureFixture[str]
) -> None:
    """With ring, counts, air, friction and the operator's steps, e_A is right within 1e-3.

    If encoder counts are read, it is within three standard uncertainties of the rate of one shot:
    without noise all shots round alike, so six shots are one draw.
    """
    rows, allowed = [], []
    for procedure, bat in EACH:
        tested = played(bat, Reality.NOISE_FREE, procedure=procedure)
        metric, true = tested.certification.metric, tested.sealed.measurand
        assert metric is not None
        found = tested.certification.quantities
        recoil = tested.certification.readings.recoil
        counted = 0.0 if recoil is None else float(np.nanmax(recoil.rate_u / recoil.rate))
        allowed.append(max(1e-3, 3 * counted * (1 + found["collision_efficiency"].value)))
        rows.append(
            [
                f"{procedure:14}{bat:18}",
                metric.value / true["metric"] - 1,
                *(found[name].value - true[name] for name in RECOVERED),
            ]
        )
    with capsys.disabled():
        print(f"\nbias, noise-free: metric (relative), {', '.join(RECOVERED)}")
        for name, *bias in rows:
            print(name + "".join(f"{value:+12.1e}" for value in bias))
    for (name, *bias), most in zip(rows, allowed, strict=True):
        assert abs(bias[1 + RECOVERED.index("collision_efficiency")]) < most, name
        assert abs(bias[0]) < 2 * most, name  # tolerance for e near one half, from the error of e_A


@pytest.mark.parametrize("procedure", ["bbcor", "ncaa-besr", "proposed"])
def test_scans_of_real_days_are_within_4_5_u(procedure: str, played: Play) -> None:
    """Four days each are within 4.5 standard uncertainties, and u is near its expected value.

    The maximum of a fitted curve, or the new mean at the best position, against the sealed result
    of the rules on the exact curve of this bat at the tested positions.
    """
    for seed in range(1, 5):
        tested = played("r161", seed=seed, procedure=procedure)
        metric, true = tested.certification.metric, tested.sealed.measurand
        assert metric is not None
        assert abs(metric.value - true["metric"]) < 4.5 * metric.u
        assert metric.u / metric.value < 0.01
        # tolerance: between positions the curve is higher; the cubic at its top errs by 1e-4
        assert -1e-4 < true[CONTINUOUS] / true["metric"] - 1 < 0.01


def test_noise_free_and_ideal_know_no_seed(played: Play) -> None:
    """Nothing is drawn, so the seed has no effect."""
    for reality in (Reality.NOISE_FREE, Reality.IDEAL):
        first, other = (played("r161", reality, seed) for seed in (1, 2))
        assert numbers(first.certification) == numbers(other.certification)


def test_the_same_seed_gives_the_same_numbers(played: Play) -> None:
    """The test is run twice in one process, the second time from the seed alone."""
    again = certify("r161", procedure=PROCEDURE, seed=1)
    assert numbers(again.certification) == numbers(played(seed=1).certification)
    assert again.sealed.measurand == played(seed=1).sealed.measurand
    assert again.sealed.document() == played(seed=1).sealed.document()


def test_a_chosen_seed_gives_the_same_folder_to_the_byte(tmp_path: Path) -> None:
    """Number, page, records, truth and seal are equal; the salt of a random seed is random, too."""
    for name in ("one", "two"):
        vl.certify("r161", seed=7).save(tmp_path / name)
    files = {path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*")}
    assert files == {path.relative_to(tmp_path / "two") for path in (tmp_path / "two").rglob("*")}
    for name in files:
        if (tmp_path / "one" / name).is_file():
            assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    drawn = [opened("r161", procedure=PROCEDURE) for _ in range(2)]
    assert drawn[0].salt != drawn[1].salt


def test_another_seed_changes_every_number(played: Play) -> None:
    """Another seed gives another bat, balls and noise: no number is equal."""
    first, other = numbers(played(seed=1).certification), numbers(played(seed=2).certification)
    assert all(first[name][0] != other[name][0] for name in first)


def test_a_test_without_a_seed_draws_one() -> None:
    """Two laboratories without a seed differ, and each states its seed."""
    first, other = (certify("r161", procedure=PROCEDURE) for _ in range(2))
    assert first.sealed.seed != other.sealed.seed
    again = certify("r161", procedure=PROCEDURE, seed=first.sealed.seed)
    assert numbers(again.certification) == numbers(first.certification)


@pytest.mark.parametrize("bit", [31, 32, 63, 64, 127])
def test_seeds_that_differ_in_one_bit_give_different_laboratories(bit: int) -> None:
    """Two seeds of 128 bits that differ in one bit give two laboratories."""
    seed = 0xB7E151628AED2A6ABF7158809CF4F3C7
    first, other = (
        opened("r161", procedure=PROCEDURE, seed=each).specimen for each in (seed, seed ^ 1 << bit)
    )
    assert first.bat.body.material.density != other.bat.body.material.density
    assert not (first.balls.mass == other.balls.mass).any()


def test_laboratories_of_one_seed_share_nothing() -> None:
    """Number 0 is the default; number 5, its tests and their control bat have other draws."""
    alone, first, other = (
        opened("r161", procedure=PROCEDURE, seed=1, test=2, **given)
        for given in ({}, {"number": 0}, {"number": 5})
    )
    assert alone.draws == first.draws == Streams(1, (2,))
    assert other.draws == Streams(1, (2,), 5)
    assert other.setup.draws(1, 1_000_000) == Streams(1, (1_000_000,), 5)
    assert alone.specimen.bat == first.specimen.bat != other.specimen.bat
    assert np.array_equal(alone.specimen.balls.mass, first.specimen.balls.mass)
    assert not np.any(first.specimen.balls.mass == other.specimen.balls.mass)
    for stage, station in first.stations.items():
        assert station.true_constants == alone.stations[stage].true_constants
        found = station.true_constants, other.stations[stage].true_constants
        uncertain = [name for name in found[0] if name in station.calibration]
        assert uncertain
        assert not [name for name in uncertain if found[0][name] == found[1][name]]


@pytest.mark.parametrize(
    ("given", "allowed"),
    [
        ({"seed": 1, "number": -1}, "number = -1; allowed: 0 to 2^32 - 1"),
        ({"seed": 1, "number": 2**32}, "number = 4294967296; allowed: 0 to 2^32 - 1"),
        (
            {"number": 3},
            "number = 3; allowed only with a seed: it is the number of a laboratory of the seed",
        ),
    ],
)
def test_a_laboratory_number_out_of_range_is_refused(given: dict[str, int], allowed: str) -> None:
    with pytest.raises(InputError, match=re.escape(allowed)):
        opened("r161", procedure=PROCEDURE, **given)


def test_the_records_say_whether_the_truth_is_sealed() -> None:
    def sealing(**given: Any) -> str:
        laboratory = opened("r161", procedure=PROCEDURE, **given)
        return str(laboratory.sealing).split(":")[0]

    assert sealing() == "sealed"
    assert sealing(seed=0) == "reproducible"
    assert sealing(reality=Reality.NOISE_FREE) == "reproducible"


def test_a_negative_seed_is_refused() -> None:
    """One line: key, value, what is allowed."""
    with pytest.raises(
        InputError, match=r"^seed = -1; allowed: whole numbers from 0 to 2\^128 - 1$"
    ):
        certify("r161", procedure=PROCEDURE, seed=-1)


def test_the_commitment_is_the_hash_of_salt_and_random_seed(played: Play) -> None:
    """A chosen seed has neither commitment nor salt, because it could be found by trying."""
    laboratory = opened("r161", procedure=PROCEDURE)
    said = laboratory.session.origin.seed_commitment
    assert said == hashlib.sha256(laboratory.salt + str(laboratory.seed).encode()).hexdigest()
    assert len(laboratory.salt) == 16
    tested = played(seed=3)
    assert (tested.certification.session.origin.seed_commitment, tested.sealed.salt) == ("", b"")


def test_loaded_records_reduce_to_the_same_bits(played: Play, tmp_path: Path) -> None:
    """Records read from disk give the same results."""
    session = played(seed=1).certification.session
    save_session(session, tmp_path)
    reduced = certify_session(load_session(tmp_path))
    assert numbers(reduced) == numbers(played(seed=1).certification)
    assert reduced.judgement == played(seed=1).certification.judgement
    assert reduced.verdict is played(seed=1).certification.verdict


def test_no_record_holds_the_seed_or_the_truth(tmp_path: Path) -> None:
    """No file contains the 19-digit seed, decimal or hexadecimal, or a true value."""
    seed = 7305918264950173846
    tested = certify("r161", procedure=PROCEDURE, seed=seed)
    save_session(tested.certification.session, tmp_path)
    truth = tested.sealed.measurand
    secrets = {str(seed), f"{seed:x}", repr(float(seed))}
    secrets |= {repr(truth[name]) for name in RECOVERED}
    secrets |= {repr(float(value)) for value in tested.sealed.shots["collision_efficiency"]}
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(written) >= 10
    for path in written:
        text = path.read_text("utf-8")
        assert not [secret for secret in secrets if secret in text], path


def _rules(tmp_path: Path, old: str, new: str) -> str:
    text = catalog.find("procedures", PROCEDURE).read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "strict.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return str(path)


def test_attempts_run_out(tmp_path: Path) -> None:
    """No shot can meet the window: 12 balls are fired, none counts, INVALID without a number."""
    rules = _rules(tmp_path, "speed_tolerance = { value = 1.0", "speed_tolerance = { value = 1e-9")
    said: list[str] = []
    result = certify("r161", procedure=rules, seed=1, progress=said.append).certification
    assert len(result.judgement.reasons) == 12
    assert all(reason.startswith("ball speed ") for reason in result.judgement.reasons)
    assert result.verdict is Verdict.INVALID
    assert result.metric is None
    assert result.quantities == {}
    assert result.other_support is None
    assert not result.marginal
    assert [line for line in said if "round" in line] == [
        "impact rig: round 1, 6 shots",
        "impact rig: round 2, 6 shots",
    ]


def test_a_laboratory_fires_until_enough_hits_are_valid(tmp_path: Path) -> None:
    """A window of 0.4 mph with a scatter of 0.4 mph rejects about a third of the hits."""
    rules = _rules(tmp_path, "speed_tolerance = { value = 1.0", "speed_tolerance = { value = 0.4")
    result = certify("r161", procedure=rules, seed=4).certification
    valid = int(result.judgement.valid.sum())
    assert valid == 6
    assert 6 < len(result.judgement.reasons) <= 12
    shots = result.session.records["impact"]
    fired = shots["log"].ball.tolist()  # in the order of the lot; some balls are set aside
    assert fired == sorted(set(fired))
    assert len(fired) == len(result.judgement.reasons)
    assert len(shots["gates"].times) == len(shots["encoder"].counts) == len(shots["log"].ball)
    # the mean of the valid hits, by definition
    bpf = result.shots.bat_performance_factor[result.judgement.valid]
    assert result.metric.value == pytest.approx(bpf.mean(), rel=1e-12)


@pytest.mark.parametrize(
    ("bat", "procedure", "tests"),
    [("r161", PROCEDURE, 40), ("softball-wood-34", "asa", 4), ("ea70", "bbcor", 4)],
)
def test_statements_on_the_simulation_follow_from_the_setup_alone(
    bat: str, procedure: str, tests: int
) -> None:
    """Forty individual bats, axes and lots, half with a fault, give one text and one number.

    An earlier version stated the error of the individual bat, which followed its modulus (-0.94).
    """
    said, moduli = [], set()
    for seed in range(tests):
        faults = ["scale-not-tared"] if seed % 2 else []
        laboratory = opened(bat, procedure=procedure, seed=seed, faults=faults)
        body = laboratory.specimen.bat.body
        laboratory.specimen.collision(body, Pinned(body.length - 0.15 - 1e-5 * seed))
        models = {"collision": laboratory.collision.report()}
        origin = laboratory.session_of(laboratory.sessions, models).origin
        said.append(origin)
        moduli.add(body.material.youngs_modulus)
    assert len(moduli) == tests
    assert all(each == said[0] for each in said)


def test_the_certificates_of_two_individuals_say_the_same_of_the_simulation(played: Play) -> None:
    """The printed collision models of the whole test are equal."""
    one, other = (played(seed=seed).certification.session.origin for seed in (1, 2))
    assert one == other


def _specimen() -> Specimen:
    ball = catalog.load("balls", "baseball-2003", BallSpec).spec
    return Specimen(
        bat=make_bat(catalog.load_bat("r161").spec, Streams(5)),
        balls=draw_balls(ball, 4, Streams(5)),
        collision=ModalModel.of,
    )


@pytest.mark.parametrize(
    ("rig", "stage", "instrument", "noise", "channel"),
    [
        ("astm-pivot", Stage.IMPACT, "gates", "edge_jitter", "gates"),
        ("astm-pivot", Stage.IMPACT, "encoder", "whole_counts", "encoder"),
        ("astm-pivot", Stage.IMPACT, "cannon", "mark_resolution", "aim"),
        ("bench", Stage.BENCH, "stand", "repeatability", "balance"),
        ("bench", Stage.BENCH, "pendulum", "timer_jitter", "pendulum"),
        ("ball-wall", Stage.BALLS, "gates", "edge_jitter", "gates"),
    ],
)
def test_the_noise_of_an_instrument_is_independent_of_the_others(
    rig: str, stage: Stage, instrument: str, noise: str, channel: str
) -> None:
    """Removing the noise of one instrument changes its channel and no bit of any other."""
    draws, specimen = Streams(5), _specimen()
    turns = np.arange(4)
    plan = ShotPlan(slot=turns, ball=turns, speed=np.full(4, 26.8224), place=np.full(4, 0.16))
    station = find_rig(rig, stage).commission(draws)
    part = getattr(station, instrument)
    quiet = replace(part, spec=replace(part.spec, **{noise: type(getattr(part.spec, noise))(0)}))
    loud = station.play(plan, specimen, draws).records
    calm = replace(station, **{instrument: quiet}).play(plan, specimen, draws).records
    differ = {
        name
        for name, record in loud.items()
        for field in record.columns
        if getattr(record, field).tobytes() != getattr(calm[name], field).tobytes()
    }
    assert differ == {channel}


@pytest.fixture(scope="module")
def scores(played: Play) -> dict[str, np.ndarray]:
    """Return (measured - true)/u of each quantity for the seeds."""
    tests = [played(seed=seed) for seed in SEEDS]
    return {
        name: np.array(
            [
                (t.certification.quantities[name].value - t.sealed.measurand[name])
                / t.certification.quantities[name].u
                for t in tests
                if t.certification.quantities
            ]
        )
        for name in (*RECOVERED, "ball_restitution")
    }


@pytest.mark.parametrize("name", [*RECOVERED, "ball_restitution"])
def test_scores_of_real_days_are_standard_normal(name: str, scores: dict[str, np.ndarray]) -> None:
    """24 seeds: mean z within 4/√24 of 0, standard deviation 0.6 to 1.6, no z beyond 6.

    That of e0 is -0.3, because balls are set aside by their measured e0, and the window ends .005
    above the mean of all lots (`virtual-lab coverage r161 --summed --laboratories 3000`: -.29).

    A Student t with 5 degrees of freedom has a standard deviation of 1.29; with 24 of them the
    sample standard deviation is within 32 % at two standard errors.
    """
    z = scores[name]
    assert len(z) >= 22
    expected = -0.3 if name == "ball_restitution" else 0.0
    assert abs(z.mean() - expected) < 4 / sqrt(len(z))
    assert 0.6 < z.std(ddof=1) < 1.6
    assert np.abs(z).max() < 6


@pytest.mark.parametrize("name", [*RECOVERED, "ball_restitution"])
def test_intervals_of_real_days_cover_the_truth(name: str, played: Play) -> None:
    """At least 19 of 24 intervals of 95 % hold the truth (binomial: fewer by chance 1 in 1000)."""
    held = 0
    for seed in SEEDS:
        tested = played(seed=seed)
        low, high = tested.certification.quantities[name].interval_95
        held += low <= tested.sealed.measurand[name] <= high
    assert held >= 19


def test_the_bat_is_measured_right(played: Play) -> None:
    """Measured against sealed properties of the bat for 24 seeds: |z| < 5, and not all tiny."""
    for name in ("mass", "z_cm", "inertia_cm", "length"):
        z = np.array(
            [
                (t.certification.bat[name].value - float(t.sealed.bat_properties[name]))
                / t.certification.bat[name].u
                for t in (played(seed=seed) for seed in SEEDS)
            ]
        )
        assert np.abs(z).max() < 5, name
        assert abs(z.mean()) < 4 / sqrt(len(z)), name
        assert z.std() > 0.5, name


@pytest.mark.parametrize("compiled", [True, False])
def test_progress_names_each_stage_in_order(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One sentence per stage in the order of the day, after the notice of the first compilation."""
    monkeypatch.setattr("virtual_lab.lab.certify.kernel_is_compiled", lambda: compiled)
    said: list[str] = []
    certify("r161", procedure=PROCEDURE, reality=Reality.IDEAL, progress=said.append)
    if not compiled:
        assert said.pop(0).startswith("compiling the numerical code")
    assert [line.split(":")[0] for line in said] == ["bench", "ball-wall rig", "impact rig"]


def test_a_rig_with_its_axis_elsewhere_is_refused(tmp_path: Path) -> None:
    """The rules require an axis 12 in from the knob; that of the rig is at 6 in."""
    text = catalog.load("procedures", "astm-f1881", Procedure).text
    changed = text.replace("pivot_from_knob = { value = 6,", "pivot_from_knob = { value = 12,")
    assert changed != text
    (tmp_path / "mine.toml").write_text(changed)
    with pytest.raises(InputError, match="pivot_from_knob"):
        certify("r161", procedure=str(tmp_path / "mine.toml"), seed=1)


def test_one_hall_has_one_air_and_one_gravity(played: Play) -> None:
    """All rigs share the constants of the hall, drawn once, for the pendulum and the balls."""
    tested = played("r161", seed=1, procedure="bbcor")
    hall = ["hall.air.density", "hall.air.drag_coefficient", "hall.gravity"]
    for names in (tested.sealed.constants, tested.certification.session.calibration):
        assert sorted(name for name in names if "air." in name or "gravity" in name) == hall
    draws = Streams(5)
    stations = [find_rig(name, stage).commission(draws) for name, stage in RIGS]
    assert {station.hall.acceleration for station in stations} == {stations[0].hall.acceleration}
    assert stations[0].hall.acceleration != stations[0].hall.stated["gravity"].value


@pytest.mark.parametrize("times", ["reversed", "uneven", "constant"])
def test_an_encoder_without_even_ticks_is_refused(times: str, played: Play) -> None:
    session = played().certification.session
    encoder = session.records["impact"]["encoder"]
    good = encoder.times
    bad = {
        "reversed": good[::-1],
        "uneven": good + 1e-6 * (np.arange(good.size) % 2),
        "constant": np.zeros_like(good),
    }[times]
    impact = {**session.records["impact"], "encoder": replace(encoder, times=bad)}
    with pytest.raises(InputError, match="must increase in equal steps"):
        certify_session(replace(session, records={**session.records, "impact": impact}))


@pytest.mark.parametrize("name", ["bench.scale.span", "impact.encoder.scale", "ball.radius"])
def test_a_scale_factor_of_nothing_is_refused(name: str, played: Play) -> None:
    session = played().certification.session
    broken = {**session.calibration, name: replace(session.calibration[name], value=0.0)}
    with pytest.raises(InputError, match=name):
        certify_session(replace(session, calibration=broken))


def test_tests_of_one_laboratory_share_its_rigs_and_nothing_else() -> None:
    """Tests of a laboratory share calibration errors, but not bat, balls and hits."""
    first, second = (
        certify("r161", procedure=PROCEDURE, seed=4, test=test).sealed for test in (0, 1)
    )
    assert first.constants == second.constants
    assert first.bat.body != second.bat.body
    assert not np.any(first.balls.mass == second.balls.mass)
    hits = min(len(first.place), len(second.place))
    assert not np.any(first.shots["speed"][:hits] == second.shots["speed"][:hits])
    elsewhere = certify("r161", procedure=PROCEDURE, seed=5, test=0).sealed
    assert elsewhere.constants != first.constants
    assert elsewhere.bat.body != first.bat.body


def test_hits_lot_and_laboratory_are_new_where_they_are_asked_for() -> None:
    """Three levels: --test, --lot and --number; each alone leaves the other two as they were."""

    def of(**choices: Any) -> tuple[float, float, float]:
        laboratory = opened("r161", procedure=PROCEDURE, seed=4, **choices)
        balls, stations = laboratory.specimen.balls, laboratory.stations
        scale = stations[Stage.BENCH].true_constants["scale.zero"]
        return balls.spec.restitution.slope, balls.mass[0], scale

    first = of()
    assert of(lot=0) == first
    other_lot, other_test, elsewhere = of(lot=1), of(lot=0, test=1), of(number=1)
    assert [one == two for one, two in zip(first, other_lot, strict=True)] == [False, True, True]
    assert [one == two for one, two in zip(first, other_test, strict=True)] == [True, False, True]
    assert not any(one == two for one, two in zip(first, elsewhere, strict=True))
    assert of(lot=1, test=1)[0] == other_lot[0] != of(lot=2, test=1)[0]
    # a numbered test has a lot of its own unless a lot is named
    assert of(test=1)[0] not in (first[0], other_lot[0], of(test=2)[0])


def test_a_lot_that_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(InputError, match=r"^lot = 1; .*with a seed"):
        opened("r161", procedure=PROCEDURE, lot=1)


@pytest.mark.parametrize("bat", ["ea70", "knob-loaded"])
def test_a_bat_that_stops_the_ball_near_its_tip_is_scanned_all_the_same(bat: str) -> None:
    """At 3 in e_A is below 0.05, so the ball does not return to the boards."""
    tested = certify(bat, procedure="bbcor", seed=0, reality=Reality.IDEAL)
    assert tested.certification.hit_weights.reasons == ("",)
    assert tested.certification.metric is not None
    assert tested.certification.metric.value == pytest.approx(
        tested.sealed.measurand["metric"], rel=1e-9
    )


def test_gates_that_see_no_ball_make_an_invalid_test(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a detected ball there is no result and no crash; the certificate says so."""
    whole = LightGates.watch

    def blind(self: LightGates, *args: Any) -> Record:
        record = whole(self, *args)
        return GateRecord(times=np.full_like(record.times, np.nan)) if "astm" in args[4] else record

    monkeypatch.setattr(LightGates, "watch", blind)
    result = certify("r161", procedure=PROCEDURE, seed=1).certification
    assert result.verdict is Verdict.INVALID
    assert set(result.judgement.reasons) == {"the gates missed the incoming ball"}
    assert "No BPF can be stated" in certificate_page(certificate(result))
