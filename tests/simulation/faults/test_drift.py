"""A wall whose e0 readings drift upward."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from virtual_lab.simulation.faults.catalogue import drifting


def test_a_wall_that_drifts_shows_six_per_cent_more_at_its_last_hit() -> None:
    """Five equal hits and gates 0.2 m apart: the rebound speed rises evenly from 1 to 1.06."""
    times = np.zeros((5, 2, 2, 2))  # axes: shot, direction, gate, edge
    times[:, 0] = [[0.0, 0.003], [0.01, 0.013]]
    times[:, 1] = [[0.05, 0.053], [0.03, 0.033]]
    written = SimpleNamespace(plan=SimpleNamespace(slot=np.arange(5)))
    drifted = drifting(SimpleNamespace(times=times), cast("Any", written))["times"]
    assert np.array_equal(drifted[:, 0], times[:, 0])
    speed = 0.2 / (drifted[:, 1, 0, 0] - drifted[:, 1, 1, 0])
    assert speed / speed[0] == pytest.approx([1, 1.015, 1.03, 1.045, 1.06], rel=1e-12)
