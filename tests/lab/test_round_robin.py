"""Many laboratories: each result depends only on its number; its scenes lie in the box."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest

from virtual_lab import catalog, lab
from virtual_lab.catalog import reading
from virtual_lab.files import parse_toml
from virtual_lab.lab.round_robin import RoundRobin
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.physics.beam import Pinned, beam_of
from virtual_lab.simulation.stations.rig import ShotPlan, Stage

BATS = {"asa": "softball-34"}  # the other procedures test baseball bats
PROCEDURES = catalog.names("procedures")
SIDE = 0.712  # position of a pivot on the bat [m]
Bits = dict[int, str]


def bits(tested: lab.BatTest) -> str:
    """Return a hash of metric, u, every record and every true value."""
    metric = tested.certification.metric
    digest = hashlib.sha256(repr((metric.value, metric.u, metric.dof) if metric else None).encode())
    for stage, records in sorted(tested.certification.session.records.items()):
        for channel, record in sorted(records.items()):
            for name in record.columns:
                digest.update(f"{stage}.{channel}.{name}".encode())
                digest.update(np.ascontiguousarray(getattr(record, name)).tobytes())
    sealed = tested.sealed
    for name, values in sorted({**sealed.shots, **sealed.wall_hits}.items()):
        digest.update(name.encode() + np.ascontiguousarray(values).tobytes())
    digest.update(repr((dict(sealed.constants), dict(sealed.measurand))).encode())
    return digest.hexdigest()


def played(procedure: str, numbers: Iterable[int]) -> Bits:
    """Return the hashes of the laboratories of a separate round robin, played in turn."""
    round_robin = RoundRobin.of(BATS.get(procedure, "r161"), procedure)
    return {
        number: bits(lab.run_test(round_robin.laboratory(1, number)).of(0)) for number in numbers
    }


def run(procedure: str, laboratories: int, first: int) -> Bits:
    round_robin = RoundRobin.of(BATS.get(procedure, "r161"), procedure)
    tests = round_robin.run(laboratories, 1, first)
    return {first + number: bits(tested) for number, tested in enumerate(tests)}


@cache
def of_64() -> Bits:
    return run("astm-f1881", 64, 1)


def test_a_laboratory_is_the_same_alone_and_among_37_or_64() -> None:
    """Metric, u, records and truth agree bit for bit, from any first number."""
    of_37 = run("astm-f1881", 37, 20)
    assert of_37 == {number: of_64()[number] for number in of_37 if number <= 64}
    assert len(set(of_64().values())) == 64
    for number in (1, 33, 56):
        assert played("astm-f1881", [number]) == {number: of_64()[number]}


@pytest.mark.long
def test_two_processes_give_what_one_gives() -> None:
    """Two processes, each with half of the laboratories, one in reverse order."""
    halves = range(1, 4), range(6, 3, -1)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = [pool.submit(played, "astm-f1881", half) for half in halves]
        both = found[0].result() | found[1].result()
    assert both == {number: of_64()[number] for number in both}


@contextmanager
def threads(count: int) -> Iterator[Any]:
    """Replace `workers` by threads: arguments are pickled, and no sheet is in place there."""
    with ThreadPoolExecutor(1) as pool:
        yield lambda function, *sent: pool.submit(function, *pickle.loads(pickle.dumps(sent)))


@pytest.mark.parametrize("by", [threads, pytest.param(None, marks=pytest.mark.long)])
def test_workers_give_what_one_process_gives(by: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks in turn, with a sheet that replaces the shipped one."""
    if by:
        monkeypatch.setattr("virtual_lab.lab.round_robin.workers", by)
    monkeypatch.setattr("virtual_lab.lab.round_robin.INDIVIDUALS", 3)
    text = catalog.text("instruments", "pivot-gates").replace("value = 0.073", "value = 0.73")
    with catalog.sheets_in_place({("instruments", "pivot-gates"): text}):
        shared = RoundRobin.of("r161", "astm-f1881", individual=True)
        alone = [*shared.each_block(metrics_of, 4, 1)]
        assert [*shared.each_block(metrics_of, 4, 1, 2)] == alone
    assert next(shared.each_block(metrics_of, 2, 1)) != alone[0][:2]
    assert [len(block) for block in alone] == [3, 1]


def metrics_of(block: lab.BlockTest) -> list[float]:
    return [*block.certified.results["metric"].value.tolist()]


@pytest.mark.parametrize("procedure", ["asa", "bbcor", "ncaa-besr"])
def test_earlier_tests_change_nothing(procedure: str) -> None:
    """Earlier laboratories and far scenes do not change the result of a laboratory."""
    (alone,) = played(procedure, [3]).values()
    round_robin = RoundRobin.of(BATS.get(procedure, "r161"), procedure)
    body, box = round_robin.setup.bat.spec.body, round_robin.setup.collision.box
    assert box is not None
    far = Scenes.of(
        impact_position=np.linspace(0.04, 0.3, 200),
        relative_speed=np.linspace(15.0, 80.0, 200),
        ball_mass=np.mean(box.ball_mass),
        ball_restitution=0.5,
        stiffness=box.stiffness,
        exponent=box.exponent,
    )
    for from_knob in (round_robin.setup.rules.spec.pivot_from_knob, body.length - SIDE):
        support = Pinned(body.length - from_knob)
        round_robin.setup.collision.efficiencies([(body, slice(None))], support, far)
    for number in (8, 5):
        lab.run_test(round_robin.laboratory(1, number))
    assert bits(lab.run_test(round_robin.laboratory(1, 3)).of(0)) == alone


