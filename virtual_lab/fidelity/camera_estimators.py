"""Methods to locate a ball in a picture, each used as well as possible: OpenCV's and ours.

The input of OpenCV's methods is the matte, the share of the ball in each pixel: the difference from
the background, divided by that of the ball. With the plain difference they would be worse on a
background with a slope.
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
    """One region and the start of the search in it, in pixels from the first one of the region."""

    image: Image
    behind: Image
    x: float
    y: float
    radius: float
    blur: tuple[float, float]
    lens: float

    @property
    def matte(self) -> Image:
        """Share of the ball in each pixel."""
        rows, columns = np.ogrid[: self.image.shape[0], : self.image.shape[1]]
        away = np.hypot(columns - self.x, rows - self.y)
        reach = self.radius + np.hypot(*self.blur) / 2 + 3.0  # pixels that may show the ball
        light = np.median(self.image[away < 0.7 * self.radius])
        share = (self.image - self.behind) / (light - self.behind)
        return np.where(away < reach, np.clip(share, -1, 2), 0).astype(np.float32)

    @property
    def model(self) -> Image:
        """Matte of a ball at the start position."""
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
    """Return an estimator that locates one picture at a time and drops positions off the ball."""

    def estimator(given: EstimatorInput) -> Located:
        found = np.full((len(given.seen.pixels), 2), np.nan)
        for k in range(len(found)):
            picture = _picture(given, k)
            at = place(picture)
            if at and np.hypot(at[0] - picture.x, at[1] - picture.y) < picture.radius:
                found[k] = at
        x, y = (found + given.seen.corners).T
        lost = np.where(np.isnan(x), PlaceFlag.NOT_FOUND, 0).astype(np.uint16)
        return replace(given.start, x=x, y=y, flags=lost)

    return estimator


def _picture(given: EstimatorInput, k: int) -> Picture:
    seen, start = given.seen, given.start
    return Picture(
        image=seen.pixels[k].astype(np.float32),
        behind=seen.background[k],
        x=float(start.x[k] - seen.corners[k, 0]),
        y=float(start.y[k] - seen.corners[k, 1]),
        radius=float(start.radius[k]),
        blur=(float(start.blur_x[k]), float(start.blur_y[k])),
        lens=given.lens,
    )


def _by_outline(centre: Callable[[Any, NDArray[Any]], Place | None]) -> Estimator:
    """Return an estimator from an OpenCV function and the largest contour at half matte."""

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
    seen = np.where(matte > 0.05, matte, 0.0)  # smaller values are noise
    return _centre(cv2.moments(seen.astype(np.float32)))


def _phase(picture: Picture) -> Place | None:
    import cv2

    (x, y), _ = cv2.phaseCorrelate(picture.model, picture.matte)
    return picture.x + x, picture.y + y


def _template(picture: Picture) -> Place | None:
    """Return the maximum of the correlation with a smaller model, with parabolas for subpixels."""
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
    """Return the shift of largest correlation; the model is rendered again, as shifts blur it."""
    import cv2

    matte, at = picture.matte, picture
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-6)
    for _ in range(2):
        moved = np.eye(2, 3, dtype=np.float32)
        try:
            cv2.findTransformECC(at.model, matte, moved, cv2.MOTION_TRANSLATION, stop)
        except cv2.error:
            return None
        at = replace(at, x=at.x + float(moved[0, 2]), y=at.y + float(moved[1, 2]))
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
    before, here, after = (float(value) for value in three)
    bend = before - 2 * here + after
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


def _edge(given: EstimatorInput) -> Located:
    return fit_edge(given.seen, given.start, noise=given.noise, lens=given.lens)


def _learnt(given: EstimatorInput) -> Located:
    """Locate the balls as the tracker does, with the noise estimated from the pictures."""
    return sharp_places(given.clip, given.seen, given.start, lens=given.lens)


EDGE = "edge fit"
OURS: dict[str, Estimator] = {EDGE: _edge, "edge fit, noise learnt": _learnt}
ESTIMATORS = CV2 | OURS
