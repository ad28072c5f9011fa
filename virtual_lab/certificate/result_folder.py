"""Files of every result folder: certificate, readings, records, truth, descriptors, digests."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab.certificate.columns import shot_columns
from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.seal import TRUTH, write_seal
from virtual_lab.certificate.signing import write_sums
from virtual_lab.certificate.tables import shots_as_columns
from virtual_lab.files import contents
from virtual_lab.files.tables import write_csv
from virtual_lab.measurement.certification import Certification
from virtual_lab.records.packages import (
    CRATE,
    MEDIA,
    PACKAGE,
    TableColumn,
    crate,
    data_package,
    record_tables,
)
from virtual_lab.records.session import PackedSession, Session

READINGS = "readings.csv"
APART = ("truth", "control", "film")  # folders that a result may be handed on without
TYPES = {"i": "integer", "f": "number", "b": "boolean"}  # type by kind of dtype; others are strings


def text_of_descriptor(descriptor: Mapping[str, Any]) -> str:
    """Return the content of a descriptor's file: indented JSON with a line end."""
    return json.dumps(descriptor, indent=1) + "\n"


def descriptors(
    document: CertificateDocument, session: Session, shots: Mapping[str, ArrayLike], folder: Path
) -> dict[str, Mapping[str, Any]]:
    """Return the metadata files of a result folder: their content, keyed by file name.

    The files are ``datapackage.json`` and ``ro-crate-metadata.json``.

    Parameters
    ----------
    document, session
        Certificate and session of the test.
    shots
        Columns of ``readings.csv`` keyed by name, each of shape (shot,).
    folder
        The result folder, in which all other files exist already.

    Raises
    ------
    KeyError
        A column of `shots` is not among `shot_columns`.
    """
    title = f"Test of bat {document.bat.name} by {document.procedure.name}"
    meanings = shot_columns(document.metric.name)
    readings = [
        TableColumn(
            name, meanings[name].meaning, TYPES.get(np.asarray(values).dtype.kind, "string")
        )
        for name, values in shots.items()
    ]
    files = [
        name
        for name in contents(folder)
        if name not in (PACKAGE, CRATE)
        and name.split("/")[0] not in APART
        and name.rpartition(".")[2] in MEDIA
    ]
    return {
        PACKAGE: data_package(
            title, document.statement, {READINGS: readings, **dict(record_tables(session))}
        ),
        CRATE: crate(
            title, document.statement, document.date, document.versions["virtual-lab"], files
        ),
    }


def write_result(
    folder: Path,
    document: CertificateDocument,
    certification: Certification,
    records: PackedSession,
    truth: bytes,
) -> None:
    """Write certificate, readings, records and truth into a new folder.

    `truth` is the content of ``truth.json``; if it is empty, no truth is written.
    """
    (folder / "certificate.json").write_text(document.text, encoding="utf-8")
    write_csv(shots_as_columns(certification), folder / READINGS)
    (folder / "records").mkdir()
    records.write(folder / "records")
    if truth:
        (folder / TRUTH).parent.mkdir()
        (folder / TRUTH).write_bytes(truth)


def close_result(folder: Path, document: CertificateDocument, certification: Certification) -> None:
    """Write the descriptors, the seal and the list of digests of a folder with all other files."""
    columns = shots_as_columns(certification)
    for name, each in descriptors(document, certification.session, columns, folder).items():
        (folder / name).write_text(text_of_descriptor(each), encoding="utf-8")
    if (folder / TRUTH).exists():
        write_seal(folder)
    write_sums(folder)
