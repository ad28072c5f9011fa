"""Modes against closed forms that involve no finite elements."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ive, jv, kve, yv

from tests.simulation.physics.bodies import rod
from virtual_lab.catalog.specs import BatBody, HoopMode
from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned, Support, beam_of
from virtual_lab.simulation.physics.modes import barrel_nodes, modes_of

Floats = NDArray[np.float64]
BAT = rod((0.06, 0.065, 0.03, 0.025), 0.86)
NEEDLE = 6e-3  # diameter [m]: in a thinner rod, rounding exceeds shear and rotary inertia
# Rounding error: grows with the ratio of the stiffest to the softest mode; worst in a needle.
COARSE = 0.25


def slender(diameter: float = NEEDLE) -> BatBody:
    return rod((diameter, diameter), shear_modulus=1e10)


def thinnest(measured: Callable[[float], Floats]) -> Floats:
    """Return the limit of zero thickness from two needles; shear and rotary inertia go with d²."""
    return (4 * measured(NEEDLE) - measured(2 * NEEDLE)) / 3


def euler_unit(body: BatBody) -> float:
    """Return sqrt(E I / rho A) of the thick end [rad m^2 / s]."""
    d = body.profile.outer_diameter[-1]
    return float(np.sqrt(body.material.youngs_modulus / body.material.density) * d / 4)


@pytest.mark.parametrize(
    ("support", "roots"),
    [
        (Free(), [4.730041, 7.853205, 10.995608]),
        (Clamped(0.0), [1.875104, 4.694091, 7.854757]),
        (Pinned(0.0), [3.926602, 7.068583, 10.210176]),
    ],
)
def test_needle_has_the_roots_of_euler_and_bernoulli(support: Support, roots: list[float]) -> None:
    def measured(diameter: float) -> Floats:
        body = slender(diameter)
        modes = modes_of(body, support, 3, element_size=COARSE)
        return np.sqrt(modes.angular_frequencies[modes.rigid :] / euler_unit(body))

    assert thinnest(measured) == pytest.approx(roots, rel=5e-6)


def test_free_conical_bar_has_the_roots_of_its_bessel_functions() -> None:
    """The deflection is J2(s)/s^2 and its kin, with s = 2 k sqrt(x), x from the apex of the cone.

    The bending moment is proportional to s^4 (J4, Y4, I4, K4), the shear force to s^3 (J3, Y3, I3,
    -K3); both are zero at both ends of the bar, at x = 0.4 and 1.
    """

    def determinant(end: float) -> float:
        rows = []
        for s in (end * np.sqrt(0.4), end):
            rows.append([jv(4, s), yv(4, s), ive(4, s), kve(4, s)])
            rows.append([jv(3, s), yv(3, s), ive(3, s), -kve(3, s)])
        # factors exp(s) and exp(-s) that the scaled functions omit: difference of the ends
        grow = np.exp(end * (1 - np.sqrt(0.4)))
        matrix = np.array(rows)
        matrix[:2, 2] /= grow
        matrix[2:, 3] /= grow
        return float(np.linalg.det(matrix))

    grid = np.linspace(5.0, 40.0, 400)
    signs = np.sign([determinant(s) for s in grid])
    first = np.flatnonzero(signs[:-1] != signs[1:])[:3]
    exact = np.array([brentq(determinant, grid[i], grid[i + 1]) for i in first]) ** 2 / 4

    def measured(diameter: float) -> Floats:
        body = rod((0.4 * diameter, diameter), 0.6, shear_modulus=1e10)
        modes = modes_of(body, Free(), 3, order=8, element_size=COARSE)
        return modes.angular_frequencies[2:] / euler_unit(body)

    assert thinnest(measured) == pytest.approx(exact, rel=1e-5)


def timoshenko_free_free(body: BatBody, count: int) -> list[float]:
    """Return the first angular frequencies of a uniform free beam from its own determinant.

    Waves exp(c x) of w and psi satisfy ``k (c^2 w + c psi) + m f^2 w = 0`` and ``B c^2 psi - k (c w
    + psi) + j f^2 psi = 0``; at both ends psi' = 0 and w' + psi = 0.
    """
    length, d, of = body.length, body.profile.outer_diameter[0], body.material
    area, second = np.pi / 4 * d**2, np.pi / 64 * d**4
    k, B = of.shear_coefficient * of.shear_modulus * area, of.youngs_modulus * second
    m, j = of.density * area, of.density * second

    def determinant(f: float) -> float:
        # characteristic equation (k c^2 + m f^2)(B c^2 - k + j f^2) + k^2 c^2 = 0
        wave, grow = sorted(
            np.roots([k * B, k * j * f**2 + m * f**2 * B, m * f**2 * (j * f**2 - k)]).real
        )
        p, q = np.sqrt(-wave), np.sqrt(grow)
        # amplitudes: psi of w = cos px is (p - m f^2 / (k p)) sin px, and so on
        P, Q = p - m * f**2 / (k * p), -(q + m * f**2 / (k * q))
        rows = []
        for x in (0.0, length):
            c, s, ch, sh = np.cos(p * x), np.sin(p * x), np.cosh(q * x), np.sinh(q * x)
            rows.append([P * p * c, P * p * s, Q * q * ch, Q * q * sh])
            rows.append([(P - p) * s, (p - P) * c, (Q + q) * sh, (Q + q) * ch])
        return float(np.linalg.det(np.array(rows)))

    grid = np.linspace(50.0, 45_000.0, 3000)  # range below the cut-off of shear waves
    signs = np.sign([determinant(f) for f in grid])
    crossings = np.flatnonzero(signs[:-1] != signs[1:])[:count]
    return [brentq(determinant, grid[i], grid[i + 1], xtol=1e-9, rtol=1e-14) for i in crossings]


def test_stocky_rod_has_the_roots_of_timoshenkos_equation() -> None:
    body = rod((0.1, 0.1))
    exact = timoshenko_free_free(body, 6)
    modes = modes_of(body, Free(), 6)
    assert modes.angular_frequencies[2:] == pytest.approx(exact, rel=1e-8)
    # margin: Euler and Bernoulli's beam would fail this comparison
    assert exact[0] < 0.95 * 4.730041**2 * euler_unit(body)


def test_frequencies_converge_at_twice_the_order() -> None:
    body = rod((0.1, 0.1))
    exact = timoshenko_free_free(body, 4)[3]
    sizes = 1 / np.array([8, 12, 16])
    errors = [
        modes_of(body, Free(), 4, order=4, element_size=size).angular_frequencies[5] / exact - 1
        for size in sizes
    ]
    orders = np.diff(np.log(errors)) / np.diff(np.log(sizes))
    print("order 4 elements, observed order of the frequency:", orders)
    assert orders == pytest.approx([8, 8], abs=0.3)


@pytest.mark.parametrize("support", [Free(), Pinned(0.7), Clamped(0.8)])
def test_modes_are_orthonormal_and_rigid_ones_exact(support: Support) -> None:
    beam, modes = beam_of(BAT, support), modes_of(BAT, support, 20)
    vectors = np.concatenate((modes.deflections, modes.rotations))
    gram = vectors.T @ beam.mass_matrix @ vectors
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-12
    assert modes.rigid == {Free: 2, Pinned: 1, Clamped: 0}[type(support)]
    assert np.all(modes.angular_frequencies[: modes.rigid] == 0)
    assert np.all(np.diff(modes.angular_frequencies[modes.rigid :]) > 0)


def test_free_rigid_modes_are_heave_and_pitch_about_the_centre_of_mass() -> None:
    beam, modes = beam_of(BAT), modes_of(BAT, Free(), 1)
    z = np.linspace(0, 0.86, 7)
    heave, pitch = modes.shape(z)[:, 0], modes.shape(z)[:, 1]
    assert heave == pytest.approx(np.full(7, beam.mass**-0.5), rel=1e-13)
    assert pitch == pytest.approx((beam.z_cm - z) / np.sqrt(beam.inertia_cm), abs=1e-12)
    assert modes.rotation(0.3)[1] == pytest.approx(beam.inertia_cm**-0.5, rel=1e-12)


def test_pinned_bat_turns_about_the_pin_and_nothing_moves_there() -> None:
    beam, modes = beam_of(BAT, Pinned(0.7)), modes_of(BAT, Pinned(0.7), 5)
    assert np.all(np.abs(modes.shape(0.7)) < 1e-15)
    assert modes.shape(0.1)[0] == pytest.approx(0.6 / np.sqrt(beam.inertia(0.7)), rel=1e-13)
    assert np.all(np.abs(modes.rotation(0.7)[1:]) > 0.1)  # ringing of an encoder


def test_clamped_bat_neither_moves_nor_turns_there() -> None:
    modes = modes_of(BAT, Clamped(0.8), 5)
    assert np.all(modes.shape(0.8) == 0)
    assert np.all(modes.rotation(0.8) == 0)


def test_rotation_is_the_slope_of_a_needle() -> None:
    modes = modes_of(slender(NEEDLE / 3), Free(), 2)  # needle in which shear adds 2e-5 to a slope
    slope = (modes.shape(0.3 + 1e-5) - modes.shape(0.3 - 1e-5)) / 2e-5
    turned = modes.rotation(0.3)
    assert turned == pytest.approx(-slope, rel=1e-4, abs=1e-6 * np.abs(turned).max())


def test_the_nodes_of_a_uniform_rod_are_the_textbook_ones() -> None:
    # textbook values: 0.2242 and 0.1321 of the length
    assert barrel_nodes(modes_of(slender(), Free(), 2)) == pytest.approx(
        (0.224157, 0.132110), abs=2e-5
    )


def test_a_turned_bat_has_turned_modes() -> None:
    turned = rod((0.025, 0.03, 0.065, 0.06), 0.86)
    one, two = modes_of(BAT, Free(), 6), modes_of(turned, Free(), 6)
    assert one.angular_frequencies == pytest.approx(two.angular_frequencies, rel=1e-7, abs=0)
    assert one.shape(0.1) ** 2 == pytest.approx(two.shape(0.76) ** 2, rel=1e-5, abs=1e-8)


def test_hoop_mode_comes_last_and_turns_nothing() -> None:
    modes = modes_of(rod(hoop=HoopMode(frequency=2000, modal_mass=0.25)), Free(), 4)
    assert modes.count == 7
    assert modes.angular_frequencies[-1] == pytest.approx(2 * np.pi * 2000)
    assert modes.shape(np.array([0.1, 0.4]))[:, -1] == pytest.approx([2.0, 2.0])
    assert modes.rotation(0.9)[-1] == 0
    assert len(modes.bending_frequencies) == 4


def test_first_and_above_divide_the_modes() -> None:
    modes = modes_of(rod(hoop=HoopMode(frequency=2000, modal_mass=0.25)), Free(), 6)
    first, above = modes.first(4), modes.above(4)
    assert (first.count, above.count) == (2 + 4 + 1, 2)
    assert above.bending_frequencies == pytest.approx(modes.bending_frequencies[4:])
    assert np.array_equal(above.shape(0.2), modes.shape(0.2)[6:8])


def test_shapes_broadcast_over_positions() -> None:
    modes = modes_of(BAT, Free(), 3)
    assert modes.shape(np.zeros((2, 4))).shape == (2, 4, 5)
    assert modes.rotation(0.5).shape == (5,)


@pytest.mark.parametrize("z", [-1e-9, 0.8600001, float("nan")])
def test_positions_off_the_bat_are_refused(z: float) -> None:
    with pytest.raises(InputError, match=r"0 to 0\.86 m"):
        modes_of(BAT, Free(), 2).shape(z)


def test_more_modes_than_the_mesh_has_are_refused() -> None:
    with pytest.raises(InputError, match="bending"):
        modes_of(BAT, Free(), 10_000)


def test_a_stiff_rod_bounces_on_its_spring_as_a_rigid_body() -> None:
    """On one pivot spring k the rotation is free, and the other mode has w^2 = k / M_eff."""
    body = rod((0.05, 0.06), youngs_modulus=1e13, shear_modulus=4e12)
    beam, modes = beam_of(body), modes_of(body, Pinned(0.8, 1e4), 2)
    inverse_mass = 1 / beam.mass + (0.8 - beam.z_cm) ** 2 / beam.inertia_cm
    assert modes.rigid == 1
    assert modes.angular_frequencies[1] ** 2 == pytest.approx(1e4 * inverse_mass, rel=1e-3)


@pytest.mark.parametrize("stiffness", [1e4, 1e7, 1e10])
def test_modes_over_a_spring_are_orthonormal_and_hold_its_energy(stiffness: float) -> None:
    support = Pinned(0.7, stiffness)
    beam, modes = beam_of(BAT, support), modes_of(BAT, support, 12)
    vectors = np.concatenate((modes.deflections, modes.rotations))
    gram = vectors.T @ beam.mass_matrix @ vectors
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-12
    at = modes.shape(0.7)
    energy = vectors.T @ beam.stiffness_matrix @ vectors + stiffness * np.outer(at, at)
    squares = modes.angular_frequencies**2
    assert np.abs(energy - np.diag(squares)).max() < 1e-7 * squares.max()


def test_a_pivot_spring_tends_to_the_free_and_the_pinned_bat() -> None:
    """The gap to a pinned bat's frequencies is proportional to 1/k, that to a free bat's to k."""
    rigid = modes_of(BAT, Pinned(0.7), 4).angular_frequencies[1:]
    free = modes_of(BAT, Free(), 4).angular_frequencies[2:]

    def gap(stiffness: float) -> float:
        frequencies = modes_of(BAT, Pinned(0.7, stiffness), 5).angular_frequencies
        against = rigid if stiffness > 1e7 else free
        selection = frequencies[1:5] if stiffness > 1e7 else frequencies[2:]
        return float(np.abs(selection / against - 1).max())

    assert gap(1e11) == pytest.approx(gap(1e10) / 10, rel=0.05)
    assert gap(1e2) == pytest.approx(gap(1e3) / 10, rel=0.05)
    assert max(gap(1e11), gap(1e2)) < 1e-3


@pytest.mark.parametrize("stiffness", [0.0, -1.0, float("nan"), 1e-12])
def test_a_pivot_without_stiffness_is_refused(stiffness: float) -> None:
    with pytest.raises(InputError, match="stiffness"):
        modes_of(rod(youngs_modulus=1e15), Pinned(0.7, stiffness), 2)


@pytest.mark.parametrize("youngs_modulus", [1e10, 1e13, 1e15])
def test_the_smallest_stiffness_is_in_the_message_and_sufficient(youngs_modulus: float) -> None:
    """From this stiffness on the bounce is that of a rigid bat on its spring: w^2 = k / M_eff."""
    body = rod(youngs_modulus=youngs_modulus, shear_modulus=0.4 * youngs_modulus)
    beam = beam_of(body, Pinned(0.7))
    inverse_mass = 1 / beam.mass + (0.7 - beam.z_cm) ** 2 / beam.inertia_cm
    with pytest.raises(InputError, match=r"allowed: at least \d\S* N/m") as refused:
        modes_of(body, Pinned(0.7, 1e-12), 2)
    least = float(str(refused.value).split("at least ")[1].split()[0])
    with pytest.raises(InputError, match="stiffness"):
        modes_of(body, Pinned(0.7, 0.99 * least), 2)
    bounce = modes_of(body, Pinned(0.7, 1.01 * least), 2).angular_frequencies[1] ** 2
    assert bounce == pytest.approx(1.01 * least * inverse_mass, rel=1e-2)
