"""Results read back from their folders, and the reports that are replaced by others."""

from __future__ import annotations

from pathlib import Path

from virtual_lab.certificate.comparing import differences
from virtual_lab.certificate.document import CertificateDocument, read_document
from virtual_lab.certificate.verify import (
    CERTIFICATE,
    COPIED,
    RECORDS,
    made_elsewhere,
    reduced_document,
)
from virtual_lab.errors import InputError
from virtual_lab.files import read_bytes
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.records.particulars import ReplacedReport
from virtual_lab.records.session import SESSION, digest_of_text, load_session

# keys with values that must agree even if another program made the certificate
RESULT = ("verdict", "metric", "shots", "budget")


def replaced_report(
    replaced: str | Path | None, reason: str, bat: str, procedure: str
) -> ReplacedReport | None:
    """Return a reference to the report that a new report replaces.

    The reference holds the number, the digest and the folder name of the old report, and the
    reason. `replaced` is the result folder of the old report. The result is None if it is None
    and `reason` is empty. Raises `InputError` if only one of them is stated, if the folder has no
    certificate that this version can read, or if the old report is about another bat than `bat` or
    another procedure than `procedure`, both names.
    """
    if replaced is None and not reason:
        return None
    if replaced is None or not reason:
        key, value = ("reason", reason) if replaced is None else ("replaces", str(replaced))
        raise InputError("", key, value, "needs both the folder that is replaced and the reason")
    folder = Path(replaced)
    document = read_document(folder / CERTIFICATE)
    for key, new in (("bat", bat), ("procedure", procedure)):
        if (old := getattr(document, key).name) != new:
            allowed = f"allowed: a report on the same {key}, {new}; another test is a new report"
            raise InputError(str(folder / CERTIFICATE), f"{key}.name", old, allowed)
    return ReplacedReport(
        number=document.number,
        digest=digest_of_text(read_bytes(folder / CERTIFICATE)),
        folder=folder.resolve().name,
        reason=reason,
    )


def read_and_reduce(folder: Path) -> tuple[CertificateDocument, Certification]:
    """Return the certificate in a result folder, and the test result computed from its records.

    Raises `InputError` if the folder has no certificate or no usable records, or if the records
    yield a different certificate. If another version of the program made the certificate, only its
    result and the values copied from the records must agree.
    """
    stated = read_document(folder / CERTIFICATE)
    certification = certify_session(load_session(folder / RECORDS))
    digest, there = digest_of_text(read_bytes(folder / RECORDS / SESSION)), stated.as_json()
    here = reduced_document(certification, there, digest).as_json()
    elsewhere = made_elsewhere(there)
    for row in differences(there, here, CERTIFICATE):
        if elsewhere and not (row.key.startswith(RESULT) or COPIED.match(row.key)):
            continue
        allowed = f"its records give {row.expected}; for details: virtual-lab verify {folder}"
        raise InputError(str(folder / CERTIFICATE), row.key, row.stated, allowed)
    return stated, certification


def result_folders(folder: Path) -> list[Path]:
    """Return `[folder]` if it is a result folder, otherwise the result folders directly in it.

    The folders are sorted by path. A result folder contains a ``certificate.json``. Raises
    `InputError` if `folder` is missing, or if neither it nor a folder directly in it is a result
    folder.
    """
    if not folder.is_dir():
        raise InputError(str(folder), "result folder", None, "no such folder")
    if (folder / CERTIFICATE).exists():
        return [folder]
    inner = sorted(path.parent for path in folder.glob(f"*/{CERTIFICATE}"))
    if not inner:
        raise InputError(
            str(folder), CERTIFICATE, None, "not found in this folder or in its subfolders"
        )
    return inner
