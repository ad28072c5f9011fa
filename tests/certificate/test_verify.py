"""An unaltered result folder is whole; otherwise the altered file and key are named."""

from __future__ import annotations

import hashlib
import json
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

import virtual_lab as vl
from tests.certificate.altering import (
    edit_json,
    in_all_forms,
    in_document,
    sums_again,
    with_risk,
)
from tests.cli.test_cli import Run, run  # noqa: F401 its fixture
from virtual_lab.certificate import verify as verifying
from virtual_lab.certificate.comparing import Mismatch
from virtual_lab.certificate.signing import require_key, write_sums
from virtual_lab.certificate.verify import Verification, verify
from virtual_lab.errors import InputError

pytestmark = pytest.mark.usefixtures("each_form_is_made_once")

HERE = Path(__file__).parents[1]


@pytest.fixture
def result(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "copy"))


NO_TRUTH = ("truth: the folder is missing",)
NO_KEY = ("SHA256SUMS.sig: checking the signature needs the public key (key=)",)


def honest(found: Verification, unchecked: tuple[str, ...] = ()) -> None:
    assert found.rows == ()
    assert found.unchecked == unchecked
    whole = ("not all checked", 4) if unchecked else ("whole", 0)
    assert (found.state, found.code) == whole
    assert "no signature was checked: anybody" in found.text


def test_of_many_differences_the_results_are_listed_first(tmp_path: Path) -> None:
    """At most 20 lines of a table; the number in each file, and all rows in the document."""
    keys = [*(f"bat.{n}" for n in range(50)), "metric.value"]
    rows = [Mismatch(file="a.json", key=key, stated="1", expected="2") for key in keys]
    rows.append(Mismatch(file="b.csv", key="row 1", stated="1", expected="2"))
    found = Verification(folder="f", rows=tuple(rows), unchecked=())
    state, counts, _, first, *others, rest, worth = found.text.splitlines()
    assert (state, counts) == ("altered", "52 rows: 51 of a.json, 1 of b.csv")
    assert "metric.value" in first
    assert (len(others), rest) == (19, "and 32 more; the JSON document has all")
    assert worth.startswith("no signature")
    assert len(found.document["altered"]) == 52
    few = replace(found, rows=found.rows[:20])
    assert len(few.text.splitlines()) == 23


def test_an_honest_copy_is_whole(result: Path) -> None:
    """Copies: read-only, other line ends, unpacked from an archive, without the truth."""
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
    shutil.rmtree(result / "truth")
    honest(verify(result), NO_TRUTH)
    sums_again(result)  # file that no list names
    honest(verify(result), NO_TRUTH)


def test_reductions_of_records_are_whole(made: Path, tmp_path: Path) -> None:
    """Our own records, reduced again, and records of another laboratory are whole."""
    vl.reduce(made / "records").save(tmp_path / "ours", pdf=True, paper="letter")
    vl.reduce(HERE / "foreign_laboratory" / "records").save(tmp_path / "theirs")
    honest(verify(tmp_path / "ours"))
    honest(verify(tmp_path / "theirs"))


