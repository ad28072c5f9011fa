"""The weights of a scan's hits: exact for cubics; and the bias of a peak due to noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.one_laboratory import outcome_of
from virtual_lab import catalog
from virtual_lab.lab.true_metric import Visits, results_of_curves
from virtual_lab.measurement.procedure import Objective, Procedure
from virtual_lab.measurement.procedure.outcome import _degrees, hit_weights_of
from virtual_lab.streams import Streams

BESR = catalog.load("procedures", "ncaa-besr", Procedure).spec
RULES = catalog.load("procedures", "ncaa-modified", Procedure).spec
BBCOR = catalog.load("procedures", "bbcor", Procedure).spec
F1881 = catalog.load("procedures", "astm-f1881", Procedure).spec
INCH, TOP = 0.0254, 6.1 * 0.0254
PLACES = np.repeat(np.arange(5, 7.25, 0.5) * INCH, 6)
ALL = np.ones(PLACES.size, dtype=bool)


def parabola(place: np.ndarray, curvature: float = 30.0) -> np.ndarray:
    return 0.7 - curvature / 2 * (place - TOP) ** 2


@given(
    top=st.floats(5.6 * INCH, 6.4 * INCH),
    curvature=st.floats(10, 60),
    skew=st.floats(-60, 60),
)
def test_a_cubic_without_noise_is_read_at_its_maximum(
    top: float, curvature: float, skew: float
) -> None:
    """The maximum of 0.7 - c x²/2 + s x³ is 0.7 at x = 0, and the weights add up to 1."""
    x = PLACES - top
    metric = 0.7 - curvature / 2 * x**2 + skew * x**3
    outcome = outcome_of(RULES, PLACES, ALL, metric)
    assert outcome.reasons[0] == ""
    assert outcome.position == pytest.approx(top, abs=1e-8)
    assert outcome.weights.sum() == pytest.approx(1, abs=1e-10)
    assert outcome.weights @ metric == pytest.approx(0.7, abs=1e-12)
    # weights evaluate any cubic at that position, such as the cube of the position
    assert outcome.weights @ PLACES**3 == pytest.approx(top**3, rel=1e-7)
    alone = Visits(np.zeros(PLACES.size, int), PLACES, ALL)
    assert results_of_curves(RULES, 1, alone, metric, metric) == pytest.approx(0.7, abs=1e-10)


def test_invalid_and_surplus_hits_have_no_weight() -> None:
    """A seventh hit at a position and an invalid outlier change nothing."""
    place = np.concatenate([PLACES, [6 * INCH, 6 * INCH]])
    valid = np.concatenate([ALL, [True, False]])
    metric = np.concatenate([parabola(PLACES), [5.0, 9.0]])
    outcome = outcome_of(RULES, place, valid, metric)
    assert outcome.weights[:-2] == pytest.approx(
        outcome_of(RULES, PLACES, ALL, metric[:-2]).weights
    )
    assert outcome.weights[-2:].tolist() == [0, 0]


def test_of_ten_fresh_hits_the_last_six_are_the_result() -> None:
    """A laboratory may continue; by bbcor the last consecutive hits are the result."""
    best = 6 * INCH
    place = np.concatenate([PLACES, np.full(10, best)])
    metric = np.concatenate([parabola(PLACES), np.arange(10.0)])
    valid = np.ones(place.size, dtype=bool)
    outcome = outcome_of(BBCOR, place, valid, metric)
    assert outcome.weights[: PLACES.size].tolist() == [0.0] * PLACES.size
    assert outcome.weights[PLACES.size :] == pytest.approx([0.0] * 4 + [1 / 6] * 6)
    assert outcome.weights @ metric == pytest.approx(6.5)
    assert outcome.position == pytest.approx(best)
    # invalid shot among them: the consecutive hits begin again
    valid[PLACES.size + 5] = False
    again = outcome_of(BBCOR, place, valid, metric)
    assert again.reasons[0] == "only 4 of 6 consecutive hits at the best impact position"
    assert again.weights[PLACES.size :] == pytest.approx([0.0] * 6 + [0.25] * 4)


def test_two_positions_are_no_scan() -> None:
    """Two positions, or one hit, give no weights but a reason."""
    two = PLACES < 5.7 * INCH
    outcome = outcome_of(RULES, PLACES[two], ALL[two], parabola(PLACES[two]))
    assert outcome.reasons[0] == "only 2 impact positions have 6 valid hits; a scan needs 3"
    assert np.isnan(outcome.weights).all()
    assert not outcome.used.any()
    assert (
        outcome_of(RULES, PLACES[:1], ALL[:1], PLACES[:1]).reasons[0].startswith("fewer than two")
    )


def rows_at_zero(x: np.ndarray, wide: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the weights of all hits in value and slope of the local cubic, and in the slope of f.

    f has the higher terms of the cubic through the `wide` hits and the line of the local hits.
    """
    local = np.abs(x) < 1.2
    design = np.vander(x, 4, increasing=True)
    rows = [np.zeros((4, x.size)), np.zeros((4, x.size)), np.zeros((2, x.size))]
    for row, hits, powers in zip(rows, (local, wide, local), (4, 4, 2), strict=True):
        chosen = design[hits, :powers]
        row[:, hits] = np.linalg.solve(chosen.T @ chosen, chosen.T)
    cubic, shape, line = rows
    return cubic[0], cubic[1], line[1] - line[1] @ design[:, 2:] @ shape[2:]


