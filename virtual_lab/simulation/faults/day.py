"""A day in the laboratory: the faults that are on, and the seams they are played at."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from virtual_lab.errors import InputError, nearest
from virtual_lab.simulation.faults.catalogue import CATALOGUE
from virtual_lab.simulation.faults.fault import Fault, FaultContext
from virtual_lab.simulation.rig import RigOutput, ShotPlan, Specimen, Stage, Station, installed_rigs
from virtual_lab.streams import Draws, Quiet
from virtual_lab.uncertainty.estimate import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultSet:
    """Everything that goes wrong on one day, in the order it is named; nothing: a sound day."""

    faults: tuple[Fault, ...] = ()

    @classmethod
    def of(cls, names: Iterable[str], *, rig: str) -> FaultSet:
        """Return the day of some faults at an impact rig.

        Raises
        ------
        InputError
            No fault of this name, or one that cannot befall the rig.
        """
        names = tuple(dict.fromkeys(names))
        for name in names:
            if name not in CATALOGUE:
                near = nearest(name, CATALOGUE)
                raise InputError("", "fault", name, f"{near}known: {', '.join(sorted(CATALOGUE))}")
            able = _able(CATALOGUE[name])
            if rig not in able:
                allowed = f"it befalls {', '.join(able)}, not the rig {rig}"
                raise InputError("", "fault", name, allowed)
        return cls(faults=tuple(CATALOGUE[name] for name in names))

    @property
    def names(self) -> tuple[str, ...]:
        """What is on, for the sealed truth."""
        return tuple(fault.name for fault in self.faults)

    def at(self, stage: Stage) -> list[Fault]:
        """Return the faults that act at a stage."""
        return [fault for fault in self.faults if fault.acts_at(stage)]

    def station(self, stage: Stage, station: Station) -> Station:
        """Return the rig of a stage as it really stands."""
        for fault in self.at(stage):
            station = (fault.station and fault.station(station)) or station
        return station

    def calibration(self, known: Mapping[str, Estimate]) -> Mapping[str, Estimate]:
        """Return the constants as they were entered."""
        for fault in self.faults:
            known = fault.calibration(known) if fault.calibration else known
        return known

    def done(self, stage: Stage, plan: ShotPlan, specimen: Specimen) -> tuple[ShotPlan, Specimen]:
        """Return what is done on this day instead of a plan, and what it is done to."""
        for fault in self.at(stage):
            plan = fault.plan(plan) if fault.plan else plan
            specimen = fault.specimen(specimen) if fault.specimen else specimen
        return plan, specimen

    def play(
        self, stage: Stage, station: Station, plan: ShotPlan, specimen: Specimen, draws: Draws
    ) -> RigOutput:
        """Carry out a plan on this day; the log holds what was asked, whatever was done."""
        done, specimen = self.done(stage, plan, specimen)
        play = station.play(done, specimen, draws)
        if done is not plan and "log" in play.records:
            play = replace(play, records={**play.records, "log": plan.log()})
        for fault in self.at(stage):
            if fault.record and fault.channel in play.records:
                record = play.records[fault.channel]
                written = FaultContext(stage, station, plan, play, draws, fault.name)
                changed = replace(record, **fault.record(record, written))
                play = replace(play, records={**play.records, fault.channel: changed})
        return play


def _able(fault: Fault) -> list[str]:
    """Return the installed impact rigs that a fault can befall."""
    return [
        name
        for name, rig in installed_rigs().items()
        if rig.stage is Stage.IMPACT and fault.befalls(rig, rig.commission(Quiet()))
    ]
