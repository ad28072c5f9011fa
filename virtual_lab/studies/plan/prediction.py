"""Cheap prediction of the median u of plans, from the budget of the present laboratory.

To first order, the variance of a term is that of the present laboratory, divided by the number of
readings of which the term is the mean, and multiplied by the factors that the exchanged instruments
cause. Nothing is simulated here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab.measurement.procedure import CHOICE, Procedure
from virtual_lab.measurement.reduction.observations import REPEATABILITY, SLOPE_REPEATABILITY
from virtual_lab.studies.plan.sample import MOST_DEALT, SampledTests
from virtual_lab.uncertainty.budget import HITS
from virtual_lab.units import Array

# multiples of the procedure's counts that plans may have; fewer would break the rules
MULTIPLES = (1, 7 / 6, 4 / 3, 3 / 2, 5 / 3, 2, 5 / 2, 3, 4)
SCATTER = (HITS, CHOICE, REPEATABILITY, SLOPE_REPEATABILITY)  # terms of the scatter of the hits


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Numbers of readings of a test: whole numbers, or arrays of one shape for several plans."""

    hits: Any  # valid hits per impact position
    final_hits: Any  # hits at the best position after a scan; 0: none
    balls: Any
    wall_hits: Any  # hits at the wall per ball and speed

    @classmethod
    def of(cls, rules: Procedure) -> Self:
        """Return the counts of a procedure."""
        final = rules.scan.final_hits if rules.scan else 0
        return cls(
            hits=rules.valid_hits, final_hits=final, balls=rules.balls, wall_hits=rules.wall_hits
        )

    @property
    def values(self) -> tuple[Any, ...]:
        """The four counts in the order of the fields."""
        return tuple(getattr(self, each.name) for each in fields(self))

    @property
    def grid(self) -> Counts:
        """The counts of all candidate plans, each of the shape (hits, final hits, balls, wall)."""
        axes = [
            np.unique(np.round(np.multiply(count, MULTIPLES)).astype(int)) for count in self.values
        ]
        names = (each.name for each in fields(self))
        return Counts(**dict(zip(names, np.meshgrid(*axes, indexing="ij"), strict=True)))

    def at(self, index: tuple[int, ...]) -> Counts:
        """Return the counts of one plan of a grid as whole numbers."""
        return Counts(**{each.name: int(getattr(self, each.name)[index]) for each in fields(self)})


class Exchanged(NamedTuple):
    """Tests with one instrument exchanged."""

    sample: SampledTests
    scatter: bool  # whether the new instrument has another scatter


