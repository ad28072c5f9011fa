"""Records of the wrong type, or of other shots, are refused by name."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import certify_session
from virtual_lab.measurement.reduction.observations import bench_constants
from virtual_lab.records.kinds import ShotLog
from virtual_lab.studies.foreign import our_session


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


def test_a_log_of_other_shots_than_its_stage_is_refused() -> None:
    session = our_session("astm-f1881")
    log = session.records["impact"]["log"]
    assert isinstance(log, ShotLog)
    parts = {name: getattr(log, name)[:-1] for name in ("ball", "nominal_speed", "place")}
    impact = {**session.records["impact"], "log": replace(log, **parts)}
    short = replace(session, records={**session.records, "impact": impact})
    shots = len(log.ball)
    said = f"impact/log: shots = {shots - 1}; the other records of impact have {shots} shots"
    with pytest.raises(InputError, match=said):
        certify_session(short)
