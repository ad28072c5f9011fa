"""Nested studies against ASTM E691's printed example, printed tables and known variances."""

from __future__ import annotations

import re
from math import log10
from pathlib import Path

import numpy as np
import pytest
import scipy.stats

import virtual_lab as vl
from virtual_lab.uncertainty.interlaboratory import (
    cochran_limit,
    grubbs_limit,
    h_limit,
    k_limit,
    nested_study,
)

# glucose in serum, ASTM E691: eight laboratories (rows), five materials of three readings; from
# memory of the standard, as are the printed figures, which the readings give to the last digit
READINGS = """
41.03 41.45 41.37 78.28 78.18 78.49 132.66 133.83 133.10 193.71 193.59 193.65 292.78 294.09 292.89
41.17 42.00 41.15 77.78 80.38 79.54 132.92 136.90 136.40 190.88 200.14 194.30 292.27 309.40 295.08
41.01 40.68 42.66 79.18 79.72 80.81 132.61 135.80 135.36 192.71 193.28 190.28 295.53 290.14 292.34
39.37 42.37 42.63 84.08 78.60 81.92 138.50 138.30 135.69 195.85 196.36 199.43 295.19 295.44 296.83
41.88 41.19 41.32 78.16 79.58 78.33 131.90 134.14 133.76 192.59 191.44 195.12 293.93 292.48 294.28
43.28 40.50 42.28 78.66 79.27 81.75 137.21 135.14 137.50 195.34 198.26 198.13 297.74 296.80 290.33
41.08 41.27 39.02 79.76 81.45 77.35 130.97 131.59 134.92 194.66 191.99 187.13 287.29 293.76 289.36
43.36 42.65 41.72 80.44 80.80 79.80 135.46 135.14 133.63 197.56 195.99 200.82 298.46 295.28 296.12
"""
GLUCOSE = np.array(READINGS.split(), float).reshape(8, 5, 1, 3).swapaxes(0, 1)
# mean, s_r and s_R of each material as printed
PRINTED = """
    41.5183 1.0632 1.0632   79.6796 1.4949 1.5796   134.7264 1.5434 2.1482
    194.7170 2.6251 3.3657  294.4920 3.9350 4.1923
"""


NIST = Path(scipy.stats.__file__).parent / "tests" / "data" / "nist_anova"
# digits of readings near 1e6 (SmLs04 to 06) and 1e12 (SmLs07 to 09) in double precision
DIGITS = {f"SmLs0{k}": digits for k, digits in zip(range(4, 10), [8] * 3 + [2] * 3, strict=True)}


def test_the_example_of_e691_to_all_digits() -> None:
    """The standard prints four decimals; its means were rounded in between, by less than 2e-4."""
    study = nested_study(GLUCOSE)
    printed = np.array(PRINTED.split(), float).reshape(5, 3).T
    assert study.mean == pytest.approx(printed[0], abs=2e-4)
    assert study.repeatability == pytest.approx(printed[1], abs=6e-5)
    assert study.reproducibility == pytest.approx(printed[2], abs=6e-5)
    # first laboratory, first material, by hand: mean 41.2833, standard deviation .2230
    assert (study.h[0, 0], study.k[0, 0]) == pytest.approx((-0.39, 0.21), abs=0.005)


def nist(name: str) -> tuple[np.ndarray, dict[str, float]]:
    """Return the rows (group, reading) and the certified values of a data set of NIST StRD."""
    text = (NIST / f"{name}.dat").read_text("utf-8")
    begin, end = re.search(r"Data\s+\(lines (\d+) to (\d+)\)", text).groups()
    rows = np.loadtxt(text.splitlines()[int(begin) - 1 : int(end)])
    number = r"([-+.\dE]+)"
    between = re.search(rf"^Between \w+\s+\d+\s+{number}\s+{number}\s+{number}", text, re.M)
    within = re.search(rf"^Within \w+\s+\d+\s+{number}", text, re.M)
    sd = re.search(rf"Certified Residual\s+Standard Deviation\s+{number}", text)
    keys = {"between": between[1], "f": between[3], "within": within[1], "sd": sd[1]}
    return rows, {key: float(value) for key, value in keys.items()}


