"""Every number and claim of the paper: one test each, which fails if the claim does not hold.

A claim that is marked as lost has to fail, so that no mark outlives its reason.
"""

from __future__ import annotations

import re
from collections import Counter
from inspect import getsource
from math import inf, isfinite, nan
from pathlib import Path

import pytest

from tests.studies.paper import computed, examples, metrics, models, procedures
from tests.studies.paper.claim import Claim, read_claims
from tests.studies.paper.claims import CLAIMS, FINDERS, PATH
from virtual_lab.errors import InputError


@pytest.mark.parametrize("claim", CLAIMS, ids=[claim.name for claim in CLAIMS])
def test_the_claim_holds_unless_it_is_marked_as_lost(claim: Claim) -> None:
    row = claim.row()
    assert isfinite(row.result)
    bounds = f"{row.result!r} {claim.unit}, allowed {claim.low!r} to {claim.high!r}"
    assert row.holds is not bool(claim.lost), bounds


def test_no_claim_is_listed_twice() -> None:
    assert [
        name for name, count in Counter(claim.name for claim in CLAIMS).items() if count > 1
    ] == []
    assert (len(CLAIMS), sum(bool(claim.lost) for claim in CLAIMS)) == (215, 2)
    for claim in CLAIMS:
        assert claim.low <= claim.high
        assert claim.why
        assert claim.paper is None or claim.low < claim.paper < claim.high


def test_every_section_and_equation_of_the_paper_has_a_claim() -> None:
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


def made_up(found: float, *, paper: float | None = None, low: float, high: float) -> Claim:
    return Claim(
        section="II C",
        where="text",
        says="made up",
        paper=paper,
        low=low,
        high=high,
        unit="mph",
        why="w",
        lost="the model",
        find=lambda: found,
    )


def test_a_claim_holds_within_its_bounds() -> None:
    assert made_up(6.4, paper=6.0, low=5.5, high=6.5).row().holds
    below = made_up(5.4, paper=6.0, low=5.5, high=6.5)
    assert not below.row().holds
    assert below.row().deviation == pytest.approx(-0.6)
    assert below.tolerance == "± 0.5"
    assert (below.row().cells["holds"], below.row().cells["deviation"]) == ("NO", "-0.6")
    assert not made_up(0.9, low=1.0, high=inf).row().holds
    assert not made_up(1.1, low=-inf, high=1.0).row().holds
    assert made_up(0.5, low=0.0, high=1.0).row().holds
    assert not made_up(nan, low=0.0, high=1.0).row().holds
    assert made_up(0.9, low=1.0, high=inf).tolerance == "≥ 1"


def test_a_table_of_claims_is_read(tmp_path: Path) -> None:
    """Bounds by tolerance, one end or both; numbers, words and the law without exponent."""
    path = tmp_path / "claims.csv"
    path.write_text(
        "section,where,says,paper,within,low,high,unit,why,lost,find\n"
        "I,text,a,6,0.5,,,mph,w,the ball,seen 1 0.5 x energy\n"
        "I,text,b,,,2,,,w,,seen\nI,text,c,,,2,3,,w,,seen\n"
    )
    seen: list[tuple[object, ...]] = []

    def find(*given: object) -> float:
        seen.append(given)
        return 6.4

    first, second, third = read_claims(path, {"seen": find})
    assert (first.low, first.paper, first.high, first.unit) == (5.5, 6.0, 6.5, "mph")
    assert (first.lost, second.lost) == ("the ball", "")
    assert (second.low, second.high, second.paper) == (2.0, inf, None)
    assert (third.low, third.high) == (2.0, 3.0)
    assert first.row().holds
    assert seen == [(1, 0.5, "x", None)]
    with pytest.raises(KeyError, match="seen"):
        next(read_claims(path, {}))


def test_every_finder_of_a_section_finds_something() -> None:
    """A finder that no claim and no other function uses would be dead code."""
    rows = PATH.read_text("utf-8").splitlines()
    named = {row.rpartition(",")[2].split()[0] for row in rows[1:]}
    for section in (metrics, models, examples, procedures):
        text = getsource(section)
        own = {name for name in FINDERS if getattr(section, name, None) is FINDERS[name]}
        own = {name for name in own if FINDERS[name].__module__ == section.__name__}
        once = {name for name in own if len(re.findall(rf"\b{name}\(", text)) == 1}
        assert once - named <= {"table_one", "drawing_entry"}


def test_an_unknown_support_is_refused() -> None:
    with pytest.raises(InputError, match="'held'; allowed: free, pivoted, clamped"):
        computed.recoil("r161", 6.0, "held")
    with pytest.raises(InputError, match="'hold'; allowed: free, pivoted, clamped, held"):
        computed.support("hold")
    with pytest.raises(InputError, match="bending mode = -1; allowed: 0, 1"):
        examples.node_shift(-1)
