"""A user's model: the GUM's examples, other libraries, exact cases, and wrong input."""

from math import inf, sqrt

import GTC
import numpy as np
import pytest
import uncertainties
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import virtual_lab as vl
from tests.uncertainty import models
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.uncertainty.inputs import read_inputs
from virtual_lab.uncertainty.models import Model

BOTH = pytest.mark.parametrize("method", ["first-order", "second-order"])


def test_both_orders_agree_with_gum_h1() -> None:
    """JCGM 100 H.1.7: u 32 nm, ν 16, and 34 nm with the terms of second order.

    These are 50 000 623 · (.5774e-6 · .4062 and 1.1547e-6 · .02887) = 11.72 and 1.667 nm, which
    is printed there as 11.7 and 1.7.
    """
    first = vl.propagate(models.end_gauge, models.END_GAUGE)
    assert (first.value, round(first.u), int(first.dof)) == (50_000_838, 32, 16)
    assert first.u == pytest.approx(31.664, abs=5e-4)
    assert first.dof == pytest.approx(16.752, abs=5e-4)
    second = vl.propagate(models.end_gauge, models.END_GAUGE, method="second-order")
    assert second.u == pytest.approx(sqrt(31.66388**2 + 11.7245**2 + 1.6668**2), abs=2e-3)
    assert round(second.u) == 34
    assert "second-order" in second.text
    largest = first.budget.iloc[0]
    assert (largest["component"], round(largest["contribution"])) == ("ls", 25)


def test_joint_readings_agree_with_gum_h2() -> None:
    """JCGM 100 table H.4, and GTC to 12 digits; u(X) is .296 without the GUM's rounding."""
    result = vl.propagate(models.circuit, {("v", "i", "phi"): models.CIRCUIT})
    printed = {"R": (127.732, 0.071), "X": (219.847, 0.296), "Z": (254.260, 0.236)}
    for name, (value, u) in printed.items():
        assert result[name].value == pytest.approx(value, abs=5e-4 + 5e-4)
        assert result[name].u == pytest.approx(u, abs=5e-4)
        assert result[name].dof == pytest.approx(4)
    pairs = result.correlation[[0, 0, 1], [1, 2, 2]]
    assert pairs == pytest.approx([-0.588, -0.485, 0.993], abs=6e-4)
    v, i, phi = GTC.type_a.multi_estimate_real(models.CIRCUIT.T)
    ohm = v / (1e-3 * i)
    peer = ohm * GTC.cos(phi)
    assert result["R"].u == pytest.approx(GTC.uncertainty(peer), rel=1e-6)
    assert result["R"].dof == pytest.approx(GTC.dof(peer), rel=1e-6)
    assert pairs[1] == pytest.approx(GTC.get_correlation(peer, ohm), rel=1e-5)


def test_a_fitted_line_agrees_with_gum_h3() -> None:
    """JCGM 100 H.3: eleven residuals with one scatter of 9 dof are one input."""
    t, b = models.THERMOMETER.T
    line = np.polyfit(t - 20, b, 1)
    s = sqrt(np.sum((b - np.polyval(line, t - 20)) ** 2) / 9)

    def fitted(b):
        dev = (t - 20) - np.mean(t - 20)
        slope = b @ dev / (dev @ dev)
        offset = b.mean(axis=-1) - slope * np.mean(t - 20)
        return {"y1": offset, "y2": slope, "b30": offset + 10 * slope}

    result = vl.propagate(fitted, {"b": vl.Input(b, s, dof=9, by=range(11))})
    printed = {"y1": (-0.1712, 0.0029), "y2": (0.00218, 0.00067), "b30": (-0.1494, 0.0041)}
    for name, (value, u) in printed.items():
        digit = 0.5 * 10 ** -len(str(abs(value)).split(".")[1])
        assert result[name].value == pytest.approx(value, abs=digit)
        assert result[name].u == pytest.approx(u, abs=max(digit / 10, 5e-6) if u < 1e-3 else 5e-5)
        assert result[name].dof == pytest.approx(9)
    assert s == pytest.approx(0.0035, abs=5e-5)
    assert result.correlation[0, 1] == pytest.approx(-0.930, abs=5e-4)


