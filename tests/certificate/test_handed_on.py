"""Folders of many tests: those that `vl.sweep` keeps, and the exercise with hidden faults."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from random import Random

import pytest

import virtual_lab as vl
from virtual_lab.errors import InputError

MANY = 2  # number of faulty tests of 200


def quiet(*_: object) -> None:
    """Ignore the progress."""


def test_a_sweep_keeps_a_folder_a_test_that_loads_and_verifies(tmp_path: Path) -> None:
    table = vl.sweep(
        "r161", laboratories=2, seed=3, certificates=tmp_path / "all", truth=False, progress=quiet
    )
    for number, row in table.iterrows():
        folder = tmp_path / "all" / f"r161-astm-f1881-{number:05d}"
        found = vl.load(folder)
        assert (found.value, found.u) == pytest.approx((row.value, row.u), rel=1e-12)
        assert (folder / "truth").exists() is False
        assert not (folder / "records/impact/encoder.csv").read_text().startswith("shot,sample")
        assert vl.verify(folder).code == 0
    with pytest.raises(InputError, match="is not empty"):
        vl.sweep("r161", laboratories=1, seed=3, certificates=tmp_path / "all", progress=quiet)


def test_traces_are_kept_by_those_who_ask_for_them_and_for_folders(tmp_path: Path) -> None:
    table = vl.sweep(
        "r161", laboratories=1, certificates=tmp_path / "all", traces=True, progress=quiet
    )
    found = vl.load(tmp_path / "all" / "r161-astm-f1881-00000")
    assert found.value == pytest.approx(table.value[0], rel=1e-12)
    assert found.value == vl.certify("r161", seed=1).value
    assert found.printed.encoder is not None
    assert (tmp_path / "all" / "r161-astm-f1881-00000" / "truth" / "truth.json").exists()
    with pytest.raises(InputError, match="traces = True; allowed only with certificates"):
        vl.sweep("r161", laboratories=1, traces=True, progress=quiet)


def test_reports_with_hidden_faults_are_handed_on_without_the_truth(tmp_path: Path) -> None:
    """As in rules.md: nothing is altered, and only the truth names the fault."""
    hidden = set(Random(5).sample(range(MANY), 1))
    (tmp_path / "kept").mkdir()
    for number in range(MANY):
        fault = {"faults": "gate-moved"} if number in hidden else {}
        vl.certify("r161", seed=7, number=number, **fault).save(tmp_path / f"kept/{number:03d}")
    shutil.copytree(
        tmp_path / "kept", tmp_path / "handed-on", ignore=shutil.ignore_patterns("truth")
    )
    for number in range(MANY):
        kept, folder = tmp_path / "kept" / f"{number:03d}", tmp_path / "handed-on" / f"{number:03d}"
        truth = json.loads((kept / "truth/truth.json").read_text())
        assert truth["faults"] == (["gate-moved"] if number in hidden else [])
        for path in folder.rglob("*"):
            assert path.is_dir() or "gate-moved" not in path.read_text(encoding="utf-8")
        found = vl.verify(folder)
        assert (found.rows, found.code) == ((), 4)
        assert found.unchecked == ("truth: the folder is missing",)
        assert vl.verify(kept).code == 0
