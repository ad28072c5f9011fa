"""Propagation of distributions against JCGM 101 and 102, closed forms, scipy and itself."""

from itertools import pairwise
from math import atan2, inf, pi, sqrt
from time import sleep
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import virtual_lab as vl
from tests.uncertainty import models
from virtual_lab.output import progress as shown_progress
from virtual_lab.streams import generator
from virtual_lab.uncertainty.inputs import read_inputs
from virtual_lab.uncertainty.laws import LAWS
from virtual_lab.uncertainty.monte_carlo import BATCH, BLOCK, drawn_block
from virtual_lab.uncertainty.sketch import BINS, Sketch, shortest_interval

DRAWS, MANY = 2**18, 2**20  # draws, and those for a judgment by clause 8


def propagated(model, inputs, **more):
    return vl.propagate(model, inputs, method="monte-carlo", **{"draws": DRAWS} | more)


def close(result, value: float | None, u: float | None, low: float, high: float) -> None:
    """Compare with expected numbers, within 4 standard errors of the draws."""
    one = next(iter(result.outcomes.values()))
    errors = one.convergence.standard_errors
    numbers = one.value, one.u, *one.interval
    for number, expected, error in zip(numbers, (value, u, low, high), errors, strict=True):
        if expected is not None:
            assert number == pytest.approx(expected, abs=4 * error), result
            assert error < 0.01 * (high - low)


def total(a, b, c, d):
    return a + b + c + d


def four(fourth: float, law: str) -> dict[str, vl.Input]:
    inputs = {name: vl.Input(0, 1, distribution=law) for name in "abc"}
    return inputs | {"d": vl.Input(0, fourth, distribution=law)}


def test_draws_agree_with_supplement_1_on_additive_models() -> None:
    """JCGM 101 9.2: ± 3.92; ± 3.88, exactly 2 √3 (2 - (3/5)^¼); with u = 10: 10.1 and ± 17.0."""
    close(propagated(total, four(1, "normal")), 0, 2, -3.92, 3.92)
    end = 2 * sqrt(3) * (2 - (3 / 5) ** 0.25)
    result = propagated(total, four(1, "uniform"), draws=MANY)
    close(result, 0, 2, -end, end)
    assert "U = 3.9, half the width of the interval" in result.text
    assert result["result"].verdict.startswith("first order validated")  # 3.92 - 3.88, below .05
    wider = {name: vl.Input(0, 1.5, distribution="uniform") for name in "abcd"}
    assert "not validated" in propagated(total, wider, draws=MANY).text  # .061, above
    result = propagated(total, four(10, "uniform"))
    close(result, 0, sqrt(103), -17.0, 17.0)
    assert result["result"].verdict.startswith("first order not validated")  # ± 19.9 by the GUM


def test_draws_agree_with_supplement_1_on_mass_calibration() -> None:
    """JCGM 101 table 5: 1.2341, .0754, shortest [1.0834, 1.3825]; that run's tolerance is .005."""
    assert vl.propagate(models.mass, models.MASS).u == pytest.approx(0.0539, abs=5e-5)
    second = vl.propagate(models.mass, models.MASS, method="second-order")
    # printed value .0750, without third derivatives, which bring it nearer to .0754
    assert second.u == pytest.approx(0.0752, abs=5e-5)
    result = propagated(models.mass, models.MASS)
    assert result.value == pytest.approx(1.2341, abs=5e-4)
    assert result.u == pytest.approx(0.0754, abs=2e-4)
    assert result["result"].shortest == pytest.approx((1.0834, 1.3825), abs=5e-3)
    assert "not validated" in result.text


@pytest.mark.parametrize(
    ("x1", "y", "u", "shortest"),
    [
        (0.0, 50, 50, (0, 150)),
        (0.010, 150, 112, (0, 367)),
        (0.050, 2550, 502, (1590, 3543)),
    ],
)
def test_draws_agree_with_supplement_1_on_squares(
    x1: float, y: float, u: float, shortest: tuple
) -> None:
    """JCGM 101 9.4, r = 0, in 1e-6; for x1 = 0, the shortest interval ends at -2 ln(.05) · 25."""
    inputs = {"x1": vl.Input(x1, 0.005), "x2": vl.Input(0.0, 0.005)}
    result = propagated(lambda x1, x2: 1e6 * (x1**2 + x2**2), inputs, draws=MANY)
    assert result.value == pytest.approx(y, abs=0.6 if x1 else 0.2)
    assert result.u == pytest.approx(u, abs=1)
    width = 8 if x1 > 0.01 else 2.5  # width of the flat minimum and of the published run
    assert result["result"].shortest == pytest.approx(shortest, abs=width)
    if x1 == 0:
        assert result["result"].shortest[1] == pytest.approx(-50 * np.log(0.05), abs=0.5)
        assert "not validated" in result["result"].verdict


