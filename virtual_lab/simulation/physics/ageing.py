"""How a ball loses restitution by being hit, and gets some of it back while it rests."""

from __future__ import annotations

from math import exp

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BallAgeing
from virtual_lab.units import Array


def loss_of_restitution(
    ageing: BallAgeing, ball: NDArray[np.int_], speed: Array, rest: float
) -> Array:
    """Return how much of its e0 each hit finds gone, (shot,): the ball's earlier hits took it.

    Hits are in their order: which `ball` at what `speed` [m/s], (shot,). Between two of the same
    ball it rests [s].
    """
    in_turn = np.argsort(ball, kind="stable")  # ball by ball
    _, first, hits = np.unique(ball[in_turn], return_index=True, return_counts=True)
    row, rank = np.arange(hits.size).repeat(hits), np.arange(ball.size) - first.repeat(hits)
    taken = np.zeros((hits.size, hits.max(initial=0)))
    taken[row, rank] = _taken(ageing, speed)[in_turn]
    kept = exp(-rest / ageing.recovery_time)
    lasting = taken.cumsum(axis=1) - taken
    passing = np.zeros_like(taken)
    for turn in range(1, taken.shape[1]):  # all balls at once
        passing[:, turn] = kept * (passing[:, turn - 1] + taken[:, turn - 1])
    gone = (1 - ageing.recovering) * lasting + ageing.recovering * passing
    found = np.empty(ball.shape)
    found[in_turn] = gone[row, rank]
    return found


def lasting_loss(ageing: BallAgeing, speed: Array) -> Array:
    """Return what hits at `speed` [m/s] take off e0 for good, of its shape."""
    return (1 - ageing.recovering) * _taken(ageing, speed)


def _taken(ageing: BallAgeing, speed: Array) -> Array:
    return np.asarray(ageing.loss * (speed / ageing.speed) ** 2)
