"""A short version of the study of clips; the table of the full one is beside this file."""

from math import nan, sqrt

import numpy as np
import pytest
from scipy.stats import binom

from tests.studies.clips import _row, clip_coverage


def test_intervals_hold_where_a_camera_writes_places() -> None:
    """24 clips minus rejected ones (20 %): the count fits a binomial distribution of 0.94."""
    for row in clip_coverage(clips=24, seed=500, summed=True):
        assert row.clips + row.missed_clips == 24
        assert row.missed_clips <= 9
        assert row.coverage * row.clips >= binom.ppf(0.006, row.clips, 0.94)
        assert 0.7 < row.rms_error_percent / row.rms_u_percent < 1.4


def test_clips_of_pixels_lead_to_the_same_speeds() -> None:
    """In three clips of stitched, spinning balls, every speed is within four u."""
    for row in clip_coverage(clips=3, seed=900):
        assert row.clips + row.missed_clips == 3
        assert row.missed_clips <= 1
        assert row.rms_error_percent < 4 * row.rms_u_percent


def test_statistics_of_clips_agree_with_a_hand_calculation() -> None:
    """20 clips with true speed 50 m/s and u .5, and one without a result.

    Eighteen have no error, one has .97 (1.94 u: held), one .99 (1.98 u: not). 19 of 20: .7513 to
    .9987 by the tables. Relative errors of 1.94 % and 1.98 %: mean 3.92/20 %, rms √(7.684/20) %,
    s² of the others about it by Σx² - n x̄².
    """
    off = np.array([0.97, 0.99, *[0.0] * 18, nan])
    row = _row("v_in", 50 + off, np.full(21, 0.5), np.full(21, 50.0))
    assert (row.clips, row.missed_clips, row.coverage) == (20, 1, 0.95)
    assert (row.coverage_low, row.coverage_high) == pytest.approx((0.7513, 0.9987), abs=5e-5)
    squares = 1.94**2 + 1.98**2
    assert row.bias_percent == pytest.approx(0.196)
    assert row.rms_error_percent == pytest.approx(sqrt(squares / 20))
    assert row.rms_u_percent == pytest.approx(1.0)
    variance = (squares - 20 * 0.196**2) / 19
    assert row.bias_se_percent == pytest.approx(sqrt(variance / 20))
