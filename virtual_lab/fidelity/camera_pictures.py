"""Rendering of the pictures of a case, with their true values."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from virtual_lab import catalog
from virtual_lab.fidelity.camera_scenes import FULL_SCALE, Batch, Case, EstimatorInput
from virtual_lab.simulation.instruments.camera.ball import Light, axes_of, render_balls
from virtual_lab.simulation.instruments.camera.sensor import Sensor
from virtual_lab.simulation.instruments.camera.spec import BallLook, CameraSpec, SensorSpec
from virtual_lab.streams import Slots, Streams
from virtual_lab.units import Array
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.source import Source
from virtual_lab.video.locate.located import Located, Regions
from virtual_lab.video.locate.noise import ROUNDING


@dataclass(frozen=True, slots=True)
class CaseSettings:
    """Settings that all cases share."""

    frame: tuple[int, int] = (800, 1280)  # rows, columns
    lens: float = 0.65  # standard deviation of the blur [px]
    bat: float = 110.0  # gray value [DN]
    albedo: float = 0.85  # albedo of the ball
    seam: float = 0.6  # relative darkness of the seam
    turn: tuple[float, float, float] = (0.001, -0.002, 0.003)  # per exposure [rad], as at 1500 rpm
    empty: int = 32  # number of frames for the background


CASE = CaseSettings()


def pictures(case: Case, seed: int = 1, block: int = 0) -> Batch:
    """Return simulated pictures of a case, with the true positions of the ball.

    The center of the ball is at `case.phases` different fractions of a pixel. There are
    `case.repeats` pictures for each fraction.

    Parameters
    ----------
    case
        Conditions of the pictures.
    seed
        Seed of the random numbers.
    block
        Number of the set of pictures, from 0. Different sets have different random numbers. The
        random numbers determine, for example, the noise, the position of the picture in the frame,
        and the orientation of the ball.
    """
    draws, side = Streams(seed), case.side
    count, middle = case.phases * case.repeats, (side - 1) / 2
    slots = block * count + np.arange(count)
    steps = np.repeat(np.arange(case.phases), case.repeats)
    centres = middle - 0.5 + np.stack([steps / case.phases, (0.37 * steps) % 1], axis=1)
    mean, behind = _means(case, centres, draws, slots)
    burn = case.exposure * (1 + 2 * case.flicker * draws.uniform("flicker", slots=slots))
    mean, behind = mean * burn[:, None, None], behind * case.exposure
    pixels, samples, empty = _expose(case, mean, behind, draws, slots, block)
    for picture, places in zip(pixels, draws.uniform("hot", case.hot, slots) + 0.5, strict=True):
        picture.flat[(places * picture.size).astype(int)] = FULL_SCALE
    columns = int(middle + case.radius * (1 - 2 * case.cut)) + 1 if case.cut else side
    corners = _corners(case, draws, (side, columns), slots)
    regions = Regions(
        pixels=np.ascontiguousarray(pixels[..., :columns]),
        background=np.ascontiguousarray(empty[..., :columns], np.float32),
        corners=corners,
    )
    x, y = (centres + corners).T
    inputs = EstimatorInput(
        clip=_clip(samples),
        regions=regions,
        start=_start(case, x, y, draws, slots),
        noise=case.noise,
        lens=CASE.lens,
    )
    return Batch(inputs=inputs, x=x, y=y, limit=case.limit(CASE.lens))


def _means(case: Case, centres: Array, draws: Streams, slots: Slots) -> tuple[Array, Array]:
    """Return expected gray values [DN] with the balls at `centres`, and without them."""
    side, count = case.side, len(centres)
    middle = (side - 1) / 2
    balls = render_balls(
        centres[:, None] + np.array(case.shift) / 2 * np.array([[-1.0], [1.0]]),
        case.radius,
        np.zeros((count, 2)),
        (side, side),
        sigma=CASE.lens,
        look=BallLook(albedo=CASE.albedo, seam_contrast=CASE.seam if case.stitched else 0.0),
        light=_light(case.light),
        orientation=axes_of(2 * draws.normal("axes", 3, slots)),
        turn=CASE.turn,
    )
    ball, level = case.levels
    behind = np.broadcast_to(level + case.slope * (np.arange(side) - middle), (side, side))
    mean = np.asarray(balls.over(behind, ball / CASE.albedo), np.float64)
    if not case.covered:
        return mean, behind
    edge = middle + case.radius * (1 - 2 * case.covered)
    share = ndtr((np.arange(side) - edge) / sqrt(CASE.lens**2 + 1 / 12))
    return mean + share * (CASE.bat - mean), behind + share * (CASE.bat - behind)


def _light(name: str) -> Light:
    """Return the light with this name: the light of a camera in the catalog, or uniform light."""
    if name in ("even", "back"):
        return Light()
    camera = {"soft": "camera-overhead", "hard side": "camera-side-lit"}[name]
    light = catalog.load("instruments", camera, CameraSpec).spec.light
    x, y, z = np.array(light.toward) / np.linalg.norm(light.toward)
    toward = float(x), -float(y), -float(z)
    return Light(ambient=light.ambient, toward=toward, softness=light.softness)


def _expose(
    case: Case, mean: Array, behind: Array, draws: Streams, slots: Slots, block: int
) -> tuple[NDArray[Any], NDArray[np.uint8], Array]:
    """Return exposed pictures [DN], pictures without the ball, and the background [DN]."""
    noise, side = case.noise, mean.shape[1]
    spec = SensorSpec(
        columns=side,
        rows=side,
        pixel=20e-6,
        quantum_efficiency=1.0,
        full_well=1e9,
        gain=noise.gain,
        gain_u=0.0,
        read_noise=sqrt(noise.read - ROUNDING) / noise.gain,
        dark_current=0.0,
        photo_response=0.0,
        dark_signal=0.0,
        black_level=0.0,
        bits=8,
    )
    sensor = Sensor.commission(spec, draws, "sensor")

    def grey(mean: Array, name: str, slots: Slots) -> NDArray[np.uint8]:
        corners = np.zeros((len(mean), 2), np.int64)
        counts = sensor.expose(mean / noise.gain, corners, draws, name, slots)
        return np.asarray(counts, np.uint8)

    empty = block * CASE.empty + np.arange(CASE.empty)
    samples = grey(np.broadcast_to(behind, (len(empty), side, side)), "samples", empty)
    if case.quiet:
        return mean, samples, np.broadcast_to(behind, mean.shape)
    spread = np.sqrt(noise.variance(behind) / len(empty))
    return (
        grey(mean, "pictures", slots),
        samples,
        behind + spread * draws.normal("empty", mean.shape[1:], slots),
    )


def _corners(case: Case, draws: Streams, shape: tuple[int, int], slots: Slots) -> Array:
    """Return the upper left corners of the regions [px], shape (picture, 2).

    For a cut ball, the regions are at the edge of the frame.
    """
    space = np.array([CASE.frame[1] - shape[1], CASE.frame[0] - shape[0]])
    share = draws.uniform("corners", 2, slots) + 0.5
    corners: Array = np.floor(share * (space + 1))
    if case.cut:
        corners[:, 0] = space[0]
    return corners


def _start(case: Case, x: Array, y: Array, draws: Streams, slots: Slots) -> Located:
    errors = 2 * case.start_off * draws.uniform("start", 2, slots).T
    places = np.stack([x + errors[0], y + errors[1]], axis=1)
    return Located.start(places, case.radius * (1 + case.radius_off), np.array(case.shift))


def _clip(samples: NDArray[np.uint8]) -> Clip:
    """Return a clip without frames. It has only sample pictures for the noise estimate."""
    return Clip(
        source=Source(path=Path("made"), declared=0, read=lambda *_: iter(())),
        times=np.zeros(0),
        shape=CASE.frame,
        full_scale=FULL_SCALE,
        samples=samples,
        sampled=np.arange(len(samples)),
        warnings=(),
    )
