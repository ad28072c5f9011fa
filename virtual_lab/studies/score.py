"""Open the sealed truth of a test and say how close its certificate came."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from virtual_lab.errors import InputError
from virtual_lab.files import read_bytes, read_json
from virtual_lab.lab.measurand import CONTINUOUS, WIDTH
from virtual_lab.lab.seal import TRUTH, Alteration, alterations
from virtual_lab.measurement.model import QUANTITIES
from virtual_lab.output.result import StudyResult
from virtual_lab.output.tables import Column, number, table_text

__all__ = ["Scored", "score", "score_folder"]

CERTIFICATE = "certificate.json"
BOUND = {(TRUTH, ""), (CERTIFICATE, "simulation.truth_digest")}  # the one holds the other's digest
COLUMNS = {
    "quantity": Column("quantity"),
    "measured": Column("measured", "SI", lambda row: number(row["measured"])),
    "u": Column("u", "SI", lambda row: number(row["u"])),
    "true": Column("true", "SI", lambda row: number(row["true"])),
    "error": Column("error", "SI", lambda row: number(row["error"], "+.6f")),
    "z": Column("error", "u", lambda row: number(row["z"], "+.2f")),
}
ALTERED = 3  # exit code
ABOUT = ("seal", "altered", "sealing")  # keys of a score that are no quantities


def score(certificate: Mapping[str, Any], measurand: Mapping[str, float]) -> dict[str, Any]:
    """Return measured against true for the metric and the quantities behind it.

    Each entry holds `measured`, `u`, `true`, `error` and `z` (the error in standard
    uncertainties, None where u is 0 or nothing was measured). Of a scan the metric stands twice:
    against the procedure's own result on the exact curve, and against the curve's greatest value;
    of a certificate that states one, the curve's width [m] stands last.
    """
    metric = certificate["metric"]
    rows = {"metric": _row(metric, measurand["metric"])}
    if CONTINUOUS in measurand:
        rows[CONTINUOUS] = _row(metric, measurand[CONTINUOUS])
    for name in QUANTITIES:
        if name in certificate:
            rows[name] = _row(certificate[name], measurand[name])
    if certificate.get(WIDTH) and WIDTH in measurand:
        rows[WIDTH] = _row(certificate[WIDTH], measurand[WIDTH])
    return rows


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Scored(StudyResult):
    """A certificate beside the truth, and whether the seal on both is whole."""

    document: dict[str, Any]

    name = "score"

    @property
    def title(self) -> str:
        """Whether the seal is whole."""
        return f"Score of a certificate, seal {self.document['seal']}"

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row a quantity."""
        return [
            {"quantity": name} | row for name, row in self.document.items() if name not in ABOUT
        ]

    @property
    def code(self) -> int:
        """The exit code of the command."""
        return ALTERED if self.document["altered"] else 0

    @property
    def text(self) -> str:
        """Measured against true as a table, and what was altered, a line each."""
        lines = [
            table_text(self.rows, COLUMNS) if self.rows else "no score: see what was altered",
            f"seal {self.document['seal']}",
            *(f"  {Alteration(**each)}" for each in self.document["altered"]),
        ]
        if self.document["sealing"]:
            lines.append(str(self.document["sealing"]))
        return "\n".join(lines)


def score_folder(folder: str | Path) -> Scored:
    """Score the test in an output folder and say whether its seal is whole.

    In the document, before the rows of `score`, stand `seal` (whole or broken), `altered` (what is
    not as it was sealed: `file`, `key`, `change`) and `sealing` (whether who knows the records
    could find the truth again). Where what was altered cannot be scored, the rows are left out.

    Raises
    ------
    InputError
        Certificate, truth or seal are missing; or nothing was altered, and yet they hold no score.
    """
    folder = Path(folder)
    read_bytes(folder / CERTIFICATE)
    digest = hashlib.sha256(read_bytes(folder / TRUTH)).hexdigest()
    altered = alterations(folder)
    try:
        simulation, rows = _scored(folder)
    except InputError:
        if not altered:
            raise
        simulation, rows = {}, {}
    named = {(each.file, each.key) for each in altered}
    if simulation.get("truth_digest", digest) != digest and not named & BOUND:
        altered.append(Alteration(TRUTH, "", "altered"))  # and the seal to match
    document = {
        "seal": "broken" if altered else "whole",
        "altered": [asdict(each) for each in altered],
        "sealing": simulation.get("sealing"),
        **rows,
    }
    return Scored(document=document)


def _scored(folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return how a certificate was simulated, and its score; `InputError` where it has none."""
    certificate, truth = read_json(folder / CERTIFICATE), read_json(folder / TRUTH)
    try:
        rows = score(certificate, truth["measurand"])
        json.dumps(rows, allow_nan=False)  # what is no finite number has no score
        return {**certificate["simulation"]}, rows
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as fault:
        raise InputError(
            str(folder),
            str(fault).strip("'"),
            None,
            "this key is missing in certificate.json or truth.json, or is no number",
        ) from fault


def _row(measured: Mapping[str, Any], true: float) -> dict[str, float | None]:
    value, u = measured["value"], measured["u"]
    error = None if value is None else value - true
    return {
        "measured": value,
        "u": u,
        "true": true,
        "error": error,
        "z": error / u if error is not None and u else None,
    }
