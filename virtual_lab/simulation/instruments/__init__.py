"""Instruments: a data sheet, constants drawn once a laboratory, noise drawn each shot.

Each module holds a spec (what its file in ``data/instruments`` says), and the instrument as
one laboratory has it, on the base in ``calibrated``: ``commission`` draws its constants about
those of its certificate, ``calibration()`` is what the laboratory knows, ``errors()`` what really
is, and a verb of its own writes raw records.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import Any, Protocol, Self, TypeVar

from virtual_lab import catalog
from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, CalibratedSpec
from virtual_lab.streams import Draws, Owner

__all__ = [
    "FittedStation",
    "Instrument",
    "InstrumentFactory",
    "RecordDetail",
    "calibration_of",
    "errors_of",
]


class RecordDetail(Enum):
    """How finely instruments write down what they saw."""

    FULL = "full"  # every edge of a gate, every count of an encoder
    SUMMED = "summed"  # what their own recorders make of them: sufficient statistics


class Instrument(Protocol):
    """What every instrument can be asked for."""

    def calibration(self) -> Mapping[str, Any]: ...
    def errors(self) -> Mapping[str, Any]: ...


S = TypeVar("S", bound=CalibratedSpec)
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentFactory:
    """What fits out a laboratory's rig: its random numbers, and whether all is `ideal`."""

    draws: Draws
    ideal: bool

    def as_asked(self, spec: S) -> S:
        """Return a spec, or what it would be without errors."""
        return spec.ideal() if self.ideal else spec

    def commission(
        self, make: Callable[[S, Draws, str], T], kind: type[S], sheet: str, name: str
    ) -> T:
        """Return an instrument of the catalog's `sheet`, its errors drawn under `name`."""
        spec = catalog.load("instruments", sheet, kind).spec
        return make(self.as_asked(spec), self.draws, name)


def calibration_of(instruments: Mapping[str, Instrument]) -> dict[str, Any]:
    """Return the constants of several instruments under ``instrument.constant`` names."""
    return {
        f"{name}.{key}": estimate
        for name, instrument in instruments.items()
        for key, estimate in instrument.calibration().items()
    }


def errors_of(instruments: Mapping[str, Instrument]) -> dict[str, Any]:
    """Return their true constants under the same names."""
    return {
        f"{name}.{key}": value
        for name, instrument in instruments.items()
        for key, value in instrument.errors().items()
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedStation:
    """A station whose fields are its instruments: what is known of them and what is true.

    Of a block of laboratories it knows `Known` constants, and true ones as arrays (laboratory,).
    """

    def instruments(self) -> Mapping[str, Instrument]:
        """Return what measures, by the names of the constants."""
        raise NotImplementedError

    def with_instrument(self, name: str, instrument: Instrument) -> Self:
        """Return the station with another instrument in the place of one of its own."""
        own = self.instruments()[name]
        (place,) = (part.name for part in fields(self) if getattr(self, part.name) is own)
        return replace(self, **{place: instrument})

    def at(self, owner: Owner) -> Self:
        """Return the station with the true constants of the laboratories that own shots."""
        own = {part.name: getattr(self, part.name) for part in fields(self)}
        instruments = {
            name: part.at(owner)
            for name, part in own.items()
            if isinstance(part, CalibratedInstrument)
        }
        return replace(self, **instruments)

    @property
    def calibration(self) -> dict[str, Any]:
        return calibration_of(self.instruments())

    @property
    def true_constants(self) -> dict[str, Any]:
        return errors_of(self.instruments())
