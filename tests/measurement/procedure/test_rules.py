"""The rules at their limits: every window, the verdict, and the aim."""

import re
from dataclasses import fields, replace
from math import inf, nan

import numpy as np
import pytest

from tests.one_laboratory import outcome_of
from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import (
    Judgement,
    Procedure,
    Reason,
    Verdict,
    judge,
    percussion_position,
    round_to_setting,
    sentences_of,
    unmet_rules,
    verdicts_of,
)
from virtual_lab.measurement.procedure.rules import Eligibility
from virtual_lab.measurement.reduction.gates import GateReadings, Passages
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.rate import RateFit
from virtual_lab.measurement.reduction.shot_algebra import BatProperties, ShotResults

RULES = catalog.load("procedures", "astm-f1881", Procedure).spec
MPH, OUNCE = 0.44704, 0.028349523125
GOOD = {
    "speed": 60 * MPH,
    "ball_mass": 5.125 * OUNCE,
    "window_ball_restitution": 0.55,
    "recoil_rate": 14.0,
    "restitution": 0.52,
}
ALLOWED = "allowed 60 ± 1 mph (26.82 ± 0.45 m/s)"
AIMED = 0.15  # aimed position [m]
COUNTS = {"rate": 22_000.0, "rate_u": 2.0, "before": 0.0}


def shots(*changes: dict[str, float]) -> tuple[ShotResults, ImpactReadings]:
    """Return a batch with one good shot per change, with that change applied."""
    n = len(changes)

    def column(name: str, good: float) -> np.ndarray:
        return np.array([change.get(name, good) for change in changes])

    results = {each.name: np.ones(n) for each in fields(ShotResults)}
    results |= {name: column(name, good) for name, good in GOOD.items()}
    recoil = RateFit(
        ring_frequency=np.zeros(0),
        ring_decay=np.zeros(0),
        rest=np.zeros(n),
        residual=np.zeros(n),
        by_half=np.full(n, nan),
        by_half_u=np.full(n, nan),
        span=np.full(n, nan),
        counting=0.3,
        angle=np.full(n, nan),
        **{name: column(name, good) for name, good in COUNTS.items()},
    )
    readings = ImpactReadings(
        ball=np.arange(n),
        position=column("place", AIMED),
        flights=GateReadings(
            stage="impact",
            passages=Passages(
                times=np.ones((n, 2, 2)),
                heights=np.full((n, 2, 2), nan),
                heights_u=np.zeros((n, 2, 2)),
                misfit=np.full((n, 2), nan),
            ),
            distances=np.array([0.5, 0.2]),
            shows_height=False,
        ),
        recoil=recoil,
        swing=None,
    )
    return ShotResults(**results), readings


def reason(**change: float) -> str:
    """Return the reason why a shot with one change is not valid."""
    return judge(RULES, *shots(change), AIMED, 0.0).reasons[0]


def test_a_good_shot_is_valid() -> None:
    """The shot is in the middle of every window of data/procedures/astm-f1881.toml."""
    judgement = judge(RULES, *shots({}, {}), AIMED, 0.0)
    assert judgement == Judgement(reasons=("", ""))
    assert judgement.valid.tolist() == [True, True]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"speed": nan}, "the gates missed the incoming ball"),
        ({"speed": 61.01 * MPH}, f"ball speed 61.01 mph (27.27 m/s), {ALLOWED}"),
        ({"speed": 58.99 * MPH}, f"ball speed 58.99 mph (26.37 m/s), {ALLOWED}"),
        ({"place": 0.1511}, "impact position set to 5.949 in, allowed 5.906 ± 0.039 in"),
        ({"place": 0.100}, "impact position set to 3.937 in, allowed 5.906 ± 0.039 in"),
        ({"restitution": -0.1}, "restitution -0.100, which is impossible; check signs,"),
        ({"restitution": 1.01}, "restitution 1.010, which is impossible; check signs,"),
        ({"ball_mass": 4.999 * OUNCE}, "ball mass 4.999 oz, allowed 5.000 to 5.250 oz"),
        ({"ball_mass": 5.251 * OUNCE}, "ball mass 5.251 oz, allowed 5.000 to 5.250 oz"),
        ({"window_ball_restitution": 0.5249}, "e0 of the ball 0.5249, allowed 0.525 to 0.555"),
        ({"window_ball_restitution": 0.5551}, "e0 of the ball 0.5551, allowed 0.525 to 0.555"),
        # rate of 79 counts/s at 22 000 counts/s per 14 rad/s: 0.0503 rad/s
        ({"before": 79.0}, "bat turning at 0.0503 rad/s before contact, allowed 0.0500 rad/s"),
        ({"before": -157.2}, "bat turning at 0.100 rad/s before contact, allowed 0.050 rad/s"),
        ({"rate_u": 88.0}, "relative u of the recoil rate 0.40%, allowed 0.30%"),
        ({"rate_u": inf}, "relative u of the recoil rate inf%, allowed 0.30%"),
    ],
)
def test_each_window_rejects_with_its_sentence(change: dict[str, float], sentence: str) -> None:
    """One quantity is outside its window of the shipped procedure, and in the unit of its rule."""
    assert reason(**change).startswith(sentence)


