"""Verification of a result folder: its consistency, and its agreement with this program.

A folder is *altered* if it contradicts itself: by a digest, by a value copied from the records, or
by a page or PDF with other content. It *differs* if another version or commit made it and
this program computes other results from the same records. Anybody with the program can make a
consistent folder from invented records, so only a signature shows who made it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from html import unescape
from pathlib import Path
from typing import Any

from virtual_lab.certificate import program
from virtual_lab.certificate.comparing import (
    FolderFinding,
    Mismatch,
    Remark,
    RowState,
    Unchecked,
    at,
    compared_json,
    compared_table,
    compared_text,
    differences,
    same_text,
    within,
)
from virtual_lab.certificate.document import (
    CertificateDocument,
    CommitStated,
    document_of,
    number_of,
    require_schema,
    text_of,
)
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.pdf import PAPERS, certificate_pdf, text_of_pdf
from virtual_lab.certificate.printed import printed_result
from virtual_lab.certificate.result_folder import READINGS, descriptors, text_of_descriptor
from virtual_lab.certificate.seal import SEAL
from virtual_lab.certificate.seal import TRUTH as TRUTH_FILE
from virtual_lab.certificate.signing import SIGNATURE, SUMS, compared_sums, signature_fault
from virtual_lab.certificate.tables import shots_as_columns
from virtual_lab.errors import InputError, name_parameters
from virtual_lab.files import contents, litter, read_bytes, read_json, read_toml
from virtual_lab.files.folders import ResultFolder
from virtual_lab.files.tables import csv_text
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.measurement.procedure.model import CONTROL as RATIO
from virtual_lab.output.result import Json, StudyResult
from virtual_lab.output.tables import table_text
from virtual_lab.parameters import SETTINGS, File
from virtual_lab.records.origin import DAY_FILES, REHEARSAL, Simulated
from virtual_lab.records.packages import CRATE, PACKAGE
from virtual_lab.records.session import SESSION, digest_of_text, load_session
from virtual_lab.streams import commitment

CERTIFICATE, PAGE, RECORDS = "certificate.json", "certificate.html", "records"
TRUTH, FILM, CONTROL = "truth", "film", "control"
TYPST = {"typst"}  # key of a version that only a certificate with a PDF states
MISSING, NO_FOLDER = "the file is missing", "the folder is missing"
OPTIONAL = (TRUTH, FILM, CONTROL)  # folders that may be missing from a result that was handed on
COPIED = re.compile(  # keys of the document with values copied from the records
    r"(origin|laboratory|customer|date|particulars|simulation|session_digest|rigs"
    r"|bat\.name|ball\.name)\b"
)
RESULTS = re.compile(  # keys for which each difference from this program is listed
    r"(verdict|flags|metric\.(value|u|interval_95)"
    r"|shots(\[\d+\]\.(recoil_efficiency|rebound_efficiency|used|reason))?)(\[\d+\]|\.|$)"
)
MOST_LISTED = 20  # largest number of rows that the text lists
SIGNED = "signed by the owner of the key"
SIGNATURES = {  # last line of the text by state of the signature
    "valid": SIGNED,
    "not valid": "the signature is not valid for this key",
    "missing": f"not signed: there is no {SIGNATURE}",
    "not checked": "no signature was checked: "
    "anybody with the program can make a folder of invented records",
}
ALTERED_THOUGH_SIGNED = (
    f"{SUMS} was {SIGNED}, but the folder differs from this list or contradicts itself"
)
STATES = {"whole": 0, "altered": 3, "differs": 4, "not all checked": 4}  # exit codes


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Verification(StudyResult):
    """Contradictions within a result folder, and its differences from this program's results."""

    folder: str
    rows: tuple[Mismatch, ...]
    unchecked: tuple[str, ...]  # parts that could not be compared here, and why
    signature: str = "not checked"  # one of `SIGNATURES`
    note: str = ""  # remarks on the program that made it and on the replaced report

    name = "verify"

    @property
    def state(self) -> str:
        """One of `STATES`."""
        states = {row.state for row in self.rows}
        if states:
            return "altered" if "altered" in states else "differs"
        return "not all checked" if self.unchecked else "whole"

    @property
    def signed(self) -> bool:
        """Whether the given key signed the folder, and nothing in it was altered."""
        return self.signature == "valid" and self.state != "altered"

    @property
    def title(self) -> str:
        """Title with folder and state."""
        return f"verification of {self.folder}: {self.state}"

    @property
    def code(self) -> int:
        """The exit code of the command."""
        return STATES[self.state]

    def _of(self, state: str) -> list[Mismatch]:
        return [row for row in self.rows if row.state == state]

    @property
    def document(self) -> Json:
        """The result for JSON."""
        return {
            "state": self.state,
            "altered": [asdict(row) for row in self._of("altered")],
            "differs": [asdict(row) for row in self._of("differs")],
            "unchecked": list(self.unchecked),
            "signature": self.signature,
            "signed": self.signed,
            "note": self.note,
        }

    @property
    def text(self) -> str:
        """The first alterations and differences, lines on unchecked parts, and the signer."""
        lines = ["whole: no file was changed" if self.state == "whole" else self.state]
        if altered := self._of("altered"):
            lines += listed_rows(altered)
        if differing := self._of("differs"):
            lines += ["differs from this program:", *listed_rows(differing)]
        lines += [f"not checked: {each}" for each in self.unchecked]
        worth = SIGNATURES[self.signature]
        if self.signature == "valid" and not self.signed:
            worth = ALTERED_THOUGH_SIGNED
        return "\n".join([*lines, *filter(None, [self.note]), worth])


