"""Propagation of distributions (JCGM 101 and 102): counted draws, adaptive stopping, intervals.

Draws are made in blocks of 65 536, and each block depends only on the seed, the input and the
number of the block. A draw can therefore be repeated. It does not depend on the other inputs, on
their order, or on the length of the run. The memory does not grow with the number of draws.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import ceil, floor, inf, log10, sqrt

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.streams import generator
from virtual_lab.uncertainty.inputs import Inputs
from virtual_lab.uncertainty.laws import LAWS
from virtual_lab.uncertainty.models import Model, Outputs
from virtual_lab.uncertainty.propagated import (
    LAST_BITS,
    Convergence,
    Outcome,
    Propagated,
    Region,
    correlation_of,
    without_rounding,
)
from virtual_lab.uncertainty.sketch import Sketch, shortest_interval
from virtual_lab.units import Array, Mask

MONTE_CARLO = "monte-carlo"
BLOCK, BATCH = 65_536, 16_384  # a batch has at least the 10 000 draws that JCGM 101, 7.9.4 requires
FIRST_STAGE = 16  # batches
CONFIDENCE = 0.95  # probability that all stated numbers are within their tolerances
# largest share of a single draw in the variance for which mean and u are stated. If the variance
# does not exist, the share does not fall with the number of draws: for 1/x about 0 it is .2 to 1.
# Of 262 144 draws of a t with 3 degrees of freedom, whose variance exists, it exceeds .15 in one of
# a thousand runs.
LARGEST_SHARE = 0.15
WITHOUT_VARIANCE = (
    "mean and variance of {} do not exist, or the draws do not settle them: one draw causes {:.0%} "
    "of the variance. u is infinite and the value is the median; use quantiles"
)
MOST_DRAWS = 2**36  # draws


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """Number of draws: fixed, or increased until `digits` digits of u are correct."""

    probability: float
    digits: int = 2
    draws: int | None = None
    rule: str = "stein"
    validate: bool = False
    seed: int = 0
    progress: Callable[[str, int, int], object] = lambda _text, _done, _total: None


def drawn_block(inputs: Inputs, seed: int, block: int) -> dict[str, Array]:
    """Return the draws of every source in one block, keyed by name of the source, each (65536,).

    The draws are values of the source, in its unit. `block` is the number of the block, from 0. The
    same seed, source and block always give the same draws.
    """
    draws = {}
    for name, source in inputs.sources.items():
        if name not in inputs.correlated_names:
            x = source.law.draw(generator(seed, name, block), BLOCK, source.shape)
            x *= source.scale
            x += source.estimate.value
            draws[name] = x
    for joint in inputs.joints:
        normal = [generator(seed, name, block).standard_normal(BLOCK) for name in joint.names]
        errors = joint.draw_factor @ np.stack(normal)
        if joint.draw_dof < inf:
            shared = generator(seed, " ".join(joint.names), block)
            errors /= np.sqrt(shared.chisquare(joint.draw_dof, BLOCK) / joint.draw_dof)
        for name, error in zip(joint.names, errors, strict=True):
            draws[name] = inputs.sources[name].estimate.value + error
    return draws


class Batches:
    """Draws of every output so far: statistics of each batch, and a sketch of all draws.

    `linear_u` is the u of each output to first order, (output,). `no_variance` says that the
    variance of an input does not exist.
    """

    def __init__(self, model: Model, drawing: Drawing, linear_u: Array, no_variance: bool) -> None:
        self.model, self.drawing = model, drawing
        self.linear_u, self.no_variance = linear_u, no_variance
        self.largest = np.zeros(linear_u.size)  # largest squared deviation from a batch's mean
        self.sketches: dict[str, Sketch] = {}
        # ends of the interval from the first block, and dx/dF there, by output
        self.ends: dict[str, tuple[Array, Array]] = {}
        # statistics of each batch: mean, u, low, high of each output, and the outputs' covariance
        self.statistics: list[Array] = []
        self.covariances: list[Array] = []
        self._blocks = self.answers()
        self._rest: list[Outputs] = []

    def answers(self) -> Iterator[Outputs]:
        for block in range(MOST_DRAWS // BLOCK):
            yield self.model(drawn_block(self.model.inputs, self.drawing.seed, block))

    def __len__(self) -> int:
        return len(self.statistics)

    def draw_to(self, count: int) -> None:
        """Draw until there are `count` batches."""
        if not self.sketches:
            first = next(self._blocks)
            p = self.drawing.probability
            self.sketches = {name: Sketch.empty_like(values, p) for name, values in first.items()}
            self.ends = {name: _ends(values, (1 - p) / 2) for name, values in first.items()}
            self._rest = _parts(first)
        while len(self) < count:
            self.drawing.progress("draws", len(self) * BATCH, count * BATCH)
            if not self._rest:
                self._rest = _parts(next(self._blocks))
            self._take(self._rest.pop(0))

    def _take(self, answers: Outputs) -> None:
        tail = (1 - self.drawing.probability) / 2
        rows = []
        for k, (name, values) in enumerate(answers.items()):
            self.sketches[name].add(values)
            deviation = max(values.max() - values.mean(), values.mean() - values.min())
            self.largest[k] = max(self.largest[k], deviation**2)
            (low, high), slope = self.ends[name]
            # the error of a quantile follows from that of the distribution function there
            # (Bahadur), without sorting
            error = np.array([np.mean(values <= low) - tail, np.mean(values <= high) - 1 + tail])
            rows.append([values.mean(), values.std(ddof=1), *([low, high] - error * slope)])
        self.statistics.append(np.array(rows))
        if len(rows) > 1:
            self.covariances.append(np.cov(np.stack(list(answers.values()))))

    @property
    def mean(self) -> Array:
        return np.asarray(np.mean([each[:, 0] for each in self.statistics], axis=0))

    @property
    def u(self) -> Array:
        """Standard deviation of all draws, (output,)."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance())))

    @property
    def largest_share(self) -> Array:
        """Share of the largest draw in the variance of each output, (output,)."""
        total = len(self) * BATCH * self.u**2
        return np.asarray(np.divide(self.largest, total, out=0 * total, where=total > 0))

    @property
    def infinite(self) -> Mask:
        """Whether mean and variance of each output do not exist or do not settle, (output,)."""
        return np.asarray(self.no_variance | (self.largest_share > LARGEST_SHARE))

    def covariance(self) -> Array:
        """Return the covariance of the outputs, (n, n), averaged over the batches."""
        if self.covariances:
            return np.asarray(np.mean(self.covariances, axis=0))
        return np.diag(np.mean(np.array(self.statistics)[:, :, 1] ** 2, axis=0))

    def standard_errors(self) -> Array:
        """Return standard errors of mean, u, low and high of each output, (output, 4)."""
        return np.asarray(np.std(self.statistics, axis=0, ddof=1) / sqrt(len(self)))