@pytest.mark.parametrize("name", sorted(path.stem for path in NIST.glob("*.dat")))
def test_labeled_groups_agree_with_nist(name: str) -> None:
    """All eleven sets: F, sums of squares, residual standard deviation (15 certified digits)."""
    rows, certified = nist(name)
    study = nested_study(rows[:, 1], rows[:, 0])
    groups = len(study.counts)
    numbers = {
        "f": study.laboratory_mean_square / study.repeat_mean_square,
        "between": study.laboratory_mean_square * (groups - 1),
        "within": study.repeat_mean_square * (len(rows) - groups),
        "sd": study.repeatability,
    }
    for key, value in numbers.items():
        digits = -log10(abs(value / certified[key] - 1) + 1e-16)
        assert digits > DIGITS.get(name, 9), (key, digits)


def test_printed_tables_of_critical_values() -> None:
    """ISO 5725-2, tables of Cochran (5 %, 1 %) and Grubbs; ASTM E691, table of h and k."""
    assert cochran_limit(8, 2, 0.05) == pytest.approx(0.516, abs=5e-4)
    assert cochran_limit(8, 2, 0.01) == pytest.approx(0.615, abs=5e-4)
    assert cochran_limit(10, 1, 0.05) == pytest.approx(0.602, abs=5e-4)
    assert grubbs_limit(10, 0.05) == pytest.approx(2.290, abs=5e-4)
    assert grubbs_limit(10, 0.01) == pytest.approx(2.482, abs=5e-4)
    assert h_limit(8, 0.005) == pytest.approx(2.15, abs=0.005)
    assert k_limit(8, 2, 0.005) == pytest.approx(2.06, abs=0.005)
    assert np.isnan(h_limit(2, 0.005))


def test_two_lots_count_for_the_limits_and_for_the_u_of_a_reproducibility() -> None:
    """Two lots of two repeats have the freedom of one lot of three, so the printed limits hold.

    By hand: lots 0 ± 1 and 0 ± 3 in two laboratories, repeats ± .5. The mean squares of
    laboratories, lots and repeats are 0, 20 and .5, with 1, 2 and 4 degrees of freedom.
    """
    study = nested_study(np.random.default_rng(1).normal(size=(8, 2, 2)))
    assert study.k_limit() == pytest.approx(2.06, abs=0.005)
    assert study.cochran_limit() == pytest.approx(0.516, abs=5e-4)
    by_hand = nested_study([[[-1.5, -0.5], [0.5, 1.5]], [[-3.5, -2.5], [2.5, 3.5]]])
    # s_R² = 0/4 + 20/4 + .5/2; a negative variance of laboratories counts as 0
    s_R = (0.5 + (20 - 0.5) / 2) ** 0.5
    variance = 2 * (20 / 4) ** 2 / (2 + 2) + 2 * (0.5 / 2) ** 2 / (4 + 2)
    assert by_hand.reproducibility == pytest.approx(s_R)
    assert by_hand.reproducibility_u == pytest.approx(variance**0.5 / (2 * s_R))


def test_variances_are_unbiased_over_1000_data_sets() -> None:
    """Known variances of laboratories, lots and repeats; bounds: 4 standard errors."""
    rng, sds = np.random.default_rng(55), (0.7, 0.4, 1.1)
    shapes = (1000, 6, 1, 1), (1000, 6, 3, 1), (1000, 6, 3, 2)
    parts = [sd * rng.standard_normal(shape) for sd, shape in zip(sds, shapes, strict=True)]
    study = nested_study(1e4 + sum(parts[1:], parts[0]))
    variances = study.laboratory_variance, study.lot_variance, study.repeat_variance
    for variance, sd in zip(variances, sds, strict=True):
        assert abs(variance.mean() - sd**2) < 4 * variance.std() / 1000**0.5
    spread = study.reproducibility.std()  # the clipped s_R scatters by its stated u
    assert np.sqrt(np.mean(study.reproducibility_u**2)) == pytest.approx(spread, rel=0.1)
    limit = study.grubbs_limit()
    assert np.mean(study.grubbs > limit) == pytest.approx(0.05, abs=0.025)
    assert np.mean(study.cochran > study.cochran_limit()) == pytest.approx(0.05, abs=0.025)