def listed_rows(rows: Sequence[Mismatch]) -> list[str]:
    """Return a table of rows as lines; of many, their number in each file and the first results."""
    if len(rows) <= MOST_LISTED:
        return [table_text(rows)]
    files = Counter(row.file for row in rows)
    first = sorted(rows, key=lambda row: not RESULTS.match(row.key))[:MOST_LISTED]
    return [
        f"{len(rows)} rows: {', '.join(f'{count} of {file}' for file, count in files.items())}",
        table_text(first),
        f"and {len(rows) - MOST_LISTED} more; the JSON document has all",
    ]


def verify(folder: ResultFolder, *, key: File | None = None) -> Verification:
    """Check a result folder.

    Its records are reduced again, and differences are listed. The certificate and the other files
    are compared too. Of the truth, only the digest is compared. The exit code is 3 if anything was
    altered. It is 4 if a part could not be checked, or if another version made the folder and this
    version computes other results from its records.

    Parameters
    ----------
    folder
        Result folder with a ``certificate.json``.
    key
        Public key of the signer, a PEM file (needs the extra ``sign``). If it is given, the
        signature is checked.

    Raises
    ------
    InputError
        The folder has no certificate, its schema cannot be read, a file is not a key, or the extra
        ``sign`` is not installed.
    """
    folder = Path(folder)
    fault = None if key is None else signature_fault(folder, Path(key))
    findings = [*_findings(folder), *([fault] if fault else [])]
    rows = named_rows(each for each in findings if isinstance(each, Mismatch))
    unchecked = [each.text for each in findings if isinstance(each, Unchecked)]
    signature = "not checked" if key is None else "valid"
    if fault:
        signature = "not valid" if isinstance(fault, Mismatch) else "missing"
    if (folder / FILM).is_dir() and signature != "valid":
        unchecked.append(f"{FILM}: the film of a shot cannot be compared with any record")
    if (folder / SIGNATURE).exists() and key is None:
        needed = name_parameters("needs the public key ({key})")
        unchecked.append(f"{SIGNATURE}: checking the signature {needed}")
    return Verification(
        folder=str(folder),
        rows=rows,
        unchecked=tuple(dict.fromkeys(unchecked)),
        signature=signature,
        note="; ".join(dict.fromkeys(each.text for each in findings if isinstance(each, Remark))),
    )


