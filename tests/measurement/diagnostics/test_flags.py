"""The checks raise no flag on sound days, and each of them detects its fault."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq

from tests.laboratories import certified, certify
from virtual_lab.certificate.document import FlagRaised
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.text import certificate_text
from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import certify_session
from virtual_lab.measurement.diagnostics.bench import _worst_release, wall_drift
from virtual_lab.measurement.diagnostics.flag import REMARKED, Pairs, chances, pairs
from virtual_lab.measurement.diagnostics.impact import AIM_ALONG, _scatter
from virtual_lab.measurement.reduction.observations import BallReadings
from virtual_lab.records import BoardRecord, GateRecord, PendulumRecord, ShotLog
from virtual_lab.records.session import Session
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import Reality
from virtual_lab.uncertainty.budget import combine_components, type_a_component
from virtual_lab.uncertainty.estimate import Estimate


@pytest.mark.parametrize("reality", [Reality.IDEAL, Reality.NOISE_FREE])
@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor", "ncaa-besr"])
def test_a_laboratory_without_noise_is_never_flagged(procedure: str, reality: Reality) -> None:
    """Without scatter, rounding alone must not count as a difference."""
    certification = certified("r161", procedure=procedure, seed=0, reality=reality).certification
    assert certification.flags == ()


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor", "proposed", "ncaa-besr"])
def test_sound_days_raise_no_flag(procedure: str) -> None:
    """None of 5 sound days is flagged, which has 95 % probability at the allowed 1 % per day."""
    for seed in range(300, 305):
        assert certified("r161", procedure=procedure, seed=seed).certification.flags == ()


def test_the_p_value_is_students_t() -> None:
    """The oracle is scipy's t for one component of scatter and no lower limit."""
    for value, dof in ((2.0, 5.0), (3.3, 40.0), (-4.0, 11.0)):
        scatter = type_a_component("scatter", np.zeros(1), np.ones(1), dof)
        u, likely = chances(combine_components(np.array([value]), scatter), 1e-9)
        assert u == pytest.approx(1.0)
        assert likely == pytest.approx(2 * stats.t.sf(abs(value), dof), rel=1e-6)


SPOKEN = {  # check that responds to each fault, by the ASTM procedure
    "balance-from-knob": "bat-shape",
    "pendulum-wide": "pendulum-swing",
    "ball-worn-out": "lot-rules",
    "wall-drift": "wall-drift",
    "gate-doubles": "chords",
    "gate-misses": "ball-seen",
    "aim-across": "aim",
    "encoder-play": "encoder-fit",
    "aim-along": "recoil-and-rebound",
}


@pytest.mark.parametrize("fault", SPOKEN)
def test_each_check_raises_its_flag(fault: str) -> None:
    """One day per fault, chosen so that its check responds; the table of faults has the rates."""
    certification = certified(
        "r161", procedure="astm-f1881", seed=13, faults=(fault,)
    ).certification
    assert SPOKEN[fault] in [flag.name for flag in certification.flags]


@pytest.mark.parametrize(
    ("fault", "check"), [("gate-moved", "boards-in-line"), ("sabot-trip", "edges")]
)
def test_each_check_of_boards_raises_its_flag(fault: str, check: str) -> None:
    certification = certified("r161", procedure="bbcor", seed=12, faults=(fault,)).certification
    assert check in [flag.name for flag in certification.flags]


def test_a_flag_is_on_every_certificate() -> None:
    tested = certified("r161", procedure="astm-f1881", seed=12, faults=("aim-across",))
    document = certificate(tested.certification)
    (flag,) = document.flags
    assert flag.name == "aim"
    assert flag.sentence in certificate_text(document)
    assert flag.sentence in certificate_page(document)


def test_a_softball_bat_under_a_baseball_procedure_is_flagged() -> None:
    """The flag uses only what the session says, not the truth."""
    tested = certified("softball-34", procedure="astm-f1881", seed=0, reality=Reality.IDEAL)
    (flag,) = tested.certification.flags
    assert flag.name == "sports"
    assert "bat is for softball, the ball is for baseball, the procedure is for" in flag.sentence
    document = certificate(tested.certification)
    assert document.flags == (FlagRaised(name="sports", sentence=flag.sentence, invalidates=False),)
    assert flag.sentence in certificate_text(document)
    assert flag.sentence in certificate_page(document)
    unknown = replace(tested.certification.session, bat_sport="")
    assert certify_session(unknown).flags == ()
    swapped = replace(tested.certification.session, bat_sport="baseball", ball_sport="softball")
    assert "ball is for softball" in certify_session(swapped).flags[0].sentence


def test_a_softball_bat_under_a_softball_procedure_is_not_flagged() -> None:
    tested = certified("softball-34", procedure="asa", seed=0, reality=Reality.IDEAL)
    assert tested.certification.flags == ()


