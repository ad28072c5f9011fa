"""The specific risk of a verdict, against published values and another code."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from scipy import stats

from tests.laboratories import certified
from virtual_lab.certificate.document import (
    CertificateDocument,
    MetricStated,
    RiskStated,
    document_of,
    risk_of,
)
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.printed import printed_result
from virtual_lab.errors import InputError


@pytest.fixture(scope="module")
def document() -> CertificateDocument:
    return certificate(certified().certification)


def decided(value: float, **changes: object) -> MetricStated:
    stated = MetricStated(
        name="bat_performance_factor",
        value=value,
        u=0.01,
        interval_95=(value - 0.02, value + 0.02),
        dof=None,
        u_type_a=0.01,
        u_type_b=0.0,
        unit="",
        limit=1.15,
        impact_position_in=6.0,
    )
    return replace(stated, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("dof", [1.0, 2.5, 14.2, None])
def test_a_result_of_few_degrees_of_freedom_has_the_tails_of_student(dof: float | None) -> None:
    told = risk_of(decided(1.14, dof=dof), "PASS", eligible=True)
    expected = stats.norm(1.14, 0.01) if dof is None else stats.t(dof, 1.14, 0.01)
    assert told is not None
    assert told.probability == pytest.approx(expected.sf(1.15), rel=1e-9)


def test_a_pass_risks_acceptance_and_a_fail_rejection() -> None:
    """At equal distances from the limit the risks are equal; at the limit they are one half."""
    accepted = risk_of(decided(1.13), "PASS", eligible=True)
    rejected = risk_of(decided(1.17), "FAIL", eligible=True)
    assert accepted is not None
    assert rejected is not None
    assert (accepted.of, rejected.of) == ("false acceptance", "false rejection")
    assert accepted.probability == pytest.approx(0.0228, abs=5e-5)  # two u
    assert rejected.probability == pytest.approx(accepted.probability, rel=1e-9)
    at_limit = risk_of(decided(1.15), "PASS", eligible=True)
    assert at_limit is not None
    assert at_limit.probability == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("stated", "verdict", "eligible"),
    [
        (decided(1.13), "INVALID", True),
        (decided(1.13), "FAIL", False),
        (decided(1.13, limit=None), "MEASURED", True),
        (decided(1.13, u=0.0), "PASS", True),
        (replace(decided(1.13), value=None, u=None), "INVALID", True),
    ],
)
def test_a_verdict_that_the_limit_does_not_decide_has_no_risk(
    stated: MetricStated, verdict: str, eligible: bool
) -> None:
    assert risk_of(stated, verdict, eligible=eligible) is None


def test_the_sentence_says_risk_and_prior(document: CertificateDocument) -> None:
    near = replace(document, risk=RiskStated(of="false acceptance", probability=0.0123))
    said = str(printed_result(near)["said"])
    assert re.search(r"The bat meets the limit: 0\.\d+ does not exceed 1\.200\. The risk", said)
    assert "risk that the true value exceeds the limit is 1.2 %" in said
    assert "specific risk of false acceptance, computed from this result alone" in said
    assert "below 0.01 %" in str(printed_result(document)["said"])


def test_a_risk_that_does_not_follow_from_the_metric_is_refused(
    document: CertificateDocument,
) -> None:
    parsed = document.as_json()
    for risk in (None, {"of": "false acceptance", "probability": 0.3, "prior": "none"}):
        with pytest.raises(InputError, match="risk"):
            document_of({**parsed, "risk": risk}, "certificate.json")
