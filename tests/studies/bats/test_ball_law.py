"""The sensitivity to the force law of the ball, against values measured during planning."""

from itertools import pairwise

import numpy as np
import pytest

from virtual_lab.studies.bats import ball_law


def test_the_law_alone_moves_the_peaks_of_a_wood_bat(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        ball_law, "PLACES_IN", np.arange(4.0, 8.01)
    )  # positions of the peaks, and around them
    rows = ball_law.sensitivity("r161")
    names = [(row.law, row.exponent) for row in rows]
    power, other = rows[:3], rows[3:]
    assert names[:3] == [("power law", 1.0), ("power law", 1.5), ("power law", 2.0)]
    assert {row.law for row in other} == {"Hunt-Crossley"}
    # planning: exponents 1, 1.5, 2 give 0.500, 0.490, 0.479, about 0.01 per step
    for one, next_ in pairwise(power):
        assert one.peaks["peak_restitution"] - next_.peaks["peak_restitution"] == pytest.approx(
            0.0085, abs=0.004
        )
        assert (
            one.peaks["peak_restitution_position_in"] > next_.peaks["peak_restitution_position_in"]
        )
    assert power[0].peaks["peak_restitution"] == pytest.approx(
        0.494, abs=0.003
    )  # value of the modal model
    spread = max(row.peaks["peak_restitution"] for row in rows) - min(
        row.peaks["peak_restitution"] for row in rows
    )
    assert 0.02 < spread < 0.06
    # all laws have the same compression time; the rest of the contact depends on the law
    assert [row.wall_time_ms for row in rows] == pytest.approx([0.824] * 5, rel=0.06)