def test_a_check_standard_does_not_count_as_a_bat_that_passed() -> None:
    """The cylinder meets the limits of the rules, but the certificate says that no bat passed."""
    tested = certified("check-cylinder", procedure="astm-f1881", seed=0, reality=Reality.IDEAL)
    assert tested.certification.verdict.value == "PASS"
    assert [flag.name for flag in tested.certification.flags] == ["check-standard"]
    assert "no bat" in certificate_text(certificate(tested.certification))
    unmarked = replace(tested.certification.session, bat_sport="")
    assert certify_session(unmarked).flags == ()


def changed(session: Session, stage: str, channel: str, **fields: object) -> Session:
    """Return a session with changed fields in one record."""
    records = {name: dict(each) for name, each in session.records.items()}
    records[stage][channel] = replace(records[stage][channel], **fields)
    return replace(session, records=records)


@pytest.fixture(scope="module")
def sound() -> Session:
    return certified("r161", procedure="astm-f1881", seed=300).certification.session


def test_gates_of_a_single_beam_are_no_fault(sound: Session) -> None:
    """Each ball crosses the beam some millimeters off its center, so it shows a chord."""
    radius, rng = 36.5e-3, np.random.default_rng(5)
    session = sound
    for stage in ("balls", "impact"):
        times = session.records[stage]["gates"].times
        height = rng.normal(0, 6e-3, times.shape[:1])[:, None, None] + rng.normal(
            0, 1e-3, times.shape[:3]
        )
        middle, chord = times.mean(axis=-1, keepdims=True), np.sqrt(1 - (height / radius) ** 2)
        session = changed(
            session, stage, "gates", times=middle + (times - middle) * chord[..., None]
        )
    assert certify_session(session).flags == ()


def test_encoder_noise_that_is_also_present_at_rest_is_no_fault(sound: Session) -> None:
    counts = sound.records["impact"]["encoder"].counts
    noise = np.rint(np.random.default_rng(6).normal(0, 1, counts.shape))
    assert certify_session(changed(sound, "impact", "encoder", counts=counts + noise)).flags == ()


def test_a_late_encoder_trigger_makes_a_test_invalid(sound: Session) -> None:
    """Five milliseconds late, the impact is inside the fitted part, so no shot is valid."""
    record = sound.records["impact"]["encoder"]
    certification = certify_session(changed(sound, "impact", "encoder", times=record.times + 5e-3))
    assert certification.verdict.value == "INVALID"
    assert certification.reasons == ("fewer than two hits were valid",)
    assert all(
        "no smooth rotation fits the encoder record" in reason
        for reason in certification.judgement.reasons
    )
    document = certificate(certification)
    assert document.verdict == "INVALID"
    assert "no smooth rotation fits the encoder record" in certificate_text(document)
    assert "no smooth rotation fits the encoder record" in certificate_page(document)


def pair(value: float, u: float, **options: float) -> Pairs:
    """Return the comparison of a block of one laboratory."""
    components = type_a_component("scatter", np.zeros(1), np.array([u]))
    return pairs("of-two", lambda _: "said", np.array([value]), components, **options)


@pytest.mark.parametrize(("chance_of", "raised"), [(6e-4, None), (4e-4, False), (9e-6, True)])
def test_a_p_value_below_5e_4_is_a_remark_and_below_1e_5_invalidates(
    chance_of: float, raised: bool | None
) -> None:
    """The difference is the two-sided normal quantile of the p-value, in units of u."""
    apart = float(stats.norm.isf(chance_of / 2))
    for value in (0.2 * apart, -0.2 * apart):
        comparison = pair(value, 0.2, least=1e-9)
        assert comparison.likely == pytest.approx(chance_of, rel=1e-6)
        assert comparison.sigmas == pytest.approx(apart)
        flag = comparison.row(0)
        assert (flag and flag.invalidates) is raised
        assert (
            flag is None
            or flag.sentence == f"said, a difference of {apart:.1f} standard uncertainties"
        )


def test_a_difference_that_barely_changes_the_result_is_only_a_remark() -> None:
    """The difference is 20 u of its own; a change of the result by u/20 counts as noise."""
    values = {"value": 20.0, "u": 1.0, "least": 1e-9}
    harmless = pair(moves=0.001, **values).row(0)
    assert harmless is not None
    assert not harmless.invalidates
    # score with normal noise of hypot(1, 0.05 / 0.01) u: 20 is 3.92 standard deviations
    bad = pair(moves=0.01, **values)
    assert bad.harmful == pytest.approx(2 * stats.norm.sf(20 / 26**0.5))
    assert not bad.voids.any()
    worse = pair(moves=0.0125, **values)  # score 20 / hypot(1, 4) = 4.85
    assert worse.voids.all()
    assert pair(moves=0.0, **values).harmful == 1.0


