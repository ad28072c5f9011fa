"""The pendulum stand: a bat hung in a clamp, same-way passages timed by a photogate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np
from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.records import PendulumRecord
from virtual_lab.relations.pendulum import amplitude_factor, small_period
from virtual_lab.simulation.instruments.indicator import quantise
from virtual_lab.streams import Draws
from virtual_lab.uncertainty.estimate import Estimate

__all__ = ["Pendulum", "PendulumSpec"]

Time = Annotated[float, Ge(0), Dimension("time")]
Number = Annotated[float, Ge(0), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class PendulumSpec(Spec):
    """Data sheet and calibration of the stand, its clamp, its timer and its place on earth."""

    kind: str
    title: str
    swings: Annotated[int, Gt(0), Dimension("number")]
    release_amplitude: Annotated[float, Gt(0), Dimension("angle")]
    amplitude_decay: Number  # relative loss a swing
    amplitude_resolution: Annotated[float, Ge(0), Dimension("angle")]
    amplitude_u: Annotated[float, Ge(0), Dimension("angle")]
    timer_resolution: Time
    timer_jitter: Time
    timer_clock_u: Number
    pivot_from_knob: Annotated[float, Gt(0), Dimension("length")]
    pivot_u: Annotated[float, Ge(0), Dimension("length")]
    clamp_inertia: Annotated[float, Ge(0), Dimension("inertia")]
    clamp_inertia_u: Annotated[float, Ge(0), Dimension("inertia")]
    clamp_moment: Annotated[float, Ge(0), Dimension("moment")]
    clamp_moment_u: Annotated[float, Ge(0), Dimension("moment")]
    gravity: Annotated[float, Gt(0), Dimension("acceleration")]
    gravity_u: Annotated[float, Ge(0), Dimension("acceleration")]

    def ideal(self) -> Self:
        """Return the stand whose every constant is known and whose timer has no steps."""
        return replace(
            self,
            amplitude_resolution=0.0,
            amplitude_u=0.0,
            timer_resolution=0.0,
            timer_jitter=0.0,
            timer_clock_u=0.0,
            pivot_u=0.0,
            clamp_inertia_u=0.0,
            clamp_moment_u=0.0,
            gravity_u=0.0,
        )


@dataclass(frozen=True, slots=True)
class Pendulum:
    """One stand with its true constants, drawn once a laboratory."""

    spec: PendulumSpec
    constants: dict[str, float]

    @classmethod
    def commission(cls, spec: PendulumSpec, draws: Draws, name: str) -> Self:
        known = _calibration(spec)
        errors = draws.normal(f"{name}.errors", (len(known),))
        return cls(
            spec,
            {
                key: estimate.value + estimate.u * float(error)
                for (key, estimate), error in zip(known.items(), errors, strict=True)
            },
        )

    def calibration(self) -> dict[str, Estimate]:
        """Return what the laboratory knows of the stand."""
        return _calibration(self.spec)

    def errors(self) -> dict[str, float]:
        """Return the true constants, to be sealed."""
        return dict(self.constants)

    def swing(
        self, *, inertia: float, moment: float, releases: int, draws: Draws, name: str
    ) -> PendulumRecord:
        """Time `releases` of a bat of true `inertia` [kg m²] and `moment` M d [kg m]."""
        spec, true = self.spec, self.constants
        period = small_period(
            inertia + true["clamp_inertia"], moment + true["clamp_moment"], true["gravity"]
        )
        decay = (1 - spec.amplitude_decay) ** np.arange(spec.swings + 1)
        amplitude = spec.release_amplitude * np.broadcast_to(decay, (releases, decay.size))
        # a decaying swing takes its time from the amplitude at its middle
        middle = np.sqrt(amplitude[:, :-1] * amplitude[:, 1:])
        swings = period * amplitude_factor(middle)
        passages = np.concatenate([np.zeros((releases, 1)), swings.cumsum(axis=1)], axis=1)
        slots = np.arange(releases)
        start = spec.timer_resolution * draws.uniform(f"{name}.start", 1, slots)
        jitter = spec.timer_jitter * draws.normal(f"{name}.jitter", spec.swings + 1, slots)
        shown = amplitude[:, [0, -1]] + true["amplitude_offset"]
        ends = quantise(shown, spec.amplitude_resolution)
        return PendulumRecord(
            times=quantise(true["clock"] * passages + start + jitter, spec.timer_resolution),
            first_amplitude=ends[:, 0],
            last_amplitude=ends[:, 1],
        )


def _calibration(spec: PendulumSpec) -> dict[str, Estimate]:
    return {
        "clock": Estimate(value=1.0, u=spec.timer_clock_u),
        "amplitude_offset": Estimate(value=0.0, u=spec.amplitude_u),
        "pivot_from_knob": Estimate(value=spec.pivot_from_knob, u=spec.pivot_u),
        "clamp_inertia": Estimate(value=spec.clamp_inertia, u=spec.clamp_inertia_u),
        "clamp_moment": Estimate(value=spec.clamp_moment, u=spec.clamp_moment_u),
        "gravity": Estimate(value=spec.gravity, u=spec.gravity_u),
    }
