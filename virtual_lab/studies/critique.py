"""Ranking of bats by test procedures, compared with the field (the paper's Sec. V).

The ranking in the field is by the peak v_f of the nominal bats under standard game conditions. A
procedure is evaluated in an error-free laboratory, and in laboratories with random balls and
errors, which test the nominal bats. Within a laboratory all bats share rigs and calibrations, so
their errors cancel in a difference. Balls, bench readings and hits differ between tests.
Instruments record only summary values, which gives the same results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import combinations
from math import nan
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from virtual_lab import catalog
from virtual_lab.catalog.specs import Sport
from virtual_lab.lab import BlockTest, RoundRobin, TestSetup, certify_block
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Json, StudyResult, frame
from virtual_lab.output.rounding import in_both_units, with_unit
from virtual_lab.output.tables import inline, number, record, table_text
from virtual_lab.parameters import (
    AnyLaboratory,
    Seed,
    SwingExponents,
    TwoOrMore,
    values_of,
)
from virtual_lab.sheets import (
    AnyBall,
    AnyBat,
    AnyBats,
    AnyProcedures,
    Instruments,
    entry_name,
    entry_names,
)
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import Reality
from virtual_lab.studies.bats.compare import compare
from virtual_lab.studies.bats.text import balls_text, swing_text
from virtual_lab.studies.critique_chart import draw_critique
from virtual_lab.uncertainty.estimate import share_interval
from virtual_lab.units import Array

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.output.page_figure import PageFigure

FIELD_TIE_MPH = 0.1  # difference of v_f below which two bats tie in the field
RELIABLE_SHARE = 0.95  # smallest probability of a reliable ranking


@dataclass(frozen=True, slots=True, kw_only=True)
class BatRank:
    """Results of a bat by a procedure and in the field."""

    bat: str
    procedure: str
    ball_name: str
    metric: str
    unit: str
    error_free: float | None  # metric in an error-free laboratory
    laboratories: int  # number of laboratories with a result
    mean: float | None
    sd: float | None
    # peak in the field by swing: ``batted_speed_n0.3_mph``
    batted_speeds: Mapping[str, float] = inline()


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """Ranking of two bats by a procedure, compared with the field.

    The ranking is ``same order``, ``opposite order``, ``by chance`` (neither order is reliable),
    ``tie`` (no order in the field), or ``no result``.
    """

    laboratories: int  # number of laboratories with a result
    mean_difference: float | None = None
    sd_difference: float | None = None
    # probability of the opposite order, for a normal distribution with this mean and sd
    opposite_probability: float | None = None
    opposite: int | None = None  # number of laboratories with the opposite order
    # limits of the share of these laboratories (95 %, Clopper-Pearson)
    opposite_low: float | None = None
    opposite_high: float | None = None
    ranking: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Ranking of two bats by a procedure; differences are first bat minus second bat."""

    bat: str
    against: str
    swing_exponent: float  # n of the field
    batted_speed_difference_mph: float
    procedure: str
    procedure_swing_exponent: float | None  # None: the procedure has no swing law
    metric: str
    unit: str
    error_free_difference: float | None  # difference in an error-free laboratory
    ranking: Ranking = inline()


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcedureResults:
    """Results of one procedure for all bats, in the printed unit of its metric."""

    procedure: str
    ball: str
    metric: str  # symbol of the metric
    unit: str
    swing_exponent: float | None  # n of the procedure; None: it has no swing law
    exact: Array  # metric in an error-free laboratory, (bat,); NaN without a result
    measured: Array  # metric, (laboratory, bat)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Critique(StudyResult):
    """Comparison of the rankings by procedures with the field."""

    bats: tuple[str, ...]
    swings: tuple[float, ...]  # exponents n of the swing law
    balls: Mapping[str, str]  # ball in the field, by bat
    field: Array  # largest v_f [mph], (swing, bat)
    ranked: tuple[ProcedureResults, ...]

    @property
    def metrics(self) -> list[BatRank]:
        """One row per bat and procedure."""
        return [
            BatRank(
                bat=bat,
                procedure=each.procedure,
                ball_name=each.ball,
                metric=each.metric,
                unit=each.unit,
                error_free=_or_none(each.exact[i]),
                laboratories=int(np.isfinite(each.measured[:, i]).sum()),
                mean=_or_none(_mean(each.measured[:, i])),
                sd=_or_none(_sd(each.measured[:, i])),
                batted_speeds={
                    f"batted_speed_n{n:g}_mph": float(self.field[j, i])
                    for j, n in enumerate(self.swings)
                },
            )
            for each in self.ranked
            for i, bat in enumerate(self.bats)
        ]

    @property
    def pairs(self) -> list[Pair]:
        """One row per pair of bats, exponent and procedure."""
        return [
            Pair(
                bat=first,
                against=second,
                swing_exponent=n,
                batted_speed_difference_mph=float(field[i] - field[j]),
                procedure=each.procedure,
                procedure_swing_exponent=each.swing_exponent,
                metric=each.metric,
                unit=each.unit,
                error_free_difference=_or_none(float(each.exact[i] - each.exact[j])),
                ranking=misranking(field[i] - field[j], each.measured[:, i] - each.measured[:, j]),
            )
            for (i, first), (j, second) in combinations(enumerate(self.bats), 2)
            for n, field in zip(self.swings, self.field, strict=True)
            for each in self.ranked
        ]

    name = "critique"

    @property
    def title(self) -> str:
        """Title of the study."""
        procedures = ", ".join(each.procedure for each in self.ranked)
        return f"Critique of {procedures} by {', '.join(self.bats)}"

    @property
    def rows(self) -> list[Pair]:
        """The pairs, one row per pair, exponent and procedure."""
        return self.pairs

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Tables of metrics and pairs."""
        return {"metrics": frame(self.metrics), "pairs": self.table}

    @property
    def text(self) -> str:
        """Table of the ranks of each bat, and table of the pairs of bats."""
        return _text(self.metrics, self.pairs, self.balls)

    def draw(self) -> PageFigure:
        """Draw the probability of a wrong ranking for each pair and procedure."""
        return draw_critique(self.table)

    @property
    def document(self) -> Json:
        """The result for JSON."""
        return {
            "field_tie_mph": FIELD_TIE_MPH,
            "field_balls": dict(self.balls),
            "metrics": [record(row) for row in self.metrics],
            "pairs": [record(row) for row in self.pairs],
        }


def critique(
    bats: AnyBats,
    *more: AnyBat,
    procedures: AnyProcedures = (),
    swings: SwingExponents = (),
    ball: AnyBall | None = None,
    laboratories: TwoOrMore = 500,
    seed: Seed = 1,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> Critique:
    """Compare procedures with play.

    A procedure should rank bats in the same order as play on the field. A bat is tested whatever
    its construction, also if a procedure requires no test of it.

    Parameters
    ----------
    bats
        At least two bats: names in the catalog or .toml files.

        In Python, sheets such as ``vl.bat("r161")`` are also allowed.
    more
        Further bats, as separate arguments instead of a list in `bats`.
    procedures
        Test procedure: a name in the catalog or a .toml file. By default all procedures for the
        sport of the ball in play. A test uses the ball of its procedure.

        In Python, a sheet such as ``vl.procedure("bbcor")``, or a list, is also allowed.
    swings
        Exponent n of the swing law in the field, 0 to 0.5. The bat speed is proportional to I^-n,
        where I is the moment of inertia. By default 0, 0.3 and 0.5.
    ball
        Ball in play on the field: a name in the catalog or a .toml file. By default the standard
        ball of the bat's sport.
    laboratories
        Number of laboratories that test every bat by every procedure.
    seed
        Seed of the study. The laboratories are numbered from 0. The seed and this number identify a
        laboratory.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with three arguments: a message with the name of the procedure, the
        number of bats done, and the total number of bats. If it is not given, the functions of
        `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        Two procedures have the same name, or a name, number or file cannot be used.
    """
    bats, procedures = entry_names(bats) + entry_names(more), entry_names(procedures)
    ball = None if ball is None else entry_name(ball)
    exponents = tuple(dict.fromkeys(values_of(swings) or (0.0, 0.3, 0.5)))
    compared = compare(bats, swings=exponents, ball=ball)
    top = [row.peaks["peak_batted_speed_mph"] for row in compared.peaks]  # (bat, n)
    procedures = procedures or _of_this_game(compared.sports)
    sheets = [catalog.load("procedures", each, Procedure).spec for each in procedures]
    catalog.require_own_names("procedures", [rules.name for rules in sheets])
    ranked = []
    for procedure, rules in zip(procedures, sheets, strict=True):
        printed = METRICS[rules.metric]
        exact = [_exact(bat, procedure) for bat in bats]
        columns = []
        for test, bat in enumerate(bats):
            progress(f"{rules.name}: bats", test, len(bats))
            shared = RoundRobin.of(bat, procedure)
            tests = replace(shared, setup=replace(shared.setup, test=test))
            blocks = [*tests.each_block(_metrics, laboratories, seed)]
            columns.append(np.concatenate(blocks))
        measured = np.stack(columns, axis=1)
        ranked.append(
            ProcedureResults(
                procedure=rules.name,
                ball=rules.ball,
                metric=printed.symbol,
                unit=printed.unit,
                swing_exponent=_own_exponent(rules),
                exact=printed.in_unit(np.array(exact)),
                measured=printed.in_unit(measured),
            )
        )
    return Critique(
        bats=tuple(catalog.load_bat(bat).spec.name for bat in bats),
        swings=exponents,
        balls=compared.balls,
        field=np.reshape(top, (len(bats), len(exponents))).T,
        ranked=tuple(ranked),
    )


def misranking(field: float, differences: Array) -> Ranking:
    """Return the ranking of two bats by a procedure, with the probability of a wrong order.

    The order is wrong if it is opposite to the order in the field. The ranking is one of these:

    * ``no result``: fewer than two differences are finite.
    * ``tie``: the bats differ by less than 0.1 mph in the field. No probability is stated.
    * ``opposite order``: the probability of a wrong order is 95 % or more.
    * ``same order``: the probability is 5 % or less.
    * ``by chance``: the probability is in between.

    Parameters
    ----------
    field
        Difference of the peak batted-ball speed of the two bats in the field [mph], first minus
        second bat.
    differences
        Differences of the metrics in any unit, first minus second bat, shape (laboratory,). A
        difference is NaN if a test has no result.
    """
    finite = differences[np.isfinite(differences)]
    if finite.size < 2:
        return Ranking(laboratories=int(finite.size), ranking="no result")
    mean, sd = float(finite.mean()), float(finite.std(ddof=1))
    tie = Ranking(
        laboratories=int(finite.size), mean_difference=mean, sd_difference=sd, ranking="tie"
    )
    if abs(field) < FIELD_TIE_MPH:
        return tie
    toward = np.sign(field)
    probability = float(ndtr(-toward * mean / sd)) if sd else float(toward * mean < 0)
    opposite = int((toward * finite < 0).sum())
    low, high = share_interval(opposite, finite.size)
    ranking = "by chance"
    if probability >= RELIABLE_SHARE:
        ranking = "opposite order"
    elif probability <= 1 - RELIABLE_SHARE:
        ranking = "same order"
    return replace(
        tie,
        opposite_probability=probability,
        opposite=opposite,
        opposite_low=low,
        opposite_high=high,
        ranking=ranking,
    )


def _of_this_game(sports: Set[Sport | None]) -> list[str]:
    """Return the procedures of the catalog for these sports; all if a sport is unknown."""
    return [
        name
        for name in catalog.names("procedures")
        if None in sports
        or catalog.load("procedures", name, Procedure).spec.sport in {*sports, None}
    ]


def _own_exponent(rules: Procedure) -> float | None:
    by_inertia = rules.game is not None and rules.game.scales_with == "inertia"
    return rules.game.exponent if rules.game and by_inertia else None


def _exact(bat: str, procedure: str) -> float:
    """Return the metric in an error-free laboratory [SI]; NaN without a result."""
    setup = TestSetup.of(
        bat, procedure=procedure, seed=0, reality=Reality.IDEAL, detail=RecordDetail.SUMMED
    )
    return float(_metrics(certify_block(setup))[0])


def _metrics(tested: BlockTest) -> Array:
    """Return the metric of each laboratory [SI], shape (laboratory,); NaN if INVALID or missing."""
    certified = tested.certified
    return np.where(certified.sound, certified.results["metric"].value, np.nan)


def _mean(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else nan


def _sd(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.std(ddof=1)) if finite.size > 1 else nan


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _text(metrics: Sequence[BatRank], pairs: Sequence[Pair], balls: Mapping[str, str]) -> str:
    """Return the tables of ranks and of pairs, as text."""
    tables: dict[str, dict[str, str]] = {}
    for row in metrics:
        line = tables.setdefault(row.bat, {"bat": row.bat})
        for key, speed in row.batted_speeds.items():
            rank = 1 + sum(other > speed for other in {each.batted_speeds[key] for each in metrics})
            swing = key.split("_")[2].removeprefix("n")
            line[f"v_f [mph (m/s)], n = {swing}"] = f"{in_both_units(speed, 'mph', '.1f')}: {rank}"
        rivals = [each.error_free for each in metrics if each.procedure == row.procedure]
        line[row.procedure] = _metric_with_rank(
            row, [value for value in rivals if value is not None]
        )
    tested = {row.procedure: row.ball_name for row in metrics}
    fires = [f"{name}: fires {ball}" for name, ball in tested.items()]
    fired = "; ".join([f"field: {balls_text(balls)}", *fires])
    lines: dict[tuple[str, str, str], dict[str, str]] = {}
    for each in pairs:
        ranked = each.ranking
        pair, swing = f"{each.bat} - {each.against}", swing_text(each.swing_exponent)
        empty = {"pair": pair, "procedure": "the field", "error-free": "", "mean": "", "sd": ""}
        field = lines.setdefault((each.bat, each.against, ""), empty)
        field[swing] = with_unit(each.batted_speed_difference_mph, "mph", "+.2f")
        line = lines.setdefault(
            (each.bat, each.against, each.procedure),
            {
                "pair": "",
                "procedure": f"{each.procedure}, {each.metric}",
                "error-free": number(each.error_free_difference, "+.4f"),
                "mean": number(ranked.mean_difference, "+.4f"),
                "sd": number(ranked.sd_difference, ".4f"),
            },
        )
        line[swing] = ranked.ranking
        if ranked.opposite is not None and ranked.opposite_low is not None:
            line[swing] += f" {ranked.opposite / ranked.laboratories:.1%} ("
            line[swing] += f"{ranked.opposite_low:.1%} to {ranked.opposite_high:.1%})"
    return (
        "results of an error-free laboratory, with the rank among the bats\n"
        f"{table_text(list(tables.values()))}\n{fired}\n\n"
        "differences, first minus second bat, with the share of laboratories that find the "
        "opposite of the order in the field,\nand its 95 % interval (Clopper-Pearson), of those "
        "with a result for both bats\n"
        f"{table_text(list(lines.values()))}"
    )


def _metric_with_rank(row: BatRank, rivals: Sequence[float]) -> str:
    """Return an error-free metric as printed, with its rank among all bats."""
    if row.error_free is None:
        return "no result"
    places = 2 if row.unit == "mph" else 4
    rank = 1 + sum(other > row.error_free for other in rivals)
    return f"{row.metric} {with_unit(row.error_free, row.unit, f'.{places}f')}: {rank}"
