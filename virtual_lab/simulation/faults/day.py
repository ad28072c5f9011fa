"""The faults of one test day, and their application to stations, plans and records."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from virtual_lab.errors import InputError, nearest
from virtual_lab.simulation.faults.catalogue import CATALOGUE
from virtual_lab.simulation.faults.fault import Fault, FaultContext
from virtual_lab.simulation.stations.rig import (
    RigOutput,
    ShotPlan,
    Specimen,
    Stage,
    Station,
    find_rig,
)
from virtual_lab.streams import Draws, Quiet
from virtual_lab.uncertainty.estimate import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultSet:
    """The faults of one day, in the order they were named. An empty set is a sound day."""

    faults: tuple[Fault, ...] = ()

    @classmethod
    def of(cls, names: Iterable[str], *, rig: str) -> FaultSet:
        """Return the faults of these names at an impact rig.

        Raises
        ------
        InputError
            A fault is unknown, or the rig cannot have it.
        """
        names = tuple(dict.fromkeys(names))
        for name in names:
            if name not in CATALOGUE:
                near = nearest(name, CATALOGUE)
                raise InputError(
                    "", "fault", name, f"{near}allowed: {', '.join(sorted(CATALOGUE))}"
                )
            if name not in (possible := faults_at(rig)):
                allowed = f"no fault of the rig {rig}; allowed: {', '.join(possible)}"
                raise InputError("", "fault", name, allowed)
        return cls(faults=tuple(CATALOGUE[name] for name in names))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the faults, for the sealed truth."""
        return tuple(fault.name for fault in self.faults)

    def at(self, stage: Stage) -> list[Fault]:
        """Return the faults that affect a stage, in the order they were named."""
        return [fault for fault in self.faults if fault.acts_at(stage)]

    def station(self, stage: Stage, station: Station) -> Station:
        """Return the station of a stage with its faults, unchanged if there are none."""
        for fault in self.at(stage):
            station = (fault.station and fault.station(station)) or station
        return station

    def calibration(self, constants: Mapping[str, Estimate]) -> Mapping[str, Estimate]:
        """Return the calibrated constants as the laboratory entered them."""
        for fault in self.faults:
            constants = fault.calibration(constants) if fault.calibration else constants
        return constants

    def apply(self, stage: Stage, plan: ShotPlan, specimen: Specimen) -> tuple[ShotPlan, Specimen]:
        """Return the plan and the specimen that are really used on this day."""
        for fault in self.at(stage):
            plan = fault.plan(plan) if fault.plan else plan
            specimen = fault.specimen(specimen) if fault.specimen else specimen
        return plan, specimen

    def play(
        self, stage: Stage, station: Station, plan: ShotPlan, specimen: Specimen, draws: Draws
    ) -> RigOutput:
        """Carry out a plan with the faults of this day. The log states the plan without faults."""
        planned, specimen = self.apply(stage, plan, specimen)
        play = station.play(planned, specimen, draws)
        if planned is not plan and "log" in play.records:
            play = replace(play, records={**play.records, "log": plan.log()})
        for fault in self.at(stage):
            if fault.record and fault.channel in play.records:
                record = play.records[fault.channel]
                context = FaultContext(stage, station, plan, play, draws, fault.name)
                changed = replace(record, **fault.record(record, context))
                play = replace(play, records={**play.records, fault.channel: changed})
        return play


def faults_at(rig: str) -> list[str]:
    """Return the names of the faults that an installed impact rig can have, in alphabetical order.

    Raises `InputError` if no impact rig named `rig` is installed.
    """
    installed = find_rig(rig, Stage.IMPACT)
    station = installed.commission(Quiet())
    faults = sorted(CATALOGUE.items())
    return [name for name, fault in faults if fault.possible_at(installed, station)]
