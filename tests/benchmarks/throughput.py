"""Shots and certificates per second, by procedure: ``python -m tests.benchmarks.throughput``.

Shots: from true shots to records to the metric of each, in blocks on one core, first with
instruments that record only summary values, then with every edge and count. Certificates: whole
tests of a block of laboratories of a round robin, from their rigs to the verdicts, in units of the
time of one numpy normal number; one laboratory alone; one in full with an individual bat; and a
campaign by two processes. Times are processor times, which neighbors on a shared machine disturb
less than wall-clock times; that of the campaign is wall-clock time.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import virtual_lab as vl
from tests.benchmarks.machine import Work, processor_seconds
from tests.benchmarks.rows import Row, tell
from virtual_lab import catalog
from virtual_lab.lab import RoundRobin, certify_block, run_test
from virtual_lab.measurement.procedure import Curve, metric_of
from virtual_lab.measurement.reduction.observations import observe_balls, observe_impact
from virtual_lab.measurement.reduction.shot_algebra import (
    ShotResults,
    bat_properties,
    measured_balls,
    shot_results,
)
from virtual_lab.measurement.session_reduction import reduce_block
from virtual_lab.records.block import SessionBlock
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import ShotPlan, Stage

BATS = {"asa": "softball-34"}  # softball bat; the other procedures test baseball bats
BLOCKS = {
    RecordDetail.SUMMED: (16_384, 2e6),
    RecordDetail.FULL: (8_192, 2e4),
}  # shots per block, and target
CERTIFICATES = {  # largest time of a certificate by sums, in normal numbers of numpy
    "asa": 18_000,
    "astm-f1881": 18_000,
    "bbcor": 44_000,
    "ncaa-besr": 140_000,
    "ncaa-modified": 140_000,
    "proposed": 140_000,
}
LABORATORIES = 2048  # laboratories per round
CAMPAIGN = 131_072
ROUNDS = 9
NORMALS = 1_000_000


def main() -> None:
    """Measure, print the rows, and write them as CSV to the named files."""
    tell("throughput", _rows(), sys.argv[1:])


def _rows() -> Iterator[Row]:
    normals = normal_time()
    yield Row(part="machine", what="a normal number", value=normals * 1e9, unit="ns")
    for procedure in catalog.names("procedures"):
        for detail, (shots, goal) in BLOCKS.items():
            rate = shots / processor_seconds(_play(procedure, detail, shots), ROUNDS)
            yield Row(
                part=procedure,
                what=f"{procedure}, {detail.value}",
                value=rate,
                unit="shots/s",
                at_least=goal,
                note=f"{1 / rate / normals:.0f} normal numbers each",
            )
    for procedure, most in CERTIFICATES.items():
        spent = processor_seconds(certify_blocks(procedure), ROUNDS // 2) / LABORATORIES
        yield Row(
            part=procedure,
            what=f"{procedure}, a certificate, summed",
            value=spent / normals,
            unit="normals",
            at_most=most,
            note=f"{1 / spent:.0f} a second",
        )
    spent = processor_seconds(certify_alone(RecordDetail.SUMMED), 50)
    yield Row(part="astm-f1881", what="one alone, summed", value=1e3 * spent, unit="ms", at_most=5)
    spent = processor_seconds(certify_alone(RecordDetail.FULL, individual=True), 20) / normals
    what = "one alone in full, a bat of its own"
    yield Row(part="astm-f1881", what=what, value=spent, unit="normals", at_most=5_000_000)
    spent = _campaign()
    yield Row(
        part="astm-f1881",
        what="a row of a campaign, two processes, by the clock",
        value=spent / normals,
        unit="normals",
        at_most=10_000,
        note=f"{1 / spent:.0f} a second",
    )


def normal_time() -> float:
    """Return the processor time of a normally distributed random number of numpy [s]."""
    generator = np.random.Generator(np.random.PCG64DXSM(1))
    return processor_seconds(lambda: generator.standard_normal(NORMALS), ROUNDS) / NORMALS


def certify_alone(detail: RecordDetail, *, individual: bool = False) -> Work:
    """Return a work that certifies the next laboratory alone."""
    round_robin = RoundRobin.of("r161", "astm-f1881", individual=individual)
    setup = replace(round_robin.setup, seed=1, detail=detail)
    numbers = count()
    return lambda: certify_block(replace(setup, number=next(numbers)))


def _campaign() -> float:
    """Return the wall-clock time per row of a campaign [s], with start and end."""
    study = {"bats": ["r161"], "procedures": ["astm-f1881"], "laboratories": CAMPAIGN, "seed": 1}
    with TemporaryDirectory() as folder:
        start = time.perf_counter()
        vl.campaign(study, Path(folder) / "campaign", workers=2)
        return (time.perf_counter() - start) / CAMPAIGN


def certify_blocks(procedure: str) -> Work:
    """Return a work that certifies the same laboratories of a round robin."""
    round_robin = RoundRobin.of(BATS.get(procedure, "r161"), procedure)
    return lambda: list(round_robin.blocks(LABORATORIES, 1))


def _play(procedure: str, detail: RecordDetail, shots: int) -> Work:
    """Return a work that plays and reduces the next block."""
    laboratory = RoundRobin.of(BATS.get(procedure, "r161"), procedure).laboratory(1)
    tested = run_test(laboratory).of(0).certification
    session = tested.session
    reduced, _ = reduce_block(tested.block)
    constants = {name: constant.value[0] for name, constant in reduced.constants.items()}
    bat = bat_properties(constants)
    balls = measured_balls(
        constants, observe_balls(tested.block).select(np.array(0)).select(np.array(0))
    )
    rules = reduced.procedure
    metric = metric_of(rules)
    plan = ShotPlan(
        slot=np.arange(shots),
        ball=np.arange(shots) % rules.balls,
        speed=np.full(shots, rules.ball_speed),
        place=np.full(shots, tested.hit_weights.position[0]),
        turn_rate=float(rules.turn_rate(bat.length)),
        detail=detail,
    )
    station = laboratory.stations[Stage.IMPACT]

    firsts = count(step=shots)

    def work() -> object:
        play = station.play(
            replace(plan, slot=next(firsts) + plan.slot), laboratory.specimen, laboratory.draws
        )
        records = {**session.records, "impact": play.records}
        readings = observe_impact(SessionBlock.of(replace(session, records=records)))
        results = shot_results(
            ShotResults, constants, bat, balls, readings, rules.reduction_settings
        )
        return metric(Curve.from_shots(results), bat)

    return work


if __name__ == "__main__":
    main()
