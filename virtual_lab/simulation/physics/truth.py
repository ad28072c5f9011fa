"""True values of the individual bat and balls, and the true results of a test.

Only physics, rigs, the laboratory that simulates the test, and the studies may read them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from types import EllipsisType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BallSpec, BatBody, BatSpec
from virtual_lab.simulation.physics.beam import RigidBat, rigid_bat
from virtual_lab.streams import Draws, Owner, Slots, of_owners
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueBat:
    """The true bat on the rig: the body of the data sheet with the material of an individual.

    A block of laboratories has one common bat, or one individual per laboratory. In a specimen of
    shots, `owner` is the index of the individual that each shot hits. For a common bat it is
    `Ellipsis`.
    """

    name: str
    bodies: tuple[BatBody, ...]
    owner: Owner = ...

    @property
    def body(self) -> BatBody:
        """The body of the first individual. All individuals have this shape."""
        return self.bodies[0]

    @property
    def rigid(self) -> RigidBat[Any]:
        """The bat as a rigid body, with values of shape (laboratory,) or, in shots, (shot,)."""
        beams = [rigid_bat(body) for body in self.bodies]
        if len(beams) == 1:
            return beams[0]
        values = np.array([(each.mass, each.first_moment, each.second_moment) for each in beams])
        mass, first, second = values[self.owner].T
        return RigidBat(
            length=self.body.length, mass=mass, first_moment=first, second_moment=second
        )

    def of(self, laboratory: int) -> TrueBat:
        """Return the bat of one laboratory of a block."""
        return self if len(self.bodies) == 1 else replace(self, bodies=(self.bodies[laboratory],))

    def of_shots(self, owner: Owner) -> TrueBat:
        """Return the bats of shots, given the index of the individual of each shot."""
        return self if len(self.bodies) == 1 else replace(self, owner=owner)

    def groups(self, count: int) -> Iterator[tuple[BatBody, NDArray[np.intp] | slice]]:
        """Yield each struck body and the indices of its shots, out of `count` shots."""
        if self.owner is ...:
            yield self.body, slice(count)
            return
        order = np.argsort(self.owner, kind="stable")
        struck, first = np.unique(self.owner[order], return_index=True)
        for number, shots in zip(struck, np.split(order, first[1:]), strict=True):
            yield self.bodies[number], shots


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueBalls:
    """A lot of balls: mass [kg] and e0 at the reference speed of each ball, shape (ball,).

    `spec` holds the true radius and stiffness of the lot, and the true level and slope of its e0.
    In a block of laboratories the arrays are (laboratory, ball), and these four values are
    (laboratory,).
    """

    spec: BallSpec
    mass: Array
    restitution: Array
    used: NDArray[np.bool_] | EllipsisType = ...  # mask of the balls that were not rejected
    # relative humidity of the store of each lot, 0 to 1, (laboratory,); None: no store
    store: Array | None = None

    def of(self, laboratory: int) -> TrueBalls:
        """Return the lot of one laboratory of a block."""
        mask = self.used if self.used is ... else self.used[laboratory]
        return replace(self._of_owners(laboratory), used=mask)

    def of_shots(self, owner: Owner, ball: NDArray[np.int_]) -> TrueBalls:
        """Return a lot of one ball per shot, (shot,): ball `ball` of the laboratory `owner`."""
        return self._of_owners((owner, ball))

    def _of_owners(self, index: Any) -> TrueBalls:
        """Return the balls at `index` of the lots, with the properties of their lots."""
        owner = index[0] if isinstance(index, tuple) else index
        return TrueBalls(
            spec=self.spec if owner is ... else _spec_of_owners(self.spec, owner),
            mass=self.mass[index],
            restitution=self.restitution[index],
            store=None if self.store is None else of_owners(self.store, owner),
        )

    def after_storage(self, humidity: float) -> TrueBalls:
        """Return these balls after a storage of days at another relative humidity, 0 to 1.

        The balls are returned unchanged if their e0 does not depend on the humidity.
        """
        law, line = self.spec.humidity, self.spec.restitution
        if law is None:
            return self
        stored = law.standard if self.store is None else self.store
        factor: Any = law.factor(humidity) / law.factor(stored)
        spec = replace(self.spec, restitution=replace(line, slope=line.slope * factor))
        return replace(self, spec=spec, restitution=self.restitution * factor[..., None])

    def restitution_at(self, ball: NDArray[np.int_] | EllipsisType, speed: Array) -> Array:
        """Return the ball-wall restitution of the balls `ball` at `speed` [m/s], (shot,).

        `ball` holds the index of the ball of each shot, (shot,). If it is Python's `Ellipsis`, the
        lot has one ball per shot.
        """
        line = self.spec.restitution
        return np.maximum(self.restitution[ball] + line.slope * (speed - line.speed), line.floor)

    def draw_hits(
        self,
        ball: NDArray[np.int_] | EllipsisType,
        speed: Array,
        draws: Draws,
        name: str,
        slots: Slots,
        loss: Array | float = 0.0,
    ) -> Array:
        """Return the ball-wall restitution of each hit, (shot,), with its random scatter.

        The scatter is caused by the orientation of the seams. `loss` is the loss of e0 before each
        hit, (shot,).
        """
        scatter = self.spec.spread.hit_restitution * draws.normal(name, slots=slots)
        e0 = self.restitution_at(ball, speed) - loss + scatter
        return np.clip(e0, self.spec.restitution.floor, 1.0)

    def at_bat(self) -> TrueBalls:
        """Return these balls with the scatter of e0 between hits at the bat."""
        spread = self.spec.spread
        scatter = spread.bat_hit_restitution
        if scatter is None:
            return self
        spread = replace(spread, hit_restitution=scatter)
        return replace(self, spec=replace(self.spec, spread=spread))

    def numbers(self, owner: Owner, ball: NDArray[np.int_]) -> NDArray[np.int_]:
        """Return a number for each shot's ball that is unique over all laboratories, (shot,)."""
        return np.arange(self.mass.size).reshape(self.mass.shape)[owner, ball]

    def after_hits(self, ball: NDArray[np.int_], loss: Array, owner: Owner = ...) -> TrueBalls:
        """Return the lot with the e0 of each ball reduced by its mean `loss` over its hits."""
        number, size = self.numbers(owner, ball), self.mass.size
        hits = np.bincount(number, minlength=size)
        mean_loss = np.bincount(number, loss, size) / np.maximum(hits, 1)
        return replace(self, restitution=self.restitution - mean_loss.reshape(self.mass.shape))

    def with_restitution(self, e0: float) -> TrueBalls:
        """Return these balls with the ball-wall restitution `e0` at every speed."""
        line = self.spec.restitution
        value: Any = np.full_like(line.value, e0)
        slope: Any = np.zeros_like(line.slope)
        line = replace(line, value=value, slope=slope, floor=0.0)
        spec = replace(self.spec, restitution=line)
        return replace(self, spec=spec, restitution=np.full_like(self.restitution, e0))

    def mean_ball(self) -> TrueBalls:
        """Return a lot of one ball, the mean of this lot, to which a measurand refers."""
        mask = np.zeros(self.mass.shape, dtype=bool)
        mask[self.used] = True
        count = mask.sum(axis=-1, keepdims=True)
        return replace(
            self,
            mass=np.where(mask, self.mass, 0.0).sum(axis=-1, keepdims=True) / count,
            restitution=np.where(mask, self.restitution, 0.0).sum(axis=-1, keepdims=True) / count,
            used=...,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueRecoil:
    """Restitution and recoil factor of the rigid bat with one support, arrays (place,)."""

    restitution: Array
    recoil_factor: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueOutcome:
    """True result at each impact position, arrays (place,)."""

    relative_speed: Array  # [m/s]
    collision_efficiency: Array
    ball_restitution: Array  # e0 of the lot's mean ball at the relative speed
    free: TrueRecoil
    pivoted: TrueRecoil  # pivot at its nominal position


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SealedTruth:
    """All true values of a test, for the score only. A laboratory never reads them."""

    seed: int
    number: int  # number of the laboratory in the study of this seed
    salt: bytes
    reality: str
    bat: TrueBat
    bat_properties: Mapping[str, Array]
    balls: TrueBalls
    constants: Mapping[str, float]  # key: "stage.instrument.constant"
    measurand: Mapping[str, float]  # key: "metric", or the name of a quantity
    place: Array  # aimed impact position, (shot,) [m]
    shots: Mapping[str, Array]  # true values of each shot, (shot,)
    wall_hits: Mapping[str, Array]
    faults: tuple[str, ...] = ()  # faults of the test day
    recipe: Mapping[str, Any]  # choices from which the test can be played again

    @property
    def content(self) -> bytes:
        """The content of ``truth.json``."""
        return (json.dumps(self.document(), indent=1, allow_nan=False) + "\n").encode()

    def document(self) -> dict[str, Any]:
        """Return the truth as the content of its JSON file."""
        return {
            "schema": 2,
            "seed": self.seed,
            "number": self.number,
            "salt": self.salt.hex(),
            "reality": self.reality,
            "measurand": dict(self.measurand),
            "place_m": self.place.tolist(),
            "bat": {"name": self.bat.name, "body": asdict(self.bat.body)},
            "bat_properties": _as_lists(self.bat_properties),
            "balls": {
                "mass": self.balls.mass.tolist(),
                "restitution": self.balls.restitution.tolist(),
                "store_humidity": None if self.balls.store is None else float(self.balls.store),
                "used": np.arange(self.balls.mass.size)[self.balls.used].tolist(),
                "spec": asdict(self.balls.spec),
            },
            "constants": dict(self.constants),
            "shots": _as_lists(self.shots),
            "wall_hits": _as_lists(self.wall_hits),
            "faults": list(self.faults),
            "recipe": dict(self.recipe),
        }


def _as_lists(arrays: Mapping[str, Array]) -> dict[str, Any]:
    """Return arrays as lists for JSON, with null for NaN (a ball that did not rebound)."""
    return {name: np.ma.masked_invalid(values).tolist(None) for name, values in arrays.items()}


def make_bat(spec: BatSpec, draws: Draws) -> TrueBat:
    """Return an individual bat of a design, with random deviations from the data sheet.

    Density, stiffness and the slope of the density along the bat vary by the spread of the sheet.
    For a block of laboratories the result contains one individual bat per laboratory.
    """
    numbers = draws.normal("bat", (3,)).reshape(-1, 3)
    return TrueBat(name=spec.name, bodies=tuple(_make_body(spec, *row) for row in numbers.tolist()))


def _make_body(spec: BatSpec, density: float, modulus: float, tilt: float) -> BatBody:
    body, spread = spec.body, spec.spread
    stiffer = 1 + spread.youngs_modulus * modulus
    material = replace(
        body.material,
        density=body.material.density * (1 + spread.density * density),
        youngs_modulus=body.material.youngs_modulus * stiffer,
        shear_modulus=body.material.shear_modulus * stiffer,
        density_tilt=spread.density_tilt * tilt,
    )
    return replace(body, material=material)


def _spec_of_owners(spec: BallSpec, owner: Any) -> BallSpec:
    """Return the sheet of a ball with the properties of the lots of the laboratories `owner`."""
    line = spec.restitution
    return replace(
        spec,
        radius=of_owners(spec.radius, owner),
        stiffness=of_owners(spec.stiffness, owner),
        restitution=replace(
            line, value=of_owners(line.value, owner), slope=of_owners(line.slope, owner)
        ),
    )


def draw_lot(
    spec: BallSpec, draws: Draws, store: Array | None = None, box: Slots | None = None
) -> BallSpec:
    """Return a copy of a ball's data sheet with the properties of a lot, drawn at random [SI].

    The properties are radius, stiffness, and level and slope of the ball-wall restitution e0. For a
    block of laboratories they are arrays (laboratory,), because each laboratory has its own lot.
    `store` is the relative humidity in which the lot was kept, 0 to 1, (laboratory,); None means
    the humidity of the sheet. `box` is the number of its box, (laboratory,); None means the first.
    """
    wider, steeper = draws.normal("lot", 2, box).T
    line, law = spec.restitution, spec.humidity
    damp: Any = 1.0 if law is None or store is None else law.factor(store)
    stiffer: Any = draws.normal("lot.stiffness", (), box)
    return replace(
        spec,
        radius=spec.radius + spec.radius_u * wider,
        stiffness=spec.stiffness * (1 + spec.stiffness_spread * stiffer),
        restitution=replace(
            line,
            value=damp * (line.value + line.value_u * draws.normal("lot.level", (), box)),
            slope=damp * (line.slope + line.slope_u * steeper),
        ),
    )


def draw_balls(
    spec: BallSpec,
    number: int,
    draws: Draws,
    lot: Draws | None = None,
    store: Array | None = None,
    box: Slots | None = None,
) -> TrueBalls:
    """Return balls of a lot, drawn at random, with arrays of mass [kg] and restitution, (ball,).

    The restitution is the ball-wall restitution e0 at the reference speed of the data sheet. For a
    block of laboratories the arrays are (laboratory, ball).

    Parameters
    ----------
    spec
        Data sheet of the ball.
    number
        Number of balls in the lot of a laboratory.
    draws
        Random numbers of the balls.
    lot
        Random numbers of the properties that all balls of the lot share. If None, `draws` is used.
    store
        Relative humidity in which the lot is kept, 0 to 1, (laboratory,). If None, it is the
        humidity of the data sheet.
    box
        Number of the box that each laboratory opens, from 0, (laboratory,). Each box is a lot of
        its own. If None, it is the first.
    """
    mass, restitution = np.moveaxis(draws.normal("balls", (2, number), box), -2, 0)
    lot_spec, spread = draw_lot(spec, lot or draws, store, box), spec.spread
    level = np.asarray(lot_spec.restitution.value)[..., None]
    return TrueBalls(
        spec=lot_spec,
        mass=spec.mass + spread.mass * mass,
        restitution=np.minimum(level + spread.restitution * restitution, 1.0),
        store=store,
    )
