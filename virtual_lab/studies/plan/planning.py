"""Plans of a laboratory that reach a target u at the least cost: predicted, then simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from virtual_lab.certificate.printed import printed_source
from virtual_lab.lab.setup import TestSetup
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.rounding import with_axis_unit, with_unit
from virtual_lab.output.style import as_drawn, page_figure
from virtual_lab.parameters import (
    AboveZero,
    AnyDocument,
    AnyLaboratory,
    HundredOrMore,
    Positive,
    Seed,
)
from virtual_lab.sheets import AnyBat, AnyProcedure, Instruments, entry_name
from virtual_lab.studies.plan.choosing import Index, cheapest_single_change
from virtual_lab.studies.plan.laboratory import PlannedLaboratory, better_instruments
from virtual_lab.studies.plan.prices import Prices
from virtual_lab.studies.plan.searching import PlanRow, Search

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

PRESENT, SINGLE, FLOOR = "present", "single change", "floor"  # names of plans
TERMS = 3  # number of the largest terms of the floor that are named
HALF = (
    "Exchanged: an instrument with half of each standard uncertainty and scatter of its data sheet,"
    " or the one offered; `pivot` is the survey of the rig, in the rig's data sheet."
)
COST = (
    "Chosen: reaches the target beyond two standard errors; of plans less than {close} above the"
    " least cost, the one with the fewest exchanges. Equal: less than {close} above the chosen one,"
    " or below it; another seed may choose it. Simulated u is a median over tests."
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LaboratoryPlans(Rows[PlanRow]):
    """Plans that reach a target u, the chosen one first, beside the present laboratory.

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
                u = row.planned_u, row.simulated_u
                cost = row.minutes if row.price is None else row.price
                labels.setdefault(cost, []).append(row)
                axes.plot(u, [cost] * 2, "|-", color="0.6", mec="k", markevery=[0], linewidth=0.6)
                axes.errorbar(u[1], cost, xerr=row.simulated_u_se, fmt="ok", markersize=3)
            for cost, rows in labels.items():
                names = ", ".join(row.plan for row in rows)
                right = max(row.simulated_u for row in rows)
                axes.annotate(names, (right, cost), (4, 4), textcoords="offset points", fontsize=7)
            axes.axvline(self.target_u, color="0.5", linewidth=0.6, linestyle="--")
            axes.set(
                title=f"{as_drawn(self.title.partition(':')[0])}; mark: planned, dashed: target",
                xlabel=with_axis_unit("median $u$", self.unit),
                ylabel=f"price, {currency}" if currency else "minutes of a test",
            )
            axes.set(xmargin=0.1, ymargin=0.1)
        return figure


