"""Comparison of a certificate with the sealed truth, after the test was played again from it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from math import sqrt
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from virtual_lab.certificate.comparing import Mismatch, RowState
from virtual_lab.certificate.printed import SYMBOLS
from virtual_lab.certificate.seal import TRUTH, compared_seal
from virtual_lab.certificate.verify import (
    CERTIFICATE,
    listed_rows,
    made_elsewhere,
    named_rows,
    verify,
)
from virtual_lab.errors import InputError
from virtual_lab.files import litter, read_bytes, read_json
from virtual_lab.lab import BatTest
from virtual_lab.lab.measurand import (
    CONTINUOUS,
    STANDARD_BALL,
    TRUE_OF_HIT,
    WIDTH_KEY,
    true_metrics_of_hits,
)
from virtual_lab.lab.recipe import Recipe
from virtual_lab.measurement.procedure.choice import variances_within
from virtual_lab.measurement.procedure.model import AS_FOUND, QUANTITIES
from virtual_lab.output.intervals import Interval, draw_intervals
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.progress import Progress
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.rounding import decimals, with_unit
from virtual_lab.output.tables import column, record, table_text
from virtual_lab.records.origin import REHEARSAL
from virtual_lab.studies.replay import compared_replay, play_again
from virtual_lab.uncertainty.budget import HITS

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

STATED = ("seal", "state", "unchecked", "sealing", "faults", "sheets", "ignored")  # keys of JSON
TRUE_METRICS = {  # the metric is compared with the true values of several definitions
    "metric": "of a test without errors at the same positions; shows how well it was measured",
    CONTINUOUS: "the maximum of the exact curve along the barrel",
    STANDARD_BALL: "of the bat struck by this ball; shows how well the procedure converts to it",
    AS_FOUND: "before the correction for the balls",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityScore:
    """Measured and true value of a quantity in `unit`, its SI unit.

    Measured value, u, error and z are None if there is no measured value. z is the error divided by
    u, and it is also None if u is 0. `held` states whether the 95 % interval of the certificate
    holds the true value; None if the certificate states no interval.
    """

    quantity: str = column("quantity", form=lambda row: row.label)
    metric: str  # symbol; empty for other quantities
    unit: str
    value: float | None = column("measured", "SI", ".6f")
    u: float | None = column("u", "SI", ".6f")
    true_value: float = column("true", "SI", ".6f")
    error: float | None = column("error", "SI", "+.6f")
    z: float | None = column("error", "u", "+.2f")
    held: bool | None = column(
        "in the 95 % interval", form=lambda row: {True: "yes", False: "no", None: ""}[row.held]
    )

    @classmethod
    def of(
        cls, quantity: str, measured: Mapping[str, Any], true: float, unit: str = ""
    ) -> QuantityScore:
        """Return the score of a result.

        `measured` has the keys `value` and `u`, and ``interval_95`` and `name` if the certificate
        states them. A metric has a name.

        Without a value the error is None. z is None without a value, and if u is None or 0.
        """
        value, u = measured["value"], measured["u"]
        error = None if value is None else value - true
        interval = measured.get("interval_95")
        return cls(
            quantity=quantity,
            metric=METRICS[measured["name"]].symbol if "name" in measured else "",
            unit=unit,
            value=value,
            u=u,
            true_value=true,
            error=error,
            z=error / u if error is not None and u else None,
            held=interval[0] <= true <= interval[1] if interval else None,
        )

    @property
    def label(self) -> str:
        """The quantity in print, by its symbol."""
        name, _, hit = self.quantity.partition("_shot_")
        label = SYMBOLS.get(name, self.metric or name)
        if name.startswith("metric"):  # the result, or the same by another definition
            definition = name.removeprefix("metric").replace("_", " ").strip()
            label = f"{self.metric} {definition or '(result)'}"
        return f"{label} of hit {hit}" if hit else label

    @property
    def words(self) -> str:
        """The error in one sentence."""
        if self.value is None or self.error is None or self.z is None:
            return f"{self.label} has no error: its value or its uncertainty is missing."
        inside, form = "inside" if self.held else "outside", f".{decimals(self.u or 0.0)}f"
        often = "" if self.held else ", as in 5 % of all tests"
        value, true = (with_unit(x, self.unit, form) for x in (self.value, self.true_value))
        return (
            f"{self.metric or self.label} {value}, true {true}: the error "
            f"{with_unit(self.error, self.unit, f'+{form}')} is {abs(self.z):.2f} times the "
            f"standard uncertainty, and the true value is {inside} the 95 % interval{often}."
        )


def score(
    certificate: Mapping[str, Any], measurand: Mapping[str, float]
) -> dict[str, QuantityScore]:
    """Return each certified quantity compared with its true value, keyed by name, in SI units.

    The metric of a scan is compared with two true values: the result of the procedure on the exact
    curve, and the maximum of this curve. A metric that is converted to a standard ball is also
    compared with that of the bat struck by this ball. This true value does not use the formula of
    the conversion, so the difference of the two true values is the error of the formula.

    Two quantities are compared only if the certificate states them:

    * the metric before a correction for the balls ("as found");
    * the width of the curve [m].

    Parameters
    ----------
    certificate
        Content of ``certificate.json``.
    measurand
        True values keyed by name. If the test has no result, there are no true values, and the
        returned dictionary is empty.

    Raises
    ------
    KeyError
        A key is missing in the certificate, or a true value is missing.
    """
    if not measurand:
        return {}
    metric, correction = certificate["metric"], certificate.get("ball_correction")
    others = [name for name in (CONTINUOUS, STANDARD_BALL) if name in measurand]
    stated = dict.fromkeys(("metric", *others), metric)
    stated |= {name: certificate[name] for name in QUANTITIES if name in certificate}
    if AS_FOUND in measurand and correction:
        stated[AS_FOUND] = {**correction["as_found"], "name": metric["name"]}
    if certificate.get(WIDTH_KEY) and WIDTH_KEY in measurand:
        stated[WIDTH_KEY] = certificate[WIDTH_KEY]
    units = dict.fromkeys(("metric", *others, AS_FOUND), metric.get("unit", "")) | {WIDTH_KEY: "m"}
    return {
        name: QuantityScore.of(name, result, measurand[name], units.get(name, ""))
        for name, result in stated.items()
    }


def hit_scores(
    certificate: Mapping[str, Any], truth: Mapping[str, Any], test: BatTest | None = None
) -> Iterator[QuantityScore]:
    """Yield the e_A of each hit of the result, and then the metric of each hit.

    The true values are for the ball of the hit and its true impact position. The u of the metric
    has two parts: the scatter of the hits at one position, and the part of the certificate's u that
    all hits share. There is no u without two hits at one position.

    Parameters
    ----------
    certificate
        Content of ``certificate.json``.
    truth
        Content of ``truth.json``.
    test
        The test played again, which has the true metrics. If it is None, only e_A is yielded.
    """
    hits, metric = [*filter(itemgetter("used"), certificate["shots"])], certificate["metric"]
    for each in hits:
        recoil, rebound, shot = each["recoil_efficiency"], each["rebound_efficiency"], each["shot"]
        measured = {"value": rebound if recoil is None else recoil, "u": None}
        name = f"collision_efficiency_shot_{shot + 1}"
        yield QuantityScore.of(name, measured, truth["shots"]["collision_efficiency"][shot])
    if test is None or not set(TRUE_OF_HIT) <= test.sealed.shots.keys():
        return
    value, place = np.array([(each["value"], each["impact_position_in"]) for each in hits]).T
    variance, freedom = variances_within(np.zeros(len(hits), int), place, value, 1)
    scatter = sum(row["contribution"] for row in certificate["budget"] if row["component"] == HITS)
    u = sqrt(metric["u"] ** 2 - scatter**2 + variance[0]) if freedom[0] else None
    balls = [each["ball"] for each in certificate["shots"]]
    true = true_metrics_of_hits(test.sealed, test.certification.procedure, balls)
    for each in hits:
        measured, shot = {**each, "name": metric["name"], "u": u}, each["shot"]
        name = f"{metric['name']}_shot_{shot + 1}"
        yield QuantityScore.of(name, measured, float(true[shot]), metric["unit"])


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CertificateScore(StudyResult):
    """A certificate compared with the truth, and whether all files still belong to one test."""

    broken: bool  # whether files were changed since the sealing
    different: tuple[Mismatch, ...]  # changed files, contradictions, and differences from a replay
    unchecked: str = ""  # reason why the test was not played again, or not by the same program
    sealing: str | None = None  # statement on the safety of the seal against trying seeds
    rows: tuple[QuantityScore, ...] = ()  # empty if the certificate cannot be scored
    faults: tuple[str, ...] = ()  # names of the faults of the test day in the catalog
    sheets: tuple[str, ...] = ()  # sheets of the test that the catalog does not have
    ignored: tuple[str, ...] = ()  # litter, see `virtual_lab.files.is_litter`

    name = "score"

    @property
    def seal(self) -> str:
        """State of the seal: ``whole`` or ``broken``."""
        return "broken" if self.broken else "whole"

    @property
    def state(self) -> str:
        """State of all files together: ``whole``, ``altered`` or ``not checked``."""
        if self.broken or any(row.state == "altered" for row in self.different):
            return "altered"
        return "not checked" if self.unchecked or self.different else "whole"

    @property
    def title(self) -> str:
        """Title with the state."""
        return f"errors of a certificate, its files {self.state}"

    @property
    def code(self) -> int:
        """Exit code of the command."""
        return {"whole": 0, "altered": 3, "not checked": 4}[self.state]

    def draw(self) -> PageFigure:
        """Draw the errors in units of u, and mark true values outside their 95 % interval."""
        return draw_intervals(
            [
                Interval(row.label, row.z, 0.0, row.z, hollow=row.held is False)
                for row in self.rows
                if row.z is not None
            ],
            self.title,
            "error (measured minus true value) divided by $u$",
            hollow="true value outside a stated 95 % interval",
        )

    @property
    def document(self) -> Json:
        """The result for JSON."""
        records = ({**record(row)} for row in self.rows)
        rows = {each.pop("quantity"): each for each in records}
        stated: dict[str, Any] = {name: getattr(self, name) for name in STATED}
        for state in ("altered", "differs"):
            stated[state] = [asdict(row) for row in self.different if row.state == state]
        return {**stated, **rows}

    @property
    def text(self) -> str:
        """Error of the metric, all scores, state of seal and replay, and remarks on the test."""
        lack = "too many keys were changed" if self.different else "the test has no result"
        table = ["", table_text(self.rows), ""] if self.rows else []
        defined = [row for row in self.rows if row.quantity in TRUE_METRICS]
        if len(defined) > 1:
            truths = [f"true value of {e.label}: {TRUE_METRICS[e.quantity]}" for e in defined]
            table += [*truths, ""]
        lines = [self.rows[0].words if self.rows else f"no score: {lack}", *table]
        lines.append(f"The seal is {'broken' if self.broken else 'intact'}.")
        if self.state == "whole":
            lines.append("Played again: truth and records agree.")
        else:
            lines.append(self.state + (f": {self.unchecked}" if self.unchecked else ""))
            lines += listed_rows(self.different) if self.different else []
        for words, names in (
            ("faults of the test day", self.faults),
            ("sheets that are not those of the catalog", self.sheets),
            ("ignored", self.ignored),
        ):
            lines += [f"{words}: {', '.join(names)}"] if names else []
        return "\n".join([*lines, self.sealing] if self.sealing else lines)


def score_folder(
    folder: Path, play_day: Callable[[Path], BatTest], progress: Progress
) -> CertificateScore:
    """Return the comparison of a result folder with its truth, as `virtual_lab.score` does.

    `play_day` plays the day in a folder again, if it was carried out at the rehearsal bench. Raises
    `InputError` if certificate, truth or seal is missing or cannot be compared.
    """
    for name in (CERTIFICATE, TRUTH):
        if name == TRUTH and not (folder / TRUTH).exists():
            why = "missing; only a simulated test has true values"
            raise InputError(str(folder / TRUTH), "file", None, why)
        read_bytes(folder / name)
    changed = tuple(row for row in compared_seal(folder) if isinstance(row, Mismatch))
    ignored = tuple(litter(folder))
    result = CertificateScore(broken=bool(changed), different=changed, ignored=ignored)
    state: RowState = "differs"
    try:
        certificate, truth = read_json(folder / CERTIFICATE), read_json(folder / TRUTH)
        result = replace(result, **_score_files(folder, certificate, truth))
        result = replace(result, different=named_rows((*changed, *verify(folder).rows)))
        elsewhere = made_elsewhere(certificate)
        state = "differs" if elsewhere else "altered"
        recipe = Recipe.read(truth, str(folder / TRUTH))
        result = replace(result, sheets=tuple(recipe.sheets))
        test = play_day(folder) if result.sealing == REHEARSAL else play_again(recipe, progress)
        result = replace(result, **_score_files(folder, certificate, truth, test))
        again = [*compared_replay(folder, test)]
    except InputError as fault:
        if not (result.rows or changed):
            raise
        if state == "differs" or fault.where != str(folder / TRUTH):
            return replace(result, unchecked=str(fault))
        # this program writes the recipe into each truth
        row = Mismatch(file=TRUTH, key=fault.key, stated="", expected=fault.allowed)
        again, elsewhere = [row], ""
    rows = named_rows((*result.different, *(replace(row, state=state) for row in again)))
    return replace(result, different=rows, unchecked=elsewhere if rows else "")


def _score_files(
    folder: Path, certificate: Json, truth: Json, test: BatTest | None = None
) -> dict[str, Any]:
    """Return the fields on the scores, on the seed and on the faults of the day, keyed by name.

    `test` is the test played again, which has the true metrics of the hits. Raises `InputError` if
    a key is missing or has a wrong type.
    """
    try:
        rows = tuple(score(certificate, truth["measurand"]).values())
        rows += tuple(hit_scores(certificate, truth, test)) if rows else ()
        json.dumps([asdict(row) for row in rows], allow_nan=False)  # rejects NaN and infinity
        sealing, faults = certificate["simulation"].get("sealing"), truth.get("faults", ())
        return {"sealing": sealing, "rows": rows, "faults": tuple(map(str, faults))}
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as fault:
        allowed = "this key is missing in certificate.json or truth.json, or is not a number"
        raise InputError(str(folder), str(fault).strip("'"), None, allowed) from fault
