"""Ways to alter a result folder by hand, without the functions that `verify` uses."""

from __future__ import annotations

import hashlib
import json
import re
from base64 import b64encode
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tests.records.digests import channel_digest
from virtual_lab.certificate.document import MetricStated, document_of, risk_of
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.pdf import certificate_pdf, pdf_name

Change = Callable[[Path], object]


def all_of(*changes: Change) -> Change:
    return lambda folder: [change(folder) for change in changes]


def edit_json(path: Path, change: Callable[[dict[str, Any]], object], indent: int = 1) -> None:
    document = json.loads(path.read_text(encoding="utf-8"))
    change(document)
    path.write_text(json.dumps(document, indent=indent) + "\n", encoding="utf-8")


def edit(name: str, old: str, new: str) -> Change:
    def change(folder: Path) -> None:
        text = (folder / name).read_text(encoding="utf-8")
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1), encoding="utf-8", newline="")

    return change


def removed(name: str) -> Change:
    return lambda folder: (folder / name).unlink()


def in_document(**values: Any) -> Change:
    """Change certificate.json alone; keys of tables are joined by two underscores."""

    def within(document: dict[str, Any]) -> None:
        for key, value in values.items():
            *above, name = key.split("__")
            table = document
            for part in above:
                table = table[int(part) if part.isdigit() else part]
            table[name] = value

    return lambda folder: edit_json(folder / "certificate.json", within, indent=2)


def with_risk(document: dict[str, Any]) -> None:
    """Set the risk that follows from the metric, as a careful forger would."""
    metric = document["metric"]
    stated = MetricStated(**{**metric, "interval_95": tuple(metric["interval_95"])})
    risk = risk_of(stated, document["verdict"], eligible=True)
    document["risk"] = risk and asdict(risk)


def forms_again(folder: Path) -> None:
    """Make page and PDF again from certificate.json, with the new file name."""
    parsed = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    document = document_of(parsed, "")
    (folder / "certificate.html").write_text(certificate_page(document), encoding="utf-8")
    for pdf in folder.glob("*.pdf"):
        pdf.unlink()
        (folder / pdf_name(document)).write_bytes(certificate_pdf(document))


def in_all_forms(**values: Any) -> Change:
    """Change certificate.json, and make page and PDF from it again."""

    def change(folder: Path) -> None:
        in_document(**values)(folder)
        edit_json(folder / "certificate.json", with_risk, indent=2)
        forms_again(folder)

    return change


def records_told_again(folder: Path) -> None:
    """Update the digest of session.json in the certificate, and make its forms again."""
    digest = hashlib.sha256((folder / "records" / "session.json").read_bytes()).hexdigest()
    in_document(session_digest=digest)(folder)
    forms_again(folder)


def number_by_hand(text: str) -> str:
    """Return the number of a certificate.json: the start of its digest without the commit."""
    counted = json.dumps({**json.loads(text), "commit": None}, indent=2) + "\n"
    return hashlib.sha256(counted.encode()).hexdigest()[:12]


def in_record(channel: str, change: Callable[[list[str]], list[str]]) -> Change:
    """Change the lines of a record, and update its digest and rows in session.json."""

    def changed(folder: Path) -> None:
        path = folder / "records" / f"{channel}.csv"
        lines = change(path.read_text(encoding="utf-8").splitlines())
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        stage, name = channel.split("/")

        def matched(session: dict[str, Any]) -> None:
            entry = session["channels"][stage][name]
            entry["sha256"] = channel_digest(session, path)
            entry["rows"] = len(lines) - 1

        edit_json(folder / "records" / "session.json", matched)

    return changed


def in_session(change: Callable[[dict[str, Any]], object]) -> Change:
    return lambda folder: edit_json(folder / "records" / "session.json", change)


def constant(key: str, **values: Any) -> Callable[[dict[str, Any]], object]:
    return lambda session: session["calibration"][key].update(values)


def digit(row: int, old: str, new: str) -> Callable[[list[str]], list[str]]:
    def change(lines: list[str]) -> list[str]:
        lines[row] = re.sub(rf"{old}(?=[^{old}]*$)", new, lines[row], count=1)
        return lines

    return change


def heavier(lines: list[str]) -> list[str]:
    """Add 50 g to every reading of a balance."""
    rows = (line.rsplit(",", 1) for line in lines[1:])
    return [lines[0], *(f"{head},{float(mass) + 0.05!r}" for head, mass in rows)]


def swapped(lines: list[str]) -> list[str]:
    """Exchange the edges of the first two shots, but not their indices."""

    def split(line: str) -> tuple[str, str]:
        head, _, value = line.rpartition(",")
        return head, value

    per_shot = sum(line.startswith("0,") for line in lines)
    first, second = (
        [split(line) for line in lines[1 + k * per_shot : 1 + (k + 1) * per_shot]] for k in (0, 1)
    )
    both = [f"{a},{d}" for (a, _), (_, d) in zip(first, second, strict=True)]
    both += [f"{c},{b}" for (_, b), (c, _) in zip(first, second, strict=True)]
    return [lines[0], *both, *lines[1 + 2 * per_shot :]]


def supplied(session: dict[str, Any]) -> None:
    """Declare the records as those of another laboratory."""
    session.pop("simulation")
    session.update(origin="supplied", laboratory="Crosstown Bat Laboratory")


def another_logo(session: dict[str, Any]) -> None:
    white = cv2.imencode(".png", np.full((9, 9), 255, np.uint8))[1].tobytes()
    logo = f"data:image/png;base64,{b64encode(white).decode()}"
    session["particulars"]["laboratory"]["logo"] = logo


def pdf_of(folder: Path) -> Path:
    (found,) = folder.glob("*.pdf")
    return found


def another_attachment(folder: Path) -> None:
    """Replace the PDF by that of a better result."""
    parsed = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    parsed["valid_hits"] += 1
    pdf_of(folder).write_bytes(certificate_pdf(document_of(parsed, "")))


def sums_again(folder: Path) -> None:
    """Write SHA256SUMS again, as ``sha256sum`` does, if the folder has it."""
    if not (folder / "SHA256SUMS").exists():
        return
    names = sorted(
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith("SHA256SUMS")
    )
    inner = [path.parent for path in folder.rglob("SHA256SUMS") if path.parent != folder]
    for each in inner:
        sums_again(each)
    names += [each.relative_to(folder).as_posix() + "/SHA256SUMS" for each in inner]
    lines = [
        f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}\n" for name in names
    ]
    (folder / "SHA256SUMS").write_text("".join(lines), encoding="utf-8", newline="")
