"""A test played again from its truth agrees with its folder, whatever was chosen for the test."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import virtual_lab as vl
from virtual_lab import lab
from virtual_lab import score as score_folder
from virtual_lab.lab.recipe import Recipe
from virtual_lab.measurement.camera import windows
from virtual_lab.measurement.camera.windows import sight
from virtual_lab.studies.replay import compared_replay


def quiet(*_: object) -> None:
    """Ignore the progress."""


def of_bat_file(folder: Path) -> Path:
    file = folder / "mine.toml"
    text = vl.bat("r161").text.replace('name = "r161"', 'name = "mine"')
    assert text.count("mine") == 1
    file.write_text(text)
    test = vl.certify(file, seed=3)
    file.unlink()
    return test.save(folder / "out")


def of_changed_gates(folder: Path) -> Path:
    gates = vl.instrument("pivot-gates").with_(distance_u="0.5 mm")
    rules = vl.procedure("astm-f1881").with_(valid_hits=4)
    return vl.certify("r161", procedure=rules, instruments=[gates], seed=3).save(folder / "out")


def of_numbered_fault(folder: Path) -> Path:
    chosen: dict[str, Any] = {"seed": 5, "number": 7, "test": 2, "lot": 3}
    return vl.certify("ea70", faults="aim-across", **chosen).save(folder / "out")


def of_sweep(folder: Path) -> Path:
    """Play two laboratories with a common collision model, which is interpolated."""
    vl.sweep("r161", laboratories=2, seed=3, certificates=folder / "all", progress=quiet)
    return folder / "all" / "r161-astm-f1881-00001"


def of_pymunk(folder: Path) -> Path:
    return vl.certify("r161", motion="pymunk", seed=3).save(folder / "out")


def of_nothing_random(folder: Path) -> Path:
    return vl.certify("ea70", reality="noise-free").save(folder / "out")


PLAYED = {
    of_bat_file: ("bats/mine",),
    of_changed_gates: ("procedures/astm-f1881 (valid_hits=4)", "instruments/pivot-gates"),
    of_numbered_fault: (),
    of_sweep: (),
    of_pymunk: (),
    of_nothing_random: (),
}


@pytest.mark.parametrize("play", PLAYED)
def test_every_choice_for_a_test_is_in_its_truth(
    play: Callable[[Path], Path], tmp_path: Path
) -> None:
    """Sheets that are not in the catalog are in the truth, and `score` names them."""
    scored = score_folder(play(tmp_path))
    assert (scored.state, scored.different, scored.code) == ("whole", (), 0)
    assert scored.sheets == PLAYED[play]
    assert all(name in scored.text for name in scored.sheets)


def test_the_pictures_of_a_camera_are_played_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A short scan and few frames per shot keep it fast. A gray value more is found.

    The ball is located in the pictures of the records, not in those of the second play.
    """
    scan = {"low": "6 in", "high": "8 in", "coarse_step": "1 in", "fine_step": "1 in"}
    changes = {f"scan.{key}": value for key, value in scan.items()}
    changes |= {"scan.coarse_hits": 1, "scan.final_hits": 2}
    rules = vl.procedure("bbcor").with_(changes, valid_hits=2, balls=2, wall_hits=2)
    camera = vl.instrument("camera-overhead").with_(frames_in=6, frames_out=6, empty_frames=2)
    words: dict[str, Any] = {"rig": "filmed-cannon", "seed": 3}
    test = vl.certify("r161", procedure=rules, instruments=[camera], progress=quiet, **words)
    folder = test.save(tmp_path / "out")
    located = []
    monkeypatch.setattr(windows, "sight", lambda *each: located.append(1) or sight(*each))
    scored = score_folder(folder, progress=quiet)
    assert (scored.state, scored.different, len(located)) == ("whole", (), 1)
    assert test.sealed is not None
    again = lab.BatTest(certification=test.certification, sealed=test.sealed)
    pixels = folder / "records" / "impact" / "camera-pixels.npy"
    stated = np.load(pixels)
    stated[3, 4, 5, 6] += 1
    np.save(pixels, stated)
    (row,) = compared_replay(folder, again)
    assert row.file == "records/impact/camera-pixels.npy"


def test_no_choice_is_left_out_of_the_recipe() -> None:
    """A new field of `TestSetup` is in the recipe, or has no effect on a saved test."""
    setup, recipe = ({each.name for each in fields(kind)} for kind in (lab.TestSetup, Recipe))
    by_another_name = {"rules", "ball", "collision"}
    without_effect = {"unverified_rigs", "film", "particulars"}
    only_in_studies = {"same_bat", "varied"}  # their tests are not saved
    assert setup - recipe == by_another_name | without_effect | only_in_studies


def test_another_processor_and_another_cache_agree(tmp_path: Path) -> None:
    """The code for any processor, compiled and then loaded from its cache, plays the same test.

    Both folders have the same bytes. Played again with the code for this processor, truth and
    records agree.
    """
    cache = {"NUMBA_CPU_NAME": "generic", "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for name in ("compiled", "loaded"):
        words = ["certify", "r161", "--seed", "7", "--out", str(tmp_path / name)]
        subprocess.run(
            [sys.executable, "-m", "virtual_lab", *words],
            env=os.environ | cache,
            check=True,
            capture_output=True,
        )
    files = [path for path in (tmp_path / "compiled").rglob("*") if path.is_file()]
    assert len(files) > 20
    for path in files:
        other = tmp_path / "loaded" / path.relative_to(tmp_path / "compiled")
        assert path.read_bytes() == other.read_bytes(), path.name
    scored = score_folder(tmp_path / "loaded")
    assert (scored.state, scored.different) == ("whole", ())
