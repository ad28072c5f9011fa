"""Catalog entries without a publication: their computed properties are plausible."""

from math import gamma, pi, sqrt

import numpy as np
import pytest

from tests.laboratories import certify
from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.measurement.reduction.kinematics import (
    recoil_factor_pivoted,
    restitution_from_efficiency,
)
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.ball import wall_contact
from virtual_lab.simulation.physics.beam import Free, Pinned, beam_of
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.simulation.stations.rig import Reality
from virtual_lab.units import INCH, MPH, OUNCE, OZ_IN2

PIVOT = 6 * INCH
SPEED = 60 * MPH


@pytest.mark.parametrize(
    ("bat", "ounces", "first_mode"),
    [("softball-34", (28, 30), (150, 240)), ("softball-wood-34", (28, 34), (140, 200))],
)
def test_a_softball_bat_has_usual_properties(
    bat: str, ounces: tuple[float, float], first_mode: tuple[float, float]
) -> None:
    """34 in long, 2.25 in thick and 7000 to 10 000 oz in² about 6 in from the knob."""
    body = catalog.load_bat(bat).spec.body
    beam = beam_of(body)
    assert beam.length == pytest.approx(34 * INCH)
    assert max(body.profile.outer_diameter) == pytest.approx(2.25 * INCH)
    assert ounces[0] - 0.5 < beam.mass / OUNCE < ounces[1]
    assert 7000 < beam.inertia(beam.length - PIVOT) / OZ_IN2 < 10_000
    assert first_mode[0] < modes_of(body, Free(), 1).bending_frequencies[0] < first_mode[1]
    if body.profile.wall is not None:
        assert body.hoop is not None
        assert 1000 <= body.hoop.frequency <= 2500


def test_a_softball_touches_a_wall_for_about_a_millisecond() -> None:
    """The oracle is a linear loading and a steep unloading branch, by the gamma function."""
    ball = catalog.load("balls", "softball-slowpitch", BallSpec).spec
    assert 6.25 < ball.mass / OUNCE < 7
    assert 2 * pi * ball.radius / INCH == pytest.approx(12, abs=0.05)
    e0 = float(ball.restitution.at(SPEED))
    assert e0 <= 0.44
    n = 2 / e0**2  # exponent of the unloading work: that of the force plus one
    deepest = SPEED * sqrt(ball.mass / ball.stiffness)
    time = deepest / SPEED * pi / 2
    time += deepest / (e0 * SPEED) * sqrt(pi) * gamma(1 + 1 / n) / gamma(1 / 2 + 1 / n)
    assert 1.0e-3 < time < 1.5e-3
    arguments = (ball.mass, SPEED, ball.stiffness, ball.exponent, e0)
    assert float(wall_contact(*(np.array(x) for x in arguments)).time) == pytest.approx(
        time, rel=1e-9
    )


def test_a_hollow_softball_bat_beats_a_wooden_one() -> None:
    """The trampoline effect adds over a sixth; the BPF of a legal bat is near the limit of 1.20."""
    peaks = {bat: float(_factors(bat, np.arange(5, 8, 0.25)).max()) for bat in _SOFTBALL_BATS}
    assert peaks["softball-34"] / peaks["softball-wood-34"] > 1 + 1 / 6
    assert 1.1 < peaks["softball-34"] < 1.25
    assert 0.9 < peaks["softball-wood-34"] < 1.05


_SOFTBALL_BATS = ("softball-34", "softball-wood-34")


def _factors(bat: str, z_in: np.ndarray, ball: str = "softball-slowpitch") -> np.ndarray:
    """Return the BPF of a pivoted bat at 60 mph, shape of `z_in`."""
    spec, body = catalog.load("balls", ball, BallSpec).spec, catalog.load_bat(bat).spec.body
    beam = beam_of(body)
    axis, z = beam.length - PIVOT, np.asarray(z_in) * INCH
    scenes = Scenes.with_ball(spec, impact_position=z, relative_speed=np.full(z.shape, SPEED))
    efficiency = ModalModel.of(body, Pinned(axis)).collide(scenes).collision_efficiency
    r = recoil_factor_pivoted(spec.mass, beam.inertia(axis), axis - z)
    return np.asarray(restitution_from_efficiency(efficiency, r)) / spec.restitution.at(SPEED)


def test_the_check_cylinder_is_nearly_rigid() -> None:
    """A rigid mass has e = e0 (BPF 1); the oracle is a uniform round bar."""
    body = catalog.load_bat("check-cylinder").spec.body
    beam, length, radius = beam_of(body), body.length, body.profile.outer_diameter[0] / 2
    mass = 7850 * pi * radius**2 * length
    assert beam.mass == pytest.approx(mass, rel=1e-12)
    inertia = mass * (length**2 / 12 + radius**2 / 4)
    assert beam.inertia_cm == pytest.approx(inertia, rel=1e-12)
    slender = 4.7300**2 / (2 * pi * length**2) * radius / 2 * sqrt(205e9 / 7850)
    first = modes_of(body, Free(), 1).bending_frequencies[0]
    assert 0.97 * slender < first < slender  # effect of rotary inertia and shear: 1 to 2 % lower
    arm = length / 2 - PIVOT
    percussion = length - PIVOT - (arm + inertia / mass / arm)
    assert percussion == pytest.approx(0.2242 * length, abs=0.3 * INCH)  # node of the first mode
    for ball in ("baseball-2003", "softball-slowpitch"):
        factor = _factors("check-cylinder", np.array([percussion / INCH]), ball)[0]
        assert factor == pytest.approx(1, abs=0.01)


def test_the_impact_rig_finds_the_check_cylinder_rigid() -> None:
    """From noiseless gates and encoder: e = e0, and e_A = (e0 - r) / (1 + r)."""
    tested = certify("check-cylinder", procedure="astm-f1881", reality=Reality.IDEAL, seed=0)
    quantities = {name: budget.value for name, budget in tested.certification.quantities.items()}
    assert quantities["bat_performance_factor"] == pytest.approx(1, abs=0.01)
    r, e0 = quantities["recoil_factor"], quantities["ball_restitution"]
    assert quantities["collision_efficiency"] == pytest.approx((e0 - r) / (1 + r), abs=0.01 * e0)
