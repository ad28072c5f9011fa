"""A block of laboratories: each gives the result of the golden table.

The table was written by a loop over laboratories, before blocks existed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import virtual_lab as vl
from tests.lab.golden.make import BASEBALL, SEED, SOFTBALL, Case, Row, differences, table
from tests.lab.test_round_robin import bits
from virtual_lab import catalog, lab
from virtual_lab.catalog.specs import BatBody

PROCEDURES = catalog.names("procedures")
Array = np.ndarray


def bat_of(procedure: str) -> str:
    return (SOFTBALL if procedure == "asa" else BASEBALL)[0]


@cache
def round_robin(procedure: str, bat: str) -> lab.RoundRobin:
    return lab.RoundRobin.of(bat, procedure)


def block_of(procedure: str, bat: str, first: int, last: int) -> lab.BlockTest:
    setup = round_robin(procedure, bat).setup
    return lab.certify_block(replace(setup, seed=SEED, number=np.arange(first, last)))


def row_of(block: lab.BlockTest, case: Case, one: int, scenes: int) -> Row:
    found, has_result = block.certified, bool(block.certified.has_result[one])
    metric = found.results["metric"]

    def of(values: Array) -> float:
        return float(values[one]) if has_result else np.nan

    return Row(
        kind=case.kind,
        procedure=case.procedure,
        bat=case.bat,
        number=case.number,
        metric=of(metric.value),
        u=of(metric.u),
        dof=of(metric.dof),
        truth=of(block.measurands["metric"]),
        shots=int(np.sum(block.certified.reduced.owner == one)),
        scenes=scenes,
        verdict=found.verdicts[one].value,
        flags="+".join(name for name, where in found.checked.flagged.items() if where[one]),
    )


def compare(procedure: str, bat: str, first: int, last: int, **shares: float) -> list[str]:
    """Return the differences from the table beyond `shares`, one line each."""
    block, lines = block_of(procedure, bat, first, last), []
    for number in range(first, last):
        case = Case(kind="summed", procedure=procedure, bat=bat, number=number)
        golden = table()[case]
        own = row_of(block, case, number - first, golden.scenes)
        lines += [f"{number}: {line}" for line in differences(own, golden, **shares)]
    return lines


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_a_block_is_its_laboratories_one_after_another(procedure: str) -> None:
    """Metric, u, ν, truth, shots, verdict and flags of twenty laboratories agree.

    Another family of processors than that of the table moves the metric by up to 1e-10.
    """
    assert compare(procedure, bat_of(procedure), 0, 20, value=1e-9, dof=1e-6) == []


@pytest.mark.long
@pytest.mark.parametrize("procedure", PROCEDURES)
@pytest.mark.parametrize("which", [0, 1])
def test_blocks_are_the_whole_table(procedure: str, which: int) -> None:
    """Blocks of a hundred give the table's three hundred laboratories of both bats."""
    bat = (SOFTBALL if procedure == "asa" else BASEBALL)[which]
    for first in (0, 100, 200):
        assert compare(procedure, bat, first, first + 100) == []


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_a_test_of_a_block_is_printed_as_that_of_its_laboratory_alone(procedure: str) -> None:
    """Every record, budget line, flag and true value agrees bit for bit."""
    shared = round_robin(procedure, bat_of(procedure))
    block = block_of(procedure, bat_of(procedure), 0, 20)
    for number in (0, 13):
        alone = lab.run_test(shared.laboratory(SEED, number)).of(0)
        beside = block.of(number)
        assert bits(beside) == bits(alone)
        for name in ("metric", "quantities", "bat", "flags", "pairs", "reasons", "verdict"):
            own = getattr(beside.certification, name)
            assert repr(own) == repr(getattr(alone.certification, name)), name
        one, other = beside.sealed.document(), alone.sealed.document()
        assert repr({**one, "salt": ""}) == repr({**other, "salt": ""})


@pytest.mark.parametrize(("procedure", "bat"), [("asa", "softball-34"), ("ncaa-besr", "ea70")])
def test_individual_bats_of_a_block_are_those_of_their_laboratories(
    procedure: str, bat: str
) -> None:
    """Records, truth and the sealed bat agree bit for bit; no two bats are equal."""
    shared = lab.RoundRobin.of(bat, procedure, individual=True)
    (block,) = shared.blocks(3, SEED)
    assert block.certified.block.laboratories == 3
    for number in (1, 2):
        alone = lab.run_test(shared.laboratory(SEED, number)).of(0)
        assert bits(block.of(number)) == bits(alone)
        one, other = (each.sealed.document() for each in (block.of(number), alone))
        assert repr((one["bat"], one["bat_properties"])) == repr(
            (other["bat"], other["bat_properties"])
        )
    assert len({block.of(number).sealed.bat.body for number in range(3)}) == 3


