"""Coverage: the share of laboratories whose 95 % interval contains the true value.

The study also compares the bias of each result with the expected bias, which has three causes. The
first is the curvature of the reduction over the range of its uncertain inputs. The second is the
curvature of the metric along the barrel over the range of the scattered impact positions. The third
is the bias that a scan causes by choosing the best position, computed by simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import sqrt
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from virtual_lab.lab import BlockTest, Laboratory, RoundRobin
from virtual_lab.lab.measurand import STANDARD_BALL, true_curve
from virtual_lab.measurement.procedure import variances_within
from virtual_lab.measurement.procedure.model import QUANTITIES
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.style import INTERVAL_GREY, as_drawn, page_figure
from virtual_lab.output.tables import column
from virtual_lab.parameters import AnyLaboratory, Positive, Seed, TwoOrMore
from virtual_lab.records import AimMarks
from virtual_lab.sheets import AnyBat, AnyProcedure, Instruments, entry_name
from virtual_lab.streams import Streams
from virtual_lab.studies.rehearsal import Rehearsal
from virtual_lab.uncertainty.budget import coverage_factors
from virtual_lab.uncertainty.estimate import share_interval
from virtual_lab.units import Array, Mask

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from virtual_lab.output.page_figure import PageFigure

WORDS = (
    "Error: measured minus true value. 95 % interval of the percentage: Clopper-Pearson. SI: unit\n"
    "of the quantity, 1 or m/s. Tenths of the laboratories: those with the smallest u, or the\n"
    "fewest degrees of freedom, first. Bias expected of the method: computed from the curvature\n"
    "of the formulas and of the metric along the barrel, and from the choice of a position."
)
Taken = TypeVar("Taken")
ENOUGH = 500  # laboratories with which the interval of a coverage of 95 % is 4 % wide
TENTHS = 10
TENTH_DASHES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (1, 1)))  # line styles of a panel's lines


def _tenth_texts(key: str) -> Callable[[Coverage], str]:
    return lambda row: ", ".join(
        "" if p is None else f"{p:.0%}" for p in getattr(row, key).values()
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """Coverage, errors and bias of one quantity over many laboratories.

    `coverage_low` and `coverage_high` are the limits of the coverage (95 %, Clopper-Pearson). The
    ratio of `rms_error` to `rms_u` is 1 for a realistic uncertainty, and larger if the stated
    uncertainty is too small. Errors, u and bias are in `unit`, the SI unit of the quantity.
    `coverage_by_u` and `coverage_by_dof` are the coverage of each tenth of the laboratories, None
    for a tenth without laboratories; they are ten columns each, from ``coverage_by_u_1`` on.
    `expected_bias_se` is None unless the expected bias was computed by simulation.
    """

    bat: str
    procedure: str
    quantity: str
    unit: str
    laboratories: int = column("laboratories with a result")
    invalid: int = column("laboratories with an INVALID test")
    rejected: float = column("hits rejected by the procedure", form=".1%")
    coverage: float = column("intervals with the true value", form=".1%")
    coverage_low: float = column("  its 95 % interval, from", form=".1%")
    coverage_high: float = column("  to", form=".1%")
    above: float = column("true value above the interval", form=".1%")
    below: float = column("true value below the interval", form=".1%")
    coverage_by_u: Mapping[int, float | None] = column(
        "coverage by tenths of u", form=_tenth_texts("coverage_by_u")
    )
    coverage_by_dof: Mapping[int, float | None] = column(
        "coverage by tenths of degrees of freedom", form=_tenth_texts("coverage_by_dof")
    )
    mean_z: float = column("mean error", "u", "+.3f")
    mean_z_se: float = column("  its standard error", "u", ".3f")
    sd_z: float = column("standard deviation of the errors", "u", ".3f")
    rms_error: float = column("rms error", "SI", ".4g")
    rms_u: float = column("rms of the stated u", "SI", ".4g")
    bias: float = column("bias (mean error)", "SI", "+.2e")
    bias_se: float = column("  its standard error", "SI", ".1e")
    expected_bias: float = column("bias expected of the method", "SI", "+.2e")
    expected_bias_se: float | None = column("  its standard error", "SI", ".1e")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CoverageTable(Rows[Coverage]):
    """Coverage, errors and bias, one row per quantity, the metric first."""

    def draw(self) -> PageFigure:
        """Draw the coverage of each quantity, and of the metric by tenths of the laboratories."""
        from scipy.stats import binom  # takes half a second to load

        shares = np.array(
            [(row.coverage, row.coverage_low, row.coverage_high) for row in self.rows]
        )
        share, low, high = 100 * shares.T
        names = [row.quantity.replace("_", " ") for row in self.rows]
        with page_figure(2.9) as figure:
            quantities, tenths = figure.subplots(1, 2)
            spread = (share - low, high - share)
            quantities.errorbar(share, names, xerr=spread, capsize=3, fmt="ok", markersize=3)
            quantities.axvline(95, color="0.5", linewidth=0.6)
            figure.suptitle(as_drawn(self.title.replace(": ", "\n", 1)), fontsize=8)
            quantities.set(xlabel="intervals with the true value, %", ymargin=0.1)
            quantities.invert_yaxis()
            metric = self.rows[0]
            labels = {
                "by $u$, smallest first": list(metric.coverage_by_u.values()),
                "by degrees of freedom, fewest first": list(metric.coverage_by_dof.values()),
            }
            size = max(metric.laboratories // TENTHS, 1)
            least, most = (100 * binom.ppf(p, size, 0.95) / size for p in (0.025, 0.975))
            words = "95 % range by chance"
            tenths.axhspan(least, most, color=INTERVAL_GREY, linewidth=0, label=words)
            plot_tenths(tenths, labels)
            tenths.set(ylabel="intervals with the true metric, %")
            figure.legend(loc="outside lower center", ncols=3)
        return figure


def plot_tenths(axes: Axes, shares: Mapping[str, Sequence[float | None]]) -> None:
    """Plot the coverage [%] of ten groups of laboratories against the number of the group, 1 to 10.

    Parameters
    ----------
    axes
        Panel to plot into.
    shares
        Coverage of each group, 0 to 1, keyed by the label of the line. None means a group without
        laboratories.
    """
    axes.axhline(95, color="0.5", linewidth=0.6)
    for (label, tenths), dash in zip(shares.items(), TENTH_DASHES, strict=False):
        percent = 100 * np.array(tenths, dtype=float)  # None: NaN
        axes.plot(range(1, TENTHS + 1), percent, linestyle=dash, color="black", label=label)
    axes.set(xticks=range(1, TENTHS + 1), xlabel="tenth of the laboratories")


def coverage(
    bat: AnyBat = "r161",
    *,
    procedure: AnyProcedure = "astm-f1881",
    laboratories: TwoOrMore = 1000,
    seed: Seed = 1,
    summed: bool = False,
    individual: bool = False,
    earlier_tests: int = 0,
    workers: Positive = 1,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> CoverageTable:
    """Show how often the intervals hold.

    This is the coverage of the 95 % intervals, over many laboratories. One bat design is certified
    in each laboratory. The table has one row per quantity, the metric first. INVALID tests have no
    result and are counted separately.

    Results of two bats with the same seed are not independent: their errors, in units of the
    standard uncertainty u, have a correlation of 0.98.

    Parameters
    ----------
    bat
        The bat: a name in the catalog or a .toml file.

        Or a sheet, ``vl.bat("r161")``, whose values may be changed.
    procedure
        The test procedure: a name in the catalog or a .toml file. Its key ``ball`` names the ball.

        Or a sheet: ``vl.procedure("bbcor").with_(valid_hits=8)``.
    laboratories
        Number of laboratories. Bat, balls and calibration errors differ between laboratories.
    seed
        Seed of the study. The laboratories are numbered from 0. The seed and this number identify a
        laboratory.
    summed
        Let the instruments record summary values instead of every gate edge and encoder count, and
        let every laboratory test the nominal bat. This is much faster.
    individual
        Let every laboratory test an individual bat, even with ``summed``. Without ``summed`` this
        is always so.
    earlier_tests
        Number of earlier tests of each laboratory, which contribute to the scatter of the hits.
    workers
        Number of processes, each with one thread, that share the laboratories.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with a message, the number of laboratories done, and the total. If
        it is not given, the functions of `virtual_lab` and the commands show the progress on
        stderr.

    Raises
    ------
    InputError
        A name is unknown.
    """
    bat, procedure = entry_name(bat), entry_name(procedure)
    round_robin = RoundRobin.of(bat, procedure, summed=summed, individual=individual)
    round_robin = replace(round_robin, history=earlier_tests)
    samples = each_laboratory(round_robin, sample, laboratories, seed, workers, progress)
    where = f" in the laboratory {laboratory}" if laboratory else ""
    return coverage_table(samples, bat, procedure, seed, where)


def each_laboratory(
    round_robin: RoundRobin,
    take: Callable[[BlockTest], Taken],
    laboratories: int,
    seed: int,
    workers: int,
    progress: Progress,
) -> Iterator[Taken]:
    """Yield the result of `take` for each block of laboratories, in the order of the laboratories.

    Parameters
    ----------
    round_robin
        Design of the study: bat, procedure and rigs.
    take
        Function that receives the tests of a block and returns what the study needs of them. It
        must be defined at module level, because processes pickle it.
    laboratories
        Number of laboratories, at least 2.
    seed
        Seed of the study.
    workers
        Number of processes, at least 1.
    progress
        Function that is called after each block with a message, the number of laboratories done,
        and the total.

    Raises
    ------
    InputError
        A laboratory cannot be simulated.
    """
    finished = 0
    counting = partial(_counting, take=take)
    for count, part in round_robin.each_block(counting, laboratories, seed, workers):
        finished += count
        progress("laboratories", finished, laboratories)
        yield part


def _counting(tested: BlockTest, take: Callable[[BlockTest], Taken]) -> tuple[int, Taken]:
    return tested.certified.invalid.size, take(tested)


def coverage_table(
    samples: Iterable[Sample], bat: str, procedure: str, seed: int, where: str = ""
) -> CoverageTable:
    """Return the table of a coverage study from the samples of all its blocks of laboratories.

    The table has one row per quantity, the metric first. `seed` is the seed of the study. `where`
    names its laboratory in the title.
    Laboratories with an INVALID test are only counted. Raises `ValueError` if no laboratory has a
    result.
    """
    nominal = RoundRobin.of(bat, procedure)
    metric_name = nominal.setup.rules.spec.metric
    order = ("metric", STANDARD_BALL, *(each for each in QUANTITIES if each != metric_name))
    rows_of_quantity: dict[str, list[Array]] = {name: [] for name in order}
    strayed: list[Array] = []
    bends: dict[str, float] = {}
    rehearsal = None
    laboratories, invalid, valid, fired = 0, 0, 0, 0
    for part in samples:
        laboratories += part.sound.size
        valid, fired = valid + int(part.valid.sum()), fired + int(part.fired.sum())
        invalid += int((~part.sound).sum())
        if not part.sound.any():
            continue
        if not bends:
            first, place = nominal.laboratory(seed), float(part.place[part.sound][0])
            bends = _curvatures(first, place)
            rehearsal = Rehearsal.of(first, place) if first.rules.spec.scan else None
        strayed.append(np.stack([part.stray, part.scatter], axis=1)[part.sound])
        for name in rows_of_quantity.keys() & part.results.keys():
            beside = 0.0 if rehearsal and name == "metric" else part.beside
            rows_of_quantity[name].append(
                part.results[name].rows(bends[name] * beside / 2)[part.sound]
            )
    rejected = 1 - valid / fired
    about = {"bat": bat, "procedure": procedure, "invalid": invalid, "rejected": rejected}
    unit = METRICS[metric_name].si_unit
    units = {"metric": unit, STANDARD_BALL: unit}
    metric, *rows = (
        _row(np.concatenate(results), quantity=name, unit=units.get(name, ""), **about)
        for name, results in rows_of_quantity.items()
        if results
    )
    if rehearsal:
        hit_scatter = rehearsal.hit_scatter(*np.sqrt(np.mean(np.concatenate(strayed), axis=0)))
        bias, bias_se = rehearsal.bias(hit_scatter, Streams(seed), laboratories)
        metric = replace(
            metric, expected_bias=metric.expected_bias + bias, expected_bias_se=bias_se
        )
    return CoverageTable(
        name="coverage",
        title=f"{bat} by {procedure}{where}: {_answer(metric)}",
        across="quantity",
        words=WORDS,
        rows=[metric, *rows],
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """Results of one quantity [SI], arrays of shape (laboratory,)."""

    value: Array
    u: Array
    dof: Array
    shift: Array  # expected bias from the curvature of the reduction
    true: Array

    def rows(self, beside: Array | float) -> Array:
        """Return miss, error, u, expected bias and degrees of freedom, shape (laboratory, 5).

        The miss is 1 if the true value is above the 95 % interval, -1 if it is below, and 0
        otherwise. `beside` is added to the expected bias.
        """
        half_width = coverage_factors(self.dof) * self.u
        above, below = self.true > self.value + half_width, self.true < self.value - half_width
        missed = above.astype(float) - below
        error, expected = self.value - self.true, self.shift + beside
        return np.stack([missed, error, self.u, expected, self.dof], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """Results of a block of laboratories, arrays of shape (laboratory,)."""

    sound: Mask  # tests that are not INVALID
    fired: NDArray[Any]  # number of shots
    valid: NDArray[Any]  # number of valid shots
    place: Array  # impact position of the result [m]
    stray: Array  # variance of the marks along the bat [m²]
    beside: Array  # mean square distance of the marks from the known aim [m²]
    scatter: Array  # variance of the metric at a position, over the hits of the result
    results: Mapping[str, Results]  # results keyed by quantity name


def sample(tested: BlockTest) -> Sample:
    """Return the results of a block of laboratories for the coverage study, in SI units.

    The arrays have the shape (laboratory,). They are the numbers of shots, the impact position [m
    from the tip], and the scatter of the impact positions and of the metric. For each quantity,
    keyed by name, there are the value, the standard uncertainty, the degrees of freedom and the
    true value. Laboratories with an INVALID test are included; the mask `sound` is False for them.
    """
    certified, reduced = tested.certified, tested.certified.reduced
    owner, metric = reduced.owner, reduced.shot_metric
    count = certified.invalid.size
    marks = certified.block.impact["aim"]
    assert isinstance(marks, AimMarks)
    aim = certified.block.calibration.get("impact.cannon.along")
    along = marks.along.reshape(count, -1)
    deviation = along - (aim.value[:, None] if aim else 0.0)
    used, results = certified.hit_weights.used, certified.results
    scatter, _ = variances_within(owner[used], reduced.position[used], metric[used], count)
    return Sample(
        sound=~certified.invalid,
        fired=np.bincount(owner, minlength=count),
        valid=np.bincount(owner, reduced.valid, count),
        place=certified.hit_weights.position,
        stray=deviation.var(axis=1, ddof=1),
        beside=np.mean(deviation**2, axis=1),
        scatter=scatter,
        results={
            true: Results(
                value=budgets.value,
                u=budgets.u,
                dof=budgets.dof,
                shift=budgets.components.shift.sum(axis=1),
                true=tested.measurands[true],
            )
            for true, budgets in {**results, STANDARD_BALL: results["metric"]}.items()
            if true in tested.measurands
        },
    )


def _curvatures(laboratory: Laboratory, place: float) -> dict[str, float]:
    """Return d²/dz² [SI/m²] of ``metric`` and of all quantities at impact position `place` [m]."""
    step = 4e-3  # distance to either side [m]
    places = place + step * np.array([-1.0, 0.0, 1.0])
    procedure = laboratory.rules.spec
    curve = true_curve(laboratory.impact, laboratory.specimen, procedure, places)
    values = curve.quantities | dict.fromkeys(("metric", STANDARD_BALL), curve.metric())
    return {name: float(np.diff(row, 2)[0]) / step**2 for name, row in values.items()}


def _row(results: Array, **about: Any) -> Coverage:
    missed, error, u, expected, dof = results.T
    covered = missed == 0
    low, high = share_interval(int(covered.sum()), covered.size)
    z = error / u
    return Coverage(
        **about,
        laboratories=int(covered.size),
        coverage=float(covered.mean()),
        coverage_low=low,
        coverage_high=high,
        above=float((missed > 0).mean()),
        below=float((missed < 0).mean()),
        coverage_by_u=_tenths(covered, u),
        coverage_by_dof=_tenths(covered, dof),
        mean_z=float(z.mean()),
        mean_z_se=float(z.std(ddof=1)) / sqrt(z.size),
        sd_z=float(z.std(ddof=1)),
        rms_error=sqrt(float((error**2).mean())),
        rms_u=sqrt(float((u**2).mean())),
        bias=float(error.mean()),
        bias_se=float(error.std(ddof=1)) / sqrt(error.size),
        expected_bias=float(expected.mean()),
        expected_bias_se=None,
    )


def _answer(metric: Coverage) -> str:
    """Return whether the intervals of the metric hold, as far as the study shows."""
    low, high = 100 * metric.coverage_low, 100 * metric.coverage_high
    answer = "as stated" if metric.laboratories >= ENOUGH else f"undecided with fewer than {ENOUGH}"
    if not low <= 95 <= high:
        answer = f"{'less' if high < 95 else 'more'} often than stated"
    return (
        f"the 95 % intervals of the metric contain the true value in {100 * metric.coverage:.1f} % "
        f"({low:.1f} to {high:.1f} %) of {metric.laboratories} laboratories, {answer}"
    )


def _tenths(covered: Mask, by: Array) -> dict[int, float | None]:
    """Return the coverage of each tenth of the laboratories by its number, sorted by `by`."""
    parts = np.array_split(covered[np.argsort(by, kind="stable")], TENTHS)
    return {n: float(part.mean()) if part.size else None for n, part in enumerate(parts, 1)}
