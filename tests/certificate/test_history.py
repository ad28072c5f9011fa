"""Certificates that pool the scatter of hits with earlier tests, read from folders."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import virtual_lab as vl
from tests.laboratories import certified, certify
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.verify import verify
from virtual_lab.errors import InputError
from virtual_lab.records.particulars import particulars_of
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.uncertainty.budget import HITS, combine_components, type_a_component

RIVERSIDE = particulars_of({"laboratory": {"name": "Riverside"}}, "laboratory.toml")


def saved(folder: Path, bat: str = "r161", procedure: str = "astm-f1881", **more: Any) -> Path:
    tested = certify(bat, procedure=procedure, seed=7, detail=RecordDetail.SUMMED, **more)
    return vl.Certificate(certification=tested.certification, sealed=tested.sealed).save(folder)


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Save three tests of one named laboratory into a folder."""
    folder = tmp_path_factory.mktemp("history")
    for test in (1, 2, 3):
        saved(folder / f"test-{test}", test=test, particulars=RIVERSIDE)
    return folder


def hits(document: dict[str, Any]) -> tuple[float, float]:
    """Return u and degrees of freedom of the scatter of the hits."""
    (row,) = (line for line in document["budget"] if line["component"] == "hits")
    return row["contribution"], row["dof"]


def test_the_scatter_is_pooled_over_all_tests(earlier: Path, tmp_path: Path) -> None:
    """The oracle uses the budgets of four certificates, with six hits at one position each.

    The remaining variance is 6 u²; ν = 5 (remaining / observed)² gives the observed one.
    """
    form = tmp_path / "laboratory.toml"
    form.write_text('[laboratory]\nname = "Riverside"\n', encoding="utf-8")
    alone = vl.certify("r161", seed=7, test=4, laboratory=form)
    folders = sorted(earlier.iterdir())
    own = [json.loads((folder / "certificate.json").read_text("utf-8")) for folder in folders]
    parts = [hits(each) for each in (*own, alone.document)]
    left = sum(6 * u**2 for u, _ in parts) / 4
    seen = sum(6 * u**2 * sqrt(5 / dof) for u, dof in parts) / 4
    test = vl.certify("r161", seed=7, test=4, history=folders, laboratory=form)
    u, dof = hits(test.document)
    assert (u, dof) == pytest.approx((sqrt(left / 6), 20 * (left / seen) ** 2), rel=1e-6)
    assert test.value == alone.value
    assert "estimated from this test and 3 earlier tests together" in test.text
    assert "estimated from this test alone" in alone.text
    told = re.search(r"would be (\d+) % shorter", alone.document["evaluation"])
    assert told is not None
    assert 2 <= int(told[1]) <= 30
    folder = test.save(tmp_path / "today")
    assert not verify(folder).code
    plain = alone.save(tmp_path / "alone")
    reduced = vl.reduce(plain / "records", history=folders)
    assert hits(reduced.document) == (u, dof)
    assert hits(vl.reduce(folder / "records").document) == (u, dof)


def test_the_shorter_interval_is_that_of_this_test_and_ten_more() -> None:
    """For a scatter with ν = 1 alone: t is 2.201 for 11 degrees of freedom, 12.706 for one."""
    found = certified().certification
    assert found.metric is not None
    hits = next(part for part in found.metric.components if part.name == HITS)
    value = np.array([found.metric.value])
    alone = combine_components(value, type_a_component(HITS, value, np.array([hits.u]), 1.0))
    assert "would be 83 % shorter" in certificate(replace(found, first_order=alone)).evaluation
    assert f"{1 - 2.201 / 12.706:.0%}" == "83%"


def test_a_history_of_other_tests_is_refused(earlier: Path, tmp_path: Path) -> None:
    """Each refusal is one line that names folder and key."""
    first, second, third = sorted(earlier.iterdir())
    other = saved(tmp_path / "ea70", "ea70", test=5)
    rules = saved(tmp_path / "bbcor", procedure="bbcor", test=5)
    form = tmp_path / "laboratory.toml"
    form.write_text('[laboratory]\nname = "Riverside"\n', encoding="utf-8")
    with pytest.raises(InputError, match="test-1: laboratory; is 'Riverside', not ''"):
        vl.certify("r161", seed=7, test=4, history=[first, second, third])
    (tmp_path / "daily").mkdir()
    (tmp_path / "daily" / "daily.csv").write_text("day\n")
    for history, said in (
        ([first, second], r"history = '2 tests'; allowed: 3 or more earlier tests"),
        ([other, first, second], r"ea70: bat; is 'ea70', not 'r161'"),
        ([rules, first, second], r"bbcor: procedure; is another"),
        ([first, first, second], r"is the same test as .*test-1"),
        ([first, second, third, tmp_path / "daily"], r"daily: .*not found in this folder"),
        ([first, second, tmp_path / "none"], r"none: result folder; no such folder"),
        ([tmp_path / "none"], r"none: result folder; no such folder"),
        (first, r"history = '1 test'; allowed: 3 or more earlier tests"),
    ):
        with pytest.raises(InputError, match=said) as caught:
            vl.certify("r161", seed=7, test=4, history=history, laboratory=form)
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="test-2: history; is the same test as these records"):
        vl.reduce(second / "records", history=[first, second, third])
    with pytest.raises(InputError, match="test = 4; allowed only with a seed"):
        vl.certify("r161", test=4)
