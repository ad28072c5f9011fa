"""Scenarios: the bat, procedure, faults, guidance and scoring of a day."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from types import MappingProxyType
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Lt

from virtual_lab import catalog
from virtual_lab.catalog import Entry
from virtual_lab.catalog.faults import FaultSheet
from virtual_lab.catalog.specs import Dimension, Name, Real, Spec, Title, Whole, YesNo
from virtual_lab.streams import Streams
from virtual_lab.units import INCH, MPH

UNITS = MappingProxyType(  # printed units of length and speed, with their size in SI
    {"SI": (("mm", 1e-3), ("m/s", 1.0)), "inch-ounce-mph": (("in", INCH), ("mph", MPH))}
)
SCORES = ("result", "detection", "protocol", "record", "economy")


@dataclass(frozen=True, slots=True, kw_only=True)
class Briefing(Spec):
    """The part of a scenario that a trainee may know, except for time and shots."""

    title: Title
    task: Title  # task of the trainee
    # possible faults with their probabilities, which trainees see; each day draws from them
    may_go_wrong: Mapping[str, Annotated[Real, Gt(0), Lt(1)]] = field(default_factory=dict)
    guidance: Literal["guided", "checklist", "none"] = "guided"
    checklists: YesNo = False
    feedback: Literal["during", "after", "never"] = "after"
    units: Literal["SI", "inch-ounce-mph"] = "SI"  # units of printed and typed numbers
    # facts about the laboratory to print with the rules
    laboratory: Mapping[str, Title] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class DayBriefing(Briefing):
    """Form of the briefing in the log of a day."""

    minutes: Real
    shots: Whole
    commitment: str  # SHA-256 of the sealed file
    camera: YesNo
    operator: Name  # person who decides about the hits
    practice: Annotated[Whole, Ge(0)] = 0  # entry from which an earlier day is repeated


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario(Briefing):
    """Description of a day to rehearse, from a .toml file."""

    name: Name
    bat: str
    procedure: str
    rig: str = ""  # rig that fires at the bat; empty: the rig of the procedure
    limit: Annotated[float | None, Gt(0), Dimension("number")] = (
        None  # limit that replaces the limit of the procedure
    )
    faults: tuple[str, ...] | None = None  # hidden faults of the day; None: draw them
    records_of: Literal["", "book", "careless", "cheating"] = ""  # operator who took the records
    minutes: Annotated[float, Gt(0), Dimension("time")]  # time budget that the page shows
    shots: Annotated[int, Gt(0), Dimension("number")]  # budget of shots that the page shows
    weights: Mapping[str, Annotated[Real, Ge(0)]] = field(default_factory=dict)  # weights of SCORES

    def briefing(self) -> dict[str, Any]:
        """Return the part of the scenario that a trainee may know, as a JSON object."""
        names = (*(each.name for each in fields(Briefing)), "minutes", "shots")
        return {name: getattr(self, name) for name in names}

    def draw_faults(self, seed: int) -> Scenario:
        """Return the scenario of one day: if its `faults` are None, draw them from the seed."""
        if self.faults is not None:
            return self
        number = np.arange(len(self.may_go_wrong))
        chance = Streams(seed).uniform("rehearsal.faults", slots=number) + 0.5
        pairs = zip(self.may_go_wrong.items(), chance, strict=True)
        return replace(self, faults=tuple(name for (name, rate), at in pairs if at < rate))

    def __post_init__(self) -> None:
        strange = sorted(set(self.weights) - set(SCORES))
        if strange:
            raise ValueError(f"weights of {', '.join(strange)}; allowed: {', '.join(SCORES)}")
        for fault in (*self.may_go_wrong, *(self.faults or ())):
            if catalog.load("faults", fault, FaultSheet).spec.found_by is None:
                raise ValueError(
                    f"no check at the bench finds {fault}; allowed: those with found_by"
                )


def load_scenario(name: str) -> Entry[Scenario]:
    """Return the shipped scenario `name`, or the scenario in the file if `name` ends in .toml.

    Raises `InputError` with file, key and allowed values if there is no such scenario or if it is
    not valid.
    """
    return catalog.load("bench/scenarios", name, Scenario)


@cache
def scenarios_to_choose() -> Mapping[str, Scenario]:
    """Return the shipped scenarios that a trainee may choose, keyed by name.

    Scenarios of exams are left out, because a trainer begins them.
    """
    scenarios = {name: load_scenario(name).spec for name in catalog.names("bench/scenarios")}
    return {name: each for name, each in scenarios.items() if each.feedback != "never"}
