"""Windows of boards and of a swung bat at their limits, and the rules of eligibility."""

from dataclasses import fields, replace
from math import nan, radians, tan

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.measurement.procedure import Procedure, findings, judge
from virtual_lab.measurement.procedure.rules import Eligibility
from virtual_lab.measurement.reduction.gates import GateReadings, Passages
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.reduction.rate import RateFit
from virtual_lab.measurement.reduction.shot_algebra import BatProperties, ShotResults

BESR, BBCOR, F1881 = (
    catalog.load("procedures", name, Procedure).spec
    for name in ("ncaa-besr", "bbcor", "astm-f1881")
)
MPH, OUNCE, INCH = 0.44704, 0.028349523125, 0.0254
OZ_IN2 = OUNCE * INCH**2
TURN = 66 * MPH / (22 * INCH)  # angular rate of a 34 in bat on an axis 6 in from the knob [rad/s]
GOOD = {
    "speed": 70 * MPH,
    "rebound_speed": 94 * MPH,
    "rebound_slope": 0.01,
    "ball_mass": 5.125 * OUNCE,
    "window_ball_restitution": 0.55,
    "swing_rate": TURN,
    "restitution": 0.5,
    "recoil_efficiency": nan,
    "rebound_efficiency": 0.2,
}
PITCH = "allowed 70 ± 1 mph (31.29 ± 0.45 m/s)"
SWING = "allowed 66 ± 1 mph (29.5 ± 0.45 m/s)"
COUNTS = 10_000 / (2 * np.pi)


def why(
    procedure: Procedure = BESR,
    *,
    place: float = 6 * INCH,
    misfit: tuple[float, float] = (0.0, 0.0),
    angle: float = 0.0,
    recoil: bool = False,
    residual: float = 0.0,
    rest: float = nan,
    **change: float,
) -> str:
    """Return why a shot at `procedure` is not valid; `misfit` in seconds, `angle` in degrees."""
    good = GOOD | ({} if procedure is BESR else {"speed": procedure.ball_speed}) | change
    results = {each.name: np.ones(1) for each in fields(ShotResults)}
    results |= {name: np.array([value]) for name, value in good.items()}
    none = {
        "rate_u": np.ones(1),
        "by_half": np.full(1, nan),
        "by_half_u": np.full(1, nan),
        "span": np.full(1, nan),
        "counting": 0.4,
        "before": np.zeros(1),
        "ring_frequency": np.zeros(0),
        "ring_decay": np.zeros(0),
        "rest": np.full(1, rest),
        "residual": np.full(1, residual),
    }
    turned = COUNTS * np.array([good["swing_rate"]])
    swing = RateFit(rate=turned, angle=COUNTS * np.radians([angle]), **none)
    struck = RateFit(rate=np.array([2e4]), angle=np.full(1, nan), **none)
    readings = ImpactReadings(
        ball=np.zeros(1, dtype=int),
        position=np.array([place]),
        flights=GateReadings(
            stage="impact",
            passages=Passages(
                times=np.ones((1, 2, 3)),
                heights=np.zeros((1, 2, 3)),
                heights_u=np.zeros((1, 2, 3)),
                misfit=np.array([misfit]),
            ),
            distances=np.array([0.5, 0.35, 0.2]),
            shows_height=False,
        ),
        recoil=struck if recoil else None,
        swing=swing if procedure is BESR else None,
    )
    turn_rate = TURN if procedure is BESR else 0.0
    return judge(procedure, ShotResults(**results), readings, 0.15, turn_rate).reasons[0]


def test_good_shots_are_valid() -> None:
    assert why() == ""
    assert why(BBCOR) == ""


