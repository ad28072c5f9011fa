"""The scores of located positions: each count against errors made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from virtual_lab.fidelity.camera_errors import score_positions, seconds_per_picture, wrong_unsaid
from virtual_lab.fidelity.camera_pictures import Batch, pictures
from virtual_lab.fidelity.camera_scenes import Case
from virtual_lab.video.locate.located import PlaceFlag


@pytest.fixture(scope="module")
def batch() -> Batch:
    """Return twenty pictures; they are drawn in a test, because each process collects all files."""
    return pictures(Case(radius=15, phases=4, repeats=5))


def test_the_score_counts_each_kind_of_error(batch: Batch) -> None:
    """One position is lost, one flagged, one wrong and flagged, one wrong only, a phase biased."""
    least = np.full(20, batch.limit)
    x, flags = batch.x.copy(), np.zeros(20, np.uint16)
    x[0], flags[0] = np.nan, PlaceFlag.NOT_FOUND
    flags[1] = PlaceFlag.CLIPPED
    x[2], flags[2] = x[2] + 6 * least[2], PlaceFlag.POOR_FIT
    x[3] += 6 * least[3]
    x[15:] += 2 * least[15:]
    score = score_positions(
        batch, replace(batch.inputs.start, x=x, y=batch.y, x_u=least, y_u=least, flags=flags)
    )
    assert (score.lost, score.flagged, score.unsaid) == pytest.approx((0.05, 0.1, 0.05))
    assert score.bias == pytest.approx(12 / 4)
    assert score.rms == pytest.approx(batch.limit * np.sqrt((2 * 36 + 5 * 4) / 38))


def test_a_pattern_uncertainty_excuses_an_error(batch: Batch) -> None:
    least = np.full(20, batch.limit)
    off = replace(batch.inputs.start, x=batch.x + 0.1, y=batch.y, x_u=least)
    assert wrong_unsaid(batch, off).all()
    assert not wrong_unsaid(batch, replace(off, pattern_u=np.full(20, 0.021))).any()


def test_a_batch_without_positions_is_all_lost(batch: Batch) -> None:
    none = np.full(20, np.nan)
    score = score_positions(batch, replace(batch.inputs.start, x=none, y=none))
    assert score.lost == 1
    assert np.isinf(score.rms)


def test_the_time_is_divided_by_the_number_of_pictures(batch: Batch) -> None:
    """The method runs three times on the whole batch, not once per picture."""
    calls = []
    seconds_per_picture(lambda given: calls.append(1) or given.start, batch.inputs, rounds=2)
    assert len(calls) == 3
