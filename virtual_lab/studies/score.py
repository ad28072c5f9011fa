"""Comparison of a certificate with the sealed truth of its test."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from virtual_lab.errors import InputError
from virtual_lab.files import read_bytes, read_json
from virtual_lab.lab.measurand import CONTINUOUS, WIDTH_KEY
from virtual_lab.lab.seal import TRUTH, Alteration, alterations
from virtual_lab.measurement.model import QUANTITIES
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.tables import column, record, table_text
from virtual_lab.parameters import Folder

CERTIFICATE = "certificate.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityScore:
    """Measured and true value [SI]; None if nothing was measured. z is None also if u is 0."""

    quantity: str = column("quantity")
    measured: float | None = column("measured", "SI", ".6f")
    u: float | None = column("u", "SI", ".6f")
    true: float = column("true", "SI", ".6f")
    error: float | None = column("error", "SI", "+.6f")
    z: float | None = column("error", "u", "+.2f")

    @classmethod
    def of(cls, quantity: str, measured: Mapping[str, Any], true: float) -> QuantityScore:
        """Return the score of a result with `value` and `u`."""
        value, u = measured["value"], measured["u"]
        error = None if value is None else value - true
        z = error / u if error is not None and u else None
        return cls(quantity=quantity, measured=value, u=u, true=true, error=error, z=z)


def score(
    certificate: Mapping[str, Any], measurand: Mapping[str, float]
) -> dict[str, QuantityScore]:
    """Return measured and true values of the metric and the other quantities, by name.

    For a scan the metric is compared twice: with the procedure's result on the exact curve, and
    with the maximum of the curve. The width of the curve [m], if stated, is last. A test without a
    result has no true value either: {}.
    """
    if not measurand:
        return {}
    stated = {"metric": certificate["metric"]}
    if CONTINUOUS in measurand:
        stated[CONTINUOUS] = certificate["metric"]
    stated |= {name: certificate[name] for name in QUANTITIES if name in certificate}
    if certificate.get(WIDTH_KEY) and WIDTH_KEY in measurand:
        stated[WIDTH_KEY] = certificate[WIDTH_KEY]
    return {name: QuantityScore.of(name, found, measurand[name]) for name, found in stated.items()}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CertificateScore(StudyResult):
    """A certificate compared with the truth, and whether the seal on both is intact."""

    altered: tuple[Alteration, ...]  # changes since the sealing
    sealing: str | None  # statement whether the truth can be found by trying seeds
    rows: tuple[QuantityScore, ...]  # empty if the certificate cannot be scored
    faults: tuple[str, ...] = ()  # names of the faults of the test day in the catalog

    name = "score"

    @property
    def seal(self) -> str:
        """``whole`` or ``broken``, the words of the JSON document."""
        return "broken" if self.altered else "whole"

    @property
    def _lack(self) -> str:
        return "too much was changed" if self.altered else "the test gave no result"

    @property
    def title(self) -> str:
        """Title with the state of the seal."""
        return f"comparison of a certificate with the truth, seal {self.seal}"

    @property
    def code(self) -> int:
        """The exit code of the command."""
        return 3 if self.altered else 0

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
        """The comparison as a table, and one line for each change since the test."""
        lines = [
            table_text(self.rows) if self.rows else f"no score: {self._lack}",
            "seal broken, changed since the test:" if self.altered else "seal intact",
            *(f"  {each}" for each in self.altered),
        ]
        if self.faults:
            lines.append(f"faults of the test day: {', '.join(self.faults)}")
        return "\n".join([*lines, self.sealing] if self.sealing else lines)


def score_folder(folder: Folder) -> CertificateScore:
    """Compare the certificate in a result folder with the true values.

    If files or keys in it were changed since the test, they are listed and the exit code is 3.

    Parameters
    ----------
    folder
        Result folder with ``certificate.json`` and ``truth/``.

    Raises
    ------
    InputError
        Certificate, truth or seal are missing or cannot be compared.
    """
    folder = Path(folder)
    read_bytes(folder / CERTIFICATE)
    digest = hashlib.sha256(read_bytes(folder / TRUTH)).hexdigest()
    altered = alterations(folder)
    try:
        simulation, rows, faults = _scored(folder)
    except InputError:
        if not altered:
            raise
        simulation, rows, faults = {}, (), ()
    named = {(each.file, each.key) for each in altered}
    # another digest than the certificate's: truth and seal were altered together
    bound = {(TRUTH, ""), (CERTIFICATE, "simulation.truth_digest")}
    if simulation.get("truth_digest") not in (None, digest) and not named & bound:
        altered.append(Alteration(TRUTH, "", "altered"))
    sealing = simulation.get("sealing")
    return CertificateScore(altered=tuple(altered), sealing=sealing, rows=rows, faults=faults)


def _scored(
    folder: Path,
) -> tuple[dict[str, str], tuple[QuantityScore, ...], tuple[str, ...]]:
    """Return the simulation entry of a certificate, its scores, and the faults of the day.

    `InputError` if there is nothing to score.
    """
    certificate, truth = read_json(folder / CERTIFICATE), read_json(folder / TRUTH)
    try:
        rows = tuple(score(certificate, truth["measurand"]).values())
        json.dumps([asdict(row) for row in rows], allow_nan=False)  # refuses NaN and infinity
        return {**certificate["simulation"]}, rows, tuple(map(str, truth.get("faults", ())))
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as fault:
        raise InputError(
            str(folder),
            str(fault).strip("'"),
            None,
            "this key is missing in certificate.json or truth.json, or is no number",
        ) from fault
