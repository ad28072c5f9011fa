"""Balls outside the limits of the rules are named, not fired, and not part of the lot's mean."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.laboratories import opened
from virtual_lab import catalog
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.text import certificate_text
from virtual_lab.lab import run_test
from virtual_lab.lab.laboratory import Laboratory
from virtual_lab.measurement.procedure import Procedure, admit_balls, set_aside
from virtual_lab.measurement.reduction.shot_algebra import MeasuredBalls

OUNCE, MPH = 0.028349523125, 0.44704
RULES = catalog.load("procedures", "astm-f1881", Procedure).spec


def balls(**changed: Any) -> MeasuredBalls:
    """Return three good balls, measured at 136 mph; their e0 falls by 0.001 per mph."""
    good = {
        "mass": np.full(3, 5.125 * OUNCE),
        "restitution": np.full(3, 0.474),
        "speed": 136 * MPH,
        "slope": np.array(-0.001 / MPH),
    }
    return MeasuredBalls(**good | changed)


def test_e0_is_judged_at_the_speed_of_the_rules() -> None:
    """An e0 of 0.474 at 136 mph is 0.55 at 60 mph, allowed 0.525 to 0.555; 0.48 is 0.556."""
    assert set_aside(RULES, balls()) == ()
    lot = balls(restitution=np.array([0.474, 0.480, 0.474]))
    assert admit_balls(RULES, lot).tolist() == [True, False, True]
    (ball,) = set_aside(RULES, lot)
    assert ball.ball == 1
    assert ball.reason == "e0 0.5560 at 60 mph, allowed 0.525 to 0.555"


def test_a_heavy_ball_is_set_aside() -> None:
    mass = np.array([5.125, 5.125, 5.30]) * OUNCE
    (ball,) = set_aside(RULES, balls(mass=mass))
    assert (ball.ball, ball.reason) == (2, "mass 5.300 oz, allowed 5.000 to 5.250 oz")


def test_a_ball_just_outside_a_window_is_printed_with_enough_digits() -> None:
    mass = np.array([5.125, 5.25004, 5.125]) * OUNCE
    e0 = np.array([0.474, 0.474, 0.47900002])
    lot = set_aside(RULES, balls(mass=mass, restitution=e0))
    assert [ball.reason for ball in lot] == [
        "mass 5.25004 oz, allowed 5.00000 to 5.25000 oz",
        "e0 0.55500002 at 60 mph, allowed 0.525 to 0.555",
    ]


def test_if_no_ball_of_a_lot_is_admissible_all_are_fired_and_rejected() -> None:
    lot = balls(restitution=np.full(3, 0.5))
    assert admit_balls(RULES, lot).all()
    assert len(set_aside(RULES, lot)) == 3


@pytest.fixture(scope="module")
def lively() -> Laboratory:
    """Return a laboratory in which the e0 of balls 3 and 7 is above the limit."""
    laboratory = opened("r161", procedure="astm-f1881", seed=5)
    lot = laboratory.specimen.balls
    e0 = np.where(np.isin(np.arange(12), [3, 7]), 0.5585, np.minimum(lot.restitution, 0.552))
    specimen = replace(laboratory.specimen, balls=replace(lot, restitution=e0))
    return replace(laboratory, specimen=specimen)


def test_balls_set_aside_are_not_fired_and_the_certificate_names_them(lively: Laboratory) -> None:
    tested = run_test(lively).of(0)
    certification = tested.certification
    assert {each.ball for each in certification.set_aside} == {3, 7}
    assert not set(certification.readings.ball) & {3, 7}
    document = certificate(certification)
    assert [each.ball for each in document.ball.set_aside] == [3, 7]
    assert "ball 4 set aside: e0 0.55" in certificate_text(document)
    assert not [flag for flag in certification.flags if flag.name == "lot-rules"]
    # e0 of the lot, measured and true: the mean of the other ten balls
    e0, true = certification.quantities["ball_restitution"], tested.sealed
    mean_e0 = np.delete(true.balls.restitution, [3, 7]).mean()
    assert true.measurand["ball_restitution"] == pytest.approx(mean_e0, abs=1e-4)
    assert e0.value == pytest.approx(mean_e0, abs=5 * e0.u)
    assert abs(true.balls.restitution.mean() - mean_e0) > 5e-4
