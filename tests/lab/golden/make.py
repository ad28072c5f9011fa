"""The golden table: ``python -m tests.lab.golden.make``, some minutes.

One row per test: two bats by each procedure in the laboratories of seed 1, with instruments that
record only summary values and a nominal bat, and in full with individual bats; each fault and each
operator of the bench once. Floats are stored to the last bit.

``--summed`` and ``--full`` ask for fewer laboratories, ``--check`` compares with the table instead
of writing it.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from math import isclose, isnan, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from virtual_lab import catalog
from virtual_lab.bench.day.operators import HABITS, operator_of
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.machines.stored_day import StoredDay
from virtual_lab.catalog.faults import FaultSheet
from virtual_lab.lab import Laboratory, RoundRobin, TestSetup, certify_bat, run_test
from virtual_lab.measurement.certification import Certification
from virtual_lab.simulation.physics.truth import SealedTruth
from virtual_lab.simulation.stations import flights

TABLE = Path(__file__).with_name("table.csv")
SEED = 1
SUMMED, FULL = 300, 20  # number of laboratories per bat and procedure
BASEBALL, SOFTBALL = ("r161", "ea70"), ("softball-34", "softball-wood-34")
SCENARIO = "plain-day"  # number of days per operator


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A test of the table."""

    kind: str  # kind of test: summed, full, fault or operator
    procedure: str
    bat: str
    number: int = 0  # number of the laboratory
    what: str = ""  # name of the fault or the operator


@dataclass(frozen=True, slots=True, kw_only=True)
class Row(Case):
    """The result of a test, SI; NaN without a result."""

    metric: float
    u: float
    dof: float
    truth: float
    shots: int  # number of shots at the bat
    scenes: int  # number of shots beyond the closed form; not compared
    verdict: str
    flags: str


def cases(summed: int = SUMMED, full: int = FULL) -> Iterator[Case]:
    """Yield the tests, for these numbers of laboratories."""
    for procedure in catalog.names("procedures"):
        for bat in SOFTBALL if procedure == "asa" else BASEBALL:
            for kind, laboratories in (("summed", summed), ("full", full)):
                for number in range(laboratories):
                    yield Case(kind=kind, procedure=procedure, bat=bat, number=number)
    for name in catalog.names("faults"):
        where = catalog.load("faults", name, FaultSheet).spec.predictions[0].procedure
        bat = SOFTBALL[0] if where == "asa" else BASEBALL[0]
        yield Case(kind="fault", procedure=where, bat=bat, what=name)
    for name in HABITS:
        yield Case(kind="operator", procedure="", bat="", what=name)


def row_of(case: Case) -> Row:
    """Carry out a test, and return its row."""
    with patch.object(flights, "play_events", wraps=flights.play_events) as played:
        found, sealed = _operated(case) if case.kind == "operator" else _tested(case)
    metric = found.metric
    return Row(
        **asdict(case),
        metric=metric.value if metric else nan,
        u=metric.u if metric else nan,
        dof=metric.dof if metric else nan,
        truth=sealed.measurand.get("metric", nan),
        shots=found.readings.position.size,
        scenes=sum(call.args[0].shots for call in played.call_args_list),
        verdict=found.verdict.value,
        flags="+".join(flag.name for flag in found.flags),
    )


def differences(found: Row, golden: Row, *, value: float = 1e-12, dof: float = 1e-9) -> list[str]:
    """Return the differences, one line each: numbers beyond these shares, ν beyond `dof`.

    If a scene was played, numbers may differ by 1e-8: pymunk played it when the table was made,
    and the last bits of a time change those of a position.
    """
    if golden.scenes:
        value = dof = 1e-8
    lines = []
    for name in (each.name for each in fields(Row) if each.name != "scenes"):
        own, true = getattr(found, name), getattr(golden, name)
        if isinstance(true, float):
            share = dof if name == "dof" else value
            same = isclose(own, true, rel_tol=share) or (isnan(own) and isnan(true))
        else:
            same = own == true
        if not same:
            lines.append(f"{name}: {own!r}, in the table {true!r}")
    return lines


def write(rows: Iterable[Row], path: Path) -> None:
    """Write the table."""
    with path.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(each.name for each in fields(Row))
        for row in rows:
            out.writerow(asdict(row).values())


@cache
def table(path: Path = TABLE) -> dict[Case, Row]:
    """Return the rows of the table, by test."""
    kinds = {
        each.name: {"int": int, "float": float}.get(str(each.type), str) for each in fields(Row)
    }
    with path.open(encoding="utf-8", newline="") as file:
        rows = [
            Row(**{name: kinds[name](text) for name, text in line.items()})
            for line in csv.DictReader(file)
        ]
    own = [each.name for each in fields(Case)]
    return {Case(**{name: getattr(row, name) for name in own}): row for row in rows}


@cache
def _round_robin(bat: str, procedure: str) -> RoundRobin:
    return RoundRobin.of(bat, procedure)


def _tested(case: Case) -> tuple[Certification, SealedTruth]:
    if case.kind == "summed":
        setup = _round_robin(case.bat, case.procedure).setup
        done = run_test(Laboratory.open(replace(setup, seed=SEED, number=case.number))).of(0)
    else:
        faults = (case.what,) if case.kind == "fault" else ()
        setup = TestSetup.of(
            case.bat, procedure=case.procedure, seed=SEED, number=case.number, faults=faults
        )
        done = certify_bat(setup)
    return done.certification, done.sealed


def _operated(case: Case) -> tuple[Certification, SealedTruth]:
    with TemporaryDirectory() as place:
        kept = StoredDay.begin(Path(place) / "day", load_scenario(SCENARIO), SEED)
        kept.run_operator(operator_of(case.what, SEED))
        return kept.desk.certification, kept.apparatus.finish(kept.desk).sealed


def _made(asked: Iterable[Case]) -> Iterator[Row]:
    for number, case in enumerate(asked, 1):
        if number % 100 == 0:
            print(f"{number} tests", file=sys.stderr)
        yield row_of(case)


def _compared(asked: Iterable[Case]) -> int:
    """Print the differences from the table, and return the number of tests with one."""
    many = 0
    for row in _made(asked):
        golden = table()[Case(**{each.name: getattr(row, each.name) for each in fields(Case)})]
        lines = differences(row, golden)
        many += bool(lines)
        for line in lines:
            print(f"{row.kind} {row.what or row.number}, {row.bat} by {row.procedure}: {line}")
    return many


def main() -> None:
    """Write the table, or compare with it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--summed", type=int, default=SUMMED)
    parser.add_argument("--full", type=int, default=FULL)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--out", type=Path, default=TABLE)
    given = parser.parse_args()
    asked = cases(given.summed, given.full)
    if given.check:
        sys.exit(f"tests that differ: {many}" if (many := _compared(asked)) else 0)
    write(_made(asked), given.out)


if __name__ == "__main__":
    main()