@pytest.mark.parametrize(
    "change",
    [
        {"speed": RULES.ball_speed + RULES.windows.speed_tolerance * (1 - 1e-12)},
        {"speed": RULES.ball_speed - RULES.windows.speed_tolerance * (1 - 1e-12)},
        {"place": AIMED + RULES.windows.place_tolerance * (1 - 1e-12)},
        {"restitution": 1.0},
        {"ball_mass": RULES.windows.ball_mass_low},
        {"ball_mass": RULES.windows.ball_mass_high},
        {"window_ball_restitution": RULES.windows.ball_restitution_low},
        {"window_ball_restitution": RULES.windows.ball_restitution_high},
        {"before": 78.0},  # rate of 0.0496 rad/s
        {"before": nan},  # recorder that starts at contact: no rate before
        {"rate_u": 66.0},  # limit of 0.3 % of 22 000
    ],
)
def test_a_shot_at_the_edge_of_a_window_is_valid(change: dict[str, float]) -> None:
    """Windows include their limits."""
    assert reason(**change) == ""


def test_the_first_window_missed_is_named() -> None:
    """A ball is too fast and too heavy; the order of the rules decides, shot by shot."""
    fast_and_heavy = {"speed": 65 * MPH, "ball_mass": 6 * OUNCE}
    reasons = judge(RULES, *shots({}, fast_and_heavy, {"ball_mass": 6 * OUNCE}), AIMED, 0.0).reasons
    assert reasons[0] == ""
    assert reasons[1].startswith("ball speed 65.00 mph (29.06 m/s)")
    assert reasons[2].startswith("ball mass 6.000 oz")


def test_a_shot_that_missed_the_bat_is_rejected_without_an_error() -> None:
    """A recoil of 0 counts/s gives a reason, and no warning of a division by zero."""
    missed = reason(rate=0.0, recoil_rate=0.0, rate_u=1.0)
    assert re.match(r"relative u of the recoil rate .*, allowed 0\.30%", missed)


LIGHT = "length in inches minus weight in ounces 3.10, allowed up to 3"
ABOVE = "BPF 1.3000 is above the limit 1.200"


def bats(*ounces: float) -> BatProperties:
    """Return bats of 34 in, one per weight [oz]."""
    one = np.ones((len(ounces), 1, 1))
    weight = OUNCE * np.reshape(ounces, one.shape)
    return BatProperties(
        mass=weight, length=34 * 0.0254 * one, z_cm=one, inertia_cm=one, barrel_radius=one
    )


def unmet(rules: Procedure, bat: BatProperties, *values: float) -> list[tuple[str, ...]]:
    """Return the sentences on the unmet rules, one tuple per laboratory."""
    unmet_by_bat = list(unmet_rules(rules, bat, np.array(values)))
    return [sentences_of(unmet_by_bat, Verdict.FAIL, i) for i in range(len(values))]


def test_each_unmet_rule_is_named() -> None:
    """The limit of the shipped procedure is 1.2; a value at the limit is within it."""
    rules = replace(RULES, eligibility=Eligibility(length_less_weight=3.0))
    values = (1.2, np.nextafter(1.2, 2), 0.5, 1.3, nan)
    bat = bats(31.0, 31.0, 30.9, 30.9, 31.0)
    above = ABOVE.replace("1.3", "1.2")
    assert unmet(rules, bat, *values) == [(), (above,), (LIGHT,), (LIGHT, ABOVE), ()]


def test_an_unmet_limit_is_stated_in_the_printed_unit() -> None:
    slow = catalog.load("procedures", "asa", Procedure).spec
    ((said,),) = unmet(slow, bats(31.0), slow.metric_limit + 0.1 * MPH)
    most = slow.metric_limit
    above = f"{most / MPH + 0.1:.2f} mph ({most + 0.1 * MPH:.2f} m/s)"
    assert said == f"v_f {above} is above the limit {most / MPH:.1f} mph ({most:.1f} m/s)"


