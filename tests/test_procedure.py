"""The rule book at its edges: every window, the verdict, and the place to aim at."""

import re
from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.procedure import (
    Judgement,
    Procedure,
    Verdict,
    aimed_place,
    judge,
    verdict,
)
from virtual_lab.reduction.measurement import ShotResults
from virtual_lab.reduction.observations import ImpactReadings
from virtual_lab.reduction.recoil import RecoilFit

RULES = catalog.load("procedures", "astm-f1881", Procedure).spec
MPH, OUNCE = 0.44704, 0.028349523125
GOOD = {
    "speed": 60 * MPH,
    "ball_mass": 5.125 * OUNCE,
    "nominal_ball_restitution": 0.55,
    "recoil_rate": 14.0,
    "restitution": 0.52,
}
AIMED = 0.15  # m
COUNTS = {"rate": 22_000.0, "rate_u": 2.0, "rate_before": 0.0}


def shots(*changes: dict[str, float]) -> tuple[ShotResults, ImpactReadings]:
    """Return a batch: a good shot a change, with that change made."""
    n = len(changes)

    def column(name: str, good: float) -> np.ndarray:
        return np.array([change.get(name, good) for change in changes])

    results = dict.fromkeys(ShotResults.__dataclass_fields__, np.ones(n))
    results |= {name: column(name, good) for name, good in GOOD.items()}
    recoil = RecoilFit(
        ring_frequency=np.zeros(0),
        ring_decay=np.zeros(0),
        residual=np.zeros(n),
        **{name: column(name, good) for name, good in COUNTS.items()},
    )
    readings = ImpactReadings(
        ball=np.arange(n),
        nominal_speed=np.full(n, 60 * MPH),
        place=column("place", AIMED),
        duration_in=np.ones(n),
        duration_out=np.ones(n),
        contact=np.zeros(n),
        recoil=recoil,
    )
    return ShotResults(**results), readings


def reason(**change: float) -> str:
    """Return why a shot with one change does not count."""
    return judge(RULES, *shots(change), AIMED).reasons[0]


def test_a_good_shot_counts() -> None:
    """Middle of every window of data/procedures/astm-f1881.toml."""
    judgement = judge(RULES, *shots({}, {}), AIMED)
    assert judgement == Judgement(reasons=("", ""))
    assert judgement.valid.tolist() == [True, True]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"speed": nan}, "the gates did not see the ball come in"),
        ({"speed": 61.01 * MPH}, "ball at 61.01 mph, allowed 60 ± 1 mph"),
        ({"speed": 58.99 * MPH}, "ball at 58.99 mph, allowed 60 ± 1 mph"),
        ({"place": 0.1511}, "set at 5.949 in, allowed 5.906 ± 0.039 in"),
        ({"place": 0.100}, "set at 3.937 in, allowed 5.906 ± 0.039 in"),
        ({"restitution": -0.1}, "restitution of -0.100, which no collision has (signs, units or"),
        ({"restitution": 1.01}, "restitution of 1.010, which no collision has (signs, units or"),
        ({"ball_mass": 4.999 * OUNCE}, "ball of 4.999 oz, allowed 5.000 to 5.250 oz"),
        ({"ball_mass": 5.251 * OUNCE}, "ball of 5.251 oz, allowed 5.000 to 5.250 oz"),
        ({"nominal_ball_restitution": 0.5249}, "ball of e0 0.5249, allowed 0.525 to 0.575"),
        ({"nominal_ball_restitution": 0.5751}, "ball of e0 0.5751, allowed 0.525 to 0.575"),
        # 79 counts/s at 22 000 counts/s for 14 rad/s are 0.0503 rad/s
        ({"rate_before": 79.0}, "bat turned at 0.050 rad/s before the hit, allowed 0.050"),
        ({"rate_before": -157.2}, "bat turned at 0.100 rad/s before the hit, allowed 0.050"),
        ({"rate_u": 88.0}, "recoil known to 0.40%, allowed 0.30%"),
        ({"rate_u": inf}, "recoil known to inf%, allowed 0.30%"),
    ],
)
def test_each_window_rejects_with_its_sentence(change: dict[str, float], sentence: str) -> None:
    """One quantity outside, in the units of its rule; numbers of the shipped procedure."""
    assert reason(**change).startswith(sentence)


