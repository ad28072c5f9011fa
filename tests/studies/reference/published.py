"""Published numbers with their sources, and the way in which this laboratory represents them."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from math import inf, isfinite
from pathlib import Path
from typing import Final, Literal, get_args

from tests.studies.paper.claim import argument

PATH = Path(__file__).with_suffix(".csv")
Role = Literal["fit", "data", "prediction", "wide", "none"]
WIDE: Final = "too wide to decide"
ROLES: tuple[Role, ...] = get_args(Role)
TAKEN_OVER = 1e-3  # relative tolerance of a number that was fitted or taken over
KNOWN_CHANGE = 0.2  # relative change of a known disagreement that needs a new explanation


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """A published number, and the range in which our result agrees with it."""

    quantity: str
    value: str  # as published: a number, a range, or words
    unit: str
    u: float | None  # published standard uncertainty
    conditions: str
    source: str
    address: str
    reading: str  # source of the number: text, table or drawing
    # a constant was fitted to it, number of our data files, prediction, prediction with a range too
    # wide to decide anything, or not represented
    role: Role
    find: str  # name of a function in `results` and its arguments
    low: float
    high: float
    # our result minus the published number, for a disagreement that is explained
    known: float | None
    why: str  # reason for the range, the disagreement, or the missing result

    @property
    def ends(self) -> tuple[float, float]:
        """The published number or range, or the range of agreement for words."""
        try:
            values = [float(part) for part in self.value.split(" to ")]
        except ValueError:
            return self.low, self.high
        return values[0], values[-1]

    def deviation(self, result: float) -> float:
        """Return the result minus the published number, or minus the nearest end of its range."""
        low, high = self.ends
        return result - min(max(result, low), high)


@cache
def read_published() -> tuple[Published, ...]:
    """Return the published numbers in the order of their file, cached after the first call."""
    with PATH.open(encoding="utf-8", newline="") as table:
        return tuple(_read(row) for row in csv.DictReader(table))


def published_value(quantity: str) -> float:
    """Return the published number of a quantity in its unit of publication.

    Raises `ValueError` if the quantity is unknown, occurs twice, or is published as words or as a
    range.
    """
    (row,) = (row for row in read_published() if row.quantity == quantity)
    return float(row.value)


def finder_of(row: Published, finders: Mapping[str, Callable[..., float]]) -> Callable[[], float]:
    """Return a function without arguments that computes our result for a published number.

    The result has the published unit. The text `row.find` begins with the name of one of the
    functions `finders`. The arguments of this function follow. Raises `KeyError` for a name that
    `finders` does not have, and `ValueError` for an empty text.
    """
    name, *arguments = row.find.split()
    return partial(finders[name], *map(argument, arguments))


def _read(row: Mapping[str, str]) -> Published:
    u, role = _number(row["u"]), next(role for role in ROLES if role == row["role"])
    words = {key: row[key] for key in ("quantity", "value", "unit", "conditions", "source")}
    words |= {key: row[key] for key in ("address", "reading", "find", "why")}
    plain = Published(**words, u=u, role=role, low=-inf, high=inf, known=_number(row["known"]))
    low, high = plain.ends
    margin = 2 * u if u is not None else TAKEN_OVER * abs(low) * (role in ("fit", "data"))
    if row["low"] or row["high"] or not isfinite(low):
        low, high, margin = float(row["low"] or -inf), float(row["high"] or inf), 0.0
    return Published(
        **words, u=u, role=role, low=low - margin, high=high + margin, known=plain.known
    )


def _number(text: str) -> float | None:
    return float(text) if text else None
