"""The surrogate model: e_A of one bat and one type of ball as a Chebyshev interpolant.

It is built on demand from another collision model, over a box of impact position, log speed, e0 and
ball mass. It is refined axis by axis until its error at independent points is small enough. It only
returns e_A, so a rig that needs the vibration of the bat uses the modal model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.scene import CollisionModel, Scenes
from virtual_lab.streams import Streams
from virtual_lab.units import Array

AXES = ("impact_position", "relative_speed", "ball_restitution", "ball_mass")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitting:
    """Settings that determine the number of nodes of an interpolant and its check."""

    line_nodes: int = 48  # nodes on a test line along each axis, which determines its node count
    line_share: float = 0.1  # largest truncation error of a line [share of the tolerance]
    least_nodes: int = 3
    most_nodes: int = 12_000
    check_points: int = 400  # number of points at which the error is measured
    check_seed: int = 20_031  # seed of these points; arbitrary but fixed


FITTING = Fitting()


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """Range of a surrogate: lower and upper limit of each variable, and the ball's force law."""

    impact_position: tuple[float, float]  # [m]
    relative_speed: tuple[float, float]  # [m/s]
    ball_restitution: tuple[float, float]
    ball_mass: tuple[float, float]  # [kg]
    stiffness: float  # [N/m^a]
    exponent: float

    def __post_init__(self) -> None:
        for axis in AXES:
            low, high = getattr(self, axis)
            if not low < high:
                raise InputError(
                    "surrogate", axis, f"{low:g} to {high:g}", "low must be below high"
                )

    @classmethod
    def about(cls, scenes: Scenes) -> Self:
        """Return the smallest box that contains the scenes, widened where all values are equal.

        Raises `InputError` if the scenes have different force laws.
        """

        def side(axis: str, most: float = inf) -> tuple[float, float]:
            values = getattr(scenes, axis)
            low, high = float(values.min()), float(values.max())
            margin = max(0.0, 1e-3 * high - (high - low)) / 2
            return max(low - margin, 0.0), min(high + margin, most)

        box = cls(
            impact_position=side("impact_position"),
            relative_speed=side("relative_speed"),
            ball_restitution=side("ball_restitution", 1.0),
            ball_mass=side("ball_mass"),
            stiffness=float(scenes.stiffness[0]),
            exponent=float(scenes.exponent[0]),
        )
        box.require_law(scenes)
        return box

    def inside(self, scenes: Scenes) -> NDArray[np.bool_]:
        """Return a mask (n,) of the scenes inside the box, with a tolerance for rounding."""
        inside = np.ones(len(scenes), dtype=bool)
        for axis in AXES:
            low, high = getattr(self, axis)
            values, rounding = getattr(scenes, axis), 1e-12 * (high - low)
            inside &= (values >= low - rounding) & (values <= high + rounding)
        return inside

    def unit(self, scenes: Scenes) -> Array:
        """Return the coordinates of the scenes in the box, from -1 to 1, shape (4, n).

        Raises `InputError` if a scene is outside the box or has another force law.
        """
        self.require_law(scenes)
        inside, rows = self.inside(scenes), []
        for axis in AXES:
            low, high = getattr(self, axis)
            values = getattr(scenes, axis)
            if not inside.all() and not low <= (bad := float(values[~inside][0])) <= high:
                raise InputError("surrogate", axis, bad, f"allowed: {low:g} to {high:g}, its box")
            rows.append(_to_unit(axis, np.clip(values, low, high), low, high))
        return np.stack(rows)

    def require_law(self, scenes: Scenes) -> None:
        """Raise `InputError` if a scene has another force law."""
        for law in ("stiffness", "exponent"):
            values = getattr(scenes, law)
            if not np.all(values == getattr(self, law)):
                mismatch = values[values != getattr(self, law)][0]
                raise InputError("surrogate", law, mismatch, f"built for {getattr(self, law):g}")

    def scenes(self, unit: Array) -> Scenes:
        """Return the scenes at coordinates (4, n) in the box, the inverse of `Box.unit`."""
        values = {
            axis: _from_unit(axis, row, *getattr(self, axis))
            for axis, row in zip(AXES, unit, strict=True)
        }
        return Scenes.of(**values, stiffness=self.stiffness, exponent=self.exponent)


