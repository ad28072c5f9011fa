"""True lens and pose of a camera: projection of points to pixels, and of spheres to outlines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab.relations.pinhole import looking_down, project_points
from virtual_lab.simulation.instruments.camera.spec import DISTORTION
from virtual_lab.units import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlines:
    """Images of n spheres."""

    centre: Array  # (n, 2), image of the sphere's center [px]
    warp: Array  # (n, 2, 5), argument of `render_balls`
    view: Array  # (n, 3, 3), argument of `render_balls`

    def __getitem__(self, some: slice) -> Self:
        return type(self)(centre=self.centre[some], warp=self.warp[some], view=self.view[some])

    @property
    def middle(self) -> Array:
        """Centroid of the outline, (n, 2) [px], which is not the image of the sphere's center.

        It is the mean of the mapped disk, weighted by the stretch of the map, with <u²> = 1/4.
        """
        (a, b, aa, ab, bb), (c, d, cc, cd, dd) = self.warp.transpose(1, 2, 0)
        stretch = np.stack(
            [2 * aa * d + a * cd - ab * c - 2 * cc * b, ab * d + 2 * a * dd - 2 * bb * c - b * cd],
            axis=1,
        )
        linear = self.warp[:, :, :2]
        lean = np.einsum("ncp,np->nc", linear, stretch) / np.linalg.det(linear)[:, None]
        return np.asarray(self.centre + (self.warp[:, :, 2] + self.warp[:, :, 4] + lean) / 4)

    @property
    def radius(self) -> Array:
        """Radius of the circle with the area of the outline, (n,) [px]."""
        return np.asarray(np.sqrt(np.abs(np.linalg.det(self.warp[:, :, :2]))))


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueLens:
    """True lens and pose of one camera."""

    focal: float  # focal length [px]
    centre: Array  # (2,), principal point [px]
    distortion: Array  # k1, k2, p1, p2, k3
    tilt: Array  # (3,), rotation vector from the vertical view [rad]
    place: Array  # (3,), position of the pinhole in axes of the rig [m]

    @classmethod
    def of(cls, true: Mapping[str, float]) -> Self:
        """Return the lens from the true constants of a camera."""
        return cls(
            focal=true["focal"],
            centre=np.array([true[f"centre_{axis}"] for axis in "xy"]),
            distortion=np.array([true[key] for key in DISTORTION]),
            tilt=np.array([true[f"tilt_{axis}"] for axis in "xyz"]),
            place=np.array([true[f"place_{axis}"] for axis in "xyz"]),
        )

    @property
    def rotation(self) -> Array:
        """Rotation from axes of the rig to axes of the camera, (3, 3)."""
        return looking_down(self.tilt)

    def to_camera(self, points: ArrayLike) -> Array:
        """Return points of the rig [m], (…, 3), in axes of the camera."""
        return np.asarray((np.asarray(points, dtype=np.float64) - self.place) @ self.rotation.T)

    def to_pixels(self, points: ArrayLike) -> Array:
        """Return the pixels (…, 2) of points (…, 3) in axes of the camera."""
        return project_points(points, self.focal, self.centre, self.distortion)

    def outlines(self, centres: ArrayLike, radius: float) -> Outlines:
        """Return the images of spheres with `centres` (n, 3) in axes of the rig [m].

        A sphere fills a cone about the direction to its center; the sine of the half angle of this
        cone is radius / distance. The lens maps the cross-section of the cone, a disk, to pixels.
        The returned map is exact to second order about the center, and to third order on the rim.
        """
        place = self.to_camera(centres)
        far = np.linalg.norm(place, axis=1)
        direction = place / far[:, None]
        view = _turned_to(direction)
        opening = radius / np.sqrt(far**2 - radius**2)
        around = np.arange(16) * np.pi / 8  # directions in which the outline is traced
        u, v = np.cos(around), np.sin(around)
        rim = u[:, None] * view[:, None, :, 0] + v[:, None] * view[:, None, :, 1]
        centre = self.to_pixels(direction)
        traced = self.to_pixels(direction[:, None] + opening[:, None, None] * rim) - centre[:, None]
        terms = np.linalg.pinv(np.stack([u, v, u * u, u * v, v * v], axis=1))
        warp = np.einsum("kp,npc->nck", terms, traced)
        return Outlines(centre=centre, warp=warp, view=view)


def _turned_to(direction: Array) -> Array:
    """Return the smallest rotations from z to the unit vectors `direction` (n, 3), (n, 3, 3)."""
    x, y, z = direction.T
    first = np.stack([1 - x * x / (1 + z), -x * y / (1 + z), -x], axis=1)
    second = np.stack([-x * y / (1 + z), 1 - y * y / (1 + z), -y], axis=1)
    return np.stack([first, second, direction], axis=2)
