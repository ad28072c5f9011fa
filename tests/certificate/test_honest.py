"""A thousand different unaltered results are whole to `verify`."""

from __future__ import annotations

import hashlib
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

import virtual_lab as vl
from virtual_lab.certificate.verify import verify

MANY = 1000
BATS = {
    "astm-f1881": ("r161", "ea70", "barrel-loaded", "knob-loaded"),
    "bbcor": ("ea70", "r161"),
    "ncaa-besr": ("r161",),
    "asa": ("softball-34",),
}
NAMES = ("", "Müller & Søn", "Ωμέγα", "中文 ไทย 🏏", "O'Neil <b>", "=1+1", "שלום", "देवनागरी")


def as_it_is(folder: Path) -> Path:
    return folder


def without_truth(folder: Path) -> Path:
    shutil.rmtree(folder / "truth")
    return folder


def by_another_system(folder: Path) -> Path:
    """Convert the line ends of every text to those of another system."""
    for path in folder.rglob("*"):
        if path.suffix in (".csv", ".json", ".html", ".toml"):
            path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    return folder


def through_an_archive(folder: Path) -> Path:
    with zipfile.ZipFile(folder.with_suffix(".zip"), "w") as archive:
        for path in folder.rglob("*"):
            archive.write(path, path.relative_to(folder))
    with zipfile.ZipFile(folder.with_suffix(".zip")) as archive:
        archive.extractall(folder.with_name("out of it"))
    return folder.with_name("out of it")


def renamed(folder: Path) -> Path:
    return folder.rename(folder.with_name("Prüfung 7 (copy)"))


def read_only(folder: Path) -> Path:
    for path in folder.rglob("*"):
        path.chmod(0o555 if path.is_dir() else 0o444)
    return folder


def reduced_again(folder: Path) -> Path:
    return vl.reduce(folder / "records").save(folder.with_name("again"), pdf=True)


WAYS: tuple[Callable[[Path], Path], ...] = (
    as_it_is,
    without_truth,
    by_another_system,
    through_an_archive,
    renamed,
    read_only,
    reduced_again,
)


def honest_result(number: int, folder: Path) -> Path:
    """Save result `number`, which determines procedure, bat, names, paper and forms."""
    procedure = [*BATS, "astm-f1881", "astm-f1881"][number % 6]
    bats = BATS[procedure]
    test = vl.certify(
        bats[number % len(bats)],
        procedure=procedure,
        seed=11,
        number=number,
        laboratory={
            "customer": {"name": NAMES[number % len(NAMES)]},
            "bat": {"serial": f"S{number}"},
        },
    )
    paper = ("a4", "letter")[number % 2]
    return test.save(folder / "result", pdf=number % 3 == 0, paper=paper)


def numbers_passed(first: int, many: int, folder: Path) -> set[str]:
    """Verify the results of consecutive numbers; return the digests of their certificates."""
    digests = set()
    for number in range(first, first + many):
        here = folder / str(number)
        here.mkdir()
        handed_on = WAYS[number % len(WAYS)](honest_result(number, here))
        found = verify(handed_on)
        bare = WAYS[number % len(WAYS)] is without_truth
        lacking = ("truth: the folder is missing",) if bare else ()
        assert (found.rows, found.unchecked) == ((), lacking), (number, found.text)
        digests.add(hashlib.sha256((handed_on / "certificate.json").read_bytes()).hexdigest())
        shutil.rmtree(here)
    return digests


def test_results_copied_without_changes_pass_verification(tmp_path: Path) -> None:
    """Results are whole after the first three ways of copying."""
    assert len(numbers_passed(0, 3, tmp_path)) == 3


@pytest.mark.long
@pytest.mark.parametrize("part", range(10))
def test_a_thousand_honest_results_are_whole(part: int, tmp_path: Path) -> None:
    many = MANY // 10
    assert len(numbers_passed(part * many, many, tmp_path)) == many
