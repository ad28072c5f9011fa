"""High-speed shots of a ball toward a bat and away from it, in gray, region by region.

A ball is drawn with a resolution three times finer than the sensor's, at several moments of the
exposure; then come lens, pixels, photons and gray values. The view is from far above, without
perspective. Pixel coordinates are OpenCV's: (0, 0) is the center of the first pixel.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

__all__ = ["KINDS", "Kind", "Shot", "drawn", "efficiency", "empties", "make_shot", "strip"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

FINE = 3  # samples per pixel in each direction
MOVED = 0.4  # motion between moments of an exposure [px]
SIZE = (1280, 800)  # columns, rows
BALL = 0.073  # diameter [m]
ALBEDO = 0.85
DRAG = 0.0069  # drag constant [1/m]
SPIN = (50.0, 100.0)  # standard deviations of the spin about each axis, in and out [rad/s]
NECK = 0.34  # angle from the seam's pole [rad]: 25 mm between the seams where they are closest
BEND = 0.5  # bend of the seam: radius of curvature at least 0.43 radii, length 42 cm
SEAM, SOFTNESS = 0.07, 0.01  # half the seam's width, and the softness of its edge [radii]
TABLE = (256, 512)  # samples of the ball's surface, over colatitude and longitude
EMPTY = 32  # number of frames averaged in the background


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A camera with its light. Light is in electrons per pixel and exposure."""

    fps: float
    exposure: float  # s
    most_in: int  # largest number of frames before the contact
    most_out: int
    white: float  # light of a white surface that faces the lamp [e]
    behind: float  # light of the background [e]
    slope: tuple[float, float]  # relative change of the background across and down the picture
    ambient: float
    lamp: tuple[float, float, float]  # direction to the lamp: right, down, away from the camera
    wrap: float  # depth of light beyond the terminator, as a share of the ball's radius
    seams: float  # share of light that seams absorb
    flicker: float
    blur: float = 0.8  # px
    scale: float = 1072.0  # px/m
    gain: float  # gray values per electron
    read: float  # e
    bits: int
    black: float

    @property
    def radius(self) -> float:
        """Radius of the ball [px]."""
        return self.scale * BALL / 2


_SOFT = Kind(
    fps=5000,
    exposure=25e-6,
    most_in=20,
    most_out=20,
    white=22000,
    behind=1500,
    slope=(0.12, -0.05),
    ambient=0.6,
    lamp=(0.0, -0.29, -0.96),
    wrap=0.6,
    seams=0.6,
    flicker=0.01,
    gain=0.1518,
    read=18,
    bits=12,
    black=64,
)
KINDS = {
    "plain": replace(_SOFT, seams=0.0),
    "back": Kind(
        fps=10000,
        exposure=10e-6,
        most_in=20,
        most_out=20,
        white=360,
        behind=14400,
        slope=(0.04, 0.03),
        ambient=1.0,
        lamp=(0.0, 0.0, -1.0),
        wrap=0.0,
        seams=0.0,
        flicker=0.005,
        gain=0.20746,
        read=14,
        bits=12,
        black=50,
    ),
    "soft": _SOFT,
    "hard": Kind(
        fps=1000,
        exposure=40e-6,
        most_in=14,
        most_out=20,
        white=8400,
        behind=720,
        slope=(0.20, 0.10),
        ambient=0.12,
        lamp=(-0.2, -0.9, -0.4),
        wrap=0.05,
        seams=0.6,
        flicker=0.03,
        gain=0.0253,
        read=30,
        bits=8,
        black=8,
    ),
}


