"""Search for the cheapest plan: predicted first, then simulated until it is decided.

All plans are simulated with the same laboratories, that is with common random numbers. The limits
are numbers of tests, not seconds, so one seed finds the same plans on every computer.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import inf
from typing import Literal

import numpy as np

from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress
from virtual_lab.output.tables import column
from virtual_lab.studies.plan.choosing import Index, cheapest, cheapest_with_fewer
from virtual_lab.studies.plan.laboratory import PlannedLaboratory
from virtual_lab.studies.plan.prediction import Counts
from virtual_lab.studies.plan.prices import Prices
from virtual_lab.units import Array

Reaches = Literal["yes", "no", "not decided"]
Compared = Literal["chosen", "equal", "higher", ""]  # rows are sorted by this word
CERTAIN = 2.0  # standard errors within which the simulated u does not decide about the target
SHOWN = 10  # largest number of plans that are simulated and shown
CLOSE = 5.0  # difference below which the minutes of two plans are equal
SMALL = 0.1  # expected saving that ends the search [`CLOSE`]
# tests of the search beyond those of the table, about 20 s of processor time, and of one plan
MOST_TESTS, MOST_OF_PLAN = 20_000, 5_000
MORE = 4  # factor of the number of tests of a plan that is not decided
# relative error of the predicted ratio of two u per step of a count between them, from ten cases;
# and the difference of a u from the target that the most tests of a plan decide [share of u]
DOUBT, DECIDED = 0.02, 0.008


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanRow:
    """A plan: instruments and counts, its price, and its u predicted and simulated."""

    plan: str = column("plan", form="")
    hits: int = column("hits")
    final_hits: int = column("final hits", form=lambda row: str(row.final_hits or ""))
    balls: int = column("balls")
    wall_hits: int = column("wall hits")
    minutes: float = column("minutes", form=".0f")
    price: float | None = column("price", form=".0f")  # all tests and exchanged instruments
    currency: str = column("", form="")
    planned_u: float  # predicted to first order
    simulated_u: float = column("simulated u", form=".3g")  # median over the tests
    simulated_u_se: float  # standard error of the median
    reaches: Reaches = column("reaches the target", form="")
    compared: Compared = column("cost", form="")
    tests: int
    invalid: int
    exchanged: str = column("exchanged", form="")
    unit: str  # unit of u


class Search:
    """Plans of one laboratory, the u and cost of each, and those that were simulated."""

    def __init__(
        self, laboratory: PlannedLaboratory, target: float, tests: int, prices: Prices | None
    ) -> None:
        self.laboratory, self.target, self.tests = laboratory, target, tests
        self.printed = METRICS[laboratory.forecast.rules.metric]
        self.grid = laboratory.forecast.present.grid
        self.u = self.printed.in_unit(laboratory.predict_u(self.grid))
        self.minutes = laboratory.minutes(self.grid)
        self.prices, self.cost, self.close = prices, self.minutes, CLOSE
        if prices:
            self.cost = prices.of_plans(laboratory.exchanges, self.minutes, self.grid.balls)
            self.close *= prices.per_minute.value * prices.tests.value
        self.simulated: dict[Index, PlanRow] = {}
        self.left = MOST_TESTS + SHOWN * tests

    def cheapest(self, progress: Progress) -> list[Index]:
        """Return plans that may reach the target: the chosen, those equal to it, then the others.

        All of them are simulated. The list is empty if no plan reaches the target. If the present
        laboratory reaches it, the list has no other plan.
        """
        present: Index = (0,) * self.u.ndim
        plans, unknown = [present], [present]
        while unknown:
            self._simulate(unknown[0])
            progress("plans", len(self.simulated), max(2 * SHOWN, len(self.simulated)))
            if self._grows(present):
                continue
            if self.simulated[present].reaches == "yes":
                return [present]
            unknown = []
            if self.left > MOST_OF_PLAN:
                unknown = self._promising() or self._simpler()
            plans = cheapest(self.estimates()[0], self.cost, self.target, SHOWN)
            unknown = unknown or [at for at in plans or [self.lowest()] if self._open(at)]
        plans += [at for at in self._best[:1] if at not in plans]
        return sorted(plans, key=lambda at: (self.row(at).compared, self.cost[at]))[:SHOWN]

    def row(self, at: Index, name: str = "") -> PlanRow:
        """Return the row of a plan, which is simulated now if it is new."""
        if at not in self.simulated:
            self._simulate(at)
        compared: Compared = ""
        if self.simulated[at].reaches != "no" and (best := self._best[:1]):
            near = self.cost[at] < self.cost[best[0]] + self.close
            compared = "chosen" if at in best else "equal" if near else "higher"
        return replace(self.simulated[at], plan=name, compared=compared)

    def lowest(self, sets: int | None = None) -> Index:
        """Return the plan with the smallest estimated u, of the first `sets` sets of exchanges.

        The first set is that without an exchange. By default all sets are compared.
        """
        u, _ = self.estimates()
        return _index(u[:sets].argmin(), u)

    @property
    def _certain(self) -> list[Index]:
        """Simulated plans that reach the target beyond doubt."""
        return [at for at, plan in self.simulated.items() if plan.reaches == "yes"]

    @property
    def _near(self) -> float:
        """Cost below which a plan is as good as the cheapest certain one."""
        return min((float(self.cost[at]) for at in self._certain), default=0) + self.close

    @property
    def _best(self) -> list[Index]:
        """Plans that reach the target at the smallest cost, the fewest exchanges first."""
        near = [at for at in self._certain if self.cost[at] < self._near]
        return sorted(near, key=lambda at: (at[0].bit_count(), self.cost[at]))

    def _grows(self, at: Index) -> bool:
        """Return whether a simulated plan can be decided by more tests."""
        plan = self.simulated[at]
        return plan.reaches == "not decided" and plan.tests * MORE <= MOST_OF_PLAN

    def _open(self, at: Index) -> bool:
        """Return whether a plan is new, or more tests may show that it replaces the best plan."""
        if at not in self.simulated:
            return True
        best = self._best[:1]
        fewer = all(at[0].bit_count() < each[0].bit_count() for each in best)
        near = all(self.cost[at] < self.cost[each] + self.close for each in best)
        return fewer and near and self.left > 0 and self._grows(at)

    def _simpler(self) -> list[Index]:
        """Return a new plan that may replace the best one because it has fewer exchanges."""
        if not self._best:
            return []
        u, _ = self.estimates()
        for at in self.simulated:
            u[at] = inf
        fewer = cheapest_with_fewer(u, self.cost, self.target, self._best[0][0].bit_count())
        return [fewer] if fewer and self.cost[fewer] < self._near else []

    def _promising(self) -> list[Index]:
        """Return the plan with the largest expected saving per test, if it is not small.

        The saving is that of cost in comparison with the best plan, beyond the difference of equal
        plans, multiplied by the probability that u is so far below the target that more tests
        decide. Otherwise the best plan is returned if it had few tests: of many plans the luckiest
        seems best.
        """
        from scipy.special import ndtr

        (u, error), best = self.estimates(), self._best
        least = min((self.cost[at] for at in best), default=self.cost.max())
        saving = np.maximum(least - self.close - self.cost, 0)
        saving = saving * ndtr(((1 - DECIDED) * self.target / u - 1) / error)
        saving[saving < SMALL * self.close] = 0
        for at, plan in self.simulated.items():
            saving[at] *= self.tests / (plan.tests * MORE) if self._grows(at) else 0
        at = _index(saving.argmax(), saving)
        few = min(self.tests, MOST_OF_PLAN // MORE)
        return [at] if saving[at] else [at for at in best[:1] if self.simulated[at].tests == few]

    def estimates(self) -> tuple[Array, Array]:
        """Return u of all plans and its relative standard error.

        u of a plan is simulated, or predicted and multiplied by the ratio of simulated to predicted
        u. The ratio is a mean over the simulated plans: the weights fall with their distance and
        their standard errors. If the simulation does not decide, u is at most the target.
        """
        here = np.indices(self.u.shape[1:])
        weights = ratios = np.zeros(self.u.shape[1:])
        for at, plan in self.simulated.items():
            steps = np.abs(here - np.reshape(at[1:], (-1, 1, 1, 1, 1))).sum(axis=0)
            weight = 1 / ((plan.simulated_u_se / plan.simulated_u) ** 2 + (DOUBT * steps) ** 2)
            weights, ratios = weights + weight, ratios + weight * plan.simulated_u / plan.planned_u
        u = self.u * (ratios / weights)
        for at, plan in self.simulated.items():
            limit = self.target if plan.reaches == "not decided" else inf
            u[at] = min(plan.simulated_u, limit)
        return u, weights**-0.5

    def _simulate(self, at: Index) -> None:
        """Simulate a plan, with more tests than before if it was simulated."""
        tests = self.simulated[at].tests * MORE if at in self.simulated else self.tests
        counts, exchanged = self.grid.at(at[1:]), self.laboratory.exchange_names(at[0])
        sample = self.laboratory.simulate(exchanged, counts, tests)
        value, error = map(float, self.printed.in_unit(np.array(sample.median_u)))
        decided = abs(value - self.target) >= CERTAIN * error
        self.simulated[at] = PlanRow(
            plan="",
            exchanged=", ".join(exchanged) or "none",
            **{each.name: getattr(counts, each.name) for each in fields(Counts)},
            minutes=float(self.minutes[at]),
            price=float(self.cost[at]) if self.prices else None,
            currency=self.prices.currency if self.prices else "",
            planned_u=float(self.u[at]),
            simulated_u=value,
            simulated_u_se=error,
            reaches="not decided" if not decided else "yes" if value <= self.target else "no",
            compared="",
            tests=tests,
            invalid=int(sample.invalid.sum()),
            unit=self.printed.unit,
        )
        self.left -= tests


def _index(flat: np.intp, array: Array) -> Index:
    return tuple(map(int, np.unravel_index(flat, array.shape)))
