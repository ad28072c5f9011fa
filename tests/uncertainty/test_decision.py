"""Risks of decisions against JCGM 106, another program's numbers, and counted items."""

import json
import pickle
from math import inf, nan

import numpy as np
import pytest
from scipy import integrate, special, stats

import virtual_lab as vl

RESISTORS = vl.Input(1500, 0.12)
LIMITS = {"lower": 1499.8, "upper": 1500.2}
# joint risks by g = h U, from suncal 1.7.1 (risk.PFA, PFR) and scipy's dblquad
TABLE = {
    0.0: (0.0189422067, 0.0372078002, 5e-9),
    1.0: (0.00047, 0.24767, 5e-6),
    0.5: (0.00433, 0.11466, 5e-6),
    0.25: (0.00988, 0.06903, 5e-6),
    -0.25: (0.03114, 0.01755, 5e-6),
    -1.0: (0.06940, 0.00068, 5e-6),
}


def test_specific_risks_agree_with_jcgm_106() -> None:
    """JCGM 106 8.3.3: Zener diode, V ≤ -5.40 V, -5.47 ± .05: Φ(1.4) = .92; a bat with one limit."""
    assert vl.conformity(-5.47, 0.05, upper=-5.40) == pytest.approx(0.9192, abs=5e-5)
    assert vl.conformity(1.140, 0.0074, upper=1.15) == pytest.approx(0.912, abs=5e-4)
    assert vl.conformity(1.140, 0.0074, upper=1.15, dof=14.2) == pytest.approx(0.901, abs=5e-4)
    two = vl.conformity(0.5, 1.0, lower=-1, upper=1, dof=4)
    assert two == pytest.approx(stats.t.cdf(0.5, 4) - stats.t.cdf(-1.5, 4))


@pytest.mark.parametrize("h", TABLE)
def test_global_risks_agree_with_suncal(h: float) -> None:
    consumer, producer, near = TABLE[h]
    result = vl.risk(RESISTORS, 0.04, **LIMITS, guard=h * 0.08)
    assert result.consumer == pytest.approx(consumer, abs=near)
    assert result.producer == pytest.approx(producer, abs=near)


@pytest.mark.parametrize(
    "prior",
    [
        vl.Input(1.0, 0.3, dof=4),
        vl.Input(low=0.5, high=1.6),
        vl.Input(1.0, 0.3, distribution="triangular"),
        vl.Input(1.0, 0.3, distribution="arcsine"),
        vl.Input(low=0.5, high=1.6, inexact=0.2),
    ],
)
def test_global_risks_agree_with_counted_items(prior: vl.Input) -> None:
    """A million items of each prior give all four risks; the text has the definitions."""
    from virtual_lab.uncertainty.inputs import source_of

    rng, source = np.random.default_rng(4), source_of("prior", prior)
    item = source.estimate.value + source.scale * source.law.draw(rng, 10**6, source.shape)
    measured = item + 0.1 * rng.standard_t(7, 10**6)
    result = vl.risk(prior, 0.1, upper=1.2, guard=0.05, dof=7)
    good, accepted = item <= 1.2, measured <= 1.15
    assert result.consumer == pytest.approx(np.mean(accepted & ~good), abs=2e-3)
    assert result.producer == pytest.approx(np.mean(~accepted & good), abs=2e-3)
    assert result.consumer_given_accepted == pytest.approx(np.mean(~good[accepted]), abs=2e-3)
    assert result.producer_given_conforming == pytest.approx(np.mean(~accepted[good]), abs=2e-3)
    text = str(result)
    assert "consumer's risk, P(accepted and not conforming): joint" in text
    assert "producer's risk, P(rejected | conforming): conditional" in text
    assert text.startswith("prior: ")


def test_a_probability_and_a_guard_band_print_their_meaning() -> None:
    chance = vl.conformity(1.140, 0.0074, upper=1.15)
    band = vl.guard_band(0.04, upper=1500, r=1)
    assert str(chance) == repr(chance)
    assert repr(chance).startswith("0.9117")
    assert "P(conforming): the true value of this item is within the limits" in repr(chance)
    assert f"{chance:.2f}" == "0.91"
    assert json.loads(json.dumps(1 - chance)) == 1 - chance
    assert json.loads(json.dumps(chance)) == chance == pickle.loads(pickle.dumps(chance))
    assert repr(band) == "guard band 0.08; accepted within (-inf, 1499.92)"
    assert (band.width, band.lower, band.upper) == tuple(band)
    assert sum(band[::2]) == pytest.approx(1500)


def test_guard_bands_meet_their_risk() -> None:
    """The band follows w = r U, a specific risk of 5 % (1.645 u), or a joint risk, which holds."""
    assert vl.guard_band(0.04, **LIMITS, r=1) == pytest.approx((0.08, 1499.88, 1500.12))
    w, low, high = vl.guard_band(0.0074, upper=1.15, target=0.05)
    assert (w, low) == (pytest.approx(1.644854 * 0.0074), -inf)
    assert 1 - vl.conformity(high, 0.0074, upper=1.15) == pytest.approx(0.05)
    k = stats.t.ppf(0.975, 6)
    assert vl.guard_band(0.04, upper=1, r=-1, dof=6)[0] == pytest.approx(-k * 0.04)
    for target in (0.0300, 0.0098836):
        w, *_ = vl.guard_band(0.04, **LIMITS, target=target, prior=RESISTORS)
        result = vl.risk(RESISTORS, 0.04, **LIMITS, guard=w)
        assert result.consumer == pytest.approx(target, abs=1e-9)
    assert w == pytest.approx(0.02, abs=2e-5)  # joint risk .00988 at g = U/4