@pytest.mark.parametrize(
    ("re", "r", "printed"),
    [
        (0.001, 0.0, (0.013, 0.007, None, 1.744)),
        (0.001, 0.9, (0.012, 0.008, -0.556, 1.599)),
        (0.010, 0.9, (0.015, 0.008, -0.343, 0.903)),
    ],
)
def test_draws_agree_with_supplement_2_on_polar_coordinates(
    re: float, r: float, printed: tuple
) -> None:
    """JCGM 102 9.2: magnitude and phase of a complex quantity whose parts have u = .010."""
    inputs = {"re": vl.Input(re, 0.010), "im": vl.Input(0.0, 0.010)}
    bound = {("re", "im"): r} if r else {}
    result = propagated(
        lambda re, im: {"size": np.hypot(re, im), "phase": np.arctan2(im, re)},
        inputs,
        correlations=bound,
    )
    numbers = [getattr(result[name], key) for name in ("size", "phase") for key in ("value", "u")]
    for number, expected in zip(numbers, printed, strict=True):
        if expected is not None:
            assert number == pytest.approx(expected, abs=1.5e-3 if abs(expected) > 0.1 else 5.1e-4)


def test_regions_of_two_outputs_agree_with_supplement_2() -> None:
    """JCGM 102 7.7: k_p = √χ²_2(.95) = 2.448 for a normal pair; 2.236 for an independent box."""
    inputs = {"a": vl.Input(1, 0.1), "b": vl.Input(2, 0.3)}
    result = propagated(lambda a, b: {"sum": a + b, "difference": a - b}, inputs)
    assert result.region.ellipsoid == pytest.approx(sqrt(stats.chi2.ppf(0.95, 2)), abs=0.006)
    r = (0.01 - 0.09) / 0.1
    assert result.correlation[0, 1] == pytest.approx(r, abs=2e-3)
    assert result.region.covariance == pytest.approx(0.1 * np.array([[1, r], [r, 1]]), rel=0.01)
    apart = propagated(lambda a, b: {"a": a, "b": b}, inputs)
    assert apart.region.box == pytest.approx(stats.norm.ppf((1 + sqrt(0.95)) / 2), abs=0.006)
    assert "ellipsoid k = 2.4" in apart.text


SCIPY = {
    "normal": stats.norm(),
    "t": stats.t(3.5),
    "uniform": stats.uniform(-1, 2),
    "triangular": stats.triang(0.5, -1, 2),
    "arcsine": stats.arcsine(-1, 2),
}


@pytest.mark.parametrize("law", LAWS)
def test_laws_agree_with_scipy(law: str) -> None:
    """Draws agree with quantiles (Kolmogorov–Smirnov), quantiles and moments with scipy."""
    shape = {"t": 3.5, "trapezoid": 0.4}.get(law, 0.0)
    x = LAWS[law].draw(generator(3, law, 0), BLOCK, shape)
    q = (np.arange(BLOCK) + 0.5) / BLOCK
    nodes = LAWS[law].quantile(q, shape)
    assert np.max(np.abs(np.searchsorted(np.sort(x), nodes) / BLOCK - q)) < 2 / sqrt(BLOCK)
    if law in SCIPY:
        some = np.array([0.003, 0.2, 0.6, 0.99])
        assert LAWS[law].quantile(some, shape) == pytest.approx(SCIPY[law].ppf(some))
    if law != "t":  # laws whose u is that of the draws
        assert nodes.std() == pytest.approx(LAWS[law].u(shape), rel=1e-3)
        kurtosis = np.mean(nodes**4) / np.mean(nodes**2) ** 2
        assert kurtosis == pytest.approx(LAWS[law].kurtosis(shape), rel=3e-3)


def test_a_t_is_wider_than_its_u() -> None:
    """JCGM 101 6.4.9: u √(ν/(ν - 2)); joint readings have ν = n - m (JCGM 102, 5.3.2)."""
    ends = 3 + 0.2 * np.array(stats.t(6).interval(0.95))
    close(propagated(lambda x: x, {"x": vl.Input(3, 0.2, dof=6)}), 3, 0.2 * sqrt(1.5), *ends)
    readings = generator(1, "readings", 0).standard_normal((9, 2))
    result = propagated(lambda a, b: a + b, {("a", "b"): readings})
    sums = readings.sum(axis=1)
    scale = sums.std(ddof=1) / 3 * sqrt(8 / 7)
    low, high = sums.mean() + scale * np.array(stats.t(7).interval(0.95))
    close(result, sums.mean(), scale * sqrt(7 / 5), low, high)