def test_eleven_inputs_agree_with_other_libraries() -> None:
    """GTC and `uncertainties` give value, u and ν with exact derivatives; ours span ± u.

    The difference, f''' u²/6, is (.003/.5)² of u here, by 1/e0. The u with a correlation is that of
    `uncertainties`.
    """
    result = vl.propagate(models.bpf, models.BPF)
    read = vl.propagate(models.bpf, models.BPF).budget.set_index("component")
    theirs = {name: GTC.ureal(row.value, row.u, row.dof) for name, row in read.iterrows()}
    peer = models.bpf(**theirs)
    assert result.value == pytest.approx(GTC.value(peer), rel=1e-14)
    assert result.u == pytest.approx(GTC.uncertainty(peer), rel=5e-5)
    assert result.dof == pytest.approx(GTC.dof(peer), rel=1e-4)
    bound = vl.propagate(models.bpf, models.BPF, correlations={("t_in", "t_out"): 0.5})
    times = uncertainties.correlated_values_norm(
        [(models.BPF[name].value, models.BPF[name].u) for name in ("t_in", "t_out")],
        [[1, 0.5], [0.5, 1]],
    )
    others = {
        name: uncertainties.ufloat(row.value, row.u)
        for name, row in read.drop(["t_in", "t_out"]).iterrows()
    }
    peer = models.bpf(t_in=times[0], t_out=times[1], **others)
    assert bound.u == pytest.approx(peer.std_dev, rel=5e-5)
    assert abs(bound.u - result.u) > 1e-3 * result.u


TERMS = st.lists(
    st.tuples(
        st.floats(-100, 100).filter(lambda c: abs(c) > 0.01),
        st.floats(-100, 100),
        st.floats(1e-2, 10),
        st.sampled_from(["normal", "uniform", "triangular", "arcsine"]),
    ),
    min_size=2,
    max_size=6,
)


@BOTH
@settings(max_examples=30)
@given(terms=TERMS, r=st.floats(-0.99, 0.99), scale=st.sampled_from([1e-6, 1e3]))
def test_a_linear_model_is_exact(terms: list, r: float, scale: float, method: str) -> None:
    """u² = Σ c² u² + 2 r c c' u u' for all laws; other units and order give the same."""

    def stated(by: float) -> dict[str, vl.Input]:
        return {
            f"x{k}": vl.Input(x * by, u * by, distribution=law)
            for k, (_, x, u, law) in enumerate(terms)
        }

    def model(**x):
        return sum(c * x[f"x{k}"] for k, (c, *_) in enumerate(terms))

    bound = {("x1", "x0"): r}
    result = vl.propagate(model, stated(1.0), correlations=bound, method=method)
    (c0, _, u0, _), (c1, _, u1, _) = terms[:2]
    variance = sum((c * u) ** 2 for c, _, u, _ in terms) + 2 * r * c0 * u0 * c1 * u1
    size = sum(abs(c) * (abs(x) + u) for c, x, u, _ in terms)
    near = 1e-9 * size + 1e-9
    assert result.u == pytest.approx(sqrt(variance), rel=1e-6, abs=near)
    assert result.value == pytest.approx(sum(c * x for c, x, *_ in terms), abs=near)
    again = dict(reversed(stated(scale).items()))
    other = vl.propagate(model, again, correlations={("x0", "x1"): r}, method=method)
    assert other.u / scale == pytest.approx(result.u, rel=1e-6, abs=near)