def test_the_p_value_accounts_for_the_number_of_comparisons() -> None:
    """The p-value of the worst of six is 1 - (1 - p)^6."""
    values = {"value": 3.0, "u": 1.0, "least": 1e-9}
    one, six = pair(**values), pair(among=6, **values)
    assert six.likely == pytest.approx(1 - (1 - one.likely) ** 6)


@pytest.mark.parametrize(("factor", "raised"), [(1.004, None), (1.010, False), (1.016, True)])
def test_recoil_and_rebound_are_flagged_on_the_right_side_of_each_limit(
    sound: Session, factor: float, raised: bool | None
) -> None:
    """The encoder reads less than its certificate states, by 0.4, 1.0 and 1.6 %."""
    key = "impact.encoder.scale"
    scale = replace(sound.calibration[key], value=factor * sound.calibration[key].value)
    certification = certify_session(replace(sound, calibration={**sound.calibration, key: scale}))
    (apart,) = [each for each in certification.pairs if each.name == "recoil-and-rebound"]
    named = {flag.name: flag.invalidates for flag in certification.flags}
    assert named.get("recoil-and-rebound") is raised
    assert (certification.verdict.value == "INVALID") is (raised is True)
    assert apart.sigmas < 9


@pytest.mark.parametrize("left", [1, 2])
def test_one_rebound_is_enough_to_detect_a_wrong_encoder(sound: Session, left: int) -> None:
    """All other rebounds are removed; the aim marks give the scatter. The encoder is 5 % off."""
    times = sound.records["impact"]["gates"].times.copy()
    back = np.flatnonzero(np.isfinite(times[:, 1]).all(axis=(1, 2)))
    times[back[left:], 1] = np.nan
    few, key = changed(sound, "impact", "gates", times=times), "impact.encoder.scale"
    (apart,) = [each for each in certify_session(few).pairs if each.name == "recoil-and-rebound"]
    assert apart.sigmas < 3
    scale = replace(sound.calibration[key], value=1.05 * sound.calibration[key].value)
    certification = certify_session(replace(few, calibration={**sound.calibration, key: scale}))
    assert certification.reasons == ("flag recoil-and-rebound",)


def test_shots_and_aim_marks_give_one_pooled_variance() -> None:
    """The oracle is the pooled variance of scipy's t-test of two samples."""
    shots, marks, lever = np.array([0.31, 0.27, 0.34]), np.array([[4.0, 1.0, -2.0, 6.0]]), -0.02
    mean, u = shots.mean(keepdims=True), stats.sem(shots)
    evidence = SimpleNamespace(mean_of=lambda *_: (mean, np.array([u]), np.array([3.0])))
    shared = SimpleNamespace(names=(AIM_ALONG,), sensitivity=np.array([[lever]]))
    square, degrees = _scatter(evidence, shots, shots > 0, shared, marks)
    two = stats.ttest_ind(shots, lever * marks[0])
    apart = mean - lever * marks.mean()
    assert square == pytest.approx((apart / two.statistic) ** 2 / (1 / 3 + 1 / 4))
    assert degrees == two.df


def test_a_contradiction_is_on_every_certificate(sound: Session) -> None:
    key = "impact.encoder.scale"
    scale = replace(sound.calibration[key], value=1.03 * sound.calibration[key].value)
    certification = certify_session(replace(sound, calibration={**sound.calibration, key: scale}))
    assert certification.verdict.value == "INVALID"
    assert certification.reasons == ("flag recoil-and-rebound",)
    assert not certification.marginal
    document = certificate(certification)
    assert document.verdict == "INVALID"
    assert "INVALID: flag recoil-and-rebound" in certificate_text(document)
    assert "flag recoil-and-rebound" in certificate_page(document)


def test_a_slow_slip_within_the_residual_makes_a_test_invalid(sound: Session) -> None:
    """Two counts lost over 20 ms keep the residual below its limit, yet move the result by 4 u."""
    record = sound.records["impact"]["encoder"]
    lost = np.round(2 * np.clip((record.times - 0.04) / 0.02, 0, 1))
    certification = certify_session(
        changed(sound, "impact", "encoder", counts=record.counts - lost)
    )
    assert set(certification.judgement.reasons) == {""}
    assert certification.reasons == ("flag encoder-halves",)
    (said,) = [flag.sentence for flag in certification.flags if flag.name == "encoder-halves"]
    assert said.startswith(
        "the half of each impact/encoder record nearest contact, used alone, shifts "
    )
    assert " of its u (shots 1, 2, 3, 4, 5, 6), " in said


