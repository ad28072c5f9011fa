"""The metric of a certificate by second order and by Monte Carlo (JCGM 101)."""

from dataclasses import replace
from functools import partial
from math import inf, sqrt

import numpy as np
import pytest

from tests.laboratories import certified
from virtual_lab.measurement.refined import refined
from virtual_lab.measurement.session_reduction import reduce_session

HITS_FREE = 5.0  # degrees of freedom of six hits at one place


@pytest.mark.parametrize(("bat", "procedure"), [("r161", "bbcor"), ("softball-34", "asa")])
def test_draws_have_the_u_of_students(bat: str, procedure: str) -> None:
    """u² = Σ (c u)² ν/(ν - 2), for draws are of t: within 2 %, four standard errors of 65 536.

    The ends are those of so many sums of t by numpy, within 3 % of the interval.

    A constant left out, drawn twice, or with another law would show, and hits or the choice of a
    place that the draws lack.
    """
    found = certified(bat, procedure=procedure, seed=2).certification
    linear = found.metric
    assert linear is not None
    parts = [part for line in linear.components for part in (line.parts or (line,))]
    dofs = [HITS_FREE if part.name == "hits" else part.dof for part in parts]
    widened = [1 if dof == inf else dof / (dof - 2) for dof in dofs]
    u = sqrt(sum(w * part.contribution**2 for w, part in zip(widened, parts, strict=True)))
    reduced = reduce_session(found.session)
    drawn = refined("monte-carlo", reduced, linear, HITS_FREE, draws=65_536)
    assert drawn.u == pytest.approx(u, rel=0.02)
    assert drawn.value == pytest.approx(linear.value + linear.shift, abs=0.02 * u)
    rng, sums = np.random.default_rng(7), np.zeros(65_536)
    for part, dof in zip(parts, dofs, strict=True):
        own = rng.standard_normal if dof == inf else partial(rng.standard_t, dof)
        sums += part.contribution * own(size=sums.size)
    ends = linear.value + linear.shift + np.quantile(sums, [0.025, 0.975])
    assert drawn.interval == pytest.approx(ends, abs=0.03 * np.ptp(ends))
    if procedure == "asa":  # not curved to speak of: the second order adds nothing but its mean
        second = refined("second-order", reduced, linear, HITS_FREE)
        assert second.u == pytest.approx(linear.u, rel=1e-3)
        assert second["result"].shift == pytest.approx(linear.shift, rel=0.02, abs=1e-3 * u)
        shifted = replace(linear, value=linear.value + 1.0)
        assert refined("second-order", reduced, shifted, HITS_FREE).value == pytest.approx(
            second.value + 1
        )
