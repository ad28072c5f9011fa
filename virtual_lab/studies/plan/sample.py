"""Simulated tests of a laboratory in numbers: u, budget, hits, and number of shots."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan, sqrt
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.aligned import AlignedArrays
from virtual_lab.lab import BlockTest, RoundRobin
from virtual_lab.measurement.certification import variance_of_hits
from virtual_lab.measurement.procedure import CHOICE
from virtual_lab.measurement.procedure.rules import SETTING_STEP
from virtual_lab.measurement.reduction.observations import REPEATABILITY
from virtual_lab.units import Array, Mask

Whole = NDArray[Any]
MOST_DEALT = 4  # largest number of balls that are dealt [procedure's number]


class Median(NamedTuple):
    """A median over simulated tests, and its standard error."""

    value: float
    error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledTests(AlignedArrays):
    """Simulated tests in numbers [SI], one per laboratory; arrays (laboratory,) unless stated."""

    names: tuple[str, ...]  # lines of the budget
    has_result: Mask  # whether the test has a result
    invalid: Mask
    u: Array
    squares: Array  # variance of each line of the budget, (laboratory, line)
    total: Array  # variance of a hit
    pooled: Array  # variance of a hit, pooled with that of the hits nearby
    unexplained: Array  # variance of a hit less the part that the constants of the budget explain
    dof: Array  # degrees of freedom of this variance
    weighing: Array  # sum of the squared weights of the hits
    wall_variance: Array  # variance of e0 of one hit at the wall
    shots: Whole
    valid: Whole  # number of valid shots
    places: Whole  # number of impact positions
    full: Whole  # number of impact positions with all hits of the procedure
    at_best: Whole  # number of shots at the impact position of the result
    valid_at_best: Whole
    admitted: Array  # number of balls that the procedure admits
    boxes: Whole  # number of boxes of balls that were opened
    by_ball: Array  # derivative of the metric with respect to e0 of each ball, (laboratory, ball)
    shares: Array  # weight of each ball's hits in the result, (laboratory, ball)
    # sum of the squared shares if 1, 2, … balls had been fired in turn, (laboratory, balls)
    dealt: Array

    aligned: ClassVar = (
        *("has_result", "invalid", "u", "squares", "total", "pooled", "unexplained", "dof"),
        *("weighing", "wall_variance", "shots", "valid", "places", "full", "at_best"),
        *("valid_at_best", "admitted", "boxes", "by_ball", "shares", "dealt"),
    )

    @classmethod
    def of(cls, laboratories: RoundRobin, tests: int, seed: int, workers: int = 1) -> SampledTests:
        """Return the tests of the first `tests` laboratories of a seed.

        Raises `InputError` in the same cases as `RoundRobin.each_block`.
        """
        return cls.concatenate(list(laboratories.each_block(sample_of, tests, seed, workers)))

    @property
    def median_u(self) -> Median:
        """Median of the stated u over the tests with a result [SI]."""
        return median_of(self.u[self.has_result])


def median_of(values: Array) -> Median:
    """Return the median of `values`, shape (n,), and its standard error, in the unit of `values`.

    The standard error is a quarter of the distance between the quantiles 0.5 - 1/√n and 0.5 + 1/√n.
    Median and error are NaN if n is 0.
    """
    if not values.size:
        return Median(nan, nan)
    half = min(1 / sqrt(values.size), 0.5)
    low, middle, high = np.quantile(values, [0.5 - half, 0.5, 0.5 + half]).tolist()
    return Median(middle, (high - low) / 4)


def sample_of(tested: BlockTest) -> SampledTests:
    """Return the simulated tests of a block as the input of `Forecast`, one test per laboratory.

    The arrays hold u, the lines of the budget, the variance of a hit, and numbers of shots.
    """
    certified, reduced = tested.certified, tested.certified.reduced
    metric, rules = certified.results["metric"], certified.procedure
    hit_weights = certified.hit_weights
    parts, scatter, count = metric.components, metric.scatter, certified.invalid.size
    assert scatter is not None
    columns = dict(zip(parts.line_names, parts.lines()[0].T, strict=True))
    names = sorted({*columns, CHOICE})  # a block may lack the choice of a position
    of_balls = [at for at, pool in enumerate(parts.pools) if pool == REPEATABILITY]
    used, owner = hit_weights.used, reduced.owner
    shares = np.zeros((count, len(of_balls)))
    np.add.at(shares, (owner[used], certified.readings.ball[used]), hit_weights.effects[used])
    places = np.round(reduced.position / SETTING_STEP).astype(int)
    fired_at, turns = np.unique([owner, places], axis=1, return_inverse=True)
    hits = np.bincount(turns.ravel(), reduced.valid, fired_at.shape[1])
    best = np.abs(reduced.position - hit_weights.position[owner]) < SETTING_STEP / 2
    in_turn = reduced.shot_numbers
    weights = np.where(in_turn >= 0, np.where(used, hit_weights.effects, 0.0)[in_turn], 0.0)
    u_ball = parts.u[:, of_balls]
    balls = reduced.preparation.balls.ball[:, 0]
    wall_hits = (balls == 0).sum(axis=1)
    return SampledTests(
        names=tuple(names),
        has_result=certified.has_result,
        invalid=certified.invalid,
        u=metric.u,
        squares=np.stack([columns.get(name, np.zeros(count)) for name in names], axis=1),
        total=scatter.variance.total,
        pooled=variance_of_hits(reduced, hit_weights, scatter.variance).total,
        unexplained=scatter.variance.unexplained,
        dof=scatter.variance.dof,
        weighing=scatter.weighing,
        wall_variance=u_ball[:, 0] ** 2 * wall_hits,
        shots=np.bincount(owner, minlength=count),
        valid=np.bincount(owner, reduced.valid, count),
        places=np.bincount(fired_at[0], minlength=count),
        full=np.bincount(fired_at[0], hits >= rules.valid_hits, count),
        at_best=np.bincount(owner, best, count),
        valid_at_best=np.bincount(owner, best & reduced.valid, count),
        admitted=reduced.preparation.used.reshape(count, -1).sum(axis=1),
        boxes=certified.block.boxes,
        by_ball=parts.effect[:, of_balls] / u_ball,
        shares=shares,
        dealt=np.stack([_dealt(weights, n + 1) for n in range(MOST_DEALT * len(of_balls))], 1),
    )


def _dealt(weights: Array, balls: int) -> Array:
    """Return the sum of the squared shares of `balls` balls that are fired in turn, (laboratory,).

    `weights` are the weights of the hits in the order of the shots, (laboratory, shot).
    """
    rounds = np.pad(weights, [(0, 0), (0, -weights.shape[1] % balls)])
    shares = rounds.reshape(len(weights), -1, balls).sum(axis=1)
    return np.asarray((shares**2).sum(axis=1))