def test_a_file_that_cannot_be_made_here_is_not_checked(
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


def test_the_pdf_of_another_typst_is_compared_by_its_words(
    result: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The version in the certificate counts, not the producer that the PDF names."""
    (pdf,) = result.glob("*.pdf")
    assert json.loads((result / "certificate.json").read_text("utf-8"))["versions"]["typst"]
    monkeypatch.setattr(verifying.program, "typst", lambda: "9.9")
    found = verify(result)
    assert (found.rows, found.code) == ((), 4)
    assert any(each.startswith(f"{pdf.name}: made by Typst") for each in found.unchecked)
    in_document(metric__value=0.94, metric__interval_95=[0.93, 0.95])(result)
    edit_json(result / "certificate.json", with_risk, indent=2)
    forged = {row.key for row in verify(result).rows if row.file == pdf.name}
    assert forged == {"name", "number", "metric"}
    pdf.write_bytes(b"%PDF-1.7 Typst 9.9")
    assert {"statement", "verdict"} < {
        row.key for row in verify(result).rows if row.file == pdf.name
    }


def test_files_that_a_system_adds_are_named_and_ignored(result: Path) -> None:
    """They are ignored by their exact names: a link, or another name, is not."""
    names = [".DS_Store", "records/._gates.csv", "records/impact/desktop.ini", "truth/Thumbs.db"]
    for name in names:
        (result / name).write_bytes(b"litter")
    for _ in range(2):
        found = verify(result)
        assert (found.rows, found.state) == ((), "whole")
        assert f"ignored: {', '.join(names)}" in found.note
        write_sums(result)
    (result / "thumbs.txt").write_bytes(b"litter")
    (result / "records" / "._link").symlink_to(result / "thumbs.txt")
    assert {row.file for row in verify(result).rows} == {"thumbs.txt", "records/._link"}


@pytest.mark.parametrize(
    "stated",
    [{"versions__virtual-lab": "0.0.1"}, {"commit": {"id": "1" * 40, "changes": "ab"}}],
)
def test_another_program_that_makes_the_same_bytes_is_whole(
    result: Path, stated: dict[str, object]
) -> None:
    """The number of the certificate depends on the version, not on the commit."""
    (pdf,) = result.glob("*.pdf")
    in_all_forms(**stated)(result)
    assert pdf.exists() == ("commit" in stated)
    if "commit" not in stated:
        (renamed,) = result.glob("*.pdf")
        crate = (result / "ro-crate-metadata.json").read_text("utf-8")
        crate = crate.replace(pdf.name, renamed.name).replace(vl.__version__, "0.0.1")
        (result / "ro-crate-metadata.json").write_text(crate, "utf-8")
    sums_again(result)
    found = verify(result)
    honest(found)
    assert "; made by version " in found.note
    assert vl.__version__ in found.note


def test_the_command_says_it_by_its_code(result: Path, run: Run) -> None:  # noqa: F811
    code, out, _ = run("verify", str(result), "--json")
    assert (code, json.loads(out)["state"]) == (0, "whole")
    u = json.loads((result / "certificate.json").read_text("utf-8"))["metric"]["u"]
    in_document(metric__u=0.002)(result)
    code, out, _ = run("verify", str(result))
    assert code == 3
    assert "metric.u" in out
    in_all_forms(**{"versions__virtual-lab": "0.0.1"}, metric__u=0.002)(result)
    sums_again(result)
    code, out, _ = run("verify", str(result), "--json")
    found = json.loads(out)
    assert (code, found["state"], found["altered"]) == (4, "differs", [])
    (row,) = (each for each in found["differs"] if each["key"] == "metric.u")
    assert (row["stated"], row["expected"]) == ("0.002", f"{u:.12g}")
    (result / "certificate.json").write_text("{")
    code, _, err = run("verify", str(result))
    assert code == 2
    assert "certificate.json" in err
    assert run("verify", str(result / "nowhere"))[0] == 2


def test_an_altered_file_has_one_row(result: Path) -> None:
    """A changed digest has no row of its own if another row names the alteration."""
    truth = result / "truth" / "truth.json"
    right = hashlib.sha256(truth.read_bytes()).hexdigest()
    truth.write_bytes(truth.read_bytes().replace(b"1", b"2", 1))
    (row,) = verify(result).rows
    assert (row.key, row.expected) == ("sha256", right)
    assert row.stated == hashlib.sha256(truth.read_bytes()).hexdigest()
    with (result / "records" / "impact" / "gates.csv").open("a") as record:
        record.write("1\n")
    found = verify(result)
    assert [row.file for row in found.rows] == ["truth/truth.json", "records/impact/gates.csv"]
    assert found.rows[1].key.startswith("line ")
    assert found.unchecked == ()


@pytest.mark.parametrize("schema", [6, 8, "7", None])
def test_a_schema_that_cannot_be_read_is_refused(result: Path, schema: object) -> None:
    in_document(schema=schema)(result)
    with pytest.raises(InputError, match="make the certificate again with 'virtual-lab reduce"):
        verify(result)


@pytest.fixture
def signed(made: Path, keys: tuple[Path, Path], tmp_path: Path) -> Path:
    return vl.reduce(made / "records").save(tmp_path / "signed", sign=keys[0])


def test_a_signed_folder_is_whole(
    signed: Path,
    keys: tuple[Path, Path],
    run: Run,  # noqa: F811
) -> None:
    """It is whole with the signer's key; without a key, the signature is not checked."""
    found = verify(signed, key=keys[1])
    assert (found.rows, found.unchecked, found.signed) == ((), (), True)
    assert "signed by the owner of the key" in found.text
    honest(verify(signed), NO_KEY)
    code, out, _ = run("verify", str(signed), "--key", str(keys[1]), "--json")
    assert (code, json.loads(out)["signed"]) == (0, True)


def test_every_folder_has_digests_for_those_who_check_them_alone(result: Path) -> None:
    """The digests of all files agree, as with ``sha256sum -c``."""
    lines = (result / "SHA256SUMS").read_text("utf-8").splitlines()
    listed = {name: digest for digest, name in (line.split("  ") for line in lines)}
    here = {path for path in result.rglob("*") if path.is_file() and path.name != "SHA256SUMS"}
    assert {result / name for name in listed} == here
    for name, digest in listed.items():
        assert hashlib.sha256((result / name).read_bytes()).hexdigest() == digest


def test_a_film_of_a_signed_folder_is_checked(result: Path, keys: tuple[Path, Path]) -> None:
    """Only a signature covers the film, because no record has its digest."""
    (result / "film").mkdir()
    (result / "film" / "shot.avi").write_bytes(b"RIFF")
    sums_again(result)
    found = verify(result)
    assert (found.rows, found.code) == ((), 4)
    assert found.unchecked == ("film: the film of a shot cannot be compared with any record",)
    write_sums(result, keys[0])
    assert verify(result, key=keys[1]).state == "whole"
    (result / "film" / "shot.avi").write_bytes(b"RIFX")
    (row,) = verify(result, key=keys[1]).rows
    assert row.file == "film/shot.avi"
    shutil.rmtree(result / "film")
    assert verify(result, key=keys[1]).unchecked == ("film: the folder is missing",)


def test_the_signature_reveals_a_rewritten_folder(signed: Path, keys: tuple[Path, Path]) -> None:
    """Another test under the same name, with matching digests: only the key reveals it."""
    for path in signed.iterdir():
        if path.name != "SHA256SUMS.sig":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    other = vl.certify("ea70", seed=8).save(signed.parent / "other")
    shutil.copytree(other, signed, dirs_exist_ok=True)
    honest(verify(signed), NO_KEY)
    found = verify(signed, key=keys[1])
    assert (found.code, found.signature, found.signed) == (3, "not valid", False)
    assert found.text.endswith("the signature is not valid for this key")
    (row,) = found.rows
    assert (row.file, row.key) == ("SHA256SUMS.sig", "signature")


def test_an_alteration_after_signing_is_named(
    result: Path, keys: tuple[Path, Path], tmp_path: Path
) -> None:
    """An added file in the truth, a foreign or no signature, and another key are named."""
    write_sums(result, keys[0])
    assert verify(result, key=keys[1]).signed

    def faults() -> list[tuple[str, str]]:
        found = verify(result, key=keys[1])
        assert (found.code, found.signed) == (3, False)
        assert "no signature was checked" not in found.text
        return [(row.file, row.key) for row in found.rows]

    (result / "truth" / "more.json").write_text("{}")
    assert faults() == [("truth/more.json", "")]
    assert "SHA256SUMS was signed by the owner of the key, but" in verify(result, key=keys[1]).text
    (result / "truth" / "more.json").unlink()
    with (result / "truth" / "seal.json").open("a") as seal:
        seal.write(" ")
    sums_again(result)
    assert faults() == [("SHA256SUMS.sig", "signature")]
    (result / "SHA256SUMS.sig").write_text("no signature")
    assert faults() == [("SHA256SUMS.sig", "signature")]
    assert verify(result, key=keys[1]).text.endswith("the signature is not valid for this key")
    (result / "SHA256SUMS.sig").unlink()
    unsigned = verify(result, key=keys[1])
    assert (unsigned.state, unsigned.code, unsigned.signed) == ("not all checked", 4, False)
    assert unsigned.signature == "missing"
    assert not unsigned.rows
    assert unsigned.text.endswith("not signed: there is no SHA256SUMS.sig")
    other = Ed25519PrivateKey.generate()
    (tmp_path / "other.pem").write_bytes(
        other.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    )
    write_sums(result, tmp_path / "other.pem")
    assert faults() == [("SHA256SUMS.sig", "signature")]


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
    with pytest.raises(InputError, match="must be an Ed25519 key"):
        require_key(other, private=True)
