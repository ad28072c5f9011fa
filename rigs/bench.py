"""The bench, which measures bat and balls with scale, rule, balance stand and pendulum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Gt

from virtual_lab import catalog
from virtual_lab.catalog.specs import Dimension, Spec
from virtual_lab.records import (
    REFERENCE_MASS,
    ClimateReadings,
    LengthReadings,
    MassReadings,
    PendulumRecord,
    Record,
)
from virtual_lab.simulation.instruments import FittedStation, Instrument, InstrumentFactory
from virtual_lab.simulation.instruments.air import Gravity, GravitySpec, HallAir, HallAirSpec
from virtual_lab.simulation.instruments.calibrated import StandardDeviation
from virtual_lab.simulation.instruments.climate import (
    ClimateLogger,
    ClimateLoggerSpec,
    HallSpec,
)
from virtual_lab.simulation.instruments.indicator import (
    Mass,
    Rule,
    RuleSpec,
    Scale,
    ScaleSpec,
)
from virtual_lab.simulation.instruments.pendulum import Pendulum, PendulumSpec
from virtual_lab.simulation.physics.beam import barrel_radius
from virtual_lab.simulation.stations.rig import RigOutput, ShotPlan, Specimen, Stage
from virtual_lab.streams import Draws, Slots, owners_and_slots
from virtual_lab.units import Array

Repeats = Annotated[int, Gt(1), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchSpec(Spec):
    """The instruments of the bench, and the number of readings of each."""

    name: str
    title: str
    scale: str
    rule: str
    stand: str
    pendulum: str
    climate: str
    air: str
    gravity: str
    repeats: Repeats
    releases: Repeats
    reference: Mass  # reference mass, weighed before and after bat and balls
    hall: HallSpec
    store: HallSpec | None = None  # store of the balls; None: the humidity is that of their sheet


class Bench:
    """The bench as a rig."""

    name = "bench"
    stage = Stage.BENCH
    blocks = True
    channels: Mapping[str, type[Record]] = {
        "bat-mass": MassReadings,
        "ball-mass": MassReadings,
        REFERENCE_MASS: MassReadings,
        "length": LengthReadings,
        "barrel-radius": LengthReadings,
        "balance": LengthReadings,
        "pendulum": PendulumRecord,
        "climate": ClimateReadings,
        "store": ClimateReadings,
    }

    def commission(self, draws: Draws, *, ideal: bool = False) -> BenchStation:
        spec = catalog.load("rigs", self.name, BenchSpec).spec
        fit = InstrumentFactory(draws=draws, ideal=ideal).commission
        return BenchStation(
            spec=spec,
            scale=fit(Scale.commission, ScaleSpec, spec.scale, "bench.scale"),
            rule=fit(Rule.commission, RuleSpec, spec.rule, "bench.rule"),
            stand=fit(Rule.commission, RuleSpec, spec.stand, "bench.stand"),
            pendulum=fit(Pendulum.commission, PendulumSpec, spec.pendulum, "bench.pendulum"),
            climate=fit(ClimateLogger.commission, ClimateLoggerSpec, spec.climate, "bench.climate"),
            air=fit(HallAir.commission, HallAirSpec, spec.air, "hall.air"),
            hall=fit(Gravity.commission, GravitySpec, spec.gravity, "hall.gravity"),
            ideal=ideal,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchStation(FittedStation):
    """The bench in one laboratory, or in a block of them."""

    channels: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "scale": ("bat-mass", "ball-mass"),
        "rule": ("length", "barrel-radius"),
        "stand": ("balance",),
    }

    spec: BenchSpec
    scale: Scale
    rule: Rule
    stand: Rule
    pendulum: Pendulum
    climate: ClimateLogger
    air: HallAir  # air of the hall with the climate logger
    hall: Gravity
    ideal: bool

    def instruments(self) -> dict[str, Instrument]:
        return {
            "scale": self.scale,
            "rule": self.rule,
            "stand": self.stand,
            "pendulum": self.pendulum,
            **({} if self.ideal else {"climate": self.climate}),  # an ideal hall has no air
            "hall": self.hall,
        }

    def numbers_in(
        self, records: Mapping[str, Record], measured: Mapping[str, StandardDeviation]
    ) -> Mapping[str, object]:
        """Return the numbers of readings per item and of releases of the pendulum."""
        return {
            "repeats": records["bat-mass"].sizes()["repeat"],
            "releases": records["pendulum"].sizes()["release"],
        }

    def store_humidity(self, draws: Draws, box: Slots | None = None) -> Array | None:
        """Return the relative humidity of the balls' store, 0 to 1, (laboratory,); None: no store.

        The store belongs to the lot, whose random numbers are `draws`. `box` is the number of the
        lot's box, (laboratory,); None: the first.
        """
        store = None if self.ideal else self.spec.store
        return store.draw_humidity(draws, "lot.store", box) if store else None

    def play(self, plan: ShotPlan, specimen: Specimen, draws: Draws) -> RigOutput:
        """Measure the bat and weigh the balls that `plan` names.

        Readings of a block are in the order of the laboratories.
        """
        bat = specimen.bat.rigid
        axis = bat.length - self.pendulum.true["pivot_from_knob"]
        moment = bat.mass * (axis - bat.z_cm)
        repeats = self.spec.repeats
        return RigOutput(
            records={
                "bat-mass": self.scale.weigh(bat.mass, repeats, draws, "bench.bat-mass"),
                "ball-mass": self.scale.at(plan.owner).weigh(
                    specimen.at(plan).balls.mass,
                    repeats,
                    draws.at(plan.owner),
                    "bench.ball-mass",
                    plan.slot,
                ),
                REFERENCE_MASS: self._reference(draws),
                "length": self.rule.measure(bat.length, repeats, draws, "bench.length"),
                "barrel-radius": self.rule.measure(
                    barrel_radius(specimen.bat.body.profile),
                    repeats,
                    draws,
                    "bench.barrel-radius",
                ),
                "balance": self.stand.measure(bat.z_cm, repeats, draws, "bench.balance"),
                "pendulum": self.pendulum.swing(
                    inertia=bat.inertia(axis),
                    moment=moment,
                    gravity=self.hall.acceleration,
                    releases=self.spec.releases,
                    draws=draws,
                    name="bench.pendulum",
                ),
                **({} if self.ideal else self._climate(draws, specimen.balls.store)),
            },
            truth={
                "mass": np.array(bat.mass),
                "z_cm": np.array(bat.z_cm),
                "inertia_cm": np.array(bat.inertia_cm),
                "length": np.array(bat.length),
            },
        )

    def _reference(self, draws: Draws) -> MassReadings:
        """Weigh the reference mass before bat and balls (item 0) and after them (item 1)."""
        owner, items = owners_and_slots(self.scale.laboratories, 2)
        return self.scale.at(owner).weigh(
            np.full(items.size, self.spec.reference),
            self.spec.repeats,
            draws.at(owner),
            "bench.reference-mass",
            items,
        )

    def _climate(self, draws: Draws, humidity: Array | None) -> dict[str, ClimateReadings]:
        """Read the climate of hall and store at the start and the end of the test."""
        spec, density, read = self.spec, self.air.true["density"], self.climate.read
        readings = {"climate": read(spec.hall, density, draws, "bench.climate-readings")}
        if spec.store is not None and humidity is not None:
            readings["store"] = read(spec.store, density, draws, "bench.store-readings", humidity)
        return readings


RIG = Bench()
