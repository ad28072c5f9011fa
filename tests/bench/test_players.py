"""Who is honest and looks comes first: ten players on the same sound and faulty days."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.bench.players import PLAYERS, Scores, lead, scores_of

LOOK = ("expert", "careful")
OTHERS = [name for name in PLAYERS if name not in LOOK]
SUM_AND_DETECTION = ("sum", "detection")


@cache
def played(days: int) -> Scores:
    return scores_of(days)


@pytest.mark.long
def test_the_player_who_looks_leads_on_a_few_days() -> None:
    """On 2 + 2 days no other player comes near in sum, or is ahead in detection."""
    scores = played(2)
    for name in OTHERS:
        for look in LOOK:
            ahead = (scores[look] - scores[name]).mean(axis=0)
            assert ahead.sum() > 0.3, (look, name)
            assert ahead[1] > 0, (look, name)


@pytest.mark.long
@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("look", LOOK)
def test_the_player_who_looks_leads_by_two_standard_errors(look: str, other: str) -> None:
    """Over 40 sound and 40 faulty days, paired; and none beats who looks so in result."""
    leads = lead(played(40), look, other)
    assert all(leads[each] >= 2 for each in SUM_AND_DETECTION), leads
    assert leads["result"] > -2


def test_leads_are_in_standard_errors() -> None:
    """Differences 1, 2, 3: mean 2, s = 1, so 2 √3; without scatter infinity, or nothing."""
    one = np.zeros((3, 5))
    other = one.copy()
    other[:, 1] = [1, 2, 3]
    scores = {"a": other, "b": one}
    assert lead(scores, "a", "b")["detection"] == pytest.approx(2 * 3**0.5)
    assert lead(scores, "b", "a")["detection"] == pytest.approx(-2 * 3**0.5)
    assert lead(scores, "a", "b")["result"] == 0
    assert lead({"a": one + 1, "b": one}, "a", "b")["sum"] == np.inf
