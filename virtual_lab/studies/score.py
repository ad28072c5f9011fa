"""Open the sealed truth of a test and say how close its certificate came."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from virtual_lab.errors import InputError
from virtual_lab.files import read_bytes, read_json
from virtual_lab.lab.measurand import CONTINUOUS, WIDTH
from virtual_lab.lab.seal import TRUTH, Alteration, alterations
from virtual_lab.measurement.model import QUANTITIES
from virtual_lab.output.tables import number, table_text

__all__ = ["score", "score_folder", "score_text"]

CERTIFICATE = "certificate.json"
BOUND = {(TRUTH, ""), (CERTIFICATE, "simulation.truth_digest")}  # the one holds the other's digest
ABOUT = ("seal", "altered", "sealing")  # keys of a score that are no quantities


def score(certificate: Mapping[str, Any], measurand: Mapping[str, float]) -> dict[str, Any]:
    """Return measured against true for the metric and the quantities behind it.

    Each entry holds `measured`, `u`, `true`, `error` and `z` (the error in standard
    uncertainties, None where u is 0 or nothing was measured). Of a scan the metric stands twice:
    against the procedure's own result on the exact curve, and against the curve's greatest value;
    of a certificate that tells one, the curve's width [m] stands last.
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


def score_folder(folder: Path) -> dict[str, Any]:
    """Score the test in an output folder and say whether its seal is whole.

    Before the rows of `score` stand `seal` (whole or broken), `altered` (what is not as it was
    sealed: `file`, `key`, `change`) and `sealing` (whether who knows the records could find the
    truth again). Where what was altered cannot be scored, the rows are left out.

    Raises
    ------
    InputError
        Certificate, truth or seal are missing; or nothing was altered, and yet they hold no score.
    """
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
    return {
        "seal": "broken" if altered else "whole",
        "altered": [asdict(each) for each in altered],
        "sealing": simulation.get("sealing"),
        **rows,
    }


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


def score_text(document: Mapping[str, Any]) -> str:
    """Return measured against true as a table, and what was altered, a line each."""
    rows = [
        {
            "quantity": name,
            "measured": number(row["measured"]),
            "u": number(row["u"]),
            "true": number(row["true"]),
            "error": number(row["error"], "+.6f"),
            "error/u": number(row["z"], "+.2f"),
        }
        for name, row in document.items()
        if name not in ABOUT
    ]
    lines = [
        table_text(rows) if rows else "no score: see what was altered",
        f"seal {document['seal']}",
        *(f"  {Alteration(**each)}" for each in document["altered"]),
    ]
    if document["sealing"]:
        lines.append(str(document["sealing"]))
    return "\n".join(lines)