def test_a_repeated_encoder_record_makes_a_test_invalid(sound: Session) -> None:
    """The rates would scatter too little. Two equal records of a bat at rest are no repetition."""
    counts = sound.records["impact"]["encoder"].counts.copy()
    counts[[0, 1]] = 17.0
    still = certify_session(changed(sound, "impact", "encoder", counts=counts))
    assert "records-repeated" not in [flag.name for flag in still.flags]
    counts[4] = counts[2]
    certification = certify_session(changed(sound, "impact", "encoder", counts=counts))
    (said,) = [flag for flag in certification.flags if flag.name == "records-repeated"]
    assert said.invalidates
    assert said.sentence.startswith("shots 3 and 5 have identical records in impact/encoder")


def filed(session: Session, stage: str, of: int, shots: list[int]) -> Session:
    """Return a session in which the gate record of one shot replaces those of others."""
    times = session.records[stage]["gates"].times.copy()
    times[shots] = times[of]
    return changed(session, stage, "gates", times=times)


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor"])
def test_a_repeated_gate_record_makes_a_test_invalid(procedure: str) -> None:
    """At the wall or at the bat; the ball or the encoder shows that these were two shots."""
    session = certified("r161", procedure=procedure, seed=300).certification.session
    for stage in ("balls", "impact"):
        log, gates = session.records[stage]["log"], session.records[stage]["gates"]
        assert isinstance(log, ShotLog)
        assert isinstance(gates, GateRecord | BoardRecord)
        ball, back = log.ball, np.isfinite(gates.times[:, 1])
        visible = back.reshape(*back.shape[:2], -1).any(axis=2)
        whole = np.flatnonzero(visible.all(axis=1))
        first = int(whole[0])
        other = next(int(shot) for shot in whole if ball[shot] != ball[first])
        certification = certify_session(filed(session, stage, first, [other]))
        (said,) = [flag for flag in certification.flags if flag.name == "records-repeated"]
        assert said.invalidates
        assert said.sentence.startswith(
            f"shots {first + 1} and {other + 1} have identical records in {stage}/gates"
        )


def test_one_repeated_flight_in_may_be_chance(sound: Session) -> None:
    """Without a rebound, six edges in steps of a microsecond may repeat once, but not twice."""
    times = sound.records["impact"]["gates"].times.copy()
    times[:, 1] = np.nan
    flown = changed(sound, "impact", "gates", times=times)
    once = certify_session(filed(flown, "impact", 0, [1])).flags
    assert "records-repeated" not in [flag.name for flag in once]
    twice = certify_session(filed(flown, "impact", 0, [1, 2])).flags
    assert "records-repeated" in [flag.name for flag in twice if flag.invalidates]


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor"])
def test_a_pendulum_passage_lost_or_doubled_in_every_release_makes_a_test_invalid(
    procedure: str,
) -> None:
    """Of ten swings nine remain, one twice as long, so their mean is 10/9 of the true one.

    With a passage counted twice eleven swings remain, two of them halves; their mean is 10/11.
    """
    session = certified("r161", procedure=procedure, seed=300).certification.session
    record = session.records["bench"]["pendulum"]
    assert isinstance(record, PendulumRecord)
    middle = record.times.shape[1] // 2
    lost = np.delete(record.times, middle, axis=1)
    between = record.times[:, middle - 1 : middle + 1].mean(axis=1)
    twice = np.insert(record.times, middle, between, axis=1)
    swings = record.times.shape[1] - 1
    for times, remaining in ((lost, swings - 1), (twice, swings + 1)):
        certification = certify_session(changed(session, "bench", "pendulum", times=times))
        (flag,) = [each for each in certification.flags if each.name == "pendulum-even"]
        assert flag.invalidates
        stated_size = float(flag.sentence.split("%")[0].rpartition(" ")[2])
        assert stated_size == pytest.approx(100 * (swings / remaining - 1), abs=0.05)


@pytest.mark.parametrize(("off", "raised"), [(3.3, False), (-3.7, True), (9.0, True)])
def test_measured_and_stated_air_densities_are_compared(
    sound: Session, off: float, raised: bool
) -> None:
    """Deviations on both sides of the limit, 3.48 u; the measured density has u .0022 kg/m³.

    By hand: 22 °C, 45 % and 1013.25 hPa give 1.1911 kg/m³ (CIPM-2007). The result barely changes.
    """
    key, logger = "hall.air.density", "bench.climate."
    climate = {"temperature": 295.15, "humidity": 0.45, "pressure": 101_325.0}
    fields = {
        name: np.full(2, value + sound.calibration[logger + name].value)
        for name, value in climate.items()
    }
    read = changed(sound, "bench", "climate", **fields)
    stated = replace(sound.calibration[key], value=1.1911 - off * np.hypot(0.02, 0.0022), u=0.02)
    certification = certify_session(replace(read, calibration={**sound.calibration, key: stated}))
    assert [flag.name for flag in certification.flags] == ["air-density"] * raised
    assert certification.verdict.value == "PASS"
    (pair,) = [each for each in certification.pairs if each.name == "air-density"]
    assert pair.sigmas == pytest.approx(abs(off), rel=0.01)
    without = {name: each for name, each in sound.records["bench"].items() if name != "climate"}
    silent = replace(sound, records={**sound.records, "bench": without})
    assert "air-density" not in {each.name for each in certify_session(silent).pairs}


