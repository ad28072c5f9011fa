"""Analysis of variance against NIST's certified values and gauge data checked by hand."""

import re
from math import log10, sqrt
from pathlib import Path

import numpy as np
import pytest
import scipy.stats

import virtual_lab as vl

NIST = Path(scipy.stats.__file__).parent / "tests" / "data" / "nist_anova"
# digits of readings near 1e6 (SmLs04 to 06) and 1e12 (SmLs07 to 09) in double precision
DIGITS = {f"SmLs0{k}": digits for k, digits in zip(range(4, 10), [8] * 3 + [2] * 3, strict=True)}


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
def test_group_studies_agree_with_nist(name: str) -> None:
    """All eleven sets: F, sums of squares, residual standard deviation (15 certified digits)."""
    rows, certified = nist(name)
    study = vl.group_study(rows[:, 1], rows[:, 0])
    numbers = {
        "f": study.f,
        "between": study.between.ss,
        "within": study.within.ss,
        "sd": study.repeatability,
    }
    for key, value in numbers.items():
        digits = -log10(abs(value / certified[key] - 1) + 1e-16)
        assert digits > DIGITS.get(name, 9), (key, digits)


# readings of AIAG Measurement systems analysis: 10 parts, 3 appraisers, three trials each
GAUGE = np.array(
    [
        [0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36],
        [0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25],
        [0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31],
        [0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68],
        [0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62],
        [0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50],
        [0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49],
        [-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77],
        [-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16],
    ]
)
PARTS, OPERATORS = np.tile(np.arange(10), 9), np.repeat(list("AAABBBCCC"), 10)


def test_a_gauge_study_agrees_with_the_manual() -> None:
    """Printed results: EV .199933, AV .226838, GRR .302372, PV 1.042327, 27.86 %, ndc 4."""
    study = vl.gauge_study(GAUGE.ravel(), PARTS, OPERATORS)
    lines = study.operators.ss, study.parts.ss, study.interaction.ss, study.trials.ss
    assert lines == pytest.approx((3.16726, 88.3619, 0.35898, 2.75893), rel=2e-5)
    assert study.pooled
    deviations = study.repeatability, study.operator_sd, study.gauge, study.part_sd, study.total
    printed = (0.199933, 0.226838, 0.302372, 1.042327, 1.085300)
    assert deviations == pytest.approx(printed, abs=1e-6)
    assert study.percent == pytest.approx(27.86, abs=0.005)
    assert study.categories == pytest.approx(4.86, abs=0.005)
    shuffled = np.random.default_rng(1).permutation(90)
    again = vl.gauge_study(GAUGE.ravel()[shuffled], PARTS[shuffled], OPERATORS[shuffled])
    assert again.gauge == pytest.approx(study.gauge)


def test_an_interaction_stays_apart() -> None:
    """Two parts, two operators and two trials by hand: σ²_PO = (MS_PO - MS_E)/2."""
    values = [1.0, 1.2, 3.0, 3.2, 5.0, 5.2, 1.0, 1.2]
    study = vl.gauge_study(values, [1, 1, 2, 2, 1, 1, 2, 2], list("AAAABBBB"))
    assert not study.pooled
    assert study.repeatability**2 == pytest.approx(0.02)
    assert study.interaction_sd**2 == pytest.approx((18.0 - 0.02) / 2)
    assert study.operator_sd == 0
    assert study.gauge**2 == pytest.approx(0.02 + 8.99)


def test_groups_of_different_size_agree_with_searle() -> None:
    """Searle's n0 by hand is (8 - (25 + 9)/8)/1 = 3.75."""
    values = [1.0, 2.0, 3.0, 2.0, 2.0, 5.0, 6.0, 7.0]
    study = vl.group_study(values, list("aaaaabbb"))
    assert study.within.ss == pytest.approx(2.0 + 2.0)
    assert study.between.ss == pytest.approx(15 / 8 * 4**2)
    variance = (30 - 4 / 6) / 3.75
    assert study.between_sd == pytest.approx(sqrt(variance))
    assert study.reproducibility == pytest.approx(sqrt(variance + 4 / 6))
    assert study.mean == 3.5


@pytest.mark.parametrize(
    ("study", "said"),
    [
        (lambda: vl.group_study([1, 1, 1], "aab"), "all readings are equal"),
        (lambda: vl.group_study([1, 2, 3], "abc"), "one of them with 2 readings"),
        (lambda: vl.group_study([1, 2], "aab"), "labels = 3; allowed: one per reading, 2"),
        (lambda: vl.group_study([1, np.nan], "ab"), "finite numbers"),
        (lambda: vl.gauge_study(GAUGE[0], range(10), "A" * 10), "equally often, twice or more"),
        (lambda: vl.gauge_study(GAUGE.ravel()[1:], PARTS[1:], OPERATORS[1:]), "equally often"),
    ],
)
def test_wrong_input_gives_one_line(study, said: str) -> None:
    with pytest.raises(vl.InputError, match=said) as caught:
        study()
    assert "\n" not in str(caught.value)