def test_the_second_order_agrees_with_exact_cases() -> None:
    """Squares: E = x² + u², Var = 4 x² u² + (κ - 1) u⁴; a product adds u² u'², a cube 36 u⁴."""
    for law, kurtosis in (("normal", 3), ("uniform", 1.8), ("triangular", 2.4), ("arcsine", 1.5)):
        inputs = {"x": vl.Input(0.5, 0.3, distribution=law)}
        result = vl.propagate(lambda x: x**2, inputs, method="second-order")
        assert result.value == pytest.approx(0.25 + 0.09)
        assert result.u**2 == pytest.approx(0.09 + (kurtosis - 1) * 0.0081)
    two = {"a": vl.Input(2, 0.1), "b": vl.Input(-3, 0.2)}
    result = vl.propagate(lambda a, b: a * b, two, method="second-order")
    assert result.u**2 == pytest.approx(0.09 + 0.16 + 4e-4)
    # normal inputs with correlation r: E = a b + r u u', Var = … + 2 r a b u u' + u² u'² (1 + r²)
    result = vl.propagate(
        lambda a, b: a * b, two, correlations={("a", "b"): 0.6}, method="second-order"
    )
    assert result.value == pytest.approx(-6 + 0.6 * 0.02)
    assert result.u**2 == pytest.approx(0.09 + 0.16 - 2 * 0.6 * 6 * 0.02 + 4e-4 * 1.36)
    # a b²: 2 f_b f_baa and 2 f_a f_abb of E[x² y²]: b⁴ u_a² + 4 a² b² u_b² + (4 + 2) b² u_a² u_b²
    # of the mixed pairs, and 2 a² u_b⁴ of b alone
    result = vl.propagate(lambda a, b: a * b**2, two, method="second-order")
    terms = 81 * 0.01, 4 * 4 * 9 * 0.04, 6 * 9 * 4e-4, 2 * 4 * 0.0016
    assert result.u**2 == pytest.approx(sum(terms))
    # correlated inputs, which are taken as normal: each is a sum of independent ones
    bound = {name: vl.Input(0, 0.1, distribution="uniform") for name in "ab"}
    result = vl.propagate(
        lambda a, b: a**2 + b**2, bound, correlations={("a", "b"): 0.5}, method="second-order"
    )
    assert result.u**2 == pytest.approx(4e-4 * (1 + 0.5**2))
    # x³ at 1: 9 u² + 18 u⁴ + 18 u⁴, without the u⁶
    result = vl.propagate(lambda x: x**3, {"x": vl.Input(1, 0.1)}, method="second-order")
    assert result.u**2 == pytest.approx(9e-2 + 36e-4)


def test_the_second_order_agrees_with_supplement_1_on_squares() -> None:
    """JCGM 101 9.4, x1 = 0, .010, .050: y 50, 150, 2550 and u 50, 112, 502 (1e-6); r = 0."""
    for x1, y, u in ((0.0, 50, 50), (0.010, 150, 112), (0.050, 2550, 502)):
        inputs = {"x1": vl.Input(x1, 0.005), "x2": vl.Input(0.0, 0.005)}
        first = vl.propagate(lambda x1, x2: x1**2 + x2**2, inputs)
        second = vl.propagate(lambda x1, x2: x1**2 + x2**2, inputs, method="second-order")
        assert first.u == pytest.approx(0.01 * x1, abs=1e-12)
        assert second.value == pytest.approx(y * 1e-6)
        assert second.u * 1e6 == pytest.approx(u, abs=0.5)
        assert ("curvature shifts its mean by 5e-05" in first.text) == (x1 == 0)
        assert "curvature" not in second.text


def test_groups_share_errors_nested_and_crossed() -> None:
    """Six hits on two days: the mean has u_day²/2, and Σ (n/6)² u_ball² for nested balls."""
    hits = np.array([1.0, 2.0, 3.0, 2.0, 2.0, 2.0])
    day, ball = [1, 1, 1, 2, 2, 2], [1, 1, 2, 1, 1, 2]

    def mean(hit, day, ball):
        return (hit + day + ball).mean(axis=-1)

    inputs = {
        "hit": vl.Input(hits, 0.3, by=range(6)),
        "day": vl.Input(u=0.2, dof=4, by=day),
        "ball": vl.Input(u=0.1, by=np.array([day, ball])),
    }
    result = vl.propagate(mean, inputs)
    assert result.value == 2.0
    squares = 0.09 / 6, 0.04 / 2, 0.01 * (2 * (2 / 6) ** 2 + 2 * (1 / 6) ** 2)
    assert result.u**2 == pytest.approx(sum(squares))
    # common scatter of both days with four dof, not eight
    assert result.dof == pytest.approx(4 * (sum(squares) / squares[1]) ** 2)
    limits = vl.propagate(mean, inputs | {"day": vl.Input(low=-0.1, high=0.3, by=day)})
    assert limits.value == pytest.approx(2.1)
    assert limits.u**2 == pytest.approx(squares[0] + 0.04 / 3 / 2 + squares[2])
    crossed = vl.propagate(mean, inputs | {"ball": vl.Input(u=0.1, by=np.array(ball))})
    assert crossed.u**2 == pytest.approx(sum(squares[:2]) + 0.01 * (4**2 + 2**2) / 36)
    # difference of two hits on one day, which is free of the day's error
    apart = vl.propagate(
        lambda hit, day, ball: (hit + day + ball)[..., 0] - (hit + day + ball)[..., 1], inputs
    )
    assert apart.u == pytest.approx(0.3 * sqrt(2))


