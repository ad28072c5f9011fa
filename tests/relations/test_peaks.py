"""Maxima of curves known at points, against closed forms."""

import numpy as np
import pytest

from virtual_lab.relations.peaks import peak

PLACES = np.linspace(-1.0, 1.3, 41)


def test_the_peak_of_a_cosine_is_at_its_top() -> None:
    top = peak(PLACES, np.cos(PLACES - 0.2))
    assert top.value == pytest.approx(1, abs=1e-6)
    assert top.place == pytest.approx(0.2, abs=1e-4)


def test_a_curve_that_rises_or_falls_has_its_top_at_an_end() -> None:
    for sign, end in ((1, 1.3), (-1, -1.0)):
        top = peak(PLACES, np.exp(sign * PLACES))
        assert (top.value, top.place) == pytest.approx((np.exp(sign * end), end), rel=1e-12)
