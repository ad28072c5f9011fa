"""Rehearsals of rules on curves with known results."""

from dataclasses import replace

import numpy as np
import pytest

from virtual_lab import catalog
from virtual_lab.measurement.procedure import Procedure
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.streams import Streams
from virtual_lab.studies.rehearsal import HitScatter, Rehearsal
from virtual_lab.units import INCH

MODIFIED = catalog.load("procedures", "ncaa-modified", Procedure).spec
# a scan for the greatest BESR: for a parabola the result is known
BESR = replace(MODIFIED, metric="besr", speed_limit=None, largest_u=0.008, largest_speed_u=None)
F1881 = catalog.load("procedures", "astm-f1881", Procedure).spec
BAT = BatProperties(
    mass=np.array(0.9),
    length=np.array(0.86),
    z_cm=np.array(0.29),
    inertia_cm=np.array(0.045),
    barrel_radius=np.array(0.033),
)
TOP = 6 * INCH
BEND = 40.0  # 1/m²
ALONG = 1.5e-3  # m


def parabola(place: np.ndarray) -> np.ndarray:
    """Return e_A with one maximum, and constant r and e0."""
    e_a = 0.2 - BEND / 2 * (place - TOP) ** 2
    return np.array([e_a, np.full_like(place, 0.25), np.full_like(place, 0.5)])


def rehearsal(procedure: Procedure, *, turn_rate: float = 0.0) -> Rehearsal:
    return Rehearsal(
        procedure=procedure, percussion=TOP, bat=BAT, turn_rate=turn_rate, curve=parabola
    )


@pytest.mark.parametrize("procedure", [BESR, F1881])
def test_without_straying_nothing_is_missed(procedure: Procedure) -> None:
    error = rehearsal(procedure).errors(HitScatter(0.0, 0.0), Streams(1), np.arange(1))
    assert error == pytest.approx(0, abs=1e-10)


def test_hits_beside_a_place_cost_half_the_curvature() -> None:
    """At a fixed position, the mean of a parabola over a normal scatter is exact."""
    one = replace(F1881, metric="restitution", correction=None)
    bias, se = rehearsal(one).bias(HitScatter(ALONG, 0.0), Streams(2), 2000)
    expected = -(1 + 0.25) * BEND / 2 * ALONG**2  # e is (1 + r) e_A + r
    assert abs(bias - expected) < 4 * se
    assert se < -expected / 10


def test_a_scan_has_less_selection_bias_than_a_fit_at_fixed_positions() -> None:
    """A scan gains less than the bias of a fitted maximum at fixed positions: it keeps looking."""
    scatter = 8e-3  # scatter of a poor laboratory, which shows it in 500 tests by 4 standard errors
    bias, se = rehearsal(BESR).bias(HitScatter(0.0, scatter), Streams(3), 500)
    x = np.repeat(np.arange(-2.0, 3.0) / 2, BESR.valid_hits)  # half width of the fit
    design = np.vander(x, 4, increasing=True)
    slope_variance = scatter**2 * np.linalg.inv(design.T @ design)[1, 1]
    lift = slope_variance / 2 / (BEND * INCH**2)
    assert bias < lift - 2 * se


def test_hit_scatter_and_the_effect_of_the_aim_add_up_to_the_observed_scatter() -> None:
    rules = rehearsal(BESR)
    hit_scatter = rules.hit_scatter(ALONG, 3e-3)
    at = TOP + np.linspace(-1, 1, 9) * INCH
    slope = -BEND * (at - TOP)  # curvature of e_A + 1/2
    assert hit_scatter.along == ALONG
    assert hit_scatter.scatter**2 + np.mean((slope * ALONG) ** 2) == pytest.approx(9e-6, rel=1e-9)
    assert rules.hit_scatter(ALONG, 0.0).scatter == 0


def test_a_swung_bat_is_read_by_the_balls_speed_back_alone() -> None:
    """If all positions give the same rebound, the impact position does not matter."""
    speed, turn_rate = BESR.ball_speed, 45.0
    axis = float(BAT.length) - BESR.pivot_from_knob

    def even(place: np.ndarray) -> np.ndarray:
        bat_speed = turn_rate * (axis - place)
        e_a = (40.0 - bat_speed) / (speed + bat_speed)
        return np.array([e_a, np.full_like(place, 0.25), np.full_like(place, 0.5)])

    swung = replace(rehearsal(BESR, turn_rate=turn_rate), curve=even)
    at = np.linspace(4, 8, 9) * INCH
    assert swung.metric(at, 2e-3) == pytest.approx(swung.metric(at), rel=1e-12)


def test_the_error_of_a_laboratory_depends_only_on_its_number() -> None:
    rules, hit_scatter = rehearsal(BESR), HitScatter(ALONG, 2e-3)
    errors = rules.errors(hit_scatter, Streams(5), np.array([0, 1, 2]))
    assert len({*errors.tolist()}) == 3
    assert (
        rules.errors(hit_scatter, Streams(5), np.array([2, 0])).tolist() == errors[[2, 0]].tolist()
    )
