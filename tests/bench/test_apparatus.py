"""What actions do: the plain day is the plain test, and each action left out moves something."""

from math import pi, sqrt

import numpy as np
import pytest

from tests.bench.days import PLAIN, apparatus, asked, day_of, play_actions, with_change, without
from tests.lab.test_test_day import same
from tests.laboratories import certified
from virtual_lab.bench.day.day import Day
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.table import MAKE_READY
from virtual_lab.errors import InputError

DEGREE = pi / 180
RESOLUTION = 1e-4  # kg, of the scale


@pytest.fixture(scope="module")
def plain() -> Desk:
    return Desk(day_of(PLAIN))


def readings(day: Day, channel: str) -> np.ndarray:
    return Desk(day).session.records["bench"][channel].readings


def moved(day: Day, plain: Desk) -> set[str]:
    """Return the channels whose records are not those of the plain day."""
    found, sound = Desk(day).session.records, plain.session.records
    assert found.keys() == sound.keys()
    return {
        channel
        for stage, records in sound.items()
        for channel, record in records.items()
        if not same({stage: {channel: record}}, {stage: {channel: found[stage][channel]}})
    }


def test_a_day_by_the_rules_is_the_plain_test(plain: Desk) -> None:
    """Records and metric bit for bit those of `virtual-lab certify`, which knows no bench."""
    sound = certified(seed=3).certification
    assert same(dict(plain.session.records), dict(sound.session.records))
    assert plain.certification.metric == sound.metric
    assert plain.certification.verdict == sound.verdict


def test_a_rehearsed_day_has_the_truth_of_an_automatic_test(plain: Desk) -> None:
    found = apparatus().finish(plain).sealed.measurand
    assert found == pytest.approx(certified(seed=3).sealed.measurand, rel=1e-12)


def test_the_order_of_the_readings_changes_no_record(plain: Desk) -> None:
    """The wall first, the bench from its end: what makes ready stays before what it is for."""
    order = ("hit-wall", "aim-paper", "fit-clamp", "swing", "level-stand", "measure-balance")
    first = [each for name in order for each in PLAIN if each[0] == name]
    later = without(*order)
    assert moved(day_of([*first, *later]), plain) == set()


def test_an_untared_scale_shifts_all_its_readings_alike(plain: Desk) -> None:
    day = day_of(without("tare"))
    off = readings(day, "bat-mass") - readings(plain.day, "bat-mass")
    assert np.ptp(off) <= RESOLUTION * 1.01
    assert abs(off.mean()) > RESOLUTION
    off_balls = readings(day, "ball-mass") - readings(plain.day, "ball-mass")
    assert off_balls == pytest.approx(np.full(off_balls.shape, off.mean()), abs=RESOLUTION * 1.01)
    assert moved(day, plain) == {"bat-mass", "ball-mass", "reference-mass"}


def test_a_stand_out_of_level_shifts_the_balance_by_1_mm(plain: Desk) -> None:
    day = day_of(without("level-stand"))
    off = readings(day, "balance") - readings(plain.day, "balance")
    assert off == pytest.approx(np.full(off.shape, 1e-3), abs=1e-9)
    assert moved(day, plain) == {"balance"}


@pytest.mark.parametrize("days", [without("fit-clamp"), with_change("fit-clamp", fitted="no")])
def test_a_missing_clamp_is_subtracted_all_the_same(plain: Desk, days: list) -> None:
    """What the bat swings without is taken off all the same: I m_c/(M d) - I_c too much."""
    day = day_of(days)
    assert moved(day, plain) == {"pendulum"}
    bat, sound = Desk(day).preparation.bat, plain.preparation.bat
    known = {name: getattr(sound, name).item() for name in ("length", "z_cm", "inertia_cm", "mass")}
    lever = known["length"] - 0.1528 - known["z_cm"]
    inertia = known["inertia_cm"] + known["mass"] * lever**2
    much = inertia * 1.1e-3 / (known["mass"] * lever) - 2.15e-4
    assert bat.inertia_cm - sound.inertia_cm == pytest.approx(much, abs=1e-4)  # u is 3e-5