def named_rows(rows: Iterable[Mismatch]) -> tuple[Mismatch, ...]:
    """Return rows without those that only state a digest, if another row names the alteration."""
    rows = tuple(dict.fromkeys(rows))
    named = {row.file for row in rows if row.key != "sha256" and row.state == "altered"}
    return tuple(row for row in rows if row.key != "sha256" or row.file not in named)


def reduced_document(
    certification: Certification, stated: Mapping[str, Any], session_digest: str
) -> CertificateDocument:
    """Return the certificate that this program makes from a test result, for a comparison.

    Parameters
    ----------
    stated
        JSON values of the certificate to compare with. These values are copied from it:

        * the digest of the truth
        * the versions, if they have the keys that this program writes, and perhaps ``typst``.
          Otherwise the result has the versions of this program.
        * the commit, if it has the keys ``id`` and ``changes``. Otherwise the result has no commit.
    session_digest
        SHA-256 of ``session.json``.
    """
    digest = at(stated, "simulation", "truth_digest")
    expected = certificate(certification, truth_digest=digest, session_digest=session_digest)
    versions, commit = stated.get("versions"), stated.get("commit")
    if isinstance(versions, Mapping) and versions.keys() - TYPST == expected.versions.keys():
        expected = replace(expected, versions=dict(versions))
    if isinstance(commit, Mapping) and commit.keys() == {"id", "changes"}:
        return replace(expected, commit=CommitStated(**commit))
    return replace(expected, commit=None)


def _findings(folder: Path) -> Iterator[FolderFinding]:
    """Yield the findings about a folder, except for its signature."""
    stated = read_json(folder / CERTIFICATE)
    require_schema(stated, str(folder / CERTIFICATE))
    of_day = DAY_FILES if at(stated, "simulation", "sealing") == REHEARSAL else ()
    yield from _strays(folder, of_day)
    if ignored := litter(folder):
        yield Remark(f"ignored: {', '.join(ignored)}")
    yield from compared_sums(folder, OPTIONAL + of_day)
    yield from _truth(folder, stated)
    elsewhere = made_elsewhere(stated)
    document, certification = None, (yield from _certify_records(folder, bool(elsewhere)))
    if certification:
        document = yield from _document(folder, stated, certification, bool(elsewhere))
        yield from _tables(folder, document, certification, bool(elsewhere))
        yield from _control(folder, certification, bool(elsewhere))
        yield from _settings(folder / SETTINGS, certification)
    yield from _forms(folder, document, stated, bool(elsewhere))
    if elsewhere:
        yield Remark(elsewhere)
    for name, here in program.versions().items():
        there = at(stated, "versions", name)
        if name != "virtual-lab" and there != here:
            yield Unchecked(f"versions.{name}: {there} stated, {here} here")
    yield from _check_replaced_reports(folder, stated)


def made_elsewhere(stated: Mapping[str, Any]) -> str:
    """Return a sentence if another version of the program made a certificate, otherwise "".

    The sentence names both versions and commits. It is returned if the version or the commit in the
    certificate differs from the running program. `stated` are the JSON values of the certificate.
    """
    here = program.commit()
    of_here = (program.versions()["virtual-lab"], here and asdict(here))
    of_there = (at(stated, "versions", "virtual-lab"), stated.get("commit"))
    there, ours = (
        f"version {version}, "
        + (f"commit {str(at(commit, 'id'))[:12]}" if commit else "no commit stated")
        + (" with changes" if at(commit, "changes") else "")
        for version, commit in (of_there, of_here)
    )
    return "" if of_there == of_here else f"made by {there}; this is {ours}"


def _certify_records(
    folder: Path, elsewhere: bool
) -> Generator[FolderFinding, None, Certification | None]:
    """Yield findings on records that cannot be reduced; return their certification."""
    session = None
    try:
        session = load_session(folder / RECORDS)
        return certify_session(session)
    except InputError as fault:
        where = fault.where.removeprefix(f"{folder}/") or RECORDS
        where = where if where.startswith(RECORDS) else f"{RECORDS}/{where}"
        if session and elsewhere:
            yield Unchecked(f"{where}: this program cannot reduce them ({fault})")
        else:
            yield _report_fault(where, fault)
        return None


