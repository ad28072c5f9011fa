"""Time integration of collisions: many scenes together, or one scene at a time.

`InStep` is the fast method and checks its results. A scene is integrated again with finer steps if
its energy balance is wrong, if it came too close to an event, if the contact was long, or if ball
and bat met or the compression turned more than once. If the results still differ by more than the
finer steps explain, `OneByOne` integrates the scene, halving the steps until e_A no longer changes.
If e_A does not converge, the scene has failed and gives no result.
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
# time after first touch within which further contacts are simulated [s]. Ball and vibrating barrel
# separate finally within 6 ms: e_A of free and pinned bats is the same for windows up to 40 ms. A
# bat clamped at its handle swings back after 11 ms and hits a slow ball again. This is another
# collision, which changes e_A by up to 0.7.
WINDOW = 0.01
STAYS = 1e-6  # tolerance of a converged e_A, and of the energy balance [share of the energy]


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionBatch:
    """Input of n scenes, with N flexible modes per bat."""

    squares: Array  # (bats, N), squared angular frequencies [1/s^2]
    bat: Counts  # (n,), index of the struck bat
    shapes: Array  # (n, N), squared shapes at the impacts [1/kg]
    ball_mass: Array  # (n,) [kg]
    inverse_mass: Array  # (n,), 1/m + squared rigid shapes [1/kg]
    stiffness: Array  # (n,) [N/m^a]
    exponent: Array  # (n,), a
    restitution: Array  # (n,), e0
    unloading: Array  # (n,), b
    compliance: Array  # (n,), compliance of the stiff modes [m/N]
    speed: Array  # (n,) [m/s]

    @classmethod
    def together(cls, parts: Sequence[Self]) -> Self:
        """Return one batch with the scenes of several bats, in the order of the bats."""
        arrays = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in cls.__slots__
            if name != "bat"
        }
        counts = [len(part.speed) for part in parts]
        return cls(bat=np.repeat(np.arange(len(parts)), counts), **arrays)

    def by_bat(self) -> list[slice]:
        """Return the slice of the scenes of each bat in a batch made by `together`."""
        ends = np.searchsorted(self.bat, np.arange(len(self.squares) + 1))
        return [slice(*pair) for pair in pairwise(ends)]

    def part(self, chosen: Counts | slice) -> Self:
        """Return the `chosen` scenes, indices or a slice. All bats are kept."""
        arrays = {name: getattr(self, name)[chosen] for name in self.__slots__ if name != "squares"}
        return replace(self, **arrays)

    def efficiency_gap(self, one: FinalStates, other: FinalStates) -> Array:
        """Return the difference in e_A between two integrations of these scenes, (n,)."""
        with np.errstate(invalid="ignore"):  # diverged scenes
            rates = other.states[:, -1] - one.states[:, -1]
        return rates / (self.speed * self.inverse_mass * self.ball_mass)

    def fastest(self) -> Array:
        """Return the highest angular frequency of each scene's bat, (n,) [rad/s]."""
        return np.asarray(np.sqrt(self.squares.max(axis=1, initial=0.0))[self.bat])


