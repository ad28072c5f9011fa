"""Decisions on conformity and their risks (JCGM 106), each number with its definition.

An item conforms if its true value Y is within the tolerance limits. It is accepted if its measured
value y, with standard uncertainty u, is within the acceptance limits. A guard band w moves the
acceptance limits inward from the tolerance limits, or outward if w < 0. One limit may be missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.parameters import Certain
from virtual_lab.uncertainty.budget import coverage_factors
from virtual_lab.uncertainty.inputs import Input, InputSource, source_of
from virtual_lab.uncertainty.laws import LAWS
from virtual_lab.units import Array

TURN = np.array([-8, -4, -2, -1, 0, 1, 2, 4, 8])  # panel limits about an acceptance limit [u]
TAILS = np.array([0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-2])
CONSUMER = "P(accepted and not conforming): joint, of all items"
PRODUCER = "P(rejected and conforming): joint, of all items"
CONSUMER_GIVEN = "P(not conforming | accepted): conditional, of accepted items"
PRODUCER_GIVEN = "P(rejected | conforming): conditional, of conforming items"


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Limits within which a value conforms, or is accepted."""

    lower: float = -inf
    upper: float = inf

    @classmethod
    def read(cls, lower: float | None, upper: float | None) -> Tolerance:
        """Return the limits. Raises `InputError` if both are None, or for a wrong order."""
        tolerance = cls(-inf if lower is None else lower, inf if upper is None else upper)
        if lower is None and upper is None:
            raise InputError("", "limits", None, "allowed: lower, upper, or both")
        if not tolerance.lower < tolerance.upper:
            raise InputError("", "upper", upper, f"allowed: larger than lower = {lower}")
        return tolerance

    def guard(self, w: float) -> Tolerance:
        """Return the acceptance limits. Raises `InputError` if nothing remains between them."""
        if not isfinite(w):
            raise InputError("", "guard band", w, "allowed: a finite number")
        tolerance = Tolerance(self.lower + w, self.upper - w)
        if not tolerance.lower < tolerance.upper:
            most = (self.upper - self.lower) / 2
            raise InputError("", "guard band", w, f"allowed: less than half the tolerance, {most}")
        return tolerance

    def chance(self, y: Array, u: float, dof: float) -> Array:
        """Return the probability that a true value is within the limits, in the shape of `y`.

        The true value is distributed about `y` with the standard uncertainty `u`, by Student's t
        with `dof` degrees of freedom.
        """
        from scipy.special import stdtr

        nu = min(dof, 1e12)
        return np.asarray(stdtr(nu, (self.upper - y) / u) - stdtr(nu, (self.lower - y) / u))


class Conformity(float):
    """Probability that an item conforms: a number that prints its meaning."""

    def __repr__(self) -> str:
        return f"{float(self):.6f}  P(conforming): the true value of this item is within the limits"

    __str__ = __repr__


class GuardBand(NamedTuple):
    """Guard band and acceptance limits: three numbers that print their meaning."""

    width: float
    lower: float
    upper: float

    def __repr__(self) -> str:
        return f"guard band {self.width:.6g}; accepted within ({self.lower:.6g}, {self.upper:.6g})"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Risks:
    """Global risks of a decision rule, for all items that a process makes."""

    prior: str  # description of the process
    acceptance: tuple[float, float]
    consumer: float
    producer: float
    consumer_given_accepted: float
    producer_given_conforming: float

    def __repr__(self) -> str:
        rows = (
            (self.consumer, f"consumer's risk, {CONSUMER}"),
            (self.producer, f"producer's risk, {PRODUCER}"),
            (self.consumer_given_accepted, f"consumer's risk, {CONSUMER_GIVEN}"),
            (self.producer_given_conforming, f"producer's risk, {PRODUCER_GIVEN}"),
        )
        lines = [f"{value:.6f}  {words}" for value, words in rows]
        return "\n".join([f"prior: {self.prior}; accepted within {self.acceptance}", *lines])


def conformity(
    value: Certain,
    u: Certain,
    *,
    lower: Certain | None = None,
    upper: Certain | None = None,
    dof: Certain = inf,
) -> Conformity:
    """Return the probability, 0 to 1, that the true value of an item is within the limits.

    The true value has a normal distribution about the measured value, or Student's t if `dof` is
    finite (JCGM 106, clause 7). The specific consumer's risk of an accepted item is one minus this
    probability. The specific producer's risk of a rejected item is this probability.

    Parameters
    ----------
    value, u, dof
        Measured value, its standard uncertainty, and the degrees of freedom of u.
    lower, upper
        Tolerance limits in the unit of `value`; at least one of them.

    Raises
    ------
    InputError
        `value` or `u` is not finite, `u` or `dof` is not above 0, there is no limit, or the limits
        are in the wrong order.
    """
    _require_u(u, dof)
    if not isfinite(value):
        raise InputError("", "value", value, "allowed: a finite number")
    return Conformity(Tolerance.read(lower, upper).chance(np.array(value), u, dof))


def global_risk(
    prior: Input,
    u: Certain,
    *,
    lower: Certain | None = None,
    upper: Certain | None = None,
    guard: Certain = 0.0,
    dof: Certain = inf,
) -> Risks:
    """Return the consumer's and the producer's risks over all items of a process (JCGM 106, 9).

    The risks are probabilities, 0 to 1. An item is accepted if its measured value is within the
    acceptance limits.

    Parameters
    ----------
    prior
        Distribution of the true values of the items before measurement, an `Input`.
    u, dof
        Standard uncertainty of a measured value, and its degrees of freedom.
    lower, upper
        Tolerance limits, in the unit of the prior; at least one of them.
    guard
        Width of the guard band at each limit, in the unit of the prior. A positive width moves the
        acceptance limits inward from the tolerance limits.

    Raises
    ------
    InputError
        The prior is not a valid `Input` with an uncertainty, `u` or `dof` is not above 0, `u` or
        `guard` is not finite, there is no limit, the limits are in the wrong order, or no value
        remains between the acceptance limits.
    """
    _require_u(u, dof)
    limits, source = Tolerance.read(lower, upper), source_of("prior", prior)
    return _risks(source, limits, limits.guard(guard), u, dof)