def test_limits_whose_u_is_not_well_known_are_inexact() -> None:
    """A uniform input with 50 dof has limits within ± h/10 (JCGM 101, 9.5.2.4)."""
    stated = vl.Input(low=-1, high=1, dof=50)
    same = vl.Input(low=-1, high=1, inexact=0.1)
    first, second = (propagated(lambda x: x, {"x": each}) for each in (stated, same))
    assert first.interval == second.interval


def test_two_degrees_of_freedom_give_no_u() -> None:
    result = vl.propagate(lambda x: x, {"x": vl.Input(1, 0.1, dof=2)}, method="monte-carlo")
    assert result.u == inf
    assert result.interval == pytest.approx(1 + 0.1 * np.array(stats.t(2).interval(0.95)), abs=5e-3)
    assert "only ν = 2 degrees of freedom, so u is infinite" in result.text


def test_draws_do_not_depend_on_order_units_or_length_of_run() -> None:
    """Order changes no bit, a scale 2^k scales the results, and blocks are not correlated."""
    first = propagated(models.bpf, models.BPF, draws=9 * BATCH)
    turned = dict(reversed(models.BPF.items()))
    assert propagated(models.bpf, turned, draws=9 * BATCH).interval == first.interval
    one = propagated(lambda x: x, {"x": vl.Input(1, 0.1)}, draws=BATCH)
    large = propagated(lambda x: x, {"x": vl.Input(1024, 102.4)}, draws=BATCH)
    assert large.interval == pytest.approx(1024 * np.array(one.interval), rel=1e-12)
    assert propagated(models.bpf, models.BPF, draws=9 * BATCH, seed=1).u != first.u
    blocks = [drawn_block(read_inputs({"x": vl.Input(0, 1)}, {}), 0, k)["x"] for k in range(3)]
    for one, other in pairwise(blocks):
        assert abs(np.corrcoef(one, other)[0, 1]) < 4 / sqrt(BLOCK)


def test_a_sketch_agrees_with_sorted_numbers_and_adds_up() -> None:
    """A sketch of a million heavy-tailed numbers is right within a bin, 1.3e-4 of its width."""
    x = generator(2, "sketch", 0).standard_t(3, 2**20)
    whole, half, other = (Sketch.empty_like(x[:BLOCK], 0.95) for _ in range(3))
    whole.add(x)
    half.add(x[: 2**19])
    other.add(x[2**19 :])
    both = half + other
    assert np.array_equal(both.counts, whole.counts)
    assert whole.counts.sum() == x.size
    q = np.array([0.025, 0.5, 0.975])
    below, edges = whole.distribution()
    exact = np.quantile(x, q)
    bins = 24 / BINS * np.sqrt(whole.width**2 + exact**2)
    assert np.all(np.abs(np.interp(q, below, edges) - exact) < bins)
    low, high = shortest_interval(below, edges, 0.95)
    assert high - low <= np.diff(np.quantile(x, [0.025, 0.975]))[0] + bins[0]
    assert np.mean((x >= low) & (x <= high)) == pytest.approx(0.95, abs=1e-4)


def test_discrete_outputs_have_exact_intervals() -> None:
    """A coin has the ends 0 and 1, a constant no width; a gap holds no quantile."""
    coin = propagated(lambda x: x > 1, {"x": vl.Input(1, 0.1)}, draws=1)
    assert coin.value == pytest.approx(0.5, abs=0.02)
    assert coin.interval == pytest.approx((0, 1), abs=1e-4)
    assert coin["result"].shortest == pytest.approx((0, 1), abs=1e-4)
    constant = propagated(lambda x: 1.0 * np.round(x), {"x": vl.Input(7, 0.01)}, draws=1)
    assert (constant.value, constant.u) == (7, 0)
    assert constant.interval == pytest.approx((7, 7), abs=1e-8)


def test_tolerance_is_met_by_two_stages() -> None:
    """Of 12 seeds, at most one misses the tolerance of two digits of u; the benchmark has 100."""
    expected = np.array([0, 2, -3.919928, 3.919928])
    met = 0
    for seed in range(12):
        result = vl.propagate(total, four(1, "normal"), method="monte-carlo", seed=seed)
        one = result["result"]
        assert one.convergence.tolerance == 0.05
        assert one.convergence.draws == 2**18
        met += bool(np.all(np.abs(np.array([one.value, one.u, *one.interval]) - expected) <= 0.05))
    assert met >= 11