@dataclass(frozen=True, kw_only=True)
class Shot:
    """Regions of a shot and their truth; the contact is at time 0.

    `corners`: the first pixel (column, row) of a region in the frame. `background`: the mean of
    frames with the bat alone, (row, column).
    """

    kind: Kind
    times: Array  # (frame,), middles of the exposures [s]
    corners: NDArray[np.intp]  # (frame, 2)
    regions: NDArray[np.uint16]  # (frame, row, column)
    background: Image
    x: Array  # (frame,) [px]
    y: Array
    light: Array  # (frame,), relative light
    bat: Array  # (frame,), x of the edge that faces the ball [px]
    contact: tuple[float, float]  # position of the center [px]
    velocity_in: tuple[float, float]  # velocity at contact [m/s]
    velocity_out: tuple[float, float]

    @property
    def efficiency(self) -> float:
        """Ratio e_A of the speeds along x, across the bat, for a bat at rest."""
        return -self.velocity_out[0] / self.velocity_in[0]


def make_shot(kind: Kind, seed: int) -> Shot:
    """Return a shot with random speed, e_A, directions, spins, seams and noise."""
    rng = np.random.default_rng(seed)
    speed, ratio = rng.uniform(26.8, 60.0), rng.uniform(0.15, 0.40)
    heading, rebound = np.radians(rng.normal(0, 0.2)), np.radians(rng.normal(0, 1.0))
    velocity_in = speed * np.array([np.cos(heading), np.sin(heading)])
    velocity_out = ratio * speed * np.array([-np.cos(rebound), np.sin(rebound)])
    spin_in, spin_out = (rng.normal(0, spin, 3) for spin in SPIN)
    contact = np.array([908.0, 400.0]) + rng.uniform(-3, 3, 2)
    times, places = _frames(kind, contact, velocity_in, velocity_out, rng.uniform(0, 1))
    facing = _turn(rng.normal(0, 2.0, 3))
    wide = 2 * ceil(kind.radius + 16)
    corners = np.round(places).astype(int) - wide // 2
    light = 1 + kind.flicker * np.sin(2 * np.pi * (100 * times + rng.uniform()))
    bat = contact[0] + kind.radius + kind.scale * 0.08 * speed * np.maximum(times, 0)
    regions = []
    for k, (time, place, corner) in enumerate(zip(times, places, corners, strict=True)):
        v, spin = (velocity_in, spin_in) if time < 0 else (velocity_out, spin_out)
        way = kind.scale * kind.exposure * _now(v, time)
        electrons, share = drawn(
            kind, (wide, wide), place - corner, way, _turn(spin * time) @ facing
        )
        inside = tuple(slice(c, c + wide) for c in corner[::-1])
        mean = _empty(kind)[inside] * (1 - share) + electrons
        _lay_bat(mean, kind, bat[k] - corner[0])
        regions.append(_grey(kind, light[k] * mean, rng))
    return Shot(
        kind=kind,
        times=times,
        corners=corners,
        regions=np.array(regions),
        background=_background(kind, float(bat[0])),
        x=places[:, 0],
        y=places[:, 1],
        light=light,
        bat=bat,
        contact=(float(contact[0]), float(contact[1])),
        velocity_in=(float(velocity_in[0]), float(velocity_in[1])),
        velocity_out=(float(velocity_out[0]), float(velocity_out[1])),
    )


def strip(shot: Shot, first: int, rows: int) -> Iterator[NDArray[np.uint16]]:
    """Yield `rows` rows, from row `first` on, of each whole frame with its region."""
    rng = np.random.default_rng(2)
    high, wide = shot.regions.shape[1:]
    for k, (column, row) in enumerate(shot.corners):
        mean = _empty(shot.kind)[first : first + rows].copy()
        _lay_bat(mean, shot.kind, shot.bat[k])
        frame = _grey(shot.kind, shot.light[k] * mean, rng)
        frame[row - first : row - first + high, column : column + wide] = shot.regions[k]
        yield frame


def empties(kind: Kind, count: int) -> NDArray[np.uint16]:
    """Return the middle of `count` frames without ball and bat, (frame, row, column)."""
    rng = np.random.default_rng(3)
    return np.stack([_grey(kind, _empty(kind)[300:500], rng) for _ in range(count)])


