"""The two edges of a bat at rest, and how the picture runs across them.

Where an edge lies is not asked to better than a pixel: frames are compared with the bat's own
picture at rest, so that shading near its rim, which would move any edge found by itself, falls out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.video.clips.calibration_file import CameraModel

__all__ = ["BatEdges", "Between", "find_outline", "normal_pixels", "pixels_of", "shifts_of"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

ACROSS = np.arange(-6.0, 7.0)  # pixels along an edge's normal, outward
SOFTER = 0.7  # pixels: pictures are blurred by that before values between pixels are read off
ROOM = 24  # pixels about the places that are asked for
STEP = 3.0  # pixels along the bat: neighbours nearer share their noise
FAR = 5000  # steps along the bat that are looked at, at most
SMOOTH = 3.0  # half pixels, of slopes across the bat
ALONG = 7  # neighbours each way that edges and profiles are smoothed over
STRAY = 4.0  # half pixels: an edge this far off its neighbours is none
SHOWN = 6.0  # times the noise of a slope: less is no edge
FAINT = 0.3  # of the stronger edge's slope: less is left out
GONE = 0.2  # of the contrast at rest: less is no edge
LEAST = 20  # points of an edge


@dataclass(frozen=True, slots=True, kw_only=True)
class BatEdges:
    """Points on the edges of a bat at rest, arrays over them; axes of the plane it turns in."""

    pivot: Array  # (2,)
    left: Array  # unit vector across its axis, (2,)
    places: Array  # (point, 2) [m], or pixels without a camera
    normals: Array  # (point, 2) unit vectors, outward
    profiles: Array  # (point, across) grey values on `ACROSS`
    slopes: Array  # (point, across) a pixel outward
    side: NDArray[np.intp]  # (point,) 0 and 1: left and right of the axis, seen from the pivot

    def turned(self, angle: float, shift: float = 0.0) -> tuple[Array, Array]:
        """Return places and normals turned about the pivot, from X toward Y [rad], and shifted.

        The shift is across the bat as it then lies, to its left [m].
        """
        cos, sin = np.cos(angle), np.sin(angle)
        turn = np.array([[cos, sin], [-sin, cos]])  # rows are vectors
        places = (self.places - self.pivot + shift * self.left) @ turn + self.pivot
        return places, self.normals @ turn


def pixels_of(places: Array, camera: CameraModel | None) -> Array:
    """Return the pixels that a plane's places are seen at, (n, 2); themselves without a camera."""
    if camera is None:
        return places
    import cv2

    deep = np.full((len(places), 1), camera.plane_height_m)
    drawn, _ = cv2.projectPoints(
        np.concatenate([places, deep], axis=1),
        np.array(camera.rotation),
        np.array(camera.translation_m),
        np.array(camera.matrix),
        np.array(camera.distortion),
    )
    return np.asarray(drawn, np.float64).reshape(-1, 2)


@dataclass(frozen=True, slots=True)
class Between:
    """A picture between its pixels, about some places: cubic splines through its blurred values.

    An edge sharper than pixels can show is bent by any spline, by its place among them; so the
    picture is blurred first.
    """

    splines: Array
    first: Array  # x and y of their first pixel

    @classmethod
    def of(cls, picture: NDArray[Any], pixels: Array) -> Between:
        """Return a picture about pixels (…, 2)."""
        from scipy.ndimage import gaussian_filter, spline_filter

        ends = pixels.reshape(-1, 2)
        left, top = np.maximum(np.floor(ends.min(axis=0)) - ROOM, 0).astype(int)
        right, low = np.ceil(ends.max(axis=0)).astype(int) + ROOM
        part = np.asarray(picture[top:low, left:right], np.float64)
        soft = gaussian_filter(part, SOFTER, mode="nearest")
        splines = np.asarray(spline_filter(soft, mode="nearest"))
        return cls(splines, np.array([left, top], np.float64))

    def at(self, pixels: Array) -> Array:
        """Return grey values at pixels (…, 2)."""
        from scipy.ndimage import map_coordinates

        x, y = np.moveaxis(pixels - self.first, -1, 0)
        found = map_coordinates(self.splines, [y, x], mode="nearest", prefilter=False)
        return np.asarray(found)