def test_verdict_and_reasons_come_from_one_table() -> None:
    """INVALID precedes FAIL, and a laboratory has only the reasons of its own verdict."""

    def reason(verdict: Verdict, *where: int) -> Reason:
        mask = np.isin(np.arange(4), where)
        return Reason(verdict, mask, lambda i: f"{verdict.value} of {i}")

    table = [
        reason(Verdict.FAIL, 1, 2),
        reason(Verdict.INVALID, 2, 3),
        reason(Verdict.INVALID, 3),
    ]
    assert [each.value for each in verdicts_of(RULES, table, 4)] == [
        "PASS", "FAIL", "INVALID", "INVALID"
    ]  # fmt: skip
    said = [sentences_of(table, each, i) for i, each in enumerate(verdicts_of(RULES, table, 4))]
    assert said == [(), ("FAIL of 1",), ("INVALID of 2",), ("INVALID of 3",) * 2]


def test_without_a_limit_a_bat_is_measured_or_fails_by_another_rule() -> None:
    """The paper's own proposal sets no limit."""
    free = replace(RULES, limit=None, eligibility=Eligibility(length_less_weight=3.0))
    unmet_by_bat = list(unmet_rules(free, bats(31.0, 30.9), np.array([1.9, 1.9])))
    assert verdicts_of(free, unmet_by_bat, 2) == (Verdict.MEASURED, Verdict.FAIL)


@pytest.mark.parametrize(
    ("hits", "said"),
    [(2, "only 2 of 6 valid hits"), (5, "only 5 of 6 valid hits"), (6, ""), (7, "")],
)
def test_fewer_valid_hits_than_required_are_no_test(hits: int, said: str) -> None:
    """The shipped procedure requires six; the weights are equal in any case."""
    outcome = outcome_of(RULES, np.full(hits, 0.16), np.ones(hits, dtype=bool), np.ones(hits))
    assert outcome.reasons[0] == said
    assert outcome.weights == pytest.approx(1 / hits)


BAT = {"mass": 31 * OUNCE, "length": 34 * 0.0254, "z_cm": 11.3 * 0.0254}
BAT["inertia_cm"] = 2539 * OUNCE * 0.0254**2


def test_the_aimed_position_of_the_papers_bat_is_its_centre_of_percussion() -> None:
    """Aim z_cm - I/(M d), d = 34 - 6 - 11.3 = 16.7 in: 11.3 - 2539/(31 x 16.7) = 6.3956 in."""
    by_hand = (11.3 - 2539 / (31 * 16.7)) * 0.0254
    exact = percussion_position(BAT, 6 * 0.0254)
    assert exact == pytest.approx(by_hand, rel=1e-12)
    # center of percussion: I_p/(M d) from the pivot, where a hit leaves the pivot at rest
    d = 16.7 * 0.0254
    length = (BAT["inertia_cm"] + BAT["mass"] * d**2) / (BAT["mass"] * d)
    assert exact == pytest.approx(28 * 0.0254 - length, rel=1e-12)


def test_the_aimed_position_is_set_in_half_millimetres() -> None:
    """6.3956 in is 162.45 mm, so the operator sets 162.5 mm."""
    place = np.array([percussion_position(BAT, 6 * 0.0254)])
    assert round_to_setting(place, exact=False) == pytest.approx(0.1625, abs=1e-12)
    assert round_to_setting(place, exact=True) is place


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("ball_mass_low = { value = 5.0,", "ball_mass_low = { value = 5.5,", "ball_mass_low"),
        (
            "ball_restitution_low = { value = 0.525",
            "ball_restitution_low = { value = 0.6",
            "no ball",
        ),
        ("attempts = { value = 12,", "attempts = { value = 100000,", "2 to 1000"),
        ("attempts = { value = 12,", "attempts = { value = 3,", "cannot give"),
        (
            "speed = { value = 60,",
            "speed = { value = 1000000,",
            "outside the range 2.2.* to 223.* mph",
        ),
        ("place_slope_u = { value = 0.018", "place_slope_u = { value = -1", "place_slope_u"),
    ],
)
def test_rules_that_no_test_can_meet_are_refused(old: str, new: str, said: str) -> None:
    text = catalog.load("procedures", "astm-f1881", Procedure).text
    assert old in text
    with pytest.raises(InputError, match=said):
        catalog.read(text.replace(old, new), "mine.toml", Procedure)


def test_a_scan_with_a_place_slope_is_refused() -> None:
    text = catalog.load("procedures", "bbcor", Procedure).text
    slope = 'place_slope = { value = 0.01, unit = "1/in", source = "x", verified = false }\n'
    with pytest.raises(InputError, match="a test at one impact position"):
        catalog.read(text.replace("[scan]", slope + "\n[scan]", 1), "mine.toml", Procedure)