def test_correlated_inputs_have_the_fewest_dof_among_them() -> None:
    inputs = {"a": vl.Input(1, 0.1, dof=9), "b": vl.Input(2, 0.2, dof=5), "c": vl.Input(0, 0.1)}
    result = vl.propagate(lambda a, b, c: a + b + c, inputs, correlations={("a", "b"): 0.5})
    block = 0.01 + 0.04 + 0.02
    assert result.dof == pytest.approx(5 * ((block + 0.01) / block) ** 2)


def test_a_budget_states_the_share_of_correlations() -> None:
    """GUM 5.2.2: u² of x - y is .01² + .02² less twice the covariance, and 0 where both cancel."""
    inputs = {"x": vl.Input(3, 0.01), "y": vl.Input(2, 0.02)}
    result = vl.propagate(lambda x, y: x - y, inputs, correlations={("x", "y"): 0.5})
    assert result.u**2 == pytest.approx(3e-4)
    shares = result.budget.set_index("component")["share_percent"].to_dict()
    assert shares == pytest.approx({"x": 100 / 3, "y": 400 / 3, "correlations": -200 / 3})
    same = vl.propagate(lambda x, y: 2 * x - y, inputs, correlations={("x", "y"): 1.0})
    assert same.u == 0
    assert "the errors of its correlated inputs cancel" in same.text


def test_readings_count_by_their_scatter() -> None:
    readings = [1.2, 1.5, 1.1, 1.9]
    result = vl.propagate(lambda x, k: k * x, {"x": readings, "k": 2.0})
    assert result.u == pytest.approx(2 * stats.sem(readings))
    assert result.dof == 3
    assert result.interval == pytest.approx(
        stats.t.interval(0.95, 3, 2 * np.mean(readings), 2 * stats.sem(readings))
    )
    budget = vl.propagate(lambda x, y: x + y, {"x": readings, "y": vl.Input(low=0, high=1)}).budget
    assert budget.set_index("component")["evaluation"].to_dict() == {"x": "A", "y": "B"}
    wide = vl.propagate(lambda x: x, {"x": readings}, probability=0.99)
    assert wide.interval == pytest.approx(
        stats.t.interval(0.99, 3, np.mean(readings), stats.sem(readings))
    )
    assert vl.propagate(lambda x: x, {"x": Estimate(value=3.0, u=0.1)}).u == pytest.approx(0.1)


def test_inexact_limits_have_the_u_of_jcgm_101() -> None:
    """JCGM 101 6.4.3: u² = h²/3 + d²/9."""
    result = vl.propagate(lambda x: x, {"x": vl.Input(low=-3, high=5, inexact=1.5)})
    assert result.value == 1.0
    assert result.u**2 == pytest.approx(16 / 3 + 2.25 / 9)


def test_a_function_of_numbers_is_called_row_by_row() -> None:
    def piecewise(x, y):
        return x * y if x > 0 else y

    inputs = {"x": vl.Input(2, 0.1), "y": vl.Input(5, 0.2)}
    result = vl.propagate(piecewise, inputs)
    assert result.u == pytest.approx(sqrt(0.25 + 0.16))
    assert "row by row" in result.text
    assert "row by row" not in vl.propagate(lambda x, y: x * y, inputs).text
    # model with a mean over its rows: each row is called alone, where that mean is the number
    mixed = vl.propagate(lambda x, y: x - np.mean(x) + y, inputs)
    assert "row by row" in mixed.text
    assert mixed.u == pytest.approx(0.2)


