"""Scenes that several tests share."""

from collections.abc import Iterable

import numpy as np

from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.units import INCH, MPH, OUNCE


def usual(z_inches: float | Iterable[float], **other: object) -> Scenes:
    """Return scenes of an ordinary ball at `z_inches`, with the values in `other` replaced."""
    values: dict[str, object] = {
        "impact_position": np.asarray(z_inches, dtype=float) * INCH,
        "relative_speed": 160 * MPH,
        "ball_mass": 5.125 * OUNCE,
        "ball_restitution": 0.5,
        "stiffness": 3.5e6,
        "exponent": 1.0,
    }
    return Scenes.of(**(values | other))  # type: ignore[arg-type]


def scattered(count: int, low: float, high: float, seed: int) -> Scenes:
    """Return random scenes between two positions [in]: random speed, ball and force law."""
    rng = np.random.default_rng(seed)
    exponent = rng.uniform(1, 2, count)
    return Scenes.of(
        impact_position=rng.uniform(low, high, count) * INCH,
        relative_speed=rng.uniform(40, 180, count) * MPH,
        ball_mass=rng.uniform(5, 5.25, count) * OUNCE,
        ball_restitution=rng.uniform(0.4, 0.6, count),
        # force at 12 mm: the same for every exponent, so that contacts last 0.6 to 1 ms
        stiffness=3.5e6 * 0.012 ** (1 - exponent),
        exponent=exponent,
    )