def efficiency(shot: Shot, x: Array, u: Array) -> float:
    """Return e_A from x with known drag, by which exp(drag x) is a straight line in time.

    Positions are weighted by their uncertainties; frames whose x is NaN are left out.
    """
    drag = DRAG / shot.kind.scale
    straight = np.expm1(np.array([1, -1])[:, None] * drag * (x - shot.contact[0])) / drag
    finite = np.isfinite(x)
    into, away = (
        np.polyfit(shot.times[side], values[side], 1, w=1 / u[side])[0]
        for side, values in (
            (finite & (shot.times < 0), straight[0]),
            (finite & (shot.times > 0), straight[1]),
        )
    )
    return float(away / into)


def drawn(
    kind: Kind,
    shape: tuple[int, int],
    place: Array,
    way: Array,
    facing: Array,
) -> tuple[Image, Image]:
    """Return a ball's light [e] and its share of each pixel, both (row, column).

    `place` is the position at the middle of the exposure, `way` the motion during it [px]; `facing`
    turns the camera's axes into the ball's.
    """
    rows, columns = shape
    row = ((np.arange(rows * FINE) + 0.5) / FINE - 0.5).astype(np.float32)[:, None]
    column = ((np.arange(columns * FINE) + 0.5) / FINE - 0.5).astype(np.float32)
    moments = max(1, ceil(float(np.hypot(*way)) / MOVED))
    light = np.zeros((rows * FINE, columns * FINE), np.float32)
    whole = np.zeros_like(light)
    for late in (np.arange(moments) + 0.5) / moments - 0.5:
        x, y = (place + late * way).astype(np.float32)
        across, down = (column - x) / np.float32(kind.radius), (row - y) / np.float32(kind.radius)
        away = np.sqrt(across**2 + down**2)
        share = np.clip(0.5 + (1 - away) * np.float32(kind.radius * FINE), 0, 1)
        whole += share / moments
        light += share * _lit(kind, across, down, away, facing) / moments
    both = []
    for each in (light, whole):
        blurred = cv2.GaussianBlur(each, (0, 0), kind.blur * FINE)
        both.append(blurred.reshape(rows, FINE, columns, FINE).mean(axis=(1, 3)))
    return both[0], both[1]


