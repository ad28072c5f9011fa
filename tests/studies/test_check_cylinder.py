"""Sessions with the steel cylinder: a rigid mass by hand, scatter, and a faulty rig."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest

from virtual_lab.errors import InputError
from virtual_lab.studies.check_cylinder import check_cylinder
from virtual_lab.studies.daily import daily
from virtual_lab.units import INCH, OUNCE

HITS = 10


def test_the_check_cylinder_has_the_e_of_a_rigid_mass() -> None:
    """Oracle: e = e0 = 0.55 and r = m b²/I of a round steel bar hit at its center of percussion.

    The e0 of balls in the lot varies by 0.004; calibrations contribute about as much.
    """
    length, radius, ball = 30 * INCH, 1.125 * INCH, 5.125 * OUNCE
    mass = 7850 * pi * radius**2 * length
    centre = mass * (length**2 / 12 + radius**2 / 4)
    arm = length / 2 - 6 * INCH
    inertia = centre + mass * arm**2
    r = ball * (inertia / (mass * arm)) ** 2 / inertia
    found = [check_cylinder(6, HITS, seed=seed).mean() for seed in range(8)]
    assert np.mean(found) == pytest.approx((0.55 - r) / (1 + r), abs=0.006)


def test_sessions_scatter_as_the_hits_do() -> None:
    """From hit to hit 0.0037 in e0, or 0.0058 in e_A with gates and recoil; ten hits."""
    values = check_cylinder(200, HITS, seed=4)
    assert 0.0037 / sqrt(HITS) < values.std(ddof=1) < 1.25 * 0.006 / sqrt(HITS)
    neighbours = np.corrcoef(values[1:], values[:-1])[0, 1]
    assert abs(neighbours) < 4 / sqrt(200)
    assert np.array_equal(check_cylinder(20, HITS, seed=4), values[:20])


def test_a_rig_error_is_detected_from_its_first_day() -> None:
    """For an error of half an inch along the barrel, e_A from recoil is wrong by 3 to 10 %."""
    sound = check_cylinder(5, 4, seed=2, faults=("aim-along",), since=6)
    wrong = check_cylinder(5, 4, seed=2, faults=("aim-along",), since=4)
    assert np.array_equal(wrong[:3], sound[:3])
    assert np.all(np.abs(wrong[3:] / sound[3:] - 1) > 0.03)
    assert np.all(np.abs(wrong[3:] / sound[3:] - 1) < 0.15)


def test_the_chart_raises_an_alarm_on_the_first_day_of_a_large_shift() -> None:
    """A shift of at least ten standard deviations, which the ball at the wall does not show."""
    played = daily(days=14, baseline=8, hits=4, faults=("aim-along",), since=12)
    assert played.since == 12
    rows = {row.rule: row for row in played.cylinder_alarms}
    assert rows["1 day beyond 3 sigma"].delay_days == 0
    assert rows["moving range"].delay_days == 0
    assert np.array_equal(played.values, daily(days=14, baseline=8, hits=4).values)
    assert played.document["faults"] == ["aim-along"]
    last = played.document["days"][-1]
    assert "3 sigma" in last["cylinder_alarms"]
    assert last["cylinder_collision_efficiency"] == played.cylinder[-1]


def test_a_day_without_valid_hits_is_refused() -> None:
    with pytest.raises(InputError, match="day = 2; no hit at the check cylinder is valid: ball"):
        check_cylinder(3, 2, seed=1, faults=("cannon-slow",), since=2)
    with pytest.raises(InputError, match="did you mean gate-moved"):
        check_cylinder(3, 2, seed=1, faults=("gate-move",))
