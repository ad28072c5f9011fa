"""Comparison of several certificates: of bats, procedures, laboratories, or repeated tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from statistics import fmean, stdev
from typing import TYPE_CHECKING, Any

from virtual_lab.certificate.chain import result_folders
from virtual_lab.certificate.document import CertificateDocument, read_document
from virtual_lab.certificate.pdf import PAPERS, require_paper, require_pdf, typeset
from virtual_lab.errors import InputError, name_parameters, of_extra
from virtual_lab.files.folders import ResultFolders
from virtual_lab.files.tables import write_csv
from virtual_lab.output.intervals import Interval, draw_intervals
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.result import StudyResult
from virtual_lab.output.rounding import decimals, digits, with_axis_unit, with_unit
from virtual_lab.output.svg import DASHED, PAGE_WIDTH, Panel, description_of, figure
from virtual_lab.output.tables import column, record, table_text
from virtual_lab.output.template import page_template
from virtual_lab.parameters import Paper, paths_of
from virtual_lab.studies.interlab.expected import expected_scatter

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

PACKAGE = "virtual_lab.certificate"
REPEATS = "the same bat, procedure and laboratory, as far as stated"
UNNAMED = "one bat design by one procedure, laboratories not told apart"
AS_STATED = "Numbers as stated in the certificates, not verified."
MOST_DIFFERING = 6  # largest number of bats, procedures or laboratories listed in an error
MOST_NAMED = 30  # largest number of certificate names printed beside the figure


def _bat(document: CertificateDocument) -> str:
    serial = document.particulars.bat.serial
    return f"{document.bat.name} {serial}".rstrip()


def _laboratory(document: CertificateDocument) -> str:
    return document.particulars.laboratory.name or document.laboratory


KINDS: dict[str, tuple[str, Callable[[CertificateDocument], str]]] = {
    "bats": ("bats by one procedure", _bat),
    "procedures": ("one bat by several procedures", lambda one: one.procedure.name),
    "laboratories": ("laboratories of one bat design", _laboratory),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedCertificate:
    """One certificate of a report; numbers are in the unit of its metric."""

    certificate: str = column("number", form="")
    folder: str = column("folder", form="")
    bat: str = column("bat", form="")
    procedure: str = column("procedure", form="")
    laboratory_name: str = column("laboratory", form="")
    verdict: str = column("verdict", form=lambda row: row.decision)
    marginal: bool
    metric: str = column("metric", form="")
    unit: str = column("unit", form="")
    value: float | None = column("value", form=".4f")
    u: float | None = column("u", form=".2g")
    low: float | None = column("low", form=".4f")
    high: float | None = column("high", form=".4f")
    limit: float | None = column("limit", form="g")
    risk: float | None = column("risk", form=".2g")
    valid_hits: int = column("hits", form="")
    flag_names: str = column("flags", form="")

    @classmethod
    def of(cls, document: CertificateDocument, folder: str) -> ComparedCertificate:
        """Return the row of a certificate. Its result is None if the test was INVALID."""
        metric, printed = document.metric, METRICS[document.metric.name]
        interval = metric.interval_95 if document.states_result else None

        return cls(
            certificate=document.number,
            folder=folder,
            bat=_bat(document),
            procedure=document.procedure.name,
            laboratory_name=_laboratory(document),
            verdict=document.verdict,
            marginal=document.marginal,
            metric=printed.symbol,
            unit=printed.unit,
            value=printed.in_unit(metric.value if interval else None),
            u=printed.in_unit(metric.u if interval else None),
            low=printed.in_unit(interval[0] if interval else None),
            high=printed.in_unit(interval[1] if interval else None),
            limit=printed.in_unit(metric.limit),
            risk=document.risk.probability if document.risk else None,
            valid_hits=document.valid_hits,
            flag_names=" ".join(flag.name for flag in document.flags),
        )

    @property
    def decision(self) -> str:
        """The verdict as printed, followed by ``marginal`` for a marginal result."""
        return f"{self.verdict}, marginal" if self.marginal else self.verdict

    @property
    def result(self) -> str:
        """The result with its expanded uncertainty, as printed; "none" without a result."""
        if self.value is None or self.high is None:
            return "none"
        half = self.high - self.value
        value = f"{self.value:.{decimals(half)}f} ± {digits(half)}"
        return f"{self.metric} {value} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CertificateReport(StudyResult):
    """Comparison of certificates; `kind` states what differs between them."""

    kind: str
    rows: tuple[ComparedCertificate, ...]
    statement: str
    pdf: bool = False
    paper: str = "a4"

    name = "report"

    @property
    def title(self) -> str:
        """Title with the number of certificates and the kind of comparison."""
        return f"{len(self.rows)} certificates: {self.kind}"

    @property
    def document(self) -> Any:
        """The result for JSON."""
        return {
            "comparison": self.kind,
            "statement": self.statement,
            "words": self.words,
            "certificates": [record(row) for row in self.rows],
        }

    @property
    def text(self) -> str:
        """Title, table and sentences."""
        return "\n\n".join([self.title, table_text(self.rows), *self.words, self.statement])

    @property
    def words(self) -> list[str]:
        """Sentences: numbers of verdicts, flags, scatter of the results, and a disclaimer."""
        counts = {
            verdict: sum(row.verdict == verdict for row in self.rows)
            for verdict in ("PASS", "FAIL", "MEASURED", "INVALID")
        }
        sentences = [", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)]
        flagged = [row for row in self.rows if row.flag_names]
        if flagged:
            sentences.append(
                f"{len(flagged)} with flags: {', '.join(row.certificate for row in flagged)}"
            )
        results = [(row.value, row.u) for row in self.rows if row.value is not None and row.u]
        if self.kind == UNNAMED:
            unnamed = sum(not row.laboratory_name for row in self.rows)
            why = name_parameters("({laboratory} of certify names it)").replace("=", "")
            sentences.append(
                f"{unnamed} of {len(self.rows)} certificates name no laboratory {why}, "
                "so they may be repeats or of several laboratories"
            )
        if self.kind in (KINDS["laboratories"][0], REPEATS, UNNAMED) and len(results) > 1:
            values, us = zip(*results, strict=True)
            rms = sqrt(fmean(u**2 for u in us))
            first = self.rows[0]
            mean, spread = (
                with_unit(each, first.unit, form)
                for each, form in ((fmean(values), ".4f"), (stdev(values), ".2g"))
            )
            sentences.append(
                f"{first.metric} {mean} is the mean of {len(results)} results; their standard "
                f"deviation is {spread}, which is {stdev(values) / rms:.2g} times their rms u"
            )
            if self.kind == KINDS["laboratories"][0]:
                bat = first.bat.split(" ")[0]  # without its serial number
                expected = expected_scatter(bat, first.procedure)
                sentences += [expected.explain(stdev(values), len(values))] if expected else []
        return [*(f"{each}." for each in sentences), AS_STATED]

    def _results(self) -> tuple[list[Interval], set[float], str]:
        """Return the results with their 95 % intervals, the limits, and the label of both.

        Results of different metrics are divided by their limits.
        """
        rows = [row for row in self.rows if row.value is not None and row.low is not None]
        one_metric = len({row.metric for row in self.rows}) == 1
        rows = [row for row in rows if one_metric or row.limit]
        intervals = []
        for row in rows:
            size = 1.0 if one_metric else row.limit or 1.0
            value, low, high = (float(end or 0) / size for end in (row.value, row.low, row.high))
            intervals.append(Interval(self._row_name(row), value, low, high))
        limits = {row.limit if one_metric else 1.0 for row in rows if row.limit is not None}
        first = rows[0] if one_metric and rows else None
        label = with_axis_unit(first.metric, first.unit) if first else "result / limit"
        return intervals, limits, label

    def draw(self) -> PageFigure:
        """Draw the results with their 95 % intervals, beside the limits."""
        intervals, limits, label = self._results()
        label = f"{label} (bars: 95 % intervals)"
        return draw_intervals(
            intervals, self.title, label, references=sorted(limits), words="limit"
        )

    @property
    def svg(self) -> str:
        """SVG figure of the results with their intervals and limits, one line per result."""
        intervals, limits, label = self._results()
        every = [*(end for each in intervals for end in (each.low, each.high)), *limits]
        margin = 0.05 * ((max(every) - min(every)) or 1.0) if every else 1.0
        few = len(intervals) <= MOST_NAMED
        height = (11.0 if few else 4.0) * max(len(intervals), 2) + 44
        panel = Panel(
            left=165,
            right=PAGE_WIDTH - 6,
            top=14,
            bottom=height - 30,
            x=(min(every, default=0.0) - margin, max(every, default=1.0) + margin),
            y=(-len(intervals) + 0.4, 0.6) if intervals else (0.0, 1.0),
            x_label=label,
            y_ticks=[-float(n) for n in range(len(intervals))] if few else (),
            y_words=[each.name for each in intervals] if few else (),
        )
        for n, each in enumerate(intervals):
            panel.line((each.low, each.high), (-n, -n))
            panel.dots([each.value], [-n], radius=1.8)
        for limit in limits:
            panel.line((limit, limit), panel.y, width=1.2, dashes=DASHED)
        caption = f"{len(intervals)} results with their 95 % intervals. Dashed line: limit"
        return figure([panel], height, "report", self.title, caption)

    def _row_name(self, row: ComparedCertificate) -> str:
        names = {"bats": row.bat, "procedures": row.procedure, "laboratories": row.laboratory_name}
        name = next((names[key] for key, (kind, _) in KINDS.items() if kind == self.kind), "")
        return f"{name or row.folder}, {row.decision}"[:44]

    def fill(self, folder: Path) -> None:
        """Write table, figure, page and, if requested, PDF into an existing folder."""
        write_csv(self.table, folder / "report.csv")
        (folder / "report.svg").write_text(self.svg, encoding="utf-8")
        (folder / "report.html").write_text(self.page, encoding="utf-8")
        if self.pdf:
            (folder / "report.pdf").write_bytes(self._typeset())

    @property
    def page(self) -> str:
        """The report as one self-contained HTML page."""
        from markupsafe import Markup

        heads, cells = self._printed_table()
        return page_template(PACKAGE, "report.html").render(
            report=self, heads=heads, cells=cells, figure=Markup(self.svg)
        )

    def _printed_table(self) -> tuple[list[str], list[list[str]]]:
        """Return the column heads and the cells of the printed table."""
        heads = ["Number", "Bat", "Procedure", "Laboratory", "Verdict", "Result", "Limit", "Flags"]
        cells = [
            [
                row.certificate,
                row.bat,
                row.procedure,
                row.laboratory_name or "–",
                row.decision,
                row.result,
                "–" if row.limit is None else f"{row.limit:g}",
                row.flag_names.replace(" ", ", ").replace("-", " ") or "–",
            ]
            for row in self.rows
        ]
        return heads, cells

    def _typeset(self) -> bytes:
        from importlib.resources import files

        typst = of_extra("typst", "pdf", "a report as PDF")
        heads, cells = self._printed_table()
        view = {
            "title": self.title,
            "words": self.words,
            "statement": self.statement,
            "heads": heads,
            "cells": cells,
            "figure": self.svg,
            "alt": description_of(self.svg),
        }
        source = (files(PACKAGE) / "templates" / "report.typ").read_bytes()
        return typeset(typst, source, view, {"paper": PAPERS[self.paper]}, ["ua-1"])


def report(folders: ResultFolders, *, pdf: bool = False, paper: Paper = "a4") -> CertificateReport:
    """Compare the certificates in result folders.

    The certificates must differ in only one way: several bats, several procedures, several
    laboratories, or repeats of one test. Laboratories are told apart only by their names; the
    report says so if a certificate names none. The same test must not occur twice. The numbers are
    copied from the certificates and not recomputed; `verify` recomputes them.

    Parameters
    ----------
    folders
        Result folders, each with a ``certificate.json``, or one folder that contains such folders.
    pdf
        Also write the report as PDF (needs the extra ``pdf``).
    paper
        Paper size of the report.

    Raises
    ------
    InputError
        There are fewer than two certificates, one cannot be read, two have the same records, they
        differ in more than one way, or the extra is missing.
    """
    require_paper(paper)
    if pdf:
        require_pdf(paper)
    result_paths = [
        result_path for each in paths_of(folders) for result_path in result_folders(each)
    ]
    if len(result_paths) < 2:
        raise InputError("", "folders", len(result_paths), "allowed: two or more certificates")
    documents = {folder: read_document(folder / "certificate.json") for folder in result_paths}
    _require_other_records(documents)
    kind = _kind_of(documents)
    rows = [ComparedCertificate.of(each, folder.name) for folder, each in documents.items()]
    statements = list(dict.fromkeys(each.statement for each in documents.values()))
    return CertificateReport(
        kind=kind, rows=tuple(rows), statement=" ".join(statements), pdf=pdf, paper=paper
    )


def _require_other_records(documents: dict[Path, CertificateDocument]) -> None:
    """Raise `InputError` if two certificates have the same records, which means they are copies."""
    earlier: dict[str, Path] = {}
    for folder, document in documents.items():
        same = earlier.setdefault(document.session_digest or str(folder), folder)
        if same != folder:
            allowed = f"are also those of {same}; allowed: each test only once"
            raise InputError(str(folder), "records", None, allowed)


def _kind_of(documents: dict[Path, CertificateDocument]) -> str:
    """Return the kind of comparison. Raises `InputError` if certificates differ in two ways."""
    differing = {}
    for key, (_, of) in KINDS.items():
        first: dict[str, str] = {}
        for folder, document in documents.items():
            if name := of(document):
                first.setdefault(name, folder.name)
        if len(first) > 1:
            words = [f"{name} in {folder}" for name, folder in first.items()]
            differing[key] = ", ".join(
                words[:MOST_DIFFERING] + ["…"] * (len(words) > MOST_DIFFERING)
            )
    if len(differing) > 1:
        differences = "; ".join(f"{key}: {names}" for key, names in differing.items())
        allowed = (
            f"differ in more than one respect ({differences}); allowed: a difference in one at "
            "most, so compare them in groups"
        )
        raise InputError("", "folders", None, allowed)
    if differing:
        return KINDS[next(iter(differing))][0]
    return REPEATS if all(map(_laboratory, documents.values())) else UNNAMED
