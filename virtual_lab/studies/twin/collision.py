"""The collision of a twin: the curve of e_A and the recoil that a laboratory measured."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BatBody
from virtual_lab.records.origin import ModelUsed
from virtual_lab.simulation.collision.ladder import StruckBat
from virtual_lab.simulation.collision.scene import Collisions, EnergySplit, Scenes
from virtual_lab.simulation.physics.beam import Pinned, RigidBat, Support
from virtual_lab.simulation.physics.cubics import monotone_cubic
from virtual_lab.simulation.stations.impact import CONTACT_TIME
from virtual_lab.units import Array

if TYPE_CHECKING:
    from virtual_lab.simulation.physics.modes import Modes


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedCurve:
    """e_A along the barrel: the mean at each impact position, joined by the certificate's curve.

    Beyond the fitted curve the positions are joined by cubics without extra maxima. Beyond the
    outermost positions the last slope continues. For a single position the slope is that of the
    procedure, without its u: this adds at most 1 % to the u of a result, because it acts only
    through the error of the aim.
    """

    place: Array  # impact positions, increasing, from the tip [m], (position,)
    efficiency: Array  # e_A at these positions, (position,)
    slope: float = 0.0  # slope of e_A, used for a single position [1/m]
    fitted: Polynomial | None = None  # curve of the certificate
    ends: tuple[float, float] = (0.0, 0.0)  # range of the fitted curve [m]

    def __call__(self, place: Array) -> Array:
        """Return e_A at `place` [m], in its shape."""
        if self.place.size == 1:
            return np.asarray(self.efficiency[0] + self.slope * (place - self.place[0]))
        inside = np.clip(place, self.place[0], self.place[-1])
        slopes = np.diff(self.efficiency) / np.diff(self.place)
        beyond = (place - inside) * np.where(place < inside, slopes[0], slopes[-1])
        e_A: Array = monotone_cubic(self.place, self.efficiency)(inside) + beyond
        if self.fitted is None:
            return e_A
        near = (place >= self.ends[0]) & (place <= self.ends[1])
        return np.where(near, self.fitted(place), e_A)


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedMotion:
    """The motion of the section at the pivot after a hit: rotation, then vibrations, (mode,).

    The vibrations are those of the fit of an encoder's record. Angle and rate at release are per
    angular rate of the rigid bat.
    """

    angular_frequencies: Array  # 0 for the rotation [rad/s]
    angle: Array  # 0 for the rotation [s]
    rate: Array  # 1 for the rotation
    damping_ratio: float = 0.0  # common to all vibrations
    rigid: int = 1

    def rotation(self, _place: float) -> Array:
        """Return the rotation of the section per unit of each coordinate, (mode,)."""
        return np.ones(self.angular_frequencies.size)


RIGID = StatedMotion(angular_frequencies=np.zeros(1), angle=np.zeros(1), rate=np.ones(1))


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedCollision:
    """The collision as a laboratory measured it.

    e is in proportion to the e0 of the ball in each hit, as the reduction assumes, so that the
    mean ball of the lot has the measured e_A at each impact position.
    """

    curve: StatedCurve
    bat: RigidBat[float]
    axis: float  # distance from the tip of the pivot that the procedure requires [m]
    free: bool  # whether r is that of a free bat
    ball_mass: float  # mass of the mean ball of the lot [kg]
    # e0 of the mean ball of the lot at the nominal relative speed: value at the tip, slope [1/m]
    ball_restitution: tuple[float, float]
    motion: StatedMotion = RIGID

    def recoil_factor(self, place: Array, ball_mass: Array | float) -> Array:
        """Return r of the measured bat, in the shape of `place` [m]."""
        yields = (self.axis - place) ** 2 / self.bat.inertia(self.axis)
        if self.free:
            yields = 1 / self.bat.mass + (place - self.bat.z_cm) ** 2 / self.bat.inertia_cm
        return np.asarray(ball_mass * yields)

    def efficiency(self, scenes: Scenes) -> Array:
        """Return e_A of the scenes, (n,)."""
        place = scenes.impact_position
        r = self.recoil_factor(place, self.ball_mass)
        e = self.curve(place) * (1 + r) + r
        at_tip, slope = self.ball_restitution
        e = e * scenes.ball_restitution / (at_tip + slope * place)
        r = self.recoil_factor(place, scenes.ball_mass)
        return np.asarray((e - r) / (1 + r))

    def efficiencies(
        self, struck: Iterable[StruckBat], support: Support, scenes: Scenes
    ) -> NDArray[np.float64]:
        """Return e_A of the scenes, (n,). It does not depend on the support."""
        return self.efficiency(scenes)

    true_efficiencies = efficiencies

    def __call__(self, body: BatBody, support: Support) -> StatedModel:
        """Return the collision model of the bat on a pivot."""
        assert isinstance(support, Pinned)
        return StatedModel(law=self, axis=support.z)

    def report(self) -> ModelUsed:
        """Return the name of this model and why it is used."""
        return ModelUsed(rung="stated", reason="stated, e_A as the records show it")


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedModel:
    """The stated collision with the motion of the bat on its pivot."""

    law: StatedCollision
    axis: float  # distance of the pivot from the tip [m]

    name = "stated"

    @property
    def modes(self) -> Modes:
        """Rotation and vibrations of the section at the pivot, which is all an encoder needs."""
        return cast("Modes", self.law.motion)

    def collide(self, scenes: Scenes) -> Collisions:
        """Return the collisions of the scenes, with the vibration in proportion to the recoil."""
        e_A, motion, bat = self.law.efficiency(scenes), self.law.motion, self.law.bat
        impulse = scenes.ball_mass * scenes.relative_speed * (1 + e_A)
        rate = impulse * (self.axis - scenes.impact_position) / bat.inertia(self.axis)
        zero, none = np.zeros(len(scenes)), np.zeros(len(scenes), dtype=np.int64)
        return Collisions(
            collision_efficiency=e_A,
            modal_displacements=np.outer(rate, motion.angle),
            modal_velocities=np.outer(rate, motion.rate),
            contact_time=np.full(len(scenes), CONTACT_TIME),
            impulse=impulse,
            contacts=none + 1,
            reloads=none,
            redone=none,
            energy=EnergySplit(ball=e_A**2, rigid=zero, bending=zero, hoop=zero, hysteresis=zero),
        )
