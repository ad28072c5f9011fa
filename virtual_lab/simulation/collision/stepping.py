"""How collisions are followed in time: many in step, or one by one.

`InStep` is the quick way and knows what it is worth: a scene whose energy does not close, that
came too near to an event, that took long, or that met or turned more than once is stepped
again, finer; where the answers still differ by more than finer steps explain, it is followed one
by one, in steps halved until e_A stays. What stays nowhere has failed: nothing is to be made of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.scene import Failure
from virtual_lab.simulation.collision.splitting import SRKN_11, Splitting
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.units import Array

Counts = NDArray[np.int64]
# s from the first touch, in which contacts must begin to count. Ball and ringing barrel part for
# good within 6 ms: e_A of free and pinned bats is the same for windows up to 40 ms. A bat clamped
# at its handle swings back from 11 ms on, onto a ball that hardly left, by up to 0.7 in e_A: that
# is another collision.
WINDOW = 0.01
STAYS = 1e-6  # in e_A, and of the energy what may not close


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionBatch:
    """Balls on the way into bats: n scenes, N flexible modes a bat."""

    squares: Array  # (bats, N), squared angular frequencies [1/s^2]
    bat: Counts  # (n,), which one is struck
    shapes: Array  # (n, N), squared shapes at the impacts [1/kg]
    ball_mass: Array  # (n,) [kg]
    inverse_mass: Array  # (n,), 1/m + squared rigid shapes [1/kg]
    stiffness: Array  # (n,) [N/m^a]
    exponent: Array  # (n,), a
    restitution: Array  # (n,), e0
    unloading: Array  # (n,), b
    compliance: Array  # (n,), of the stiff modes [m/N]
    speed: Array  # (n,) [m/s]

    @classmethod
    def together(cls, parts: Sequence[Self]) -> Self:
        """Return the scenes of several bats in one batch, bat by bat."""
        own = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in cls.__slots__
            if name != "bat"
        }
        return cls(bat=np.repeat(np.arange(len(parts)), [len(part.speed) for part in parts]), **own)

    def by_bat(self) -> list[slice]:
        """Return where each bat's scenes are in a batch put together."""
        ends = np.searchsorted(self.bat, np.arange(len(self.squares) + 1))
        return [slice(*pair) for pair in pairwise(ends)]

    def part(self, chosen: Counts | slice) -> Self:
        """Return some of the scenes."""
        own = {name: getattr(self, name)[chosen] for name in self.__slots__ if name != "squares"}
        return replace(self, **own)

    def efficiency_gap(self, one: FinalStates, other: FinalStates) -> Array:
        """Return the difference in e_A of two ways to follow these scenes, (n,)."""
        with np.errstate(invalid="ignore"):  # of what ran away
            rates = other.states[:, -1] - one.states[:, -1]
        return rates / (self.speed * self.inverse_mass * self.ball_mass)

    def fastest(self) -> Array:
        """Return the highest angular frequency of each scene's bat, (n,) [rad/s]."""
        return np.asarray(np.sqrt(self.squares.max(axis=1, initial=0.0))[self.bat])


