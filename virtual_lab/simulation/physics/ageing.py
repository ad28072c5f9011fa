"""Loss of a ball's restitution by its hits, and partial recovery while the ball rests."""

from __future__ import annotations

from math import exp

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BallAgeing
from virtual_lab.units import Array


def loss_of_restitution(
    ageing: BallAgeing, ball: NDArray[np.int_], speed: Array, rest: float
) -> Array:
    """Return the loss of restitution e0 before each hit, caused by earlier hits on the ball.

    e0 is the ball-wall restitution. The result is dimensionless, (shot,), and 0 at the first hit of
    a ball. The hits are in the order of time. `ball` holds the number of the ball of each hit and
    `speed` its speed [m/s], both (shot,). `rest` is the time between two hits of the same ball [s].
    """
    owners_and_slots = np.argsort(ball, kind="stable")  # sorts the hits by ball
    _, first, hits = np.unique(ball[owners_and_slots], return_index=True, return_counts=True)
    row, rank = np.arange(hits.size).repeat(hits), np.arange(ball.size) - first.repeat(hits)
    losses = np.zeros((hits.size, hits.max(initial=0)))
    losses[row, rank] = _loss_by_hit(ageing, speed)[owners_and_slots]
    remaining = exp(-rest / ageing.recovery_time)
    lasting = losses.cumsum(axis=1) - losses
    passing = np.zeros_like(losses)
    for turn in range(1, losses.shape[1]):  # one step for all balls
        passing[:, turn] = remaining * (passing[:, turn - 1] + losses[:, turn - 1])
    loss_by_rank = (1 - ageing.recovering) * lasting + ageing.recovering * passing
    loss = np.empty(ball.shape)
    loss[owners_and_slots] = loss_by_rank[row, rank]
    return loss


def lasting_loss(ageing: BallAgeing, speed: Array) -> Array:
    """Return the permanent loss of ball-wall restitution e0 by one hit at `speed` [m/s].

    The result is dimensionless and has the shape of `speed`.
    """
    return (1 - ageing.recovering) * _loss_by_hit(ageing, speed)


def _loss_by_hit(ageing: BallAgeing, speed: Array) -> Array:
    return np.asarray(ageing.loss * (speed / ageing.speed) ** 2)
