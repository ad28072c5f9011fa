"""Constants are read in any unit of their dimension, and unknown ones are named."""

from __future__ import annotations

import re
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from virtual_lab import catalog
from virtual_lab.catalog.reading import DATA
from virtual_lab.errors import InputError
from virtual_lab.records.constants import constant_of
from virtual_lab.records.foreign.constants import read_constants
from virtual_lab.studies.foreign import our_session
from virtual_lab.units import DIMENSIONS

KEYS = {  # one of each dimension the form knows
    "mass": "bench.scale.zero",
    "length": "impact.gates.distance_12",
    "number": "hall.air.drag_coefficient",
    "angle": "bench.pendulum.amplitude_offset",
    "inertia": "bench.pendulum.clamp_inertia",
    "moment": "bench.pendulum.clamp_moment",
    "acceleration": "hall.gravity",
    "density": "hall.air.density",
    "slope of speed": "ball.restitution_slope",
}
UNITS = [(dimension, unit) for dimension in KEYS for unit in DIMENSIONS[dimension]]


@given(
    share=st.floats(1e-9, 1 - 1e-9),
    wide=st.floats(0, 1 - 1e-9),
    dof=st.none() | st.floats(1e-3, 1e6),
    unit=st.sampled_from(UNITS),
)
def test_constants_are_read_in_any_unit(
    share: float, wide: float, dof: float | None, unit: tuple[str, str]
) -> None:
    """Value and u have the same unit. The oracle is the factor in the table of units."""
    dimension, name = unit
    key, factor = KEYS[dimension], DIMENSIONS[dimension][name]
    of = constant_of(key)
    assert of
    value, u = of.low + share * (of.high - of.low), wide * (of.high - of.low)
    entry = {"value": value / factor, "unit": name, "u": u / factor, "source": "certificate 7"}
    known = read_constants({key: entry | ({"dof": dof} if dof else {})}, "x.toml")[key]
    assert known.value == pytest.approx(value, rel=1e-14, abs=1e-300)
    assert known.u == pytest.approx(u, rel=1e-14, abs=1e-300)
    assert known.dof == (dof or inf)
    assert known.source == "certificate 7"


def test_inches_and_ounce_inches_are_converted_by_nist() -> None:
    """By NIST: 1 in is 25.4 mm, and 1 oz in is 28.349523125 g times 25.4 mm."""
    entries = {
        "impact.gates.distance_0": {"value": 20, "unit": "in", "u": 0.01},
        "bench.pendulum.clamp_moment": {"value": 2, "unit": "oz in", "u": 0},
    }
    known = read_constants(entries, "x.toml")
    assert known["impact.gates.distance_0"].value == pytest.approx(0.508, rel=1e-15)
    assert known["impact.gates.distance_0"].u == pytest.approx(0.000254, rel=1e-15)
    assert known["bench.pendulum.clamp_moment"].value == pytest.approx(
        2 * 0.028349523125 * 0.0254, rel=1e-15
    )


def test_the_page_lists_the_constants_of_a_pivoted_test() -> None:
    """The page lists all constants of the form, and no others."""
    page = (DATA.parent / "virtual_lab" / "docs" / "raw-records.md").read_text("utf-8")
    sentence = page.split("needs these calibration constants:")[1].split("\n\n")[0]
    listed = []
    for found in re.findall(r"`([^`]+)`", sentence.replace("\n", " ")):
        before, _, inner = found.partition("{")
        listed += [before + name.strip() for name in inner.rstrip("}").split(",")]
    assert sorted(listed) == sorted(our_session("astm-f1881").calibration)


@pytest.mark.parametrize("procedure", catalog.names("procedures"))
def test_every_constant_of_ours_is_explained(procedure: str) -> None:
    """Each constant of an instrument has a dimension and a meaning."""
    for key in our_session(procedure).calibration:
        known = constant_of(key)
        assert known, key
        assert known.dimension in DIMENSIONS


def test_a_constant_of_somebody_elses_may_have_any_unit() -> None:
    entry = {"value": 2, "unit": "mph", "u": 0}
    known = read_constants({"impact.radar.offset": entry}, "x.toml")
    assert known["impact.radar.offset"].value == pytest.approx(0.89408)


GOOD = {"value": 21.65, "unit": "in", "u": 0.003}
KEY = "impact.gates.distance_0"


@pytest.mark.parametrize(
    ("entry", "key", "allowed"),
    [
        (GOOD | {"unit": "oz"}, f"{KEY}.unit", "m, mm, cm, in, um"),
        (GOOD | {"unit": "inches"}, f"{KEY}.unit", "m, mm, cm, in, um"),
        (GOOD | {"value": 2165, "unit": "m"}, f"{KEY}.value", "0 to 100 m"),
        (GOOD | {"u": 200, "unit": "m"}, f"{KEY}.u", "0 to 100 m"),
        (GOOD | {"unit": 3}, f"{KEY}.unit", "m, mm, cm, in, um"),
        (GOOD | {"unit": ["in"]}, f"{KEY}.unit", "m, mm, cm, in, um"),
        (GOOD | {"value": "21.65"}, f"{KEY}.value", "number"),
        (GOOD | {"value": True}, f"{KEY}.value", "number"),
        (GOOD | {"value": nan}, f"{KEY}.value", "finite"),
        (GOOD | {"value": 10**400}, f"{KEY}.value", "finite"),
        (GOOD | {"u": inf}, f"{KEY}.u", "finite"),
        (GOOD | {"u": -1}, KEY, "at least 0"),
        (GOOD | {"dof": 0}, KEY, "above 0"),
        (GOOD | {"dof": "many"}, f"{KEY}.dof", "number"),
        (GOOD | {"uncertainty": 1}, KEY, "value, unit, u, dof, source"),
        ({"value": 1, "unit": "in"}, KEY, "lacks u"),
        ({"u": 1}, KEY, "lacks value, unit"),
        (21.65, KEY, "expected a table"),
    ],
)
def test_every_fault_of_an_entry_is_named(entry: object, key: str, allowed: str) -> None:
    """One fault at a time in an entry that is otherwise valid."""
    read_constants({KEY: GOOD}, "x.toml")
    with pytest.raises(InputError) as caught:
        read_constants({KEY: entry}, "x.toml")
    assert "\n" not in str(caught.value)
    assert caught.value.where == "x.toml"
    assert caught.value.key == f"calibration.{key}"
    assert allowed in caught.value.allowed


def test_a_key_without_quotes_is_refused() -> None:
    """Without quotes, TOML reads the dots as nested tables."""
    with pytest.raises(InputError, match="quotes around the whole key"):
        read_constants({"impact": {"gates": {"distance_0": GOOD}}}, "x.toml")
