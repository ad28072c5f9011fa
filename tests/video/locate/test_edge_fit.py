"""The edge fit against rendered balls, and its tables and solver against closed forms."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.integrate import quad
from scipy.special import ndtr

from tests.video.plain import FIELD, Balls, balls
from tests.video.spectrum import disc
from tests.video.stitched import LENS, Array, Scene, scene
from virtual_lab.video.locate.edge_fit import RIM_FIT, fit_edge, hidden_share, solve_ring
from virtual_lab.video.locate.edge_kernel import View
from virtual_lab.video.locate.located import Located, PlaceFlag, Regions
from virtual_lab.video.locate.noise import Noise
from virtual_lab.video.locate.rim_profiles import AT, TABLE, blurred_profiles


def fitted(sample: Scene, **options: Any) -> Located:
    """Return the fit of balls with circular outlines; keywords replace the arguments of the fit."""
    arguments = {"start": sample.start(), "oval_u": 0.0} | options
    regions = arguments.pop("regions", sample.regions)
    return fit_edge(regions_of(regions, 1.0), **arguments, noise=sample.noise, lens=LENS)


def regions_of(pixels: Array, behind: ArrayLike) -> Regions:
    """Return regions at the corner of the frame; `behind` is the background up to a factor."""
    background = np.broadcast_to(behind, pixels.shape).astype(np.float32)
    return Regions(pixels=pixels, background=background, corners=np.zeros((len(pixels), 2)))


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def errors(sample: Scene, fit: Located) -> tuple[Array, Array]:
    """Return the errors (2, region) [pixel], and the errors divided by their uncertainties."""
    off = np.stack([fit.x - sample.x, fit.y - sample.y])
    return off, off / np.hypot([fit.x_u, fit.y_u], fit.pattern_u)


@pytest.mark.parametrize(
    ("light", "blur", "worst", "least"),
    [
        # lower limits of 0.5: the u of every position allows for seams at the rim, which are rare
        ("soft", 0, 0.010, 0.5),
        pytest.param("soft", 2, 0.010, 0.5, marks=pytest.mark.long),  # light and blur of ellipses
        ("soft", 6, 0.020, 0.6),
        ("back", 2, 0.005, 0.6),
        ("side", 0, 0.08, 0.6),
        ("side", 6, 0.10, 0.6),
    ],
)
def test_a_stitched_ball_is_located_within_its_u(
    light: str, blur: float, worst: float, least: float
) -> None:
    """For 100 balls, the rms error is below its limit, and the errors agree with the stated u."""
    sample = scene(light, blur)
    fit = fitted(sample)
    assert (fit.flags > 0).mean() <= 0.01
    off, pulls = errors(sample, fit)
    assert max(map(rms, off)) < worst
    assert least < rms(pulls) < 1.5
    assert np.median(np.abs(pulls)) < 1.2


@pytest.mark.parametrize("hidden", [0.0, 0.3, 0.5])
def test_the_hidden_share_of_a_rim_is_found(hidden: float) -> None:
    """An object that hides the rim is in the background, too; the oracle is its part of a ring."""
    side, radius, middle = 101, 36.0, 50.0
    rows, columns = np.mgrid[:side, :side]
    back = np.where(columns > middle + radius * np.cos(np.pi * hidden), 110.0, 40.0)
    away = np.hypot(columns - middle, rows - middle)
    region = np.where((away < radius) & (back < 100), 190.0, back)
    noise = Noise(gain=0.0, read=4.0)
    p = np.zeros(len(AT))
    p[[AT.x, AT.y, AT.radius, AT.level]] = middle, middle, radius, 1.0
    share = hidden_share(View(region, back, np.zeros(2)), p, noise)
    # angle of the ring, whose middle lies 3 pixels inside the rim and meets the chord later
    ring = np.arccos(np.cos(np.pi * hidden) * radius / (radius - 3)) / np.pi if hidden else 0.0
    assert share == pytest.approx(ring, abs=0.01)
    dim = np.where(region > 180, 40.0 + 10 * 2, region)  # contrast of 10 sigma with the background
    assert hidden_share(View(dim, back, np.zeros(2)), p, noise) == 0.0


def test_a_plain_ball_costs_no_more_than_twice_its_bound() -> None:
    """For a plain ball, the fitted strength of the pattern is zero."""
    sample = scene("soft", seams=0.0, count=50)
    off, pulls = errors(sample, fitted(sample))
    assert max(map(rms, off)) < 2 * 0.0023  # bound of the occlusion model
    assert rms(pulls) < 1.2


@pytest.mark.parametrize("blur", [0, 2, 30])
def test_a_plain_ball_has_no_bias(blur: float) -> None:
    """Without noise, from the exact spectrum, at every phase of a pixel, before a slope too."""
    for slope in (0.0, 0.5):
        sample = balls(15, blur, 96, slope=slope, phases=8, repeats=1, noisy=False)
        fit = plain(sample)
        assert np.abs(fit.x - sample.x).max() < 0.003
        assert np.abs(fit.y - sample.y).max() < 0.003


def test_hot_pixels_do_not_bias_a_position() -> None:
    """Each region has 100 hot pixels at 250 DN."""
    sample = balls(30, 2, 96, repeats=10)
    random = np.random.default_rng(3)
    for region in sample.regions:
        region.flat[random.choice(region.size, 100, replace=False)] = 250.0
    fit = plain(sample)
    assert rms(fit.x - sample.x) < 0.006


def test_full_scale_is_flagged_and_does_no_harm() -> None:
    """Gray values are clipped well below the ball; the lower part of the edge still places it."""
    sample = balls(30, 2, 96, repeats=10)
    noise = Noise(gain=sample.noise.gain, read=sample.noise.read, full_scale=150.0)
    fit = plain(replace(sample, regions=np.minimum(sample.regions, 150.0), noise=noise))
    flagged = fit.flags & (PlaceFlag.SATURATED | PlaceFlag.NOT_FOUND)
    assert flagged.all()
    assert rms((fit.x - sample.x)[np.isfinite(fit.x)]) < 0.05


def test_a_known_background_may_become_brighter() -> None:
    """The background is a known pattern, and is 10 % brighter than when it was recorded."""
    sample = balls(30, 2, 96, repeats=5)
    size = sample.regions.shape[1]
    pattern = 1 + 0.4 * np.sin(np.arange(size) / 5.0) * np.cos(np.arange(size) / 7.0)[:, None]
    regions = []
    random = np.random.default_rng(5)
    off = (FIELD - size) // 2
    for x, y in zip(sample.x, sample.y, strict=True):
        m = disc(FIELD, x + off, y + off, 30, 0.8, sample.blur)[off:-off, off:-off][:size, :size]
        mean = 44.0 * pattern * (1 - m) + 190 * m
        regions.append(
            mean + random.standard_normal(m.shape) * np.sqrt(sample.noise.variance(mean))
        )
    fit = plain(replace(sample, regions=np.array(regions)), behind=40 * pattern)
    assert not fit.flags.any()
    assert rms(fit.x - sample.x) < 0.006


def plain(sample: Balls, behind: ArrayLike = 1.0) -> Located:
    """Return the fit of plain balls."""
    regions = regions_of(sample.regions, behind)
    return fit_edge(regions, sample.start(), noise=sample.noise, lens=0.8)


def test_elliptic_outlines_are_located() -> None:
    """Outlines are 4 % longer along one axis, which is given to the fit or found by it."""
    sample = scene("soft", stretch=1.04)
    oval = (1.04 - 1) / (1.04 + 1) * np.array([np.cos(np.pi / 3), np.sin(np.pi / 3)])
    off, _ = errors(sample, fitted(sample, oval=oval))
    assert max(map(rms, off)) < 0.010
    assert max(map(rms, errors(sample, fitted(sample, oval_u=0.02))[0])) < 0.016
    sample = scene("soft", stretch=1.01)
    fit = fitted(sample, oval_u=RIM_FIT.oval_u)
    off, pulls = errors(sample, fit)
    assert max(map(rms, off)) < 0.015
    assert rms(pulls) < 1.5


def test_a_ball_cut_by_the_frame_is_flagged_and_located() -> None:
    """A quarter of the ball is outside the frame; the median error is below 0.01 px."""
    sample = scene("soft")
    end = int(sample.x.mean() + 15)
    fit = fitted(sample, regions=sample.regions[:, :, :end])
    assert (fit.flags == PlaceFlag.CLIPPED).all()
    off, pulls = errors(sample, fit)
    assert np.median(np.abs(off[0])) < 0.010
    assert rms(pulls) < 1.6


def test_noise_without_a_ball_gives_no_position() -> None:
    """Regions with noise only, and a region with an unknown start, give no position."""
    sample = scene("soft", count=20)
    empty = np.random.default_rng(2).normal(40.0, 1.5, sample.regions.shape)
    fit = fitted(sample, regions=empty)
    assert (fit.flags > 0).all()
    assert np.isnan(fit.x).mean() > 0.9
    start = sample.start()
    start.x[3] = np.nan
    assert fitted(sample, start=start).flags.tolist() == [
        int(PlaceFlag.NOT_FOUND) if k == 3 else 0 for k in range(20)
    ]


def test_tables_have_closed_forms() -> None:
    """The edge of an even level is the normal distribution; that of a linear fall, its integral."""
    radius, width = 20.0, 0.8
    table = blurred_profiles(radius, width, 6.0, 0.0).table
    t = -TABLE.widths + np.arange(len(table)) / TABLE.per_width
    density = np.exp(-(t**2) / 2) / np.sqrt(2 * np.pi)
    columns = table.shape[1] // 2
    near = t < 8
    level, falls = ndtr(t), ndtr(t) - width / radius * (t * ndtr(t) + density)
    assert np.abs(table[:, 0] - level)[near].max() < 3e-4
    assert np.abs(table[:, columns] - density)[near].max() < 1e-3
    assert np.abs(table[:, 1] - falls)[near].max() < 3e-4
    # sum of the pattern's knots, which is the whole ball
    assert np.abs(table[:, 3:columns].sum(axis=1) - table[:, 0]).max() < 1e-9
    # facing of a sphere's surface, blurred
    for entry in (130, 180, 300):

        def facing(d: float, at: float = t[entry]) -> float:
            weight = np.exp(-((at - d / width) ** 2) / 2) / np.sqrt(2 * np.pi) / width
            return float(np.sqrt(1 - (1 - d / radius) ** 2) * weight)

        blurred = quad(facing, 0, 0.2)[0] + quad(facing, 0.2, 12)[0]
        assert table[entry, 2] == pytest.approx(blurred, abs=3e-4)


def test_a_ring_of_blocks_is_solved_like_a_full_matrix() -> None:
    """A random system of the same block structure is solved by numpy, too."""
    random = np.random.default_rng(4)
    for count in (5, 6):
        n, total, shared = 3, 3 * count, 4
        near = [[(3 * k + i) % total for i in range(2 * n)] for k in range(count)]
        design = np.zeros((count, 12, total + shared))
        for part, index in zip(design, near, strict=True):
            part[:, [*index, *range(total, total + shared)]] = random.normal(size=(12, 10))
        whole = np.einsum("kri,krj->ij", design, design)
        blocks = np.array([whole[np.ix_(index[:n], index[:n])] for index in near])
        links = np.array([whole[np.ix_(index[:n], index[n:])] for index in near])
        right = np.zeros((total + shared, 4))
        right[:, 0], right[total : total + 3, 1:] = random.normal(size=total + shared), np.eye(3)
        exact = np.linalg.solve(whole, right)
        sides = np.column_stack([whole[:, total:], right[:, 0]])
        ring, alone = solve_ring(blocks, links, sides[:total].reshape(count, n, -1), sides[total:])
        assert np.concatenate([ring.reshape(total, 4), alone]) == pytest.approx(exact, rel=1e-9)
