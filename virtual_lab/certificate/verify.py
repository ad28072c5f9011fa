"""Whether a result folder is as it was made: its reduction repeated, its forms made anew.

The truth is not opened. Whoever rewrites records and all forms alike stays hidden: only a signature
would show that.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from itertools import zip_longest
from math import isclose, isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.certificate.document import SCHEMA, CertificateDocument, document_of
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.packages import READINGS, descriptors
from virtual_lab.certificate.pdf import PAPERS, certificate_pdf, pdf_name
from virtual_lab.certificate.signing import SIGNATURE, SUMS, unsigned
from virtual_lab.certificate.tables import shot_table
from virtual_lab.errors import DISTRIBUTION, InputError
from virtual_lab.files import contents, parse_table, read_bytes, read_json, read_table
from virtual_lab.measurement.certification import certify_session
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.tables import column, csv_text, table_text
from virtual_lab.records.packages import CRATE, PACKAGE
from virtual_lab.records.session import SESSION, digest_of_text, load_session

if TYPE_CHECKING:
    import pandas as pd

CERTIFICATE, PAGE, RECORDS = "certificate.json", "certificate.html", "records"
UNOPENED, FILM, CONTROL = "truth", "film", "control"
TOLERANCE = 1e-9  # relative: what other processors change
UNSIGNED = "without a signature, someone who rewrites the records and all forms alike stays hidden"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mismatch:
    """A file, or a key in it, that is not what the records give."""

    file: str = column("file", form="")
    key: str = column("key", form="")
    stated: str = column("stated", form="")
    found: str = column("by the records", form="")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Verification(StudyResult):
    """What of a result folder is not as it was made."""

    folder: str
    rows: tuple[Mismatch, ...]
    unchecked: tuple[str, ...]  # what could not be compared here, and why
    signed: bool = False  # by the key that was given
    note: str = ""  # of a certificate of another version

    name = "verify"

    @property
    def state(self) -> str:
        """``whole``, ``altered`` or ``not all checked``, the words of the JSON document."""
        return "altered" if self.rows else "not all checked" if self.unchecked else "whole"

    @property
    def title(self) -> str:
        """Title with folder and state."""
        return f"verification of {self.folder}: {self.state}"

    @property
    def code(self) -> int:
        """The exit code of the command."""
        return {"whole": 0, "altered": 3, "not all checked": 4}[self.state]

    @property
    def document(self) -> Json:
        """The result for JSON."""
        return {
            "state": self.state,
            "altered": [asdict(row) for row in self.rows],
            "unchecked": list(self.unchecked),
            "signed": self.signed,
            "note": self.note,
        }

    @property
    def text(self) -> str:
        """What was altered as a table, what was not checked, and what no check can show."""
        lines = [self.state]
        if self.rows:
            lines.append(table_text(self.rows))
        lines += [f"not checked: {each}" for each in self.unchecked]
        hidden = "signed by the owner of the key" if self.signed else UNSIGNED
        return "\n".join([*lines, *filter(None, [self.note]), hidden])


def verify(folder: str | Path, *, key: str | Path | None = None) -> Verification:
    """Repeat the reduction of a result folder, make its forms anew, and compare.

    With the public `key` of who signed it, every file is compared with what was signed, too.

    Raises
    ------
    InputError
        No folder with a certificate, or one of another schema; a file that holds no key, or the
        extra ``sign`` is missing.
    """
    folder = Path(folder)
    found = _by_its_records(folder)
    if key is None:
        return found
    rows = tuple(
        Mismatch(file=each.file, key="signature", stated=each.stated, found=each.found)
        for each in unsigned(folder, Path(key), UNOPENED)
    )
    return replace(found, rows=found.rows + rows, signed=not rows)


def _by_its_records(folder: Path) -> Verification:
    stated = read_json(folder / CERTIFICATE)
    if stated.get("schema") != SCHEMA:
        allowed = f"allowed: {SCHEMA}; make the certificate again with 'virtual-lab reduce RECORDS'"
        raise InputError(str(folder / CERTIFICATE), "schema", stated.get("schema"), allowed)
    made_by = _at(stated, "versions", "virtual-lab")
    if made_by != version(DISTRIBUTION):
        return _of_another_version(folder, stated, made_by)
    rows, unchecked = list(_strays(folder)), list[str]()
    document = None
    try:
        certification = certify_session(load_session(folder / RECORDS))
    except InputError as fault:
        rows.append(_refused(fault, folder))
    else:
        digest = _at(stated, "simulation", "truth_digest")
        session = digest_of_text(read_bytes(folder / RECORDS / SESSION))
        document = certificate(certification, truth_digest=digest, session_digest=session)
        document, other = _with_versions(document, stated)
        unchecked += other
        changed = list(differences(stated, document.as_json(), CERTIFICATE))
        if not changed:
            document = document_of(stated, CERTIFICATE)  # whose very last digits the forms have
        rows += changed
        shots = shot_table(certification)
        rows += _readings(folder, shots)
        told = descriptors(document, certification.session, shots, folder)
        for name, each in told.items():
            rows += _descriptor(folder / name, each)
    of_forms, other = _forms(folder, document)
    rows, unchecked = rows + of_forms, unchecked + other
    if (folder / FILM).is_dir():
        unchecked.append(f"{FILM}: the film of a shot shows what no record holds")
    replaced, note = _replaced(folder, stated)
    rows += replaced
    if (folder / CONTROL).is_dir():
        control = _by_its_records(folder / CONTROL)
        rows += [replace(row, file=f"{CONTROL}/{row.file}") for row in control.rows]
        unchecked += [f"{CONTROL}/{each}" for each in control.unchecked]
    return Verification(folder=str(folder), rows=tuple(rows), unchecked=tuple(unchecked), note=note)


def _replaced(folder: Path, stated: Mapping[str, Any]) -> tuple[list[Mismatch], str]:
    """Return what of the chain of replaced reports was altered, and what it says of the first.

    A report lies beside the one that replaces it, in a folder of the name that this one states.
    """
    told = _at(stated, "particulars", "replaces")
    name, number = _at(told, "folder"), _at(told, "number")
    if not isinstance(name, str) or Path(name).name != name:
        return [], ""
    old = folder.resolve().parent / name
    if not (old / CERTIFICATE).is_file():
        return [], f"it replaces {number}, whose folder {name} is not beside this one"
    digest, wanted = digest_of_text(read_bytes(old / CERTIFICATE)), str(_at(told, "digest"))
    if digest != wanted:  # and followed no further: a forged chain may run in a circle
        file = f"../{name}/{CERTIFICATE}"
        return [Mismatch(file=file, key="sha256", stated=wanted, found=digest)], ""
    found = _by_its_records(old)
    rows = [replace(row, file=f"../{name}/{row.file}") for row in found.rows]
    return rows, "; ".join(filter(None, [f"it replaces {number} in {name}", found.note]))


def _at(document: Any, *keys: str) -> Any:
    for key in keys:
        document = document.get(key) if isinstance(document, Mapping) else None
    return document


def _refused(fault: InputError, folder: Path) -> Mismatch:
    """Return what records that cannot be read, or not be reduced, say."""
    where = fault.where.removeprefix(f"{folder}/") or RECORDS
    if not where.startswith(RECORDS):
        where = f"{RECORDS}/{where}"
    value = "" if fault.value is None else str(fault.value)
    return Mismatch(file=where, key=fault.key, stated=value, found=fault.allowed)


def _with_versions(
    document: CertificateDocument, stated: Mapping[str, Any]
) -> tuple[CertificateDocument, list[str]]:
    """Return the document with the libraries it was made with, and which of them differ here."""
    libraries = _at(stated, "versions")
    if not isinstance(libraries, Mapping) or libraries.keys() != document.versions.keys():
        return document, []
    other = [
        f"versions.{name}: {libraries[name]} stated, {here} here"
        for name, here in document.versions.items()
        if libraries[name] != here
    ]
    return replace(document, versions=dict(libraries)), other


def _descriptor(path: Path, found: Mapping[str, Any]) -> Iterator[Mismatch]:
    """Yield what of a descriptor is not that of the folder."""
    try:
        stated = read_json(path)
    except InputError as fault:
        yield Mismatch(file=path.name, key=fault.key, stated="", found=fault.allowed)
    else:
        yield from differences(stated, found, path.name)


def differences(stated: Any, found: Any, file: str, key: str = "") -> Iterator[Mismatch]:
    """Yield the keys of a JSON file that are not what the records give."""
    if isinstance(stated, Mapping) and isinstance(found, Mapping):
        for name in [*found, *(name for name in stated if name not in found)]:
            own = f"{key}.{name}" if key else name
            if name not in stated or name not in found:
                there, here = (
                    _value(each[name]) if name in each else "" for each in (stated, found)
                )
                yield Mismatch(file=file, key=own, stated=there, found=here)
            else:
                yield from differences(stated[name], found[name], file, own)
    elif isinstance(stated, list) and isinstance(found, list) and len(stated) == len(found):
        for number, (there, here) in enumerate(zip(stated, found, strict=True)):
            yield from differences(there, here, file, f"{key}[{number}]")
    elif not _same(stated, found):
        yield Mismatch(file=file, key=key, stated=_value(stated), found=_value(found))


def _same(stated: Any, found: Any) -> bool:
    either = (stated, found)
    if any(isinstance(each, bool) for each in either):
        return type(stated) is type(found) and bool(stated == found)
    if all(isinstance(each, float) and isnan(each) for each in either):  # empty cells
        return True
    if all(isinstance(each, int | float) for each in either):
        return isclose(stated, found, rel_tol=TOLERANCE, abs_tol=1e-15)
    return type(stated) is type(found) and bool(stated == found)


def _value(value: Any) -> str:
    """Return a value of JSON to be printed: a text in quotes, a number to twelve digits."""
    return _shown(f"{value:.12g}" if isinstance(value, float) else json.dumps(value))


def _shown(text: str) -> str:
    """Return a value cut short, with a digest by which two long ones differ."""
    cut = f"{text[:48]}… {hashlib.sha256(text.encode()).hexdigest()[:8]}"
    return text if len(text) <= 60 else cut


def _readings(folder: Path, shots: pd.DataFrame) -> Iterator[Mismatch]:
    """Yield the cells of readings.csv that are not what the records give."""
    try:
        stated = read_table(folder / READINGS)
    except InputError as fault:
        yield Mismatch(file=READINGS, key=fault.key, stated="", found=fault.allowed)
        return
    found = parse_table(csv_text(shots).encode(), READINGS)
    if [*stated.columns] != [*found.columns] or len(stated) != len(found):
        shape = f"{len(found)} rows of {len(found.columns)} columns"
        yield Mismatch(
            file=READINGS,
            key="",
            stated=f"{len(stated)} rows of {len(stated.columns)} columns",
            found=shape,
        )
        return
    for name in found.columns:
        for row, (there, here) in enumerate(zip(stated[name], found[name], strict=True)):
            if not _same(there, here):
                key = f"row {row}, {name}"
                yield Mismatch(
                    file=READINGS, key=key, stated=_shown(str(there)), found=_shown(str(here))
                )


def _forms(folder: Path, document: CertificateDocument | None) -> tuple[list[Mismatch], list[str]]:
    """Return what of page and PDF the document does not give, and what could not be compared."""
    pdfs = sorted(path.name for path in folder.glob("*.pdf"))
    if document is None:
        return [], [f"{name}: the records give no certificate" for name in (PAGE, *pdfs)]
    rows, unchecked = list(_page(folder / PAGE, document)), []
    for name in pdfs:
        if name != pdf_name(document):
            rows.append(Mismatch(file=name, key="name", stated=name, found=pdf_name(document)))
        try:
            rows += _pdf(folder / name, document)
        except InputError as fault:  # the extra that makes it is missing, or another one made it
            unchecked.append(f"{name}: {fault}")
    return rows, unchecked


def _pdf(path: Path, document: CertificateDocument) -> Iterator[Mismatch]:
    """Yield a mismatch of a PDF that is not made of the document, on whatever paper.

    `InputError` where that cannot be told here.
    """
    found, wanted = read_bytes(path), b""
    for paper in PAPERS:
        wanted = certificate_pdf(document, paper)
        if found == wanted:
            return
    producer = re.compile(rb"Typst [\d.]+")
    theirs, ours = producer.findall(found), producer.findall(wanted)
    if theirs and theirs != ours:
        raise InputError("", "Typst", theirs[0].decode(), f"here it is {ours[0].decode()}")
    yield Mismatch(file=path.name, key="", stated="", found="another file than the records give")


def _page(path: Path, document: CertificateDocument) -> Iterator[Mismatch]:
    """Yield the first line in which the page is not that of the document."""
    if not path.is_file():
        yield Mismatch(file=path.name, key="", stated="", found="the file is missing")
        return
    found = read_bytes(path).decode(errors="replace").splitlines()
    pages = (certificate_page(document, paper).splitlines() for paper in PAPERS)
    first = next(pages)  # most have its paper
    if found == first or found in pages:
        return
    for number, (there, here) in enumerate(zip_longest(found, first, fillvalue=""), start=1):
        if there != here:
            own = {"stated": _shown(there.strip()), "found": _shown(here.strip())}
            yield Mismatch(file=path.name, key=f"line {number}", **own)
            return


def _strays(folder: Path) -> Iterator[Mismatch]:
    """Yield files that belong to no result; those among the records their session refuses."""
    own = {CERTIFICATE, PAGE, READINGS, PACKAGE, CRATE, SUMS, SIGNATURE}
    for name, kind in contents(folder).items():
        top = name.split("/")[0]
        if top in (UNOPENED, RECORDS, CONTROL, FILM) and "/" in name:
            continue
        if kind != "file":
            yield Mismatch(file=name, key="", stated=f"a {kind}", found="no such thing")
        elif name not in own and not re.fullmatch(r"[^/]+\.pdf", name):
            yield Mismatch(file=name, key="", stated="a file", found="no such file")


def _of_another_version(folder: Path, stated: Mapping[str, Any], made_by: Any) -> Verification:
    """Compare the page's number with the document's: another version may print otherwise."""
    document = document_of(dict(stated), str(folder / CERTIFICATE))
    rows = []
    number = pdf_name(document).split("-")[1]
    page = folder / PAGE
    if not page.is_file() or number not in read_bytes(page).decode(errors="replace"):
        rows.append(Mismatch(file=PAGE, key="number", stated="", found=number))
    note = f"made by version {made_by}, this is {version(DISTRIBUTION)}: only the number in print"
    return Verification(
        folder=str(folder),
        rows=tuple(rows),
        unchecked=(),
        note=f"{note} was compared",
    )
