"""A block of laboratories gives the draws and records of each laboratory alone, bit for bit.

The oracle is the laboratory alone, whose constants are plain numbers. All other tests of one
laboratory support it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.simulation.collision.ladder import Ladder, probing_scenes
from virtual_lab.simulation.collision.surrogate import Box
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.physics.beam import Pinned
from virtual_lab.simulation.physics.truth import draw_balls, make_bat
from virtual_lab.simulation.stations.rig import (
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    find_rig,
    knows_blocks,
)
from virtual_lab.streams import Draws, Quiet, Streams
from virtual_lab.units import INCH, MPH

BALLS, PIVOT = 6, 6 * INCH
RIGS = {
    "bench": Stage.BENCH,
    "ball-wall": Stage.BALLS,
    "astm-pivot": Stage.IMPACT,
    "ball-cannon": Stage.IMPACT,
    "ncaa-swing": Stage.IMPACT,
}
SPEEDS = {"ball-wall": 60 * MPH, "astm-pivot": 60 * MPH, "ball-cannon": 136 * MPH}
NUMBERS = np.random.default_rng(4).permutation(10_000)[:512]
SHOTS = 14  # number of shots of every laboratory
BARREL = 0.05, 0.28  # positions [m], with weak rebounds at the ends
MIDDLE = 0.12, 0.20  # positions [m] from which balls return without obstacles


@cache
def collision(ball: BallSpec, rig: str) -> Ladder:
    body, speed = catalog.load_bat("r161").spec.body, SPEEDS.get(rig, 110 * MPH)
    box = Box(
        impact_position=(0.04, 0.3),
        relative_speed=(0.7 * speed, 1.2 * speed),
        ball_restitution=(0.3, 0.65),
        ball_mass=(0.97 * ball.mass, 1.03 * ball.mass),
        stiffness=ball.stiffness,
        exponent=ball.exponent,
    )
    support, probe = Pinned(body.length - PIVOT), probing_scenes(ball, speed)
    return Ladder(nominal=body, support=support, probe=probe, standard_uncertainty=2e-3, box=box)


@dataclass(frozen=True)
class Laboratories:
    """A rig in several laboratories, or in one, with its specimen."""

    rig: str
    draws: Draws
    shape: tuple[int, ...]
    places: tuple[float, float] = BARREL

    @classmethod
    def of(cls, rig: str, numbers: int | np.ndarray, **more: Any) -> Laboratories:
        return cls(rig, Streams(3, (), numbers), np.shape(numbers), **more)

    @property
    def station(self) -> Any:
        return find_rig(self.rig, RIGS[self.rig]).commission(self.draws)

    @property
    def specimen(self) -> Specimen:
        ball = catalog.load("balls", "baseball-2003", BallSpec).spec
        return Specimen(
            bat=make_bat(catalog.load_bat("r161").spec, Quiet()),
            balls=draw_balls(ball, BALLS, self.draws),
            collision=collision(ball, self.rig),
        )

    @property
    def plan(self) -> ShotPlan:
        """Plan the same shots for every laboratory, and readings of every ball for the bench."""
        shots = BALLS if self.rig == "bench" else SHOTS
        place = np.linspace(*self.places, shots)
        own = {
            "slot": np.arange(shots),
            "ball": np.arange(shots) % BALLS,
            "speed": np.full(shots, SPEEDS.get(self.rig, 70 * MPH)),
            "place": place,
            "turn_rate": 30.0 + place,  # one per shot
        }
        owner = np.arange(*self.shape).repeat(shots) if self.shape else ...
        columns: dict[str, Any] = {name: np.tile(each, self.shape) for name, each in own.items()}
        return ShotPlan(**columns, owner=owner, detail=RecordDetail.SUMMED)

    def play(self) -> RigOutput:
        return self.station.play(self.plan, self.specimen, self.draws)


def arrays(output: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Yield all arrays of the records and of the truth."""
    for channel, record in output.records.items():
        for name in record.columns:
            yield f"{channel}.{name}", getattr(record, name)
    for name, values in output.truth.items():
        yield name, np.asarray(values)


def part(values: np.ndarray, alone: np.ndarray, first: int, count: int, of: int) -> np.ndarray:
    """Return the rows of `count` laboratories from a block `of` several."""
    if values.ndim == 0:  # fields of the bat that all laboratories share
        return values
    rows = len(alone) // count
    assert len(values) == rows * of
    return values[first * rows : (first + count) * rows]


@pytest.mark.parametrize("rig", RIGS)
def test_a_laboratory_plays_in_a_block_what_it_plays_alone(rig: str) -> None:
    """For six laboratories of 60, all channels and the truth; plain numbers against arrays."""
    numbers = NUMBERS[:60]
    block = dict(arrays(Laboratories.of(rig, numbers).play()))
    for at in (0, 1, 17, 30, 58, 59):
        alone = dict(arrays(Laboratories.of(rig, int(numbers[at])).play()))
        assert alone.keys() == block.keys()
        for name, values in alone.items():
            own = part(block[name], values, at, 1, 60)
            assert np.array_equal(own, values, equal_nan=True), name


