"""Effect on the metric and cost of every model in each part of the laboratory.

    python -m tests.benchmarks.laboratory LABORATORIES OUT.CSV [PART …]

The bat is a nominal r161, the procedure astm-f1881. The same numbered laboratories are certified
with every model of a part; the other parts are as for many laboratories (sums), or write full
records (gates and encoder). An effect is the mean over laboratories of the metric less that of the
finest model, over u. For the uncertainty, it is that of half the length of the interval; for the
camera, that of e_A of one filmed shot, over the camera's u. Expensive models get fewer
laboratories; the table states their number.
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from rigs.astm_pivot import AstmPivotStation
from virtual_lab.lab import Laboratory, RoundRobin, TestSetup, certify_block
from virtual_lab.lab.laboratory import collision_of
from virtual_lab.measurement.alternatives.refined import propagate_metric
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.instruments.light_gate import LightGates
from virtual_lab.simulation.stations.rig import MotionModel
from virtual_lab.studies import clips

BAT, PROCEDURE, SEED = "r161", "astm-f1881", 1
Numbers = np.ndarray
Found = tuple[Numbers, Numbers, float]  # metric and u of the laboratories, seconds per laboratory
FULL, SUMMED = RecordDetail.FULL, RecordDetail.SUMMED


def played(setup: TestSetup, laboratories: int) -> Found:
    """Return the results of numbered laboratories, in one block if all records are sums."""
    setup = replace(setup, seed=SEED)
    alone = setup.detail is FULL
    numbers: list[Any] = [*range(laboratories)] if alone else [np.arange(laboratories)]
    certify_block(replace(setup, number=0 if alone else np.arange(2)))  # compilation, fits
    begin = time.process_time()
    results = [certify_block(replace(setup, number=each)).certified for each in numbers]
    seconds = (time.process_time() - begin) / laboratories
    metric = [each.results["metric"] for each in results]
    value, u = (np.concatenate([getattr(m, key) for m in metric]) for key in ("value", "u"))
    sound = np.concatenate([~each.invalid for each in results])
    return np.where(sound, value, np.nan), np.where(sound, u, np.nan), seconds


def collisions(laboratories: int) -> Iterator[tuple[str, bool, Found]]:
    setup = RoundRobin.of(BAT, PROCEDURE).setup
    for rung in ("rigid", "surrogate", "modal", "reference"):
        variant = setup
        if rung != "surrogate":
            bat, ball, rules = setup.bat.spec, setup.ball.spec, setup.rules.spec
            variant = replace(setup, collision=collision_of(bat, ball, rules, rung))
        yield rung, rung == "surrogate", played(variant, laboratories)


def motions(laboratories: int) -> Iterator[tuple[str, bool, Found]]:
    setup = RoundRobin.of(BAT, PROCEDURE).setup
    for rung in MotionModel:
        yield (
            rung.value,
            rung is MotionModel.CLOSED_FORM,
            played(replace(setup, motion=rung), laboratories),
        )


def in_full() -> TestSetup:
    bat = RoundRobin.of(BAT, PROCEDURE).setup
    collision = collision_of(bat.bat.spec, bat.ball.spec, bat.rules.spec)
    return replace(bat, detail=FULL, collision=collision)


def gates(laboratories: int) -> Iterator[tuple[str, bool, Found]]:
    whole = LightGates.watch

    def summed(self: Any, *args: Any) -> Any:
        return whole(self, *args[:-1], SUMMED)

    with patch.object(LightGates, "watch", summed):
        yield "sums", True, played(in_full(), laboratories)
    yield "edges", False, played(in_full(), laboratories)


@contextmanager
def encoder_that_sums() -> Iterator[None]:
    """Make the encoder alone record summary values, while all other records are in full."""
    names = ("fire", "record_flights", "play")
    plan_at = {"fire": 0, "record_flights": 1, "play": 0}

    def changed(name: str) -> Callable[..., Any]:
        method, detail = getattr(AstmPivotStation, name), SUMMED if name == "play" else FULL

        def call(self: Any, *args: Any) -> Any:
            arguments = list(args)
            arguments[plan_at[name]] = replace(arguments[plan_at[name]], detail=detail)
            return method(self, *arguments)

        return call

    with ExitStack() as stack:
        for name, call in [(name, changed(name)) for name in names]:
            stack.enter_context(patch.object(AstmPivotStation, name, call))
        yield


def encoders(laboratories: int) -> Iterator[tuple[str, bool, Found]]:
    with encoder_that_sums():
        yield "sums", True, played(in_full(), laboratories)
    yield "counts", False, played(in_full(), laboratories)


def cameras(laboratories: int) -> Iterator[tuple[str, bool, Found]]:
    for rung, detail in (("error model", SUMMED), ("frames, tracked", FULL)):
        results, begin = [], time.process_time()
        for number in range(laboratories):
            setup = TestSetup.of(
                BAT, procedure="bbcor", rig="filmed-cannon", seed=SEED + number, detail=SUMMED
            )
            results.append(clips._clip(Laboratory.open(setup), detail)[-1])
        seconds = (time.process_time() - begin) / len(results)
        value, u, _ = np.array(results).T
        yield rung, detail is FULL, (value, u, seconds)


def uncertainties(laboratories: int) -> Iterator[tuple[str, bool, Found]]:
    setup = replace(RoundRobin.of(BAT, PROCEDURE).setup, seed=SEED)
    few = laboratories
    certify_block(replace(setup, number=np.arange(2)))  # compilation
    begin = time.process_time()
    block = certify_block(replace(setup, number=np.arange(few)))
    cost = (time.process_time() - begin) / few
    sound = np.flatnonzero(block.certified.sound).tolist()
    linear = [block.certified.results["metric"].row(at) for at in sound]
    u = np.array([each.u for each in linear])
    yield (
        "first order",
        True,
        (np.array([np.ptp(each.interval_95) / 2 for each in linear]), u, cost),
    )
    for rung, method, draws in (
        ("second order", "second-order", None),
        ("Monte Carlo", "monte-carlo", 2**17),
    ):
        begin, half = time.process_time(), []
        for at, each in zip(sound, linear, strict=True):
            certification, reduced = block.of(at).certification, block.certified.reduced.row(at)
            result = propagate_metric(
                method, reduced, certification.readings, certification.hit_weights, each, draws
            )
            half.append(np.ptp(result.interval) / 2)
        seconds = cost + (time.process_time() - begin) / few
        yield rung, False, (np.array(half), u, seconds)


PARTS: dict[str, Callable[[int], Iterator[tuple[str, bool, Found]]]] = {
    "collision": collisions,
    "motion": motions,
    "gates": gates,
    "encoder": encoders,
    "camera": cameras,
    "uncertainty": uncertainties,
}


def main(laboratories: str, path: str, *parts: str) -> None:
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file)
        out.writerow(["part", "rung", "shipped", "laboratories", "effect", "se", "rms", "ms"])
        for part in parts or PARTS:
            rungs = [*PARTS[part](int(laboratories))]
            finest, u, _ = rungs[-1][-1]
            for rung, shipped, (value, _, seconds) in rungs:
                off = ((value - finest) / u)[np.isfinite(value - finest)]
                se = float(off.std(ddof=1)) / sqrt(off.size)
                numbers = (f"{x:.3g}" for x in (off.mean(), se, sqrt(np.mean(off**2))))
                row = (part, rung, int(shipped), off.size, *numbers, f"{1e3 * seconds:.3g}")
                out.writerow(row)
                print(*row, flush=True)
            file.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
