"""Methods to locate a ball in a picture, from OpenCV and from this package.

Each method of OpenCV is used as well as possible. It gets the matte, which is the share of each
pixel that the ball covers. The matte is the difference from the background, divided by the same
difference for the ball. With the plain difference the methods would be less accurate on a
background with a gradient.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from virtual_lab.fidelity.camera_scenes import EstimatorInput
from virtual_lab.video.locate.edge_fit import fit_edge
from virtual_lab.video.locate.located import Located, PlaceFlag
from virtual_lab.video.locate.sharp import sharp_places

Image = NDArray[np.float32]
Place = tuple[float, float]

Estimator = Callable[[EstimatorInput], Located]


@dataclass(frozen=True, slots=True)
class Picture:
    """One region of a picture, and the start of the search [px from the corner of the region]."""

    image: Image
    behind: Image
    x: float
    y: float
    radius: float
    blur: tuple[float, float]
    lens: float

    @property
    def matte(self) -> Image:
        """Share of each pixel that the ball covers, shape (row, column)."""
        rows, columns = np.ogrid[: self.image.shape[0], : self.image.shape[1]]
        away = np.hypot(columns - self.x, rows - self.y)
        radius_seen = self.radius + np.hypot(*self.blur) / 2 + 3.0  # pixels that may show the ball
        light = np.median(self.image[away < 0.7 * self.radius])
        share = (self.image - self.behind) / (light - self.behind)
        return np.where(away < radius_seen, np.clip(share, -1, 2), 0).astype(np.float32)

    @property
    def model(self) -> Image:
        """Matte of a ball at the start position, shape (row, column)."""
        rows, columns = np.ogrid[: self.image.shape[0], : self.image.shape[1]]
        width, long = np.sqrt(self.lens**2 + 1 / 12), np.hypot(*self.blur)
        nodes, weights = np.polynomial.legendre.leggauss(int(np.ceil(0.9 * long / width)) + 4)
        share = np.zeros(self.image.shape)
        for node, weight in zip(nodes / 2, weights / 2, strict=True):
            x, y = self.x + node * self.blur[0], self.y + node * self.blur[1]
            inside = self.radius - np.hypot(columns - x, rows - y)
            share += weight * ndtr(inside / width - width / (2 * self.radius))
        return share.astype(np.float32)


def by_picture(place: Callable[[Picture], Place | None]) -> Estimator:
    """Return an estimator for several pictures that calls `place` for each picture.

    An estimator locates the ball. `place` locates the ball in one picture. It returns a position
    [px from the corner of the picture's region], or None.

    The estimator also has a start position for each picture, near which the ball is searched. In
    two cases the estimated position is NaN and has a flag:

    * `place` returns None;
    * the returned position is at least one ball radius away from the start position.
    """

    def estimator(inputs: EstimatorInput) -> Located:
        positions = np.full((len(inputs.regions.pixels), 2), np.nan)
        for k in range(len(positions)):
            picture = _picture(inputs, k)
            at = place(picture)
            if at and np.hypot(at[0] - picture.x, at[1] - picture.y) < picture.radius:
                positions[k] = at
        x, y = (positions + inputs.regions.corners).T
        flags = np.where(np.isnan(x), PlaceFlag.NOT_FOUND, 0).astype(np.uint16)
        return replace(inputs.start, x=x, y=y, flags=flags)

    return estimator


def _picture(inputs: EstimatorInput, k: int) -> Picture:
    regions, start = inputs.regions, inputs.start
    return Picture(
        image=regions.pixels[k].astype(np.float32),
        behind=regions.background[k],
        x=float(start.x[k] - regions.corners[k, 0]),
        y=float(start.y[k] - regions.corners[k, 1]),
        radius=float(start.radius[k]),
        blur=(float(start.blur_x[k]), float(start.blur_y[k])),
        lens=inputs.lens,
    )


def _by_outline(centre: Callable[[Any, NDArray[Any]], Place | None]) -> Estimator:
    """Return an estimator that applies a function of OpenCV to the largest contour of the matte."""

    def place(picture: Picture) -> Place | None:
        import cv2

        mask = (picture.matte > 0.5).astype(np.uint8)
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        largest = max(outlines, key=len, default=())
        return centre(cv2, np.asarray(largest)) if len(largest) >= 5 else None

    return by_picture(place)


def _matte_moments(picture: Picture) -> Place | None:
    import cv2

    matte = picture.matte
    mass = np.where(matte > 0.05, matte, 0.0)  # smaller values are noise
    return _centre(cv2.moments(mass.astype(np.float32)))


def _phase(picture: Picture) -> Place | None:
    import cv2

    (x, y), _ = cv2.phaseCorrelate(picture.model, picture.matte)
    return picture.x + x, picture.y + y


def _template(picture: Picture) -> Place | None:
    """Return the maximum of the correlation with a cropped model, interpolated by parabolas."""
    import cv2

    edge = 4
    model = picture.model[edge:-edge, edge:-edge]
    score = cv2.matchTemplate(picture.matte, model, cv2.TM_CCOEFF_NORMED)
    _, _, _, (column, row) = cv2.minMaxLoc(score)
    if not (0 < row < 2 * edge and 0 < column < 2 * edge):
        return None
    x = column + _vertex(score[row, column - 1 : column + 2]) - edge
    y = row + _vertex(score[row - 1 : row + 2, column]) - edge
    return picture.x + x, picture.y + y


def _ecc(picture: Picture) -> Place | None:
    """Return the shift of largest correlation, in two passes with a newly rendered model."""
    import cv2

    matte, at = picture.matte, picture
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-6)
    for _ in range(2):
        shift = np.eye(2, 3, dtype=np.float32)
        try:
            cv2.findTransformECC(at.model, matte, shift, cv2.MOTION_TRANSLATION, stop)
        except cv2.error:
            return None
        at = replace(at, x=at.x + float(shift[0, 2]), y=at.y + float(shift[1, 2]))
    return at.x, at.y


def _hough(picture: Picture) -> Place | None:
    import cv2

    grey = np.clip(200 * picture.matte + 20, 0, 255).astype(np.uint8)
    low, high = int(0.85 * picture.radius), int(1.15 * picture.radius) + 1
    circles = cv2.HoughCircles(
        grey, cv2.HOUGH_GRADIENT, 1, 20, param1=120, param2=12, minRadius=low, maxRadius=high
    )
    return None if circles is None else _pair(circles[0, 0])


def _centre(moments: dict[str, float]) -> Place | None:
    area = moments["m00"]
    return (moments["m10"] / area, moments["m01"] / area) if area > 0 else None


def _pair(point: Any) -> Place:
    return float(point[0]), float(point[1])


def _vertex(three: Any) -> float:
    before, middle, after = (float(value) for value in three)
    bend = before - 2 * middle + after
    return (before - after) / (2 * bend) if bend else 0.0


CV2: dict[str, Estimator] = {
    "contour moments": _by_outline(lambda cv2, outline: _centre(cv2.moments(outline))),
    "convex hull": _by_outline(lambda cv2, outline: _centre(cv2.moments(cv2.convexHull(outline)))),
    "fitEllipse": _by_outline(lambda cv2, outline: _pair(cv2.fitEllipse(outline)[0])),
    "minEnclosingCircle": _by_outline(lambda cv2, out: _pair(cv2.minEnclosingCircle(out)[0])),
    "matte moments": by_picture(_matte_moments),
    "phaseCorrelate": by_picture(_phase),
    "matchTemplate, parabola": by_picture(_template),
    "ECC on the matte": by_picture(_ecc),
    "HoughCircles": by_picture(_hough),
}


def _edge(inputs: EstimatorInput) -> Located:
    return fit_edge(inputs.regions, inputs.start, noise=inputs.noise, lens=inputs.lens)


def _learnt(inputs: EstimatorInput) -> Located:
    """Locate the balls with the method of the tracker, which estimates the noise from the clip."""
    return sharp_places(inputs.clip, inputs.regions, inputs.start, lens=inputs.lens)


EDGE = "edge fit"
OURS: dict[str, Estimator] = {EDGE: _edge, "edge fit, noise learned": _learnt}
ESTIMATORS = CV2 | OURS
