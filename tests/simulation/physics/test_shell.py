"""The hoop mode of a hollow bat against closed forms, and against a shell that may also stretch."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigh

from tests.simulation.physics.bodies import rod
from virtual_lab.catalog import load_bat
from virtual_lab.catalog.specs import BatBody
from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.beam import outer_diameter, wall_thickness
from virtual_lab.simulation.physics.shell import Cap, shell_mode
from virtual_lab.units import INCH

Floats = NDArray[np.float64]
MODULUS, DENSITY, OUTER, WALL = 70e9, 2800.0, 0.066, 0.003
RADIUS = (OUTER - WALL) / 2


def tube(length: float, poisson: float) -> BatBody:
    return rod(
        (OUTER, OUTER),
        length,
        wall=WALL,
        density=DENSITY,
        youngs_modulus=MODULUS,
        shear_modulus=MODULUS / 2 / (1 + poisson),
    )


def ring_square(modulus: float) -> float:
    """Return ω² of a free ring, n²(n² - 1)²/(n² + 1) EI/(μR⁴) with n = 2 (Hoppe; Rayleigh)."""
    stiffness, mass = modulus * WALL**3 / 12, DENSITY * WALL
    return 4 * 9 / 5 * stiffness / (mass * RADIUS**4)


def test_a_tube_without_poissons_ratio_is_a_free_ring() -> None:
    mode = shell_mode(tube(0.8, poisson=0.0), "open")
    assert (2 * np.pi * mode.frequency) ** 2 == pytest.approx(ring_square(MODULUS), rel=1e-7)
    assert mode.shape == pytest.approx(np.ones_like(mode.shape), abs=1e-5)
    mass = DENSITY * 2 * np.pi * RADIUS * WALL * 0.8
    assert mode.modal_mass == pytest.approx(5 / 8 * mass, rel=1e-5)


def test_the_wall_of_a_capped_tube_twists() -> None:
    """W = sin(qz) with qL = π/2 adds the twist to a free ring: D (9/2) (q/a)² / (5/4 ρh)."""
    for length, error in ((1.4, 0.05), (5.6, 0.005)):
        q = np.pi / 2 / length
        twist = MODULUS * WALL**3 / 12 * 9 / 2 * (q / RADIUS) ** 2 / (1.25 * DENSITY * WALL)
        square = (2 * np.pi * shell_mode(tube(length, poisson=0.0)).frequency) ** 2
        assert square - ring_square(MODULUS) == pytest.approx(twist, rel=error)


def test_a_long_tube_is_a_ring_that_cannot_curve_along_its_axis() -> None:
    """Its modulus is E/(1 - ν²). Only the free ends curve, which lowers the frequency a little."""
    poisson = 0.3
    square = (2 * np.pi * shell_mode(tube(3.0, poisson), "open").frequency) ** 2
    assert -3e-4 < square / ring_square(MODULUS / (1 - poisson**2)) - 1 < 0


def stretching_shell(body: BatBody, cap: Cap, z: Floats) -> tuple[float, Floats]:
    """Return the frequency [Hz] of a thin shell with n = 2, and its modal masses at `z` [kg].

    Rayleigh and Ritz with three free fields, u cos 2θ, v sin 2θ and w cos 2θ, and the strains of
    Sanders: the circumference may stretch, and the wall may shear. The radius is the local one.
    The fields are powers of the position (Legendre's polynomials) over the whole bat.
    """
    count, n = 24, 2
    x, gauss = np.polynomial.legendre.leggauss(200)
    half = body.length / 2
    place, weight = half * (1 + x), half * gauss

    def basis(position: Floats, derivative: int) -> Floats:
        one = np.polynomial.Legendre
        return (
            np.stack([one.basis(k).deriv(derivative)(position) for k in range(count)], axis=1)
            / half**derivative
        )

    h = wall_thickness(body.profile, place)
    a = (outer_diameter(body.profile, place) - h) / 2
    modulus = body.material.youngs_modulus
    poisson = modulus / (2 * body.material.shear_modulus) - 1
    membrane = modulus * h / (1 - poisson**2)
    f, f1, f2 = (basis(x, derivative) for derivative in range(3))
    o, r = np.zeros_like(f), a[:, None]
    along, around = np.hstack((f1, o, o)), np.hstack((o, n * f, f)) / r
    shear = np.hstack((-n * f / r, f1, o))
    curved, oval = np.hstack((o, o, -f2)), np.hstack((o, n * f, n**2 * f)) / r**2
    twist = np.hstack((n * f / (4 * r**2), 0.75 * f1 / r, n * f1 / r))

    def energy(density: Floats, left: Floats, right: Floats) -> Floats:
        return np.asarray((left * (np.pi * a * weight * density)[:, None]).T @ right)

    stiffness = energy(membrane * (1 - poisson) / 2, shear, shear)
    stiffness += energy(membrane * h**2 / 12 * 2 * (1 - poisson), twist, twist)
    for density, first, second in (
        (membrane, along, around),
        (membrane * h**2 / 12, curved, oval),
    ):
        both = energy(poisson * density, first, second)
        stiffness += energy(density, first, first) + energy(density, second, second) + both + both.T
    mass = sum(
        energy(body.material.density * h, field, field)
        for field in (np.hstack((f, o, o)), np.hstack((o, f, o)), np.hstack((o, o, f)))
    )
    tip = basis(np.array([-1.0]), 0)[0]
    rows = np.zeros((2, 3 * count))
    rows[0, count : 2 * count] = rows[1, 2 * count :] = tip
    allowed = np.eye(3 * count)
    if cap == "rigid":
        allowed = np.linalg.svd(rows)[2][2:].T
    squares, vectors = eigh(
        allowed.T @ stiffness @ allowed, allowed.T @ mass @ allowed, subset_by_index=[0, 0]
    )
    w = basis(z / half - 1, 0) @ (allowed @ vectors[:, 0])[2 * count :]
    return float(np.sqrt(squares[0]) / (2 * np.pi)), w**-2.0


@pytest.mark.parametrize(
    ("bat", "cap", "deviation"),
    [("ea70", "rigid", 0.013), ("ea70", "open", 0.005), ("softball-34", "rigid", 0.003)],
)
def test_a_shell_that_may_stretch_and_shear_is_little_softer(
    bat: str, cap: Cap, deviation: float
) -> None:
    body = load_bat(bat).spec.body
    z = np.array([4.0, 5.0, 6.0]) * INCH
    softer, masses = stretching_shell(body, cap, z)
    mode = shell_mode(body, cap)
    assert mode.frequency / softer - 1 == pytest.approx(deviation, abs=5e-4)
    if cap == "rigid":
        assert np.interp(z, mode.z, mode.modal_masses) == pytest.approx(masses, rel=0.045)


def test_a_solid_bat_has_no_hoop_mode() -> None:
    with pytest.raises(InputError, match="allowed: a hollow bat"):
        shell_mode(load_bat("r161").spec.body)