def tolerance(u: float, digits: int) -> float:
    """Return half a unit of the last significant digit of `u`, in its unit (JCGM 101, 7.9.2).

    `digits` is the number of significant digits. The result is inf if `u` is 0, inf or NaN.
    """
    return float(0.5 * 10.0 ** (floor(log10(u)) - digits + 1)) if 0 < u < inf else inf


def _goals(batches: Batches) -> Array:
    """Return the tolerances of mean, u and both ends of the interval, (output, 4).

    Those of mean and u are inf if u is infinite. To judge the first order, they are a fifth of
    those of its u, where this is the smaller one, but not below half the u of the draws.
    """
    means, u, infinite = np.mean(batches.statistics, axis=0), batches.u, batches.infinite
    share = np.where(batches.drawing.validate & ~infinite, 5, 1)
    u = np.where(share > 1, np.clip(batches.linear_u, u / 2, u), u)
    size = np.where(infinite, (means[:, 3] - means[:, 2]) / 4, u)
    goals = np.array([tolerance(each, batches.drawing.digits) for each in size]) / share
    by_number = np.repeat(goals[:, None], 4, axis=1)
    by_number[infinite, :2] = inf
    rounding = LAST_BITS * np.abs(means[:, 2:]).max(axis=1, keepdims=True)
    return np.asarray(np.maximum(by_number, rounding))


