"""A result folder is as it was made, or the file and key that is not are named."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import zipfile
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
)

import virtual_lab as vl
from tests.cli.test_cli import Run, run  # noqa: F401 its fixture
from virtual_lab.certificate import verify as verifying
from virtual_lab.certificate.document import CertificateDocument, MetricStated, document_of, risk_of
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.pdf import certificate_pdf, pdf_name
from virtual_lab.certificate.signing import require_key
from virtual_lab.certificate.verify import Verification, verify
from virtual_lab.errors import InputError

LOGO = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path fill="black"/></svg>'
HERE = Path(__file__).parents[1]


@pytest.fixture(scope="module", autouse=True)
def each_document_is_set_once() -> Iterator[None]:
    """Keep every PDF that verify makes; that its bytes repeat has a test of its own."""
    kept: dict[tuple[str, str], bytes] = {}

    def of_kept(document: CertificateDocument, paper: str) -> bytes:
        if (document.text, paper) not in kept:
            kept[document.text, paper] = certificate_pdf(document, paper)
        return kept[document.text, paper]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(verifying, "certificate_pdf", of_kept)
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    (folder / "logo.svg").write_text(LOGO)
    lab = folder / "lab.toml"
    lab.write_text('[laboratory]\nname = "Bat Laboratory"\nlogo = "logo.svg"\n')
    test = vl.certify("r161", seed=7, laboratory=lab, customer="Ashwood & Sons")
    return test.save(folder / "result", pdf=True)


@pytest.fixture
def result(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "copy"))


def edit_json(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    document = json.loads(path.read_text(encoding="utf-8"))
    change(document)
    path.write_text(json.dumps(document, indent=1), encoding="utf-8")


def edit(name: str, old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        text = (folder / name).read_text(encoding="utf-8")
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")

    return change


def in_document(**values: Any) -> Callable[[Path], None]:
    """Change certificate.json alone; keys of tables are joined by two underscores."""

    def change(folder: Path) -> None:
        def within(document: dict[str, Any]) -> None:
            for key, value in values.items():
                *above, name = key.split("__")
                table = document
                for part in above:
                    table = table[part]
                table[name] = value

        edit_json(folder / "certificate.json", within)

    return change


def with_risk(document: dict[str, Any]) -> None:
    """Let the risk follow from the metric, as who forges it well does."""
    metric = document["metric"]
    stated = MetricStated(**{**metric, "interval_95": tuple(metric["interval_95"])})
    risk = risk_of(stated, document["verdict"], eligible=True)
    document["risk"] = risk and asdict(risk)


def in_all_forms(**values: Any) -> Callable[[Path], None]:
    """Change certificate.json, and make page and PDF anew from it, name and all."""

    def change(folder: Path) -> None:
        in_document(**values)(folder)
        edit_json(folder / "certificate.json", with_risk)
        parsed = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
        document = document_of(parsed, "")
        (folder / "certificate.html").write_text(certificate_page(document), encoding="utf-8")
        for pdf in folder.glob("*.pdf"):
            pdf.unlink()
        (folder / pdf_name(document)).write_bytes(certificate_pdf(document))

    return change


def in_record(channel: str, change: Callable[[list[str]], list[str]]) -> Callable[[Path], None]:
    """Change the lines of a record, and its digest and rows in session.json to match."""

    def changed(folder: Path) -> None:
        path = folder / "records" / f"{channel}.csv"
        lines = change(path.read_text(encoding="utf-8").splitlines())
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        stage, name = channel.split("/")

        def matched(session: dict[str, Any]) -> None:
            entry = session["channels"][stage][name]
            entry["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
            entry["rows"] = len(lines) - 1

        edit_json(folder / "records" / "session.json", matched)

    return changed


def in_session(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], None]:
    return lambda folder: edit_json(folder / "records" / "session.json", change)


def digit(row: int, old: str, new: str) -> Callable[[list[str]], list[str]]:
    def change(lines: list[str]) -> list[str]:
        lines[row] = re.sub(rf"{old}(?=[^{old}]*$)", new, lines[row], count=1)
        return lines

    return change


def swapped(lines: list[str]) -> list[str]:
    """Exchange the edges of the first two shots, whose indices stay."""

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


def constant(key: str, **values: Any) -> Callable[[dict[str, Any]], object]:
    return lambda session: session["calibration"][key].update(values)


def pdf_of(folder: Path) -> Path:
    (found,) = folder.glob("*.pdf")
    return found


def another_attachment(folder: Path) -> None:
    """Write the PDF of a better result under the name of this one."""
    parsed = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    parsed["valid_hits"] += 1
    pdf_of(folder).write_bytes(certificate_pdf(document_of(parsed, "")))


def another_logo(session: dict[str, Any]) -> None:
    laboratory = session["particulars"]["laboratory"]
    kind, _, drawn = laboratory["logo"].partition(",")
    other = b64decode(drawn).replace(b"black", b"white")
    laboratory["logo"] = f"{kind},{b64encode(other).decode()}"


CALIBRATION = "impact.gates.distance_0"
TAMPERED: dict[str, tuple[Callable[[Path], None], str, str]] = {  # change, file, key
    # one form alone
    "the value in the document": (
        in_document(metric__value=0.9),
        "certificate.json",
        "metric.value",
    ),
    "its u": (in_document(metric__u=0.001), "certificate.json", "metric.u"),
    "a key removed": (
        lambda folder: edit_json(folder / "certificate.json", lambda d: d.pop("flags")),
        "certificate.json",
        "flags",
    ),
    "a key added": (in_document(logo="gold"), "certificate.json", "logo"),
    "the verdict": (in_document(verdict="FAIL"), "certificate.json", "verdict"),
    "a number as text": (in_document(valid_hits="6"), "certificate.json", "valid_hits"),
    "the value on the page": (edit("certificate.html", "± ", "± 0"), "certificate.html", "line"),
    "SIMULATED gone from the page": (
        edit("certificate.html", "SIMULATED", "CERTIFIED"),
        "certificate.html",
        "line",
    ),
    "the page cut short": (
        lambda folder: (folder / "certificate.html").write_text("<html>"),
        "certificate.html",
        "line",
    ),
    "the page removed": (
        lambda folder: (folder / "certificate.html").unlink(),
        "certificate.html",
        "",
    ),
    "a reading in the table": (edit("readings.csv", ",60.", ",61."), "readings.csv", "row"),
    "a row of the table gone": (
        lambda folder: (folder / "readings.csv").write_text(
            "\n".join((folder / "readings.csv").read_text().splitlines()[:-1]) + "\n"
        ),
        "readings.csv",
        "",
    ),
    "a PDF of another document": (another_attachment, "pdf", ""),
    "a byte of the PDF": (
        lambda folder: pdf_of(folder).write_bytes(pdf_of(folder).read_bytes() + b"\n"),
        "pdf",
        "",
    ),
    "a PDF renamed": (
        lambda folder: pdf_of(folder).rename(folder / "certificate-000000000000-SIMULATED.pdf"),
        "pdf",
        "name",
    ),
    "a file added": (
        lambda folder: (folder / "approved.txt").write_text("yes"),
        "approved.txt",
        "",
    ),
    "a record added": (
        lambda folder: (folder / "records/impact/more.csv").write_text("a\n1\n"),
        "records/impact/more.csv",
        "file",
    ),
    "a record removed": (
        lambda folder: (folder / "records/impact/aim.csv").unlink(),
        "records/impact/aim.csv",
        "file",
    ),
    "a record edited": (
        edit("records/impact/gates.csv", "1", "2"),
        "records/impact/gates.csv",
        "sha256",
    ),
    "the rules edited": (
        edit("records/procedure.toml", "valid_hits", "valid_hits "),
        "records/procedure.toml",
        "sha256",
    ),
    # several forms alike, so that only the records tell
    "u halved in all forms": (in_all_forms(metric__u=0.002), "certificate.json", "metric.u"),
    "the value and its interval in all forms": (
        in_all_forms(metric__value=0.94, metric__interval_95=[0.93, 0.95]),
        "certificate.json",
        "metric.value",
    ),
    "another customer in all forms": (
        in_all_forms(particulars__customer__name="Nobody"),
        "certificate.json",
        "particulars.customer.name",
    ),
    "another date in all forms": (in_all_forms(date="2020-01-01"), "certificate.json", "date"),
    "another bat in all forms": (in_all_forms(bat__name="ea70"), "certificate.json", "bat.name"),
    "rejected hits gone in all forms": (
        in_all_forms(rejected_hits=[], valid_hits=12),
        "certificate.json",
        "valid_hits",
    ),
    "a digit of a reading, its digest too": (
        in_record("bench/bat-mass", digit(1, "8", "9")),
        "certificate.json",
        "bat.mass_kg.value",
    ),
    "a row gone, its digest too": (
        in_record("bench/bat-mass", lambda lines: lines[:-1]),
        "certificate.json",
        "bat.mass_kg",
    ),
    "records of two shots exchanged, their digests too": (
        in_record("impact/gates", swapped),
        "certificate.json",
        "shots[0]",
    ),
    "a calibration": (
        in_session(constant(CALIBRATION, value=0.56)),
        "certificate.json",
        "metric.value",
    ),
    "the u of a calibration": (
        in_session(constant(CALIBRATION, u=1e-5)),
        "certificate.json",
        "metric.u",
    ),
    "the unit of a column": (
        edit("datapackage.json", "[oz_av]", "kg"),
        "datapackage.json",
        "resources[0].schema.fields[2].unit",
    ),
    "a file left out of the crate": (
        lambda folder: edit_json(
            folder / "ro-crate-metadata.json", lambda crate: crate["@graph"][1]["hasPart"].pop()
        ),
        "ro-crate-metadata.json",
        "@graph[1].hasPart",
    ),
    "the PDF removed": (
        lambda folder: pdf_of(folder).unlink(),
        "ro-crate-metadata.json",
        "@graph",
    ),
    "another logo": (
        in_session(another_logo),
        "certificate.json",
        "particulars.laboratory.logo",
    ),
    "the due date of an instrument": (
        in_session(
            lambda session: session["particulars"]["instruments"]["pivot-gates"].update(
                due="2031-01-01"
            )
        ),
        "certificate.json",
        "particulars.instruments",
    ),
    "a word of the records that no result uses": (
        in_session(constant(CALIBRATION, source="recalibrated")),
        "certificate.json",
        "session_digest",
    ),
    "the sealing": (
        in_session(lambda session: session["simulation"].update(sealing="sealed")),
        "certificate.json",
        "simulation.sealing",
    ),
}


def test_there_are_thirty_ways() -> None:
    assert len(TAMPERED) >= 30


@pytest.mark.parametrize("way", TAMPERED)
def test_what_was_altered_is_named(result: Path, way: str) -> None:
    """With its file and key, and with both values where it has any."""
    change, file, key = TAMPERED[way]
    change(result)
    found = verify(result)
    assert found.code == 3
    named = [row for row in found.rows if row.file.endswith(file) and row.key.startswith(key)]
    assert named, found.text
    for row in named:
        assert row.stated != row.found
    assert "altered" in found.text


def honest(found: Verification) -> None:
    assert found.rows == ()
    assert found.unchecked == ()
    assert (found.state, found.code) == ("whole", 0)
    assert "whoever" not in found.text
    assert "without a signature" in found.text


def test_an_honest_copy_is_whole(result: Path) -> None:
    """Read-only, without the truth, with other line ends, and out of an archive."""
    shutil.rmtree(result / "truth")
    honest(verify(result))
    for path in [*result.rglob("*.csv"), *result.rglob("*.json"), result / "certificate.html"]:
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    honest(verify(result))
    with zipfile.ZipFile(result.parent / "all.zip", "w") as archive:
        for path in result.rglob("*"):
            archive.write(path, path.relative_to(result))
    with zipfile.ZipFile(result.parent / "all.zip") as archive:
        archive.extractall(result.parent / "again")
    for path in (result.parent / "again").rglob("*"):
        path.chmod(0o555 if path.is_dir() else 0o444)
    honest(verify(result.parent / "again"))


def test_reductions_of_records_are_whole(made: Path, tmp_path: Path) -> None:
    """Our own, repeated, and those of another laboratory."""
    vl.reduce(made / "records").save(tmp_path / "ours", pdf=True, paper="letter")
    vl.reduce(HERE / "foreign_laboratory" / "records").save(tmp_path / "theirs")
    honest(verify(tmp_path / "ours"))
    honest(verify(tmp_path / "theirs"))


def test_the_truth_is_not_opened(result: Path) -> None:
    for path in (result / "truth").iterdir():
        path.write_text("no JSON")
    honest(verify(result))


def test_what_cannot_be_made_here_is_not_checked(
    result: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(*_: object) -> bytes:
        raise InputError("", "pdf", None, "needs Typst")

    monkeypatch.setattr(verifying, "certificate_pdf", missing)
    found = verify(result)
    assert (found.rows, found.code) == ((), 4)
    assert "needs Typst" in found.text
    edit_json(
        result / "certificate.json", lambda document: document["versions"].update(numpy="1.0")
    )
    assert any("versions.numpy: 1.0 stated" in each for each in verify(result).unchecked)


def test_a_certificate_of_another_version_is_compared_by_its_number(result: Path) -> None:
    in_all_forms(versions={"virtual-lab": "0.0.1"}, metric__u=0.002)(result)
    found = verify(result)
    assert (found.code, found.rows) == (0, ())
    assert "made by version 0.0.1" in found.text
    in_document(metric__u=0.003)(result)
    assert verify(result).code == 3


def test_the_command_says_it_by_its_code(result: Path, run: Run) -> None:  # noqa: F811
    code, out, _ = run("verify", str(result), "--json")
    assert (code, json.loads(out)["state"]) == (0, "whole")
    in_document(metric__u=0.002)(result)
    code, out, _ = run("verify", str(result))
    assert code == 3
    assert "metric.u" in out
    (result / "certificate.json").write_text("{")
    code, _, err = run("verify", str(result))
    assert code == 2
    assert "certificate.json" in err
    assert run("verify", str(result / "nowhere"))[0] == 2


def test_an_older_schema_is_made_again(result: Path) -> None:
    in_document(schema=2)(result)
    with pytest.raises(InputError, match="make the certificate again with 'virtual-lab reduce"):
        verify(result)


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Make a private key and its public part."""
    folder, private = tmp_path_factory.mktemp("keys"), Ed25519PrivateKey.generate()
    (folder / "private.pem").write_bytes(
        private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    )
    (folder / "public.pem").write_bytes(
        private.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    )
    return folder / "private.pem", folder / "public.pem"


