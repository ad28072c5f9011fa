"""The measured density of the hall's air, and its use in the reduction."""

from dataclasses import replace

import numpy as np
import pytest

from tests.laboratories import certified
from virtual_lab import lab
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.printed import printed_values
from virtual_lab.errors import InputError
from virtual_lab.lab import test_day
from virtual_lab.measurement.certification import certify_session
from virtual_lab.measurement.reduction.air import DENSITY, measured_density
from virtual_lab.measurement.session_reduction import prepare
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.session import Session
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import Stage

LABORATORIES = 1000


def with_climate(session: Session, **changes: float) -> Session:
    """Return a session with a changed climate record, or without one if there are no changes."""
    bench = dict(session.records["bench"])
    record = bench.pop("climate")
    if changes:
        arrays = {name: np.full(2, value) for name, value in changes.items()}
        bench["climate"] = replace(record, **arrays)
    return replace(session, records={**session.records, "bench": bench})


def test_the_measured_density_scatters_about_the_true_one_as_its_u_says() -> None:
    """1000 halls: mean of (measured - true) / u within 4 / √1000 of 0, its rms 0.85 to 1.1.

    The u of a drift between start and end is too large where nothing drifted.
    """
    setup = lab.TestSetup.of("r161", procedure="astm-f1881", seed=1, detail=RecordDetail.SUMMED)
    laboratory = lab.Laboratory.open(replace(setup, number=np.arange(LABORATORIES)))
    density = measured_density(test_day.TestDay.begin(laboratory).measure_bat().sessions)
    true = laboratory.stations[Stage.IMPACT].true_constants["air.density"]
    assert np.std(true) == pytest.approx(0.02, rel=0.1)  # standard deviation of the sheet
    score = (density.value - true) / density.u
    assert abs(score.mean()) < 4 / np.sqrt(LABORATORIES)
    assert 0.85 < np.sqrt(np.mean(score**2)) < 1.1
    assert density.u.max() < 0.002


def test_the_density_is_computed_from_the_readings_if_there_are_any() -> None:
    """At 20 °C, 50 % and 1013.25 hPa it is 1.1993 kg/m³; a stated density is then ignored."""
    session = certified().certification.session
    none = {f"bench.climate.{name}": 0.0 for name in ("temperature", "humidity", "pressure")}
    calibration = dict(session.calibration)
    for name, value in none.items():
        calibration[name] = replace(calibration[name], value=value)
    calibration[DENSITY] = replace(calibration[DENSITY], value=1.0)
    changed_session = replace(session, calibration=calibration)
    read = with_climate(changed_session, temperature=293.15, humidity=0.5, pressure=101325.0)
    constants = prepare(SessionBlock.of(read)).constants
    assert constants[DENSITY].value == pytest.approx(1.19931, abs=1e-5)
    assert not any(name.startswith("bench.climate") for name in constants)
    without = SessionBlock.of(with_climate(changed_session))
    assert prepare(without).constants[DENSITY].value == 1.0


def test_a_certificate_states_the_climate_or_the_density_of_the_sheet() -> None:
    session = certified().certification.session
    document = certificate(certify_session(session))
    assert [each.name for each in document.conditions] == ["temperature", "humidity", "pressure"]
    rows = dict(row for half in printed_values(document)["identification"] for row in half)
    for unit in ("°C", "% relative humidity", "hPa", "kg/m³"):
        assert unit in rows["Air in the hall"]
    before = certificate(certify_session(with_climate(session)))
    assert before.conditions == ()
    assert before.air_density_kg_per_m3.u == 0.02
    shift = abs(document.metric.value - before.metric.value)
    assert 0 < shift < 0.05 * before.metric.u


@pytest.mark.parametrize(
    ("name", "value", "column"),
    [("temperature", 21.0, "temperature_K"), ("humidity", 45.0, "humidity"),
     ("pressure", 1013.0, "pressure_Pa")],
)  # fmt: skip
def test_a_reading_in_another_unit_is_refused(name: str, value: float, column: str) -> None:
    session = with_climate(certified().certification.session, **{name: value})
    with pytest.raises(InputError, match=f"bench/climate: {column}") as refused:
        measured_density(SessionBlock.of(session))
    assert "allowed" in str(refused.value)