def test_the_pendulum_record_follows_angle_number_and_clock(plain: Desk) -> None:
    def pendulum(**how: object) -> object:
        day = day_of(with_change("swing", **how))
        assert moved(day, plain) == {"pendulum"}
        return Desk(day).session.records["bench"]["pendulum"]

    wide = pendulum(amplitude=20.0)
    assert wide.first_amplitude == pytest.approx(20.2 * DEGREE, abs=0.3 * DEGREE)
    assert (wide.times[:, -1] / plain.session.records["bench"]["pendulum"].times[:, -1] - 1) == (
        pytest.approx(20**2 / 16 * DEGREE**2, rel=0.15)
    )
    assert pendulum(swings=3).times.shape == (5, 4)
    by_hand = pendulum(clock="hand").times
    assert np.round(by_hand * 100) == pytest.approx(by_hand * 100, abs=1e-9)
    assert 0.01 < np.diff(by_hand, axis=1).std() / (0.05 * sqrt(2)) < 2
    assert np.diff(by_hand, axis=1).std() > 0.03


@pytest.mark.parametrize(
    ("action", "channel", "unit", "factor"),
    [
        ("weigh-bat", "bat-mass", "oz", 28.349523125),
        ("weigh-balls", "ball-mass", "oz", 28.349523125),
        ("measure-length", "length", "in", 25.4),
        ("measure-barrel", "barrel-radius", "cm", 10),
        ("measure-balance", "balance", "in", 25.4),
    ],
)
def test_a_reading_typed_in_another_unit_is_wrong_by_the_factor(
    plain: Desk, action: str, channel: str, unit: str, factor: float
) -> None:
    day = day_of([(action, {"entered_as": unit})])
    assert readings(day, channel) / factor == pytest.approx(readings(plain.day, channel), rel=1e-2)


def test_a_balance_from_the_knob_is_the_length_minus_the_right_one(plain: Desk) -> None:
    day = day_of(with_change("measure-balance", end="knob"))
    both = readings(day, "balance") + readings(plain.day, "balance")
    assert both == pytest.approx(np.full(both.shape, 34 * 25.4e-3), abs=1.5e-3)
    assert moved(day, plain) == {"balance"}


def test_gauged_gates_take_the_place_of_the_certificate(plain: Desk) -> None:
    seen = Desk(day_of([("gauge-gates", {}), *PLAIN]))
    assert moved(seen.day, plain) == set()
    assert dict(seen.session.calibration) == dict(plain.session.calibration)
    used = Desk(day_of([("gauge-gates", {"use": "gauge"}), *PLAIN])).session.calibration
    for gate in (0, 1):
        name = f"impact.gates.distance_{gate}"
        assert used[name].u == 0.05e-3
        true = apparatus().laboratory.stations
        assert used[name].value == pytest.approx(
            next(s for s in true.values() if hasattr(s, "encoder")).gates.distances[gate],
            abs=0.25e-3,
        )


def first_counts(days: list) -> np.ndarray:
    return Desk(day_of(days)).session.records["impact"]["encoder"].counts


def test_an_encoder_not_zeroed_shifts_all_counts_of_a_shot_alike(plain: Desk) -> None:
    """All counts of a shot are off by one number; the recoil does not know it."""
    off = first_counts(without("zero-encoder")) - plain.session.records["impact"]["encoder"].counts
    assert (np.ptp(off, axis=1) == 0).all()
    assert (np.abs(off[:, 0]) > 0).all()
    assert Desk(day_of(without("zero-encoder"))).reasons == plain.reasons


def test_a_bat_not_at_rest_is_noticed_in_most_shots(plain: Desk) -> None:
    desk = Desk(day_of(without("wait-rest")))
    assert moved(desk.day, plain) == {"encoder"}
    turned = np.diff(desk.session.records["impact"]["encoder"].counts[:, [0, 99]])
    assert turned.min() < 0 < turned.max()
    assert [shot for shot, why in enumerate(desk.reasons) if "turning at" in why] == [
        0,
        2,
        3,
        4,
        5,
        6,
    ]


