import numpy as np
import pytest

from virtual_lab.simulation.physics.mesh import mesh_through, reference_element


@pytest.mark.parametrize("order", [4, 8, 11])
def test_interpolates_polynomials_up_to_its_order_exactly(order: int) -> None:
    mesh = mesh_through((0.0, 0.31, 1.0), (0.0, 1.0), size=0.4, order=order)
    z = np.random.default_rng(1).uniform(0, 1, (50, 1))
    for power, exact in ((order, True), (order + 1, False)):
        gap = mesh.interpolation(z) @ (mesh.nodes - 0.3) ** power - (z[:, 0] - 0.3) ** power
        assert (np.abs(gap).max() < 1e-13) == exact


def test_interpolation_at_the_nodes_returns_the_nodes_own_values() -> None:
    mesh = mesh_through((0.0, 1.0), (0.0, 1.0), size=0.25, order=6)
    at_nodes = mesh.interpolation(mesh.nodes[:, None]).toarray()
    assert np.abs(at_nodes - np.eye(len(mesh.nodes))).max() < 1e-13
    assert np.array_equal(
        mesh.interpolation(mesh.boundaries[:, None]) @ mesh.nodes, mesh.boundaries
    )


def test_weights_sum_over_the_pieces_of_a_row() -> None:
    mesh = mesh_through((0.0, 1.0), (0.0, 1.0), size=0.25, order=6)
    z, weights = np.array([[[0.1, 0.25], [0.6, 0.7]]]), np.array([[[2.0, 1.0], [-1.0, 3.0]]])
    sums = mesh.interpolation(z, weights) @ mesh.nodes**2
    assert sums == pytest.approx([2 * 0.01 + 0.0625 - 0.36 + 3 * 0.49], abs=1e-14)


def test_differentiation_is_exact_for_its_own_polynomials() -> None:
    element = reference_element(7)
    assert element.differentiation @ element.nodes**7 == pytest.approx(
        7 * element.nodes**6, abs=1e-12
    )


def test_fixed_boundaries_are_exact_and_close_ones_are_dropped() -> None:
    pin = 0.1 + 0.2
    mesh = mesh_through((0.0, 0.3 + 1e-6, 0.5, 0.5 + 1e-7, 1.0), (0.0, pin, 1.0), size=1, order=4)
    assert mesh.boundaries.tolist() == [0.0, pin, 0.5, 1.0]
    assert pin in mesh.nodes


def test_no_element_is_longer_than_requested() -> None:
    mesh = mesh_through((0.0, 0.13, 1.0), (0.0, 1.0), size=0.1, order=4)
    assert np.diff(mesh.boundaries).max() <= 0.1 + 1e-12
