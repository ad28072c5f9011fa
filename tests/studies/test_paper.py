"""Every number and claim of the paper: a test each, that fails where a claim does not hold."""

from __future__ import annotations

import json
import re
from collections import Counter
from math import isfinite, nan
from pathlib import Path

import pandas as pd
import pytest

from virtual_lab.studies.paper import CLAIMS, Claim, Findings, Row
from virtual_lab.studies.paper.claim import about, at_least, at_most, between
from virtual_lab.studies.paper.text import cells


@pytest.mark.parametrize("claim", CLAIMS, ids=[claim.name for claim in CLAIMS])
def test_the_claim_holds(claim: Claim) -> None:
    row = claim.row()
    assert isfinite(row.found)
    assert row.holds, f"{row.found!r} {claim.unit}, allowed {claim.low!r} to {claim.high!r}"


def test_no_claim_stands_there_twice() -> None:
    assert [
        name for name, count in Counter(claim.name for claim in CLAIMS).items() if count > 1
    ] == []
    for claim in CLAIMS:
        assert claim.low <= claim.high
        assert claim.why
        assert claim.paper is None or claim.low < claim.paper < claim.high


def test_every_section_and_numbered_thing_of_the_paper_is_there() -> None:
    """Secs. II A to V B, Eqs. (1) to (14), Table I, Figs. 2 to 4."""
    sections = {part.strip() for claim in CLAIMS for part in claim.section.split(",")}
    assert sections >= {"II A", "II B", "II C", "II D", "III A", "III B", "III C", "III D", "IV"}
    assert sections >= {"V A", "V B", "V B 1", "V B 2", "V B 3", "V B 4", "VI"}
    where = " ".join(claim.where + " " + claim.says for claim in CLAIMS)
    found = {int(number) for number in re.findall(r"\((\d+)[abc]?\)", where)}
    assert found >= set(range(1, 15))
    assert {"Table I", "Fig. 2", "Fig. 3", "Fig. 4"} <= {claim.where for claim in CLAIMS}
    table = [claim for claim in CLAIMS if claim.why == "fit of the drawing, 0.5 %"]
    assert len(table) == 4 * 9
    assert sum(claim.paper in (12.8, 2.6) for claim in CLAIMS) == 4  # test speeds of Sec. II C


def test_bounds_of_a_claim() -> None:
    def row(claim: Claim) -> Row:
        return claim.row()

    said = ("I", "text", "x")
    assert row(about(*said, 6.0, 0.5, lambda: 6.4)).holds
    assert not row(about(*said, 6.0, 0.5, lambda: 5.4)).holds
    assert row(about(*said, 6.0, 0.5, lambda: 5.4)).deviation == pytest.approx(-0.6)
    assert not row(at_least(*said, 1.0, lambda: 0.9, why="w")).holds
    assert not row(at_most(*said, 1.0, lambda: 1.1, why="w")).holds
    assert row(between(*said, 0.0, 1.0, lambda: 0.5, why="w")).holds
    assert not row(between(*said, 0.0, 1.0, lambda: nan, why="w")).holds
    assert at_least(*said, 1.0, lambda: 0.9, why="w").tolerance == "≥ 1"
    assert about(*said, 6.0, 0.5, lambda: 6.4).tolerance == "± 0.5"


def test_text_folder_and_json_say_the_same(tmp_path: Path) -> None:
    """Of a few rows; the pictures are of all four bats."""
    failing = about("II C", "text", "made up", 2.6, 0.05, lambda: 3.0, unit="mph")
    claims = [*(claim for claim in CLAIMS if claim.section == "II C"), failing]
    found = Findings(found=tuple(claim.row() for claim in claims))
    assert found.held == len(claims) - 1
    text = found.text
    assert f"{len(claims) - 1} of {len(claims)} hold" in text
    assert cells(found.found)[-1]["holds"] == "NO"
    assert cells(found.found)[-1]["deviation"] == "+0.4"
    document = json.loads(json.dumps(found.document, allow_nan=False))
    assert document["rows"][-1]["holds"] is False
    assert document["rows"][-1]["paper"] == 2.6
    found.save(tmp_path / "out")
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["paper.csv", "paper.html", "paper.png"]
    table = pd.read_csv(tmp_path / "out" / "paper.csv")
    assert table["found"].tolist() == pytest.approx([row.found for row in found.found])
    page = (tmp_path / "out" / "paper.html").read_text("utf-8")
    assert "<svg" in page
    assert page.count("<tr>") == len(claims) + 1
    assert (tmp_path / "out" / "paper.png").read_bytes().startswith(b"\x89PNG")
