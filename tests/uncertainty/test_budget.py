"""Propagation and combination against the GUM's examples and exact cases."""

from math import inf, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tests.one_laboratory import combine, propagate, stacked
from virtual_lab.uncertainty.budget import (
    HITS,
    Component,
    Components,
    Variants,
    combine_components,
    interval_95,
    means_of_hits,
    type_a_component,
)
from virtual_lab.uncertainty.estimate import Estimate, Estimates
from virtual_lab.uncertainty.scatter import Scatter

ROOT3, ROOT2 = sqrt(3), sqrt(2)
# inputs of JCGM 100:2008, H.1: end gauge, lengths in nm, temperatures in °C
END_GAUGE = {
    "ls": Estimate(value=50_000_623.0, u=25.0, dof=18),
    "d0": Estimate(value=215.0, u=5.8, dof=24),
    "d1": Estimate(value=0.0, u=3.9, dof=5),
    "d2": Estimate(value=0.0, u=6.7, dof=8),
    "as": Estimate(value=11.5e-6, u=2e-6 / ROOT3),
    "da": Estimate(value=0.0, u=1e-6 / ROOT3, dof=50),
    "dt": Estimate(value=0.0, u=0.05 / ROOT3, dof=2),
    "t": Estimate(value=-0.1, u=0.2),
    "delta": Estimate(value=0.0, u=0.5 / ROOT2),
}


def scatter(
    hits: np.ndarray, weights: np.ndarray, groups: np.ndarray, effects: np.ndarray | None = None
) -> Components:
    """Return the component of a weighted sum of hits by their scatter, `effects` (constant, n)."""
    effects = np.zeros((0, hits.size)) if effects is None else effects
    whole = Scatter.of_hits(hits[None], weights[None], groups[None], effects[None])
    return type_a_component(HITS, np.array([hits @ weights]), whole.u, whole.dof)


def component(components: Components) -> Component:
    (part,) = components.row(0)
    return part


def end_gauge(x):
    """Return L = ls + d - ls (da θ + as dθ), and d alone."""
    d = (x["d0"] + x["d1"] + x["d2"])[:, 0]
    expansion = x["da"] * (x["t"] + x["delta"]) + x["as"] * x["dt"]
    return {"length": d + (x["ls"] * (1 - expansion))[:, 0], "d": d}


def test_the_budget_agrees_with_gum_h1() -> None:
    """JCGM 100 H.1 has u 32 nm, ν 16, U99 93 nm; GTC 1.5.1 has more digits: 31.664 and 16.752."""
    components = propagate(end_gauge, END_GAUGE)
    budget = combine(50_000_838.0, components["length"])
    assert budget.u == pytest.approx(31.664, abs=5e-4)
    assert budget.dof == pytest.approx(16.752, abs=5e-4)
    assert round(stats.t.ppf(0.995, int(budget.dof)) * budget.u, -0) in (92, 93)
    difference = combine(215.0, components["d"])
    assert difference.u == pytest.approx(9.682, abs=5e-4)
    assert difference.dof == pytest.approx(25.447, abs=5e-4)
    by_name = {part.name: part for part in budget.components}
    # sensitivities of table H.1: the two largest, and those that are 0
    assert by_name["ls"].sensitivity == pytest.approx(1, abs=1e-5)
    assert by_name["dt"].contribution == pytest.approx(16.6, abs=0.05)
    assert by_name["da"].contribution == pytest.approx(2.9, abs=0.05)
    assert by_name["as"].contribution == pytest.approx(0, abs=1e-6)
    assert [part.name for part in budget.components][:2] == ["ls", "dt"]


