"""Estimates: allowed values, and type A evaluation against numbers in the GUM."""

from math import inf, nan, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from virtual_lab.uncertainty.estimate import (
    Estimate,
    Estimates,
    means_of_readings,
    share_interval,
)

# readings of JCGM 100:2008, H.2.2, table H.2: voltage [V], current [mA], phase [rad], with the
# printed means and standard uncertainties of the means
GUM_H2 = [
    ([5.007, 4.994, 5.005, 4.990, 4.999], 4.9990, 0.0032, 4),
    ([19.663, 19.639, 19.640, 19.685, 19.678], 19.6610, 0.0095, 4),
    ([1.0456, 1.0438, 1.0468, 1.0428, 1.0433], 1.04446, 0.00075, 5),
]


def mean_of_readings(readings: list[float], least_u: float = 0.0) -> Estimate:
    return means_of_readings(np.array([readings]), least_u=least_u).row(0)


@pytest.mark.parametrize(("readings", "value", "u", "digits"), GUM_H2)
def test_means_agree_with_gum_h2(
    readings: list[float], value: float, u: float, digits: int
) -> None:
    """The three observed quantities of JCGM 100:2008, H.2.2, agree to the printed digits."""
    mean = mean_of_readings(readings)
    assert round(mean.value, digits) == value
    assert round(mean.u, digits) == u
    assert mean.dof == 4
    assert mean.evaluation == "A"


def test_the_mean_agrees_with_nist_numacc1() -> None:
    """NIST StRD univariate, NumAcc1: the certified mean is 10000002, the standard deviation 1."""
    mean = mean_of_readings([10000001.0, 10000003.0, 10000002.0])
    assert mean.value == 10000002
    assert mean.u == pytest.approx(1 / sqrt(3), rel=1e-14)


@given(
    readings=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=30),
    shift=st.floats(-1e3, 1e3),
)
def test_mean_and_u_agree_with_textbook_sums(readings: list[float], shift: float) -> None:
    """The oracle is sums written out here; a shift moves the value and leaves the scatter."""
    mean = mean_of_readings(readings)
    n = len(readings)
    centre = sum(readings) / n
    scatter = sqrt(sum((x - centre) ** 2 for x in readings) / (n - 1) / n)
    assert mean.value == pytest.approx(centre, abs=1e-9)
    assert mean.u == pytest.approx(scatter, abs=1e-9)
    shifted = mean_of_readings([x + shift for x in readings])
    assert shifted.value == pytest.approx(centre + shift, abs=1e-9)
    assert shifted.u == pytest.approx(scatter, abs=1e-9)


def test_resolution_hides_the_scatter() -> None:
    """GUM F.2.2.1: equal readings have u = step/√12 with infinite dof."""
    least = 0.5e-3 / sqrt(12)
    same = mean_of_readings([0.864] * 5, least_u=least)
    assert same.u == pytest.approx(1.4434e-4, rel=1e-4)
    assert same.dof == inf
    wild = mean_of_readings([0.860, 0.864, 0.868, 0.872], least_u=least)
    assert wild.u == pytest.approx(2.581989e-3, rel=1e-6)  # sqrt(80e-6/3/4)
    assert wild.dof == 3


@pytest.mark.parametrize(
    ("fault", "named"),
    [
        ({"value": nan}, "value"),
        ({"value": inf}, "value"),
        ({"value": 1.0, "u": -1e-9}, "uncertainty"),
        ({"value": 1.0, "u": inf}, "uncertainty"),
        ({"value": 1.0, "u": nan}, "uncertainty"),
        ({"value": 1.0, "dof": 0.0}, "freedom"),
        ({"value": 1.0, "dof": nan}, "freedom"),
    ],
)
def test_invalid_estimates_are_refused(fault: dict[str, float], named: str) -> None:
    """The message names the wrong part."""
    with pytest.raises(ValueError, match=named):
        Estimate(**fault)


def test_nan_among_readings_is_refused() -> None:
    """A mean of NaN would be an invalid `Estimate`."""
    with pytest.raises(ValueError, match="finite"):
        mean_of_readings([1.0, nan, 2.0])


TWO = [
    Estimate(value=1.0, u=0.5, dof=4.0, evaluation="A", source="rule", pool="lot"),
    Estimate(value=-2.0, u=0.0, dof=inf, evaluation="A", source="rule", pool="lot"),
]


def test_a_row_of_a_block_is_the_estimate_of_its_laboratory() -> None:
    """Every field returns, after selection by a mask and by an index."""
    block = Estimates.stack(TWO)
    assert [block.row(n) for n in range(2)] == TWO
    assert block.select(np.array([False, True])).row(0) == TWO[1]
    assert block.select(np.array([1, 0, 1])).row(1) == TWO[0]


def test_a_block_holds_estimates_of_one_kind() -> None:
    """Evaluation, source and pool belong to the block, so that they must agree."""
    with pytest.raises(ValueError, match="one kind"):
        Estimates.stack([TWO[0], Estimate(value=1.0, u=0.5, dof=4.0)])


def test_a_laboratory_without_a_value_has_no_estimate() -> None:
    """NaN is allowed in a block, but not in an `Estimate`."""
    block = Estimates(value=np.array([nan]), u=np.array([0.1]), dof=np.array([inf]))
    with pytest.raises(ValueError, match="finite"):
        block.row(0)


@pytest.mark.parametrize(("count", "of"), [(0, 5), (5, 5), (3, 10), (939, 1000)])
def test_the_interval_of_a_share_is_that_of_clopper_and_pearson(count: int, of: int) -> None:
    expected = binomtest(count, of).proportion_ci(0.95, "exact")
    assert share_interval(count, of) == pytest.approx((expected.low, expected.high), abs=1e-10)


def test_no_case_says_nothing_about_a_probability() -> None:
    assert share_interval(0, 0) == (0.0, 1.0)