@pytest.mark.parametrize(("sigma", "curvature"), [(0.001, 60.0), (0.0005, 30.0)])
def test_noise_hardly_raises_a_fitted_peak(sigma: float, curvature: float) -> None:
    """The mean excess is (Cov(m, f) - ½ Var(f)) / |curvature| for the slopes m, f of both curves.

    Metric and maximized quantity are the same. The scatter is small, so that all laboratories
    choose the same position. Within 4 standard errors; the oracle are the normal equations. The
    linear effect of the noise, whose mean is 0, is subtracted from the excess.
    """
    wide = np.repeat(np.arange(4, 8.25, 0.5) * INCH, 6)
    top = 6 * INCH
    exact = 0.7 - curvature / 2 * (wide - top) ** 2
    runs = 20_000
    noise = sigma * Streams(11).normal("noise", (runs, wide.size))
    metric = exact + noise
    owner = np.repeat(np.arange(runs), wide.size)
    hits = np.tile(wide, runs), np.ones(owner.size, bool), metric.ravel()
    objective = Objective(value=hits[2], gain=np.ones(owner.size))
    outcome = hit_weights_of(RULES, runs, owner, *hits, objective)
    x = (wide - top) / INCH
    value, of_metric, of_objective = rows_at_zero(x, np.abs(x) < 2.2)
    excess = np.sum(outcome.weights.reshape(runs, -1) * metric, axis=1) - 0.7 - noise @ value
    product = of_metric @ of_objective - of_objective @ of_objective / 2
    by_hand = sigma**2 * product / (curvature * INCH**2)
    error = excess.std() / np.sqrt(runs)
    of_local_curve = sigma**2 * of_metric @ of_metric / 2 / (curvature * INCH**2)
    assert of_local_curve > 8 * error  # bias of the maximum of the metric's own curve
    assert abs(excess.mean() - by_hand) < 4 * error


def test_hits_beside_the_used_ones_bend_the_curve_alone() -> None:
    """Hits 2 in from the best position have no weight, but cause a part of the variance.

    The oracle are central differences by all hits.
    """
    place = np.concatenate([PLACES, np.repeat([4 * INCH, 8 * INCH], 2)])
    besr = 0.7 + 0.8 * (place - TOP) - 20 * (place - TOP) ** 2
    besr += 0.0005 * Streams(12).normal("noise", place.size)
    valid = np.ones(place.size, bool)

    def result(hits: np.ndarray) -> float:
        return float(outcome_of(BESR, place, valid, hits, speed_of(hits, place)).weights @ hits)

    outcome = outcome_of(BESR, place, valid, besr, speed_of(besr, place))
    used = outcome.used
    assert used.sum() == 30
    steps = 1e-5 * np.eye(place.size)
    derivatives = np.array([(result(besr + each) - result(besr - each)) / 2e-5 for each in steps])
    assert np.linalg.norm(outcome.effects[used]) == pytest.approx(
        np.linalg.norm(derivatives), rel=0.1
    )
    assert np.linalg.norm(derivatives[~used]) > 0.1 * np.linalg.norm(derivatives[used])


