"""The protocol of a rig, for the rigs of this project and of other packages, and their discovery.

A rig is installed by an entry point of the group ``virtual_lab.rigs``. A laboratory commissions it
once, which draws its calibration errors. The resulting station then carries out plans: it takes
true specimens and returns raw records and truth. The conformance tests in
``tests/rigs/conformance.py`` check every installed rig.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError, nearest
from virtual_lab.records import Record, ShotLog
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.physics.truth import TrueBalls, TrueBat, TrueOutcome
from virtual_lab.streams import Draws, Owner, Quiet, Slots, Streams
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import Array

if TYPE_CHECKING:
    from virtual_lab.simulation.collision.ladder import CollisionLaw
    from virtual_lab.simulation.instruments.camera.camera import Camera


class Reality(Enum):
    """Degree of realism of a simulated test day."""

    REAL = "real"
    NOISE_FREE = "noise-free"  # no randomness, but vibration, counts, drag and friction
    IDEAL = "ideal"  # noise-free, and all individuals and instruments have their nominal values

    def draws(self, seed: int, *branch: int, laboratory: int | Slots = 0) -> Draws:
        """Return the random numbers of one or n laboratories, or of a `branch` of their seed.

        All are 0 unless the reality is real.
        """
        return Streams(seed, branch, laboratory) if self is Reality.REAL else Quiet(laboratory)


class MotionModel(Enum):
    """Model of the motion of ball and bat through flight, contact and rebound."""

    CLOSED_FORM = "closed-form"  # all shots at once; by events if a ball hits other objects
    PYMUNK = "pymunk"  # one scene per shot


E = TypeVar("E", bound=Enum)


def member_of(kind: type[E], key: str, name: str) -> E:
    """Return the member of the enumeration `kind` that has the value `name`.

    Raises `InputError`, which names the argument `key`, if there is no such member.
    """
    names = [each.value for each in kind]
    if name not in names:
        raise InputError("", key, name, f"allowed: {', '.join(names)}")
    return kind(name)


class Stage(Enum):
    """Stage of the test that a rig serves."""

    BENCH = "bench"  # mass and dimensions of bat and balls
    BALLS = "balls"  # restitution of the balls on a wall
    IMPACT = "impact"  # shots at the bat


@dataclass(frozen=True, slots=True, kw_only=True)
class Specimen:
    """The specimen on a rig: true bat, true balls, and the models of their collision.

    A block of laboratories has one common bat or one bat per laboratory, and one lot of balls per
    laboratory.
    """

    bat: TrueBat
    balls: TrueBalls
    collision: CollisionLaw

    def at(self, plan: ShotPlan) -> Specimen:
        """Return the specimen for the shots of a plan, in which ball i is the ball of shot i."""
        bat, balls = self.bat.of_shots(plan.owner), self.balls.of_shots(plan.owner, plan.ball)
        return replace(self, bat=bat, balls=balls)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotPlan:
    """Plan of the operator: ball, nominal speed [m/s] and set impact position [m] of each shot.

    `slot` is the number of each shot in its laboratory, on which its random numbers depend. `owner`
    is the index of that laboratory in its block. For a single laboratory it is Python's `Ellipsis`.
    A rig that swings the bat rotates it at `turn_rate` [rad/s], a number or (shot,). Other rigs
    ignore `turn_rate`.
    """

    slot: Slots
    ball: NDArray[np.int_]
    speed: Array
    place: Array
    turn_rate: Array | float = 0.0
    owner: Owner = ...
    detail: RecordDetail = RecordDetail.FULL
    motion: MotionModel = MotionModel.CLOSED_FORM

    def log(self) -> ShotLog:
        """Return the operator's log of the plan."""
        return ShotLog(
            ball=self.ball.astype(np.float64), nominal_speed=self.speed, place=self.place
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RigOutput:
    """Raw records by channel, and true values keyed by name, arrays with a leading shot axis."""

    records: Mapping[str, Record]
    truth: Mapping[str, Array] = field(default_factory=dict)


class Station(Protocol):
    """A rig commissioned in one laboratory."""

    @property
    def calibration(self) -> Mapping[str, Estimate]:
        """Calibrated values of the rig's constants, as the laboratory knows them."""
        ...

    @property
    def true_constants(self) -> Mapping[str, float]:
        """True values of the constants; sealed."""
        ...

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Carry out a plan, and return raw records and true values."""
        ...


class ErrorFreeTest(Protocol):
    """A test without errors."""

    def outcome(self, plan: ShotPlan, specimen: Specimen) -> TrueOutcome:
        """Return the measurand of this bat with the lot's mean ball at the plan's shots."""
        ...


@runtime_checkable
class ImpactStation(Station, ErrorFreeTest, Protocol):
    """A station that fires at bats and also returns the error-free result."""


@runtime_checkable
class FilmingStation(Station, Protocol):
    """A station with a camera that can also record whole frames."""

    @property
    def camera(self) -> Camera:
        """Camera that films the flights."""
        ...

    def film(self, plan: ShotPlan, specimen: Specimen, draws: Draws, folder: Path) -> None:
        """Film the first shot of a plan: ``shot-0.mp4``, a ``.csv`` of time stamps, a preview."""
        ...

    def frames(self, plan: ShotPlan, specimen: Specimen, draws: Draws, count: int) -> Array:
        """Return whole frames of a plan's first shot, (count, row, column), from 0 to 1."""
        ...

    def without_camera(self) -> Station:
        """Return the station with its camera switched off."""
        ...


@runtime_checkable
class StoringStation(Station, Protocol):
    """A station with a store in which the balls are kept."""

    def store_humidity(self, draws: Draws, box: Slots | None = None) -> Array | None:
        """Return the relative humidity of the store, 0 to 1, (laboratory,), None without one."""
        ...


@runtime_checkable
class WallStation(Station, Protocol):
    """A station that fires at a wall, which can be less than rigid."""

    def with_wall(self, restitution: Array | float) -> WallStation:
        """Return the station with a wall of `restitution`, relative to a rigid wall's rebound."""
        ...


class Rig(Protocol):
    """A machine before it is commissioned in a laboratory.

    A rig that sets ``blocks = True`` can be commissioned in a block of laboratories at once, if
    their instruments record only summary values. Its station then has arrays of constants and
    carries out the shots of all laboratories together. Any other rig is simulated in one laboratory
    after another.
    """

    @property
    def name(self) -> str: ...
    @property
    def stage(self) -> Stage: ...
    @property
    def channels(self) -> Mapping[str, type[Record]]:
        """Type of the record of each channel."""
        ...

    def commission(self, draws: Draws, *, ideal: bool = False) -> Station:
        """Commission the rig in a laboratory: draw its calibration errors."""
        ...


def knows_blocks(rig: Rig) -> bool:
    """Return whether all laboratories of a block can be commissioned at once with this rig.

    The result is True if the attribute `blocks` of the rig is True.
    """
    return getattr(rig, "blocks", False) is True


@runtime_checkable
class MotionRig(Rig, Protocol):
    """A rig that has other models of the motion besides the closed form."""

    @property
    def motions(self) -> Collection[MotionModel]:
        """Models of the motion that the rig has."""
        ...


@cache
def installed_rigs() -> Mapping[str, Rig]:
    """Return all rigs installed on this computer, keyed by name, in alphabetical order.

    All packages with rigs are loaded. If a package cannot be loaded, its error is raised.
    """
    return MappingProxyType({name: point.load() for name, point in _entry_points().items()})


@cache
def _entry_points() -> Mapping[str, EntryPoint]:
    return {point.name: point for point in sorted(entry_points(group="virtual_lab.rigs"))}


def find_rig(name: str, stage: Stage) -> Rig:
    """Return the installed rig `name` of a stage. Only the package of this rig is loaded.

    Raises `InputError` if no rig has that name, or if the rig belongs to another stage. To list the
    rigs of the stage in the message, all packages are then loaded. If a package cannot be loaded,
    its error is raised.
    """
    point = _entry_points().get(name)
    # Only this rig is loaded, because other rigs may need modules that this test does not.
    rig: Rig | None = point.load() if point else None
    if rig is None or rig.stage is not stage:
        fitting = [key for key, rig in installed_rigs().items() if rig.stage is stage]
        allowed = f"{nearest(name, fitting)}installed: {', '.join(fitting)}"
        raise InputError("", f"{stage.value} rig", name, allowed)
    return rig
