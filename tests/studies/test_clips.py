"""The study of clips, reduced; the full one is in the README, its table beside this file."""

import pytest
from scipy.stats import binom

from virtual_lab.errors import InputError
from virtual_lab.studies.clips import clip_coverage


def test_intervals_hold_where_a_camera_writes_places() -> None:
    """24 clips less those that rules reject (13 %): intervals hold as a binomial of 0.94 may."""
    for row in clip_coverage(clips=24, seed=500, summed=True):
        assert row.clips + row.missed == 24
        assert row.missed <= 9
        assert row.coverage * row.clips >= binom.ppf(0.006, row.clips, 0.94)
        assert 0.7 < row.rms_error_percent / row.rms_u_percent < 1.4


def test_clips_of_pixels_lead_to_the_same_speeds() -> None:
    """Three clips, stitched and spinning: every speed within four of its uncertainties."""
    for row in clip_coverage(clips=3, seed=900):
        assert row.clips + row.missed == 3
        assert row.missed <= 1
        assert row.rms_error_percent < 4 * row.rms_u_percent


def test_one_clip_is_no_study() -> None:
    """An interval of one count says nothing."""
    with pytest.raises(InputError, match="clips"):
        clip_coverage(clips=1)
