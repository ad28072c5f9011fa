"""Published numbers beside our results: table, picture, and the reason for each disagreement."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Final, Literal

from virtual_lab.output.progress import Progress, quiet
from virtual_lab.output.result import StudyResult
from virtual_lab.output.style import INTERVAL_GREY, as_drawn, page_figure
from virtual_lab.output.tables import column, table_text
from virtual_lab.studies.reference import results
from virtual_lab.studies.reference.published import (
    KNOWN_CHANGE,
    Published,
    finder_of,
    read_published,
)

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

WIDE: Final = "too wide to decide"
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

    quantity: str = column("quantity")
    published: str = column("published")
    published_u: float | None = column("u")
    unit: str = column("unit")
    value: float | None = column("ours", form=".4g")
    difference: float | None = column("difference", form="+.3g")
    difference_in_u: float | None = column("in u", form="+.1f")
    role: str = column("role")
    agreement: Verdict = column("verdict")
    agreement_low: float | None  # range of agreement; None: no limit
    agreement_high: float | None
    explained_difference: float | None  # difference at which the disagreement was explained
    why: str
    conditions: str
    source: str
    address: str
    source_reading: str


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ReferenceResult(StudyResult):
    """All published numbers, with our result for each quantity that the simulation models."""

    rows: list[ReferenceRow]
    name = "reference"

    @property
    def represented(self) -> list[ReferenceRow]:
        """Rows with our result."""
        return [row for row in self.rows if row.value is not None]

    @property
    def title(self) -> str:
        """Title with the number of rows represented."""
        return f"Published numbers: {len(self.represented)} of {len(self.rows)} represented"

    @property
    def text(self) -> str:
        """The rows represented, the reasons for disagreements, and the counts."""
        represented = self.represented
        roles = {
            role: sum(row.role == role for row in represented)
            for role in ("prediction", "wide", "data", "fit")
        }
        reasons = [_reason(row) for row in represented if "agrees" != row.agreement != WIDE]
        counts = (
            f"{len(represented)} of {len(self.rows)} published numbers represented: "
            f"{roles['prediction']} predicted, {roles['wide']} with a range too wide to decide, "
            f"{roles['data']} in the data files, {roles['fit']} to which a constant was fitted; "
            f"{len(reasons)} disagree. The others and their reasons are in the CSV file."
        )
        return "\n\n".join((table_text(represented), "\n".join(reasons), counts))

    def draw(self) -> PageFigure:
        """Draw the predictions, each in half widths of its range of agreement."""
        drawn = [
            row
            for row in self.represented
            if row.role == "prediction"
            and row.agreement_low is not None
            and row.agreement_high is not None
        ]
        names = [
            f"{as_drawn(row.quantity)}: {row.published} {row.unit.removeprefix('1')}"
            for row in drawn
        ]
        with page_figure(0.17 * len(drawn) + 0.6) as figure:
            axes = figure.subplots()
            axes.axvspan(-1, 1, color=INTERVAL_GREY, linewidth=0)
            for place, row in enumerate(drawn):
                at = _share(row)
                agrees = row.agreement == "agrees"
                far = abs(at) > FARTHEST
                marker = ("<" if at < 0 else ">") if far else "o"
                drawn_at = min(max(at, -FARTHEST), FARTHEST)
                axes.plot(
                    drawn_at, place, marker, color="black", fillstyle="full" if agrees else "none"
                )
            axes.set_yticks(range(len(drawn)), names)
            axes.set_ylim(len(drawn) - 0.5, -0.5)
            axes.set_xlim(-FARTHEST - 0.3, FARTHEST + 0.3)
            axes.set_xlabel("our result in half widths of the\nrange of agreement (open: outside)")
        return figure


FARTHEST = 3.0  # largest deviation drawn [half widths]; farther results are arrows


def reference(*, progress: Progress = quiet) -> ReferenceResult:
    """Compare published measurements of bats, balls and tests with results of this program.

    Each row states whether our result is a prediction of the simulation, a number of the data
    files, or one to which a constant was fitted. A row whose range of agreement could hardly fail
    is too wide to decide. The CSV file also lists the quantities that the simulation does not
    model, with the reason.

    Parameters
    ----------
    progress
        Function that is called with a message, the number of rows done, and the total. If it is not
        given, the functions of `virtual_lab` and the commands show the progress on stderr.
    """
    rows: list[ReferenceRow] = []
    for number in read_published():
        progress("published numbers", len(rows), len(read_published()))
        rows.append(compare_number(number))
    return ReferenceResult(rows=rows)


def compare_number(number: Published) -> ReferenceRow:
    """Return a row with a published number and our result, both in the published unit.

    The difference is our result minus the published number. For a published range, it is the
    distance beyond the nearer end, and 0 inside the range. Result and difference are None if the
    simulation does not model the quantity.
    """
    result = None if number.role == "none" else float(finder_of(number, FINDERS)())
    difference = None if result is None else number.deviation(result)
    return ReferenceRow(
        quantity=number.quantity,
        published=number.value,
        published_u=number.u,
        unit=number.unit,
        value=result,
        difference=difference,
        difference_in_u=difference / number.u if difference is not None and number.u else None,
        role=number.role,
        agreement=_verdict(number, result),
        agreement_low=number.low if isfinite(number.low) else None,
        agreement_high=number.high if isfinite(number.high) else None,
        explained_difference=number.known,
        why=number.why,
        conditions=number.conditions,
        source=number.source,
        address=number.address,
        source_reading=number.reading,
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


def _reason(row: ReferenceRow) -> str:
    """Return a disagreement with its size and its explanation as one line."""
    size = f"{row.difference:+.3g} {row.unit.removeprefix('1')}".rstrip()
    return f"{row.quantity}: {row.agreement}, {size} ({row.why})"


def _share(row: ReferenceRow) -> float:
    """Return the distance of a result from the middle of its range of agreement [half widths]."""
    assert row.value is not None
    low, high = row.agreement_low, row.agreement_high
    assert low is not None
    assert high is not None
    return (row.value - (low + high) / 2) / ((high - low) / 2)
