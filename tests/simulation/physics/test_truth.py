"""Individuals against their nominal sheets: correlated draws, and the mean of the balls used."""

from dataclasses import replace

import numpy as np
import pytest

from virtual_lab.catalog import load, load_bat
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.simulation.physics.truth import draw_balls, draw_lot, make_bat
from virtual_lab.streams import Streams


@pytest.mark.parametrize("name", ["r161", "ea70"])
def test_both_moduli_of_a_bat_scatter_by_one_factor(name: str) -> None:
    """One draw for both: five bats have the nominal ratio of the moduli, but other moduli."""
    spec = load_bat(name).spec
    drawn = spec.body.material
    for seed in range(5):
        made = make_bat(spec, Streams(seed)).body.material
        stiffer = made.youngs_modulus / drawn.youngs_modulus
        assert abs(stiffer - 1) > 1e-6
        assert made.shear_modulus / drawn.shear_modulus == pytest.approx(stiffer, rel=1e-12)


def test_the_mean_ball_excludes_rejected_balls() -> None:
    """Of balls of 140, 150 and 190 g the last is set aside: 145 g, and likewise for e0."""
    lot = draw_balls(load("balls", "baseball-2003", BallSpec).spec, 3, Streams(1))
    mass, e0 = np.array([0.140, 0.150, 0.190]), np.array([0.54, 0.56, 0.70])
    mask = np.array([True, True, False])
    mean = replace(lot, mass=mass, restitution=e0, used=mask).mean_ball()
    assert mean.mass == pytest.approx([0.145], rel=1e-12)
    assert mean.restitution == pytest.approx([0.55], rel=1e-12)


def test_mass_and_e0_of_a_ball_are_independent() -> None:
    """4000 balls: both scatter as the sheet says (4.5/√8000), and |r| < 4.5/√4000 (7e-6 each)."""
    spec = load("balls", "baseball-2003", BallSpec).spec
    lot = draw_balls(spec, 4000, Streams(2))
    assert lot.mass.std() == pytest.approx(spec.spread.mass, rel=0.05)
    assert lot.restitution.std() == pytest.approx(spec.spread.restitution, rel=0.05)
    assert abs(np.corrcoef(lot.mass, lot.restitution)[0, 1]) < 0.071


def test_lots_of_balls_scatter_as_their_sheet_states() -> None:
    """2000 lots: standard scores normal within 4.5 standard errors, and |r| < 4.5/√2000."""
    spec = load("balls", "baseball-2003", BallSpec).spec
    line = replace(spec.restitution, value_u=0.004)
    spec = replace(spec, restitution=line, stiffness_spread=0.05)
    lots = draw_lot(spec, Streams(5, (), np.arange(2000)))
    z = np.array(
        [
            (lots.restitution.value - 0.55) / 0.004,
            (lots.restitution.slope - line.slope) / line.slope_u,
            (lots.radius - spec.radius) / spec.radius_u,
            (lots.stiffness / spec.stiffness - 1) / 0.05,
        ]
    )
    assert np.abs(z.mean(axis=1)).max() < 4.5 / np.sqrt(2000)
    assert np.abs(z.var(axis=1) - 1).max() < 4.5 * np.sqrt(2 / 2000)
    assert np.abs(np.corrcoef(z) - np.eye(4)).max() < 4.5 / np.sqrt(2000)


def test_balls_scatter_about_the_level_of_their_lot() -> None:
    """Two draws of balls from one lot of level .56: means within 4.5/√4000 of their spread."""
    spec = load("balls", "baseball-2003", BallSpec).spec
    line = replace(spec.restitution, value_u=0.01)
    (level,) = (0.55 + 0.01 * Streams(8).normal("lot.level", 1)).tolist()
    for test in (1, 2):
        balls = draw_balls(
            replace(spec, restitution=line), 4000, Streams(8, (test,)), lot=Streams(8)
        )
        spread = spec.spread.restitution
        assert balls.restitution.mean() == pytest.approx(level, abs=4.5 * spread / np.sqrt(4000))