@pytest.mark.parametrize("rig", RIGS)
def test_nothing_depends_on_the_neighbours(rig: str) -> None:
    """A block of 512 equals blocks of 1, 37 and 474."""
    whole = dict(arrays(Laboratories.of(rig, NUMBERS, places=MIDDLE).play()))
    for first, count in ((0, 1), (1, 37), (38, 474)):
        some = NUMBERS[first : first + count]
        for name, values in arrays(Laboratories.of(rig, some, places=MIDDLE).play()):
            own = part(whole[name], values, first, count, 512)
            assert np.array_equal(own, values, equal_nan=True), name


@pytest.mark.parametrize("rig", RIGS)
def test_a_station_of_a_block_knows_what_each_laboratory_knows(rig: str) -> None:
    """Calibration and true constants have the same names and values."""
    assert knows_blocks(find_rig(rig, RIGS[rig]))
    block = Laboratories.of(rig, NUMBERS[:5]).station
    for at in (0, 4):
        alone = Laboratories.of(rig, int(NUMBERS[at])).station
        assert {key: each.row(at) for key, each in block.calibration.items()} == alone.calibration
        assert {key: each[at] for key, each in block.true_constants.items()} == alone.true_constants


@pytest.mark.parametrize("rig", ["astm-pivot", "ball-cannon", "ncaa-swing"])
def test_the_truth_of_a_block_is_that_of_each_laboratory(rig: str) -> None:
    """For two of 40, with balls set aside: the mean ball to rounding, all else bit for bit."""
    mask = np.random.default_rng(1).random((40, BALLS)) > 0.3
    mask[:, 0] = True
    block = Laboratories.of(rig, NUMBERS[:40])
    lots = replace(block.specimen.balls, used=mask)
    found = block.station.outcome(block.plan, replace(block.specimen, balls=lots))
    for at in (0, 39):
        alone = Laboratories.of(rig, int(NUMBERS[at]))
        balls = replace(alone.specimen.balls, used=mask[at])
        assert balls.mean_ball().mass == pytest.approx(balls.mass[mask[at]].mean(), rel=1e-15)
        true = alone.station.outcome(alone.plan, replace(alone.specimen, balls=balls))
        for name, own in _outcomes(true):
            assert np.array_equal(dict(_outcomes(found))[name][at * SHOTS :][:SHOTS], own), name


def _outcomes(outcome: Any, prefix: str = "") -> Iterator[tuple[str, np.ndarray]]:
    for each in fields(outcome):
        value = getattr(outcome, each.name)
        if isinstance(value, np.ndarray):
            yield prefix + each.name, value
        else:
            yield from _outcomes(value, f"{each.name}.")


def test_a_lot_of_a_block_is_that_of_the_laboratory() -> None:
    """A lot is drawn, fired at the wall, and selected from the block."""
    block, loss = Laboratories.of("ball-wall", NUMBERS[:9]), 0.01 * np.arange(9.0 * SHOTS)
    lots = block.specimen.balls
    found = lots.after_hits(block.plan.ball, loss, block.plan.owner)
    for at in (0, 8):
        alone = Laboratories.of("ball-wall", int(NUMBERS[at]))
        own, lost = alone.specimen.balls, loss[at * SHOTS : (at + 1) * SHOTS]
        for taken, lot in ((lots, own), (found, own.after_hits(alone.plan.ball, lost))):
            assert taken.of(at).spec == lot.spec
            assert np.array_equal(taken.of(at).mass, lot.mass)
            assert np.array_equal(taken.of(at).restitution, lot.restitution)


def test_a_scene_outside_the_surrogate_is_solved_by_the_modal_model_alone() -> None:
    """One laboratory fires at the tip: its e_A is that of the modal model, others do not change."""
    block = Laboratories.of("ball-cannon", NUMBERS[:20])
    far = block.plan.place.copy()
    far[5 * SHOTS] = 0.02
    plan = replace(block.plan, place=far)
    usual, found = (
        block.station.play(each, block.specimen, block.draws).truth for each in (block.plan, plan)
    )
    others = np.arange(20 * SHOTS) != 5 * SHOTS
    for name, values in found.items():
        assert np.array_equal(values[others], usual[name][others]), name
    alone = Laboratories.of("ball-cannon", int(NUMBERS[5]))
    play = alone.station.play(
        replace(alone.plan, place=far[5 * SHOTS : 6 * SHOTS]), alone.specimen, alone.draws
    )
    assert play.truth["collision_efficiency"][0] == found["collision_efficiency"][5 * SHOTS]


def test_a_quiet_block_is_a_quiet_laboratory_many_times() -> None:
    block, alone = (
        replace(Laboratories.of("astm-pivot", numbers), draws=Quiet(numbers))
        for numbers in (np.arange(3), 0)
    )
    single = dict(arrays(alone.play()))
    for name, values in arrays(block.play()):
        assert np.array_equal(values, np.concatenate([single[name]] * 3), equal_nan=True), name


def test_a_rig_without_blocks_is_played_one_laboratory_at_a_time() -> None:
    assert not knows_blocks(find_rig("filmed-cannon", Stage.IMPACT))
    assert not knows_blocks(object())  # type: ignore[arg-type]
