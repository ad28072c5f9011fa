"""A block of laboratories of one study on the day of their tests, all of them at once.

Instruments write sums and the bat is nominal. What a laboratory draws, measures and certifies
depends on its number alone, not on the others of its block: it is what it is in a test of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.lab.laboratory import constant_name, lot_constants
from virtual_lab.lab.measurand import measurands
from virtual_lab.lab.plans import BeforeShots, bench_plan, impact_plan, stage_records, wall_plan
from virtual_lab.lab.setup import TestSetup
from virtual_lab.measurement.certification import BlockCertification, evaluate_block
from virtual_lab.measurement.procedure import next_shots
from virtual_lab.measurement.reduction.observations import ImpactReadings
from virtual_lab.measurement.session_reduction import (
    BlockPreparation,
    BlockReduction,
    observe_hits,
    prepare_block,
    reduce_shots,
)
from virtual_lab.records.block import SessionBlock
from virtual_lab.simulation.rig import (
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    find_rig,
    knows_blocks,
)
from virtual_lab.simulation.truth import draw_balls, made_bat
from virtual_lab.streams import Draws, Quiet, Streams
from virtual_lab.uncertainty.estimate import Known
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LaboratoryBlock:
    """Laboratories of one study with installed rigs, a bat and their lots of balls."""

    setup: TestSetup
    draws: Draws
    stations: Mapping[Stage, Any]
    specimen: Specimen
    sessions: SessionBlock  # what stands in them before anything is measured

    @classmethod
    def open(cls, setup: TestSetup, seed: int, numbers: NDArray[np.int_]) -> LaboratoryBlock:
        """Install the rigs and draw the balls of the laboratories of these numbers.

        `setup` is that of a round robin: instruments write sums, the bat is nominal. Its `test` is
        a branch of the draws, as of `Laboratory.open`. `InputError` as there.
        """
        rules, bat, ball = setup.rules.spec, setup.bat.spec, setup.ball.spec
        assert setup.collision is not None, "a round robin has one"
        draws = Streams(seed, (), numbers)
        own = draws if setup.test is None else Streams(seed, (setup.test,), numbers)
        stations = {
            stage: find_rig(name, stage).commission(draws) for stage, name in setup.rigs.items()
        }
        known: dict[str, Any] = {  # Known: the rigs know blocks
            constant_name(stage, name): each
            for stage, station in stations.items()
            for name, each in station.calibration.items()
        }
        lot = {
            name: Known.stacked([each] * numbers.size) for name, each in lot_constants(ball).items()
        }
        return cls(
            setup=setup,
            draws=own,
            stations=stations,
            specimen=Specimen(
                bat=made_bat(bat, Quiet()),
                balls=draw_balls(ball, rules.balls, own),
                collision=setup.collision,
            ),
            sessions=SessionBlock(
                procedure_text=setup.rules.text,
                calibration=known | lot,
                records={},
                owner=np.zeros(0, dtype=np.intp),
                laboratories=numbers.size,
                bat=bat.name,
                bat_sport=bat.sport or "",
                ball_sport=ball.sport or "",
            ),
        )

    def play(self, stage: Stage, plan: ShotPlan) -> RigOutput:
        """Carry out ordered shots of all laboratories."""
        output: RigOutput = self.stations[stage].play(plan, self.specimen, self.draws)
        return output


def can_be_a_block(setup: TestSetup) -> bool:
    """Return whether the laboratories of a setup can be played all at once."""
    rigs = (find_rig(name, stage) for stage, name in setup.rigs.items())
    plain = not setup.faults.names and not setup.rules.spec.controlled and not setup.made
    return plain and all(knows_blocks(rig) for rig in rigs)


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockTest:
    """The certifications of a block with their sealed truth, which only a study may read."""

    certified: BlockCertification
    reduced: BlockReduction
    readings: ImpactReadings  # of all shots, as fired
    measurands: Mapping[str, Array]  # ``metric``, and by the quantities' names, (laboratory,)
    sessions: SessionBlock
    laboratories: LaboratoryBlock
    shots: Mapping[str, Array]  # what really happened, (shot,)


def certify_block(setup: TestSetup, seed: int, numbers: NDArray[np.int_]) -> BlockTest:
    """Take the bat of a round robin through its procedure in the laboratories of these numbers.

    Raises
    ------
    InputError
        As `Laboratory.open`; records of one of them that cannot be reduced.
    """
    block = LaboratoryBlock.open(setup, seed, numbers)
    block, preparation = _prepared(block)
    rounds, reduced = _fired(block, preparation)
    sessions = _with_shots(block.sessions, rounds, reduced.owner)
    readings = observe_hits(sessions, preparation)
    certified = evaluate_block(sessions, reduced, readings)
    return BlockTest(
        certified=certified,
        reduced=reduced,
        readings=readings,
        measurands=measurands(
            block.stations[Stage.IMPACT], block.specimen, reduced, certified.outcome.weights
        ),
        sessions=sessions,
        laboratories=block,
        shots={
            name: np.concatenate([each.truth[name] for each in rounds]) for name in rounds[0].truth
        },
    )


def _prepared(block: LaboratoryBlock) -> tuple[LaboratoryBlock, BlockPreparation]:
    """Measure bats and balls, fire the balls at the wall, and reduce what was recorded."""
    rules, shape = block.setup.rules.spec, (block.sessions.laboratories,)
    bench = block.play(Stage.BENCH, bench_plan(rules, shape))
    plan = wall_plan(rules, block.setup.detail, shape)
    wall = block.play(Stage.BALLS, plan)
    balls = block.specimen.balls.as_found(plan.ball, wall.truth["restitution_loss"], plan.owner)
    records = {Stage.BENCH.value: bench.records, Stage.BALLS.value: wall.records}
    sessions = replace(block.sessions, records=records)
    preparation = prepare_block(sessions)
    found = replace(balls, used=preparation.used[:, 0])
    specimen = replace(block.specimen, balls=found)
    return replace(block, specimen=specimen, sessions=sessions), preparation


def _fired(
    block: LaboratoryBlock, preparation: BlockPreparation
) -> tuple[list[RigOutput], BlockReduction]:
    """Fire and judge, round by round, until the procedure asks no laboratory for more."""
    rules = block.setup.rules.spec
    empty = np.zeros(0)
    asked = next_shots(
        rules, preparation.percussion, empty.astype(np.intp), empty, empty.astype(bool), empty
    )
    rounds: list[RigOutput] = []
    reduced: BlockReduction | None = None
    along = block.sessions.calibration.get("impact.cannon.along")
    before = BeforeShots(
        fired=np.zeros(preparation.laboratories, dtype=np.intp),
        used=preparation.used[:, 0],
        turn_rate=preparation.turn_rate,
        along=along.value if along else np.zeros(preparation.laboratories),
    )
    while asked.owner.size:
        owner = asked.owner
        plan = impact_plan(block.setup, asked, before)
        rounds.append(block.play(Stage.IMPACT, plan))
        sessions = _with_shots(block.sessions, rounds[-1:], owner)
        more = reduce_shots(sessions, preparation, observe_hits(sessions, preparation))
        reduced = more if reduced is None else reduced.with_round(more)
        fired = before.fired + np.bincount(owner, minlength=before.fired.size)
        before = before._replace(fired=fired)
        asked = reduced.next_shots()
    assert reduced is not None, "every procedure asks for shots"
    return rounds, reduced


def _with_shots(
    sessions: SessionBlock, rounds: Sequence[RigOutput], owner: NDArray[np.intp]
) -> SessionBlock:
    """Return the sessions with the records of rounds at the bat, one after another."""
    records = {**sessions.records, Stage.IMPACT.value: stage_records(rounds)}
    return replace(sessions, records=records, owner=owner)
