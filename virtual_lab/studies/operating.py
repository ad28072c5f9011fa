"""Operating characteristic of a procedure: probability of PASS against the true metric.

Simulated tests of a bat with the true metric x give the distribution of the errors of the metric
(measured minus true value) and the share of INVALID tests. The bat passes if x plus the error is at
most the limit. Other rules for the bat are not considered. The bat is a variant of the named design
with another stiffness. If no variant has the metric x, the errors of the nearest are used. Each
laboratory tests three times, with new balls, hits and readings, but with the same calibrations and
bat.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from math import nan
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab.catalog.specs import BatSpec
from virtual_lab.errors import InputError
from virtual_lab.lab import RoundRobin
from virtual_lab.measurement.procedure import unmet_rules
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.rounding import both_units, in_both_units, with_axis_unit, with_unit
from virtual_lab.output.style import INTERVAL_GREY, as_drawn, page_figure
from virtual_lab.output.tables import column, table_text
from virtual_lab.parameters import AnyLaboratory, Numbers, Positive, Seed, values_of
from virtual_lab.sheets import AnyBat, AnyProcedures, Instruments, entry_name, entry_names
from virtual_lab.uncertainty.estimate import share_interval
from virtual_lab.units import Array, Mask

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

TESTS = (1, 3)  # numbers of tests per laboratory; the best test decides
# half the range of true metrics about the limit [standard deviations of the error], and number of
# true metrics in the range; the middle one is the limit
HALF_RANGE, POINTS = 3.0, 11
# factors of the stiffness between which a variant is searched, and number of laboratories whose
# mean is the true metric of a variant; the mean of 16 has a standard error of 0.00005 in e
FACTORS, MEAN_OF = 2.0 ** (np.arange(-6, 9) / 4), 16
RISK = 0.05  # largest probability that a bat at the limit is accepted, for the acceptance limits

WORDS = (
    "PASS: joint probability that the test of a bat with the true metric x is valid and that its\n"
    "result does not exceed the limit. PASS if valid: conditional probability among valid tests.\n"
    "Best of 3: at least one of three tests of one laboratory passes. At least, at most: 95 %\n"
    "confidence limits of the simulation (Clopper-Pearson). ±: half of that interval. < or >: no\n"
    "simulated test passes, or every one, and the number is the limit at most or at least.\n"
    "All procedures are tested in the same laboratories and share their luck; another seed gives\n"
    "others. Errors of: the simulated bat, a variant of the named one with the true metric.\n"
    "If no variant has this metric, the errors of the one nearest to it are used."
)
OVER = (1.0, 1.01, 1.02, 1.05)  # true metrics of the answers [limit]


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatingPoint:
    """Probability of PASS for bats with one true metric, by one test or by the best of three."""

    bat: str = column("bat")
    procedure: str = column("procedure")
    best_of: int = column("best of", form="d")
    metric: str
    unit: str
    true_value: float = column("true metric x", form=".4f")
    tests: int
    errors_of: str = column("errors of", form="")  # the simulated bat
    limit: float
    # probability that none of the tests is valid
    invalid_probability: float = column("INVALID", form=".1%")
    pass_probability: float = column("PASS", form=".1%")
    pass_probability_low: float = column("  at least", form=".1%")
    pass_probability_high: float = column("  at most", form=".1%")
    pass_probability_if_valid: float = column("PASS if valid", form=".1%")
    pass_probability_if_valid_low: float
    pass_probability_if_valid_high: float


CHANCES = [each.name for each in fields(OperatingPoint) if each.name.startswith("pass_")]
DRAWN = ("true_value", "invalid_probability", *CHANCES[:3])
LABELS = ("best of 3 tests of one laboratory", "one test")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class OperatingCurves(Rows[OperatingPoint]):
    """Probability of PASS against the true metric, by one test and by the best of three."""

    # limits of acceptance at which a bat at the limit passes with a probability of 5 %: one test,
    # and the best of three laboratories
    acceptance_limits: Mapping[str, tuple[float, float]]

    @property
    def text(self) -> str:
        """The title, the answers, and the table of all points."""
        return "\n\n".join((self.title, self.words, table_text(self.rows)))

    def draw(self) -> PageFigure:
        """Draw the probability of PASS with its interval, one panel per procedure."""
        with page_figure(2.6 * len(self.acceptance_limits)) as figure:
            same = len({row.metric for row in self.rows}) == 1
            panels = figure.subplots(len(self.acceptance_limits), squeeze=False, sharex=same).flat
            for axes, procedure in zip(panels, self.acceptance_limits, strict=True):
                for best_of, line, words in zip(TESTS[::-1], ("--", "-"), LABELS, strict=True):
                    points = [
                        r for r in self.rows if (r.procedure, r.best_of) == (procedure, best_of)
                    ][:POINTS]
                    true, invalid, passes, low, high = np.transpose(
                        [[getattr(row, key) for key in DRAWN] for row in points]
                    )
                    axes.fill_between(true, low, high, color=INTERVAL_GREY, linewidth=0)
                    axes.plot(true, passes, line, color="black", label=f"PASS, {words}")
                axes.plot(true, invalid, ":", color="black", label=f"INVALID, {words}")
                axes.axvline(points[0].limit, color="0.5", linewidth=0.6)
                words = "vertical line: limit; gray: 95 % interval of the simulation"
                axes.set_title(f"{points[0].bat} by {as_drawn(procedure)}; {words}")
                axes.set(
                    xlabel=with_axis_unit(f"true {points[0].metric}", points[0].unit),
                    ylabel="probability",
                )
                axes.legend()
        return figure


def operating(
    bat: AnyBat = "r161",
    *,
    procedures: AnyProcedures = ("astm-f1881",),
    true: Numbers = (),
    laboratories: Positive = 1000,
    seed: Seed = 1,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> OperatingCurves:
    """Show the probability of PASS.

    It is a function of the true metric of the bat. Each laboratory makes three tests of a bat. The
    table has the probability that one test passes, and the probability that at least one of three
    tests passes. The text ends with the answers for a bat at the limit, and 1, 2 and 5 % over it.

    For each true metric a variant of the bat is simulated that has this metric. A wood bat gets
    another modulus of elasticity. A hollow bat gets a thinner wall for a larger metric, and a
    higher hoop frequency for a smaller one. If no variant has the metric, the errors of the variant
    nearest to it are used. The column `errors of` names the simulated bat. Only the metric is
    compared with its limit. Rules for weight, length, diameter, moment of inertia and construction
    of a bat are ignored. To save time, the instruments record only summary values, not every gate
    edge and encoder count.

    Parameters
    ----------
    bat
        Bat design: a name in the catalog or a .toml file.

        In Python, a sheet such as ``vl.bat("r161")`` is also allowed.
    procedures
        Test procedure: a name in the catalog or a .toml file. It must have a limit.

        In Python, a sheet such as ``vl.procedure("bbcor")``, or a list, is also allowed.
    true
        Further true metrics for which the probabilities are stated, in the unit of the metric. By
        default the limit, and 1, 2 and 5 % more.
    laboratories
        Number of laboratories, each with three tests.
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
        Function that is called with a message, the number of simulated bats, and the total. If it
        is not given, the functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        A name is unknown, or a procedure has no limit.
    """
    bat, procedures, true = entry_name(bat), entry_names(procedures), values_of(true)
    rows, titles, answers = list[OperatingPoint](), list[str](), list[str]()
    acceptance_limits: dict[str, tuple[float, float]] = {}
    for name in procedures:
        round_robin = RoundRobin.of(bat, name)
        total = POINTS + len(OVER) + len(true)
        variants = _Variants(round_robin, laboratories, seed, total, progress)
        rules, limit, printed = variants.rules, variants.limit, variants.printed
        errors, valid, _ = variants.errors(limit)
        results = printed.in_unit(limit + np.where(valid, errors, np.inf))
        accepted = [_acceptance(results, risk) for risk in (RISK, 1 - (1 - RISK) ** (1 / 3))]
        acceptance_limits[rules.name] = accepted[0][0], accepted[1][0]
        deviations = HALF_RANGE * float(errors[valid].std()) * np.linspace(-1, 1, POINTS)
        further = *np.multiply(OVER, limit), *np.multiply(true, printed.unit_si)
        metrics = np.array([*(limit + deviations), *further]).tolist()
        one, best = ([variants.point(x, best_of) for x in metrics] for best_of in TESTS)
        rows += one + best
        answers.append(_answers(one[POINTS:], best[POINTS:], accepted))
        answers.extend(_decided_by_chance(one[:POINTS]))
        answers.extend(_other_rules(round_robin, seed))
        invalid = f"INVALID: {100 * one[POINTS].invalid_probability:.0f} %"
        strict = f"5 % with the limit {with_unit(accepted[0][0], printed.unit, '.4f')}"
        titles.append(f"{_best_of(1, one[POINTS])} by {rules.name} ({invalid}; {strict})")
    start = f"A bat such as {rows[0].bat} at the limit passes one test with a probability of"
    return OperatingCurves(
        name="operating",
        title=f"{start} {', '.join(titles)}",
        rows=[*dict.fromkeys(rows)],  # the curve and the answers have the limit
        words="\n\n".join((WORDS, *answers)),
        acceptance_limits=acceptance_limits,
    )


def _answers(
    one: Sequence[OperatingPoint],
    best: Sequence[OperatingPoint],
    accepted: Sequence[tuple[float, float]],
) -> str:
    """Return the probabilities of PASS for some true metrics, and limits of acceptance, as text.

    `one` and `best` are the rows of one procedure, by one test and by the best of three, for these
    metrics. `accepted` has the limit of acceptance, with its ±, for one laboratory and for the best
    of three.
    """
    lines = [
        {
            f"true {single.metric} {both_units(single.unit)}".rstrip(): in_both_units(
                single.true_value, single.unit, ".4g"
            ),
            "over the limit": f"{100 * (single.true_value / single.limit - 1):+.1f} %",
            "one test": _best_of(1, single),
            "best of 3 tests": _best_of(1, three),
            "best of 3 laboratories": _best_of(3, single),
            "errors of": single.errors_of,
        }
        for single, three in zip(one, best, strict=True)
    ]
    (alone, u), (best_of, best_u) = accepted
    return (
        f"Probability of PASS by {one[0].procedure}, with the limit {one[0].limit:g}; best of 3 "
        f"tests of one laboratory, or of 3 laboratories:\n{table_text(lines)}\n"
        f"If a bat at the limit shall pass only {100 * RISK:.0f} % of its tests,\nthe limit of "
        f"acceptance is {alone:.4f} ± {u:.4f}, or {best_of:.4f} ± {best_u:.4f} if the best of "
        "three laboratories counts."
    )


def _decided_by_chance(curve: Sequence[OperatingPoint]) -> Iterator[str]:
    """Yield the true metrics between which chance decides, if the curve reaches 95 and 5 %."""
    chances = [row.pass_probability_if_valid for row in curve[::-1]]
    if chances[0] <= RISK and chances[-1] >= 1 - RISK:
        true = [row.true_value for row in curve[::-1]]
        ends = np.interp([1 - RISK, RISK], chances, true).tolist()
        low, high = (with_unit(each, curve[0].unit, ".4f") for each in ends)
        most, least = (f"{100 * each:.0f} %" for each in (1 - RISK, RISK))
        yield (
            f"Chance decides between a true {curve[0].metric} of {low} and {high}: of the valid\n"
            f"tests of a bat, {most} pass at the first and {least} at the second."
        )


def _other_rules(round_robin: RoundRobin, seed: int) -> Iterator[str]:
    """Yield why the verdict of the nominal bat does not depend on its metric, if so."""
    certified, bat = next(round_robin.blocks(1, seed)).certified, round_robin.setup.bat.spec
    rules, measured = certified.procedure, certified.reduced.preparation.bat
    reasons = unmet_rules(rules, measured, np.array([nan]), bat.construction or "")
    if unmet := [each for each in reasons if each.where[0]]:
        yield (
            f"Here only the metric decides. By {rules.name} the verdict of the nominal {bat.name} "
            f"is {unmet[0].verdict.value} whatever its metric:\n"
            f"{'; '.join(each.sentence(0) for each in unmet)}."
        )


def _best_of(laboratories: int, row: OperatingPoint) -> str:
    """Return the probability that at least one of several laboratories passes a bat, with its ±."""
    p, low, high = row.pass_probability, row.pass_probability_low, row.pass_probability_high
    if p == 0:
        return f"< {100 * (1 - (1 - high) ** laboratories):.1f} %"
    if p == 1:
        return f"> {100 * (1 - (1 - low) ** laboratories):.1f} %"
    u = laboratories * (1 - p) ** (laboratories - 1) * (high - low) / 2
    return f"{100 * (1 - (1 - p) ** laboratories):.1f} ± {100 * u:.1f} %"


def _acceptance(results: Array, risk: float) -> tuple[float, float]:
    """Return the limit that a share `risk` of the results meets, and half its 95 % interval.

    The tests of a laboratory share its errors, so each laboratory counts as one test.
    """
    of = len(results)
    _, low, high = _chance(round(risk * of), of)
    ends = np.quantile(results, [risk, low, high], method="inverted_cdf")
    return float(ends[0]), float(ends[2] - ends[1]) / 2


class _Variants:
    """Variants of a bat with other true metrics, and the errors of their tests."""

    def __init__(
        self, round_robin: RoundRobin, laboratories: int, seed: int, total: int, progress: Progress
    ) -> None:
        self.setup, self.laboratories, self.seed = round_robin.setup, laboratories, seed
        self.rules, limit = self.setup.rules.spec, self.setup.rules.spec.metric_limit
        if limit is None:
            allowed = "has no limit; allowed: one with a limit"
            raise InputError("", "procedure", self.rules.name, allowed)
        self.limit, self.printed = limit, METRICS[self.rules.metric]
        self.total, self.progress = total, progress  # number of bats at most
        self.tests: dict[float, tuple[Array, Mask]] = {}  # errors and valid tests, by factor
        self.metric_of = cache(self._metric)
        self.metrics = np.array([self.metric_of(factor) for factor in FACTORS.tolist()])

    def point(self, metric: float, best_of: int) -> OperatingPoint:
        """Return the probabilities for bats with a true metric [SI], by the best of some tests."""
        errors, valid, errors_of = self.errors(metric)
        below = valid[:, :best_of] & (metric + errors[:, :best_of] <= self.limit)
        passed, sound = (int(mask.any(axis=1).sum()) for mask in (below, valid[:, :best_of]))
        chances = [each for of in (self.laboratories, sound) for each in _chance(passed, of)]
        return OperatingPoint(
            bat=self.setup.bat.spec.name,
            procedure=self.rules.name,
            best_of=best_of,
            metric=self.printed.symbol,
            unit=self.printed.unit,
            true_value=self.printed.in_unit(metric),
            tests=self.laboratories * best_of,
            errors_of=errors_of,
            limit=self.printed.in_unit(self.limit),
            invalid_probability=1 - sound / self.laboratories,
            **dict(zip(CHANCES, chances, strict=True)),
        )

    def errors(self, metric: float) -> tuple[Array, Mask, str]:
        """Return the errors of the metric [SI], 0 without a result, the valid tests, and the bat.

        The first two have the shape (laboratory, test).
        """
        difference = self.metrics - metric  # NaN: a barrel too soft for a result
        brackets = np.flatnonzero(difference[1:] * difference[:-1] < 0)
        factor = float(FACTORS[np.nan_to_num(np.abs(difference), nan=np.inf).argmin()])
        if brackets.size:
            from scipy.optimize import brentq

            at = min(brackets, key=lambda each: abs(np.log(FACTORS[each : each + 2]).sum()))
            low, high = FACTORS[at : at + 2].tolist()
            factor = float(brentq(lambda f: self.metric_of(f) - metric, low, high, rtol=1e-3))
        if factor not in self.tests:
            self.progress("bats", len(self.tests), self.total)
            tests = [self._test(factor, test) for test in range(max(TESTS))]
            errors, valid = (np.stack(each, axis=1) for each in zip(*tests, strict=True))
            self.tests[factor] = errors, valid
        return *self.tests[factor], _with_stiffness(self.setup.bat.spec, factor)[1]

    def _metric(self, factor: float) -> float:
        """Return the mean true metric of a variant [SI]."""
        metrics = next(self._variant(factor).blocks(MEAN_OF, 0)).measurands["metric"]
        finite = metrics[np.isfinite(metrics)]
        return float(finite.mean()) if finite.size else nan

    def _variant(self, factor: float, test: int = 0) -> RoundRobin:
        spec, _ = _with_stiffness(self.setup.bat.spec, factor)
        bat = replace(self.setup.bat, spec=spec)
        return RoundRobin.with_common_model(
            replace(self.setup, bat=bat, test=test or None, collision=None)
        )

    def _test(self, factor: float, test: int) -> tuple[Array, Mask]:
        """Return the errors of a test in each laboratory, and the valid tests, (laboratory,)."""
        errors, valid = [], []
        for block in self._variant(factor, test).blocks(self.laboratories, self.seed):
            certified = block.certified
            error = certified.results["metric"].value - block.measurands["metric"]
            errors.append(np.where(certified.has_result, error, 0.0))
            valid.append(certified.sound)
        return np.concatenate(errors), np.concatenate(valid)


def _with_stiffness(bat: BatSpec, factor: float) -> tuple[BatSpec, str]:
    """Return a bat whose barrel is stiffer by `factor`, and its name."""
    body = bat.body
    if factor == 1:
        return bat, bat.name
    if factor < 1 and body.profile.wall is not None:
        body, changed = body.with_wall(factor), "wall"
    elif body.hoop is not None:
        hoop = replace(body.hoop, frequency=factor * body.hoop.frequency)
        body, changed = replace(body, hoop=hoop), "hoop frequency"
    else:
        young, shear = factor * body.material.youngs_modulus, factor * body.material.shear_modulus
        material = replace(body.material, youngs_modulus=young, shear_modulus=shear)
        body, changed = replace(body, material=material), "modulus"
    return replace(bat, body=body), f"{bat.name}, {changed} × {factor:.3g}"


def _chance(passed: int, of: int) -> tuple[float, float, float]:
    """Return the share `passed` / `of` and its 95 % interval; 0, 0 and 1 if `of` is 0."""
    return passed / max(of, 1), *share_interval(passed, of)
