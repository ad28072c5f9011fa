"""The two edges of a bat at rest, and how far they have moved across it in another picture.

Where an edge lies is not asked to better than a pixel: frames are compared with the bat's own
picture at rest, so that shading near its rim, which would move any edge found by itself, falls out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.units import Array
from virtual_lab.video.clips.calibration_file import BatPlace, CameraModel

ACROSS = np.arange(-6.0, 7.0)  # pixels across the bat, about an edge


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeSearch:
    """How the edges of a bat are looked for; slopes across it are taken every half pixel."""

    blur_px: float = 0.7  # of a picture before values between pixels are read off
    margin_px: int = 24  # about the places that are asked for
    spacing_px: float = 3.0  # along the bat: neighbours nearer share their noise
    most_points: int = 5000  # along the bat, at most
    slope_blur_half_px: float = 3.0
    neighbours: int = 7  # each way, that edges and profiles are smoothed over
    stray_half_px: float = 4.0  # an edge this far off its neighbours is none
    least_slope_over_noise: float = 6.0  # times its noise: less is no edge
    # of the stronger edge's slope: less is left out, as what is behind would move it
    least_slope_of_stronger: float = 0.3
    least_contrast_of_rest: float = 0.2  # of the contrast at rest: less is no edge
    least_points: int = 20


SEARCH = EdgeSearch()


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A bat's axis at rest, in the plane it turns in, before a camera."""

    pivot: Array  # (2,) [m]
    ahead: Array  # unit vector away from it
    camera: CameraModel

    def pixels(self, along: Array, left: Array, angle: float = 0.0) -> Array:
        """Return the pixels of places so far along and left of the axis [m], (…, 2).

        They turned about the pivot, from X toward Y [rad].
        """
        camera = self.camera
        cos, sin = np.cos(angle), np.sin(angle)
        ahead = self.ahead @ np.array([[cos, sin], [-sin, cos]])
        across = np.array([ahead[1], -ahead[0]])
        places = self.pivot + along[..., None] * ahead + left[..., None] * across
        deep = np.full((*places.shape[:-1], 1), camera.plane_height_m)
        drawn, _ = cv2.projectPoints(
            np.concatenate([places, deep], axis=-1).reshape(-1, 3),
            np.array(camera.rotation),
            np.array(camera.translation_m),
            np.array(camera.matrix),
            np.array(camera.distortion),
        )
        return np.asarray(drawn, np.float64).reshape(places.shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class BatEdges:
    """Points on the edges of a bat at rest, arrays over them."""

    axis: Axis
    pixel: float  # [m] a pixel at the bat, about
    along: Array  # (point,) from the pivot [m]
    left: Array  # (point,) of the axis [m]
    side: Array  # (point,) 1 and -1: left and right of it
    profiles: Array  # (point, across) grey values on `ACROSS`, to the left
    slopes: Array  # (point, across) a pixel to the left

    def pixels(self, angle: float, shift: float) -> Array:
        """Return pixels across the edges of a bat that turned and moved to its left [m].

        (point, across, 2).
        """
        left = self.left[:, None] + self.pixel * ACROSS + shift
        return self.axis.pixels(self.along[:, None], left, angle)

    def shifts(self, seen: Array, used: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return how far left of where it should be each edge is [pixels], and the weight of that.

        A frame's profile is level + gain (rest - shift slope), each of the three its own.
        """
        profiles, slopes = self.profiles[used], self.slopes[used]
        design = np.stack([np.ones_like(seen), profiles, -slopes], axis=-1)
        # the level takes the means: better conditioned
        design[..., 1:] -= design[..., 1:].mean(axis=1, keepdims=True)
        normal = design.transpose(0, 2, 1) @ design
        scale = np.trace(normal, axis1=1, axis2=2)[:, None, None]
        inverse = np.linalg.inv(normal + 1e-9 * scale * np.eye(3))
        right = (design * seen[..., None]).sum(axis=1)
        _, gain, moved = (inverse @ right[..., None])[..., 0].T
        shown = gain > SEARCH.least_contrast_of_rest
        safe = np.where(shown, gain, 1.0)
        return np.asarray(moved / safe), np.where(shown, safe**2 / inverse[:, 2, 2], 0.0)


def values_at(picture: NDArray[Any], pixels: Array) -> Array:
    """Return a picture's grey values at pixels (…, 2), by cubic splines.

    An edge sharper than pixels can show is bent by any spline, by its place among them; so the
    picture is blurred first.
    """
    from scipy.ndimage import gaussian_filter, map_coordinates

    ends = pixels.reshape(-1, 2)
    left, top = np.maximum(np.floor(ends.min(axis=0)) - SEARCH.margin_px, 0).astype(int)
    right, low = np.ceil(ends.max(axis=0)).astype(int) + SEARCH.margin_px
    part = np.asarray(picture[top:low, left:right], np.float64)
    soft = gaussian_filter(part, SEARCH.blur_px, mode="nearest")
    x, y = np.moveaxis(pixels - [left, top], -1, 0)
    return np.asarray(map_coordinates(soft, [y, x], mode="nearest"))


def find_outline(rest: NDArray[Any], place: BatPlace, camera: CameraModel) -> BatEdges:
    """Return the edges of a bat in a picture (row, column) of it at rest, an average of frames.

    The camera's `plane_height_m` is that of the edges; the pivot may lie out of the picture.
    Raises `InputError` where no edge shows on either side.
    """
    from scipy.ndimage import uniform_filter1d

    pivot, way = np.array(place.pivot_m), np.array(place.toward_m) - place.pivot_m
    length = float(np.hypot(*way))
    axis = Axis(pivot=pivot, ahead=way / length, camera=camera)
    there = axis.pixels(length + np.array([0.0, 1e-3]), np.zeros(2))
    pixel = 1e-3 / float(np.hypot(*(there[1] - there[0])))
    stations = np.arange(SEARCH.most_points, dtype=np.float64) * (SEARCH.spacing_px * pixel)
    reach = np.arange(-place.widest_m, place.widest_m, pixel / 2, dtype=np.float64)
    rows, columns = rest.shape
    border = ACROSS.max() + 2
    ends = axis.pixels(stations[:, None], place.widest_m * np.array([-1.0, 1.0]))
    seen = (ends > border) & (ends < np.array([columns, rows]) - 1 - border)
    stations = stations[seen.all(axis=(1, 2))]
    if len(stations) < SEARCH.least_points:
        raise InputError("", "bat", None, "its axis does not cross the picture")
    grey = values_at(rest, axis.pixels(stations[:, None], reach))
    sides, strength = [], []
    for sign in (1.0, -1.0):
        off, good = _edge(grey, stations, reach, sign)
        if good.any():
            along, left = stations[good], off[good]
            here, more, less = (
                values_at(rest, axis.pixels(along[:, None], left[:, None] + pixel * (ACROSS + h)))
                for h in (0.0, 0.5, -0.5)
            )
            profiles, slopes = (
                uniform_filter1d(each, 2 * SEARCH.neighbours + 1, axis=0, mode="nearest")
                for each in (here, more - less)
            )
            sides.append((along, left, np.full(len(left), sign), profiles, slopes))
            strength.append(float(np.median((slopes**2).sum(axis=1))))
    if not sides:
        raise InputError("", "bat", None, "no edge of it shows in the picture at rest")
    kept = np.flatnonzero(np.array(strength) > SEARCH.least_slope_of_stronger**2 * max(strength))
    shown = map(np.concatenate, zip(*(sides[k] for k in kept), strict=True))
    names = ("along", "left", "side", "profiles", "slopes")
    return BatEdges(axis=axis, pixel=pixel, **dict(zip(names, shown, strict=True)))


def _edge(
    grey: Array, stations: Array, reach: Array, sign: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Return how far off the axis an edge is at each station, and where it shows."""
    from scipy.ndimage import gaussian_filter, median_filter, uniform_filter1d

    step = float(reach[1] - reach[0])
    slope = np.abs(gaussian_filter(grey, (3, SEARCH.slope_blur_half_px), order=(0, 1)))
    noise = 1.4826 * float(np.median(slope)) + 1e-6 * float(np.abs(grey).max())
    own = np.where(sign * reach > 0, slope, 0.0)
    off = reach[own.argmax(axis=1)]
    calm = median_filter(off, 2 * SEARCH.neighbours + 1, mode="nearest")
    near = np.abs(off - calm) < SEARCH.stray_half_px * step
    good = np.asarray(near & (own.max(axis=1) > SEARCH.least_slope_over_noise * noise))
    if good.sum() < SEARCH.least_points:
        return off, np.zeros_like(good)
    whole = np.interp(stations, stations[good], off[good])
    return np.asarray(uniform_filter1d(whole, SEARCH.neighbours + 1, mode="nearest")), good