@pytest.mark.parametrize(("sigmas", "raised"), [(3.2, None), (-4.4, False), (40.0, True)])
def test_the_reference_mass_detects_a_drift_of_the_scale(
    sound: Session, sigmas: float, raised: bool | None
) -> None:
    """Five readings before and after, standard deviation 0.1 g, resolution 0.1 g.

    By hand the variance is 2 (.1²/5 + .1²/12).
    """
    scatter = 0.1e-3 * np.array([-2, -1, 0, 1, 2]) / np.sqrt(10 / 4)
    u = np.sqrt(2 * 0.1e-3**2 / 5 + 2 * 0.1e-3**2 / 12)
    after = 0.5 + scatter + sigmas * u
    readings = np.stack([0.5 + scatter, after])
    certification = certify_session(changed(sound, "bench", "reference-mass", readings=readings))
    flags = {flag.name: flag for flag in certification.flags}
    assert {name: flag.invalidates for name, flag in flags.items()} == (
        {} if raised is None else {"scale-drift": raised}
    )
    (pair,) = [each for each in certification.pairs if each.name == "scale-drift"]
    assert pair.sigmas == pytest.approx(abs(sigmas), rel=1e-6)
    assert f" changed by {sigmas * u * 1e3:+.2f} g while" in pair.sentence


def test_without_a_reference_mass_the_drift_is_listed_as_not_checked(sound: Session) -> None:
    assert certify_session(sound).not_checked == ()
    bench = {name: each for name, each in sound.records["bench"].items() if "reference" not in name}
    certification = certify_session(replace(sound, records={**sound.records, "bench": bench}))
    assert certification.not_checked == ("scale-drift",)
    assert certification.metric == certify_session(sound).metric
    document = certificate(certification)
    said = "ot checked, because no reference mass was weighed before and after the test: scale"
    assert said in certificate_text(document)
    assert f"{said} drift." in certificate_page(document)


@pytest.mark.parametrize("shape", [(1, 5), (3, 5), (2, 1)])
def test_a_reference_mass_is_weighed_before_and_after_and_more_than_once(
    sound: Session, shape: tuple[int, int]
) -> None:
    odd = changed(sound, "bench", "reference-mass", readings=np.full(shape, 0.5))
    with pytest.raises(
        InputError,
        match=r"bench/reference-mass: size = '. items, . readings of each'; needs items 0",
    ):
        certify_session(odd)


@pytest.mark.parametrize("way", [0, 1])
@pytest.mark.parametrize("lost", [1, 24])
def test_missing_passages_at_the_wall_are_counted(sound: Session, way: int, lost: int) -> None:
    """The wall returns every ball, so a missing passage is a fault in either direction; 48 hits."""
    times = sound.records["balls"]["gates"].times.copy()
    assert len(times) == 48
    times[1 : 2 * lost : 2, way, 0] = np.nan
    (flag,) = certify_session(changed(sound, "balls", "gates", times=times)).flags
    assert flag.name == "ball-seen"
    assert flag.sentence.endswith(f"the returning ball in {lost} of 48 hits at the wall")


def with_a_gap(session: Session, releases: list[int], passage: int, by: float) -> Session:
    """Return a session in which the swings before `passage` are longer by the share `by`."""
    times = session.records["bench"]["pendulum"].times.copy()
    gap = times[releases, passage] - times[releases, passage - 1]
    times[releases, passage:] += by * gap[:, None]
    return changed(session, "bench", "pendulum", times=times)


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor"])
@pytest.mark.parametrize(
    ("releases", "passage", "by", "shown"), [([2], 5, 1.0, "2.00"), ([4, 1], 10, -0.5, "0.50")]
)
def test_a_release_with_a_passage_lost_or_doubled_is_left_out_and_named(
    procedure: str, releases: list[int], passage: int, by: float, shown: str
) -> None:
    """The result is that of the other releases, to u/5; with this release it is 7 u off."""
    session = certified("r161", procedure=procedure, seed=300).certification.session
    untouched = certify_session(session).metric
    certification = certify_session(with_a_gap(session, releases, passage, by))
    assert abs(certification.metric.value - untouched.value) < 0.2 * untouched.u
    assert certification.metric.u == pytest.approx(untouched.u, rel=0.01)
    (flag,) = certification.flags
    assert not flag.invalidates
    assert flag.sentence.startswith(
        f"in release {min(releases) + 1} of bench/pendulum, the swing after passage {passage} "
        f"takes {shown} times the usual time, "
    )
    assert f"releases with such a swing: {len(releases)} of 5, left out" in flag.sentence


