"""Rigid-body properties against elementary integrals."""

from dataclasses import replace

import numpy as np
import pytest

from tests.simulation.physics.bodies import rod
from virtual_lab.catalog.specs import Lump, Profile
from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.beam import Clamped, Pinned, beam_of, outer_diameter


def test_a_solid_rod_has_the_textbook_properties() -> None:
    beam = beam_of(rod((0.05, 0.05), 0.9))
    mass = 700 * np.pi / 4 * 0.05**2 * 0.9
    assert beam.mass == pytest.approx(mass, rel=1e-13)
    assert beam.z_cm == pytest.approx(0.45, rel=1e-13)
    assert beam.inertia_cm == pytest.approx(mass * (0.9**2 / 12 + 0.05**2 / 16), rel=1e-12)


def test_a_tube_has_the_textbook_properties() -> None:
    beam = beam_of(rod((0.06, 0.06), 0.9, wall=0.003))
    mass = 700 * np.pi / 4 * (0.06**2 - 0.054**2) * 0.9
    assert beam.mass == pytest.approx(mass, rel=1e-13)
    rotary = (0.06**2 + 0.054**2) / 16
    assert beam.inertia_cm == pytest.approx(mass * (0.9**2 / 12 + rotary), rel=1e-12)


def test_a_truncated_cone_has_the_integrated_properties() -> None:
    # oracle: exact integrals of polynomials, not the beam's quadrature
    d = np.polynomial.Polynomial([0.06, -0.03])
    z = np.polynomial.Polynomial([0.0, 1.0])
    area, second = 700 * np.pi / 4 * d**2, 700 * np.pi / 64 * d**4
    mass, first, turning = (
        float(density.integ()(1.0)) for density in (area, area * z, area * z**2 + second)
    )
    beam = beam_of(rod((0.06, 0.03)))
    assert beam.mass == pytest.approx(mass, rel=1e-13)
    assert beam.z_cm == pytest.approx(first / mass, rel=1e-13)
    assert beam.inertia(0.0) == pytest.approx(turning, rel=1e-12)
    assert beam.inertia_cm == pytest.approx(turning - first**2 / mass, rel=1e-11)


def test_lumps_add_mass_moment_and_both_inertias() -> None:
    bare = beam_of(rod())
    beam = beam_of(rod(lumps=(Lump(name="knob", z=0.93, mass=0.1, inertia=2e-4),)))
    assert beam.mass - bare.mass == pytest.approx(0.1, rel=1e-12)
    assert beam.mass * beam.z_cm - bare.mass * bare.z_cm == pytest.approx(0.093, rel=1e-12)
    assert beam.inertia(0.2) - bare.inertia(0.2) == pytest.approx(0.1 * 0.73**2 + 2e-4, rel=1e-11)


def test_parallel_axes_hold_within_one_mass_matrix() -> None:
    beam = beam_of(rod((0.06, 0.065, 0.03, 0.025)), Pinned(0.8))
    about = beam.inertia_cm + beam.mass * (0.8 - beam.z_cm) ** 2
    assert beam.inertia(0.8) == pytest.approx(about, rel=1e-13)


def test_density_tilt_moves_the_centre_of_mass_toward_the_tip_only() -> None:
    straight = rod()
    beam = beam_of(replace(straight, material=replace(straight.material, density_tilt=0.01)))
    # first moment of rho (1 + t (1 - 2 z)) over a uniform rod of unit length
    assert beam.mass == pytest.approx(beam_of(rod()).mass, rel=1e-13)
    assert beam.z_cm == pytest.approx(0.5 - 0.01 / 6, rel=1e-12)


def test_outline_never_overshoots_its_stations() -> None:
    profile = Profile(z=(0.0, 0.2, 0.5, 0.9), outer_diameter=(0.06, 0.06, 0.025, 0.025))
    d = outer_diameter(profile, np.linspace(0, 0.9, 500))
    assert d.max() <= 0.06
    assert d.min() >= 0.025
    assert np.all(np.diff(d) <= 1e-15)


@pytest.mark.parametrize("support", [Pinned(-0.01), Pinned(1.01), Clamped(float("nan"))])
def test_a_support_off_the_bat_is_refused(support: Pinned | Clamped) -> None:
    with pytest.raises(InputError, match="0 to 1 m"):
        beam_of(rod(), support)


def test_low_orders_are_refused() -> None:
    with pytest.raises(InputError, match="order = 3"):
        beam_of(rod(), order=3)