def test_more_digits_take_more_draws() -> None:
    """Both rules take more draws for δ/5, as clause 8 requires; the linear result is validated."""
    inputs = {"a": vl.Input(1, 0.0606), "b": vl.Input(2, 0.0808)}
    for rule in ("stein", "7.9"):
        two = vl.propagate(lambda a, b: a + b, inputs, method="monte-carlo", rule=rule)
        result = vl.propagate(
            lambda a, b: a + b, inputs, method="monte-carlo", rule=rule, validate=True
        )
        draws = [each["result"].convergence.draws for each in (two, result)]
        assert draws[1] > 2 * draws[0]
        errors = result["result"].convergence.standard_errors
        assert 2 * max(errors) <= result["result"].convergence.tolerance == pytest.approx(0.001)
        assert result["result"].verdict.startswith("first order validated")
    few = propagated(lambda a, b: a + b, inputs, draws=1)
    assert few["result"].verdict.startswith("first order not judged")
    with pytest.raises(vl.InputError, match=r"digits = '.*draws needed'; allowed: fewer digits"):
        vl.propagate(lambda a, b: a + b, inputs, method="monte-carlo", digits=6)


def test_two_stages_with_validate_always_judge_the_first_order() -> None:
    """The scatter of the second stage may exceed that of the first: with this seed 2 se is 1.02e-6.

    The rule of two stages meets its tolerance of 1.0e-6 nonetheless, with 95 % probability.
    """
    inputs = {"m": vl.Input(0.88, 0.0005), "d": vl.Input(0.42, 0.001), "T": vl.Input(1.55, 0.002)}
    result = vl.propagate(
        lambda m, d, T: m * 9.80665 * d * T**2 / (4 * np.pi**2),
        inputs,
        method="monte-carlo",
        validate=True,
    )["result"]
    assert result.convergence.tolerance < 2 * max(result.convergence.standard_errors[2:])
    assert result.verdict.startswith("first order validated")


@settings(max_examples=8)
@given(
    c=st.lists(st.floats(0.5, 2), min_size=3, max_size=3),
    r=st.floats(-0.9, 0.9),
    law=st.sampled_from(["uniform", "triangular", "arcsine", "trapezoid"]),
)
def test_all_methods_agree_on_linear_models(c: list[float], r: float, law: str) -> None:
    """Three methods agree in value and u, with two correlated normal inputs and another law."""
    third = vl.Input(3, 0.4, distribution=law)
    if law == "trapezoid":
        third = vl.Input(low=2.5, high=3.5, inexact=0.2)
    inputs = {"a": vl.Input(1, 0.2), "b": vl.Input(2, 0.3), "c": third}
    result = [
        vl.propagate(
            lambda a, b, x: c[0] * a + c[1] * b + c[2] * x,
            {"a": inputs["a"], "b": inputs["b"], "x": inputs["c"]},
            correlations={("a", "b"): r},
            method=method,
            draws=2**18,
        )
        for method in ("first-order", "second-order", "monte-carlo")
    ]
    errors = result[2]["result"].convergence.standard_errors
    assert result[1].u == pytest.approx(result[0].u, rel=1e-6)
    assert result[2].u == pytest.approx(result[0].u, abs=5 * errors[1])
    assert result[2].value == pytest.approx(result[0].value, abs=5 * errors[0])


@pytest.mark.parametrize(
    ("inputs", "more", "said"),
    [
        (
            four(1, "uniform"),
            {"correlations": {("a", "b"): 0.5}},
            "normal distributions, or t distributions",
        ),
        (four(1, "normal"), {"rule": "7.8"}, r"did you mean 7.9.*allowed: stein or 7.9"),
        (four(1, "normal"), {"draws": 0}, "draws = 0; allowed: 1 to 68719476736"),
        (four(1, "normal"), {"draws": 2**40}, "allowed: 1 to 68719476736"),
        (four(1, "normal"), {"digits": 400}, "digits = 400; allowed: 1 to 15"),
    ],
)
def test_impossible_draws_are_refused(inputs: dict, more: dict, said: str) -> None:
    with pytest.raises(vl.InputError, match=said):
        vl.propagate(total, inputs, method="monte-carlo", **more)


def test_draws_with_a_larger_first_digit_than_the_first_order_still_judge_it() -> None:
    """The u of first order is .0099, that of the draws .0101 with ten times the tolerance."""
    result = propagated(
        lambda x: x, {"x": vl.Input(0, 0.0099, dof=60)}, draws=None, digits=1, validate=True
    )["result"]
    assert result.u > 0.01
    assert result.verdict.startswith("first order validated")