def test_too_few_consistent_releases_make_a_test_invalid(sound: Session) -> None:
    """Three of five releases are wrong, or one of two."""
    record = sound.records["bench"]["pendulum"]
    assert isinstance(record, PendulumRecord)
    two = replace(
        sound,
        records=sound.records
        | {"bench": sound.records["bench"] | {"pendulum": record.select(slice(2))}},
    )
    for few in (with_a_gap(sound, [0, 2, 3], 5, 1.0), with_a_gap(two, [1], 5, 1.0)):
        flags = certify_session(few).flags
        assert [flag.invalidates for flag in flags if flag.name == "pendulum-even"] == [True]


def test_a_release_far_from_the_others_is_judged_by_their_scatter(sound: Session) -> None:
    """A last passage 0.1 s late moves BBCOR by u/2, and far exceeds the scatter of the others."""
    certification = certify_session(with_a_gap(sound, [1], 10, 0.07))
    (flag,) = [each for each in certification.flags if each.name == "pendulum-even"]
    assert flag.invalidates
    assert (
        "in release 2 of bench/pendulum, the ratio of mean to median swing time differs by 0.70%"
        in flag.sentence
    )


@pytest.mark.parametrize("releases", [4, 5, 8])
def test_the_p_value_of_the_worst_release_is_right(releases: int) -> None:
    """40 000 laboratories with normal scatter; counts agree to four standard deviations.

    The same holds for INVALID, if each difference changes the result by as many u.
    """
    apart = np.random.default_rng(20261126).normal(3.0, 0.1, (40_000, releases))
    comparison = _worst_release(apart, np.full(len(apart), 10.0 * releases))
    for likely in (comparison.likely, comparison.harmful):
        for chance_of in (0.05, 0.01, 1e-3):
            number, most = np.sum(likely < chance_of), chance_of * len(apart)
            assert number < most + 4 * most**0.5
    assert np.sum(comparison.likely < 0.05) > 0.9 * 0.05 * len(apart)


def test_a_release_shifts_the_mean_by_its_share() -> None:
    """A release of five is off by two harmless shifts, each 5 % of the u of the result."""
    off, count = 1e-3, 5
    comparison = _worst_release(
        np.array([[off, 1e-9, -1e-9, 2e-9, 0.0]]), np.array([2 * 0.05 * count / off])
    )
    assert comparison.harmful == pytest.approx(1 - (1 - 2 * stats.norm.sf(2)) ** count, rel=1e-2)


def test_marks_far_off_the_aim_make_a_test_invalid() -> None:
    """Half an inch along the bat is 7.7 u of the bbcor result."""
    certification = certified(
        "r161", procedure="bbcor", seed=12, faults=("aim-along",)
    ).certification
    assert "flag aim" in certification.reasons


def test_the_certificate_lists_the_checks_that_summed_records_cannot_make() -> None:
    tested = certify("r161", procedure="astm-f1881", seed=300, detail=RecordDetail.SUMMED)
    assert tested.certification.not_checked == (
        "chords",
        "edges",
        "records-repeated",
        "encoder-fit",
        "encoder-halves",
    )
    said = certificate_text(certificate(tested.certification))
    assert (
        "not checked, because the recorders stored no individual readings: chords, edges, "
        "records-repeated" in said
    )
    assert "Not checked, because the recorders stored no individual readings" in certificate_page(
        certificate(tested.certification)
    )


def test_an_impossible_density_makes_a_test_invalid(sound: Session) -> None:
    """Ounces were entered as grams, so the bat is lighter than balsa."""
    mass = sound.records["bench"]["bat-mass"]
    light = certify_session(changed(sound, "bench", "bat-mass", readings=mass.readings * 0.0353))
    assert "flag bat-shape" in light.reasons
    (said,) = [flag.sentence for flag in light.flags if flag.name == "bat-shape"]
    assert "kg/m³; possible densities are 100 to 12000 kg/m³" in said


def test_an_uncertainty_above_the_limit_makes_a_test_invalid(sound: Session) -> None:
    """The u of the result is just below or just above the largest permitted u."""
    at = certify_session(sound).metric
    assert at is not None
    for factor, verdict in ((1.01, "PASS"), (0.9, "INVALID")):
        largest = f"largest_u = {{ value = {factor * at.u}"
        text = sound.procedure_text.replace("largest_u = { value = 0.02", largest)
        assert text != sound.procedure_text
        certification = certify_session(replace(sound, procedure_text=text))
        assert certification.verdict.value == verdict
    (reason,) = certification.reasons
    assert reason.startswith(f"the u of BPF is {at.u:.2g}, allowed up to 0.00")


