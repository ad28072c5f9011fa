"""A test played again from its sealed truth, and compared with its result folder.

Seed and choices determine bat, balls, constants and all records, so the truth of one test cannot
agree with the records of another. Digests of two plays are not compared, because the last digits of
a number depend on the processor.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from virtual_lab import catalog
from virtual_lab.certificate.comparing import (
    TOLERANCE,
    Mismatch,
    compared_table,
    compared_text,
    differences,
    same_text,
)
from virtual_lab.certificate.seal import TRUTH
from virtual_lab.errors import InputError
from virtual_lab.files import read_json
from virtual_lab.lab import BatTest, RoundRobin, certify_block
from virtual_lab.lab.recipe import Recipe
from virtual_lab.output.progress import Progress
from virtual_lab.records.session import RULES, SESSION, pack

# keys of ``session.json`` that the recipe does not determine: texts, and digests of the files
FREE = re.compile(
    r"date|particulars.*|control_sha256|.*\.sha256|channels\..*\.attached.*"
    r"|simulation\.(sealing|seed_commitment|rungs\.\w+\.(error|reason))"
)


def play_again(recipe: Recipe, progress: Progress) -> BatTest:
    """Return the test of a recipe, played again, without a comparison of camera and gates.

    Raises `InputError` if this program does not have a rig, a fault or a sheet of the recipe.
    """
    with catalog.sheets_in_place(catalog.texts_of(recipe.sheets)):
        setup = recipe.setup()
        if recipe.common_model:
            setup = RoundRobin.with_common_model(setup).setup
        test = certify_block(setup, progress).of(0, camera=False)
    return test.control if recipe.is_control and test.control else test


def compared_replay(folder: Path, again: BatTest) -> Iterator[Mismatch]:
    """Yield the differences of a result folder from its test played again.

    Truth and records are compared, also those of the control bat's test. Numbers that differ only
    by rounding are equal.
    """
    stated = read_json(folder / TRUTH)
    salt = {"salt": stated.get("salt")}  # `verify` compares it with the commitment
    truth = json.loads(json.dumps(again.sealed.document() | salt))
    yield from differences(stated, truth, TRUTH)
    yield from _compared_records(folder / "records", again)
    if again.control and (folder / "control").is_dir():
        for row in compared_replay(folder / "control", again.control):
            yield replace(row, file=f"control/{row.file}")


def _compared_records(records: Path, again: BatTest) -> Iterator[Mismatch]:
    packed = pack(again.certification.session)
    session = json.loads(packed.texts[SESSION])
    for row in differences(read_json(records / SESSION), session, f"records/{SESSION}"):
        if not FREE.fullmatch(row.key):
            yield row
    rules = packed.texts[RULES].decode()
    yield from compared_text(f"records/{RULES}", same_text(records / RULES), rules)
    for name, text in packed.texts.items():
        if name.endswith(".csv"):
            for row in compared_table(records / name, text.decode()):
                yield replace(row, file=f"records/{name}")
    for name, values in packed.arrays.items():
        stated = _array(records / name)
        if stated.shape != values.shape or not np.allclose(
            stated, values, rtol=TOLERANCE, atol=0, equal_nan=True
        ):
            yield Mismatch(file=f"records/{name}", key="", stated="other values", expected="")


def _array(path: Path) -> Any:
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as fault:
        raise InputError(str(path), "file", None, f"cannot be read ({fault})") from fault
