"""Free flight in closed form against known limits."""

import numpy as np
import pytest

from virtual_lab.relations.flight import distance_after, speed_after, time_after


def test_distance_and_time_are_inverse() -> None:
    """The distance flown in the time of a distance is that distance; without air it is v t."""
    for drag in (0.0, 1e-12, 0.006, 0.5):
        time = time_after(2.0, 30.0, drag)
        assert distance_after(time, 30.0, drag) == pytest.approx(2.0, rel=1e-13)
        assert speed_after(time, 30.0, drag) == pytest.approx(30 * np.exp(-2 * drag), rel=1e-13)
    assert distance_after(0.1, 30.0, 0.0) == 3.0
    assert distance_after(0.0, 30.0, 0.006) == 0.0