def _report_fault(file: str, fault: InputError) -> Mismatch:
    """Return the finding for a file that cannot be read or contradicts itself."""
    value = "" if fault.value is None else str(fault.value)
    return Mismatch(file=file, key=fault.key, stated=value, expected=fault.allowed)


def _document(
    folder: Path, stated: Mapping[str, Any], certification: Certification, elsewhere: bool
) -> Generator[FolderFinding, None, CertificateDocument | None]:
    """Yield the keys of a certificate with values that differ from the document computed here.

    Return the document to compare page and PDF with. It is None if the certificate is not valid, or
    if another program made it and its values differ.
    """
    digest = digest_of_text(read_bytes(folder / RECORDS / SESSION))
    expected = reduced_document(certification, stated, digest)
    rows = list(differences(stated, expected.as_json(), CERTIFICATE))
    layout = compared_text(CERTIFICATE, same_text(folder / CERTIFICATE), text_of(stated))
    if not rows:
        yield from layout
        try:
            # Page and PDF show the last digits of the stated document, which may differ from ours.
            return document_of(dict(stated), CERTIFICATE)
        except InputError as fault:  # versions or commit are not strings
            yield _report_fault(CERTIFICATE, fault)
            return None
    if not elsewhere:
        yield from rows
        return expected
    for row in rows:
        is_copied = row.stated and COPIED.match(row.key)
        yield row if is_copied else replace(row, state="differs")
    return None


def _tables(
    folder: Path,
    document: CertificateDocument | None,
    certification: Certification,
    elsewhere: bool,
) -> Iterator[FolderFinding]:
    """Yield differences of the table of shots and of the descriptors from the records."""
    shots = shots_as_columns(certification)
    rows = list(compared_table(folder / READINGS, csv_text(shots)))
    if document:
        packages = descriptors(document, certification.session, shots, folder)
        for name, each in packages.items():
            rows += compared_json(folder / name, each, text_of_descriptor(each))
    yield from (replace(row, state="differs") for row in rows) if elsewhere else rows


def _settings(path: Path, certification: Certification) -> Iterator[Mismatch]:
    """Yield the arguments of ``certify`` in a settings file that the records contradict.

    A sheet in a file is not compared, because its name is inside the file.
    """
    if not path.exists():
        return
    session = certification.session
    try:
        text, stated = same_text(path), read_toml(path)
    except InputError as fault:
        yield _report_fault(SETTINGS, fault)
        return
    origin = session.origin if isinstance(session.origin, Simulated) else None
    motion = origin and origin.rungs.get("motion")
    recorded = {  # value in the records, and default of ``certify``
        "bat": (session.bat, ""),
        "procedure": (certification.procedure.name, "astm-f1881"),
        "ball": (session.ball, None),
        "rig": (session.rigs.get("impact"), None),
        "reality": (origin and origin.reality, "real"),
        "motion": (motion and motion.rung, "closed-form"),
        "uncertainty": (session.uncertainty, "first-order"),
    }
    is_certified = not (session.is_rehearsed or "records" in stated)
    for key, (value, default) in recorded.items():
        absent = default if is_certified and f"# {key}: " not in text else None
        given = stated.get(key, absent)
        if given not in (None, value) and not str(given).endswith(".toml"):
            yield Mismatch(file=SETTINGS, key=key, stated=str(given), expected=str(value))