class AskedError(Exception):
    """Signal that the scenes were collected, to stop the shots."""


@dataclass
class Watching:
    """The collision model of a round robin, which collects the requested scenes."""

    round_robin: RoundRobin
    seen: list[Scenes] = field(default_factory=list)

    def __call__(self, body, support):
        return self.round_robin.setup.collision(body, support)

    def efficiencies(self, struck, support, scenes: Scenes) -> np.ndarray:
        self.seen.append(scenes)
        raise AskedError


@pytest.mark.parametrize("procedure", PROCEDURES)
def test_scenes_of_a_test_lie_in_its_box(procedure: str) -> None:
    """None of 20 000 shots, at both ends of a procedure's positions, is outside.

    The box is not too wide: the shots fill four tenths of each side.
    """
    round_robin = RoundRobin.of(BATS.get(procedure, "r161"), procedure)
    box, shots = round_robin.setup.collision.box, 20_000
    assert box is not None
    laboratory, rules = round_robin.laboratory(1), round_robin.setup.rules.spec
    ready = lab.prepare_day(laboratory).laboratory
    ends = (rules.scan.low, rules.scan.high) if rules.scan else (np.mean(box.impact_position),) * 2
    slots, watching = np.arange(shots), Watching(round_robin)
    plan = ShotPlan(
        slot=slots,
        ball=slots % rules.balls,
        speed=np.full(shots, rules.ball_speed),
        place=np.where(slots % 2, *ends),
        turn_rate=float(rules.turn_rate(beam_of(round_robin.setup.bat.spec.body).length)),
        detail=RecordDetail.SUMMED,
    )
    specimen = replace(ready.specimen, collision=watching)
    with pytest.raises(AskedError):
        laboratory.stations[Stage.IMPACT].play(plan, specimen, laboratory.draws)
    (scenes,) = watching.seen
    assert box.inside(scenes).all()
    for axis in ("impact_position", "relative_speed", "ball_restitution"):
        low, high = getattr(box, axis)
        assert np.ptp(getattr(scenes, axis)) > 0.4 * (high - low), axis


def test_no_sheet_is_parsed_for_a_further_laboratory(monkeypatch: pytest.MonkeyPatch) -> None:
    """The setup counts unverified values once; the rigs' sheets are read once per process."""
    round_robin = RoundRobin.of("r161", "astm-f1881")
    round_robin.laboratory(1)
    parsed: list[str] = []

    def parse(text: str, where: str) -> dict[str, object]:
        parsed.append(where)
        return parse_toml(text, where)

    monkeypatch.setattr(reading, "parse_toml", parse)
    reading._parse.cache_clear()
    doubts = round_robin.laboratory(2).session.origin.unverified_numbers
    assert parsed == []
    assert doubts == lab.TestSetup.of("r161", procedure="astm-f1881").unverified
    assert "pendulum.toml" in parsed  # first test of a new setup


@pytest.mark.parametrize("procedure", ["astm-f1881", "bbcor", "ncaa-besr"])
def test_summed_and_full_records_share_their_truth(procedure: str) -> None:
    """Speed, position and e0 of every shot, true constants, balls and bat agree bit for bit."""
    setup = replace(RoundRobin.of("r161", procedure).setup, seed=4, number=3)
    rules, slots = setup.rules.spec, np.arange(24)
    truths, constants, balls = [], [], []
    for detail in RecordDetail:
        day = lab.prepare_day(lab.Laboratory.open(replace(setup, detail=detail)))
        ready, bench, wall = day.laboratory, day.bench, day.wall
        assert bench is not None
        assert wall is not None
        plan = ShotPlan(
            slot=slots,
            ball=slots % rules.balls,
            speed=np.full(slots.size, rules.ball_speed),
            place=np.linspace(0.13, 0.17, slots.size),
            turn_rate=float(rules.turn_rate(float(bench.truth["length"]))),
            detail=detail,
        )
        station = ready.stations[Stage.IMPACT]
        play = station.play(plan, ready.specimen, ready.draws)
        names = ("speed", "place", "across", "ball_restitution")
        truths.append([play.truth[name] for name in names] + [*wall.truth.values()])
        constants.append([dict(each.true_constants) for each in ready.stations.values()])
        balls.append([ready.specimen.balls.mass, ready.specimen.balls.restitution])
    assert constants[0] == constants[1]
    for one, other in zip(truths[0] + balls[0], truths[1] + balls[1], strict=True):
        assert np.array_equal(one, other)