def test_welch_satterthwaite_agrees_with_welchs_t_test() -> None:
    """The dof are those of Welch's two-sample t-test, by scipy.stats.ttest_ind(equal_var=False)."""
    rng = np.random.default_rng(12)
    a, b = rng.normal(0, 1, 7), rng.normal(0, 3, 12)
    expected = stats.ttest_ind(a, b, equal_var=False).df
    parts = [
        type_a_component(name, np.zeros(1), values.std(ddof=1, keepdims=True) / sqrt(n), n - 1)
        for name, values, n in (("a", a, 7), ("b", b, 12))
    ]
    assert combine(0.0, parts[0] + parts[1]).dof == pytest.approx(expected, rel=1e-12)


@given(
    terms=st.lists(
        st.tuples(st.floats(-100, 100), st.floats(-100, 100), st.floats(1e-3, 10)),
        min_size=1,
        max_size=6,
    )
)
def test_a_linear_model_is_exact(terms: list[tuple[float, float, float]]) -> None:
    """For Y = Σ c x, u² = Σ c² u² (GUM 5.1.2, independent inputs)."""
    constants = {f"x{i}": Estimate(value=x, u=u) for i, (_, x, u) in enumerate(terms)}

    def model(x):
        return {"y": sum(c * x[f"x{i}"][:, 0] for i, (c, _, _) in enumerate(terms))}

    parts = propagate(model, constants)["y"]
    for (c, _, u), part in zip(terms, parts.row(0), strict=True):
        assert part.sensitivity == pytest.approx(c, abs=1e-9 * 1e4 / u)
    expected = sqrt(sum((c * u) ** 2 for c, _, u in terms))
    assert combine(0.0, parts).u == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_shared_constant_cancels() -> None:
    """Two speeds share a clock: its u cancels in their ratio, but not in either speed."""
    constants = {
        "clock": Estimate(value=1.0, u=0.01),
        "near": Estimate(value=0.3, u=1e-3),
    }

    def model(x):
        into, back = x["near"] * x["clock"] / 0.01, x["near"] * x["clock"] / 0.05
        return {"ratio": (back / into)[:, 0], "speed": into[:, 0]}

    parts = propagate(model, constants)
    assert np.abs(parts["ratio"].effect).max() < 1e-15
    assert combine(30.0, parts["speed"]).u == pytest.approx(30 * sqrt(1e-4 + 1 / 9e4), rel=1e-3)


def test_scatter_has_a_line_and_a_constant_without_u_has_none() -> None:
    """Hits 1, 2, 3, 4 have s/√n = √(5/3)/2 with 3 dof; a constant without u has no line."""
    constants = {"a": Estimate(value=1.0), "b": Estimate(value=1.0, u=0.5)}
    parts = propagate(lambda x: {"y": (x["a"] * x["b"])[:, 0]}, constants)["y"]
    assert parts.names == ("b",)
    hits = scatter(np.arange(1.0, 5.0), np.full(4, 0.25), np.zeros(4))
    budget = combine(2.5, parts + hits)
    spread = sqrt(5 / 3) / 2
    assert budget.u_type_a == pytest.approx(spread, rel=1e-12)
    assert budget.u_type_b == pytest.approx(0.5, rel=1e-12)
    assert budget.u == pytest.approx(sqrt(spread**2 + 0.25), rel=1e-12)
    assert budget.dof == pytest.approx(3 * (budget.u / spread) ** 4, rel=1e-12)
    assert [part.name for part in budget.components] == ["hits", "b"]


def test_a_block_without_uncertain_constants_has_its_scatter_alone() -> None:
    """Three laboratories with a certain constant have no column of constants and three rows."""
    constants = {"a": Estimates(value=np.ones(3), u=np.zeros(3), dof=np.full(3, inf))}
    variants = Variants.of(constants)
    assert variants.sets == 1
    alone = variants.components(np.ones((3, 1))) + type_a_component(
        "hits", np.ones(3), np.full(3, 0.1)
    )
    assert combine_components(np.ones(3), alone).u == pytest.approx([0.1] * 3)


