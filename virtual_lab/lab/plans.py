"""Plans of a procedure for each stage of a test, in one laboratory or in a block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from virtual_lab.lab.setup import TestSetup
from virtual_lab.measurement.procedure import NextShots, Procedure, round_to_setting
from virtual_lab.records import Record, join
from virtual_lab.records.session import Session
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import Reality, RigOutput, ShotPlan, Stage
from virtual_lab.streams import Slots, of_owners, owners_and_slots
from virtual_lab.units import Array, Mask

ALONE = ()  # shape of a single laboratory; (n,) for a block


def bench_plan(
    rules: Procedure, laboratories: tuple[int, ...] = ALONE, box: Slots | int = 0
) -> ShotPlan:
    """Return the plan to weigh every ball of the lot once, in each laboratory.

    `laboratories` is (n,) for a block of n laboratories, and () for one laboratory. The arrays of
    the plan have one entry per laboratory and ball, sorted by laboratory. Speed and position are
    NaN. `box` is the number of the box of balls, from 0, (n,) for a block.
    """
    owner, ball = owners_and_slots(laboratories, rules.balls)
    nothing, slot = np.full(ball.shape, np.nan), ball + rules.balls * of_owners(box, owner)
    return ShotPlan(slot=slot, ball=ball, speed=nothing, place=nothing, owner=owner)


def wall_plan(
    rules: Procedure,
    detail: RecordDetail,
    laboratories: tuple[int, ...] = ALONE,
    box: Slots | int = 0,
) -> ShotPlan:
    """Return the plan to fire every ball at the wall at each speed of the procedure.

    Each ball is fired `rules.wall_hits` times at each speed [m/s]. The arrays of the plan are
    (shot,). The shots are sorted by laboratory and ball. All impact positions of the plan are 0.

    Parameters
    ----------
    detail
        Whether the instruments record every reading or only summary values.
    laboratories
        The tuple ``(n,)`` for a block of n laboratories, or ``()`` for one laboratory.
    box
        Number of the box of balls, from 0, (n,) for a block. The numbers of the shots go on from
        box to box.
    """
    speeds = np.tile(rules.wall_speeds, rules.wall_hits)
    owner, slot = owners_and_slots(laboratories, rules.balls * speeds.size)
    return ShotPlan(
        slot=slot + rules.balls * speeds.size * of_owners(box, owner),
        ball=slot // speeds.size,
        speed=speeds[slot % speeds.size],
        place=np.zeros(slot.shape),
        owner=owner,
        detail=detail,
    )


class BeforeShots(NamedTuple):
    """State of each laboratory before the next shots, arrays (laboratory,)."""

    fired: NDArray[np.intp]  # number of shots so far
    used: Mask  # balls that were not rejected, (laboratory, ball)
    turn_rate: Array  # angular rate of the bat required by the procedure [rad/s]
    along: Array  # correction of the cannon's aim [m]


def impact_plan(setup: TestSetup, shots: NextShots, before: BeforeShots) -> ShotPlan:
    """Return the plan to fire one ball at each requested impact position.

    The arrays of the plan are (shot,). The balls are used in turn, except rejected balls. Each
    laboratory must have at least one ball that is not rejected. A planned position is the requested
    distance from the barrel tip minus the known error of the aim [m]. This error is positive toward
    the knob. The planned position is rounded to 0.5 mm, the resolution of the rig's setting, except
    in an ideal laboratory.
    """
    owner = shots.owner
    turn, counts = np.argsort(~before.used, axis=1, kind="stable"), before.used.sum(axis=1)
    slot = before.fired[owner] + shot_numbers(owner)
    exact = setup.reality is Reality.IDEAL
    return ShotPlan(
        slot=slot,
        ball=turn[owner, slot % counts[owner]],
        speed=np.full(slot.shape, setup.rules.spec.ball_speed),
        place=round_to_setting(shots.position - before.along[owner], exact=exact),
        turn_rate=before.turn_rate[owner],
        owner=owner if setup.shape else ...,
        detail=setup.detail,
        motion=setup.motion,
    )


def shot_numbers(owner: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the index of each shot within its laboratory, from 0, (shot,).

    `owner` is the index of the laboratory of each shot, (shot,), and must be sorted.
    """
    return np.asarray(np.arange(owner.size) - np.searchsorted(owner, owner))


def stage_records(rounds: Sequence[RigOutput]) -> dict[str, Record]:
    """Return the records of one stage of a test, keyed by channel, from the outputs of its rounds.

    A stage is one kind of measurement: bat and balls on the bench, balls at the wall, or shots at
    the bat. A round is a group of shots that are fired before the next shots are planned. A channel
    is the record of one instrument. Each record holds the shots of all rounds in order. Raises
    `IndexError` if there is no round.
    """
    return {
        channel: join([each.records[channel] for each in rounds]) for channel in rounds[0].records
    }


def with_records(session: Session, stage: Stage, rounds: Sequence[RigOutput]) -> Session:
    """Return the session with the records of one stage replaced by the outputs of `rounds`.

    Each record holds the shots of all rounds in order. Raises `IndexError` if there is no round.
    """
    return replace(session, records={**session.records, stage.value: stage_records(rounds)})