def test_guard_bands_reach_from_minus_40_to_40_u_or_half_the_tolerance() -> None:
    """With 1 degree of freedom the risk at the limit is 1/2 - arctan(w/u)/π: 31.8 u for 1 %."""
    for target in (0.01, 0.3, 0.99):
        w, *_ = vl.guard_band(0.5, upper=3, target=target, dof=1)
        assert w == pytest.approx(0.5 * np.tan(np.pi * (0.5 - target)), rel=1e-9)
    for target in (0.0079, 0.9921):  # 40.3 u
        with pytest.raises(vl.InputError, match=r"allowed: 0\.008 to 0\.99, the range"):
            vl.guard_band(0.5, upper=3, target=target, dof=1)
    w, *_ = vl.guard_band(1e-9, upper=1, target=0.05)  # of any size
    assert w == pytest.approx(1e-9 * stats.norm.isf(0.05), rel=1e-9)
    # two limits, 2 u from their middle: at least the risk of an item in the middle, 2 Φ(-2)
    least = 2 * stats.norm.cdf(-2)
    w, low, high = vl.guard_band(0.5, lower=-1, upper=1, target=least + 1e-6)
    assert 0.99 < w < 1
    assert low < high
    risk = 1 - np.diff(stats.norm.cdf([-1, 1], high, 0.5))[0]
    assert risk == pytest.approx(least + 1e-6, abs=1e-12)
    with pytest.raises(vl.InputError, match=r"allowed: 0\.046 to"):
        vl.guard_band(0.5, lower=-1, upper=1, target=least - 1e-6)


@pytest.mark.parametrize("u", [1e-4, 0.01, 0.3])
@pytest.mark.parametrize(("lower", "upper", "guard"), [(-1.0, 1.5, 0.1), (None, 0.7, -0.05)])
def test_global_risks_agree_with_scipy_for_any_u(lower, upper, guard, u: float) -> None:
    """Items and readings are normal, so that the accepted share is closed, the rest by quad.

    Panels that miss an acceptance limit would show: the chance changes there within a few u.
    """
    ends = [(-9.0 if lower is None else lower), upper]
    inner = [(-9.0 if lower is None else lower + guard), upper - guard]

    def density(x: float) -> float:
        return stats.norm.pdf(x) * np.diff(special.ndtr((np.array(inner) - x) / u))[0]

    turns = [end + k * u for end in inner for k in (-7, -1, 0, 1, 7)]
    inside, _ = integrate.quad(
        density, *ends, points=[x for x in turns if ends[0] < x < ends[1]], epsabs=1e-11, limit=200
    )
    accepted = np.diff(stats.norm.cdf(inner, 0, np.sqrt(1 + u**2)))[0]
    conforming = np.diff(stats.norm.cdf(ends))[0]
    result = vl.risk(vl.Input(0, 1), u, lower=lower, upper=upper, guard=guard)
    assert result.consumer == pytest.approx(accepted - inside, abs=1e-10)
    assert result.producer == pytest.approx(conforming - inside, abs=1e-10)


@pytest.mark.parametrize(
    ("decide", "said"),
    [
        (lambda: vl.conformity(1, 0.1), "allowed: lower, upper, or both"),
        (lambda: vl.conformity(1, 0, upper=2), "u = 0.0; allowed: above 0"),
        (lambda: vl.conformity(nan, 0.1, upper=2), "value = nan; allowed: a number"),
        (lambda: vl.conformity(inf, 0.1, upper=2), "value = inf; allowed: a finite number"),
        (lambda: vl.conformity(1, 0.1, upper=2, dof=nan), "dof = nan; allowed: a number"),
        (lambda: vl.conformity(1, 0.1, upper=2, dof=-1), "dof = -1.0; allowed: above 0"),
        (lambda: vl.conformity(1, 0.1, upper=2, dof=0), "dof = 0.0; allowed: above 0"),
        (lambda: vl.guard_band(0.1, upper=1, r=inf), "guard band = inf; allowed: a finite number"),
        (lambda: vl.conformity(1, 0.1, lower=2, upper=1), "allowed: larger than lower = 2"),
        (lambda: vl.risk(1.5, 0.1, upper=2), r"prior = 1.5; allowed: vl.Input"),
        (lambda: vl.risk(vl.Input(1, 0), 0.1, upper=2), "prior: u = 0; allowed: above 0"),
        (lambda: vl.risk(RESISTORS, 0.04, **LIMITS, guard=0.3), "half the tolerance"),
        (lambda: vl.guard_band(0.1, upper=1), "allowed: either r or target"),
        (lambda: vl.guard_band(0.1, upper=1, target=1.5), "between 0 and 1"),
        (
            lambda: vl.guard_band(0.04, **LIMITS, target=0.5, prior=RESISTORS),
            "the range that a guard band covers",
        ),
    ],
)
def test_wrong_input_gives_one_line(decide, said: str) -> None:
    with pytest.raises(vl.InputError, match=said) as caught:
        decide()
    assert "\n" not in str(caught.value)