def test_clause_8_compares_both_ends() -> None:
    """For a normal law cut at -1 u, the upper end is first order's 1.96, but the lower is -1."""
    result = propagated(
        lambda x: np.maximum(x, -1.0), {"x": vl.Input(0, 1)}, digits=1, validate=True
    )
    assert result.interval == pytest.approx((-1, 1.96), abs=0.02)
    said = result["result"].verdict
    assert said.startswith(
        "first order not validated: the ends of the interval differ by 0.96 and 0.0"
    )


@pytest.mark.parametrize("rule", ["fixed", "stein", "7.9"])
def test_a_result_without_variance_has_a_median_and_is_never_validated(rule: str) -> None:
    """1/d for d = .5 ± .283: numpy's quantiles and median by scipy; no mean, no u.

    The distribution is P(1/d <= t) = P(d < 0) + P(d >= 1/t) for t > 0, so the median is that of
    1/d. A tolerance from the u of the draws (2500 of 4e6) would call [-.6, 4.6] right.
    """
    d = stats.norm(0.5, 0.2 * sqrt(2))
    inputs = {"x": vl.Input(3, 0.2), "y": vl.Input(2.5, 0.2)}
    more = {"draws": MANY} if rule == "fixed" else {"draws": None, "rule": rule, "digits": 1}
    result = propagated(lambda x, y: {"inverse": 1 / (x - y), "sum": x + y}, inputs, **more)
    one, other = result["inverse"], result["sum"]
    assert one.u == inf
    assert one.value == pytest.approx(1 / d.ppf(d.cdf(0) + 0.5), abs=0.05)
    high = 1 / d.ppf(d.cdf(0) + 0.025)
    low = 1 / d.ppf(d.cdf(0) - 0.025)
    assert one.interval == pytest.approx((low, high), abs=0.2 if rule == "fixed" else 0.7)
    assert one.verdict.startswith("first order not validated")
    assert "mean and variance of inverse do not exist" in result.text
    assert "variance of sum" not in result.text
    assert other.u == pytest.approx(0.2 * sqrt(2), rel=0.01)
    assert result.correlation is result.region is None


@pytest.mark.parametrize("dof", [3, 4, 12])
def test_a_t_with_a_variance_keeps_its_u(dof: int) -> None:
    result = propagated(lambda x: x, {"x": vl.Input(0, 1, dof=dof)})
    assert result.u == pytest.approx(sqrt(dof / (dof - 2)), rel=0.05)


def test_the_tolerance_of_clause_8_is_that_of_the_first_order() -> None:
    """Rare large draws raise u tenfold, to 3.3; the ends move by .02, more than u = .3 allows."""
    inputs = {"x": vl.Input(0, 0.3), "rare": vl.Input(low=0, high=1)}

    def model(x, rare):
        return x + 60 * (rare > 0.99) * x

    result = propagated(model, inputs, draws=MANY)
    assert result.u == pytest.approx(0.3 * sqrt(0.99 + 0.01 * 61**2), rel=0.03)
    assert result["result"].verdict.startswith("first order not validated")
    assert "allowed 0.005" in result.text


def test_draws_are_counted_while_they_are_made(capsys: pytest.CaptureFixture[str]) -> None:
    """Progress calls the given function, or prints on stderr if the draws take long."""
    calls: list[tuple[str, int, int]] = []
    inputs = {"x": vl.Input(0, 1)}
    vl.propagate(
        lambda x: x,
        inputs,
        method="monte-carlo",
        draws=2**17,
        progress=lambda *each: calls.append(each),
    )
    assert calls == [("draws", n * 2**14, 2**17) for n in range(8)]
    waited = iter([0.3])

    def slow(x):
        sleep(next(waited, 0))
        return x

    with mock.patch.object(shown_progress, "PIPE_STEP", 0.05):
        vl.propagate(slow, inputs, method="monte-carlo", draws=2**17)
    assert "…" in capsys.readouterr().err


def test_a_rare_nan_is_found() -> None:
    """A square root fails once in 32 000 draws, at -4 u."""

    def root(x):
        return np.sqrt(x)

    with pytest.raises(vl.InputError, match=r"is nan in \d of 65536 rows, for example at x = -"):
        propagated(root, {"x": vl.Input(4, 1)})


def test_a_scalar_function_is_called_for_each_draw() -> None:
    result = propagated(
        lambda x, y: atan2(y, x), {"x": vl.Input(-1, 0.1), "y": vl.Input(0, 0.1)}, draws=1
    )
    assert "row by row" in result.text
    # both sides of the cut: E (π - |angle|)²
    assert result.u == pytest.approx(sqrt(pi**2 - 0.2 * sqrt(2 * pi) + 0.01), rel=2e-3)