def test_hits_that_bend_upward_show_no_maximum() -> None:
    """Noise lifts the middle position above a valley; the curve through all hits has no maximum."""
    metric = parabola(PLACES, curvature=-30.0)
    metric[np.abs(PLACES - 6 * INCH) < 1e-6] += 0.02
    wide = np.concatenate([PLACES, np.repeat([4 * INCH, 8 * INCH], 2)])
    metric = np.concatenate([metric, np.full(4, 0.76)])
    outcome = outcome_of(RULES, wide, np.ones(wide.size, bool), metric)
    assert outcome.reasons[0] == "the hits near the best impact position show no maximum"


def speed_of(besr: np.ndarray, place: np.ndarray) -> Objective:
    """Return v_f [mph] of a 70 mph pitch by Eq. (3), with e_A = BESR - 1/2 and its gain."""
    bat = 66 * (28 - place / INCH) / 22
    return Objective(value=(besr - 0.5) * 70 + (besr + 0.5) * bat, gain=70 + bat)


def test_besr_is_read_where_the_speed_is_greatest() -> None:
    """A BESR that rises toward the handle is read at the maximum of v_f, not at its own."""
    besr = 0.7 + 0.4 * (PLACES - TOP) - 15 * (PLACES - TOP) ** 2
    fine = np.linspace(5 * INCH, 7 * INCH, 200_001)
    exact = 0.7 + 0.4 * (fine - TOP) - 15 * (fine - TOP) ** 2
    best = np.argmax(speed_of(exact, fine).value)
    outcome = outcome_of(BESR, PLACES, ALL, besr, speed_of(besr, PLACES))
    assert outcome.position == pytest.approx(fine[best], abs=2e-6)
    assert outcome.weights @ besr == pytest.approx(exact[best], abs=1e-6)
    assert outcome.weights.sum() == pytest.approx(1, abs=1e-10)


def test_the_effects_are_the_derivatives_by_each_hit() -> None:
    """The oracle is central differences: a hit changes the result, and where it is read.

    The curvature in the middle of the hits is within some percent of that at the maximum.
    """
    noise = 0.0005 * Streams(12).normal("noise", PLACES.size)
    besr = 0.7 + 0.8 * (PLACES - TOP) - 20 * (PLACES - TOP) ** 2 + noise

    def result(hits: np.ndarray) -> float:
        return float(outcome_of(BESR, PLACES, ALL, hits, speed_of(hits, PLACES)).weights @ hits)

    outcome = outcome_of(BESR, PLACES, ALL, besr, speed_of(besr, PLACES))
    steps = 1e-5 * np.eye(PLACES.size)
    derivatives = [(result(besr + step) - result(besr - step)) / 2e-5 for step in steps]
    assert np.linalg.norm(outcome.effects - derivatives) < 0.1 * np.linalg.norm(derivatives)
    assert np.abs(outcome.effects - outcome.weights).max() > 0.01
    alone = outcome_of(RULES, PLACES, ALL, besr)
    assert np.array_equal(alone.effects, alone.weights)


def test_missing_hits_count_as_no_positions() -> None:
    """A laboratory of two positions beside one of five; a warning of numpy would fail the test."""
    place = np.array([[0.10, 0.11, 0.12, 0.13, 0.14], [0.10, 0.10, 0.12, 0.13, 0.14]])
    is_hit = np.array([[True] * 5, [True] * 3 + [False] * 2])
    assert _degrees(place, is_hit).tolist() == [3, 1]