def _truth(folder: Path, stated: Mapping[str, Any]) -> Iterator[FolderFinding]:
    """Yield mismatches if a truth does not have the stated digest, or the seed of the commitment.

    The true values follow from the seed, but only `virtual_lab.score` computes them.
    """
    stated_digest, path = at(stated, "simulation", "truth_digest"), folder / TRUTH_FILE
    if path.is_file():
        digest = digest_of_text(read_bytes(path))
        if digest != stated_digest:
            yield Mismatch(
                file=TRUTH_FILE, key="sha256", stated=digest, expected=str(stated_digest or "")
            )
        yield Remark("truth: only `score` can check it")
        committed = at(stated, "simulation", "seed_commitment")  # compared with the records
        try:
            truth = read_json(path)
            found = commitment(bytes.fromhex(truth["salt"]), truth["seed"])
        except (KeyError, TypeError, ValueError) as fault:
            found = f"cannot be used ({fault})"
        if committed and committed != found:
            yield Mismatch(file=TRUTH_FILE, key="seed", stated=found, expected=str(committed))
    elif (folder / TRUTH).exists():
        yield Mismatch(file=TRUTH_FILE, key="", stated=MISSING, expected="")
    elif stated_digest:
        yield Unchecked(f"{TRUTH}: {NO_FOLDER}")


def _control(
    folder: Path, certification: Certification, elsewhere: bool
) -> Iterator[FolderFinding]:
    """Yield differences of the control bat's test from the control test named in the records."""
    session, there = certification.session, folder / CONTROL
    ratio, stated_digest = session.calibration.get(RATIO), session.control_sha256
    corrected = ratio and (ratio.u or ratio.value != 1)  # the control bat's own test has 1 and 0
    if not there.exists():
        if stated_digest or corrected:
            yield Unchecked(f"{CONTROL}: {NO_FOLDER}")
        return
    if not (stated_digest or (elsewhere and ratio)):
        yield Mismatch(file=CONTROL, key="", stated="a folder", expected="no such folder")
        return
    try:
        digest = digest_of_text(read_bytes(there / RECORDS / SESSION))
        if stated_digest and digest != stated_digest:
            file = f"{CONTROL}/{RECORDS}/{SESSION}"
            yield Mismatch(file=file, key="sha256", stated=digest, expected=stated_digest)
        yield from within(CONTROL, _findings(there))
        e = at(read_json(there / CERTIFICATE), "restitution")
    except InputError as fault:
        yield _report_fault(fault.where.removeprefix(f"{folder}/"), fault)
        return
    correction = certification.procedure.correction
    if ratio and correction:
        stated = {"value": ratio.value * correction.standard, "u": ratio.u * correction.standard}
        yield from differences(stated, e, f"{RECORDS}/{SESSION}", f"calibration.{RATIO}")


def _forms(
    folder: Path,
    document: CertificateDocument | None,
    stated: Mapping[str, Any],
    elsewhere: bool,
) -> Iterator[FolderFinding]:
    """Yield differences of page and PDF from the document, and parts that cannot be compared."""
    if not (folder / PAGE).is_file():
        yield Mismatch(file=PAGE, key="", stated=MISSING, expected="")
    here, there = program.typst(), at(stated, "versions", "typst")
    state: RowState = "differs" if elsewhere else "altered"  # other programs use other words
    for path in (*folder.glob(PAGE), *sorted(folder.glob("*.pdf"))):
        is_page, other = path.name == PAGE, elsewhere
        if not is_page and number_of(stated) not in path.name:
            expected = number_of(stated)
            yield Mismatch(file=path.name, key="name", stated=path.name, expected=expected)
        if not is_page and here != there:
            other = True
            yield Unchecked(f"{path.name}: made by Typst {there}, here it is {here}")
        try:
            if other:
                text = _text_of_page(path) if is_page else text_of_pdf(path)
                yield from _words(path.name, text, stated)
            if document and (is_page or here == there):
                for row in (_page if is_page else _pdf)(path, document):
                    yield replace(row, state=state)
        except InputError as fault:  # no extra ``pdf``, or Typst fails
            yield Unchecked(f"{path.name}: {fault}")
        if elsewhere and not document:  # otherwise the reason is an alteration
            why = "another version made it; only number and result were compared"
            yield Unchecked(f"{path.name}: {why}")


def _text_of_page(path: Path) -> str:
    return unescape(re.sub("<[^>]*>", " ", same_text(path)))