def test_every_impact_position_has_its_own_scatter() -> None:
    """Var = Σ (Σ w²) s² over impact positions; a single hit gets the pooled s² of the others."""
    hits = np.array([1.0, 2.0, 3.0, 10.0, 20.0, 7.0])
    weights = np.array([0.1, 0.1, 0.1, 0.3, 0.3, 0.1])
    part = component(scatter(hits, weights, np.array([1, 1, 1, 2, 2, 3])))
    parts = np.array([0.03 * 1.0, 0.18 * 50.0])
    alone = 0.01 * (2.0 + 50.0) / 3
    assert part.contribution**2 == pytest.approx(parts.sum() + alone, rel=1e-12)
    welch = parts[0] ** 2 / 2 + parts[1] ** 2 / 1
    assert part.dof == pytest.approx((parts.sum() + alone) ** 2 / welch, rel=1e-12)
    assert part.value == pytest.approx(hits @ weights, rel=1e-12)


def test_scatter_that_constants_explain_is_subtracted() -> None:
    """Two constants move two hits at a position by ±1 and ±2 and explain a variance of (2 + 8)/3.

    The dof are those of the whole variance times (remaining s²/s²)².
    """
    hits, weights = np.array([0.0, 4.0, 1.0, 3.0]), np.full(4, 0.25)
    effects = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 2.0, -2.0]])
    whole, remaining = 10 / 3, 10 / 3 - 10 / 3
    part = component(scatter(hits, weights, np.zeros(4), effects))
    assert part.contribution == pytest.approx(remaining, abs=1e-7)
    half = component(scatter(hits, weights, np.zeros(4), effects / sqrt(2)))
    assert half.contribution**2 == pytest.approx(whole / 2 / 4, rel=1e-12)
    assert half.dof == pytest.approx(3 / 4, rel=1e-12)
    # shift of all hits alike, which explains no scatter; an excess leaves none
    alike = scatter(hits, weights, np.zeros(4), np.full((1, 4), 5.0))
    assert component(alike) == component(scatter(hits, weights, np.zeros(4)))
    assert component(scatter(hits, weights, np.zeros(4), 9 * effects)).contribution == 0
    # position with a single hit: scatter of the other position, less the explained part
    alone = scatter(
        np.append(hits, 9.0),
        np.full(5, 0.2),
        np.array([0, 0, 0, 0, 1]),
        np.pad(effects / 2, (0, 1))[:2],
    )
    assert component(alone).contribution ** 2 == pytest.approx(0.2 * 0.75 * whole, rel=1e-12)


def test_a_pool_is_one_line() -> None:
    """Three means share one scatter of 9 dof: √(Σ c²) with 9, not 27 dof; others are separate."""
    constants = {
        f"b{k}": Estimate(value=0.0, u=0.1 * (k + 1), dof=9, evaluation="A", pool="means")
        for k in range(3)
    } | {"other": Estimate(value=1.0, u=0.2)}

    def model(x):
        return {"y": (x["b0"] - 2 * x["b1"] + x["b2"] + x["other"])[:, 0]}

    budget = combine(1.0, propagate(model, constants)["y"])
    lines = {part.name: part for part in budget.components}
    assert lines.keys() == {"means", "other"}
    square = 0.1**2 + 0.4**2 + 0.3**2
    assert lines["means"].contribution == pytest.approx(sqrt(square), rel=1e-12)
    assert lines["means"].dof == 9
    assert lines["means"].u == pytest.approx(sqrt((0.01 + 0.04 + 0.09) / 3), rel=1e-12)
    assert [part.sensitivity for part in lines["means"].parts] == pytest.approx([1, -2, 1])
    assert budget.u == pytest.approx(sqrt(square + 0.04), rel=1e-12)
    assert budget.dof == pytest.approx(9 * (budget.u**2 / square) ** 2, rel=1e-12)


def test_an_integer_is_varied_like_a_float() -> None:
    """The input d0 of JCGM 100 H.1 is 215: as an int it is varied by its u like a float."""
    parts = propagate(lambda x: {"y": x["d0"][:, 0]}, {"d0": Estimate(value=215, u=5.8)})["y"]
    assert component(parts).contribution == pytest.approx(5.8, rel=1e-12)