def test_lots_agree_with_one_way_analyses() -> None:
    """The scatter of lots is that within each laboratory, the mean over the laboratories."""
    values = np.random.default_rng(3).normal(size=(4, 3, 5))
    study = nested_study(values)
    within = values.var(axis=2, ddof=1).mean()
    between_lots = 5 * values.mean(axis=2).var(axis=1, ddof=1).mean()
    assert float(study.lot_variance) == pytest.approx((between_lots - within) / 5)
    laboratories = 15 * values.mean(axis=(1, 2)).var(ddof=1)
    assert float(study.laboratory_variance) == pytest.approx((laboratories - between_lots) / 15)
    one_lot = nested_study(values[:, :1])
    assert np.isnan(one_lot.lot_variance)
    assert np.isfinite(one_lot.reproducibility)


def test_unequal_repeats_of_laboratories_by_hand() -> None:
    """ISO 5725-2 with one lot each, of 2, 3 and 1 results: means 2, 5 and 9, grand mean 28/6."""
    study = nested_study([[[1.0, 3.0]], [[4.0, 5.0, 6.0]], [[9.0]]])
    repeat = (2 + 2) / 3  # squares over (2 - 1) + (3 - 1) degrees of freedom
    grand = 28 / 6
    between = (2 * (2 - grand) ** 2 + 3 * (5 - grand) ** 2 + (9 - grand) ** 2) / 2
    size = (6 - (4 + 9 + 1) / 6) / 2
    assert float(study.mean) == pytest.approx(grand)
    assert float(study.repeatability) == pytest.approx(repeat**0.5)
    assert float(study.laboratory_variance) == pytest.approx((between - repeat) / size)
    assert np.isnan(study.lot_variance)
    # deviations from the mean of the means, 16/3, by their standard deviation, √(37/3)
    assert study.h == pytest.approx(np.array([-10, -1, 11]) / 3 / (37 / 3) ** 0.5)
    assert study.k == pytest.approx([(2 / repeat) ** 0.5, (1 / repeat) ** 0.5, np.nan], nan_ok=True)
    assert float(study.cochran) == pytest.approx(2 / 3)


def test_variances_of_unequal_lots_and_repeats_are_unbiased() -> None:
    """The mean of each estimate is 1 for its own variance of 1, and 0 for the other variances.

    An estimate is a quadratic form. Its mean for independent effects of variance 1 is therefore the
    sum of its values for one effect of 1 at a time.
    """
    numbers = [[4, 1], [2, 2, 3], [1], [3, 1, 1], [2], [2, 4]]
    places = [
        (i, j) for i, lots in enumerate(numbers) for j, n in enumerate(lots) for _ in range(n)
    ]
    laboratory, lot = np.array(places).T
    effects = {
        "laboratory": (laboratory == np.arange(6)[:, None]).astype(float),
        "lot": np.array([(np.array(places) == cell).all(axis=1) for cell in set(places)], float),
        "repeat": np.eye(len(places)),
    }
    for cause, rows in effects.items():
        studies = [nested_study(row, laboratory, lot) for row in rows]
        for name in effects:
            mean = sum(float(getattr(study, f"{name}_variance")) for study in studies)
            assert mean == pytest.approx(float(cause == name), abs=1e-12)


def test_labels_are_nested_lists() -> None:
    """The same results in three forms; laboratories keep the order of their first labels."""
    laboratories, lots = list("BBAABBAAC"), [1, 1, 5, 5, 2, 2, 6, 6, 1]
    values = [1.0, 1.1, 1.0, 1.3, 1.0, 1.2, 1.4, 1.5, 0.7]
    nested = [[[1.0, 1.1], [1.0, 1.2]], [[1.0, 1.3], [1.4, 1.5]]]
    by_label = nested_study(values[:-1], laboratories[:-1], lots[:-1])
    for wanted, found in ((nested, by_label), ([*nested, [[0.7]]], None)):
        expected = nested_study(wanted)
        study = found or nested_study(values, laboratories, lots)
        assert float(study.laboratory_variance) == pytest.approx(
            float(expected.laboratory_variance)
        )
        assert float(study.lot_variance) == pytest.approx(float(expected.lot_variance))
        assert study.h == pytest.approx(expected.h)
        assert study.reproducibility_u == pytest.approx(expected.reproducibility_u)


# three laboratories, two lots each, two repeats with each lot
BY_HAND = [[[1, 3], [7, 5]], [[2, 4], [4, 4]], [[9, 11], [10, 14]]]