def test_without_the_wait_for_pressure_balls_are_2_5_mph_slow(plain: Desk) -> None:
    slow = Desk(day_of(without("wait-pressure")))
    off = slow.reduction_by_rules.shots.speed - plain.reduction_by_rules.shots.speed
    assert off / 0.44704 == pytest.approx(np.full(off.shape, -2.5), abs=0.01)
    assert all(reason.startswith("ball speed") for reason in slow.reasons)


def test_scrap_breaks_the_first_gate_30_mm_too_early(plain: Desk) -> None:
    """None at the first shot, then now and then: the first gate breaks 30 mm ahead of the ball."""
    times = Desk(day_of(without("clear-scrap"))).session.records["impact"]["gates"].times
    early = plain.session.records["impact"]["gates"].times - times
    tripped = early[:, 0, 0, 0] > 0
    assert not tripped[0]
    assert tripped.any()
    speed = plain.reduction_by_rules.shots.speed
    assert early[tripped, 0, 0, 0] * speed[tripped] == pytest.approx(0.03, abs=1e-3)


def test_a_ball_fired_again_at_once_has_lost_e0(plain: Desk) -> None:
    days = with_change("load-ball", ball=1)
    desk = Desk(day_of(days))
    log = desk.session.records["impact"]["log"]
    assert (log.ball == 0).all()
    fired = apparatus().shots(desk.day)
    e0 = [float(play.truth["ball_restitution"][0]) for _, play in fired]
    balls = apparatus().laboratory.specimen.balls.restitution
    sound = [
        float(play.truth["ball_restitution"][0]) - balls[int(plan.ball[0])] + balls[0]
        for plan, play in apparatus().shots(plain.day)
    ]
    lost = np.array(sound) - e0
    assert lost[0] == pytest.approx(0, abs=1e-4)
    assert lost[1:3] == pytest.approx([0.003, 0.006], abs=3e-4)
    assert lost[3:] == pytest.approx(0.006, abs=0.0031)  # those within ten minutes


def test_a_wrong_impact_position_is_recorded_and_rejected(plain: Desk) -> None:
    desk = Desk(day_of(with_change("set-place", place="6.5 in")))
    assert desk.session.records["impact"]["log"].place == pytest.approx(0.165, abs=1e-9)
    assert all("set to" in reason for shot, reason in enumerate(desk.reasons) if shot != 1)


def test_a_new_aim_moves_the_marks_and_the_calibration(plain: Desk) -> None:
    day = day_of(
        [
            ("aim-paper", {}),
            ("re-aim", {"along": 5, "across": -3}),
            ("aim-paper", {}),
        ]
    )
    first, _, second = day.events
    off = [b[1] - a[1] for a, b in zip(first.shown, second.shown, strict=True)]
    assert off == pytest.approx([5, -3], abs=1.5)
    key = "impact.cannon.along"
    known, before = Desk(day).session.calibration[key], plain.session.calibration[key]
    assert known.value - before.value == pytest.approx(5e-3)
    assert known.u == pytest.approx(sqrt(before.u**2 + 0.3e-3**2))


@pytest.mark.parametrize(
    ("name", "missing"),
    [
        ("weigh-bat", "bench/bat-mass"),
        ("weigh-balls", "bench/ball-mass"),
        ("measure-length", "bench/length"),
        ("measure-barrel", "bench/barrel-radius"),
        ("measure-balance", "bench/balance"),
        ("swing", "bench/pendulum"),
        ("hit-wall", "balls/log"),
        ("aim-paper", "impact/aim"),
    ],
)
def test_without_a_reading_there_is_no_result(name: str, missing: str) -> None:
    day = day_of(without(name))
    assert missing in Desk(day).reduction_error
    with pytest.raises(InputError, match=missing):
        play_actions(apparatus(), asked([*without(name), ("reduce", {})]))


@pytest.mark.parametrize("name", ["weigh-bat", "measure-length", "swing", "measure-balance"])
def test_of_repeated_readings_the_last_counts_unless_struck_out(plain: Desk, name: str) -> None:
    again = [*PLAIN, (name, {})]
    day = day_of(again)
    assert len(moved(day, plain)) == 1
    entry = len(PLAIN) + 1
    struck = day_of([*again, ("strike-out", {"entry": entry, "because": "the door slammed"})])
    assert moved(struck, plain) == set()
    assert len(struck.events) == len(day.events) + 1


