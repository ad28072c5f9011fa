"""Plans of a laboratory that reach a target u, the cheapest first: predicted, then simulated."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.lab.setup import TestSetup
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.style import as_drawn, page_figure
from virtual_lab.output.tables import column
from virtual_lab.parameters import AnyLaboratory, File, Folders, Positive, Seed, paths_of
from virtual_lab.sheets import AnyBat, AnyProcedure, Instruments, entry_name
from virtual_lab.studies.plan.choosing import Index, cheapest, cheapest_single_change
from virtual_lab.studies.plan.history import balls_of, read_history
from virtual_lab.studies.plan.laboratory import PlannedLaboratory, better_instruments
from virtual_lab.studies.plan.prediction import Counts
from virtual_lab.studies.plan.prices import Prices

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

PRESENT, SINGLE, FLOOR = "present", "single change", "floor"  # names of plans
CERTAIN = 2.0  # standard errors within which the simulated u does not decide about the target
SHOWN = 10  # largest number of plans that are simulated and shown
TERMS = 3  # number of the largest terms of the floor that are named
HALF = (
    "Exchanged: an instrument with half of each standard uncertainty and scatter of its data sheet,"
    " or the one offered; `pivot` is the survey of the rig, in the rig's data sheet."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanRow:
    """A plan: instruments and counts, its price, and its u predicted and simulated."""

    plan: str = column("plan", form="")
    hits: int = column("hits")
    final_hits: int = column("final hits")
    balls: int = column("balls")
    wall_hits: int = column("wall hits")
    minutes: float = column("minutes", form=".0f")
    price: float | None = column(
        "price", form=".0f"
    )  # price of all tests and exchanged instruments
    currency: str = column("", form="")
    planned_u: float = column("planned u", form=".3g")
    simulated_u: float = column("simulated u", form=".3g")  # median over the tests
    simulated_u_se: float = column("its error", form=".1g")  # standard error of the median
    reaches: Literal["yes", "no", "not decided"] = column("reaches the target", form="")
    invalid: int = column("INVALID tests")
    exchanged: str = column("exchanged", form="")
    unit: str  # unit of u


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LaboratoryPlans(Rows[PlanRow]):
    """Plans that reach a target u, the cheapest first, beside the present laboratory.

    If no plan reaches it, the last row is the floor, the plan with the smallest u.
    """

    target_u: float  # in the unit of the metric
    unit: str

    def draw(self) -> PageFigure:
        """Plot minutes or price of each plan against its planned and its simulated u."""
        with page_figure(3.2) as figure:
            axes = figure.subplots()
            currency = self.rows[0].currency
            labels: dict[float, list[PlanRow]] = {}  # plans of the same cost share a label
            for row in self.rows:
                planned, simulated = row.planned_u, row.simulated_u
                cost = row.minutes if row.price is None else row.price
                labels.setdefault(cost, []).append(row)
                axes.plot([planned, simulated], [cost] * 2, color="0.6", linewidth=0.6)
                axes.plot(planned, cost, "|", color="black")
                axes.errorbar(simulated, cost, xerr=row.simulated_u_se, fmt="ok", markersize=3)
            for cost, rows in labels.items():
                names = ", ".join(row.plan for row in rows)
                right = max(row.simulated_u for row in rows)
                axes.annotate(names, (right, cost), (4, 4), textcoords="offset points", fontsize=7)
            axes.axvline(self.target_u, color="0.5", linewidth=0.6, linestyle="--")
            axes.set_title(f"{as_drawn(self.title)}; mark: planned, dashed: target")
            axes.set(
                xlabel=f"median $u$ {self.unit}".rstrip(),
                ylabel=f"price, {currency}" if currency else "minutes of a test",
            )
            axes.set(xmargin=0.1, ymargin=0.1)
        return figure


def plan(
    procedure: AnyProcedure,
    *,
    target_u: float,
    bat: AnyBat = "r161",
    prices: File | None = None,
    history: Folders = (),
    laboratories: int = 1000,
    seed: Seed = 1,
    workers: Positive = 1,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> LaboratoryPlans:
    """Find the cheapest way to reach an uncertainty: instruments, hits, balls, wall hits.

    The table has the present laboratory and at most ten plans that should reach the target. It also
    has the cheapest single change of the present laboratory, if one is enough. The plans are sorted
    by minutes, or by price if `prices` is given.

    A plan has 1, 7/6, 4/3, 3/2, 5/3, 2, 5/2, 3 or 4 times the hits, balls and wall hits of the
    procedure, rounded. Numbers between these are not tried. A plan may exchange up to eight
    instruments. The new instruments follow the data sheets named in `prices`. By default they have
    half of each standard uncertainty and half of each scatter, such as the scatter of a cannon's
    aim. Instruments that hardly lower u are not considered. An exchange does not change the
    minutes. A plan is left out if a smaller plan reaches the target too. A smaller plan has one
    exchanged instrument fewer, or the next smaller number of hits, balls or wall hits.

    To choose the plans, u is predicted to first order from the budget of the present laboratory.
    Then each plan in the table is simulated, and the column `reaches` shows whether its simulated u
    reaches the target: yes, no, or not decided within two standard errors. If no plan is predicted
    to reach the target, the table contains the plan with the smallest u instead (the floor). The
    text names the largest terms of this u. A bat is tested whatever its construction, also if the
    procedure requires no test of it.

    Parameters
    ----------
    procedure
        The test procedure: a name in the catalog or a .toml file.

        Or a sheet: ``vl.procedure("bbcor").with_(valid_hits=8)``.
    target_u
        Largest allowed median of the stated standard uncertainty of the metric, in the metric's
        unit.
    bat
        The bat: a name in the catalog or a .toml file.

        Or a sheet, ``vl.bat("r161")``, with changed values if needed.
    prices
        File of prices, .toml. The plans are then sorted by price. Its keys are ``tests``,
        ``per_minute``, ``per_ball`` and ``instruments``, each with value, unit and source;
        ``virtual-lab template prices FILE`` writes an empty one. Only instruments with a price are
        exchanged.
    history
        Result folders of at least three earlier tests of the same bat by the same procedure, or one
        folder of ``virtual-lab daily``. The simulated hits get the pooled scatter of these tests or
        days. Their scatters must agree by Bartlett's test.
    laboratories
        Number of simulated tests per plan, at least 100.
    seed
        Seed of the study.
    workers
        Number of processes, each with one thread, that share the laboratories.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs of the present laboratory with changed values, used instead of the
        catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with a message, the number of plans done, and the total. If it is
        not given, the functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        A name is unknown, or a number is out of range. No test of the present laboratory has a
        result, or its laboratories cannot be simulated side by side. The file of prices has an
        unknown or missing key, an unknown instrument, two currencies, or a sheet that cannot be
        read. The history has fewer than three days, another metric, or days that differ.
    """
    bat, procedure = entry_name(bat), entry_name(procedure)
    if not 0 < target_u < inf:
        raise InputError("", "target_u", target_u, "allowed: more than 0, finite")
    if laboratories < 100:
        raise InputError("", "laboratories", laboratories, "allowed: at least 100")
    setup = TestSetup.of(bat, procedure=procedure)
    rigs = setup.rigs.values()
    offers, priced = better_instruments(rigs), None
    if prices is not None:
        priced = Prices.read(Path(prices))
        offers = priced.offers(Path(prices), rigs)
    days = read_history(paths_of(history), setup) if history else None
    progress("tests of the present laboratory")
    balls = balls_of(days, bat, procedure, seed) if days else {}
    with catalog.sheets_in_place(balls):
        planned = PlannedLaboratory.of(bat, procedure, offers, seed, workers)
        return _Search(planned, target_u, laboratories, priced, progress).plans()


class _Search:
    """Search for plans in one laboratory; each plan is simulated once at most."""

    def __init__(
        self,
        laboratory: PlannedLaboratory,
        target_u: float,
        tests: int,
        prices: Prices | None,
        progress: Progress,
    ) -> None:
        self.laboratory, self.tests, self.progress = laboratory, tests, progress
        self.printed = METRICS[laboratory.forecast.rules.metric]
        self.target = target_u
        self.grid = laboratory.forecast.present.grid
        self.u = self.printed.in_unit(laboratory.predict_u(self.grid))
        self.minutes = np.broadcast_to(laboratory.minutes(self.grid), self.u.shape)
        self.prices, self.cost = prices, self.minutes
        if prices:
            names = laboratory.exchanges
            self.cost = prices.of_plans(names, self.minutes[0], self.grid.balls)
        self.rows: dict[Index, PlanRow] = {}

    def plans(self) -> LaboratoryPlans:
        """Return the present laboratory, the cheapest plans, and the floor if there is none.

        The predicted u of all plans is multiplied by the ratio of simulated to predicted u of one
        plan.
        """
        self.progress("plans", 0, SHOWN + TERMS)
        present: Index = (0,) * self.u.ndim
        lowest = np.unravel_index(self.u.argmin(), self.u.shape)
        floor: Index = tuple(int(at) for at in lowest)
        first = next(iter(cheapest(self.u, self.cost, self.target, 1)), floor)
        row = self._row("", first)
        ratio = row.simulated_u / row.planned_u
        u = self.u * ratio
        plans = cheapest(u, self.cost, self.target, SHOWN)
        single = cheapest_single_change(u, self.cost, self.target)
        chosen = {PRESENT: present, **{str(n): at for n, at in enumerate(plans, 1)}}
        words = [
            HALF,
            f"Plans were chosen by {ratio:.3f} times the planned u. This is the ratio of simulated"
            " to planned u of the first simulated plan. Simulated u is a median over tests.",
        ]
        if plans == [present]:
            del chosen["1"]
            words.append("The present laboratory reaches the target.")
        elif not plans:
            chosen[FLOOR] = floor
            words.append(self._floor(floor, u[floor]))
        elif single is None:
            words.append("No single change of the present laboratory reaches the target.")
        else:
            chosen[SINGLE] = single
        return LaboratoryPlans(
            name="plan",
            title=self._title,
            rows=[self._row(name, at) for name, at in chosen.items()],
            words=" ".join(words),
            target_u=self.target,
            unit=self.printed.unit,
        )

    @property
    def _title(self) -> str:
        setup = self.laboratory.shared.setup
        target = f"{self.target:g} {self.printed.unit}".rstrip()
        return f"{setup.bat.spec.name} by {setup.rules.spec.name}: plans with u up to {target}"

    def _floor(self, at: Index, u: float) -> str:
        """Return the smallest u and its largest terms in words."""
        terms = self.laboratory.forecast.contributions(self.grid.at(at[1:]), at[0])
        largest = list(terms.items())[:TERMS]
        texts = (f"{name} {self.printed.in_unit(value):.2g}" for name, value in largest)
        floor = f"{u:.3g} {self.printed.unit}".rstrip()
        return f"No plan reaches the target: the floor is {floor}, with {', '.join(texts)}."

    def _row(self, name: str, at: Index) -> PlanRow:
        """Return the row of a plan. The plan is simulated unless this was done before."""
        if at not in self.rows:
            counts, exchanged = self.grid.at(at[1:]), self.laboratory.exchange_names(at[0])
            tests = self.laboratory.simulate(exchanged, counts, self.tests)
            value, error = self.printed.in_unit(np.array(tests.median_u))
            self.rows[at] = PlanRow(
                plan=name,
                exchanged=", ".join(exchanged) or "none",
                **{each.name: getattr(counts, each.name) for each in fields(Counts)},
                minutes=float(self.minutes[at]),
                price=float(self.cost[at]) if self.prices else None,
                currency=self.prices.currency if self.prices else "",
                planned_u=float(self.u[at]),
                simulated_u=float(value),
                simulated_u_se=float(error),
                reaches="not decided"
                if abs(value - self.target) < CERTAIN * error
                else ("yes" if value <= self.target else "no"),
                invalid=int(tests.invalid.sum()),
                unit=self.printed.unit,
            )
            self.progress("plans", len(self.rows), max(SHOWN + TERMS, len(self.rows)))
        return replace(self.rows[at], plan=name)