def test_two_lots_by_hand() -> None:
    """Means of lots 2, 6; 3, 4; 10, 12, of laboratories 4, 3.5, 11, of all 37/6.

    MS of repeats (2 + 2 + 2 + 0 + 2 + 8)/6 = 8/3, of lots 2 (8 + .5 + 2)/3 = 7, and of laboratories
    4 (Σ m² - 3 (37/6)²)/2 = 2 · 35.1667. s_R² = MS_L/4 + MS_lot/4 + MS_r/2, so that its variance is
    the sum of 2 MS²/(dof + 2) with the squares of these factors.
    """
    study = nested_study(np.array(BY_HAND, float))
    repeat, lot = 8 / 3, 7.0
    laboratory = 2 * (16 + 12.25 + 121 - 37**2 / 12)
    s_R2 = laboratory / 4 + lot / 4 + repeat / 2
    assert float(study.repeat_variance) == pytest.approx(repeat)
    assert float(study.lot_variance) == pytest.approx((lot - repeat) / 2)
    assert float(study.laboratory_variance) == pytest.approx((laboratory - lot) / 4)
    assert float(study.reproducibility) ** 2 == pytest.approx(s_R2)
    terms = ((laboratory / 4, 2), (lot / 4, 3), (repeat / 2, 6))
    variance = sum(2 * part**2 / (dof + 2) for part, dof in terms)
    assert float(study.reproducibility_u) == pytest.approx(variance**0.5 / (2 * s_R2**0.5))


def test_negative_variances_of_lots_and_laboratories_count_as_0() -> None:
    """Repeats scatter by 2, lots and laboratories do not: s_lot = s_L = 0, and s_R is s_r."""
    study = nested_study(np.array([[[0.0, 4], [4, 0]], [[1, 3], [3, 1]]]))
    assert float(study.lot_variance) < 0
    assert float(study.laboratory_variance) <= 0
    assert float(study.lot_sd) == float(study.laboratory_sd) == 0
    assert float(study.reproducibility) == pytest.approx(float(study.repeatability))


def test_one_lot_by_hand() -> None:
    """Without lots s_R² is MS_L/n + MS_r (n - 1)/n, and its variance has two terms."""
    study = nested_study(np.array([[[1.0, 3, 5]], [[6, 8, 10]], [[2, 2, 5]]]))
    repeat = (4 + 4 + 3) / 3
    laboratory = 3 * (9 + 64 + 9 - 14**2 / 3) / 2
    s_R2 = laboratory / 3 + repeat * 2 / 3
    assert float(study.reproducibility) ** 2 == pytest.approx(s_R2)
    variance = 2 * (laboratory / 3) ** 2 / 4 + 2 * (repeat * 2 / 3) ** 2 / 8
    assert float(study.reproducibility_u) == pytest.approx(variance**0.5 / (2 * s_R2**0.5))


@pytest.mark.parametrize("lots", [1, 2, 3])
def test_limits_of_k_and_cochran_count_the_freedom_of_all_lots(lots: int) -> None:
    """By simulation with numpy: k of a given laboratory exceeds its limit with .5 % by chance."""
    rng = np.random.default_rng(lots)
    study = nested_study(rng.normal(size=(40_000, 6, lots, 3)))
    for level in (0.005, 0.05):
        above = np.mean(study.k > study.k_limit(level))
        assert above == pytest.approx(level, abs=5 * (level / study.k.size) ** 0.5)
    above = np.mean(study.cochran > study.cochran_limit(0.05))
    assert above == pytest.approx(0.05, abs=0.006)  # Bonferroni's bound is a little too safe


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.eye(3), "shape of the values"),
        (np.ones((1, 2, 2)), "laboratories = 1; allowed: at least 2"),
        (np.ones((3, 2, 1)), "repeats = 1; allowed: at least 2"),
        (np.ones((3, 2, 2)), "all results are equal"),
        (np.full((3, 1, 2), np.nan), "finite numbers"),
        ([[[1.0, np.inf]], [[1.0]]], "finite numbers"),
        ([[[1.0], [2.0]], [[1.0]]], "repeats = 1; allowed: at least 2"),
        ([[1.0, 2.0], [3.0]], "with n labels"),
        ([[["one", "two"]], [["three"]]], "with n labels"),
    ],
)
def test_wrong_input_gives_one_line(values: np.ndarray, said: str) -> None:
    with pytest.raises(vl.InputError, match=said) as caught:
        nested_study(values)
    assert "\n" not in str(caught.value)