LATE = 0.3e-3 / (70 * MPH)  # time of 0.3 mm of flight in [s]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"speed": 71.01 * MPH}, f"ball speed 71.01 mph (31.74 m/s), {PITCH}"),
        ({"speed": 68.99 * MPH}, f"ball speed 68.99 mph (30.84 m/s), {PITCH}"),
        (
            {"place": 2.97 * INCH},
            "impact position set to 2.970 in, allowed 3.000 to 9.000 in (range of the scan)",
        ),
        ({"place": 9.03 * INCH}, "impact position set to 9.030 in, allowed 3.000 to 9.000 in"),
        (
            {"misfit": (LATE * 1.01, 0.0)},
            "beam edges 0.303 mm rms from a single flight, allowed 0.300 mm",
        ),
        ({"misfit": (nan, LATE)}, "beam edges 0.40 mm rms from a single flight, allowed 0.30 mm"),
        ({"rebound_slope": tan(radians(12.1))}, "rebound angle 12.1 deg, allowed 12.0 deg"),
        ({"rebound_slope": -tan(radians(12.1))}, "rebound angle 12.1 deg, allowed 12.0 deg"),
        ({"rebound_slope": tan(radians(12.04))}, "rebound angle 12.04 deg, allowed 12.00 deg"),
        ({"rebound_slope": tan(radians(12.0006))}, "rebound angle 12.001 deg, allowed 12.000"),
        ({"speed": 71.0004 * MPH}, f"ball speed 71.0004 mph (31.7400 m/s), {PITCH}"),
        ({"ball_mass": 5.2501 * OUNCE}, "ball mass 5.2501 oz, allowed 5.0000 to 5.2500 oz"),
        ({"window_ball_restitution": 0.52499}, "e0 of the ball 0.52499, allowed 0.525 to 0.555"),
        (
            {"place": 3 * INCH - 0.51e-3},
            "impact position set to 2.980 in, allowed 3.000 to 9.000 in",
        ),
        ({"angle": 3.001}, "angle of the bat at contact 3.001 deg from square, allowed 3.000 deg"),
        ({"restitution": -0.0001}, "restitution -0.0001, which is impossible"),
        ({"restitution": 1.0001}, "restitution 1.0001, which is impossible"),
        ({"swing_rate": nan}, "the encoder shows no rotation before contact"),
        ({"swing_rate": TURN * 67.01 / 66}, f"bat speed 67.01 mph (29.96 m/s), {SWING}"),
        ({"swing_rate": TURN * 64.99 / 66}, f"bat speed 64.99 mph (29.05 m/s), {SWING}"),
        ({"angle": 3.1}, "angle of the bat at contact 3.1 deg from square, allowed 3.0 deg"),
        ({"angle": -3.1}, "angle of the bat at contact 3.1 deg from square, allowed 3.0 deg"),
        ({"restitution": nan}, "the gates missed the returning ball"),
        ({"restitution": -0.01}, "restitution -0.010, which is impossible"),
    ],
)
def test_each_window_rejects_with_its_sentence(change: dict, sentence: str) -> None:
    """One quantity is outside the windows of data/procedures/ncaa-besr.toml."""
    assert why(**change).startswith(sentence)


@pytest.mark.parametrize(
    "change",
    [
        {"place": 3 * INCH - 0.4e-3},  # deviation within half a setting
        {"place": 9 * INCH + 0.4e-3},
        {"misfit": (LATE * 0.999, LATE * 0.999 * 70 / 94)},
        {"misfit": (nan, nan)},  # summed records: no misfit
        {"rebound_slope": tan(radians(11.999))},
        {"rebound_slope": nan},
        {"swing_rate": TURN * 66.999 / 66},
        {"angle": 2.999},
        {"angle": -2.999},
    ],
)
def test_a_shot_at_the_edge_of_a_window_is_valid(change: dict) -> None:
    assert why(**change) == ""


def test_recoil_and_rebound_must_agree_if_the_rules_require_it() -> None:
    """The limit is 0.01; a rebound that was not seen is no disagreement."""
    strict = replace(F1881, windows=replace(F1881.windows, agreement=0.01))
    shot = {"place": 0.15, "rebound_speed": 7.0, "recoil_rate": 14.0, "recoil": True}
    said = why(strict, recoil_efficiency=0.2, rebound_efficiency=0.2101, **shot)
    assert said == "e_A from recoil and from rebound differ by 0.0101, allowed 0.0100"
    assert why(strict, recoil_efficiency=0.2, rebound_efficiency=0.2099, **shot) == ""
    assert why(strict, recoil_efficiency=0.2, rebound_efficiency=nan, **shot) == ""


