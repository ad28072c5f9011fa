"""Propagation of uncertainty: speed and errors against other programs, tolerances, memory.

    python -m tests.benchmarks.uncertainty [PART …] [OUT.CSV]    the rows of the benchmark
    python -m tests.benchmarks.uncertainty methods [OUT.CSV]     the table of the chart

Other programs (uncertainties, GTC, metrolopy, suncal, OpenTURNS) take part if they are installed.
"""

from __future__ import annotations

import csv
import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import virtual_lab as vl
from tests.benchmarks.machine import processor_seconds
from tests.benchmarks.rows import Row, tell
from tests.uncertainty import models
from virtual_lab.lab import RoundRobin, certify_block, test_day
from virtual_lab.measurement import certification
from virtual_lab.uncertainty.inputs import read_inputs
from virtual_lab.uncertainty.models import Model
from virtual_lab.uncertainty.monte_carlo import BLOCK, Batches, Drawing, drawn_block

DRAWS, REFERENCE, SEEDS = 2**20, 2**27, 100
LABORATORIES = 1024  # laboratories per block
Numbers = tuple[float, float, float]  # u and both ends


def monte_carlo(model: Callable[..., Any], inputs: Any, **more: Any) -> Any:
    return vl.propagate(model, inputs, method="monte-carlo", **more)


def ours(result: Any) -> Numbers:
    return (result.u, *result.interval)


def linear() -> Iterator[Row]:
    """Yield times of the first order for eleven inputs, and of the second order for 11 and 43."""
    yield timed("first order: ours", lambda: vl.propagate(models.bpf, models.BPF))
    yield timed(
        "second order: ours", lambda: vl.propagate(models.bpf, models.BPF, method="second-order")
    )
    many = {f"x{k}": vl.Input(1 + k, 0.1) for k in range(43)}
    product = partial(vl.propagate, lambda **x: np.prod(list(x.values()), axis=0), many)
    yield timed("second order, 43 inputs, 903 pairs: ours", partial(product, method="second-order"))
    for name, peer in (("uncertainties", _uncertainties), ("GTC", _gtc), ("metrolopy", _metrolopy)):
        yield from _where_installed(name, "first order", lambda peer=peer: (peer(), None)[1])


def timed(what: str, work: Callable[[], Any]) -> Row:
    return Row(part="linear", what=what, value=1e6 * processor_seconds(work, 15), unit="us")


def stated(kind: Callable[..., Any], spread: Callable[..., Any]) -> dict[str, Any]:
    """Return the eleven inputs as objects of another program, by value, u and ν or by limits."""
    inputs = {}
    for name, each in models.BPF.items():
        if each.low is None:
            inputs[name] = kind(each.value, each.u, each.dof)
        else:
            middle, half = (each.low + each.high) / 2, (each.high - each.low) / 2
            inputs[name] = spread(middle, half, each.distribution or "uniform")
    return inputs


U = {"uniform": 3**-0.5, "triangular": 6**-0.5}


def _uncertainties() -> Any:
    from uncertainties import ufloat

    inputs = stated(lambda x, u, _: ufloat(x, u), lambda x, h, law: ufloat(x, h * U[law]))
    return models.bpf(**inputs)


def _gtc() -> Any:
    import GTC

    return models.bpf(**stated(GTC.ureal, lambda x, h, law: GTC.ureal(x, h * U[law])))


def _metrolopy() -> Any:
    from metrolopy import TriangularDist, UniformDist, gummy

    def spread(x: float, h: float, law: str) -> Any:
        if law == "triangular":
            return gummy(TriangularDist(mode=x, half_width=h))
        return gummy(UniformDist(center=x, half_width=h))

    return models.bpf(**stated(lambda x, u, dof: gummy(x, u=u, dof=dof), spread))


def by_metrolopy() -> Numbers:
    from metrolopy import gummy

    result = _metrolopy()
    result.p = 0.95
    gummy.simulate([result], n=DRAWS)
    return (result.usim, *result.cisim)


def by_suncal() -> Numbers:
    import suncal

    model = suncal.ModelCallable(models.bpf)

    def kind(x: float, u: float, dof: float) -> Any:
        return lambda one: one.measure(x).typeb(std=u, df=dof)

    def spread(x: float, h: float, law: str) -> Any:
        return lambda one: one.measure(x).typeb(dist=law, a=h)

    for name, set_one in stated(kind, spread).items():
        set_one(model.var(name))
    return ends(np.asarray(next(iter(model.monte_carlo(samples=DRAWS).samples.values()))))