@dataclass(frozen=True, kw_only=True)
class Forecast:
    """Predicted u and shots of plans of a laboratory, of which a sample of tests is known."""

    rules: Procedure
    sample: SampledTests  # tests of the present laboratory
    # tests of some of these laboratories with one instrument exchanged, one entry per instrument
    exchanged: Sequence[Exchanged] = ()
    # tests of the same laboratories with twice as many hits; None without a choice of the position
    doubled: SampledTests | None = None

    @cached_property
    def present(self) -> Counts:
        """Counts of the present laboratory, those of the procedure."""
        return Counts.of(self.rules)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the terms of the budget."""
        return self.sample.names

    def u(self, counts: Counts) -> Array:
        """Return the predicted median u [SI], shape (set of exchanges, …), … as the counts.

        Bit k of the index of a set is 1 if instrument k is exchanged.
        """
        return np.asarray(np.sqrt(np.tensordot(self._factors, self._terms(counts), 1)))

    @property
    def gain(self) -> float:
        """Share of the variance that all exchanges together remove."""
        terms = self._terms(self.present)
        return float(1 - self._factors[-1] @ terms / terms.sum())

    def contributions(self, counts: Counts, exchanges: int) -> dict[str, float]:
        """Return the predicted contribution of each term to the u of one plan [SI], largest first.

        `exchanges` is the index of the set of exchanges.
        """
        squares = self._factors[exchanges] * self._terms(counts)
        order = np.argsort(-squares)
        return {self.names[at]: float(np.sqrt(squares[at])) for at in order}

    def shots(self, counts: Counts) -> Array:
        """Return the expected number of shots at the bat, in the shape of the counts."""
        sample, present = self.sample, self.present
        share = sample.valid_at_best.sum() / max(sample.at_best.sum(), 1)
        share = share or sample.valid.sum() / sample.shots.sum()
        scan = sample.shots.mean() - self._final_shots(present.final_hits, share)
        scan = scan + sample.full.mean() * (np.asarray(counts.hits) - present.hits) / share
        return np.asarray(scan + self._final_shots(counts.final_hits, share))

    def shots_of_sets(self, counts: Counts) -> Array:
        """Return the expected number of shots, shape (set of exchanges, …), … as the counts.

        Only an instrument with another scatter changes it, such as a cannon that aims better.
        """
        present = self.shots(counts)
        sets = np.arange(2 ** len(self.exchanged))
        shots = np.broadcast_to(present, (sets.size, *np.shape(present))).copy()
        for bit, each in enumerate(self.exchanged):
            if each.scatter:
                shots[sets >> bit & 1 == 1] *= (
                    replace(self, sample=each.sample).shots(counts) / present
                )
        return shots

    def _final_shots(self, hits: ArrayLike, share: float) -> Array:
        """Return the expected number of shots for the final hits, of which a `share` is valid."""
        n, scan = np.asarray(hits, float), self.rules.scan
        if scan is None or not scan.consecutive or share == 1:
            return np.asarray(n / share)
        return np.asarray((share**-n - 1) / (1 - share))  # mean wait for a run of n successes

    @cached_property
    def _factors(self) -> Array:
        """Factor of the variance of each term for each set of exchanges, (set, term)."""
        ratios = [self._ratio(each) for each in self.exchanged]
        sets = np.arange(2 ** len(ratios))[:, None]
        factors = np.ones((sets.size, len(self.names)))
        for bit, ratio in enumerate(ratios):
            factors *= np.where(sets >> bit & 1, ratio, 1.0)
        return factors

    def _ratio(self, exchanged: Exchanged) -> Array:
        """Return the factor of the variance of each term that an exchange causes, (term,).

        The terms of the scatter of hits and wall hits are taken as unchanged, unless the scatter of
        the instrument is another.
        """
        before = _squares(self.sample.select(slice(exchanged.sample.u.size)))
        changed = (before > 0) & (exchanged.scatter | ~np.isin(self.names, SCATTER))
        after = _squares(exchanged.sample)
        return np.asarray(np.where(changed, after / np.where(changed, before, 1.0), 1.0))

    def _terms(self, counts: Counts) -> Array:
        """Return the variance of each term without exchanges, (term, …)."""
        present, scale = self.present, np.ones(np.shape(counts.hits))
        wall = present.wall_hits / np.asarray(counts.wall_hits)
        balls = present.balls / np.asarray(counts.balls)
        scales = {
            REPEATABILITY: wall * self._ball_scale(counts),
            SLOPE_REPEATABILITY: wall * balls,
            CHOICE: (np.asarray(counts.hits) / present.hits) ** self._choice_power,
        }
        terms = [
            square * scales.get(name, scale)
            for name, square in zip(self.names, _squares(self.sample), strict=True)
        ]
        terms[self.names.index(HITS)] = self._hits(counts) * scale
        return np.stack(terms)

    def _hits(self, counts: Counts) -> Array:
        """Return the median variance that the scatter of the hits gives to the result.

        The variance of a hit has the distribution of chi square, whose median is below its mean,
        and the part that the budget explains is subtracted.
        """
        from scipy.special import chdtri

        sample, has_result = self.sample, self.sample.has_result
        before, hits = self._hits_of_result(self.present), self._hits_of_result(counts)
        dof = np.median(sample.dof[has_result]) * (hits - 1) / (before - 1)
        total, unexplained = sample.total[has_result].mean(), sample.unexplained[has_result].mean()
        middle = total * chdtri(dof, 0.5) / dof
        weighing = np.median(sample.weighing[has_result]) * before / hits
        return np.asarray(weighing * np.maximum(middle - (total - unexplained), 0.0))

    @cached_property
    def _choice_power(self) -> float:
        """Power of the number of hits that the variance of the choice of a position follows.

        The variance falls faster than that of a mean if the positions are further apart than chance
        can confuse.
        """
        at = self.names.index(CHOICE)
        before = _squares(self.sample)[at]
        after = _squares(self.doubled)[at] if self.doubled else 0.0
        return float(np.log2(after / before)) if before and after else -1.0

    @staticmethod
    def _hits_of_result(counts: Counts) -> Array:
        """Return the number of hits per position that the result is the mean of."""
        return np.asarray(np.where(counts.final_hits, counts.final_hits, counts.hits))

    def _ball_scale(self, counts: Counts) -> Array:
        """Return the factor of the variance that the errors of e0 of the balls cause."""
        return np.asarray(self._ball_variance(counts) / self._ball_variance(self.present))

    def _ball_variance(self, counts: Counts) -> Array:
        """Return the variance of the result per variance of the error of e0 of a ball.

        The result depends on e0 of the ball of each hit and on the mean e0 of the lot.
        """
        of_lot, of_ball = self._ball_derivatives
        balls = len(self._dealt) / MOST_DEALT
        more_hits = self._hits_of_result(counts) / self._hits_of_result(self.present)
        more_balls = np.asarray(counts.balls) / self.present.balls
        admitted = self.sample.admitted.mean() * more_balls / more_hits
        dealt = np.clip(np.round(admitted).astype(int), 1, len(self._dealt))
        lot = balls * of_lot * (of_lot + 2 * of_ball / balls) / more_balls
        struck = of_ball**2 * self._dealt[dealt - 1] / more_hits
        # both cancel if all balls are hit equally often
        return np.asarray(np.maximum(lot + struck, 0.0))

    @cached_property
    def _ball_derivatives(self) -> tuple[float, float]:
        """Derivatives of the result with respect to e0: of a ball without hits, and more per share.

        The share is that of the ball's hits in the result.
        """
        share = self.sample.shares[self.sample.has_result].ravel()
        derivative = np.nan_to_num(self.sample.by_ball[self.sample.has_result].ravel())
        slope, intercept = np.polyfit(share, derivative, 1)
        return float(intercept), float(slope)

    @cached_property
    def _dealt(self) -> Array:
        """Mean sum of the squared shares of 1, 2, … balls, (balls,)."""
        return np.asarray(self.sample.dealt[self.sample.has_result].mean(axis=0))


def _squares(sample: SampledTests) -> Array:
    return np.asarray(sample.squares[sample.has_result].mean(axis=0))
