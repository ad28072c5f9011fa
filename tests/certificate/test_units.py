"""Every number of certificate.json has a unit in its key or beside it, or is dimensionless."""

import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.conftest import Play
from virtual_lab import catalog
from virtual_lab.certificate.filling import certificate
from virtual_lab.simulation.stations.rig import Reality

SUFFIX = re.compile(r"_(mph|in|kg|m|kg_m2|kg_per_m3|hz|per_s|percent|ms|deg)$")
RATIOS = {
    "ball",
    "ball_restitution",
    "bat_performance_factor",
    "collision_efficiency",
    "dof",
    "difference",
    "drop",
    "error",
    "exponent",
    "hits",
    "hits_needed",
    "missed",
    "probability",
    "rebound_efficiency",
    "recoil_efficiency",
    "recoil_factor",
    "restitution",
    "schema",
    "share_of_video",
    "shot",
    "standard",
    "swing_exponent",
    "valid_hits",
}
OF_THE_METRIC = {"metric", "swing_range", "choice", "places"}  # numbers in the unit of metric.unit
WITH_UNIT = {
    ("along", "quantities"),
    ("along", "read"),
    ("ball_correction", "as_found"),
}  # numbers with `unit` beside them, or in the metric's unit
OF_RATIOS = {"rebound_check"}
SI = {"": 1.0, "m/s": 1.0}


def numbers(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the path of keys to every number."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, (*path, key))
    elif isinstance(value, list):
        for inner in value:
            yield from numbers(inner, path)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def has_unit(path: tuple[str, ...]) -> bool:
    """Return whether the keys state the unit of a number."""
    if any(SUFFIX.search(key) or key in RATIOS for key in path) or path[-1] == "shots":
        return True
    if path == ("shots", "value") or path[0] in OF_RATIOS:
        return True
    if path[:2] in WITH_UNIT or path == ("along", "degree"):
        return True
    if path[0] == "conditions":  # numbers with `unit` beside them
        return True
    # a budget's lines are in SI: the constant's own, and contributions in the metric's
    return path[0] in OF_THE_METRIC or path[0] == "budget"


def bat_of(procedure: str) -> str:
    return "softball-34" if procedure == "asa" else "r161"


@pytest.mark.parametrize("procedure", catalog.names("procedures"))
def test_every_number_has_a_unit(procedure: str, played: Play) -> None:
    found = played(bat_of(procedure), Reality.IDEAL, procedure=procedure).certification
    document = certificate(found).as_json()
    paths = set(numbers(document))
    assert len(paths) > 30
    assert [path for path in paths if not has_unit(path)] == []
    metric = document["metric"]
    assert metric["unit"] in SI
    assert (metric["unit"] == "m/s") == (found.procedure.metric == "batted_speed")
    assert found.metric is not None
    assert metric["value"] == found.metric.value
    assert metric["limit"] == found.procedure.metric_limit
    # 80 to 120 mph are 36 to 54 m/s, so a speed in m/s cannot pass for mph
    if metric["unit"] == "m/s":
        speeds = [metric["value"], *(row["value"] for row in document["swing_range"])]
        assert all(30 < speed < 55 for speed in speeds)


def test_a_number_without_a_unit_is_detected() -> None:
    assert not has_unit(("recoil", "axis"))
    assert list(numbers({"a": [1, {"b": True, "c_mph": 2.0}]})) == [("a",), ("a", "c_mph")]
