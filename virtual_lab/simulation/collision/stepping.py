"""Time integration of collisions, with a check of each result.

All scenes are integrated once. A scene is doubtful if ball and bat met more than once, if the
compression turned more than once, if a step may have hidden an event, or if the energy balance is
wrong. It is integrated again with finer steps until two results for e_A agree. If they never agree,
the scene has failed and gives no result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.simulation.collision.scene import Failure
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
    steps: Counts  # number of steps of the last try
    open_energy: Array  # (n,), error of the energy balance [share of the ball's energy]
    failure: Counts  # a `Failure`
    redone: Counts  # number of tries with finer steps

    def part(self, chosen: Counts | slice) -> Self:
        """Return the `chosen` scenes, indices or a slice."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in self.__slots__})

    def put(self, chosen: Counts, other: FinalStates) -> None:
        """Overwrite the states of the `chosen` scenes with `other`."""
        for name in self.__slots__:
            getattr(self, name)[chosen] = getattr(other, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stepper:
    """Integration scene by scene, with steps that resolve the fastest mode and the stiffest ball.

    A step is stated as its phase, which is the step times an angular frequency.
    """

    mode_step: float = 2.33  # phase of the fastest mode [rad]; unstable above 3.14
    ball_step: float = 0.47  # phase of the ball on the steepest branch of its force law [rad]
    flight_step: float = 0.58  # phase of the fastest mode in a flight [rad]
    rough: float = 2.0  # unloading exponent below which the force is not smooth at the release
    # divisors of the steps of further tries. With a factor of 2 between the first two, both missed
    # the same reload and agreed on an e_A that was wrong by 2.4e-6.
    finer: tuple[float, ...] = (3.0, 6.0, 12.0)

    def refine(self, divisor: float) -> Self:
        """Return the method with steps divided by `divisor`."""
        steps = (self.mode_step, self.ball_step, self.flight_step)
        mode, ball, flight = (step / divisor for step in steps)
        return replace(self, mode_step=mode, ball_step=ball, flight_step=flight)

    def follow(self, struck: CollisionBatch, window: float = WINDOW) -> FinalStates:
        """Return the states after all contacts that begin within `window` [s] of first touch."""
        final, doubtful = self.one_pass(struck, window)
        remaining = np.flatnonzero(doubtful)
        for tries, divisor in enumerate(self.finer, start=1):
            if not remaining.size:
                break
            part, before = struck.part(remaining), final.part(remaining)
            finer, _ = self.refine(divisor).one_pass(part, window)
            finer.redone[:] = tries
            final.put(remaining, finer)
            near = np.abs(part.efficiency_gap(finer, before)) < STAYS  # False for NaN
            sound = (before.failure == Failure.SOUND) & (finer.failure == Failure.SOUND)
            remaining = remaining[~(near & sound)]
        final.failure[remaining[final.failure[remaining] == Failure.SOUND]] = Failure.UNSETTLED
        return final

    def one_pass(
        self, struck: CollisionBatch, window: float = WINDOW
    ) -> tuple[FinalStates, NDArray[np.bool_]]:
        """Return the states after one pass, and a mask (n,) of the scenes to integrate again."""
        from virtual_lab.simulation.collision.modal_kernel import collide

        k, a, b = struck.stiffness, struck.exponent, struck.unloading
        states, sums, counts = collide(
            struck.squares,
            struck.bat,
            struck.shapes,
            struck.inverse_mass,
            np.stack((k, a, b, struck.compliance, struck.speed), axis=1),
            self._steps(struck),
            window,
        )
        contacts, reloads, failure, hidden, number = counts.T
        open_energy = sums[:, 2]
        closed = np.abs(open_energy) < STAYS  # False for NaN
        failure[(failure == Failure.SOUND) & ~closed] = Failure.OPEN
        doubtful = (contacts > 1) | (reloads > 1) | (hidden > 0) | (failure != Failure.SOUND)
        final = FinalStates(
            states=states,
            time=sums[:, 0],
            loss=sums[:, 1],
            contacts=contacts,
            reloads=reloads,
            steps=number,
            open_energy=open_energy,
            failure=failure,
            redone=np.zeros_like(failure),
        )
        return final, doubtful | (b < self.rough)

    def _steps(self, struck: CollisionBatch) -> Array:
        """Return the time steps (n, 2) [s] of contacts and of flights."""
        contact = wall_contact(
            1 / struck.inverse_mass,
            struck.speed,
            struck.stiffness,
            struck.exponent,
            struck.restitution,
        )
        slope = struck.unloading * contact.force / contact.compression
        steepest, fastest = np.sqrt(slope * struck.inverse_mass), struck.fastest()
        rate = np.maximum(steepest / self.ball_step, fastest / self.mode_step)
        return np.stack((1 / rate, self.flight_step / np.maximum(fastest, 1.0)), axis=1)


STEPPER = Stepper()
