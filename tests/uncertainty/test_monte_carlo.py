"""The metric of a certificate by second order and by Monte Carlo (JCGM 101)."""

from dataclasses import replace
from functools import partial
from math import inf, sqrt
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.conftest import PROCEDURE
from tests.laboratories import certified
from tests.one_laboratory import reduce_session
from virtual_lab import lab
from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.text import certificate_text
from virtual_lab.measurement.alternatives.refined import propagate_metric
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.uncertainty.propagating import propagate_inputs


@pytest.mark.parametrize(("bat", "procedure"), [("r161", "bbcor"), ("softball-34", "asa")])
def test_draws_have_the_u_of_t_distributions(bat: str, procedure: str) -> None:
    """u² = Σ (c u)² ν/(ν - 2), because draws have t distributions, within 2 % (4 standard errors).

    The ends agree with those of sums of t draws by numpy, within 3 % of the interval.

    A constant left out, drawn twice, or with another law would show, as would missing draws of hits
    or of the choice of an impact position.
    """
    certification = certified(bat, procedure=procedure, seed=2).certification
    linear = certification.metric
    assert linear is not None
    parts = [part for line in linear.components for part in (line.parts or (line,))]
    dofs = [part.dof for part in parts]
    widened = [1 if dof == inf else dof / (dof - 2) for dof in dofs]
    u = sqrt(sum(w * part.contribution**2 for w, part in zip(widened, parts, strict=True)))
    reduced, readings = reduce_session(certification.session)
    by = partial(
        propagate_metric, reduced=reduced, readings=readings, hit_weights=reduced.hit_weights
    )
    drawn = by("monte-carlo", linear=linear, draws=65_536)
    assert drawn.u == pytest.approx(u, rel=0.02)
    assert drawn.value == pytest.approx(linear.value + linear.shift, abs=0.02 * u)
    rng, sums = np.random.default_rng(7), np.zeros(65_536)
    for part, dof in zip(parts, dofs, strict=True):
        draw = rng.standard_normal if dof == inf else partial(rng.standard_t, dof)
        sums += part.contribution * draw(size=sums.size)
    ends = linear.value + linear.shift + np.quantile(sums, [0.025, 0.975])
    assert drawn.interval == pytest.approx(ends, abs=0.03 * np.ptp(ends))
    if procedure == "asa":  # small curvature, so that the second order changes only the mean
        second = by("second-order", linear=linear)
        assert second.u == pytest.approx(linear.u, rel=1e-3)
        assert second["result"].shift == pytest.approx(linear.shift, rel=0.02, abs=1e-3 * u)
        shifted = replace(linear, value=linear.value + 1.0)
        assert by("second-order", linear=shifted).value == pytest.approx(second.value + 1)


def by_draws(monkeypatch: pytest.MonkeyPatch, seed: int) -> CertificateDocument:
    """Return a certificate by Monte Carlo with 32 768 draws, which settle one digit of u."""
    monkeypatch.setattr("virtual_lab.uncertainty.monte_carlo.BLOCK", 32_768)
    few = partial(propagate_inputs, digits=1, rule="7.9")
    monkeypatch.setattr("virtual_lab.measurement.alternatives.refined.propagate_inputs", few)
    setup = lab.TestSetup.of("r161", procedure=PROCEDURE, seed=seed, detail=RecordDetail.SUMMED)
    tested = lab.certify_bat(replace(setup, uncertainty="monte-carlo"))
    return certificate(tested.certification)


def test_a_certificate_by_draws_also_states_the_combined_u_of_its_lines(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The drawn u is that of a t distribution per line, with the dof that the line states.

    The hits have 3.9 dof of 5, less what the constants explain; with 5, u would be 7 % smaller.
    """
    document = by_draws(monkeypatch, 1)
    lines = document.budget
    first = sqrt(sum(line.contribution**2 for line in lines))
    wider = [dof / (dof - 2) if (dof := line.dof) else 1.0 for line in lines]
    drawn = sqrt(sum(w * line.contribution**2 for w, line in zip(wider, lines, strict=True)))
    assert document.metric.u == pytest.approx(drawn, rel=0.04)
    assert "√(ν/(ν − 2)) times the u of its source" in document.evaluation
    rows = ElementTree.fromstring(certificate_page(document)).iter("tr")
    foot = {row[0].text: ["".join(cell.itertext()) for cell in row] for row in rows}
    assert foot["Combined, first order"][3:] == [f"{first:.4f}", "100"]
    assert foot["Combined, as stated"][3] == f"{document.metric.u:.4f}"
    assert f"(u {document.metric.u:.4f}, to first order {first:.4f})" in certificate_text(document)


def test_draws_of_too_few_degrees_of_freedom_are_not_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six hits scatter hardly more than the constants explain: u is that of the lines."""
    document = by_draws(monkeypatch, 21)
    u = sqrt(sum(line.contribution**2 for line in document.budget))
    assert document.metric.u == pytest.approx(u, rel=1e-12)
    assert "requested but not used: hits has only 2.2 degrees" in document.evaluation
    page = certificate_page(document)
    assert "Combined, first order" not in page
    assert ", of first order" not in certificate_text(document)
