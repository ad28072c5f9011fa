"""The study `interlab`: precision of a procedure in several laboratories, and its causes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from math import hypot, sqrt
from typing import TYPE_CHECKING

import numpy as np

from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import Rows
from virtual_lab.output.rounding import with_axis_unit, with_unit
from virtual_lab.output.style import INTERVAL_GREY, as_drawn, page_figure
from virtual_lab.output.tables import column
from virtual_lab.parameters import AnyDocument, AnyLaboratory, Positive
from virtual_lab.studies.interlab.playing import Play
from virtual_lab.studies.interlab.study import FACTORS, read_interlab
from virtual_lab.uncertainty.interlaboratory import (
    OUTLIER,
    STRAGGLER,
    NestedStudy,
    nested_study,
)
from virtual_lab.units import Array

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

# largest difference that agrees with a prediction [share of the prediction], and smallest effect
# that is compared [share of s_R]
TOLERANCE, NEGLIGIBLE = 0.1, 0.02
APART = 1.96 * sqrt(2)  # largest difference of 95 % of pairs of results [s_R]
ALL, REST = "all factors", "interaction"
WORDS = (
    "s_r: repeats with one lot; s_lot: between lots; s_L: between laboratories; s_R: single tests\n"
    "of different laboratories. Factors: standard deviation that each alone causes, all others\n"
    "nominal; interaction: what all together cause beyond their root sum of squares (negative:\n"
    "less). Predicted: to first order. agrees: within 10 %, or within 2 % of s_R."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class InterlabTerm:
    """A standard deviation of one result, in the unit of its metric."""

    bat: str = column("bat", form="")
    procedure: str = column("procedure", form="")
    result: str = column("result", form="")
    unit: str
    term: str = column("term", form="")
    predicted: float | None = column("predicted", form=".2g")
    simulated: float | None = column("simulated", form=".3g")
    simulated_se: float | None = column("its u", form=".1g")
    agrees: bool | None = column("agrees", form="")
    factor_spread: str = column(
        "spread of the factor",
        form=lambda row: "; ".join(filter(None, (row.factor_spread, row.source))),
    )
    source: str


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Interlab(Rows[InterlabTerm]):
    """Precision of each result, the factors that cause it, and the analysis of its exercises."""

    exercises: dict[str, NestedStudy]  # all exercises, by the name of bat, procedure and result

    def draw(self) -> PageFigure:
        """Draw the causes of each result's scatter, and h and k of its first exercise.

        Raises `InputError` for predictions alone.
        """
        if not self.exercises:
            raise InputError("", "plot", None, "predictions have no picture; leave out predict")
        cases = list(self.exercises.items())
        with page_figure(2.2 * len(cases)) as figure:
            panels = figure.subplots(len(cases), 3, squeeze=False, width_ratios=(2, 1, 1))
            for (name, study), (causes, h, k) in zip(cases, panels, strict=True):
                rows = [row for row in self.rows if _case_name(row) == name and row.simulated]
                terms = [row.term for row in rows]
                causes.barh(terms, [abs(row.simulated or 0) for row in rows], color="0.6")
                causes.plot([row.predicted for row in rows], terms, "|k", markersize=9)
                causes.invert_yaxis()
                causes.set_title(as_drawn(name))
                words = with_axis_unit("mark: predicted; standard deviation", rows[0].unit)
                causes.set_xlabel(words)
                causes.locator_params(axis="x", nbins=5)
                for axes, values, limit, words in (
                    (h, study.h[0], study.h_limit(), "h: means"),
                    (k, study.k[0], study.k_limit(), "k: scatter of repeats"),
                ):
                    low = -limit if values.min() < 0 else 0
                    axes.axhspan(low, limit, color=INTERVAL_GREY, linewidth=0)
                    axes.plot(1 + np.arange(values.size), values, "ok", markersize=3)
                    axes.set(title=words, xlabel="laboratory")
                    axes.locator_params(axis="x", integer=True)
        return figure


def interlab(
    study: AnyDocument,
    *,
    predict: bool = False,
    workers: Positive = 1,
    laboratory: AnyLaboratory | None = None,
    progress: Progress = quiet,
) -> Interlab:
    """Show how far laboratories differ.

    In each exercise, several laboratories test the same bat with several lots of balls. The table
    has the standard deviations of repeats, lots and laboratories (ISO 5725-2). It also has the
    effect of each factor alone, both predicted and simulated, and the effect of a control bat. A
    bat is tested whatever its construction, also if the procedure requires no test of it.

    Parameters
    ----------
    study
        Study file, .toml. The required keys are
        ``procedures``, ``bats``, ``laboratories`` (number per exercise), ``seed`` and ``factors``.
        The optional keys are ``exercises``, ``lots`` (number per laboratory), ``repeats`` (number
        per lot), ``alone`` (number of laboratories for each factor alone) and ``control`` (a
        control bat).

        Or the keys and values as a mapping.
    predict
        Predict the effect of each factor without simulating any laboratory.
    workers
        Number of processes, each with one thread, that share the laboratories.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    progress
        Function that is called with a message, the number of cases done, and the total. If it is
        not given, the functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        The file has an unknown key, a value or unit that is not allowed, or an unknown name; bat,
        ball or rig does not fit the procedure; too few laboratories have a valid test.
    """
    entry = read_interlab(study)
    spec = entry.spec
    rows: list[InterlabTerm] = []
    exercises: dict[str, NestedStudy] = {}
    cases = [
        Play(study=entry, bat=bat, procedure=procedure, workers=workers)
        for procedure in spec.procedures
        for bat in spec.bats
    ]
    for play in cases:
        _require_effects(play, "study" if isinstance(study, Mapping) else str(study))
    for number, play in enumerate(cases):
        progress("cases", number, len(cases))
        if predict:
            rows += [row for each in _predictions(play).values() for row in each.values()]
            continue
        for terms, precision in _results(play):
            rows += terms
            exercises[_case_name(terms[0])] = precision
    progress("cases", len(cases), len(cases))
    if predict:
        title = "effect of each factor alone, predicted"
        return Interlab(name="interlab", title=title, rows=rows, exercises={})
    tests = f"{spec.exercises} x {spec.laboratories} laboratories, {spec.lots} lots"
    tests += f", {spec.repeats} repeats; {spec.alone} laboratories per factor alone"
    units = {_case_name(row): row.unit for row in rows}
    texts = [_consistency(name, units[name], each) for name, each in exercises.items()]
    title = "\n".join([*texts, "", tests])
    return Interlab(name="interlab", title=title, words=WORDS, rows=rows, exercises=exercises)


def _require_effects(play: Play, where: str) -> None:
    """Raise `InputError` if a factor has neither a number in the study nor a spread in its sheet.

    `where` is the name of the study's file in the error message.
    """
    for factor in play.factors:
        numbers = getattr(play.study.spec.factors, factor)
        spreads = [datum.value for key, datum in _numbers(play, factor) if key != "value"]
        if factor != "calibration" and not any([*asdict(numbers).values(), *spreads]):
            key, place = list(FACTORS[factor].places().items())[-1]
            sheet = f"{place.kind}/{place.name or _rules(play).ball}"
            allowed = (
                f"has no effect, because {sheet} has no {place.key}; "
                f'add {key} = {{ value = …, unit = "…", source = "…", verified = false }}'
            )
            raise InputError(where, f"factors.{factor}", None, allowed)


def _results(play: Play) -> Iterator[tuple[list[InterlabTerm], NestedStudy]]:
    """Yield rows and analysis of all exercises for each result of a bat by a procedure."""
    study, predictions = play.study.spec, _predictions(play)
    exercises = play.exercises()
    alone = {}
    if study.alone:
        alone = {name: play.alone([name]) for name in play.factors}
        alone[ALL] = play.alone(play.factors)
    printed = METRICS[_rules(play).metric]
    control = {}
    if study.control:
        tests = study.lots * study.repeats
        control = replace(play, bat=study.control).exercises(first_test=1 + tests)
    for result, predicted in predictions.items():
        values, u = printed.in_unit(exercises[result])
        precision = _precision(values)
        s_R = _pooled_sds(precision)["s_R"]
        like = predicted[ALL]
        effects = {name: printed.in_unit(each[result]) for name, each in alone.items()}
        rows = [
            _with_result(row, effects[name], study.alone, s_R) if alone else row
            for name, row in predicted.items()
        ]
        if alone:
            parts = [effects[name] for name in play.factors]
            rows.append(_interaction(parts, effects[ALL], study.alone, like))
        of_lots = [
            predicted[name].predicted or 0.0 for name in play.factors if FACTORS[name].of_lot
        ]
        expected = {"s_lot": hypot(*of_lots, 0.0)} if study.lots > 1 else {}
        rows += _sds(precision, like, expected)
        stated = float(np.sqrt(np.nanmean(u**2)))
        rows.append(replace(like, term="stated u", predicted=None, simulated=stated))
        yield rows, precision
        if control:
            reference = control[result][0].mean(axis=-1, keepdims=True)  # one value per lot
            corrected = values * np.nanmean(reference) / reference
            cured = replace(like, result=f"{result}, control bat {study.control}")
            precision = _precision(corrected)
            yield _sds(precision, cured, {}), precision


def _predictions(play: Play) -> dict[str, dict[str, InterlabTerm]]:
    """Return the predicted rows by result and factor; the last row is for all factors together."""
    point = play.nominal_test()
    printed, factors = METRICS[point.procedure.metric], play.study.spec.factors
    rows: dict[str, dict[str, InterlabTerm]] = {}
    for result in point.calibrations:
        effects = {
            name: abs(printed.in_unit(getattr(factors, name).effect(point, result)))
            for name in play.factors
        }
        effects[ALL] = hypot(*effects.values())
        rows[result] = {
            name: InterlabTerm(
                bat=play.bat,
                procedure=play.procedure,
                result=result,
                unit=printed.unit,
                term=name,
                predicted=effect,
                simulated=None,
                simulated_se=None,
                agrees=None,
                factor_spread=_spread(play, name),
                source=_sources(play, name),
            )
            for name, effect in effects.items()
        }
    return rows


def _with_result(row: InterlabTerm, found: float, laboratories: int, s_R: float) -> InterlabTerm:
    """Return the row of a factor with the effect that was simulated in `laboratories`."""
    predicted = row.predicted or 0.0
    tolerance = max(TOLERANCE * predicted, NEGLIGIBLE * s_R)
    return replace(
        row,
        simulated=found,
        simulated_se=found / sqrt(2 * (laboratories - 1)),
        agrees=None if row.term == ALL else abs(found - predicted) <= tolerance,
    )


def _interaction(
    alone: list[float], together: float, laboratories: int, like: InterlabTerm
) -> InterlabTerm:
    """Return the row of the interaction, from standard deviations in `laboratories` each.

    The interaction is negative if all factors together cause a smaller standard deviation than the
    root sum of squares of the single factors. Its u is its standard deviation by chance.
    """
    squares = np.square([together, *alone])
    rest = squares[0] - squares[1:].sum()
    chance = sqrt(2 / (laboratories - 1)) * float(np.linalg.norm(squares))
    root = float(np.copysign(sqrt(abs(rest)), rest))
    return replace(like, term=REST, predicted=0.0, simulated=root, simulated_se=sqrt(chance))


def _precision(values: Array) -> NestedStudy:
    """Return the analysis of exercises, (exercise, laboratory, lot, repeat).

    A laboratory is used only if all its tests are valid, so there may be fewer exercises. A lot
    that the procedure rejects makes a test INVALID. Raises `InputError` if fewer than two
    laboratories remain.
    """
    laboratories = values.reshape(-1, *values.shape[2:])
    valid = laboratories[np.isfinite(laboratories).all(axis=(1, 2))]
    size = min(values.shape[1], len(valid))
    if size < 2:
        allowed = f"allowed: at least 2 whose tests are all valid, of {len(laboratories)}"
        raise InputError("", "laboratories", len(valid), allowed)
    whole = len(valid) // size
    return nested_study(valid[: whole * size].reshape(whole, size, *values.shape[2:]))


def _variances(precision: NestedStudy) -> dict[str, Array]:
    """Return unbiased variances by term, (exercise,)."""
    lots = precision.counts.shape[1] > 1
    parts = {"s_lot": precision.lot_variance} if lots else {}
    parts |= {"s_L": precision.laboratory_variance, "s_r": precision.repeat_variance}
    return parts | {"s_R": sum(parts.values(), np.zeros(precision.mean.shape))}


def _pooled_sds(precision: NestedStudy) -> dict[str, float]:
    """Return standard deviations by term, computed from the mean variances of all exercises."""
    variances = {term: max(float(each.mean()), 0.0) for term, each in _variances(precision).items()}
    variances["s_R"] = sum(variances.values()) - variances["s_R"]
    return {term: sqrt(variance) for term, variance in variances.items()}


def _sds(
    precision: NestedStudy, like: InterlabTerm, predicted: dict[str, float]
) -> list[InterlabTerm]:
    """Return the rows of s_lot, s_L, s_r and s_R; `like` names the result."""
    count, variances = precision.mean.size, _variances(precision)
    rows = []
    for term, sd in _pooled_sds(precision).items():
        u = None
        if count > 1 and sd:
            u = float(variances[term].std(ddof=1)) / sqrt(count) / (2 * sd)
        elif term == "s_R":
            u = float(precision.reproducibility_u[0])
        row = replace(like, term=term, predicted=predicted.get(term), simulated=sd, simulated_se=u)
        rows.append(replace(row, agrees=None, factor_spread="", source=""))
    return rows


def _consistency(name: str, unit: str, study: NestedStudy) -> str:
    """Return the largest difference of two laboratories and tests of the first exercise in words.

    The difference is the reproducibility limit of ISO 5725-6.
    """
    tests = (
        ("Cochran", float(study.cochran[0]), study.cochran_limit, "laboratory's scatter"),
        ("Grubbs", float(study.grubbs[0]), study.grubbs_limit, "laboratory's mean"),
    )
    texts = []
    for test, value, limit, what in tests:
        kind = "an outlier" if value > limit(OUTLIER) else "a straggler"
        said = f", a {what} is {kind}" if value > limit(STRAGGLER) else ""
        texts.append(f"{test} {value:.2f} (5 %: {limit(STRAGGLER):.2f}){said}")
    apart = with_unit(APART * _pooled_sds(study)["s_R"], unit, ".3g")
    return (
        f"{name}: single tests of two laboratories differ by less than {apart} in 95 % of cases "
        f"({APART:.1f} s_R).\nOutlier tests (ISO 5725-2) of its first exercise:\n"
        f"{'; '.join(texts)}."
    )


def _case_name(row: InterlabTerm) -> str:
    return f"{row.bat} by {row.procedure}, {row.result}"


def _rules(play: Play) -> Procedure:
    return catalog.load("procedures", play.procedure, Procedure).spec


def _numbers(play: Play, factor: str) -> Iterator[tuple[str, catalog.Datum]]:
    """Yield key and number of a factor, from the study or from the data sheet; none for all."""
    stated = {datum.key: datum for datum in play.study.sheet}
    places = FACTORS[factor].places() if factor != ALL else {}
    for key, place in places.items():
        _, numbers = catalog.sheet(place.kind, place.name or _rules(play).ball)
        of_sheet = next((datum for datum in numbers if datum.key == place.key), None)
        if datum := stated.get(f"factors.{factor}.{key}", of_sheet):
            yield key, datum


def _spread(play: Play, factor: str) -> str:
    texts = [f"{key} {datum.value:g} {datum.unit}" for key, datum in _numbers(play, factor)]
    return ", ".join(text.removesuffix(" 1") for text in texts)


def _sources(play: Play, factor: str) -> str:
    if factor == "calibration":
        return "data sheets of the instruments"
    numbers = [datum for _, datum in _numbers(play, factor)]
    words = [f"{datum.source}{'' if datum.verified else ', not verified'}" for datum in numbers]
    return "; ".join(dict.fromkeys(words))