def test_a_retired_ball_is_not_loaded() -> None:
    with pytest.raises(InputError, match="retired"):
        day_of([("retire-ball", {"ball": 3, "because": "seam"}), ("load-ball", {"ball": 3})])


def shown(day: Day, entry: int) -> dict[str, float]:
    return {what: value for what, value, _ in day.events[entry - 1].shown}


def test_the_check_mass_shows_a_dish_on_the_scale() -> None:
    """Left out, nothing is shown, and no other record knows of it."""
    days = [("tare", {}), ("weigh-check-mass", {})]
    sound, wrong = (shown(day_of(days, *faults), 2) for faults in ((), ("scale-not-tared",)))
    assert sound["reading 1"] - 500 == pytest.approx(0.2, abs=0.3)
    assert wrong["reading 1"] - sound["reading 1"] == pytest.approx(2, abs=0.15)


def test_the_gauge_shows_a_gate_that_was_moved() -> None:
    sound, wrong = (
        shown(day_of([("gauge-gates", {})], *faults), 1) for faults in ((), ("gate-moved",))
    )
    assert wrong["gate 2, gauged"] - sound["gate 2, gauged"] == pytest.approx(1.0, abs=0.011)
    assert wrong["gate 1, gauged"] == sound["gate 1, gauged"]


def test_the_check_cylinder_shows_half_the_counts() -> None:
    found = shown(day_of([("fire-check-cylinder", {})], "encoder-half-counts"), 1)
    name = "rotation × time between gates"
    assert found[f"{name}, today"] / found[f"{name}, chart"] == pytest.approx(0.5, rel=0.02)
    ball = "ball's rebound speed / incoming speed"
    off = found[f"{ball}, today"] - found[f"{ball}, chart"]
    assert abs(off) < 5 * found[f"{ball}, standard deviation of a day"]


def test_the_check_ball_shows_a_wall_rig_that_drifts() -> None:
    """It is hit at the start of the test and not through it, and again at the end."""
    found = shown(day_of([("fire-check-ball", {})]), 1)
    name = "rebound speed / incoming speed"
    off = found[f"{name}, today"] - found[f"{name}, chart"]
    assert abs(off) < 4 * found[f"{name}, standard deviation of a day"]
    drifting = shown(day_of([("fire-check-ball", {})], "wall-drift"), 1)
    assert drifting[f"{name}, today"] > found[f"{name}, today"] * 1.02


def test_taps_before_and_after_show_a_crack() -> None:
    days = [("tap-bat", {}), *PLAIN[:-8], ("tap-bat", {})]
    for faults, ratio in (((), 1.0), (("bat-cracked",), sqrt(0.9))):
        day = day_of(days, *faults)
        before, after = (e.shown[0][1] for e in day.events if e.action == "tap-bat")
        assert after / before == pytest.approx(ratio, abs=0.012)


def test_callipers_show_each_ball() -> None:
    day = day_of([("gauge-balls", {})])
    diameters = np.array([value for _, value, _ in day.events[0].shown])
    assert diameters.shape == (12,)
    assert 0.02 < diameters.std() < 0.12
    assert diameters.mean() == pytest.approx(2 * 1.4523 * 25.4, abs=1.0)


def test_an_undecided_hit_does_not_count_and_a_person_may_overrule(plain: Desk) -> None:
    undecided = Desk(day_of(PLAIN[:-1]))
    assert undecided.reduced.judgement(undecided.readings).reasons[-1] == "undecided"
    assert undecided.certification.verdict.value == "INVALID"
    over = Desk(day_of([*PLAIN, ("accept", {"shot": 2, "because": "near enough"})]))
    assert over.reduced.valid.sum() == 7
    assert over.reasons[1].startswith("ball speed")


def test_readiness_ends_with_the_shot() -> None:
    day = day_of(PLAIN)
    assert day.ready == frozenset()
    assert day_of(PLAIN[: len(PLAIN) - 2]).ready == set(MAKE_READY)
