"""Instruments: a data sheet, constants drawn once per laboratory, noise drawn for each shot.

Each module contains a specification (the data sheet in ``data/instruments``) and the instrument of
one laboratory, based on ``calibrated``. ``commission`` draws the true constants about the constants
of the certificate, ``calibration()`` returns the constants that the laboratory knows, ``errors()``
returns the true constants, and another method writes the raw records.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import Any, ClassVar, Protocol, Self, TypeVar

from virtual_lab import catalog
from virtual_lab.records import Record
from virtual_lab.simulation.instruments.calibrated import (
    CalibratedInstrument,
    CalibratedSpec,
    StandardDeviation,
)
from virtual_lab.streams import Draws, Owner

__all__ = [
    "FittedStation",
    "Instrument",
    "InstrumentFactory",
    "RecordDetail",
    "calibration_of",
    "true_constants_of",
]


class RecordDetail(Enum):
    """Level of detail of the records."""

    FULL = "full"  # every edge of a gate, every count of an encoder
    SUMMED = "summed"  # sufficient statistics computed by the instrument's recorder


class Instrument(Protocol):
    """Methods that every instrument has."""

    def calibration(self) -> Mapping[str, Any]: ...
    def errors(self) -> Mapping[str, Any]: ...


S = TypeVar("S", bound=CalibratedSpec)
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentFactory:
    """Factory of a laboratory's instruments, with random errors, or without any if `ideal`."""

    draws: Draws
    ideal: bool

    def adapt(self, spec: S) -> S:
        """Return a specification, without its errors if the laboratory is ideal."""
        return spec.ideal() if self.ideal else spec

    def commission(
        self, make: Callable[[S, Draws, str], T], kind: type[S], sheet: str, name: str
    ) -> T:
        """Return an instrument of the data `sheet`, with errors drawn under `name`."""
        spec = catalog.load("instruments", sheet, kind).spec
        return make(self.adapt(spec), self.draws, name)


def calibration_of(instruments: Mapping[str, Instrument]) -> dict[str, Any]:
    """Return the calibration constants of the instruments, keyed by ``instrument.constant``.

    These are the values on the certificates, in SI units: an `Estimate` each, or `Estimates`
    (laboratory,) for a block of laboratories.
    """
    return {
        f"{name}.{key}": estimate
        for name, instrument in instruments.items()
        for key, estimate in instrument.calibration().items()
    }


def true_constants_of(instruments: Mapping[str, Instrument]) -> dict[str, Any]:
    """Return the true constants of the instruments in SI units, keyed by ``instrument.constant``.

    Each is a number, or an array (laboratory,) for a block of laboratories.
    """
    return {
        f"{name}.{key}": value
        for name, instrument in instruments.items()
        for key, value in instrument.errors().items()
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedStation:
    """A station with one field per instrument, with calibrated and true constants.

    In a block of laboratories the calibrated constants are `Estimates`, and the true constants are
    arrays (laboratory,).
    """

    # channels that an instrument records, keyed by its name; by default the channel of that name
    channels: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    def instruments(self) -> Mapping[str, Instrument]:
        """Return the instruments, by the names used for their constants."""
        raise NotImplementedError

    def parts(self) -> dict[str, tuple[str, CalibratedInstrument[Any]]]:
        """Return name and instrument of each field that holds a calibrated instrument, by field.

        An instrument that is not among `instruments` has the name of its field.
        """
        names = {id(each): name for name, each in self.instruments().items()}
        values = {part.name: getattr(self, part.name) for part in fields(self)}
        return {
            field: (names.get(id(each), field), each)
            for field, each in values.items()
            if isinstance(each, CalibratedInstrument)
        }

    def numbers_in(
        self, records: Mapping[str, Record], measured: Mapping[str, StandardDeviation]
    ) -> Mapping[str, object]:
        """Return numbers of the rig's sheet that its raw records show [SI], keyed by name.

        `measured` holds results of the reduction: ``turn_rate_scatter`` is the relative scatter of
        the bat's angular rate before contact.
        """
        return {}

    def with_instrument(self, name: str, instrument: Instrument) -> Self:
        """Return the station with the instrument `name` replaced."""
        current = self.instruments()[name]
        (place,) = (part.name for part in fields(self) if getattr(self, part.name) is current)
        return replace(self, **{place: instrument})

    def at(self, owner: Owner) -> Self:
        """Return the station with the true constants of each shot's laboratory."""
        if owner is ...:
            return self
        parts = {part.name: getattr(self, part.name) for part in fields(self)}
        instruments = {
            name: part.at(owner)
            for name, part in parts.items()
            if isinstance(part, CalibratedInstrument)
        }
        return replace(self, **instruments)

    @property
    def calibration(self) -> dict[str, Any]:
        return calibration_of(self.instruments())

    @property
    def true_constants(self) -> dict[str, Any]:
        return true_constants_of(self.instruments())
