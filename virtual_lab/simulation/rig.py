"""What a rig is: the protocol every machine meets, ours and anybody's, and how it is found.

A rig is installed by an entry point of the group ``virtual_lab.rigs``. A laboratory
commissions it once, which draws the errors its calibrations left, and then has it play
plans: true specimens in, raw records and sealed truth out. The conformance suite in
``tests/rigs/conformance.py`` holds every installed rig to this.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError, nearest
from virtual_lab.records import Record, ShotLog
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.truth import TrueBalls, TrueBat, TrueOutcome
from virtual_lab.streams import Draws, Owner, Quiet, Slots, Streams
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

if TYPE_CHECKING:
    from virtual_lab.simulation.collision.ladder import Ladder
    from virtual_lab.simulation.instruments.camera.camera import Camera


class Reality(Enum):
    """How much of a real day is played."""

    REAL = "real"
    NOISE_FREE = "noise-free"  # no randomness; ring, counts, drag and friction stay
    IDEAL = "ideal"  # nor these: every individual and instrument equals its nominal

    def draws(self, seed: int, *branch: int, laboratory: int | Slots = 0) -> Draws:
        """Return the random numbers of one laboratory, or of some, (n,); or of a branch of them."""
        return Streams(seed, branch, laboratory) if self is Reality.REAL else Quiet(laboratory)


class MotionRung(Enum):
    """How ball and bat are carried through flight, contact and rebound."""

    CLOSED_FORM = "closed-form"  # all shots at once, from event to event where the ball meets more
    PYMUNK = "pymunk"  # a scene a shot


E = TypeVar("E", bound=Enum)


def named(kind: type[E], key: str, name: str) -> E:
    """Return the member of a kind by its value; `InputError` under `key` where there is none."""
    names = [each.value for each in kind]
    if name not in names:
        raise InputError("", key, name, f"allowed: {', '.join(names)}")
    return kind(name)


class Stage(Enum):
    """What a rig is for."""

    BENCH = "bench"  # weighs and measures the bat and the balls
    BALLS = "balls"  # measures the balls' restitution on a wall
    IMPACT = "impact"  # fires balls at the bat


@dataclass(frozen=True, slots=True, kw_only=True)
class Specimen:
    """What is on the rig: true bat, true balls, and the collision between them.

    That of a block of laboratories has one bat for all or one of each, and a lot of balls of each.
    """

    bat: TrueBat
    balls: TrueBalls
    collision: Ladder

    def at(self, plan: ShotPlan) -> Specimen:
        """Return the specimen of a plan's shots: a lot of which shot i takes its ball i."""
        bat, balls = self.bat.of_shots(plan.owner), self.balls.of_shots(plan.owner, plan.ball)
        return replace(self, bat=bat, balls=balls)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotPlan:
    """What the operator asks for: a ball, a nominal speed [m/s] and a set place [m] a shot.

    `slot` is each shot's number in its laboratory, to which all that is random of it belongs;
    `owner` counts that laboratory in its block, `...` where it is alone. A rig that swings its bat
    turns it at `turn_rate` [rad/s], (shot,) or of all; others leave it at rest.
    """

    slot: Slots
    ball: NDArray[np.int_]
    speed: Array
    place: Array
    turn_rate: Array | float = 0.0
    owner: Owner = ...
    detail: RecordDetail = RecordDetail.FULL
    motion: MotionRung = MotionRung.CLOSED_FORM

    def log(self) -> ShotLog:
        """Return the operator's log of the plan."""
        return ShotLog(
            ball=self.ball.astype(np.float64), nominal_speed=self.speed, place=self.place
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RigOutput:
    """Raw records by channel, and what really happened, arrays with a leading shot axis."""

    records: Mapping[str, Record]
    truth: Mapping[str, Array] = field(default_factory=dict)


class Station(Protocol):
    """A rig commissioned in one laboratory."""

    @property
    def calibration(self) -> Mapping[str, Estimate]:
        """What the laboratory knows of the rig's constants."""
        ...

    @property
    def true_constants(self) -> Mapping[str, float]:
        """What they really are; sealed."""
        ...

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Carry out a plan."""
        ...


@runtime_checkable
class ImpactStation(Station, Protocol):
    """A station that fires at bats can also be asked for the error-free answer."""

    def outcome(self, plan: ShotPlan, specimen: Specimen) -> TrueOutcome:
        """Return the measurand at the plan's speeds and places: this bat, the lot's mean ball."""
        ...


@runtime_checkable
class FilmingStation(Station, Protocol):
    """A station with a camera that can also keep whole frames."""

    @property
    def camera(self) -> Camera:
        """The camera that looks at the flights."""
        ...

    def film(self, plan: ShotPlan, specimen: Specimen, draws: Draws, folder: Path) -> None:
        """Film the first shot of a plan: ``shot-0.mp4``, its ``.csv`` of times, a preview."""
        ...

    def frames(self, plan: ShotPlan, specimen: Specimen, draws: Draws, count: int) -> Array:
        """Return some whole frames of a plan's first shot, (count, row, column), 0 to 1."""
        ...

    def unfilmed(self) -> Station:
        """Return the station with its camera off."""
        ...


@runtime_checkable
class WallStation(Station, Protocol):
    """A station that fires at a wall can stand before a wall that gives."""

    def with_wall(self, restitution: float) -> WallStation:
        """Return the station whose wall gives back `restitution` of what a rigid one would."""
        ...


class Rig(Protocol):
    """A machine as it is sold.

    One that sets ``blocks = True`` can be set up in a block of laboratories at once, whose
    instruments write sums: drawn from for all of them its station knows arrays of constants, and
    plays the shots of all. Any other is played in one laboratory after another.
    """

    @property
    def name(self) -> str: ...
    @property
    def stage(self) -> Stage: ...
    @property
    def channels(self) -> Mapping[str, type[Record]]:
        """Every channel its records may have, and their type."""
        ...

    def commission(self, draws: Draws, *, ideal: bool = False) -> Station:
        """Set the rig up in a laboratory: draw the errors that calibration leaves."""
        ...


def knows_blocks(rig: Rig) -> bool:
    """Return whether a rig can be set up in a block of laboratories at once."""
    return getattr(rig, "blocks", False) is True


@runtime_checkable
class MotionRig(Rig, Protocol):
    """A rig that can carry its balls otherwise than in closed form."""

    @property
    def motions(self) -> Collection[MotionRung]:
        """The models of the motion it has."""
        ...


@cache
def installed_rigs() -> Mapping[str, Rig]:
    """Return every rig installed on this machine by name."""
    found = {point.name: point.load() for point in sorted(entry_points(group="virtual_lab.rigs"))}
    return MappingProxyType(found)


def find_rig(name: str, stage: Stage) -> Rig:
    """Return the installed rig `name`; `InputError` where none is, or of another stage."""
    rigs = installed_rigs()
    fitting = [key for key, rig in rigs.items() if rig.stage is stage]
    if name not in fitting:
        allowed = f"{nearest(name, fitting)}installed: {', '.join(fitting)}"
        raise InputError("", f"{stage.value} rig", name, allowed)
    return rigs[name]