def stein(batches: Batches) -> Array:
    """Add draws to `batches` in two stages, and return the tolerances of the results, (output, 4).

    The second axis is mean, u and the two ends of the interval, in the unit of the output. The
    scatter of the first stage determines the number of draws in the second stage (Stein 1945; for
    JCGM 101 by Wübbeler et al., Metrologia 47, 2010, 317). With a probability of 95 %, the errors
    of all these numbers are then within their tolerances (Bonferroni). If u is infinite,
    the tolerances of mean and u are inf. Raises `InputError` if too many draws are needed.
    """
    from scipy.special import stdtrit

    batches.draw_to(FIRST_STAGE)
    goals, errors = _goals(batches), batches.standard_errors()
    bound = goals < inf
    if bound.any():
        factor = stdtrit(FIRST_STAGE - 1, 1 - (1 - CONFIDENCE) / 2 / bound.sum())
        needed = FIRST_STAGE * float(np.max((factor * errors / goals)[bound])) ** 2
        if not needed * BATCH < MOST_DRAWS:
            allowed = "allowed: fewer digits, or a fixed number of draws"
            raise InputError("", "digits", f"{needed * BATCH:.2g} draws needed", allowed)
        batches.draw_to(ceil(needed))
    return goals


def standard_rule(batches: Batches) -> Array:
    """Make draws by the rule of JCGM 101, 7.9.4, and return the tolerances, (output, 4).

    The second axis is mean, u and the two ends of the interval, in the unit of the output.
    `batches` makes the draws. They end when twice the standard error of each of these four results
    is at most its tolerance, or at `MOST_DRAWS` draws. If u is infinite, the tolerances of
    mean and u are inf.
    """
    batches.draw_to(2)
    while len(batches) * BATCH < MOST_DRAWS:
        goals = _goals(batches)
        if np.all(2 * batches.standard_errors() <= goals):
            break
        batches.draw_to(len(batches) + 1)
    return goals


RULES: dict[str, Callable[[Batches], Array]] = {"stein": stein, "7.9": standard_rule}


def monte_carlo(model: Model, linear: Propagated, drawing: Drawing) -> Propagated:
    """Return value, u and intervals of a model's outputs from random draws (JCGM 101).

    Each output also has a verdict on the first-order result `linear`: whether it is valid.
    `drawing` states the number of draws, or the rule for it. If an input has at most 2 degrees of
    freedom, or if a single draw causes more than 15 % of the variance, u is inf and the value is
    the median. Raises `InputError` if correlated inputs cannot be drawn, or if too many draws are
    needed.
    """
    _require_drawable(model.inputs)
    few = min(_draw_dof(model.inputs), default=inf)
    linear_u = np.array([outcome.u for outcome in linear.outcomes.values()])
    batches = Batches(model, drawing, linear_u, no_variance=few <= 2)
    goals = None
    if drawing.draws is None:
        goals = RULES[drawing.rule](batches)
    else:
        batches.draw_to(max(2, ceil(drawing.draws / BATCH)))
    infinite, notes = batches.infinite, _draw_notes(few, drawing)
    errors, tail = batches.standard_errors(), (1 - drawing.probability) / 2
    outcomes = {}
    for k, (name, outcome) in enumerate(linear.outcomes.items()):
        below, edges = batches.sketches[name].distribution()
        low, middle, high = map(float, np.interp([tail, 0.5, 1 - tail], below, edges))
        value = middle if infinite[k] else float(batches.mean[k])
        u = inf if infinite[k] else without_rounding(float(batches.u[k]), value)
        if infinite[k] and not batches.no_variance:
            notes += (WITHOUT_VARIANCE.format(name, batches.largest_share[k]),)
        accuracy = 2 * float(np.max(errors[k, 2:]))
        if goals is not None and drawing.rule == "stein":  # this rule meets its goals at 95 %
            accuracy = min(accuracy, float(np.max(goals[k, 2:])))
        outcomes[name] = replace(
            outcome,
            value=value,
            u=u,
            dof=inf,
            interval=(low, high),
            shift=value - outcome.value,
            shortest=shortest_interval(below, edges, drawing.probability),
            convergence=Convergence(
                draws=len(batches) * BATCH,
                standard_errors=tuple(map(float, errors[k])),
                tolerance=None if goals is None else float(goals[k].min()),
            ),
            verdict=_verdict(outcome, (low, high), accuracy, drawing.digits)
            if min(u, outcome.u) > 0 and u < inf
            else "first order not validated, because u is 0 or infinite",
        )
    return replace(
        linear,
        method=MONTE_CARLO,
        outcomes=outcomes,
        correlation=None if infinite.any() else correlation_of(batches.covariance()),
        region=None if infinite.any() or len(outcomes) == 1 else _region(model, batches),
        notes=linear.notes + notes,
    )