@dataclass(frozen=True, slots=True, kw_only=True)
class FinalStates:
    """States after the last release, and data on their integration; the leading axis is n."""

    states: Array  # (n, 2 N + 2): p, p', s, s' of `modal_kernel`
    time: Array  # (n,), time from first touch to last release [s]
    loss: Array  # (n,), energy lost in the ball [J]
    contacts: Counts
    reloads: Counts
    steps: Counts  # number of steps of the last try, 0 for `OneByOne`
    open_energy: Array  # (n,), error of the energy balance [share of the ball's energy]
    failure: Counts  # a `Failure`
    redone: Counts  # 0 for the first try, 1 and 2 for finer steps, 3 for `OneByOne`

    @classmethod
    def first_try(cls, states: Array, sums: Array, counts: Counts) -> Self:
        """Return the states from the output of a kernel."""
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
        """Return the `chosen` scenes, indices or a slice."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in self.__slots__})

    def put(self, chosen: Counts, other: FinalStates) -> None:
        """Overwrite the states of the `chosen` scenes with `other`."""
        for name in self.__slots__:
            getattr(self, name)[chosen] = getattr(other, name)


class Stepper(Protocol):
    """Method of time integration."""

    def follow(self, struck: CollisionBatch, window: float = WINDOW) -> FinalStates:
        """Return the states after all contacts that begin within `window` [s] of first touch."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class OneByOne:
    """Integration scene by scene, to about 1e-10 in e_A; steps end on the events to rounding."""

    refinement: float = 1.0  # divisor of the steps
    mode_step: float = 0.7  # step times the highest angular frequency
    ball_step: float = 0.14  # step times the largest angular frequency of the ball
    last_resort: float = 0.75  # refinement for doubtful scenes, accurate to about 1e-9

    def follow(self, struck: CollisionBatch, window: float = WINDOW) -> FinalStates:
        """Return the states after all contacts that begin within `window` [s] of first touch."""
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
        final = FinalStates.first_try(states, sums, counts)
        closed = np.abs(final.open_energy) < STAYS  # False for NaN
        final.failure[(final.failure == Failure.SOUND) & ~closed] = Failure.OPEN
        return final

    def settle(
        self, struck: CollisionBatch, other: FinalStates, window: float = WINDOW
    ) -> FinalStates:
        """Integrate the scenes, halving the steps until e_A converges.

        A scene has converged if its e_A agrees with `other`, an earlier integration. A scene that
        does not converge gets the failure `UNSETTLED`.
        """
        states = replace(self, refinement=self.last_resort).follow(struck, window)
        remaining = np.flatnonzero(~self._stays(struck, states, other))
        for refinement in (0.5, 2.0, 4.0):
            if not remaining.size:
                break
            part = struck.part(remaining)
            new = replace(self, refinement=refinement * self.last_resort).follow(part, window)
            stays = self._stays(part, states.part(remaining), new)
            if refinement > 1:
                states.put(remaining, new)
            remaining = remaining[~stays & (states.failure[remaining] != Failure.ENDLESS)]
        states.failure[remaining[states.failure[remaining] == Failure.SOUND]] = Failure.UNSETTLED
        return states

    @staticmethod
    def _stays(struck: CollisionBatch, one: FinalStates, other: FinalStates) -> NDArray[np.bool_]:
        near = np.abs(struck.efficiency_gap(one, other)) < STAYS  # False for NaN
        return np.asarray(near & (one.failure == Failure.SOUND))

    def _steps(self, struck: CollisionBatch) -> Array:
        """Return the time steps (n,) [s] that resolve the fastest mode and the stiffest ball."""
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
    """Integration of many scenes together, to a tolerance in e_A.

    The tolerance was verified on 1e5 random scenes along the whole bat, with 8 bending modes and
    with the default number. With fewer than 8 modes some errors are a few times the tolerance.
    """

    tolerance: float
    splitting: Splitting
    mode_step: float  # step times the highest angular frequency
    ball_step: float  # step times the current angular frequency of the ball
    first: float  # first compression [share of the largest one on a wall]
    growth: float  # growth factor of the first steps
    turn: float  # largest speed at which the approach has turned [share of the initial speed]
    release: float = 1e-2  # largest compression of a released ball [share of the largest one]
    # gap below which a missed second touch makes a scene doubtful; for a release a tenth of it
    # [share of the largest compression]
    brush: float = 0.03
    # duration above which phase errors of the modes accumulate without an energy error [s]
    long: float = 1.5e-3
    shorter: float = 2.5  # divisor of the steps in each further try
    tries: int = 3  # number of tries before `OneByOne`
    # largest difference of two tries [tolerance]; finer steps divide errors by ten times this
    # number
    agree: float = 25.0

    def __post_init__(self) -> None:
        limit = self.splitting.limit
        for name in ("mode_step", "ball_step"):  # a ball on a stiff bat is an oscillator too
            if not 0 < getattr(self, name) <= limit:
                allowed = f"allowed: above 0, to {limit:.4f}, the limit of stability"
                raise InputError("modal", name, getattr(self, name), allowed)

    def finer(self, factor: float) -> Self:
        """Return the method with steps and tolerances divided by `factor`."""
        return replace(
            self,
            mode_step=self.mode_step / factor,
            ball_step=self.ball_step / factor,
            first=self.first / factor,
            turn=self.turn / factor,
            brush=self.brush / factor**2,
        )

    def follow(self, struck: CollisionBatch, window: float = WINDOW) -> FinalStates:
        """Return the states after all contacts that begin within `window` [s] of first touch."""
        final, doubted = self.one_pass(struck, window)
        remaining = np.flatnonzero(doubted)
        stepper = self
        for tries in range(1, self.tries):
            if not remaining.size:
                break
            part, stepper = struck.part(remaining), stepper.finer(self.shorter)
            finer, sure = stepper._try(part, window)
            finer.redone[:] = tries
            gap = part.efficiency_gap(finer, final.part(remaining))
            final.put(remaining, finer)
            sure &= (np.abs(gap) < self.agree * self.tolerance) & (finer.contacts <= tries + 1)
            remaining = remaining[~sure]
        if remaining.size:
            exact = OneByOne().settle(struck.part(remaining), final.part(remaining), window)
            exact.redone[:] = self.tries
            final.put(remaining, exact)
        return final

    def one_pass(
        self, struck: CollisionBatch, window: float = WINDOW
    ) -> tuple[FinalStates, NDArray[np.bool_]]:
        """Return the states after one pass, and a mask (n,) of the scenes to integrate again."""
        final, sure = self._try(struck, window)
        often = (final.contacts > 1) | (final.reloads > 1)
        return final, ~sure | often | (final.time > self.long)

    def _try(self, struck: CollisionBatch, window: float) -> tuple[FinalStates, NDArray[np.bool_]]:
        """Return the states after one pass, and a mask (n,) of the scenes without doubt."""
        from virtual_lab.simulation.collision import batch_kernel as kernel

        a, b, c, v = struck.exponent, struck.unloading, struck.inverse_mass, struck.speed
        first = self.first * ((a + 1) * v**2 / (2 * struck.stiffness * c)) ** (1 / (a + 1))
        inputs = kernel.Given(
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
        modes = struck.shapes.shape[1]
        states, sums, counts = out = kernel.prepare_results(len(v), modes)
        kernel.collide_lanes(
            kernel.prepare_lanes(modes),
            struck.squares,
            struck.bat,
            struck.shapes,
            # All arrays have one type; numba would compile the kernel again for each mixture of
            # types.
            kernel.Given(*(np.require(each, np.float64, ["C", "W"]) for each in inputs)),
            bool(np.any(inputs.series > 0)),
            (self.splitting.kicks, self.splitting.drifts),
            kernel.StepRule(self.growth, self.turn, self.brush, window),
            out,
        )
        final = FinalStates.first_try(states, sums, counts)
        return final, (counts[:, 2] == 0) & (np.abs(final.open_energy) < self.tolerance)


FINE = InStep(
    tolerance=1e-6,
    splitting=SRKN_11,
    mode_step=2.4,
    ball_step=0.55,
    first=0.02,
    growth=3.0,
    turn=3e-3,
)