def find_outline(
    rest: Image,
    pivot: tuple[float, float],
    toward: tuple[float, float],
    widest: float,
    camera: CameraModel | None = None,
) -> BatEdges:
    """Return the edges of a bat in a picture of it at rest.

    Parameters
    ----------
    rest
        Grey values of the whole frame, (row, column), as many frames averaged as there are.
    pivot
        What the bat turns about, X and Y in the plane [m]; it may lie out of the picture. Without
        a camera, pixels, here and below.
    toward
        Another point of its axis, to a third of its width.
    widest
        More than half its greatest width, less than the distance to the next thing beside it.
    camera
        Whose `plane_height_m` is that of the bat's edges.

    Raises
    ------
    InputError
        No edge shows on either side.
    """
    middle, ahead = np.array(pivot), np.array(toward) - pivot
    ahead = ahead / np.hypot(*ahead)
    left = np.array([ahead[1], -ahead[0]])
    there = pixels_of(np.stack([np.array(toward), np.array(toward) + 1e-3 * ahead]), camera)
    pixel = 1e-3 / float(np.hypot(*(there[1] - there[0])))
    stations = np.arange(FAR, dtype=np.float64) * (STEP * pixel)
    reach = np.arange(-widest, widest, pixel / 2, dtype=np.float64)
    axis = middle + stations[:, None] * ahead
    sides = np.stack([axis - widest * left, axis + widest * left])
    rows, columns = rest.shape
    border = ACROSS.max() + 2
    seen = [
        ((each > border) & (each < np.array([columns, rows]) - 1 - border)).all(axis=1)
        for each in (pixels_of(side, camera) for side in sides)
    ]
    kept = np.flatnonzero(seen[0] & seen[1])
    if len(kept) < LEAST:
        raise InputError("", "bat", None, "its axis does not cross the picture")
    across = axis[kept, None] + reach[:, None] * left
    pixels = pixels_of(across.reshape(-1, 2), camera).reshape(across.shape)
    grey = Between.of(rest, pixels).at(pixels)
    points, normals, numbers = [], [], []
    for number, sign in enumerate((1.0, -1.0)):
        off, lean, good = _edge(grey, stations[kept], reach, sign)
        normal = sign * (left - lean[:, None] * ahead)
        points.append((axis[kept] + off[:, None] * left)[good])
        normals.append((normal / np.hypot(*normal.T)[:, None])[good])
        numbers.append(np.full(int(good.sum()), number))
    if not any(map(len, points)):
        raise InputError("", "bat", None, "no edge of it shows in the picture at rest")
    places, outward, side = (np.concatenate(each) for each in (points, normals, numbers))
    found = BatEdges(
        pivot=middle,
        left=left,
        places=places,
        normals=outward,
        profiles=np.empty(0),
        slopes=np.empty(0),
        side=side,
    )
    return _strong(_with_profiles(found, rest, camera))


def _edge(
    grey: Array, stations: Array, reach: Array, sign: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return how far off the axis an edge is at each station, its slope, and where it shows."""
    from scipy.ndimage import gaussian_filter, median_filter, uniform_filter1d

    step = float(reach[1] - reach[0])
    slope = np.abs(gaussian_filter(grey, (3, SMOOTH), order=(0, 1)))
    noise = 1.4826 * float(np.median(slope)) + 1e-6 * float(np.abs(grey).max())
    own = np.where(sign * reach > 0, slope, 0.0)
    off = reach[own.argmax(axis=1)]
    calm = median_filter(off, 2 * ALONG + 1, mode="nearest")
    good = np.asarray((own.max(axis=1) > SHOWN * noise) & (np.abs(off - calm) < STRAY * step))
    if good.sum() < LEAST:
        return off, np.zeros_like(off), np.zeros_like(good)
    whole = np.interp(stations, stations[good], off[good])
    smooth = np.asarray(uniform_filter1d(whole, ALONG + 1, mode="nearest"))
    return smooth, np.gradient(smooth, stations), good


def normal_pixels(places: Array, normals: Array, camera: CameraModel | None) -> Array:
    """Return pixels along normals on `ACROSS`, (point, across, 2)."""
    at = pixels_of(places, camera)
    small = 1e-4 if camera else 1.0
    way = pixels_of(places + small * normals, camera) - at
    way = way / np.hypot(*way.T)[:, None]
    return np.asarray(at[:, None] + ACROSS[:, None] * way[:, None])


def shifts_of(seen: Array, found: BatEdges, used: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return how far each edge is from where it should be [pixels], and the weight of that.

    A frame's profile is level + gain (rest - shift slope), each of the three its own.
    """
    profiles, slopes = found.profiles[used], found.slopes[used]
    design = np.stack([np.ones_like(seen), profiles, -slopes], axis=-1)
    # the level takes the means: better conditioned
    design[..., 1:] -= design[..., 1:].mean(axis=1, keepdims=True)
    normal = design.transpose(0, 2, 1) @ design
    scale = np.trace(normal, axis1=1, axis2=2)[:, None, None]
    inverse = np.linalg.inv(normal + 1e-9 * scale * np.eye(3))
    right = (design * seen[..., None]).sum(axis=1)
    _, gain, moved = (inverse @ right[..., None])[..., 0].T
    shown = gain > GONE
    safe = np.where(shown, gain, 1.0)
    return np.asarray(moved / safe), np.where(shown, safe**2 / inverse[:, 2, 2], 0.0)


def _with_profiles(found: BatEdges, rest: Image, camera: CameraModel | None) -> BatEdges:
    """Return an outline with the picture at rest across it, averaged along each edge."""
    from scipy.ndimage import uniform_filter1d

    along = normal_pixels(found.places, found.normals, camera)
    half = 0.5 * (along[:, 1] - along[:, 0])[:, None]
    between = Between.of(rest, along)
    here, ahead, behind = (between.at(along + step) for step in (0.0, half, -half))
    profiles, slopes = np.empty_like(here), np.empty_like(here)
    for number in np.unique(found.side):
        own = found.side == number
        size = 2 * ALONG + 1
        profiles[own] = uniform_filter1d(here[own], size, axis=0, mode="nearest")
        slopes[own] = uniform_filter1d((ahead - behind)[own], size, axis=0, mode="nearest")
    return replace(found, profiles=profiles, slopes=slopes)


def _strong(found: BatEdges) -> BatEdges:
    """Return an outline without an edge that hardly shows.

    What little the background changes behind such an edge would move it.
    """
    strength = (found.slopes**2).sum(axis=1)
    typical = np.array(
        [np.median(strength[found.side == each]) if each in found.side else 0.0 for each in (0, 1)]
    )
    kept = (typical > FAINT**2 * typical.max())[found.side]
    return replace(
        found,
        places=found.places[kept],
        normals=found.normals[kept],
        profiles=found.profiles[kept],
        slopes=found.slopes[kept],
        side=found.side[kept],
    )