def test_several_outputs_are_selected_by_name() -> None:
    result = vl.propagate(models.circuit, {("v", "i", "phi"): models.CIRCUIT})
    assert result.table["output"].tolist() == ["R", "X", "Z"]
    with pytest.raises(vl.InputError, match=r"use .NAME. of R, X, Z"):
        _ = result.u
    with pytest.raises(vl.InputError, match="allowed: R, X, Z"):
        _ = result["Y"]


def plain(a, b):
    return a + b


def changes(a, b):
    a += b
    return a


class Changing:
    """A sum that changes with the number of its calls, after `since` calls."""

    def __init__(self, since: int = 0, named: bool = False) -> None:
        self.calls, self.since, self.named = 0, since, named

    def __call__(self, a, b):
        self.calls += 1
        late = self.calls > self.since
        if self.named:
            return {f"sum {self.calls if late else 0}": a + b}
        return a + b + late * self.calls


GOOD = {"a": vl.Input(1, 0.1), "b": vl.Input(2, 0.2)}
THREE = {name: vl.Input(0, 1) for name in "abc"}
NOT_DEFINITE = {("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9}
WRONG = {
    "not positive": (
        lambda a, b, c: a + b + c,
        THREE,
        {"correlations": NOT_DEFINITE},
        r"negative eigenvalue -0\.8, mainly caused by . and .",
    ),
    "above 1": (plain, GOOD, {"correlations": {("a", "b"): 1.5}}, "a b = 1.5; allowed: -1 to 1"),
    "twice": (plain, GOOD, {"correlations": {("a", "b"): 0.5, ("b", "a"): 0.4}}, "given twice"),
    "unknown": (plain, GOOD, {"correlations": {("a", "z"): 0.5}}, "allowed: two of a, b"),
    "limits": (
        plain,
        GOOD | {"b": vl.Input(low=3, high=1)},
        {},
        "b: high = 1.0; .*larger than low = 3",
    ),
    "limits of a normal": (
        plain,
        GOOD | {"b": vl.Input(low=1, high=3, distribution="normal")},
        {},
        "value and u instead of limits",
    ),
    "both": (plain, GOOD | {"b": vl.Input(2, low=1, high=3)}, {}, "low and high, or value and u"),
    "law": (plain, GOOD | {"b": vl.Input(2, 1, distribution="norml")}, {}, "did you mean normal"),
    "negative": (plain, GOOD | {"b": vl.Input(2, -1)}, {}, "b: u = -1.0; allowed: at least 0"),
    "dof": (plain, GOOD | {"b": vl.Input(2, 1, dof=0)}, {}, "b: dof = 0; allowed: above 0"),
    "dof of limits": (plain, GOOD | {"b": vl.Input(low=1, high=3, dof=0.4)}, {}, "at least 0.5 if"),
    "text for dof": (plain, GOOD | {"b": vl.Input(2, 1, dof="9")}, {}, "b: dof = '9'; .*above 0"),
    "texts": (plain, {("a", "b"): "many"}, {}, "allowed: vl.Input, a number, or readings"),
    "inexact": (plain, GOOD | {"b": vl.Input(low=1, high=2, inexact=0.6)}, {}, "half the distance"),
    "equal": (plain, GOOD | {"b": [3.0, 3.0, 3.0]}, {}, r"b: readings = 3.0; all are equal.*√12"),
    "one reading": (plain, GOOD | {"b": [3.0]}, {}, "at least 2"),
    "text": (plain, GOOD | {"b": "2 mm"}, {}, "allowed: vl.Input, a number, or readings"),
    "nan": (
        lambda a, b: np.sqrt(a - b),
        GOOD,
        {},
        "is nan in 3 of 3 rows, for example at a = 1, b = 2",
    ),
    "shape": (lambda a, b: np.array([a, b]), GOOD, {}, r"shape \(2,\)'; allowed: one number"),
    "complex": (lambda a, b: a + 1j * b, GOOD, {}, "real ones"),
    "writes": (changes, GOOD, {}, "the model changes one of its input arrays"),
    "raises": (lambda a, b: a / (b - b), {"a": vl.Input(1, 0.1), "b": 2.0}, {}, "is inf"),
    "argument": (lambda a: a, GOOD, {}, "raises; TypeError: .*unexpected keyword"),
    "nothing": (lambda a: a, {"a": 1.0}, {}, "none has an uncertainty"),
    "method": (plain, GOOD, {"method": "third"}, "first-order, second-order"),
    "probability": (plain, GOOD, {"probability": 95}, "between 0 and 1"),
    "groups": (
        plain,
        GOOD | {"b": vl.Input([1, 2, 3], 0.1, by=[1, 2])},
        {},
        "or 2 numbers, one per label",
    ),
    "array": (plain, GOOD | {"b": vl.Input([1, 2], 0.1)}, {}, "an array needs by=labels"),
    "no output": (lambda a, b: {}, GOOD, {}, r"outputs = \[\]; allowed: one number"),
    "correlations": (plain, GOOD, {"correlations": [0.5]}, r"allowed: \{\('a', 'b'\): 0.5\}"),
    "no number": (plain, GOOD, {"correlations": {("a", "b"): "x"}}, "a b = 'x'; allowed: -1 to 1"),
    "one together": (plain, {("a",): np.ones((2, 1))}, {}, "at least two inputs"),
    "together": (plain, {("a", "b"): np.ones((2, 2))}, {}, "more than 2, the number of inputs"),
    "infinite": (
        plain,
        GOOD | {"b": vl.Input(2, inf)},
        {},
        "b: u = inf; allowed: a number with a magnitude below",
    ),
    "no square": (plain, GOOD | {"b": vl.Input(2, 1e200)}, {}, "b: u = 1e.200; .* below 1e.150"),
    "wide": (plain, GOOD | {"b": vl.Input(low=-1e308, high=1e308)}, {}, "low = -1e.308; .*below"),
    "large readings": (plain, GOOD | {"b": [1e308, -1e308]}, {}, "with magnitudes below 1e.150"),
    "large answer": (lambda a, b: 1e200 * a + b, GOOD, {}, "is 1e.200 in 3 of 3 rows.*below 1e"),
    "names": (
        Changing(named=True),
        GOOD,
        {},
        r"outputs = \['sum \d'\]; allowed: sum \d, the outputs",
    ),
    "names by row": (
        lambda a, b: {"low" if np.all(a < 1.01) else "high": a + b},
        GOOD,
        {},
        r"outputs = \['high'\]; allowed: low",
    ),
    "no convergence": (
        np.vectorize(lambda a: 1 / (1 + a**2) ** 2 - 5 * a**3 + a),
        {"a": vl.Input(0, 0.5)},
        {"method": "second-order"},
        "does not converge",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_gives_one_line(case: str) -> None:
    model, inputs, more, said = WRONG[case]
    with pytest.raises(vl.InputError, match=said) as caught:
        vl.propagate(model, inputs, **more)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", ["first-order", "monte-carlo"])
@pytest.mark.parametrize("row_by_row", [False, True])
def test_a_model_that_gives_two_results_is_refused(method: str, row_by_row: bool) -> None:
    """The model draws numbers, counts its calls, or changes after the trial."""
    rng = np.random.default_rng(1)
    models = {"draws": lambda a, b: a * b + rng.normal(), "counts": Changing()}
    for model in models.values():
        by_row = (lambda a, b, f=model: f(float(a), float(b))) if row_by_row else model
        with pytest.raises(vl.InputError, match=r"the same inputs gave two results, .* and"):
            vl.propagate(by_row, GOOD, method=method, draws=1)
    if not row_by_row:
        tried = Changing(since=10**9)
        Model.try_out(tried, read_inputs(GOOD, {}))
        with pytest.raises(vl.InputError, match="the same inputs gave two results, 3 and 1"):
            vl.propagate(Changing(since=tried.calls), GOOD, method=method, draws=1)


def test_outputs_in_another_order_are_the_same() -> None:
    """The mapping has another order for each row."""
    turned = iter(range(10**9))

    def model(a, b):
        rows = [("sum", a + b), ("product", a * b)]
        return dict(rows[:: 1 if next(turned) % 2 else -1])

    result = vl.propagate(model, GOOD)
    assert result["sum"].value == pytest.approx(3)
    assert result["product"].value == pytest.approx(2)


@pytest.mark.parametrize(
    ("model", "inputs", "u"),
    [
        (
            lambda y, x: np.angle(x + 1j * y),
            {"y": vl.Input(0, 0.01), "x": vl.Input(-1, 0.02)},
            0.01,
        ),
        (lambda y, x: np.angle(x + 1j * y), {"y": vl.Input(-0.006, 0.01), "x": -1.0}, 0.01),
        (lambda a: np.mod(a, 360), {"a": vl.Input(359.9, 0.3)}, 0.3),
        (lambda a: np.mod(-2 * a, 360), {"a": vl.Input(0.1, 0.3)}, 0.6),
    ],
)
def test_a_jump_within_u_is_noted_and_the_slope_beside_it_counts(model, inputs, u: float) -> None:
    """The derivative of an angle is 1/r, of a remainder that of its argument."""
    result = vl.propagate(model, inputs)
    assert result.u == pytest.approx(u, rel=1e-3)
    assert len(result.notes) == 1
    assert "jumps within u of" in result.text
    for method in ("second-order", "monte-carlo"):
        assert "jumps within u" in vl.propagate(model, inputs, method=method, draws=1).text


@pytest.mark.parametrize(
    ("model", "value", "u", "noted"),
    [
        (np.floor, 3.05, 0.1, True),
        (np.round, 2.45, 0.06, True),
        (lambda a: np.maximum(a, 0), 0, 1, True),
        (lambda a: np.minimum(a, 0), 0, 1, True),
        # smooth: one of the two changes of a parabola is 0 for u, or for u/2
        (np.square, 0.5, 1, False),
        (np.square, 0.25, 1, False),
        (np.square, -0.5, 1, False),
        (np.exp, 0, 3, False),
        (lambda a: a**3, 0, 1, False),
        (lambda a: 1e9 + 0 * a + 1e-3 * a, 1, 1, False),
        (lambda a: np.sin(1e6 + a) * 1e-12 + a, 1e6, 1e-3, False),
    ],
)
def test_a_jump_or_bend_without_a_clear_slope_is_noted_only(model, value, u, noted: bool) -> None:
    def named(a):  # the argument of a ufunc has no name
        return model(a)

    result = vl.propagate(named, {"a": vl.Input(value, u)})
    assert result.u == pytest.approx(abs(model(value + u) - model(value - u)) / 2, rel=1e-6)
    assert ("jumps or bends within u of a" in result.text) == noted


def test_a_missing_limit_is_named() -> None:
    with pytest.raises(
        vl.InputError, match=r"x: limits = \(0, None\); allowed: either low and high"
    ):
        vl.propagate(lambda x: x, {"x": vl.Input(low=0)})
    with pytest.raises(vl.InputError, match="either low and high"):
        vl.propagate(lambda x: x, {"x": vl.Input(high=0)})


def test_an_output_without_u_is_stated() -> None:
    result = vl.propagate(lambda a, b: 0 * a + 3 + 0 * b, GOOD)
    assert result.u == 0
    assert result.dof == inf
    assert "no input changes it" in result.text


@pytest.mark.parametrize("method", ["first-order", "second-order", "monte-carlo"])
@pytest.mark.parametrize("rule", ["stein", "7.9"])
def test_a_u_that_is_rounding_is_zero(method: str, rule: str) -> None:
    """Two digits of a u of 1e-16 would take endless draws."""
    result = vl.propagate(lambda a, b: 0.95 + 3e-16 * (a + b), GOOD, method=method, rule=rule)
    assert result.u == 0
    assert result.value == pytest.approx(0.95)
    if method == "monte-carlo":
        assert result["result"].convergence.draws <= 2**18
