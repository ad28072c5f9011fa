"""Files of every result folder: certificate, readings, records, truth, descriptors, digests."""

from __future__ import annotations

from pathlib import Path

from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.packages import READINGS, descriptors, text_of_descriptor
from virtual_lab.certificate.seal import TRUTH, write_seal
from virtual_lab.certificate.signing import write_sums
from virtual_lab.certificate.tables import shots_as_columns
from virtual_lab.files.tables import write_csv
from virtual_lab.measurement.certification import Certification
from virtual_lab.records.session import PackedSession


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