@pytest.mark.parametrize(("dof", "factor"), [(1, 12.71), (5, 2.57), (16, 2.12), (50, 2.01)])
def test_the_interval_has_students_factor(dof: float, factor: float) -> None:
    """JCGM 100:2008, table G.2, column 95 %."""
    low, high = interval_95(10.0, 2.0, dof)
    assert (high - 10) / 2 == pytest.approx(factor, abs=0.005)
    assert 10 - low == pytest.approx(high - 10)


def test_infinite_dof_give_the_normal_interval() -> None:
    """The normal factor is 1.96; without uncertain inputs the interval has no width."""
    assert interval_95(0.0, 1.0, inf)[1] == pytest.approx(1.959964, abs=1e-6)
    nothing = combine(
        3.0, propagate(lambda x: {"y": x["a"][:, 0]}, {"a": Estimate(value=3.0)})["y"]
    )
    assert (nothing.u, nothing.dof, nothing.interval_95) == (0.0, inf, (3.0, 3.0))


def test_a_nonlinear_model_has_its_central_difference() -> None:
    """For y = x³ at 2 ± 1e-4, the central difference is 3x² + u²."""
    parts = propagate(lambda x: {"y": x["x"][:, 0] ** 3}, {"x": Estimate(value=2.0, u=1e-4)})["y"]
    assert component(parts).sensitivity == pytest.approx(12 + 1e-8, rel=1e-9)


def test_curvature_shifts_the_mean_by_half_of_it() -> None:
    """E[x²] = x² + u² for any law, E[a²/2 - b²] = … + u_a²/2 - u_b² (GUM F.2.4.4, note 2).

    Shifts of a pool add up; a linear input has none.
    """

    def model(x):
        a, b, c = (x[name][:, 0] for name in "abc")
        return {"square": a**2, "both": a**2 / 2 - b**2 + c}

    constants = {
        "a": Estimate(value=3.0, u=0.2, pool="twins"),
        "b": Estimate(value=-5.0, u=0.1, pool="twins"),
        "c": Estimate(value=1.0, u=0.4),
    }
    parts = propagate(model, constants)
    assert combine(9.0, parts["square"]).shift == pytest.approx(0.04, rel=1e-9)
    result = combine(-19.5, parts["both"])
    assert result.shift == pytest.approx(0.04 / 2 - 0.01, rel=1e-9)
    assert {part.name: round(part.shift, 12) for part in result.components} == {
        "twins": 0.01,
        "c": 0,
    }


def test_hits_weigh_in_the_scatter_by_their_effect_on_the_result() -> None:
    """At a peak between positions, value follows the weights, u the effects.

    Hits 1, 3 and 2, 6 at two positions have s² = 2 and 8. A constant moves two of them by +.5 and
    -.5, which explains (.25 + .25)/1 of the first position's 2. Effects .7, .7, -.2, -.2 give
    .98 · 1.5 + .08 · 8 for the hits and .7 (.5 - .5) = 0 for the constant.
    """
    variants = Variants.of(stacked({"k": Estimate(value=0.0, u=0.1)}))
    effect = np.array([0.5, -0.5, 0.0, 0.0])
    hits = np.array([1.0, 3.0, 2.0, 6.0]) + np.outer([0.0, 1.0, -1.0], effect)
    weights, effects = np.full(4, 0.25), np.array([0.7, 0.7, -0.2, -0.2])
    places = np.array([[1, 1, 2, 2]])
    result = means_of_hits(variants, hits[None], weights[None], places, effects[None]).row(0)
    assert result.value == pytest.approx(3.0)
    by_name = {part.name: part.contribution for part in result.components}
    assert by_name["hits"] == pytest.approx(sqrt(0.98 * 1.5 + 0.08 * 8.0))
    assert by_name["k"] == pytest.approx(0.0, abs=1e-12)