def with_survey(session: Session, **off: float) -> Session:
    """Return a session whose surveyed gate distances at the bat are larger by `off` [m]."""
    calibration = dict(session.calibration)
    for name, more in off.items():
        key = f"impact.gates.{name}"
        calibration[key] = replace(calibration[key], value=calibration[key].value + more)
    return replace(session, calibration=calibration)


@pytest.mark.parametrize(
    ("board", "off", "said"), [(1, 1e-3, 1.0), (1, -1e-3, -1.0), (0, 1e-3, -0.5), (2, 1e-3, -0.5)]
)
def test_a_wrong_board_distance_is_stated_with_sign_and_size(
    board: int, off: float, said: float
) -> None:
    """Three equidistant boards; an error at either end shifts the middle board by half of it."""
    ideal = certified("r161", procedure="bbcor", seed=0, reality=Reality.IDEAL).certification
    (flag,) = certify_session(with_survey(ideal.session, **{f"distance_{board}": off})).flags
    stated_size = flag.sentence.split(" mm")[0].rpartition(" ")[2]
    assert flag.name == "boards-in-line"
    assert stated_size[0] in "+-"
    assert float(stated_size) == pytest.approx(said, abs=0.011)


def counted_from_another_beam(session: Session, boards: list[int], beams: int) -> Session:
    """Return a session in which the beams of some boards are shifted up by `beams`."""
    times = session.records["impact"]["gates"].times.copy()
    for board in boards:
        times[:, :, board] = np.roll(times[:, :, board], beams, axis=2)
    return changed(session, "impact", "gates", times=times)


@pytest.mark.parametrize(
    ("boards", "said"),
    [
        ([0], {"board 2": -4.0, "marks": -0.83 * 8}),
        ([1], {"board 2": 8.0, "marks": 0.33 * 8}),
        ([2], {"board 2": -4.0, "marks": 1.5 * 8}),
        ([0, 1, 2], {"board 2": 0.0, "marks": 8.0}),
    ],
)
def test_a_shifted_beam_count_makes_a_test_invalid(
    boards: list[int], said: dict[str, float]
) -> None:
    """Beams are 8 mm apart on boards at 0.50, 0.35 and 0.20 m.

    The middle board shows its own shift fully, and that of another board by half. A least-squares
    line weighs the boards by -.83, .33 and 1.5 at the target, where the marks show the truth.
    """
    ideal = certified("r161", procedure="bbcor", seed=0, reality=Reality.IDEAL).certification
    certification = certify_session(counted_from_another_beam(ideal.session, boards, 1))
    assert "flag heights" in certification.reasons
    for each in certification.pairs:
        if each.name == "heights" and each.of in said:
            stated_size = each.sentence.split(" mm")[0].rpartition(" ")[2]
            assert float(stated_size) == pytest.approx(said[each.of], abs=0.05)


@pytest.mark.parametrize("procedure", ["bbcor", "ncaa-besr"])
def test_a_board_with_reversed_beams_makes_a_test_invalid(procedure: str) -> None:
    """For balls near the middle of the board the mean height is right; only differences reverse."""
    session = certified("r161", procedure=procedure, seed=3).certification.session
    times = session.records["impact"]["gates"].times.copy()
    times[:, :, 0] = times[:, :, 0, ::-1]
    certification = certify_session(changed(session, "impact", "gates", times=times))
    assert "flag heights" in certification.reasons
    over_height = next(each for each in certification.pairs if each.of == "board 2 over height")
    assert over_height.sigmas > 10


@pytest.mark.parametrize("procedure", ["bbcor", "ncaa-besr"])
def test_a_board_that_is_late_on_the_flight_out_makes_a_test_invalid(procedure: str) -> None:
    """One millisecond at any board moves the result by up to 80 u; the flight in shows nothing."""
    session = certified("r161", procedure=procedure, seed=3).certification.session
    for board in range(3):
        times = session.records["impact"]["gates"].times.copy()
        times[:, 1, board] += 1e-3
        certification = certify_session(changed(session, "impact", "gates", times=times))
        assert certification.verdict.value == "INVALID"
        (flag,) = [each for each in certification.flags if each.name == "boards-in-line"]
        assert flag.invalidates
        assert "on the way back, board" in flag.sentence