def test_a_bat_is_the_same_on_another_day_where_it_is_asked_for() -> None:
    shared = lab.RoundRobin.of("r161", "astm-f1881", individual=True)

    def bat_of_day(**choices: Any) -> BatBody:
        setup = replace(shared.setup, seed=SEED, **choices)
        return lab.Laboratory.open(setup).specimen.bat.body

    assert bat_of_day(test=2, same_bat=True) == bat_of_day()
    assert bat_of_day(test=2) != bat_of_day()


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_nothing_depends_on_the_neighbours(procedure: str) -> None:
    """Twenty laboratories in one block, and in blocks of 1, 7 and 12, have the same bits."""
    bat = bat_of(procedure)
    whole = block_of(procedure, bat, 0, 20)
    for first, last in pairwise((0, 1, 8, 20)):
        part, own = block_of(procedure, bat, first, last), slice(first, last)
        for name, budgets in part.certified.results.items():
            every = whole.certified.results[name]
            for field in ("value", "u", "dof"):
                assert np.array_equal(getattr(budgets, field), getattr(every, field)[own]), name
        for name, values in part.measurands.items():
            assert np.array_equal(values, whole.measurands[name][own], equal_nan=True), name
        assert part.certified.verdicts == whole.certified.verdicts[own]


def test_lots_of_another_level_and_stiffness_are_those_of_such_a_sheet() -> None:
    """Three lots side by side, and each alone with a ball whose sheet states its true values."""

    def block(number: int | Array, **changes: float | str) -> lab.BlockTest:
        sheet = vl.ball("baseball-2003").with_(changes)
        bench = vl.rig("bench").with_({"store.humidity_spread": "0 %"})
        texts = {("balls", "baseball-2003"): sheet.text, ("rigs", "bench"): bench.text}
        with catalog.sheets_in_place(texts):
            setup = lab.RoundRobin.of("ea70", "astm-f1881").setup
            return lab.certify_block(replace(setup, seed=SEED, number=np.atleast_1d(number)))

    many = block(np.arange(3), **{"restitution.value_u": 0.003, "stiffness_spread": "5 %"})
    lots = many.laboratory.specimen.balls.spec
    assert np.ptp(lots.stiffness) > 1e5
    assert many.laboratory.collision.box is None
    for number, (level, stiffness) in enumerate(
        zip(lots.restitution.value, lots.stiffness, strict=True)
    ):
        sheet = {
            "restitution.value": float(level),
            "restitution.value_u": 0.0,
            "stiffness": float(stiffness),
        }
        alone = block(number, **sheet)
        for name, values in alone.measurands.items():
            assert values == pytest.approx(many.measurands[name][[number]], abs=3e-5), name


class BrokenError(Exception):
    """The error of a function that both calls should reach."""


@pytest.mark.parametrize(
    "name",
    [
        "simulation.stations.cannon_station.compute_impacts",
        "lab.test_day.wall_plan",
        "lab.test_day.prepare",
        "measurement.session_reduction.next_shots",
        "lab.test_day.reduce_shots",
        "measurement.session_reduction.shot_results",
        "measurement.certification.check",
        "lab.test_day.measurands",
    ],
)
def test_one_laboratory_and_many_run_the_same_functions(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    shared = round_robin("astm-f1881", "r161")

    def broken(*_given: object, **_named: object) -> object:
        raise BrokenError

    monkeypatch.setattr(f"virtual_lab.{name}", broken)
    for number in (0, np.arange(3)):
        with pytest.raises(BrokenError):
            lab.certify_block(replace(shared.setup, seed=SEED, number=number))


def test_a_block_of_another_day_is_the_second_tests_of_its_laboratories() -> None:
    """Tests of branch 1 in the loop: the rigs of the first day, other balls, readings and hits."""
    shared = round_robin("astm-f1881", "r161")
    setup = replace(shared.setup, test=1)
    block = lab.certify_block(replace(setup, seed=SEED, number=np.arange(3, 6)))
    first = block_of("astm-f1881", "r161", 3, 6)
    one = "impact.gates.distance_0"
    for at, number in enumerate(range(3, 6)):
        own = lab.Laboratory.open(replace(setup, seed=SEED, number=number))
        tested = lab.run_test(own).of(0)
        metric = tested.certification.metric
        assert metric is not None
        found = block.certified.results["metric"]
        assert found.value[at] == pytest.approx(metric.value, rel=1e-12)
        assert found.u[at] == pytest.approx(metric.u, rel=1e-12)
        true = tested.sealed.measurand["metric"]
        assert block.measurands["metric"][at] == pytest.approx(true, rel=1e-12)
        assert block.certified.block.calibration[one].value[at] == own.calibration[one].value[0]
        assert abs(found.value[at] - first.certified.results["metric"].value[at]) > 1e-5
