"""Published numbers beside our results, with the verdict of each."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Literal

from tests.studies.reference import results
from tests.studies.reference.published import KNOWN_CHANGE, WIDE, Published, finder_of
from virtual_lab.output.tables import column

FINDERS = {
    name: finder
    for name, finder in vars(results).items()
    if callable(finder) and finder.__module__ == results.__name__ and not name.startswith("_")
}
Verdict = Literal[
    "agrees", "too wide to decide", "known disagreement", "DISAGREES", "not represented"
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceRow:
    """A published number beside our result, in the unit of the publication."""

    number: Published
    quantity: str = column("quantity")
    published: str = column("published")
    published_u: float | None = column("u")
    unit: str = column("unit")
    value: float | None = column("ours", form=".4g")
    difference: float | None = column("difference", form="+.3g")
    difference_in_u: float | None = column("in u", form="+.1f")
    role: str = column("role")
    agreement: Verdict = column("verdict")
    low: float | None  # range of agreement; None: no limit
    high: float | None


def compare_number(number: Published) -> ReferenceRow:
    """Return a row with a published number and our result, both in the published unit.

    The difference is our result minus the published number. For a published range, it is the
    distance beyond the nearer end, and 0 inside the range. Result and difference are None if the
    simulation does not model the quantity.
    """
    result = None if number.role == "none" else float(finder_of(number, FINDERS)())
    difference = None if result is None else number.deviation(result)
    return ReferenceRow(
        number=number,
        quantity=number.quantity,
        published=number.value,
        published_u=number.u,
        unit=number.unit,
        value=result,
        difference=difference,
        difference_in_u=difference / number.u if difference is not None and number.u else None,
        role=number.role,
        agreement=_verdict(number, result),
        low=number.low if isfinite(number.low) else None,
        high=number.high if isfinite(number.high) else None,
    )


def _verdict(number: Published, result: float | None) -> Verdict:
    """Return the verdict. A known disagreement that has changed or disappeared is not "known"."""
    if result is None:
        return "not represented"
    within = number.low <= result <= number.high
    if number.known is None:
        return ("agrees" if number.role != "wide" else WIDE) if within else "DISAGREES"
    change = abs(number.deviation(result) - number.known)
    unchanged = not within and change <= KNOWN_CHANGE * abs(number.known)
    return "known disagreement" if unchanged else "DISAGREES"