@dataclass(frozen=True, slots=True, kw_only=True)
class Surrogate:
    """An interpolant of e_A and its error."""

    box: Box
    coefficients: Array  # coefficients of the products T_i T_j T_k T_l, one axis per variable
    error: float  # largest error of e_A at independent points, relative to the original model
    name: str = "surrogate"

    @classmethod
    def build(cls, model: CollisionModel, box: Box, *, tolerance: float) -> Self:
        """Build a surrogate over `box` with an error of at most `tolerance` in e_A.

        Raises
        ------
        InputError
            Somewhere in the box the ball is reloaded or hits the bat twice, so that e_A is not
            smooth, or the tolerance requires more nodes than `Fitting` allows.
        """

        def value(unit: Array) -> Array:
            return _smooth_efficiency(model, box.scenes(unit))

        check = 2 * Streams(FITTING.check_seed).uniform(
            "surrogate.check", (4, FITTING.check_points)
        )
        true = value(check)
        nodes = _nodes_needed(value, FITTING.line_share * tolerance)
        while True:
            coefficients = _fit(value, nodes)
            error = float(np.abs(_evaluate(coefficients, check) - true).max())
            if error <= tolerance:
                return cls(box=box, coefficients=coefficients, error=error)
            nodes = _refine(coefficients)
            if np.prod(nodes) > FITTING.most_nodes:
                allowed = f"{error:.1e} is reached with {coefficients.size} nodes, the most"
                raise InputError("surrogate", "tolerance", tolerance, allowed)

    def efficiency(self, scenes: Scenes) -> Array:
        """Return e_A of the scenes, (n,). Raises `InputError` outside the box."""
        return _evaluate(self.coefficients, self.box.unit(scenes))


def _smooth_efficiency(model: CollisionModel, scenes: Scenes) -> Array:
    collisions = model.collide(scenes)
    rough = (collisions.reloads > 0) | (collisions.contacts > 1)
    if rough.any():
        place = float(scenes.impact_position[rough][0])
        raise InputError(
            "surrogate", "impact_position", place, "ball and bat re-load here: take the modal model"
        )
    return collisions.collision_efficiency


def _fit(value: Callable[[Array], Array], nodes: tuple[int, ...]) -> Array:
    """Return the Chebyshev coefficients from values at points of the first kind (cosine sums)."""
    from scipy.fft import dctn

    points = [np.cos(np.pi * (np.arange(n) + 0.5) / n) for n in nodes]
    grid = np.stack([axis.ravel() for axis in np.meshgrid(*points, indexing="ij")])
    coefficients = dctn(value(grid).reshape(nodes), type=2) / np.prod(nodes)
    for axis in range(len(nodes)):
        first = [slice(None)] * len(nodes)
        first[axis] = slice(0, 1)
        coefficients[tuple(first)] /= 2
    return np.ascontiguousarray(coefficients)


def _nodes_needed(value: Callable[[Array], Array], tolerance: float) -> tuple[int, ...]:
    """Return the number of nodes each axis needs on the line through the center of the box."""
    from scipy.fft import dctn

    points = np.cos(np.pi * (np.arange(FITTING.line_nodes) + 0.5) / FITTING.line_nodes)
    unit = np.zeros((4, 4, FITTING.line_nodes))
    unit[range(4), range(4)] = points
    cuts = value(unit.reshape(4, -1)).reshape(4, FITTING.line_nodes)
    size = np.abs(dctn(cuts, type=2, axes=(1,))) / FITTING.line_nodes
    beyond = np.cumsum(size[:, ::-1], axis=1)[:, ::-1]  # error if the terms from n on are dropped
    needed = np.maximum(np.sum(beyond > tolerance, axis=1), FITTING.least_nodes)
    fitting = min(1.0, (FITTING.most_nodes / np.prod(needed)) ** 0.25)
    return tuple(int(n) for n in np.maximum(fitting * needed, FITTING.least_nodes))


def _refine(coefficients: Array) -> tuple[int, ...]:
    """Return node counts with more nodes along the axis with the largest last coefficients."""
    size = np.abs(coefficients)
    tails = [
        size.take(range(n - max(1, n // 6), n), axis=axis).max()
        for axis, n in enumerate(size.shape)
    ]
    worst = int(np.argmax(tails))
    return tuple(
        n + 1 + n // 6 if axis == worst else n for axis, n in enumerate(coefficients.shape)
    )


def _evaluate(coefficients: Array, unit: Array) -> Array:
    from virtual_lab.simulation.collision.surrogate_kernel import evaluate_surrogate

    return np.asarray(evaluate_surrogate(coefficients, np.ascontiguousarray(unit)))


def _to_unit(axis: str, values: Array, low: float, high: float) -> Array:
    if axis == "relative_speed":
        values, low, high = np.log(values), np.log(low), np.log(high)
    return (2 * values - low - high) / (high - low)


def _from_unit(axis: str, unit: Array, low: float, high: float) -> Array:
    if axis == "relative_speed":
        return np.asarray(np.exp(_from_unit("", unit, np.log(low), np.log(high))))
    return (low + high + unit * (high - low)) / 2