def plan(
    procedure: AnyProcedure,
    *,
    target_u: AboveZero,
    bat: AnyBat = "r161",
    prices: AnyDocument | None = None,
    laboratories: HundredOrMore = 1000,
    seed: Seed = 1,
    workers: Positive = 1,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> LaboratoryPlans:
    """Find the cheapest way to an uncertainty.

    A plan has more hits, balls or wall hits than the procedure requires, or better instruments. The
    table has the present laboratory and at most ten plans, the chosen one first. The cost of a plan
    is the minutes of one test, so that instruments cost nothing, or the price of all tests and
    exchanged instruments if `prices` is given. If a single change of the present laboratory is
    enough, the table also has the cheapest single change. If no plan reaches the target, the table
    has the plan with the smallest u (the floor), and the text names the largest terms of this u.

    Hits, balls and wall hits are multiplied by 1, 7/6, 4/3, 3/2, 5/3, 2, 5/2, 3 or 4, and rounded.
    At most eight instruments are exchanged for better ones, the data sheets in `prices`. By default
    a better instrument has half of each standard uncertainty and half of each scatter, such as the
    scatter of a cannon's aim. Instruments that hardly lower u are not exchanged. A better
    instrument changes the minutes only by the number of shots: a cannon that aims better needs
    fewer. Apart from the chosen plan, a plan is left out if it would also reach the target with
    one exchanged instrument fewer, or with the next smaller number of hits, balls or wall hits.

    The u of a plan is predicted from the budget of the present laboratory, and corrected by the
    plans that were simulated. The plan with the largest expected saving is simulated next, and
    then plans about as cheap as the best one with fewer exchanges. If the u of a plan is within two
    standard errors of the target, four times the tests are simulated, up to 5 000 tests. The search
    ends if no plan is expected to save more than 5 min or an exchange, or after 20 000 tests beyond
    those of the table (about 20 s of processor time).

    In the table, *reaches the target* is yes, no, or not decided within two standard errors of the
    simulated u. Of the plans that reach it for less than 5 min, or the price of 5 min of all tests,
    above the least cost, the *chosen* one has the fewest exchanges. The *cost* is equal if it is
    less than this above that of the chosen plan, or below it. A bat is tested whatever its
    construction.

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
        File of prices, .toml; `template` writes an empty one. The cost of a plan is then its price.
        Only instruments with a price are exchanged.

        Or its keys and values as a mapping. The keys are ``tests``, ``per_minute``, ``per_ball``
        and ``instruments``, each with value, unit and source.
    laboratories
        Number of simulated tests per plan, at least 100; more where the search needs them.
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
        A name is unknown. No test of the present laboratory has a result, or its laboratories
        cannot be simulated side by side. The file of prices has an unknown or missing key, an
        unknown instrument, two currencies, or a sheet that cannot be read.
    """
    bat, procedure = entry_name(bat), entry_name(procedure)
    setup = TestSetup.of(bat, procedure=procedure)
    rigs = setup.rigs.values()
    offers, priced = better_instruments(rigs), None
    if prices is not None:
        priced = Prices.read(prices)
        offers = priced.offers(Path("prices" if isinstance(prices, Mapping) else prices), rigs)
    progress("tests of the present laboratory")
    planned = PlannedLaboratory.of(bat, procedure, offers, seed, workers)
    return _plans(Search(planned, target_u, laboratories, priced), progress)


def _plans(search: Search, progress: Progress) -> LaboratoryPlans:
    """Return the present laboratory, the plans of least cost, and the floor if there is none."""
    present: Index = (0,) * search.u.ndim
    plans = search.cheapest(progress)
    others = [at for at in plans if at != present]
    chosen = {PRESENT: present, **{str(n): at for n, at in enumerate(others, 1)}}
    words = [HALF]
    single = None
    while others:
        single = cheapest_single_change(search.estimates()[0], search.cost, search.target)
        if single is None or search.row(single).reaches != "no":
            break
    if not plans:
        chosen[FLOOR] = search.lowest()
        words.append(_floor(search))
    elif single:
        chosen[SINGLE] = single
    elif others:
        words.append("No single change of the present laboratory reaches the target.")
    rows = [search.row(at, name) for name, at in chosen.items()]
    best = _best(rows)
    alone = search.lowest(sets=1)
    if plans and search.estimates()[0][alone] > search.target and search.row(alone).reaches == "no":
        u = search.row(alone).simulated_u
        best += f"; more hits, balls and wall hits alone reach {u:.3g} at best"
    setup, unit = search.laboratory.shared.setup, search.printed.unit
    target = with_unit(search.target, unit, ".3g")
    close = f"{search.close:.0f} {rows[0].currency or 'min'}"
    return LaboratoryPlans(
        name="plan",
        title=f"{setup.bat.spec.name} by {setup.rules.spec.name}, u up to {target}: {best}",
        rows=rows,
        words=" ".join([*words, COST.format(close=close)]),
        target_u=search.target,
        unit=unit,
    )


def _best(rows: Sequence[PlanRow]) -> str:
    """Return the chosen plan, which is sure to reach the target, in words."""
    plan = next((row for row in rows if row.compared == "chosen"), None)
    if plan is None:
        return "no plan is sure to reach it"
    name = "the present laboratory" if plan.plan == PRESENT else f"plan {plan.plan}"
    final = f"{plan.final_hits} final hits, " if plan.final_hits else ""
    more = "no plan has fewer than the procedure requires"
    if plan.plan != PRESENT:
        free = "minutes: instruments cost nothing without prices"
        by = f"price: {plan.price:.0f} {plan.currency}" if plan.currency else free
        more = f"chosen by {by}; exchanged: {plan.exchanged}"
    return (
        f"{name} reaches {plan.simulated_u:.3g}, with {plan.hits} hits, {final}{plan.balls} balls, "
        f"{plan.minutes:.0f} minutes; {more}"
    )


def _floor(search: Search) -> str:
    """Return the smallest u and its largest terms in words."""
    at, unit = search.lowest(), search.printed.unit
    terms = search.laboratory.forecast.contributions(search.grid.at(at[1:]), at[0])
    largest = list(terms.items())[:TERMS]
    size = search.printed.in_unit
    texts = (f"{printed_source(name, 0.0)['words']} {size(u):.2g}" for name, u in largest)
    floor = with_unit(search.row(at).simulated_u, unit, ".3g")
    return f"No plan reaches the target: the floor is {floor}, with {'; '.join(texts)}."