@pytest.mark.parametrize(
    "change",
    [
        {"speed": RULES.speed + RULES.windows.speed_tolerance * (1 - 1e-12)},
        {"speed": RULES.speed - RULES.windows.speed_tolerance * (1 - 1e-12)},
        {"place": AIMED + RULES.windows.place_tolerance * (1 - 1e-12)},
        {"restitution": 1.0},
        {"ball_mass": RULES.windows.ball_mass_low},
        {"ball_mass": RULES.windows.ball_mass_high},
        {"nominal_ball_restitution": RULES.windows.ball_restitution_low},
        {"nominal_ball_restitution": RULES.windows.ball_restitution_high},
        {"rate_before": 78.0},  # 0.0496 rad/s
        {"rate_before": nan},  # a recorder that starts at contact tells nothing
        {"rate_u": 66.0},  # 0.3 % of 22 000
    ],
)
def test_at_the_edge_a_shot_counts(change: dict[str, float]) -> None:
    """Windows include their limits."""
    assert reason(**change) == ""


def test_the_first_window_missed_is_named() -> None:
    """Too fast and too heavy: the order of the rules decides, for each shot by itself."""
    fast_and_heavy = {"speed": 65 * MPH, "ball_mass": 6 * OUNCE}
    reasons = judge(RULES, *shots({}, fast_and_heavy, {"ball_mass": 6 * OUNCE}), AIMED).reasons
    assert reasons[0] == ""
    assert reasons[1].startswith("ball at 65.00 mph")
    assert reasons[2].startswith("ball of 6.000 oz")


def test_a_shot_that_missed_the_bat_is_rejected_not_raised() -> None:
    """No recoil at all (0 counts/s, 0 rad/s): a sentence, no warning of a division by zero."""
    missed = reason(rate=0.0, recoil_rate=0.0, rate_u=1.0)
    assert re.match(r"recoil known to .*, allowed 0\.30%", missed)


@pytest.mark.parametrize(
    ("value", "hits", "expected"),
    [
        (1.2, 6, Verdict.PASS),
        (np.nextafter(1.2, 2), 6, Verdict.FAIL),
        (0.5, 6, Verdict.PASS),
        (1.2, 5, Verdict.INVALID),
        (1.3, 5, Verdict.INVALID),
        (nan, 0, Verdict.INVALID),
        (1.3, 7, Verdict.FAIL),
    ],
)
def test_verdict(value: float, hits: int, expected: Verdict) -> None:
    """Limit 1.2 and 6 valid hits of the shipped procedure: at the limit is within it."""
    assert verdict(RULES, float(value), hits) is expected


def test_more_hits_wanted() -> None:
    """The number comes from the procedure, not from here."""
    assert verdict(replace(RULES, valid_hits=7), 1.0, 6) is Verdict.INVALID


BAT = {"mass": 31 * OUNCE, "length": 34 * 0.0254, "z_cm": 11.3 * 0.0254}
BAT["inertia_cm"] = 2539 * OUNCE * 0.0254**2


def test_aimed_place_of_the_papers_bat() -> None:
    """Z = z_cm - I/(M d), d = 34 - 6 - 11.3 = 16.7 in: 11.3 - 2539/(31 x 16.7) = 6.3956 in."""
    by_hand = (11.3 - 2539 / (31 * 16.7)) * 0.0254
    exact = aimed_place(BAT, 6 * 0.0254, exact=True)
    assert exact == pytest.approx(by_hand, rel=1e-12)
    # struck there, the bat's far end at the pivot stays: l = I_p/(M d) from the pivot
    d = 16.7 * 0.0254
    length = (BAT["inertia_cm"] + BAT["mass"] * d**2) / (BAT["mass"] * d)
    assert exact == pytest.approx(28 * 0.0254 - length, rel=1e-12)


def test_aimed_place_is_set_in_half_millimetres() -> None:
    """6.3956 in is 162.45 mm: the operator sets 162.5 mm."""
    assert aimed_place(BAT, 6 * 0.0254, exact=False) == pytest.approx(0.1625, abs=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("ball_mass_low = { value = 5.0,", "ball_mass_low = { value = 5.5,", "ball_mass_low"),
        (
            "ball_restitution_low = { value = 0.525",
            "ball_restitution_low = { value = 0.6",
            "no ball",
        ),
        ("attempts = { value = 12,", "attempts = { value = 100000,", "up to 1000"),
        ("attempts = { value = 12,", "attempts = { value = 3,", "cannot give"),
        ("speed = { value = 60,", "speed = { value = 1000000,", "less than 100"),
    ],
)
def test_rules_that_no_test_can_meet_are_refused(old: str, new: str, said: str) -> None:
    text = catalog.load("procedures", "astm-f1881", Procedure).text
    assert old in text
    with pytest.raises(InputError, match=said):
        catalog.read(text.replace(old, new), "mine.toml", Procedure)