def _page(path: Path, document: CertificateDocument) -> Iterator[Mismatch]:
    """Yield the first line that differs from the document's page; nothing if either size agrees."""
    stated, pages = same_text(path), (certificate_page(document, paper) for paper in PAPERS)
    first = next(pages)  # the paper of most certificates
    if stated != first and stated not in pages:
        yield from compared_text(path.name, stated, first)


def _pdf(path: Path, document: CertificateDocument) -> Iterator[Mismatch]:
    """Yield a mismatch if the PDF is not that of the document for any paper size.

    Raises `InputError` if the extra ``pdf`` is not installed, or if Typst fails.
    """
    stored = read_bytes(path)
    if all(stored != certificate_pdf(document, paper) for paper in PAPERS):
        wrong = "differs from the file made from the records"
        yield Mismatch(file=path.name, key="", stated=wrong, expected="")


def _words(file: str, text: str, stated: Mapping[str, Any]) -> Iterator[FolderFinding]:
    """Yield values of the document that are missing in the text of a page or PDF."""
    expected = {"number": number_of(stated), "verdict": str(stated.get("verdict"))}
    if stated.get("origin") == "simulated":
        expected["statement"] = "SIMULATED"
    try:
        result = printed_result(document_of(dict(stated), CERTIFICATE))
    except InputError as fault:
        yield _report_fault(CERTIFICATE, fault)
    else:
        if result["stated"]:
            expected["metric"] = f"{result['value']} ± {result['expanded']}"
    for key, word in expected.items():
        if word not in text:
            yield Mismatch(file=file, key=key, stated="", expected=word)


def _check_replaced_reports(folder: Path, stated: Mapping[str, Any]) -> Iterator[FolderFinding]:
    """Yield alterations in the chain of replaced reports, and remarks on it.

    The folder of a replaced report is beside the folder of its replacement. The replacement states
    the name of this folder.
    """
    earlier = at(stated, "particulars", "replaces")
    if not earlier:
        return
    name, number = str(at(earlier, "folder")), at(earlier, "number")
    if name in ("", ".", "..") or Path(name).name != name:
        return  # reported when the records are loaded or compared
    old = folder.resolve().parent / name
    if not (old / CERTIFICATE).is_file():
        yield Remark(f"it replaces {number}, whose folder {name} is not beside this one")
        return
    digest, stated_digest = (
        digest_of_text(read_bytes(old / CERTIFICATE)),
        str(at(earlier, "digest")),
    )
    if digest != stated_digest:  # the chain ends here: a forged one may be circular
        file = f"../{name}/{CERTIFICATE}"
        yield Mismatch(file=file, key="sha256", stated=digest, expected=stated_digest)
        return
    yield Remark(f"it replaces {number} in {name}")
    try:
        there = read_json(old / CERTIFICATE)
        facts, expected = (
            {"number": of, **{key: {"name": at(each, key, "name")} for key in ("bat", "procedure")}}
            for each, of in ((there, number_of(there)), (stated, number))
        )
        yield from differences(facts, expected, f"../{name}/{CERTIFICATE}")
        yield from within(f"../{name}", _findings(old))
    except InputError as fault:
        yield Unchecked(f"../{name}: {fault}")


def _strays(folder: Path, of_day: Iterable[str]) -> Iterator[Mismatch]:
    """Yield the files that do not belong to a result, except in the folder of the records.

    `of_day` are the names of the files of a rehearsed day.
    """
    of_result = {CERTIFICATE, PAGE, READINGS, PACKAGE, CRATE, SETTINGS, SUMS, SIGNATURE, *of_day}
    of_result |= {TRUTH_FILE, SEAL}
    for name, kind in contents(folder).items():
        top = name.split("/")[0]
        if top in (RECORDS, CONTROL) and "/" in name:
            continue
        if kind != "file":
            stated = f"a {kind}" if kind != "folder" else "an empty folder"
            yield Mismatch(file=name, key="", stated=stated, expected="no such entry")
        elif not (
            name in of_result or re.fullmatch(r"[^/]+\.pdf", name) or (top == FILM and "/" in name)
        ):
            yield Mismatch(file=name, key="", stated="a file", expected="no such file")
