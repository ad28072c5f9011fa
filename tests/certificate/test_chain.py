"""Results read back from their folders, and reports that replace others."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

import virtual_lab as vl
from tests.cli.test_cli import Run, run  # noqa: F401 its fixture
from virtual_lab.certificate.verify import verify
from virtual_lab.errors import InputError


def test_a_result_is_loaded_as_it_was(chain: Path) -> None:
    """Document, tables and forms are equal, and `save` writes the same bytes."""
    test, found = vl.certify("r161", seed=7), vl.load(chain / "first")
    stated = json.loads((chain / "first" / "certificate.json").read_text("utf-8"))
    assert found.document == stated
    pd.testing.assert_frame_equal(found.shots, test.shots)
    pd.testing.assert_frame_equal(found.budget, test.budget)
    assert (found.verdict, found.value, found.u) == (test.verdict, test.value, test.u)
    assert found.plot().axes
    with pytest.raises(InputError, match=r"vl\.score"):
        found.score()
    again = found.save(chain.parent / "again")
    for name in ("certificate.html", "certificate.json", "readings.csv", "records/session.json"):
        assert (again / name).read_bytes() == (chain / "first" / name).read_bytes()


def test_a_certificate_that_its_records_do_not_give_is_not_loaded(
    chain: Path, tmp_path: Path
) -> None:
    """Texts count, too: a customer, a serial number, a removed remark."""
    folder = shutil.copytree(chain / "first", tmp_path / "copy")
    text = (folder / "certificate.json").read_text("utf-8")
    for keys, value in (
        (("shots", 0, "speed_mph"), 1.0),
        (("particulars", "customer", "name"), "another"),
        (("particulars", "bat", "serial"), "another"),
        (("restitution", "value"), 0.5),
        (("conditional_on",), ""),
    ):
        parsed = table = json.loads(text)
        for key in keys[:-1]:
            table = table[key]
        table[keys[-1]] = value
        (folder / "certificate.json").write_text(json.dumps(parsed))
        with pytest.raises(InputError, match=rf"\b{keys[-1]} = .*its records give.*verify"):
            vl.load(folder)
    for key, value in (("decision_rule", "Good."), ("date", "2020-01-01"), ("evaluation", "")):
        parsed = json.loads((chain / "first" / "certificate.json").read_text("utf-8"))
        (folder / "certificate.json").write_text(json.dumps({**parsed, key: value}))
        with pytest.raises(InputError, match=f"{key}.*its records give.*verify"):
            vl.load(folder)
    with pytest.raises(InputError, match="nowhere"):
        vl.load(tmp_path / "nowhere")


def test_a_report_names_the_one_it_replaces(chain: Path) -> None:
    number = vl.load(chain / "second").document["particulars"]["replaces"]["number"]
    assert number in (chain / "first" / "certificate.html").read_text("utf-8")
    page = (chain / "second" / "certificate.html").read_text("utf-8")
    assert f"certificate {number}: not first" in page
    assert "Replaces" not in (chain / "first" / "certificate.html").read_text("utf-8")
    assert "replaces" not in page.split("Not stated: ")[1].split("</p>")[0]


def test_verify_follows_the_chain(chain: Path, tmp_path: Path) -> None:
    """`verify` follows the chain to its start, and names missing and altered folders."""
    found = verify(chain / "third")
    assert (found.rows, found.code) == ((), 0)
    assert "in second" in found.note
    assert "in first" in found.note
    alone = shutil.copytree(chain / "third", tmp_path / "alone" / "third")
    found = verify(alone)
    assert found.code == 0
    assert "whose folder second is not beside this one" in found.text
    there = shutil.copytree(chain, tmp_path / "chain")
    (there / "first" / "readings.csv").write_text("shot\n")
    found = verify(there / "third")
    assert found.code == 3
    assert {row.file for row in found.rows} == {"../second/../first/readings.csv"}


def test_a_chain_in_a_circle_ends(chain: Path, tmp_path: Path) -> None:
    """Two folders replace each other."""
    there = shutil.copytree(chain, tmp_path / "chain")
    shutil.rmtree(there / "first")
    shutil.copytree(there / "third", there / "first")
    found = verify(there / "third")
    assert found.code == 3
    assert any(row.key == "sha256" for row in found.rows)


def test_folder_and_reason_are_given_together(chain: Path, run: Run) -> None:  # noqa: F811
    with pytest.raises(InputError, match="needs both"):
        vl.certify("r161", replaces=chain / "first")
    with pytest.raises(InputError, match="needs both"):
        vl.certify("r161", reason="wrong customer")
    with pytest.raises(InputError, match="needs both"):
        vl.reduce(chain / "first" / "records", reason="wrong customer")
    with pytest.raises(InputError, match=r"certificate\.json"):
        vl.certify("r161", replaces=chain, reason="wrong customer")
    with pytest.raises(InputError, match=r"bat.name = 'r161'; allowed: .* the same bat, ea70"):
        vl.certify("ea70", replaces=chain / "first", reason="other")
    with pytest.raises(InputError, match=r"procedure.name = 'astm-f1881'; allowed: .* bbcor"):
        vl.certify("r161", procedure="bbcor", replaces=chain / "first", reason="other")
    code, _, err = run("certify", "r161", "--replaces", str(chain / "none"), "--reason", "x")
    assert code == 2
    assert "certificate.json" in err