def _require_drawable(inputs: Inputs) -> None:
    for joint in inputs.joints:
        if joint.drawn:
            allowed = (
                "draws of correlated inputs need normal distributions, or t distributions with "
                "equal ν (JCGM 101, 6.4.8)"
            )
            raise InputError("correlations", "inputs", joint.drawn, allowed)


def _draw_dof(inputs: Inputs) -> Iterator[float]:
    joined = inputs.correlated_names
    yield from (joint.draw_dof for joint in inputs.joints)
    for name, source in inputs.sources.items():
        if name not in joined and source.law is LAWS["t"]:
            yield source.shape


def _draw_notes(few: float, drawing: Drawing) -> tuple[str, ...]:
    note = f"draws: {drawing.rule if drawing.draws is None else 'a fixed number'}"
    if few <= 2:
        return (
            f"{note}; an input has only ν = {few:g} degrees of freedom, so u is infinite and the "
            "value is the median",
        )
    return (note,)


def _ends(values: Array, tail: float) -> tuple[Array, Array]:
    """Return the quantiles of both tails of a block, and the slopes of the quantile function."""
    q = np.array([[tail / 2, tail, tail * 3 / 2], [1 - tail * 3 / 2, 1 - tail, 1 - tail / 2]])
    quantiles = np.quantile(values, q)
    return quantiles[:, 1], (quantiles[:, 2] - quantiles[:, 0]) / tail


def _parts(answers: Outputs) -> list[Outputs]:
    return [
        {name: values[at : at + BATCH] for name, values in answers.items()}
        for at in range(0, BLOCK, BATCH)
    ]


def _verdict(linear: Outcome, ends: tuple[float, float], accuracy: float, digits: int) -> str:
    """Return a sentence on whether the first-order interval agrees with the draws (clause 8).

    `accuracy` is the 95 % accuracy of the `ends` of the interval of the draws [unit of the output].
    The tolerance follows from the u of first order: rare draws may increase that of the draws
    without limit.
    """
    limit = tolerance(linear.u, digits)
    low, high = (abs(a - b) for a, b in zip(linear.interval, ends, strict=True))
    if accuracy > limit / 5 and max(low, high) - accuracy < limit:
        return (
            f"first order not judged: the ends of the interval of the draws are accurate to "
            f"{accuracy:.1g}, but clause 8 requires {limit / 5:.1g}; use validate=True"
        )
    verdict = "validated" if max(low, high) <= limit else "not validated"
    return (
        f"first order {verdict}: the ends of the interval differ by {low:.2g} and {high:.2g}, "
        f"allowed {limit:.1g}"
    )


def _region(model: Model, batches: Batches) -> Region:
    """Repeat the draws, and return the coverage regions of all outputs (JCGM 102, 7.7)."""
    drawing, mean, covariance = batches.drawing, batches.mean, batches.covariance()
    inverse = np.linalg.pinv(covariance, hermitian=True)
    u = np.where(batches.u > 0, batches.u, inf)
    sketches: list[Sketch] = []
    remaining = len(batches)
    for answers in batches.answers():
        away = np.stack(list(answers.values()))[:, : remaining * BATCH] - mean[:, None]
        both = (
            np.sqrt(np.einsum("ik,ij,jk->k", away, inverse, away)),
            np.max(np.abs(away) / u[:, None], axis=0),
        )
        sketches = sketches or [Sketch.empty_like(each, drawing.probability) for each in both]
        for sketch, each in zip(sketches, both, strict=True):
            sketch.add(each)
        remaining -= BLOCK // BATCH
        if remaining <= 0:
            break
    ellipsoid, box = (
        float(np.interp(drawing.probability, *each.distribution())) for each in sketches
    )
    return Region(mean=mean, covariance=covariance, ellipsoid=ellipsoid, box=box)
