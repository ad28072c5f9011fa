"""The seal of a result folder: a file that was altered or removed is named."""

import json
import shutil
from pathlib import Path

import pytest

from tests.conftest import Play
from virtual_lab.api import Certificate
from virtual_lab.certificate.comparing import Mismatch
from virtual_lab.certificate.seal import compared_seal, write_seal
from virtual_lab.errors import InputError


@pytest.fixture(scope="module")
def issued(played: Play, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of one test as it was written."""
    tested = played()
    folder = tmp_path_factory.mktemp("seal") / "r161"
    return Certificate(certification=tested.certification, sealed=tested.sealed).save(folder)


@pytest.fixture
def folder(issued: Path, tmp_path: Path) -> Path:
    """Return a copy of the folder to alter."""
    return Path(shutil.copytree(issued, tmp_path / "r161"))


def named(folder: Path) -> list[str]:
    return [row.file for row in compared_seal(folder) if isinstance(row, Mismatch)]


def test_an_unaltered_folder_is_whole(folder: Path) -> None:
    """Line ends may differ, and other files may lie beside it, which `verify` reports."""
    (folder / "notes.txt").write_text("seen by me")
    (folder / ".DS_Store").write_text("")
    path = folder / "readings.csv"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert named(folder) == []


def test_one_byte_of_any_file_and_its_absence_are_named(folder: Path) -> None:
    """The truth and the settings of the command are protected by the seal, too."""
    (folder / "settings.toml").write_text('bat = "r161"\n')
    write_seal(folder)
    apart = ("seal.json", "SHA256SUMS")
    files = [path for path in folder.rglob("*") if path.is_file() and path.name not in apart]
    assert len(files) > 20
    for path in files:
        name, content = path.relative_to(folder).as_posix(), path.read_bytes()
        path.write_bytes(content + b" ")
        assert named(folder) == [name]
        path.unlink()
        assert named(folder) == [name]
        path.symlink_to("/dev/null")
        assert named(folder) == [name]
        path.unlink()
        path.write_bytes(content)


def test_a_control_bats_folder_is_sealed_too(folder: Path) -> None:
    """The test of a control bat is sealed with the test that used it, and alone."""
    shutil.copytree(folder, folder / "control")
    write_seal(folder)
    with (folder / "control" / "certificate.json").open("a") as file:
        file.write(" ")
    assert named(folder) == ["control/certificate.json"]
    assert named(folder / "control") == ["certificate.json"]


@pytest.mark.parametrize("text", [None, "", "[]", "{}", '{"files": 3}', "[" * 100_000])
def test_a_missing_or_unreadable_seal_is_bad_input(text: str | None, folder: Path) -> None:
    seal = folder / "truth" / "seal.json"
    seal.unlink()
    if text is not None:
        seal.write_text(text)
    with pytest.raises(InputError, match=r"truth/seal.json"):
        named(folder)


def test_the_seal_of_the_seal_is_no_part_of_it(folder: Path) -> None:
    text = (folder / "truth" / "seal.json").read_text()
    write_seal(folder)
    assert (folder / "truth" / "seal.json").read_text() == text
    files = json.loads(text)["files"]
    assert "truth/truth.json" in files
    assert not {"truth/seal.json", "SHA256SUMS"} & {*files}
