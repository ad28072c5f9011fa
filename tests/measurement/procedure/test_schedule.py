"""Scans of exact curves converge to the maximum, need no other shots, and end."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.one_laboratory import next_places, outcome_of
from virtual_lab import catalog
from virtual_lab.errors import InputError
from virtual_lab.measurement.procedure import Procedure, round_to_setting
from virtual_lab.measurement.procedure.rules import Scan
from virtual_lab.measurement.procedure.scan_kernel import find_final_hits
from virtual_lab.measurement.procedure.schedule import scan_rules

BBCOR = catalog.load("procedures", "bbcor", Procedure).spec
BESR = catalog.load("procedures", "ncaa-besr", Procedure).spec
assert BBCOR.scan is not None
assert BESR.scan is not None
INCH = 0.0254


def curve(place: np.ndarray, top: float, left: float, right: float) -> np.ndarray:
    """Return a unimodal curve of two half parabolas with different widths about `top` [m]."""
    distance = place - top
    return 0.5 - (distance / np.where(distance < 0, left, right)) ** 2


class Test:
    """A test that gets its hits from `metric`; every round has the shots that the rules require."""

    __test__ = False

    def __init__(self, procedure: Procedure, metric, bad=lambda shot, place: False, *, exact=False):
        self.place, self.valid, self.metric = np.zeros(0), np.zeros(0, dtype=bool), np.zeros(0)
        self.rounds: list[np.ndarray] = []
        while (places := next_places(procedure, 0.15, self.place, self.valid, self.metric)).size:
            fired = round_to_setting(places, exact=exact)
            self.rounds.append(fired)
            shots = np.arange(self.place.size, self.place.size + fired.size)
            self.place = np.concatenate([self.place, fired])
            values = metric(fired)
            good = [not bad(s, p) for s, p in zip(shots, fired, strict=True)]
            self.valid = np.concatenate([self.valid, np.array(good) & np.isfinite(values)])
            self.metric = np.concatenate([self.metric, values])
            assert len(self.rounds) <= procedure.attempts
        self.outcome = outcome_of(procedure, self.place, self.valid, self.metric)


tops = st.floats(2.0 * INCH, 10.0 * INCH)
widths = st.floats(2 * INCH, 12 * INCH)


@given(tops, widths, widths, st.sampled_from([BBCOR, BESR]), st.booleans())
def test_a_scan_finds_the_maximum(
    top: float, left: float, right: float, procedure: Procedure, exact: bool
) -> None:
    """The result is within a fine step of the true maximum, or the reason says there is none."""
    scan = procedure.scan
    assert scan is not None
    test = Test(procedure, lambda z: curve(z, top, left, right), exact=exact)
    assert test.place.min() >= scan.low - 2.5e-4 - 1e-9
    assert test.place.max() <= scan.high + 2.5e-4 + 1e-9
    assert test.place.size <= procedure.attempts
    if test.outcome.reasons[0]:
        assert not scan.low + scan.fine_step < top < scan.high - scan.fine_step
        assert test.outcome.reasons[0].startswith("the scan has no maximum between")
    else:
        # tolerance: a fine step, as the curve is asymmetric, and half a setting
        assert abs(test.outcome.position - top) < scan.fine_step + 2.5e-4
    assert test.outcome.weights.sum() == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("rising", [1.0, -1.0])
@pytest.mark.parametrize("procedure", [BBCOR, BESR], ids=lambda rules: rules.name)
def test_a_curve_that_only_rises_has_no_maximum(procedure: Procedure, rising: float) -> None:
    test = Test(procedure, lambda z: 0.4 + rising * z)
    assert test.outcome.reasons[0].startswith("the scan has no maximum between 0.0762 and 0.2286 m")
    assert test.place.size <= procedure.attempts


def test_invalid_hits_are_repeated() -> None:
    """With every third shot invalid, each position gets six hits, and the result is the same."""

    def metric(place: np.ndarray) -> np.ndarray:
        return curve(place, 0.15, 0.2, 0.2)

    clean = Test(BESR, metric)
    spoilt = Test(BESR, metric, lambda shot, _: shot % 3 == 2)
    assert spoilt.place.size > clean.place.size
    assert int(spoilt.valid.sum()) == clean.place.size
    assert spoilt.outcome.position == pytest.approx(clean.outcome.position, abs=1e-12)
    assert not spoilt.outcome.weights[~spoilt.valid].any()


def test_the_attempts_limit_a_test_without_valid_hits() -> None:
    test = Test(BESR, lambda z: curve(z, 0.15, 0.2, 0.2), lambda *_: True)
    assert test.place.size == BESR.attempts
    assert np.isnan(test.outcome.weights).all()


def test_a_position_without_rebounds_is_given_up() -> None:
    """Two coarse balls are lost at 3 in and two at 4 in; the maximum at 6.5 in is found."""

    def metric(place: np.ndarray) -> np.ndarray:
        return np.where(place < 4.2 * INCH, np.nan, curve(place, 6.5 * INCH, 0.2, 0.2))

    test = Test(BBCOR, metric)
    assert int((test.place < 4.2 * INCH).sum()) == 4
    assert test.outcome.reasons[0] == ""
    assert test.outcome.position == pytest.approx(6.5 * INCH, abs=2.5e-4)


def test_a_scan_without_any_rebound_ends() -> None:
    """It fires two balls at each of seven coarse positions, and no more."""
    test = Test(BBCOR, lambda z: np.full(z.shape, np.nan))
    assert test.place.size == 14
    assert test.outcome.reasons[0] == "fewer than two hits were valid"


def test_the_final_hits_are_fresh_ones() -> None:
    """The earlier hits at the best position chose it, so they are no part of the result."""
    test = Test(BBCOR, lambda z: curve(z, 0.15, 0.2, 0.2))
    indices = np.flatnonzero(test.outcome.used)
    assert indices.tolist() == list(range(test.place.size - 6, test.place.size))
    assert np.array_equal(test.rounds[-1], test.place[indices])
    assert int((test.place == test.place[-1]).sum()) == 12


def test_a_walk_of_many_fine_steps_reaches_the_maximum() -> None:
    """A coarse step is 25 fine ones; the walk is as long as necessary."""
    scan = replace(
        BBCOR.scan, low=0.05, high=0.15, coarse_step=0.05, fine_step=0.002, fit_half_width=0.004
    )
    rules = replace(BBCOR, scan=scan, attempts=1000)
    test = Test(rules, lambda z: curve(z, 0.124, 0.03, 0.2))
    assert test.outcome.reasons[0] == ""
    assert test.outcome.position == pytest.approx(0.124, abs=2e-3)


def test_a_better_position_at_the_edge_of_the_fit_is_visited() -> None:
    """A dip beside the best coarse position hides a higher one two steps away."""
    bump = {12: 0.50, 13: 0.48, 14: 0.52, 15: 0.47, 16: 0.46}

    def metric(place: np.ndarray) -> np.ndarray:
        halves = np.rint(place / INCH * 2).astype(int)
        return np.array([bump.get(int(half), 0.4) for half in halves])

    test = Test(BESR, metric)
    best = 7 * INCH
    assert test.outcome.reasons[0] == ""
    assert abs(test.outcome.position - best) < BESR.scan.fine_step
    for offset in (-2, -1, 0, 1, 2):
        at = best + offset * BESR.scan.fine_step
        assert int((np.abs(test.place - at) < 3e-4).sum()) >= BESR.valid_hits


def test_a_scan_stays_within_an_end_between_two_steps() -> None:
    rules = replace(BBCOR, scan=replace(BBCOR.scan, high=8.9 * INCH))
    test = Test(rules, lambda z: 0.4 + z)
    assert test.place.max() <= 8.9 * INCH + 2.5e-4


SCAN = {name: getattr(BBCOR.scan, name) for name in Scan.__dataclass_fields__}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"fine_step": 0.9e-3}, "impact positions are set in steps"),
        ({"fine_step": 0.03}, "larger than coarse_step"),
        ({"fit_half_width": 0.01}, "smaller than fine_step"),
        ({"high": 0.12}, "too short for two steps"),
    ],
)
def test_impossible_scans_are_refused(change: dict[str, float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Scan(**(SCAN | change))


def test_more_coarse_hits_than_a_place_takes_are_refused() -> None:
    text = catalog.load("procedures", "bbcor", Procedure).text
    changed = text.replace("coarse_hits = { value = 2,", "coarse_hits = { value = 7,")
    assert changed != text
    with pytest.raises(InputError, match="coarse_hits"):
        catalog.read(changed, "mine.toml", Procedure)


def test_an_invalid_shot_restarts_the_consecutive_hits() -> None:
    """After four of six consecutive hits and an invalid one, six more are required."""
    rules = catalog.load("procedures", "bbcor", Procedure).spec
    assert rules.scan is not None
    assert rules.scan.consecutive
    best, scanned = 0.15, np.full(rules.valid_hits, 0.15)
    place = np.concatenate([scanned, np.full(5, best)])
    valid = np.array([True] * rules.valid_hits + [True] * 4 + [False])

    def fresh(scan: Scan, place: np.ndarray, valid: np.ndarray) -> list[int]:
        rows = np.empty(place.size, np.int64)
        return rows[: find_final_hits(best, place, valid, scan_rules(rules, scan), rows)].tolist()

    assert fresh(rules.scan, place, valid) == []
    more = np.append(place, [best, best]), np.append(valid, [True, True])
    assert fresh(rules.scan, *more) == [11, 12]
    assert fresh(replace(rules.scan, consecutive=False), place, valid) == [6, 7, 8, 9]
