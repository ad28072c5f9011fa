"""Records of the wrong type are refused by name."""

from types import SimpleNamespace
from typing import Any

import pytest

from virtual_lab.errors import InputError
from virtual_lab.measurement.reduction.observations import bench_constants


@pytest.mark.parametrize(
    ("bench", "said"),
    [({}, "this record is missing"), ({"pendulum": 3.0}, "expected PendulumRecord")],
)
def test_a_record_of_another_kind_is_refused(bench: dict[str, Any], said: str) -> None:
    session: Any = SimpleNamespace(records={"bench": bench})
    with pytest.raises(InputError, match=said) as refused:
        bench_constants(session)
    assert "bench/pendulum" in str(refused.value)
    assert "<class" not in str(refused.value)