@dataclass(frozen=True, slots=True, kw_only=True)
class FinalStates:
    """States after the last release, and how it went; leading axis n."""

    states: Array  # (n, 2 N + 2): p, p', s, s' of `modal_kernel`
    time: Array  # (n,), first touch to last release [s]
    loss: Array  # (n,), work lost in the ball [J]
    contacts: Counts
    reloads: Counts
    steps: Counts  # of the last try; 0 where none are counted, one by one
    open_energy: Array  # (n,), share of the ball's that does not close
    failure: Counts  # a `Failure`
    redone: Counts  # 0 first try, 1 and 2 in finer steps, 3 one by one

    @classmethod
    def first_try(cls, states: Array, sums: Array, counts: Counts) -> Self:
        """Return what a kernel gave."""
        none = np.zeros(len(states), dtype=np.int64)
        return cls(
            states=states,
            time=sums[:, 0],
            loss=sums[:, 1],
            open_energy=sums[:, 2],
            contacts=counts[:, 0],
            reloads=counts[:, 1],
            failure=counts[:, 2],
            steps=counts[:, 3] if counts.shape[1] > 3 else none.copy(),
            redone=none,
        )

    def part(self, chosen: Counts | slice) -> Self:
        """Return some of the scenes."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in self.__slots__})

    def put(self, chosen: Counts, other: FinalStates) -> None:
        """Overwrite some of the scenes with `other`."""
        for name in self.__slots__:
            getattr(self, name)[chosen] = getattr(other, name)


class Stepper(Protocol):
    """A way to follow collisions."""

    def follow(self, struck: CollisionBatch, window: float = WINDOW) -> FinalStates:
        """Follow all contacts that begin within `window` [s] of the first touch."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class OneByOne:
    """Scene by scene to about 1e-10 in e_A: every event met to rounding."""

    refinement: float = 1.0  # divides the steps
    mode_step: float = 0.7  # step times the highest angular frequency
    ball_step: float = 0.14  # step times the angular frequency of the ball at its steepest
    last_resort: float = 0.75  # refinement of what no other try is sure of, to about 1e-9

    def follow(self, struck: CollisionBatch, window: float = WINDOW) -> FinalStates:
        """Follow all contacts that begin within `window` [s] of the first touch."""
        from virtual_lab.simulation.collision.modal_kernel import collide

        ball = (
            struck.stiffness,
            struck.exponent,
            struck.unloading,
            struck.compliance,
            struck.speed,
        )
        states, sums, counts = collide(
            struck.squares,
            struck.bat,
            struck.shapes,
            struck.inverse_mass,
            np.stack(ball, axis=1),
            self._steps(struck),
            window,
        )
        followed = FinalStates.first_try(states, sums, counts)
        closed = np.abs(followed.open_energy) < STAYS  # not of a nan
        followed.failure[(followed.failure == Failure.SOUND) & ~closed] = Failure.OPEN
        return followed

    def settled(
        self, struck: CollisionBatch, other: FinalStates, window: float = WINDOW
    ) -> FinalStates:
        """Follow them in steps halved until e_A stays; say where it does not.

        It stays at once where `other` steps already came to the same.
        """
        found = replace(self, refinement=self.last_resort).follow(struck, window)
        left = np.flatnonzero(~self._stays(struck, found, other))
        for refinement in (0.5, 2.0, 4.0):
            if not left.size:
                break
            part = struck.part(left)
            new = replace(self, refinement=refinement * self.last_resort).follow(part, window)
            stays = self._stays(part, found.part(left), new)
            if refinement > 1:
                found.put(left, new)
            left = left[~stays & (found.failure[left] != Failure.ENDLESS)]
        found.failure[left[found.failure[left] == Failure.SOUND]] = Failure.UNSETTLED
        return found

    @staticmethod
    def _stays(struck: CollisionBatch, one: FinalStates, other: FinalStates) -> NDArray[np.bool_]:
        near = np.abs(struck.efficiency_gap(one, other)) < STAYS  # not of a nan
        return np.asarray(near & (one.failure == Failure.SOUND))

    def _steps(self, struck: CollisionBatch) -> Array:
        """Return the time steps (n,): the fastest mode and the steepest ball both resolved."""
        contact = wall_contact(
            1 / struck.inverse_mass,
            struck.speed,
            struck.stiffness,
            struck.exponent,
            struck.restitution,
        )
        slope = struck.unloading * contact.force / contact.compression
        steepest = np.sqrt(slope * struck.inverse_mass)
        rate = np.maximum(steepest / self.ball_step, struck.fastest() / self.mode_step)
        return np.asarray(1 / (rate * self.refinement))


