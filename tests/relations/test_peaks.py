"""Tops and widths of curves known at places, against the curves' own closed forms."""

import numpy as np
import pytest

from virtual_lab.relations.peaks import peak, width_below

PLACES = np.linspace(-1.0, 1.3, 41)


def test_the_top_of_a_cosine() -> None:
    top = peak(PLACES, np.cos(PLACES - 0.2))
    assert top.value == pytest.approx(1, abs=1e-6)
    assert top.place == pytest.approx(0.2, abs=1e-4)


def test_the_width_of_a_cosine() -> None:
    """The cosine is 0.01 below its top at ± arccos 0.99."""
    found = width_below(PLACES, np.cos(PLACES - 0.2), 0.01)
    assert found.low == pytest.approx(0.2 - np.arccos(0.99), abs=1e-5)
    assert found.high == pytest.approx(0.2 + np.arccos(0.99), abs=1e-5)
    assert found.whole


def test_the_nearest_crossings_count_and_ends_are_said_to_be_cut_off() -> None:
    """Of a cosine that comes round again only the stretch about the greatest value is taken."""
    places = np.linspace(-4, 10, 401)
    found = width_below(places, np.cos(places) * np.exp(-0.01 * places**2), 0.5)
    assert -1.1 < found.low < -1.0
    assert 1.0 < found.high < 1.1
    rising = width_below(PLACES, PLACES, 0.5)
    assert rising == pytest.approx((0.8, 1.3, False, True))
    assert rising.width == pytest.approx(0.5)
