"""Comparison of a certificate with the sealed truth of its test."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.certificate.seal import TRUTH, Alteration, alterations
from virtual_lab.errors import InputError
from virtual_lab.files import read_bytes, read_json
from virtual_lab.lab.measurand import CONTINUOUS, STANDARD_BALL, WIDTH_KEY
from virtual_lab.measurement.procedure.model import AS_FOUND, QUANTITIES
from virtual_lab.output.intervals import Interval, draw_intervals
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.tables import column, record, table_text
from virtual_lab.parameters import Folder

if TYPE_CHECKING:
    from virtual_lab.output.page_figure import PageFigure

CERTIFICATE = "certificate.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityScore:
    """Measured and true value of a quantity in `unit`, its SI unit.

    Measured value, u, error and z are None if there is no measured value. z is the error divided by
    u, and it is also None if u is 0. `held` states whether the 95 % interval of the certificate
    holds the true value; None if the certificate states no interval.
    """

    quantity: str = column("quantity")
    unit: str
    value: float | None = column("measured", "SI", ".6f")
    u: float | None = column("u", "SI", ".6f")
    true: float = column("true", "SI", ".6f")
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

        `measured` has the keys `value` and `u`, and ``interval_95`` if the certificate states it.

        Without a value the error is None. z is None without a value, and if u is None or 0.
        """
        value, u = measured["value"], measured["u"]
        error = None if value is None else value - true
        z = error / u if error is not None and u else None
        interval = measured.get("interval_95")
        held = interval[0] <= true <= interval[1] if interval else None
        return cls(
            quantity=quantity,
            unit=unit,
            value=value,
            u=u,
            true=true,
            error=error,
            z=z,
            held=held,
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
    stated = {"metric": certificate["metric"]}
    others = CONTINUOUS, STANDARD_BALL
    stated |= {name: certificate["metric"] for name in others if name in measurand}
    stated |= {name: certificate[name] for name in QUANTITIES if name in certificate}
    if AS_FOUND in measurand and (correction := certificate["ball_correction"]):
        stated[AS_FOUND] = correction["as_found"]
    if certificate.get(WIDTH_KEY) and WIDTH_KEY in measurand:
        stated[WIDTH_KEY] = certificate[WIDTH_KEY]
    units = dict.fromkeys(("metric", *others, AS_FOUND), certificate["metric"].get("unit", ""))
    units |= {WIDTH_KEY: "m"}
    return {
        name: QuantityScore.of(name, result, measurand[name], units.get(name, ""))
        for name, result in stated.items()
    }


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CertificateScore(StudyResult):
    """A certificate compared with the truth, and whether the seal on both is intact."""

    altered: tuple[Alteration, ...]  # changes after the sealing
    sealing: str | None  # statement on the safety of the seal against trying seeds
    rows: tuple[QuantityScore, ...]  # empty if the certificate cannot be scored
    faults: tuple[str, ...] = ()  # names of the faults of the test day in the catalog

    name = "score"

    @property
    def seal(self) -> str:
        """State of the seal: ``whole`` or ``broken``."""
        return "broken" if self.altered else "whole"

    @property
    def _lack(self) -> str:
        return "too many keys were changed" if self.altered else "the test has no result"

    @property
    def title(self) -> str:
        """Title with the state of the seal."""
        return f"comparison of a certificate with the truth; the seal is {self.seal}"

    @property
    def code(self) -> int:
        """Exit code of the command: 3 for a broken seal, else 0."""
        return 3 if self.altered else 0

    def draw(self) -> PageFigure:
        """Draw the errors in units of u, beside the limits of a 95 % interval."""
        return draw_intervals(
            [Interval(row.quantity, row.z, 0.0, row.z) for row in self.rows if row.z is not None],
            self.title,
            "error (measured minus true value) divided by $u$",
            references=(-1.96, 1.96),
            words="limits of 95 % of the errors",
        )

    @property
    def document(self) -> Json:
        """The result for JSON."""
        rows = {row.quantity: {**record(row)} for row in self.rows}
        for row in rows.values():
            del row["quantity"]
        altered = [asdict(each) for each in self.altered]
        stated = {"seal": self.seal, "altered": altered, "sealing": self.sealing}
        return {**stated, "faults": list(self.faults), **rows}

    @property
    def text(self) -> str:
        """Table of the scores, and one line per change after the test."""
        lines = [
            table_text(self.rows) if self.rows else f"no score: {self._lack}",
            "The seal is broken; changes since the test:"
            if self.altered
            else "The seal is intact.",
            *(f"  {each}" for each in self.altered),
        ]
        if self.faults:
            lines.append(f"faults of the test day: {', '.join(self.faults)}")
        return "\n".join([*lines, self.sealing] if self.sealing else lines)


def score_folder(folder: Folder) -> CertificateScore:
    """Compare the certificate in a result folder with the true values.

    Files or keys that were changed since the test are listed in the result. The exit code of the
    command is then 3.

    Parameters
    ----------
    folder
        Result folder with ``certificate.json`` and ``truth/``.

    Raises
    ------
    InputError
        Certificate, truth or seal is missing or cannot be compared.
    """
    folder = Path(folder)
    read_bytes(folder / CERTIFICATE)
    digest = hashlib.sha256(read_bytes(folder / TRUTH)).hexdigest()
    altered = alterations(folder)
    try:
        simulation, rows, faults = _score_files(folder)
    except InputError:
        if not altered:
            raise
        simulation, rows, faults = {}, (), ()
    named = {(each.file, each.key) for each in altered}
    # If truth and seal were altered together, the digest differs from that in the certificate.
    bound = {(TRUTH, ""), (CERTIFICATE, "simulation.truth_digest")}
    if simulation.get("truth_digest") not in (None, digest) and not named & bound:
        altered.append(Alteration(TRUTH, "", "altered"))
    sealing = simulation.get("sealing")
    return CertificateScore(altered=tuple(altered), sealing=sealing, rows=rows, faults=faults)


def _score_files(
    folder: Path,
) -> tuple[dict[str, str], tuple[QuantityScore, ...], tuple[str, ...]]:
    """Return the key `simulation` of a certificate, the scores, and the faults of the day.

    Raises `InputError` if a key is missing or has a wrong type.
    """
    certificate, truth = read_json(folder / CERTIFICATE), read_json(folder / TRUTH)
    try:
        rows = tuple(score(certificate, truth["measurand"]).values())
        json.dumps([asdict(row) for row in rows], allow_nan=False)  # rejects NaN and infinity
        return {**certificate["simulation"]}, rows, tuple(map(str, truth.get("faults", ())))
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as fault:
        raise InputError(
            str(folder),
            str(fault).strip("'"),
            None,
            "this key is missing in certificate.json or truth.json, or is not a number",
        ) from fault
