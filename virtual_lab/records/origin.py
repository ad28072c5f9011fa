"""Origin of the records of a session: this simulation, or another laboratory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from virtual_lab.catalog.specs import Real, Spec, Title


@dataclass(frozen=True, slots=True, kw_only=True)
class RungTaken(Spec):
    """A model that a simulation took, and why."""

    rung: str
    reason: str
    error: Real | None = None  # in e_A; None: not stated


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated(Spec):
    """A test simulated here: all that is said of its simulation follows from its setup.

    But for the commitment, the SHA-256 of salt and seed.
    """

    reality: str
    sealing: str  # whether who knows the records could find the truth
    seed_commitment: str
    unverified_numbers: Mapping[str, str]  # sheet: so many of so many
    rungs: Mapping[str, RungTaken]  # by part of the simulation; {} before the test is finished

    def as_json(self) -> dict[str, Any]:
        """Return the values of JSON, without what is not stated."""
        found = asdict(self)
        for rung in found["rungs"].values():
            if rung["error"] is None:
                del rung["error"]
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Supplied(Spec):
    """Records that another laboratory supplied: nobody here verified them."""

    laboratory: Title
    customer: Title = ""


Origin = Simulated | Supplied
