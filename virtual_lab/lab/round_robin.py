"""One bat design in many laboratories with different errors.

In metrology a round robin is one artefact that goes from laboratory to laboratory.

The common parts (surrogate of the nominal bat's collision, procedure) are made once. Laboratories
are the numbered ones of one seed, as of ``certify --seed S --number n``. Where instruments write
sums they run in blocks, side by side: of a nominal bat a fraction of a millisecond each, of an
individual bat a twentieth of a second.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import hypot
from typing import Self, TypeVar

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.reading import Key
from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.errors import InputError
from virtual_lab.lab.bat_test import BatTest, BlockTest
from virtual_lab.lab.certify import certify_block
from virtual_lab.lab.fitting import nominal_places
from virtual_lab.lab.laboratory import Laboratory, collision_of
from virtual_lab.lab.setup import TestSetup
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.processes import workers
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.collision.surrogate import Box
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.rig import find_rig, knows_blocks
from virtual_lab.uncertainty.scatter import HitVariance

Taken = TypeVar("Taken")
BLOCK = 1024  # laboratories side by side: more gain a few per cent and take memory
SCANS = 768  # the same of scans, which fire more shots
INDIVIDUALS = 32  # where each has a bat of its own, whose modes and splines are kept meanwhile


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundRobin:
    """Everything that all laboratories have in common."""

    setup: TestSetup
    history: int = 0  # earlier tests of each laboratory, whose hits' scatter counts

    @classmethod
    def of(cls, bat: str, procedure: str, *, summed: bool = True, individual: bool = False) -> Self:
        """Return the round robin of a bat by a procedure; `InputError` as `TestSetup.of`.

        With `summed` instruments write sums, and all laboratories get the nominal bat, whose
        collision is that of a surrogate, unless bats are to be `individual`, each with its own
        modes to find. In full they always are.
        """
        detail = RecordDetail.SUMMED if summed else RecordDetail.FULL
        setup = TestSetup.of(bat, procedure=procedure, detail=detail)
        return cls.shared(replace(setup, made=individual or not summed))

    @classmethod
    def shared(cls, setup: TestSetup) -> Self:
        """Return the round robin of a setup, with the collision of a bat that is nominal."""
        if setup.made:
            return cls(setup=setup)
        rules, ball, drawn = setup.rules.spec, setup.ball.spec, setup.bat.spec
        collision = collision_of(drawn, ball, rules).with_box(box_of(rules, drawn, ball))
        return cls(setup=replace(setup, collision=collision))

    def laboratory(self, seed: int, number: int = 0) -> Laboratory:
        """Return a laboratory of a seed, by its number."""
        return Laboratory.open(replace(self.setup, seed=seed, number=number))

    @property
    def in_blocks(self) -> bool:
        """Whether its laboratories can be played side by side: all its rigs know blocks."""
        setup = self.setup
        rigs = (find_rig(name, stage) for stage, name in setup.rigs.items())
        plain = not setup.faults.names and not setup.rules.spec.controlled
        summed = setup.detail is RecordDetail.SUMMED
        return plain and summed and all(knows_blocks(rig) for rig in rigs)

    @property
    def _share(self) -> int:
        """Number of laboratories that are made together."""
        if self.setup.made or not self.in_blocks:
            return INDIVIDUALS
        return SCANS if self.setup.rules.spec.scan else BLOCK

    def blocks(self, laboratories: int, seed: int, first: int = 0) -> Iterator[BlockTest]:
        """Yield the tests in so many laboratories of a seed, in blocks.

        They are blocks of one where laboratories cannot be played side by side. `InputError` as
        `certify_block`.
        """
        numbers, setup = np.arange(first, first + laboratories), replace(self.setup, seed=seed)
        if not self.in_blocks:
            for number in numbers.tolist():
                yield self._tested(replace(setup, number=number))
            return
        for begin in range(0, laboratories, self._share):
            yield self._tested(replace(setup, number=numbers[begin : begin + self._share]))

    def _tested(self, setup: TestSetup) -> BlockTest:
        """Return the tests of a block, after the earlier ones of its laboratories."""
        if not self.history:
            return certify_block(setup)
        tests = range(1, self.history + 1)
        earlier = [certify_block(replace(setup, test=test)).certified.variances for test in tests]
        return certify_block(
            replace(
                setup,
                history={
                    name: HitVariance.pooled([each[name] for each in earlier]).known()
                    for name in earlier[0]
                },
            )
        )

    def each_block(
        self, take: Callable[[BlockTest], Taken], laboratories: int, seed: int, processes: int = 1
    ) -> Iterator[Taken]:
        """Yield the result of `take`, a function of a module, for each block, in turn.

        So many processes of this machine share the blocks. `InputError` as `blocks`.
        """
        if processes < 1:
            raise InputError("", "workers", processes, "allowed: 1 and more")
        if processes == 1:
            yield from map(take, self.blocks(laboratories, seed))
            return
        shared = pickle.dumps(
            (replace(self.setup, collision=None), self.history, catalog.texts_in_place())
        )
        share = self._share
        with workers(processes) as submit:
            made = [
                submit(_taken, shared, take, min(share, laboratories - first), seed, first)
                for first in range(0, laboratories, share)
            ]
            for each in made:
                yield from each.result()

    def run(self, laboratories: int, seed: int, first: int = 0) -> Iterator[BatTest]:
        """Yield the same tests one after another, as they are printed."""
        for block in self.blocks(laboratories, seed, first):
            for one in range(block.sessions.laboratories):
                yield block.of(one)


def _taken(
    pickled: bytes, take: Callable[[BlockTest], Taken], laboratories: int, seed: int, first: int
) -> list[Taken]:
    shared, texts = _unpickled(pickled)
    with catalog.sheets_in_place(texts):
        return [take(block) for block in shared.blocks(laboratories, seed, first)]


@lru_cache(maxsize=1)  # a worker is asked for the blocks of one round robin
def _unpickled(pickled: bytes) -> tuple[RoundRobin, Mapping[Key, str]]:
    setup, history, texts = pickle.loads(pickled)
    with catalog.sheets_in_place(texts):
        return replace(RoundRobin.shared(setup), history=history), texts


def box_of(procedure: Procedure, bat: BatSpec, ball: BallSpec) -> Box:
    """Return the range of a test's collisions: nominal values and six sigma about them.

    It depends only on procedure, bat and lot, so a surrogate over it is always the same.
    """
    either = np.array([-1.0, 1.0])
    sigmas = 6  # a scene outside costs time, no accuracy
    # scatter as the cannons' sheets in data/instruments have it; others make more scenes lie
    # outside. That of the place [m] has the percussion centre's own uncertainty among it.
    place = np.array(nominal_places(procedure, bat)) + sigmas * 1.7e-3 * either
    axis = bat.body.length - procedure.pivot_from_knob
    bat_speed = procedure.turn_rate(bat.body.length) * (axis - place[::-1])
    speed = procedure.ball_speed + bat_speed + sigmas * 0.2 * either  # m/s
    speed[0] *= 0.99  # a hit six sigma above the bat's axis is slanted
    scatter = hypot(ball.spread.restitution, ball.spread.hit_restitution)
    e0 = np.asarray(ball.restitution.at(speed[::-1])) + sigmas * scatter * either
    return Box.about(
        Scenes.of(
            impact_position=place,
            relative_speed=speed,
            ball_mass=ball.mass + sigmas * ball.spread.mass * either,
            ball_restitution=e0.clip(ball.restitution.floor, 1.0),
            stiffness=ball.stiffness,
            exponent=ball.exponent,
        )
    )
