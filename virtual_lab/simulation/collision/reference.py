"""The reference model: an independent solution of high accuracy, for tests and charts.

The ball and each mode have a coordinate. The motion is split into phases at the events and
integrated by an adaptive Runge-Kutta method of order eight. This model shares only the contact
patch with the modal model, not the time integration and not the code of the force law. It can also
use another force law.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from typing import Literal, Self

import numpy as np

from virtual_lab.catalog.specs import BatBody
from virtual_lab.simulation.collision.modal import energy_split
from virtual_lab.simulation.collision.patch import PATCH, patch_shape
from virtual_lab.simulation.collision.scene import Collisions, Failure, Scenes
from virtual_lab.simulation.collision.stepping import STAYS, WINDOW
from virtual_lab.simulation.physics.ball import BallLaw, Branch, Event, LawOfBall, PowerLaw
from virtual_lab.simulation.physics.beam import Support, support_words
from virtual_lab.simulation.physics.modes import Modes, modes_of
from virtual_lab.units import Array

Method = Literal["RK45", "DOP853", "LSODA", "Radau"]
FLIGHT = Branch(force=lambda u, rate: 0.0, ends={Event.TOUCH: 1})


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceModel:
    """A bat described by many modes and solved to a tight tolerance; slow."""

    modes: Modes
    patch: float = PATCH  # full width of the patch [m]
    tolerance: float = 1e-12
    leak: float = 1e4  # largest error of the energy balance [tolerance]
    method: Method = "DOP853"
    longest_step: float = 0.2  # largest step times the highest angular frequency, to miss no event
    law: LawOfBall = PowerLaw.of
    held: str = ""  # description of the support for error messages
    name: str = "reference"

    @classmethod
    def of(
        cls, body: BatBody, support: Support, bending_modes: int = 100, law: LawOfBall = PowerLaw.of
    ) -> Self:
        """Return the model of a bat and a force law. Raises `InputError` like `ModalModel`."""
        modes = modes_of(body, support, bending_modes)
        return cls(modes=modes, law=law, held=support_words(support))

    def collide(self, scenes: Scenes) -> Collisions:
        """Return the collisions of the scenes.

        Raises `InputError` for a position beyond the bat or a scene that gives no result.
        """
        scenes.require_on(self.modes.length)
        shapes = patch_shape(self.modes, scenes.impact_position, self.patch)
        runs = [
            self._one(
                _Scene(
                    shape=shapes[i],
                    angular=self.modes.angular_frequencies,
                    stiffness=-(self.modes.angular_frequencies**2),
                    mass=float(scenes.ball_mass[i]),
                    speed=float(scenes.relative_speed[i]),
                    law=self.law(
                        stiffness=float(scenes.stiffness[i]),
                        exponent=float(scenes.exponent[i]),
                        restitution=float(scenes.ball_restitution[i]),
                        speed=float(scenes.relative_speed[i]),
                    ),
                )
            )
            for i in range(len(scenes))
        ]
        states = np.array([run.state for run in runs])
        count = self.modes.count
        displacements, velocities = states[:, :count], states[:, count + 1 : -2]
        speed, mass = scenes.relative_speed, scenes.ball_mass
        e_A = -states[:, -2] / speed
        losses = states[:, -1]
        energy = energy_split(
            self.modes, displacements, velocities, e_A, losses, mass * speed**2 / 2
        )
        closed = np.abs(energy.total - 1) < max(STAYS, self.leak * self.tolerance)  # False for NaN
        failure = np.array([run.failure for run in runs], dtype=np.int64)
        failure[(failure == Failure.SOUND) & ~closed] = Failure.OPEN
        scenes.require_sound(failure, self.held)
        return Collisions(
            collision_efficiency=e_A,
            modal_displacements=displacements,
            modal_velocities=velocities,
            contact_time=np.array([run.time for run in runs]),
            impulse=mass * speed * (1 + e_A),
            contacts=np.array([run.contacts for run in runs], dtype=np.int64),
            reloads=np.array([run.reloads for run in runs], dtype=np.int64),
            redone=np.zeros(len(scenes), dtype=np.int64),
            energy=energy,
        )

    def _one(self, scene: _Scene) -> _Run:
        y = np.zeros(2 * (self.modes.count + 1) + 1)
        y[-2] = scene.speed
        run, touch = _Run(state=y), True
        while touch:
            run = self._contact(scene, run)
            again = None if run.failure else self._flight(scene, run)
            run, touch = again or run, again is not None
        return run

    def _contact(self, scene: _Scene, run: _Run) -> _Run:
        """Integrate one contact, branch by branch, to its release."""
        met, branch = Event.TOUCH, None
        while met is not Event.RELEASE:
            branch = scene.law.branch(met, scene.compression(run.state), branch)
            phase = self._phase(scene, branch, run, run.time + 0.2)  # limit of a contact [s]
            if phase is None:
                return replace(run, failure=Failure.ENDLESS)
            run, met = phase
            run = replace(run, reloads=run.reloads + (met is Event.BACK))
        return replace(run, contacts=run.contacts + 1)

    def _flight(self, scene: _Scene, run: _Run) -> _Run | None:
        """Integrate the flight from a release to the next touch; None without a touch in time."""
        end = min(WINDOW, scene.out_of_reach(run))
        phase = self._phase(scene, FLIGHT, run, end) if run.time < end else None
        return phase[0] if phase else None

    def _phase(
        self, scene: _Scene, branch: Branch, start: _Run, end: float
    ) -> tuple[_Run, Event] | None:
        """Integrate one branch of the force law to its first event; None without one by `end`."""
        from scipy.integrate import solve_ivp

        try:
            solution = solve_ivp(
                lambda _, y: scene.derivative(y, branch),
                (start.time, end),
                start.state,
                method=self.method,
                rtol=self.tolerance,
                atol=self.tolerance * scene.sizes,
                max_step=self.longest_step / max(float(scene.angular.max(initial=0.0)), 1e4),
                events=[_event(scene, branch, event) for event in branch.ends],
            )
        except OverflowError:  # the force exceeds the largest float
            return None
        for event, times, states in zip(
            branch.ends, solution.t_events or [], solution.y_events or [], strict=True
        ):
            if len(times):
                return replace(start, time=float(times[0]), state=states[0]), event
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """State of a collision during the integration."""

    state: Array  # displacements of modes and ball, their rates, work done on the force law
    time: float = 0.0
    contacts: int = 0
    reloads: int = 0
    failure: Failure = Failure.SOUND


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scene:
    """Input of one scene: scalars, and arrays (N,) over the modes."""

    shape: Array
    angular: Array
    mass: float
    speed: float
    law: BallLaw
    stiffness: Array  # acceleration of each mode per displacement [1/s^2]

    @property
    def sizes(self) -> Array:
        """Typical size of each state variable, for a millisecond at the speed of the ball."""
        n = len(self.shape) + 1
        energy = [self.mass * self.speed / 2]
        return self.speed * np.concatenate((np.full(n, 1e-3), np.ones(n), energy))

    def compression(self, y: Array) -> float:
        n = len(self.shape)
        return float(y[n] - self.shape @ y[:n])

    def rate(self, y: Array) -> float:
        return self.compression(y[len(self.shape) + 1 : -1])

    def derivative(self, y: Array, branch: Branch) -> Array:
        n, rates = len(self.shape), np.zeros(y.size)
        u = self.compression(y)
        rates[: n + 1] = y[n + 1 : -1]
        np.multiply(self.stiffness, y[:n], out=rates[n + 1 : -2])
        if u > 0:
            rate = self.rate(y)
            force = branch.force(u, rate)
            rates[n + 1 : -2] += self.shape * force
            rates[-2], rates[-1] = -force / self.mass, force * rate
        return rates

    def out_of_reach(self, run: _Run) -> float:
        """Return the time [s] after which ball and vibrating bat cannot meet again.

        The ball approaches the rigid bat at the speed `drift`, and the amplitude of the vibrating
        surface is at most `amplitude`.
        """
        n, y, rigid = len(self.shape), run.state, self.angular == 0
        place, rate = y[:n] * self.shape, y[n + 1 : -2] * self.shape
        drift = float(y[-2] - rate[rigid].sum())
        amplitude = np.hypot(place[~rigid], rate[~rigid] / self.angular[~rigid]).sum()
        ahead = float(y[n] - place[rigid].sum() + amplitude)
        return run.time + ahead / -drift if drift < 0 else inf


def _event(scene: _Scene, branch: Branch, event: Event) -> Callable[[float, Array], float]:
    def crossing(_: float, y: Array) -> float:
        if event in (Event.TURN, Event.BACK):
            return scene.rate(y)
        return scene.compression(y) - (branch.peak if event is Event.FULL else 0.0)

    crossing.terminal = True  # type: ignore[attr-defined]
    crossing.direction = branch.ends[event]  # type: ignore[attr-defined]
    return crossing
