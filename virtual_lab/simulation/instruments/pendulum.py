"""The pendulum stand: a bat in a clamp, with a photogate for passages in one direction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from virtual_lab.catalog.specs import Dimension
from virtual_lab.records import PendulumRecord, Record
from virtual_lab.relations.pendulum import amplitude_factor, small_period
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    Freedom,
    StandardDeviation,
    TrueConstant,
    stated_constant,
)
from virtual_lab.simulation.instruments.indicator import quantise
from virtual_lab.streams import Draws, of_owners, owners_and_slots
from virtual_lab.uncertainty.estimate import Estimate

Time = Annotated[float, Ge(0), Dimension("time")]
Number = Annotated[float, Ge(0), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class PendulumSpec(CalibratedSpec):
    """Data sheet and certificate of the stand, its clamp and its timer."""

    kind: str
    title: str
    swings: Annotated[int, Gt(0), Dimension("number")]
    release_amplitude: Annotated[float, Gt(0), Dimension("angle")]
    amplitude_decay: Number  # relative loss per swing
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
    timer_fast: Annotated[float, Gt(-1), Dimension("number")] = 0.0  # rate error of the timer
    amplitude_offset: Annotated[float, Dimension("angle")] = 0.0
    amplitude_dof: Freedom = inf
    pivot_dof: Freedom = inf
    clamp_inertia_dof: Freedom = inf
    clamp_moment_dof: Freedom = inf

    def numbers_in(
        self, records: Sequence[Record], constants: Mapping[str, float]
    ) -> Mapping[str, object]:
        """Return number, amplitude and decay of the swings, and the jitter that the times show."""
        numbers: dict[str, object] = {}
        for record in records:
            if not isinstance(record, PendulumRecord):
                continue
            swings = record.times.shape[1] - 1
            spans = record.times[:, -1] - record.times[:, 0]
            first, last = (
                float(ends.mean()) - constants["amplitude_offset"]
                for ends in (record.first_amplitude, record.last_amplitude)
            )
            numbers = {
                "swings": swings,
                "release_amplitude": first,
                "amplitude_decay": max(1 - (last / first) ** (1 / swings), 0.0),
                "amplitude_resolution": 0.0,
                "timer_resolution": 0.0,
                "timer_jitter": StandardDeviation.of(spans / sqrt(2)),
            }
        return numbers

    def certificate(self) -> dict[str, Estimate]:
        """Return the certified constants of timer, amplitude scale, pivot and clamp."""
        return {
            "clock": stated_constant(1 + self.timer_fast, self.timer_clock_u),
            "amplitude_offset": stated_constant(
                self.amplitude_offset, self.amplitude_u, self.amplitude_dof
            ),
            "pivot_from_knob": stated_constant(self.pivot_from_knob, self.pivot_u, self.pivot_dof),
            "clamp_inertia": stated_constant(
                self.clamp_inertia, self.clamp_inertia_u, self.clamp_inertia_dof
            ),
            "clamp_moment": stated_constant(
                self.clamp_moment, self.clamp_moment_u, self.clamp_moment_dof
            ),
        }


@dataclass(frozen=True, slots=True)
class Pendulum(CalibratedInstrument[PendulumSpec]):
    """A pendulum stand of one laboratory or a block of laboratories."""

    def swing(
        self,
        *,
        inertia: TrueConstant,
        moment: TrueConstant,
        gravity: TrueConstant,
        releases: int,
        draws: Draws,
        name: str,
    ) -> PendulumRecord:
        """Return the record of `releases` of a bat of true `inertia` [kg m²] and `moment` [kg m].

        `moment` is M d, and `gravity` is the gravity in the hall [m/s²]. In a block the releases
        are in the order of the laboratories.
        """
        spec, true = self.spec, self.true
        period = small_period(
            inertia + true["clamp_inertia"], moment + true["clamp_moment"], gravity
        )
        amplitude = spec.release_amplitude * (1 - spec.amplitude_decay) ** np.arange(
            spec.swings + 1
        )
        # The period of a decaying swing follows from the amplitude at its middle.
        factor = amplitude_factor(np.sqrt(amplitude[:-1] * amplitude[1:]))
        passages = np.cumsum(np.multiply.outer(period, [0.0, *factor]), axis=-1)
        clock_times = np.asarray(true["clock"])[..., None] * passages
        ends = np.add.outer(true["amplitude_offset"], amplitude[[0, -1]])
        owner, slots = owners_and_slots(self.laboratories, releases)
        streams = draws.at(owner)
        start = spec.timer_resolution * streams.uniform(f"{name}.start", 1, slots)
        jitter = spec.timer_jitter * streams.normal(f"{name}.jitter", spec.swings + 1, slots)
        times = of_owners(clock_times, owner) + start + jitter
        read = quantise(of_owners(ends, owner), spec.amplitude_resolution)
        first, last = np.broadcast_to(read, (slots.size, 2)).T
        return PendulumRecord(
            times=quantise(times, spec.timer_resolution), first_amplitude=first, last_amplitude=last
        )