def guard_band(
    u: Certain,
    *,
    lower: Certain | None = None,
    upper: Certain | None = None,
    r: Certain | None = None,
    target: Certain | None = None,
    prior: Input | None = None,
    dof: Certain = inf,
) -> GuardBand:
    """Return the guard band w, the lower and the upper acceptance limit, in the unit of `u`.

    A positive w moves the acceptance limits inward from the tolerance limits. A limit that is not
    given is -inf or inf.

    Parameters
    ----------
    u, dof, lower, upper
        As for `risk`.
    r
        Multiple of the expanded uncertainty U: w = r U, where U = k u covers 95 % (k = 2 with
        infinite `dof`). r = 0 is simple acceptance, r = 1 is guarded acceptance, and r = -1 is
        guarded rejection.
    target
        Largest allowed consumer's risk, between 0 and 1, instead of `r`. With a `prior` it is the
        joint risk of all items. Without a `prior` it is the specific risk of an item whose measured
        value is at the acceptance limit. With one limit this equals the probability that an item
        whose true value is at the tolerance limit is accepted.
    prior
        As for `risk`.

    Raises
    ------
    InputError
        Both or neither of `r` and `target` are given, no guard band reaches the target, no value
        remains between the acceptance limits, or an argument is not allowed for `risk`.
    """
    from scipy.optimize import brentq

    _require_u(u, dof)
    limits = Tolerance.read(lower, upper)
    if (r is None) == (target is None):
        raise InputError("", "guard band", None, "allowed: either r or target")
    if r is not None:
        k = 2.0 if dof == inf else float(coverage_factors(np.array(dof)))
        w = r * k * u
    else:
        assert target is not None
        if not 0 < target < 1:
            raise InputError("", "target", target, "allowed: between 0 and 1")
        risk = partial(_risk_with, limits, u, dof, source_of("prior", prior) if prior else None)
        most = min((limits.upper - limits.lower) / 2 * (1 - 1e-9), 40 * u)
        reached = [risk(w) for w in (-40 * u, most)]
        if not reached[1] <= target <= reached[0]:
            allowed = (
                f"allowed: {reached[1]:.2g} to {reached[0]:.2g}, the range that a guard band covers"
            )
            raise InputError("", "target", target, allowed)
        w = float(brentq(lambda w: risk(w) - target, -40 * u, most, xtol=1e-12 * u))
    acceptance = limits.guard(w)
    return GuardBand(w, acceptance.lower, acceptance.upper)


def _risk_with(
    limits: Tolerance, u: float, dof: float, prior: InputSource | None, w: float
) -> float:
    """Return the consumer's risk with the guard band `w`.

    With a prior it is the joint risk of all items. Without a prior it is the specific risk of an
    item at the acceptance limit.
    """
    accepted = limits.guard(w)
    if prior:
        return _risks(prior, limits, accepted, u, dof).consumer
    # The risk is the same at both ends, by symmetry.
    end = accepted.upper if isfinite(accepted.upper) else accepted.lower
    return float(1 - limits.chance(np.array(end), u, dof))


def _risks(
    prior: InputSource, limits: Tolerance, accepted: Tolerance, u: float, dof: float
) -> Risks:
    """Return the risks by integrals over the quantiles of the prior.

    The rule is Gauss–Legendre in panels, which are finer near the acceptance limits and in the
    tails.
    """
    from scipy.optimize import bisect

    def item(q: Array | float) -> Array:
        x = prior.law.quantile(np.asarray(q, float), prior.shape)
        return prior.estimate.value + prior.scale * x

    def below(x: float) -> float:
        if not item(0.0) < x < item(1.0):
            return float(x >= item(1.0))
        return float(bisect(lambda q: float(item(q)) - x, 0.0, 1.0, xtol=1e-15))

    begin, end = below(limits.lower), below(limits.upper)
    turns = np.concatenate([[accepted.lower + k * u, accepted.upper + k * u] for k in TURN])
    steps = np.unique([*TAILS, *(1 - TAILS), begin, end, *map(below, turns)])
    nodes, weights = np.polynomial.legendre.leggauss(40)
    half = np.diff(steps)[:, None] / 2
    q = steps[:-1, None] + half * (1 + nodes)
    parts = (half * weights * accepted.chance(item(q), u, dof)).sum(axis=1)
    inside = (steps[:-1] >= begin) & (steps[:-1] < end)
    good, bad = float(parts[inside].sum()), float(parts[~inside].sum())
    conforming = end - begin
    law = next(name for name, each in LAWS.items() if each is prior.law)
    return Risks(
        prior=f"{law}, {prior.estimate.value:.6g} with u = {prior.estimate.u:.6g}",
        acceptance=(accepted.lower, accepted.upper),
        consumer=bad,
        producer=conforming - good,
        consumer_given_accepted=bad / (good + bad) if good + bad else 0.0,
        producer_given_conforming=(conforming - good) / conforming if conforming else 0.0,
    )


def _require_u(u: float, dof: float) -> None:
    if not (isfinite(u) and u > 0):
        raise InputError("", "u", u, "allowed: above 0, finite")
    if not dof > 0:
        raise InputError("", "dof", dof, "allowed: above 0")