def _lit(kind: Kind, across: Image, down: Image, away: Image, facing: Array) -> Image | float:
    """Return the light of the surface [e]."""
    if kind.ambient == 1:  # light from all directions
        return ALBEDO * kind.white
    toward = -np.sqrt(np.maximum(0, 1 - away**2))
    lamp = np.array(kind.lamp) / np.linalg.norm(kind.lamp)
    slant = across * lamp[0] + down * lamp[1] + toward * lamp[2]
    direct = np.maximum(0, slant + kind.wrap) / (1 + kind.wrap)
    light = ALBEDO * kind.white * (kind.ambient + (1 - kind.ambient) * direct)
    if not kind.seams:
        return light.astype(np.float32)
    turned = [
        np.float32(f[0]) * across + np.float32(f[1]) * down + np.float32(f[2]) * toward
        for f in facing
    ]
    colatitude = np.arccos(np.clip(turned[2], -1, 1)) * np.float32(TABLE[0] / np.pi) - 0.5
    longitude = np.arctan2(turned[1], turned[0]) * np.float32(TABLE[1] / 2 / np.pi)
    longitude += TABLE[1] / 2 + 0.5  # table with an extra column from the opposite end on each side
    seam = cv2.remap(_seams(), longitude, colatitude, cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
    return (light * (1 - kind.seams * seam)).astype(np.float32)


@cache
def _seams() -> Image:
    """Return the share of seam at points of the ball, over colatitude and longitude."""
    t = np.linspace(0, 4 * np.pi, 3000, endpoint=False)
    curve = _on_ball(np.pi / 2 - (np.pi / 2 - NECK) * np.cos(t), t / 2 + BEND * np.sin(2 * t))
    rows, columns = TABLE
    colatitude = (np.arange(rows) + 0.5)[:, None] / rows * np.pi
    longitude = ((np.arange(columns) + 0.5) / columns * 2 - 1) * np.pi
    nearest, _ = cKDTree(curve).query(_on_ball(*np.broadcast_arrays(colatitude, longitude)))
    table = (1 / (1 + np.exp((nearest - SEAM) / SOFTNESS))).astype(np.float32)
    return np.concatenate([table[:, -1:], table, table[:, :1]], axis=1)


def _on_ball(colatitude: Array, longitude: Array) -> Array:
    aside = np.sin(colatitude)
    return np.stack([aside * np.cos(longitude), aside * np.sin(longitude), np.cos(colatitude)], -1)


def _frames(
    kind: Kind, contact: Array, velocity_in: Array, velocity_out: Array, phase: float
) -> tuple[Array, Array]:
    """Return times and positions of the frames in which the whole ball is clear of the contact."""
    numbers = np.arange(-kind.most_in, kind.most_out + 1)
    times = (numbers + phase) / kind.fps
    places = np.where(
        (times < 0)[:, None],
        _places(kind, contact, velocity_in, times),
        _places(kind, contact, velocity_out, times),
    )
    margin = kind.radius + 20
    visible = (places[:, 0] > margin) & (np.abs(times) > kind.exposure)
    before, after = (np.flatnonzero(visible & side) for side in (times < 0, times > 0))
    chosen = np.concatenate([before[-kind.most_in :], after[: kind.most_out]])
    return times[chosen], places[chosen]


def _places(kind: Kind, contact: Array, velocity: Array, times: Array) -> Array:
    speed = np.hypot(*velocity)
    gone = np.log1p(DRAG * speed * times) / DRAG
    return contact + kind.scale * gone[:, None] * velocity / speed


def _now(velocity: Array, time: float) -> Array:
    """Return the velocity at a time, given that at contact."""
    return velocity / (1 + DRAG * np.hypot(*velocity) * time)


def _turn(angles: Array) -> Array:
    return cv2.Rodrigues(np.asarray(angles, float))[0]


@cache
def _empty(kind: Kind) -> Image:
    """Return the light of the background [e], (row, column)."""
    columns, rows = SIZE
    across, down = (np.linspace(-0.5, 0.5, n) * s for n, s in zip(SIZE, kind.slope, strict=True))
    return (kind.behind * (1 + across + down[:, None])).astype(np.float32).reshape(rows, columns)


def _background(kind: Kind, bat: float) -> Image:
    """Return the mean of frames without a ball [gray values]."""
    mean = _empty(kind).copy()
    _lay_bat(mean, kind, bat)
    noise = np.random.default_rng(0).standard_normal(mean.shape, np.float32)
    return kind.black + kind.gain * (mean + np.sqrt((mean + kind.read**2) / EMPTY) * noise)


def _lay_bat(mean: Image, kind: Kind, edge: float) -> None:
    """Draw the barrel, a band 66 mm wide from `edge` on, into a region."""
    column = np.arange(mean.shape[1], dtype=np.float32)
    wide = np.float32(0.066 * kind.scale)
    share = np.clip(column - edge + 0.5, 0, 1) * np.clip(edge + wide - column + 0.5, 0, 1)
    bat = 0.15 * ALBEDO * kind.white
    mean[:] = mean * (1 - share) + bat * share


def _grey(kind: Kind, mean: Image, rng: np.random.Generator) -> NDArray[np.uint16]:
    electrons = rng.poisson(mean) + kind.read * rng.standard_normal(mean.shape, np.float32)
    grey = np.round(kind.black + kind.gain * electrons)
    return np.clip(grey, 0, 2**kind.bits - 1).astype(np.uint16)