@pytest.mark.parametrize("side", [0.9, 1.1])
def test_the_p_value_of_a_trend_is_that_of_a_regression(side: float) -> None:
    """Four balls leave two degrees of freedom; scipy's p-value is just above or below the limit."""
    e0, scatter = 0.54 + 0 * np.arange(4.0), np.array([1.0, -1.5, 0.0, 0.5]) * 1e-4

    def lot(slope: float) -> np.ndarray:
        return e0 + scatter + slope * np.arange(4)

    steep = brentq(
        lambda slope: stats.linregress(np.arange(4), lot(slope)).pvalue - REMARKED, 1e-4, 0.1
    )
    balls = BallReadings(
        mass=np.zeros((1, 1, 4)),
        ball=np.repeat(np.arange(4), 3)[None, None],
        nominal_speed=np.zeros((1, 1, 12)),
        flights=None,
    )
    laboratory = SimpleNamespace(
        measured_balls=SimpleNamespace(restitution=lot(side * steep)[None, None]),
        reduced=SimpleNamespace(preparation=SimpleNamespace(balls=balls)),
        has_result=np.zeros(1, dtype=bool),
        metric=SimpleNamespace(u=np.zeros(1)),
        sensitivities={},
    )
    (trend,) = wall_drift(laboratory)
    assert (trend.row(0) is not None) == (side > 1)


@pytest.mark.parametrize(("size", "flagged"), [(1.0, False), (1.015, False), (1.03, True)])
def test_chords_use_the_speed_at_the_gate(sound: Session, size: float, flagged: bool) -> None:
    """With ten times the drag, a ball is 3 % faster at the far gate than at the bat.

    By hand: the edges are the passage ± radius over the local speed.
    """
    calibration, radius = dict(sound.calibration), sound.calibration["ball.radius"].value
    key = "hall.air.drag_coefficient"
    calibration[key] = replace(calibration[key], value=10 * calibration[key].value)
    session = replace(sound, calibration=calibration)
    area = np.pi * radius**2 * calibration[key].value * calibration["hall.air.density"].value
    masses = session.records["bench"]["ball-mass"].readings.mean(axis=1)
    for stage in ("balls", "impact"):
        kappa = area / (2 * masses[session.records[stage]["log"].ball.astype(int)])[:, None]
        times = session.records[stage]["gates"].times.mean(axis=-1)
        far, near = (calibration[f"{stage}.gates.distance_{gate}"].value for gate in (0, 1))
        place = np.array([far, near])
        half = np.empty(times.shape)
        for direction, sign in ((0, -1), (1, 1)):
            lasted = np.abs(times[:, direction, 1] - times[:, direction, 0])[:, None]
            ends = np.exp(sign * kappa * place)
            speed = np.abs(ends[:, :1] - ends[:, 1:]) / (kappa * lasted)  # speed at the target
            half[:, direction] = size * radius / (speed / ends)
        edges = np.stack([times - half, times + half], axis=-1)
        session = changed(session, stage, "gates", times=edges)
    assert ("chords" in [flag.name for flag in certify_session(session).flags]) == flagged


def through_thick_beams(session: Session, thickness: float) -> Session:
    """Return a session whose beams are `thickness` [m] thick, which the calibration does not state.

    The speed at a beam is taken as the mean speed between the first gate and the last, which is
    right to 1 %.
    """
    for stage in ("balls", "impact"):
        times = session.records[stage]["gates"].times
        ends = (0, times.shape[2] - 1)
        far, near = (session.calibration[f"{stage}.gates.distance_{k}"].value for k in ends)
        edges = np.where(np.isfinite(times), times, 0.0).reshape(*times.shape[:3], -1).sum(axis=-1)
        edge_counts = np.isfinite(times).reshape(*times.shape[:3], -1).sum(axis=-1)
        passed = edges / np.where(edge_counts > 0, edge_counts, np.nan)
        speed = (far - near) / np.abs(passed[..., -1] - passed[..., 0])
        half = thickness / 2 / speed[(...,) + (None,) * (times.ndim - 2)]
        session = changed(session, stage, "gates", times=times + half * np.array([-1.0, 1.0]))
    return session


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor"])
def test_a_stated_beam_thickness_is_corrected(procedure: str) -> None:
    """3 mm are 4 % of a ball. Once stated, no flag remains, and the metric is unchanged."""
    session = certified("r161", procedure=procedure, seed=300).certification.session
    thick = through_thick_beams(session, 3e-3)
    wide = certify_session(thick)
    assert [flag.name for flag in wide.flags] == ["chords"]
    stated = {
        f"{stage}.gates.thickness": Estimate(value=3e-3, u=1e-4) for stage in ("balls", "impact")
    }
    certification = certify_session(replace(thick, calibration={**thick.calibration, **stated}))
    assert certification.flags == ()
    assert certification.metric == wide.metric


def test_a_flag_states_the_size_of_the_fault() -> None:
    """The nearest board has moved by 1 mm, so the middle board is off the flight by half of it."""
    certification = certified(
        "r161", procedure="bbcor", seed=12, faults=("gate-moved",)
    ).certification
    (said,) = [flag.sentence for flag in certification.flags if flag.name == "boards-in-line"]
    stated_size = float(said.split(" mm")[0].rpartition(" ")[2])
    assert stated_size == pytest.approx(0.5, abs=0.3)
