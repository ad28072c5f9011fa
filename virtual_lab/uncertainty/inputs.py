"""Inputs of a model: the form in which a user states them, and the sources behind them.

An input is a number with its standard uncertainty and distribution. An input `by` groups is an
array with one number per observation, and observations of the same group have the same error.
Correlated inputs form a block, which is a linear map of independent sources.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, nan, sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.errors import InputError, nearest
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.uncertainty.laws import LAWS, Law, inexactness
from virtual_lab.units import Array

Correlations = Mapping[tuple[str, str], float]
InputName = str | tuple[str, ...]
TOGETHER = "observed together"
LARGEST = 1e150  # size of a number whose square is still finite


@dataclass(frozen=True, slots=True)
class Input:
    """An input of a model: value and u, or limits.

    Parameters
    ----------
    value, u
        Best estimate and its standard uncertainty. The value may be an array (n,) of an input
        `by` groups.
    dof
        Degrees of freedom ν of u. If they are finite, a normal distribution becomes a t, and limits
        become inexact by half their distance over √(2 ν).
    distribution
        ``normal``, ``t``, ``uniform``, ``triangular``, ``arcsine`` or ``trapezoid``. A trapezoid is
        uniform between limits that are only known within ± `inexact` (JCGM 101, 6.4.3). By default
        the distribution is normal or t for a value and u, uniform for limits, and a trapezoid for
        inexact limits.
    low, high
        Limits, instead of value and u.
    inexact
        Half width of either limit, at most half their distance.
    by
        Labels (n,) of n observations: all observations with the same label have the same error.
        Several rows of labels are nested: with ``by=(days, balls)`` each ball has a separate error
        on each day. State crossed groups as two inputs.
    evaluation
        ``A`` if u comes from the scatter of readings, otherwise ``B``. It is shown in the budget.
    """

    value: ArrayLike | None = None
    u: float | None = None
    dof: float = inf
    distribution: str = ""
    low: float | None = None
    high: float | None = None
    inexact: float = 0.0
    by: Sequence[Any] = ()
    evaluation: Literal["A", "B"] = "B"


@dataclass(frozen=True, slots=True)
class InputSource:
    """A source of uncertainty behind an input: a number with its distribution."""

    estimate: Estimate
    law: Law
    scale: float
    shape: float = nan

    @property
    def kurtosis(self) -> float:
        return self.law.kurtosis(self.shape)


@dataclass(frozen=True, slots=True)
class Joint:
    """Correlated sources: their errors are the matrix `factor` times independent errors with u = 1.

    For readings that were taken together, draws need another factor than the law of propagation,
    because their joint t distribution has fewer degrees of freedom (JCGM 102, 5.3.2).
    """

    names: tuple[str, ...]
    factor: Array
    dof: float
    draw_factor: Array
    draw_dof: float
    drawn: str = ""  # names of these inputs if they cannot be drawn, otherwise empty


@dataclass(frozen=True, slots=True)
class Inputs:
    """All sources of a model keyed by name, and the map from sources to the model's arguments."""

    sources: Mapping[str, InputSource]
    joints: tuple[Joint, ...]
    certain: Mapping[str, float]
    groups: Mapping[str, tuple[Array, tuple[str, ...], NDArray[np.int_]]]  # base, sources, which

    def arguments(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Return the model's arguments, (k,) or (k, n), from columns (k,) of sources."""
        k = next(iter(columns.values())).size if columns else 1
        values = {name: np.full(k, value) for name, value in self.certain.items()}
        apart = {part for _, parts, _ in self.groups.values() for part in parts}
        values |= {name: column for name, column in columns.items() if name not in apart}
        for name, (base, parts, which) in self.groups.items():
            values[name] = base + np.stack([columns[part] for part in parts], axis=1)[:, which]
        return values

    @property
    def correlated_names(self) -> set[str]:
        """Names of the correlated sources."""
        return {name for joint in self.joints for name in joint.names}


def read_inputs(entries: Mapping[InputName, Any], correlations: Correlations) -> Inputs:
    """Return the inputs of a model in the form that the methods of propagation need.

    Raises `InputError` for an input or a correlation that cannot be used. The message has its name.

    Parameters
    ----------
    entries
        Inputs, keyed by name. An entry is an `Input`, an `Estimate`, a number without uncertainty,
        or an array of readings (n,). The mean of the readings is used. Its standard uncertainty is
        computed from their scatter (type A). Several inputs may have been read together. In this
        case the key is a tuple of m names, and the entry is an array of readings (n, m).
    correlations
        Correlation coefficients of pairs of inputs, keyed by the two names. All other coefficients
        are 0.
    """
    if not isinstance(entries, Mapping) or not entries:
        raise InputError("", "inputs", entries, "allowed: names and inputs, {'d': vl.Input(…)}")
    sources: dict[str, InputSource] = {}
    certain: dict[str, float] = {}
    groups: dict[str, tuple[Array, tuple[str, ...], NDArray[np.int_]]] = {}
    joints: list[Joint] = []
    for key, entry in entries.items():
        if isinstance(key, tuple):
            together, joint = _together(key, entry)
            sources |= together
            joints.append(joint)
            continue
        read = _input(key, entry)
        if len(read.by):
            groups[key], parts = _group_observations(key, read)
            sources |= parts
        elif isinstance(source := _source(key, read), float):
            certain[key] = source
        else:
            sources[key] = source
    _require_once([*sources, *certain])
    joints += _correlate(sources, correlations, {each for joint in joints for each in joint.names})
    return Inputs(sources, tuple(joints), certain, groups)


def _input(name: str, entry: Any) -> Input:
    if isinstance(entry, Input):
        return entry
    if isinstance(entry, Estimate):
        return Input(entry.value, entry.u, entry.dof, evaluation=entry.evaluation)
    readings = _numbers(name, entry)
    if readings.ndim == 0:
        return Input(float(readings), 0.0)
    mean, u = _readings(name, readings)
    return Input(mean, u, readings.size - 1.0, "t", evaluation="A")


def _numbers(name: str, entry: Any) -> Array:
    try:
        return np.asarray(entry, float)
    except (TypeError, ValueError) as fault:
        allowed = "allowed: vl.Input, a number, or readings"
        raise InputError(name, "input", entry, allowed) from fault


def _readings(name: str, readings: Array) -> tuple[float, float]:
    """Return the mean of readings (n,) and its standard uncertainty."""
    if readings.ndim != 1 or readings.size < 2 or not (np.abs(readings) < LARGEST).all():
        allowed = f"allowed: a list of at least 2 numbers with magnitudes below {LARGEST:g}"
        raise InputError(name, "readings", readings, allowed)
    if np.ptp(readings) == 0:
        allowed = "all are equal, so their scatter is unknown; use vl.Input(value, u) with the u "
        raise InputError(name, "readings", readings[0], allowed + "of the resolution, step/√12")
    return float(readings.mean()), float(readings.std(ddof=1) / sqrt(readings.size))


def source_of(name: str, entry: Input) -> InputSource:
    """Return value, u and distribution of an input.

    `name` is the name of the input in error messages. Raises `InputError` if `entry` is not an
    `Input`, is not valid, or has no uncertainty.
    """
    if not isinstance(entry, Input):
        raise InputError("", name, entry, "allowed: vl.Input(…)")
    source = _source(name, entry)
    if isinstance(source, float):
        raise InputError(name, "u", entry.u, "allowed: above 0")
    return source


def _source(name: str, entry: Input) -> InputSource | float:
    """Return the source of an input, or its value if it has no uncertainty."""

    def refuse(key: str, value: object, allowed: str) -> InputError:
        return InputError(name, key, value, f"allowed: {allowed}")

    def number(key: str) -> float:
        value = getattr(entry, key)
        try:
            converted = float(value)
        except (TypeError, ValueError) as fault:
            raise refuse(key, value, "a number") from fault
        if not abs(converted) < LARGEST:
            raise refuse(key, value, f"a number with a magnitude below {LARGEST:g}")
        return converted

    if not isinstance(entry.dof, int | float | np.number) or not entry.dof > 0:
        raise refuse("dof", entry.dof, "above 0")
    limits = entry.low is not None or entry.high is not None
    if limits and ((entry.value, entry.u) != (None, None) or None in (entry.low, entry.high)):
        raise refuse("limits", (entry.low, entry.high), "either low and high, or value and u")
    kind = entry.distribution or (
        ("trapezoid" if entry.inexact else "uniform")
        if limits
        else ("normal" if entry.dof == inf else "t")
    )
    if kind not in LAWS:
        raise refuse("distribution", kind, f"{nearest(kind, LAWS)}{', '.join(LAWS)}")
    if (entry.inexact != 0) != (kind == "trapezoid"):
        raise refuse("inexact", entry.inexact, "a number above 0, only for a trapezoid")
    if kind == "t" and entry.dof == inf:
        raise refuse("dof", entry.dof, "a finite number for a t; use distribution='normal'")
    if limits:
        if not LAWS[kind].limited:
            raise refuse("distribution", kind, "value and u instead of limits")
        low, high = number("low"), number("high")
        if not low < high:
            raise refuse("high", high, f"larger than low = {low}")
        value, half = (low + high) / 2, (high - low) / 2
    else:
        if entry.value is not None and np.ndim(entry.value) > 0:
            raise refuse("value", entry.value, "a number; an array needs by=labels")
        value, u = number("value"), number("u") if entry.u is not None else 0.0
        if u < 0:
            raise refuse("u", u, "at least 0")
        if u == 0:
            return value
        half = u / LAWS[kind].u(0.0)
    return _scale_law(value, half, kind, entry, refuse)


def _scale_law(value: float, half: float, kind: str, entry: Input, refuse: Any) -> InputSource:
    """Return a source with a distribution of given scale; finite `dof` make its limits inexact."""
    dof, shape = entry.dof, nan
    if kind == "trapezoid":
        if not 0 < entry.inexact <= half * (1 + 1e-12):
            raise refuse("inexact", entry.inexact, f"above 0, up to half the distance, {half}")
        shape = entry.inexact / half
    elif kind == "t":
        shape = dof
    u = half * LAWS[kind].u(shape)
    if kind == "uniform" and dof < inf:
        kind, shape = "trapezoid", inexactness(dof)
        if shape > 1:
            raise refuse("dof", dof, "at least 0.5 if limits are given")
    estimate = Estimate(value=value, u=u, dof=dof, evaluation=entry.evaluation)
    return InputSource(estimate, LAWS[kind], half, shape)


def _group_observations(
    name: str, entry: Input
) -> tuple[tuple[Array, tuple[str, ...], NDArray[np.int_]], dict[str, InputSource]]:
    """Return the values of an input with groups, and its sources keyed by name.

    The values are a tuple: value of each observation, names of the sources, and index of the source
    of each observation.
    """
    nested = isinstance(next(iter(entry.by)), list | tuple | np.ndarray)
    rows = entry.by if nested else (entry.by,)
    lengths = {len(row) for row in rows}
    if len(lengths) != 1:
        raise InputError(name, "by", sorted(lengths), "allowed: rows of labels of equal length")
    labels = list(zip(*rows, strict=True))
    order = {label: at for at, label in enumerate(dict.fromkeys(labels))}
    base = np.zeros(len(labels))
    if entry.value is not None:
        try:
            base = base + np.asarray(entry.value, float)
        except (TypeError, ValueError) as fault:
            allowed = f"allowed: a number, or {len(labels)} numbers, one per label"
            raise InputError(name, "value", entry.value, allowed) from fault
    # The base holds the values, and the sources hold their errors.
    source = source_of(name, replace(entry, value=None if entry.low is not None else 0.0))
    parts = tuple(f"{name}[{'/'.join(map(str, label))}]" for label in order)
    pooled = replace(source, estimate=replace(source.estimate, pool=name))
    which = np.array([order[label] for label in labels])
    return (base, parts, which), dict.fromkeys(parts, pooled)


def _require_once(names: Sequence[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError("inputs", "name", twice[0], "is given twice")


def _together(names: tuple[str, ...], entry: Any) -> tuple[dict[str, InputSource], Joint]:
    """Return the sources and the correlated block of readings (n, m) that were taken together."""
    where = ", ".join(names)
    readings = _numbers(where, entry)
    if readings.ndim != 2 or readings.shape[1] != len(names) or len(names) < 2:
        allowed = f"allowed: one column for each of at least two inputs, (n, {len(names)})"
        raise InputError(where, "readings", f"shape {readings.shape}", allowed)
    n, m = readings.shape
    if n <= m:
        raise InputError(where, "readings", n, f"allowed: more than {m}, the number of inputs")
    sources = {}
    for name, column in zip(names, readings.T, strict=True):
        mean, u = _readings(name, column)
        estimate = Estimate(value=mean, u=u, dof=n - 1.0, evaluation="A", source=TOGETHER)
        sources[name] = InputSource(estimate, LAWS["t"], u, n - 1.0)
    scatter = np.cov(readings.T) / n
    factor = _factor(names, scatter)
    return sources, Joint(names, factor, n - 1.0, factor * sqrt((n - 1) / (n - m)), float(n - m))


def _correlate(
    sources: Mapping[str, InputSource], correlations: Correlations, joint_names: set[str]
) -> list[Joint]:
    """Return one block per set of inputs that are connected by correlations."""
    blocks: list[set[str]] = []
    if not isinstance(correlations, Mapping):
        raise InputError("", "correlations", correlations, "allowed: {('a', 'b'): 0.5}")
    for pair, r in correlations.items():
        for name in pair if isinstance(pair, tuple) and len(pair) == 2 else (pair,):
            if name not in sources or len(pair) != 2 or pair[0] == pair[1]:
                allowed = f"{nearest(name, sources)}allowed: two of {', '.join(sources)}"
                raise InputError("correlations", "pair", pair, allowed)
            if name in joint_names:
                allowed = "allowed: inputs that were not observed together"
                raise InputError("correlations", "pair", pair, allowed)
        if pair[::-1] in correlations:
            raise InputError("correlations", " ".join(pair), r, "is given twice")
        if not isinstance(r, int | float | np.floating) or not -1 <= r <= 1:
            raise InputError("correlations", " ".join(pair), r, "allowed: -1 to 1")
        bound = [block for block in blocks if block & set(pair)]
        blocks = [block for block in blocks if block not in bound]
        blocks.append(set(pair).union(*bound))
    return [_joint(sources, correlations, sorted(block)) for block in blocks]


def _joint(
    sources: Mapping[str, InputSource], correlations: Correlations, block: list[str]
) -> Joint:
    members = [sources[name] for name in block]
    u = np.array([each.estimate.u for each in members])
    matrix = np.eye(len(block))
    for (first, second), r in correlations.items():
        if first in block:
            i, j = block.index(first), block.index(second)
            matrix[i, j] = matrix[j, i] = r
    dofs = {each.estimate.dof for each in members}
    shapes = {(each.law, each.shape if each.law is LAWS["t"] else inf) for each in members}
    law, _ = next(iter(shapes))
    drawn = "" if len(shapes) == 1 and not law.limited else ", ".join(block)
    factor = _factor(tuple(block), matrix * np.outer(u, u))
    # effective degrees of freedom are not defined for correlated terms; the smallest is safe
    dof = min(dofs)
    return Joint(tuple(block), factor, dof, factor, dof if law is LAWS["t"] else inf, drawn)


def _factor(names: tuple[str, ...], covariance: Array) -> Array:
    """Return a matrix F with F Fᵀ equal to the covariance.

    Raises `InputError` if the covariance is impossible, that is, not positive semidefinite.
    """
    u = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(u, u))
    if values[0] < -1e-12:
        worst = np.argsort(-np.abs(vectors[:, 0]))[:2]
        pair = " and ".join(names[at] for at in sorted(worst))
        allowed = f"the matrix has the negative eigenvalue {values[0]:.3g}, mainly caused by {pair}"
        raise InputError("correlations", ", ".join(names), None, allowed)
    return np.asarray(u[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