def by_openturns() -> Numbers:
    import openturns as ot

    def kind(x: float, u: float, dof: float) -> Any:
        return ot.Student(dof, x, u) if np.isfinite(dof) else ot.Normal(x, u)

    def spread(x: float, h: float, law: str) -> Any:
        uniform = law == "uniform"
        return ot.Uniform(x - h, x + h) if uniform else ot.Triangular(x - h, x, x + h)

    joint = ot.JointDistribution(list(stated(kind, spread).values()))
    return ends(models.bpf(*np.asarray(joint.getSample(DRAWS)).T))


def by_numpy() -> Numbers:
    rng = np.random.default_rng(1)

    def kind(x: float, u: float, dof: float) -> Any:
        if np.isfinite(dof):
            return x + u * rng.standard_t(dof, DRAWS)
        return rng.normal(x, u, DRAWS)

    def spread(x: float, h: float, law: str) -> Any:
        if law == "uniform":
            return rng.uniform(x - h, x + h, DRAWS)
        return rng.triangular(x - h, x, x + h, DRAWS)

    return ends(models.bpf(**stated(kind, spread)))


def ends(y: Any) -> Numbers:
    low, high = np.quantile(y, [0.025, 0.975])
    return float(np.std(y, ddof=1)), float(low), float(high)


def budget() -> Iterator[Row]:
    """Yield the time of an astm-f1881 budget per laboratory of a block, the best of nine rounds."""
    arguments: list[Any] = []
    whole = certification.certify_reduction

    def kept(*args: Any) -> Any:
        arguments[:] = args
        return whole(*args)

    setup = RoundRobin.of("r161", "astm-f1881").setup
    with patch.object(test_day, "certify_reduction", kept):
        certify_block(replace(setup, seed=1, number=np.arange(LABORATORIES)))
    budgets, spent = certification._results, []

    def timed_one(*args: Any) -> Any:
        begin = time.process_time()
        result = budgets(*args)
        spent.append(time.process_time() - begin)
        return result

    rounds = []
    with patch.object(certification, "_results", timed_one):
        for _ in range(9):
            spent.clear()
            results = whole(*arguments).results
            rounds.append(sum(spent) / LABORATORIES)
    first = 1e6 * min(rounds)

    def means() -> list[Any]:
        return [each.value + each.components.shift.sum(axis=1) for each in results.values()]

    second = first + 1e6 * processor_seconds(means, 9) / LABORATORIES
    hits = "metric and five quantities of six hits"
    yield Row(part="budget", what="first order", value=first, unit="us", at_most=100, note=hits)
    yield Row(part="budget", what="second-order mean too", value=second, unit="us", at_most=120)


def draws() -> Iterator[Row]:
    """Yield the time of 2^20 draws, and the errors of u and both ends over u.

    The oracle is 2^27 other draws.
    """
    reference = np.array(ours(monte_carlo(models.bpf, models.BPF, draws=REFERENCE, seed=1)))

    def us() -> Numbers:
        return ours(monte_carlo(models.bpf, models.BPF, draws=DRAWS))

    plain, weighted = (processor_seconds(work, 7) for work in (by_numpy, us))
    yield _of_draws("plain numpy", by_numpy, reference, plain)
    yield _of_draws("ours", us, reference, weighted)
    yield Row(part="draws", what="ours over plain numpy", value=weighted / plain, at_most=1.2)
    for name, work in (
        ("metrolopy", by_metrolopy),
        ("suncal", by_suncal),
        ("openturns", by_openturns),
    ):
        yield from _where_installed(
            name, "draws", work, lambda work=work, name=name: _of_draws(name, work, reference)
        )


def _of_draws(name: str, work: Callable[[], Numbers], reference: Any, spent: float = 0.0) -> Row:
    errors = (np.array(work()) - reference) / reference[0]
    return Row(
        part="draws",
        what=f"2^20 draws of 11 inputs: {name}",
        value=spent or processor_seconds(work, 3),
        unit="s",
        note="errors over u: u {:+.4f}, low {:+.4f}, high {:+.4f}".format(*errors),
    )


def _where_installed(
    name: str, part: str, work: Callable[[], Any], row: Callable[[], Row] | None = None
) -> Iterator[Row]:
    try:
        work()
    except ImportError:
        yield Row(part=part, what=name, note="not installed")
        return
    yield row() if row else timed(f"{part}: {name}", work)


