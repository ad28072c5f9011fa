"""Prices of instruments, balls and minutes, read from a file of the user."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from annotated_types import Ge, MinLen

from virtual_lab.catalog.specs import Real, Spec
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError, nearest
from virtual_lab.files import parse_toml
from virtual_lab.parameters import AnyDocument
from virtual_lab.sheets import Sheet, document_text, replacement
from virtual_lab.studies.plan.laboratory import better_instruments
from virtual_lab.units import Array

Words = Annotated[str, MinLen(1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Price(Spec):
    """A number with its unit and source."""

    value: Annotated[Real, Ge(0)]
    unit: Words
    source: Words
    # sheet of an offered instrument, beside the file; empty: half of each u and each scatter
    sheet: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prices(Spec):
    """Prices in one currency."""

    tests: Price  # number of tests for which the plan is made
    per_minute: Price
    per_ball: Price  # price of a ball per test
    instruments: Mapping[str, Price] = field(default_factory=dict)  # keyed by instrument name

    def __post_init__(self) -> None:
        if self.tests.unit != "1" or self.tests.value < 1:
            raise ValueError('tests must be a number of at least 1 with the unit "1"')
        amounts = {"per_ball": self.per_ball, **self.instruments}
        for name, price in amounts.items():
            if price.unit != self.currency:
                raise ValueError(f"{name} is in {price.unit}, but per_minute in {self.currency}")

    @classmethod
    def read(cls, prices: AnyDocument) -> Self:
        """Return the prices in a file or mapping.

        Raises `InputError` for an unknown or missing key, or prices in two currencies.
        """
        text, where = document_text(prices, "prices")
        return validate(parse_toml(text, where), where, cls)

    @property
    def currency(self) -> str:
        """Unit of all prices."""
        return self.per_minute.unit

    def offers(self, path: Path, rigs: Collection[str]) -> dict[str, Sheet]:
        """Return the sheets of the offered instruments, keyed by the instrument that they replace.

        `path` is the file of the prices. Raises `InputError` for an instrument that the rigs do not
        have, and for a sheet that cannot be read.
        """
        better = better_instruments(rigs)
        sheets = {}
        for name, price in self.instruments.items():
            if name not in better:
                allowed = f"{nearest(name, better)}allowed: {', '.join(better)}"
                raise InputError(str(path), f"instruments.{name}", None, allowed)
            sheets[name] = better[name]
            if price.sheet:
                sheets[name] = replacement(better[name], path.parent / price.sheet)
        return sheets

    def of_plans(self, names: Collection[str], minutes: Array, balls: Array) -> Array:
        """Return the price of each plan, shape (set of exchanges, …).

        `names` are the instruments that may be exchanged. `minutes` is the duration of one test,
        also (set of exchanges, …), and `balls` is its number of balls, shape (…).
        """
        of_tests = self.tests.value * (
            self.per_minute.value * minutes + self.per_ball.value * np.asarray(balls)
        )
        sets = np.arange(2 ** len(names))
        of_instruments = sum(
            ((sets >> bit & 1) * self.instruments[name].value for bit, name in enumerate(names)),
            np.zeros(sets.size),
        )
        return np.asarray(of_instruments.reshape(-1, *(1,) * np.ndim(balls)) + of_tests)
