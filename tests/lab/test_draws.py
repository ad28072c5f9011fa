"""No two random quantities share a random number.

A number belongs to (seed, branch, laboratory, name, slot, index). A caller is identified by
its line and its call stack in simulation and rigs: a cannon fires at a bat and at an
aim paper by the same line, and every instrument of a laboratory is drawn by the same two. One key
requested by two callers would give two quantities one number.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest

import rigs
from tests.lab.test_control import CONTROLLED, CYLINDER
from tests.laboratories import certify
from virtual_lab import catalog, simulation, streams
from virtual_lab.simulation.faults import CATALOGUE
from virtual_lab.simulation.instruments import RecordDetail

STREAMS = Path(streams.__file__).parent
SIMULATED = Path(simulation.__file__).parent, *map(Path, rigs.__path__)
HALL = {"hall.air.errors", "hall.gravity.errors"}  # air and gravity, shared by all rigs
Place = tuple[str, int]
PROCEDURES = ("asa", "astm-f1881", "bbcor", "ncaa-besr", "ncaa-modified", "proposed")


@contextmanager
def overheard(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[tuple, set[tuple[Place, ...]]]]:
    """Collect the callers for the numbers of each (seed, branch, laboratory, name)."""
    asked: dict[tuple, set[tuple[Place, ...]]] = defaultdict(set)
    draw = streams.Streams._numbers

    def listening(self: streams.Streams, name: str, *rest: object) -> object:
        asked[(self.seed, self.branch, self.laboratory, name)].add(_callers())
        return draw(self, name, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(streams.Streams, "_numbers", listening)
        yield asked


def _callers() -> tuple[Place, ...]:
    """Return the calling line outside the streams, and those in simulation and rigs above it."""
    frame: FrameType | None = sys._getframe(2)
    while frame is not None and Path(frame.f_code.co_filename).parent == STREAMS:
        frame = frame.f_back
    places: list[Place] = []
    while frame is not None:
        file = frame.f_code.co_filename
        if places and not any(Path(file).is_relative_to(folder) for folder in SIMULATED):
            break
        places.append((file, frame.f_lineno))
        frame = frame.f_back
    return tuple(places)


def shared(asked: dict[tuple, set[tuple[Place, ...]]]) -> dict[tuple, set[tuple[Place, ...]]]:
    """Return the keys that two callers requested, except those that all rigs share."""
    assert len(asked) > 25
    return {key: who for key, who in asked.items() if len(who) > 1 and key[-1] not in HALL}


@pytest.mark.parametrize("detail", RecordDetail)
@pytest.mark.parametrize("procedure", PROCEDURES)
def test_no_two_parts_of_a_test_draw_the_same_numbers(
    procedure: str, detail: RecordDetail, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert set(PROCEDURES) <= set(catalog.names("procedures"))
    bat = "softball-wood-34" if procedure == "asa" else "r161"
    with overheard(monkeypatch) as asked:
        certify(bat, procedure=procedure, seed=11, test=1, detail=detail)
    assert not shared(asked)


def test_no_two_faults_of_a_day_draw_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """All faults of this rig occur at once."""
    with overheard(monkeypatch) as asked:
        certify("r161", procedure="astm-f1881", seed=11, faults=tuple(CATALOGUE))
    assert not shared(asked)


def test_a_bat_and_its_control_bat_draw_different_numbers(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """In tests 1, 2 and 3 of a laboratory, which share only its rigs."""
    rules = tmp_path / "controlled.toml"
    rules.write_text(CONTROLLED)
    branches = []
    for test in (1, 2, 3):
        with overheard(monkeypatch) as asked:
            certify(
                "r161",
                procedure=str(rules),
                control_bat=CYLINDER,
                seed=7,
                test=test,
                detail=RecordDetail.SUMMED,
            )
        assert not shared(asked)
        branches.append({key[1] for key in asked} - {()})
    assert [len(each) for each in branches] == [2, 2, 2]
    assert len(set().union(*branches)) == 6