@dataclass(frozen=True, slots=True, kw_only=True)
class InStep:
    """Many scenes at once, to a tolerance in e_A.

    Measured on 1e5 random scenes all over the bat with 8 bending modes and with the default;
    below 8 modes some scenes err by a few times the tolerance.
    """

    tolerance: float
    splitting: Splitting
    mode_step: float  # step times the highest angular frequency
    ball_step: float  # step times the angular frequency of the ball at its stiffness of the moment
    first: float  # first compression over the greatest one on a wall
    growth: float  # of the first steps
    turn: float  # share of the speed at which the approach counts as turned
    release: float = 1e-2  # share of the greatest compression at which it counts as released
    brush: float = 0.03  # share of it, as near to touching again is in doubt; a tenth, to releasing
    # s: of longer contacts errors in the modes' phases add up, though the energy closes
    long: float = 1.5e-3
    shorter: float = 2.5  # how much shorter the steps of a second try
    tries: int = 3  # before a scene is followed one by one
    # tolerances two tries may differ by; shorter steps divide errors by ten times that
    agree: float = 25.0

    def __post_init__(self) -> None:
        limit = self.splitting.limit
        for name in ("mode_step", "ball_step"):  # a ball on a stiff bat is an oscillator too
            if not 0 < getattr(self, name) <= limit:
                allowed = f"allowed: above 0, to {limit:.4f}, the limit of stability"
                raise InputError("modal", name, getattr(self, name), allowed)

    def finer(self, factor: float) -> Self:
        """Return the same with steps shorter by a factor."""
        return replace(
            self,
            mode_step=self.mode_step / factor,
            ball_step=self.ball_step / factor,
            first=self.first / factor,
            turn=self.turn / factor,
            brush=self.brush / factor**2,
        )

    def follow(self, struck: CollisionBatch, window: float = WINDOW) -> FinalStates:
        """Follow all contacts that begin within `window` [s] of the first touch."""
        followed, doubted = self.one_pass(struck, window)
        left = np.flatnonzero(doubted)
        stepper = self
        for tries in range(1, self.tries):
            if not left.size:
                break
            part, stepper = struck.part(left), stepper.finer(self.shorter)
            finer, sure = stepper._try(part, window)
            finer.redone[:] = tries
            gap = part.efficiency_gap(finer, followed.part(left))
            followed.put(left, finer)
            sure &= (np.abs(gap) < self.agree * self.tolerance) & (finer.contacts <= tries + 1)
            left = left[~sure]
        if left.size:
            exact = OneByOne().settled(struck.part(left), followed.part(left), window)
            exact.redone[:] = self.tries
            followed.put(left, exact)
        return followed

    def one_pass(
        self, struck: CollisionBatch, window: float = WINDOW
    ) -> tuple[FinalStates, NDArray[np.bool_]]:
        """Return where one pass gets to, and which scenes (n,) are to be stepped again."""
        followed, sure = self._try(struck, window)
        often = (followed.contacts > 1) | (followed.reloads > 1)
        return followed, ~sure | often | (followed.time > self.long)

    def _try(self, struck: CollisionBatch, window: float) -> tuple[FinalStates, NDArray[np.bool_]]:
        """Return where one pass gets to, and which scenes (n,) it is sure of."""
        from virtual_lab.simulation.collision.batch_kernel import Given, StepRule, collide_lanes

        a, b, c, v = struck.exponent, struck.unloading, struck.inverse_mass, struck.speed
        first = self.first * ((a + 1) * v**2 / (2 * struck.stiffness * c)) ** (1 / (a + 1))
        given = Given(
            exponent=a,
            unloading=b,
            log_k=np.log2(struck.stiffness),
            series=struck.compliance,
            speed=v,
            inverse_mass=c,
            first=first,
            first_force=struck.stiffness * first**a,
            mode_step=self.mode_step / np.maximum(struck.fastest(), 1.0),
            ball_step=self.ball_step / np.sqrt(c),
            near_end=np.minimum(self.release, 1e-8 ** (1 / (b + 1))),
        )
        states, sums, counts = collide_lanes(
            struck.squares,
            struck.bat,
            struck.shapes,
            # one type of array, or the kernel is compiled anew for each mixture
            Given(*(np.require(each, np.float64, ["C", "W"]) for each in given)),
            (self.splitting.kicks, self.splitting.drifts),
            StepRule(self.growth, self.turn, self.brush, window),
        )
        followed = FinalStates.first_try(states, sums, counts)
        return followed, (counts[:, 2] == 0) & (np.abs(followed.open_energy) < self.tolerance)


FINE = InStep(
    tolerance=1e-6,
    splitting=SRKN_11,
    mode_step=2.4,
    ball_step=0.55,
    first=0.02,
    growth=3.0,
    turn=3e-3,
)