def tolerance() -> Iterator[Row]:
    """Yield the number of seeds, of 100, with value, u and both ends within the tolerance.

    The oracle is the exact result of a sum of normal numbers.
    """
    for u in (1.01, 2.5, 8.3):
        inputs = {name: vl.Input(0, u / 2) for name in "abcd"}
        exact = np.array([0, u, -1.959964 * u, 1.959964 * u])
        for rule, least in (("stein", 93), ("7.9", None)):
            met, used = 0, []
            for seed in range(SEEDS):
                one = monte_carlo(_sum, inputs, rule=rule, seed=seed)["result"]
                numbers = np.array([one.value, one.u, *one.interval])
                met += bool(np.all(np.abs(numbers - exact) <= 0.05))
                used.append(one.convergence.draws)
            yield Row(
                part="tolerance",
                what=f"all met, tolerance {0.05 / u:.3f} u: {rule}",
                value=met,
                unit=f"of {SEEDS}",
                at_least=least,
                note=f"{np.mean(used):.3g} draws",
            )


def _sum(a: Any, b: Any, c: Any, d: Any) -> Any:
    return a + b + c + d


def memory() -> Iterator[Row]:
    """Yield the growth of memory from 2e6 to 3e7 draws, and the error due to the sketch."""
    monte_carlo(models.bpf, models.BPF, draws=2 * DRAWS)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    monte_carlo(models.bpf, models.BPF, draws=30 * DRAWS)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    yield Row(part="memory", what="2e6 to 3e7 draws", value=grown, unit="MB", at_most=5.0)
    model = Model.try_out(models.bpf, read_inputs(models.BPF, {}))
    batches = Batches(model, Drawing(probability=0.95), np.ones(1), no_variance=False)
    count = 64
    batches.draw_to(4 * count)
    values = [model(drawn_block(model.inputs, 0, block))["result"] for block in range(count)]
    exact = np.quantile(np.concatenate(values), [0.025, 0.975])
    quantiles = np.interp([0.025, 0.975], *batches.sketches["result"].distribution())
    worst = float(np.max(np.abs(quantiles - exact)))
    yield Row(
        part="memory",
        what="sketch against sorting, over δ/5 of 2 digits",
        value=worst / 1e-5,
        at_most=0.1,
        note=f"{count * BLOCK:.2g} draws",
    )


CASES: dict[str, tuple[Callable[..., Any], Any]] = {
    "bat, 11 inputs": (models.bpf, models.BPF),
    "GUM H.1, end gauge": (models.end_gauge, models.END_GAUGE),
    "JCGM 101 9.3, mass": (models.mass, models.MASS),
    "JCGM 101 9.4, squares": (models.squares, models.SQUARES),
}


def methods(path: str) -> None:
    """Write the table of the chart: errors of u and both ends over u, and times, by method."""
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file)
        out.writerow(["model", "method", "draws", "ms", "u_error", "low_error", "high_error"])
        for name, (model, inputs) in CASES.items():
            reference = np.array(ours(monte_carlo(model, inputs, draws=REFERENCE, seed=1)))
            for method in ("first-order", "second-order"):
                work = partial(vl.propagate, model, inputs, method=method)
                errors = np.abs(np.array(ours(work())) - reference) / reference[0]
                out.writerow(
                    [name, method, "", f"{1e3 * processor_seconds(work, 9):.3g}"]
                    + [f"{error:.2e}" for error in errors]
                )
            for batches in (1, 8, 64, 512):
                work = partial(monte_carlo, model, inputs, draws=batches * BLOCK)
                results = [ours(work(seed=seed)) for seed in range(2, 2 + max(4, 64 // batches))]
                errors = np.sqrt(np.mean((np.array(results) - reference) ** 2, axis=0))
                spent = processor_seconds(work, 3 if batches < 100 else 1)
                out.writerow(
                    [name, "monte-carlo", batches * BLOCK, f"{1e3 * spent:.3g}"]
                    + [f"{error:.2e}" for error in errors / reference[0]]
                )
            file.flush()


PARTS = {
    "linear": linear,
    "budget": budget,
    "draws": draws,
    "tolerance": tolerance,
    "memory": memory,
}


def rows(*parts: str) -> Iterator[Row]:
    for part in parts or PARTS:
        yield from PARTS[part]()


if __name__ == "__main__":
    if sys.argv[1:2] == ["methods"]:
        methods(*sys.argv[2:])
    else:
        parts = [each for each in sys.argv[1:] if each in PARTS]
        paths = [each for each in sys.argv[1:] if each not in PARTS]
        tell("Propagation of uncertainty", rows(*parts), paths)
