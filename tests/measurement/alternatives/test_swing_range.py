"""One test evaluated for a range of swing laws, against a test judged by each law."""

from dataclasses import replace

import pytest

from tests.laboratories import opened
from virtual_lab.lab import run_test
from virtual_lab.measurement.certification import certify_session
from virtual_lab.records.session import Session


def with_exponent(session: Session, exponent: float) -> Session:
    """Return a session whose rules have another exponent."""
    old = "exponent = { value = 0.3,"
    assert old in session.procedure_text
    text = session.procedure_text.replace(old, f"exponent = {{ value = {exponent},")
    return replace(session, procedure_text=text)


def test_each_exponent_gives_the_result_of_rules_with_that_exponent() -> None:
    """Value, position and u equal those of a certificate from the same records."""
    tested = run_test(opened("ea70", procedure="proposed", seed=4)).of(0)
    results = tested.certification.swings
    assert [result.exponent for result in results] == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    for result in results[:: len(results) - 1]:
        certification = certify_session(
            with_exponent(tested.certification.session, result.exponent)
        )
        assert certification.metric is not None
        assert result.budget.value == pytest.approx(certification.metric.value, rel=1e-12)
        assert result.budget.u == pytest.approx(certification.metric.u, rel=1e-9)
        assert result.position == pytest.approx(certification.hit_weights.position, rel=1e-12)
    speeds = [result.budget.value for result in results]
    assert speeds == sorted(speeds)  # gain of a light bat with n


def test_rules_without_exponents_give_no_swing_range() -> None:
    tested = run_test(opened("r161", procedure="ncaa-modified", seed=4)).of(0)
    assert tested.certification.swings == ()
