"""One bat design in many laboratories with different errors.

(In metrology a round robin is one artifact that travels from laboratory to laboratory.)

The common parts (procedure, surrogate of the nominal bat's collision) are made once. The
laboratories have the numbers 0, 1, … of one seed, as in ``certify --seed S --number n``. If the
instruments record only summary values, laboratories are simulated side by side in blocks. A
laboratory then takes a fraction of a millisecond for a nominal bat, and about 20 ms for an
individual bat.
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
from virtual_lab.catalog import Entry
from virtual_lab.catalog.reading import Key
from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.lab.bat_test import BatTest, BlockTest
from virtual_lab.lab.certify import certify_block
from virtual_lab.lab.fitting import nominal_positions
from virtual_lab.lab.laboratory import Laboratory, collision_of
from virtual_lab.lab.setup import TestSetup
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.processes import workers
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.collision.surrogate import Box
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import find_rig, knows_blocks
from virtual_lab.uncertainty.scatter import HitVariance

Taken = TypeVar("Taken")
AnyRules = str | Entry[Procedure]  # a procedure by its name, or as read
BLOCK = 1024  # number of laboratories per block; more are a few percent faster but need memory
SCANS = 768  # number of laboratories per block for scans, which need more shots
INDIVIDUALS = 32  # laboratories per block with individual bats; their modes need memory


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundRobin:
    """The common parts of all laboratories."""

    setup: TestSetup
    history: int = 0  # number of earlier tests of each laboratory whose scatter is used

    @classmethod
    def of(
        cls, bat: str, procedure: AnyRules, *, summed: bool = True, individual: bool = False
    ) -> Self:
        """Return a round robin with the same bat and the same procedure in all laboratories.

        With `summed` the instruments record only summary values, and all laboratories test the
        nominal bat with a surrogate of its collision. With `individual`, or without `summed`, each
        laboratory has an individual bat, so the modes of each bat must be computed. Raises
        `InputError` in the same cases as `TestSetup.of`.
        """
        detail = RecordDetail.SUMMED if summed else RecordDetail.FULL
        setup = TestSetup.of(bat, procedure=procedure, detail=detail)
        return cls.with_common_model(replace(setup, random_bat=individual or not summed))

    @classmethod
    def with_common_model(cls, setup: TestSetup) -> Self:
        """Return the round robin of a setup, with a common collision model if the bat is nominal.

        The common model has a single stiffness of the ball. It is left out if the stiffness of the
        balls varies.
        """
        rules, ball, bat = setup.rules.spec, setup.ball.spec, setup.bat.spec
        if setup.random_bat or ball.stiffness_spread:
            return cls(setup=setup)
        collision = collision_of(bat, ball, rules).with_box(box_of(rules, bat, ball))
        return cls(setup=replace(setup, collision=collision))

    def laboratory(self, seed: int, number: int = 0) -> Laboratory:
        """Return the laboratory `number` of a seed. Raises `InputError` like `Laboratory.open`."""
        return Laboratory.open(replace(self.setup, seed=seed, number=number))

    @property
    def in_blocks(self) -> bool:
        """Whether several laboratories can be simulated together.

        All rigs must support it. The instruments must record summary values only, and the setup
        must have neither faults nor a control bat.
        """
        setup = self.setup
        rigs = (find_rig(name, stage) for stage, name in setup.rigs.items())
        plain = not setup.faults.names and not setup.rules.spec.controlled
        summed = setup.detail is RecordDetail.SUMMED
        return plain and summed and all(knows_blocks(rig) for rig in rigs)

    @property
    def _share(self) -> int:
        """Number of laboratories per block."""
        if self.setup.random_bat or not self.in_blocks:
            return INDIVIDUALS
        return SCANS if self.setup.rules.spec.scan else BLOCK

    def blocks(self, laboratories: int, seed: int, first: int = 0) -> Iterator[BlockTest]:
        """Yield the tests of `laboratories` laboratories of a seed, in blocks.

        If laboratories cannot be simulated together, each block has one. Raises `InputError` in the
        same cases as `certify_block`.
        """
        numbers, setup = np.arange(first, first + laboratories), replace(self.setup, seed=seed)
        if not self.in_blocks:
            for number in numbers.tolist():
                yield self._run_tests(replace(setup, number=number))
            return
        for begin in range(0, laboratories, self._share):
            yield self._run_tests(replace(setup, number=numbers[begin : begin + self._share]))

    def _run_tests(self, setup: TestSetup) -> BlockTest:
        """Return the tests of a block, after the earlier tests of its laboratories."""
        if not self.history:
            return certify_block(setup)
        tests = range(1, self.history + 1)
        earlier = [certify_block(replace(setup, test=test)).certified.variances for test in tests]
        return certify_block(
            replace(
                setup,
                history={
                    name: HitVariance.pool([each[name] for each in earlier]).as_estimates()
                    for name in earlier[0]
                },
            )
        )

    def each_block(
        self, take: Callable[[BlockTest], Taken], laboratories: int, seed: int, processes: int = 1
    ) -> Iterator[Taken]:
        """Yield the result of the function `take` for each block, in the order of the blocks.

        `take` must be a module-level function. `processes` processes of this computer share the
        blocks. Raises `InputError` in the same cases as `blocks`.
        """
        if processes == 1:
            yield from map(take, self.blocks(laboratories, seed))
            return
        shared = pickle.dumps(
            (replace(self.setup, collision=None), self.history, catalog.texts_in_place())
        )
        share = self._share
        with workers(processes) as submit:
            calls = [
                submit(_take_blocks, shared, take, min(share, laboratories - first), seed, first)
                for first in range(0, laboratories, share)
            ]
            for each in calls:
                yield from each.result()

    def run(self, laboratories: int, seed: int, first: int = 0) -> Iterator[BatTest]:
        """Yield the tests of `blocks` one by one, ready to print."""
        for block in self.blocks(laboratories, seed, first):
            for one in range(block.certified.block.laboratories):
                yield block.of(one)


def _take_blocks(
    pickled: bytes, take: Callable[[BlockTest], Taken], laboratories: int, seed: int, first: int
) -> list[Taken]:
    shared, texts = _unpickle(pickled)
    with catalog.sheets_in_place(texts):
        return [take(block) for block in shared.blocks(laboratories, seed, first)]


@lru_cache(maxsize=1)  # a worker makes the blocks of one round robin
def _unpickle(pickled: bytes) -> tuple[RoundRobin, Mapping[Key, str]]:
    setup, history, texts = pickle.loads(pickled)
    with catalog.sheets_in_place(texts):
        return replace(RoundRobin.with_common_model(setup), history=history), texts


def box_of(procedure: Procedure, bat: BatSpec, ball: BallSpec) -> Box:
    """Return the ranges of the impact conditions in a test [SI], for the fit of a surrogate model.

    The impact conditions are impact position, relative speed, and e0 (ball-wall restitution) and
    mass of the ball. Each range extends six standard deviations beyond the nominal values. There
    are two exceptions:

    * The lower limit of the speed is a further 1 % lower.
    * The range of e0 never extends below the smallest e0 of the ball's data sheet, and never above
      1.

    The scatter of position and speed is taken from the cannons in the catalog. The same arguments
    always give the same ranges, and thus the same surrogate.
    """
    either = np.array([-1.0, 1.0])
    sigmas = 6  # half width of the range; a collision outside costs time but no accuracy
    # The scatter is that of the cannons in data/instruments; with other cannons more collisions are
    # outside the range. The scatter of the position [m] includes the uncertainty of the center of
    # percussion.
    place = np.array(nominal_positions(procedure, bat)) + sigmas * 1.7e-3 * either
    axis = bat.body.length - procedure.pivot_from_knob
    bat_speed = procedure.turn_rate(bat.body.length) * (axis - place[::-1])
    speed = procedure.ball_speed + bat_speed + sigmas * 0.2 * either  # m/s
    speed[0] *= 0.99  # a hit six sigma above the bat's axis is oblique
    spread, line = ball.spread, ball.restitution
    hits = max(spread.hit_restitution, spread.bat_hit_restitution or 0.0)
    scatter = hypot(spread.restitution, hits, line.value_u)
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