@pytest.fixture
def signed(made: Path, keys: tuple[Path, Path], tmp_path: Path) -> Path:
    return vl.reduce(made / "records").save(tmp_path / "signed", key=keys[0])


def test_a_signed_folder_is_whole_without_its_truth(
    signed: Path,
    keys: tuple[Path, Path],
    run: Run,  # noqa: F811
) -> None:
    """And for those who check digests alone."""
    found = verify(signed, key=keys[1])
    assert (found.rows, found.signed) == ((), True)
    assert "signed by the owner of the key" in found.text
    for line in (signed / "SHA256SUMS").read_text().splitlines():
        digest, name = line.split("  ")
        assert hashlib.sha256((signed / name).read_bytes()).hexdigest() == digest
    honest(verify(signed))
    code, out, _ = run("verify", str(signed), "--key", str(keys[1]), "--json")
    assert (code, json.loads(out)["signed"]) == (0, True)


def test_who_rewrites_everything_is_found_by_the_signature(
    signed: Path, keys: tuple[Path, Path]
) -> None:
    """Another test under the same name, with digests to match: whole, but for the key."""
    other = vl.certify("ea70", seed=8).save(signed.parent / "other")
    for path in signed.iterdir():
        if not path.name.startswith("SHA256SUMS"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    shutil.copytree(other, signed, dirs_exist_ok=True, ignore=shutil.ignore_patterns("truth"))
    assert verify(signed).code == 0
    found = verify(signed, key=keys[1])
    assert (found.code, found.signed) == (3, False)
    assert {row.key for row in found.rows} == {"signature"}
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(signed).as_posix()}"
        for path in sorted(signed.rglob("*"))
        if path.is_file() and not path.name.startswith("SHA256SUMS")
    ]
    (signed / "SHA256SUMS").write_text("\n".join(lines) + "\n")
    (row,) = verify(signed, key=keys[1]).rows
    assert row.file == "SHA256SUMS.sig"
    (signed / "SHA256SUMS.sig").unlink()
    (row,) = verify(signed, key=keys[1]).rows
    assert row.file == "SHA256SUMS.sig"


def test_a_file_that_is_no_key_is_refused_before_the_test(
    keys: tuple[Path, Path],
    tmp_path: Path,
    run: Run,  # noqa: F811
) -> None:
    (tmp_path / "none.pem").write_text("no key")
    for path, said in ((tmp_path / "none.pem", "private key in PEM"), (keys[1], "private key")):
        code, _, err = run("certify", "r161", "--sign", str(path), "--out", "new")
        assert (code, said in err) == (2, True)
        assert not (tmp_path / "new").exists()
    rsa_key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    other = tmp_path / "rsa.pem"
    other.write_bytes(rsa_key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    with pytest.raises(InputError, match="must be of the kind Ed25519"):
        require_key(other, private=True)
