"""Origin of the records of a session: this simulation, or another laboratory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from virtual_lab.catalog.specs import Real, Spec, Title

# statement of a test that was carried out at the rehearsal bench
REHEARSAL = "rehearsal: the truth is opened at the debrief"
# files of a rehearsed day beside its result
DAY_FILES = ("day.sqlite", "sealed.json", "actions.json", "debrief.json", "debrief.html")


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelUsed(Spec):
    """The model that a simulation used, with the reason."""

    rung: str
    """Name of the model."""
    reason: str
    """Reason for its choice."""
    error: Real | None = None
    """Largest error of the model, in e_A; null: not stated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated(Spec):
    """Origin of records simulated here.

    All values follow from the setup of the test, except the commitment.
    """

    reality: str
    """Degree of realism: real, noise-free or ideal."""
    sealing: str
    """Statement whether the truth can be found by trying seeds."""
    seed_commitment: str
    """SHA-256 of salt and seed; empty: the seed was chosen, or nothing is random."""
    unverified_numbers: Mapping[str, str]
    """Number of unverified values of each data sheet, as a string."""
    rungs: Mapping[str, ModelUsed]
    """Models of the simulation, by its part; empty: the test is not finished."""

    def as_json(self) -> dict[str, Any]:
        """Return the values as JSON, without those that are not stated."""
        document = asdict(self)
        for model in document["rungs"].values():
            if model["error"] is None:
                del model["error"]
        return document


@dataclass(frozen=True, slots=True, kw_only=True)
class Supplied(Spec):
    """Origin of records that another laboratory supplied. They were not verified here."""

    laboratory: Title
    """Laboratory that supplied the records."""
    customer: Title = ""
    """Customer that the laboratory names; empty: not stated."""


Origin = Simulated | Supplied
