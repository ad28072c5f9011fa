"""Open the sealed truth of a test and say how close its certificate came."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from virtual_lab.errors import InputError
from virtual_lab.files import read_bytes, read_json
from virtual_lab.lab.measurand import CONTINUOUS, WIDTH
from virtual_lab.measurement.certification import QUANTITIES
from virtual_lab.output.tables import number, table_text

__all__ = ["score", "score_folder", "score_text"]


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
    """Score the test in an output folder and say whether the seal on its truth is whole.

    Raises
    ------
    InputError
        The certificate or the truth is missing, is not JSON or misses a key.
    """
    certificate = read_json(folder / "certificate.json")
    data = read_bytes(folder / "truth" / "truth.json")
    truth = read_json(folder / "truth" / "truth.json")
    try:
        rows = score(certificate, truth["measurand"])
        digest = certificate["simulation"].get("truth_digest")
    except (KeyError, TypeError) as fault:
        raise InputError(
            str(folder),
            str(fault).strip("'"),
            None,
            "this key is missing in certificate.json or truth.json",
        ) from fault
    whole = digest == hashlib.sha256(data).hexdigest()
    return {"seal": "whole" if whole else "broken", **rows}


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
    """Return measured against true as a table."""
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
        if name != "seal"
    ]
    seal = document["seal"]
    note = "" if seal == "whole" else ": the truth is not the one the certificate was issued with"
    return f"{table_text(rows)}\nseal {seal}{note}"
