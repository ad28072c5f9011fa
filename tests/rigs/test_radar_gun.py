"""An instrument of another package: four files and entry points, and no change here."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.laboratories import certify
from tests.one_laboratory import reduce_session
from virtual_lab.errors import InputError
from virtual_lab.lab import BatTest
from virtual_lab.measurement.reduction.makers import flight_readings
from virtual_lab.records.session import Session, load_session, save_session
from virtual_lab.simulation.stations.rig import Reality


@pytest.fixture(scope="module")
def ideal() -> BatTest:
    return certify("r161", procedure="bbcor", rig="radar-range", seed=1, reality=Reality.IDEAL)


def test_a_radar_gun_measures_e_of_an_ideal_laboratory(ideal: BatTest) -> None:
    """Scale, distance and drag are corrected with the right sign; otherwise e is wrong by 1e-4."""
    true = ideal.sealed.measurand["metric"]
    assert ideal.certification.metric.value == pytest.approx(true, abs=1e-9)


def test_a_radar_guns_constants_are_in_the_budget() -> None:
    """For a gun farther away by δ, e_A = v_out/v_in exp(2 κ d) rises and v_in ∝ exp(-κ d) falls.

    So e rises by (1 + r) e_A 2 κ δ, and e0 at the lower speed as well. The metric of a wood bat is
    .5 e/e0, because its shell is rigid.
    """
    tested = certify("r161", procedure="bbcor", rig="radar-range", seed=1)
    parts = {part.name: part.contribution for part in tested.certification.metric.components}
    shots, mask = tested.certification.shots, tested.certification.hit_weights.used
    e_A, r, e, e0, v = (
        getattr(shots, name)[mask].mean()
        for name in (
            "collision_efficiency",
            "recoil_factor",
            "restitution",
            "ball_restitution",
            "speed",
        )
    )
    slope = -0.001 / 0.44704  # slope of e0 of this ball [s/m], within 2 % in this lot
    known = {name: of.value for name, of in tested.certification.session.calibration.items()}
    area, mass = np.pi * known["ball.radius"] ** 2, shots.ball_mass[mask].mean()
    air = known["hall.air.density"] * known["hall.air.drag_coefficient"]
    kappa = air * area / (2 * mass)
    by_distance = 0.5 / e0 * ((1 + r) * e_A * 2 + e / e0 * slope * v) * kappa * 2e-3
    assert abs(parts["impact.radar.distance"]) == pytest.approx(by_distance, rel=0.03)
    by_scale = 0.5 / e0 * e / e0 * slope * v * 2e-4  # cancels in e_A, not in the speed for e0
    assert abs(parts["impact.radar.scale"]) == pytest.approx(abs(by_scale), rel=0.03)


def test_its_records_are_reduced_from_the_disk(ideal: BatTest, tmp_path: Path) -> None:
    session = ideal.certification.session
    save_session(session, tmp_path)
    again, _ = reduce_session(load_session(tmp_path))
    assert np.array_equal(
        again.shots.collision_efficiency, ideal.certification.shots.collision_efficiency
    )


def test_a_stage_with_two_instruments_or_none_is_refused(ideal: BatTest) -> None:
    session = ideal.certification.session
    impact, balls = session.records["impact"], session.records["balls"]
    for records, says in (
        ({**impact, "gates": balls["gates"]}, "one record of the ball's flight"),
        ({"log": impact["log"]}, "this record is missing"),
    ):
        changed: Session = replace(session, records={**session.records, "impact": records})
        with pytest.raises(InputError, match=says):
            flight_readings(changed, "impact")
