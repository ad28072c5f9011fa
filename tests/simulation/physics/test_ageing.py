"""Balls that lose restitution, against an explicit sum over all pairs of hits."""

from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from virtual_lab.catalog.specs import BallAgeing
from virtual_lab.simulation.physics.ageing import lasting_loss, loss_of_restitution

AGEING = BallAgeing(speed=26.8, loss=2e-4, recovering=0.4, recovery_time=600.0)
hits = st.lists(st.tuples(st.integers(0, 5), st.floats(5.0, 60.0)), max_size=25)


def written_out(ball: list[int], speed: list[float], rest: float) -> list[float]:
    """Return the loss before each hit: 60 % of every earlier loss stays, 40 % decays with time."""
    losses = []
    for n, this in enumerate(ball):
        mine = [speed[i] for i in range(n) if ball[i] == this]
        losses.append(
            sum(
                2e-4 * (v / 26.8) ** 2 * (0.6 + 0.4 * exp(-(len(mine) - i) * rest / 600))
                for i, v in enumerate(mine)
            )
        )
    return losses


@given(hits=hits, rest=st.floats(0.0, 1e6))
def test_the_loss_is_the_explicit_sum_over_earlier_hits(
    hits: list[tuple[int, float]], rest: float
) -> None:
    ball, speed = [hit[0] for hit in hits], [hit[1] for hit in hits]
    loss = loss_of_restitution(AGEING, np.array(ball, dtype=int), np.array(speed), rest)
    assert loss.tolist() == pytest.approx(written_out(ball, speed, rest), rel=1e-12, abs=1e-18)


def test_without_rest_every_hit_costs_the_same() -> None:
    loss = loss_of_restitution(AGEING, np.zeros(5, dtype=int), np.full(5, 26.8), 0.0)
    assert loss == pytest.approx(2e-4 * np.arange(5), rel=1e-12)


def test_after_a_long_rest_the_lasting_part_is_left() -> None:
    """The lasting share is 0.6; at half the speed the loss is a quarter."""
    speed = np.array([26.8, 13.4, 26.8])
    loss = loss_of_restitution(AGEING, np.zeros(3, dtype=int), speed, 1e9)
    assert loss == pytest.approx([0, 1.2e-4, 1.5e-4], rel=1e-12)
    assert lasting_loss(AGEING, speed) == pytest.approx([1.2e-4, 0.3e-4, 1.2e-4], rel=1e-12)