def test_a_shot_whose_encoder_record_does_not_fit_is_not_valid() -> None:
    """Counting leaves 0.4 and noise at rest 0.3, together 0.5, so up to 0.75 is allowed."""
    struck = {"place": 0.15, "rebound_speed": 7.0, "recoil_rate": 14.0, "recoil": True}
    for shot in ({"procedure": F1881, **struck}, {}):
        said = why(**shot, residual=0.751, rest=0.3)
        assert said == (
            "no smooth rotation fits the encoder record: the rms misfit is 1.502 times that of "
            "resolution and noise at rest, allowed 1.5"
        )
        assert why(**shot, residual=0.749, rest=0.3) == ""
        assert why(**shot, residual=0.61, rest=nan).startswith("no smooth rotation fits")
        assert why(**shot, residual=0.59, rest=nan) == ""
        assert why(**shot, residual=nan, rest=nan) == ""


def bat(
    *, length: float = 34, weight: float = 31, barrel: float = 2.6, inertia: float = 10_000
) -> BatProperties:
    """Return a bat from inches, ounces and oz in² about the pivot; balance 23 in from the knob."""
    return BatProperties(
        mass=np.array(weight * OUNCE),
        length=np.array(length * INCH),
        z_cm=np.array((length - 23) * INCH),
        inertia_cm=np.array((inertia - weight * 17**2) * OZ_IN2),
        barrel_radius=np.array(barrel / 2 * INCH),
    )


@pytest.mark.parametrize(
    ("change", "missed"),
    [
        ({}, None),
        ({"weight": 31.0}, None),  # difference of 34 and 31: exactly 3
        ({"weight": 30.98}, 0),
        ({"length": 36, "weight": 33.1, "inertia": 12000}, None),
        ({"length": 36.01, "weight": 33.1, "inertia": 12000}, 1),
        ({"barrel": 2.624}, None),
        ({"barrel": 2.626}, 2),
        ({"inertia": 9531}, None),  # floor at 34 in: 9530 oz in²
        ({"inertia": 9529}, 3),
        # floor halfway between two lengths: (8538 + 9530)/2 = 9034
        ({"length": 33.5, "inertia": 9035}, None),
        ({"length": 33.5, "inertia": 9033}, 3),
    ],
)
def test_each_rule_of_eligibility_includes_its_limit(
    change: dict[str, float], missed: int | None
) -> None:
    results = findings(BBCOR, bat(**change))
    assert [finding.met for finding in results] == [index != missed for index in range(4)]


def test_findings_are_in_inches_and_ounces() -> None:
    assert [finding.sentence for finding in findings(BBCOR, bat())] == [
        "length in inches minus weight in ounces 3.00, allowed up to 3",
        "length 34.00 in, allowed up to 36.00 in",
        "barrel diameter 2.600 in, allowed up to 2.625 in (ring gauge)",
        "moment of inertia about the pivot 10000 oz in², required at least 9530 "
        "for a length of 34.0 in",
    ]


def test_a_barely_unmet_rule_is_printed_with_enough_digits() -> None:
    results = findings(BBCOR, bat(barrel=2.62501, inertia=9529.96))
    said = [finding.sentence.partition(" (")[0] for finding in results if not finding.met]
    assert said == [
        "barrel diameter 2.62501 in, allowed up to 2.62500 in",
        "moment of inertia about the pivot 9529.96 oz in², required at least 9530.00 "
        "for a length of 34.0 in",
    ]


def test_rules_that_a_procedure_lacks_give_no_finding() -> None:
    assert findings(F1881, bat()) == ()
    assert findings(replace(BBCOR, eligibility=Eligibility()), bat()) == ()


def test_floors_without_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="inertia_floors but 0 inertia_lengths"):
        Eligibility(inertia_floors=(1.0,))
