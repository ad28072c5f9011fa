"""A small campaign, made once, and copies to damage."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import virtual_lab as vl
from virtual_lab.campaigns.folder import PARTS

KEY = "impact.gates.distance_u"
COLUMN = f"{KEY}_mm"  # column of the key, in the unit of the sheet
STUDY = f"""
bats = ["r161"]  # a remark
procedures = ["astm-f1881"]
laboratories = 6
repeats = 2
seed = 5
[change]
"{KEY}" = [0.05, 0.1]  # mm
"""


def begun(folder: Path, text: str = STUDY) -> Path:
    study = folder.parent / "study.toml"
    study.write_text(text, "utf-8")
    return study


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a finished campaign: four parts of six laboratories."""
    folder = tmp_path_factory.mktemp("campaign") / "made"
    account = vl.campaign(begun(folder), folder)
    assert (account.parts, account.made, account.missing) == (4, 4, {})
    return folder


@pytest.fixture
def copy(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "copy"))


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files of a campaign by path, without the remarks of its study."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def part(folder: Path, number: int) -> Path:
    (found,) = (folder / PARTS).glob(f"{number:07}-*")
    return found
